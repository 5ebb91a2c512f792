//! The Material Point Method in three dimensions: MLS-MPM with quadratic B-splines and APIC transfers.
//!
//! A substep ([`Solver::step`]) is, in this order:
//! 1. `sort`: if particles may have drifted by a cell, they are sorted into slabs, with a new grid around them;
//! 2. `p2g`: the grid is cleared; return map, stress, scatter of mass and momentum to the nodes;
//! 3. `grid_update`: velocities, gravity, boundary conditions;
//! 4. `g2p`: velocities back to the particles, their new positions, their deformation.
//!
//! Guests ([`Solver::host`]) are particles of rigid bodies: the grid has nodes around them, but they have no mass here, and
//! the caller moves them. Between [`Solver::scatter`] and [`Solver::gather`], the two halves of a substep, the caller may change
//! velocities of nodes.
//!
//! Hu et al., *A Moving Least Squares Material Point Method*, 2018; Jiang et al., *The Affine Particle-In-Cell Method*,
//! 2015; Jiang et al., *The Material Point Method for Simulating Continuum Materials*, 2016 (course notes).
//!
//! Arithmetic is f32 in packs of eight ([`Lanes`](crate::simd::Lanes)); the same input gives the same bytes on any
//! number of threads of one machine.

pub mod boundary;
pub mod eigen;
mod g2p;
mod grid;
mod grid_update;
pub mod in_order;
pub mod laws;
pub mod matrix;
mod p2g;
pub mod particles;
pub mod reach;
mod sort;
mod stencil;

use crate::mpm::boundary::Boundary;
use crate::parallel;
use crate::simd::LANES;
pub use grid::DRIFT;
use in_order::InOrder;
use laws::Law;
use particles::{Motion, Pack, Particle, Row, compensated_sum};
use sort::Sorted;
pub use stencil::base_cell;

/// Packs per task: enough to make the overhead of a task small, few enough to share the work evenly.
const TASK: usize = 64;

/// Settings that do not change while the solver runs. SI units.
#[derive(Debug, Clone)]
pub struct Setting {
    /// Edge of a grid cell.
    pub spacing_m: f32,
    pub gravity_m_s2: [f32; 3],
    /// In the order in which they act.
    pub boundaries: Vec<Boundary>,
    /// Lowest and highest position a particle may have.
    pub domain_m: [[f32; 3]; 2],
    /// The laws that [`Particle::law`] refers to by index.
    pub laws: Vec<Law>,
}

/// A particle that became NaN or infinite or left the domain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lost {
    /// Its index in the order in which the particles were given.
    pub particle: usize,
    pub position_m: [f32; 3],
    pub velocity_m_s: [f32; 3],
}

/// Whether a position lies between the corners of the domain; false if it is not a number.
pub fn is_within([low, high]: [[f32; 3]; 2], position_m: [f32; 3]) -> bool {
    (0..3).all(|a| low[a] < position_m[a] && position_m[a] < high[a])
}

/// The particles, their grid, and the substep.
pub struct Solver {
    setting: Setting,
    /// Number of particles that are not guests.
    own: usize,
    sorted: Sorted,
    nodes: Vec<f32>,
    /// Distance, in cells, that some particle may have moved since the last sort.
    drift: f32,
    fastest_m_s: f32,
    /// Per pack: the positions and compensations before a substep with given motions; see [`Solver::take`].
    before: Vec<[[Row; 3]; 2]>,
}

impl Solver {
    /// A solver for `particles`; their order is their numbering.
    pub fn new(setting: Setting, particles: Vec<Particle>) -> Self {
        let own = particles.len();
        let sorted = Sorted { packs: sort::packed(0, particles), ..Sorted::default() };
        let mut solver = Self { setting, own, sorted, nodes: vec![], drift: 0.0, fastest_m_s: 0.0, before: vec![] };
        solver.renew();
        solver
    }

    /// Replaces its guests, which are numbered after its own particles. Their law is the last of the setting's,
    /// [`Law::Rigid`].
    pub fn host(&mut self, guests: Vec<Particle>) {
        let own = self.own;
        self.sorted.packs.retain(|pack| (pack.id[0] as usize) < own);
        self.sorted.packs.extend(sort::packed(own, guests));
        self.renew();
    }

    /// Whether a particle may have moved so far that the next substep begins with sorting.
    pub fn is_due_for_sorting(&self) -> bool {
        /// Slightly below [`grid::DRIFT`], to allow for rounding.
        const LIMIT: f32 = grid::DRIFT as f32 * 0.95;
        self.drift > LIMIT
    }

    /// Moves each guest, by its number among them, to where `place` puts it.
    pub fn place_guests(&mut self, place: impl Fn(usize) -> ([f32; 3], Motion) + Sync) {
        let own = self.own;
        let put = |pack: &mut Pack| {
            let mut farthest = 0.0_f32;
            for lane in 0..pack.live as usize {
                let (position_m, motion) = place(pack.id[lane] as usize - own);
                farthest = farthest.max(pack.place(lane, position_m, &motion));
            }
            farthest
        };
        let farthest = parallel::map_chunks_mut(&mut self.sorted.packs, TASK, |_, packs| {
            let guests = packs.iter_mut().filter(|pack| pack.id[0] as usize >= own);
            guests.map(put).fold(0.0, f32::max)
        });
        let farthest = farthest.into_iter().fold(0.0, f32::max);
        self.drift += farthest / self.setting.spacing_m;
    }

    /// Resets the solver to what [`Solver::new`] would make of its particles in their current state.
    pub fn renew(&mut self) {
        let velocities = self.sorted.packs.iter().flat_map(|pack| pack.velocity).flatten();
        self.fastest_m_s = velocities.fold(0.0, |m: f32, v| m.max(v.abs()));
        self.sort();
    }

    /// Takes a substep of `dt_s` seconds. On failure the particles are as the substep left them.
    pub fn step(&mut self, dt_s: f32) -> Result<(), Lost> {
        self.scatter(dt_s);
        self.gather(dt_s)
    }

    /// The first half of a substep: up to the velocities of the nodes.
    pub fn scatter(&mut self, dt_s: f32) {
        if self.is_due_for_sorting() {
            self.sort();
        }
        if self.sorted.packs.is_empty() {
            return;
        }
        let Setting { spacing_m, gravity_m_s2, ref boundaries, ref laws, .. } = self.setting;
        p2g::scatter(&mut self.sorted, &mut self.nodes, laws, spacing_m, dt_s);
        grid_update::update(&self.sorted.columns, &mut self.nodes, boundaries, gravity_m_s2, spacing_m, dt_s);
    }

    /// The second half of a substep.
    ///
    /// # Errors
    /// If a particle is lost.
    pub fn gather(&mut self, dt_s: f32) -> Result<(), Lost> {
        let Setting { spacing_m, domain_m, ref laws, .. } = self.setting;
        let moved = g2p::gather(&mut self.sorted, &self.nodes, laws, spacing_m, dt_s, domain_m);
        self.fastest_m_s = moved.fastest_m_s;
        self.drift += moved.fastest_m_s * dt_s / spacing_m;
        match moved.lost {
            Some(pack) => Err(self.lost_in(pack)),
            None => Ok(()),
        }
    }

    /// Largest component of any particle's velocity, m/s.
    pub fn fastest_m_s(&self) -> f32 {
        self.fastest_m_s
    }

    /// Moves every particle as gravity alone does in `dt_s`. To be followed by [`Solver::host`].
    pub fn fall(&mut self, dt_s: f32) {
        let gravity = self.setting.gravity_m_s2;
        parallel::for_each_mut(&mut self.sorted.packs, |_, pack| {
            let rows = pack.position.iter_mut().zip(&mut pack.compensation).zip(&mut pack.velocity).zip(gravity);
            for (((positions, compensations), velocities), g) in rows {
                for ((x, c), v) in positions.iter_mut().zip(compensations).zip(velocities) {
                    [*x, *c] = compensated_sum([*x, *c], (*v + g * dt_s / 2.0) * dt_s);
                    *v += g * dt_s;
                }
            }
        });
    }

    /// Sets every particle's velocity to what `change` returns for its number and velocity.
    pub fn change_velocities(&mut self, change: impl Fn(u32, [f32; 3]) -> [f32; 3] + Sync) {
        parallel::for_each_mut(&mut self.sorted.packs, |_, pack| {
            for lane in 0..pack.live as usize {
                let changed = change(pack.id[lane], pack.velocity.map(|row| row[lane]));
                for (row, v) in pack.velocity.iter_mut().zip(changed) {
                    row[lane] = v;
                }
            }
        });
    }

    /// Makes some particles so heavy that the grid follows them in the next substep: those to which `led` gives a motion,
    /// by their number and current position. To be followed by [`Solver::lead`].
    pub fn take(&mut self, led: impl Fn(u32, [f32; 3]) -> Option<Motion> + Sync) {
        // Sorted now instead of in `scatter`: until `lead`, every particle keeps its place in `before`.
        if self.is_due_for_sorting() {
            self.sort();
        }
        let packs = &self.sorted.packs;
        self.before.resize(packs.len(), [[[0.0; LANES]; 3]; 2]);
        parallel::for_each_mut(&mut self.before, |n, before| *before = [packs[n].position, packs[n].compensation]);
        parallel::for_each_mut(&mut self.sorted.packs, |_, pack| {
            for lane in 0..pack.live as usize {
                if let Some(motion) = led(pack.id[lane], pack.position.map(|row| row[lane])) {
                    pack.take(lane, &motion);
                }
            }
        });
    }

    /// After the substep that follows [`Solver::take`]: the particles move and turn as `led` says, and strain no further.
    pub fn lead(&mut self, dt_s: f32, led: impl Fn(u32, [f32; 3]) -> Option<Motion> + Sync) {
        let lead = |(pack, before): (&mut Pack, &[[Row; 3]; 2])| {
            let mut fastest = 0.0_f32;
            for lane in 0..pack.live as usize {
                let before = before.map(|rows| rows.map(|row| row[lane]));
                if let Some(motion) = led(pack.id[lane], before[0]) {
                    pack.lead(lane, before, &motion, dt_s);
                    fastest = motion.velocity_m_s.iter().fold(fastest, |m, v| m.max(v.abs()));
                }
            }
            fastest
        };
        let before = &self.before;
        let fastest = parallel::map_chunks_mut(&mut self.sorted.packs, TASK, |task, packs| {
            packs.iter_mut().zip(&before[task * TASK..]).map(lead).fold(0.0, f32::max)
        });
        let fastest = fastest.into_iter().fold(0.0, f32::max);
        self.fastest_m_s = self.fastest_m_s.max(fastest);
        self.drift += fastest * dt_s / self.setting.spacing_m;
    }

    /// All particles in the order in which they were given.
    pub fn particles(&self) -> InOrder<'_> {
        InOrder::new(&self.sorted.packs, &self.setting.laws)
    }

    /// Number of laws.
    pub fn laws(&self) -> usize {
        self.setting.laws.len()
    }

    /// The first cell of each own particle's stencil, x y z.
    pub fn cells(&self) -> impl Iterator<Item = [i32; 3]> + '_ {
        let cells_per_m = 1.0 / self.setting.spacing_m;
        let own = self.sorted.packs.iter().filter(|pack| (pack.id[0] as usize) < self.own);
        let places = own.flat_map(|pack| (0..pack.live as usize).map(|lane| pack.position.map(|row| row[lane])));
        places.map(move |place| place.map(|x| stencil::base_cell(x, cells_per_m)))
    }

    fn sort(&mut self) {
        if self.sorted.packs.is_empty() {
            self.sorted = Sorted::default();
            self.drift = 0.0;
            return;
        }
        self.sorted.sort(self.setting.laws.len(), 1.0 / self.setting.spacing_m);
        self.nodes.resize(self.sorted.columns.nodes() * grid::NODE, 0.0);
        self.drift = 0.0;
    }

    fn lost_in(&self, pack: usize) -> Lost {
        let outside = |p: &Particle| !is_within(self.setting.domain_m, p.position_m);
        let pack = &self.sorted.packs[pack];
        let (id, particle) =
            pack.particles().find(|(_, p)| outside(p)).unwrap_or_else(|| (pack.id[0], pack.particle(0)));
        Lost { particle: id as usize, position_m: particle.position_m, velocity_m_s: particle.velocity_m_s }
    }
}
