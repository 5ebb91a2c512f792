//! Triangles that share their corners: equal positions become one vertex.
//!
//! The result depends on the surface alone, not on the order of its vertices and triangles: both are sorted.

use nalgebra::Point3;

use super::frame::Frame;
use crate::numeric::forest::Forest;
use crate::parallel;
use crate::scene::mesh::Triangles;

/// Two vertices on boundaries that are this close are one, as a share of the mesh's size: the precision of the 32-bit numbers
/// that most files hold.
const GAP: f64 = 1e-6;

/// Triangles in the [`Frame`] of the measurement.
#[derive(Debug, Clone, Default)]
pub struct Welded {
    /// Sorted by coordinates; no two are equal.
    pub points: Vec<Point3<f64>>,
    /// Each starts with its smallest index; sorted.
    pub triangles: Vec<[u32; 3]>,
    /// Number of triangles that were left out because two of their corners are one, and of those kept that have no area.
    pub degenerate: usize,
    /// Number of triangles that were left out because another one has the same corners.
    pub duplicates: usize,
}

impl Welded {
    /// Joins vertices at equal positions. The surface has been checked.
    pub fn of(surface: &Triangles, frame: &Frame) -> Self {
        // Adding 0 makes -0 and 0 the same bits.
        let exact: Vec<[f64; 3]> = parallel::map(&surface.vertices, |position| position.map(|x| x + 0.0));
        let mut is_used = vec![false; exact.len()];
        surface.triangles.iter().flatten().for_each(|v| is_used[*v as usize] = true);
        let mut order: Vec<u32> = (0..exact.len() as u32).filter(|v| is_used[*v as usize]).collect();
        let by_position = |a: &u32, b: &u32| compare(&exact[*a as usize], &exact[*b as usize]);
        parallel::sort_unstable_by(&mut order, |a, b| by_position(a, b).then(a.cmp(b)));
        let mut point_of = vec![0; exact.len()];
        let mut points: Vec<Point3<f64>> = Vec::new();
        for (n, &vertex) in order.iter().enumerate() {
            if n == 0 || by_position(&order[n - 1], &vertex).is_ne() {
                points.push(frame.point(exact[vertex as usize]));
            }
            point_of[vertex as usize] = points.len() as u32 - 1;
        }
        let triangles = surface.triangles.iter().map(|t| t.map(|v| point_of[v as usize]));
        let mut welded = Self { points, ..Self::default() };
        welded.set_triangles(triangles.collect());
        welded
    }

    /// Joins vertices on the edges of only one triangle (`boundary`) that all but coincide; false if there are none.
    pub fn close_gaps(&mut self, boundary: &[[u32; 2]]) -> bool {
        let mut ends: Vec<u32> = boundary.iter().flatten().copied().collect();
        ends.sort_unstable();
        ends.dedup();
        let mut joined: Vec<u32> = (0..self.points.len() as u32).collect();
        let mut any = false;
        // Sorted by x, as all points are.
        ends.sort_by(|a, b| self.points[*a as usize].x.total_cmp(&self.points[*b as usize].x));
        for (n, &end) in ends.iter().enumerate() {
            let point = self.points[end as usize];
            let before = ends[..n].iter().rev().take_while(|other| point.x - self.points[**other as usize].x <= GAP);
            if let Some(near) = before.filter(|other| (self.points[**other as usize] - point).norm() <= GAP).min() {
                joined[end as usize] = joined[*near as usize];
                any = true;
            }
        }
        if any {
            let triangles = self.triangles.iter().map(|t| t.map(|v| joined[v as usize]));
            self.set_triangles(triangles.collect());
        }
        any
    }

    pub fn corners(&self, triangle: usize) -> [Point3<f64>; 3] {
        self.triangles[triangle].map(|v| self.points[v as usize])
    }

    /// Keeps the triangles with three different corners, each set of corners once, sorted.
    fn set_triangles(&mut self, triangles: Vec<[u32; 3]>) {
        let count = triangles.len();
        let mut kept = triangles;
        kept.retain(|[a, b, c]| a != b && b != c && c != a);
        self.degenerate += count - kept.len();
        for t in &mut kept {
            let least = (0..3).min_by_key(|k| t[*k]).unwrap_or(0);
            t.rotate_left(least);
        }
        parallel::sort_unstable_by(&mut kept, |s, t| (corners(s), s).cmp(&(corners(t), t)));
        let distinct = kept.len();
        kept = without_membranes(kept);
        kept.dedup_by_key(|t| corners(t));
        self.duplicates += distinct - kept.len();
        self.triangles = kept;
    }
}

/// The triangles without those that are there twice and part the inside of the surface: bodies that touch have their common
/// face twice, and the two as one have none there. Such membranes end at edges where an odd number of triangles meet if
/// each counts once. `triangles` are sorted by corners.
fn without_membranes(triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    let groups: Vec<&[[u32; 3]]> = triangles.chunk_by(|a, b| corners(a) == corners(b)).collect();
    if groups.len() == triangles.len() {
        return triangles;
    }
    let mut sides: Vec<([u32; 2], usize)> = Vec::with_capacity(3 * groups.len());
    for (group, copies) in groups.iter().enumerate() {
        let [a, b, c] = corners(&copies[0]);
        sides.extend([[a, b], [b, c], [a, c]].map(|edge| (edge, group)));
    }
    parallel::sort_unstable_by(&mut sides, Ord::cmp);
    let edges = || sides.chunk_by(|a, b| a.0 == b.0);
    let paired = |edge: &[([u32; 2], usize)]| -> Vec<usize> {
        edge.iter().map(|(_, group)| *group).filter(|group| groups[*group].len() == 2).collect()
    };
    let mut sheets = Forest::of(groups.len());
    for pairs in edges().map(paired) {
        pairs.windows(2).for_each(|two| _ = sheets.join(two[0], two[1], false));
    }
    let mut is_membrane = vec![false; groups.len()];
    for edge in edges().filter(|edge| edge.len() > 1 && edge.len() % 2 == 1) {
        paired(edge).into_iter().for_each(|group| is_membrane[sheets.root(group).0] = true);
    }
    let is_kept = |group: &usize| !is_membrane[sheets.root(*group).0];
    (0..groups.len()).filter(is_kept).flat_map(|group| groups[group]).copied().collect()
}

/// The indices in rising order.
fn corners(triangle: &[u32; 3]) -> [u32; 3] {
    let mut sorted = *triangle;
    sorted.sort_unstable();
    sorted
}

fn compare(a: &[f64; 3], b: &[f64; 3]) -> std::cmp::Ordering {
    a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2]))
}
