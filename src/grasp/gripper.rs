//! Gripper profiles: the range of force, the finger, and the command for a force. Format: grippers/README.md.

use std::ops::RangeInclusive;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::GraspError;
use super::calibration::{CalibrationPoint, Fit};
use super::touch::{whole_arm_m, whole_shift_m};
use crate::files;
use crate::words::output::toml_problem;

/// The built-in profiles, by name.
const BUILTIN: [(&str, &str); 3] = [
    ("paper", include_str!("../../grippers/paper.toml")),
    ("robotiq-2f-85", include_str!("../../grippers/robotiq-2f-85.toml")),
    ("franka-hand", include_str!("../../grippers/franka-hand.toml")),
];

/// The contact areas that a profile may have: from a square millimetre to a square of 32 cm.
const FINGER_AREAS_M2: RangeInclusive<f64> = 1e-6..=0.1;

/// A parallel gripper with two fingers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GripperProfile {
    pub name: String,
    /// Smallest and largest force of one finger, N.
    pub force_n: [f64; 2],
    /// Contact area A under one finger, m^2; 1e-6 to 0.1.
    pub finger_area_m2: f64,
    pub pad: Pad,
    /// Widest opening between the fingers, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stroke_m: Option<f64>,
    /// The commands in use; those of the calibration if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<Command>,
    /// Measured pairs in any order, any number at each command; empty without measurements.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub calibration: Vec<CalibrationPoint>,
    /// The curve through `calibration`.
    #[serde(skip)]
    fit: Option<Fit>,
}

/// The material of the contact pads, which selects a material's friction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pad {
    Rubber,
}

/// The commands, in the controller's own unit, at which the fingers begin to press and press hardest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Command {
    pub enabled_from: f64,
    pub full: f64,
}

impl Command {
    fn is_valid(self) -> bool {
        self.enabled_from.is_finite() && self.full.is_finite() && self.enabled_from < self.full
    }
}

impl GripperProfile {
    /// The names of the built-in profiles, separated by commas.
    pub fn builtin_names() -> String {
        BUILTIN.map(|(name, _)| name).join(", ")
    }

    /// True if there is a built-in profile of this name.
    pub fn is_builtin(name: &str) -> bool {
        BUILTIN.iter().any(|(known, _)| *known == name)
    }

    /// The built-in profile called `name_or_path`, or else the file there.
    ///
    /// # Errors
    /// If neither exists, the file cannot be read, or it is not a valid profile.
    pub fn load(name_or_path: &str) -> Result<Self, GraspError> {
        if let Some((name, text)) = BUILTIN.iter().find(|(name, _)| *name == name_or_path) {
            return Self::from_toml(text, name);
        }
        let path = Path::new(name_or_path);
        match files::read_to_string(path) {
            Ok(text) => Self::from_toml(&text, name_or_path),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                Err(GraspError::NoSuchGripper { name: name_or_path.to_owned(), builtin: Self::builtin_names() })
            }
            Err(source) => Err(GraspError::ReadProfile { path: path.to_owned(), source }),
        }
    }

    /// A profile from TOML text; `origin` names its source in errors.
    ///
    /// # Errors
    /// If the text is not TOML, or has an unknown key, a value outside its domain, neither commands nor a calibration,
    /// or a calibration that gives no increasing curve.
    pub fn from_toml(text: &str, origin: &str) -> Result<Self, GraspError> {
        let mut profile: Self = toml::from_str(text).map_err(|error| GraspError::ParseProfile {
            origin: origin.to_owned(),
            message: toml_problem(&error, text),
        })?;
        if let Some((key, problem)) = profile.problem() {
            return Err(GraspError::ProfileValue { origin: origin.to_owned(), key, problem: problem.to_owned() });
        }
        if profile.calibration.is_empty() && profile.command.is_none() {
            return Err(GraspError::NoCalibration { origin: origin.to_owned() });
        }
        if !profile.calibration.is_empty() {
            profile.calibrate(profile.calibration.clone(), origin)?;
        }
        Ok(profile)
    }

    /// Replaces the profile's calibration with measured pairs. The range of force is then that of the fitted curve over
    /// the profile's commands or, without those, over the measured ones.
    ///
    /// # Errors
    /// If the pairs give no increasing curve.
    pub fn calibrate(&mut self, points: Vec<CalibrationPoint>, origin: &str) -> Result<&Fit, GraspError> {
        let commands = points.iter().map(|p| p.command);
        let enabled = self.command.map_or_else(
            || [commands.clone().fold(f64::INFINITY, f64::min), commands.fold(f64::NEG_INFINITY, f64::max)],
            |command| [command.enabled_from, command.full],
        );
        let refuse = |problem| GraspError::Calibration { origin: origin.to_owned(), problem };
        let fit = Fit::of(&points, enabled).map_err(refuse)?;
        self.calibration = points;
        self.force_n = fit.force_n.map(|force| force.max(0.0));
        Ok(self.fit.insert(fit))
    }

    fn problem(&self) -> Option<(&'static str, &'static str)> {
        let [low, high] = self.force_n;
        if !(0.0 <= low && low < high && high.is_finite()) {
            Some(("force_n", "must be [least, most] with 0 <= least < most, in N"))
        } else if !FINGER_AREAS_M2.contains(&self.finger_area_m2) {
            Some(("finger_area_m2", "must be from 1e-6 to 0.1, in m2"))
        } else if self.stroke_m.is_some_and(|s| !(s > 0.0 && s.is_finite())) {
            Some(("stroke_m", "must be above 0, in m"))
        } else if self.command.is_some_and(|command| !command.is_valid()) {
            Some(("command", "must have enabled_from below full, both finite"))
        } else {
            None
        }
    }

    /// True if the command is based on measured pairs.
    pub fn is_calibrated(&self) -> bool {
        self.fit.is_some()
    }

    /// The smallest and largest command that the gripper obeys.
    pub fn enabled(&self) -> [f64; 2] {
        match (&self.fit, self.command) {
            (Some(fit), _) => fit.enabled,
            (None, Some(command)) => [command.enabled_from, command.full],
            (None, None) => unreachable!("a profile has a calibration or commands"),
        }
    }

    /// The command for a force of one finger in N: from the calibration, or without one by linear interpolation between
    /// the smallest command at the smallest force and the largest at the largest. A force beyond either end gets that
    /// end's command.
    pub fn command_for(&self, force_n: f64) -> f64 {
        if let Some(fit) = &self.fit {
            return fit.command_for(force_n);
        }
        let ([from, full], [low, high]) = (self.enabled(), self.force_n);
        from + (full - from) * ((force_n - low) / (high - low)).clamp(0.0, 1.0)
    }

    /// The force of one finger in N at a command, the inverse of [`Self::command_for`]; for a command that the gripper
    /// does not obey, the force at the nearer end.
    pub fn force_for(&self, command: f64) -> f64 {
        let ([from, full], [low, high]) = (self.enabled(), self.force_n);
        match &self.fit {
            Some(fit) => fit.force_at(command.clamp(from, full)).max(0.0),
            None => low + (high - low) * ((command - from) / (full - from)).clamp(0.0, 1.0),
        }
    }

    /// Side of a finger's square contact area, m.
    pub fn finger_side_m(&self) -> f64 {
        self.finger_area_m2.sqrt()
    }

    /// Mean distance of the pressure from the middle of an evenly pressed disc with the finger's area, m.
    pub fn pressure_arm_m(&self) -> f64 {
        whole_arm_m(self.contact_radius_m())
    }

    /// How far that pressure can move before an edge of the disc lifts off, m.
    pub fn pressure_shift_m(&self) -> f64 {
        whole_shift_m(self.pressure_arm_m())
    }

    /// Radius of a disc with the finger's area, m.
    pub fn contact_radius_m(&self) -> f64 {
        (self.finger_area_m2 / std::f64::consts::PI).sqrt()
    }
}
