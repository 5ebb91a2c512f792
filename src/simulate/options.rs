//! The user's options for the simulation.

use serde::Serialize;

use super::animation::Viewpoint;
use super::material::Soften;
use super::rigid::choice;
use super::script::{self, FULL_TURN, HIGHEST_DROP};
use crate::config::SceneKey;
use crate::config::option_values::{self, Domain, OptionError, above, from_to};
use crate::mpm::boundary::Contact;

/// The keys that a scene may set: what happens to its object and how it is filmed. How long the user is willing to wait
/// and how large a film they want are not among them.
pub const SCENE_KEYS: &[SceneKey] = &[
    SceneKey::any("drop-height"),
    SceneKey::any("tilt-deg"),
    SceneKey::name_or_path("scenario", script::is_name),
    SceneKey::any("set"),
    SceneKey::any("anchor"),
    SceneKey::any("fixed-step"),
    SceneKey::any("duration"),
    SceneKey::with("frames", may_be_frames_of_scene, "up to 60"),
    SceneKey::any("grid"),
    SceneKey::any("gravity"),
    SceneKey::any("ground"),
    SceneKey::any("ground-friction"),
    SceneKey::any("max-stiffness"),
    SceneKey::any("soften"),
    SceneKey::any("rigid"),
    SceneKey::any("fillings"),
    SceneKey::any("cfl"),
    SceneKey::any("film-from"),
    SceneKey::any("azimuth-deg"),
    SceneKey::any("elevation-deg"),
    SceneKey::any("turntable"),
];

/// The most frames that a scene may ask for, each of which is a splat on the disk: as many as the report shows.
const MOST_FRAMES_OF_SCENE: u32 = 60;

/// False for a number of frames that only the user may ask for.
fn may_be_frames_of_scene(text: &str) -> bool {
    !text.parse::<u32>().is_ok_and(|frames| frames > MOST_FRAMES_OF_SCENE)
}

const DROP_HEIGHT: Domain<f64> = from_to(0.0, HIGHEST_DROP);
const TILT_DEG: Domain<f64> = from_to(-FULL_TURN, FULL_TURN);
/// Up to an hour.
const SECONDS: Domain<f64> = above(0.0, 3600.0);
/// Up to two years.
const MINUTES: Domain<f64> = above(0.0, 1e6);
const FRAMES: Domain<u32> = from_to(2, 10_000);
const GRID: Domain<u32> = from_to(4, 512);
/// Up to more than three times the sun's surface gravity.
const GRAVITY: Domain<f64> = from_to(-1000.0, 1000.0);
/// Up to ten times the friction of the stickiest rubber.
const FRICTION: Domain<f64> = from_to(0.0, 100.0);
/// Up to ten times as stiff as diamond.
const STIFFNESS_PA: Domain<f64> = above(0.0, 1e13);
const CFL: Domain<f64> = above(0.0, 1.0);

/// `--fillings`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Fillings {
    /// Fillings move with their shell if it is rigid, and follow their own material law if it deforms; takes no extra
    /// time.
    #[default]
    Weigh,
    /// Each follows its own material law: liquids slosh, grains shift, foams give.
    Simulate,
    /// Shells are empty.
    Ignore,
}

/// How the object is dropped, how finely and for how long it is simulated.
#[derive(Debug, Clone, PartialEq, clap::Args, Serialize)]
#[command(next_help_heading = "Simulation")]
pub struct Options {
    /// Height of the drop, as a multiple of the longest side (only for the scenario `drop`)
    #[arg(long, value_name = "RATIO", default_value_t = 0.5, value_parser = DROP_HEIGHT)]
    pub drop_height: f64,

    /// Tilt before the drop, in degrees (only for the scenario `drop`)
    #[arg(long, value_name = "DEGREES", default_value_t = 25.0, allow_negative_numbers = true, value_parser = TILT_DEG)]
    pub tilt_deg: f64,

    /// Scenario: a name (see `gprop simulate --list`) or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "drop")]
    pub scenario: String,

    /// Set a parameter of the named scenario; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,

    /// Hold these parts, or `top`, `bottom`, `low_end` or `high_end`, in place; repeatable
    #[arg(long, value_name = "PART")]
    pub anchor: Vec<String>,

    /// Use this fixed time step, even if it is not stable; for comparisons
    #[arg(long, value_name = "SECONDS", value_parser = SECONDS)]
    pub fixed_step: Option<f64>,

    /// Refuse a simulation that is expected to take longer than this many minutes, and stop one that turns out to need
    /// more than twice the steps that fit into that time
    #[arg(long, value_name = "MINUTES", default_value_t = 120.0, value_parser = MINUTES)]
    pub max_simulation_minutes: f64,

    /// Simulated time in seconds [default: 4.8 sqrt(longest side / 9.8 m/s^2), about the time to fall, bounce and come to
    /// rest; 0.9 s for a hammer]
    #[arg(long, value_name = "SECONDS", value_parser = SECONDS)]
    pub duration: Option<f64>,

    /// Number of frames to write, spread evenly over the simulated time, including the start
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = FRAMES)]
    pub frames: u32,

    /// Grid cells along the object's longest side
    #[arg(long, value_name = "CELLS", default_value_t = 32, value_parser = GRID)]
    pub grid: u32,

    /// Gravitational acceleration in m/s^2, along -z; the default is the paper's
    #[arg(long, value_name = "M/S2", default_value_t = crate::units::GRAVITY_M_S2, value_parser = GRAVITY)]
    pub gravity: f64,

    /// How the ground acts on a body that touches it
    #[arg(long, value_enum, default_value_t = Ground::Separate)]
    pub ground: Ground,

    /// Coulomb friction on `--ground separate` (about 0.4 for wood on wood)
    #[arg(long, value_name = "MU", default_value_t = 0.4, value_parser = FRICTION)]
    pub ground_friction: f64,

    /// Parts that move as rigid bodies: `auto` (those whose deformation would not show; none in twist and stretch), `never`,
    /// or their names; repeatable
    #[arg(long, value_name = "auto|never|PART", default_values_t = [choice::AUTO.to_owned()])]
    pub rigid: Vec<String>,

    /// How to treat the fillings of shells, which no photo shows
    #[arg(long, value_enum, default_value_t)]
    pub fillings: Fillings,

    /// Largest Young's modulus to simulate, in Pa. If a part that deforms is stiffer, materials are softened (see --soften)
    /// and their strength is reduced in proportion, so that they yield at the same strain; the running time grows with this
    /// limit's square root [default: 2e7 with --compat; otherwise none with --fixed-step or if the simulation is expected to
    /// take a minute at most, else 2e7]
    #[arg(long, value_name = "PA", value_parser = STIFFNESS_PA)]
    pub max_stiffness: Option<f64>,

    /// How to soften materials that are stiffer than --max-stiffness
    #[arg(long, value_enum, default_value_t)]
    pub soften: Soften,

    /// Time step, as a fraction of the time in which the fastest wave crosses a grid cell
    #[arg(long, value_name = "SHARE", default_value_t = 0.4, value_parser = CFL)]
    pub cfl: f64,

    #[command(flatten)]
    pub viewpoint: Viewpoint,
}

/// How the ground acts on a body that touches it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ground {
    /// The body can leave the ground and is slowed by friction.
    Separate,
    /// The body can slide, but not leave.
    Slip,
    /// The body sticks to the ground.
    Sticky,
}

impl Options {
    /// Checks that every number is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        DROP_HEIGHT.check("--drop-height", self.drop_height)?;
        TILT_DEG.check("--tilt-deg", self.tilt_deg)?;
        SECONDS.check("--fixed-step", self.fixed_step)?;
        MINUTES.check("--max-simulation-minutes", self.max_simulation_minutes)?;
        SECONDS.check("--duration", self.duration)?;
        FRAMES.check("--frames", self.frames)?;
        GRID.check("--grid", self.grid)?;
        GRAVITY.check("--gravity", self.gravity)?;
        FRICTION.check("--ground-friction", self.ground_friction)?;
        STIFFNESS_PA.check("--max-stiffness", self.max_stiffness)?;
        CFL.check("--cfl", self.cfl)?;
        self.viewpoint.check()
    }

    /// The ground's boundary condition on the grid.
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
        option_values::defaults()
    }
}
