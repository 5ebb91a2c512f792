//! How much of the labels' accuracy is left if views are segmented badly, answers are wrong or views are few.
//!
//! Answers are perfect except for those that are made wrong on purpose: each names the true part that most of the mask
//! shows. The subjects of the questions, and the way in which views vote, are as in a run, so that a run with `--preset
//! paper` measures the paper's way.

mod answers;
mod merge;

use std::collections::BTreeMap;
use std::num::NonZeroUsize;

use fastrand::Rng;
use image::GrayImage;
use serde::Serialize;

use crate::camera::Camera;
use crate::consensus::{self, AskAbout};
use crate::evaluate::parts::{TrueView, label_ious};
use crate::scene::Scene;
use crate::segment::ViewSegments;
use crate::vote::{self, VoteError};
use crate::words::output::one_line;
use answers::Voters;
pub use merge::merged;

/// A condition that involves chance is tried this often, each time with another seed.
const REPEATS: u64 = 5;
const MERGED: f64 = 0.5;
const WRONG: f64 = 0.1;

/// A view that votes.
pub struct StudiedView<'a> {
    pub name: &'a str,
    pub camera: &'a Camera,
    /// The true part of each pixel, 255 for none.
    pub parts: GrayImage,
    /// As [`consensus::sharpness`].
    pub sharpness: Vec<f32>,
    pub segments: &'a ViewSegments,
}

/// The labels' mean IoU over the true parts, in views that did not vote.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Robustness {
    pub scene: String,
    pub asked: AskAbout,
    pub voting_views: usize,
    pub few_views: usize,
    pub compared_views: usize,
    pub rows: Vec<Row>,
}

/// One condition.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    pub condition: &'static str,
    /// Over the true parts.
    pub mean_iou: f64,
    /// By the value in the true part maps.
    pub iou: BTreeMap<u8, f64>,
}

/// Probabilities that a segment is merged with a neighbour and that an answer is wrong.
#[derive(Debug, Clone, Copy)]
struct Condition {
    name: &'static str,
    merged: f64,
    wrong: f64,
    few: bool,
}

const CONDITIONS: [Condition; 5] = [
    Condition { name: "as they are", merged: 0.0, wrong: 0.0, few: false },
    Condition { name: "half of the segments merged with a neighbour", merged: MERGED, wrong: 0.0, few: false },
    Condition { name: "a tenth of the answers wrong", merged: 0.0, wrong: WRONG, few: false },
    Condition { name: "fewer views", merged: 0.0, wrong: 0.0, few: true },
    Condition { name: "all three", merged: MERGED, wrong: WRONG, few: true },
];

/// Votes under every condition. If fewer views vote, these are `few` of them, evenly spread over their order.
///
/// # Errors
/// [`VoteError`] as for [`vote::vote`].
pub fn measure(
    scene: &Scene,
    views: &[StudiedView],
    few: NonZeroUsize,
    compared: &[TrueView],
    asked: &consensus::Options,
    vote: &vote::Options,
) -> Result<Robustness, VoteError> {
    let all: Vec<&StudiedView> = views.iter().collect();
    let few = few.get().min(all.len());
    let some: Vec<&StudiedView> = (0..few).map(|n| all[n * all.len() / few]).collect();
    let ious = |condition: &Condition, seed: u64| {
        let views = if condition.few { &some } else { &all };
        let voters = Voters { gaussians: &scene.gaussians, views, merged: condition.merged, wrong: condition.wrong };
        let labels = voters.labels(asked, vote, &mut Rng::with_seed(seed))?;
        Ok::<_, VoteError>(label_ious(&scene.gaussians, &labels, compared))
    };
    let of_condition = |condition: &Condition| {
        let repeats = if condition.merged + condition.wrong > 0.0 { REPEATS } else { 1 };
        let mut iou: BTreeMap<u8, f64> = BTreeMap::new();
        for seed in 0..repeats {
            for (part, value) in ious(condition, seed)? {
                *iou.entry(part).or_default() += value / repeats as f64;
            }
        }
        Ok::<_, VoteError>(Row {
            condition: condition.name,
            mean_iou: iou.values().sum::<f64>() / iou.len() as f64,
            iou,
        })
    };
    Ok(Robustness {
        scene: scene.name.clone(),
        asked: asked.ask,
        voting_views: all.len(),
        few_views: few,
        compared_views: compared.len(),
        rows: CONDITIONS.iter().map(of_condition).collect::<Result<_, _>>()?,
    })
}

/// A table for people: the conditions, with a column for each scene and one for their mean.
pub fn text(scenes: &[Robustness]) -> String {
    let mut text = String::new();
    for Robustness { scene, asked, voting_views, few_views, compared_views, .. } in scenes {
        let asked = match asked {
            AskAbout::Object => "object",
            AskAbout::Parts => "parts",
            AskAbout::Segments => "segments",
        };
        text += &format!(
            "{}: questions about {asked}; {voting_views} views vote ({few_views} in the rows with fewer views), \
             {compared_views} others measure the IoU\n",
            one_line(scene)
        );
    }
    let mut row = |name: &str, values: Vec<String>| {
        text += &format!("{name:<46}{}\n", values.iter().map(|value| format!(" {value:>11}")).collect::<String>());
    };
    row(
        "mean IoU",
        scenes.iter().map(|scene| one_line(&scene.scene).into_owned()).chain(["mean".to_owned()]).collect(),
    );
    for (n, condition) in CONDITIONS.iter().enumerate() {
        let ious: Vec<f64> = scenes.iter().map(|scene| scene.rows[n].mean_iou).collect();
        let mean = ious.iter().sum::<f64>() / ious.len() as f64;
        row(condition.name, ious.iter().chain([&mean]).map(|iou| format!("{iou:.3}")).collect());
    }
    text
}
