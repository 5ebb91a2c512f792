//! The report: everything the stages before it left, as one JSON file and one page.

use anyhow::Result;
use rayon::prelude::*;

use crate::report::{self, AnswerCounts, Pictures, Report, SceneSummary, StageTime, ViewPictures, Warning};
use crate::vote::MaterialField;
use crate::workdir::Artifact;

use super::{Done, Pipeline, Stage};

impl Pipeline {
    pub(super) fn report_key(&self) -> String {
        self.key_after(Stage::Report, &Stage::ALL[..Stage::ALL.len() - 1]).hex()
    }

    pub(super) fn do_report(&self) -> Result<Done> {
        let report = self.report()?;
        let segmentation = self.segmentation()?;
        let views = self.views.par_iter().zip(&segmentation.views);
        let (gaussians, field) = (&self.scene.gaussians, self.field()?);
        let views = views.map(|(view, segments)| ViewPictures::draw(view, &segments.map, gaussians, field));
        let pictures = Pictures {
            views: views.collect::<Result<_>>()?,
            animation: self.work.read(Artifact::Animation)?,
            grasp: self.grasp_picture()?,
        };
        self.work.write_json(Artifact::ReportJson, &report)?;
        let page = report::page(&report, self.answers()?, &pictures);
        self.work.write(Artifact::ReportHtml, page.as_bytes())?;
        Ok(Done::writing([Artifact::ReportJson, Artifact::ReportHtml]))
    }

    /// The result of a finished run.
    pub fn report(&self) -> Result<Report> {
        let (scene, field) = (&self.scene, self.field()?);
        let before = self.record.stages.iter().filter(|record| record.name < Stage::Report);
        let name = |stage: Stage| format!("{stage:?}").to_lowercase();
        Ok(Report {
            version: env!("CARGO_PKG_VERSION"),
            scene: SceneSummary {
                name: scene.name.clone(),
                gaussians: scene.gaussians.len(),
                sh_degree: scene.gaussians.sh_degree,
                scale: scene.scale.clone(),
                views: self.views.iter().map(|view| view.name.clone()).collect(),
                seen_gaussians: field.views.iter().filter(|&&views| views > 0).count(),
            },
            stages: before
                .clone()
                .map(|stage| StageTime { name: name(stage.name), seconds: stage.seconds, reused: stage.reused })
                .collect(),
            answers: AnswerCounts::of(self.answers()?),
            parts: self.metric_parts()?,
            labels: field.labels.clone(),
            gaussians_per_label: gaussians_per_label(field),
            simulation: self.simulation()?,
            grasp: self.grasp()?,
            warnings: before
                .flat_map(|stage| {
                    let warn = |message: &String| Warning { stage: name(stage.name), message: message.clone() };
                    stage.warnings.iter().map(warn)
                })
                .collect(),
        })
    }
}

fn gaussians_per_label(field: &MaterialField) -> Vec<usize> {
    let mut counts = vec![0; field.labels.len()];
    field.part_label.iter().for_each(|&label| counts[label as usize] += 1);
    counts
}
