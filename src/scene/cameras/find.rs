//! Chooses the camera file of a folder, and lists the places where its photos may be.

use std::path::{Path, PathBuf};

use super::gaussian_splatting::TrainingArguments;
use super::{colmap, text_of};
use crate::files;
use crate::files::read_scope::ReadScope;
use crate::scene::photos::view_names;
use crate::scene::splat::find::names_in;
use crate::scene::{Options, Reference, SceneError};
use crate::words::output::counted;

/// A camera file and its kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::scene) struct CameraSource {
    pub kind: Kind,
    /// A file, or the folder of a COLMAP model.
    pub path: PathBuf,
}

impl CameraSource {
    /// Refuses files outside of what may be read for the scene in `folder`.
    pub fn check(&self, folder: &Path, scope: &ReadScope) -> Result<(), SceneError> {
        let cfg_args = folder.join(CFG_ARGS);
        let found_inside = self.path.starts_with(folder);
        let files = match self.kind {
            Kind::Colmap => colmap::model_files(&self.path).to_vec(),
            _ => vec![self.path.clone()],
        };
        files.iter().try_for_each(|path| {
            let named_in = (!found_inside).then_some(cfg_args.as_path());
            let flag = Some(("--cameras", self.path.as_path()));
            Ok(Reference { what: "camera file", path, named_in, flag }.check(scope)?)
        })
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::scene) enum Kind {
    /// nerfstudio, instant-ngp, Blender.
    Transforms,
    Colmap,
    /// The cameras.json of a 3DGS output folder.
    GaussianSplatting,
}

/// The file of a 3DGS output that names its training data.
const CFG_ARGS: &str = "cfg_args";

/// Where camera files are looked for within a folder, best first.
const PLACES: [(&str, Kind); 6] = [
    ("transforms.json", Kind::Transforms),
    ("transforms_train.json", Kind::Transforms),
    ("sparse", Kind::Colmap),
    ("colmap/sparse", Kind::Colmap),
    ("colmap", Kind::Colmap),
    ("cameras.json", Kind::GaussianSplatting),
];

/// COLMAP's folder of undistorted photos and the models that belong to them.
const DENSE: &str = "dense";

/// The camera file to read, and the others that are there.
pub(in crate::scene) struct Chosen {
    pub source: CameraSource,
    pub others: Vec<PathBuf>,
    /// Why this one of several models.
    pub reason: Option<String>,
}

impl Chosen {
    /// The first, unless it is one of several models of one place: then the one with most photos.
    fn of(found: Vec<Vec<CameraSource>>, scope: &ReadScope) -> Option<Self> {
        let mut found = found.into_iter().filter(|of_place| !of_place.is_empty());
        let mut first = found.next()?;
        let counts: Vec<u64> = match first.len() {
            1 => vec![0],
            _ => first.iter().map(|model| colmap::image_count(&model.path, scope)).collect(),
        };
        let most = counts.iter().copied().max().unwrap_or_default();
        let largest = counts.iter().position(|count| *count == most).unwrap_or_default();
        let reason = (counts.len() > 1).then(|| {
            format!(
                "the largest of {} models, with {}",
                counts.len(),
                counted(usize::try_from(most).unwrap_or_default(), "photo")
            )
        });
        let source = first.remove(largest);
        let mut others: Vec<PathBuf> = Vec::new();
        for other in first.into_iter().chain(found.flatten()).filter(|other| *other != source) {
            if !others.contains(&other.path) {
                others.push(other.path);
            }
        }
        Some(Self { source, others, reason })
    }
}

/// Chooses the camera file: `given`, or the first of [`PLACES`] in `folder`, or the first in the folder that a `cfg_args`
/// names as the training data. Models that `scope` does not allow to be read are not looked into.
pub(in crate::scene) fn choose(folder: &Path, given: Option<&Path>, scope: &ReadScope) -> Result<Chosen, SceneError> {
    if let Some(path) = given {
        return given_choice(path);
    }
    let trained_on = || training_folder(folder).and_then(|source| Chosen::of(in_folder(&source), scope));
    let chosen = Chosen::of(in_folder(folder), scope).or_else(trained_on);
    chosen.ok_or_else(|| SceneError::NoCameras { folder: folder.to_owned() })
}

/// The camera files in the places of a folder, those of each place together.
fn in_folder(folder: &Path) -> Vec<Vec<CameraSource>> {
    let of_place = |(place, kind): &(&str, Kind)| {
        let path = folder.join(place);
        match kind {
            Kind::Colmap => models_in(&path),
            _ if files::is_there(&path) => vec![CameraSource { kind: *kind, path }],
            _ => Vec::new(),
        }
    };
    let dense = dense_models(&folder.join(DENSE));
    // The models there are those of the photos there: without photos elsewhere, these are the ones to use.
    let only_dense = !has_photos(folder) && dense.iter().any(|model| model.path.parent().is_some_and(has_photos));
    let mut found: Vec<Vec<CameraSource>> = PLACES.iter().map(of_place).collect();
    let first_colmap = PLACES.iter().position(|(_, kind)| *kind == Kind::Colmap).unwrap_or_default();
    let at = if only_dense { first_colmap } else { PLACES.len() };
    found.insert(at, dense);
    found
}

/// Whether a folder has one of the folders in which COLMAP and 3DGS look for photos.
fn has_photos(folder: &Path) -> bool {
    PHOTO_FOLDERS.iter().any(|name| folder.join(name).is_dir())
}

/// COLMAP's models in a folder: numbered subfolders, by number, then the folder itself.
fn models_in(folder: &Path) -> Vec<CameraSource> {
    let numbered = numbered_folders(folder);
    let models = numbered.into_iter().chain([folder.to_owned()]).filter(|path| colmap::is_model(path));
    models.map(|path| CameraSource { kind: Kind::Colmap, path }).collect()
}

/// The models of undistorted photos: `0/sparse`, `1/sparse` and so on, or `sparse`.
fn dense_models(folder: &Path) -> Vec<CameraSource> {
    numbered_folders(folder)
        .into_iter()
        .chain([folder.to_owned()])
        .flat_map(|path| models_in(&path.join("sparse")))
        .collect()
}

/// The subfolders whose names are numbers, by number.
fn numbered_folders(folder: &Path) -> Vec<PathBuf> {
    let names = names_in(folder).into_iter();
    let mut numbered: Vec<(u64, String)> = names.filter_map(|name| Some((name.parse().ok()?, name))).collect();
    numbered.sort();
    numbered.into_iter().map(|(_, name)| folder.join(name)).collect()
}

/// The camera file that `--cameras` points at: a COLMAP model, a folder with some, or a JSON file of either kind.
fn given_choice(path: &Path) -> Result<Chosen, SceneError> {
    let unknown = || SceneError::UnknownCameras { path: path.to_owned() };
    if path.is_dir() {
        if colmap::is_model(path) {
            let source = CameraSource { kind: Kind::Colmap, path: path.to_owned() };
            return Ok(Chosen { source, others: Vec::new(), reason: None });
        }
        let places = vec![models_in(path), models_in(&path.join("sparse")), dense_models(path)];
        // The user named the folder, and so whatever is in it.
        return Chosen::of(places, &ReadScope::new(path)).ok_or_else(unknown);
    }
    // A file named as JSON that does not begin as such is read all the same: the reader says what is wrong with it.
    let is_json = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    let begins = |byte: &&u8| if is_json { matches!(byte, b'[' | b'{') } else { !byte.is_ascii_whitespace() };
    let kind = match text_of(path)?.iter().find(begins) {
        Some(b'[') => Kind::GaussianSplatting,
        Some(b'{') => Kind::Transforms,
        _ => return Err(unknown()),
    };
    Ok(Chosen { source: CameraSource { kind, path: path.to_owned() }, others: Vec::new(), reason: None })
}

/// The contents of the `cfg_args` in `folder`; empty if the folder has none of its own.
fn training_arguments(folder: &Path) -> TrainingArguments {
    let path = folder.join(CFG_ARGS);
    let own = ReadScope::new(folder).leads_out(&path).is_none();
    let text = own.then(|| files::read_to_string(&path).ok()).flatten();
    TrainingArguments::parse(&text.unwrap_or_default())
}

/// The training data's folder according to the `cfg_args` of a 3DGS output, if it exists on this machine.
fn training_folder(folder: &Path) -> Option<PathBuf> {
    let source = folder.join(training_arguments(folder).source_path?);
    source.is_dir().then_some(source)
}

/// The folders in which COLMAP, 3DGS and nerfstudio keep photos, best first; the last ones hold smaller copies.
const PHOTO_FOLDERS: [&str; 5] = ["images", "input", "images_2", "images_4", "images_8"];

/// The folders where photos and masks may be, and which of them the user named.
pub(in crate::scene) struct Places<'a> {
    /// The folders for photos, best first.
    pub photos: Vec<PathBuf>,
    /// Those of them that hold other things too.
    parents: Vec<PathBuf>,
    /// True if `--images` names the folder; it is then the only one.
    pub photos_are_named: bool,
    /// `--masks`.
    pub masks: Option<&'a Path>,
    /// The files that may be read without being named by a flag.
    pub scope: ReadScope,
    /// The scene's folder.
    scene: PathBuf,
    /// The folder of the camera file, without links.
    beside: PathBuf,
    /// The `cfg_args` that names the training data, and the folder of the training data.
    training: Option<(PathBuf, PathBuf)>,
}

impl<'a> Places<'a> {
    /// The places for the photos of the camera file `choice` of the scene in `folder`.
    pub fn of(folder: &Path, choice: &CameraSource, options: &'a Options) -> Self {
        let training = training_folder(folder);
        let (photos, parents) = match &options.images {
            Some(given) => (vec![given.clone()], Vec::new()),
            None => photo_folders(folder, choice, training.as_deref()),
        };
        let named = options.images.as_deref().into_iter().chain(options.masks.as_deref());
        Self {
            photos,
            parents,
            photos_are_named: options.images.is_some(),
            masks: options.masks.as_deref(),
            // Masks may be in the folder of photos that the user named.
            scope: options.read_scope(folder).and(named),
            scene: folder.to_owned(),
            beside: choice.path.parent().and_then(|folder| folder.canonicalize().ok()).unwrap_or_default(),
            training: training.map(|data| (folder.join(CFG_ARGS), data)),
        }
    }

    /// Whether the folder is one that only photos are expected in.
    pub fn is_for_photos(&self, folder: &Path) -> bool {
        !self.parents.iter().any(|parent| parent == folder)
    }

    /// Whether the names in a folder may be read: it is there, and in the scene or in what the user named.
    pub fn may_list(&self, folder: &Path) -> bool {
        folder.is_dir() && self.scope.leads_out(folder).is_none()
    }

    /// A path for messages: relative to the scene's folder if it lies in it.
    pub fn short(&self, path: &Path) -> String {
        let within = path.strip_prefix(&self.scene).unwrap_or(path);
        if within.as_os_str().is_empty() { ".".to_owned() } else { within.display().to_string() }
    }

    /// The absolute path to which `file` leads from the folder of the camera file, whether or not anything is there.
    pub fn beside_camera_file(&self, file: &str) -> PathBuf {
        view_names::without_climbing(&self.beside.join(file.replace('\\', "/")))
    }

    /// Refuses a photo, found in one of the folders for a frame of `camera_file`, if it is outside of what may be read.
    pub fn check_photo(&self, camera_file: &Path, folder: &Path, path: &Path) -> Result<(), SceneError> {
        if self.photos_are_named {
            return Ok(());
        }
        let training = self.training.as_ref().filter(|(_, data)| folder.starts_with(data));
        let named_in = Some(training.map_or(camera_file, |(cfg_args, _)| cfg_args));
        Ok(Reference { what: "photo", path, named_in, flag: Some(("--images", folder)) }.check(&self.scope)?)
    }

    /// Refuses a mask that is outside of what may be read.
    pub fn check_mask(&self, path: &Path, named_in: Option<&Path>) -> Result<(), SceneError> {
        if self.masks.is_some() {
            return Ok(());
        }
        let flag = path.parent().map(|folder| ("--masks", folder));
        Ok(Reference { what: "mask", path, named_in, flag }.check(&self.scope)?)
    }
}

/// The folders in which the photos of a camera file may be, best first, and those of them that hold other things too.
/// `training` is the folder of the training data.
fn photo_folders(folder: &Path, choice: &CameraSource, training: Option<&Path>) -> (Vec<PathBuf>, Vec<PathBuf>) {
    // A COLMAP model is one to three folders below the parent of the photos' folder.
    let above = choice.path.ancestors().skip(1).take(if choice.kind == Kind::Colmap { 3 } else { 1 });
    let parents: Vec<PathBuf> = [folder].into_iter().chain(above.clone()).chain(training).map(Path::to_owned).collect();
    let trained_on = training_arguments(folder).images;
    let below = |parent: &Path| -> Vec<PathBuf> {
        let names = trained_on.as_deref().into_iter().chain(PHOTO_FOLDERS);
        names.map(|name| parent.join(name)).filter(|path| path.is_dir()).collect()
    };
    // Photos beside a model below the scene's folder are those of that model, for instance undistorted ones.
    let inner = above.filter(|parent| parent.starts_with(folder) && *parent != folder);
    let mut candidates: Vec<PathBuf> = inner.flat_map(below).collect();
    for parent in &parents {
        // transforms.json names files relative to itself, COLMAP and 3DGS relative to the photos' folder.
        let of_parent = match choice.kind {
            Kind::Transforms => [vec![parent.clone()], below(parent)].concat(),
            _ => [below(parent), vec![parent.clone()]].concat(),
        };
        candidates.extend(of_parent);
    }
    candidates.extend([format!("{DENSE}/images"), format!("{DENSE}/0/images")].map(|place| folder.join(place)));
    let mut folders: Vec<PathBuf> = Vec::new();
    for candidate in candidates {
        let is_there = candidate.as_os_str().is_empty() || candidate.is_dir();
        if is_there && !folders.contains(&candidate) {
            folders.push(candidate);
        }
    }
    (folders, parents)
}
