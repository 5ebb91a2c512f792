//! The report of a simulation before it runs.

use std::collections::BTreeSet;
use std::path::Path;

use super::stiffness::{Conditions, Settled};
use crate::mpm::particles::Particle;
use crate::simulate::Input;
use crate::simulate::filling::{Filled, Parcel};
use crate::simulate::material::Softened;
use crate::simulate::report::{FilledReport, RigidReport, SimulationReport, StepReport};
use crate::simulate::rigid::choice::{Choice, Load};
use crate::words::output::{agreeing, counted};
use crate::words::readable::significant;

/// The report of what `start` leads to; the first `carried` parcels are Gaussians.
pub(super) fn before_run(
    conditions: &Conditions,
    settled: &Settled,
    filled: &Filled,
    carried: usize,
    start: &[Particle],
    ground_z_m: f64,
) -> SimulationReport {
    let Conditions { input, options, load, extent, .. } = conditions;
    let strays = input.gaussians.len() - carried;
    let mut warnings = warnings(input, load.longest_m, &filled.assumed_full, strays);
    if options.max_stiffness.is_none() {
        warnings.extend(settled.materials.softened.iter().map(softened_warning));
    }
    let scenario = Path::new(&options.scenario).file_name().unwrap_or_default();
    SimulationReport {
        scenario: scenario.to_string_lossy().into_owned(),
        particles: start.len(),
        fill_particles: start.len() - carried,
        substeps: 0,
        dt_s: 0.0,
        time_step: StepReport {
            cfl: options.cfl,
            stiffest_material: settled.fastest.map(|label| input.materials[label].name.clone()),
            wave_speed_m_s: settled.bound.wave_speed_m_s,
        },
        mass_kg: start.iter().map(|p| f64::from(p.mass_kg)).sum(),
        filled: filled_report(input, filled, carried),
        gravity_m_s2: options.gravity,
        grid_spacing_m: extent.spacing_m,
        meters_per_unit: extent.meters_per_unit,
        scale_assumed: input.meters_per_unit.is_none(),
        rigid: rigid_report(input, &settled.choice, load),
        softened: settled.materials.softened.clone(),
        poisson_capped: settled.materials.poisson_capped.clone(),
        ground_z_m,
        frames: vec![],
        warnings,
    }
}

/// The particles of every label in use; the first `carried` parcels are Gaussians.
fn filled_report(input: &Input, filled: &Filled, carried: usize) -> Vec<FilledReport> {
    let used: BTreeSet<u32> = filled.parcels.iter().map(|p| p.label).collect();
    let report_of = |label: u32| {
        let material = &input.materials[label as usize];
        let count = |parcels: &[Parcel]| parcels.iter().filter(|p| p.label == label).count();
        FilledReport {
            part: material.caption.clone(),
            material: material.name.clone(),
            gaussians: count(&filled.parcels[..carried]),
            fill_particles: count(&filled.parcels[carried..]),
            volume_m3: filled.parcels.iter().filter(|p| p.label == label).map(|p| p.volume_m3).sum(),
            skin: filled.assumed_full.contains(&label),
        }
    };
    used.into_iter().map(report_of).collect()
}

/// The rigid parts, before they touched anything.
fn rigid_report(input: &Input, choice: &Choice, load: &Load) -> Vec<RigidReport> {
    let report_of = |(label, body): (usize, &Option<u32>)| {
        let material = &input.materials[label];
        Some(RigidReport {
            part_id: material.part_id,
            label: label as u32,
            part: material.caption.clone(),
            material: material.name.clone(),
            body: (*body)?,
            strain: load.strain(material),
            because: choice.reasons[label]?,
            peak_pressure_pa: 0.0,
            strength_pa: material.strength_pa,
            dents: false,
        })
    };
    choice.body_of.iter().enumerate().filter_map(report_of).collect()
}

fn softened_warning(softened: &Softened) -> String {
    format!(
        "{} is softened by a factor of {:.1} in the simulation, which would take too long otherwise: it bends more than \
         the real object would; --max-stiffness sets the limit",
        softened.material,
        1.0 / softened.factor
    )
}

fn warnings(input: &Input, longest_m: f64, assumed_full: &[u32], strays: usize) -> Vec<String> {
    let mut warnings = Vec::new();
    if input.meters_per_unit.is_none() {
        warnings.push(format!(
            "the scale is unknown: the simulation takes the longest side to be {} m; give --scale or \
             --known-mass to simulate it at its true size",
            significant(longest_m)
        ));
    }
    if !assumed_full.is_empty() {
        let mut names: Vec<&str> = Vec::new();
        for &label in assumed_full {
            let name = input.materials[label as usize].name.as_str();
            if !names.contains(&name) {
                names.push(name);
            }
        }
        warnings.push(format!(
            "nothing is known about the inside of {}, so only a thin skin of it is simulated, which may be lighter and softer than \
             the real thing",
            names.join(", ")
        ));
    }
    if strays > 0 {
        warnings.push(format!(
            "{} {}",
            counted(strays, "Gaussian"),
            agreeing(
                strays,
                "lies far from the object or was set aside: it is not simulated and stays in place",
                "lie far from the object or were set aside: they are not simulated and stay in place",
            ),
        ));
    }
    warnings
}
