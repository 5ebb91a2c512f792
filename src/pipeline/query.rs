//! Queries on disk: one sheet per question, recordings as they arrive, `answers.jsonl` when all are complete.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Result;
use serde::{Deserialize, Serialize};

use crate::consensus::Asked;
use crate::from_splat::photo_with_foreground;
use crate::query::{
    AnswerSource, Answers, LabelSet, Match, Options, Outcome, Preview, Queries, SegmentAnswer, SizeAnswer, SizeOutcome,
    SizeQuery,
};
use crate::scene::ScaleChoice;
use crate::units::{MetricScale, Range};
use crate::words::output::{agreeing, counted};
use crate::words::part_name::part_name;
use crate::workdir::{Artifact, WorkDir, WorkDirError};

use super::query_session::{self, QuerySession, QueryView};
use super::record::Hasher;
use super::scene::file_digest;
use super::{Done, Pipeline, Stage, get_or_load};

/// The content of `size.json`.
#[derive(Serialize, Deserialize)]
struct SizeFile {
    #[serde(flatten)]
    answer: SizeAnswer,
    scale: Option<MetricScale>,
}

impl Pipeline {
    pub(super) fn query_key(&self) -> Result<String> {
        let options = &self.options.query;
        // The content of these files and folders counts, not how their paths are written.
        let labels = options.labels.clone().filter(|labels| !matches!(labels, LabelSet::File(_)));
        let without_paths = Options { prompts: None, recordings: None, lmm_body: None, labels, ..options.clone() };
        let candidates = query_session::candidates(options, &self.library)?;
        let mut hasher = self
            .key_after_inputs(Stage::Query)
            .with_json(&without_paths)
            .with_json(&self.options.consensus.ask_views)
            .with_json(&candidates.families())
            .with_json(&candidates.materials())
            .with_json(&self.library.fillings())
            .with_json(&query_session::prompts(options)?.sha256());
        if let Some(fields) = &options.lmm_body {
            hasher = hasher.with(&file_digest(fields).unwrap_or_default());
        }
        for folder in query_session::recording_folders(options, &self.folder) {
            for path in recordings_in(&folder) {
                hasher = hasher
                    .with(path.file_name().unwrap_or_default().as_encoded_bytes())
                    .with(&file_digest(&path).unwrap_or_default());
            }
        }
        Ok(hasher.hex())
    }

    pub(super) fn do_query(&self) -> Result<Done> {
        let session = self.query_session()?;
        let (answers, file) =
            session.answer_with_size(&|round| Ok(write_sheets(&self.work, round)?), |answer| self.size_file(answer))?;
        let answers = settled(answers);
        let jsonl = answers.to_jsonl();
        self.work.write(Artifact::Answers, jsonl.as_bytes())?;
        answers.require_any()?;
        let sheets = answers.segments.iter().map(|answer| Artifact::Sheet(&answer.view, answer.segment));
        let mut outputs: Vec<Artifact> = sheets.chain([Artifact::Answers]).collect();
        let mut warnings = failures(&answers, self.options.consensus.ask);
        if let Some((file, warning)) = &file {
            self.work.write_json(Artifact::Size, file)?;
            warnings.push(warning.clone());
            outputs.extend([Artifact::Size, Artifact::Sheet(&file.answer.view, SizeQuery::WHOLE)]);
        }
        let digest = Hasher::new("answers").with(jsonl.as_bytes()).with_json(&file).hex();
        let done = Done::writing(outputs).warning(warnings).noting(notes(&answers));
        Ok(Done { digest: Some(digest), ..done })
    }

    /// The size of the object with the scale that follows from it, and what the user should know about that scale.
    fn size_file(&self, answer: SizeAnswer) -> Result<(SizeFile, String)> {
        let size = match &answer.outcome {
            SizeOutcome::Answered(size) => size,
            SizeOutcome::Failed(failure) => {
                let warning = format!("view {}: the model did not say how long the object is: {failure}", answer.view);
                return Ok((SizeFile { answer, scale: None }, warning));
            }
        };
        let (scale, unusual) = self.scene.estimated_scale(&size.object, size.longest_side_m)?;
        let Range { low, high } = size.longest_side_m;
        let warning = format!(
            "the metric scale is {}; its interval alone makes masses uncertain by a factor of {:.1}. Measure a length \
             (--scale) or weigh the object (--known-mass)",
            scale.provenance,
            (high / low).powi(3)
        );
        let warning = [Some(warning), unusual].into_iter().flatten().collect::<Vec<_>>().join("; ");
        Ok((SizeFile { answer, scale: Some(scale) }, warning))
    }

    /// Takes over the scale that the query stage found by asking for the size of the object.
    pub(super) fn recall_estimated_scale(&mut self) -> Result<()> {
        if self.options.scene.scale == ScaleChoice::Estimate {
            self.scene.scale = estimated_scale(&self.work)?;
        }
        Ok(())
    }

    /// The stored answers.
    pub(super) fn stored_answers(&self) -> Result<&Answers> {
        get_or_load(&self.answers, || {
            let answers = read_answers(&self.work)?;
            // The names of files are made of the views' names, and the work folder may come from anyone.
            let unknown = answers.segments.iter().find(|answer| !self.votes(&answer.view));
            if let Some(SegmentAnswer { view, .. }) = unknown {
                let problem = format!("it has an answer about {view:?}, which is not among the chosen views");
                return Err(self.work.damaged(Artifact::Answers, problem).into());
            }
            Ok(answers)
        })
    }

    /// Estimates what a query would send, and its cost.
    pub(crate) fn query_preview(&self) -> Result<Preview> {
        let session = self.query_session()?;
        Ok(session.preview(&session.queries()?))
    }

    /// The queries of the chosen views; the parts must have been found.
    pub(crate) fn query_session(&self) -> Result<QuerySession<'_>> {
        self.query_session_with(&self.options.query)
    }

    /// Like [`Self::query_session`], but with other options than the run's.
    pub(super) fn query_session_with<'a>(&'a self, options: &'a Options) -> Result<QuerySession<'a>> {
        let views = self.views.iter().enumerate().map(|(number, view)| {
            let photo = photo_with_foreground(&self.scene, view)?;
            Ok(QueryView { name: &view.name, photo, maps: self.asked_maps(number)? })
        });
        let views = views.collect::<Result<_>>()?;
        let scope = self.options.scene.read_scope(&self.folder);
        query_session::check_recordings(options, &self.folder, &self.work, scope)?;
        let network = self.options.setup.network();
        let subjects = self.subjects(views)?;
        QuerySession::new(options, subjects, &self.library, &self.folder, &self.work, network, self.progress)
    }

    /// True if answers of an earlier run are not to be reused: either the model is to be asked regardless of
    /// recordings, or it can be asked again the questions that it failed to answer.
    pub(super) fn asks_anew(&self) -> bool {
        let options = &self.options.query;
        let no_size = || {
            let asked = self.options.scene.scale == ScaleChoice::Estimate;
            asked && estimated_scale(&self.work).is_ok_and(|scale| scale.is_none())
        };
        let failed = || no_size() || read_answers(&self.work).is_ok_and(|answers| answers.failed().next().is_some());
        match options.answers {
            AnswerSource::Replay => false,
            AnswerSource::Record => options.lmm_url.is_some() && failed(),
            AnswerSource::Live => true,
        }
    }
}

/// The scale in `size.json`; `None` if the model did not say how long the object is.
pub(super) fn estimated_scale(work: &WorkDir) -> Result<Option<MetricScale>, WorkDirError> {
    Ok(work.read_json::<SizeFile>(Artifact::Size)?.scale)
}

fn read_answers(work: &WorkDir) -> Result<Answers> {
    let damaged = |problem: &dyn std::fmt::Display| work.damaged(Artifact::Answers, problem);
    let text = String::from_utf8(work.read(Artifact::Answers)?).map_err(|problem| damaged(&problem))?;
    Ok(Answers::from_jsonl(&text).map_err(|problem| damaged(&problem))?)
}

/// The answers as any later run finds them: an answer that the model just gave counts as recorded for exactly this query.
/// So a run that was killed while asking ends in the same bytes as one that was not, and a rerun of either has nothing to redo.
fn settled(mut answers: Answers) -> Answers {
    for segment in &mut answers.segments {
        if let Outcome::Answered(answer) = &mut segment.outcome
            && answer.matched == Match::Live
        {
            answer.matched = Match::Exact;
        }
    }
    answers
}

/// Writes the sheet of every question.
pub(super) fn write_sheets(work: &WorkDir, queries: &Queries) -> Result<(), WorkDirError> {
    let object = queries.size.map(|size| &size.shown);
    queries
        .segments
        .iter()
        .chain(object)
        .try_for_each(|segment| work.write(Artifact::Sheet(&segment.view, segment.segment), &segment.jpeg))
}

/// The recordings in a folder, sorted; none if it cannot be read.
fn recordings_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut found: Vec<_> = entries.filter(|path| path.extension().is_some_and(|end| end == "json")).collect();
    found.sort();
    found
}

/// The questions without an answer.
fn failures(answers: &Answers, asked: Asked) -> Vec<String> {
    let noun = match asked {
        Asked::Parts => "part",
        Asked::Segments => "segment",
    };
    // Other views' answers name a part; a segment's number means something else in every view.
    let name = |number: u16| {
        let mut about = answers.segments.iter().filter(|segment| asked == Asked::Parts && segment.segment == number);
        let name = about.find_map(|segment| match &segment.outcome {
            Outcome::Answered(answer) => Some(part_name(&answer.caption, &answer.material)),
            Outcome::Failed(_) => None,
        });
        name.map_or_else(String::new, |name| format!(" ({name})"))
    };
    let failure = |segment: &SegmentAnswer| match &segment.outcome {
        Outcome::Failed(failure) => {
            let (view, number) = (&segment.view, segment.segment);
            Some(format!("view {view}, {noun} {number}{}: {failure}", name(number)))
        }
        Outcome::Answered(_) => None,
    };
    answers.segments.iter().filter_map(failure).collect()
}

/// Each correction or doubt once, with the number of answers that it applies to; and the number of answers that were
/// recorded for slightly different masks.
fn notes(answers: &Answers) -> Vec<String> {
    let mut notes = Vec::new();
    let mut overlaps: Vec<f64> = Vec::new();
    let mut flags: BTreeMap<&str, usize> = BTreeMap::new();
    for segment in &answers.segments {
        if let Outcome::Answered(answer) = &segment.outcome {
            answer.flags.iter().for_each(|flag| *flags.entry(flag).or_default() += 1);
            if let Match::Mask { iou } = answer.matched {
                overlaps.push(iou);
            }
        }
    }
    notes.extend(flags.into_iter().map(|(flag, segments)| format!("{flag} (in {})", counted(segments, "answer"))));
    if let Some(least) = overlaps.iter().copied().min_by(f64::total_cmp) {
        let (count, all) = (overlaps.len(), answers.segments.len());
        notes.push(format!(
            "{count} of {} {} recorded for slightly different masks (IoU {least:.3} or more)",
            counted(all, "answer"),
            agreeing(count, "was", "were"),
        ));
    }
    notes
}
