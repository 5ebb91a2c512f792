//! A tree of boxes around triangles, for rays.

use crate::parallel;
use nalgebra::{Point3, Vector3};

/// Maximum number of triangles of a leaf.
const LEAF: usize = 6;
/// Bits for each axis of a place on the curve along which triangles are sorted.
const BITS: u32 = 21;
/// Depth up to which the halves of a tree are built side by side.
const PARALLEL: usize = 4096;
/// More than the depth of any tree: each half has half the triangles.
pub const MOST_DEPTH: usize = 40;

/// Triangles in a tree: each node halves those of the one above.
pub struct Tree {
    /// The root first, then all nodes of its first half, then those of its second.
    pub nodes: Vec<Node>,
    /// Per triangle of the tree, its number in the surface.
    pub number: Vec<u32>,
    /// Per triangle of the tree.
    pub corners: Vec<[Point3<f64>; 3]>,
}

/// A box around triangles.
#[derive(Debug, Clone, Copy)]
pub struct Node {
    pub low: Point3<f64>,
    pub high: Point3<f64>,
    /// The first of its triangles in the tree, and their number.
    pub first: u32,
    pub count: u32,
    /// The node of the second half; 0 in a leaf. That of the first half is the next one.
    pub second: u32,
}

/// A place where a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    pub distance: f64,
    /// Number in the surface.
    pub triangle: u32,
    /// Whether the ray leaves through the front of the triangle, coming from its back.
    pub leaves: bool,
}

impl Tree {
    /// A tree of at least one triangle.
    pub fn of(corners: &[[Point3<f64>; 3]]) -> Self {
        let (low, high) = extent(corners.iter().flatten());
        let cells = (1u64 << BITS) as f64;
        let per_cell = (high - low).map(|side| if side > 0.0 { cells / side } else { 0.0 });
        let place = |n: usize| {
            let position = (middle(&corners[n]) - low).component_mul(&per_cell);
            let [x, y, z] = [position.x, position.y, position.z].map(|c| spread((c as u64).min((1 << BITS) - 1)));
            (x | y << 1 | z << 2, n as u32)
        };
        let mut places: Vec<(u64, u32)> = parallel::map_range(corners.len(), place);
        parallel::sort_unstable_by(&mut places, Ord::cmp);
        let number: Vec<u32> = places.into_iter().map(|(_, n)| n).collect();
        let corners: Vec<_> = parallel::map(&number, |n| corners[*n as usize]);
        let blank = Node { low, high, first: 0, count: 0, second: 0 };
        let mut nodes = vec![blank; node_count(corners.len())];
        build(&mut nodes, 0, 0, &corners);
        Self { nodes, number, corners }
    }

    /// Every place where the ray from `origin` along `direction` meets a triangle, in no order.
    pub fn hits(&self, origin: Point3<f64>, direction: Vector3<f64>, mut found: impl FnMut(Hit)) {
        let inverse = direction.map(|d| 1.0 / d);
        let mut stack = [0; MOST_DEPTH];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let at = stack[waiting] as usize;
            let node = &self.nodes[at];
            if !node.is_met(origin, inverse) {
                continue;
            }
            if node.second > 0 {
                stack[waiting] = node.second;
                stack[waiting + 1] = at as u32 + 1;
                waiting += 2;
                continue;
            }
            for n in node.triangles() {
                if let Some((distance, leaves)) = meet(&self.corners[n], origin, direction) {
                    found(Hit { distance, triangle: self.number[n], leaves });
                }
            }
        }
    }
}

impl Node {
    pub fn triangles(&self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// Whether the ray passes through the box (the slab method of Kay and Kajiya 1986).
    fn is_met(&self, origin: Point3<f64>, inverse: Vector3<f64>) -> bool {
        let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
        for axis in 0..3 {
            let [a, b] = [self.low[axis], self.high[axis]].map(|side| (side - origin[axis]) * inverse[axis]);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        // The few units in the last place by which the sides may be off.
        enter <= leave * (1.0 + 1e-12)
    }
}

/// Distance to a triangle along a ray and whether the ray leaves through its front (Moeller and Trumbore 1997).
fn meet([a, b, c]: &[Point3<f64>; 3], origin: Point3<f64>, direction: Vector3<f64>) -> Option<(f64, bool)> {
    let (ab, ac) = (b - a, c - a);
    let across = direction.cross(&ac);
    let det = ab.dot(&across);
    if det == 0.0 {
        return None;
    }
    let from_a = origin - a;
    let u = from_a.dot(&across) / det;
    let other = from_a.cross(&ab);
    let v = direction.dot(&other) / det;
    let distance = ac.dot(&other) / det;
    // With a negative determinant the ray comes from the back.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some((distance, det < 0.0))
}

/// Builds the nodes of `corners`, the first of which is number `first` of the tree; the first node is number `at`.
fn build(nodes: &mut [Node], at: usize, first: usize, corners: &[[Point3<f64>; 3]]) {
    let count = corners.len();
    nodes[0].first = first as u32;
    nodes[0].count = count as u32;
    if count <= LEAF {
        (nodes[0].low, nodes[0].high) = extent(corners.iter().flatten());
        return;
    }
    let (half, left_nodes) = (count / 2, node_count(count / 2));
    let (root, below) = nodes.split_at_mut(1);
    let (left, right) = below.split_at_mut(left_nodes);
    let (left_corners, right_corners) = corners.split_at(half);
    let second = at + 1 + left_nodes;
    let mut build_left = || build(left, at + 1, first, left_corners);
    let mut build_right = || build(right, second, first + half, right_corners);
    if count > PARALLEL {
        parallel::join(build_left, build_right);
    } else {
        build_left();
        build_right();
    }
    root[0].low = left[0].low.inf(&right[0].low);
    root[0].high = left[0].high.sup(&right[0].high);
    root[0].second = second as u32;
}

/// Number of nodes of a tree of so many triangles.
fn node_count(triangles: usize) -> usize {
    if triangles <= LEAF { 1 } else { 1 + node_count(triangles / 2) + node_count(triangles - triangles / 2) }
}

pub fn middle([a, b, c]: &[Point3<f64>; 3]) -> Point3<f64> {
    Point3::from((a.coords + b.coords + c.coords) / 3.0)
}

/// The corners of the box around points.
pub fn extent<'a>(points: impl Iterator<Item = &'a Point3<f64>>) -> (Point3<f64>, Point3<f64>) {
    let none = (Point3::from([f64::INFINITY; 3]), Point3::from([f64::NEG_INFINITY; 3]));
    points.fold(none, |(low, high), point| (low.inf(point), high.sup(point)))
}

/// The lowest 21 bits, each followed by two zeros (Morton 1966).
fn spread(mut bits: u64) -> u64 {
    for (shift, mask) in [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        bits = (bits | bits << shift) & mask;
    }
    bits
}
