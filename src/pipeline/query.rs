//! Queries on disk: a sheet a part, recordings as they come, `answers.jsonl` when all are there.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::Result;

use crate::from_splat::photo_with_foreground;
use crate::query::{AnswerSource, Answers, Match, Options, Outcome, Plan, Queries};
use crate::workdir::{Artifact, WorkDir, WorkDirError};

use super::desk::{self, Desk, DeskView};
use super::record::Hasher;
use super::{Done, Pipeline, Stage, get_or_load};

impl Pipeline {
    pub(super) fn query_key(&self) -> Result<String> {
        let options = &self.options.query;
        let mut hasher = self
            .key_after_inputs(Stage::Query)
            .with_json(options)
            .with_json(&desk::candidates(options, &self.library)?.materials())
            .with_json(&desk::prompts(options)?.sha256());
        for folder in desk::recording_folders(options, &self.folder) {
            for (name, length) in recordings_in(&folder) {
                hasher = hasher.with(name.as_bytes()).with(&length.to_le_bytes());
            }
        }
        Ok(hasher.hex())
    }

    pub(super) fn do_query(&self) -> Result<Done> {
        let desk = self.desk()?;
        let queries = desk.queries()?;
        write_sheets(&self.work, &queries)?;
        let answers = settled(desk.run(&queries)?.answers);
        let jsonl = answers.to_jsonl();
        self.work.write(Artifact::Answers, jsonl.as_bytes())?;
        answers.require_any()?;
        let sheets = queries.parts.iter().map(|part| Artifact::Sheet(&part.view, part.part));
        let done = Done::writing(sheets.chain([Artifact::Answers])).warning(warnings(&answers));
        Ok(Done { digest: Some(Hasher::new("answers").with(jsonl.as_bytes()).hex()), ..done })
    }

    /// The answers of all parts.
    pub fn answers(&self) -> Result<&Answers> {
        get_or_load(&self.answers, || read_answers(&self.work))
    }

    /// What a query would send, and what it would cost.
    pub fn query_plan(&self) -> Result<Plan> {
        let desk = self.desk()?;
        Ok(desk.plan(&desk.queries()?))
    }

    /// The queries of the chosen views; the scene must be segmented.
    pub fn desk(&self) -> Result<Desk<'_>> {
        self.desk_with(&self.options.query)
    }

    /// As [`Self::desk`], with other options than the run's.
    pub(super) fn desk_with<'a>(&'a self, options: &'a Options) -> Result<Desk<'a>> {
        let views = self.views.iter().zip(&self.segmentation()?.views).map(|(view, segments)| {
            Ok(DeskView { name: &view.name, photo: photo_with_foreground(&self.scene, view)?, segments })
        });
        let views = views.collect::<Result<_>>()?;
        Desk::new(options, views, &self.library, &self.folder, &self.work, self.progress)
    }

    /// Whether what an earlier run was answered does not count: the model is to be asked whatever is recorded, or it may
    /// be asked again what it failed to answer.
    pub(super) fn asks_anew(&self) -> bool {
        let options = &self.options.query;
        let failed = || read_answers(&self.work).is_ok_and(|answers| answers.failed().next().is_some());
        match options.answers {
            AnswerSource::Replay => false,
            AnswerSource::Record => options.lmm_url.is_some() && failed(),
            AnswerSource::Live => true,
        }
    }
}

fn read_answers(work: &WorkDir) -> Result<Answers> {
    let damaged = |problem: &dyn std::fmt::Display| work.damaged(Artifact::Answers, problem);
    let text = String::from_utf8(work.read(Artifact::Answers)?).map_err(|problem| damaged(&problem))?;
    Ok(Answers::from_jsonl(&text).map_err(|problem| damaged(&problem))?)
}

/// The answers as any later run finds them: what was asked just now is recorded for exactly this query. So a run that was
/// killed while it asked comes to the same bytes as one that was not, and a rerun of either has nothing to redo.
fn settled(mut answers: Answers) -> Answers {
    for part in &mut answers.parts {
        if let Outcome::Answered(answer) = &mut part.outcome
            && answer.matched == Match::Live
        {
            answer.matched = Match::Exact;
        }
    }
    answers
}

/// Writes the picture of every part.
pub(super) fn write_sheets(work: &WorkDir, queries: &Queries) -> Result<(), WorkDirError> {
    queries.parts.iter().try_for_each(|part| work.write(Artifact::Sheet(&part.view, part.part), &part.jpeg))
}

/// Names and lengths of the recordings in a folder, sorted; a recording's name is the hash of what it answers.
fn recordings_in(folder: &Path) -> Vec<(String, u64)> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let named = |entry: fs::DirEntry| {
        let name = entry.file_name().into_string().ok().filter(|name| name.ends_with(".json"))?;
        Some((name, entry.metadata().ok()?.len()))
    };
    let mut found: Vec<_> = entries.filter_map(named).collect();
    found.sort();
    found
}

/// Every failure by itself; what was corrected or doubted once, with the number of parts it holds for; how many answers
/// were recorded for slightly other masks.
fn warnings(answers: &Answers) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut overlaps: Vec<f64> = Vec::new();
    let mut flags: BTreeMap<&str, usize> = BTreeMap::new();
    for part in &answers.parts {
        match &part.outcome {
            Outcome::Failed(failure) => warnings.push(format!("view {} part {}: {failure}", part.view, part.part)),
            Outcome::Answered(answer) => {
                answer.flags.iter().for_each(|flag| *flags.entry(flag).or_default() += 1);
                if let Match::Mask { iou } = answer.matched {
                    overlaps.push(iou);
                }
            }
        }
    }
    warnings.extend(flags.into_iter().map(|(flag, parts)| format!("{flag} ({parts} of the answers)")));
    if let Some(least) = overlaps.iter().copied().min_by(f64::total_cmp) {
        let (count, all) = (overlaps.len(), answers.parts.len());
        warnings
            .push(format!("{count} of {all} answers were recorded for slightly other masks (IoU {least:.3} or more)"));
    }
    warnings
}
