//! Splats Gaussians onto the grid: for every cell that a Gaussian reaches, its opacity times its fall-off there. The
//! grid's layers are processed in parallel, each with the Gaussians in the same order, so sums never depend on the
//! number of threads.

use nalgebra::{Matrix3, Point3, Vector3};

use super::Grid;
use crate::gaussians::Gaussians;
use crate::parallel;

/// A Gaussian is evaluated out to this many standard deviations; beyond, 1.1 % of its opacity or less is left.
const REACH: f64 = 3.0;
/// Layers processed together: with fewer, the search for Gaussians is repeated more often; with more, threads are left
/// idle.
const LAYERS: usize = 4;

/// A Gaussian prepared for evaluation on a grid.
struct Blob {
    center: Point3<f64>,
    opacity: f64,
    /// Inverse of the covariance.
    precision: Matrix3<f64>,
    spans: [[usize; 2]; 3],
    gaussian: usize,
}

/// Calls `add(layers, place, gaussian, value)` for every cell that a kept Gaussian reaches, where `layers` is the state
/// of the block of layers that holds the cell and `place` the cell's index within that block. The blocks are returned
/// in order.
///
/// Standard deviations below `least_deviation` cells are widened to this size: a flat Gaussian between two rows of cell
/// centres would otherwise touch neither.
pub fn splat<S: Send>(
    gaussians: &Gaussians,
    kept: &[bool],
    grid: &Grid,
    least_deviation: f64,
    new_block: impl Fn(std::ops::Range<usize>) -> S + Sync,
    add: impl Fn(&mut S, usize, usize, f64) + Sync,
) -> Vec<S> {
    let blob_of = |i: usize| if kept[i] { blob(gaussians, i, grid, least_deviation) } else { None };
    let blobs: Vec<Blob> = parallel::flat_map_range(gaussians.len(), blob_of);
    let blocks = grid.dims[2].div_ceil(LAYERS);
    let mut of_block: Vec<Vec<u32>> = vec![Vec::new(); blocks];
    for (n, blob) in blobs.iter().enumerate() {
        let [first, last] = blob.spans[2];
        for block in &mut of_block[first / LAYERS..=last / LAYERS] {
            block.push(n as u32);
        }
    }
    let layer = grid.layer();
    parallel::map_range(blocks, |block| {
        let (first, end) = (block * LAYERS, ((block + 1) * LAYERS).min(grid.dims[2]));
        let mut state = new_block(first * layer..end * layer);
        for n in &of_block[block] {
            blobs[*n as usize].visit(grid, [first, end - 1], |place, gaussian, value| {
                add(&mut state, place, gaussian, value);
            });
        }
        state
    })
}

fn blob(gaussians: &Gaussians, i: usize, grid: &Grid, least_deviation: f64) -> Option<Blob> {
    let least = least_deviation * grid.cell;
    let deviations = gaussians.scale(i).map(|s| s.max(least));
    let rotation = gaussians.rotation(i).to_rotation_matrix();
    let covariance = rotation * Matrix3::from_diagonal(&deviations.map(|s| s * s)) * rotation.transpose();
    let precision = rotation * Matrix3::from_diagonal(&deviations.map(|s| 1.0 / (s * s))) * rotation.transpose();
    let center = gaussians.center(i);
    let reach = Vector3::new(covariance[(0, 0)], covariance[(1, 1)], covariance[(2, 2)]).map(|v| REACH * v.sqrt());
    let spans = grid.cells_between(center - reach, center + reach)?;
    Some(Blob { center, opacity: gaussians.opacity(i), precision, spans, gaussian: i })
}

impl Blob {
    fn visit(&self, grid: &Grid, layers: [usize; 2], mut add: impl FnMut(usize, usize, f64)) {
        let [xs, ys, zs] = self.spans;
        for z in zs[0].max(layers[0])..=zs[1].min(layers[1]) {
            for y in ys[0]..=ys[1] {
                let row = (z - layers[0]) * grid.layer() + y * grid.dims[0];
                for x in xs[0]..=xs[1] {
                    let from_center = grid.center([x, y, z]) - self.center;
                    let distance2 = from_center.dot(&(self.precision * from_center));
                    if distance2 <= REACH * REACH {
                        add(row + x, self.gaussian, self.opacity * (-0.5 * distance2).exp());
                    }
                }
            }
        }
    }
}
