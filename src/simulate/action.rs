//! What a scenario does to the object while it runs: velocities of chosen particles are changed before each substep.

use super::mpm::Solver;

/// Times from when on until when, s, and the particles it acts on.
#[derive(Debug, Clone, PartialEq)]
pub struct Action {
    pub from_s: f64,
    pub to_s: f64,
    /// By particle, in the order they were given.
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
    /// Drag: the velocity nears the air's with a time constant.
    Wind {
        velocity: [f32; 3],
        response_s: f32,
    },
    /// A given velocity; zero holds.
    Move([f32; 3]),
    /// Turns about the upright axis through `center`, counterclockwise seen from above, rad/s.
    Turn {
        center: [f32; 2],
        rate: f32,
    },
}

/// Does what is due at time `t_s` for a step of `dt_s`.
pub fn act(actions: &[Action], solver: &mut Solver, t_s: f64, dt_s: f64) {
    for action in actions.iter().filter(|a| a.from_s <= t_s && t_s < a.to_s) {
        let effect = action.effect;
        let dt = dt_s as f32;
        solver.change_velocities(|id, x, v| {
            if !action.mask[id as usize] {
                return v;
            }
            let plus = |a: [f32; 3], s: f32| [v[0] + a[0] * s, v[1] + a[1] * s, v[2] + a[2] * s];
            match effect {
                Effect::Accelerate(a) => plus(a, dt),
                Effect::Shake { acceleration, frequency_hz } => {
                    plus(acceleration, dt * (std::f64::consts::TAU * frequency_hz * t_s).sin() as f32)
                }
                Effect::Wind { velocity, response_s } => {
                    let share = 1.0 - (-dt / response_s).exp();
                    [0, 1, 2].map(|a| v[a] + share * (velocity[a] - v[a]))
                }
                Effect::Move(velocity) => velocity,
                Effect::Turn { center, rate } => [-(x[1] - center[1]) * rate, (x[0] - center[0]) * rate, 0.0],
            }
        });
    }
}
