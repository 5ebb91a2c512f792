//! Units: shapes in millimetres, centimetres or inches that are read as metres, or a scale that is applied twice.

use super::super::hull::extent;
use super::super::measure::Mass;
use super::mass::{HEAVY_KG_M3, LIGHT_KG_M3};
use super::{Finding, Kind, Subject, words};
use crate::scene::mesh::containers::Geometry;

/// A unit that may have been meant, in metres.
struct Unit {
    name: &'static str,
    meters: f64,
}

/// The units in which people model, the likeliest first.
const UNITS: [Unit; 4] = [
    Unit { name: "mm", meters: 1e-3 },
    Unit { name: "cm", meters: 1e-2 },
    Unit { name: "inches", meters: 0.0254 },
    // A scale of 0.001 for a mesh that is in metres already.
    Unit { name: "m, without the scale,", meters: 1e3 },
];

/// Sizes of what people hold and of what robots are made of, m.
const USUAL_M: [f64; 2] = [2e-3, 5.0];
/// A solid that is lighter than air (1.2 kg/m3) is too large for its mass whatever it is made of.
const LIGHTER_THAN_AIR_KG_M3: f64 = 1.0;
/// Denser than the densest material, platinum.
const DENSER_THAN_ALL_KG_M3: f64 = 22_000.0;
/// Without a mass, only sizes beyond these are told.
const WITHOUT_MASS_M: [f64; 2] = [5e-4, 50.0];
/// What is flatter than this is a floor or a map, which may be large.
const FLAT: f64 = 0.02;

pub fn judge(subject: &Subject) -> Option<Finding> {
    let best = subject.size.best()?;
    let longest = best.longest_side_m();
    let unit = match (subject.mass, best.volume_m3) {
        (Mass::Stated(mass), Some([_, volume, _])) if mass > 0.0 => by_mass(longest, mass / volume)?,
        (Mass::Stated(_), _) => return None,
        _ => {
            let sides = extent(&best.corners);
            let is_flat = sides.min() < FLAT * sides.max();
            by_size(longest).filter(|_| !is_flat)?
        }
    };
    let is_mesh =
        |shape: &&crate::scene::mesh::containers::Shape| matches!(shape.geometry, Geometry::Mesh(_) | Geometry::Own(_));
    let shapes = &subject.body.shapes;
    let place = shapes.iter().find(is_mesh).or(shapes.first()).map_or(&subject.body.place, |shape| &shape.place);
    let problem = format!(
        "its longest side is {}; in {} it would be {}",
        words::length(longest),
        unit.name,
        words::length(longest * unit.meters)
    );
    let remedy = if unit.meters < 1.0 {
        format!("give the mesh a scale of {}, or export it in metres", unit.meters)
    } else {
        "leave out the scale, or export the mesh in the unit that the scale is for".to_owned()
    };
    Some(subject.finding(Kind::Units, place, problem, remedy))
}

/// The unit in which both the size and the density would be usual, if in metres neither is.
fn by_mass(longest: f64, density: f64) -> Option<&'static Unit> {
    if is_usual(longest) {
        return None;
    }
    let is_too_large = density < LIGHTER_THAN_AIR_KG_M3;
    let is_too_small = density > DENSER_THAN_ALL_KG_M3;
    UNITS.iter().find(|unit| {
        let would_be = density / unit.meters.powi(3);
        let fits = if unit.meters < 1.0 { is_too_large } else { is_too_small };
        fits && (LIGHT_KG_M3..=HEAVY_KG_M3).contains(&would_be) && is_usual(longest * unit.meters)
    })
}

/// The unit in which the size would be usual, if in metres it is absurd.
fn by_size(longest: f64) -> Option<&'static Unit> {
    let [least, most] = WITHOUT_MASS_M;
    UNITS.iter().find(|unit| {
        let is_absurd = if unit.meters < 1.0 { longest > most } else { longest < least && longest > 0.0 };
        is_absurd && is_usual(longest * unit.meters)
    })
}

fn is_usual(meters: f64) -> bool {
    (USUAL_M[0]..=USUAL_M[1]).contains(&meters)
}
