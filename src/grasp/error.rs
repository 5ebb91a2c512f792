//! Errors in a grasp's inputs.

use std::path::PathBuf;

use super::calibration::CalibrationError;
use crate::config::option_values::OptionError;
use crate::parts::NoVolume;
use crate::units::Estimate;

/// Why no forces can be computed.
#[derive(Debug, thiserror::Error)]
pub enum GraspError {
    #[error("{0}")]
    Option(#[from] OptionError),
    #[error("no part is called {name:?}; the parts are: {parts}")]
    NoSuchPart { name: String, parts: String },
    #[error("{name:?} could be any of several parts: {parts}; name one by its number with --part")]
    AmbiguousPart { name: String, parts: String },
    #[error("no part has a surface that a finger could touch; choose a part with --part")]
    NoSurface,
    #[error("part {part} has no label in the material field; run the vote stage again")]
    NoLabel { part: u32 },
    #[error(
        "{what} of part {part:?} is {} to {}: it must be above 0 for a grasp; correct the part's answer or choose another \
         part with --part", estimate.low, estimate.high
    )]
    Property { part: String, what: &'static str, estimate: Estimate },
    #[error(
        "part {part:?} {}, so it has no thickness and cannot be grasped; choose another part with --part",
        why.map_or_else(|| "has no surface that was seen".to_owned(), |why| why.to_string())
    )]
    NoThickness { part: String, why: Option<NoVolume> },
    #[error(
        "--gripper {name:?}: no gripper of that name is built in and no such file exists; the built-in grippers are: \
         {builtin}"
    )]
    NoSuchGripper { name: String, builtin: String },
    #[error("cannot read the gripper profile {}", path.display())]
    ReadProfile { path: PathBuf, source: std::io::Error },
    #[error("gripper profile {origin}: {message}")]
    ParseProfile { origin: String, message: String },
    #[error("gripper profile {origin}: {key} {problem}")]
    ProfileValue { origin: String, key: &'static str, problem: String },
    #[error(
        "gripper profile {origin} has no calibration: give [[calibration]] pairs (`gprop grasp calibrate` makes them from \
         measurements), or [command] with enabled_from and full for a command that is linear in the force"
    )]
    NoCalibration { origin: String },
    #[error("calibration {origin}: {problem}")]
    Calibration { origin: String, problem: CalibrationError },
    #[error("cannot read the measurements {}: {message}", path.display())]
    ReadPoints { path: PathBuf, message: String },
    #[error(
        "every place where the fingers could press on {what} is wider than the {stroke_mm:.0} mm to which {gripper} opens: \
         the narrowest is {narrowest_mm:.0} mm; use a gripper with a longer stroke, or name another part with --part"
    )]
    StrokeTooSmall { what: String, gripper: String, stroke_mm: f64, narrowest_mm: f64 },
    #[error(
        "--point {} is {distance_mm:.0} mm from the object, farther than a finger is long ({finger_mm:.0} mm); give a point on the object, \
         in scene units",
        coordinates(point)
    )]
    PointTooFar { point: [f64; 3], distance_mm: f64, finger_mm: f64 },
    #[error(
        "no two opposite places on {what} can be pressed on and leave enough space for the fingers; name a part with --part \
         or a place with --point, where gprop then looks more closely"
    )]
    NoPlace { what: String },
}

impl GraspError {
    /// True if the object cannot be grasped; false if a value or a name that the user gave is wrong, or a file is damaged.
    pub fn is_of_the_object(&self) -> bool {
        matches!(
            self,
            Self::NoSurface
                | Self::Property { .. }
                | Self::NoThickness { .. }
                | Self::StrokeTooSmall { .. }
                | Self::NoPlace { .. }
        )
    }
}

/// A point as the user types it.
fn coordinates([x, y, z]: &[f64; 3]) -> String {
    format!("{x},{y},{z}")
}
