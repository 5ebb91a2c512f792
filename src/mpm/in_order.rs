//! The particles for callers: in the order in which they were given.

use super::laws::{Law, energy};
use super::particles::{Pack, Particle};
use crate::simd::LANES;

/// All particles in the order in which they were given, wherever they are in the packs.
pub struct InOrder<'a> {
    packs: &'a [Pack],
    laws: &'a [Law],
    /// Per particle: its pack, times [`LANES`], plus its lane.
    places: Vec<u32>,
}

impl<'a> InOrder<'a> {
    pub fn new(packs: &'a [Pack], laws: &'a [Law]) -> Self {
        let mut places = vec![0; packs.iter().map(|pack| pack.live as usize).sum()];
        for (at, pack) in packs.iter().enumerate() {
            for (lane, &id) in pack.id[..pack.live as usize].iter().enumerate() {
                places[id as usize] = (at * LANES + lane) as u32;
            }
        }
        Self { packs, laws, places }
    }

    pub fn count(&self) -> usize {
        self.places.len()
    }

    pub fn get(&self, id: usize) -> Particle {
        let place = self.places[id] as usize;
        let mut particle = self.packs[place / LANES].particle(place % LANES);
        if !self.laws[particle.law as usize].is_plastic() {
            particle.deformation = particle.elastic;
        }
        particle
    }

    /// Elastic energy of a particle, J.
    pub fn elastic_j(&self, id: usize) -> f64 {
        let particle = self.get(id);
        energy::elastic_j(self.laws[particle.law as usize], &particle)
    }

    pub fn iter(&self) -> impl Iterator<Item = Particle> + '_ {
        (0..self.count()).map(|id| self.get(id))
    }
}
