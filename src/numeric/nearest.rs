//! Nearest-neighbour search: a k-d tree without nodes, whose points are sorted so that the middle of every range splits
//! it.
//!
//! A search ends after a given number of visits. One among the points of any capture is over long before; but if the
//! points were laid out for it, all at one distance from the point to which they are searched, it would visit every one, and the time
//! for all searches would grow with the square of their number.

use std::ops::Range;

use crate::parallel;

/// A set of points to search.
pub struct Nearest {
    /// Each point and its index in the order given.
    points: Vec<([f32; 3], u32)>,
    /// The axis along which the middle point of a range splits it, indexed by the position of that point.
    axes: Vec<u8>,
    /// The box around all points: lowest and highest corner.
    bounds: [[f32; 3]; 2],
}

impl Nearest {
    /// Sorts the points; results refer to the `n`th point as `n`.
    pub fn new(points: impl Iterator<Item = [f32; 3]>) -> Self {
        let mut points: Vec<_> = points.zip(0u32..).collect();
        let mut axes = vec![0; points.len()];
        let bounds = bounds(&points);
        split(&mut points, &mut axes);
        Self { points, axes, bounds }
    }

    /// The `k` points nearest to `to`, nearest first, as (squared distance, index); ties go to lower indices. Of a search that
    /// takes more than [`MOST_VISITS`], the nearest that it came by.
    pub fn find(&self, to: [f32; 3], k: usize) -> Vec<(f32, u32)> {
        self.find_within(to, k, MOST_VISITS)
    }

    /// The same for a search that may take up to `visits`, and at least enough to come by `k` points.
    pub fn find_within(&self, to: [f32; 3], k: usize, visits: usize) -> Vec<(f32, u32)> {
        let mut search = Search { to, k, best: Vec::with_capacity(k + 1), left: visits.max(4 * k) };
        if k > 0 {
            self.search(0..self.points.len(), self.offsets(to), &mut search);
        }
        search.best
    }

    /// How far a point lies outside of the box around all points, along each axis.
    fn offsets(&self, to: [f32; 3]) -> [f32; 3] {
        let [low, high] = self.bounds;
        std::array::from_fn(|axis| to[axis] - to[axis].max(low[axis]).min(high[axis]))
    }

    /// Searches a range of the points. `offsets` lead from the box in which these lie to the point to which they are searched: along
    /// each axis, none of them is nearer.
    fn search(&self, Range { start, end }: Range<usize>, offsets: [f32; 3], search: &mut Search) {
        if start >= end || search.left == 0 || !search.may_gain(offsets) {
            return;
        }
        search.left -= 1;
        let Search { to, k, .. } = *search;
        let middle = start.midpoint(end);
        let (point, index) = self.points[middle];
        let axis = usize::from(self.axes[middle]);
        let offset = to[axis] - point[axis];
        let (near, far) =
            if offset < 0.0 { (start..middle, middle + 1..end) } else { (middle + 1..end, start..middle) };
        self.search(near, offsets, search);
        offer(&mut search.best, k, (squared_distance(point, to), index));
        let mut beyond = offsets;
        beyond[axis] = offset;
        self.search(far, beyond, search);
    }
}

/// The most points that a search visits: several times as many as any among a million points of a capture.
const MOST_VISITS: usize = 1 << 14;

/// A search that goes on.
struct Search {
    to: [f32; 3],
    k: usize,
    best: Vec<(f32, u32)>,
    /// How many more points it may visit.
    left: usize,
}

impl Search {
    /// True if a point that is at least this far along each axis can be among the best. (Each rounding keeps the order, so the sum is
    /// never more than the squared distance of such a point.)
    fn may_gain(&self, offsets: [f32; 3]) -> bool {
        self.best.len() < self.k || squared_distance(offsets, [0.0; 3]) <= self.best[self.k - 1].0
    }
}

fn split(points: &mut [([f32; 3], u32)], axes: &mut [u8]) {
    if points.is_empty() {
        return;
    }
    let axis = widest_axis(points);
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    axes[middle] = axis as u8;
    let (left, right) = points.split_at_mut(middle);
    let (left_axes, right_axes) = axes.split_at_mut(middle);
    parallel::join(|| split(left, left_axes), || split(&mut right[1..], &mut right_axes[1..]));
}

fn widest_axis(points: &[([f32; 3], u32)]) -> usize {
    let [low, high] = bounds(points);
    let width = |axis: &usize| high[*axis] - low[*axis];
    (0..3).max_by(|a, b| width(a).total_cmp(&width(b))).unwrap_or(0)
}

/// The lowest and the highest corner of the box around points.
fn bounds(points: &[([f32; 3], u32)]) -> [[f32; 3]; 2] {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (point, _) in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    [low, high]
}

/// Keeps the best `k` in order.
fn offer(best: &mut Vec<(f32, u32)>, k: usize, candidate: (f32, u32)) {
    let place = best.partition_point(|known| known.0.total_cmp(&candidate.0).then(known.1.cmp(&candidate.1)).is_lt());
    if place < k {
        best.insert(place, candidate);
        best.truncate(k);
    }
}

fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a sphere, which are all equally far from its centre.
    fn sphere(count: usize) -> Nearest {
        let golden = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
        Nearest::new((0..count).map(|i| {
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / count as f32;
            let (sin, cos) = (golden * i as f32).sin_cos();
            let ring = (1.0 - z * z).sqrt();
            [ring * cos, ring * sin, z]
        }))
    }

    /// How many points a search visits.
    fn visits(points: &Nearest, to: [f32; 3], k: usize, most: usize) -> usize {
        let mut search = Search { to, k, best: Vec::new(), left: most };
        points.search(0..points.points.len(), points.offsets(to), &mut search);
        most - search.left
    }

    #[test]
    fn a_search_among_points_at_one_distance_ends() {
        let points = sphere(100_000);
        assert_eq!(visits(&points, [0.0; 3], 1, MOST_VISITS), MOST_VISITS, "the points are laid out for it");
        for to in [[0.0; 3], [1e20, 0.0, 0.0], [f32::MAX; 3]] {
            assert!(visits(&points, to, 1, MOST_VISITS) <= MOST_VISITS);
            assert_eq!(points.find(to, 17).len(), 17);
            assert_eq!(points.find_within(to, 17, 0).len(), 17);
        }
        // A search from anywhere else does not come to the limit, so that its result is exact.
        for to in [[1.0, 0.0, 0.0], [0.6, -0.7, 0.2], [2.0, 3.0, -1.0]] {
            let taken = visits(&points, to, 17, usize::MAX);
            assert!(taken < MOST_VISITS, "{taken}");
        }
    }
}
