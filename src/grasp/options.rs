//! The user's options for a grasp.

use clap::Args;
use serde::{Deserialize, Serialize};

use super::curvature;
use super::gripper::GripperProfile;
use crate::config::SceneKey;
use crate::config::option_values::{self, Domain, OptionError, above, from_to};
use crate::units::Estimate;

const LIFT_ANGLE_DEG: Domain<f64> = from_to(0.0, 90.0);
/// Up to a radius of a micrometre.
const CURVATURE_1_M: Domain<f64> = above(0.0, 1e6);
const MARGIN: Domain<f64> = from_to(0.0, 0.5);
/// The paper keeps F* away from both ends of the usable forces by a margin eta but gives no value; 5 % is our choice.
const FORCE_MARGIN: f64 = 0.05;
/// Below 1, the object falls.
const SAFETY_FACTOR: Domain<f64> = from_to(1.0, 100.0);
/// Makers of grippers compute with m (g + a) S / mu (assemblymag.com/articles/91040): 2 bears an acceleration a of 1 g, or
/// half of the friction.
const SAFETY: f64 = 2.0;
/// The gripper of the paper's experiments.
const GRIPPER: &str = "paper";

/// The keys that a scene may set: all of them, because they affect only this scene's result.
pub const SCENE_KEYS: &[SceneKey] = &[
    SceneKey::any("part"),
    SceneKey::any("point"),
    SceneKey::any("auto"),
    SceneKey::name_or_path("gripper", GripperProfile::is_builtin),
    SceneKey::any("lift-angle-deg"),
    SceneKey::any("max-curvature"),
    SceneKey::any("force"),
    SceneKey::any("safety-factor"),
    SceneKey::any("force-margin"),
    SceneKey::any("policy"),
];

/// How the force to press with follows from what holds the object and what damages the part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ForceRule {
    /// The least force that holds the object, times the safety factor
    #[default]
    Safety,
    /// The paper's F*, midway between F_min and F_max as far as the gripper can
    Paper,
}

/// Which values of the intervals determine the force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// The `mid` value of every input, as in the paper.
    #[default]
    Mid,
    /// The worst case of both bounds: heaviest and slipperiest for F_min, weakest, softest and thinnest for F_max.
    Safe,
}

impl Policy {
    /// The coefficient of friction on which a grasp may rely.
    pub fn friction(self, friction: Estimate) -> f64 {
        match self {
            Self::Mid => friction.mid,
            Self::Safe => friction.low,
        }
    }
}

/// Options of the grasp stage.
#[derive(Debug, Clone, PartialEq, Args, Serialize)]
#[command(next_help_heading = "Grasp")]
pub struct Options {
    /// Grasp this part: its number, or its name, caption or material, or any text within one of them
    #[arg(long, value_name = "NAME", overrides_with_all = ["point", "auto"])]
    pub part: Option<String>,
    /// Grasp near this point (scene units, in the splat's frame)
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true, overrides_with_all = ["part", "auto"])]
    pub point: Option<[f64; 3]>,
    /// Grasp at the best place: antipodal, within the stroke, near the centre of mass. This is also the default, but with
    /// --auto, `gprop run` and `gprop report` too end with an error if no place fits
    #[arg(long, overrides_with_all = ["part", "point"])]
    pub auto: bool,
    #[arg(long, value_name = "NAME|FILE", default_value_t = GRIPPER.to_owned(), help = gripper_help())]
    pub gripper: String,
    /// Angle between the direction of the lift and straight up, in degrees from 0 to 90
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = LIFT_ANGLE_DEG)]
    pub lift_angle_deg: f64,
    /// Largest curvature kappa_max that the grasped part tolerates, in 1/m [default: by the material's family, 0.5 for metal;
    /// the paper takes 0.5 for all]
    #[arg(long, value_name = "1/M", value_parser = CURVATURE_1_M)]
    pub max_curvature: Option<f64>,
    /// How hard to press
    #[arg(long, value_enum, default_value_t)]
    pub force: ForceRule,
    /// How many times the least force that holds the object to press with, from 1 to 100; never above F_max and the
    /// gripper's range
    #[arg(long, value_name = "FACTOR", default_value_t = SAFETY, value_parser = SAFETY_FACTOR)]
    pub safety_factor: f64,
    /// Margin eta at both ends of the usable forces, as a fraction of their span, from 0 to 0.5
    #[arg(long, value_name = "SHARE", default_value_t = FORCE_MARGIN, value_parser = MARGIN)]
    pub force_margin: f64,
    /// Which values of the intervals determine the force
    #[arg(long, value_enum, default_value_t)]
    pub policy: Policy,
}

/// The help text of `--gripper`.
fn gripper_help() -> String {
    format!("Built-in gripper ({}) or TOML profile (see grippers/README.md)", GripperProfile::builtin_names())
}

impl Default for Options {
    fn default() -> Self {
        option_values::defaults()
    }
}

impl Options {
    /// True if the user says where to grasp.
    pub fn names_a_place(&self) -> bool {
        self.part.is_some() || self.point.is_some() || self.auto
    }

    /// The largest curvature that a part of this family tolerates, in 1/m.
    pub fn max_curvature_of(&self, family: &str) -> f64 {
        self.max_curvature.unwrap_or_else(|| curvature::of_family(family))
    }

    /// Checks that every number is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        if let Some([x, y, z]) = self.point.filter(|point| point.iter().any(|x| !x.is_finite())) {
            let remedy = "give three numbers in scene units".to_owned();
            return Err(OptionError { flag: "--point", value: format!("{x},{y},{z}"), remedy });
        }
        LIFT_ANGLE_DEG.check("--lift-angle-deg", self.lift_angle_deg)?;
        CURVATURE_1_M.check("--max-curvature", self.max_curvature)?;
        SAFETY_FACTOR.check("--safety-factor", self.safety_factor)?;
        MARGIN.check("--force-margin", self.force_margin)
    }
}

/// Three numbers.
///
/// # Errors
/// If it is anything else.
pub fn point(text: &str) -> Result<[f64; 3], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse::<f64>()).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) if [x, y, z].iter().all(|v| v.is_finite()) => Ok([x, y, z]),
        _ => Err("not three numbers separated by commas".to_owned()),
    }
}
