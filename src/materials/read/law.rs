//! Reads a constitutive law: its name in `law`, its parameters in `law_parameters` as `name=number` separated by `;`.
//! The laws and the names of their parameters are defined by [`Law`] itself, through serde.

use std::ops::RangeInclusive;

use serde::Deserialize;
use serde::de::value::MapDeserializer;

use super::word::{Cell, Mismatch, alternatives};
use super::{LibraryError, Row, within};
use crate::materials::Law;

/// The law that a row gives, with all its parameters and no others.
pub fn law(row: &Row) -> Result<Law, LibraryError> {
    let mut given: Vec<(&str, f64)> = Vec::new();
    for pair in row.text("law_parameters").split(';').map(str::trim).filter(|pair| !pair.is_empty()) {
        let parsed = pair.split_once('=').and_then(|(name, value)| Some((name.trim(), value.trim().parse().ok()?)));
        given.push(parsed.ok_or_else(|| row.bad("law_parameters", "must be name=number pairs separated by ;"))?);
    }
    let name = [("law", Cell::Word(row.text("law")))];
    let parameters = given.iter().map(|(name, value)| (*name, Cell::Number(*value)));
    let law = Law::deserialize(MapDeserializer::new(name.into_iter().chain(parameters))).map_err(|mismatch| {
        let (column, problem) = match mismatch {
            Mismatch::Word(known) => ("law", format!("is not a law; write {}", alternatives(known))),
            Mismatch::Missing(parameter) => ("law_parameters", format!("lacks `{parameter}` for this law")),
            Mismatch::Other(problem) => ("law_parameters", format!("does not suit this law: {problem}")),
        };
        row.bad(column, problem)
    })?;
    let domains = domains(law);
    if let Some((name, _)) = given.iter().find(|(name, _)| !domains.iter().any(|(known, ..)| known == name)) {
        return Err(row.bad("law_parameters", format!("gives `{name}`, which the law does not have")));
    }
    match domains.into_iter().find(|(_, value, domain)| !domain.contains(value)) {
        Some((name, _, domain)) => Err(row.bad("law_parameters", format!("`{name}` must be {}", within(&domain)))),
        None => Ok(law),
    }
}

/// The parameters by name, each with its value and the range of valid values, in SI units.
fn domains(law: Law) -> Vec<(&'static str, f64, RangeInclusive<f64>)> {
    macro_rules! each {
        ($($parameter:ident: $domain:expr),*) => { vec![$((stringify!($parameter), $parameter, $domain)),*] };
    }
    match law {
        Law::Elastic | Law::Fluid => vec![],
        Law::VonMises { yield_stress_pa } => each!(yield_stress_pa: 1.0..=1e12),
        Law::DruckerPrager { friction_angle_rad, cohesion_pa } => {
            each!(friction_angle_rad: 0.0..=std::f64::consts::FRAC_PI_2, cohesion_pa: 0.0..=1e9)
        }
        Law::Foam { yield_stress_pa, viscosity_pa_s } => each!(yield_stress_pa: 0.1..=1e9, viscosity_pa_s: 0.0..=1e9),
        Law::Snow { theta_c, theta_s, hardening } => {
            each!(theta_c: 1e-4..=1.0, theta_s: 1e-5..=1.0, hardening: 0.0..=100.0)
        }
        Law::Plasticine { yield_stress_pa, softening } => each!(yield_stress_pa: 0.1..=1e9, softening: 0.0..=1.0),
    }
}
