//! How much of a pad touches the object, and how far from its middle: at an edge, on a rail that is narrower than the pad, on
//! ribs and on what is strongly curved, it is less than all of it.
//!
//! A pad is a disc with the finger's area. Points are spread evenly over it, and each stands as high as the surface below it. Soft
//! rubber reaches [`GIVE_M`] below the highest of them.

use nalgebra::{Point3, Vector3};

use super::cells::Cells;
use super::places::Place;
use super::surface::{Surface, SurfacePoint};

/// Soft pads of 5 mm (E = 1 MPa) on 1.1e-4 m2 give way by as much under 33 N; a splat's surface is off by a third of it.
const GIVE_M: f64 = 0.0015;
/// What lies farther below a contact belongs to another side.
const DEEPEST_M: f64 = 0.006;
/// Points spread over a pad, as the seeds of a sunflower.
const SPREAD: usize = 48;
/// Facing the pad: within 60 degrees.
const FACING: f64 = 0.5;
/// The distance to the nearest other point of an evenly strewn surface is half of its spacing; no hole in it is wider.
const HOLE: f64 = 2.0;
/// Points from which the spacing is estimated.
const MEASURED: usize = 500;
/// A highest point that is not one stray: of this share of the points, the lowest.
const TOP: f64 = 0.8;

/// How both pads touch the object at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// The share of a pad that touches, of the pad that touches less.
    pub share: f64,
    /// Mean distance of the touching points from their middle, m, over both pads.
    pub arm_m: f64,
}

/// Pads that may press anywhere on a surface.
pub struct Pads<'a> {
    points: &'a [SurfacePoint],
    cells: Cells<'a>,
    radius_m: f64,
    /// How far apart points of the surface may lie without a hole between them.
    spacing_m: f64,
}

impl<'a> Pads<'a> {
    /// Pads of this radius; `positions` are those of the surface's points.
    pub fn new(surface: &'a Surface, positions: &'a [Point3<f64>], radius_m: f64) -> Self {
        let cells = Cells::new(positions, radius_m);
        let count = positions.len().min(MEASURED);
        let nearest = |k: usize| {
            let own = k * positions.len() / count;
            let others = cells.near(positions[own], radius_m).filter(|&i| i != own);
            others.map(|i| (positions[i] - positions[own]).norm()).fold(radius_m, f64::min)
        };
        let mut distances: Vec<f64> = (0..count).map(nearest).collect();
        distances.sort_by(f64::total_cmp);
        let spacing_m = HOLE * distances.get(count / 2).copied().unwrap_or(radius_m);
        Self { points: &surface.points, cells, radius_m, spacing_m }
    }

    /// How the pads touch at a place. A surface that is too sparse to tell counts as flat.
    pub fn touch(&self, place: &Place) -> Touch {
        let full_m = 2.0 / 3.0 * self.radius_m;
        if self.spacing_m > 0.5 * self.radius_m {
            return Touch { share: 1.0, arm_m: full_m };
        }
        let axis = place.axis();
        let [first, second] =
            [(place.contacts[0], -axis), (place.contacts[1], axis)].map(|(at, out)| self.pad(at, out));
        Touch { share: first.0.min(second.0), arm_m: full_m * 0.5 * (first.1 + second.1) }
    }

    /// The share of a pad that touches, and the mean distance from its middle relative to that of a whole pad.
    fn pad(&self, contact: Point3<f64>, outward: Vector3<f64>) -> (f64, f64) {
        let across = outward.cross(&if outward.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() }).normalize();
        let along = outward.cross(&across);
        let below: Vec<[f64; 3]> = self
            .cells
            .near(contact, self.radius_m + self.spacing_m + DEEPEST_M)
            .filter(|&i| self.points[i].normal.dot(&outward) > FACING)
            .map(|i| self.points[i].position - contact)
            .map(|off| [off.dot(&across), off.dot(&along), off.dot(&outward)])
            .filter(|[_, _, height]| height.abs() <= DEEPEST_M)
            .collect();
        let spread = self.spread();
        let heights: Vec<Option<f64>> = spread.iter().map(|at| height_at(*at, &below, self.spacing_m)).collect();
        let mut known: Vec<f64> = heights.iter().copied().flatten().collect();
        known.sort_by(f64::total_cmp);
        let Some(&top) = known.get((TOP * known.len() as f64) as usize) else { return (0.0, 0.0) };
        let touches = |height: &Option<f64>| height.is_some_and(|height| height >= top - GIVE_M);
        let touching: Vec<[f64; 2]> =
            spread.iter().zip(&heights).filter(|(_, height)| touches(height)).map(|(at, _)| *at).collect();
        (touching.len() as f64 / SPREAD as f64, mean_arm(&touching) / mean_arm(&spread))
    }

    /// Points that each stand for the same area of a pad.
    fn spread(&self) -> Vec<[f64; 2]> {
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let seed = |k: usize| {
            let off = self.radius_m * ((k as f64 + 0.5) / SPREAD as f64).sqrt();
            let (sin, cos) = (k as f64 * golden).sin_cos();
            [off * cos, off * sin]
        };
        (0..SPREAD).map(seed).collect()
    }
}

/// The mean height of the surface beside a point of the pad; `None` if there is a hole.
fn height_at([x, y]: [f64; 2], below: &[[f64; 3]], spacing_m: f64) -> Option<f64> {
    let near = below.iter().filter(|[u, v, _]| (u - x).hypot(v - y) <= spacing_m);
    let (count, sum) = near.fold((0, 0.0), |(count, sum), [_, _, height]| (count + 1, sum + height));
    (count > 0).then(|| sum / f64::from(count))
}

/// The mean distance of points from their middle.
fn mean_arm(points: &[[f64; 2]]) -> f64 {
    let count = points.len().max(1) as f64;
    let middle = [0, 1].map(|k| points.iter().map(|at| at[k]).sum::<f64>() / count);
    points.iter().map(|at| (at[0] - middle[0]).hypot(at[1] - middle[1])).sum::<f64>() / count
}
