//! Clouds of flat Gaussians on surfaces whose volume is known in closed form, and cameras around them.

use gprop::camera::{Camera, Distortion, Intrinsics};
use gprop::gaussians::Gaussians;
use gprop::materials::MaterialLibrary;
use gprop::parts::{Possibilities, Possible};
use gprop::query::{Form, Hypothesis};
use gprop::units::{Estimate, Range};
use gprop::vote::{FieldPart, MaterialField};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use crate::support::changed;

/// Surface points with outward unit normals, and the part each belongs to.
#[derive(Default)]
pub struct Cloud {
    pub points: Vec<(Point3<f64>, Vector3<f64>, u32)>,
}

impl Cloud {
    pub fn add(&mut self, point: Point3<f64>, normal: Vector3<f64>, part: u32) {
        self.points.push((point, normal, part));
    }

    /// A ball's surface; `part_of` gives the part of each point.
    pub fn sphere(center: Point3<f64>, radius: f64, count: usize, part_of: impl Fn(Vector3<f64>) -> u32) -> Self {
        let mut cloud = Self::default();
        for n in directions(count) {
            cloud.add(center + n * radius, n, part_of(n));
        }
        cloud
    }

    /// A torus about the z axis.
    pub fn torus(ring: f64, tube: f64, spacing: f64) -> Self {
        let mut cloud = Self::default();
        let around = (std::f64::consts::TAU * tube / spacing).ceil() as usize;
        for a in 0..around {
            let (sin, cos) = (std::f64::consts::TAU * a as f64 / around as f64).sin_cos();
            let along = (std::f64::consts::TAU * (ring + tube * cos) / spacing).ceil() as usize;
            for b in 0..along {
                let (y, x) = (std::f64::consts::TAU * b as f64 / along as f64).sin_cos();
                let normal = Vector3::new(x * cos, y * cos, sin);
                cloud.add(Point3::from(Vector3::new(x, y, 0.0) * ring + normal * tube), normal, 0);
            }
        }
        cloud
    }

    /// The side of an upright cylinder from `low` to `high` and, with `caps`, its two ends.
    pub fn add_cylinder(&mut self, radius: f64, [low, high]: [f64; 2], caps: [bool; 2], spacing: f64, part: u32) {
        let ring = |radius: f64| (std::f64::consts::TAU * radius / spacing).ceil().max(1.0) as usize;
        let angle = |k: usize, n: usize| std::f64::consts::TAU * k as f64 / n as f64;
        let rows = ((high - low) / spacing).ceil() as usize;
        for row in 0..=rows {
            for k in 0..ring(radius) {
                let (y, x) = angle(k, ring(radius)).sin_cos();
                let z = low + (high - low) * row as f64 / rows as f64;
                self.add(Point3::new(radius * x, radius * y, z), Vector3::new(x, y, 0.0), part);
            }
        }
        for (z, up, _) in [(low, -1.0, caps[0]), (high, 1.0, caps[1])].into_iter().filter(|cap| cap.2) {
            let rings = (radius / spacing).ceil() as usize;
            for r in (0..rings).map(|r| radius * r as f64 / rings as f64) {
                for k in 0..ring(r) {
                    let (y, x) = angle(k, ring(r)).sin_cos();
                    self.add(Point3::new(r * x, r * y, z), Vector3::z() * up, part);
                }
            }
        }
    }

    /// A box about the origin, by half its sides.
    pub fn cuboid(half: Vector3<f64>, spacing: f64) -> Self {
        let mut cloud = Self::default();
        let steps = |axis: usize| (2.0 * half[axis] / spacing).ceil() as usize;
        for normal in 0..3 {
            let [a, b] = [(normal + 1) % 3, (normal + 2) % 3];
            for (k, sign) in (0..=steps(a) * (steps(b) + 1) + steps(b)).flat_map(|k| [(k, 1.0), (k, -1.0)]) {
                let coordinate = |axis: usize, step: usize| half[axis] * (2.0 * step as f64 / steps(axis) as f64 - 1.0);
                let mut point = Point3::origin();
                point[normal] = sign * half[normal];
                point[a] = coordinate(a, k / (steps(b) + 1));
                point[b] = coordinate(b, k % (steps(b) + 1));
                cloud.add(point, Vector3::ith(normal, sign), 0);
            }
        }
        cloud
    }

    /// Flat Gaussians of this deviation along the surface, a fiftieth of it across: they represent a solid whose
    /// surface lies sqrt(5) deviations in front of their centres, an offset that must be negligible here.
    pub fn gaussians(&self, deviation: f64) -> Gaussians {
        let mut gaussians = Gaussians::default();
        for (point, normal, _) in &self.points {
            let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
            let turn = UnitQuaternion::rotation_between(&Vector3::z(), normal).unwrap_or(half_turn);
            let [x, y, z, w] = turn.coords.map(|v| v as f32).into();
            gaussians.positions.push(point.coords.map(|v| v as f32).into());
            gaussians.log_scales.push([deviation, deviation, 0.02 * deviation].map(|s| s.ln() as f32));
            gaussians.rotations.push([w, x, y, z]);
            // Opacity 0.95.
            gaussians.opacity_logits.push(19f32.ln());
            gaussians.sh_dc.push([0.0; 3]);
        }
        gaussians
    }

    /// The field that labels each Gaussian with its part; `forms` per part, density 1000 kg/m^3.
    pub fn field(&self, forms: &[Form]) -> MaterialField {
        let labels = forms.iter().enumerate().map(|(id, form)| label(id as u32, *form)).collect();
        MaterialField::known(labels, self.points.iter().map(|(_, _, part)| *part).collect())
    }
}

pub fn label(id: u32, form: Form) -> FieldPart {
    changed(FieldPart::of(id, &MaterialLibrary::builtin().materials()[0]), |label| {
        label.caption = format!("part {id}");
        label.density_kg_m3 = Estimate::exactly(1000.0);
        label.youngs_modulus_pa = Estimate::exactly(1e9);
        label.poisson_ratio = Estimate::exactly(0.3);
        label.yield_strength_pa = Estimate::exactly(1e7);
        label.friction_rubber = Estimate::exactly(0.5);
        (label.form, label.hardness) = (form, None);
    })
}

/// Parts that may be made in these ways, each with its probability, of a thing that weighs between `mass_kg`.
pub fn possible(mass_kg: Range, of_label: Vec<Vec<(FieldPart, f64)>>) -> Possibilities {
    let choice = |(part, probability): (FieldPart, f64)| Possible {
        part,
        under: vec![probability],
        likelihood: 1.0,
        stated_probability: probability,
    };
    Possibilities {
        hypotheses: vec![Hypothesis { what: "a thing".to_owned(), probability: 1.0, mass_kg }],
        stated_mass_counts: true,
        guess_kg: None,
        asked: vec![None; of_label.len()],
        of_label: of_label.into_iter().map(|choices| choices.into_iter().map(choice).collect()).collect(),
        printed: None,
        unnumbered: Vec::new(),
        shown_as: Vec::new(),
    }
}

/// Unit vectors spread evenly (Fibonacci sphere).
pub fn directions(count: usize) -> Vec<Vector3<f64>> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let direction = |i: usize| {
        let z = 1.0 - (2 * i + 1) as f64 / count as f64;
        let (sin, cos) = (golden_angle * i as f64).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vector3::new(r * cos, r * sin, z)
    };
    (0..count).map(direction).collect()
}

/// As [`cameras_of`] with pictures of 400 px.
pub fn cameras(distance: f64, count: usize, from: impl Fn(&Vector3<f64>) -> bool) -> Vec<Camera> {
    cameras_of(400, distance, count, from)
}

/// Cameras at `distance` from the origin that look at it from the directions that `from` accepts; an object as long
/// as the distance fills the picture, which has `pixels` pixels per side.
pub fn cameras_of(pixels: u32, distance: f64, count: usize, from: impl Fn(&Vector3<f64>) -> bool) -> Vec<Camera> {
    let side = f64::from(pixels);
    let intrinsics = Intrinsics {
        width: pixels,
        height: pixels,
        fx: side,
        fy: side,
        cx: 0.5 * side,
        cy: 0.5 * side,
        distortion: Distortion::default(),
    };
    // nalgebra's right-handed look_at gives x right, y up, z backward; half a turn about x makes it OpenCV's.
    let flip = Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
    let look = |n: Vector3<f64>| {
        let up = if n.z.abs() > 0.9 { Vector3::x() } else { Vector3::z() };
        flip * Isometry3::look_at_rh(&Point3::from(n * distance), &Point3::origin(), &up)
    };
    let seen_from = directions(count).into_iter().filter(from);
    seen_from.map(|n| Camera { intrinsics, camera_from_world: look(n) }).collect()
}
