//! Errors in the files of a COLMAP model.

use thiserror::Error;

/// An error in a file of the model.
#[derive(Debug, Error)]
pub enum Problem {
    #[error("is truncated: it ends within {what} {index} of {count}; copy or export the model again")]
    Truncated { what: &'static str, index: u64, count: u64 },
    #[error("line {line}: {reason}; export the model again")]
    Line { line: usize, reason: String },
    #[error(
        "camera {id}: gprop does not know the model {model}, or it does not project onto a plane; undistort the photos to PINHOLE first"
    )]
    Model { id: u32, model: String },
    #[error("camera {id} has {found} parameters, but its model {model} takes {expected}; export the model again")]
    Parameters { id: u32, model: String, expected: usize, found: usize },
    #[error("camera {id}: {reason}; calibrate again")]
    Camera { id: u32, reason: &'static str },
    #[error(
        "image {id} has a pose with a value that is not finite or a quaternion of length zero; export the model again"
    )]
    Pose { id: u32 },
    #[error(
        "image {id} (`{name}`) belongs to camera {camera}, which the model does not have; copy both files of one model"
    )]
    UnknownCamera { id: u32, name: String, camera: u32 },
}
