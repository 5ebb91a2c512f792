//! The reasons why a scene cannot be used, and what to do about them.

use std::path::PathBuf;

use thiserror::Error;

use super::cameras::{FrameProblem, colmap};
use super::splat::{dot_splat, ksplat, sog, spz};
use crate::config::option_values::OptionError;
use crate::files::json;
use crate::scene::mesh::{self, MeshError};
use crate::scene::object::choice::ObjectNumber;
use crate::scene::object::outliers::AllSetAside;
use crate::scene::object::photo_point::PhotoPoint;
use crate::scene::reference::Outside;
use crate::scene::splat::ply::PlyError;
use crate::words::output::counted;
use crate::words::shell;

/// The trainers whose splats gprop reads, and how each exports them.
const TRAINERS: &str = "3DGS writes point_cloud/iteration_N/point_cloud.ply as it trains (point gprop at its output folder), \
    nerfstudio's splatfacto exports with `ns-export gaussian-splat` (copy splat.ply and dataparser_transforms.json beside \
    transforms.json), gsplat writes ply/point_cloud_N.ply with --save_ply, Brush exports export_N.ply";

/// Maximum number of views that a message names.
const MOST_VIEWS_NAMED: usize = 8;

/// A scene that is missing, incomplete or broken. Each message is complete: it includes that of its cause.
#[derive(Debug, Error)]
pub enum SceneError {
    #[error("{0}")]
    Option(#[from] OptionError),
    #[error("no such scene folder: `{}`; give the folder that holds the photos, cameras and splat", path.display())]
    NoFolder { path: PathBuf },
    #[error(
        "`{}` is a file but not a mesh that gprop reads ({}, with faces); give one, or the folder that holds the photos, cameras \
         and splat",
        path.display(),
        mesh::endings()
    )]
    NotAFolder { path: PathBuf },
    #[error(
        "each link of `{}` is an object of its own: `gprop run {0} --to consensus` writes them into `{}`; give one of these",
        path.display(),
        path.with_extension("gprop").join("links").display()
    )]
    IsRobot { path: PathBuf },
    #[error("{flag} is for scenes with a splat and photos; a mesh has none of these, so leave it out")]
    NotForMeshes { flag: &'static str },
    #[error("cannot read `{}`: {reason}", path.display())]
    Io { path: PathBuf, reason: std::io::Error },
    #[error(
        "no splat in `{}`{}; gprop needs the trained Gaussians: {TRAINERS}; --splat FILE names one elsewhere",
        folder.display(),
        others_found(others),
    )]
    NoSplat { folder: PathBuf, others: Vec<String> },
    #[error(
        "`{}` is not a scene, but its parent `{}` has a splat and cameras; did you mean that?",
        folder.display(), parent.display()
    )]
    InsideScene { folder: PathBuf, parent: PathBuf },
    #[error(
        "`{0}` is not a scene but holds {1}; give a scene folder, such as `{2}`, or run all of `{0}` with `gprop batch {3}`",
        folder.display(), counted(*.count, "scene folder"), first.display(), shell::path(folder)
    )]
    ManyScenes { folder: PathBuf, count: usize, first: PathBuf },
    #[error("`{}`: {problem}", path.display())]
    Splat { path: PathBuf, problem: SplatProblem },
    #[error(transparent)]
    Mesh(#[from] MeshError),
    #[error(transparent)]
    AllSetAside(#[from] AllSetAside),
    #[error(transparent)]
    Ply(#[from] PlyError),
    #[error(
        "no cameras in `{}`: neither transforms.json (nerfstudio), transforms_train.json (Blender), sparse or dense (COLMAP) \
         nor cameras.json (3DGS); --cameras PATH names them elsewhere. Without photos a splat can still be looked at with \
         `gprop inspect`; all commands that run stages, such as `gprop run`, need --render-views N, which renders its own \
         views",
        folder.display()
    )]
    NoCameras { folder: PathBuf },
    #[error(
        "`{}` is not a camera file that gprop knows; gprop reads transforms.json, cameras.json of 3DGS, and folders with a COLMAP \
         model (cameras.bin and images.bin, or .txt)",
        path.display()
    )]
    UnknownCameras { path: PathBuf },
    #[error("`{}`: {problem}", path.display())]
    Colmap { path: PathBuf, problem: colmap::Problem },
    #[error(
        "`{}`: {key} are not a rotation, a translation and one scale; export the splat and this file again from one training",
        path.display()
    )]
    NotASimilarity { path: PathBuf, key: &'static str },
    #[error(
        "none of the {count} photos that `{}` names is there (the first is `{first}`; looked in {}); put the photos there \
         or name their folder with --images DIR. Without photos, run with --render-views N",
        path.display(),
        looked_in(tried)
    )]
    NoPhotos { path: PathBuf, count: usize, first: String, tried: Vec<Held> },
    #[error(
        "`{}` names the {what} `{file}`, and it may be any of {}; keep one of them, or name the folder of the right ones with \
         {flag} DIR",
        path.display(),
        listed(found)
    )]
    Several { path: PathBuf, what: &'static str, file: String, found: Vec<PathBuf>, flag: &'static str },
    #[error(
        "no scenes in `{}`, taken as {layout}; give the folder that holds the scene folders, and their layout with --layout",
        folder.display()
    )]
    NoScenes { folder: PathBuf, layout: String },
    #[error(
        "there is no mask for any of the {views} views (the first is `{first}`); looked in {}. A mask is named like its photo: \
         {first}.png; --masks DIR names another folder",
        looked_in(tried)
    )]
    NoMasks { tried: Vec<Held>, first: String, views: usize },
    #[error("{0}; mend the masks, or say with --mask-color what is the object's")]
    MasksHideAll(Box<MasksHideAll>),
    #[error("--align {given}: {problem}; see what `gprop inspect` suggests")]
    Align { given: String, problem: &'static str },
    #[error("--scale {given}: {problem}")]
    Scale { given: String, problem: String },
    #[error(
        "--object-box {given}: none of the Gaussians lies in it; the splat extends from {} to {}",
        corner(low),
        corner(high)
    )]
    EmptyBox { given: String, low: [f64; 3], high: [f64; 3] },
    #[error(
        "--object {given}: {} on the surface that the cameras look at; `gprop objects SCENE` shows what gprop takes for an object",
        only_standing(*count)
    )]
    NoSuchObject { given: ObjectNumber, count: usize },
    #[error(
        "--object-at {given}: that pixel of a photo of {} x {} shows no object; {}",
        size[0], size[1],
        objects_shown(shown)
    )]
    NoObjectAt { given: PhotoPoint, size: [u32; 2], shown: Vec<String> },
    #[error(
        "there are no objects to tell apart: {0}; gprop tells them apart if photos without masks go all around the surface on \
         which they stand. `gprop run SCENE --object-box XMIN,YMIN,ZMIN:XMAX,YMAX,ZMAX` takes what is in a box instead, as one object"
    )]
    NoSupport(&'static str),
    #[error("--object all is for `gprop run`; name one object here, as `gprop objects SCENE` numbers them")]
    AllObjects,
    #[error(
        "{count} objects stand on the surface that the cameras look at: --object N takes one of them, as `gprop objects SCENE` \
         numbers them, --object-box XMIN,YMIN,ZMIN:XMAX,YMAX,ZMAX what lies in a box; `gprop run SCENE` and `gprop export SCENE \
         --object all` take all of them"
    )]
    SeveralObjects { count: usize },
    #[error("`{}`: {reason}; correct it there or export the cameras again", path.display())]
    Json { path: PathBuf, reason: json::Problem },
    #[error("`{}` has no frames, so there are no photos to segment; name other cameras with --cameras, or use --render-views N", path.display())]
    NoFrames { path: PathBuf },
    #[error("`{}`, frame {frame} (`{file}`): {problem}", path.display())]
    Frame { path: PathBuf, frame: usize, file: String, problem: FrameProblem },
    #[error("photo `{}` is missing; put it there, or remove its frame from the camera file", path.display())]
    MissingImage { path: PathBuf },
    #[error("photo `{}` cannot be decoded: {reason}; replace it with a complete PNG, JPEG, WebP, BMP or TIFF", path.display())]
    Image { path: PathBuf, reason: image::ImageError },
    #[error(
        "photo `{}`, {} x {} pixels, takes {} MB to decode, and gprop uses up to {} MB per photo here; scale it down{}",
        path.display(), size.0, size.1, bytes >> 20, most >> 20, remedy
    )]
    TooLarge { path: PathBuf, size: (u32, u32), bytes: u64, most: u64, remedy: &'static str },
    #[error(
        "photo `{}` is {} x {} pixels but was {} x {} when the scene was loaded; run again",
        path.display(), found.0, found.1, expected.0, expected.1
    )]
    ImageChanged { path: PathBuf, expected: (u32, u32), found: (u32, u32) },
    #[error(
        "mask `{}` is {} x {} pixels, not the shape of its photo, which is {} x {} after any rotation by its EXIF \
         orientation; make the mask from the photo again, in that orientation and without cropping",
        path.display(), found.0, found.1, photo.0, photo.1
    )]
    MaskShape { path: PathBuf, photo: (u32, u32), found: (u32, u32) },
    #[error(
        "mask `{}` has no value above 1, so it is black everywhere, but others are white (255) on the object; write all of them \
         alike",
        path.display()
    )]
    MaskOfOnes { path: PathBuf },
    #[error("{0}")]
    Outside(#[from] Box<Outside>),
    #[error("no view is named `{name}`; {}", views_known(known))]
    UnknownView { name: String, known: Vec<String> },
}

/// Masks that show nothing of the object.
#[derive(Debug, Error)]
#[error(
    "the {} would hide everything: read as {color} on the object, none shows any of it (first: `{}`; their colours: {colors})",
    counted(*count, "mask"),
    first.display()
)]
pub struct MasksHideAll {
    pub first: PathBuf,
    pub count: usize,
    pub color: String,
    /// The first of the colours that the masks have.
    pub colors: String,
}

/// A folder that was searched, and pictures in it.
#[derive(Debug)]
pub struct Held {
    pub folder: PathBuf,
    /// Some of them.
    pub pictures: Vec<String>,
    /// The number of all.
    pub count: usize,
    /// False if it lies outside of what may be read.
    pub may_be_listed: bool,
}

impl SceneError {
    /// The same error for a command without the options that name files of the scene.
    pub fn without_flag(mut self) -> Self {
        if let Self::Outside(outside) = &mut self {
            outside.flag = None;
        }
        self
    }
}

/// An error in a splat that is not a PLY.
#[derive(Debug, Error)]
pub enum SplatProblem {
    #[error("is not a splat format that gprop reads: the name must end in one of {endings}")]
    Format { endings: String },
    #[error(
        "--quaternions is for splats in plain PLY files; this format defines the order itself, so leave the option out"
    )]
    QuaternionOrder,
    #[error(transparent)]
    Ksplat(#[from] ksplat::Problem),
    #[error(transparent)]
    Sog(#[from] sog::Problem),
    #[error(transparent)]
    Splat(#[from] dot_splat::Problem),
    #[error(transparent)]
    Spz(#[from] spz::Problem),
}

fn others_found(others: &[String]) -> String {
    match others {
        [] => String::new(),
        _ => format!(" (there is {}, which gprop does not read)", others.join(", ")),
    }
}

fn views_known(known: &[String]) -> String {
    match known {
        [] => "the scene has no photo with a camera".to_owned(),
        _ if known.len() > MOST_VIEWS_NAMED => {
            let (named, more) = known.split_at(MOST_VIEWS_NAMED);
            format!("the views are: {} and {} more", named.join(", "), more.len())
        }
        _ => format!("the views are: {}", known.join(", ")),
    }
}

fn listed(paths: &[PathBuf]) -> String {
    let (named, more) = paths.split_at(paths.len().min(MOST_VIEWS_NAMED));
    let mut named: Vec<String> = named.iter().map(|path| format!("`{}`", path.display())).collect();
    if !more.is_empty() {
        named.push(format!("{} more", more.len()));
    }
    named.join(", ")
}

fn looked_in(folders: &[Held]) -> String {
    let held = |held: &Held| match held.count - held.pictures.len() {
        _ if !held.may_be_listed => format!("`{}`, which leads out of the scene", held.folder.display()),
        _ if held.count == 0 => format!("`{}`, which has no pictures", held.folder.display()),
        0 => format!("`{}`, which has {}", held.folder.display(), held.pictures.join(" ")),
        more => format!("`{}`, which has {} and {more} more", held.folder.display(), held.pictures.join(" ")),
    };
    folders.iter().map(held).collect::<Vec<_>>().join("; ")
}

fn only_standing(count: usize) -> String {
    match count {
        0 => "nothing stands".to_owned(),
        1 => "only 1 object stands".to_owned(),
        more => format!("only {more} objects stand"),
    }
}

fn objects_shown(shown: &[String]) -> String {
    match shown {
        [] => "nor does any other of its pixels; `gprop objects SCENE` shows what gprop takes for an object".to_owned(),
        _ if shown.len() > MOST_VIEWS_NAMED => format!("it shows {}, and more", shown[..MOST_VIEWS_NAMED].join(", ")),
        _ => format!("it shows {}", shown.join(", ")),
    }
}

fn corner(point: &[f64; 3]) -> String {
    let [x, y, z] = point;
    format!("{x:.3},{y:.3},{z:.3}")
}
