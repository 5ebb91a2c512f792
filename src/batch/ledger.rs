//! The outcomes of the scenes on disk: one file per shard with one line per scene, sorted by scene. A shard's file is
//! replaced as a whole each time a scene ends, so it is never half-written; no two shards write the same file.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use crate::files;
use crate::workdir::lock::{self, Holder};
use crate::workdir::{self, TEMPORARY};

use super::select::Selected;
use super::{BatchError, Outcome, Shard, State};

/// The outcomes of one shard, which no other process can write in the meantime.
#[derive(Debug)]
pub struct Ledger {
    path: PathBuf,
    outcomes: BTreeMap<String, Outcome>,
    /// Held but never read.
    _lock: File,
}

impl Ledger {
    /// Locks the shard's file in `folder` and reads it.
    pub fn open(folder: &Path, shard: Shard) -> Result<Self, BatchError> {
        let path = folder.join(shard.file_name());
        let io_error = |source| BatchError::Io { path: path.clone(), source };
        fs::create_dir_all(folder).map_err(io_error)?;
        let lock = folder.join(format!(".{}.lock", shard.file_name()));
        let locked =
            || BatchError::Locked { shard: shard.to_string(), folder: folder.to_owned(), holder: Holder::of(&lock) };
        let not_lockable = |source| BatchError::Io { path: lock.clone(), source };
        let lock = lock::exclusive(&lock).map_err(not_lockable)?.ok_or_else(locked)?;
        workdir::sweep(folder, &temporary_prefix(&path)).map_err(io_error)?;
        let outcomes = if path.exists() { read(&path)? } else { Vec::new() };
        let outcomes = outcomes.into_iter().map(|outcome| (outcome.scene.clone(), outcome)).collect();
        Ok(Self { path, outcomes, _lock: lock })
    }

    /// All outcomes, by scene.
    pub fn outcomes(&self) -> impl Iterator<Item = &Outcome> {
        self.outcomes.values()
    }

    /// Replaces the outcomes of `scenes` by the given ones, and saves if that changes anything.
    pub fn replace<'a>(
        &mut self,
        scenes: impl Iterator<Item = &'a Selected>,
        outcomes: impl Iterator<Item = Outcome>,
    ) -> Result<(), BatchError> {
        let mut replaced = self.outcomes.clone();
        for scene in scenes {
            replaced.remove(&scene.name);
        }
        replaced.extend(outcomes.map(|outcome| (outcome.scene.clone(), outcome)));
        if replaced == self.outcomes && self.path.exists() {
            return Ok(());
        }
        self.outcomes = replaced;
        self.save()
    }

    /// Adds the outcome of a scene and saves.
    pub fn put(&mut self, outcome: Outcome) -> Result<(), BatchError> {
        self.outcomes.insert(outcome.scene.clone(), outcome);
        self.save()
    }

    fn save(&self) -> Result<(), BatchError> {
        let written = workdir::write_atomic_as(&self.path, &temporary_prefix(&self.path), |out| {
            self.outcomes.values().try_for_each(|outcome| {
                serde_json::to_writer(&mut *out, outcome)?;
                out.write_all(b"\n")
            })
        });
        written.map_err(|source| BatchError::Io { path: self.path.clone(), source })
    }
}

/// The prefix of a shard's own temporary files; those of other shards are left alone.
fn temporary_prefix(path: &Path) -> String {
    format!("{TEMPORARY}{}-", path.file_name().expect("a shard's file has a name").to_string_lossy())
}

/// The outcomes in the files of all shards.
#[derive(Debug, Default)]
pub struct Known {
    /// By scene, each in the order of the shards.
    outcomes: BTreeMap<String, Vec<Outcome>>,
    /// The numbers of shards into which the scenes were divided.
    divisions: BTreeSet<usize>,
}

impl Known {
    /// Reads the files of all shards in `folder`.
    pub fn read(folder: &Path) -> Result<Self, BatchError> {
        let mut files: Vec<(Shard, PathBuf)> = Vec::new();
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            if let Some(shard) = Shard::of_file_name(&entry.file_name().to_string_lossy()) {
                files.push((shard, entry.path()));
            }
        }
        files.sort();
        let mut known = Self::default();
        for (shard, path) in files {
            for outcome in read(&path)? {
                known.divisions.insert(shard.of);
                known.outcomes.entry(outcome.scene.clone()).or_default().push(outcome);
            }
        }
        Ok(known)
    }

    /// Checks that there are outcomes from `folder` and that all are of one division into shards.
    pub fn require_one_division(&self, folder: &Path) -> Result<(), BatchError> {
        match self.divisions.len() {
            1 => Ok(()),
            0 => Err(BatchError::NothingToMerge { folder: folder.to_owned() }),
            _ => {
                let names: Vec<String> =
                    self.divisions.iter().map(|of| format!("{of} (shard-*-of-{of}.jsonl)")).collect();
                Err(BatchError::MixedShards { folder: folder.to_owned(), divisions: names.join(" and ") })
            }
        }
    }

    /// The outcome of `scene` for the current task, whichever shard the scene was in; a done outcome takes precedence
    /// over a failed one.
    pub fn of(&self, scene: &Selected, key: &str) -> Option<Outcome> {
        let with = |state: State| {
            let mut matching = self.outcomes.get(&scene.name)?.iter().filter(|outcome| outcome.key == key);
            matching.find(|outcome| outcome.state == state)
        };
        with(State::Done).or_else(|| with(State::Failed)).map(|outcome| found_at(scene, outcome))
    }

    /// The outcome of `scene` to merge: that for the current task if there is one. Shards that were run with other
    /// options can be merged too.
    pub fn of_any_task(&self, scene: &Selected, key: &str) -> Option<Outcome> {
        let any = || Some(found_at(scene, self.outcomes.get(&scene.name)?.last()?));
        self.of(scene, key).or_else(any)
    }
}

/// The outcome with the scene's work folder as it is called now: since then, the results may have been moved, or the
/// batch was started elsewhere and called the folder by another path.
fn found_at(scene: &Selected, outcome: &Outcome) -> Outcome {
    Outcome { work: scene.work.clone(), ..outcome.clone() }
}

fn read(path: &Path) -> Result<Vec<Outcome>, BatchError> {
    let text = files::read_to_string(path).map_err(|source| BatchError::Io { path: path.to_owned(), source })?;
    let parse = |(line, text): (usize, &str)| {
        serde_json::from_str(text).map_err(|source| BatchError::Line { path: path.to_owned(), line, source })
    };
    (1..).zip(text.lines()).map(parse).collect()
}
