//! The outcomes of the scenes on disk: one file per shard with one line per scene. No two shards write the same file.
//!
//! Each scene that ends adds a line to its shard's file, because a data set may have so many scenes that the whole file
//! cannot be written each time. The file is replaced as a whole by a sorted one when a batch begins, if outcomes were
//! dropped, and when it ends. A batch that is killed loses at most the line that it was writing: half a line at the end
//! does not count. Of several lines of one scene, the last one counts.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use rustix::fs::OFlags;

use crate::files;
use crate::files::json;
use crate::files::write::{self, Folder, TEMPORARY};
use crate::workdir;
use crate::workdir::lock::{self, Holder};

use super::select::Selected;
use super::{BatchError, Outcome, Shard, State};

/// The outcomes of one shard, which no other process can write in the meantime.
#[derive(Debug)]
pub struct Ledger {
    path: PathBuf,
    outcomes: BTreeMap<String, Outcome>,
    /// True if this process has written the file as a whole: then it is not a link, and its last line is complete.
    is_own: bool,
    /// True if the file has one complete line per scene, sorted.
    is_compact: bool,
    /// Held but never read.
    _lock: File,
}

impl Ledger {
    /// Locks the shard's file in `folder` and reads it.
    pub fn open(folder: &Path, shard: Shard) -> Result<Self, BatchError> {
        let path = folder.join(shard.file_name());
        let io_error = |source| BatchError::Io { path: path.clone(), source };
        Folder::open(folder).map_err(io_error)?;
        let lock = folder.join(format!(".{}.lock", shard.file_name()));
        let locked =
            || BatchError::Locked { shard: shard.to_string(), folder: folder.to_owned(), holder: Holder::of(&lock) };
        let not_lockable = |source| BatchError::Io { path: lock.clone(), source };
        let lock = lock::exclusive(&lock).map_err(not_lockable)?.ok_or_else(locked)?;
        workdir::sweep(folder, &temporary_prefix(&path)).map_err(io_error)?;
        let (outcomes, is_compact) = if path.exists() { read(&path)? } else { (BTreeMap::new(), true) };
        Ok(Self { path, outcomes, is_own: false, is_compact, _lock: lock })
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

    /// Adds the outcome of a scene to the file.
    pub fn put(&mut self, outcome: Outcome) -> Result<(), BatchError> {
        let line = json::compact(&outcome).expect("an outcome is plain data") + "\n";
        self.outcomes.insert(outcome.scene.clone(), outcome);
        if !self.is_own {
            return self.save();
        }
        self.is_compact = false;
        let appended =
            write::open_in_place(&self.path, OFlags::APPEND).and_then(|mut file| file.write_all(line.as_bytes()));
        match appended {
            // Somebody removed it.
            Err(error) if error.kind() == ErrorKind::NotFound => self.save(),
            appended => appended.map_err(|source| BatchError::Io { path: self.path.clone(), source }),
        }
    }

    /// Sorts the lines of the file.
    pub fn finish(&mut self) -> Result<(), BatchError> {
        if self.is_compact { Ok(()) } else { self.save() }
    }

    fn save(&mut self) -> Result<(), BatchError> {
        let write = || {
            let (folder, name) =
                (self.path.parent().unwrap_or(Path::new("")), self.path.file_name().unwrap_or_default());
            let mut draft = Folder::open(folder)?.draft(Path::new(name), &temporary_prefix(&self.path))?;
            self.outcomes.values().try_for_each(|outcome| {
                draft.write_all(json::compact(outcome)?.as_bytes())?;
                draft.write_all(b"\n")
            })?;
            draft.publish()
        };
        write().map_err(|source| BatchError::Io { path: self.path.clone(), source })?;
        (self.is_own, self.is_compact) = (true, true);
        Ok(())
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
            for (scene, outcome) in read(&path)?.0 {
                known.divisions.insert(shard.of);
                known.outcomes.entry(scene).or_default().push(outcome);
            }
        }
        Ok(known)
    }

    /// The scenes that failed when they were last run, in whichever shard.
    pub fn failed(&self) -> BTreeSet<&str> {
        let has_failed = |outcomes: &[Outcome]| outcomes.iter().all(|outcome| outcome.state == State::Failed);
        self.outcomes.iter().filter(|(_, outcomes)| has_failed(outcomes)).map(|(scene, _)| scene.as_str()).collect()
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
        let outcome_in = |state: State| {
            let mut matching = self.outcomes.get(&scene.name)?.iter().filter(|outcome| outcome.key == key);
            matching.find(|outcome| outcome.state == state)
        };
        outcome_in(State::Done).or_else(|| outcome_in(State::Failed)).map(|outcome| found_at(scene, outcome))
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

/// The outcomes in a file, by scene, and whether the file has one complete line per scene, sorted.
fn read(path: &Path) -> Result<(BTreeMap<String, Outcome>, bool), BatchError> {
    let bytes = files::read(path).map_err(|source| BatchError::Io { path: path.to_owned(), source })?;
    let mut outcomes = BTreeMap::new();
    let mut is_compact = true;
    for (line, text) in (1..).zip(bytes.split_inclusive(|byte| *byte == b'\n')) {
        let is_complete = text.ends_with(b"\n");
        let outcome: Outcome = match json::read(text) {
            Ok(outcome) => outcome,
            Err(_) if !is_complete => {
                is_compact = false;
                break;
            }
            Err(source) => return Err(BatchError::Line { path: path.to_owned(), line, source }),
        };
        is_compact &= is_complete && outcomes.last_key_value().is_none_or(|(last, _)| *last < outcome.scene);
        outcomes.insert(outcome.scene.clone(), outcome);
    }
    Ok((outcomes, is_compact))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(scene: &str, seconds: f64) -> Outcome {
        Outcome { state: State::Done, seconds, ..Outcome::skipped(scene) }
    }

    fn open(folder: &Path) -> Ledger {
        Ledger::open(folder, Shard::WHOLE).unwrap()
    }

    /// The scenes in the order of the file's lines.
    fn scenes(folder: &Path) -> Vec<String> {
        let text = fs::read_to_string(folder.join(Shard::WHOLE.file_name())).unwrap();
        text.lines().map(|line| serde_json::from_str::<Outcome>(line).unwrap().scene).collect()
    }

    #[test]
    fn a_scene_that_ends_adds_a_line_and_the_end_of_the_batch_sorts_them() {
        let folder = tempfile::tempdir().unwrap();
        let mut ledger = open(folder.path());
        for scene in ["b", "c", "a"] {
            ledger.put(outcome(scene, 1.0)).unwrap();
        }
        assert_eq!(scenes(folder.path()), ["b", "c", "a"]);
        drop(ledger);
        // The batch was killed, and the next one finds nothing to do.
        let mut ledger = open(folder.path());
        ledger.finish().unwrap();
        assert_eq!(scenes(folder.path()), ["a", "b", "c"]);
    }

    #[test]
    fn half_a_line_at_the_end_is_lost_and_disturbs_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(Shard::WHOLE.file_name());
        let line = |scene, seconds| serde_json::to_string(&outcome(scene, seconds)).unwrap() + "\n";
        let whole = line("a", 1.0) + &line("b", 1.0) + &line("a", 2.0);
        for half in ["{", "{\"scene\":\"c", &line("c", 1.0)[..40]] {
            fs::write(&path, whole.clone() + half).unwrap();
            let mut ledger = open(folder.path());
            let found: Vec<(&str, f64)> = ledger.outcomes().map(|found| (&*found.scene, found.seconds)).collect();
            assert_eq!(found, [("a", 2.0), ("b", 1.0)], "the later line of a scene counts");
            assert_eq!(Known::read(folder.path()).unwrap().outcomes["a"], [outcome("a", 2.0)]);
            ledger.put(outcome("c", 3.0)).unwrap();
            assert_eq!(scenes(folder.path()), ["a", "b", "c"]);
        }
        fs::write(&path, "{\n".to_owned() + &whole).unwrap();
        let error = Ledger::open(folder.path(), Shard::WHOLE).unwrap_err();
        assert!(matches!(error, BatchError::Line { line: 1, .. }), "{error}");
    }
}
