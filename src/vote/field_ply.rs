//! The material field as extra vertex properties of a PLY.

use std::collections::BTreeMap;

use super::{FieldLabel, MaterialField};
use crate::gaussians::ExtraProperty;
use crate::materials::{Material, MaterialLibrary};
use crate::units::Estimate;

/// The largest part id that a column of 32-bit floats holds exactly.
const LARGEST_ID: usize = 1 << 24;

/// Names of the materials that the labels use, sorted: `material_id` is the index into this list.
pub fn material_names(labels: &[FieldLabel]) -> Vec<&str> {
    let mut names: Vec<&str> = labels.iter().map(|label| label.material.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// The library's rows of the materials that the labels use, in the order of `material_id`. Written as `materials.json`.
pub fn materials<'a>(labels: &[FieldLabel], library: &'a MaterialLibrary) -> Vec<&'a Material> {
    material_names(labels).into_iter().filter_map(|name| library.get(name)).collect()
}

/// The columns of `field.ply`, one value per Gaussian: `part_label` (the part id), `material_id`, `density` (kg/m3), `E` (Pa), `nu`,
/// `yield_stress` (Pa), `friction` (on a rubber pad), `hardness` (Shore, on the scale of the label's material; NaN if
/// it has none), `conf` (0 to 1), `votes`, `views` (0: label taken from the nearest seen Gaussians).
pub fn columns(field: &MaterialField) -> Vec<ExtraProperty> {
    let names = material_names(&field.labels);
    let of_label = |name: &str, value: &dyn Fn(&FieldLabel) -> f64| {
        let by_label: Vec<f32> = field.labels.iter().map(|label| value(label) as f32).collect();
        property(name, field.part_label.iter().map(|&label| by_label[label as usize]))
    };
    let mid = |name, estimate: fn(&FieldLabel) -> Estimate| of_label(name, &|label| estimate(label).mid);
    vec![
        of_label("part_label", &|label| f64::from(label.id)),
        of_label("material_id", &|label| names.iter().position(|name| *name == label.material).unwrap_or(0) as f64),
        mid("density", |label| label.density_kg_m3),
        mid("E", |label| label.youngs_modulus_pa),
        mid("nu", |label| label.poisson_ratio),
        mid("yield_stress", |label| label.yield_strength_pa),
        mid("friction", |label| label.friction_rubber),
        of_label("hardness", &|label| label.hardness.map_or(f64::NAN, |hardness| hardness.range.mid())),
        property("conf", field.confidence.iter().copied()),
        property("votes", field.votes.iter().copied()),
        property("views", field.views.iter().map(|&views| f32::from(views))),
    ]
}

fn property(name: &str, values: impl Iterator<Item = f32>) -> ExtraProperty {
    ExtraProperty { name: name.to_owned(), values: values.collect() }
}

/// The field that [`columns`] wrote for `labels`; `None` if a column is missing or has invalid values.
pub fn read(columns: &[ExtraProperty], labels: Vec<FieldLabel>) -> Option<MaterialField> {
    let column = |name: &str| columns.iter().find(|column| column.name == name).map(|column| &column.values);
    let whole = |value: &f32, below: usize| {
        (value.fract() == 0.0 && *value >= 0.0 && (*value as usize) < below).then_some(*value as u32)
    };
    let index_of: BTreeMap<u32, u32> = labels.iter().map(|label| label.id).zip(0..).collect();
    let label_of = |id: &f32| index_of.get(&whole(id, LARGEST_ID + 1)?).copied();
    let part_label: Option<Vec<u32>> = column("part_label")?.iter().map(label_of).collect();
    let views = column("views")?.iter().map(|value| whole(value, 1 << 16).map(|views| views as u16));
    Some(MaterialField {
        part_label: part_label?,
        views: views.collect::<Option<_>>()?,
        confidence: column("conf")?.clone(),
        votes: column("votes")?.clone(),
        warnings: Vec::new(),
        notes: Vec::new(),
        labels,
    })
}
