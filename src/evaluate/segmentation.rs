//! How well labels fit a hand-labelled map: intersection over union (IoU) by label, and their mean (mIoU), the paper's
//! measure for materials rendered into a view.

use std::collections::BTreeMap;

/// Pixels counted over any number of views, by label.
#[derive(Debug, Clone, PartialEq)]
pub struct IouTally<L> {
    counts: BTreeMap<L, Counts>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Counts {
    both: u64,
    truth: u64,
    predicted: u64,
}

impl<L> Default for IouTally<L> {
    fn default() -> Self {
        Self { counts: BTreeMap::new() }
    }
}

impl<L: Ord + Copy> IouTally<L> {
    /// Adds pixels: what a pixel is and what it was taken for; `None` is background, which is no label of its own but
    /// counts against the label that it was confused with.
    pub fn add(&mut self, pixels: impl Iterator<Item = (Option<L>, Option<L>)>) {
        for (truth, predicted) in pixels {
            if let Some(label) = truth {
                let counts = self.counts.entry(label).or_default();
                counts.truth += 1;
                counts.both += u64::from(predicted == truth);
            }
            if let Some(label) = predicted {
                self.counts.entry(label).or_default().predicted += 1;
            }
        }
    }

    /// IoU of every label that occurs in the truth.
    pub fn per_label(&self) -> BTreeMap<L, f64> {
        let real = self.counts.iter().filter(|(_, counts)| counts.truth > 0);
        real.map(|(label, c)| (*label, c.both as f64 / (c.truth + c.predicted - c.both) as f64)).collect()
    }

    /// Mean over the labels that occur in the truth; `None` where there is none.
    pub fn mean(&self) -> Option<f64> {
        let ious = self.per_label();
        (!ious.is_empty()).then(|| ious.values().sum::<f64>() / ious.len() as f64)
    }
}
