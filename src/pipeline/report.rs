//! The report: the results of all stages before it, as one JSON file and one page.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::gaussians::bounds::longest_side;
use anyhow::Result;
use nalgebra::Point3;
use rayon::prelude::*;

use crate::config::{self, Flag};
use crate::consensus::Asked;
use crate::report::{
    self, AnswerCounts, Cloud, Disagreement, InputFile, Motion, Pictures, Remark, Report, Reproduction, SceneSummary,
    SheetPicture, StageTime, ViewPictures,
};
use crate::simulate::SimulationReport;
use crate::vote::MaterialField;
use crate::workdir::{Artifact, hexadecimal};

use super::record::StageRecord;
use super::scene::file_digest;
use super::{Done, Pipeline, Stage, known_flags};

impl Pipeline {
    pub(super) fn report_key(&self) -> String {
        self.key_after_inputs(Stage::Report).with(self.scene.name.as_bytes()).hex()
    }

    pub(super) fn do_report(&self) -> Result<Done> {
        let report = self.report()?;
        let maps = self.settled_maps(self.stored_answers()?)?;
        let views = self.views.par_iter().zip(&maps);
        let (gaussians, field) = (&self.scene.gaussians, &*self.weighed_field()?);
        let views = views.map(|(view, map)| ViewPictures::draw(view, map, gaussians, field));
        let answers = self.stored_answers()?;
        let sheets = answers.segments.par_iter().map(|segment| {
            let sheet = self.work.read(Artifact::Sheet(&segment.view, segment.segment))?;
            Ok(SheetPicture::shrink(&segment.view, segment.segment, &sheet)?)
        });
        let pictures = Pictures {
            views: views.collect::<Result<_, _>>()?,
            sheets: sheets.collect::<Result<_>>()?,
            animation: if self.simulates { self.work.read(Artifact::Animation)? } else { vec![] },
            grasp: self.grasp_picture()?,
        };
        self.work.write_json(Artifact::ReportJson, &report)?;
        let eye = self.showing_view(field).map_or_else(Point3::origin, |view| view.camera.center_in_world());
        let cloud = Cloud::new(gaussians, field, eye);
        let motion = report.simulation.as_ref().map(|simulation| self.motion(&cloud, simulation)).transpose()?;
        let page = report::page(&report, answers, &pictures, &cloud, motion.as_ref());
        self.work.write(Artifact::ReportHtml, page.as_bytes())?;
        Ok(Done::writing([Artifact::ReportJson, Artifact::ReportHtml]))
    }

    /// The result of a finished run.
    pub(crate) fn report(&self) -> Result<Report> {
        let (scene, field) = (&self.scene, self.weighed_field()?);
        let is_in =
            |record: &&StageRecord| record.name < Stage::Report && (self.simulates || record.name != Stage::Simulate);
        let before = self.record.stages.iter().filter(is_in);
        Ok(Report {
            schema_version: report::SCHEMA_VERSION,
            version: env!("CARGO_PKG_VERSION"),
            scene: SceneSummary {
                name: scene.name.clone(),
                gaussians: scene.gaussians.len(),
                sh_degree: scene.gaussians.sh_degree,
                scale: self.metric_scale()?,
                longest_side: longest_side(&scene.gaussians),
                views: self.views.iter().map(|view| view.name.clone()).collect(),
                seen_gaussians: field.views.iter().filter(|&&views| views > 0).count(),
            },
            stages: before
                .clone()
                .map(|stage| StageTime {
                    name: stage.name.name(),
                    seconds: stage.seconds,
                    reused: stage.reused,
                    digest: stage.digest.clone(),
                })
                .collect(),
            answers: AnswerCounts::of(self.stored_answers()?),
            disagreements: match self.options.consensus.ask {
                Asked::Parts => Disagreement::all(self.stored_answers()?),
                Asked::Segments => Vec::new(),
            },
            parts: self.stored_parts()?,
            labels: field.labels.clone(),
            gaussians_per_label: gaussians_per_label(&field),
            simulation: self.simulates.then(|| self.stored_simulation()).transpose()?,
            grasp: self.stored_grasp()?,
            warnings: before.clone().flat_map(|stage| remarks(stage, &stage.warnings)).collect(),
            notes: before.flat_map(|stage| remarks(stage, &stage.notes)).collect(),
            reproduction: Reproduction { command: self.command(), inputs: self.inputs()? },
        })
    }

    /// How the Gaussians of `cloud` move in the simulation.
    fn motion(&self, cloud: &Cloud, simulation: &SimulationReport) -> Result<Motion> {
        Motion::new(cloud, &self.scene.gaussians, simulation, &mut |frame| self.frame(frame))
    }

    /// The command line that reproduces this result from the folder above the scene's.
    fn command(&self) -> String {
        let scene = self.folder.canonicalize().unwrap_or_else(|_| self.folder.clone());
        let (above, known) = (scene.parent().unwrap_or(&scene), known_flags());
        let left_out = (!self.simulates).then_some("--no-simulate");
        let flags = self.command_line.effective.iter().map(|flag| as_typed_in(above, flag, &known));
        let words = ["gprop", "run", &self.scene.name].into_iter().chain(left_out).map(Cow::Borrowed).chain(flags);
        words.map(|word| quoted(&word)).collect::<Vec<_>>().join(" ")
    }

    fn inputs(&self) -> Result<Vec<InputFile>> {
        let input = |path: &PathBuf| {
            let digest = file_digest(path)?;
            let path = path.strip_prefix(&self.folder).unwrap_or(path);
            Ok(InputFile { path: path.display().to_string(), sha256: hexadecimal(&digest) })
        };
        self.scene.files.iter().map(input).collect()
    }
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
    match known.iter().any(|known| known.name == name && known.is_path(value)) {
        true => format!("--{name}={}", config::portable(Path::new(value), folder).display()).into(),
        false => flag.into(),
    }
}

/// A word, quoted for the shell if necessary.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,@%+".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

fn gaussians_per_label(field: &MaterialField) -> Vec<usize> {
    let mut counts = vec![0; field.labels.len()];
    field.part_label.iter().for_each(|&label| counts[label as usize] += 1);
    counts
}
