//! `gprop evaluate segmentation`: reads scenes and folders of label maps and makes the paper's table.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::error::{Result, UsageError};
use crate::evaluate::EvaluateError;
use crate::evaluate::label_maps::LabelMaps;
use crate::evaluate::segmentation::{LabelledView, NamedField, ObjectTallies, SegmentationEvaluation, tallies};
use crate::evaluate::vocabulary::Vocabulary;
use crate::materials::MaterialLibrary;
use crate::pipeline::variants::variants;
use crate::pipeline::{OpenScene, Stage, stored};

use super::super::{Global, print};
use super::{check_truth, one_scene_only};

pub fn evaluate(
    global: &Global,
    scenes: &[PathBuf],
    truth: &Path,
    labels: Vocabulary,
    out: Option<&Path>,
    allow_read: &[PathBuf],
) -> Result<()> {
    one_scene_only(scenes.len(), out)?;
    let opened = scenes.iter().map(|scene| stored::open(scene, out, allow_read, Stage::Vote, global.show_progress()));
    let opened: Vec<OpenScene> = opened.collect::<Result<_>>()?;
    require_distinct_names(&opened)?;
    let objects = opened.iter().zip(scenes).map(|(open, scene)| {
        let maps = folder_of(truth, scene, &open.scene.name, scenes.len());
        if truth.is_relative() && maps == scene.join(truth) {
            check_truth(&maps, &open.options.scene.read_scope(scene))?;
        }
        count(open, &maps, labels)
    });
    let found = SegmentationEvaluation::of(labels, objects.collect::<Result<_>>()?);
    print(global, &found, || found.text())
}

/// Refuses two scenes of one name, because the table has a row for each name.
fn require_distinct_names(opened: &[OpenScene]) -> Result<(), UsageError> {
    let mut names = BTreeSet::new();
    match opened.iter().map(|open| &open.scene.name).find(|name| !names.insert(*name)) {
        Some(name) => {
            Err(UsageError(format!("two scenes have the name {name:?}; give one of the folders another name")))
        }
        None => Ok(()),
    }
}

/// The folder of a scene's label maps.
fn folder_of(truth: &Path, scene: &Path, name: &str, scenes: usize) -> PathBuf {
    let (inside, by_name) = (scene.join(truth), truth.join(name));
    // An absolute path is not inside the scene, and joining it leads to itself.
    match (truth.is_relative() && inside.is_dir(), by_name.is_dir() || scenes > 1) {
        (true, _) => inside,
        (_, true) => by_name,
        _ => truth.to_owned(),
    }
}

fn count<'a>(open: &'a OpenScene, folder: &Path, labels: Vocabulary) -> Result<ObjectTallies<'a>> {
    let library = &open.library;
    let (scene, variants) = (&open.scene, variants(open)?);
    let views = labelled_views(open, folder, labels, library)?;
    let single = variants.single_views.iter().map(|(_, field)| field);
    let fields = std::iter::once(&*variants.voted).chain(&variants.local_only).chain(single);
    let fields: Vec<NamedField> =
        fields.map(|field| NamedField { field, names: labels.of_field(field, library) }).collect();
    let mut tallies = tallies(&scene.gaussians, &fields, &views).into_iter();
    let mut next = || tallies.next().expect("one per field");
    Ok(ObjectTallies {
        object: scene.name.clone(),
        voted: next(),
        local_only: variants.local_only.as_ref().map(|_| next()),
        single_views: variants.single_views.iter().map(|(view, _)| (view.clone(), next())).collect(),
    })
}

/// The labelled views that did not vote; if all labelled views voted, all of them.
fn labelled_views<'a>(
    open: &OpenScene,
    folder: &Path,
    labels: Vocabulary,
    library: &'a MaterialLibrary,
) -> Result<Vec<LabelledView<'a>>, EvaluateError> {
    let maps = LabelMaps::open(folder)?;
    let names = labels.of_values(&maps, library).map_err(|unknown| EvaluateError::Label {
        path: folder.to_owned(),
        name: unknown.name,
        hint: unknown.hint,
    })?;
    let (mut voting, mut others) = (Vec::new(), Vec::new());
    for view in &open.scene.views {
        let size = (view.camera.intrinsics.width, view.camera.intrinsics.height);
        let Some(map) = maps.of(&view.name, size)? else { continue };
        let truth = map.labels.iter().map(|value| names.get(value).copied()).collect();
        let place = if open.votes(&view.name) { &mut voting } else { &mut others };
        place.push(LabelledView { camera: view.camera.clone(), truth });
    }
    match (others.is_empty(), voting.is_empty()) {
        (false, _) => Ok(others),
        (true, false) => Ok(voting),
        (true, true) => Err(EvaluateError::NoView {
            path: folder.to_owned(),
            scene: open.scene.name.clone(),
            example: open.scene.views.first().map_or_else(String::new, |view| view.name.clone()),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_absolute_folder_holds_one_folder_per_scene() {
        let home = tempfile::tempdir().unwrap();
        let (truth, scene) = (home.path().join("truth"), home.path().join("mug"));
        std::fs::create_dir_all(truth.join("mug")).unwrap();
        std::fs::create_dir_all(scene.join("maps")).unwrap();
        for scenes in [1, 2] {
            assert_eq!(folder_of(&truth, &scene, "mug", scenes), truth.join("mug"));
            assert_eq!(folder_of(Path::new("maps"), &scene, "mug", scenes), scene.join("maps"));
        }
        assert_eq!(folder_of(&truth, &scene, "lamp", 1), truth, "the folder of a single scene");
    }
}
