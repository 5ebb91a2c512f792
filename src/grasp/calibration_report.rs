//! What `gprop grasp calibrate` shows: the fit, its residuals by command, a plot.

use std::path::Path;

use minijinja::{Environment, context};
use serde::Serialize;

use super::GraspError;
use super::calibration::{CalibrationPoint, Fit};
use super::gripper::GripperProfile;

/// A fit beside what it was made from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CalibrationReport {
    pub gripper: String,
    pub fit: Fit,
    /// By rising command.
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
    /// Between the least and the greatest measurement.
    pub spread_n: f64,
    pub fitted_force_n: f64,
    /// Mean less fitted.
    pub residual_n: f64,
}

impl CalibrationReport {
    /// Calibrates `gripper` with the measurements in a CSV file with the header `command,force_n`.
    ///
    /// # Errors
    /// The file cannot be read or is no such CSV; its measurements make no rising curve.
    pub fn of_file(path: &Path, gripper: &mut GripperProfile) -> Result<Self, GraspError> {
        let points = read(path)?;
        let fit = gripper.calibrate(points.clone(), &path.display().to_string())?.clone();
        Ok(Self { gripper: gripper.name.clone(), commands: by_command(&points, &fit), fit, points })
    }

    /// The measurements and the curve, force over command, and below the residuals, as SVG.
    pub fn plot(&self) -> String {
        const CURVE_POINTS: usize = 200;
        /// Left, right; top and bottom of the curve and of the residuals, px.
        const X: [f64; 2] = [60.0, 620.0];
        const FORCE_Y: [f64; 2] = [280.0, 20.0];
        const RESIDUAL_Y: [f64; 2] = [420.0, 320.0];
        let [from, full] = self.fit.enabled;
        let most = self.points.iter().map(|p| p.force_n).fold(self.fit.force_n[1], f64::max);
        let worst = self.fit.max_residual_n.max(f64::MIN_POSITIVE);
        let place = |value: f64, low: f64, high: f64, [a, b]: [f64; 2]| a + (b - a) * (value - low) / (high - low);
        let used = self.points.iter().filter(|p| (from..=full).contains(&p.command));
        let dots: Vec<_> = used
            .map(|p| {
                let residual = p.force_n - self.fit.force_at(p.command);
                context! {
                    x => place(p.command, from, full, X),
                    force_y => place(p.force_n, 0.0, most, FORCE_Y),
                    residual_y => place(residual, -worst, worst, RESIDUAL_Y),
                }
            })
            .collect();
        let curve: Vec<String> = (0..=CURVE_POINTS)
            .map(|k| {
                let command = from + (full - from) * k as f64 / CURVE_POINTS as f64;
                let y = place(self.fit.force_at(command), 0.0, most, FORCE_Y);
                format!("{:.1} {y:.1}", place(command, from, full, X))
            })
            .collect();
        let data = context! {
            dots, from, full,
            curve => format!("M{}", curve.join("L")),
            gripper => &self.gripper,
            most => format!("{most:.1}"),
            worst => format!("{worst:.2}"),
            rms => format!("{:.3}", self.fit.rms_residual_n),
        };
        let mut engine = Environment::new();
        engine.set_auto_escape_callback(|_| minijinja::AutoEscape::Html);
        engine.render_str(include_str!("calibration.svg.j2"), data).expect("the template is a constant")
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
                format!("; {} measurements below {} left out", fit.left_out, fit.enabled[0])
            } else {
                String::new()
            },
        )
    }
}

fn read(path: &Path) -> Result<Vec<CalibrationPoint>, GraspError> {
    let error = |error: csv::Error| GraspError::ReadPoints { path: path.to_owned(), message: error.to_string() };
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_path(path).map_err(error)?;
    reader.deserialize().collect::<Result<_, _>>().map_err(error)
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
