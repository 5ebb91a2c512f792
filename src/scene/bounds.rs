//! The position and size of the object.

use nalgebra::{Point3, Vector3};

use super::Scene;
use super::gaussians::Gaussians;

/// An axis-aligned box in the world frame, scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    pub min: Point3<f64>,
    pub max: Point3<f64>,
}

impl Bounds {
    pub fn center(&self) -> Point3<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    pub fn size(&self) -> Vector3<f64> {
        self.max - self.min
    }

    pub fn diagonal(&self) -> f64 {
        self.size().norm()
    }
}

impl Scene {
    /// The box that holds the centres of all opaque Gaussians except a few strays.
    pub fn object_bounds(&self) -> Bounds {
        robust_bounds(&self.gaussians)
    }
}

/// The box between the 0.5 and the 99.5 percentile of the centres of the Gaussians that are at least half opaque (of
/// all Gaussians if none is), excluding those set aside: trained splats have floaters, and one of them would stretch
/// the full box.
pub(crate) fn robust_bounds(gaussians: &Gaussians) -> Bounds {
    const STRAY_SHARE: f64 = 0.005;
    let mut chosen: Vec<usize> =
        (0..gaussians.len()).filter(|&i| gaussians.opacity_logits[i] >= 0.0 && !gaussians.is_set_aside(i)).collect();
    if chosen.is_empty() {
        chosen = (0..gaussians.len()).filter(|&i| !gaussians.is_set_aside(i)).collect();
    }
    let mut bounds = Bounds { min: Point3::origin(), max: Point3::origin() };
    if chosen.is_empty() {
        return bounds;
    }
    let strays = (chosen.len() as f64 * STRAY_SHARE) as usize;
    for axis in 0..3 {
        let mut values: Vec<f32> = chosen.iter().map(|&i| gaussians.positions[i][axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        bounds.min[axis] = f64::from(values[strays]);
        bounds.max[axis] = f64::from(values[values.len() - 1 - strays]);
    }
    bounds
}
