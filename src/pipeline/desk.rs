//! What can be done with the queries of some views, a scene's or one picture: plan them, answer them, move them out and
//! answers in, prune what is recorded. Sending them by the Batch API is in `batch.rs`.

use std::borrow::Cow;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde::Serialize;

use crate::exit::UsageError;
use crate::materials::MaterialLibrary;
use crate::progress::Progress;
use crate::query::asker::Asker;
use crate::query::client::{ApiKey, Client};
use crate::query::cost::{Price, PriceTable};
use crate::query::exchange::{self, Imported};
use crate::query::recorded::Recordings;
use crate::query::{Options, Plan, Prompts, Queries, Run, ViewInput};
use crate::scene::Photo;
use crate::segment::ViewSegments;
use crate::workdir::{self, WorkDir};

/// Recordings lie beside what they are of, so that they travel with it.
const RECORDINGS: &str = "recorded";

/// Views with what the options say of how they are asked about.
pub struct Desk<'a> {
    pub(super) options: &'a Options,
    views: Vec<DeskView<'a>>,
    prompts: Prompts,
    /// The materials to choose among.
    pub(super) library: Cow<'a, MaterialLibrary>,
    prices: PriceTable,
    own_recordings: PathBuf,
    pub(super) recordings: Recordings,
    pub(super) client: Option<Client>,
    pub(super) work: &'a WorkDir,
    progress: Progress,
}

/// A view of a desk.
pub struct DeskView<'a> {
    pub name: &'a str,
    pub photo: Photo,
    pub segments: &'a ViewSegments,
}

/// What `--prune` did.
#[derive(Debug, Serialize)]
pub struct Pruned {
    pub kept: usize,
    pub removed: usize,
}

impl<'a> Desk<'a> {
    /// A desk for `views`, with recordings in `home` and in the folder that the options name.
    pub fn new(
        options: &'a Options,
        views: Vec<DeskView<'a>>,
        library: &'a MaterialLibrary,
        home: &Path,
        work: &'a WorkDir,
        progress: Progress,
    ) -> Result<Self> {
        let folders = recording_folders(options, home);
        workdir::refuse_link(&folders[0], "--recordings")?;
        let write_to = folders.last().expect("the home's folder is always among them");
        let read_from: Vec<&Path> = folders.iter().map(PathBuf::as_path).collect();
        Ok(Self {
            options,
            views,
            prompts: prompts(options)?,
            library: candidates(options, library)?,
            prices: prices(options)?,
            own_recordings: home.join(RECORDINGS),
            recordings: Recordings::open(&read_from, write_to)?,
            client: Client::new(options, ApiKey::from_environment()?)?,
            work,
            progress,
        })
    }

    /// The questions, with every sheet drawn.
    pub fn queries(&self) -> Result<Queries<'_>> {
        let inputs: Vec<_> = self
            .views
            .iter()
            .map(|view| ViewInput { name: view.name, photo: &view.photo, segments: view.segments })
            .collect();
        Ok(Queries::prepare(&inputs, &self.library, &self.prompts, self.options)?)
    }

    /// What would be sent, and what it would cost.
    pub fn plan(&self, queries: &Queries) -> Plan {
        queries.plan(&self.recordings, self.client.as_ref().map(Asker::answerer), self.price())
    }

    /// Answers all queries; each answer is recorded as it comes. Says before and after what it costs.
    pub fn run(&self, queries: &Queries) -> Result<Run> {
        let asker = self.client.as_ref().map(|client| client as &dyn Asker);
        if asker.is_some() {
            say(&format!("query: {}", self.plan(queries)));
        }
        let run = queries.run(&self.recordings, asker, self.price(), &mut |_, _| Ok(()), self.progress)?;
        if run.spent.requests > 0 {
            say(&format!(
                "query: {}; {} of {} parts failed",
                run.spent,
                run.answers.failed().count(),
                queries.parts.len()
            ));
        }
        Ok(run)
    }

    /// Writes the parts that have no recorded answer, with everything needed to answer them, into a new folder.
    pub fn export(&self, folder: &Path) -> Result<usize> {
        let queries = self.queries()?;
        Ok(exchange::export(folder, &queries.unanswered(&self.recordings, None))?)
    }

    /// Checks the answers in a folder that [`Self::export`] wrote, and records the good ones.
    pub fn import(&self, folder: &Path) -> Result<Imported> {
        let model = self.options.lmm_model.as_deref();
        let questions = &self.queries()?.questions;
        Ok(exchange::import(folder, model, questions, &self.library, &self.recordings)?)
    }

    /// Removes the recordings of the views' own folder that no part of them uses with these options, whoever answered. A
    /// folder given with `--recordings` may serve other scenes too and is left alone.
    pub fn prune(&self) -> Result<Pruned> {
        let own = Recordings::open(&[], &self.own_recordings)?;
        let used = self.queries()?.used(&own);
        let (kept, useless): (Vec<_>, Vec<_>) = own.keys().into_iter().partition(|key| used.contains(key));
        for key in &useless {
            own.remove(key)?;
        }
        Ok(Pruned { kept: kept.len(), removed: useless.len() })
    }

    pub(super) fn price(&self) -> Option<&Price> {
        self.options.lmm_model.as_deref().and_then(|model| self.prices.price(model))
    }
}

/// Where recordings are read; new ones go to the last.
pub fn recording_folders(options: &Options, home: &Path) -> Vec<PathBuf> {
    [home.join(RECORDINGS)].into_iter().chain(options.recordings.clone()).collect()
}

/// The built-in prompts or the user's.
pub fn prompts(options: &Options) -> Result<Prompts> {
    Ok(options.prompts.as_deref().map_or_else(|| Ok(Prompts::builtin()), Prompts::from_folder)?)
}

/// The materials that a model may choose among.
pub fn candidates<'a>(options: &Options, library: &'a MaterialLibrary) -> Result<Cow<'a, MaterialLibrary>> {
    Ok(match &options.labels {
        Some(labels) => Cow::Owned(labels.restrict(library)?),
        None => Cow::Borrowed(library),
    })
}

fn prices(options: &Options) -> Result<PriceTable> {
    let Some(path) = &options.prices else { return Ok(PriceTable::builtin()) };
    let text =
        fs::read_to_string(path).map_err(|error| UsageError(format!("cannot read --prices {path:?}: {error}")))?;
    PriceTable::from_csv(&text).with_context(|| format!("{path:?}"))
}

/// Tells the user what must not be missed; progress may be hidden, this is not.
fn say(message: &str) {
    eprintln!("{message}");
}
