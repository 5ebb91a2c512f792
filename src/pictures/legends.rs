//! The legends of parts, materials and confidence.

use super::palette;
use super::panels::{Entry, Key};
use crate::vote::{FieldLabel, MaterialField, field_ply};
use crate::words::part_name::part_name;

/// The parts with their numbers.
pub fn parts(field: &MaterialField) -> Vec<Entry> {
    let entry = |label: &FieldLabel| Entry {
        text: part_name(&label.caption, &label.material),
        key: Key::Number(palette::bytes(palette::part(label.id)), label.id),
    };
    field.labels.iter().map(entry).collect()
}

/// The materials.
pub fn materials(field: &MaterialField) -> Vec<Entry> {
    let entry = |(n, name): (u32, &str)| Entry {
        text: name.to_owned(),
        key: Key::Square(palette::bytes(palette::material(n))),
    };
    (0..).zip(field_ply::material_names(&field.labels)).map(entry).collect()
}

/// Three values of the confidence.
pub fn confidence() -> Vec<Entry> {
    let entry = |value: f32, text: &str| Entry {
        text: format!("{value} {text}"),
        key: Key::Square(palette::bytes(palette::scale(value))),
    };
    vec![entry(0.0, "no votes"), entry(0.5, "half of the votes"), entry(1.0, "all votes agree")]
}
