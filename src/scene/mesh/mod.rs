//! Meshes: surfaces of triangles that people already have, instead of splats.
//!
//! [`read`] selects the reader by the file's name, one file for each format: `gltf` (glTF and GLB), `obj` (with its MTL),
//! `stl` and `ply`. All of them fill an `assembly`, which checks every index, number and count as it comes, so that a
//! [`Mesh`] is sound whatever the file held. What a file names beside itself is opened by `beside`, under the rule that
//! holds for scenes: nothing outside its folder, unless the user allowed it.
//!
//! A scene is made of a mesh in two more steps: [`PaintedMesh`] decodes its pictures and knows the colour of each point of the
//! surface; [`sample`] covers the surface with flat Gaussians.
//!
//! What the format knows and gprop does not use is told in [`Mesh::notes`]; what it could not read, though a picture may
//! look different for it, in [`Mesh::warnings`].

mod assembly;
mod beside;
mod connected;
mod error;
pub mod gltf;
mod obj;
mod painted;
mod ply;
mod polygon;
mod problems;
mod sampled;
mod stl;
mod texture;

use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Rotation3};

use crate::files::read_scope::ReadScope;
use beside::Beside;

pub use assembly::{MOST_SHAPES, MOST_TRIANGLES, MOST_VERTICES};
pub use beside::MOST_BYTES;
pub use connected::surface_of_triangles;
pub use error::{MeshError, Problem};
pub use painted::PaintedMesh;
pub use problems::{GltfProblem, ObjProblem, PlyProblem, StlProblem};
pub use sampled::{GAUSSIANS, SampledSurface, sample};
pub use texture::{Encoded, MOST_TEXTURE_PIXELS, Picture, Wrapping};

pub mod containers;
pub mod solid;

/// A surface of triangles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Triangles {
    /// Positions, in the unit and frame that the owner of the surface names.
    pub vertices: Vec<[f64; 3]>,
    /// Three indices of [`vertices`](Self::vertices) each, anticlockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// A mesh as a file holds it, with its instances placed and its polygons cut into triangles.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// The surface after all transforms of nodes, in the file's unit and the axes that [`read`] was asked for. Every
    /// index is in range and every position finite. Vertices are those of the file: the two sides of a texture's seam may
    /// have vertices of their own, and triangles without area are kept.
    pub surface: Triangles,
    /// One for each triangle.
    pub faces: Vec<Face>,
    /// Linear red, green, blue and alpha of each vertex, 0 to 1; empty if the file has none.
    pub vertex_colors: Vec<[f32; 4]>,
    /// What the faces look like; never empty.
    pub materials: Vec<Material>,
    /// The encoded pictures of the materials.
    pub pictures: Vec<Picture>,
    /// Number of shapes that the file tells apart: a primitive of a node's mesh, once for each instance (glTF), an object
    /// or group (OBJ), a solid (STL).
    pub shapes: usize,
    /// What the file's author called things. They steer nothing, and are shown to no model unless the user says so.
    pub names: Names,
    /// Metres per unit, if the format says so: 1 for glTF, `None` for the others.
    pub meters_per_unit: Option<f64>,
    /// The primitives of a glTF in the order in which they were placed; empty for other formats.
    pub placed: Vec<PlacedPrimitive>,
    /// The mass that the file states, if its format can, and it does.
    pub claimed_mass_kg: Option<f64>,
    /// Every file that was read, the mesh's own first, and those of the pictures.
    pub files: Vec<PathBuf>,
    /// What the file holds and gprop does not use.
    pub notes: Vec<String>,
    /// What is missing or could not be read, and what was used instead.
    pub warnings: Vec<String>,
}

/// A primitive of a glTF's mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct GltfPrimitive {
    /// Its index in the file.
    pub mesh: usize,
    /// Its index in the mesh.
    pub primitive: usize,
}

/// A primitive where a node or an instance has placed it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlacedPrimitive {
    pub source: GltfPrimitive,
    /// Its vertices among those of the [`Mesh`], in the order of its attributes.
    pub vertices: Range<u32>,
}

/// What is known of a triangle besides its corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Face {
    /// Index of [`Mesh::materials`].
    pub material: u32,
    /// The shape to which it belongs, below [`Mesh::shapes`].
    pub shape: u32,
    /// Texture coordinates of its corners, in the order of the corners: (0, 0) is the picture's upper left corner and (1, 1)
    /// its lower right one. `None` if it has none.
    pub texture_coordinates: Option<[[f32; 2]; 3]>,
}

/// The look of a surface: linear base colour, multiplied by the picture and the vertices' colours.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Linear red, green, blue and alpha, 0 to 1.
    pub base_color: [f32; 4],
    pub texture: Option<Texture>,
    pub alpha: Alpha,
}

/// The picture on a material.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Texture {
    /// Index of [`Mesh::pictures`].
    pub picture: u32,
    /// Along u and v.
    pub wrapping: [Wrapping; 2],
}

/// What a material's alpha means.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Alpha {
    /// Nothing.
    #[default]
    Opaque,
    /// There is no surface where alpha is below this.
    CutBelow(f32),
    /// The surface is transparent to this degree.
    Blend,
}

impl Mesh {
    /// For each material, a number that those of the same base colour and picture share: a file may repeat a material for each
    /// of its shapes.
    pub fn looks(&self) -> Vec<u32> {
        let mut known = HashMap::new();
        let look = |material: &Material| {
            let picture = material.texture.map(|texture| &self.pictures[texture.picture as usize].source);
            let next = known.len() as u32;
            *known.entry((material.base_color.map(f32::to_bits), picture)).or_insert(next)
        };
        self.materials.iter().map(look).collect()
    }
}

impl Default for Material {
    fn default() -> Self {
        Self { base_color: [1.0; 4], texture: None, alpha: Alpha::Opaque }
    }
}

/// Names in a mesh file, each list with one entry per thing; empty where the file gives no name.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Names {
    /// Of [`Mesh::shapes`]: the node or its mesh, the object or group, the solid.
    pub shapes: Vec<String>,
    /// Of [`Mesh::materials`].
    pub materials: Vec<String>,
}

/// The axes in which a mesh is returned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axes {
    /// Those of the file, whatever they are.
    OfFile,
    /// z up: glTF's y axis points up by its specification and is turned, so that `(x, y, z)` becomes `(x, -z, y)`. The
    /// other formats have no rule; they are returned as they are.
    ZUp,
}

/// Turns z up into glTF's y up: `(x, y, z)` becomes `(x, z, -y)`.
pub fn y_up_from_z_up() -> Rotation3<f64> {
    Rotation3::from_matrix_unchecked(Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0))
}

/// A format of meshes.
pub struct MeshFormat {
    /// The ending of its file names in lower case, with the dot.
    pub ending: &'static str,
    read: fn(&[u8], &mut Beside<'_>) -> Result<Mesh, Problem>,
    /// Whether y points up by the format's specification.
    pub is_y_up: bool,
}

/// Every format of meshes that gprop reads.
pub const MESH_FORMATS: &[MeshFormat] = &[
    MeshFormat { ending: ".glb", read: gltf::read, is_y_up: true },
    MeshFormat { ending: ".gltf", read: gltf::read, is_y_up: true },
    MeshFormat { ending: ".obj", read: obj::read, is_y_up: false },
    MeshFormat { ending: ".stl", read: stl::read, is_y_up: false },
    MeshFormat { ending: ".ply", read: ply::read, is_y_up: false },
];

/// The endings of the names of mesh files, for messages.
pub(super) fn endings() -> String {
    MESH_FORMATS.iter().map(|format| format.ending).collect::<Vec<_>>().join(", ")
}

impl MeshFormat {
    /// The format of a file with this name.
    pub fn of(path: &Path) -> Option<&'static Self> {
        let name = path.file_name()?.to_string_lossy().to_lowercase();
        MESH_FORMATS.iter().find(|format| name.len() > format.ending.len() && name.ends_with(format.ending))
    }

    /// The mesh in these bytes, which can name no other files. For the tests of the readers.
    ///
    /// # Errors
    /// [`Problem`].
    pub fn parse(&self, bytes: &[u8]) -> Result<Mesh, Problem> {
        (self.read)(bytes, &mut Beside::nothing())
    }
}

/// Reads the mesh at `path`. The file may name others in its own folder (buffers, materials, textures) and in those that
/// `scope` allows.
///
/// # Errors
/// [`MeshError`], which says which file is affected, what is wrong with it, where, and what to do: among others if there
/// is no triangle, a position is not finite, an index is out of range, the file asks for more than the limits here
/// ([`MOST_VERTICES`], [`MOST_TRIANGLES`], [`MOST_SHAPES`], [`MOST_TEXTURE_PIXELS`], [`MOST_BYTES`]), or it names a file
/// outside.
pub fn read(path: &Path, axes: Axes, scope: &ReadScope) -> Result<Mesh, MeshError> {
    let in_file = |problem| MeshError { path: path.to_owned(), problem };
    let format = MeshFormat::of(path).ok_or_else(|| in_file(Problem::format_of(path)))?;
    let mut beside = Beside::of(path, scope);
    let bytes = beside.own_bytes(path).map_err(in_file)?;
    let mut mesh = (format.read)(&bytes, &mut beside).map_err(in_file)?;
    mesh.files = [vec![path.to_owned()], beside.into_files()].concat();
    if axes == Axes::ZUp && format.is_y_up {
        for [_, y, z] in &mut mesh.surface.vertices {
            (*y, *z) = (-*z, *y);
        }
    }
    Ok(mesh)
}

/// True if the file at `path` is a mesh by its name and, for a PLY, by its faces: most PLY files that gprop meets are splats.
pub fn is_mesh(path: &Path) -> bool {
    MeshFormat::of(path).is_some_and(|format| format.ending != ".ply" || ply::has_faces(path))
}
