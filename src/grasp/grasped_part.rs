//! The choice of the part that the fingers press on.

use serde::{Deserialize, Serialize};

use super::GraspError;
use crate::part_name::part_name;
use crate::parts::{Part, Parts};

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
/// else of captions and materials; only one part may match. Case does not matter.
///
/// # Errors
/// If no part, or more than one, matches the name, or no part has a surface.
pub fn choose<'a>(parts: &'a Parts, name: Option<&str>) -> Result<(&'a Part, PartChoice), GraspError> {
    match name {
        Some(name) => Ok((named(parts, name)?, PartChoice::Named)),
        None => {
            let reachable = parts.parts.iter().filter_map(|p| Some((p.surface_to_center_of_mass_m?, p)));
            let (_, nearest) = reachable.min_by(|a, b| a.0.total_cmp(&b.0)).ok_or(GraspError::NoSurface)?;
            Ok((nearest, PartChoice::NearestCenterOfMass))
        }
    }
}

fn named<'a>(parts: &'a Parts, name: &str) -> Result<&'a Part, GraspError> {
    let wanted = name.trim().to_lowercase();
    if let Some(part) = parts.parts.iter().find(|p| wanted == p.id.to_string()) {
        return Ok(part);
    }
    // The first way in which the name fits the part.
    let way = |p: &Part| {
        let [caption, material] = [&p.caption, &p.material].map(|text| text.to_lowercase());
        let short = part_name(&p.caption, &p.material).to_lowercase();
        let within = |text: &str| !wanted.is_empty() && text.contains(&wanted);
        [caption == wanted, short == wanted, within(&short), within(&caption) || within(&material)]
            .into_iter()
            .position(|fits| fits)
    };
    let best = parts.parts.iter().filter_map(way).min();
    let found: Vec<&Part> = parts.parts.iter().filter(|p| best.is_some() && way(p) == best).collect();
    match found[..] {
        [part] => Ok(part),
        [] => Err(GraspError::NoSuchPart { name: name.to_owned(), parts: list(&parts.parts) }),
        _ => Err(GraspError::AmbiguousPart { name: name.to_owned(), parts: list(found.iter().copied()) }),
    }
}

fn list<'a>(parts: impl IntoIterator<Item = &'a Part>) -> String {
    parts.into_iter().map(|p| format!("{} ({}, {})", p.id, p.caption, p.material)).collect::<Vec<_>>().join("; ")
}
