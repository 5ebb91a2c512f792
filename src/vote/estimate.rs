//! One estimate from the ranges that several answers give.

use crate::numeric::median;
use crate::units::{Estimate, Range};

/// The median of the middles within the hull of the ranges.
pub(super) fn middle_and_hull(ranges: impl Iterator<Item = Range>) -> Estimate {
    let ranges: Vec<Range> = ranges.collect();
    let hull = ranges.iter().copied().reduce(Range::hull).expect("a label is won by an answer");
    Estimate::new(
        hull.low,
        median(ranges.iter().map(|range| range.mid()).collect()).expect("a label is won by an answer"),
        hull.high,
    )
}
