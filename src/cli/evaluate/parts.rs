//! `gprop evaluate parts`: finds the parts of scenes and compares them with true ones.

use std::path::Path;

use rayon::prelude::*;

use crate::consensus::{self, SegmentedView};
use crate::error::UsageError;
use crate::evaluate::parts::{PartsEvaluation, TrueView, compare, compare_segments};
use crate::from_splat::photo_with_foreground;
use crate::pipeline::open_segmenter;
use crate::scene::{self, Scene, View};
use crate::segment::{self, Segmenter};

use super::super::arguments::TrueParts;
use super::super::{Global, print};
use super::{true_map, true_view};

pub fn evaluate(global: &Global, asked: &TrueParts) -> anyhow::Result<()> {
    let TrueParts { scenes, scene: options, segment, setup } = asked;
    let scenes = scenes.iter().map(|folder| TrueScene::load(folder, options)).collect::<anyhow::Result<Vec<_>>>()?;
    let segmenter = open_segmenter(setup, segment, global.progress())?;
    let mut found = Vec::with_capacity(scenes.len());
    for scene in &scenes {
        found.push(scene.evaluate(global, &segmenter, segment)?);
        global.progress().line(&format!("{} done", scene.scene.name));
    }
    print(global, &found, || found.iter().map(PartsEvaluation::text).collect::<Vec<_>>().join("\n"))
}

/// A scene with true part maps.
struct TrueScene {
    scene: Scene,
    /// The views to segment.
    chosen: Vec<View>,
    truth: Vec<TrueView>,
}

impl TrueScene {
    fn load(folder: &Path, options: &scene::Options) -> anyhow::Result<Self> {
        let scene = scene::load(folder, options)?;
        let chosen = scene.chosen_views(options)?;
        let is_chosen = |view: &View| chosen.iter().any(|other| other.name == view.name);
        let labelled = scene.views.iter().filter(|view| true_map(folder, view).exists());
        let truth = labelled.map(|view| true_view(folder, view, options, is_chosen(view)));
        let truth: Vec<TrueView> = truth.collect::<anyhow::Result<_>>()?;
        if truth.iter().all(|view| view.segmented) {
            return Err(UsageError(format!(
                "{folder:?}: no view with a map in ground_truth/part_maps is left to compare with; {} views are to be \
                 segmented: choose fewer with --views or --view-list",
                chosen.len()
            ))
            .into());
        }
        Ok(Self { scene, chosen, truth })
    }

    fn evaluate(
        &self,
        global: &Global,
        segmenter: &Segmenter,
        segment: &segment::Options,
    ) -> anyhow::Result<PartsEvaluation> {
        let segments_of = |view: &View| -> anyhow::Result<_> {
            Ok(segmenter.segment_view(&view.name, &photo_with_foreground(&self.scene, view)?, segment, &())?)
        };
        let found = self.chosen.par_iter().map(segments_of).collect::<anyhow::Result<Vec<_>>>()?;
        let views = self.chosen.iter().zip(&found);
        let views: Vec<SegmentedView> =
            views.map(|(view, segments)| SegmentedView { camera: &view.camera, segments }).collect();
        let parts = consensus::find(&self.scene.gaussians, &views, global.progress());
        let of_views = compare(&self.scene.name, &self.scene.gaussians, &parts.part_of_gaussian(), &self.truth);
        let truth_of = |name: &str| self.truth.iter().find(|view| view.name == name).map(|view| &view.parts);
        let maps: Vec<_> = found.iter().filter_map(|view| Some((&view.map, truth_of(&view.view)?))).collect();
        Ok(PartsEvaluation { segments: compare_segments(&maps), ..of_views })
    }
}
