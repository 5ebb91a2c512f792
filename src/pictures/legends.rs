//! The legends of parts, materials and confidence.

use super::palette;
use super::panels::{Entry, Key};
use crate::vote::{FieldPart, MaterialField, field_ply};
use crate::words::part_name::part_name;

/// The parts with their numbers.
pub fn parts(field: &MaterialField) -> Vec<Entry> {
    let entry = |part: &FieldPart| Entry {
        text: part_name(&part.caption, &part.material),
        key: Key::Number(palette::bytes(palette::part(part.id)), part.id),
    };
    field.parts.iter().map(entry).collect()
}

/// The materials.
pub fn materials(field: &MaterialField) -> Vec<Entry> {
    let entry = |(n, name): (u32, &str)| Entry {
        text: name.to_owned(),
        key: Key::Square(palette::bytes(palette::material(n))),
    };
    (0..).zip(field_ply::material_names(&field.parts)).map(entry).collect()
}

/// Three values of the confidence.
pub fn confidence() -> Vec<Entry> {
    let entry = |value: f32, text: &str| Entry {
        text: format!("{value} {text}"),
        key: Key::Square(palette::bytes(palette::scale(value))),
    };
    vec![entry(0.0, "no votes"), entry(0.5, "half of the votes"), entry(1.0, "all votes agree")]
}
