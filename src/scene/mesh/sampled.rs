//! Flat Gaussians on a mesh's surface, which carry the field.
//!
//! Candidates are spread over the triangles by their area: at equal steps along the sum of all areas, and within a triangle at
//! the points of a sequence that leaves no gaps (R2, Roberts 2018). Of those, in an order that jumps over the whole surface, each
//! is taken that lies at least a distance away from all taken before on the same side of the surface (Poisson disks, Cook 1986).
//! Nothing is random.

use std::collections::HashMap;

use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::Problem;
use super::connected::surface_of_triangles;
use super::painted::{PaintedMesh, area_normal};
use crate::gaussians::{Gaussians, SH_C0};
use crate::numeric::srgb;
use crate::render::triangles::SurfacePoint;

/// About how many Gaussians a mesh gets: at a picture of a thousand pixels, one for every few pixels of the object.
pub const GAUSSIANS: usize = 60_000;
/// Four for each Gaussian.
const CANDIDATES: usize = 4 * GAUSSIANS;
/// Candidates from one that is tried to the next: near the golden section, and without a common divisor with their number, so
/// that each is tried once.
const STRIDE: usize = 148_327;
/// The distance over the square root of the area that each Gaussian is to have. Disks that are placed one by one until none fits
/// cover 0.547 of a plane (Feder 1980), four candidates for each about half of it: n disks of diameter d then have an area of
/// n pi d^2 / 4 = 0.5.
const DISTANCE: f64 = 0.8;
/// Standard deviation along the surface over that distance. Once no disk fits, no point is farther than the distance from a
/// centre; with this, the Gaussians around such a point cover three quarters of it.
const DEVIATION: f64 = 0.65;
/// Standard deviation across the surface over that along it.
const FLATNESS: f64 = 0.1;
/// 0.99, just below what a splat's rasteriser takes for opaque, before the logistic function.
const OPACITY_LOGIT: f32 = 4.595;

/// Gaussians and where they lie.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledSurface {
    pub gaussians: Gaussians,
    /// For each Gaussian, the triangle on which it lies.
    pub triangles: Vec<u32>,
}

/// A candidate or what has been taken.
struct Sample {
    position: Point3<f64>,
    normal: Vector3<f64>,
}

/// Samples the surface.
///
/// # Errors
/// [`Problem::NoArea`] if the surface has none.
pub fn sample(painted: &PaintedMesh) -> Result<SampledSurface, Problem> {
    let count = painted.mesh.surface.triangles.len();
    let normals: Vec<Vector3<f64>> = (0..count).map(|triangle| area_normal(&painted.mesh, triangle)).collect();
    let mut sum = 0.0;
    let area_up_to: Vec<f64> = normals
        .iter()
        .map(|normal| {
            sum += 0.5 * normal.norm();
            sum
        })
        .collect();
    let distance = DISTANCE * (sum / GAUSSIANS as f64).sqrt();
    if !(distance > 0.0 && (DEVIATION * distance).ln().is_finite()) {
        return Err(Problem::NoArea);
    }
    let mut taken = Taken::new(distance);
    let mut sampled = SampledSurface { gaussians: Gaussians::default(), triangles: Vec::new() };
    for number in 0..CANDIDATES {
        let candidate = number * STRIDE % CANDIDATES;
        let area = (candidate as f64 + 0.5) / CANDIDATES as f64 * sum;
        let triangle = area_up_to.partition_point(|up_to| *up_to < area).min(count - 1);
        let point = SurfacePoint { triangle: triangle as u32, barycentric: spread(candidate) };
        let Some(normal) = normals[triangle].try_normalize(0.0) else { continue };
        let sample = Sample { position: painted.position(&point), normal };
        if painted.is_there(&point) && taken.has_room_for(&sample) {
            let cells = 0.5 * normals[triangle].norm() / (distance * distance);
            push(&mut sampled.gaussians, &sample, painted.color(&point, cells), distance);
            sampled.triangles.push(point.triangle);
            taken.add(sample);
        }
    }
    if sampled.triangles.is_empty() {
        return Err(Problem::NoArea);
    }
    let surface_of = surface_of_triangles(&painted.mesh.surface);
    sampled.gaussians.surface = sampled.triangles.iter().map(|triangle| surface_of[*triangle as usize]).collect();
    Ok(sampled)
}

/// Shares of a triangle's corners, evenly spread for any run of numbers (R2 on the square, folded onto the triangle with the
/// square root that keeps areas).
fn spread(number: usize) -> [f64; 3] {
    /// One over the plastic number, and over its square.
    const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
    let [along, across] = STEPS.map(|step| (0.5 + step * number as f64).fract());
    let root = along.sqrt();
    [1.0 - root, root * (1.0 - across), root * across]
}

/// What has been taken, by cells that are one distance wide.
struct Taken {
    distance: f64,
    samples: Vec<Sample>,
    cells: HashMap<[i64; 3], Vec<u32>>,
}

impl Taken {
    fn new(distance: f64) -> Self {
        Self { distance, samples: Vec::new(), cells: HashMap::new() }
    }

    fn cell(&self, position: &Point3<f64>) -> [i64; 3] {
        position.coords.map(|value| (value / self.distance).floor() as i64).into()
    }

    /// True if none on this side of the surface is nearer than the distance: the two sides of a thin wall do not count for
    /// each other.
    fn has_room_for(&self, sample: &Sample) -> bool {
        let [x, y, z] = self.cell(&sample.position);
        let is_near = |other: &u32| {
            let other = &self.samples[*other as usize];
            other.normal.dot(&sample.normal) > 0.0 && (other.position - sample.position).norm() < self.distance
        };
        let step = |cell: i64, step: i64| cell.saturating_add(step);
        !(0..27).any(|around| {
            let cell = [step(x, around % 3 - 1), step(y, around / 3 % 3 - 1), step(z, around / 9 - 1)];
            self.cells.get(&cell).is_some_and(|samples| samples.iter().any(is_near))
        })
    }

    fn add(&mut self, sample: Sample) {
        let index = self.samples.len() as u32;
        self.cells.entry(self.cell(&sample.position)).or_default().push(index);
        self.samples.push(sample);
    }
}

/// Adds a flat Gaussian whose own z axis is the normal.
fn push(gaussians: &mut Gaussians, sample: &Sample, linear_color: [f32; 3], distance: f64) {
    let along = (DEVIATION * distance).ln() as f32;
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &sample.normal)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let [x, y, z, w] = turn.coords.map(|value| value as f32).into();
    gaussians.positions.push(sample.position.coords.map(|value| value as f32).into());
    gaussians.log_scales.push([along, along, along + FLATNESS.ln() as f32]);
    gaussians.rotations.push([w, x, y, z]);
    gaussians.opacity_logits.push(OPACITY_LOGIT);
    gaussians.sh_dc.push(linear_color.map(|channel| (srgb(channel) - 0.5) / SH_C0));
}
