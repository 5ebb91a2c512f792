//! Converts commands to forces and back: a polynomial of 5th order through repeated measurements, as in the paper's
//! supplement B.1, refused if it does not increase over the commands that the gripper obeys.
//!
//! The fit is in t = (command - center) / half_span, which runs from -1 to 1 over the measured commands: powers of the
//! command itself would lose six digits to rounding.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// The paper's order.
pub const ORDER: usize = 5;
/// Number of steps over the range, at each of which the fit must increase: a dip narrower than 0.1 % of the range moves
/// no finger.
const CHECKED: usize = 1000;

/// A command and the force of one finger that was measured for it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationPoint {
    /// In the controller's own unit.
    pub command: f64,
    pub force_n: f64,
}

/// Why measurements cannot be used as a calibration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    #[error(
        "measurement {index} is command {command}, force {force_n} N: give finite numbers and a force that is not \
         negative"
    )]
    Value { index: usize, command: f64, force_n: f64 },
    #[error(
        "there are only {found} different commands from {from} up, where the gripper begins to press, too few for a polynomial of \
         order {ORDER}: measure at {} or more", ORDER + 1
    )]
    TooFew { found: usize, from: f64 },
    #[error(
        "the measurements reach from command {low} to {high}, but the gripper obeys {from} to {full}: measure at both ends, \
         since the fit is meaningless beyond the measurements"
    )]
    NotCovered { low: f64, high: f64, from: f64, full: f64 },
    #[error(
        "the fitted force falls from {before_n:.3} N to {after_n:.3} N near command {at:.2}, so one force has several commands: \
         measure again around there, or raise enabled_from past it"
    )]
    NotMonotone { at: f64, before_n: f64, after_n: f64 },
}

/// The fitted curve, increasing over the enabled commands.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fit {
    pub center: f64,
    pub half_span: f64,
    /// Coefficients of 1, t, t^2 ... t^5, N.
    pub coefficients: [f64; ORDER + 1],
    /// The smallest and largest command that the gripper obeys.
    pub enabled: [f64; 2],
    /// Force at both ends of `enabled`, N.
    pub force_n: [f64; 2],
    /// Root mean square of the residuals, N.
    pub rms_residual_n: f64,
    pub max_residual_n: f64,
    /// Number of measurements below `enabled`, which were left out.
    pub left_out: usize,
}

impl Fit {
    /// Fits `points`, with any number of them at each command; those below `enabled` are left out.
    ///
    /// # Errors
    /// [`CalibrationError`] if they cannot be used.
    pub fn of(points: &[CalibrationPoint], enabled: [f64; 2]) -> Result<Self, CalibrationError> {
        let [from, full] = enabled;
        let wrong = |p: &CalibrationPoint| !(p.command.is_finite() && p.force_n.is_finite() && p.force_n >= 0.0);
        if let Some(index) = points.iter().position(wrong) {
            let CalibrationPoint { command, force_n } = points[index];
            return Err(CalibrationError::Value { index: index + 1, command, force_n });
        }
        let used: Vec<CalibrationPoint> = points.iter().copied().filter(|p| p.command >= from).collect();
        let mut commands: Vec<f64> = used.iter().map(|p| p.command).collect();
        commands.sort_by(f64::total_cmp);
        commands.dedup();
        if commands.len() <= ORDER {
            return Err(CalibrationError::TooFew { found: commands.len(), from });
        }
        let (low, high) = (commands[0], commands[commands.len() - 1]);
        if low > from || high < full {
            return Err(CalibrationError::NotCovered { low, high, from, full });
        }
        let (center, half_span) = (0.5 * (low + high), 0.5 * (high - low));
        let mut fit = Self {
            center,
            half_span,
            coefficients: least_squares(&used, center, half_span),
            enabled,
            force_n: [0.0; 2],
            rms_residual_n: 0.0,
            max_residual_n: 0.0,
            left_out: points.len() - used.len(),
        };
        let residuals: Vec<f64> = used.iter().map(|p| p.force_n - fit.force_at(p.command)).collect();
        fit.rms_residual_n = (residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len() as f64).sqrt();
        fit.max_residual_n = residuals.iter().fold(0.0, |most, r| r.abs().max(most));
        fit.force_n = enabled.map(|command| fit.force_at(command));
        fit.check_rising()?;
        Ok(fit)
    }

    fn check_rising(&self) -> Result<(), CalibrationError> {
        let [from, full] = self.enabled;
        let command = |k: usize| from + (full - from) * k as f64 / CHECKED as f64;
        for k in 1..=CHECKED {
            let (before_n, after_n) = (self.force_at(command(k - 1)), self.force_at(command(k)));
            if after_n <= before_n {
                return Err(CalibrationError::NotMonotone { at: command(k), before_n, after_n });
            }
        }
        Ok(())
    }

    /// Force of one finger at a command, N.
    pub fn force_at(&self, command: f64) -> f64 {
        let t = (command - self.center) / self.half_span;
        self.coefficients.iter().rev().fold(0.0, |sum, c| sum * t + c)
    }

    /// The command for a force, by bisection; for a force outside the range, the command of the nearer end.
    pub fn command_for(&self, force_n: f64) -> f64 {
        let [mut low, mut high] = self.enabled;
        if force_n <= self.force_n[0] {
            return low;
        }
        if force_n >= self.force_n[1] {
            return high;
        }
        // Until no f64 lies between the two ends.
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                return middle;
            }
            if self.force_at(middle) < force_n {
                low = middle;
            } else {
                high = middle;
            }
        }
    }
}

fn least_squares(points: &[CalibrationPoint], center: f64, half_span: f64) -> [f64; ORDER + 1] {
    let powers = DMatrix::from_fn(points.len(), ORDER + 1, |row, power| {
        ((points[row].command - center) / half_span).powi(power as i32)
    });
    let forces = DVector::from_iterator(points.len(), points.iter().map(|p| p.force_n));
    let solved = powers.svd(true, true).solve(&forces, f64::EPSILON).expect("both bases were computed");
    std::array::from_fn(|power| solved[power])
}
