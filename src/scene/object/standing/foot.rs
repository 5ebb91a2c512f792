//! Where an object touches the support.

use std::collections::BTreeSet;

use nalgebra::Point2;

use super::cells::Cells;
use super::{Cluster, Region, cell};

/// Height of the Gaussians that tell where an object touches the support, in thicknesses of the surface.
const FOOT: f64 = 2.0;
/// Side of a cell of the foot.
pub(super) const FOOT_CELL: f64 = 1.0 / 400.0;
/// Standard deviations of a Gaussian that the foot covers.
const FOOT_DEVIATIONS: f64 = 1.5;
/// Gaps in the rim of a foot that are closed have up to twice this many cells (20 mm if the cameras are a metre away); the rim is
/// as wide.
const RIM_CELLS: usize = 4;
/// Most cells that the foot of one Gaussian covers along each axis, so that the time is bounded.
const MOST_FOOT_CELLS: i64 = 32;

/// Where an object touches the support: cells covered by its lowest Gaussians, and all that they enclose.
pub(super) struct Foot {
    solid: Cells,
    /// Without its [rim](RIM_CELLS).
    inner: Cells,
}

/// What a place is to a foot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Standpoint {
    Beside,
    /// On the foot, close to its border.
    Rim,
    /// On the rest of it.
    Foot,
}

impl Foot {
    pub fn of(region: &Region, cluster: &Cluster) -> Self {
        let surface = &region.surface;
        let is_low = |i: &&usize| region.places[i].height <= (1.0 + FOOT) * surface.thickness;
        let mut covered = BTreeSet::new();
        for &i in cluster.indices.iter().filter(is_low) {
            cover(region, i, &mut covered);
        }
        let mut solid = Cells::new(&covered, RIM_CELLS);
        solid.close(RIM_CELLS);
        let mut inner = solid.clone();
        (0..RIM_CELLS).for_each(|_| inner.grow(false));
        Self { solid, inner }
    }

    pub fn at(&self, along: &Point2<f64>) -> Standpoint {
        let at = cell(along, FOOT_CELL);
        match (self.solid.contains(at), self.inner.contains(at)) {
            (_, true) => Standpoint::Foot,
            (true, false) => Standpoint::Rim,
            (false, false) => Standpoint::Beside,
        }
    }
}

/// Adds the cells whose centres lie within [`FOOT_DEVIATIONS`] of a Gaussian seen from above, and the cell of its own centre.
pub(super) fn cover(region: &Region, i: usize, covered: &mut BTreeSet<[i64; 2]>) {
    let (surface, side) = (&region.surface, FOOT_CELL);
    let center = &region.places[&i].along;
    let spread = surface.axes.transpose() * region.gaussians.covariance(i) * surface.axes / surface.unit.powi(2);
    let [x, y] = cell(center, side);
    covered.insert([x, y]);
    let Some(inverse) = spread.try_inverse() else { return };
    let reach = |axis: usize| {
        let cells = (FOOT_DEVIATIONS * spread[(axis, axis)].max(0.0).sqrt() / side).ceil();
        (cells as i64).min(MOST_FOOT_CELLS)
    };
    for i in x - reach(0)..=x + reach(0) {
        for j in y - reach(1)..=y + reach(1) {
            let from_center = Point2::new(i as f64 + 0.5, j as f64 + 0.5) * side - center;
            if (from_center.transpose() * inverse * from_center)[0] <= FOOT_DEVIATIONS.powi(2) {
                covered.insert([i, j]);
            }
        }
    }
}
