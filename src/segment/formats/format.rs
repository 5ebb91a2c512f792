//! The formats of label maps, by name.

use serde::Serialize;

/// A form in which label maps are written besides the 16-bit PNG.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// `VIEW_s.npy`, int32 `[height, width]`, -1 for background, segments from 0: the form of the paper's code.
    Npy,
    /// `VIEW_s.npy`, int32 `[4, height, width]`, the same map for each of LangSplat's levels (default, s, m, l).
    Langsplat,
    /// `coco.json`, a COCO data set with compressed run lengths.
    Coco,
}

impl Format {
    /// The number of planes of its arrays: `None` if the form has no arrays, `Some(None)` if its arrays have no such
    /// axis.
    pub fn npy_planes(self) -> Option<Option<u64>> {
        match self {
            Self::Npy => Some(None),
            Self::Langsplat => Some(Some(4)),
            Self::Coco => None,
        }
    }
}
