//! Convex hulls as sets of points and of planes.

use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3};

use crate::numeric::{hull, sphere_directions};

/// A convex hull.
#[derive(Debug, Clone)]
pub struct Hull {
    pub corners: Vec<Vector3<f64>>,
    /// Outward unit normal n and distance d of each face: inside, n . p <= d.
    planes: Vec<(Vector3<f64>, f64)>,
    pub volume: f64,
}

impl Hull {
    /// The hull of points; `None` if they span no volume.
    pub fn of(points: &[Vector3<f64>]) -> Option<Self> {
        let points: Vec<Point3<f64>> = points.iter().copied().map(Point3::from).collect();
        let hull = hull::Hull::of(&points)?;
        let (planes, volume) = (hull.bounds(), hull.volume());
        Some(Self { corners: hull.vertices.into_iter().map(|vertex| vertex.coords).collect(), planes, volume })
    }

    /// How far a point lies beyond the face that it is farthest beyond; negative inside.
    pub fn beyond(&self, point: &Vector3<f64>) -> f64 {
        self.planes.iter().map(|(normal, d)| normal.dot(point) - d).fold(f64::NEG_INFINITY, f64::max)
    }

    /// How far the farthest of these points lies outside.
    pub fn farthest_beyond(&self, points: &[Vector3<f64>]) -> f64 {
        points.iter().map(|point| self.beyond(point)).fold(0.0, f64::max)
    }
}

/// Number of directions in which the extremes of points are sought. Between two of them lie about 5 degrees, so that a round
/// body loses 0.1 % of its radius.
const DIRECTIONS: usize = 1000;

/// The points that lie farthest in some direction, each once: the corners of the hull, or close to them.
pub fn extremes(points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    if points.len() <= DIRECTIONS / 4 {
        return points.to_vec();
    }
    let farthest = |direction: Vector3<f64>| {
        let mut best = (f64::NEG_INFINITY, 0);
        for (n, point) in points.iter().enumerate() {
            let along = direction.dot(point);
            if along > best.0 {
                best = (along, n);
            }
        }
        best.1
    };
    let found: BTreeSet<usize> = directions().map(farthest).collect();
    found.into_iter().map(|point| points[point]).collect()
}

/// The axes, and directions spread evenly.
fn directions() -> impl Iterator<Item = Vector3<f64>> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().flat_map(|axis| [axis, -axis]);
    axes.chain(sphere_directions(DIRECTIONS))
}

/// The sides of the box around points.
pub fn extent(points: &[Vector3<f64>]) -> Vector3<f64> {
    let Some(first) = points.first() else { return Vector3::zeros() };
    let (low, high) = points.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
    high - low
}
