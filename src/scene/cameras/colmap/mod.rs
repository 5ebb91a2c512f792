//! COLMAP's sparse model: `cameras` and `images`, each as `.bin` or `.txt`. The 3D points are read only if the frame of the
//! splat has to be computed from them.
//!
//! An image's pose is world-to-camera in OpenCV axes, a quaternion w x y z and a translation; pixel coordinates start
//! at the upper left corner, and the centre of the first pixel is at (0.5, 0.5). See COLMAP's documentation, "Output
//! Format".

mod binary;
mod models;
mod problem;
mod text;

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};

use super::frame::{Declared, Frame};
use super::{Capture, bytes_of, text_of};
use crate::files;
use crate::files::read_scope::ReadScope;
use crate::scene::SceneError;
use crate::words::output::counted;
pub use problem::Problem;

/// The cameras by id.
pub type Cameras = BTreeMap<u32, Declared>;

/// One registered image.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    pub id: u32,
    pub camera: u32,
    pub name: String,
    pub camera_from_world: Isometry3<f64>,
}

impl Image {
    /// Checks and normalises a pose from the files.
    fn new(id: u32, camera: u32, name: String, [w, x, y, z]: [f64; 4], translation: [f64; 3]) -> Result<Self, Problem> {
        let quaternion = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-12);
        let quaternion = quaternion.filter(|q| q.coords.iter().all(|v| v.is_finite())).ok_or(Problem::Pose { id })?;
        if translation.iter().any(|value| !value.is_finite()) {
            return Err(Problem::Pose { id });
        }
        let camera_from_world = Isometry3::from_parts(Translation3::from(translation), quaternion);
        Ok(Self { id, camera, name, camera_from_world })
    }
}

/// Reads `cameras.bin` from memory.
///
/// # Errors
/// [`Problem`] if the data are truncated or a camera is invalid.
pub fn parse_cameras_binary(bytes: &[u8]) -> Result<Cameras, Problem> {
    binary::cameras(bytes)
}

/// Reads `images.bin` from memory.
///
/// # Errors
/// [`Problem`] if the data are truncated or a pose is invalid.
pub fn parse_images_binary(bytes: &[u8]) -> Result<Vec<Image>, Problem> {
    binary::images(bytes)
}

/// Reads `cameras.txt` from memory.
///
/// # Errors
/// [`Problem`] if a line is not a camera.
pub fn parse_cameras_text(text: &str) -> Result<Cameras, Problem> {
    text::cameras(text)
}

/// Reads `images.txt` from memory.
///
/// # Errors
/// [`Problem`] if a line is not an image.
pub fn parse_images_text(text: &str) -> Result<Vec<Image>, Problem> {
    text::images(text).map(|listed| listed.images)
}

/// Reads `points3D.bin` from memory: the points' places.
///
/// # Errors
/// [`Problem`] if the data are truncated.
pub fn parse_points_binary(bytes: &[u8]) -> Result<Vec<Point3<f64>>, Problem> {
    binary::points(bytes)
}

/// Reads `points3D.txt` from memory: the points' places.
///
/// # Errors
/// [`Problem`] if a line is not a point.
pub fn parse_points_text(text: &str) -> Result<Vec<Point3<f64>>, Problem> {
    text::points(text)
}

/// The file with the 3D points of the model in `folder`, if there is one.
pub(super) fn points_file(folder: &Path) -> Option<PathBuf> {
    ["points3D.bin", "points3D.txt"].map(|name| folder.join(name)).into_iter().find(|path| files::is_there(path))
}

/// The finite 3D points in the file at `path`.
pub(in crate::scene) fn read_points(path: &Path) -> Result<Vec<Point3<f64>>, SceneError> {
    let points = if path.extension().is_some_and(|end| end == "bin") {
        parse_points_binary(&bytes_of(path)?)
    } else {
        parse_points_text(&String::from_utf8_lossy(&text_of(path)?))
    };
    let mut points = points.map_err(|problem| SceneError::Colmap { path: path.to_owned(), problem })?;
    points.retain(|point| point.iter().all(|value| value.is_finite()));
    Ok(points)
}

/// True if `folder` holds a model.
pub(super) fn is_model(folder: &Path) -> bool {
    ["bin", "txt"]
        .iter()
        .any(|end| ["cameras", "images"].iter().all(|name| files::is_there(&folder.join(format!("{name}.{end}")))))
}

/// The two files of the model in `folder` that are read: the binary ones if both exist.
pub(super) fn model_files(folder: &Path) -> [PathBuf; 2] {
    let binary = ["cameras.bin", "images.bin"].iter().all(|name| files::is_there(&folder.join(name)));
    let end = if binary { "bin" } else { "txt" };
    ["cameras", "images"].map(|name| folder.join(format!("{name}.{end}")))
}

/// The number of images in the model in `folder`, or as many as there can be in the file if that claims more; 0 if the file
/// cannot be read, or may not be according to `scope`.
pub(super) fn image_count(folder: &Path, scope: &ReadScope) -> u64 {
    let [_, images_at] = model_files(folder);
    if scope.leads_out(&images_at).is_some() {
        return 0;
    }
    if images_at.extension().is_some_and(|end| end == "txt") {
        let text = text_of(&images_at).unwrap_or_default();
        return parse_images_text(&String::from_utf8_lossy(&text)).map_or(0, |images| images.len() as u64);
    }
    let mut claimed = [0; 8];
    let Ok(mut file) = files::open(&images_at) else { return 0 };
    let bytes = file.metadata().map_or(0, |found| found.len());
    match file.read_exact(&mut claimed) {
        Ok(()) => u64::from_le_bytes(claimed).min(bytes / binary::LEAST_BYTES_OF_IMAGE),
        Err(_) => 0,
    }
}

/// Reads the model in `folder`, preferring the binary one if its two files exist; the images are sorted by name, as in
/// 3DGS.
pub(super) fn read(folder: &Path) -> Result<(Capture, Vec<PathBuf>), SceneError> {
    let in_file = |path: &Path| {
        let path = path.to_owned();
        move |problem| SceneError::Colmap { path, problem }
    };
    let [cameras_at, images_at] = model_files(folder);
    let binary = cameras_at.extension().is_some_and(|end| end == "bin");
    let content_of = if binary { bytes_of } else { text_of };
    let (cameras, images) = (content_of(&cameras_at)?, content_of(&images_at)?);
    let cameras =
        if binary { parse_cameras_binary(&cameras) } else { parse_cameras_text(&String::from_utf8_lossy(&cameras)) };
    let images = if binary {
        parse_images_binary(&images).map(|images| text::Listed { images, without_points: 0 })
    } else {
        text::images(&String::from_utf8_lossy(&images))
    };
    let cameras = cameras.map_err(in_file(&cameras_at))?;
    let text::Listed { images, without_points } = images.map_err(in_file(&images_at))?;
    let frames = frames(&cameras, images).map_err(in_file(&images_at))?;
    if frames.is_empty() {
        return Err(SceneError::NoFrames { path: images_at });
    }
    let notes = (without_points > 0).then(|| {
        format!(
            "`{}` has no line of points after {} of its {}; all of them are read",
            images_at.display(),
            without_points,
            counted(frames.len(), "photo"),
        )
    });
    let notes = notes.into_iter().collect();
    Ok((Capture { frames, notes, ..Capture::default() }, vec![cameras_at, images_at]))
}

fn frames(cameras: &Cameras, mut images: Vec<Image>) -> Result<Vec<Frame>, Problem> {
    images.sort_by(|a, b| a.name.cmp(&b.name));
    let frame = |image: Image| match cameras.get(&image.camera) {
        Some(declared) => {
            Ok(Frame { file: image.name, mask: None, declared: *declared, camera_from_world: image.camera_from_world })
        }
        None => Err(Problem::UnknownCamera { id: image.id, name: image.name, camera: image.camera }),
    };
    images.into_iter().map(frame).collect()
}
