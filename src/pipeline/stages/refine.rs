//! What the answer about the object names and no part shows, on disk: `refined.json` says what was looked for. If something was found,
//! the parts are listed there again, and `refined/` holds a label map per view and the part of every Gaussian.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::consensus::{FoundThing, Part, Parts};
use crate::error::Result;
use crate::query::Unnumbered;
use crate::refine::{self, Look, Missed, Numbering, Place, Sighted};
use crate::segment::Segmenter;
use crate::workdir::Artifact;

use super::consensus::{FoundPart, FoundParts, PartFiles, Unasked, views_of_parts, write_gaussians};
use super::recognise::AnswerAboutWhole;
use super::{Done, Job, OpenScene, Row, Stage, Stored};
use crate::pipeline::hasher::Hasher;
use crate::pipeline::segment_files::{models_key, open_segmenter};
use crate::words::output::counted;

/// A thing that is less probable than this is not looked for.
const PROBABLE: f64 = 0.5;

/// The content of `refined.json`.
#[derive(Default, Serialize, Deserialize)]
pub struct RefinedFile {
    pub looked_for: Vec<LookedFor>,
    /// Those that were found.
    found: Vec<FoundThing>,
    /// All parts, if anything was found.
    parts: Vec<FoundPart>,
    /// True if nothing could be looked for.
    #[serde(default)]
    lacks_sam: bool,
}

/// A thing without a number, and what came of looking for it.
#[derive(Serialize, Deserialize)]
pub struct LookedFor {
    pub what: String,
    pub view: String,
    /// Its number, if it was found.
    pub id: Option<u16>,
    /// Why not, in words, if it was not.
    pub why_not: Option<String>,
}

const FILES: PartFiles = PartFiles {
    list: Artifact::Refined,
    map: |view| Artifact::RefinedMap(view),
    of_gaussian: Artifact::RefinedGaussians,
};

pub(super) const ROW: Row = Row {
    inputs: &[Stage::Scene, Stage::Consensus, Stage::Recognise],
    options: &[],
    result: Artifact::Refined,
    key,
    // SAM may be there by now.
    is_stale: |open, _| open.get::<RefinedFile>().is_ok_and(|file| file.lacks_sam),
    run,
};

fn key(open: &OpenScene, inputs: Hasher) -> Result<String> {
    let selection = &open.options.segment.selection;
    Ok(inputs.with(models_key(&open.options.setup).as_bytes()).with_json(selection).hex())
}

fn run(open: &OpenScene, job: &Job) -> Result<Done> {
    let work = &open.work;
    if job.is_last
        && let Some(budget) = open.budget.take()
    {
        budget.spent().tell("");
    }
    work.remove(Artifact::Refined)?;
    let known = open.get::<AnswerAboutWhole>()?;
    let things = known.known().map_or(&[][..], |known| &known.unnumbered);
    let probable = things.iter().enumerate().filter(|(_, thing)| thing.probability >= PROBABLE);
    let place = |(view, at)| Place { view, at };
    let placed: Vec<(usize, &Unnumbered, Place)> =
        probable.filter_map(|(n, thing)| Some((n, thing, place(known.place_of(n, open)?)))).collect();
    if placed.is_empty() {
        work.write_json(Artifact::Refined, &RefinedFile::default())?;
        return Ok(Done::writing([Artifact::Refined]));
    }
    let segmenter = match open_segmenter(&open.options.setup, &open.options.segment, open.progress()) {
        Err(error) if open.options.segment.segments.is_some() => return without_sam(open, &placed, &error.to_string()),
        opened => opened?,
    };
    let unasked = open.get::<Unasked>()?;
    let (numbering, outcomes) = look(open, &segmenter, &unasked.0, &placed)?;
    let mut file = RefinedFile::default();
    let mut notes = Vec::new();
    for ((thing, Unnumbered { what, .. }, place), outcome) in placed.into_iter().zip(outcomes) {
        let view = open.views[place.view].name.clone();
        let (note, id, why_not) = match &outcome {
            Ok(Sighted { id, views, .. }) => {
                let views = counted(views.len(), "view");
                (
                    format!("where the answer names {what}, {views} show a region that had no number: {id}"),
                    Some(*id),
                    None,
                )
            }
            Err(missed) => {
                let why = in_words(*missed);
                let note = format!("{what} (view {view}) gets no number: {why}; it is weighed by the answer alone");
                (note, None, Some(why.to_owned()))
            }
        };
        notes.push(note);
        file.looked_for.push(LookedFor { what: what.clone(), view, id, why_not });
        file.found.extend(outcome.ok().map(|Sighted { id, cut_from, .. }| FoundThing { thing, id, cut_from }));
    }
    let mut outputs = vec![Artifact::Refined];
    if !file.found.is_empty() {
        file.parts = parts_with(open, &unasked.0, &numbering)?;
        for (view, map) in open.views.iter().zip(&numbering.maps) {
            work.write(Artifact::RefinedMap(&view.name), &map.to_png()?)?;
        }
        let write = |out: &mut dyn std::io::Write| write_gaussians(out, &numbering.id_of_gaussian, None);
        work.write_with(Artifact::RefinedGaussians, write)?;
        outputs.extend(open.views.iter().map(|view| Artifact::RefinedMap(&view.name)));
        outputs.push(Artifact::RefinedGaussians);
    }
    work.write_json(Artifact::Refined, &file)?;
    Ok(Done::writing(outputs).noting(notes))
}

/// Leaves everything as it is: whoever brings segments may do without SAM.
fn without_sam(open: &OpenScene, placed: &[(usize, &Unnumbered, Place)], why: &str) -> Result<Done> {
    let not_looked_for = |(_, Unnumbered { what, .. }, place): &(usize, &Unnumbered, Place)| LookedFor {
        what: what.clone(),
        view: open.views[place.view].name.clone(),
        id: None,
        why_not: Some(why.to_owned()),
    };
    let looked_for = placed.iter().map(not_looked_for).collect();
    open.work.write_json(Artifact::Refined, &RefinedFile { looked_for, lacks_sam: true, ..RefinedFile::default() })?;
    let things = counted(placed.len(), "thing");
    let warning =
        format!("{things} that the answer about the object names without a number cannot be looked for: {why}");
    Ok(Done::writing([Artifact::Refined]).warning(vec![warning]))
}

fn look(
    open: &OpenScene,
    segmenter: &Segmenter,
    unasked: &FoundParts,
    placed: &[(usize, &Unnumbered, Place)],
) -> Result<(Numbering, Vec<Result<Sighted, Missed>>)> {
    let cloud = open.scene.whole_cloud();
    let photos = open.views.iter().map(|view| open.photo(view)).collect::<Result<Vec<_>, _>>()?;
    let views = open.views.iter().zip(&photos);
    let looks: Vec<Look> = views.map(|(view, photo)| Look { camera: &view.camera, cloud: &cloud, photo }).collect();
    let places: Vec<Place> = placed.iter().map(|(.., place)| *place).collect();
    let next = unasked.parts.last().map_or(1, |last| last.part.id.saturating_add(1));
    let mut numbering = Numbering::new(unasked.of_gaussian.clone(), unasked.maps.clone(), next);
    let outcomes = refine::look(segmenter, &looks, &places, &mut numbering, &open.options.segment.selection)?;
    Ok((numbering, outcomes))
}

/// The parts with those that are new. What was cut off takes its pixels and Gaussians along.
fn parts_with(open: &OpenScene, before: &FoundParts, numbering: &Numbering) -> Result<Vec<FoundPart>> {
    let mut parts: Vec<Part> = before.parts.iter().map(|found| found.part.clone()).collect();
    let new = (parts.len() as u16 + 1)..numbering.next;
    parts.extend(new.map(|id| Part { id, piece_of: None, gaussians: 0, light: 0.0, separation: 1.0 }));
    let pixels = before.maps.iter().zip(&numbering.maps).flat_map(|(old, new)| old.labels.iter().zip(&new.labels));
    for (id, pixels) in changes(&parts, pixels) {
        let light = &mut parts[usize::from(id) - 1].light;
        *light = (*light + pixels as f64).max(0.0);
    }
    for (id, count) in changes(&parts, before.of_gaussian.iter().zip(&numbering.id_of_gaussian)) {
        let gaussians = &mut parts[usize::from(id) - 1].gaussians;
        *gaussians = gaussians.saturating_add_signed(count);
    }
    let all = Parts { id_of_gaussian: numbering.id_of_gaussian.clone(), confidence: Vec::new(), parts };
    let maps: Vec<_> = numbering.maps.iter().collect();
    let views = views_of_parts(open, &all, &maps)?;
    let known = before.parts.iter().map(|found| (found.backed_by, found.opposed_by));
    let known = known.chain(std::iter::repeat((0, 0)));
    let found = |((part, views), (backed_by, opposed_by))| FoundPart { part, backed_by, opposed_by, views };
    Ok(all.parts.into_iter().zip(views).zip(known).map(found).collect())
}

/// By id, how much more of a part or piece there is after these changes of ids.
fn changes<'a>(parts: &[Part], ids: impl Iterator<Item = (&'a u16, &'a u16)>) -> BTreeMap<u16, isize> {
    let mut found = BTreeMap::new();
    for (old, new) in ids.filter(|(old, new)| old != new) {
        for (id, by) in [(*old, -1), (*new, 1)].into_iter().filter(|(id, _)| *id > 0) {
            let whole = parts[usize::from(id) - 1].piece_of;
            [Some(id), whole].into_iter().flatten().for_each(|id| *found.entry(id).or_default() += by);
        }
    }
    found
}

fn in_words(missed: Missed) -> &'static str {
    match missed {
        Missed::Unconfirmed => "too few views show more there than what has a number",
        Missed::Numbered => "what the views show there has one",
    }
}

impl Stored for RefinedFile {
    const STAGE: Stage = Stage::Refine;

    fn load(open: &OpenScene) -> Result<Self> {
        Ok(open.work.read_json(Artifact::Refined)?)
    }
}

/// The parts with what was found, or as they were before, if nothing was, or nobody has looked.
impl Stored for FoundParts {
    const STAGE: Stage = Stage::Refine;

    fn load(open: &OpenScene) -> Result<Self> {
        let file: RefinedFile = match open.work.size(Artifact::Refined) {
            Some(_) => open.work.read_json(Artifact::Refined)?,
            None => RefinedFile::default(),
        };
        if file.found.is_empty() {
            return Ok(open.get::<Unasked>()?.0.clone());
        }
        let read = Self::read(open, file.parts, &FILES)?;
        let before = open.get::<Unasked>()?.0.parts.len();
        let is_known = |of: &FoundThing| (before + 1..=read.parts.len()).contains(&usize::from(of.id));
        if !file.found.iter().all(is_known) {
            return Err(open.work.damaged(Artifact::Refined, "it found a part that it does not list").into());
        }
        Ok(Self { found: file.found, ..read })
    }
}
