//! The choice of the part that the fingers press on.

use serde::{Deserialize, Serialize};

use super::GraspError;
use crate::parts::{Part, Parts};
use crate::words::part_fit::PartFit;
use crate::words::part_name::part_name;

/// How the part was chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum PartChoice {
    /// The user named it.
    Named,
    /// The best place to grasp at is on it.
    BestPlace,
    /// Its outer surface comes nearest to the object's centre of mass, so that the weight turns least about the fingers.
    NearestCenterOfMass,
}

/// The part called `name`, or without a name the one whose outer surface is nearest to the object's centre of mass (the
/// lowest id among equals). A name is, in this order, an id, a caption, a short name, or a substring of short names, or
/// else of captions and materials; only one part may match. Case does not matter. The caption of a body is one of its part.
///
/// # Errors
/// If no part, or more than one, matches the name, or no part has a surface.
pub fn choose(parts: &Parts, name: Option<&str>) -> Result<(Part, PartChoice), GraspError> {
    match name {
        Some(name) => Ok((named(parts, name)?, PartChoice::Named)),
        None => {
            let reachable = parts.whole_parts().filter_map(|p| Some((p.surface_to_center_of_mass_m?, p)));
            let (_, nearest) = reachable.min_by(|a, b| a.0.total_cmp(&b.0)).ok_or(GraspError::NoSurface)?;
            Ok((nearest, PartChoice::NearestCenterOfMass))
        }
    }
}

fn fit_of(part: &Part, name: &str) -> Option<PartFit> {
    PartFit::new(part.id, &part.caption, &part.material, name)
}

/// A warning that `part`, found by `name`, may not be the part that was meant: it has another name, and only its caption
/// or material mentions this one.
pub fn doubt(part: &Part, name: &str) -> Option<String> {
    let short = part_name(&part.caption, &part.material);
    (fit_of(part, name) == Some(PartFit::Mentioned)).then(|| {
        format!(
            "no part is called {name:?}; taking part {}, {short:?}, because its caption or material mentions it ({}, {})",
            part.id, part.caption, part.material
        )
    })
}

fn named(parts: &Parts, name: &str) -> Result<Part, GraspError> {
    let all: Vec<Part> = parts.whole_parts().collect();
    let fit = |part: &Part| {
        let mut bodies = parts.parts.iter().filter(|body| body.id == part.id);
        let is_body = bodies.any(|body| fit_of(body, name) == Some(PartFit::Caption));
        if is_body { Some(PartFit::Caption) } else { fit_of(part, name) }
    };
    let best = all.iter().filter_map(fit).min();
    let found: Vec<&Part> = all.iter().filter(|part| best.is_some() && fit(part) == best).collect();
    match found[..] {
        [part] => Ok(part.clone()),
        [] => Err(GraspError::NoSuchPart { name: name.to_owned(), parts: list(&all) }),
        _ => Err(GraspError::AmbiguousPart { name: name.to_owned(), parts: list(found.iter().copied()) }),
    }
}

fn list<'a>(parts: impl IntoIterator<Item = &'a Part>) -> String {
    parts.into_iter().map(|p| format!("{} ({}, {})", p.id, p.caption, p.material)).collect::<Vec<_>>().join("; ")
}
