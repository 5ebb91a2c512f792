//! Geoms.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::super::numbers::{exactly, numbers, of_z_axis};
use super::super::{Body, Friction, Geometry, Problem, Role, Shape, ShapeMass};
use super::compiler::FromGeoms;
use super::defaults::Settings;
use super::documents::Item;
use super::{MeshUse, Model};

/// MuJoCo's density of a geom that states neither mass nor density, kg/m3: that of water.
const DEFAULT_DENSITY: f64 = 1000.0;

/// Reads a geom.
pub struct Reader<'a, 'm> {
    pub model: &'a Model<'m>,
    pub item: Item<'a>,
    pub settings: Settings<'a>,
    pub problems: &'a mut Vec<Problem>,
}

impl Reader<'_, '_> {
    /// The geom in the frame of its body; `None` if it cannot be read, which is then among the problems.
    pub fn read(mut self, body_from_frame: &Isometry3<f64>) -> Option<Shape> {
        let kind = self.settings.value("type").unwrap_or("sphere");
        let ends = match self.settings.value("fromto") {
            Some(text) => Some(self.checked("fromto", exactly::<6>(text))?),
            None => None,
        };
        let pose = match ends {
            Some(ends) => between(ends),
            None => self.model.pose(self.item, &self.settings, self.problems),
        };
        let geometry = self.geometry(kind, ends)?;
        Some(Shape {
            name: self.item.node.value("name").map(str::to_owned),
            place: self.item.place(),
            role: if self.collides() { Role::Collision } else { Role::Visual },
            geometry,
            body_from_shape: body_from_frame * pose,
            friction: self.friction(),
            mass: self.mass(),
        })
    }

    fn geometry(&mut self, kind: &str, ends: Option<[f64; 6]>) -> Option<Geometry> {
        if let Some(mesh) = self.settings.value("mesh") {
            let used: Option<&MeshUse> = self.model.meshes.get(mesh);
            return Some(match used {
                Some(used) if kind == "mesh" => Geometry::Mesh(used.clone()),
                // MuJoCo fits the shape to the mesh, or the model holds the mesh itself.
                _ => Geometry::Other(format!("{kind} from the mesh {mesh:?}")),
            });
        }
        let size = self.settings.value("size").map_or(Ok(Vec::new()), numbers);
        let size = self.checked("size", size.map_err(|word| format!("has {word:?}, which is not a finite number")))?;
        let half_length = ends.map(|[a, b, c, x, y, z]| Vector3::new(x - a, y - b, z - c).norm() / 2.0);
        let radius = size.first().copied();
        let length = half_length.or_else(|| size.get(1).copied());
        let half = match half_length {
            Some(half) => radius.map(|radius| [radius, radius, half]),
            None => size.get(..3).map(|half| [half[0], half[1], half[2]]),
        };
        let found = match kind {
            "sphere" => radius.map(|radius| Geometry::Sphere { radius }),
            "capsule" => radius.zip(length).map(|(radius, half_length)| Geometry::Capsule { radius, half_length }),
            "cylinder" => radius.zip(length).map(|(radius, half_length)| Geometry::Cylinder { radius, half_length }),
            "ellipsoid" => half.map(|half| Geometry::Ellipsoid { half }),
            "box" => half.map(|half| Geometry::Box { half }),
            "plane" => Some(Geometry::Plane),
            other => Some(Geometry::Other(other.to_owned())),
        };
        if found.is_none() {
            self.problem(format!("<geom>: a {kind} needs more numbers in its size"));
        }
        found
    }

    fn collides(&self) -> bool {
        ["contype", "conaffinity"].iter().any(|name| self.settings.value(name).is_none_or(|bits| bits.trim() != "0"))
    }

    fn friction(&mut self) -> Option<Friction> {
        let text = self.settings.value("friction")?;
        let found = numbers(text).map_err(|word| format!("has {word:?}, which is not a finite number"));
        let coefficient = *self.checked("friction", found)?.first()?;
        Some(Friction { place: self.item.place(), coefficient })
    }

    fn mass(&mut self) -> ShapeMass {
        let group = self.settings.value("group").and_then(|group| group.trim().parse().ok()).unwrap_or(0.0);
        let [first, last] = self.model.compiler.mass_groups;
        let has_mass = self.model.compiler.inertia_from_geoms != FromGeoms::Never && (first..=last).contains(&group);
        // Of a shell, the density is that of its area.
        let is_shell = self.settings.value("shellinertia") == Some("true");
        let (mass, density) = (self.settings.value("mass"), self.settings.value("density"));
        match (mass, density) {
            _ if !has_mass => ShapeMass::None,
            (Some(text), _) => match self.checked("mass", exactly(text)) {
                Some([mass]) => ShapeMass::StatedKg(mass),
                None => ShapeMass::None,
            },
            _ if is_shell => ShapeMass::None,
            (None, Some(text)) => match self.checked("density", exactly(text)) {
                Some([density]) => ShapeMass::Density(density),
                None => ShapeMass::None,
            },
            (None, None) => ShapeMass::DefaultDensity(DEFAULT_DENSITY),
        }
    }

    fn checked<T>(&mut self, name: &str, value: Result<T, String>) -> Option<T> {
        value.map_err(|error| self.problem(format!("<geom>: {name} {error}"))).ok()
    }

    fn problem(&mut self, text: String) {
        self.problems.push(Problem { place: self.item.place(), text });
    }
}

/// The frame in the middle between two ends, with z along the line between them.
fn between([a, b, c, x, y, z]: [f64; 6]) -> Isometry3<f64> {
    let rotation = of_z_axis([x - a, y - b, z - c]).unwrap_or_else(UnitQuaternion::identity);
    Isometry3::from_parts(Translation3::new((a + x) / 2.0, (b + y) / 2.0, (c + z) / 2.0), rotation)
}

/// Geoms that collide are drawn as well, if the body has none that are only drawn.
pub fn set_roles(body: &mut Body) {
    if !body.shapes.iter().any(|shape| shape.role == Role::Visual) {
        body.shapes.iter_mut().for_each(|shape| shape.role = Role::Both);
    }
}
