//! Errors that make a vote impossible.

use super::correction::CorrectionError;
use crate::config::option_values::OptionError;
use crate::words::output::counted;

/// Why there is no [`super::MaterialField`].
#[derive(Debug, thiserror::Error)]
pub enum VoteError {
    #[error("{0}")]
    Option(#[from] OptionError),
    #[error("{0}")]
    Correction(#[from] CorrectionError),
    #[error("the scene has no Gaussians: give a splat that contains some")]
    NoGaussians,
    #[error(
        "the label map of view `{view}` is {} x {} pixels, but its camera's picture is {} x {}: segment the view \
         again, or scale the map to the photo's size",
        map.0, map.1, camera.0, camera.1
    )]
    MapSize { view: String, map: (u32, u32), camera: (u32, u32) },
    #[error(
        "an answer about {about} names `{material}`, which the material library does not have: add it to the library \
         or correct the answer"
    )]
    UnknownMaterial {
        /// The part, or the segment and its view.
        about: String,
        material: String,
    },
    #[error(
        "no Gaussian received a vote: {answered} of {} or parts in {} have an answer (a part counts once in each view); look \
         at the label maps and at the failures in the answers, and check with `gprop inspect` whether photos, cameras and splat agree",
        counted(*.segments, "segment"), counted(*.views, "view")
    )]
    NoVotes { views: usize, segments: usize, answered: usize },
}
