//! The nodes that guests reach, between the two halves of a substep.

use super::Solver;
use super::grid::NODE;
use super::stencil::base_cell;

/// A node that a guest reaches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reached {
    /// Its number among the nodes.
    pub node: usize,
    /// x y z, in cells.
    pub cell: [i32; 3],
    /// The guest's B-spline weight there.
    pub weight: f32,
}

impl Solver {
    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.sorted.columns.nodes()
    }

    /// Calls `visit` for every guest, by its number among them, and every node that it reaches.
    pub fn reach(&self, mut visit: impl FnMut(usize, Reached)) {
        let cells_per_m = 1.0 / self.setting.spacing_m;
        let guests = self.sorted.packs.iter().filter(|pack| pack.id[0] as usize >= self.own);
        for (pack, lane) in guests.flat_map(|pack| (0..pack.live as usize).map(move |lane| (pack, lane))) {
            let base = pack.position.map(|row| base_cell(row[lane], cells_per_m));
            let weights: [[f32; 3]; 3] =
                std::array::from_fn(|a| weights(pack.position[a][lane] * cells_per_m, base[a]));
            for n in 0..27 {
                let at = [n / 9, n / 3 % 3, n % 3];
                let weight: f32 = (0..3).map(|a| weights[a][at[a]]).product();
                let cell = std::array::from_fn(|a| base[a] + at[a] as i32);
                let node = self.sorted.columns.node(cell);
                visit(pack.id[lane] as usize - self.own, Reached { node, cell, weight });
            }
        }
    }

    /// Velocity and mass of a node.
    pub fn node(&self, node: usize) -> ([f32; 3], f32) {
        let [x, y, z, mass] = self.nodes.as_chunks::<NODE>().0[node];
        ([x, y, z], mass)
    }

    /// Gives a node a velocity, as far as the boundaries allow.
    pub fn set_node(&mut self, node: usize, cell: [i32; 3], velocity_m_s: [f32; 3]) {
        let position_m = cell.map(|n| n as f32 * self.setting.spacing_m);
        let bounded = self.setting.boundaries.iter().fold(velocity_m_s, |v, boundary| boundary.apply(position_m, v));
        self.nodes[node * NODE..][..3].copy_from_slice(&bounded);
    }
}

/// Weights of the three nodes from `base` on for a particle at `place`, in cells: those of
/// [`Stencil`](super::stencil::Stencil).
fn weights(place: f32, base: i32) -> [f32; 3] {
    let offset = place - base as f32;
    let (a, b, c) = (1.5 - offset, offset - 1.0, offset - 0.5);
    [0.5 * a * a, 0.75 - b * b, 0.5 * c * c]
}
