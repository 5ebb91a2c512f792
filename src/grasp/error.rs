//! What can be wrong with a grasp's inputs.

use std::path::PathBuf;

use crate::units::Estimate;

/// Why there are no forces.
#[derive(Debug, thiserror::Error)]
pub enum GraspError {
    #[error("--lift-angle-deg is {degrees}: give the angle between the lift and straight up, 0 to 90")]
    LiftAngle { degrees: f64 },
    #[error("--max-curvature is {value}: give a curvature above 0, in 1/m")]
    Curvature { value: f64 },
    #[error("--force-margin is {value}: give a share of the gripper's range, 0 or more and below 0.5")]
    Margin { value: f64 },
    #[error("no part is called {name:?}; the parts are: {parts}")]
    NoSuchPart { name: String, parts: String },
    #[error("{name:?} may be more than one part: {parts}; give --part the number")]
    AmbiguousPart { name: String, parts: String },
    #[error("no part has a surface that a finger could touch; name one with --part")]
    NoSurface,
    #[error("part {part} has no label in the material field; run the vote stage again")]
    NoLabel { part: u32 },
    #[error(
        "{what} of part {part:?} is {} to {}: a grasp needs a number above 0; correct the part's answer or choose another \
         part with --part", estimate.low, estimate.high
    )]
    Property { part: String, what: &'static str, estimate: Estimate },
    #[error("no gripper is called {name:?} and no such file exists; built in are: {builtin}")]
    NoSuchGripper { name: String, builtin: String },
    #[error("cannot read the gripper profile {}", path.display())]
    ReadProfile { path: PathBuf, source: std::io::Error },
    #[error("gripper profile {origin}: {message}")]
    ParseProfile { origin: String, message: String },
    #[error("gripper profile {origin}: {key} {problem}")]
    ProfileValue { origin: String, key: &'static str, problem: String },
}
