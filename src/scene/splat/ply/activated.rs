//! Values that were written as the renderer uses them, instead of as 3DGS trains and stores them: lengths instead of
//! logarithms of lengths, opacities instead of logits.

use crate::gaussians::Gaussians;

/// With fewer Gaussians, it may be chance that all values lie on one side.
const LEAST_GAUSSIANS: usize = 32;
/// The least span of values within 0 to 1 that are taken for opacities: a cloud built by hand may have one logit for all.
const LEAST_SPAN: f32 = 0.5;

/// The values that look activated, in words; `None` if none do. `flat`: the file has no third scale.
///
/// A logarithm above zero is a standard deviation above one scene unit. Some clouds are that coarse, such as those in
/// millimetres, but then the object is far larger than they are, and their opacities do not all lie between the logits 0
/// and 1.
pub(super) fn activated(gaussians: &Gaussians, flat: bool) -> Option<&'static str> {
    if gaussians.len() < LEAST_GAUSSIANS {
        return None;
    }
    let scales = if flat { 2 } else { 3 };
    let are_positive = gaussians.log_scales.iter().all(|values| values[..scales].iter().all(|value| *value > 0.0));
    let within = |value: &f32| (0.0..=1.0).contains(value);
    let are_shares = gaussians.opacity_logits.iter().all(within);
    match (are_positive, are_shares) {
        (true, true) => Some("all scales are positive and all opacities lie within 0 and 1"),
        (true, false) if are_lengths(gaussians) => Some(
            "all scales are positive; as logarithms they would make every Gaussian about as large as the whole cloud",
        ),
        (false, true) if span(&gaussians.opacity_logits) > LEAST_SPAN => Some("all opacities lie within 0 and 1"),
        _ => None,
    }
}

/// Whether at least half of the Gaussians are large for the cloud if their scales are logarithms, and small if they are
/// lengths: more and less than a quarter of the diagonal of the box around the middle half of the centres.
fn are_lengths(gaussians: &Gaussians) -> bool {
    let middle_half = |axis: usize| {
        let mut sides: Vec<f32> = gaussians.positions.iter().map(|position| position[axis]).collect();
        sides.sort_by(f32::total_cmp);
        f64::from(sides[sides.len() * 3 / 4] - sides[sides.len() / 4])
    };
    let quarter = 0.25 * (0..3).map(middle_half).map(|side| side * side).sum::<f64>().sqrt();
    let longest = |i: usize| gaussians.log_scales[i].into_iter().fold(0.0, f32::max);
    let are_most =
        |holds: &dyn Fn(usize) -> bool| 2 * (0..gaussians.len()).filter(|i| holds(*i)).count() >= gaussians.len();
    are_most(&|i| gaussians.scale(i).max() > quarter) && are_most(&|i| f64::from(longest(i)) < quarter)
}

fn span(values: &[f32]) -> f32 {
    let (low, high) =
        values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    high - low
}
