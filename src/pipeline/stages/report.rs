//! The report: the results of all stages before it, as one JSON file and one page.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::Result;
use crate::parallel;
use nalgebra::Point3;

use crate::config::{self, Flag};
use crate::report::{
    self, AnswerCounts, Cloud, CorrectionsFile, Disagreement, InputFile, Motion, Pictures, Remark, Report,
    Reproduction, SceneSummary, SheetPicture, StageTime, ViewPictures, shrink_object,
};
use crate::vote::MaterialField;
use crate::words::readable::hexadecimal;
use crate::words::shell;
use crate::workdir::Artifact;

use super::grasp::{self, Grasped};
use super::recognized::Recognized;
use super::scene;
use super::subjects::FoundSubjects;
use super::vote::ShowsMost;
use super::{Done, Job, OpenScene, Row, Stage, StageRecord, never, parts, simulate};
use crate::pipeline::corrections_file;
use crate::pipeline::hasher::file_digest;
use crate::pipeline::options::known_flags;
use crate::query::Answers;

pub(super) const ROW: Row = Row {
    inputs: &[
        Stage::Scene,
        Stage::Segment,
        Stage::Consensus,
        Stage::Query,
        Stage::Vote,
        Stage::Parts,
        Stage::Simulate,
        Stage::Grasp,
    ],
    options: &[],
    result: Artifact::ReportHtml,
    key: |open, inputs| Ok(inputs.with(open.scene.name.as_bytes()).hex()),
    is_stale: never,
    run,
};

fn run(open: &OpenScene, job: &Job) -> Result<Done> {
    let work = &open.work;
    let report = report(open, job)?;
    let (field, answers) = (parts::weighed_field(open)?, open.get::<Answers>()?);
    let pictures = pictures(open, &answers, &field, job.simulates)?;
    work.write_json(Artifact::ReportJson, &report)?;
    let view = open.get::<ShowsMost>()?.view(open);
    let eye = view.map_or_else(Point3::origin, |view| view.camera.center_in_world());
    let cloud = Cloud::new(&open.scene.gaussians, &field, eye);
    let motion = report.simulation.as_ref().map(|simulation| {
        Motion::new(&cloud, &open.scene.gaussians, simulation, &mut |frame| simulate::frame(open, frame))
    });
    let corrections = place_for_corrections(open);
    let page = report::page(&report, &answers, &pictures, &cloud, motion.transpose()?.as_ref(), &corrections);
    work.write(Artifact::ReportHtml, page.as_bytes())?;
    Ok(Done::writing([Artifact::ReportJson, Artifact::ReportHtml]))
}

/// The file in which corrections are saved, and where.
fn place_for_corrections(open: &OpenScene) -> CorrectionsFile<'_> {
    let path = corrections_file(&open.path, open.options.scene.object);
    let mesh = open.path.file_name().filter(|_| open.scene.mesh.is_some() && open.path.is_file());
    CorrectionsFile {
        name: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        place: mesh
            .map_or_else(|| "in the scene's folder".to_owned(), |mesh| format!("beside {}", mesh.to_string_lossy())),
        library: &open.library,
    }
}

/// The pictures on the page.
fn pictures(open: &OpenScene, answers: &Answers, field: &MaterialField, simulates: bool) -> Result<Pictures> {
    let work = &open.work;
    let about = FoundSubjects::of(open)?;
    let maps = about.settled_maps(open, answers)?;
    let seen: Vec<_> = open.views.iter().zip(&maps).collect();
    let views = parallel::try_map(&seen, |(view, map)| ViewPictures::draw(view, map, &open.scene.gaussians, field))?;
    let recognized = &open.get::<Recognized>()?.0;
    // What was asked about the whole object was asked with one sheet.
    let asked_alone = if recognized.is_some() { &[] } else { answers.all.as_slice() };
    let sheets = parallel::try_map(asked_alone, |answer| -> Result<_> {
        let (view, number) = (answer.view.as_str(), answer.subject.number());
        Ok(SheetPicture::shrink(view, number, &work.read(Artifact::Sheet(view, number))?)?)
    })?;
    let object = match recognized {
        Some(_) => Some(shrink_object(&work.read(Artifact::ObjectSheet)?)?),
        None => None,
    };
    Ok(Pictures {
        views,
        sheets,
        object,
        animation: if simulates { work.read(Artifact::Animation)? } else { vec![] },
        grasp: grasp::picture(work)?,
    })
}

/// The result of a finished run.
pub(crate) fn report(open: &OpenScene, job: &Job) -> Result<Report> {
    let (scene, field, answers) = (&open.scene, parts::weighed_field(open)?, open.get::<Answers>()?);
    let is_in =
        |record: &&StageRecord| record.name < Stage::Report && (job.simulates || record.name != Stage::Simulate);
    let before = job.records.iter().filter(is_in);
    let parts = parts::metric_parts(open)?.map(Arc::unwrap_or_clone);
    Ok(Report {
        schema_version: report::SCHEMA_VERSION,
        version: env!("CARGO_PKG_VERSION"),
        scene: SceneSummary {
            name: scene.name.clone(),
            gaussians: scene.gaussians.len(),
            sh_degree: scene.gaussians.sh_degree,
            scale: parts::scale(open)?,
            claimed_mass_kg: scene.mesh.as_ref().and_then(|mesh| mesh.painted.mesh.claimed_mass_kg),
            misfit: scene::misfit(open)?,
            longest_side: scene.longest_side(),
            views: open.views.iter().map(|view| view.name.clone()).collect(),
            seen_gaussians: field.views.iter().filter(|&&views| views > 0).count(),
        },
        stages: before.clone().map(stage_time).collect(),
        answers: AnswerCounts::of(&answers),
        provisional: provisional(open)?,
        disagreements: Disagreement::all(&answers),
        parts,
        labels: field.parts.clone(),
        gaussians_per_label: gaussians_per_label(&field),
        simulation: job.simulates.then(|| open.get().map(Arc::unwrap_or_clone)).transpose()?,
        grasp: open.get::<Grasped>()?.0.as_deref().cloned(),
        warnings: before.clone().flat_map(|stage| remarks(stage, &stage.warnings)).collect(),
        notes: before.flat_map(|stage| remarks(stage, &stage.notes)).collect(),
        reproduction: Reproduction { command: command(open, job), inputs: inputs(open)? },
    })
}

/// That questions are open, if some are.
pub fn provisional(open: &OpenScene) -> Result<Option<String>> {
    let has_belief = parts::metric_parts(open)?.is_some_and(|parts| parts.belief.is_some());
    Ok(report::provisional(open.get::<Answers>()?.as_ref(), has_belief))
}

fn stage_time(stage: &StageRecord) -> StageTime {
    StageTime { name: stage.name.name(), seconds: stage.seconds, reused: stage.reused, digest: stage.digest.clone() }
}

/// The command line that reproduces this result from the folder above the scene's.
fn command(open: &OpenScene, job: &Job) -> String {
    let scene = open.path.canonicalize().unwrap_or_else(|_| open.path.clone());
    let (above, known) = (scene.parent().unwrap_or(&scene), known_flags());
    let name = scene.file_name().map_or(Path::new(&open.scene.name), Path::new);
    let left_out = (!job.simulates).then_some("--no-simulate");
    let flags = job.flags.iter().map(|flag| as_typed_in(above, flag, &known));
    let flags = left_out.map(Cow::Borrowed).into_iter().chain(flags);
    let words = flags.map(|flag| format!(" {}", shell::word(&flag)));
    format!("gprop run {}{}", shell::path(name), words.collect::<String>())
}

fn inputs(open: &OpenScene) -> Result<Vec<InputFile>> {
    let input = |path: &PathBuf| {
        let digest = file_digest(path)?;
        let path = path.strip_prefix(&open.folder).unwrap_or(path);
        Ok(InputFile { path: path.display().to_string(), sha256: hexadecimal(&digest) })
    };
    open.scene.files.iter().map(input).collect()
}

fn remarks(stage: &StageRecord, messages: &[String]) -> Vec<Remark> {
    messages.iter().map(|message| Remark { stage: stage.name.name(), message: message.clone() }).collect()
}

/// A flag as it would be typed in `folder`: its path, if its value is one, is relative to `folder` if it is inside it, else
/// absolute.
fn as_typed_in<'a>(folder: &Path, flag: &'a str, known: &[Flag]) -> Cow<'a, str> {
    let Some((name, value)) = flag.strip_prefix("--").and_then(|words| words.split_once('=')) else {
        return flag.into();
    };
    if known.iter().any(|known| known.name == name && known.is_path(value)) {
        format!("--{name}={}", config::portable(Path::new(value), folder).display()).into()
    } else {
        flag.into()
    }
}

fn gaussians_per_label(field: &MaterialField) -> Vec<usize> {
    let mut counts = vec![0; field.parts.len()];
    field.part_index.iter().for_each(|&label| counts[label as usize] += 1);
    counts
}
