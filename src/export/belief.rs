//! What is believed of the object, as samples.

use nalgebra::Vector3;
use serde::Serialize;

use super::placement::{Axes, Placement};
use super::{ExportError, Files, body_name};
use crate::files::json;
use crate::parts::samples::Sample;

#[derive(Serialize)]
struct Belief {
    frame: &'static str,
    /// By rows; maps a point to the frame and unit of the scene's files.
    input_from_asset: [f64; 16],
    /// Says that the scale may be further off than the samples show; missing if it is not in doubt.
    #[serde(skip_serializing_if = "Option::is_none")]
    note: Option<&'static str>,
    samples: Vec<Sample>,
}

/// Writes the samples of an object with this name, with centres of mass as they are in the other exports.
pub(super) fn write(
    name: &str,
    samples: &[Sample],
    placement: &Placement,
    note: Option<&'static str>,
    files: &mut Files,
) -> Result<(), ExportError> {
    let raised = |sample: &Sample| {
        let mut sample = sample.clone();
        let center = Vector3::from(sample.center_of_mass_m) - placement.origin + placement.place();
        sample.center_of_mass_m = center.into();
        sample
    };
    let belief = Belief {
        frame: "metres, kilograms, z up, as in the exports for simulators",
        input_from_asset: placement.input_from_asset(Axes::ZUp),
        note,
        samples: samples.iter().map(raised).collect(),
    };
    files.write(format!("{}_belief.json", body_name(name)), |out| {
        out.write_all(json::pretty(&belief)?.as_bytes())?;
        out.write_all(b"\n")
    })
}
