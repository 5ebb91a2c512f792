// Motion: the quantities that the transfers must conserve, and positions after thousands of tiny steps.
mod motion;
// Stress, yield and waves against closed forms.
mod laws;
// The ground.
mod contact;
// Rigid bodies: on the ground, in free flight, beside soft material.
mod rigid;
// Equilibria: a bent beam, a column of water, a heap of sand.
mod statics;
// Trajectories of the public solver, in the default mode.
mod peer;
// The public solver reproduced: configurations, conditions, trajectories, filling.
mod compat;
// Scenarios by name, parameters and file.
mod scenarios;
// The stage: volumes, frames, threads, checkpoints, bad input, the animation.
mod stage;

use gprop::mpm::boundary::Boundary;
use gprop::mpm::laws::Law;
use gprop::mpm::particles::{IDENTITY, Particle};
use gprop::mpm::{Setting, Solver};
use gprop::simulate::material::lame;
use nalgebra::Vector3;

/// An elastic or plastic block for tests, with eight particles per grid cell.
struct Block {
    low_m: [f32; 3],
    size_m: [f32; 3],
    spacing_m: f32,
    density_kg_m3: f64,
    youngs_modulus_pa: f64,
    poisson_ratio: f64,
    velocity_m_s: fn(Vector3<f64>) -> Vector3<f64>,
    law: Law,
    /// The initial value of the law's state.
    state: f64,
}

impl Default for Block {
    fn default() -> Self {
        Self {
            low_m: [0.8; 3],
            size_m: [0.4; 3],
            spacing_m: 0.05,
            density_kg_m3: 1000.0,
            youngs_modulus_pa: 1e5,
            poisson_ratio: 0.3,
            velocity_m_s: |_| Vector3::zeros(),
            law: Law::FixedCorotated,
            state: 0.0,
        }
    }
}

impl Block {
    /// sqrt((lambda + 2 mu) / rho).
    fn wave_speed_m_s(&self) -> f64 {
        let (mu, lambda) = lame(self.youngs_modulus_pa, self.poisson_ratio);
        ((lambda + 2.0 * mu) / self.density_kg_m3).sqrt()
    }

    /// A step that stays well below the CFL bound.
    fn dt_s(&self) -> f32 {
        (0.3 * f64::from(self.spacing_m) / self.wave_speed_m_s()) as f32
    }

    fn particles(&self) -> Vec<Particle> {
        let step = self.spacing_m / 2.0;
        let counts = self.size_m.map(|s| (s / step).round() as usize);
        let volume_m3 = step.powi(3);
        let (mu, lambda) = lame(self.youngs_modulus_pa, self.poisson_ratio);
        let mut particles = Vec::new();
        for i in 0..counts[0] {
            for j in 0..counts[1] {
                for k in 0..counts[2] {
                    let coordinate = |a: usize, n: usize| self.low_m[a] + (n as f32 + 0.5) * step;
                    let position_m = [coordinate(0, i), coordinate(1, j), coordinate(2, k)];
                    let velocity = (self.velocity_m_s)(Vector3::from(position_m.map(f64::from)));
                    particles.push(Particle {
                        position_m,
                        compensation_m: [0.0; 3],
                        velocity_m_s: velocity.map(|v| v as f32).into(),
                        affine: [0.0; 9],
                        elastic: IDENTITY,
                        deformation: IDENTITY,
                        mass_kg: (self.density_kg_m3 * f64::from(volume_m3)) as f32,
                        volume_m3,
                        mu: mu as f32,
                        lambda: lambda as f32,
                        state: self.state as f32,
                        law: 0,
                    });
                }
            }
        }
        particles
    }

    fn solver(&self, gravity_m_s2: [f32; 3], boundaries: Vec<Boundary>) -> Solver {
        self.solver_of(&self.particles(), gravity_m_s2, boundaries)
    }

    /// A solver of some of its particles.
    fn solver_of(&self, particles: &[Particle], gravity_m_s2: [f32; 3], boundaries: Vec<Boundary>) -> Solver {
        Solver::new(self.setting(gravity_m_s2, boundaries), particles.to_vec())
    }

    fn setting(&self, gravity_m_s2: [f32; 3], boundaries: Vec<Boundary>) -> Setting {
        Setting {
            spacing_m: self.spacing_m,
            gravity_m_s2,
            boundaries,
            domain_m: [[0.0; 3], [10.0; 3]],
            laws: vec![self.law],
        }
    }
}

/// The solver's particles in the order in which they were given.
fn particles_of(solver: &Solver) -> Vec<Particle> {
    solver.particles().iter().collect()
}

/// Total mass, centre of mass, momentum.
fn totals(particles: &[Particle]) -> (f64, Vector3<f64>, Vector3<f64>) {
    let (mut mass, mut moment, mut momentum) = (0.0, Vector3::zeros(), Vector3::zeros());
    for p in particles {
        let m = f64::from(p.mass_kg);
        mass += m;
        moment += m * Vector3::from(p.position_m.map(f64::from));
        momentum += m * Vector3::from(p.velocity_m_s.map(f64::from));
    }
    (mass, moment / mass, momentum)
}
