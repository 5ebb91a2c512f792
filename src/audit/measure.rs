//! The size of a body: what its shapes enclose, and the hull around them.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::hull::{Hull, extent, extremes};
use super::meshes::{MeasuredMesh, MeshId, Meshes};
use super::moments::Moments;
use crate::scene::mesh::containers::{Body, Geometry, Shape, ShapeMass};

/// The shapes of a body that are seen, or those that collide.
#[derive(Debug, Clone)]
pub struct Shapes {
    /// Of what they enclose, one density everywhere; of sheets that enclose nothing, as thin shells. Where shapes overlap,
    /// what they share counts twice.
    pub moments: Moments,
    /// What they enclose, m3, at least, most likely, and at most; `None` if they enclose nothing.
    pub volume_m3: Option<[f64; 3]>,
    /// The corners of their hulls.
    pub corners: Vec<Vector3<f64>>,
    /// Whether all of them are closed.
    pub are_closed: bool,
}

impl Shapes {
    pub fn longest_side_m(&self) -> f64 {
        extent(&self.corners).max()
    }
}

/// The size of a body.
#[derive(Debug, Clone, Default)]
pub struct Size {
    /// `None` if there are none, or if one of them cannot be measured.
    pub seen: Option<Shapes>,
    pub colliding: Option<Shapes>,
    /// Around all of them; `None` if they span no volume.
    pub hull: Option<Hull>,
}

impl Size {
    pub fn of(body: &Body, meshes: &Meshes) -> Self {
        let seen = shapes(body.shapes.iter().filter(|shape| shape.role.is_seen()), meshes);
        let colliding = shapes(body.shapes.iter().filter(|shape| shape.role.collides()), meshes);
        // Colliders of a body whose looks are not known may be mere stand-ins.
        if seen.is_none() && body.shapes.iter().any(|shape| shape.role.is_seen()) {
            return Self::default();
        }
        let corners: Vec<Vector3<f64>> =
            [&seen, &colliding].into_iter().flatten().flat_map(|shapes| shapes.corners.iter().copied()).collect();
        let hull = Hull::of(&extremes(&corners));
        Self { seen, colliding, hull }
    }

    /// The shapes that say most about what the body is: those that are seen, or else those that collide.
    pub fn best(&self) -> Option<&Shapes> {
        let encloses = |shapes: &&Shapes| shapes.volume_m3.is_some();
        let both = [&self.seen, &self.colliding];
        both.into_iter().flatten().find(encloses).or_else(|| both.into_iter().flatten().next())
    }
}

/// A shape of a body in the body's frame.
struct Measured {
    solid: Option<Moments>,
    shell: Option<Moments>,
    volume: [f64; 3],
    corners: Vec<Vector3<f64>>,
    is_closed: bool,
}

fn shapes<'a>(all: impl Iterator<Item = &'a Shape>, meshes: &Meshes) -> Option<Shapes> {
    let all: Option<Vec<Measured>> = all.map(|shape| measured(shape, meshes)).collect();
    let all = all.filter(|all| !all.is_empty())?;
    let corners: Vec<Vector3<f64>> = all.iter().flat_map(|one| one.corners.iter().copied()).collect();
    let solid = Moments::sum(all.iter().filter_map(|one| one.solid));
    let at_most = Hull::of(&extremes(&corners)).map_or(f64::INFINITY, |hull| hull.volume);
    let sum = |which: usize| all.iter().map(|one| one.volume[which]).sum::<f64>().min(at_most);
    // If shapes overlap, together they enclose no more than the largest of them.
    let at_least = all.iter().map(|one| one.volume[0]).fold(0.0, f64::max).min(at_most);
    let volume_m3 = solid.map(|_| [at_least, sum(1), sum(2)]);
    let moments = solid.or_else(|| Moments::sum(all.iter().filter_map(|one| one.shell)))?;
    Some(Shapes { moments, volume_m3, corners, are_closed: all.iter().all(|one| one.is_closed) })
}

fn measured(shape: &Shape, meshes: &Meshes) -> Option<Measured> {
    let pose = &shape.body_from_shape;
    match &shape.geometry {
        Geometry::Mesh(used) => {
            let scale = Matrix3::from_diagonal(&Vector3::from(used.scale));
            Some(placed(measured_mesh(shape, meshes)?, &scale, &used.reference, pose))
        }
        Geometry::Own(_) => {
            Some(placed(measured_mesh(shape, meshes)?, &Matrix3::identity(), &Isometry3::identity(), pose))
        }
        simple => {
            let moments = Moments::of_simple(simple)?.mapped(&Matrix3::identity(), pose);
            Some(Measured {
                solid: (moments.amount > 0.0).then_some(moments),
                shell: None,
                volume: [moments.amount; 3],
                corners: corners_of_simple(simple)
                    .into_iter()
                    .map(|corner| pose * nalgebra::Point3::from(corner))
                    .map(|p| p.coords)
                    .collect(),
                is_closed: true,
            })
        }
    }
}

fn measured_mesh<'a>(shape: &Shape, meshes: &'a Meshes) -> Option<&'a MeasuredMesh> {
    meshes.get(&MeshId::of(&shape.geometry)?)?.as_ref().ok()
}

/// A mesh as a shape of a body uses it.
fn placed(mesh: &MeasuredMesh, scale: &Matrix3<f64>, reference: &Isometry3<f64>, pose: &Isometry3<f64>) -> Measured {
    let reference = reference.inverse();
    let whole = |moments: &Moments| moments.mapped(&Matrix3::identity(), &reference).mapped(scale, pose);
    let factor = scale.determinant().abs();
    // The area of a shell grows as the square of a length, whatever the directions.
    let shell = whole(&mesh.shell);
    let area = mesh.shell.amount * factor.powf(2.0 / 3.0);
    let point = |corner: &Vector3<f64>| {
        let in_shape = scale * (reference * nalgebra::Point3::from(*corner)).coords;
        (pose * nalgebra::Point3::from(in_shape)).coords
    };
    Measured {
        solid: mesh.solid.as_ref().map(whole).filter(|moments| moments.amount > 0.0),
        shell: Some(Moments { amount: area, center: shell.center, second: shell.second * (area / shell.amount) }),
        volume: [mesh.volume.low, mesh.volume.mid, mesh.volume.high].map(|volume| volume * factor),
        corners: mesh.corners.iter().map(point).collect(),
        is_closed: mesh.is_closed,
    }
}

/// Points on a simple shape, of which the hull is the shape within half a percent.
fn corners_of_simple(geometry: &Geometry) -> Vec<Vector3<f64>> {
    let ball = |[a, b, c]: [f64; 3], lift: f64| {
        const AROUND: u32 = 32;
        const UP: u32 = 16;
        let angle = |n: u32, of: u32| std::f64::consts::PI * f64::from(n) / f64::from(of);
        let ring = move |up: u32| {
            let (sin, cos) = angle(up, UP).sin_cos();
            (0..AROUND).map(move |around| {
                let (y, x) = angle(2 * around, AROUND).sin_cos();
                Vector3::new(a * sin * x, b * sin * y, c * cos + lift * cos.signum())
            })
        };
        (0..=UP).flat_map(ring).collect::<Vec<_>>()
    };
    match *geometry {
        Geometry::Box { half } => corners_of_box(half),
        Geometry::Sphere { radius } => ball([radius; 3], 0.0),
        Geometry::Ellipsoid { half } => ball(half, 0.0),
        Geometry::Capsule { radius, half_length } => ball([radius; 3], half_length),
        Geometry::Cylinder { radius, half_length } => {
            let rim = ball([radius, radius, 0.0], 0.0).into_iter().filter(|point| point.xy().norm() > 0.99 * radius);
            rim.flat_map(|point| [half_length, -half_length].map(|z| Vector3::new(point.x, point.y, z))).collect()
        }
        Geometry::Plane | Geometry::Mesh(_) | Geometry::Own(_) | Geometry::Other(_) => Vec::new(),
    }
}

fn corners_of_box([a, b, c]: [f64; 3]) -> Vec<Vector3<f64>> {
    let signs = [-1.0, 1.0];
    let corners = signs.into_iter().flat_map(|x| signs.into_iter().flat_map(move |y| signs.map(|z| [x, y, z])));
    corners.map(|[x, y, z]| Vector3::new(a * x, b * y, c * z)).collect()
}

/// What a body weighs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mass {
    /// Nothing is said, and no reader makes it up.
    Missing,
    /// It follows from shapes that cannot be measured.
    Unknown,
    Stated(f64),
    /// By the mass or density that its shapes state.
    OfShapes(f64),
    /// By the format's own density for what states none.
    ByDefault(f64),
}

impl Mass {
    pub fn of(body: &Body, meshes: &Meshes) -> Self {
        if let Some(inertial) = &body.inertial {
            return inertial.mass_kg.map_or(Self::Missing, Self::Stated);
        }
        let (mut total, mut is_default, mut is_any) = (0.0, false, false);
        for shape in &body.shapes {
            let density = match shape.mass {
                ShapeMass::None => continue,
                ShapeMass::StatedKg(mass) => {
                    (total, is_any) = (total + mass, true);
                    continue;
                }
                ShapeMass::Density(density) => density,
                ShapeMass::DefaultDensity(density) => {
                    is_default = true;
                    density
                }
            };
            is_any = true;
            // A plane has no mass, whatever its density.
            if shape.geometry == Geometry::Plane {
                continue;
            }
            let Some(measured) = measured(shape, meshes) else { return Self::Unknown };
            total += density * measured.volume[1];
        }
        match () {
            () if !is_any => Self::Missing,
            () if is_default => Self::ByDefault(total),
            () => Self::OfShapes(total),
        }
    }

    pub fn kg(self) -> Option<f64> {
        match self {
            Self::Stated(mass) | Self::OfShapes(mass) | Self::ByDefault(mass) => Some(mass),
            Self::Missing | Self::Unknown => None,
        }
    }

    /// The mass after MuJoCo has scaled all of them.
    pub fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Stated(mass) => Self::Stated(mass * factor),
            Self::OfShapes(mass) => Self::OfShapes(mass * factor),
            Self::ByDefault(mass) => Self::ByDefault(mass * factor),
            Self::Missing | Self::Unknown => self,
        }
    }
}
