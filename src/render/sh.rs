//! View-dependent colour: real spherical harmonics up to degree 3, in the basis and sign convention of 3DGS
//! (Kerbl et al. 2023; Sloan, *Efficient Spherical Harmonic Evaluation*, JCGT 2013).

use crate::gaussians::{Gaussians, SH_C0};

/// `sqrt(3 / 4 pi)`.
const SH_C1: f32 = 0.488_602_51;
const SH_C2: [f32; 5] = [1.092_548_4, -1.092_548_4, 0.315_391_57, -1.092_548_4, 0.546_274_2];
const SH_C3: [f32; 7] =
    [-0.590_043_6, 2.890_611_4, -0.457_045_8, 0.373_176_33, -0.457_045_8, 1.445_305_7, -0.590_043_6];

/// Colour of Gaussian `i` seen along `direction` (unit vector from the camera to the Gaussian, world frame): linear
/// combination of the basis plus one half, as trained by 3DGS, with negative values clamped to zero. RGB as in the
/// photos, 0 to about 1.
pub fn color(gaussians: &Gaussians, i: usize, direction: [f32; 3]) -> [f32; 3] {
    let basis = basis(gaussians.sh_degree, direction);
    let n = gaussians.sh_rest_per_channel();
    let rest = gaussians.sh_rest_of(i);
    std::array::from_fn(|channel| {
        let detail: f32 = rest[channel * n..(channel + 1) * n].iter().zip(&basis).map(|(c, b)| c * b).sum();
        (0.5 + SH_C0 * gaussians.sh_dc[i][channel] + detail).max(0.0)
    })
}

/// The basis functions beyond the constant one, in storage order; those above `degree` are zero.
pub fn basis(degree: u8, [x, y, z]: [f32; 3]) -> [f32; 15] {
    let mut b = [0.0; 15];
    if degree >= 1 {
        b[0] = -SH_C1 * y;
        b[1] = SH_C1 * z;
        b[2] = -SH_C1 * x;
    }
    let (xx, yy, zz) = (x * x, y * y, z * z);
    if degree >= 2 {
        b[3] = SH_C2[0] * x * y;
        b[4] = SH_C2[1] * y * z;
        b[5] = SH_C2[2] * (2.0 * zz - xx - yy);
        b[6] = SH_C2[3] * x * z;
        b[7] = SH_C2[4] * (xx - yy);
    }
    if degree >= 3 {
        b[8] = SH_C3[0] * y * (3.0 * xx - yy);
        b[9] = SH_C3[1] * x * y * z;
        b[10] = SH_C3[2] * y * (4.0 * zz - xx - yy);
        b[11] = SH_C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
        b[12] = SH_C3[4] * x * (4.0 * zz - xx - yy);
        b[13] = SH_C3[5] * z * (xx - yy);
        b[14] = SH_C3[6] * x * (xx - 3.0 * yy);
    }
    b
}
