//! The element type for ply-rs-bw's parser: one row in ASCII. Parsing the header needs the type too.

use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

/// The values of one row in the order of the declaration.
pub(super) struct Row {
    pub values: Vec<f32>,
}

impl PropertyAccess for Row {
    fn new() -> Self {
        Self { values: Vec::new() }
    }

    fn set_property(&mut self, _name: &str, property: Property) -> PropertyAccessResult {
        self.values.push(match property {
            Property::Char(v) => v.into(),
            Property::UChar(v) => v.into(),
            Property::Short(v) => v.into(),
            Property::UShort(v) => v.into(),
            Property::Int(v) => v as f32,
            Property::UInt(v) => v as f32,
            Property::Float(v) => v,
            Property::Double(v) => v as f32,
            _ => unreachable!("list properties were refused with the header"),
        });
        PropertyAccessResult::Set
    }
}
