//! Actions of a scenario on the object while it runs. Forces change the velocities of chosen particles before a
//! substep; held or guided particles follow their given motion instead of the grid's.

use nalgebra::{Matrix3, Vector3};

use super::mpm::particles::Motion;
use super::mpm::{Lost, Solver};

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
    /// The motion that it imposes on a particle at `position`; `None` for a force.
    fn led(&self, position: [f32; 3]) -> Option<Motion> {
        match *self {
            Self::Move(velocity_m_s) => Some(Motion { velocity_m_s, gradient: Matrix3::zeros() }),
            Self::Turn { axis, center, rate } => {
                let mut spin = Vector3::zeros();
                spin[axis] = rate;
                let velocity = spin.cross(&(Vector3::from(position) - Vector3::from(center)));
                Some(Motion { velocity_m_s: velocity.into(), gradient: spin.cross_matrix() })
            }
            Self::Accelerate(_) | Self::Shake { .. } | Self::Wind { .. } => None,
        }
    }

    /// The velocity `v` after a force acted on it for `dt` at time `t_s`.
    fn changed(&self, v: [f32; 3], t_s: f64, dt: f32) -> [f32; 3] {
        let plus = |a: [f32; 3], s: f32| [v[0] + a[0] * s, v[1] + a[1] * s, v[2] + a[2] * s];
        match *self {
            Self::Accelerate(a) => plus(a, dt),
            Self::Shake { acceleration, frequency_hz } => {
                plus(acceleration, dt * (std::f64::consts::TAU * frequency_hz * t_s).sin() as f32)
            }
            Self::Wind { velocity, response_s } => {
                let share = 1.0 - (-dt / response_s).exp();
                [0, 1, 2].map(|a| v[a] + share * (velocity[a] - v[a]))
            }
            Self::Move(_) | Self::Turn { .. } => v,
        }
    }
}

/// Takes a substep of `dt_s` at time `t_s` with the actions that are active then. Of several motions the last one
/// counts.
///
/// # Errors
/// If a particle is lost.
pub fn step(actions: &[Action], solver: &mut Solver, t_s: f64, dt_s: f64) -> Result<(), Lost> {
    let dt = dt_s as f32;
    let due = actions.iter().filter(|a| a.from_s <= t_s && t_s < a.to_s);
    let (leads, forces): (Vec<&Action>, Vec<&Action>) = due.partition(|a| a.effect.led([0.0; 3]).is_some());
    for action in forces {
        let acts_on = |id: u32| action.mask[id as usize];
        solver.change_velocities(|id, v| if acts_on(id) { action.effect.changed(v, t_s, dt) } else { v });
    }
    if leads.is_empty() {
        return solver.step(dt);
    }
    solver.step_led(dt, |id, x| leads.iter().rev().find(|a| a.mask[id as usize]).and_then(|a| a.effect.led(x)))
}
