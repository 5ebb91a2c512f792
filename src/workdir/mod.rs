//! The work folder: every path, file name and format version on disk, atomic reads and writes, checksums.
//!
//! Files are written [as a whole and through no link](crate::files::write): a scene from elsewhere cannot have gprop write
//! outside its work folder. Files that a killed run left under a temporary name are removed by the next run.
//!
//! Artifacts that are reused later have a [`Checksum`], computed while they were written. A second gprop process is
//! kept out by the [`lock`]; processes that only read share it, and need no permission to write.

mod checksum;
pub mod lock;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::Serialize;
use serde::de::DeserializeOwned;
use thiserror::Error;
use tracing::warn;

use crate::files;
use crate::files::json;
use crate::files::write::{Fill, Folder, TEMPORARY};
pub use checksum::{Checksum, Checksumming, sha256_of_file};

/// Raised when the meaning of any artifact changes: artifacts of an older gprop are then made again. The Python module
/// has it too.
pub const FORMAT_VERSION: u32 = 15;

/// Name of the work folder inside a scene.
pub const DEFAULT_NAME: &str = "gprop";

/// The option that names a work folder.
pub const OUT: &str = "--out";

/// The lock's file in a work folder.
const LOCK: &str = ".lock";

/// Every file of the work folder. View names are already safe as file names here (`scene` ensures it).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Artifact<'a> {
    /// Version, options, input hashes, timings, warnings: the record from which a rerun knows what it can reuse.
    Run,
    /// The chosen views with their cameras, and the metric scale.
    Views,
    /// 16-bit label map of a view.
    LabelMap(&'a str),
    /// The label map of a view as a NumPy array.
    LabelArray(&'a str),
    /// All label maps as a COCO data set.
    Coco,
    /// Per segment: view, id, area, box, predicted IoU, stability, level, parent.
    Segments,
    /// The parts in 3D, with the views that show each.
    FoundParts,
    /// 16-bit label map of the parts in a view.
    PartMap(&'a str),
    /// The part of every Gaussian, and the confidence in it.
    PartOfGaussian,
    /// What a model takes the object for, with `--ask object`, and the places of which it speaks.
    Recognition,
    /// The things without a number that were looked for, and the parts with those that were found.
    Refined,
    /// As [`Self::PartMap`] and [`Self::PartOfGaussian`], with what was found.
    RefinedMap(&'a str),
    RefinedGaussians,
    /// The picture sent for a segment or part of a view; 0 is the whole object.
    Sheet(&'a str, u16),
    /// One line per question: the answer or the typed failure.
    Answers,
    /// The length of the object as a model judged it, with `--scale estimate`.
    Size,
    /// What a model takes the object and its parts for, with `--ask object`.
    Object,
    /// The picture sent with that question.
    ObjectSheet,
    /// The picture sent with the question for the mass alone.
    DirectSheet,
    /// Questions sent through the Batch API whose answers have not been collected.
    BatchApiJobs,
    /// One picture's materials with their legend.
    MaterialMap,
    /// The input PLY with the materials' properties.
    Field,
    /// The input PLY in the colours of the materials, for any viewer.
    Recolored,
    /// A view's photo, parts and materials side by side, with a legend.
    Figure,
    /// The photo and materials of the view in the figure, small, for a list of scenes.
    Thumbnail,
    /// The labels of `field.ply`: 3D parts with their properties.
    Labels,
    /// Library rows in the order of `material_id`.
    Materials,
    /// 3D parts with volume, thickness, mass, inertia.
    Parts,
    /// For each cell of the object's inside, the part that fills it, for the stages after the parts.
    Interior,
    /// A frame of the simulation.
    Frame(usize),
    /// The particles of a frame, for other programs.
    States(usize),
    /// The particles after the last written frame, to resume from.
    Checkpoint,
    /// The report of the simulation, frame by frame.
    Simulation,
    /// The small animation for pages, GIF.
    Animation,
    /// The film, if ffmpeg is installed.
    FilmMp4,
    /// The film, if ffmpeg is not installed or fails.
    FilmGif,
    /// Energies and centre of mass over time.
    Plot,
    /// Forces, bounds, command, best places to grasp at.
    Grasp,
    /// The best places, drawn on the splat.
    GraspPicture,
    /// The objects of a capture that shows several.
    Objects,
    /// A photo with their numbers.
    ObjectsPicture,
    /// Both on one page, with links to their reports.
    ObjectsPage,
    /// The whole result, for programs.
    ReportJson,
    /// The whole result, for people.
    ReportHtml,
}

impl Artifact<'_> {
    /// Path inside the work folder.
    pub fn path(&self) -> PathBuf {
        match self {
            Self::Run => "run.json".into(),
            Self::Views => "views.json".into(),
            Self::LabelMap(view) => Path::new("segments").join(format!("{view}.png")),
            Self::LabelArray(view) => Path::new("segments").join(format!("{view}_s.npy")),
            Self::Coco => "segments/coco.json".into(),
            Self::Segments => "segments/segments.json".into(),
            Self::FoundParts => "consensus/consensus.json".into(),
            Self::PartMap(view) => Path::new("consensus").join(format!("{view}.png")),
            Self::PartOfGaussian => "consensus/gaussians.npz".into(),
            Self::Recognition => "recognition.json".into(),
            Self::Refined => "refined/refined.json".into(),
            Self::RefinedMap(view) => Path::new("refined").join(format!("{view}.png")),
            Self::RefinedGaussians => "refined/gaussians.npz".into(),
            Self::Sheet(view, segment) => Path::new("sheets").join(format!("{view}_{segment}.jpg")),
            Self::Answers => "answers.jsonl".into(),
            Self::Size => "size.json".into(),
            Self::Object => "object.json".into(),
            Self::ObjectSheet => "sheets/object.jpg".into(),
            Self::DirectSheet => "sheets/direct.jpg".into(),
            Self::BatchApiJobs => "batch_api.json".into(),
            Self::MaterialMap => "material_map.png".into(),
            Self::Field => "field.ply".into(),
            Self::Recolored => "field_recolored.ply".into(),
            Self::Figure => "figure.png".into(),
            Self::Thumbnail => "thumbnail.jpg".into(),
            Self::Labels => "labels.json".into(),
            Self::Materials => "materials.json".into(),
            Self::Parts => "parts.json".into(),
            Self::Interior => "interior.bin".into(),
            Self::Frame(index) => Path::new("simulation/frames").join(format!("{index:04}.ply")),
            Self::States(index) => Path::new("simulation/states").join(format!("{index:04}.npz")),
            Self::Checkpoint => "simulation/checkpoint.bin".into(),
            Self::Simulation => "simulation/simulation.json".into(),
            Self::Animation => "simulation/animation.gif".into(),
            Self::FilmMp4 => "simulation/film.mp4".into(),
            Self::FilmGif => "simulation/film.gif".into(),
            Self::Plot => "simulation/plot.svg".into(),
            Self::Grasp => "grasp.json".into(),
            Self::GraspPicture => "grasp.png".into(),
            Self::Objects => "objects.json".into(),
            Self::ObjectsPicture => "objects.jpg".into(),
            Self::ObjectsPage => "index.html".into(),
            Self::ReportJson => "report.json".into(),
            Self::ReportHtml => "report.html".into(),
        }
    }
}

/// The folder that holds a work folder per object of a capture with several.
const OBJECTS: &str = "objects";

/// The folders inside a work folder that hold artifacts, views that were rendered, and recordings that could not be
/// written to their own folder.
const FOLDERS: [&str; 9] = [
    "segments",
    "consensus",
    "refined",
    "sheets",
    "simulation",
    "simulation/frames",
    "simulation/states",
    "rendered",
    "unrecorded",
];

/// Errors of the work folder.
#[derive(Debug, Error)]
pub enum WorkDirError {
    #[error(
        "cannot write {path:?}: {source}; make room or choose another work folder (--out; for `gprop export`, --work)"
    )]
    Write { path: PathBuf, source: io::Error },
    #[error("cannot read {path:?}: {source}; run the stage that writes this file once more, with --from STAGE")]
    Read { path: PathBuf, source: io::Error },
    #[error("{path:?} is not what gprop wrote: {problem}; delete it and run again")]
    Damaged { path: PathBuf, problem: String },
    #[error(
        "another gprop {holder} {path:?}; wait for it to end (the page of `gprop answer` ends with Ctrl-C in its terminal) or \
         choose another work folder (--out; for `gprop export`, --work)"
    )]
    Locked { path: PathBuf, holder: lock::Holder },
    #[error("{path:?} was made with {input:?}, which is not in the scene; give the work folder with --out")]
    Foreign { path: PathBuf, input: PathBuf },
    #[error(
        "{path:?} is of a capture that shows several objects, each of which has a work folder of its own; give one, such as --out {object:?}"
    )]
    OfSeveral { path: PathBuf, object: PathBuf },
    #[error("{path:?}: {problem}; run `{command}` to complete it")]
    Unfinished { path: PathBuf, problem: String, command: String },
    #[error(
        "{path:?} is a link, and gprop reads and writes results only through links that you name; remove it, or give its \
         target with {flag}"
    )]
    Link { path: PathBuf, flag: &'static str },
    #[error("{path:?} leads out of the work folder")]
    Outside { path: PathBuf },
}

/// How an artifact on disk compares to the checksum with which it was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// It is unchanged.
    Whole,
    Missing,
    /// Its content has changed.
    Changed,
}

/// Why nothing may be written into a work folder.
#[derive(Debug, Clone)]
struct ReadOnly(String);

/// A work folder whose lock this process holds.
#[derive(Debug)]
pub struct WorkDir {
    root: PathBuf,
    /// Held but never read: the lock ends with the process, however that ends. `None` if the folder is only read and cannot
    /// be locked.
    _lock: Option<File>,
    /// The folder to write into, or why nothing may be written.
    folder: Result<Folder, ReadOnly>,
    /// Checksums of the files that this process has written or verified, by path inside the folder.
    checksums: Mutex<BTreeMap<PathBuf, Checksum>>,
    /// Changed artifacts about which the user has been warned.
    told: Mutex<BTreeSet<PathBuf>>,
}

impl WorkDir {
    /// Opens the work folder, creating it if it does not exist, locks it against a second gprop process, and removes
    /// files that a killed run left half-written. A folder that exists but is not writable is opened for reading; the
    /// run fails later if it has to write.
    pub fn open(root: &Path) -> Result<Self, WorkDirError> {
        let write_error = |source| WorkDirError::Write { path: root.to_owned(), source };
        let folder = Folder::open(root).map_err(write_error)?;
        let lock = root.join(LOCK);
        refuse_link(&lock, OUT)?;
        match lock::exclusive(&lock) {
            Ok(Some(lock)) => {
                sweep_all(root).map_err(write_error)?;
                Ok(Self::new(root, Some(lock), Ok(folder)))
            }
            Ok(None) => Err(WorkDirError::Locked { path: root.to_owned(), holder: lock::Holder::of(&lock) }),
            Err(error) if matches!(error.kind(), ErrorKind::ReadOnlyFilesystem | ErrorKind::PermissionDenied) => {
                Self::read_only(root, error.to_string())
            }
            Err(error) => Err(write_error(error)),
        }
    }

    /// Opens a work folder for reading: creates and writes nothing, and keeps out only processes that write.
    pub fn open_to_read(root: &Path) -> Result<Self, WorkDirError> {
        Self::read_only(root, "this command only reads the work folder".to_owned())
    }

    fn read_only(root: &Path, why: String) -> Result<Self, WorkDirError> {
        let path = root.join(LOCK);
        refuse_link(&path, OUT)?;
        let lock = match lock::shared(&path) {
            Ok(Some(lock)) => Some(lock),
            Ok(None) => {
                return Err(WorkDirError::Locked { path: root.to_owned(), holder: lock::Holder::of(&path) });
            }
            // The folder was copied without the file, or its file system has no locks: no process can be kept out.
            Err(_) => None,
        };
        Ok(Self::new(root, lock, Err(ReadOnly(why))))
    }

    fn new(root: &Path, lock: Option<File>, folder: Result<Folder, ReadOnly>) -> Self {
        Self { root: root.to_owned(), _lock: lock, folder, checksums: Mutex::default(), told: Mutex::default() }
    }

    /// True if artifacts may be written.
    pub fn is_writable(&self) -> bool {
        self.folder.is_ok()
    }

    /// Fails if nothing may be written.
    pub fn require_writable(&self) -> Result<(), WorkDirError> {
        self.writable_folder().map(|_| ())
    }

    /// The folder to write into.
    pub fn writable_folder(&self) -> Result<&Folder, WorkDirError> {
        self.folder.as_ref().map_err(|ReadOnly(why)| WorkDirError::Write {
            path: self.root.clone(),
            source: io::Error::other(why.clone()),
        })
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Path of an artifact, whether it exists or not.
    pub fn path(&self, artifact: Artifact) -> PathBuf {
        self.root.join(artifact.path())
    }

    /// Size of an artifact in bytes; `None` if it does not exist.
    pub fn size(&self, artifact: Artifact) -> Option<u64> {
        fs::metadata(self.path(artifact)).ok().map(|meta| meta.len())
    }

    /// The checksum of a file inside the folder: the one it was written with, if this process wrote it.
    pub fn checksum(&self, relative: &Path) -> Result<Checksum, WorkDirError> {
        if let Some(known) = locked(&self.checksums).get(relative) {
            return Ok(known.clone());
        }
        let path = self.root.join(relative);
        let found = Checksum::of_file(&path).map_err(|source| WorkDirError::Read { path, source })?;
        locked(&self.checksums).insert(relative.to_owned(), found.clone());
        Ok(found)
    }

    /// Compares a file inside the folder with what was written.
    pub fn standing(&self, relative: &Path, written: &Checksum) -> Standing {
        let path = self.root.join(relative);
        if !relative.components().all(|part| matches!(part, Component::Normal(_))) || !files::is_there(&path) {
            return Standing::Missing;
        }
        let same_length = fs::metadata(&path).is_ok_and(|found| found.len() == written.bytes);
        if !same_length || !Checksum::of_file(&path).is_ok_and(|found| found == *written) {
            return Standing::Changed;
        }
        locked(&self.checksums).insert(relative.to_owned(), written.clone());
        Standing::Whole
    }

    /// Warns, once, that a file inside the folder is not as gprop wrote it, and how this is handled.
    pub fn warn_changed(&self, relative: &Path, remedy: &str) {
        if locked(&self.told).insert(relative.to_owned()) {
            warn!("{:?} has changed since gprop wrote it; {remedy}", self.root.join(relative));
        }
    }

    /// Writes an artifact atomically through a writer, and stores its checksum.
    pub fn write_with(
        &self,
        artifact: Artifact,
        fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), WorkDirError> {
        self.fill(artifact, Box::new(fill))
    }

    fn fill(&self, artifact: Artifact, fill: Fill<'_>) -> Result<(), WorkDirError> {
        let (folder, path) = self.writable(artifact)?;
        let mut written = None;
        let filled = folder.write(&artifact.path(), |out| {
            let mut out = io::BufWriter::new(Checksumming::new(out));
            fill(&mut out)?;
            written = Some(out.into_inner().map_err(io::IntoInnerError::into_error)?.finish());
            Ok(())
        });
        filled.map_err(|source| WorkDirError::Write { path, source })?;
        let written = written.expect("it was written to the end");
        locked(&self.checksums).insert(artifact.path(), written);
        Ok(())
    }

    /// Writes an artifact atomically.
    pub fn write(&self, artifact: Artifact, bytes: &[u8]) -> Result<(), WorkDirError> {
        self.write_with(artifact, |out| out.write_all(bytes))
    }

    /// Writes an artifact as indented JSON that ends with a newline.
    pub fn write_json(&self, artifact: Artifact, value: &impl Serialize) -> Result<(), WorkDirError> {
        let text = json::pretty(value)
            .map_err(|problem| WorkDirError::Write { path: self.path(artifact), source: problem.into() })?;
        self.write(artifact, (text + "\n").as_bytes())
    }

    /// The bytes of an artifact.
    pub fn read(&self, artifact: Artifact) -> Result<Vec<u8>, WorkDirError> {
        let path = self.path(artifact);
        files::read_large(&path).map_err(|source| WorkDirError::Read { path, source })
    }

    /// Reads a JSON artifact.
    pub fn read_json<T: DeserializeOwned>(&self, artifact: Artifact) -> Result<T, WorkDirError> {
        read_json(&self.path(artifact))
    }

    /// The error for an artifact whose content gprop did not write.
    pub fn damaged(&self, artifact: Artifact, problem: impl ToString) -> WorkDirError {
        WorkDirError::Damaged { path: self.path(artifact), problem: problem.to_string() }
    }

    /// Removes an artifact; a missing one is not an error.
    pub fn remove(&self, artifact: Artifact) -> Result<(), WorkDirError> {
        let (folder, path) = self.writable(artifact)?;
        locked(&self.checksums).remove(&artifact.path());
        match folder.remove(&artifact.path()) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => Err(WorkDirError::Write { path, source }),
            _ => Ok(()),
        }
    }

    /// The folder to write into, and the path at which an artifact may be written: below the root, with no link on the way.
    /// (A link in the artifact's own place is replaced, not followed.)
    fn writable(&self, artifact: Artifact) -> Result<(&Folder, PathBuf), WorkDirError> {
        let folder = self.writable_folder()?;
        let relative = artifact.path();
        let mut path = self.root.clone();
        let mut components = relative.components().peekable();
        while let Some(component) = components.next() {
            let Component::Normal(name) = component else { return Err(WorkDirError::Outside { path: relative }) };
            path.push(name);
            if components.peek().is_some() {
                refuse_link(&path, OUT)?;
            }
        }
        Ok((folder, path))
    }
}

/// Refuses a path that is a link, which may lead anywhere; `flag` is the option with which the user can name its
/// target.
pub fn refuse_link(path: &Path, flag: &'static str) -> Result<(), WorkDirError> {
    match path.symlink_metadata() {
        Ok(found) if found.is_symlink() => Err(WorkDirError::Link { path: path.to_owned(), flag }),
        _ => Ok(()),
    }
}

/// The work folder that the user named, or else `default`, which must not be a link.
pub fn named_or(named: Option<&Path>, default: PathBuf) -> Result<PathBuf, WorkDirError> {
    if let Some(named) = named {
        return Ok(named.to_owned());
    }
    refuse_link(&default, OUT)?;
    Ok(default)
}

/// The folder with the work folders of the objects of a capture whose own is `root`.
pub fn objects_folder(root: &Path) -> PathBuf {
    root.join(OBJECTS)
}

/// The work folder of the object `name` of a capture whose own is `root`; `root` itself if it is that folder already.
pub fn object_folder(root: &Path, name: &str) -> PathBuf {
    let below = Path::new(OBJECTS).join(name);
    if root.ends_with(&below) { root.to_owned() } else { root.join(below) }
}

/// A thread that panicked while it held the mutex either ended the process or left the map consistent.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the files of `folder` whose names begin with `prefix`.
pub fn sweep(folder: &Path, prefix: &str) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()) && !entry.file_type()?.is_dir() {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

/// Removes temporary files in a work folder and in the folders of its artifacts, but not through links.
fn sweep_all(root: &Path) -> io::Result<()> {
    sweep(root, TEMPORARY)?;
    for folder in FOLDERS {
        let path = root.join(folder);
        let is_own = |path: &Path| path.symlink_metadata().is_ok_and(|found| found.is_dir());
        if path.ancestors().take_while(|above| *above != root).all(is_own) {
            sweep(&path, TEMPORARY)?;
        }
    }
    Ok(())
}

/// Reads a JSON file of a work folder.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, WorkDirError> {
    let bytes = files::read(path).map_err(|source| WorkDirError::Read { path: path.to_owned(), source })?;
    json::read(&bytes).map_err(|error| WorkDirError::Damaged { path: path.to_owned(), problem: error.to_string() })
}
