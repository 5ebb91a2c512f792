//! Errors of the parts stage.

use crate::config::option_values::OptionError;
use crate::scene::mesh::solid::SolidError;

/// An error in the input of the parts stage, and what to do about it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PartsError {
    #[error("{0}")]
    Option(#[from] OptionError),
    #[error("the scene has no Gaussians, so it has no volume")]
    NoGaussians,
    #[error("the material field has {field} Gaussians but the scene has {gaussians}; run the vote stage again")]
    FieldSize { field: usize, gaussians: usize },
    #[error("Gaussian {gaussian} has label {label}, but the material field has {labels}; run the vote stage again")]
    Label { gaussian: usize, label: u32, labels: usize },
    #[error("Gaussian {gaussian} has a position or size that is not a finite number; remove it from the splat")]
    NotFinite { gaussian: usize },
    #[error("there are no views: carving needs the scene's cameras; without them, use --volume fill")]
    NoViews,
    #[error(
        "nothing is inside the object: {why}; check with `gprop inspect` that cameras and splat agree, or use --volume fill \
         with a lower --fill-density"
    )]
    NothingInside { why: &'static str },
    #[error("the mesh encloses less than a cell of the grid shows; raise --volume-cells")]
    MeshTooThin,
    #[error("the mesh cannot be measured: {0}")]
    Mesh(#[from] SolidError),
    #[error(
        "none of the parts has a volume, so the object has no mass: {why}; check with `gprop inspect` that photos, \
         cameras and splat agree, and look at the warnings of the earlier stages"
    )]
    NoVolume { parts: usize, why: String },
    #[error(
        "the metric scale is unknown, so masses and forces cannot be computed: give --scale metric if the scene is in \
         metres, or a length that you measured (such as --scale bbox:z=0.12 for the object's height in metres; see \
         docs/capture.md for others), or --known-mass if you can weigh the object"
    )]
    ScaleUnknown,
    /// An error in a stored [`Interior`](super::Interior).
    #[error("{0}")]
    Interior(String),
}
