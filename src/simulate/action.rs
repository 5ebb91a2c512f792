//! The actions of a scenario on the object during a run. Forces change the velocities of chosen particles before a
//! substep; held or guided particles follow their given motion instead of the grid's. On a rigid body, forces add up to
//! an impulse and an angular impulse.
//!
//! No action limits the length of a step. So a force that varies acts with its mean over the step, and a particle
//! that is turned is on its circle again at the end of the step.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Vector3};

use super::object::{Influence, Object};
use super::rigid::body::{Body, Moments, Velocities};
use super::rigid::coupling::Impulse;
use crate::mpm::Lost;
use crate::mpm::particles::Motion;

/// The start and end of an action, s, and the particles it acts on.
#[derive(Debug, Clone, PartialEq)]
pub struct Action {
    pub from_s: f64,
    pub to_s: f64,
    /// Per particle, in the order in which they were given.
    pub mask: Vec<bool>,
    pub effect: Effect,
}

/// Frame and units are the simulation's: metres, seconds, z up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Effect {
    Accelerate([f32; 3]),
    /// Acceleration a sin(2 pi f t).
    Shake {
        acceleration: [f32; 3],
        frequency_hz: f64,
    },
    /// Drag: the velocity approaches the air's with a time constant.
    Wind {
        velocity: [f32; 3],
        response_s: f32,
    },
    /// A given velocity; zero holds the particles in place.
    Move([f32; 3]),
    /// Turns about the coordinate axis `axis` through `center`, counterclockwise seen from its tip, rad/s.
    Turn {
        axis: usize,
        center: [f32; 3],
        rate: f32,
    },
}

impl Effect {
    /// Whether it gives its particles their motion, instead of a force.
    fn guides(&self) -> bool {
        matches!(self, Self::Move(_) | Self::Turn { .. })
    }

    /// The motion that takes a particle from `position_m` to where it has to be after a step of `dt_s`; `None` for a force.
    fn led(&self, position_m: [f32; 3], dt_s: f64) -> Option<Motion> {
        match *self {
            Self::Move(velocity_m_s) => Some(Motion { velocity_m_s, gradient: Matrix3::zeros() }),
            Self::Turn { axis, center, rate } => {
                let gradient = along_chords(axis, rate.into(), dt_s);
                let velocity = gradient * (in_f64(position_m) - in_f64(center));
                let velocity_m_s = velocity.map(|v| v as f32).into();
                Some(Motion { velocity_m_s, gradient: gradient.map(|g| g as f32) })
            }
            Self::Accelerate(_) | Self::Shake { .. } | Self::Wind { .. } => None,
        }
    }

    /// The velocities that take a body with this centre of mass to where it has to be after a step of `dt_s`; `None` for a
    /// force.
    fn led_body(&self, center_m: Vector3<f64>, dt_s: f64) -> Option<Velocities> {
        match *self {
            Self::Move(velocity_m_s) => Some([in_f64(velocity_m_s), Vector3::zeros()]),
            Self::Turn { axis, center, rate } => {
                let rate = f64::from(rate);
                let velocity_m_s = along_chords(axis, rate, dt_s) * (center_m - in_f64(center));
                Some([velocity_m_s, Vector3::ith(axis, rate)])
            }
            Self::Accelerate(_) | Self::Shake { .. } | Self::Wind { .. } => None,
        }
    }

    /// The impulse and angular impulse of a force that acts for `dt_s` on the part of a rigid body that has `moments`.
    fn impulse(&self, body: &Body, moments: &Moments, t_s: f64, dt_s: f64) -> Impulse {
        let Moments { mass_kg, first, inertia } = body.turned(moments);
        let uniform = |acceleration: Vector3<f64>| [acceleration * (mass_kg * dt_s), first.cross(&acceleration) * dt_s];
        match *self {
            Self::Accelerate(a) => uniform(in_f64(a)),
            Self::Shake { acceleration, frequency_hz } => {
                uniform(in_f64(acceleration) * mean_sine(frequency_hz, t_s, dt_s))
            }
            Self::Wind { velocity, response_s } => {
                let share = -(-dt_s / f64::from(response_s)).exp_m1();
                let (against, spin) = (in_f64(velocity) - body.state().velocity_m_s, body.spin());
                [(against * mass_kg - spin.cross(&first)) * share, (first.cross(&against) - inertia * spin) * share]
            }
            Self::Move(_) | Self::Turn { .. } => [Vector3::zeros(); 2],
        }
    }

    /// The velocity `v` after a force acted on it for `dt` at time `t_s`.
    fn changed(&self, v: [f32; 3], t_s: f64, dt: f32) -> [f32; 3] {
        let plus = |a: [f32; 3], s: f32| [v[0] + a[0] * s, v[1] + a[1] * s, v[2] + a[2] * s];
        match *self {
            Self::Accelerate(a) => plus(a, dt),
            Self::Shake { acceleration, frequency_hz } => {
                plus(acceleration, dt * mean_sine(frequency_hz, t_s, dt.into()) as f32)
            }
            Self::Wind { velocity, response_s } => {
                let share = -(-dt / response_s).exp_m1();
                [0, 1, 2].map(|a| v[a] + share * (velocity[a] - v[a]))
            }
            Self::Move(_) | Self::Turn { .. } => v,
        }
    }
}

fn in_f64(v: [f32; 3]) -> Vector3<f64> {
    v.map(f64::from).into()
}

/// The mean of sin(2 pi f t) over a step of `dt_s` that begins at `t_s`.
fn mean_sine(frequency_hz: f64, t_s: f64, dt_s: f64) -> f64 {
    let half = PI * frequency_hz * dt_s;
    let sinc = if half == 0.0 { 1.0 } else { half.sin() / half };
    (TAU * frequency_hz * (t_s + dt_s / 2.0)).sin() * sinc
}

/// The gradient of the velocity with which everything that turns at `rate` about a coordinate axis moves along the chord
/// of its arc in a step of `dt_s`: (R - 1) / dt, where R is the step's rotation.
fn along_chords(axis: usize, rate: f64, dt_s: f64) -> Matrix3<f64> {
    let (cross, angle) = (Vector3::ith(axis, 1.0).cross_matrix(), rate * dt_s);
    // 1 - cos(angle), without cancellation.
    let rise = 2.0 * (angle / 2.0).sin().powi(2);
    (cross * angle.sin() + cross * cross * rise) / dt_s
}

/// An action, and the moments of the particles of each rigid body that it acts on.
#[derive(Debug, Clone, PartialEq)]
pub struct Acting {
    action: Action,
    on_bodies: Vec<Moments>,
}

/// The actions on an object.
pub fn on(object: &Object, actions: Vec<Action>) -> Vec<Acting> {
    actions.into_iter().map(|action| Acting { on_bodies: object.moments(&action.mask), action }).collect()
}

/// The next time after `t_s` at which an action begins or ends, s.
pub fn next_change_s(actions: &[Acting], t_s: f64) -> f64 {
    let times = actions.iter().flat_map(|acting| [acting.action.from_s, acting.action.to_s]);
    times.filter(|time| *time > t_s).fold(f64::INFINITY, f64::min)
}

/// The time at which `left_s` remain until `to_s`, and the next time at which an action begins or ends, s. An action that
/// begins or ends so soon that a step up to there would be lost in rounding begins or ends now: otherwise such steps would
/// be repeated forever.
pub fn now_and_next_change_s(actions: &[Acting], to_s: f64, left_s: f64) -> (f64, f64) {
    let mut t_s = to_s - left_s;
    loop {
        let change_s = next_change_s(actions, t_s);
        if left_s - (change_s - t_s) != left_s {
            return (t_s, change_s);
        }
        t_s = change_s;
    }
}

/// Takes a substep of `dt_s` at time `t_s` with the actions that are active then. If several of them give a particle its
/// motion, the last one counts; a rigid body moves as a whole if any of its particles is moved.
///
/// # Errors
/// If a particle is lost.
pub fn step(actions: &[Acting], object: &mut Object, t_s: f64, dt_s: f64) -> Result<(), Lost> {
    let due = actions.iter().filter(|a| a.action.from_s <= t_s && t_s < a.action.to_s);
    let (leads, forces) = due.partition(|a| a.action.effect.guides());
    object.step(dt_s, &Due { leads, forces, t_s, dt_s })
}

/// The actions that are active in a substep.
struct Due<'a> {
    leads: Vec<&'a Acting>,
    forces: Vec<&'a Acting>,
    t_s: f64,
    dt_s: f64,
}

impl Influence for Due<'_> {
    fn has_forces(&self) -> bool {
        !self.forces.is_empty()
    }

    fn has_leads(&self) -> bool {
        !self.leads.is_empty()
    }

    fn on_particle(&self, id: u32, velocity_m_s: [f32; 3]) -> [f32; 3] {
        let acting = self.forces.iter().map(|a| &a.action).filter(|action| action.mask[id as usize]);
        acting.fold(velocity_m_s, |v, action| action.effect.changed(v, self.t_s, self.dt_s as f32))
    }

    fn on_body(&self, number: usize, body: &Body) -> Impulse {
        let impulse = |a: &&Acting| a.action.effect.impulse(body, &a.on_bodies[number], self.t_s, self.dt_s);
        self.forces.iter().map(impulse).fold([Vector3::zeros(); 2], |sum, one| [sum[0] + one[0], sum[1] + one[1]])
    }

    fn leads(&self, id: u32, position_m: [f32; 3]) -> Option<Motion> {
        let last = self.leads.iter().rev().map(|a| &a.action).find(|action| action.mask[id as usize]);
        last.and_then(|action| action.effect.led(position_m, self.dt_s))
    }

    fn leads_body(&self, number: usize, center_m: Vector3<f64>) -> Option<Velocities> {
        let last = self.leads.iter().rev().find(|a| a.on_bodies[number].mass_kg > 0.0);
        last.and_then(|a| a.action.effect.led_body(center_m, self.dt_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wind of speed v and time constant T accelerates what rests by v / T at first, however short the step.
    #[test]
    fn wind_acts_in_short_steps_too() {
        let wind = Effect::Wind { velocity: [5.0, 0.0, 0.0], response_s: 2.0 };
        for dt in [1e-3_f32, 1e-6, 1e-9] {
            let gained = f64::from(wind.changed([0.0; 3], 0.0, dt)[0]);
            let expected = 5.0 / 2.0 * f64::from(dt);
            // The next term of the exponential is dt / 2T = 2.5e-4 of the first one.
            assert!((gained / expected - 1.0).abs() < 3e-4, "{gained} m/s in {dt} s, expected {expected} m/s");
        }
    }

    /// From rest, a sin(2 pi f t) gives the velocity a (1 - cos(2 pi f t)) / (2 pi f), in steps shorter and longer than a
    /// period.
    #[test]
    fn shaking_does_not_depend_on_the_step() {
        const ACCELERATION: f32 = 100.0;
        const FREQUENCY_HZ: f64 = 1010.0;
        let shake = |frequency_hz| Effect::Shake { acceleration: [ACCELERATION, 0.0, 0.0], frequency_hz };
        for steps in [50, 500] {
            let dt = 0.05 / f64::from(steps);
            let times = (0..steps).map(|step| f64::from(step) * dt);
            let v = times.fold([0.0; 3], |v, t_s| shake(FREQUENCY_HZ).changed(v, t_s, dt as f32))[0];
            let turned = TAU * FREQUENCY_HZ;
            let expected = f64::from(ACCELERATION) * (1.0 - (turned * 0.05).cos()) / turned;
            // The step in f32 is off by up to 6e-8 of itself in each of 500 steps.
            assert!((f64::from(v) / expected - 1.0).abs() < 1e-4, "{v} m/s in {steps} steps, expected {expected} m/s");
        }
        assert_eq!(shake(0.0).changed([1.0; 3], 0.3, 1e-3), [1.0; 3]);
    }

    /// As a frame is advanced, with the end of an action at a fiftieth of it.
    #[test]
    fn time_goes_on_past_every_change() {
        for n in 1..1000 {
            let to_s = 0.0037 * f64::from(n);
            let action = Action { from_s: 0.0, to_s: 0.02 * to_s, mask: vec![], effect: Effect::Move([0.0; 3]) };
            let actions = [Acting { action, on_bodies: vec![] }];
            let (mut left_s, mut steps) = (to_s, 0);
            while left_s > 0.0 {
                let (t_s, change_s) = now_and_next_change_s(&actions, to_s, left_s);
                let dt_s = (to_s / 100.0).min(change_s - t_s);
                left_s = if dt_s < left_s { left_s - dt_s } else { 0.0 };
                steps += 1;
                assert!(steps <= 200, "time stands still at {t_s} of {to_s} s");
            }
        }
    }
}
