//! Containers: files that put meshes and simple shapes together into the links of a robot or the bodies of a scene, and that
//! state masses, inertias and frictions. [`read`] turns each format into the same [`Container`]:
//! - [`urdf`]: a tree of links;
//! - [`mjcf`]: MuJoCo's bodies, after includes, default classes and the compiler's settings;
//! - `gltf`: the rigid bodies of a glTF or GLB;
//! - `usd`: those of a USD in text.
//!
//! [`xml`] keeps the place of everything, so that each value can be named by line and replaced byte for byte;
//! [`write`] does the latter;
//! `files` finds the file that a name stands for and refuses what lies outside of the folders that the user named.

mod error;
mod files;
mod frame;
mod gltf;
pub mod mjcf;
pub mod numbers;
pub mod urdf;
mod usd;
pub mod write;
pub mod xml;

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::{MeshFormat, Triangles};
use crate::files::read_scope::ReadScope;

pub use error::{Broken, ContainerError};
pub use files::FileProblem;

/// True if the file at `path` is a URDF or an MJCF by its name.
pub fn is_robot(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    ending.is_some_and(|ending| ["urdf", "xml"].contains(&ending.as_str())) && path.is_file()
}

/// A format of containers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    Urdf,
    Mjcf,
    Gltf,
    Usd,
}

impl Format {
    pub fn name(self) -> &'static str {
        match self {
            Self::Urdf => "URDF",
            Self::Mjcf => "MJCF",
            Self::Gltf => "glTF",
            Self::Usd => "USD",
        }
    }
}

/// What a container says. Lengths in metres, in the frame of each body; masses in kilograms.
#[derive(Debug)]
pub struct Container {
    pub format: Format,
    /// As the file names itself; empty if it does not.
    pub name: String,
    /// The files that were read: the container, then what it includes.
    pub sources: Vec<PathBuf>,
    /// In the order of the file.
    pub bodies: Vec<Body>,
    pub joints: Vec<Joint>,
    /// To which MuJoCo scales the masses of all bodies together; `None` if it leaves them.
    pub total_mass_kg: Option<f64>,
    /// What could not be read, apart from what belongs to a body.
    pub problems: Vec<Problem>,
}

/// Where something is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// An index of [`Container::sources`].
    pub source: usize,
    /// Counted from 1.
    pub line: usize,
    /// The bytes of the element's start tag.
    pub bytes: Range<usize>,
}

/// Something in a container that its readers would refuse or misread.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    pub place: Place,
    pub text: String,
}

/// A link of a URDF, a body of an MJCF.
#[derive(Debug)]
pub struct Body {
    pub name: String,
    pub place: Place,
    /// An index of [`Container::bodies`].
    pub parent: Option<usize>,
    pub mobility: Mobility,
    /// What the file states; `None` if it states nothing.
    pub inertial: Option<Inertial>,
    pub shapes: Vec<Shape>,
    /// Sliding friction that is stated for all of its shapes.
    pub friction: Option<Friction>,
    pub problems: Vec<Problem>,
}

/// How a body can move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mobility {
    /// By a joint of its own, or freely.
    Moves,
    /// With its parent, to which it is fixed.
    Fixed,
    /// Not at all: it is the world, or fixed to it.
    Static,
}

/// The inertial properties that a file states for a body.
#[derive(Debug, Clone)]
pub struct Inertial {
    pub place: Place,
    pub mass_kg: Option<f64>,
    /// Its origin is the centre of mass; its axes are those of `inertia_kg_m2`.
    pub body_from_inertial: Isometry3<f64>,
    /// False if the file leaves the centre of mass to its reader.
    pub states_center: bool,
    /// About the centre of mass.
    pub inertia_kg_m2: Option<Matrix3<f64>>,
    /// Where the inertia is written; the place of the inertial properties if it is not.
    pub inertia_place: Place,
}

impl Inertial {
    /// The centre of mass in the body's frame, m.
    pub fn center_m(&self) -> Vector3<f64> {
        self.body_from_inertial.translation.vector
    }

    /// The inertia about the centre of mass along the body's axes.
    pub fn inertia_in_body(&self) -> Option<Matrix3<f64>> {
        let rotation = self.body_from_inertial.rotation.to_rotation_matrix();
        Some(rotation.matrix() * self.inertia_kg_m2? * rotation.matrix().transpose())
    }
}

/// A coefficient of sliding friction.
#[derive(Debug, Clone, PartialEq)]
pub struct Friction {
    pub place: Place,
    pub coefficient: f64,
}

/// What a shape is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    Visual,
    Collision,
    /// MuJoCo draws what collides.
    Both,
}

impl Role {
    pub fn is_seen(self) -> bool {
        self != Self::Collision
    }

    pub fn collides(self) -> bool {
        self != Self::Visual
    }
}

/// A shape of a body.
#[derive(Debug, Clone)]
pub struct Shape {
    pub name: Option<String>,
    pub place: Place,
    pub role: Role,
    pub geometry: Geometry,
    pub body_from_shape: Isometry3<f64>,
    pub friction: Option<Friction>,
    /// What the shape adds to the mass of a body that states none.
    pub mass: ShapeMass,
}

/// What a shape weighs, if its body states no mass itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ShapeMass {
    /// Nothing: the format gives shapes no mass, or this shape is left out.
    None,
    StatedKg(f64),
    /// Stated for the shape or its class, kg/m3.
    Density(f64),
    /// The format's own density, which nobody stated, kg/m3.
    DefaultDensity(f64),
}

/// A geometry in its own frame, about its middle; axes along z. Lengths in metres.
#[derive(Debug, Clone, PartialEq)]
pub enum Geometry {
    Box {
        half: [f64; 3],
    },
    Sphere {
        radius: f64,
    },
    Cylinder {
        radius: f64,
        half_length: f64,
    },
    /// The half length is that of the cylinder between the caps.
    Capsule {
        radius: f64,
        half_length: f64,
    },
    Ellipsoid {
        half: [f64; 3],
    },
    /// Without end.
    Plane,
    Mesh(MeshUse),
    /// A mesh in the container itself, in the frame of the body.
    Own(OwnMesh),
    /// What gprop does not measure, by the format's word for it.
    Other(String),
}

/// A mesh as a shape uses it: first moved, then turned, then scaled.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshUse {
    /// As the container names it.
    pub named: String,
    pub file: Result<PathBuf, FileProblem>,
    pub scale: [f64; 3],
    /// The mesh's own frame before the scale: MuJoCo's `refpos` and `refquat`.
    pub reference: Isometry3<f64>,
}

/// A mesh in a container.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnMesh {
    pub file: PathBuf,
    /// Tells the meshes of the container apart.
    pub number: usize,
    pub surface: Arc<Triangles>,
}

/// A joint between two bodies.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    pub name: Option<String>,
    pub place: Place,
    /// The format's word for its kind.
    pub kind: String,
    /// Indices of [`Container::bodies`]; `None` is the world.
    pub parent: Option<usize>,
    pub child: usize,
}

/// Reads the container at `path`; its meshes are named, not read.
///
/// # Errors
/// [`ContainerError`] if the file cannot be read at all. What is wrong with a body or a shape is in the container's problems.
pub fn read(path: &Path, scope: &ReadScope) -> Result<Container, ContainerError> {
    if MeshFormat::of(path).is_some_and(|format| format.is_y_up) {
        return gltf::read(path, scope);
    }
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("usda")) {
        return usd::read(path, &bytes_of(path)?);
    }
    let document = document(path)?;
    match document.root().name() {
        "robot" => urdf::read(path, &document, scope),
        "mujoco" | "mujocoinclude" => mjcf::read(path, document, scope),
        other => {
            let found = format!("its root element is <{other}>");
            Err(ContainerError::NotAContainer { path: path.to_owned(), found })
        }
    }
}

/// The most bytes of a container in text: more than the limits of [`xml`] allow to be useful.
const MOST_BYTES: usize = 256 << 20;

/// The XML document at `path`.
fn document(path: &Path) -> Result<xml::Document, ContainerError> {
    xml::Document::parse(bytes_of(path)?).map_err(|broken| broken.of(path))
}

fn bytes_of(path: &Path) -> Result<Vec<u8>, ContainerError> {
    let unreadable = |source| ContainerError::Unreadable { path: path.to_owned(), source };
    let bytes = crate::files::read(path).map_err(unreadable)?;
    if bytes.len() > MOST_BYTES {
        return Err(Broken::new(1, "it has more than 256 MiB, which no container needs").of(path));
    }
    Ok(bytes)
}
