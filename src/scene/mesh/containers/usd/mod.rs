//! USD in text (`.usda`): rigid bodies, masses, colliders and frictions by UsdPhysics.
//!
//! A body is a prim with `PhysicsRigidBodyAPI`, with everything below it down to the next body; in a layer without one, a prim
//! with `PhysicsMassAPI`. Its frame is that of the prim, without its scale, in metres.
//!
//! No crate is used: those that read USD compose whole stages with other layers, which an audit of one file must not open, and what
//! is needed of the text is little. Two modules: [`text`] reads a layer, [`shapes`] its geometry.

mod shapes;
mod text;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Matrix4, Point3, Translation3, Vector3};

use super::frame::Frame;
use super::{
    Body, Container, ContainerError, Format, Friction, Geometry, Inertial, Mobility, Place, Problem, Role, Shape,
    ShapeMass,
};
use crate::scene::mesh::gltf::quaternion;
use shapes::Shapes;
use text::Prim;

/// Metres in a unit if a layer says nothing: USD's default is the centimetre.
const DEFAULT_METERS_PER_UNIT: f64 = 0.01;
/// UsdPhysics's density of what states none, kg/m3.
const DEFAULT_DENSITY_KG_M3: f64 = 1000.0;
const BODY: &str = "PhysicsRigidBodyAPI";
const MASS: &str = "PhysicsMassAPI";
const COLLIDER: &str = "PhysicsCollisionAPI";

/// Reads the layer at `path`, of which `bytes` are the content.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Container, ContainerError> {
    let not_a_container =
        |found: &str| ContainerError::NotAContainer { path: path.to_owned(), found: found.to_owned() };
    let text =
        std::str::from_utf8(bytes).map_err(|_| not_a_container("it is not USD in text; convert it with usdcat"))?;
    let layer = text::parse(text).map_err(|broken| broken.of(path))?;
    let unit = |name: &str, default: f64| layer.number(name).filter(|unit| *unit > 0.0).unwrap_or(default);
    let world = Prims::of(text, &layer, unit("metersPerUnit", DEFAULT_METERS_PER_UNIT));
    let has_bodies = world.all.iter().any(|placed| placed.prim.has_schema(BODY));
    let schema = if has_bodies { BODY } else { MASS };
    let is_body = |placed: &Placed| placed.prim.has_schema(schema);
    let bodies: Vec<usize> = (0..world.all.len()).filter(|at| is_body(&world.all[*at])).collect();
    if bodies.is_empty() {
        return Err(not_a_container("no prim of it has PhysicsRigidBodyAPI or PhysicsMassAPI"));
    }
    let reader = Reader { path, world: &world, kilograms_per_unit: unit("kilogramsPerUnit", 1.0), is_body: &is_body };
    Ok(Container {
        format: Format::Usd,
        name: layer.text("defaultPrim").unwrap_or_default().to_owned(),
        sources: vec![path.to_owned()],
        bodies: bodies.into_iter().map(|body| reader.body(body)).collect(),
        joints: Vec::new(),
        total_mass_kg: None,
        problems: Vec::new(),
    })
}

/// A prim in the world.
struct Placed<'a> {
    prim: &'a Prim,
    path: String,
    /// Index of the one above it.
    parent: Option<usize>,
    /// Metres.
    world_from_prim: Matrix4<f64>,
    place: Place,
}

/// All prims that are defined, parents before their children.
struct Prims<'a> {
    all: Vec<Placed<'a>>,
    meters_per_unit: f64,
    by_path: BTreeMap<String, usize>,
}

impl<'a> Prims<'a> {
    fn of(text: &str, layer: &'a Prim, meters_per_unit: f64) -> Self {
        let mut world = Self { all: Vec::new(), meters_per_unit, by_path: BTreeMap::new() };
        let unit = Matrix4::new_scaling(meters_per_unit);
        let mut open: Vec<(&Prim, Option<usize>)> = layer.children.iter().rev().map(|prim| (prim, None)).collect();
        let (mut line, mut counted) = (1, 0);
        while let Some((prim, parent)) = open.pop() {
            if prim.specifier == "class" {
                continue;
            }
            let above = parent.map(|parent| &world.all[parent]);
            let start = above.filter(|_| !shapes::resets(prim)).map_or(unit, |above| above.world_from_prim);
            let path = format!("{}/{}", above.map_or("", |above| above.path.as_str()), prim.name);
            // Prims are visited in the order of the text.
            line += text[counted..prim.head.start].matches('\n').count();
            counted = prim.head.start;
            let place = Place { source: 0, line, bytes: prim.head.clone() };
            let at = world.all.len();
            world.by_path.insert(path.clone(), at);
            let world_from_prim = start * shapes::parent_from_prim(prim);
            world.all.push(Placed { prim, path, parent, world_from_prim, place });
            open.extend(prim.children.iter().rev().map(|child| (child, Some(at))));
        }
        world
    }

    /// A prim and those above it.
    fn up_from(&self, at: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(at), |at| self.all[*at].parent)
    }
}

struct Reader<'a> {
    path: &'a Path,
    world: &'a Prims<'a>,
    kilograms_per_unit: f64,
    is_body: &'a dyn Fn(&Placed) -> bool,
}

impl Reader<'_> {
    fn body(&self, at: usize) -> Body {
        let placed = &self.world.all[at];
        let prim = placed.prim;
        let frame = Frame::of(&placed.world_from_prim);
        let mut body = Body {
            name: prim.name.clone(),
            place: placed.place.clone(),
            parent: None,
            mobility: if prim.number("physics:rigidBodyEnabled") == Some(0.0) {
                Mobility::Static
            } else {
                Mobility::Moves
            },
            inertial: self.inertial(placed, &frame),
            shapes: Vec::new(),
            friction: self.friction(at),
            problems: Vec::new(),
        };
        let density = prim.number("physics:density").filter(|density| *density > 0.0);
        for below in at..self.world.all.len() {
            // Descendants follow each other.
            if below > at && !self.world.up_from(below).any(|above| above == at) {
                break;
            }
            let owner = self.world.up_from(below).find(|above| (self.is_body)(&self.world.all[*above]));
            if owner == Some(at) {
                self.add_shapes(below, &frame, density, &mut body);
            }
        }
        body
    }

    fn add_shapes(&self, at: usize, frame: &Frame, of_body: Option<f64>, body: &mut Body) {
        let placed = &self.world.all[at];
        let prim = placed.prim;
        let shape = |role: Role, geometry: Geometry, body_from_shape: Isometry3<f64>| Shape {
            name: Some(prim.name.clone()),
            place: placed.place.clone(),
            role,
            geometry,
            body_from_shape,
            friction: None,
            mass: ShapeMass::None,
        };
        if prim.is_composed {
            let other = Geometry::Other("reference or variant".to_owned());
            body.shapes.push(shape(Role::Visual, other, Isometry3::identity()));
        }
        let body_from_prim = frame.body_from_world() * placed.world_from_prim;
        let made = Shapes { file: self.path, number: at, prim, body_from_prim }.geometry();
        let (geometry, body_from_shape) = match made {
            Ok(Some(made)) => made,
            Ok(None) => return,
            Err(text) => return body.problems.push(Problem { place: placed.place.clone(), text }),
        };
        let collides = prim.has_schema(COLLIDER) && prim.number("physics:collisionEnabled") != Some(0.0);
        let is_hidden = prim.text("purpose") == Some("guide") || prim.text("visibility") == Some("invisible");
        let role = match (collides, is_hidden) {
            (true, true) => Role::Collision,
            (true, false) => Role::Both,
            (false, true) => return,
            (false, false) => Role::Visual,
        };
        let mass = match prim.number("physics:mass").filter(|mass| *mass > 0.0) {
            _ if !collides => ShapeMass::None,
            Some(mass) => ShapeMass::StatedKg(mass * self.kilograms_per_unit),
            None => {
                let own = prim.number("physics:density").filter(|density| *density > 0.0);
                let stated = own.or_else(|| self.of_material(at, "physics:density")).or(of_body);
                stated.map_or(ShapeMass::DefaultDensity(DEFAULT_DENSITY_KG_M3), |density| {
                    ShapeMass::Density(density * self.kilograms_per_unit / self.world.meters_per_unit.powi(3))
                })
            }
        };
        body.shapes.push(Shape { friction: self.friction(at), mass, ..shape(role, geometry, body_from_shape) });
    }

    /// What a prim with a mass states; `None` if it states no mass: then its shapes do.
    fn inertial(&self, placed: &Placed, frame: &Frame) -> Option<Inertial> {
        let prim = placed.prim;
        let mass = prim.number("physics:mass").filter(|mass| *mass != 0.0)?;
        let body_from_prim = frame.body_from_world() * placed.world_from_prim;
        let center = prim.vector::<3>("physics:centerOfMass").filter(|center| center.iter().all(|x| x.is_finite()));
        let at = body_from_prim.transform_point(&center.map_or_else(Point3::origin, Point3::from));
        let axes = prim.vector::<4>("physics:principalAxes").map_or([0.0, 0.0, 0.0, 1.0], |[w, x, y, z]| [x, y, z, w]);
        let moments = prim.vector::<3>("physics:diagonalInertia").filter(|moments| *moments != [0.0; 3]);
        let unit = self.kilograms_per_unit * self.world.meters_per_unit.powi(2);
        Some(Inertial {
            place: placed.place.clone(),
            mass_kg: Some(mass * self.kilograms_per_unit),
            body_from_inertial: Isometry3::from_parts(Translation3::from(at.coords), quaternion(axes)),
            states_center: center.is_some(),
            inertia_kg_m2: moments.map(|moments| Matrix3::from_diagonal(&(Vector3::from(moments) * unit))),
            inertia_place: placed.place.clone(),
        })
    }

    fn friction(&self, at: usize) -> Option<Friction> {
        let coefficient = self
            .of_material(at, "physics:staticFriction")
            .or_else(|| self.of_material(at, "physics:dynamicFriction"))?;
        Some(Friction { place: self.world.all[at].place.clone(), coefficient })
    }

    /// A number of the physics material that is bound to a prim, or to the nearest one above it.
    fn of_material(&self, at: usize, name: &str) -> Option<f64> {
        let bound = |at: usize| {
            let prim = self.world.all[at].prim;
            ["material:binding:physics", "material:binding"].into_iter().find_map(|name| prim.text(name))
        };
        let path = self.world.up_from(at).find_map(bound)?;
        self.world.all[*self.world.by_path.get(path)?].prim.number(name)
    }
}
