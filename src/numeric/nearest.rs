//! Nearest-neighbour search: a k-d tree without nodes, whose points are sorted so that the middle of every range splits
//! it.

/// A set of points to search.
pub struct Nearest {
    /// Each point and its index in the order given.
    points: Vec<([f32; 3], u32)>,
    /// The axis along which the middle point of a range splits it, indexed by the position of that point.
    axes: Vec<u8>,
}

impl Nearest {
    /// Sorts the points; results refer to the `n`th point as `n`.
    pub fn new(points: impl Iterator<Item = [f32; 3]>) -> Self {
        let mut points: Vec<_> = points.zip(0u32..).collect();
        let mut axes = vec![0; points.len()];
        split(&mut points, &mut axes);
        Self { points, axes }
    }

    /// The `k` points nearest to `to`, nearest first, as (squared distance, index); ties go to lower indices.
    pub fn find(&self, to: [f32; 3], k: usize) -> Vec<(f32, u32)> {
        let mut best = Vec::with_capacity(k + 1);
        if k > 0 {
            self.search(0, self.points.len(), to, k, &mut best);
        }
        best
    }

    fn search(&self, start: usize, end: usize, to: [f32; 3], k: usize, best: &mut Vec<(f32, u32)>) {
        if start >= end {
            return;
        }
        let middle = start.midpoint(end);
        let (point, index) = self.points[middle];
        let axis = usize::from(self.axes[middle]);
        let offset = to[axis] - point[axis];
        let (near, far) =
            if offset < 0.0 { ((start, middle), (middle + 1, end)) } else { ((middle + 1, end), (start, middle)) };
        self.search(near.0, near.1, to, k, best);
        offer(best, k, (squared_distance(point, to), index));
        if best.len() < k || offset * offset <= best[k - 1].0 {
            self.search(far.0, far.1, to, k, best);
        }
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
    rayon::join(|| split(left, left_axes), || split(&mut right[1..], &mut right_axes[1..]));
}

fn widest_axis(points: &[([f32; 3], u32)]) -> usize {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (point, _) in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let width = |axis: &usize| high[*axis] - low[*axis];
    (0..3).max_by(|a, b| width(a).total_cmp(&width(b))).unwrap_or(0)
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
