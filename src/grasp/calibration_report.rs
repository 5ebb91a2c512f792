//! The report of `gprop grasp calibrate`: the fit, its residuals by command, a plot.

use std::path::Path;

use serde::Serialize;

use super::GraspError;
use super::calibration::{CalibrationPoint, Fit};
use super::gripper::GripperProfile;
use crate::files;
use crate::pictures::plots::{self, Mark, Panel, Series};

/// A fit together with its measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CalibrationReport {
    pub gripper: String,
    pub fit: Fit,
    /// In ascending order.
    pub commands: Vec<MeasuredCommand>,
    #[serde(skip)]
    points: Vec<CalibrationPoint>,
}

/// The measurements at one command.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasuredCommand {
    pub command: f64,
    pub count: usize,
    pub mean_force_n: f64,
    /// Difference of the largest and the smallest measurement.
    pub spread_n: f64,
    pub fitted_force_n: f64,
    /// Mean minus fitted force.
    pub residual_n: f64,
}

impl CalibrationReport {
    /// Calibrates `gripper` with the measurements in a CSV file with the header `command,force_n`.
    ///
    /// # Errors
    /// If the file cannot be read or is not such a CSV, or its measurements give no increasing curve.
    pub fn of_file(path: &Path, gripper: &mut GripperProfile) -> Result<Self, GraspError> {
        let points = read(path)?;
        let fit = gripper.calibrate(points.clone(), &path.display().to_string())?.clone();
        Ok(Self { gripper: gripper.name.clone(), commands: by_command(&points, &fit), fit, points })
    }

    /// The measurements and the curve, force over command, and the residuals below, as SVG.
    pub fn plot(&self) -> String {
        const CURVE_POINTS: usize = 200;
        let [from, full] = self.fit.enabled;
        let along = |k: usize| from + (full - from) * k as f64 / CURVE_POINTS as f64;
        let curve = (0..=CURVE_POINTS).map(along).map(|command| (command, self.fit.force_at(command))).collect();
        let used = || self.points.iter().filter(|p| (from..=full).contains(&p.command));
        let measured = used().map(|p| (p.command, p.force_n)).collect();
        let residuals = used().map(|p| (p.command, p.force_n - self.fit.force_at(p.command))).collect();
        let panel = |title: String, series| Panel { title, along: "command, in the controller's unit", series };
        plots::svg(&[
            panel(
                format!("{}: force of one finger, N", self.gripper),
                vec![
                    Series { name: "5th-order polynomial", mark: Mark::Curve, points: curve },
                    Series { name: "measured", mark: Mark::Dots, points: measured },
                ],
            ),
            panel(
                format!("measured minus fitted, N: {:.3} rms", self.fit.rms_residual_n),
                vec![Series { name: "residual", mark: Mark::Dots, points: residuals }],
            ),
        ])
    }

    /// A table for the terminal.
    pub fn text(&self) -> String {
        let fit = &self.fit;
        let mut text = format!(
            "{:>10} {:>6} {:>10} {:>10} {:>10} {:>10}\n",
            "command", "count", "mean N", "spread N", "fitted N", "residual N"
        );
        for c in &self.commands {
            text += &format!(
                "{:>10} {:>6} {:>10.3} {:>10.3} {:>10.3} {:>10.3}\n",
                c.command, c.count, c.mean_force_n, c.spread_n, c.fitted_force_n, c.residual_n
            );
        }
        text + &format!(
            "{}: rises from {:.3} N at {} to {:.3} N at {}; residuals {:.3} N rms, {:.3} N at most{}",
            self.gripper,
            fit.force_n[0],
            fit.enabled[0],
            fit.force_n[1],
            fit.enabled[1],
            fit.rms_residual_n,
            fit.max_residual_n,
            if fit.left_out > 0 {
                format!("; {} of the measurements left out (commands below {})", fit.left_out, fit.enabled[0])
            } else {
                String::new()
            },
        )
    }
}

fn read(path: &Path) -> Result<Vec<CalibrationPoint>, GraspError> {
    files::rows(path).map_err(|problem| GraspError::ReadPoints { path: path.to_owned(), message: problem.to_string() })
}

fn by_command(points: &[CalibrationPoint], fit: &Fit) -> Vec<MeasuredCommand> {
    let mut sorted: Vec<&CalibrationPoint> = points.iter().filter(|p| p.command >= fit.enabled[0]).collect();
    sorted.sort_by(|a, b| a.command.total_cmp(&b.command));
    let measured = |run: &[&CalibrationPoint]| {
        let forces = || run.iter().map(|p| p.force_n);
        let mean_force_n = forces().sum::<f64>() / run.len() as f64;
        let fitted_force_n = fit.force_at(run[0].command);
        MeasuredCommand {
            command: run[0].command,
            count: run.len(),
            mean_force_n,
            spread_n: forces().fold(0.0, f64::max) - forces().fold(f64::INFINITY, f64::min),
            fitted_force_n,
            residual_n: mean_force_n - fitted_force_n,
        }
    };
    sorted.chunk_by(|a, b| a.command == b.command).map(measured).collect()
}
