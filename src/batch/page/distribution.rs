//! The distribution of a positive quantity over the scenes: its histogram, and which values are far from the others.
//!
//! Everything is in logarithms: the masses of a data set span decades.

use minijinja::{Value, context};

use crate::numeric::median;
use crate::words::output::counted;
use crate::words::readable::significant;

/// With fewer values there is nothing to stand out from.
const LEAST_TO_COMPARE: usize = 8;
/// A value is far from the others if it is this many interquartile ranges outside the quartiles (Tukey, Exploratory Data
/// Analysis, 1977).
const FENCE: f64 = 1.5;
/// Values that differ by less than this factor are alike, so the interquartile range counts with at least its logarithm.
const ALIKE: f64 = 1.25;
const LEAST_BINS: usize = 6;
const MOST_BINS: usize = 30;
/// Size of a histogram without the numbers below it, in the unit of its picture.
const WIDTH: f64 = 360.0;
const HEIGHT: f64 = 96.0;
/// A single scene among thousands must be seen too.
const LEAST_HEIGHT: f64 = 2.0;

/// Which values are far from the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fences {
    pub low: f64,
    pub high: f64,
}

impl Fences {
    /// `None` if there are too few values.
    pub fn of(values: &[f64]) -> Option<Self> {
        if values.len() < LEAST_TO_COMPARE {
            return None;
        }
        let mut logs: Vec<f64> = values.iter().map(|value| value.ln()).collect();
        logs.sort_by(f64::total_cmp);
        let half = logs.len() / 2;
        let lower = median(logs[..half].to_vec())?;
        let upper = median(logs[logs.len() - half..].to_vec())?;
        let reach = FENCE * (upper - lower).max(ALIKE.ln());
        Some(Self { low: (lower - reach).exp(), high: (upper + reach).exp() })
    }
}

/// The histogram of positive values for the page's template; `None` if there are fewer than two.
pub fn histogram(title: &str, column: usize, unit: &str, values: &[f64]) -> Option<Value> {
    let (low, high) = values.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v)));
    if values.len() < 2 {
        return None;
    }
    let edges = edges(low, high, values.len());
    let mut counts = vec![0; edges.len() - 1];
    values.iter().for_each(|value| counts[bin_of(*value, &edges)] += 1);
    let most = counts.iter().copied().max().unwrap_or(1).max(1) as f64;
    let width = WIDTH / counts.len() as f64;
    let bars = (0..).zip(&counts).filter(|(_, count)| **count > 0).map(|(at, count)| {
        let height = (HEIGHT * *count as f64 / most).max(LEAST_HEIGHT);
        let [from, to] = [edges[at], edges[at + 1]];
        let text = format!("{}: {} to {} {unit}", counted(*count, "scene"), significant(from), significant(to));
        // Nothing is lost at the ends to rounding.
        let from = if at == 0 { 0.0 } else { from };
        let to = if at + 1 == counts.len() { f64::INFINITY } else { to };
        context! { x => width * f64::from(at as u32), y => HEIGHT - height, width, height, from, to => to.to_string(), text }
    });
    let x_of = |value: f64| WIDTH * (value / edges[0]).ln() / (edges[counts.len()] / edges[0]).ln();
    let ticks = ticks(edges[0], edges[counts.len()]).into_iter();
    let ticks = ticks.map(|value| context! { x => x_of(value), text => significant(value) });
    let middle = median(values.to_vec()).map(significant);
    Some(context! {
        title, column, unit, median => middle, bars => bars.collect::<Vec<_>>(), ticks => ticks.collect::<Vec<_>>(),
        most => most as usize,
    })
}

/// The edges of bins that are equally wide in logarithms, around values from `low` to `high`.
fn edges(low: f64, high: f64, count: usize) -> Vec<f64> {
    let bins = ((count as f64).sqrt().ceil() as usize).clamp(LEAST_BINS, MOST_BINS);
    // Values that are all alike stand in the middle.
    let spread = (high / low).ln().max(ALIKE.ln());
    let start = low * ((high / low).ln() / 2.0 - spread / 2.0).exp();
    (0..=bins).map(|at| start * (spread * at as f64 / bins as f64).exp()).collect()
}

fn bin_of(value: f64, edges: &[f64]) -> usize {
    edges.partition_point(|edge| *edge <= value).clamp(1, edges.len() - 1) - 1
}

/// A few round numbers from `low` to `high`.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    const MOST: usize = 6;
    let decades = || (low.log10().floor() as i32..=high.log10().ceil() as i32).map(|power| 10f64.powi(power));
    let round: [&[f64]; 4] = [
        &[1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
        &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0],
        &[1.0, 2.0, 5.0],
        &[1.0],
    ];
    let within = |steps: &[f64]| -> Vec<f64> {
        let all = decades().flat_map(|decade| steps.iter().map(move |step| step * decade));
        all.filter(|value| (low..=high).contains(value)).collect()
    };
    round.into_iter().map(within).find(|ticks| ticks.len() <= MOST).unwrap_or_else(|| {
        let all = within(&[1.0]);
        let step = all.len().div_ceil(MOST);
        all.into_iter().step_by(step).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_far_from_the_others_is_outside_the_fences() {
        let mut values: Vec<f64> = (10..=30).map(f64::from).collect();
        let fences = Fences::of(&values).unwrap();
        assert!(fences.low < 10.0 && fences.high > 30.0, "{fences:?}");
        values.push(5000.0);
        let fences = Fences::of(&values).unwrap();
        assert!(fences.high > 30.0 && fences.high < 5000.0, "{fences:?}");
        assert_eq!(Fences::of(&[1.0; 7]), None, "too few");
        let alike = Fences::of(&[1.0; 8]).unwrap();
        assert!(alike.low < 0.8 && alike.high > 1.25, "{alike:?}");
    }

    #[test]
    fn bins_span_the_values() {
        for values in [[0.001, 70.0], [2.0, 2.0], [1.0, 1.01]] {
            let edges = edges(values[0], values[1], 9);
            let factors: Vec<f64> = edges.windows(2).map(|bin| bin[1] / bin[0]).collect();
            assert!(factors.iter().all(|factor| (factor / factors[0] - 1.0).abs() < 1e-9), "{edges:?}");
            assert!(edges[0] <= values[0] * 1.000_001 && edges[edges.len() - 1] >= values[1] * 0.999_999, "{edges:?}");
            assert!(bin_of(values[0], &edges) <= bin_of(values[1], &edges));
        }
        let edges = [1.0, 2.0, 4.0];
        assert_eq!([0.9, 1.0, 1.9, 2.0, 4.0].map(|value| bin_of(value, &edges)), [0, 0, 0, 1, 1]);
    }

    #[test]
    fn the_axis_has_a_few_round_numbers() {
        assert_eq!(ticks(0.008, 30.0), [0.01, 0.1, 1.0, 10.0]);
        assert_eq!(ticks(1.1, 2.1), [1.2, 1.4, 1.6, 1.8, 2.0]);
        assert_eq!(ticks(1e-9, 1e9).len(), 5);
    }
}
