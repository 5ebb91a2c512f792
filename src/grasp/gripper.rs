//! Gripper profiles: the range of force, the finger, and the command that makes a force. Format: grippers/README.md.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::GraspError;

/// The profiles compiled in, by name.
const BUILTIN: [(&str, &str); 1] = [("paper", include_str!("../../grippers/paper.toml"))];

/// A parallel gripper with two fingers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GripperProfile {
    pub name: String,
    /// Least and greatest force of one finger, N.
    pub force_n: [f64; 2],
    /// Contact area A under one finger, m^2.
    pub finger_area_m2: f64,
    pub pad: Pad,
    /// Widest opening between the fingers, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stroke_m: Option<f64>,
    pub command: Command,
    /// Measured pairs by rising command and force; empty where nobody measured.
    #[serde(default)]
    pub calibration: Vec<CalibrationPoint>,
}

/// What the fingers touch with: which friction of a material holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pad {
    Rubber,
}

/// The commands, in the controller's own unit, at which the fingers begin to press and press most.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Command {
    pub enabled_from: f64,
    pub full: f64,
}

/// A command and the force that was measured for it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationPoint {
    pub command: f64,
    pub force_n: f64,
}

impl GripperProfile {
    /// The built-in profile called `name_or_path`, or else the file there.
    ///
    /// # Errors
    /// Neither exists, the file cannot be read, or it is no valid profile.
    pub fn load(name_or_path: &str) -> Result<Self, GraspError> {
        if let Some((name, text)) = BUILTIN.iter().find(|(name, _)| *name == name_or_path) {
            return Self::from_toml(text, name);
        }
        let path = Path::new(name_or_path);
        match std::fs::read_to_string(path) {
            Ok(text) => Self::from_toml(&text, name_or_path),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(GraspError::NoSuchGripper {
                name: name_or_path.to_owned(),
                builtin: BUILTIN.map(|(name, _)| name).join(", "),
            }),
            Err(source) => Err(GraspError::ReadProfile { path: path.to_owned(), source }),
        }
    }

    /// A profile from TOML text; `origin` says in errors where it came from.
    ///
    /// # Errors
    /// The text is no TOML, has a key that profiles do not know, or a value outside its domain.
    pub fn from_toml(text: &str, origin: &str) -> Result<Self, GraspError> {
        let profile: Self = toml::from_str(text).map_err(|error| GraspError::ParseProfile {
            origin: origin.to_owned(),
            message: error.to_string().trim_end().to_owned(),
        })?;
        match profile.problem() {
            None => Ok(profile),
            Some((key, problem)) => {
                Err(GraspError::ProfileValue { origin: origin.to_owned(), key, problem: problem.to_owned() })
            }
        }
    }

    fn problem(&self) -> Option<(&'static str, &'static str)> {
        let [low, high] = self.force_n;
        let rising = |pair: &[CalibrationPoint]| pair[0].command < pair[1].command && pair[0].force_n < pair[1].force_n;
        let finite = |p: &CalibrationPoint| p.command.is_finite() && p.force_n.is_finite() && p.force_n >= 0.0;
        if !(0.0 <= low && low < high && high.is_finite()) {
            Some(("force_n", "must be [least, most] with 0 <= least < most, in N"))
        } else if !(self.finger_area_m2 > 0.0 && self.finger_area_m2.is_finite()) {
            Some(("finger_area_m2", "must be above 0, in m2"))
        } else if self.stroke_m.is_some_and(|s| !(s > 0.0 && s.is_finite())) {
            Some(("stroke_m", "must be above 0, in m"))
        } else if !(self.command.enabled_from < self.command.full && self.command.full.is_finite()) {
            Some(("command", "must have enabled_from below full"))
        } else if self.calibration.len() == 1 {
            Some(("calibration", "needs at least two measured pairs, or none"))
        } else if !self.calibration.iter().all(finite) || !self.calibration.windows(2).all(rising) {
            Some(("calibration", "must rise from pair to pair, in command and in force_n"))
        } else {
            None
        }
    }

    /// Whether the command rests on measured pairs.
    pub fn is_calibrated(&self) -> bool {
        !self.calibration.is_empty()
    }

    /// The command for a force of one finger in N: linear between the two neighbours of the calibration, or without one
    /// between `enabled_from` at the least force and `full` at the greatest. A force beyond either end gets that end's
    /// command.
    pub fn command_for(&self, force_n: f64) -> f64 {
        let ends = [
            CalibrationPoint { command: self.command.enabled_from, force_n: self.force_n[0] },
            CalibrationPoint { command: self.command.full, force_n: self.force_n[1] },
        ];
        let points = if self.is_calibrated() { &self.calibration[..] } else { &ends[..] };
        let above = points.partition_point(|p| p.force_n < force_n).clamp(1, points.len() - 1);
        let (a, b) = (points[above - 1], points[above]);
        let share = ((force_n - a.force_n) / (b.force_n - a.force_n)).clamp(0.0, 1.0);
        a.command + share * (b.command - a.command)
    }
}
