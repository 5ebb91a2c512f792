//! `gprop evaluate parts`: finds the parts of scenes and compares them with true ones.

use std::path::{Path, PathBuf};

use crate::consensus::{self, SegmentedView};
use crate::error::{Result, UsageError};
use crate::evaluate::parts::{PartsEvaluation, TrueView, compare, compare_segments};
use crate::from_splat::photo_with_foreground;
use crate::parallel;
use crate::pipeline::{self, open_segmenter};
use crate::scene::{self, Scene, View};
use crate::words::output::counted;

use super::super::arguments::TrueParts;
use super::super::{Global, options_of, print};
use super::{refuse_segments, true_map, true_view};

pub fn evaluate(global: &Global, asked: &TrueParts) -> Result<()> {
    refuse_segments(asked)?;
    let load = |folder: &PathBuf| TrueScene::load(folder, options_of(folder, &global.flags.typed)?);
    let scenes = asked.scenes.iter().map(load).collect::<Result<Vec<_>>>()?;
    let mut found = Vec::with_capacity(scenes.len());
    for scene in &scenes {
        found.push(scene.evaluate(global)?);
        global.progress().line(&format!("{} done", scene.scene.name));
    }
    print(global, &found, || found.iter().map(PartsEvaluation::text).collect::<Vec<_>>().join("\n"))
}

/// A scene with true part maps.
struct TrueScene {
    scene: Scene,
    options: pipeline::Options,
    /// The views to segment.
    chosen: Vec<View>,
    truth: Vec<TrueView>,
}

impl TrueScene {
    fn load(folder: &Path, options: pipeline::Options) -> Result<Self> {
        let scene = scene::load(folder, &options.scene)?;
        let chosen = scene.chosen_views(&options.scene)?;
        let is_chosen = |view: &View| chosen.iter().any(|other| other.name == view.name);
        let labelled = scene.views.iter().filter(|view| true_map(folder, view).exists());
        let truth = labelled.map(|view| true_view(folder, view, &options.scene, is_chosen(view)));
        let truth: Vec<TrueView> = truth.collect::<Result<_>>()?;
        if truth.iter().all(|view| view.segmented) {
            return Err(UsageError(format!(
                "{folder:?}: no view with a map in ground_truth/part_maps is left to compare with, because {} would be \
                 segmented; choose fewer with --views or --view-list",
                counted(chosen.len(), "view")
            ))
            .into());
        }
        Ok(Self { scene, options, chosen, truth })
    }

    fn evaluate(&self, global: &Global) -> Result<PartsEvaluation> {
        let segment = &self.options.segment;
        let segmenter = open_segmenter(&self.options.setup, segment, global.progress())?;
        let segments_of = |view: &View| -> Result<_> {
            Ok(segmenter.segment_view(&view.name, &photo_with_foreground(&self.scene, view)?, segment, &())?)
        };
        let found = parallel::try_map(&self.chosen, segments_of)?;
        let views = self.chosen.iter().zip(&found);
        let cloud = self.scene.whole_cloud();
        let views: Vec<SegmentedView> =
            views.map(|(view, segments)| SegmentedView { camera: &view.camera, cloud: &cloud, segments }).collect();
        let parts = consensus::find(&self.scene.gaussians, &self.scene.origins(), &views, global.progress());
        let of_views = compare(&self.scene.name, &self.scene.gaussians, &parts.part_of_gaussian(), &self.truth);
        let truth_of = |name: &str| self.truth.iter().find(|view| view.name == name).map(|view| &view.parts);
        let maps: Vec<_> = found.iter().filter_map(|view| Some((&view.map, truth_of(&view.view)?))).collect();
        Ok(PartsEvaluation { segments: compare_segments(&maps), ..of_views })
    }
}
