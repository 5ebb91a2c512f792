//! Chooses the camera file of a folder, and lists the places where its photos may be.

use std::path::{Path, PathBuf};

use super::gaussian_splatting::TrainingArguments;
use super::{colmap, text_of};
use crate::files;
use crate::files::read_scope::ReadScope;
use crate::scene::photos::view_names;
use crate::scene::{Options, Reference, SceneError};

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
            Reference { what: "camera file", path, named_in, flag }.check(scope)
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
const PLACES: [(&str, Kind); 8] = [
    ("transforms.json", Kind::Transforms),
    ("transforms_train.json", Kind::Transforms),
    ("sparse/0", Kind::Colmap),
    ("sparse", Kind::Colmap),
    ("colmap/sparse/0", Kind::Colmap),
    ("colmap/sparse", Kind::Colmap),
    ("colmap", Kind::Colmap),
    ("cameras.json", Kind::GaussianSplatting),
];

/// The camera file to read and the others that are there: `given`, or the first of [`PLACES`] in `folder`, or the first
/// in the folder that a `cfg_args` names as the training data.
pub(in crate::scene) fn choose(
    folder: &Path,
    given: Option<&Path>,
) -> Result<(CameraSource, Vec<PathBuf>), SceneError> {
    if let Some(path) = given {
        return Ok((given_choice(path)?, Vec::new()));
    }
    let in_folder = |folder: &Path| -> Vec<CameraSource> {
        let choices = PLACES.iter().map(|(place, kind)| CameraSource { kind: *kind, path: folder.join(place) });
        choices.filter(is_there).collect()
    };
    let mut found = in_folder(folder);
    if found.is_empty() {
        found = training_folder(folder).map(|source| in_folder(&source)).unwrap_or_default();
    }
    if found.is_empty() {
        return Err(SceneError::NoCameras { folder: folder.to_owned() });
    }
    let others = found.split_off(1).into_iter().map(|choice| choice.path).collect();
    Ok((found.remove(0), others))
}

fn is_there(choice: &CameraSource) -> bool {
    match choice.kind {
        Kind::Colmap => colmap::is_model(&choice.path),
        _ => files::is_there(&choice.path),
    }
}

/// The camera file that `--cameras` points at: a COLMAP model, a folder with one, or a JSON file of either kind.
fn given_choice(path: &Path) -> Result<CameraSource, SceneError> {
    if path.is_dir() {
        let models = [path.to_owned(), path.join("0"), path.join("sparse/0"), path.join("sparse")];
        let model = models.into_iter().find(|folder| colmap::is_model(folder));
        let model = model.ok_or_else(|| SceneError::UnknownCameras { path: path.to_owned() })?;
        return Ok(CameraSource { kind: Kind::Colmap, path: model });
    }
    // A file named as JSON that does not begin as such is read all the same: the reader says what is wrong with it.
    let is_json = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    let begins = |byte: &&u8| if is_json { matches!(byte, b'[' | b'{') } else { !byte.is_ascii_whitespace() };
    let kind = match text_of(path)?.iter().find(begins) {
        Some(b'[') => Kind::GaussianSplatting,
        Some(b'{') => Kind::Transforms,
        _ => return Err(SceneError::UnknownCameras { path: path.to_owned() }),
    };
    Ok(CameraSource { kind, path: path.to_owned() })
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

/// The folders where photos and masks may be, and which of them the user named.
pub(in crate::scene) struct Places<'a> {
    /// The folders for photos, best first.
    pub photos: Vec<PathBuf>,
    /// True if `--images` names the folder; it is then the only one.
    pub photos_are_named: bool,
    /// `--masks`.
    pub masks: Option<&'a Path>,
    /// The files that may be read without being named by a flag.
    pub scope: ReadScope,
    /// The folder of the camera file, without links.
    beside: PathBuf,
    /// The `cfg_args` that names the training data, and the folder of the training data.
    training: Option<(PathBuf, PathBuf)>,
}

impl<'a> Places<'a> {
    /// The places for the photos of the camera file `choice` of the scene in `folder`.
    pub fn of(folder: &Path, choice: &CameraSource, options: &'a Options) -> Self {
        let training = training_folder(folder);
        Self {
            photos: photo_folders(folder, choice, options.images.as_deref(), training.as_deref()),
            photos_are_named: options.images.is_some(),
            masks: options.masks.as_deref(),
            // Masks may be in the folder of photos that the user named.
            scope: options.read_scope(folder).and(options.images.as_deref()),
            beside: choice.path.parent().and_then(|folder| folder.canonicalize().ok()).unwrap_or_default(),
            training: training.map(|data| (folder.join(CFG_ARGS), data)),
        }
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
        Reference { what: "photo", path, named_in, flag: Some(("--images", folder)) }.check(&self.scope)
    }

    /// Refuses a mask that is outside of what may be read.
    pub fn check_mask(&self, path: &Path, named_in: Option<&Path>) -> Result<(), SceneError> {
        if self.masks.is_some() {
            return Ok(());
        }
        let flag = path.parent().map(|folder| ("--masks", folder));
        Reference { what: "mask", path, named_in, flag }.check(&self.scope)
    }
}

/// The folders in which the photos of a camera file may be, best first; only `given` if that is given. `training` is
/// the folder of the training data.
fn photo_folders(folder: &Path, choice: &CameraSource, given: Option<&Path>, training: Option<&Path>) -> Vec<PathBuf> {
    if let Some(given) = given {
        return vec![given.to_owned()];
    }
    // A COLMAP model is one to three folders below the parent of the photos' folder.
    let above = choice.path.ancestors().skip(1).take(if choice.kind == Kind::Colmap { 3 } else { 1 });
    let trained_on = training_arguments(folder).images;
    let mut parents: Vec<PathBuf> = vec![folder.to_owned()];
    parents.extend(above.map(Path::to_owned));
    parents.extend(training.map(Path::to_owned));
    let mut folders = Vec::new();
    for parent in parents {
        // transforms.json names files relative to itself, COLMAP and 3DGS relative to the photos' folder.
        let below = trained_on.as_deref().into_iter().chain(["images", "input", "images_2", "images_4", "images_8"]);
        let below: Vec<PathBuf> = below.map(|name| parent.join(name)).filter(|path| path.is_dir()).collect();
        let in_order = match choice.kind {
            Kind::Transforms => [vec![parent], below].concat(),
            _ => [below, vec![parent]].concat(),
        };
        for candidate in in_order {
            if !folders.contains(&candidate) {
                folders.push(candidate);
            }
        }
    }
    folders
}
