//! What the user may choose about the simulation.

use serde::Serialize;

use super::animation::Viewpoint;
use super::boundary::Contact;

/// How the object is dropped, how finely and for how long it is simulated.
#[derive(Debug, Clone, PartialEq, clap::Args, Serialize)]
#[command(next_help_heading = "Simulation")]
pub struct Options {
    /// Height from which the object is dropped onto the ground, in times its longest side
    #[arg(long, value_name = "RATIO", default_value_t = 0.5, value_parser = not_negative)]
    pub drop_height: f64,

    /// How far the object is tilted before the drop, in degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 25.0, allow_negative_numbers = true, value_parser = finite)]
    pub tilt_deg: f64,

    /// What happens to the object: a scenario by name (see --list) or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "drop")]
    pub scenario: String,

    /// A parameter of the scenario; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,

    /// A part that stays where it is, by name; may be given several times
    #[arg(long, value_name = "PART")]
    pub anchor: Vec<String>,

    /// A fixed time step in seconds, whatever keeps the material stable: for comparisons
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub fixed_step: Option<f64>,

    /// Refuse a simulation that is expected to take longer
    #[arg(long, value_name = "MINUTES", default_value_t = 120.0, value_parser = positive)]
    pub max_minutes: f64,

    /// Simulated time in seconds (default: 4.8 sqrt(longest side / 9.8 m/s^2), about what it takes to fall, bounce and
    /// come to rest: 0.9 s for a hammer)
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub duration: Option<f64>,

    /// Frames to write, spread evenly over the time, the start among them
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    pub frames: u32,

    /// Grid cells along the object's longest side
    #[arg(long, value_name = "CELLS", default_value_t = 32, value_parser = clap::value_parser!(u32).range(4..=512))]
    pub grid: u32,

    /// Gravitational acceleration in m/s^2, downwards along -z (default: the value of the paper's force equations)
    #[arg(long, value_name = "M/S2", default_value_t = crate::units::GRAVITY_M_S2, value_parser = finite)]
    pub gravity: f64,

    /// What the ground does to what touches it
    #[arg(long, value_enum, default_value_t = Ground::Separate)]
    pub ground: Ground,

    /// Coulomb friction between object and a ground that lets go of it (wood on wood is about 0.4)
    #[arg(long, value_name = "MU", default_value_t = 0.4, value_parser = not_negative)]
    pub ground_friction: f64,

    /// Stiffest Young's modulus to step through, in Pa: stiffer materials are softened to it, their strength alike so
    /// that they yield at the same strain; time grows with its square root
    #[arg(long, value_name = "PA", default_value_t = 2e7, value_parser = positive)]
    pub max_stiffness: f64,

    /// Time step as a share of the time in which the fastest wave crosses a grid cell
    #[arg(long, value_name = "SHARE", default_value_t = 0.4, value_parser = positive)]
    pub cfl: f64,

    #[command(flatten)]
    pub viewpoint: Viewpoint,
}

/// What the ground does to what touches it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ground {
    /// Lets go of it, and slows it by friction.
    Separate,
    /// Lets it glide, but not leave.
    Slip,
    /// Holds it.
    Sticky,
}

impl Options {
    /// The ground as the grid knows it.
    pub(super) fn contact(&self) -> Contact {
        match self.ground {
            Ground::Separate => Contact::Separate { friction: self.ground_friction as f32 },
            Ground::Slip => Contact::Slip,
            Ground::Sticky => Contact::Sticky,
        }
    }
}

impl Default for Options {
    fn default() -> Self {
        use clap::{Args, FromArgMatches};
        let matches = Self::augment_args(clap::Command::new("defaults")).get_matches_from(["defaults"]);
        Self::from_arg_matches(&matches).expect("every option has a default")
    }
}

fn finite(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if f64::is_finite(value) => Ok(value),
        _ => Err("not a number".to_owned()),
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    finite(text).and_then(|v| if v >= 0.0 { Ok(v) } else { Err("must not be negative".to_owned()) })
}

fn positive(text: &str) -> Result<f64, String> {
    finite(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err("must be positive".to_owned()) })
}
