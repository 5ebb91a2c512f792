//! The result of reading a splat, whatever the format.

use std::path::PathBuf;

use crate::gaussians::Gaussians;
use crate::words::output::{agreeing, counted};

/// A cloud read from a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Loaded {
    pub gaussians: Gaussians,
    /// The kind of splat, if it is not plain 3DGS.
    pub notes: Vec<String>,
    /// Counts of what was dropped, rounded or left out.
    pub warnings: Vec<String>,
    /// The files beside the named one that hold a part of it.
    pub files: Vec<PathBuf>,
}

/// The error that no Gaussian of a file can be drawn.
pub(in crate::scene) struct NothingUsable;

/// Drops every Gaussian that no renderer could draw and says how many there were.
pub(in crate::scene) fn drop_unusable(gaussians: &mut Gaussians) -> Result<Option<String>, NothingUsable> {
    let count = gaussians.len();
    let usable: Vec<bool> = (0..count).map(|i| gaussians.is_usable(i)).collect();
    let dropped = usable.iter().filter(|usable| !**usable).count();
    if dropped == count {
        return Err(NothingUsable);
    }
    if dropped == 0 {
        return Ok(None);
    }
    gaussians.retain(&usable);
    Ok(Some(format!(
        "{dropped} of {} {} values that are NaN, infinite or beyond float32; {} dropped",
        counted(count, "Gaussian"),
        agreeing(dropped, "has", "have"),
        agreeing(dropped, "it was", "they were"),
    )))
}
