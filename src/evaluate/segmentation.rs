//! How well labels match a hand-labelled map: intersection over union (IoU) by label, and their mean (mIoU), the
//! paper's measure for materials rendered into a view.

use std::collections::BTreeMap;

use serde::Serialize;

use super::vocabulary::Vocabulary;
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::render::{RenderOptions, render_labelings};
use crate::vote::MaterialField;
use crate::words::output::one_line;

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
    /// Adds pixels, each as its true label and its predicted label; `None` is background, which is not a label itself
    /// but counts against the label with which it was confused.
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

    /// Adds the pixels of another tally.
    pub fn join(&mut self, other: &Self) {
        for (label, counts) in &other.counts {
            let own = self.counts.entry(*label).or_default();
            own.both += counts.both;
            own.truth += counts.truth;
            own.predicted += counts.predicted;
        }
    }

    /// IoU of every label that occurs in the truth.
    pub fn per_label(&self) -> BTreeMap<L, f64> {
        let real = self.counts.iter().filter(|(_, counts)| counts.truth > 0);
        real.map(|(label, c)| (*label, c.both as f64 / (c.truth + c.predicted - c.both) as f64)).collect()
    }

    /// Mean over the labels that occur in the truth; `None` if there are none.
    pub fn mean(&self) -> Option<f64> {
        let ious = self.per_label();
        (!ious.is_empty()).then(|| ious.values().sum::<f64>() / ious.len() as f64)
    }
}

/// A view with the label of each of its pixels, row by row; `None` outside the object.
pub struct LabelledView<'a> {
    pub camera: Camera,
    pub truth: Vec<Option<&'a str>>,
}

/// A material field with the names of its labels.
pub struct NamedField<'f, 'a> {
    pub field: &'f MaterialField,
    /// Names of `field.parts`.
    pub names: Vec<&'a str>,
}

impl<'a> NamedField<'_, 'a> {
    /// The distinct names, and for each Gaussian the index of its own: parts of one name are blended as one.
    fn labels(&self) -> (Vec<&'a str>, Vec<u32>) {
        let mut distinct = self.names.clone();
        distinct.sort_unstable();
        distinct.dedup();
        let place = |name: &str| distinct.iter().position(|other| *other == name).expect("listed above") as u32;
        let of_label: Vec<u32> = self.names.iter().map(|name| place(name)).collect();
        let labels = self.field.part_index.iter().map(|&label| of_label[label as usize]).collect();
        (distinct, labels)
    }
}

/// For each field, counts the pixels of the views, each as the label that contributes most to its light.
pub fn tallies<'a>(
    gaussians: &Gaussians,
    fields: &[NamedField<'_, 'a>],
    views: &[LabelledView<'a>],
) -> Vec<IouTally<&'a str>> {
    let labelings: Vec<(Vec<&str>, Vec<u32>)> = fields.iter().map(NamedField::labels).collect();
    let labels: Vec<&[u32]> = labelings.iter().map(|(_, labels)| labels.as_slice()).collect();
    let mut tallies = vec![IouTally::default(); fields.len()];
    for view in views {
        let drawn = render_labelings(gaussians, &view.camera, &labels, &RenderOptions::default());
        for ((tally, drawn), (names, _)) in tallies.iter_mut().zip(drawn).zip(&labelings) {
            let drawn = drawn.into_iter().map(|label| label.map(|label| names[label as usize]));
            tally.add(view.truth.iter().copied().zip(drawn));
        }
    }
    tallies
}

/// How well labels match.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Score {
    /// Mean over the labels; `None` if the truth has none.
    pub mean_iou: Option<f64>,
    pub per_label: BTreeMap<String, f64>,
}

impl Score {
    fn of(tally: &IouTally<&str>) -> Self {
        let per_label = tally.per_label().into_iter().map(|(label, iou)| (label.to_owned(), iou));
        Self { mean_iou: tally.mean(), per_label: per_label.collect() }
    }
}

/// The result of one way of labelling over all objects: the pixels of all are counted together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Column {
    #[serde(flatten)]
    pub overall: Score,
    pub per_object: BTreeMap<String, Score>,
}

impl Column {
    fn of(tallies: &[(String, IouTally<&str>)]) -> Self {
        let mut all = IouTally::default();
        tallies.iter().for_each(|(_, tally)| all.join(tally));
        let per_object = tallies.iter().map(|(object, tally)| (object.clone(), Score::of(tally)));
        Self { overall: Score::of(&all), per_object: per_object.collect() }
    }
}

/// The counts for one object.
pub struct ObjectTallies<'a> {
    pub object: String,
    /// The counts for the whole method.
    pub voted: IouTally<&'a str>,
    /// The counts for answers to sheets without the global picture, if they are recorded.
    pub local_only: Option<IouTally<&'a str>>,
    /// The counts for each view alone, by its name.
    pub single_views: Vec<(String, IouTally<&'a str>)>,
}

/// The paper's table: the method and its ablations.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SegmentationEvaluation {
    pub labels: Vocabulary,
    #[serde(flatten)]
    pub voted: Column,
    /// The result for the objects that have it recorded; `None` if none has.
    pub local_only: Option<Column>,
    /// The whole method on the objects of `local_only`.
    pub voted_beside_local_only: Option<Column>,
    /// For every object, the single view with the best score.
    pub no_vote: Column,
    /// That view, by object.
    pub best_view: BTreeMap<String, String>,
    /// For every object, the mean over all single views of their mean IoU: the worth of a view that is not chosen
    /// with knowledge of the truth.
    pub mean_view: BTreeMap<String, f64>,
}

impl SegmentationEvaluation {
    /// Computes the scores from the counts.
    pub fn of(labels: Vocabulary, objects: Vec<ObjectTallies>) -> Self {
        let (mut voted, mut local, mut beside, mut single) = (vec![], vec![], vec![], vec![]);
        let (mut best_view, mut mean_view) = (BTreeMap::new(), BTreeMap::new());
        for ObjectTallies { object, voted: own, local_only, single_views } in objects {
            if let Some(tally) = local_only {
                local.push((object.clone(), tally));
                beside.push((object.clone(), own.clone()));
            }
            let means: Vec<f64> = single_views.iter().filter_map(|(_, tally)| tally.mean()).collect();
            if !means.is_empty() {
                mean_view.insert(object.clone(), means.iter().sum::<f64>() / means.len() as f64);
            }
            // Among equals, the first.
            let best =
                single_views.into_iter().rev().max_by(|a, b| a.1.mean().partial_cmp(&b.1.mean()).expect("no NaN"));
            if let Some((view, tally)) = best {
                best_view.insert(object.clone(), view);
                single.push((object.clone(), tally));
            }
            voted.push((object, own));
        }
        let some = |tallies: &[(String, IouTally<&str>)]| (!tallies.is_empty()).then(|| Column::of(tallies));
        Self {
            labels,
            voted: Column::of(&voted),
            local_only: some(&local),
            voted_beside_local_only: some(&beside),
            no_vote: Column::of(&single),
            best_view,
            mean_view,
        }
    }

    /// The table: one row per label and a mean for every object, then for all.
    pub fn text(&self) -> String {
        let mut text =
            format!("{:<16} {:<10} {:>8} {:>11} {:>8}\n", "object", "label", "voted", "local only", "no vote");
        for (object, score) in &self.voted.per_object {
            let of_object = |column: &'_ Column| column.per_object.get(object).cloned();
            let local = self.local_only.as_ref().and_then(of_object);
            text += &rows(object, score, local.as_ref(), of_object(&self.no_vote).as_ref());
        }
        text += &rows("all", &self.voted.overall, None, Some(&self.no_vote.overall));
        if let (Some(local), Some(beside)) = (&self.local_only, &self.voted_beside_local_only) {
            text += &rows("with local only", &beside.overall, Some(&local.overall), None);
        }
        let views: Vec<String> = self.best_view.iter().map(|(object, view)| format!("{view} of {object}")).collect();
        text += &format!("\nno vote: only the view that scores best ({})", views.join(", "));
        let means: Vec<String> = self.mean_view.iter().map(|(object, mean)| format!("{object} {mean:.4}")).collect();
        text + &format!("\nno vote, mean IoU over the views: {}", means.join(", "))
    }
}

fn rows(object: &str, voted: &Score, local: Option<&Score>, single: Option<&Score>) -> String {
    let number = |iou: Option<f64>| iou.map_or_else(|| "-".to_owned(), |iou| format!("{iou:.4}"));
    let row = |first: &str, label: &str, iou_of: &dyn Fn(&Score) -> Option<f64>| {
        let [a, b, c] = [Some(voted), local, single].map(|score| number(score.and_then(iou_of)));
        let first = one_line(first);
        format!("{first:<16} {label:<10} {a:>8} {b:>11} {c:>8}\n")
    };
    let mut text = String::new();
    for (n, label) in voted.per_label.keys().enumerate() {
        text += &row(if n == 0 { object } else { "" }, label, &|score| score.per_label.get(label).copied());
    }
    text + &row("", "mean", &|score| score.mean_iou)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tally(pixels: &[(&'static str, &'static str)]) -> IouTally<&'static str> {
        let named = |name: &&'static str| Some(*name).filter(|name| !name.is_empty());
        let mut tally = IouTally::default();
        tally.add(pixels.iter().map(|(truth, drawn)| (named(truth), named(drawn))));
        tally
    }

    #[test]
    fn background_counts_against_the_label_it_was_confused_with() {
        let tally = tally(&[("wood", "wood"), ("wood", ""), ("", "wood"), ("metal", "wood"), ("", "glass")]);
        // Wood: 1 of 4 pixels; metal: none of 1; glass is not in the truth.
        assert_eq!(tally.per_label(), BTreeMap::from([("metal", 0.0), ("wood", 0.25)]));
        assert_eq!(tally.mean(), Some(0.125));
    }

    #[test]
    fn all_objects_are_counted_pixel_by_pixel_and_the_best_view_stands_for_no_vote() {
        let right = || tally(&[("wood", "wood"), ("wood", "wood"), ("wood", "wood")]);
        let wrong = || tally(&[("wood", "metal")]);
        let object = |name: &str, voted, local_only| ObjectTallies {
            object: name.to_owned(),
            voted,
            local_only,
            single_views: vec![("a".to_owned(), wrong()), ("b".to_owned(), right()), ("c".to_owned(), right())],
        };
        let objects = vec![object("one", right(), None), object("two", wrong(), Some(right()))];
        let found = SegmentationEvaluation::of(Vocabulary::Abo, objects);
        assert_eq!(found.voted.overall.mean_iou, Some(0.75));
        assert_eq!(found.voted.per_object["two"].mean_iou, Some(0.0));
        assert_eq!(found.local_only.as_ref().unwrap().overall.mean_iou, Some(1.0));
        assert_eq!(found.voted_beside_local_only.as_ref().unwrap().overall.mean_iou, Some(0.0));
        assert_eq!(found.best_view["one"], "b");
        // One view is wrong, two are right.
        assert!((found.mean_view["one"] - 2.0 / 3.0).abs() < 1e-12, "{:?}", found.mean_view);
        let text = found.text();
        assert!(text.contains("all") && text.contains("0.7500") && text.contains("b of two"), "{text}");
    }
}
