//! A rigid body: its particles at fixed places in its own frame, and its motion.
//!
//! Momentum and angular momentum are the state; a free body conserves both up to rounding. The rotation follows from
//! them by the Runge-Kutta method of fourth order: q' = omega q / 2, omega = R I^-1 R^T L.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::face::Face;
use crate::mpm::base_cell;
use crate::mpm::particles::Particle;

/// A particle of a body.
#[derive(Debug, Clone)]
pub struct Member {
    /// Its number among all particles of the object.
    pub id: u32,
    /// From the body's centre of mass, in the body's frame, m.
    pub place_m: Vector3<f64>,
    /// Its state at the start, in which the body's frame has the axes of the simulation's.
    pub start: Particle,
}

/// Velocity of the centre of mass, m/s, and angular velocity, rad/s.
pub type Velocities = [Vector3<f64>; 2];

/// The motion of a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Centre of mass.
    pub center_m: Vector3<f64>,
    /// From the body's frame to the simulation's.
    pub rotation: UnitQuaternion<f64>,
    pub velocity_m_s: Vector3<f64>,
    /// About the centre of mass, kg m^2/s.
    pub angular_momentum: Vector3<f64>,
}

impl State {
    /// How many numbers [`Self::to_numbers`] returns.
    pub const NUMBERS: usize = 13;

    pub fn to_numbers(self) -> [f64; Self::NUMBERS] {
        let (c, q, v, l) = (self.center_m, self.rotation.coords, self.velocity_m_s, self.angular_momentum);
        [c.x, c.y, c.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, l.x, l.y, l.z]
    }

    pub fn from_numbers(n: &[f64; Self::NUMBERS]) -> Self {
        let vector = |at: usize| Vector3::new(n[at], n[at + 1], n[at + 2]);
        // Normalised when it was written: normalising again would change its last bits.
        let rotation = UnitQuaternion::new_unchecked(Quaternion::new(n[6], n[3], n[4], n[5]));
        Self { center_m: vector(0), rotation, velocity_m_s: vector(7), angular_momentum: vector(10) }
    }
}

/// The mass of some of a body's particles and its first and second moment about the body's centre of mass, in the
/// body's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    pub mass_kg: f64,
    /// kg m.
    pub first: Vector3<f64>,
    /// Inertia tensor, kg m^2.
    pub inertia: Matrix3<f64>,
}

impl Moments {
    fn of<'a>(members: impl Iterator<Item = &'a Member>) -> Self {
        let nothing = Self { mass_kg: 0.0, first: Vector3::zeros(), inertia: Matrix3::zeros() };
        members.fold(nothing, |sum, member| {
            let (m, r) = (f64::from(member.start.mass_kg), member.place_m);
            // A particle is a cube of matter: a^2 / 6 about each of its axes.
            let own = f64::from(member.start.volume_m3).cbrt().powi(2) / 6.0;
            Self {
                mass_kg: sum.mass_kg + m,
                first: sum.first + m * r,
                inertia: sum.inertia + m * (Matrix3::from_diagonal_element(r.norm_squared() + own) - r * r.transpose()),
            }
        })
    }
}

/// A rigid body.
#[derive(Debug, Clone)]
pub struct Body {
    members: Vec<Member>,
    mass_kg: f64,
    inverse_inertia: Matrix3<f64>,
    inertia: Matrix3<f64>,
    /// Distance of its farthest particle from the centre of mass.
    radius_m: f64,
    state: State,
    /// The places where it can touch the ground, part by part.
    pub(super) faces: Vec<Face>,
}

impl Body {
    /// A body of particles with their numbers, moving as they do at the start. `spread_m2` is added to the square of
    /// every particle's distance from any axis through it: how far the grid spreads a particle's momentum.
    pub fn new(particles: Vec<(u32, Particle)>, faces: Vec<Face>, spread_m2: f64) -> Self {
        let vector = |v: [f32; 3]| Vector3::from(v.map(f64::from));
        let sum = |value_of: &dyn Fn(&Particle) -> Vector3<f64>| -> Vector3<f64> {
            particles.iter().map(|(_, p)| value_of(p) * f64::from(p.mass_kg)).sum()
        };
        let mass_kg: f64 = particles.iter().map(|(_, p)| f64::from(p.mass_kg)).sum();
        let center_m = sum(&|p| vector(p.position_m)) / mass_kg;
        let velocity_m_s = sum(&|p| vector(p.velocity_m_s)) / mass_kg;
        let momentum = sum(&|p| (vector(p.position_m) - center_m).cross(&vector(p.velocity_m_s)));
        let members: Vec<Member> = particles
            .into_iter()
            .map(|(id, start)| Member { id, place_m: vector(start.position_m) - center_m, start })
            .collect();
        let own = Moments::of(members.iter()).inertia;
        let inertia = own + Matrix3::from_diagonal_element(mass_kg * spread_m2);
        let inverse = |m: Matrix3<f64>| m.try_inverse().unwrap_or_else(Matrix3::zeros);
        let angular_momentum = inertia * (inverse(own) * momentum);
        let radius_m = members.iter().map(|m| m.place_m.norm()).fold(0.0, f64::max);
        let faces = faces.into_iter().map(|face| face.about(center_m)).collect();
        let rotation = UnitQuaternion::identity();
        let state = State { center_m, rotation, velocity_m_s, angular_momentum };
        Self { members, mass_kg, inverse_inertia: inverse(inertia), inertia, radius_m, state, faces }
    }

    pub fn members(&self) -> &[Member] {
        &self.members
    }

    pub fn mass_kg(&self) -> f64 {
        self.mass_kg
    }

    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    pub fn state(&self) -> &State {
        &self.state
    }

    pub fn set_state(&mut self, state: State) {
        self.state = state;
    }

    pub fn faces(&self) -> &[Face] {
        &self.faces
    }

    pub fn faces_mut(&mut self) -> &mut [Face] {
        &mut self.faces
    }

    /// From the body's frame to the simulation's.
    pub fn pose(&self) -> Isometry3<f64> {
        Isometry3::from_parts(Translation3::from(self.state.center_m), self.state.rotation)
    }

    /// Momentum and angular momentum per velocity and angular velocity, in the simulation's frame.
    pub fn inertia_in_simulation(&self) -> Matrix6<f64> {
        self.along_and_about(self.mass_kg, &self.inertia)
    }

    /// Velocity and angular velocity per impulse and angular impulse, in the simulation's frame.
    pub fn response_in_simulation(&self) -> Matrix6<f64> {
        self.along_and_about(1.0 / self.mass_kg, &self.inverse_inertia)
    }

    fn along_and_about(&self, along: f64, about: &Matrix3<f64>) -> Matrix6<f64> {
        let turn = self.state.rotation.to_rotation_matrix();
        let mut both = Matrix6::zeros();
        both.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(along);
        both.fixed_view_mut::<3, 3>(3, 3).copy_from(&(turn * about * turn.inverse()));
        both
    }

    /// Angular velocity, rad/s.
    pub fn spin(&self) -> Vector3<f64> {
        self.spin_at(&self.state.rotation)
    }

    fn spin_at(&self, rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
        rotation * (self.inverse_inertia * (rotation.inverse() * self.state.angular_momentum))
    }

    pub fn velocities(&self) -> Velocities {
        [self.state.velocity_m_s, self.spin()]
    }

    /// A bound on the speed of its particles, m/s.
    pub fn fastest_m_s(&self) -> f64 {
        self.state.velocity_m_s.norm() + self.spin().norm() * self.radius_m
    }

    pub fn kinetic_j(&self) -> f64 {
        0.5 * (self.mass_kg * self.state.velocity_m_s.norm_squared() + self.spin().dot(&self.state.angular_momentum))
    }

    /// Adds an impulse, N s, and an angular impulse about the centre of mass, N m s.
    pub fn push(&mut self, impulse: Vector3<f64>, angular_impulse: Vector3<f64>) {
        self.state.velocity_m_s += impulse / self.mass_kg;
        self.state.angular_momentum += angular_impulse;
    }

    /// Gives it a velocity of its centre of mass and an angular velocity.
    pub fn set_motion(&mut self, velocity_m_s: Vector3<f64>, spin: Vector3<f64>) {
        let turn = self.state.rotation.to_rotation_matrix();
        self.state.velocity_m_s = velocity_m_s;
        self.state.angular_momentum = turn * (self.inertia * (turn.inverse() * spin));
    }

    /// Moves and turns for `dt_s` at given velocities, whatever its momentum and angular momentum.
    pub fn lead(&mut self, [velocity_m_s, spin]: Velocities, dt_s: f64) {
        self.state.center_m += velocity_m_s * dt_s;
        self.state.rotation = UnitQuaternion::from_scaled_axis(spin * dt_s) * self.state.rotation;
        self.set_motion(velocity_m_s, spin);
    }

    /// Moves and turns for `dt_s` with its momentum and angular momentum.
    pub fn advance(&mut self, dt_s: f64) {
        self.state.center_m += self.state.velocity_m_s * dt_s;
        if self.state.angular_momentum == Vector3::zeros() {
            return;
        }
        let slope = |q: Quaternion<f64>| {
            let spin = self.spin_at(&UnitQuaternion::new_normalize(q));
            Quaternion::from_parts(0.0, spin) * q * 0.5
        };
        let q = *self.state.rotation.quaternion();
        let a = slope(q);
        let b = slope(q + a * (dt_s / 2.0));
        let c = slope(q + b * (dt_s / 2.0));
        let d = slope(q + c * dt_s);
        self.state.rotation = UnitQuaternion::new_normalize(q + (a + (b + c) * 2.0 + d) * (dt_s / 6.0));
    }

    /// Moves it without changing its velocity.
    pub fn shift(&mut self, by_m: Vector3<f64>) {
        self.state.center_m += by_m;
    }

    /// The first cell of each particle's stencil, x y z, on a grid of `spacing_m`.
    pub fn cells(&self, spacing_m: f32) -> impl Iterator<Item = [i32; 3]> + '_ {
        let (pose, cells_per_m) = (self.pose(), 1.0 / spacing_m);
        self.members.iter().map(move |member| {
            let place = pose * Point3::from(member.place_m);
            [0, 1, 2].map(|a| base_cell(place[a] as f32, cells_per_m))
        })
    }

    /// The moments of the particles whose number is in `mask`.
    pub fn moments(&self, mask: &[bool]) -> Moments {
        Moments::of(self.members.iter().filter(|member| mask[member.id as usize]))
    }

    /// `moments` in the simulation's frame.
    pub fn turned(&self, moments: &Moments) -> Moments {
        let turn = self.state.rotation.to_rotation_matrix();
        Moments {
            mass_kg: moments.mass_kg,
            first: turn * moments.first,
            inertia: turn * moments.inertia * turn.inverse(),
        }
    }

    /// A particle as it moves with the body.
    pub fn particle(&self, member: &Member) -> Particle {
        let (state, spin) = (&self.state, self.spin());
        let turn = state.rotation.to_rotation_matrix();
        let arm = turn * member.place_m;
        let rows = |m: Matrix3<f64>| -> [f32; 9] { std::array::from_fn(|i| m[(i / 3, i % 3)] as f32) };
        let turned = |f: &[f32; 9]| rows(turn.matrix() * Matrix3::from_row_slice(&f.map(f64::from)));
        Particle {
            position_m: (state.center_m + arm).map(|x| x as f32).into(),
            velocity_m_s: (state.velocity_m_s + spin.cross(&arm)).map(|v| v as f32).into(),
            affine: rows(spin.cross_matrix()),
            elastic: turned(&member.start.elastic),
            deformation: turned(&member.start.deformation),
            ..member.start
        }
    }
}
