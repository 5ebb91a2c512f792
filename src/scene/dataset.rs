//! Data sets: the scenes of a folder, with split, class and true mass if the data set provides them.
//!
//! ```text
//! ABO-500, as NeRF2Physics lays it out        MVImgNet                         anything else
//! FOLDER/scenes/ASIN_MARKET/images/           FOLDER/CLASS/INSTANCE/images/    FOLDER/NAME/ with a splat or cameras
//!                           transforms.json                         sparse/0/  FOLDER/NAME.glb and other meshes
//! FOLDER/splits.json
//! FOLDER/filtered_product_weights.json
//! ```

use std::collections::{BTreeMap, HashMap, HashSet};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::{fmt, fs};

use serde::{Deserialize, Serialize};

use super::{SceneError, cameras};
use crate::files;
use crate::files::read_scope::ReadScope;
use crate::scene::mesh::{MESH_FORMATS, MeshFormat, is_mesh};
use crate::scene::splat::find as splat_file;
use crate::units::{MetricScale, ScaleSource};
use crate::words::output::{agreeing, counted};
use crate::workdir::Artifact;

const SPLITS: &str = "splits.json";
const MASSES: &str = "filtered_product_weights.json";

/// How a data set lays its scenes out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    Abo,
    #[value(name = "mvimgnet")]
    MvImgNet,
    /// Any folder of scenes.
    Scenes,
}

/// One scene of a data set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Entry {
    /// Unique within the data set, with `/` between class and instance.
    pub name: String,
    /// Its folder, or a mesh file.
    pub folder: PathBuf,
    /// `train`, `val`, `test`, or the data set's own name for it.
    pub split: Option<String>,
    pub class: Option<String>,
    /// Ground truth, for evaluation only.
    pub mass_kg: Option<f64>,
}

/// The scenes of a folder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DataSet {
    pub layout: Layout,
    /// Sorted by name.
    pub scenes: Vec<Entry>,
    /// Scene folders whose name is not UTF-8, with the invalid bytes escaped; result files could not name them.
    pub skipped: Vec<String>,
    pub warnings: Vec<String>,
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Abo => "ABO-500",
            Self::MvImgNet => "MVImgNet",
            Self::Scenes => "scene folders",
        })
    }
}

/// Lists the scenes of `folder`, in the given layout or the one that the folder's contents indicate.
///
/// # Errors
/// [`SceneError`] if there is no such folder, no scene in it, or a broken JSON file beside the scenes.
pub fn list(folder: &Path, layout: Option<Layout>) -> Result<DataSet, SceneError> {
    super::check_is_folder(folder)?;
    let layout = layout.unwrap_or_else(|| recognised(folder));
    let mut warnings = Vec::new();
    let Listed { scenes, skipped } = match layout {
        Layout::Abo => abo(folder, &mut warnings)?,
        Layout::MvImgNet => mvimgnet(folder),
        Layout::Scenes => plain(folder),
    };
    if scenes.is_empty() && skipped.is_empty() {
        return Err(SceneError::NoScenes { folder: folder.to_owned(), layout: layout.to_string() });
    }
    Ok(DataSet { layout, scenes, skipped, warnings })
}

/// The error that `folder` is not a scene but lies in one, or holds scenes and has no cameras of its own; `None` if
/// neither is so.
pub(super) fn instead_of_scene(folder: &Path) -> Option<SceneError> {
    if let Some(parent) = scene_around(folder) {
        return Some(SceneError::InsideScene { folder: folder.to_owned(), parent });
    }
    let scenes = list(folder, None).ok().filter(|_| !has_cameras(folder))?.scenes;
    let first = scenes.first()?.folder.clone();
    Some(SceneError::ManyScenes { folder: folder.to_owned(), count: scenes.len(), first })
}

/// The parent of `folder` if it has a splat and cameras.
fn scene_around(folder: &Path) -> Option<PathBuf> {
    // `.` and `..` have no name, and the path does not tell their parents.
    folder.file_name()?;
    let parent = folder.parent()?;
    let parent = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
    let is_scene = splat_file::find(parent).is_ok() && has_cameras(parent);
    is_scene.then(|| parent.to_owned())
}

fn has_cameras(folder: &Path) -> bool {
    cameras::choose(folder, None, &ReadScope::new(folder)).is_ok()
}

/// The metric scale of the data set that the scene `folder` belongs to: the cameras of ABO-500 are in metres.
pub(super) fn convention_of(folder: &Path, splat_units_per_camera_unit: f64) -> Option<MetricScale> {
    is_of_abo(folder).then(|| MetricScale {
        meters_per_unit: 1.0 / splat_units_per_camera_unit,
        source: ScaleSource::DataSet,
        provenance: "ABO-500 is in metres".to_owned(),
        range: None,
    })
}

/// Whether the scene `folder` belongs to ABO-500, whose cameras' world has z up.
pub(super) fn is_of_abo(folder: &Path) -> bool {
    let folder = folder.canonicalize().unwrap_or_default();
    let scenes = folder.parent().filter(|parent| parent.file_name().is_some_and(|name| name == "scenes"));
    scenes.and_then(Path::parent).is_some_and(|root| root.join(MASSES).is_file() || root.join(SPLITS).is_file())
}

fn recognised(folder: &Path) -> Layout {
    if folder.join("scenes").is_dir() && (folder.join(SPLITS).is_file() || folder.join(MASSES).is_file()) {
        return Layout::Abo;
    }
    if plain(folder).scenes.is_empty() && !mvimgnet(folder).scenes.is_empty() {
        return Layout::MvImgNet;
    }
    Layout::Scenes
}

/// The scenes of a folder and those skipped, as in [`DataSet`].
struct Listed {
    scenes: Vec<Entry>,
    skipped: Vec<String>,
}

fn abo(folder: &Path, warnings: &mut Vec<String>) -> Result<Listed, SceneError> {
    let splits: BTreeMap<String, Vec<String>> = json(&folder.join(SPLITS))?;
    let masses: BTreeMap<String, f64> = json(&folder.join(MASSES))?;
    // Of several splits that list a scene, the first.
    let split_of_name: HashMap<&str, &String> =
        splits.iter().rev().flat_map(|(split, names)| names.iter().map(move |name| (name.as_str(), split))).collect();
    let split_of = |name: &str| split_of_name.get(name).map(|split| (*split).clone());
    // Masses are listed by product (ASIN), scenes by product and market.
    let mass_of = |name: &str| masses.get(name).or_else(|| masses.get(name.split('_').next().unwrap_or(name))).copied();
    let scenes = folder.join("scenes");
    let entry = |name: String| Entry {
        folder: scenes.join(&name),
        split: split_of(&name),
        class: None,
        mass_kg: mass_of(&name),
        name,
    };
    let Folders { names, skipped } = folders_in(&scenes);
    let entries: Vec<Entry> = names.into_iter().map(entry).collect();
    let there: HashSet<&str> = entries.iter().map(|entry| entry.name.as_str()).collect();
    let absent: Vec<&String> = splits.values().flatten().filter(|name| !there.contains(name.as_str())).collect();
    if let Some(first) = absent.first() {
        warnings.push(format!(
            "{} of {SPLITS} left out because {} no folder (first: `{first}`)",
            counted(absent.len(), "scene"),
            agreeing(absent.len(), "it has", "they have")
        ));
    }
    Ok(Listed { scenes: entries, skipped: skipped.iter().map(|name| printable(name)).collect() })
}

fn mvimgnet(folder: &Path) -> Listed {
    let is_scene = |folder: &Path| folder.join("images").is_dir() && folder.join("sparse").is_dir();
    let classes = folders_in(folder);
    let (mut scenes, mut skipped) = (Vec::new(), Vec::new());
    for class in classes.names {
        let class_folder = folder.join(&class);
        let instances = folders_in(&class_folder);
        for instance in instances.names {
            let (name, folder) = (format!("{class}/{instance}"), class_folder.join(&instance));
            if is_scene(&folder) {
                scenes.push(Entry { name, folder, split: None, class: Some(class.clone()), mass_kg: None });
            }
        }
        let odd = instances.skipped.iter().filter(|instance| is_scene(&class_folder.join(instance)));
        skipped.extend(odd.map(|instance| format!("{class}/{}", printable(instance))));
    }
    for class in classes.skipped {
        let Folders { names, skipped: odd } = folders_in(&folder.join(&class));
        let instances = names.into_iter().map(OsString::from).chain(odd);
        let instances = instances.filter(|instance| is_scene(&folder.join(&class).join(instance)));
        skipped.extend(instances.map(|instance| format!("{}/{}", printable(&class), printable(&instance))));
    }
    Listed { scenes, skipped }
}

fn plain(folder: &Path) -> Listed {
    let has_splat = |folder: &Path| splat_file::find(folder).is_ok_and(|found| !is_result(&found.path));
    let is_scene = |folder: &Path| has_splat(folder) || has_cameras(folder);
    let entry = |name: String| Entry { folder: folder.join(&name), split: None, class: None, mass_kg: None, name };
    let Folders { names, skipped } = folders_in(folder);
    let mut scenes: Vec<Entry> = names.into_iter().map(entry).filter(|entry| is_scene(&entry.folder)).collect();
    scenes.extend(meshes_in(folder));
    scenes.sort_by(|a, b| a.name.cmp(&b.name));
    Listed {
        scenes,
        skipped: skipped.iter().filter(|name| is_scene(&folder.join(name))).map(|name| printable(name)).collect(),
    }
}

/// The meshes in a folder, each named like its file without the ending. Of several with one name, such as the forms in which
/// one object is offered, the first by the table of formats counts.
fn meshes_in(folder: &Path) -> Vec<Entry> {
    let rank = |name: &str| {
        let format = MeshFormat::of(Path::new(name));
        MESH_FORMATS.iter().position(|known| format.is_some_and(|format| format.ending == known.ending))
    };
    let mut files: Vec<(usize, String)> =
        splat_file::names_in(folder).into_iter().filter_map(|name| Some((rank(&name)?, name))).collect();
    files.retain(|(_, name)| !name.starts_with('.') && folder.join(name).is_file() && is_mesh(&folder.join(name)));
    files.sort();
    let mut seen = HashSet::new();
    let mut entries = Vec::new();
    for (_, file) in files {
        let name = file.rsplit_once('.').map_or(file.clone(), |(stem, _)| stem.to_owned());
        if seen.insert(name.clone()) {
            entries.push(Entry { folder: folder.join(&file), split: None, class: None, mass_kg: None, name });
        }
    }
    entries
}

/// True if gprop wrote this splat: it lies in a work folder, under the name of a result. (If a folder holds another splat,
/// [`splat_file::find`] prefers that one.)
fn is_result(splat: &Path) -> bool {
    let folder = splat.parent().unwrap_or(Path::new(""));
    let lies_at = |result: Artifact| splat == folder.join(result.path());
    (lies_at(Artifact::Field) || lies_at(Artifact::Recolored)) && folder.join(Artifact::Run.path()).is_file()
}

/// The visible folders in a folder, sorted.
#[derive(Default)]
struct Folders {
    names: Vec<String>,
    /// Names that are not UTF-8.
    skipped: Vec<OsString>,
}

fn folders_in(folder: &Path) -> Folders {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.file_name());
    let mut found = Folders::default();
    for name in entries.filter(|name| !name.as_encoded_bytes().starts_with(b".") && folder.join(name).is_dir()) {
        match name.into_string() {
            Ok(name) => found.names.push(name),
            Err(name) => found.skipped.push(name),
        }
    }
    found.names.sort();
    found.skipped.sort();
    found
}

/// A name in which bytes that are not UTF-8 and control characters are escaped.
fn printable(name: &OsStr) -> String {
    let quoted = format!("{name:?}");
    quoted[1..quoted.len() - 1].to_owned()
}

/// The content of a JSON file; empty if it does not exist.
fn json<T: Default + for<'de> Deserialize<'de>>(path: &Path) -> Result<T, SceneError> {
    match files::read(path) {
        Ok(bytes) => files::json::parse(&bytes).map_err(|reason| SceneError::Json { path: path.to_owned(), reason }),
        Err(reason) if reason.kind() == std::io::ErrorKind::NotFound => Ok(T::default()),
        Err(reason) => Err(SceneError::Io { path: path.to_owned(), reason }),
    }
}
