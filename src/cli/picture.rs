//! `gprop segment PICTURE`: the parts of one picture without a scene.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::Context;
use serde_json::json;

use crate::pipeline::open_segmenter;
use crate::scene::Photo;
use crate::segment::formats::coco;
use crate::segment::{LabelMap, Observer, PartMask, ViewSegments};
use crate::workdir::{Artifact, WorkDir};

use super::{Global, SceneArgs, print};

/// Segments the picture that `args` names and writes what a scene's view gets, into `--out` or a folder beside it.
pub fn segment(global: &Global, args: &SceneArgs) -> anyhow::Result<()> {
    let path = &args.scene;
    let (photo, size) = Photo::open(path)?;
    let view = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let work = WorkDir::open(&args.out.clone().unwrap_or_else(|| folder_beside(path)))?;
    let options = &args.options.segment;
    let segmenter = open_segmenter(&args.options.setup, options, global.progress())?;
    let asked = Asked::default();
    let segments = segmenter.segment_view(&view, &photo, options, &asked)?;
    drop((photo, segmenter));
    let segments = at_size(segments, size);
    if let Some(warning) = segments.warning() {
        global.progress().line(&format!("warning: {warning}"));
    }
    let png = segments.map.to_png().with_context(|| format!("{path:?}"))?;
    work.write(Artifact::LabelMap(&view), &png)?;
    drop(png);
    let views = [segments];
    for format in &options.also {
        match format.npy_planes() {
            Some(planes) => work.write_with(Artifact::LabelArray(&view), |out| views[0].map.write_npy(planes, out))?,
            None => work.write_json(Artifact::Coco, &coco(&views))?,
        }
    }
    let result = json!({
        "picture": path,
        "width": size.0,
        "height": size.1,
        "prompts": asked.0.load(Ordering::Relaxed),
        "parts": views[0].parts,
    });
    work.write_json(Artifact::Segments, &result)?;
    print(global, &result, || {
        format!("{} parts in {}", views[0].parts.len(), work.path(Artifact::LabelMap(&view)).display())
    })
}

fn folder_beside(path: &Path) -> PathBuf {
    path.with_extension("gprop")
}

/// The parts of a picture that was segmented at a smaller size.
fn at_size(segments: ViewSegments, (width, height): (u32, u32)) -> ViewSegments {
    let small = (segments.map.width, segments.map.height);
    if small == (width, height) {
        return segments;
    }
    let map = segments.map.resized(width, height);
    let parts = segments.parts.into_iter().map(|part| part_at_size(part, &map, small)).collect();
    ViewSegments { map, parts, ..segments }
}

fn part_at_size(part: PartMask, map: &LabelMap, small: (u32, u32)) -> PartMask {
    let scale = |value: u32, to: u32, from: u32| (u64::from(value) * u64::from(to) / u64::from(from)) as u32;
    let area = map.labels.iter().filter(|&&label| label == part.id).count() as u32;
    let [x, y, width, height] = part.bbox;
    let bbox = [
        scale(x, map.width, small.0),
        scale(y, map.height, small.1),
        scale(width, map.width, small.0),
        scale(height, map.height, small.1),
    ];
    PartMask { area, bbox, ..part }
}

/// Counts prompts.
#[derive(Default)]
struct Asked(AtomicUsize);

impl Observer for Asked {
    fn planned(&self, _: usize) {}

    fn prompted(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}
