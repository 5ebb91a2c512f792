//! How often closed surfaces wind around a place: the crossings of a ray from there. It takes a fraction of the time of a
//! [`winding`](super::winding) number, which surfaces that are not closed need.

use nalgebra::{Point3, Vector3};

use super::tree::Tree;

/// Rays from a place, of which two must agree: one alone may pass through an edge.
pub const RAYS: [Vector3<f64>; 3] =
    [Vector3::new(0.83, 0.31, 0.47), Vector3::new(-0.29, 0.79, 0.54), Vector3::new(0.37, -0.61, -0.70)];

/// How often the triangles wind around a point. `turns` are, per triangle of the surface, those of its component around its
/// inside; 0 for components that do not count, among them all that are not closed.
pub fn crossings(tree: &Tree, point: Point3<f64>, turns: &[i32]) -> i32 {
    let along = |ray: Vector3<f64>| {
        // Away from the middle of the surface, where there is less of it.
        let direction = if ray.dot(&point.coords) < 0.0 { -ray } else { ray };
        let mut sum = 0;
        tree.hits(point, direction, |hit| {
            let turns = turns[hit.triangle as usize];
            sum += if hit.leaves { turns } else { -turns };
        });
        sum
    };
    let [first, second] = [along(RAYS[0]), along(RAYS[1])];
    if first == second {
        return first;
    }
    // If one of the two is right, it is the median.
    let mut all = [first, second, along(RAYS[2])];
    all.sort_unstable();
    all[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sides of a cube around the origin, facing outward.
    fn cube(half: f64) -> Vec<[Point3<f64>; 3]> {
        let corner = |n: usize| Point3::from([0, 1, 2].map(|axis| if n >> axis & 1 == 1 { half } else { -half }));
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).map(|side| side.map(corner)).collect()
    }

    #[test]
    fn a_cube_with_a_void_winds_once_around_its_wall() {
        let corners = [cube(1.0), cube(0.5)].concat();
        let tree = Tree::of(&corners);
        let turns = [[1; 12], [-1; 12]].concat();
        let on_rays_through_edges = RAYS.map(|ray| Point3::from(Vector3::new(1.0, 1.0, 0.2) - 0.3 * ray));
        for point in on_rays_through_edges.into_iter().chain([Point3::new(0.75, -0.6, 0.1)]) {
            let is_in_wall = point.coords.amax() > 0.5 && point.coords.amax() < 1.0;
            assert_eq!(crossings(&tree, point, &turns), i32::from(is_in_wall), "{point}");
        }
        assert_eq!(crossings(&tree, Point3::new(0.1, 0.2, 0.3), &turns), 0);
        assert_eq!(crossings(&tree, Point3::new(1.1, 0.2, 0.3), &turns), 0);
        // Only the outer one counts.
        assert_eq!(crossings(&tree, Point3::new(0.1, 0.2, 0.3), &[[1; 12], [0; 12]].concat()), 1);
    }
}
