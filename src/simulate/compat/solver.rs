//! The peer's solver: a substep on a dense grid, in f32, in the peer's order.
//!
//! 1. the grid is cleared;
//! 2. impulses, then velocity modifiers;
//! 3. the return map takes the trial deformation to the elastic one, whose stress is computed;
//! 4. particles to grid: quadratic B-splines, nodes at multiples of dx, forces with the kernel's gradient;
//! 5. velocities, gravity, damping, boundary conditions in their order;
//! 6. grid to particles: velocity, move, affine velocity, trial deformation.
//!
//! The scatter processes the particles one after the other and everything else is parallel, so the bytes are the same
//! on any number of threads.

use nalgebra::{Matrix3, Vector3};

use super::condition::Conditions;
use super::config::Config;
use super::law::Law;
use super::particle::Particle;
use crate::parallel;

type Vec3 = Vector3<f32>;
type Mat3 = Matrix3<f32>;

/// Nodes lighter than this have no velocity.
const LEAST_MASS: f32 = 1e-15;

/// Below this damping value the affine velocity is ignored: PIC.
const PIC: f32 = -0.001;

/// Momentum and mass; after the grid update, velocity and mass.
#[derive(Debug, Clone, Copy, Default)]
struct Node {
    velocity: Vec3,
    mass: f32,
}

/// A particle that left the grid or became NaN or infinite; the peer crashes in this case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lost {
    pub particle: usize,
    pub time: f64,
}

/// The particles, their grid, and the substep.
#[derive(Debug, Clone)]
pub struct Solver {
    pub particles: Vec<Particle>,
    laws: Vec<Law>,
    conditions: Conditions,
    gravity: Vec3,
    rpic_damping: f32,
    damping: f32,
    cells: usize,
    dx: f32,
    /// Not 1 / `dx`: both are rounded separately.
    per_dx: f32,
    nodes: Vec<Node>,
    /// Planes of nodes along x that hold mass: the first, and one past the last.
    touched: [usize; 2],
    time: f64,
}

/// The nodes that a particle touches: the first node and the weights along each axis, with their derivatives in cells.
struct Stencil {
    base: [usize; 3],
    /// Particle position minus first node, in cells.
    offset: Vec3,
    weight: [[f32; 3]; 3],
    slope: [[f32; 3]; 3],
}

impl Stencil {
    fn at(position: &Vec3, cells_per_unit: f32) -> Self {
        let place = position * cells_per_unit;
        let base = [0, 1, 2].map(|a| (place[a] - 0.5) as usize);
        let offset = Vec3::new(place.x - base[0] as f32, place.y - base[1] as f32, place.z - base[2] as f32);
        let (mut weight, mut slope) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        for a in 0..3 {
            let (l, m, r) = (1.5 - offset[a], offset[a] - 1.0, offset[a] - 0.5);
            weight[a] = [0.5 * l * l, 0.75 - m * m, 0.5 * r * r];
            slope[a] = [-l, -2.0 * m, r];
        }
        Self { base, offset, weight, slope }
    }

    /// Visits the 27 nodes: index, weight, gradient of the weight, node minus particle in cells.
    #[inline]
    fn each(&self, cells: usize, per_dx: f32, mut visit: impl FnMut(usize, f32, Vec3, Vec3)) {
        let ([wx, wy, wz], [sx, sy, sz]) = (self.weight, self.slope);
        for i in 0..3 {
            for j in 0..3 {
                let row = ((self.base[0] + i) * cells + self.base[1] + j) * cells + self.base[2];
                for k in 0..3 {
                    let gradient = Vec3::new(sx[i] * wy[j] * wz[k], wx[i] * sy[j] * wz[k], wx[i] * wy[j] * sz[k]);
                    let away = Vec3::new(i as f32, j as f32, k as f32) - self.offset;
                    visit(row + k, wx[i] * wy[j] * wz[k], gradient * per_dx, away);
                }
            }
        }
    }
}

impl Solver {
    /// A solver at time 0. The particles' positions at this moment decide which of them a condition acts on.
    pub fn new(config: &Config, particles: Vec<Particle>) -> Self {
        Self::with_laws(config, vec![Law::new(config)], particles)
    }

    /// A solver whose particles follow the `laws` that they name, instead of that of the configuration.
    pub fn with_laws(config: &Config, laws: Vec<Law>, particles: Vec<Particle>) -> Self {
        let cells = config.n_grid;
        let conditions = Conditions::new(&config.boundary_conditions, &particles, config.substep_dt, cells);
        Self {
            particles,
            laws,
            conditions,
            gravity: config.g.into(),
            rpic_damping: config.rpic_damping,
            damping: config.grid_v_damping_scale,
            cells,
            dx: (config.grid_lim / cells as f64) as f32,
            per_dx: (cells as f64 / config.grid_lim) as f32,
            nodes: vec![Node::default(); cells * cells * cells],
            touched: [0, 0],
            time: 0.0,
        }
    }

    /// One substep.
    ///
    /// # Errors
    /// [`Lost`] if a particle does not lie on the grid. The particles then are as the step before left them.
    pub fn step(&mut self, dt: f64) -> Result<(), Lost> {
        self.check()?;
        let (t, step) = (self.time as f32, dt as f32);
        let plane = self.cells * self.cells;
        self.nodes[self.touched[0] * plane..self.touched[1] * plane].fill(Node::default());
        for condition in self.conditions.impulses.iter().chain(&self.conditions.modifiers) {
            condition.apply(&mut self.particles, t, step);
        }
        let laws = &self.laws;
        parallel::for_each_mut(&mut self.particles, |_, p| {
            (p.elastic, p.stress) = laws[p.law as usize].respond(&p.trial, &mut p.strength, step);
        });
        self.scatter(step);
        self.update_grid(t, step);
        for condition in &mut self.conditions.on_grid {
            condition.advance(self.time, dt);
        }
        self.gather(step);
        self.time += dt;
        Ok(())
    }

    /// Checks that all nodes of every particle are on the grid, and that its deformation is finite.
    ///
    /// # Errors
    /// [`Lost`] for the first particle of which this is not true.
    pub fn check(&self) -> Result<(), Lost> {
        // Rounded as in `Stencil::at`.
        let on_grid = |x: &f32| (0.0..self.cells as f32 - 2.0).contains(&(x * self.per_dx - 0.5));
        let inside = |p: &Particle| p.position.iter().all(on_grid) && p.trial.iter().all(|x| x.is_finite());
        match self.particles.iter().position(|p| !inside(p)) {
            Some(particle) => Err(Lost { particle, time: self.time }),
            None => Ok(()),
        }
    }

    fn scatter(&mut self, dt: f32) {
        let (cells, dx, per_dx) = (self.cells, self.dx, self.per_dx);
        let g = self.rpic_damping;
        let (mut first, mut last) = (cells, 0);
        for p in &self.particles {
            let stencil = Stencil::at(&p.position, per_dx);
            first = first.min(stencil.base[0]);
            last = last.max(stencil.base[0] + 3);
            let affine = match g {
                g if g < PIC => Mat3::zeros(),
                0.0 => p.affine,
                g => p.affine * (1.0 - g) + (p.affine - p.affine.transpose()) * (g / 2.0),
            };
            let pull = p.stress * -p.volume;
            let nodes = &mut self.nodes;
            stencil.each(cells, per_dx, |node, weight, gradient, away| {
                let node = &mut nodes[node];
                let mass = weight * p.mass;
                node.velocity += (p.velocity + affine * (away * dx)) * mass + pull * gradient * dt;
                node.mass += mass;
            });
        }
        self.touched = [first, last.max(first)];
    }

    fn update_grid(&mut self, t: f32, dt: f32) {
        let (cells, dx) = (self.cells, self.dx);
        let plane = cells * cells;
        let [first, last] = self.touched;
        let fall = self.gravity * dt;
        let kept = self.damping.min(1.0);
        let conditions = &self.conditions.on_grid;
        parallel::for_each_chunk_mut(&mut self.nodes[first * plane..last * plane], plane, |i, nodes| {
            for (jk, node) in nodes.iter_mut().enumerate() {
                if node.mass == 0.0 {
                    continue;
                }
                let mut v = Vec3::zeros();
                if node.mass > LEAST_MASS {
                    v = (node.velocity * (1.0 / node.mass) + fall) * kept;
                }
                for condition in conditions {
                    v = condition.apply([first + i, jk / cells, jk % cells], dx, v, t, dt);
                }
                node.velocity = v;
            }
        });
    }

    fn gather(&mut self, dt: f32) {
        let (cells, per_dx, nodes) = (self.cells, self.per_dx, &self.nodes);
        parallel::for_each_mut(&mut self.particles, |_, p| {
            let (mut velocity, mut affine, mut gradient_of_v) = (Vec3::zeros(), Mat3::zeros(), Mat3::zeros());
            Stencil::at(&p.position, per_dx).each(cells, per_dx, |node, weight, gradient, away| {
                let v = nodes[node].velocity;
                velocity += v * weight;
                affine += v * away.transpose() * (weight * per_dx * 4.0);
                gradient_of_v += v * gradient.transpose();
            });
            p.velocity = velocity;
            p.position += velocity * dt;
            p.affine = affine;
            p.trial = (Mat3::identity() + gradient_of_v * dt) * p.elastic;
        });
    }
}
