//! A property of the materials as colours of the Gaussians, with a legend that gives its values.

use std::collections::BTreeSet;

use super::palette;
use super::panels::{Entry, Key};
use crate::units::ShoreScale;
use crate::vote::{FieldPart, MaterialField};

/// A property that a picture can show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Property {
    Hardness,
    YoungsModulus,
    Density,
    Friction,
}

/// How values become places on the scale of colours, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scale {
    /// Between two powers of ten.
    Logarithmic([f64; 2]),
    /// From zero to this value.
    Linear(f64),
    /// Shore A on the lower half, Shore D, for harder materials, on the upper one.
    Shore,
}

impl Property {
    /// The title, with the unit of the values in the legend if all have the same.
    pub fn title(self) -> &'static str {
        match self {
            Self::Hardness => "Hardness",
            Self::YoungsModulus => "Young's modulus",
            Self::Density => "Density, kg/m³",
            Self::Friction => "Friction on rubber",
        }
    }

    /// One colour per Gaussian, from dark purple, low, through green to yellow, high; grey if its part has no such value.
    pub fn colors(self, field: &MaterialField) -> Vec<[f32; 3]> {
        let scale = self.scale(field);
        let of_part: Vec<[f32; 3]> = field.parts.iter().map(|part| self.color(part, scale)).collect();
        field.part_index.iter().map(|&part| of_part[part as usize]).collect()
    }

    /// The scale of colours, and below it each value with a material that has it, once, the highest first.
    pub fn legend(self, field: &MaterialField) -> Vec<Entry> {
        let scale = self.scale(field);
        let mut parts: Vec<&FieldPart> = field.parts.iter().collect();
        let place = |part: &FieldPart| self.place(part, scale).unwrap_or(-1.0);
        parts.sort_by(|a, b| place(b).total_cmp(&place(a)).then(a.material.cmp(&b.material)));
        let entry = |part: &FieldPart| Entry {
            text: format!("{} {}", self.text(part), part.material),
            key: Key::Square(palette::bytes(self.color(part, scale))),
        };
        let mut entries: Vec<Entry> = parts.into_iter().map(entry).collect();
        let mut known = BTreeSet::new();
        entries.retain(|entry| known.insert(entry.text.clone()));
        entries.insert(0, Entry { text: self.ends(scale), key: Key::Scale });
        entries
    }

    /// `None` for a hardness that the material does not have.
    fn value(self, part: &FieldPart) -> Option<f64> {
        match self {
            Self::Hardness => part.hardness.map(|hardness| hardness.range.mid()),
            Self::YoungsModulus => Some(part.youngs_modulus_pa.mid),
            Self::Density => Some(part.density_kg_m3.mid),
            Self::Friction => Some(part.friction_rubber.mid),
        }
    }

    fn scale(self, field: &MaterialField) -> Scale {
        let values = || field.parts.iter().filter_map(|part| self.value(part));
        match self {
            Self::Hardness => Scale::Shore,
            Self::YoungsModulus | Self::Density => {
                let powers = || values().map(f64::log10);
                let low = powers().fold(f64::INFINITY, f64::min).floor();
                let high = powers().fold(f64::NEG_INFINITY, f64::max).ceil().max(low + 1.0);
                Scale::Logarithmic([low, high].map(|power| 10f64.powf(power)))
            }
            // Rounded up to a half, so that the scale ends at a round number.
            Self::Friction => Scale::Linear((2.0 * values().fold(0.5, f64::max)).ceil() / 2.0),
        }
    }

    /// 0 to 1; `None` if the part has no such value.
    fn place(self, part: &FieldPart, scale: Scale) -> Option<f32> {
        let value = self.value(part)?;
        let place = match scale {
            Scale::Logarithmic([low, high]) => (value / low).ln() / (high / low).ln(),
            Scale::Linear(high) => value / high,
            Scale::Shore => {
                let half = 0.5 * value / 100.0;
                if part.hardness?.scale == ShoreScale::D { 0.5 + half } else { half }
            }
        };
        Some(place as f32)
    }

    fn color(self, part: &FieldPart, scale: Scale) -> [f32; 3] {
        self.place(part, scale).map_or(palette::NOTHING, palette::scale)
    }

    fn text(self, part: &FieldPart) -> String {
        match (self, part.hardness) {
            (Self::Hardness, None) => "no hardness:".to_owned(),
            (Self::Hardness, Some(hardness)) => {
                format!("Shore {} {:.0}", if hardness.scale == ShoreScale::D { "D" } else { "A" }, hardness.range.mid())
            }
            (Self::YoungsModulus, _) => pressure(part.youngs_modulus_pa.mid),
            (Self::Density, _) => format!("{:.0}", part.density_kg_m3.mid),
            (Self::Friction, _) => format!("{:.2}", part.friction_rubber.mid),
        }
    }

    /// The two ends of the scale.
    fn ends(self, scale: Scale) -> String {
        match (self, scale) {
            (_, Scale::Shore) => "Shore A 0 to 100, then D 0 to 100".to_owned(),
            (_, Scale::Linear(high)) => format!("0 to {high}"),
            (Self::YoungsModulus, Scale::Logarithmic([low, high])) => {
                format!("{} to {}", pressure(low), pressure(high))
            }
            (_, Scale::Logarithmic([low, high])) => format!("{low} to {high}"),
        }
    }
}

/// A pressure in GPa, MPa or kPa, with a decimal only below ten.
fn pressure(pascals: f64) -> String {
    // A power of ten may have been rounded down.
    let (value, unit) = match pascals * (1.0 + f64::EPSILON) {
        p if p >= 1e9 => (p / 1e9, "GPa"),
        p if p >= 1e6 => (p / 1e6, "MPa"),
        p => (p / 1e3, "kPa"),
    };
    let is_round = (value - value.round()).abs() < 1e-6;
    if value < 10.0 && !is_round { format!("{value:.1} {unit}") } else { format!("{value:.0} {unit}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::Law;
    use crate::query::Form;
    use crate::units::{Estimate, Range, ShoreHardness};

    fn part(material: &str, shore_d: f64) -> FieldPart {
        let range = Range::exactly(shore_d);
        FieldPart {
            id: 0,
            caption: String::new(),
            material: material.to_owned(),
            family: String::new(),
            density_kg_m3: Estimate::exactly(700.0),
            youngs_modulus_pa: Estimate::exactly(1e10),
            poisson_ratio: Estimate::exactly(0.3),
            yield_strength_pa: Estimate::exactly(4e7),
            hardness: Some(ShoreHardness { scale: ShoreScale::D, range }),
            friction_rubber: Estimate::exactly(0.5),
            restitution: None,
            form: Form::Solid,
            inside: None,
            bulk_reason: None,
            law: Law::Elastic,
            corrected: None,
        }
    }

    /// The beech lies between the two parts of oak, whose values are written alike.
    #[test]
    fn a_legend_has_each_line_once() {
        let field = MaterialField {
            parts: vec![part("oak", 70.2), part("beech", 70.1), part("oak", 70.0)],
            part_index: Vec::new(),
            confidence: Vec::new(),
            votes: Vec::new(),
            views: Vec::new(),
            warnings: Vec::new(),
            notes: Vec::new(),
        };
        let lines: Vec<String> = Property::Hardness.legend(&field).into_iter().map(|entry| entry.text).collect();
        assert_eq!(lines[1..], ["Shore D 70 oak", "Shore D 70 beech"]);
    }
}
