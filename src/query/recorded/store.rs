//! The folder of recordings: read once, looked up in memory; each new one is written at once and atomically.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::lock::QuestionLock;
use super::{Answerer, FORMAT, MASK_IOU, QuestionId, Recording, key};
use crate::files::json;
use crate::files::write::{Folder, TEMPORARY};
use crate::query::Match;
use crate::query::recorded::sha256::Sha256Hex;

/// All recordings that were read, and where new ones are written.
#[derive(Debug)]
pub struct Recordings {
    write_to: PathBuf,
    /// The folder for recordings that `write_to` cannot take.
    spare: Option<PathBuf>,
    by_key: Mutex<ByKey>,
}

type ByKey = BTreeMap<Sha256Hex, Stored>;

/// A recording with the files that hold it: a copy may have any name that ends in `.json`, but the file that is named
/// after the key takes precedence in its folder.
#[derive(Debug)]
struct Stored {
    recording: Recording,
    paths: BTreeSet<PathBuf>,
}

/// A recording that cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    #[error("cannot read the recordings in {path:?}: {source}")]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("{path:?} is not a recording: {problem}; delete it or restore it")]
    Broken { path: PathBuf, problem: String },
    #[error("cannot write a recording to {path:?}: {source}")]
    Unwritable { path: PathBuf, source: std::io::Error },
    #[error(
        "recordings cannot be kept in {folder:?}, so nothing was asked: {source}; make it writable, make room, or name \
         another folder with --recordings"
    )]
    NoPlace { folder: PathBuf, source: std::io::Error },
}

/// Whose recordings may be used; those of people always may, and come first.
#[derive(Debug, Clone, Copy)]
pub enum Who<'a> {
    /// Anyone's: the user named no model.
    Anybody,
    /// Those of a model, with any settings.
    Model(&'a str),
    /// Those of exactly this answerer: the one that would be asked.
    Exactly(&'a Answerer),
}

impl Who<'_> {
    fn includes(self, recording: &Recording) -> bool {
        recording.is_by_hand() || self.names(recording)
    }

    fn names(self, recording: &Recording) -> bool {
        match self {
            Self::Anybody => true,
            Self::Model(model) => recording.model == model,
            Self::Exactly(who) => recording.model == who.model && recording.parameters == who.parameters,
        }
    }
}

/// Why nothing was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Miss {
    /// Recordings were not to be used.
    Live,
    /// There is no recording for this view's photo.
    View,
    /// This subject is recorded, but for another prompt, schema or model.
    Prompt,
    /// The view is recorded, but no mask overlaps enough; the best overlap.
    Mask { iou: f64 },
    /// The answer is recorded, but does not have the form that was asked for.
    Unusable,
}

/// A share in whole percent, rounded down: one that will not do never looks like one that would.
fn percent(share: f64) -> f64 {
    (100.0 * share).floor()
}

impl std::fmt::Display for Miss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Live => f.write_str("--answers live always asks"),
            Self::View => f.write_str("nothing is recorded for this photo"),
            Self::Prompt => f.write_str("recorded only for another prompt, library or model"),
            Self::Mask { iou } if percent(*iou) == 0.0 => {
                f.write_str("the answers recorded for this photo are all about other regions of it")
            }
            Self::Mask { iou } => write!(
                f,
                "the answers recorded for this photo are about other regions of it: the nearest overlaps this one by {} %, and {} % \
                 would do",
                percent(*iou),
                percent(MASK_IOU)
            ),
            Self::Unusable => f.write_str("the recorded answer does not have the form that was asked for"),
        }
    }
}

impl Recordings {
    /// Reads every `*.json` of those folders that exist; new recordings go to `write_to`, which is read too.
    pub fn open(read_from: &[&Path], write_to: &Path) -> Result<Self, RecordingError> {
        let mut by_key = ByKey::new();
        for folder in read_from.iter().copied().chain([write_to]) {
            let mut found = json_files(folder)?
                .into_iter()
                .map(|path| Ok((read(&path)?, path)))
                .collect::<Result<Vec<_>, RecordingError>>()?;
            // Of several files with one key, the one that new answers are written to counts, not a copy of an old answer.
            found.sort_by_key(|(recording, path)| *path == file_in(folder, &recording.key));
            for (recording, path) in found {
                store(&mut by_key, recording, path);
            }
        }
        Ok(Self { write_to: write_to.into(), spare: None, by_key: Mutex::new(by_key) })
    }

    /// Adds a folder for recordings that cannot be written to their own. It is read too.
    pub fn with_spare(self, folder: &Path) -> Result<Self, RecordingError> {
        for path in json_files(folder)? {
            let recording = read(&path)?;
            self.lock().entry(recording.key.clone()).or_insert(Stored { recording, paths: BTreeSet::new() });
        }
        Ok(Self { spare: Some(folder.into()), ..self })
    }

    /// The folder for new recordings.
    pub fn folder(&self) -> &Path {
        &self.write_to
    }

    /// Checks that recordings can be saved by writing a file as large as a big recording and removing it.
    pub fn check_writable(&self) -> Result<(), RecordingError> {
        let try_to = || {
            let mut draft = Folder::open(&self.write_to)?.draft(Path::new("trial"), TEMPORARY)?;
            draft.write_all(&[b' '; TRIAL_BYTES])?;
            draft.sync()
        };
        try_to().map_err(|source| RecordingError::NoPlace { folder: self.write_to.clone(), source })
    }

    /// Takes the lock on a question before it is asked; `None` while another process has it.
    pub fn lock_question(&self, key: &Sha256Hex) -> Result<Option<QuestionLock>, RecordingError> {
        QuestionLock::take(&self.write_to, key)
            .map_err(|source| RecordingError::Unwritable { path: self.path(key), source })
    }

    /// The recording with this key, if another process has written it in the meantime.
    pub fn written_meanwhile(&self, key: &Sha256Hex) -> Result<Option<Recording>, RecordingError> {
        let path = self.path(key);
        if !path.exists() {
            return Ok(None);
        }
        let recording = read(&path)?;
        store(&mut self.lock(), recording.clone(), path);
        Ok(Some(recording))
    }

    /// Saves a recording that could not be written to its own folder in the spare folder; returns that folder, or
    /// `None` if there is none or it cannot be written either.
    pub fn set_aside(&self, recording: &Recording) -> Option<&Path> {
        let spare = self.spare.as_deref()?;
        write(spare, recording).ok()?;
        Some(spare)
    }

    /// Number of recordings.
    pub fn len(&self) -> usize {
        self.lock().len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The recording that answers `asked`, and how it was found. Among several, one whose response `is_readable`, then one
    /// by a person (the one that `who` names comes first), then the one with the best overlap, then the one with the
    /// smallest key.
    pub fn find(
        &self,
        asked: &QuestionId,
        who: Who,
        is_readable: &dyn Fn(&str) -> bool,
    ) -> Result<(Recording, Match), Miss> {
        let by_key = self.lock();
        let readable = |recording: &Recording| is_readable(&recording.response);
        let by_person = |is_named: bool| {
            let candidates = recordings(&by_key).filter(|recording| recording.is_by_hand());
            best(asked, candidates.filter(|recording| !is_named || who.names(recording)), &readable)
        };
        if let Ok(found) = by_person(true).or_else(|_| by_person(false)) {
            return Ok(found);
        }
        if let Who::Exactly(answerer) = who
            && let Some(stored) = by_key.get(&key(answerer, asked))
            && readable(&stored.recording)
        {
            return Ok((stored.recording.clone(), Match::Exact));
        }
        let candidates = recordings(&by_key).filter(|recording| who.includes(recording));
        best(asked, candidates.clone(), &readable)
            .or_else(|_| best(asked, candidates, &|_| true))
            .map_err(|iou| miss(asked, &by_key, iou))
    }

    /// The keys of all recordings that may be used for `asked`, whoever answered.
    pub fn serving(&self, asked: &QuestionId) -> Vec<Sha256Hex> {
        let serves = |recording: &&Recording| {
            let known = &recording.asked;
            let same_view = known.photo_sha256 == asked.photo_sha256;
            let fits = || known.has_same_prompt(asked) && same_view && known.mask.iou(&asked.mask) >= MASK_IOU;
            known.is_same_question(asked) || fits()
        };
        recordings(&self.lock()).filter(serves).map(|recording| recording.key.clone()).collect()
    }

    /// The keys of all recordings.
    pub fn keys(&self) -> Vec<Sha256Hex> {
        self.lock().keys().cloned().collect()
    }

    /// Removes a recording with the files that hold it, except those in the spare folder; one that is no longer there is not
    /// an error.
    pub fn remove(&self, key: &Sha256Hex) -> Result<(), RecordingError> {
        let mut by_key = self.lock();
        for path in by_key.get(key).into_iter().flat_map(|stored| &stored.paths) {
            if let Err(source) = std::fs::remove_file(path)
                && source.kind() != std::io::ErrorKind::NotFound
            {
                return Err(RecordingError::Unwritable { path: path.clone(), source });
            }
        }
        by_key.remove(key);
        Ok(())
    }

    fn path(&self, key: &Sha256Hex) -> PathBuf {
        file_in(&self.write_to, key)
    }

    /// Saves a recording, first on disk, then in memory. It replaces one with the same key.
    pub fn insert(&self, recording: &Recording) -> Result<(), RecordingError> {
        let path = self.path(&recording.key);
        write(&self.write_to, recording).map_err(|source| RecordingError::Unwritable { path: path.clone(), source })?;
        store(&mut self.lock(), recording.clone(), path);
        Ok(())
    }

    /// A thread that panicked while it held the lock left the map consistent: every change is to one entry.
    fn lock(&self) -> MutexGuard<'_, ByKey> {
        self.by_key.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The file in `folder` to which a recording with this key is written.
fn file_in(folder: &Path, key: &Sha256Hex) -> PathBuf {
    folder.join(format!("{key}.json"))
}

/// Adds a recording that the file at `path` holds. It replaces one with the same key.
fn store(by_key: &mut ByKey, recording: Recording, path: PathBuf) {
    match by_key.entry(recording.key.clone()) {
        Entry::Vacant(entry) => {
            entry.insert(Stored { recording, paths: BTreeSet::from([path]) });
        }
        Entry::Occupied(mut entry) => {
            let stored = entry.get_mut();
            stored.recording = recording;
            stored.paths.insert(path);
        }
    }
}

fn recordings(by_key: &ByKey) -> impl Iterator<Item = &Recording> + Clone {
    by_key.values().map(|stored| &stored.recording)
}

/// The recording among `candidates` that answers `asked` and that `accepts` takes; without one, the best overlap of those with
/// the same prompt.
fn best<'a>(
    asked: &QuestionId,
    candidates: impl Iterator<Item = &'a Recording> + Clone,
    accepts: &dyn Fn(&Recording) -> bool,
) -> Result<(Recording, Match), Option<f64>> {
    let mut same = candidates.clone().filter(|recording| recording.asked.is_same_question(asked));
    if let Some(recording) = same.find(|recording| accepts(recording)) {
        return Ok((recording.clone(), Match::Exact));
    }
    let of_prompt = candidates.filter(|recording| recording.asked.has_same_prompt(asked));
    match best_overlap(asked, of_prompt, accepts) {
        // The same subject of the same photo with the same prompt: the question is the same, however it was drawn.
        Some((recording, 1.0)) => Ok((recording.clone(), Match::Exact)),
        Some((recording, iou)) if iou >= MASK_IOU => Ok((recording.clone(), Match::Mask { iou })),
        best => Err(best.map(|(_, iou)| iou)),
    }
}

/// The recording of the same photo with the best overlap, among those that `accepts` takes.
fn best_overlap<'a>(
    asked: &QuestionId,
    recordings: impl Iterator<Item = &'a Recording>,
    accepts: &dyn Fn(&Recording) -> bool,
) -> Option<(&'a Recording, f64)> {
    let mut best: Option<(&Recording, f64)> = None;
    for recording in recordings.filter(|recording| recording.asked.photo_sha256 == asked.photo_sha256) {
        let iou = recording.asked.mask.iou(&asked.mask);
        if best.is_none_or(|(_, top)| iou > top) && accepts(recording) {
            best = Some((recording, iou));
        }
    }
    best
}

fn miss(asked: &QuestionId, by_key: &ByKey, best_of_prompt: Option<f64>) -> Miss {
    match (best_of_prompt, best_overlap(asked, recordings(by_key), &|_| true)) {
        (_, None) => Miss::View,
        (best, Some((_, any))) if any >= MASK_IOU && best.is_none_or(|best| best < any) => Miss::Prompt,
        (Some(iou), _) | (None, Some((_, iou))) => Miss::Mask { iou },
    }
}

/// The JSON files of a folder in order of their names; none if the folder does not exist.
fn json_files(folder: &Path) -> Result<Vec<PathBuf>, RecordingError> {
    let unreadable = |source| RecordingError::Unreadable { path: folder.into(), source };
    let entries = match std::fs::read_dir(folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(unreadable)?,
    };
    let mut paths = entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, _>>().map_err(unreadable)?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
    paths.sort();
    Ok(paths)
}

fn read(path: &Path) -> Result<Recording, RecordingError> {
    let bytes = crate::files::read(path).map_err(|source| RecordingError::Unreadable { path: path.into(), source })?;
    let broken = |problem: String| RecordingError::Broken { path: path.into(), problem };
    let recording: Recording = crate::files::json::parse(&bytes).map_err(|error| broken(error.to_string()))?;
    if recording.format != FORMAT {
        return Err(broken(format!("its format is {}, but this gprop reads {FORMAT}", recording.format)));
    }
    let answerer = Answerer { model: recording.model.clone(), parameters: recording.parameters.clone() };
    if recording.key != key(&answerer, &recording.asked) {
        return Err(broken("its key does not match its content".into()));
    }
    Ok(recording)
}

/// More bytes than most recordings have: a mask's run lengths and an answer.
const TRIAL_BYTES: usize = 1 << 16;

fn write(folder: &Path, recording: &Recording) -> std::io::Result<()> {
    let mut draft = Folder::open(folder)?.draft(&file_in(Path::new(""), &recording.key), TEMPORARY)?;
    draft.write_all(json::pretty(recording)?.as_bytes())?;
    draft.write_all(b"\n")?;
    draft.sync()?;
    draft.publish()
}
