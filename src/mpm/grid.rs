//! The background grid: only the nodes that particles can reach, in columns along the object's shortest direction.
//!
//! Over the rectangle of columns that particles touch, each column stores the contiguous span of nodes between the
//! lowest and the highest that any particle can reach before the next sort. So the grid costs memory and time in
//! proportion to the object, and the three nodes a particle touches in a column are neighbours in memory.
//!
//! Node (i, j, k) in grid axes lies at `spacing * (i, j, k)` from the simulation's origin. The grid's axes are a
//! permutation of x, y, z: columns are cut into slabs along `axes[0]`, the object's longest direction.

use std::ops::Range;

/// Floats in a node: momentum x, y, z, then mass; after the grid update velocity x, y, z, then mass.
pub const NODE: usize = 4;

/// Width of a slab in cells. A slab's particles touch nodes up to one cell before it and three cells after it (one of
/// these for the drift between sorts), so slabs of even number never touch the same node, nor do those of odd number.
pub const SLAB: usize = 4;

/// How far, in cells, a particle may drift between sorts.
pub const DRIFT: i32 = 1;

/// An empty span: the hull of this and another span is the other span.
pub const NOTHING: Range<i32> = Range { start: i32::MAX, end: i32::MIN };

/// The place in memory of every node.
#[derive(Debug, Clone, Default)]
pub struct Columns {
    /// The grid's first, second and third axis as indices into x, y, z.
    pub axes: [usize; 3],
    /// The node at local (0, 0), in grid axes.
    pub first: [i32; 2],
    /// Number of columns along the first and the second axis.
    pub count: [usize; 2],
    /// Per column, first axis major: index of its node k = 0 (which the column need not hold) among all nodes.
    pub base: Vec<i32>,
    /// Per column: the range of k of its nodes.
    pub span: Vec<Range<i32>>,
    /// Number of nodes stored before plane i of the first axis; one more entry than planes.
    pub plane: Vec<usize>,
}

impl Columns {
    /// Columns for particles whose stencils start at the cells `bases` (grid axes), with room to drift.
    pub fn around(axes: [usize; 3], bases: impl Iterator<Item = [i32; 3]> + Clone) -> Self {
        let mut low = [i32::MAX; 2];
        let mut high = [i32::MIN; 2];
        for base in bases.clone() {
            for a in 0..2 {
                low[a] = low[a].min(base[a]);
                high[a] = high[a].max(base[a]);
            }
        }
        let first = low.map(|l| l - DRIFT);
        let slabs = (high[0] - low[0]) as usize / SLAB + 1;
        let count = [SLAB * slabs + SLAB, (high[1] - low[1] + 3 + 2 * DRIFT) as usize];
        let mut own = vec![NOTHING; count[0] * count[1]];
        for base in bases {
            let span = &mut own[(base[0] - first[0]) as usize * count[1] + (base[1] - first[1]) as usize];
            *span = span.start.min(base[2] - DRIFT)..span.end.max(base[2] + 4 + DRIFT);
        }
        let span = dilated(&own, count);
        let mut columns = Self { axes, first, count, base: Vec::with_capacity(span.len()), span, plane: vec![] };
        let mut stored = 0;
        for (c, span) in columns.span.iter().enumerate() {
            if c % count[1] == 0 {
                columns.plane.push(stored);
            }
            columns.base.push(stored as i32 - span.start);
            stored += span.len();
        }
        columns.plane.push(stored);
        columns
    }

    /// Number of stored nodes.
    pub fn nodes(&self) -> usize {
        self.plane.last().copied().unwrap_or(0)
    }

    /// The number of the node at a cell, x y z, among those stored.
    pub fn node(&self, cell: [i32; 3]) -> usize {
        let [i, j, k] = self.axes.map(|a| cell[a]);
        let column = (i - self.first[0]) as usize * self.count[1] + (j - self.first[1]) as usize;
        (self.base[column] + k) as usize
    }

    pub fn slabs(&self) -> usize {
        (self.count[0] - SLAB) / SLAB
    }

    /// The slab of a particle whose stencil starts at first-axis cell `i`.
    pub fn slab_of(&self, i: i32) -> usize {
        (i - self.first[0] - DRIFT) as usize / SLAB
    }

    /// Number of nodes stored before the [`SLAB`] planes that begin with this slab. A slab's particles touch these
    /// planes and those of `slab + 1`, so there is one more group of planes than slabs.
    pub fn before_planes_of(&self, slab: usize) -> usize {
        self.plane[slab * SLAB]
    }
}

/// For each column, the span that any stencil starting within [`DRIFT`] of its particles' cells can reach.
fn dilated(own: &[Range<i32>], count: [usize; 2]) -> Vec<Range<i32>> {
    let (before, after) = (2 + DRIFT as usize, DRIFT as usize);
    let hull = |a: Range<i32>, b: &Range<i32>| a.start.min(b.start)..a.end.max(b.end);
    let window = |at: usize, n: usize| at.saturating_sub(before)..(at + after + 1).min(n);
    let mut along: Vec<Range<i32>> = Vec::with_capacity(own.len());
    for i in 0..count[0] {
        for j in 0..count[1] {
            along.push(window(j, count[1]).fold(NOTHING, |s, j| hull(s, &own[i * count[1] + j])));
        }
    }
    let mut spans = Vec::with_capacity(own.len());
    for i in 0..count[0] {
        for j in 0..count[1] {
            let span = window(i, count[0]).fold(NOTHING, |s, i| hull(s, &along[i * count[1] + j]));
            spans.push(if span.is_empty() { 0..0 } else { span });
        }
    }
    spans
}
