//! Splats that are not plain 3DGS but can be turned into it: flat Gaussians, and those with a 3D smoothing filter.

use super::Rows;
use crate::gaussians::Gaussians;

/// Mip-Splatting's property: the standard deviation of its 3D filter, scene units (Yu et al. 2024, eq. 8).
const SMOOTHING_FILTER: &str = "filter_3D";

/// The thickness of a flat Gaussian as a fraction of its smaller extent: thin compared with any object, thick enough
/// for its covariance to be inverted.
const FLAT_SHARE: f32 = 0.01;

/// The comment with which Brush marks splats that are to be drawn antialiased.
pub(super) const ANTIALIASED_COMMENT: &str = "SplatRenderMode: mip";

/// Turns 2DGS and Mip-Splatting Gaussians into plain ones, in place, and returns notes about what was found. `flat`:
/// the file has no third scale.
pub(super) fn recognise(rows: &mut Rows, flat: bool, comments: &[String]) -> Vec<String> {
    let gaussians = &mut rows.gaussians;
    let mut notes = Vec::new();
    if flat {
        for [a, b, thickness] in &mut gaussians.log_scales {
            *thickness = a.min(*b) + FLAT_SHARE.ln();
        }
        notes.push(format!(
            "2DGS: there is no scale_2; the thickness of the flat Gaussians is taken as {FLAT_SHARE} of their width"
        ));
    }
    if let Some(at) = gaussians.extra.iter().position(|extra| extra.name == SMOOTHING_FILTER) {
        let filter = gaussians.extra.remove(at).values;
        fuse(gaussians, &filter);
        rows.surely_usable = false;
        gaussians.antialiased = true;
        notes.push(format!("Mip-Splatting: {SMOOTHING_FILTER} is merged into scales and opacities"));
    } else if comments.iter().any(|comment| is_mip_comment(comment)) {
        gaussians.antialiased = true;
        notes.push("trained with an antialiased rasteriser".to_owned());
    }
    notes
}

fn is_mip_comment(comment: &str) -> bool {
    let comment = comment.to_lowercase();
    let words: Vec<&str> = comment.split(|c: char| !c.is_alphanumeric()).collect();
    words.contains(&"splatrendermode") && words.contains(&"mip")
}

/// Widens each Gaussian by its filter and reduces its opacity by what it gains in size (Yu et al. 2024, eq. 9): s' =
/// sqrt(s^2 + f^2) and opacity' = opacity sqrt(prod s^2 / prod s'^2).
fn fuse(gaussians: &mut Gaussians, filter: &[f32]) {
    for (i, filter) in filter.iter().enumerate() {
        let scales = gaussians.scale(i);
        let widened = scales.map(|s| s.hypot(f64::from(*filter)));
        let opacity = gaussians.opacity(i) * scales.component_div(&widened).product();
        if !(opacity.is_finite() && widened.iter().all(|s| s.is_finite())) {
            // Will be dropped and counted with the unusable Gaussians.
            gaussians.opacity_logits[i] = f32::NAN;
            continue;
        }
        gaussians.log_scales[i] = std::array::from_fn(|axis| widened[axis].ln() as f32);
        gaussians.opacity_logits[i] = (opacity / (1.0 - opacity)).ln() as f32;
    }
}
