//! Selects the scenes of a batch from a data set.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use glob::Pattern;

use crate::files;
use crate::files::json;
use crate::pipeline::work_folder;
use crate::scene::SplatFormat;
use crate::scene::dataset::Entry;
use crate::scene::mesh;
use crate::words::output::{agreeing, counted};
use crate::workdir;

use super::memory::GAUSSIAN_BYTES;
use super::shard::deal;
use super::{BatchError, FOLDER, Options};

/// Folders of a scene that a run writes into: their files do not count towards the scene's size.
const WRITTEN: [&str; 2] = [workdir::DEFAULT_NAME, "recorded"];

/// A scene of the batch.
#[derive(Debug, Clone, PartialEq)]
pub struct Selected {
    /// Unique within the data set.
    pub name: String,
    /// Its folder, or a mesh file.
    pub folder: PathBuf,
    /// Its work folder.
    pub work: PathBuf,
    /// Total size of its files, apart from hidden ones and those that a run writes.
    pub bytes: u64,
    /// Size of its largest splat, converted to plain PLY floats.
    pub splat_bytes: u64,
    /// The shard to which it belongs.
    pub shard: usize,
}

impl Selected {
    /// The work folder if it has to be named because it is not the scene's default one.
    pub fn named_work(&self) -> Option<&Path> {
        Some(self.work.as_path()).filter(|work| *work != work_folder(&self.folder, None))
    }
}

/// The scenes that `options` choose, distributed to `shards`; removes from `skipped` the names that `--split` or
/// `--filter` leaves out.
pub fn select(
    mut scenes: Vec<Entry>,
    skipped: &mut Vec<String>,
    options: &Options,
    shards: usize,
    out: Option<&Path>,
    warnings: &mut Vec<String>,
) -> Result<Vec<Selected>, BatchError> {
    let listed = scenes.len();
    if let Some(split) = &options.split {
        scenes = of_split(scenes, split, warnings)?;
        // A split cannot name a scene whose name is not UTF-8.
        skipped.clear();
    }
    if let Some(filter) = &options.filter {
        let filter = Filter::new(filter)?;
        scenes.retain(|scene| filter.takes(&scene.name));
        skipped.retain(|name| filter.takes(name));
    }
    let end = options.end.unwrap_or(usize::MAX).min(scenes.len());
    let chosen = scenes.get(options.start..end).unwrap_or_default();
    if chosen.is_empty() && skipped.is_empty() {
        return Err(BatchError::NothingSelected { listed });
    }
    // Its work folder would be the batch's own, whose unfinished files each run of the scene would remove. A name in
    // capitals is refused on every system, because the results may be moved to one that ignores case.
    if let Some(out) = out
        && let Some(scene) = chosen.iter().find(|scene| scene.name.eq_ignore_ascii_case(FOLDER))
    {
        return Err(BatchError::Reserved { scene: scene.name.clone(), folder: out.join(FOLDER) });
    }
    let selected = |entry: &Entry| {
        let work = out.map_or_else(|| work_folder(&entry.folder, None), |out| out.join(&entry.name));
        let (bytes, splat_bytes) =
            if entry.folder.is_file() { sizes_of_mesh(&entry.folder) } else { sizes(&entry.folder, true) };
        Selected { name: entry.name.clone(), folder: entry.folder.clone(), work, bytes, splat_bytes, shard: 0 }
    };
    let mut selected: Vec<Selected> = chosen.iter().map(selected).collect();
    let sizes: Vec<u64> = selected.iter().map(|scene| scene.bytes).collect();
    for (scene, shard) in selected.iter_mut().zip(deal(&sizes, shards)) {
        scene.shard = shard;
    }
    Ok(selected)
}

fn of_split(scenes: Vec<Entry>, split: &str, warnings: &mut Vec<String>) -> Result<Vec<Entry>, BatchError> {
    let refuse = |problem: String| BatchError::Split { given: split.to_owned(), problem };
    let path = Path::new(split);
    if path.is_file() {
        let text = files::read_to_string(path).map_err(|error| refuse(format!("cannot be read: {error}")))?;
        let names: BTreeSet<&str> =
            text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#')).collect();
        let known: BTreeSet<&str> = scenes.iter().map(|scene| scene.name.as_str()).collect();
        let absent: Vec<&&str> = names.difference(&known).collect();
        if let Some(first) = absent.first() {
            warnings.push(format!(
                "{} of {split} left out because {} no folder (first: `{first}`)",
                counted(absent.len(), "scene"),
                agreeing(absent.len(), "it has", "they have")
            ));
        }
        return Ok(scenes.iter().filter(|scene| names.contains(scene.name.as_str())).cloned().collect());
    }
    let known: BTreeSet<&str> = scenes.iter().filter_map(|scene| scene.split.as_deref()).collect();
    if !known.contains(split) {
        let known: Vec<&str> = known.into_iter().collect();
        return Err(refuse(if known.is_empty() {
            "the data set has no splits; give a text file with one scene name per line".to_owned()
        } else {
            format!("is neither a file nor a split of the data set; its splits are {}", known.join(", "))
        }));
    }
    Ok(scenes.iter().filter(|scene| scene.split.as_deref() == Some(split)).cloned().collect())
}

/// The condition of `--filter` on a name.
enum Filter {
    Holds(String),
    Fits(Pattern),
}

impl Filter {
    /// A pattern if the text has a wildcard.
    fn new(filter: &str) -> Result<Self, BatchError> {
        if !filter.contains(['*', '?', '[']) {
            return Ok(Self::Holds(filter.to_owned()));
        }
        let problem =
            |error: glob::PatternError| BatchError::Filter { given: filter.to_owned(), problem: error.to_string() };
        Ok(Self::Fits(Pattern::new(filter).map_err(problem)?))
    }

    fn takes(&self, name: &str) -> bool {
        match self {
            Self::Holds(text) => name.contains(text),
            Self::Fits(pattern) => pattern.matches(name),
        }
    }
}

/// Bytes of a mesh file, and of the Gaussians on its surface.
fn sizes_of_mesh(path: &Path) -> (u64, u64) {
    (fs::metadata(path).map_or(0, |meta| meta.len()), mesh::GAUSSIANS as u64 * GAUSSIAN_BYTES)
}

/// Bytes of all files below a scene's folder, and of its largest splat; files that a run writes and hidden files do not
/// count. Links to folders are not followed.
fn sizes(folder: &Path, is_top: bool) -> (u64, u64) {
    let (mut bytes, mut splat) = (0, 0);
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') || (is_top && WRITTEN.contains(&name.as_str())) {
            continue;
        }
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            let (below, largest) = sizes(&entry.path(), false);
            bytes += below;
            splat = splat.max(largest);
        } else if let Ok(meta) = fs::metadata(entry.path()).map(|meta| meta.len()) {
            bytes += meta;
            splat = splat.max(splat_bytes(&entry.path(), meta));
        }
    }
    (bytes, splat)
}

/// Bytes of a splat as plain floats, if it is in a file of this many bytes; 0 for any other file.
fn splat_bytes(path: &Path, bytes: u64) -> u64 {
    let Some(format) = SplatFormat::of(path) else { return 0 };
    gaussians_of_meta(path).map_or(bytes * format.inflation, |count| count * GAUSSIAN_BYTES)
}

/// The number of Gaussians that a `meta.json` states, if it is SOG's: a few kilobytes beside the pictures that hold the
/// splat.
fn gaussians_of_meta(path: &Path) -> Option<u64> {
    path.extension().filter(|ending| ending.eq_ignore_ascii_case("json"))?;
    let meta: serde_json::Value = json::read(&files::read(path).ok()?).ok()?;
    meta.get("means")?;
    // No splat has more, and the need of memory must not overflow.
    u32::try_from(meta.get("count")?.as_u64()?).ok().map(u64::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_splat_in_many_files_is_as_large_as_in_one() {
        let folder = tempfile::tempdir().unwrap();
        let meta = folder.path().join("meta.json");
        let write = |text: &str| fs::write(&meta, text).unwrap();
        fs::write(folder.path().join("means_l.webp"), [0; 900]).unwrap();
        write(r#"{"version": 2, "count": 1000, "means": {"files": ["means_l.webp"]}}"#);
        assert_eq!(sizes(folder.path(), true).1, 248_000);
        for other in [r#"{"count": 1000}"#, r#"{"count": 99999999999999, "means": {}}"#, "[]"] {
            write(other);
            assert!(sizes(folder.path(), true).1 < 1000, "{other}");
        }
        fs::remove_file(&meta).unwrap();
        assert_eq!(sizes(folder.path(), true), (900, 0));
    }
}
