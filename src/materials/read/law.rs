//! Reading a constitutive law: its name in `law`, its parameters in `law_parameters` as `name=number` between `;`.

use std::ops::RangeInclusive;

use super::{LibraryError, Row, within};
use crate::materials::Law;

/// The law that a row gives, with all its parameters and no others.
pub fn law(row: &Row) -> Result<Law, LibraryError> {
    let mut given: Vec<(&str, f64)> = Vec::new();
    for pair in row.text("law_parameters").split(';').map(str::trim).filter(|pair| !pair.is_empty()) {
        let parsed = pair.split_once('=').and_then(|(name, value)| Some((name.trim(), value.trim().parse().ok()?)));
        given.push(parsed.ok_or_else(|| row.bad("law_parameters", "must be name=number pairs between ;"))?);
    }
    let take = |name: &str, bounds: RangeInclusive<f64>| {
        let value = given.iter().find(|(given, _)| *given == name).map(|(_, value)| *value);
        value
            .filter(|value| bounds.contains(value))
            .ok_or_else(|| row.bad("law_parameters", format!("lacks `{name}` for this law, {}", within(&bounds))))
    };
    let law = match row.text("law") {
        "elastic" => Law::Elastic,
        "von_mises" => Law::VonMises { yield_stress_pa: take("yield_stress_pa", 1.0..=1e12)? },
        "drucker_prager" => Law::DruckerPrager {
            friction_angle_rad: take("friction_angle_rad", 0.0..=std::f64::consts::FRAC_PI_2)?,
            cohesion_pa: take("cohesion_pa", 0.0..=1e9)?,
        },
        "foam" => Law::Foam {
            yield_stress_pa: take("yield_stress_pa", 0.1..=1e9)?,
            viscosity_pa_s: take("viscosity_pa_s", 0.0..=1e9)?,
        },
        "snow" => Law::Snow {
            theta_c: take("theta_c", 1e-4..=1.0)?,
            theta_s: take("theta_s", 1e-5..=1.0)?,
            hardening: take("hardening", 0.0..=100.0)?,
        },
        "plasticine" => Law::Plasticine {
            yield_stress_pa: take("yield_stress_pa", 0.1..=1e9)?,
            softening: take("softening", 0.0..=1.0)?,
        },
        "fluid" => Law::Fluid,
        _ => {
            let problem = "is not a law; write elastic, von_mises, drucker_prager, foam, snow, plasticine or fluid";
            return Err(row.bad("law", problem));
        }
    };
    let known = law.parameters();
    match given.iter().find(|(name, _)| !known.iter().any(|(parameter, _)| parameter == name)) {
        Some((name, _)) => Err(row.bad("law_parameters", format!("gives `{name}`, which the law does not have"))),
        None => Ok(law),
    }
}
