//! The underside of an object that stands on a surface.
//!
//! No photo shows it. Its shape is that of the lowest Gaussians, which scatter as those of the surface do, so it is uneven, and
//! the object would tilt in a simulator until it stood on its outermost bumps. What is nearer to the surface than the surface's own
//! spread cannot be told from it: it is set onto the surface, as is what lies below. The object then stands on all that
//! touches. What is higher, as the recess within the foot ring of a mug, stays as it is.

use nalgebra::Point3;

use super::{Collider, Mesh};
use crate::numeric::hull::Hull;
use crate::scene::{Plane, SupportSurface};

/// The plane on which an object stands, and what counts as touching it; in metres.
#[derive(Debug, Clone, Copy)]
pub struct Footing {
    plane: Plane,
    tolerance: f64,
}

impl Footing {
    /// The plane of the support or, if all colliders are higher than its spread, the one parallel to it through their lowest
    /// vertex: that the object stands there is known, and what is missing below is not. `None` without colliders.
    pub fn of(support: &SupportSurface, meters_per_unit: f64, colliders: &[Collider]) -> Option<Self> {
        let tolerance = support.spread * meters_per_unit;
        let mut plane = Plane { offset: support.plane.offset * meters_per_unit, ..support.plane };
        let heights = colliders.iter().flat_map(|collider| &collider.vertices).map(|vertex| plane.height(vertex));
        let lowest = heights.reduce(f64::min)?;
        if lowest > tolerance {
            plane.offset += lowest;
        }
        Some(Self { plane, tolerance })
    }

    fn touches(&self, point: &Point3<f64>) -> bool {
        self.plane.height(point) <= self.tolerance
    }

    fn onto(&self, point: &Point3<f64>) -> Point3<f64> {
        point - self.plane.normal * self.plane.height(point)
    }

    /// Moves all of these until the lowest is on the plane.
    fn set_down(&self, vertices: &mut [Point3<f64>]) {
        let lowest = vertices.iter().map(|vertex| self.plane.height(vertex)).fold(f64::INFINITY, f64::min);
        vertices.iter_mut().for_each(|vertex| *vertex -= self.plane.normal * lowest);
    }

    /// Sets the vertices that touch the plane onto it, and takes the convex hull. A collider that is no higher than the tolerance
    /// keeps its shape, and is set onto the plane as a whole.
    pub fn flatten_collider(&self, collider: &mut Collider) {
        if !collider.vertices.iter().any(|vertex| self.touches(vertex)) {
            return;
        }
        let on_plane = |vertex: &Point3<f64>| if self.touches(vertex) { self.onto(vertex) } else { *vertex };
        let is_flat = collider.vertices.iter().all(|vertex| self.touches(vertex));
        let moved: Vec<Point3<f64>> = collider.vertices.iter().map(on_plane).collect();
        if let Some(hull) = Hull::of(&moved).filter(|_| !is_flat) {
            collider.vertices = hull.vertices;
            collider.triangles = hull.triangles;
        } else {
            self.set_down(&mut collider.vertices);
        }
    }

    /// Sets the vertices that touch the plane onto it, but leaves the upper side of what is thin above it. What is all below it
    /// keeps its shape, and is raised onto it.
    pub fn flatten_mesh(&self, mesh: &mut Mesh) {
        if mesh.vertices.iter().all(|vertex| self.plane.height(vertex) <= 0.0) {
            self.set_down(&mut mesh.vertices);
            return;
        }
        let normals = mesh.normals();
        for (vertex, normal) in mesh.vertices.iter_mut().zip(normals) {
            let is_upper_side = normal.dot(&self.plane.normal) > 0.0 && self.plane.height(vertex) > 0.0;
            if self.touches(vertex) && !is_upper_side {
                *vertex = self.onto(vertex);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::Vector3;

    use super::*;

    /// Standard deviation of the support, m.
    const SPREAD: f64 = 0.002;

    fn support(normal: Vector3<f64>, offset: f64) -> SupportSurface {
        SupportSurface { plane: Plane { normal: normal.normalize(), offset }, spread: SPREAD }
    }

    fn collider(points: &[Point3<f64>]) -> Collider {
        let Hull { vertices, triangles } = Hull::of(points).unwrap();
        Collider { part: 0, name: String::new(), vertices, triangles }
    }

    fn flattened(support: &SupportSurface, mut collider: Collider) -> Collider {
        let footing = Footing::of(support, 1.0, std::slice::from_ref(&collider)).unwrap();
        footing.flatten_collider(&mut collider);
        collider
    }

    /// The area with which a collider stands on a plane, and its largest height below it.
    fn contact(collider: &Collider, plane: &Plane) -> (f64, f64) {
        let is_on = |v: &Point3<f64>| plane.height(v).abs() < 1e-12;
        let corners = collider.triangles.iter().map(|t| t.map(|v| collider.vertices[v as usize]));
        let on_plane = corners.filter(|corners| corners.iter().all(is_on));
        let area = on_plane.map(|[a, b, c]| 0.5 * (b - a).cross(&(c - a)).norm()).sum();
        (area, collider.vertices.iter().map(|v| -plane.height(v)).fold(0.0, f64::max))
    }

    /// A box of 80 mm x 60 mm x 200 mm whose underside is uneven by a spread to both sides: it would tilt by up to 2 spreads on
    /// 60 mm, which are 4 degrees. Afterwards it stands on its whole underside, on a plane that is level and on one that is not.
    #[test]
    fn a_box_with_an_uneven_underside_stands_on_all_of_it() {
        let mut random = fastrand::Rng::with_seed(7);
        let turn = nalgebra::UnitQuaternion::from_euler_angles(0.01, -0.012, 0.3);
        for (turn, offset) in [(nalgebra::UnitQuaternion::identity(), 0.0), (turn, 0.3)] {
            let support = support(turn * Vector3::z(), offset);
            let place = |x: f64, y: f64, z: f64| turn * Point3::new(x, y, z + offset);
            let mut points = Vec::new();
            for (i, j) in (0..9).flat_map(|i| (0..7).map(move |j| (i, j))) {
                let (x, y) = (0.01 * f64::from(i), 0.01 * f64::from(j));
                points.push(place(x, y, SPREAD * (2.0 * random.f64() - 1.0)));
                points.push(place(x, y, 0.2));
            }
            let uneven = collider(&points);
            let before = contact(&uneven, &support.plane);
            assert!(before.0 == 0.0 && before.1 > 0.5 * SPREAD, "{before:?}");
            let flat = flattened(&support, uneven);
            let (area, below) = contact(&flat, &support.plane);
            assert!((area - 0.08 * 0.06).abs() < 1e-9, "{area}");
            assert!(below < 1e-12, "{below}");
            let volume = Hull { vertices: flat.vertices, triangles: flat.triangles }.volume();
            assert!((volume - 0.08 * 0.06 * 0.2).abs() < 1e-9, "{volume}");
        }
    }

    /// A ball of radius R touches within a circle of radius sqrt(2 R t - t^2) for the tolerance t, and nowhere else.
    #[test]
    fn a_ball_touches_no_more_than_the_spread_allows() {
        const RADIUS: f64 = 0.02;
        let support = support(Vector3::z(), 0.0);
        let (mut points, rings) = (Vec::new(), 60);
        for (ring, turn) in (0..=rings).flat_map(|ring| (0..90).map(move |turn| (ring, turn))) {
            let (polar, azimuth) = (PI * f64::from(ring) / f64::from(rings), f64::from(turn) * PI / 45.0);
            let direction = Vector3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), -polar.cos());
            points.push(Point3::new(0.0, 0.0, RADIUS) + RADIUS * direction);
        }
        let flat = flattened(&support, collider(&points));
        let touching = (2.0 * RADIUS * SPREAD - SPREAD * SPREAD).sqrt();
        let on_plane = flat.vertices.iter().filter(|v| v.z.abs() < 1e-12).map(|v| v.coords.xy().norm());
        let widest = on_plane.fold(0.0, f64::max);
        // The rings are 1.05 mm apart.
        assert!(widest <= touching && widest > touching - 0.0012, "{widest} of {touching}");
    }

    #[test]
    fn what_does_not_touch_stays_and_what_hovers_is_flat_where_it_is_lowest() {
        let block = |low: f64| {
            let corner = |n: u32| [n & 1, n >> 1 & 1, n >> 2].map(f64::from);
            let uneven = |n: u32| if n < 4 { low + 0.0005 * f64::from(n) } else { 0.05 };
            collider(
                &(0..8).map(|n| Point3::new(0.05 * corner(n)[0], 0.05 * corner(n)[1], uneven(n))).collect::<Vec<_>>(),
            )
        };
        let support = support(Vector3::z(), 0.0);
        // Beside a collider that stands on the plane, one that is 3 spreads above it does not touch.
        let standing = block(0.0);
        let footing = Footing::of(&support, 1.0, &[standing, block(3.0 * SPREAD)]).unwrap();
        let mut above = block(3.0 * SPREAD);
        footing.flatten_collider(&mut above);
        assert_eq!(above, block(3.0 * SPREAD));
        // By itself, it stands on its own lowest points.
        let plane = Plane { offset: 3.0 * SPREAD, ..support.plane };
        let (area, below) = contact(&flattened(&support, block(3.0 * SPREAD)), &plane);
        assert!((area - 0.05 * 0.05).abs() < 1e-12 && below < 1e-12, "{area} {below}");
        assert!(Footing::of(&support, 1.0, &[]).is_none());
    }

    #[test]
    fn a_sheet_thinner_than_the_spread_keeps_its_thickness() {
        let support = support(Vector3::z(), 0.0);
        let corner =
            |n: u32, low: f64| Point3::new(f64::from(n & 1), f64::from(n >> 1 & 1), low + 0.001 * f64::from(n >> 2));
        let sheet = flattened(&support, collider(&(0..8).map(|n| corner(n, -0.0005)).collect::<Vec<_>>()));
        let (area, below) = contact(&sheet, &support.plane);
        let height = sheet.vertices.iter().map(|v| v.z).fold(0.0, f64::max);
        assert!(
            (area - 1.0).abs() < 1e-12 && below < 1e-12 && (height - 0.001).abs() < 1e-12,
            "{area} {below} {height}"
        );
        // So does its mesh, whose upper side is within the tolerance, too.
        let Collider { vertices, triangles, .. } = collider(&(0..8).map(|n| corner(n, 0.0005)).collect::<Vec<_>>());
        let footing = Footing { plane: support.plane, tolerance: SPREAD };
        let heights = |rise: f64| {
            let vertices = vertices.iter().map(|vertex| vertex + Vector3::z() * rise).collect();
            let mut mesh = Mesh { vertices, triangles: triangles.clone() };
            footing.flatten_mesh(&mut mesh);
            let mut micrometers: Vec<i64> = mesh.vertices.iter().map(|v| (1e6 * v.z).round() as i64).collect();
            micrometers.sort_unstable();
            micrometers.dedup();
            micrometers
        };
        assert_eq!(heights(0.0), [0, 1500], "above the plane");
        assert_eq!(heights(-0.003), [0, 1000], "below it");
    }
}
