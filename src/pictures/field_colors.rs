//! The material field as colours of the Gaussians.

use super::palette;
use crate::scene::gaussians::{Gaussians, SH_C0};
use crate::vote::field_ply::material_names;
use crate::vote::{FieldLabel, MaterialField};

/// One colour per Gaussian, that of its part.
pub fn part_colors(field: &MaterialField) -> Vec<[f32; 3]> {
    field.part_label.iter().map(|&label| palette::part(label)).collect()
}

/// One colour per Gaussian, that of its material: the palette's colour at its `material_id`.
pub fn material_colors(field: &MaterialField) -> Vec<[f32; 3]> {
    let names = material_names(&field.labels);
    let place = |label: &FieldLabel| names.binary_search(&label.material.as_str()).expect("every material is listed");
    let of_label: Vec<_> = field.labels.iter().map(|label| palette::material(place(label) as u32)).collect();
    field.part_label.iter().map(|&label| of_label[label as usize]).collect()
}

/// One colour per Gaussian for the confidence in its label, from dark blue (never seen) through green to yellow (all
/// votes agree).
pub fn confidence_colors(field: &MaterialField) -> Vec<[f32; 3]> {
    field.confidence.iter().map(|confidence| palette::scale(*confidence)).collect()
}

/// One colour per Gaussian for the Young's modulus of its part, on the logarithmic scale of [`stiffness_range`].
pub fn stiffness_colors(field: &MaterialField) -> Vec<[f32; 3]> {
    let [low, high] = stiffness_range(field);
    let of_label =
        |label: &FieldLabel| palette::scale(((label.youngs_modulus_pa.mid / low).ln() / (high / low).ln()) as f32);
    let of_label: Vec<_> = field.labels.iter().map(of_label).collect();
    field.part_label.iter().map(|&label| of_label[label as usize]).collect()
}

/// Powers of ten between which the Young's moduli of all parts lie, in Pa.
pub fn stiffness_range(field: &MaterialField) -> [f64; 2] {
    let moduli = || field.labels.iter().map(|label| label.youngs_modulus_pa.mid.log10());
    let low = moduli().fold(f64::INFINITY, f64::min).floor();
    let high = moduli().fold(f64::NEG_INFINITY, f64::max).ceil().max(low + 1.0);
    [low, high].map(|power| 10f64.powf(power))
}

/// The cloud in these colours (sRGB, 0 to 1), the same from every side.
pub fn recolored(gaussians: &Gaussians, colors: &[[f32; 3]]) -> Gaussians {
    let sh_dc = colors.iter().map(|color| color.map(|c| (c - 0.5) / SH_C0)).collect();
    Gaussians { sh_dc, sh_degree: 0, sh_rest: Vec::new(), ..gaussians.clone() }
}
