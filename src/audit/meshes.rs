//! What is needed of the meshes that containers name. Each file is read and measured once, however many links use it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use super::hull::extremes;
use super::moments::Moments;
use crate::files::read_scope::ReadScope;
use crate::parallel;
use crate::scene::mesh::containers::{Container, Geometry};
use crate::scene::mesh::solid::{self, Topology};
use crate::scene::mesh::{self, Axes, MeshFormat, Triangles};
use crate::units::Estimate;

/// A mesh in its file's own frame and unit.
#[derive(Debug, Clone)]
pub struct MeasuredMesh {
    /// Of what it encloses; `None` if it encloses nothing.
    pub solid: Option<Moments>,
    /// Of its surface as a thin shell.
    pub shell: Moments,
    pub volume: Estimate,
    /// The corners of its convex hull, or close to them.
    pub corners: Vec<Vector3<f64>>,
    /// Whether every edge has two triangles, so that the volume may be relied on.
    pub is_closed: bool,
    pub topology: Topology,
}

/// A surface encloses something if at most one in this many of its edges is open.
const SHARE_OF_EDGES: usize = 20;

/// The measured meshes, or why one could not be measured.
pub type Meshes = BTreeMap<MeshId, Result<MeasuredMesh, String>>;

/// A mesh file, or a mesh in a container.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct MeshId {
    pub file: PathBuf,
    /// Its number in the container; `None` for a file of its own.
    pub number: Option<usize>,
}

impl MeshId {
    /// The mesh of a shape; `None` if it is none, or its file cannot be found.
    pub fn of(geometry: &Geometry) -> Option<Self> {
        match geometry {
            Geometry::Mesh(used) => Some(Self { file: used.file.clone().ok()?, number: None }),
            Geometry::Own(own) => Some(Self { file: own.file.clone(), number: Some(own.number) }),
            _ => None,
        }
    }
}

/// Formats of meshes that some simulators read and gprop does not, which is no fault of the container.
const UNREAD: [&str; 7] = ["dae", "msh", "vtk", "fbx", "3ds", "usd", "usda"];

/// True if gprop knows the format of the mesh, so that a mesh that cannot be read is broken.
pub fn is_of_known_format(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    MeshFormat::of(path).is_some() || ending.is_none_or(|ending| !UNREAD.contains(&ending.as_str()))
}

/// Measures every mesh of the containers, and those that they name and that may be read.
pub fn measure<'a>(containers: impl Iterator<Item = &'a Container>, scope: &ReadScope) -> Meshes {
    let shapes = containers.flat_map(|container| &container.bodies).flat_map(|body| &body.shapes);
    let geometries = shapes.filter_map(|shape| Some((MeshId::of(&shape.geometry)?, &shape.geometry)));
    let meshes: Vec<(MeshId, &Geometry)> = geometries.collect::<BTreeMap<_, _>>().into_iter().collect();
    let measured = |(id, geometry): &(MeshId, &Geometry)| {
        let measured = match geometry {
            Geometry::Own(own) => measure_surface(&own.surface),
            _ => mesh::read(&id.file, Axes::OfFile, scope)
                .map_err(|error| error.problem.to_string())
                .and_then(|mesh| measure_surface(&mesh.surface)),
        };
        (id.clone(), measured)
    };
    parallel::map(&meshes, measured).into_iter().collect()
}

fn measure_surface(surface: &Triangles) -> Result<MeasuredMesh, String> {
    let survey = solid::survey(surface).map_err(|error| error.to_string())?;
    let is_closed = survey.topology.is_watertight();
    let edges = 3 * survey.topology.triangles / 2;
    let is_all_but_closed = is_closed || survey.topology.boundary_edges <= edges / SHARE_OF_EDGES;
    let solid = Moments::from_inertia(survey.volume.mid, survey.center.coords, survey.inertia);
    let vertices: Vec<Vector3<f64>> = surface.vertices.iter().map(|vertex| Vector3::from(*vertex)).collect();
    Ok(MeasuredMesh {
        solid: (is_all_but_closed && solid.amount > 0.0).then_some(solid),
        shell: Moments::from_inertia(survey.shell.area, survey.shell.center.coords, survey.shell.inertia),
        volume: survey.volume,
        corners: extremes(&vertices),
        is_closed,
        topology: survey.topology,
    })
}
