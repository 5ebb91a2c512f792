//! A material's row of the library as fields of an answer, with which the form fills itself in.

use serde::Serialize;

use crate::materials::Material;
use crate::query::answer::PA_PER_MPA;
use crate::units::{Range, ShoreScale};

/// Fields of `prompts/answer.schema.json`, in its units, as far as the library has them.
#[derive(Debug, Serialize)]
pub struct Filled<'a> {
    family: &'a str,
    material: &'a str,
    density_kg_m3: Range,
    youngs_modulus_mpa: Range,
    poisson_ratio: Range,
    yield_strength_mpa: Range,
    shore_scale: &'static str,
    shore_hardness: Option<Range>,
    friction_rubber: Range,
}

impl<'a> From<&'a Material> for Filled<'a> {
    fn from(material: &'a Material) -> Self {
        Self {
            family: &material.family,
            material: &material.name,
            density_kg_m3: material.density_kg_m3,
            youngs_modulus_mpa: in_mpa(material.youngs_modulus_pa),
            poisson_ratio: material.poisson_ratio,
            yield_strength_mpa: in_mpa(material.strength_pa),
            shore_scale: match material.hardness.map(|hardness| hardness.scale) {
                Some(ShoreScale::A) => "A",
                Some(ShoreScale::D) => "D",
                None => "none",
            },
            shore_hardness: material.hardness.map(|hardness| hardness.range),
            friction_rubber: material.friction_rubber,
        }
    }
}

/// In MPa, to twelve digits: a library's 2.1 GPa is 2100 MPa, not 2100.0000000000002.
fn in_mpa(range: Range) -> Range {
    let converted = |pa: f64| format!("{:.11e}", pa / PA_PER_MPA).parse().expect("a number is read back");
    Range::new(converted(range.low), converted(range.high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::MaterialLibrary;
    use crate::query::answer::{self, Unknown};
    use serde_json::{Value, json};

    /// An answer with the library's numbers; every other field of the schema has its first possible value.
    fn answer(material: &Material) -> Value {
        let schema: Value = serde_json::from_str(include_str!("../../../prompts/answer.schema.json")).unwrap();
        let mut answer = serde_json::to_value(Filled::from(material)).unwrap();
        for (name, property) in schema["properties"].as_object().unwrap() {
            let may_be_null = property["type"].as_array().is_some_and(|types| types.contains(&json!("null")));
            let value = match property["type"].as_str() {
                _ if may_be_null => Value::Null,
                Some("boolean") => json!(false),
                Some("number") => json!(0.9),
                Some("array") => json!([]),
                _ if property["enum"].is_array() => property["enum"][0].clone(),
                _ => json!("a word"),
            };
            answer.as_object_mut().unwrap().entry(name).or_insert(value);
        }
        answer
    }

    #[test]
    fn what_is_filled_in_is_read_back_as_the_librarys_without_a_remark() {
        let library = MaterialLibrary::builtin();
        for material in library.materials() {
            let read = answer::read(answer(material), library, Unknown::Refuse).unwrap();
            assert_eq!(read.flags, Vec::<String>::new(), "{}", material.name);
            let near =
                |a: Range, b: Range| (a.low - b.low).abs() <= 1e-9 * b.low && (a.high - b.high).abs() <= 1e-9 * b.high;
            assert!(near(read.density_kg_m3, material.density_kg_m3), "{}", material.name);
            assert!(near(read.youngs_modulus_pa, material.youngs_modulus_pa), "{}", material.name);
            assert!(near(read.yield_strength_pa, material.strength_pa), "{}", material.name);
            assert_eq!(read.hardness, material.hardness, "{}", material.name);
        }
    }
}
