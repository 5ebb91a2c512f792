//! Plots energies and the centre of mass over time, as SVG.

use super::{FrameSummary, SimulationReport};
use crate::pictures::plots::{self, Mark, Panel, Series};

/// The upper plot shows kinetic, potential and elastic energy and their sum, in J; the potential energy is measured from
/// the ground. The lower plot shows the centre of mass, in m from its start.
pub fn svg(report: &SimulationReport) -> String {
    let weight_n = report.mass_kg * report.gravity_m_s2;
    let kinetic = |frame: &FrameSummary| frame.kinetic_energy_j;
    let potential = move |frame: &FrameSummary| weight_n * (frame.center_of_mass_m[2] - report.ground_z_m);
    let elastic = |frame: &FrameSummary| frame.elastic_energy_j;
    let start = report.frames.first().map_or([0.0; 3], |frame| frame.center_of_mass_m);
    let moved = |axis: usize| move |frame: &FrameSummary| frame.center_of_mass_m[axis] - start[axis];
    let energies = vec![
        curve("kinetic", report, kinetic),
        curve("potential", report, potential),
        curve("elastic", report, elastic),
        curve("all", report, move |frame| kinetic(frame) + potential(frame) + elastic(frame)),
    ];
    let center = vec![curve("x", report, moved(0)), curve("y", report, moved(1)), curve("z", report, moved(2))];
    plots::svg(&[over_time("energy, J", energies), over_time("centre of mass, m", center)])
}

/// For the report page: the height of the centre of mass, and the kinetic energy.
pub fn height_and_energy(report: &SimulationReport) -> String {
    let height = curve("z", report, |frame| frame.center_of_mass_m[2]);
    let energy = curve("kinetic", report, |frame| frame.kinetic_energy_j);
    plots::svg(&[
        over_time("height of the centre of mass, m", vec![height]),
        over_time("kinetic energy, J", vec![energy]),
    ])
}

fn over_time(title: &str, series: Vec<Series>) -> Panel {
    Panel { title: title.to_owned(), along: "time, s", series }
}

fn curve(name: &'static str, report: &SimulationReport, value: impl Fn(&FrameSummary) -> f64) -> Series {
    let points = report.frames.iter().map(|frame| (frame.t_s, value(frame))).collect();
    Series { name, mark: Mark::Curve, points }
}
