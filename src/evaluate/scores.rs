//! How close predicted numbers are to true ones: the measures of NeRF2Physics (Zhai et al. 2024), which papers use to
//! compare masses and hardnesses.

use serde::Serialize;

/// A predicted number and the true one, both above 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    pub predicted: f64,
    pub truth: f64,
}

/// The measures over all pairs; p is a prediction and t its truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Scores {
    /// Absolute difference error: mean of |p - t|, in the unit of the numbers.
    pub ade: f64,
    /// Absolute log difference error: mean of |ln p - ln t|.
    pub alde: f64,
    /// Absolute percentage error: mean of |p - t| / t.
    pub ape: f64,
    /// Min ratio error: mean of min(p/t, t/p); 1 is best.
    pub mnre: f64,
    /// Pairwise relationship accuracy: over all ordered pairs of two objects, how often p_i > p_j exactly when t_i >
    /// t_j (GaussianProperty, supplement C.2). `None` for fewer than two objects.
    pub pra: Option<f64>,
    pub count: usize,
}

impl Scores {
    /// The scores of these pairs; `None` if there are none.
    pub fn of(pairs: &[Pair]) -> Option<Self> {
        let mean = |error: fn(&Pair) -> f64| pairs.iter().map(error).sum::<f64>() / pairs.len() as f64;
        (!pairs.is_empty()).then(|| Self {
            ade: mean(|pair| (pair.predicted - pair.truth).abs()),
            alde: mean(|pair| (pair.predicted.ln() - pair.truth.ln()).abs()),
            ape: mean(|pair| (pair.predicted - pair.truth).abs() / pair.truth),
            mnre: mean(|pair| (pair.predicted / pair.truth).min(pair.truth / pair.predicted)),
            pra: pairwise_accuracy(pairs),
            count: pairs.len(),
        })
    }
}

fn pairwise_accuracy(pairs: &[Pair]) -> Option<f64> {
    let mut right = 0u64;
    for (i, a) in pairs.iter().enumerate() {
        for (_, b) in pairs.iter().enumerate().filter(|(j, _)| *j != i) {
            right += u64::from((a.truth > b.truth) == (a.predicted > b.predicted));
        }
    }
    let all = (pairs.len() * pairs.len().saturating_sub(1)) as u64;
    (all > 0).then(|| right as f64 / all as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(numbers: &[(f64, f64)]) -> Vec<Pair> {
        numbers.iter().map(|&(predicted, truth)| Pair { predicted, truth }).collect()
    }

    #[test]
    fn two_objects_by_hand() {
        // Twice too heavy, four times too light.
        let scores = Scores::of(&pairs(&[(2.0, 1.0), (1.0, 4.0)])).unwrap();
        assert_eq!(scores.ade, 2.0);
        assert!((scores.alde - 1.5 * 2f64.ln()).abs() < 1e-15);
        assert_eq!((scores.ape, scores.mnre, scores.pra), (0.875, 0.375, Some(0.0)));
    }

    #[test]
    fn a_tie_in_the_truth_is_half_right_where_the_predictions_differ() {
        let tied = Scores::of(&pairs(&[(2.0, 1.0), (1.0, 1.0)])).unwrap();
        assert_eq!(tied.pra, Some(0.5));
        assert_eq!(Scores::of(&pairs(&[(1.0, 2.0), (1.0, 2.0)])).unwrap().pra, Some(1.0));
    }

    #[test]
    fn one_object_has_no_order_and_none_no_scores() {
        assert_eq!(Scores::of(&pairs(&[(2.0, 1.0)])).unwrap().pra, None);
        assert_eq!(Scores::of(&[]), None);
    }
}
