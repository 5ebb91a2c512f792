//! The queries of some views, of a scene or of a single picture: estimates them, answers them, exports questions,
//! imports answers and prunes recordings. Sending them through the Batch API is in `batch_api.rs`.

use std::borrow::Cow;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde::Serialize;

use crate::error::UsageError;
use crate::materials::MaterialLibrary;
use crate::progress::{self, Progress};
use crate::query::asker::Asker;
use crate::query::client::{ApiKey, Client};
use crate::query::cost::{Price, PriceTable};
use crate::query::exchange::{self, Imported};
use crate::query::recorded::Recordings;
use crate::query::{Options, Preview, Prompts, Queries, Run, ViewInput};
use crate::read_scope::ReadScope;
use crate::scene::{Photo, Reference, SceneError};
use crate::segment::ViewSegments;
use crate::setup::Offline;
use crate::workdir::{self, WorkDir};

/// Recordings are stored beside their scene or picture, so that they are copied together with it.
const RECORDINGS: &str = "recorded";

/// The folder in the work folder for recordings that could not be written to their own.
const SPARE_RECORDINGS: &str = "unrecorded";

/// Views, with the options for asking about them.
pub struct QuerySession<'a> {
    pub(super) options: &'a Options,
    views: Vec<QueryView<'a>>,
    prompts: Prompts,
    /// The materials to choose from.
    pub(super) library: Cow<'a, MaterialLibrary>,
    /// The price of the model, if known.
    price: Option<Price>,
    own_recordings: PathBuf,
    pub(super) recordings: Recordings,
    pub(super) client: Option<Client>,
    pub(super) work: &'a WorkDir,
    progress: Progress,
}

/// A view of a session.
pub struct QueryView<'a> {
    pub name: &'a str,
    pub photo: Photo,
    pub segments: &'a ViewSegments,
}

/// The result of `--prune`.
#[derive(Debug, Serialize)]
pub struct Pruned {
    pub kept: usize,
    pub removed: usize,
}

impl<'a> QuerySession<'a> {
    /// A session for `views`, with recordings in `home` and in the folder that the options name.
    pub fn new(
        options: &'a Options,
        views: Vec<QueryView<'a>>,
        library: &'a MaterialLibrary,
        home: &Path,
        work: &'a WorkDir,
        network: Result<(), Offline>,
        progress: Progress,
    ) -> Result<Self> {
        let folders = recording_folders(options, home);
        workdir::refuse_link(&folders[0], "--recordings")?;
        let spare = work.root().join(SPARE_RECORDINGS);
        workdir::refuse_link(&spare, "--out")?;
        let write_to = folders.last().expect("the home's folder is always among them");
        let read_from: Vec<&Path> = folders.iter().map(PathBuf::as_path).collect();
        Ok(Self {
            options,
            views,
            prompts: prompts(options)?,
            library: candidates(options, library)?,
            price: price(options)?,
            own_recordings: home.join(RECORDINGS),
            recordings: Recordings::open(&read_from, write_to)?.with_spare(&spare)?,
            client: Client::new(options, ApiKey::from_environment()?, network, progress)?,
            work,
            progress,
        })
    }

    /// The questions, with all sheets drawn.
    pub fn queries(&self) -> Result<Queries<'_>> {
        let inputs: Vec<_> = self
            .views
            .iter()
            .map(|view| ViewInput { name: view.name, photo: &view.photo, segments: view.segments })
            .collect();
        Ok(Queries::prepare(&inputs, &self.library, &self.prompts, self.options)?)
    }

    /// Estimates what would be sent, and its cost.
    pub fn preview(&self, queries: &Queries) -> Preview {
        queries.preview(&self.recordings, self.client.as_ref().map(Asker::answerer), self.price())
    }

    /// Answers all queries; each answer is recorded as it arrives. Reports the cost before and after.
    pub fn run(&self, queries: &Queries) -> Result<Run> {
        let asker = self.client.as_ref().map(|client| client as &dyn Asker);
        let run = queries.run(&self.recordings, asker, self.price(), &mut |_, _| Ok(()), self.progress)?;
        if run.spent.requests > 0 {
            let (failed, segments) = (run.answers.failed().count(), queries.segments.len());
            progress::notice(&format!("asked: {}; {failed} of {segments} segments failed", run.spent));
        }
        Ok(run)
    }

    /// Writes the segments that have no recorded answer, with everything needed to answer them, into a new folder;
    /// returns the number of questions.
    pub fn export(&self, folder: &Path) -> Result<usize> {
        let queries = self.queries()?;
        Ok(exchange::export(folder, &queries.unanswered(&self.recordings, None))?)
    }

    /// Checks the answers in a folder that [`Self::export`] wrote, and records the valid ones.
    pub fn import(&self, folder: &Path) -> Result<Imported> {
        let model = self.options.lmm_model.as_deref();
        let questions = &self.queries()?.questions;
        Ok(exchange::import(folder, model, questions, &self.library, &self.recordings)?)
    }

    /// Removes recordings from the views' own folder that none of their segments uses with these options, whoever
    /// answered. A folder given with `--recordings` may be used by other scenes too and is not changed.
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
        self.price.as_ref()
    }
}

/// Refuses recordings beside the scene or picture in `home`, or in the work folder, that lead outside `scope`. A folder
/// given with `--recordings` is not checked.
pub fn check_recordings(home: &Path, work: &WorkDir, scope: ReadScope) -> Result<(), SceneError> {
    let scope = scope.and([work.root()]);
    for folder in [home.join(RECORDINGS), work.root().join(SPARE_RECORDINGS)] {
        if let Some((path, _)) = scope.leads_out_below(&folder) {
            Reference { what: "recording", path: &path, named_in: None, flag: None }.check(&scope)?;
        }
    }
    Ok(())
}

/// The folders from which recordings are read; new ones go to the last.
pub fn recording_folders(options: &Options, home: &Path) -> Vec<PathBuf> {
    [home.join(RECORDINGS)].into_iter().chain(options.recordings.clone()).collect()
}

/// The built-in prompts or the user's.
pub fn prompts(options: &Options) -> Result<Prompts> {
    Ok(options.prompts.as_deref().map_or_else(|| Ok(Prompts::builtin()), Prompts::from_folder)?)
}

/// The materials that a model may choose from.
pub fn candidates<'a>(options: &Options, library: &'a MaterialLibrary) -> Result<Cow<'a, MaterialLibrary>> {
    Ok(match &options.labels {
        Some(labels) => Cow::Owned(labels.restrict(library)?),
        None => Cow::Borrowed(library),
    })
}

/// The price of the model, if the user's price table or the built-in one has it.
pub fn price(options: &Options) -> Result<Option<Price>> {
    let table = match &options.prices {
        None => PriceTable::builtin(),
        Some(path) => {
            let text = fs::read_to_string(path)
                .map_err(|error| UsageError(format!("cannot read --prices {path:?}: {error}")))?;
            PriceTable::from_csv(&text).with_context(|| format!("{path:?}"))?
        }
    };
    Ok(options.lmm_model.as_deref().and_then(|model| table.price(model)).cloned())
}
