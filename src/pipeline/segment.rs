//! Segmentation on disk: a label map a view and `segments.json`, both written as soon as a view is done.

use std::collections::BTreeMap;
use std::sync::Mutex;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use crate::from_splat::photo_with_foreground;
use crate::scene::{ObjectSource, View};
use crate::segment::{LabelMap, PartMask, Segmentation, Segmenter, ViewSegments, segment_views};
use crate::setup;
use crate::workdir::Artifact;

use super::record::Hasher;
use super::scene::file_digest;
use super::{Done, Pipeline, Stage, get_or_load};

/// The content of `segments/segments.json`, by view.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct SegmentsFile {
    pub views: BTreeMap<String, ViewEntry>,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct ViewEntry {
    /// Hash of what the view's parts depend on; a view with another one is segmented again.
    pub key: String,
    pub parts: Vec<PartMask>,
}

impl Pipeline {
    pub(super) fn segment_key(&self) -> Result<String> {
        let hasher = self.key_after(Stage::Segment, &[Stage::Scene]).with_json(&self.options.segment);
        Ok(hasher.with(models_key(&self.options.setup).as_bytes()).hex())
    }

    pub(super) fn do_segment(&self) -> Result<Done> {
        let mut file = self.finished_views()?;
        let open: Vec<&str> =
            self.views.iter().map(|view| view.name.as_str()).filter(|name| !file.views.contains_key(*name)).collect();
        if !open.is_empty() {
            self.segment_open(&open, &mut file)?;
        }
        let label_maps = self.views.iter().map(|view| Artifact::LabelMap(&view.name));
        let warnings = self.segmentation()?.views.iter().filter_map(ViewSegments::warning);
        Ok(Done::writing(label_maps.chain([Artifact::Segments])).warning(warnings.collect()))
    }

    fn segment_open(&self, open: &[&str], file: &mut SegmentsFile) -> Result<()> {
        let models = setup::obtain(&self.options.setup, self.progress)?;
        let segmenter = Segmenter::new(&models, rayon::current_num_threads())?;
        let keys: BTreeMap<&str, String> =
            open.iter().map(|name| Ok((*name, self.view_key(self.view(name))?))).collect::<Result<_>>()?;
        let load = |name: &str| Ok(photo_with_foreground(&self.scene, self.view(name))?);
        let file = Mutex::new(file);
        let save = |done: &ViewSegments| {
            let png = done.map.to_png().with_context(|| format!("view {}", done.view))?;
            self.work.write(Artifact::LabelMap(&done.view), &png)?;
            let mut file = file.lock().expect("a thread that panicked ended the process");
            let entry = ViewEntry { key: keys[done.view.as_str()].clone(), parts: done.parts.clone() };
            file.views.insert(done.view.clone(), entry);
            Ok(self.work.write_json(Artifact::Segments, &**file)?)
        };
        segment_views(&segmenter, open, &load, &self.options.segment, self.progress, &save)?;
        Ok(())
    }

    /// The parts of the chosen views.
    pub(super) fn segmentation(&self) -> Result<&Segmentation> {
        get_or_load(&self.segmentation, || {
            let mut file: SegmentsFile = self.work.read_json(Artifact::Segments)?;
            let views = self.views.iter().map(|view| {
                let artifact = Artifact::LabelMap(&view.name);
                let map = LabelMap::from_png(&self.work.read(artifact)?)
                    .with_context(|| format!("{:?}", self.work.path(artifact)))?;
                let entry = file.views.remove(&view.name).with_context(|| format!("no parts of view {}", view.name))?;
                Ok(ViewSegments { view: view.name.clone(), map, parts: entry.parts })
            });
            Ok(Segmentation { views: views.collect::<Result<_>>()? })
        })
    }

    /// What an earlier run finished of the chosen views and is still good.
    fn finished_views(&self) -> Result<SegmentsFile> {
        let mut file: SegmentsFile = self.work.read_json(Artifact::Segments).unwrap_or_default();
        let mut good = SegmentsFile::default();
        for view in &self.views {
            let map_there = self.work.size(Artifact::LabelMap(&view.name)).is_some();
            let key = self.view_key(view)?;
            if let Some(entry) = file.views.remove(&view.name).filter(|entry| entry.key == key && map_there) {
                good.views.insert(view.name.clone(), entry);
            }
        }
        Ok(if self.must_redo(Stage::Segment) { SegmentsFile::default() } else { good })
    }

    fn view(&self, name: &str) -> &View {
        self.views.iter().find(|view| view.name == name).expect("only chosen views are segmented")
    }

    /// A view's parts depend on its photo, the options and the models, not on the other views.
    fn view_key(&self, view: &View) -> Result<String> {
        let photo = file_digest(&view.image).with_context(|| format!("cannot read {:?}", view.image))?;
        let mut hasher = Hasher::new("view").with(&photo).with_json(&self.options.segment);
        if let Some(mask) = &view.mask {
            hasher = hasher.with(&file_digest(mask).with_context(|| format!("cannot read {mask:?}"))?);
        }
        if self.scene.object_source != ObjectSource::Whole {
            // The foreground is rendered from the Gaussians.
            hasher = hasher.with(self.scene_key()?.as_bytes());
        }
        Ok(hasher.with(models_key(&self.options.setup).as_bytes()).hex())
    }
}

/// Which models make the masks: the catalogue's by their pins, the user's own by their content.
pub(super) fn models_key(setup: &setup::Options) -> String {
    let own = [&setup.sam_encoder, &setup.sam_decoder];
    let mut hasher = Hasher::new("models").with(setup::catalog::SAM.requirement.as_bytes());
    for path in own.into_iter().flatten() {
        // A file that cannot be read is the set-up's to report, with its remedy.
        hasher = hasher.with(&file_digest(path).unwrap_or_default());
    }
    hasher.hex()
}
