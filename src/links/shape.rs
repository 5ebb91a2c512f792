//! The shape of a link: its visual meshes and simple shapes, or those that collide if there are none that can be read, as one
//! surface.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3};

use super::simple;
use crate::files::read_scope::ReadScope;
use crate::scene::mesh::containers::{Body, Geometry, MeshUse, Shape};
use crate::scene::mesh::{self, Axes, Mesh, Triangles};

/// The surfaces of a link, in metres, in its own frame.
pub struct LinkShape {
    pub shapes: Vec<PlacedShape>,
}

/// A surface of a link.
pub struct PlacedShape {
    pub surface: Triangles,
    /// The mesh that it is a copy of, with its looks; `None` for simple shapes.
    pub mesh: Option<std::rc::Rc<Mesh>>,
}

/// The meshes that were read, or why one could not be.
pub struct Meshes<'a> {
    scope: &'a ReadScope,
    read: BTreeMap<PathBuf, Result<std::rc::Rc<Mesh>, String>>,
}

impl<'a> Meshes<'a> {
    pub fn new(scope: &'a ReadScope) -> Self {
        Self { scope, read: BTreeMap::new() }
    }

    fn get(&mut self, path: &Path) -> Result<std::rc::Rc<Mesh>, String> {
        let read = || {
            let mesh = mesh::read(path, Axes::OfFile, self.scope).map_err(|error| error.to_string())?;
            Ok(std::rc::Rc::new(mesh))
        };
        self.read.entry(path.to_owned()).or_insert_with(read).clone()
    }
}

/// What makes two links look alike: all shapes with their places.
pub fn look(body: &Body) -> String {
    let of_shape = |shape: &Shape| format!("{:?}{:?}{:?}\n", shape.role, shape.geometry, shape.body_from_shape);
    body.shapes.iter().map(of_shape).collect()
}

/// The shape of a link; `None` if it has none.
pub fn of_link(body: &Body, meshes: &mut Meshes, warnings: &mut Vec<String>) -> Option<LinkShape> {
    let mut problems = Vec::new();
    let is_seen = |shape: &&Shape| shape.role.is_seen();
    let collides = |shape: &&Shape| shape.role.collides();
    let mut shapes = placed_shapes(body.shapes.iter().filter(is_seen), meshes, &mut problems);
    // A link that shows only half of itself would weigh half.
    if shapes.is_empty() || !problems.is_empty() {
        let colliding = placed_shapes(body.shapes.iter().filter(collides), meshes, &mut problems);
        if !colliding.is_empty() {
            shapes = colliding;
        }
    }
    if let Some(first) = problems.first() {
        let used = if shapes.is_empty() { "it is left out" } else { "what else could be read of it is used" };
        warnings.push(format!("link {:?}: {first}; {used}", body.name));
    }
    (!shapes.is_empty()).then_some(LinkShape { shapes })
}

fn placed_shapes<'a>(
    shapes: impl Iterator<Item = &'a Shape>,
    meshes: &mut Meshes,
    problems: &mut Vec<String>,
) -> Vec<PlacedShape> {
    let mut all = Vec::new();
    for shape in shapes {
        match placed_shape(shape, meshes) {
            Ok(placed) => all.extend(placed),
            Err(problem) => problems.push(problem),
        }
    }
    all
}

/// The surface of a shape; `None` for a plane, which has no end.
fn placed_shape(shape: &Shape, meshes: &mut Meshes) -> Result<Option<PlacedShape>, String> {
    let pose = &shape.body_from_shape;
    match &shape.geometry {
        Geometry::Plane => Ok(None),
        Geometry::Other(kind) => Err(format!("a shape of the kind {kind:?} cannot be measured")),
        Geometry::Mesh(used) => {
            let path = used.file.as_ref().map_err(ToString::to_string)?;
            let mesh = meshes.get(path)?;
            Ok(Some(PlacedShape { surface: placed(&mesh.surface, used, pose), mesh: Some(mesh) }))
        }
        Geometry::Own(own) => Ok(Some(PlacedShape { surface: own.surface.as_ref().clone(), mesh: None })),
        simple => {
            let mut surface = simple::surface(simple);
            surface.vertices.iter_mut().for_each(|vertex| *vertex = (pose * Point3::from(*vertex)).into());
            Ok(Some(PlacedShape { surface, mesh: None }))
        }
    }
}

/// A mesh as a shape of a link uses it.
fn placed(mesh: &Triangles, used: &MeshUse, pose: &Isometry3<f64>) -> Triangles {
    let reference = used.reference.inverse();
    let [x, y, z] = used.scale;
    let place = |vertex: &[f64; 3]| {
        let point = reference * Point3::from(*vertex);
        (pose * Point3::new(x * point.x, y * point.y, z * point.z)).into()
    };
    let mut placed =
        Triangles { vertices: mesh.vertices.iter().map(place).collect(), triangles: mesh.triangles.clone() };
    if x * y * z < 0.0 {
        placed.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    }
    placed
}
