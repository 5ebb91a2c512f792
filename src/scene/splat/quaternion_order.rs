//! The order of a quaternion's components in a PLY.

use std::fmt;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use crate::gaussians::Gaussians;

/// How `rot_0` to `rot_3` hold a quaternion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum QuaternionOrder {
    /// As 3DGS writes it: the real part first.
    #[default]
    Wxyz,
    /// The real part last, as SciPy and glTF have it.
    Xyzw,
}

impl QuaternionOrder {
    /// Brings quaternions that were read as w x y z, but have this order, into that of [`Gaussians`].
    pub fn apply(self, gaussians: &mut Gaussians) {
        if self == Self::Xyzw {
            gaussians.rotations.iter_mut().for_each(|rotation| rotation.rotate_right(1));
        }
    }
}

impl fmt::Display for QuaternionOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Wxyz => "wxyz",
            Self::Xyzw => "xyzw",
        })
    }
}
