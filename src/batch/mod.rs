//! Runs many scenes: selects them, orders them, runs several side by side, and keeps the outcome of each.
//!
//! 1. [`select`] lists the data set's scenes, narrows them by split, filter and range, and distributes them to
//!    [`shard`]s by size.
//! 2. [`ledger`] holds the outcome of each scene so far, so that done scenes are skipped.
//! 3. [`scheduler`] runs the others, each in a [`child`] process: a panic or a lack of [`memory`] in one does not stop
//!    the others, and a child that was killed continues where it stopped when it is started again. It tells its
//!    [`status`] meanwhile.
//! 4. [`summary`] lists all outcomes in a table and [`mod@page`] on a page; those of several shards are
//!    [merged](Batch::merge).
//!
//! [`questions`] sends the questions of all scenes through the Batch API.

mod child;
mod error;
mod ledger;
mod memory;
mod options;
mod outcome;
mod page;
mod questions;
mod scheduler;
mod select;
mod shard;
mod status;
mod summary;
mod table;

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use crate::error::Result;
use crate::pipeline::{Hasher, Stage, corrections_file, known_flags};
use crate::scene::{ObjectChoice, dataset};
use crate::words::output::{agreeing, counted};
use crate::{config, files, workdir};

pub use child::end_with_the_batch;
pub use error::{BatchError, FailedScene};
pub use ledger::{Known, Ledger};
pub use options::Options;
pub use outcome::{Outcome, State};
pub use questions::BatchQuestions;
pub use scheduler::{News, RunningScene, Snapshot};
pub use select::Selected;
pub use shard::Shard;
pub use status::{Asked, tell_the_batch};
pub use summary::Summary;

use memory::Budget;
pub(crate) use memory::holds as memory_holds;
use scheduler::{Due, Scheduler};

/// The folder for files about all scenes, inside the batch's output folder.
const FOLDER: &str = "batch";

/// The options that may name a small file or folder of the user's on which the results depend. Its content is part of a
/// scene's key; files that other options name count by their path only.
const CONTENT_COUNTS: [&str; 6] = ["gripper", "labels", "lmm-body", "materials", "prompts", "scenario"];

/// The folder of the files about a batch of the data set in `folder` as a whole, whose work folders are in `out` if given.
pub fn home(folder: &Path, out: Option<&Path>) -> PathBuf {
    out.map_or_else(|| folder.join(workdir::DEFAULT_NAME), Path::to_owned).join(FOLDER)
}

/// A batch with its options.
#[derive(Debug)]
pub struct Batch {
    /// The data set's folder.
    folder: PathBuf,
    /// Folder for the work folders; each scene's own folder if not given.
    out: Option<PathBuf>,
    options: Options,
    /// The last stage to do.
    to: Stage,
    /// This stage and those after it are done again in every scene.
    from: Option<Stage>,
    /// The options of every scene's run as they were typed.
    flags: Vec<OsString>,
    /// The flags that the user's configuration may set.
    known: Vec<config::Flag>,
    /// The budget of all scenes together.
    max_usd: Option<f64>,
    /// Threads for all scenes together.
    threads: usize,
    shard: Shard,
    /// The scenes of all shards.
    all: Vec<Selected>,
    /// Names of scenes that cannot be run, printable.
    skipped: Vec<String>,
    warnings: Vec<String>,
}

/// The task for every scene.
#[derive(Debug, Clone)]
pub struct Task {
    pub to: Stage,
    pub from: Option<Stage>,
    /// The options of every scene's run as they were typed. A scene's process reads the configuration files itself.
    pub flags: Vec<OsString>,
    /// The budget of all scenes together, from the command line or a configuration file.
    pub max_usd: Option<f64>,
    /// Threads for all scenes together; all cores if not given.
    pub threads: Option<usize>,
}

/// The status of a scene before the batch runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    ToDo,
    Done,
    Failed,
}

/// The page of a batch that was run on the scenes in `folder`, without `--out`.
pub fn page(folder: &Path) -> PathBuf {
    page_in(&folder.join(workdir::DEFAULT_NAME))
}

/// The page of a batch whose output folder is `out`.
pub fn page_in(out: &Path) -> PathBuf {
    out.join(FOLDER).join(page::FILE)
}

impl Batch {
    /// Lists the scenes of `folder` that `options` choose.
    ///
    /// # Errors
    /// If there is no such data set, no scene is selected, the split, the filter or the shard is invalid, or the folder
    /// for the files about the batch as a whole is a link that the user did not name.
    pub fn new(folder: &Path, out: Option<&Path>, options: Options, task: Task) -> Result<Self> {
        let shard = options.shard()?;
        if out.is_none() {
            let root = folder.join(workdir::DEFAULT_NAME);
            workdir::refuse_link(&root, "--out")?;
            workdir::refuse_link(&root.join(FOLDER), "--out")?;
        }
        let listed = dataset::list(folder, options.layout)?;
        let (mut warnings, mut skipped) = (listed.warnings, listed.skipped);
        let all = select::select(listed.scenes, &mut skipped, &options, shard.of, out, &mut warnings)?;
        if let Some(first) = skipped.first() {
            let count = skipped.len();
            warnings.push(format!(
                "{} skipped because of a name that is not UTF-8 (first: `{first}`); rename {} to run {1}",
                counted(count, "scene folder"),
                agreeing(count, "it", "them")
            ));
        }
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        Ok(Self {
            folder: folder.to_owned(),
            out: out.map(Path::to_owned),
            options,
            to: task.to,
            from: task.from,
            flags: task.flags,
            known: known_flags(),
            max_usd: task.max_usd,
            threads: task.threads.unwrap_or_else(cores),
            shard,
            all,
            skipped,
            warnings,
        })
    }

    /// Warnings about the data set.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Outcomes for the scenes that cannot be run, in whichever shard.
    pub fn skipped(&self) -> impl Iterator<Item = Outcome> {
        self.skipped.iter().map(|name| Outcome::skipped(name))
    }

    /// The scenes of this shard, by name.
    pub fn scenes(&self) -> impl Iterator<Item = &Selected> {
        self.all.iter().filter(|scene| scene.shard == self.shard.index)
    }

    /// The shard that this batch runs.
    pub fn shard(&self) -> Shard {
        self.shard
    }

    /// The folder of the files about the batch as a whole.
    pub fn home(&self) -> PathBuf {
        home(&self.folder, self.out.as_deref())
    }

    /// The page of all scenes, which is written once all shards have ended.
    pub fn page(&self) -> PathBuf {
        self.home().join(page::FILE)
    }

    /// The scenes of this shard with their status so far.
    pub fn standing(&self) -> Result<Vec<(&Selected, Standing)>> {
        let known = Known::read(&self.home())?;
        Ok(self.scenes().map(|scene| (scene, self.standing_of(scene, &known).0)).collect())
    }

    /// Estimated memory that a scene needs, in bytes.
    pub fn need(&self, scene: &Selected) -> u64 {
        memory::need(scene.splat_bytes, self.to, self.threads_a_scene())
    }

    /// Runs the open scenes of this shard; `tell` is called with each outcome as soon as the scene ends, and with how the
    /// batch stands in between. Returns the shard's summary.
    ///
    /// # Errors
    /// If the batch as a whole cannot continue. Scenes that failed are in the summary.
    pub fn run(&self, tell: &mut dyn FnMut(News)) -> Result<Summary> {
        let mut ledger = Ledger::open(&self.home(), self.shard)?;
        self.skipped().for_each(|outcome| tell(News::Ended(Box::new(outcome))));
        let known = Known::read(&self.home())?;
        let mut due = Vec::new();
        let mut kept = Vec::new();
        for scene in self.scenes() {
            let (standing, outcome) = self.standing_of(scene, &known);
            match standing {
                Standing::Failed if self.options.retry_failed => due.push(self.due(scene, &known)),
                Standing::Done | Standing::Failed => kept.extend(outcome),
                Standing::ToDo => due.push(self.due(scene, &known)),
            }
        }
        let asked = kept.iter().fold(Asked::default(), |sum, outcome| sum.plus(outcome.asked));
        tell(News::Begins { due: due.len(), kept: kept.len(), asked });
        ledger.replace(self.scenes(), kept.into_iter())?;
        self.scheduler(self.to)?.run(&due, &|scene| self.key(scene), &mut |news| {
            if let News::Ended(outcome) = &news {
                ledger.put(Outcome::clone(outcome))?;
            }
            tell(news);
            Ok(())
        })?;
        ledger.finish()?;
        let summary = Summary::new(self.scenes(), ledger.outcomes(), self.skipped());
        if self.shard.of == 1 {
            self.save(&summary)?;
        }
        Ok(summary)
    }

    /// The summary of all shards' files.
    ///
    /// # Errors
    /// If there are no files, or they belong to different divisions into shards, or cannot be read or written.
    pub fn merge(&self) -> Result<Summary> {
        let known = Known::read(&self.home())?;
        known.require_one_division(&self.home())?;
        let outcome = |scene: &Selected| known.of_any_task(scene, &self.key(scene));
        let outcomes: Vec<Outcome> = self.all.iter().filter_map(outcome).collect();
        let summary = Summary::new(self.all.iter(), outcomes.iter(), self.skipped());
        self.save(&summary)?;
        Ok(summary)
    }

    /// Writes the summary and its page.
    fn save(&self, summary: &Summary) -> Result<(), BatchError> {
        let folder = std::path::absolute(&self.folder).unwrap_or_else(|_| self.folder.clone());
        let title = folder.file_name().unwrap_or(folder.as_os_str()).to_string_lossy();
        summary.write(&self.home())?;
        page::write(summary, &title, &self.home())
    }

    fn scheduler(&self, to: Stage) -> Result<Scheduler> {
        let mut flags = self.flags.clone();
        if let Some(max_usd) = self.max_usd {
            flags.push(format!("--max-usd={}", max_usd / self.all.len() as f64).into());
        }
        let task = child::Task { to, from: self.from, flags, threads: self.threads_a_scene() };
        let budget = Budget::new(self.options.memory)?;
        Ok(Scheduler { jobs: self.jobs(), budget, max_minutes: self.options.max_minutes, task })
    }

    /// Number of scenes to run side by side.
    fn jobs(&self) -> usize {
        self.options.jobs.map_or_else(|| (self.threads / scheduler::THREADS_A_SCENE).max(1), usize::from)
    }

    fn threads_a_scene(&self) -> usize {
        (self.threads / self.jobs()).max(1)
    }

    /// A scene that is to be run, with what it has asked so far with this task.
    fn due<'a>(&self, scene: &'a Selected, known: &Known) -> Due<'a> {
        let earlier = known.of(scene, &self.key(scene));
        Due { scene, asked: earlier.map_or_else(Asked::default, |earlier| earlier.asked) }
    }

    /// The status of a scene so far, and the outcome from which it follows.
    fn standing_of(&self, scene: &Selected, known: &Known) -> (Standing, Option<Outcome>) {
        if self.from.is_some() {
            return (Standing::ToDo, None);
        }
        let outcome = known.of(scene, &self.key(scene));
        let standing = match outcome.as_ref().map(|outcome| outcome.state) {
            Some(State::Done) if scene.work.join(workdir::Artifact::Run.path()).is_file() => Standing::Done,
            Some(State::Failed) => Standing::Failed,
            _ => Standing::ToDo,
        };
        (standing, outcome)
    }

    /// Hash of the task and of those properties of the scene that can be checked without opening it. An outcome with
    /// another key does not count as this scene's. Whether `--out` is given counts, because with `--out DATA/gprop` the
    /// batch's folder is the default one, but the work folders are others; the path itself may be written in many ways.
    fn key(&self, scene: &Selected) -> String {
        let mut hasher = Hasher::new("batch").with_json(&self.to).with(&scene.bytes.to_le_bytes());
        hasher = hasher.with(&[u8::from(self.out.is_some())]);
        for flag in &self.flags {
            hasher = hasher.with(flag.as_encoded_bytes());
        }
        let corrections = corrections_file(&scene.folder, ObjectChoice::Auto);
        let configurations = [Some(scene.folder.join(config::FILE_NAME)), Some(corrections), config::user_file()];
        let content = |path: Option<PathBuf>| path.and_then(|path| files::read(&path).ok()).unwrap_or_default();
        let hasher = configurations.into_iter().fold(hasher, |hasher, path| hasher.with(&content(path)));
        self.named_paths().iter().fold(hasher, |hasher, path| with_content(hasher, path)).hex()
    }

    /// The values of the options whose [content counts](CONTENT_COUNTS), as they were typed or are in the user's
    /// configuration. The name of something built in, such as a gripper, is among them too.
    fn named_paths(&self) -> Vec<PathBuf> {
        let of_user = config::user_file().and_then(|path| config::flags_of_user(&path, &self.known).ok());
        let flags = of_user.iter().flat_map(|file| &file.flags).chain(&self.flags);
        let flags = flags.filter(|flag| CONTENT_COUNTS.contains(&config::name_of(flag)));
        flags.filter_map(|flag| config::value_of(flag).map(PathBuf::from)).collect()
    }
}

/// Adds the content of a file, or the names and contents of the files in a folder.
fn with_content(hasher: Hasher, path: &Path) -> Hasher {
    let content = |path: &Path| files::read(path).unwrap_or_default();
    let Ok(entries) = fs::read_dir(path) else { return hasher.with(&content(path)) };
    let mut inside: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    inside.sort();
    inside.iter().fold(hasher, |hasher, path| hasher.with(path.as_os_str().as_encoded_bytes()).with(&content(path)))
}
