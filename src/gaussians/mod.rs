//! The Gaussians as a structure of arrays, stored exactly as in a 3DGS PLY and read through accessors.

pub mod bounds;

use nalgebra::{Matrix3, Point3, Quaternion, UnitQuaternion, Vector3};

/// The constant spherical harmonic, `sqrt(1 / 4 pi)`: colour = 1/2 + this * `sh_dc` (3DGS, Kerbl et al. 2023).
pub const SH_C0: f32 = 0.282_094_79;

/// Semi-axes of a Gaussian's ellipsoid, in standard deviations: `sqrt(5)`. A Gaussian represents something solid: the
/// ellipsoid with the same covariance.
pub const ELLIPSOID_DEVIATIONS: f64 = 2.236_067_977_499_79;

/// A rotation in the form in which [`Gaussians::rotations`] stores it.
pub fn wxyz(rotation: &UnitQuaternion<f64>) -> [f32; 4] {
    [rotation.w, rotation.i, rotation.j, rotation.k].map(|part| part as f32)
}

/// A cloud of 3D Gaussians. The arrays hold the values of the PLY: log scale, logit opacity, unnormalised quaternion (w
/// x y z), spherical harmonics channel-major. Use the accessors for the physical values.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gaussians {
    /// Centres in the world frame, scene units.
    pub positions: Vec<[f32; 3]>,
    /// Natural logarithm of the standard deviations along the Gaussian's own axes, scene units.
    pub log_scales: Vec<[f32; 3]>,
    /// Quaternion w x y z that rotates the Gaussian's own axes into the world's; not normalised.
    pub rotations: Vec<[f32; 4]>,
    /// Opacity before the logistic function.
    pub opacity_logits: Vec<f32>,
    /// The constant SH coefficient of red, green, blue.
    pub sh_dc: Vec<[f32; 3]>,
    /// Degree of the spherical harmonics, 0 to 3.
    pub sh_degree: u8,
    /// The other SH coefficients, `3 * sh_rest_per_channel()` per Gaussian: all of red, then green, then blue.
    pub sh_rest: Vec<f32>,
    /// Whether the cloud was trained with an antialiased rasteriser (Mip-Splatting, Yu et al. 2024), and is to be drawn
    /// with one, which compensates for the opacity that the low-pass filter adds.
    pub antialiased: bool,
    /// Properties of the file that gprop does not know, in file order, kept for writing back.
    pub extra: Vec<ExtraProperty>,
    /// For each Gaussian, whether it is set aside (gprop's `scene::outliers`): it stays in the cloud and in the files
    /// that are written, but counts as transparent when the cloud is drawn or measured. Empty if none is.
    pub set_aside: Vec<bool>,
    /// For each Gaussian, the connected surface on which it lies, if the cloud was sampled from a mesh: surfaces have nothing in
    /// common, however near they are. Empty for a splat, of which nothing is known.
    pub surface: Vec<u32>,
}

/// A vertex property that gprop passes through without interpreting it.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtraProperty {
    pub name: String,
    pub values: Vec<f32>,
}

impl Gaussians {
    /// Just below ln(f32::MAX): beyond this a standard deviation does not fit in a float32.
    pub const LOG_SCALE_LIMIT: f32 = 88.0;

    pub fn len(&self) -> usize {
        self.positions.len()
    }

    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// SH coefficients per channel beyond the constant one: 0, 3, 8 or 15.
    pub fn sh_rest_per_channel(&self) -> usize {
        let bands = usize::from(self.sh_degree) + 1;
        bands * bands - 1
    }

    /// The SH coefficients of Gaussian `i` beyond the constant one, channel-major.
    pub fn sh_rest_of(&self, i: usize) -> &[f32] {
        let n = 3 * self.sh_rest_per_channel();
        &self.sh_rest[i * n..(i + 1) * n]
    }

    /// Centre of Gaussian `i`, world frame, scene units.
    pub fn center(&self, i: usize) -> Point3<f64> {
        Point3::from(self.positions[i].map(f64::from))
    }

    /// True if Gaussian `i` is set aside.
    pub fn is_set_aside(&self, i: usize) -> bool {
        self.set_aside.get(i).copied().unwrap_or(false)
    }

    /// The connected surface on which Gaussian `i` lies; the same for all of a splat.
    pub fn surface_of(&self, i: usize) -> u32 {
        self.surface.get(i).copied().unwrap_or(0)
    }

    /// Opacity of Gaussian `i`, 0 to 1; 0 if it is set aside.
    pub fn opacity(&self, i: usize) -> f64 {
        if self.is_set_aside(i) {
            return 0.0;
        }
        1.0 / (1.0 + (-f64::from(self.opacity_logits[i])).exp())
    }

    /// Standard deviations of Gaussian `i` along its own axes, scene units.
    pub fn scale(&self, i: usize) -> Vector3<f64> {
        Vector3::from(self.log_scales[i].map(|s| f64::from(s).exp()))
    }

    /// Rotation of Gaussian `i` from its own axes to the world's; the identity if the stored quaternion is zero.
    pub fn rotation(&self, i: usize) -> UnitQuaternion<f64> {
        let [w, x, y, z] = self.rotations[i].map(f64::from);
        UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-12).unwrap_or_else(UnitQuaternion::identity)
    }

    /// Covariance of Gaussian `i` in the world frame: R diag(s)^2 R^T, scene units squared.
    pub fn covariance(&self, i: usize) -> Matrix3<f64> {
        let axes = self.rotation(i).to_rotation_matrix() * Matrix3::from_diagonal(&self.scale(i));
        axes * axes.transpose()
    }

    /// Standard deviation of Gaussian `i` along `direction`, a unit vector in the world frame; scene units.
    pub fn deviation(&self, i: usize, direction: &Vector3<f64>) -> f64 {
        self.rotation(i).inverse_transform_vector(direction).component_mul(&self.scale(i)).norm()
    }

    /// True if every value of Gaussian `i` is valid: finite centre, size, rotation and colour. An infinite opacity
    /// logit is allowed (exporters write it for opacity 0 and 1), a NaN is not.
    pub fn is_usable(&self, i: usize) -> bool {
        let finite = |values: &[f32]| values.iter().all(|value| value.is_finite());
        finite(&self.positions[i])
            && self.log_scales[i].iter().all(|s| s.is_finite() && *s < Self::LOG_SCALE_LIMIT)
            && finite(&self.rotations[i])
            && !self.opacity_logits[i].is_nan()
            && finite(&self.sh_dc[i])
            && finite(self.sh_rest_of(i))
    }

    /// Appends the Gaussians of `other`, whose spherical harmonics have the same degree. Properties that only one of
    /// the two has are dropped.
    ///
    /// # Panics
    /// If the degrees differ and neither cloud is empty.
    pub fn append(&mut self, other: &Self) {
        if self.is_empty() {
            self.clone_from(other);
            return;
        }
        if other.is_empty() {
            return;
        }
        assert_eq!(self.sh_degree, other.sh_degree, "clouds of one degree");
        if !self.set_aside.is_empty() || !other.set_aside.is_empty() {
            self.set_aside.resize(self.len(), false);
            self.set_aside.extend((0..other.len()).map(|i| other.is_set_aside(i)));
        }
        if self.surface.is_empty() != other.surface.is_empty() {
            self.surface.clear();
        } else {
            self.surface.extend(&other.surface);
        }
        self.positions.extend(&other.positions);
        self.log_scales.extend(&other.log_scales);
        self.rotations.extend(&other.rotations);
        self.opacity_logits.extend(&other.opacity_logits);
        self.sh_dc.extend(&other.sh_dc);
        self.sh_rest.extend(&other.sh_rest);
        self.extra.retain_mut(|extra| {
            let theirs = other.extra.iter().find(|theirs| theirs.name == extra.name);
            theirs.map(|theirs| extra.values.extend(&theirs.values)).is_some()
        });
    }

    /// Appends copies of the Gaussians `sources`.
    ///
    /// # Panics
    /// If a source index is out of range.
    pub fn repeat(&mut self, sources: &[u32]) {
        fn repeat_rows<T: Copy>(values: &mut Vec<T>, width: usize, sources: &[u32]) {
            for &i in sources {
                values.extend_from_within(i as usize * width..(i as usize + 1) * width);
            }
        }
        let rest = 3 * self.sh_rest_per_channel();
        if !self.set_aside.is_empty() {
            repeat_rows(&mut self.set_aside, 1, sources);
        }
        if !self.surface.is_empty() {
            repeat_rows(&mut self.surface, 1, sources);
        }
        repeat_rows(&mut self.positions, 1, sources);
        repeat_rows(&mut self.log_scales, 1, sources);
        repeat_rows(&mut self.rotations, 1, sources);
        repeat_rows(&mut self.opacity_logits, 1, sources);
        repeat_rows(&mut self.sh_dc, 1, sources);
        repeat_rows(&mut self.sh_rest, rest, sources);
        for extra in &mut self.extra {
            repeat_rows(&mut extra.values, 1, sources);
        }
    }

    /// Keeps the Gaussians whose entry in `kept` is true, in their order.
    ///
    /// # Panics
    /// If `kept` does not have one entry per Gaussian.
    pub fn retain(&mut self, kept: &[bool]) {
        assert_eq!(kept.len(), self.len(), "one entry per Gaussian");
        let rest = 3 * self.sh_rest_per_channel();
        retain_rows(&mut self.positions, 1, kept);
        retain_rows(&mut self.log_scales, 1, kept);
        retain_rows(&mut self.rotations, 1, kept);
        retain_rows(&mut self.opacity_logits, 1, kept);
        retain_rows(&mut self.sh_dc, 1, kept);
        retain_rows(&mut self.sh_rest, rest, kept);
        if !self.set_aside.is_empty() {
            retain_rows(&mut self.set_aside, 1, kept);
        }
        if !self.surface.is_empty() {
            retain_rows(&mut self.surface, 1, kept);
        }
        for extra in &mut self.extra {
            retain_rows(&mut extra.values, 1, kept);
        }
    }
}

/// Keeps the rows of `width` values whose entry in `kept` is true.
fn retain_rows<T>(values: &mut Vec<T>, width: usize, kept: &[bool]) {
    let mut entries = kept.iter().flat_map(|kept| std::iter::repeat_n(*kept, width));
    values.retain(|_| entries.next().unwrap_or(false));
}
