//! The paper's culling of redundant masks (`mask_nms` of LangSplat's preprocessing, which its code uses).

use super::mask::Mask;
use super::options::SelectionOptions;

/// A mask that lies inside another covers less than this share of the other.
const SMALL_SHARE_OF_OTHER: f64 = 0.5;
/// A mask that lies inside another has at least this share of its own area there.
const INSIDE_SHARE: f64 = 0.85;
/// Number of masks that are kept if none scores well enough.
const KEPT_ANYWAY: usize = 3;

/// The indices of the masks that are kept, best score first. `scores` are predicted IoU times stability.
///
/// Every mask is compared with all others, including those that are removed themselves. It is removed if
/// - one with a better score overlaps it with an IoU above `cull_iou`,
/// - its score is not above `cull_score` (if none is, the best three are kept), or
/// - it lies inside another, of which it covers less than half, and 1 - (overlap / its area) x (overlap / the other's
///   area) is above 1 - `cull_inner`.
pub fn cull(masks: &[&Mask], scores: &[f64], options: &SelectionOptions) -> Vec<usize> {
    let mut order: Vec<usize> = (0..masks.len()).collect();
    order.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]));
    let areas: Vec<f64> = masks.iter().map(|mask| mask.area() as f64).collect();
    let any_scores_well = scores.iter().any(|&score| score > options.cull_score);
    let mut stays: Vec<bool> = order
        .iter()
        .enumerate()
        .map(|(rank, &i)| scores[i] > options.cull_score || (!any_scores_well && rank < KEPT_ANYWAY))
        .collect();
    for (rank, &better) in order.iter().enumerate() {
        for (worse_rank, &worse) in order.iter().enumerate().skip(rank + 1) {
            let overlap = masks[better].overlap(masks[worse]) as f64;
            if overlap / (areas[better] + areas[worse] - overlap) > options.cull_iou {
                stays[worse_rank] = false;
            }
            let is_redundant = |own: f64, other: f64| {
                overlap / other < SMALL_SHARE_OF_OTHER
                    && overlap / own >= INSIDE_SHARE
                    && 1.0 - (overlap / own) * (overlap / other) > 1.0 - options.cull_inner
            };
            if is_redundant(areas[worse], areas[better]) {
                stays[worse_rank] = false;
            }
            if is_redundant(areas[better], areas[worse]) {
                stays[rank] = false;
            }
        }
    }
    order.into_iter().zip(stays).filter_map(|(i, stays)| stays.then_some(i)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn culled(masks: &[Mask], scores: &[f64]) -> Vec<usize> {
        cull(&masks.iter().collect::<Vec<_>>(), scores, &SelectionOptions::default())
    }

    /// Columns `start..end` of a strip 100 wide and 1 high.
    fn strip(start: u32, end: u32) -> Mask {
        Mask::from_fn(100, 1, |x, _| (start..end).contains(&x))
    }

    #[test]
    fn the_worse_of_two_alike_goes() {
        // IoU 90/110 = 0.818 and 88/112 = 0.786, either side of 0.8.
        assert_eq!(culled(&[strip(0, 50), strip(5, 50)], &[0.8, 0.9]), [1]);
        assert_eq!(culled(&[strip(0, 100), strip(0, 79)], &[0.8, 0.9]), [1, 0]);
    }

    #[test]
    fn a_low_score_goes_but_the_best_three_stay_if_all_are_low() {
        let masks = [strip(0, 10), strip(20, 30), strip(40, 50), strip(60, 70)];
        assert_eq!(culled(&masks, &[0.9, 0.7, 0.71, 0.2]), [0, 2]);
        assert_eq!(culled(&masks, &[0.3, 0.5, 0.4, 0.2]), [1, 2, 0]);
    }

    #[test]
    fn a_mask_well_inside_a_larger_one_goes_whichever_scores_better() {
        let masks = [strip(0, 60), strip(10, 39)];
        assert_eq!(culled(&masks, &[0.9, 0.8]), [0]);
        assert_eq!(culled(&masks, &[0.8, 0.9]), [0]);
        // Half of the larger one is not a detail of it.
        assert_eq!(culled(&[strip(0, 60), strip(10, 40)], &[0.9, 0.8]), [0, 1]);
        // 84% inside is not inside.
        assert_eq!(culled(&[strip(0, 60), strip(39, 64)], &[0.9, 0.8]), [0, 1]);
    }
}
