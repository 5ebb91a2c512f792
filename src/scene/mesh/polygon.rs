//! Polygons cut into triangles: convex ones as a fan, others by clipping ears (Meisters 1975).

use nalgebra::{Point3, Vector3};

/// Clipping ears takes time quadratic in the number of corners; a polygon with more is cut as a fan.
const MOST_CLIPPED: usize = 2_000;

/// The corners of the triangles that make up a polygon with these corners, in its own winding: two fewer than it has
/// corners. A polygon with less than three corners has none.
pub(super) fn triangles(corners: &[[f64; 3]]) -> Vec<[usize; 3]> {
    let count = corners.len();
    if count < 3 {
        return Vec::new();
    }
    let points: Vec<Point3<f64>> = corners.iter().map(|corner| Point3::from(*corner)).collect();
    let normal = newell_normal(&points);
    let turn = |a: usize, b: usize, c: usize| (points[b] - points[a]).cross(&(points[c] - points[b])).dot(&normal);
    let is_convex = (0..count).all(|i| turn(i, (i + 1) % count, (i + 2) % count) >= 0.0);
    if count == 3 || is_convex || count > MOST_CLIPPED {
        return (1..count - 1).map(|i| [0, i, i + 1]).collect();
    }
    let mut left: Vec<usize> = (0..count).collect();
    let mut cut = Vec::with_capacity(count - 2);
    while left.len() > 3 {
        let around = |i: usize| [left[(i + left.len() - 1) % left.len()], left[i], left[(i + 1) % left.len()]];
        let is_ear = |i: &usize| {
            let [a, b, c] = around(*i);
            let is_inside = |p: &usize| {
                ![a, b, c].contains(p) && [(a, b), (b, c), (c, a)].iter().all(|(from, to)| turn(*from, *to, *p) >= 0.0)
            };
            turn(a, b, c) > 0.0 && !left.iter().any(is_inside)
        };
        // A polygon that crosses itself may have no ear; any corner is then as good.
        let ear = (0..left.len()).find(is_ear).unwrap_or(0);
        cut.push(around(ear));
        left.remove(ear);
    }
    cut.push([left[0], left[1], left[2]]);
    cut
}

/// The normal of a polygon that need not be flat or convex, twice its area long (Newell's method).
fn newell_normal(points: &[Point3<f64>]) -> Vector3<f64> {
    let first = points[0];
    points.windows(2).map(|pair| (pair[0] - first).cross(&(pair[1] - first))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[[f64; 3]]) -> (f64, f64) {
        let points: Vec<Point3<f64>> = corners.iter().map(|corner| Point3::from(*corner)).collect();
        let signed = |[a, b, c]: &[usize; 3]| (points[*b] - points[*a]).cross(&(points[*c] - points[*a])).z / 2.0;
        let cut = triangles(corners);
        assert_eq!(cut.len(), corners.len() - 2);
        (cut.iter().map(signed).sum(), cut.iter().map(|triangle| signed(triangle).abs()).sum())
    }

    #[test]
    fn polygons_are_covered_once_whatever_their_shape() {
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(area(&square), (1.0, 1.0));
        // A dart and an L, of which a fan would leave the outline.
        let dart = [[0.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 1.0, 0.0], [-2.0, 2.0, 0.0]];
        assert_eq!(area(&dart), (2.0, 2.0));
        let l = [[0.0, 3.0], [0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0]].map(|[x, y]| [x, y, 5.0]);
        assert_eq!(area(&l), (5.0, 5.0));
        assert!(triangles(&square[..2]).is_empty());
    }

    #[test]
    fn no_polygon_is_too_broken_to_cut() {
        let crossed = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.5, 2.0, 1.0]];
        assert_eq!(triangles(&crossed).len(), 3);
        assert_eq!(triangles(&[[7.0; 3]; 6]).len(), 4);
    }
}
