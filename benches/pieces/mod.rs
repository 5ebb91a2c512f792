//! A cloud of a million Gaussians, from a small one.

use gprop::gaussians::Gaussians;
use nalgebra::Vector3;

/// Pieces per Gaussian for a cloud of a million.
pub const PIECES: usize = 35;

/// The same surface from many times as many Gaussians: each is split into pieces, spread over it (R3 sequence, Roberts 2018),
/// that together cover the same area.
pub fn in_pieces(cloud: &Gaussians) -> Gaussians {
    let mut fine = Gaussians { antialiased: cloud.antialiased, ..Gaussians::default() };
    let shrink = 0.5 * (PIECES as f32).ln();
    for i in 0..cloud.len() {
        for piece in 1..=PIECES {
            let spread =
                [0.819_172_5, 0.671_043_6, 0.549_700_5].map(|step: f64| 2.0 * (step * piece as f64).fract() - 1.0);
            let offset = cloud.rotation(i) * cloud.scale(i).component_mul(&Vector3::from(spread));
            fine.positions.push((cloud.center(i) + offset).coords.map(|v| v as f32).into());
            fine.log_scales.push(cloud.log_scales[i].map(|s| s - shrink));
            fine.rotations.push(cloud.rotations[i]);
            fine.opacity_logits.push(cloud.opacity_logits[i]);
            fine.sh_dc.push(cloud.sh_dc[i]);
        }
    }
    fine
}
