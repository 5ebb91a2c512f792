//! Which camera file of a folder to read, and where its photos may lie.

use std::fs;
use std::path::{Path, PathBuf};

use super::colmap;
use super::gaussian_splatting::TrainingArguments;
use crate::scene::SceneError;

/// A camera file and who wrote it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::scene) struct Choice {
    pub kind: Kind,
    /// A file, or the folder of a COLMAP model.
    pub path: PathBuf,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::scene) enum Kind {
    /// nerfstudio, instant-ngp, Blender.
    Transforms,
    Colmap,
    /// The cameras.json of a 3DGS output folder.
    GaussianSplatting,
}

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

/// The camera file to read and the others that are there: `given`, or the first of [`PLACES`] in `folder`, or the first in the
/// folder that a `cfg_args` names as the training data.
pub(in crate::scene) fn choose(folder: &Path, given: Option<&Path>) -> Result<(Choice, Vec<PathBuf>), SceneError> {
    if let Some(path) = given {
        return Ok((given_choice(path)?, Vec::new()));
    }
    let in_folder = |folder: &Path| -> Vec<Choice> {
        let choices = PLACES.iter().map(|(place, kind)| Choice { kind: *kind, path: folder.join(place) });
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

fn is_there(choice: &Choice) -> bool {
    match choice.kind {
        Kind::Colmap => colmap::is_model(&choice.path),
        _ => choice.path.is_file(),
    }
}

/// What `--cameras` points at: a COLMAP model, a folder with one, or a JSON file of either kind.
fn given_choice(path: &Path) -> Result<Choice, SceneError> {
    if path.is_dir() {
        let models = [path.to_owned(), path.join("0"), path.join("sparse/0"), path.join("sparse")];
        let model = models.into_iter().find(|folder| colmap::is_model(folder));
        let model = model.ok_or_else(|| SceneError::UnknownCameras { path: path.to_owned() })?;
        return Ok(Choice { kind: Kind::Colmap, path: model });
    }
    let text = fs::read(path).map_err(|reason| SceneError::Io { path: path.to_owned(), reason })?;
    let kind = match text.iter().find(|byte| !byte.is_ascii_whitespace()) {
        Some(b'[') => Kind::GaussianSplatting,
        Some(b'{') => Kind::Transforms,
        _ => return Err(SceneError::UnknownCameras { path: path.to_owned() }),
    };
    Ok(Choice { kind, path: path.to_owned() })
}

/// The training data's folder by the `cfg_args` of a 3DGS output, where it is on this machine.
fn training_folder(folder: &Path) -> Option<PathBuf> {
    let text = fs::read_to_string(folder.join("cfg_args")).ok()?;
    let source = folder.join(TrainingArguments::parse(&text).source_path?);
    source.is_dir().then_some(source)
}

/// The folders in which the photos of a camera file may lie, best first; `given` alone where it is given.
pub(in crate::scene) fn photo_folders(folder: &Path, choice: &Choice, given: Option<&Path>) -> Vec<PathBuf> {
    if let Some(given) = given {
        return vec![given.to_owned()];
    }
    // A COLMAP model lies one to three folders below the photos' parent.
    let above = choice.path.ancestors().skip(1).take(if choice.kind == Kind::Colmap { 3 } else { 1 });
    let text = fs::read_to_string(folder.join("cfg_args")).unwrap_or_default();
    let trained_on = TrainingArguments::parse(&text).images;
    let mut parents: Vec<PathBuf> = vec![folder.to_owned()];
    parents.extend(above.map(Path::to_owned));
    parents.extend(training_folder(folder));
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
