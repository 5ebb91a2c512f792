//! The material field as colours of the Gaussians.

use super::palette;
use crate::gaussians::{Gaussians, SH_C0};
use crate::vote::field_ply::material_names;
use crate::vote::{FieldPart, MaterialField};

/// One colour per Gaussian, that of its part.
pub fn part_colors(field: &MaterialField) -> Vec<[f32; 3]> {
    let of_part: Vec<_> = field.parts.iter().map(|part| palette::part(part.id)).collect();
    field.part_index.iter().map(|&part| of_part[part as usize]).collect()
}

/// One colour per Gaussian, that of its material: the palette's colour at its `material_id`.
pub fn material_colors(field: &MaterialField) -> Vec<[f32; 3]> {
    let names = material_names(&field.parts);
    let place = |part: &FieldPart| names.binary_search(&part.material.as_str()).expect("every material is listed");
    let of_part: Vec<_> = field.parts.iter().map(|part| palette::material(place(part) as u32)).collect();
    field.part_index.iter().map(|&part| of_part[part as usize]).collect()
}

/// One colour per Gaussian for the confidence in its part, from dark purple (never seen) through green to yellow (all
/// votes agree).
pub fn confidence_colors(field: &MaterialField) -> Vec<[f32; 3]> {
    field.confidence.iter().map(|confidence| palette::scale(*confidence)).collect()
}

/// The cloud in these colours (sRGB, 0 to 1), the same from every side.
pub fn recolored(gaussians: &Gaussians, colors: &[[f32; 3]]) -> Gaussians {
    let sh_dc = colors.iter().map(|color| color.map(|c| (c - 0.5) / SH_C0)).collect();
    Gaussians { sh_dc, sh_degree: 0, sh_rest: Vec::new(), ..gaussians.clone() }
}
