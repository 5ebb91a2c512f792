//! The ways in which all items of an object, its parts and what no part shows, may be made together, the most probable first.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// One way in which everything may be: the hypothesis, and for each item the index of its choice.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    pub hypothesis: usize,
    pub choices: Vec<usize>,
    /// All states together make 1.
    pub probability: f64,
}

/// Under one hypothesis, more states than this differ in items that hardly matter.
const MOST: usize = 256;

/// The most probable states under each hypothesis with a probability, which they share out among them; `items` has for each item, by
/// hypothesis, the probabilities of its choices, which need not add up to 1. Given the hypothesis, items are independent of each other.
pub fn most_probable(hypotheses: &[f64], items: &[Vec<Vec<f64>>]) -> Vec<State> {
    let mut states: Vec<State> = Vec::new();
    for (hypothesis, probability) in hypotheses.iter().enumerate().filter(|(_, probability)| **probability > 0.0) {
        let of_items: Vec<Vec<(usize, f64)>> = items.iter().map(|item| ranked(&item[hypothesis])).collect();
        let kept = of_hypothesis(&of_items, MOST);
        // A hypothesis under which much is in doubt has many states; those that are left out must not count against it.
        let all: f64 = items.iter().map(|item| item[hypothesis].iter().sum::<f64>()).product();
        let sum: f64 = kept.iter().map(|(_, share)| share).sum();
        let scale = if sum > 0.0 { probability * all / sum } else { 0.0 };
        let state = |(choices, share)| State { hypothesis, choices, probability: scale * share };
        states.extend(kept.into_iter().map(state));
    }
    // A stable sort, so among equals the order of hypotheses and of choices stays.
    states.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let sum: f64 = states.iter().map(|state| state.probability).sum();
    states.iter_mut().for_each(|state| state.probability /= sum);
    states
}

/// The choices that are possible, the most probable first.
fn ranked(probabilities: &[f64]) -> Vec<(usize, f64)> {
    let mut choices: Vec<(usize, f64)> = probabilities.iter().copied().enumerate().filter(|(_, p)| *p > 0.0).collect();
    choices.sort_by(|a, b| b.1.total_cmp(&a.1));
    choices
}

/// A combination by the rank of each item's choice.
#[derive(Debug, PartialEq)]
struct Combination {
    probability: f64,
    ranks: Vec<usize>,
    /// Only the ranks from this item on may still go up, so that each combination is met once.
    from: usize,
}

impl Eq for Combination {}

impl Ord for Combination {
    fn cmp(&self, other: &Self) -> Ordering {
        self.probability.total_cmp(&other.probability).then_with(|| other.ranks.cmp(&self.ranks))
    }
}

impl PartialOrd for Combination {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The `most` most probable combinations of choices, best first: the choice of each item, and the probability.
fn of_hypothesis(items: &[Vec<(usize, f64)>], most: usize) -> Vec<(Vec<usize>, f64)> {
    let first = items.iter().map(|item| item.first().map_or(0.0, |(_, p)| *p)).product();
    let mut open = BinaryHeap::from([Combination { probability: first, ranks: vec![0; items.len()], from: 0 }]);
    let mut found = Vec::new();
    while let Some(Combination { probability, ranks, from }) = open.pop() {
        for item in from..items.len() {
            let (now, next) = (items[item][ranks[item]].1, items[item].get(ranks[item] + 1));
            if let Some((_, next)) = next {
                let mut ranks = ranks.clone();
                ranks[item] += 1;
                open.push(Combination { probability: probability / now * next, ranks, from: item });
            }
        }
        let choices = items.iter().zip(&ranks).map(|(item, rank)| item[*rank].0).collect();
        found.push((choices, probability));
        if found.len() == most {
            break;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_combinations_come_once_and_the_most_probable_first() {
        let items = vec![vec![vec![0.2, 0.8], vec![1.0, 0.0]], vec![vec![0.5, 0.3, 0.2], vec![0.1, 0.2, 0.7]]];
        let states = most_probable(&[0.6, 0.4], &items);
        assert_eq!(states.len(), 2 * 3 + 3, "the second hypothesis excludes a choice");
        assert!((states.iter().map(|state| state.probability).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(states.is_sorted_by(|a, b| a.probability >= b.probability));
        assert_eq!((states[0].hypothesis, &*states[0].choices), (1, &[0, 2][..]));
        for state in &states {
            let share: f64 =
                state.choices.iter().zip(&items).map(|(choice, item)| item[state.hypothesis][*choice]).product();
            let expected = [0.6, 0.4][state.hypothesis] * share;
            assert!((state.probability - expected).abs() < 1e-12, "{state:?}");
        }
    }

    #[test]
    fn a_hypothesis_loses_nothing_because_much_is_in_doubt_under_it() {
        let items = vec![vec![vec![1.0, 0.0], vec![0.5, 0.5]]; 10];
        let states = most_probable(&[0.6, 0.4], &items);
        assert_eq!(states.len(), 1 + MOST, "of 1 and 1024");
        let of_second: f64 = states.iter().filter(|state| state.hypothesis == 1).map(|state| state.probability).sum();
        assert!((of_second - 0.4).abs() < 1e-12, "{of_second}");
    }

    #[test]
    fn of_very_many_combinations_the_most_probable_are_kept() {
        let items = vec![vec![vec![0.9, 0.1]]; 40];
        let states = most_probable(&[1.0], &items);
        assert_eq!(states.len(), MOST);
        let changed = |state: &State| state.choices.iter().filter(|choice| **choice == 1).count();
        assert!(states.is_sorted_by_key(changed), "one change is more probable than two");
    }
}
