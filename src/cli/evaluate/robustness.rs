//! `gprop evaluate robustness`: labels from bad segments, wrong answers and few views.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use image::GrayImage;

use crate::consensus::sharpness;
use crate::error::{Result, UsageError};
use crate::evaluate::parts::{NO_PART, TrueView};
use crate::evaluate::robustness::{Robustness, StudiedView, measure, text};
use crate::from_splat::photo_with_foreground;
use crate::pipeline::{OpenScene, Stage, stored};
use crate::scene::View;
use crate::segment::Segmentation;

use super::super::{Global, print};
use super::{one_scene_only, true_map, true_parts, true_view};

pub fn evaluate(
    global: &Global,
    scenes: &[PathBuf],
    few: NonZeroUsize,
    out: Option<&Path>,
    allow_read: &[PathBuf],
) -> Result<()> {
    one_scene_only(scenes.len(), out)?;
    let mut measured: Vec<Robustness> = Vec::with_capacity(scenes.len());
    for folder in scenes {
        let open = stored::open(folder, out, allow_read, Stage::Vote, global.show_progress())?;
        measured.push(of_scene(folder, &open, few)?);
        global.progress().line(&format!("{folder:?} done"));
    }
    print(global, &measured, || text(&measured))
}

fn of_scene(folder: &Path, open: &OpenScene, few: NonZeroUsize) -> Result<Robustness> {
    let (scene, options) = (&open.scene, &open.options);
    let parts = |view: &View| true_parts(folder, view, &options.scene);
    let others = scene.views.iter().filter(|view| !open.votes(&view.name) && true_map(folder, view).exists());
    let compared = others.map(|view| true_view(folder, view, &options.scene, false));
    let compared: Vec<TrueView> = compared.collect::<Result<_>>()?;
    if compared.is_empty() {
        return Err(UsageError(format!(
            "{folder:?}: every view with a map in ground_truth/part_maps votes, so none is left to compare with; run it \
             with fewer --views, or with others in --view-list"
        ))
        .into());
    }
    let no_part = |which: &str| {
        UsageError(format!("{folder:?}: its maps in ground_truth/part_maps show no part in the views that {which}"))
    };
    if compared.iter().all(|view| shows_no_part(&view.parts)) {
        return Err(no_part("do not vote").into());
    }
    let segmentation = open.get::<Segmentation>()?;
    let voting = open.views.iter().zip(&segmentation.views).map(|(view, segments)| {
        Ok(StudiedView {
            name: &view.name,
            camera: &view.camera,
            parts: parts(view)?,
            sharpness: sharpness(&photo_with_foreground(scene, view)?.rgb),
            segments,
        })
    });
    let voting: Vec<StudiedView> = voting.collect::<Result<_>>()?;
    if voting.iter().all(|view| shows_no_part(&view.parts)) {
        return Err(no_part("vote").into());
    }
    Ok(measure(scene, &voting, few, &compared, &options.consensus, &options.vote)?)
}

fn shows_no_part(parts: &GrayImage) -> bool {
    parts.as_raw().iter().all(|&part| part == NO_PART)
}
