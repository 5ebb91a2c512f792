//! The particles: packs of eight, with a structure of arrays inside a pack, so that a pack's data is contiguous in
//! memory and each quantity fills a vector register.

use nalgebra::Matrix3;

use crate::simd::LANES;

/// One f32 of each particle of a pack in memory.
pub type Row = [f32; LANES];

/// One particle as callers pass and receive it. SI units; positions relative to the simulation's origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    pub position_m: [f32; 3],
    /// The part of the particle's moves that rounding has kept out of `position_m`; the next move includes it.
    pub compensation_m: [f32; 3],
    pub velocity_m_s: [f32; 3],
    /// APIC's affine velocity matrix C, 1/s, row by row.
    pub affine: [f32; 9],
    /// Elastic deformation gradient, row by row. A rotation if nothing is strained.
    pub elastic: [f32; 9],
    /// Total deformation gradient, including the plastic part: the change of shape.
    pub deformation: [f32; 9],
    pub mass_kg: f32,
    /// Volume at rest.
    pub volume_m3: f32,
    /// Lame's second constant (shear modulus), Pa.
    pub mu: f32,
    /// Lame's first constant, Pa.
    pub lambda: f32,
    /// The law's scalar state: see [`laws`](super::laws).
    pub state: f32,
    /// Index into the solver's laws.
    pub law: u32,
}

impl Particle {
    /// True if all its numbers are.
    pub fn is_finite(&self) -> bool {
        let Self { position_m, compensation_m, velocity_m_s, affine, elastic, deformation, .. } = self;
        let motion = position_m.iter().chain(compensation_m).chain(velocity_m_s).chain(affine);
        let scalars = [self.mass_kg, self.volume_m3, self.mu, self.lambda, self.state];
        motion.chain(elastic).chain(deformation).chain(&scalars).all(|number| number.is_finite())
    }
}

/// The motion of a rigid body at one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    pub velocity_m_s: [f32; 3],
    /// Gradient of the velocity, 1/s.
    pub gradient: Matrix3<f32>,
}

/// Factor on the mass of a particle while its motion is given: what pushes it changes the motion of the grid beside it
/// by only about the inverse of this factor per step. A power of two, so that the particle's own mass is restored
/// exactly.
pub const LED_WEIGHT: f32 = 16384.0;

/// The identity matrix, row by row.
pub const IDENTITY: [f32; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

/// Eight particles of one law. Unused lanes hold a resting particle without mass or volume.
#[derive(Debug, Clone)]
#[repr(C, align(32))]
pub struct Pack {
    pub position: [Row; 3],
    /// See [`Particle::compensation_m`].
    pub compensation: [Row; 3],
    pub velocity: [Row; 3],
    pub affine: [Row; 9],
    pub elastic: [Row; 9],
    pub mass: Row,
    pub volume: Row,
    pub mu: Row,
    pub lambda: Row,
    pub state: Row,
    pub deformation: [Row; 9],
    /// Each particle's number in the order in which the particles were given.
    pub id: [u32; LANES],
    pub live: u32,
    pub law: u32,
}

impl Pack {
    /// Prepares a lane for a substep with a given motion.
    pub fn take(&mut self, lane: usize, motion: &Motion) {
        self.mass[lane] *= LED_WEIGHT;
        put_matrix(&mut self.affine, lane, &motion.gradient);
        for (row, v) in self.velocity.iter_mut().zip(motion.velocity_m_s) {
            row[lane] = v;
        }
    }

    /// Gives a lane the `motion` that starts at the position and with the compensation in `before`, instead of the result
    /// of a substep of `dt_s`. In f64: with the same motion in every step, rounding errors would add up.
    pub fn lead(&mut self, lane: usize, before: [[f32; 3]; 2], motion: &Motion, dt_s: f32) {
        let step = |gradient: Matrix3<f64>| Matrix3::identity() + gradient * f64::from(dt_s);
        let made = step(lane_matrix(&self.affine, lane));
        // A step whose matrix is singular cannot be undone.
        if let Some(back) = made.try_inverse() {
            let change = step(motion.gradient.map(f64::from)) * back;
            for rows in [&mut self.elastic, &mut self.deformation] {
                put_matrix(rows, lane, &(change * lane_matrix(rows, lane)).map(|x| x as f32));
            }
        }
        self.mass[lane] /= LED_WEIGHT;
        put_matrix(&mut self.affine, lane, &motion.gradient);
        for (a, v) in motion.velocity_m_s.into_iter().enumerate() {
            self.velocity[a][lane] = v;
            let moved = compensated_sum([before[0][a], before[1][a]], v * dt_s);
            [self.position[a][lane], self.compensation[a][lane]] = moved;
        }
    }

    /// Moves a lane to `position_m` with a `motion`; returns the largest of its moves along x, y and z.
    pub fn place(&mut self, lane: usize, position_m: [f32; 3], motion: &Motion) -> f32 {
        let mut farthest = 0.0_f32;
        for (row, x) in self.position.iter_mut().zip(position_m) {
            farthest = farthest.max((x - row[lane]).abs());
            row[lane] = x;
        }
        for row in &mut self.compensation {
            row[lane] = 0.0;
        }
        for (row, v) in self.velocity.iter_mut().zip(motion.velocity_m_s) {
            row[lane] = v;
        }
        put_matrix(&mut self.affine, lane, &motion.gradient);
        farthest
    }

    /// A pack without particles.
    pub fn empty() -> Self {
        let zero = [0.0; LANES];
        let identity = IDENTITY.map(|v| [v; LANES]);
        Self {
            position: [zero; 3],
            compensation: [zero; 3],
            velocity: [zero; 3],
            affine: [zero; 9],
            elastic: identity,
            mass: zero,
            volume: zero,
            mu: zero,
            lambda: zero,
            state: zero,
            deformation: identity,
            id: [u32::MAX; LANES],
            live: 0,
            law: 0,
        }
    }

    /// A pack of `particles` (one to eight, of one law) with their numbers.
    pub fn gather(particles: impl Iterator<Item = (u32, Particle)>) -> Self {
        let mut pack = Self::empty();
        for (lane, (id, particle)) in particles.enumerate() {
            pack.put(lane, id, &particle);
            pack.live = lane as u32 + 1;
            pack.law = particle.law;
        }
        pack.pad();
        pack
    }

    /// Turns the unused lanes into resting particles without mass, at the position of the first one.
    pub fn pad(&mut self) {
        let nothing = Particle {
            position_m: self.position.map(|row| row[0]),
            compensation_m: [0.0; 3],
            velocity_m_s: [0.0; 3],
            affine: [0.0; 9],
            elastic: IDENTITY,
            deformation: IDENTITY,
            mass_kg: 0.0,
            volume_m3: 0.0,
            mu: 0.0,
            lambda: 0.0,
            state: 0.0,
            law: self.law,
        };
        for lane in self.live as usize..LANES {
            self.put(lane, u32::MAX, &nothing);
        }
    }

    fn put(&mut self, lane: usize, id: u32, p: &Particle) {
        fn set<const N: usize>(rows: &mut [Row; N], lane: usize, values: &[f32; N]) {
            for (row, value) in rows.iter_mut().zip(values) {
                row[lane] = *value;
            }
        }
        set(&mut self.position, lane, &p.position_m);
        set(&mut self.compensation, lane, &p.compensation_m);
        set(&mut self.velocity, lane, &p.velocity_m_s);
        set(&mut self.affine, lane, &p.affine);
        set(&mut self.elastic, lane, &p.elastic);
        set(&mut self.deformation, lane, &p.deformation);
        self.mass[lane] = p.mass_kg;
        self.volume[lane] = p.volume_m3;
        self.mu[lane] = p.mu;
        self.lambda[lane] = p.lambda;
        self.state[lane] = p.state;
        self.id[lane] = id;
    }

    /// The particle in `lane`.
    pub fn particle(&self, lane: usize) -> Particle {
        fn get<const N: usize>(rows: &[Row; N], lane: usize) -> [f32; N] {
            std::array::from_fn(|i| rows[i][lane])
        }
        Particle {
            position_m: get(&self.position, lane),
            compensation_m: get(&self.compensation, lane),
            velocity_m_s: get(&self.velocity, lane),
            affine: get(&self.affine, lane),
            elastic: get(&self.elastic, lane),
            deformation: get(&self.deformation, lane),
            mass_kg: self.mass[lane],
            volume_m3: self.volume[lane],
            mu: self.mu[lane],
            lambda: self.lambda[lane],
            state: self.state[lane],
            law: self.law,
        }
    }

    /// Its live particles with their numbers.
    pub fn particles(&self) -> impl Iterator<Item = (u32, Particle)> + '_ {
        (0..self.live as usize).map(|lane| (self.id[lane], self.particle(lane)))
    }
}

/// A position with its compensation, after a move by `by` along the same axis: compensated summation (Kahan, *Further
/// Remarks on Reducing Truncation Errors*, 1965). Without it, moves far below the rounding of the position are lost.
pub fn compensated_sum([position, compensation]: [f32; 2], by: f32) -> [f32; 2] {
    let by = by + compensation;
    let moved = position + by;
    [moved, by - (moved - position)]
}

fn lane_matrix(rows: &[Row; 9], lane: usize) -> Matrix3<f64> {
    Matrix3::from_row_slice(&rows.map(|row| f64::from(row[lane])))
}

fn put_matrix(rows: &mut [Row; 9], lane: usize, m: &Matrix3<f32>) {
    for (row, value) in rows.iter_mut().zip(m.transpose().iter()) {
        row[lane] = *value;
    }
}
