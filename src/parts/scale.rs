//! The metric scale that follows from what the object weighs.

use super::assign::Labelled;
use super::compose::{Construction, Evidence, compose, thickness::Chord};
use crate::vote::{Contents, FieldPart};

/// A trial changes the scale by less than this once it has converged.
const CONVERGED: f64 = 1e-4;
/// If everything is solid, the first trial is exact; walls, whose mass grows with the square of the scale, take a few
/// more.
const TRIALS: usize = 30;

/// The metres in a scene unit with which the object weighs `kg`, everything else being at its middle value.
/// `constructions` says how the labels are built at a scale.
pub fn meters_per_unit(
    kg: f64,
    cells: &Labelled,
    chords: &[Option<Chord>],
    evidence: &Evidence,
    labels: &[FieldPart],
    constructions: impl Fn(f64) -> Vec<Construction>,
) -> Option<f64> {
    let weigh = |meters: f64| {
        let (composed, _) = compose(cells.clone(), &constructions(meters), chords, evidence);
        let mass_of = |(l, label): (usize, &FieldPart)| {
            let filling = match (&composed.hollows[l], &label.inside) {
                (Some(hollow), Some(Contents::Filled(filled))) => {
                    hollow.volume.mid * filled.share.mid * filled.density_kg_m3.mid
                }
                _ => 0.0,
            };
            composed.volumes[l].mid * label.density_kg_m3.mid + filling
        };
        labels.iter().enumerate().map(mass_of).sum::<f64>() * meters.powi(3)
    };
    let mut meters = 1.0;
    for _ in 0..TRIALS {
        let weight = weigh(meters);
        if weight <= 0.0 {
            return None;
        }
        let factor = (kg / weight).cbrt();
        meters *= factor;
        if factor.ln().abs() < CONVERGED {
            break;
        }
    }
    Some(meters)
}
