//! Scenarios by name and parameters, and from TOML files: a first pose and a list of steps, each on a part or a region.
//!
//! A named scenario is equivalent to a file, but written in code: [`named`] turns parameters into a [`Script`].

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;

use super::action::{Action, Effect};
use super::error::SimulateError;
use super::material::Material;
use crate::mpm::particles::Particle;
use crate::words::output::toml_problem;

/// An object that falls from more than a thousand times its height falls for longer than is worth simulating.
pub(super) const HIGHEST_DROP: f64 = 1000.0;
/// In degrees.
pub(super) const FULL_TURN: f64 = 360.0;

/// A scenario: its name, a description, and its parameters with their defaults.
pub struct Known {
    pub name: &'static str,
    /// What happens to the object, without the subject.
    pub what: &'static str,
    /// For the film on a page.
    pub caption: &'static str,
    pub parameters: &'static [(&'static str, f64, &'static str)],
}

/// The scenarios that need no file. Times are fractions of the simulated time.
pub const KNOWN: [Known; 8] = [
    Known {
        name: "drop",
        what: "falls onto the ground (see --ground), tilted",
        caption: "Dropped onto the ground",
        parameters: &[
            ("height", 0.5, "in multiples of the longest side, like --drop-height"),
            ("tilt", 25.0, "in degrees, like --tilt-deg"),
        ],
    },
    Known {
        name: "push",
        what: "is pushed with a steady force on its upper third, straight down or sideways",
        caption: "Pushed at its upper third",
        parameters: &[("force", 1.0, "times the object's weight"), ("down", 1.0, "1: straight down; 0: along x")],
    },
    Known {
        name: "poke",
        what: "gets a short sideways blow at the top",
        caption: "Hit sideways at the top",
        parameters: &[("force", 5.0, "times the object's weight"), ("lasts", 0.02, "fraction of the simulated time")],
    },
    Known {
        name: "twist",
        what: "is held at one end of its longest side and twisted about that axis at the other",
        caption: "Twisted",
        parameters: &[("rate", 2.0, "rad/s")],
    },
    Known {
        name: "stretch",
        what: "is pulled apart at both ends of its longest side",
        caption: "Stretched",
        parameters: &[("speed", 0.2, "in longest sides per second")],
    },
    Known {
        name: "wind",
        what: "stands in wind along x",
        caption: "In the wind",
        parameters: &[
            ("speed", 5.0, "m/s"),
            ("response", 1.0, "s, time constant with which parts take up the wind's speed"),
        ],
    },
    Known {
        name: "shake",
        what: "is shaken along x",
        caption: "Shaken",
        parameters: &[("acceleration", 10.0, "m/s^2"), ("frequency", 4.0, "Hz")],
    },
    Known {
        name: "release",
        what: "hangs by its top, then is let go",
        caption: "Hung by its top, then let go",
        parameters: &[
            ("height", 0.5, "above the ground, in multiples of the longest side"),
            ("after", 0.3, "fraction of the simulated time"),
        ],
    },
];

/// A caption for a film of the scenario with this name; that of a file is named after it.
pub fn caption(scenario: &str) -> String {
    let known = KNOWN.iter().find(|known| known.name == scenario);
    known.map_or_else(|| format!("Scenario {scenario}"), |known| known.caption.to_owned())
}

/// True if the value of `--scenario` is a scenario's name; otherwise it is the path of a file.
pub fn is_name(text: &str) -> bool {
    !text.to_ascii_lowercase().ends_with(".toml")
}

/// A scenario as written in a file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Script {
    /// Height above the ground, in multiples of the longest side.
    #[serde(default)]
    pub drop_height: f64,
    #[serde(default)]
    pub tilt_deg: f64,
    #[serde(default, rename = "step")]
    pub steps: Vec<Step>,
}

/// One action on one region.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// `all`, `top`, `bottom`, `low_end`, `high_end`, or parts: by caption or material, or by words from these.
    pub on: String,
    /// Fractions of the simulated time.
    #[serde(default)]
    pub from: f64,
    #[serde(default = "one")]
    pub to: f64,
    #[serde(rename = "do")]
    pub what: What,
}

/// The kind of action. World axes.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum What {
    /// Total force, in multiples of the object's weight.
    Force {
        weights: [f64; 3],
    },
    Hold,
    Move {
        velocity_m_s: [f64; 3],
    },
    /// Moves along the longest side, in longest sides per second.
    Draw {
        speed: f64,
    },
    Turn {
        rate_rad_s: f64,
        #[serde(default)]
        about: About,
    },
    Wind {
        velocity_m_s: [f64; 3],
        response_s: f64,
    },
    Shake {
        acceleration_m_s2: [f64; 3],
        frequency_hz: f64,
    },
}

impl Step {
    fn is_finite(&self) -> bool {
        let of_what: &[f64] = match &self.what {
            What::Hold => &[],
            What::Force { weights: numbers } | What::Move { velocity_m_s: numbers } => numbers,
            What::Draw { speed: number } | What::Turn { rate_rad_s: number, .. } => std::slice::from_ref(number),
            What::Wind { velocity_m_s: [x, y, z], response_s: last }
            | What::Shake { acceleration_m_s2: [x, y, z], frequency_hz: last } => &[*x, *y, *z, *last],
        };
        of_what.iter().chain([&self.from, &self.to]).all(|number| number.is_finite())
    }

    /// Whether nothing of its time lies within the simulated time.
    fn never_acts(&self) -> bool {
        self.from.max(0.0) >= self.to.min(1.0)
    }
}

impl What {
    /// Whether it gives its particles their motion, instead of a force.
    pub fn guides(&self) -> bool {
        matches!(self, Self::Hold | Self::Move { .. } | Self::Draw { .. } | Self::Turn { .. })
    }
}

/// The axis of a rotation, through the object's middle.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum About {
    #[default]
    Upright,
    /// The axis of the longest side.
    Longest,
}

fn one() -> f64 {
    1.0
}

impl Script {
    /// Reads a scenario file.
    ///
    /// # Errors
    /// [`SimulateError::Scenario`] for invalid TOML, unknown keys, numbers that are out of range or not finite, or a step that
    /// never acts.
    pub fn from_toml(text: &str) -> Result<Self, SimulateError> {
        let script: Self = toml::from_str(text).map_err(|error| SimulateError::Scenario(toml_problem(&error, text)))?;
        script.check()?;
        Ok(script)
    }

    /// Checks that the height and the tilt are within the limits of the options, that all numbers of steps are finite, and
    /// that every step acts at some time.
    fn check(&self) -> Result<(), SimulateError> {
        if !(0.0..=HIGHEST_DROP).contains(&self.drop_height) {
            let height = self.drop_height;
            return Err(SimulateError::Scenario(format!(
                "the drop's height is {height}; give 0 to {HIGHEST_DROP} times the longest side"
            )));
        }
        if !(-FULL_TURN..=FULL_TURN).contains(&self.tilt_deg) {
            let tilt = self.tilt_deg;
            return Err(SimulateError::Scenario(format!(
                "the tilt is {tilt}; give -{FULL_TURN} to {FULL_TURN} degrees"
            )));
        }
        for (number, step) in (1..).zip(&self.steps) {
            let Step { from, to, .. } = step;
            if !step.is_finite() {
                let problem = format!("step {number}: a value is infinite or NaN; give finite numbers");
                return Err(SimulateError::Scenario(problem));
            }
            if step.never_acts() {
                return Err(SimulateError::Scenario(format!(
                    "step {number} never acts: it lasts from {from} to {to} of the simulated time; give two different \
                     fractions from 0 to 1, the smaller first"
                )));
            }
        }
        Ok(())
    }
}

/// The scenario `name` with parameters given as `key=value`.
///
/// # Errors
/// [`SimulateError::Scenario`] for an unknown scenario or parameter, or a value that is not a number or out of range.
pub fn named(name: &str, given: &[String]) -> Result<Script, SimulateError> {
    let known = KNOWN.iter().find(|k| k.name == name).ok_or_else(|| {
        let names: Vec<&str> = KNOWN.iter().map(|k| k.name).collect();
        SimulateError::Scenario(format!(
            "there is no scenario `{name}`: give one of {}, or a TOML file",
            names.join(", ")
        ))
    })?;
    let script = of_values(name, &values(known, given)?);
    script.check()?;
    Ok(script)
}

/// The values of the parameters of a scenario: those that are given, the defaults of the others.
fn values(known: &Known, given: &[String]) -> Result<BTreeMap<&'static str, f64>, SimulateError> {
    let (name, bad) = (known.name, |text: String| SimulateError::Scenario(text));
    let mut values: BTreeMap<&str, f64> = known.parameters.iter().map(|(key, value, _)| (*key, *value)).collect();
    for text in given {
        let (key, value) = text.split_once('=').unwrap_or((text, ""));
        let slot = values.get_mut(key).ok_or_else(|| {
            // A part's property looks like a parameter.
            let instead = if key.contains('.') {
                format!("; a part is corrected with `--correct {text}`")
            } else {
                String::new()
            };
            bad(format!("`{name}` has no parameter `{key}`: see `gprop simulate --list`{instead}"))
        })?;
        *slot = value
            .parse()
            .ok()
            .filter(|v: &f64| v.is_finite())
            .ok_or_else(|| bad(format!("`{text}`: give a finite number after the `=`")))?;
    }
    Ok(values)
}

/// The scenario `name` with the values of its parameters.
fn of_values(name: &str, values: &BTreeMap<&str, f64>) -> Script {
    let step = |on: &str, what| Step { on: on.to_owned(), from: 0.0, to: 1.0, what };
    let mut script = Script { drop_height: 0.0, tilt_deg: 0.0, steps: vec![] };
    script.steps = match name {
        "push" if values["down"] != 0.0 => vec![step("top", What::Force { weights: [0.0, 0.0, -values["force"]] })],
        "push" => vec![step("top", What::Force { weights: [values["force"], 0.0, 0.0] })],
        "poke" => {
            let what = What::Force { weights: [values["force"], 0.0, 0.0] };
            vec![Step { to: values["lasts"], ..step("top", what) }]
        }
        "twist" => {
            let what = What::Turn { rate_rad_s: values["rate"], about: About::Longest };
            vec![step("low_end", What::Hold), step("high_end", what)]
        }
        "stretch" => vec![
            step("low_end", What::Draw { speed: -values["speed"] / 2.0 }),
            step("high_end", What::Draw { speed: values["speed"] / 2.0 }),
        ],
        "wind" => {
            let (velocity_m_s, response_s) = ([values["speed"], 0.0, 0.0], values["response"]);
            vec![step("all", What::Wind { velocity_m_s, response_s })]
        }
        "shake" => {
            let (acceleration_m_s2, frequency_hz) = ([values["acceleration"], 0.0, 0.0], values["frequency"]);
            vec![step("all", What::Shake { acceleration_m_s2, frequency_hz })]
        }
        "drop" => {
            script.drop_height = values["height"];
            script.tilt_deg = values["tilt"];
            vec![]
        }
        "release" => {
            script.drop_height = values["height"];
            vec![Step { to: values["after"], ..step("top", What::Hold) }]
        }
        _ => vec![],
    };
    // A blow of no duration, or an object that is let go at once.
    script.steps.retain(|step| step.to != 0.0);
    script
}

/// The object that a script acts on, in its initial pose.
pub struct Standing<'a> {
    pub particles: &'a [Particle],
    /// Per particle: whether it is part of the object; strays of the cloud are not.
    pub is_solid: &'a [bool],
    /// Per particle: index into `names`.
    pub labels: &'a [u32],
    /// The names by which a step may refer to each part: its caption and its material.
    pub names: &'a [Vec<&'a str>],
    pub longest_m: f64,
    pub gravity_m_s2: f64,
    pub duration_s: f64,
}

impl Standing<'_> {
    /// The steps with their particles.
    ///
    /// # Errors
    /// [`SimulateError::Part`] for a part that does not exist.
    pub fn actions(&self, steps: &[Step]) -> Result<Vec<Action>, SimulateError> {
        steps.iter().map(|step| self.action(step)).collect()
    }

    fn action(&self, step: &Step) -> Result<Action, SimulateError> {
        let mask = self.region(&step.on)?;
        let masked = self.particles.iter().zip(&mask).filter(|(_, m)| **m).map(|(p, _)| p);
        let mass_of = |p: &Particle| f64::from(p.mass_kg);
        let (whole, part) = (self.particles.iter().map(mass_of).sum::<f64>(), masked.map(mass_of).sum::<f64>());
        let effect = match step.what {
            What::Force { weights } => {
                let share = (self.gravity_m_s2.abs() * whole / part.max(f64::MIN_POSITIVE)).max(0.0);
                Effect::Accelerate(weights.map(|w| (w * share) as f32))
            }
            What::Hold => Effect::Move([0.0; 3]),
            What::Move { velocity_m_s } => Effect::Move(velocity_m_s.map(|v| v as f32)),
            What::Draw { speed } => {
                let mut velocity = [0.0; 3];
                velocity[self.longest_axis()] = (speed * self.longest_m) as f32;
                Effect::Move(velocity)
            }
            What::Turn { rate_rad_s, about } => {
                let axis = match about {
                    About::Upright => 2,
                    About::Longest => self.longest_axis(),
                };
                let center = [0, 1, 2].map(|a| self.extent(a).iter().sum::<f32>() / 2.0);
                Effect::Turn { axis, center, rate: rate_rad_s as f32 }
            }
            What::Wind { velocity_m_s, response_s } if response_s > 0.0 => {
                Effect::Wind { velocity: velocity_m_s.map(|v| v as f32), response_s: response_s as f32 }
            }
            What::Wind { .. } => return Err(SimulateError::Scenario("a wind's response must be positive".to_owned())),
            What::Shake { acceleration_m_s2, frequency_hz } => {
                Effect::Shake { acceleration: acceleration_m_s2.map(|a| a as f32), frequency_hz }
            }
        };
        Ok(Action { from_s: step.from * self.duration_s, to_s: step.to * self.duration_s, mask, effect })
    }

    /// The particles of a region or a part.
    fn region(&self, on: &str) -> Result<Vec<bool>, SimulateError> {
        /// Fractions of the object's extent.
        const TOP: f32 = 1.0 / 3.0;
        const BOTTOM: f32 = 0.1;
        const END: f32 = 0.1;
        let within = |axis: usize, from: f32, to: f32| {
            let [low, high] = self.extent(axis);
            // Strays beyond an end belong to it.
            let share = |p: &Particle| (p.position_m[axis] - low) / (high - low).max(f32::MIN_POSITIVE);
            self.particles.iter().map(|p| (from..=to).contains(&share(p).clamp(0.0, 1.0))).collect()
        };
        Ok(match on {
            "all" => vec![true; self.particles.len()],
            "top" => within(2, 1.0 - TOP, 1.0),
            "bottom" => within(2, 0.0, BOTTOM),
            "low_end" => within(self.longest_axis(), 0.0, END),
            "high_end" => within(self.longest_axis(), 1.0 - END, 1.0),
            part => {
                let simulated: BTreeSet<u32> = self.labels.iter().copied().collect();
                let unknown =
                    || SimulateError::Part { part: part.to_owned(), names: all_names(self.names, &simulated) };
                let found = parts_named(self.names, &simulated, part).ok_or_else(unknown)?;
                self.labels.iter().map(|&l| found[l as usize]).collect()
            }
        })
    }

    /// The lowest and the highest coordinate of the solid particles; of all particles if none is solid.
    fn extent(&self, axis: usize) -> [f32; 2] {
        let none_is_solid = !self.is_solid.contains(&true);
        let counted = || self.particles.iter().zip(self.is_solid).filter(move |(_, solid)| **solid || none_is_solid);
        let places = || counted().map(|(p, _)| p.position_m[axis]);
        [places().fold(f32::INFINITY, f32::min), places().fold(f32::NEG_INFINITY, f32::max)]
    }

    fn longest_axis(&self) -> usize {
        let length = |a: usize| self.extent(a)[1] - self.extent(a)[0];
        (0..3).max_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap_or(0)
    }
}

/// The names of each part by which a step or an option may refer to it: its caption and its material.
pub(super) fn names_of_parts(materials: &[Material]) -> Vec<Vec<&str>> {
    materials.iter().map(|material| vec![material.caption.as_str(), material.name.as_str()]).collect()
}

/// For each part, whether `part` refers to it: by one of its `names`, or, if no part has this name, by words from one of
/// its names. Nothing can act on a part that is not among the `simulated` ones, but its name still stands for no other
/// part. `None` if `part` refers to no simulated part.
pub(super) fn parts_named(names: &[Vec<&str>], simulated: &BTreeSet<u32>, part: &str) -> Option<Vec<bool>> {
    let named = |fits: fn(&str, &str) -> bool| -> Vec<bool> {
        names.iter().map(|names| names.iter().any(|name| fits(name, part))).collect()
    };
    let mut found = named(|name, part| name.to_lowercase() == part.to_lowercase());
    if !found.contains(&true) {
        found = named(mentions);
    }
    for (label, found) in (0_u32..).zip(&mut found) {
        *found &= simulated.contains(&label);
    }
    found.contains(&true).then_some(found)
}

/// The names of all `simulated` parts, as a text.
pub(super) fn all_names(names: &[Vec<&str>], simulated: &BTreeSet<u32>) -> String {
    let mut all: Vec<&str> = simulated.iter().flat_map(|&label| &names[label as usize]).copied().collect();
    all.sort_unstable();
    all.dedup();
    all.join("`, `")
}

/// True if the words of `part` occur in `name`, in their order and in singular or plural: "handle" in "body and handles
/// of a pot", "legs" in "front leg".
fn mentions(name: &str, part: &str) -> bool {
    let words = |text: &str| -> Vec<String> {
        let words = text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
        words.map(|word| singular(&word.to_lowercase()).to_owned()).collect()
    };
    let wanted = words(part);
    !wanted.is_empty() && words(name).windows(wanted.len()).any(|found| found == wanted)
}

/// A word without a plural s: "legs" becomes "leg"; "glass" and "gas" stay.
fn singular(word: &str) -> &str {
    match word.strip_suffix('s') {
        Some(stem) if stem.len() > 2 && !stem.ends_with('s') => stem,
        _ => word,
    }
}
