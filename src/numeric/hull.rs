//! Convex hulls.

use crate::parallel;
use nalgebra::{Point2, Point3, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::transformation::try_convex_hull;

use super::sphere_directions;

/// Maximum number of vertices of a hull that PhysX and other engines accept.
const VERTICES: usize = 64;

/// A vertex this far beyond a plane, as a share of the hull's size, lies in it: far more than rounding errors, and far less
/// than a cell.
const FLAT: f64 = 1e-6;

/// Directions in which [`Hull::inner`] seeks points: with so many, that of a ball is 3 % too small.
const DIRECTIONS: usize = 300;

/// Six times the volume between a point in a face and that face, as a share of the cube of the hull's size: more than its
/// rounding errors.
const ROUNDING: f64 = 1e-12;

/// The convex hull of points in a plane, from the leftmost on, in the sense from the first axis to the second (Andrew's
/// monotone chain).
pub fn planar(mut points: Vec<Point2<f64>>) -> Vec<Point2<f64>> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let chain = |points: &mut dyn Iterator<Item = Point2<f64>>| {
        let mut chain: Vec<Point2<f64>> = Vec::new();
        for point in points {
            while chain.len() > 1 && turn(chain[chain.len() - 2], chain[chain.len() - 1], point) <= 0.0 {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = chain(&mut points.iter().copied());
    hull.extend(chain(&mut points.iter().rev().copied()));
    hull
}

/// Twice the area of a triangle, positive if its corners go round in the sense from the first axis to the second.
pub fn turn(a: Point2<f64>, b: Point2<f64>, c: Point2<f64>) -> f64 {
    (b - a).perp(&(c - a))
}

/// A convex polyhedron.
#[derive(Debug, Clone, PartialEq)]
pub struct Hull {
    pub vertices: Vec<Point3<f64>>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Hull {
    /// The hull of points; `None` if they span no volume.
    pub fn of(points: &[Point3<f64>]) -> Option<Self> {
        let points: Vec<_> = points.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let (vertices, triangles) = try_convex_hull(&points).ok()?;
        let hull = Self { vertices: vertices.iter().map(|v| Point3::new(v.x, v.y, v.z)).collect(), triangles };
        (hull.volume() > 0.0).then_some(hull)
    }

    /// The hull of those points that are farthest in some [`DIRECTIONS`]: a little too small, but quick however many points
    /// there are; `None` if they span no volume.
    pub fn inner(points: &[Point3<f64>]) -> Option<Self> {
        let directions: Vec<Vector3<f64>> = sphere_directions(DIRECTIONS).collect();
        let farthest = |direction: &Vector3<f64>| {
            let along = |p: &Point3<f64>| p.coords.dot(direction);
            points.iter().max_by(|a, b| along(a).total_cmp(&along(b))).copied()
        };
        let found: Vec<Point3<f64>> = parallel::flat_map(&directions, farthest);
        Self::of(&found)
    }

    /// A hull of at most [`VERTICES`] of its vertices: those that lie farthest outside the hull of the ones already
    /// taken, until none lies outside by more than `error`.
    pub fn simple(&self, error: f64) -> Option<Self> {
        let mut taken: Vec<Point3<f64>> = Vec::new();
        for x in -1..=1 {
            for y in -1..=1 {
                for z in -1..=1 {
                    let direction = Vector3::new(f64::from(x), f64::from(y), f64::from(z));
                    let far = self
                        .vertices
                        .iter()
                        .max_by(|a, b| a.coords.dot(&direction).total_cmp(&b.coords.dot(&direction)))?;
                    if !taken.contains(far) {
                        taken.push(*far);
                    }
                }
            }
        }
        loop {
            let hull = Self::of(&taken)?;
            let planes = hull.bounds();
            let beyond = |p: &Point3<f64>| planes.iter().map(|(n, d)| n.dot(&p.coords) - d).fold(0.0, f64::max);
            let (far, distance) = self.vertices.iter().map(|p| (p, beyond(p))).max_by(|a, b| a.1.total_cmp(&b.1))?;
            if distance <= error || taken.len() >= VERTICES || taken.contains(far) {
                return Some(hull);
            }
            taken.push(*far);
        }
    }

    /// The enclosed volume.
    pub fn volume(&self) -> f64 {
        let cone = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| self.vertices[v as usize].coords);
            a.dot(&b.cross(&c))
        };
        self.triangles.iter().map(cone).sum::<f64>() / 6.0
    }

    /// Outward unit normal n and distance d of each face: inside, n . p <= d.
    pub fn planes(&self) -> Vec<(Vector3<f64>, f64)> {
        let plane = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| self.vertices[v as usize]);
            let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
            Some((normal, normal.dot(&a.coords)))
        };
        self.triangles.iter().filter_map(plane).collect()
    }

    /// Those of the planes that no vertex lies beyond. Of points on a grid, many lie in one plane or on one line; the normals
    /// of some of the triangles between these are mere rounding errors.
    pub fn bounds(&self) -> Vec<(Vector3<f64>, f64)> {
        let [low, high] = self.extent();
        let error = FLAT * (high - low).norm();
        let holds_all = |(n, d): &(Vector3<f64>, f64)| self.vertices.iter().all(|v| n.dot(&v.coords) <= d + error);
        self.planes().into_iter().filter(holds_all).collect()
    }

    /// Whether a point lies inside, or beyond a face by at most `tolerance`.
    pub fn contains(&self, point: Point3<f64>, tolerance: f64) -> bool {
        let [low, high] = self.extent();
        let rounding = ROUNDING * (high - low).norm().powi(3);
        self.triangles.iter().all(|t| {
            let [a, b, c] = t.map(|v| self.vertices[v as usize]);
            let normal = (b - a).cross(&(c - a));
            normal.dot(&(point - a)) <= tolerance * normal.norm() + rounding
        })
    }

    /// The corners of its box.
    pub fn extent(&self) -> [Point3<f64>; 2] {
        let first = self.vertices[0];
        self.vertices.iter().fold([first, first], |[low, high], v| [low.inf(v), high.sup(v)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hulls_of_a_box_and_a_ball() {
        let corners: Vec<Point3<f64>> = (0..8)
            .map(|n| Point3::new(f64::from(n & 1), f64::from(n >> 1 & 1), 2.0 * f64::from(n >> 2)))
            .chain([Point3::new(0.5, 0.5, 1.0)])
            .collect();
        let hull = Hull::of(&corners).unwrap();
        assert!((hull.volume() - 2.0).abs() < 1e-12 && (Hull::inner(&corners).unwrap().volume() - 2.0).abs() < 1e-12);
        assert!(hull.contains(Point3::new(1.0, 1.0, 2.0), 0.0) && !hull.contains(Point3::new(1.01, 0.5, 1.0), 0.0));
        assert!(hull.contains(Point3::new(1.01, 0.5, 1.0), 0.02));
        let ball: Vec<Point3<f64>> = sphere_directions(5000).map(Point3::from).collect();
        let share = Hull::inner(&ball).unwrap().volume() / Hull::of(&ball).unwrap().volume();
        assert!((0.96..1.0).contains(&share), "{share}");
        assert!(Hull::of(&ball[..3]).is_none() && Hull::inner(&[]).is_none());
    }
}
