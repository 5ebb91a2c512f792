//! glTF with physics: its rigid bodies by `KHR_physics_rigid_bodies`, or, if it has none, the nodes that have a mass among the
//! `extras` that gprop writes.
//!
//! A body is a node that moves, with everything below it. Its frame is that of the node, without the node's scale.

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Matrix4, Point3, Translation3, UnitQuaternion, Vector3};
use serde_json::Value;

use super::frame::{Frame, hull_of, stretch};
use super::{
    Body, Container, ContainerError, Format, Friction, Geometry, Inertial, Mobility, OwnMesh, Place, Role, Shape,
    ShapeMass,
};
use crate::files::json_patch::places_of_items;
use crate::files::read_scope::ReadScope;
use crate::scene::mesh::beside::Beside;
use crate::scene::mesh::gltf::physics::{EXTENSION, Motion, Outline, exactly, extension};
use crate::scene::mesh::gltf::{Document, GltfFile, PlacedNode};
use crate::scene::mesh::{MeshError, Problem as MeshProblem, Triangles};

const SHAPES: &str = "KHR_implicit_shapes";

/// Reads the glTF at `path`.
pub(super) fn read(path: &Path, scope: &ReadScope) -> Result<Container, ContainerError> {
    let in_mesh = |problem: MeshProblem| ContainerError::Mesh(MeshError { path: path.to_owned(), problem });
    let mut beside = Beside::of(path, scope);
    let bytes = beside.own_bytes(path).map_err(in_mesh)?;
    let not_a_container = |found: String| ContainerError::NotAContainer { path: path.to_owned(), found };
    let file = GltfFile::of(&bytes).ok_or_else(|| not_a_container("its parts cannot be told apart".to_owned()))?;
    let outline = Outline::of(&bytes).map_err(|problem| not_a_container(problem.to_string()))?;
    let stated =
        if outline.motions.is_empty() { Stated::in_extras(&bytes, &outline) } else { Stated::motions(&outline) };
    if stated.is_empty() {
        return Err(not_a_container(format!("no node of it moves ({EXTENSION}) or has a mass")));
    }
    let document = Document::open(&bytes, &mut beside).map_err(in_mesh)?;
    let reader = Reader { path, document: &document, outline: &outline, places: places(file.text) };
    let bodies = stated.iter().map(|stated| reader.body(stated, &stated_nodes(&outline, stated)));
    Ok(Container {
        format: Format::Gltf,
        name: String::new(),
        sources: vec![path.to_owned()],
        bodies: bodies.collect::<Result<_, _>>().map_err(in_mesh)?,
        joints: Vec::new(),
        total_mass_kg: None,
        problems: Vec::new(),
    })
}

/// Where each node of the file stands.
fn places(text: &str) -> Vec<Place> {
    let (mut line, mut counted) = (1, 0);
    let place = |bytes: std::ops::Range<usize>| {
        line += text[counted..bytes.start].matches('\n').count();
        counted = bytes.start;
        Place { source: 0, line, bytes }
    };
    places_of_items(text, "nodes").into_iter().map(place).collect()
}

/// A node of which a mass is stated.
struct Stated {
    motion: Motion,
    /// Sliding friction, if it is stated with the mass.
    friction: Option<f64>,
    is_motion: bool,
}

impl Stated {
    fn motions(outline: &Outline) -> Vec<Self> {
        outline.motions.iter().map(|motion| Self { motion: motion.clone(), friction: None, is_motion: true }).collect()
    }

    /// Nodes with `extras` of gprop: those of an asset (`gprop`), or those of a part.
    fn in_extras(bytes: &[u8], outline: &Outline) -> Vec<Self> {
        let text = GltfFile::of(bytes).map_or("{}", |file| file.text);
        let document: Value = crate::files::json::parse(text.as_bytes()).unwrap_or_default();
        let stated = |(node, placed): (usize, &PlacedNode)| {
            let extras = &document["nodes"][placed.index]["extras"];
            let mass = extras["gprop"]["mass_kg"]["mid"].as_f64();
            let of_part = extras["mass_kg"].as_f64().filter(|_| extras["part"].is_u64());
            Some(Self {
                motion: Motion { node, mass_kg: Some(mass.or(of_part)?), ..Motion::default() },
                friction: extras["friction_rubber"].as_f64().or(extras["gprop"]["friction_rubber"].as_f64()),
                is_motion: false,
            })
        };
        outline.nodes.iter().enumerate().filter_map(stated).collect()
    }
}

/// The nodes that belong to a body: those with its motion, or all below a node with a mass.
fn stated_nodes(outline: &Outline, stated: &Stated) -> Vec<usize> {
    let is_below = |node: usize| {
        std::iter::successors(Some(node), |node| outline.nodes[*node].parent).any(|node| node == stated.motion.node)
    };
    let moves_with =
        |node: usize| outline.motion_of(node).is_some_and(|motion| outline.motions[motion].node == stated.motion.node);
    let belongs = |node: &usize| if stated.is_motion { moves_with(*node) } else { is_below(*node) };
    (0..outline.nodes.len()).filter(belongs).collect()
}

struct Reader<'a> {
    path: &'a Path,
    document: &'a Document<'a>,
    outline: &'a Outline,
    /// By the index of a node in the file.
    places: Vec<Place>,
}

impl Reader<'_> {
    fn body(&self, stated: &Stated, nodes: &[usize]) -> Result<Body, MeshProblem> {
        let motion = &stated.motion;
        let placed = &self.outline.nodes[motion.node];
        let frame = Frame::of(&placed.world_from_node);
        let place = self.places[placed.index].clone();
        let mut shapes = Vec::new();
        let seen: Vec<(usize, Matrix4<f64>)> = self.with_meshes(nodes, &frame);
        if !seen.is_empty() {
            let geometry = self.mesh(placed.index, &seen)?;
            shapes.extend(geometry.map(|geometry| shape(&place, Role::Visual, geometry, Isometry3::identity())));
        }
        for node in nodes.iter().filter(|node| self.outline.with_colliders.contains(node)) {
            shapes.extend(self.collider(*node, &frame)?);
        }
        let node = &self.document.root.nodes[placed.index];
        Ok(Body {
            name: node.name.clone().unwrap_or_else(|| format!("node {}", placed.index)),
            parent: None,
            mobility: if motion.is_kinematic { Mobility::Static } else { Mobility::Moves },
            inertial: motion.mass_kg.map(|_| inertial(motion, &frame, &placed.world_from_node, &place)),
            shapes,
            friction: stated.friction.map(|coefficient| Friction { place: place.clone(), coefficient }),
            problems: Vec::new(),
            place,
        })
    }

    /// The meshes of these nodes, with their places in the body's frame.
    fn with_meshes(&self, nodes: &[usize], frame: &Frame) -> Vec<(usize, Matrix4<f64>)> {
        let has_mesh = |node: &&usize| self.outline.with_meshes.contains(node);
        let placed = nodes.iter().filter(has_mesh).map(|node| &self.outline.nodes[*node]);
        placed.map(|placed| (placed.index, frame.body_from_world() * placed.world_from_node)).collect()
    }

    /// The meshes of nodes as one; `None` if they have no triangles.
    fn mesh(&self, number: usize, nodes: &[(usize, Matrix4<f64>)]) -> Result<Option<Geometry>, MeshProblem> {
        let surface = self.document.surface(nodes)?;
        Ok(self.own_mesh(number, surface))
    }

    fn own_mesh(&self, number: usize, surface: Triangles) -> Option<Geometry> {
        let is_there = !surface.triangles.is_empty();
        let mesh = OwnMesh { file: self.path.to_owned(), number, surface: Arc::new(surface) };
        is_there.then_some(Geometry::Own(mesh))
    }

    /// The collider of a node of the outline.
    fn collider(&self, node: usize, frame: &Frame) -> Result<Option<Shape>, MeshProblem> {
        let placed = &self.outline.nodes[node];
        let own = &self.document.root.nodes[placed.index];
        let Some(collider) = extension(own).and_then(|extension| extension.get("collider")) else { return Ok(None) };
        let geometry = collider.get("geometry").unwrap_or(collider);
        let body_from_node = frame.body_from_world() * placed.world_from_node;
        let number_of = |name: &str| geometry.get(name).and_then(Value::as_u64).and_then(|n| usize::try_from(n).ok());
        let surface = match (number_of("mesh"), number_of("node")) {
            (Some(mesh), _) if mesh < self.document.root.meshes.len() => {
                Some(self.document.surface_of_mesh(mesh, body_from_node)?)
            }
            (None, Some(top)) if top < self.document.root.nodes.len() => {
                Some(self.document.surface(&self.document.below(top, body_from_node)?)?)
            }
            _ => None,
        };
        let found = match (number_of("shape"), surface) {
            (Some(shape), _) => self.implicit(shape, &body_from_node),
            (None, Some(surface)) => {
                let is_hull = geometry.get("convexHull").and_then(Value::as_bool).unwrap_or(false);
                let surface = if is_hull { hull_of(&surface) } else { surface };
                // Numbers of colliders follow those of what is seen.
                let number = self.document.root.nodes.len() + placed.index;
                self.own_mesh(number, surface).map(|geometry| (geometry, Isometry3::identity()))
            }
            (None, None) => None,
        };
        let place = &self.places[placed.index];
        let friction = collider.get("physicsMaterial").and_then(Value::as_u64).and_then(|n| self.friction(n));
        Ok(found.map(|(geometry, body_from_shape)| Shape {
            friction: friction.map(|coefficient| Friction { place: place.clone(), coefficient }),
            ..shape(place, Role::Collision, geometry, body_from_shape)
        }))
    }

    /// The friction of a physics material.
    fn friction(&self, material: u64) -> Option<f64> {
        let materials = self.document.extension(EXTENSION)?.get("physicsMaterials")?;
        let material = materials.get(usize::try_from(material).ok()?)?;
        material.get("staticFriction").or_else(|| material.get("dynamicFriction"))?.as_f64()
    }

    /// A shape of `KHR_implicit_shapes` and where it stands. A node's scale makes it larger.
    fn implicit(&self, index: usize, body_from_node: &Matrix4<f64>) -> Option<(Geometry, Isometry3<f64>)> {
        let shape = self.document.extension(SHAPES)?.get("shapes")?.get(index)?;
        let kind = shape.get("type")?.as_str()?;
        let numbers = shape.get(kind)?;
        let number = |name: &str, default: f64| numbers.get(name).and_then(Value::as_f64).unwrap_or(default);
        let [x, y, z] = stretch(body_from_node);
        // Those with an axis stand along y, and those of a container along z.
        let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2);
        let (radius, half_length) = (number("radiusTop", number("radius", 0.25)) * x, 0.5 * number("height", 0.5) * y);
        let is_even = number("radiusTop", 0.25) == number("radiusBottom", 0.25);
        let (geometry, turn) = match kind {
            "box" => {
                let size: [f64; 3] = numbers.get("size").and_then(|size| exactly(size.as_array()?)).unwrap_or([1.0; 3]);
                let half = [size[0] * x, size[1] * y, size[2] * z].map(|side| 0.5 * side.abs());
                (Geometry::Box { half }, UnitQuaternion::identity())
            }
            "sphere" => {
                let radius = number("radius", 0.5);
                (Geometry::Ellipsoid { half: [radius * x, radius * y, radius * z] }, UnitQuaternion::identity())
            }
            "cylinder" if is_even => (Geometry::Cylinder { radius, half_length }, upright),
            "capsule" if is_even => (Geometry::Capsule { radius, half_length }, upright),
            other => (Geometry::Other(other.chars().take(40).collect()), UnitQuaternion::identity()),
        };
        Some((geometry, Frame::of(body_from_node).world_from_body * turn))
    }
}

fn inertial(motion: &Motion, frame: &Frame, world_from_node: &Matrix4<f64>, place: &Place) -> Inertial {
    let body_from_node = frame.body_from_world() * world_from_node;
    let center = body_from_node.transform_point(&motion.center.unwrap_or_else(Point3::origin));
    Inertial {
        place: place.clone(),
        mass_kg: motion.mass_kg,
        body_from_inertial: Isometry3::from_parts(Translation3::from(center.coords), motion.node_from_axes),
        states_center: motion.center.is_some(),
        // A moment of 0 stands for one without end.
        inertia_kg_m2: motion
            .moments
            .filter(|moments| moments.iter().all(|moment| *moment != 0.0))
            .map(|moments| Matrix3::from_diagonal(&moments)),
        inertia_place: place.clone(),
    }
}

fn shape(place: &Place, role: Role, geometry: Geometry, body_from_shape: Isometry3<f64>) -> Shape {
    Shape { name: None, place: place.clone(), role, geometry, body_from_shape, friction: None, mass: ShapeMass::None }
}
