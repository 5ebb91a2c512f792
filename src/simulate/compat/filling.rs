//! The peer's filling: a density on a grid, dense cells topped up with particles, then particles for the cells that lie
//! inside.
//!
//! A cell lies inside if it is empty, every ray along the axes (but an excluded one) meets density above the search
//! threshold, and a ray along one direction enters it an odd number of times. Directions 0 to 5: x, -x, y, -y, z, -z.
//! New particles lie at random positions in their cells; the random numbers differ from the peer's.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use super::config::Filling;
use super::eigen::symmetric_eigen;
use super::smoothing;
use crate::simulate::SimulateError;

/// The smallest variance of a Gaussian along an axis: the peer's floor.
const LEAST_VARIANCE: f32 = 1e-8;

/// Seed of the random positions inside a cell.
const SEED: u64 = 9;

/// A Gaussian with the attributes that the filling needs.
#[derive(Debug, Clone, Copy)]
pub struct Blob {
    pub position: Vector3<f32>,
    pub opacity: f32,
    /// Upper triangle of the covariance, row by row.
    pub covariance: [f32; 6],
}

/// Cells of the grid, last axis fastest.
#[derive(Debug, Clone)]
pub struct Filled {
    /// Particles in a cell: before the filling, after filling the dense cells, and after filling the inside.
    pub counts: Vec<i32>,
    pub counts_dense: Vec<i32>,
    pub counts_inside: Vec<i32>,
    pub density: Vec<f32>,
    /// The density that was searched: smoothed, if the configuration asks for it.
    pub density_used: Vec<f32>,
    /// Number of particles added to dense cells: the first of `added`.
    pub added_dense: usize,
    pub added: Vec<Vector3<f32>>,
}

/// Fills the box, or the part of it within the filling's boundary, on a grid of `cells` cells each way; `dx` is their
/// edge if there is no boundary.
///
/// # Errors
/// If there are more particles than the configuration allows.
pub fn fill(blobs: &[Blob], cells: usize, dx: f32, filling: &Filling) -> Result<Filled, SimulateError> {
    let Some([x0, x1, y0, y1, z0, z1]) = filling.boundary else {
        return fill_grid(blobs, cells, dx, filling);
    };
    let (low, high) = (Vector3::new(x0, y0, z0), Vector3::new(x1, y1, z1));
    let within = |b: &&Blob| (0..3).all(|a| low[a] < b.position[a] && b.position[a] < high[a]);
    let inner = |b: &Blob| Blob { position: b.position - low, ..*b };
    let blobs: Vec<Blob> = blobs.iter().filter(within).map(inner).collect();
    let mut filled = fill_grid(&blobs, cells, (high - low).max() / cells as f32, filling)?;
    for place in &mut filled.added {
        *place += low;
    }
    Ok(filled)
}

fn fill_grid(blobs: &[Blob], cells: usize, dx: f32, filling: &Filling) -> Result<Filled, SimulateError> {
    let (counts, density) = densified(blobs, cells, dx);
    let most = filling.max_partciels_per_cell;
    let mut counts_dense = counts.clone();
    for (count, density) in counts_dense.iter_mut().zip(&density) {
        if *density > filling.density_threshold {
            *count = most.max(*count);
        }
    }
    let density_used = if filling.smooth {
        let inside: Vec<bool> = density.iter().map(|d| *d > 0.0).collect();
        smoothing::smooth(&inside, cells).into_iter().map(|d| d as f32).collect()
    } else {
        density.clone()
    };
    let rays = Rays { density: &density_used, cells, threshold: filling.search_threshold };
    let mut counts_inside = counts_dense.clone();
    for cell in (0..counts_inside.len()).filter(|&cell| counts_dense[cell] == 0) {
        let closed = (0..6).filter(|d| *d != filling.search_exclude_direction).all(|d| rays.hits(cell, d));
        if closed && rays.entries(cell, filling.ray_cast_direction) % 2 == 1 {
            counts_inside[cell] = most;
        }
    }
    // Counted before any of them is placed: the configuration may ask for more than fit into memory.
    let steps = [(&counts, &counts_dense), (&counts_dense, &counts_inside)];
    let [added_dense, added_inside] =
        steps.map(|(before, after)| missing(before, after).map(|numbers| numbers.len()).sum::<usize>());
    if added_dense + added_inside > filling.max_particles_num {
        return Err(SimulateError::Configuration(format!(
            "the filling adds {} particles, more than `max_particles_num`; raise that or `search_threshold`, or lower `max_partciels_per_cell`",
            added_dense + added_inside
        )));
    }
    let mut random = fastrand::Rng::with_seed(SEED);
    let mut place = |cell: usize| {
        let corner = [cell / cells / cells, cell / cells % cells, cell % cells];
        Vector3::from(corner.map(|i| (i as f32 + random.f32()) * dx))
    };
    let mut added = Vec::with_capacity(added_dense + added_inside);
    for (before, after) in steps {
        for (cell, numbers) in missing(before, after).enumerate() {
            added.extend(numbers.map(|_| place(cell)));
        }
    }
    Ok(Filled { counts, counts_dense, counts_inside, density, density_used, added_dense, added })
}

/// For each cell, the numbers of the particles that it lacks, if it has as many as `before` and should have as many as
/// `after`.
fn missing(before: &[i32], after: &[i32]) -> impl Iterator<Item = Range<i32>> {
    before.iter().zip(after).map(|(before, after)| *before..*after)
}

/// Particles in each cell, and the density: the sum over all Gaussians of opacity times the mean of the Gaussian over
/// the corners of the cells within its largest standard deviation.
fn densified(blobs: &[Blob], cells: usize, dx: f32) -> (Vec<i32>, Vec<f32>) {
    let mut counts = vec![0; cells * cells * cells];
    let mut density = vec![0.0_f32; counts.len()];
    for blob in blobs {
        let at = (blob.position / dx).map(|x| x.floor() as i64);
        let inside = |at: &Vector3<i64>| at.iter().all(|i| (0..cells as i64).contains(i));
        let index = |at: &Vector3<i64>| ((at.x as usize * cells) + at.y as usize) * cells + at.z as usize;
        if inside(&at) {
            counts[index(&at)] += 1;
        }
        let [xx, xy, xz, yy, yz, zz] = blob.covariance;
        let (variances, axes) = symmetric_eigen(&Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz));
        let variances = variances.map(|v| v.max(LEAST_VARIANCE));
        let inverse = axes * Matrix3::from_diagonal(&variances.map(|v| 1.0 / v)) * axes.transpose();
        // A Gaussian larger than the grid covers all of it.
        let radius = ((variances.max().sqrt() / dx).ceil() as i64).min(cells as i64);
        let range = |a: usize| (at[a] - radius).max(0)..(at[a] + radius + 1).min(cells as i64);
        for i in range(0) {
            for j in range(1) {
                for k in range(2) {
                    let mut bell = 0.0_f32;
                    for corner in 0..8_i64 {
                        let node = Vector3::new(i + (corner >> 2), j + (corner >> 1 & 1), k + (corner & 1));
                        let away = blob.position - node.map(|n| n as f32) * dx;
                        bell += flushed((-0.5 * away.dot(&(inverse * away))).exp());
                    }
                    density[index(&Vector3::new(i, j, k))] += flushed(blob.opacity * bell / 8.0);
                }
            }
        }
    }
    (counts, density)
}

/// Subnormal numbers become zero, as in the peer: the smoothing tests whether there is any density at all.
fn flushed(value: f32) -> f32 {
    if value < f32::MIN_POSITIVE { 0.0 } else { value }
}

/// Rays through the cells.
struct Rays<'a> {
    density: &'a [f32],
    cells: usize,
    threshold: f32,
}

impl Rays<'_> {
    /// For each cell beyond `cell` in a direction, in order: true if it is dense.
    fn beyond(&self, cell: usize, direction: i32) -> impl Iterator<Item = bool> + '_ {
        let stride = [self.cells * self.cells, self.cells, 1][direction as usize / 2];
        let along = cell / stride % self.cells;
        let forward = direction % 2 == 0;
        let steps = if forward { self.cells - 1 - along } else { along };
        (1..=steps).map(move |n| {
            let cell = if forward { cell + n * stride } else { cell - n * stride };
            self.density[cell] > self.threshold
        })
    }

    fn hits(&self, cell: usize, direction: i32) -> bool {
        self.beyond(cell, direction).any(|dense| dense)
    }

    /// How often the ray from an empty cell enters dense cells; 1 for an invalid direction.
    fn entries(&self, cell: usize, direction: i32) -> usize {
        if !(0..6).contains(&direction) {
            return 1;
        }
        let mut before = false;
        let mut entries = 0;
        for dense in self.beyond(cell, direction) {
            entries += usize::from(dense && !before);
            before = dense;
        }
        entries
    }
}

/// Volume of each particle: its cell's, divided equally among the particles in it; if `uniform`, all get the mean.
pub fn volumes(positions: &[Vector3<f32>], cells: usize, dx: f32, uniform: bool) -> Vec<f32> {
    let cell = |p: &Vector3<f32>| {
        let [i, j, k] = [0, 1, 2].map(|a| ((p[a] / dx).floor() as usize).min(cells - 1));
        (i * cells + j) * cells + k
    };
    let mut counts = vec![0_u32; cells * cells * cells];
    for p in positions {
        counts[cell(p)] += 1;
    }
    let volumes: Vec<f32> = positions.iter().map(|p| dx.powi(3) / counts[cell(p)] as f32).collect();
    if !uniform {
        return volumes;
    }
    let mean = volumes.iter().map(|v| f64::from(*v)).sum::<f64>() / volumes.len().max(1) as f64;
    vec![mean as f32; volumes.len()]
}
