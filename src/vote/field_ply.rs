//! The material field as extra vertex properties of a PLY.

use std::collections::BTreeMap;

use super::{FieldPart, MaterialField};
use crate::gaussians::ExtraProperty;
use crate::materials::{Material, MaterialLibrary};
use crate::units::Estimate;

/// The largest part id that a column of 32-bit floats holds exactly.
const LARGEST_ID: usize = 1 << 24;

/// Names of the materials that the parts use, sorted: `material_id` is the index into this list.
pub fn material_names(parts: &[FieldPart]) -> Vec<&str> {
    let mut names: Vec<&str> = parts.iter().map(|part| part.material.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// The library's rows of the materials that the parts use, in the order of `material_id`. Written as `materials.json`.
pub fn materials<'a>(parts: &[FieldPart], library: &'a MaterialLibrary) -> Vec<&'a Material> {
    material_names(parts).into_iter().filter_map(|name| library.get(name)).collect()
}

/// The columns of `field.ply`, one value per Gaussian: `part_label` (the part id), `material_id`, `density` (kg/m3), `E` (Pa), `nu`,
/// `yield_stress` (Pa), `friction` (on a rubber pad), `hardness` (Shore, on the scale of the part's material; NaN if
/// it has none), `conf` (0 to 1), `votes`, `views` (0: part taken from the nearest seen Gaussians).
pub fn columns(field: &MaterialField) -> Vec<ExtraProperty> {
    let names = material_names(&field.parts);
    let of_part = |name: &str, value: &dyn Fn(&FieldPart) -> f64| {
        let by_part: Vec<f32> = field.parts.iter().map(|part| value(part) as f32).collect();
        property(name, field.part_index.iter().map(|&part| by_part[part as usize]))
    };
    let mid = |name, estimate: fn(&FieldPart) -> Estimate| of_part(name, &|part| estimate(part).mid);
    vec![
        of_part("part_label", &|part| f64::from(part.id)),
        of_part("material_id", &|part| names.iter().position(|name| *name == part.material).unwrap_or(0) as f64),
        mid("density", |part| part.density_kg_m3),
        mid("E", |part| part.youngs_modulus_pa),
        mid("nu", |part| part.poisson_ratio),
        mid("yield_stress", |part| part.yield_strength_pa),
        mid("friction", |part| part.friction_rubber),
        of_part("hardness", &|part| part.hardness.map_or(f64::NAN, |hardness| hardness.range.mid())),
        property("conf", field.confidence.iter().copied()),
        property("votes", field.votes.iter().copied()),
        property("views", field.views.iter().map(|&views| f32::from(views))),
    ]
}

fn property(name: &str, values: impl Iterator<Item = f32>) -> ExtraProperty {
    ExtraProperty { name: name.to_owned(), values: values.collect() }
}

/// The field that [`columns`] wrote for `parts`; `None` if a column is missing or has invalid values.
pub fn read(columns: &[ExtraProperty], parts: Vec<FieldPart>) -> Option<MaterialField> {
    let column = |name: &str| columns.iter().find(|column| column.name == name).map(|column| &column.values);
    let whole = |value: &f32, below: usize| {
        (value.fract() == 0.0 && *value >= 0.0 && (*value as usize) < below).then_some(*value as u32)
    };
    let index_of: BTreeMap<u32, u32> = parts.iter().map(|part| part.id).zip(0..).collect();
    let index_of_id = |id: &f32| index_of.get(&whole(id, LARGEST_ID + 1)?).copied();
    let part_index: Option<Vec<u32>> = column("part_label")?.iter().map(index_of_id).collect();
    let views = column("views")?.iter().map(|value| whole(value, 1 << 16).map(|views| views as u16));
    Some(MaterialField {
        part_index: part_index?,
        views: views.collect::<Option<_>>()?,
        confidence: column("conf")?.clone(),
        votes: column("votes")?.clone(),
        warnings: Vec::new(),
        notes: Vec::new(),
        parts,
    })
}
