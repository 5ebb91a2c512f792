//! Why a scene cannot be used, and what to do about it.

use std::path::PathBuf;

use thiserror::Error;

use super::ply::PlyError;

/// A scene that is missing, incomplete or broken. Each message is whole: it holds what caused it.
#[derive(Debug, Error)]
pub enum SceneError {
    #[error("no such scene folder: `{}`; give the folder that holds the photos, cameras and splat", path.display())]
    NoFolder { path: PathBuf },
    #[error("`{}` is a file; give the folder that holds the photos, cameras and splat", path.display())]
    NotAFolder { path: PathBuf },
    #[error("cannot read `{}`: {reason}", path.display())]
    Io { path: PathBuf, reason: std::io::Error },
    #[error(
        "no splat in `{}`: neither point_cloud.ply nor point_cloud/iteration_N/point_cloud.ply{}; copy or link the \
         trained splat there as point_cloud.ply",
        folder.display(),
        others_found(others)
    )]
    NoSplat { folder: PathBuf, others: Vec<String> },
    #[error(transparent)]
    Ply(#[from] PlyError),
    #[error("no cameras in `{}`: {remedy}", folder.display())]
    NoCameras { folder: PathBuf, remedy: &'static str },
    #[error("`{}`: {reason}; correct it there or export the cameras again", path.display())]
    Json { path: PathBuf, reason: serde_json::Error },
    #[error("`{}` has no frames; without photos there is nothing to segment", path.display())]
    NoFrames { path: PathBuf },
    #[error("`{}`, frame {frame} (`{file}`): {problem}", path.display())]
    Frame { path: PathBuf, frame: usize, file: String, problem: FrameProblem },
    #[error("photo `{}` is missing; put it there, or remove its frame from the camera file", path.display())]
    MissingImage { path: PathBuf },
    #[error("photo `{}` cannot be decoded: {reason}; replace it by a whole PNG, JPEG, WebP, BMP or TIFF", path.display())]
    Image { path: PathBuf, reason: image::ImageError },
    #[error(
        "photo `{}` is {} x {} pixels but was {} x {} when the scene was loaded; start again",
        path.display(), found.0, found.1, expected.0, expected.1
    )]
    ImageChanged { path: PathBuf, expected: (u32, u32), found: (u32, u32) },
    #[error("no view is named `{name}`; the views are: {}", known.join(", "))]
    UnknownView { name: String, known: Vec<String> },
}

/// What is wrong with one frame of a camera file.
#[derive(Debug, Error)]
pub enum FrameProblem {
    #[error("transform_matrix is not 4 x 4")]
    MatrixShape,
    #[error(
        "the upper left 3 x 3 of transform_matrix is not a rotation (orthonormal, right-handed); export the cameras again \
         without scaling or mirroring the axes"
    )]
    NotARotation,
    #[error("no focal length: fl_x or camera_angle_x is needed, in the frame or at the top")]
    NoFocalLength,
    #[error("{name} = {value} makes no sense; it must be finite{}", if *.positive { " and above zero" } else { "" })]
    Number { name: &'static str, value: f64, positive: bool },
    #[error("camera_model {model} is not supported yet; undistort the photos to PINHOLE or OPENCV first")]
    CameraModel { model: String },
    #[error("file_path leads out of the scene folder; copy the photo into it and write a relative path")]
    OutsideScene,
}

fn others_found(others: &[String]) -> String {
    match others {
        [] => String::new(),
        _ => format!(" (there is {}, which the cameras' tools or other programs write)", others.join(", ")),
    }
}
