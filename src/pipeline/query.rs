//! Queries on disk: a sheet a part, recordings as they come, `answers.jsonl` when all are there; export and import.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::from_splat::photo_with_foreground;
use crate::query::asker::Asker;
use crate::query::client::{ApiKey, Client};
use crate::query::cost::PriceTable;
use crate::query::exchange::{self, Imported};
use crate::query::question::Questions;
use crate::query::recorded::Recordings;
use crate::query::{AnswerSource, Answers, Outcome, Plan, Prompts, Queries, ViewInput};
use crate::scene::Photo;
use crate::workdir::Artifact;

use super::record::Hasher;
use super::{Done, Pipeline, Stage, get_or_load};

/// Recordings of a scene lie in it, so that they travel with it.
const RECORDINGS: &str = "recorded";

impl Pipeline {
    pub(super) fn query_key(&self) -> Result<String> {
        let mut hasher = self
            .key_after(Stage::Query, &[Stage::Scene, Stage::Segment])
            .with_json(&self.options.query)
            .with_json(&self.library.materials())
            .with_json(&self.prompts()?.sha256());
        for folder in self.recording_folders() {
            for (name, length) in recordings_in(&folder) {
                hasher = hasher.with(name.as_bytes()).with(&length.to_le_bytes());
            }
        }
        Ok(hasher.hex())
    }

    pub(super) fn do_query(&self) -> Result<Done> {
        let (photos, prompts) = (self.photos()?, self.prompts()?);
        let queries = self.queries(&photos, &prompts)?;
        for part in &queries.parts {
            self.work.write(Artifact::Sheet(&part.view, part.part), &part.jpeg)?;
        }
        let recordings = self.recordings()?;
        let client = Client::new(&self.options.query, ApiKey::from_environment()?)?;
        let prices = self.prices()?;
        let price = self.options.query.lmm_model.as_deref().and_then(|model| prices.price(model));
        let asker = client.as_ref().map(|client| client as &dyn Asker);
        if let Some(asker) = asker {
            self.announce(&queries.plan(&recordings, Some(asker.answerer()), price));
        }
        let run = queries.run(&recordings, asker, price, &mut |_, _| Ok(()), self.progress)?;
        if run.spent.requests > 0 {
            self.say(&format!("query: {}", run.spent));
        }

        let jsonl = run.answers.to_jsonl();
        self.work.write(Artifact::Answers, jsonl.as_bytes())?;
        let sheets = queries.parts.iter().map(|part| Artifact::Sheet(&part.view, part.part));
        let done = Done::writing(sheets.chain([Artifact::Answers])).warning(warnings(&run.answers));
        Ok(Done { digest: Some(Hasher::new("answers").with(jsonl.as_bytes()).hex()), ..done })
    }

    /// The answers of all parts.
    pub fn answers(&self) -> Result<&Answers> {
        get_or_load(&self.answers, || {
            let text = String::from_utf8(self.work.read(Artifact::Answers)?).context("answers.jsonl is no text")?;
            Answers::from_jsonl(&text).with_context(|| format!("{:?}", self.work.path(Artifact::Answers)))
        })
    }

    /// Writes the parts that have no recorded answer, with everything needed to answer them, into a new folder.
    pub fn export_queries(&self, folder: &Path) -> Result<usize> {
        let (photos, prompts) = (self.photos()?, self.prompts()?);
        let queries = self.queries(&photos, &prompts)?;
        Ok(exchange::export(folder, &queries.unanswered(&self.recordings()?))?)
    }

    /// Checks the answers in a folder that [`Self::export_queries`] wrote, and records the good ones.
    pub fn import_answers(&self, folder: &Path, model: Option<&str>) -> Result<Imported> {
        let (options, prompts) = (&self.options.query, self.prompts()?);
        let questions = Questions::new(&prompts, &self.library, options.guidance, options.context)?;
        Ok(exchange::import(folder, model, &questions, &self.library, &self.recordings()?)?)
    }

    /// What a query would send, and what it would cost.
    pub fn query_plan(&self) -> Result<Plan> {
        let (photos, prompts) = (self.photos()?, self.prompts()?);
        let queries = self.queries(&photos, &prompts)?;
        let client = Client::new(&self.options.query, ApiKey::from_environment()?)?;
        let prices = self.prices()?;
        let price = self.options.query.lmm_model.as_deref().and_then(|model| prices.price(model));
        let answerer = client.as_ref().map(Asker::answerer);
        Ok(queries.plan(&self.recordings()?, answerer, price))
    }

    fn queries<'a>(&'a self, photos: &'a [Photo], prompts: &'a Prompts) -> Result<Queries<'a>> {
        let segmentation = self.segmentation()?;
        let inputs = self.views.iter().zip(photos).zip(&segmentation.views);
        let inputs: Vec<_> =
            inputs.map(|((view, photo), segments)| ViewInput { name: &view.name, photo, segments }).collect();
        Ok(Queries::prepare(&inputs, &self.library, prompts, &self.options.query)?)
    }

    fn photos(&self) -> Result<Vec<Photo>> {
        self.views.iter().map(|view| Ok(photo_with_foreground(&self.scene, view)?)).collect()
    }

    fn prompts(&self) -> Result<Prompts> {
        Ok(match &self.options.query.prompts {
            Some(folder) => Prompts::from_folder(folder)?,
            None => Prompts::builtin(),
        })
    }

    fn prices(&self) -> Result<PriceTable> {
        let Some(path) = &self.options.query.prices else { return Ok(PriceTable::builtin()) };
        let text = fs::read_to_string(path).with_context(|| format!("cannot read {path:?}"))?;
        PriceTable::from_csv(&text).with_context(|| format!("{path:?}"))
    }

    fn recordings(&self) -> Result<Recordings> {
        let folders = self.recording_folders();
        let folders: Vec<&Path> = folders.iter().map(PathBuf::as_path).collect();
        let write_to = folders.last().expect("the scene's folder is always among them");
        Ok(Recordings::open(&folders, write_to)?)
    }

    /// Where recordings are read; new ones go to the last.
    fn recording_folders(&self) -> Vec<PathBuf> {
        [self.folder.join(RECORDINGS)].into_iter().chain(self.options.query.recordings.clone()).collect()
    }

    fn announce(&self, plan: &Plan) {
        self.say(&format!("query: {} parts, {} recorded; to ask: {}", plan.parts, plan.recorded, plan.cost));
    }

    /// Whether the model is to be asked whatever is recorded.
    pub(super) fn asks_anew(&self) -> bool {
        self.options.query.answers == AnswerSource::Live
    }
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

/// Every failure by itself; what was corrected or doubted once, with the number of parts it holds for.
fn warnings(answers: &Answers) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut flags: BTreeMap<&str, usize> = BTreeMap::new();
    for part in &answers.parts {
        match &part.outcome {
            Outcome::Failed(failure) => warnings.push(format!("view {} part {}: {failure}", part.view, part.part)),
            Outcome::Answered(answer) => {
                answer.flags.iter().for_each(|flag| *flags.entry(flag).or_default() += 1);
            }
        }
    }
    warnings.extend(flags.into_iter().map(|(flag, parts)| format!("{flag} ({parts} of the answers)")));
    warnings
}
