//! The parts on disk: a label map per view, `consensus.json`, and the part of every Gaussian. None of these are there if
//! the model is asked about segments.

use serde::{Deserialize, Serialize};

use crate::consensus::masks::{PartMasks, part_masks};
use crate::consensus::{self, AskAbout, FoundThing, Part, Parts, SegmentedView};
use crate::error::Result;
use crate::files::npz::{Npz, NpzWriter};
use crate::parallel;
use crate::scene::View;
use crate::segment::{LabelMap, Segmentation};
use crate::words::output::{agreeing, counted};
use crate::workdir::Artifact;

use super::{Done, Job, OpenScene, Row, Stage, Stored, never};

/// The parts as they are found before anyone is asked about them.
pub struct Unasked(pub FoundParts);

/// The parts as the stages after them need them.
#[derive(Clone)]
pub struct FoundParts {
    pub parts: Vec<FoundPart>,
    /// For every chosen view, the id of each pixel's piece, or of its part if that has no pieces.
    pub maps: Vec<LabelMap>,
    /// For every Gaussian, the id of its piece; of its part if that has no pieces.
    pub of_gaussian: Vec<u16>,
    /// The parts that were found where the answer what the object is names something without a number.
    pub found: Vec<FoundThing>,
}

/// The content of `consensus.json`.
#[derive(Serialize, Deserialize)]
struct PartsFile {
    parts: Vec<FoundPart>,
}

/// The files of parts.
pub struct PartFiles {
    /// That which lists them.
    pub list: Artifact<'static>,
    pub map: fn(&str) -> Artifact<'_>,
    pub of_gaussian: Artifact<'static>,
}

const FILES: PartFiles = PartFiles {
    list: Artifact::FoundParts,
    map: |view| Artifact::PartMap(view),
    of_gaussian: Artifact::PartOfGaussian,
};

/// A part or piece with the views that show it.
#[derive(Clone, Serialize, Deserialize)]
pub struct FoundPart {
    #[serde(flatten)]
    pub part: Part,
    /// Number of views in which a segment shows it, and of those that see it but have no such segment.
    pub backed_by: usize,
    pub opposed_by: usize,
    /// The views that show it, the best ones to ask about it in first.
    pub views: Vec<ShownIn>,
}

#[derive(Clone, Serialize, Deserialize)]
pub struct ShownIn {
    pub view: String,
    /// Number of pixels that show the part.
    pub pixels: u32,
}

pub(super) const ROW: Row = Row {
    inputs: &[Stage::Scene, Stage::Segment],
    options: &["consensus"],
    result: Artifact::FoundParts,
    // A question about the whole object is about its parts.
    key: |open, inputs| {
        let ask = open.options.consensus.ask;
        Ok(inputs.with_json(&if ask == AskAbout::Object { AskAbout::Parts } else { ask }).hex())
    },
    is_stale: never,
    run,
};

fn run(open: &OpenScene, _: &Job) -> Result<Done> {
    remove_parts(open)?;
    if open.options.consensus.ask == AskAbout::Segments {
        return Ok(Done::writing([]));
    }
    let Found { parts, masks, file } = find(open, open.get::<Segmentation>()?.as_ref())?;
    let work = &open.work;
    work.write_with(Artifact::PartOfGaussian, |out| {
        write_gaussians(out, &parts.id_of_gaussian, Some(&parts.confidence))
    })?;
    for (view, masks) in open.views.iter().zip(&masks) {
        work.write(Artifact::PartMap(&view.name), &masks.map.to_png()?)?;
    }
    work.write_json(Artifact::FoundParts, &file)?;
    let maps = open.views.iter().map(|view| Artifact::PartMap(&view.name));
    let written = maps.chain([Artifact::FoundParts, Artifact::PartOfGaussian]);
    Ok(Done::writing(written).warning(warnings(&file.parts)))
}

/// The parts that the segments of all views show.
struct Found {
    parts: Parts,
    /// Where each view shows them.
    masks: Vec<PartMasks>,
    file: PartsFile,
}

fn find(open: &OpenScene, segmentation: &Segmentation) -> Result<Found> {
    let gaussians = &open.scene.gaussians;
    let views = open.views.iter().zip(&segmentation.views);
    let cloud = open.scene.whole_cloud();
    let views: Vec<SegmentedView> =
        views.map(|(view, segments)| SegmentedView { camera: &view.camera, cloud: &cloud, segments }).collect();
    let origins = open.scene.origins();
    let parts = consensus::find(gaussians, &origins, &views, open.progress());
    let masks: Vec<PartMasks> = views.iter().map(|view| part_masks(&parts, view)).collect();
    let maps: Vec<&LabelMap> = masks.iter().map(|masks| &masks.map).collect();
    let best = views_of_parts(open, &parts, &maps)?;
    let found = parts.parts.iter().zip(best).map(|(part, views)| {
        let backing = |expected: bool| masks.iter().filter(|masks| masks.backs(part.id) == Some(expected)).count();
        FoundPart { part: part.clone(), backed_by: backing(true), opposed_by: backing(false), views }
    });
    let file = PartsFile { parts: found.collect() };
    Ok(Found { parts, masks, file })
}

/// For every part and piece, the views that show it, the best ones to ask about it in first; `maps` are those of the views.
pub fn views_of_parts(open: &OpenScene, parts: &Parts, maps: &[&LabelMap]) -> Result<Vec<Vec<ShownIn>>> {
    let sharpness = |view: &View| view.photo().map(|photo| consensus::sharpness(&photo.rgb));
    let sharpness = parallel::try_map(&open.views, sharpness)?;
    let cameras: Vec<_> = open.views.iter().map(|view| &view.camera).collect();
    let best = consensus::best_views(&open.scene.gaussians, parts, &cameras, maps, &sharpness);
    let shown =
        |shown: consensus::PartView| ShownIn { view: open.views[shown.view].name.clone(), pixels: shown.pixels };
    Ok(best.into_iter().map(|views| views.into_iter().map(shown).collect()).collect())
}

/// Removes the parts that an earlier run left, which would be taken for this run's; also in views that are not chosen
/// now.
fn remove_parts(open: &OpenScene) -> Result<()> {
    let maps = open.scene.views.iter().map(|view| Artifact::PartMap(&view.name));
    let old = maps.chain([Artifact::FoundParts, Artifact::PartOfGaussian]);
    old.chain([Artifact::Refined]).try_for_each(|artifact| Ok(open.work.remove(artifact)?))
}

impl Stored for Unasked {
    const STAGE: Stage = Stage::Consensus;

    fn load(open: &OpenScene) -> Result<Self> {
        let PartsFile { parts } = open.work.read_json(Artifact::FoundParts)?;
        Ok(Self(FoundParts::read(open, parts, &FILES)?))
    }
}

impl FoundParts {
    /// The parts that are listed, with what the other files say of them.
    pub fn read(open: &OpenScene, parts: Vec<FoundPart>, files: &PartFiles) -> Result<Self> {
        let work = &open.work;
        if !are_numbered(&parts) {
            let problem = "its parts are not numbered from 1 on, or one is a piece of a part that it does not list";
            return Err(work.damaged(files.list, problem).into());
        }
        let map = |view: &View| {
            let artifact = (files.map)(&view.name);
            let map = LabelMap::from_png(&work.read(artifact)?).map_err(|problem| work.damaged(artifact, problem))?;
            let size = &view.camera.intrinsics;
            if (map.width, map.height) != (size.width, size.height) {
                return Err(work.damaged(artifact, "it does not fit the photo").into());
            }
            let is_known = |&id: &u16| usize::from(id) <= parts.len();
            if !map.labels.iter().all(is_known) {
                let problem = format!("it shows parts that are not in {}", files.list.path().display());
                return Err(work.damaged(artifact, problem).into());
            }
            Ok(map)
        };
        let maps = open.views.iter().map(map).collect::<Result<_>>()?;
        let damaged = |problem: &dyn std::fmt::Display| work.damaged(files.of_gaussian, problem);
        let bytes = work.read(files.of_gaussian)?;
        let ids = Npz::new(bytes).and_then(|mut archive| archive.f32s("part")).map_err(|problem| damaged(&problem))?;
        let are_known = ids.iter().all(|id| id.fract() == 0.0 && (1.0..=parts.len() as f32).contains(id));
        if ids.len() != open.scene.gaussians.len() || !are_known {
            return Err(damaged(&"its numbers are not those of the parts, one for each Gaussian").into());
        }
        Ok(Self { maps, parts, of_gaussian: ids.into_iter().map(|id| id as u16).collect(), found: Vec::new() })
    }

    /// The part that an id stands for: the part of a piece, or the part itself; 0 for 0.
    pub fn part_of(&self, id: u16) -> u16 {
        usize::from(id).checked_sub(1).map_or(0, |index| self.parts[index].part.piece_of.unwrap_or(id))
    }

    pub fn whole_parts(&self, view: usize) -> LabelMap {
        renamed(&self.maps[view], |id| self.part_of(id))
    }
}

/// True if the parts are numbered from 1 on, and each piece belongs to one of them.
fn are_numbered(parts: &[FoundPart]) -> bool {
    let is_numbered = |(number, FoundPart { part, .. }): (usize, &FoundPart)| {
        usize::from(part.id) == number && part.piece_of.is_none_or(|of| (1..=parts.len()).contains(&usize::from(of)))
    };
    (1..).zip(parts).all(is_numbered)
}

pub fn renamed(map: &LabelMap, name: impl Fn(u16) -> u16) -> LabelMap {
    LabelMap { labels: map.labels.iter().map(|&id| name(id)).collect(), ..*map }
}

/// `part` (the id of the Gaussian's piece or part) and `confidence`, if that is known, in the order of the splat.
pub fn write_gaussians(out: &mut dyn std::io::Write, ids: &[u16], confidence: Option<&[f32]>) -> std::io::Result<()> {
    let mut archive = NpzWriter::new(out);
    let shape = [ids.len() as u64];
    archive.array("part", &shape, ids.iter().map(|&id| f32::from(id)))?;
    if let Some(confidence) = confidence {
        archive.array("confidence", &shape, confidence.iter().copied())?;
    }
    archive.finish()
}

fn warnings(parts: &[FoundPart]) -> Vec<String> {
    let whole: Vec<&FoundPart> = parts.iter().filter(|found| found.part.piece_of.is_none()).collect();
    let mut warnings = Vec::new();
    if let [only] = whole.as_slice()
        && only.part.light == 0.0
    {
        warnings.push(
            "no view sees any Gaussian: the object counts as one part. Check with `gprop inspect \
             SCENE` whether cameras and splat belong together"
                .to_owned(),
        );
    }
    let hidden = whole.iter().filter(|found| found.views.is_empty()).count();
    if hidden > 0 && warnings.is_empty() {
        warnings.push(format!(
            "{hidden} of {} {} hidden or too small in every view and cannot be asked about; {} neighbours' material",
            counted(whole.len(), "part"),
            agreeing(hidden, "is", "are"),
            agreeing(hidden, "it takes its", "they take their"),
        ));
    }
    warnings
}
