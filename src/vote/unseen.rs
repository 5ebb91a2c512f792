//! Gaussians on which no view votes, inside or below the object, take the choice of the nearest seen ones.
//!
//! Distance is measured in the Gaussians' own metric: that of two centres in standard deviations of the sum of their
//! covariances (Mahalanobis). Flat Gaussians of one wall are near each other along the wall and far apart across it.
//!
//! Of a mesh, only Gaussians of the same connected surface count, if any of them is seen: the underside of a cup has the cup's
//! label, however near the saucer is.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::tally::{Elected, PartMaterial};
use crate::gaussians::Gaussians;
use crate::numeric::nearest::Nearest;
use crate::parallel;

/// Number of candidates per wanted neighbour, nearest by Euclidean distance, from which the metric selects.
const CANDIDATES_PER_NEIGHBOR: usize = 4;

/// The choice of every Gaussian: its own if it is seen, otherwise the most frequent among its `neighbors` nearest seen
/// ones; among equals, the nearest one's. `None` only if no Gaussian is seen.
pub(super) fn fill(gaussians: &Gaussians, elected: &[Option<Elected>], neighbors: usize) -> Option<Vec<PartMaterial>> {
    let seen: Vec<usize> = (0..elected.len()).filter(|&i| elected[i].is_some()).collect();
    if seen.is_empty() {
        return None;
    }
    let of_surface = by_surface(gaussians, &seen);
    let everywhere = Seen::of(gaussians, seen);
    let of_neighbors = |i: usize| {
        let seen = of_surface.get(&gaussians.surface_of(i)).unwrap_or(&everywhere);
        let found = seen.near(gaussians.positions[i], neighbors * CANDIDATES_PER_NEIGHBOR);
        most_frequent(&in_own_metric(gaussians, i, found), neighbors, elected)
    };
    let choice = |i: usize| elected[i].map(|e| e.choice).or_else(|| of_neighbors(i));
    parallel::map_range(elected.len(), choice).into_iter().collect()
}

/// Seen Gaussians, to be searched.
struct Seen {
    indices: Vec<usize>,
    nearest: Nearest,
}

impl Seen {
    fn of(gaussians: &Gaussians, indices: Vec<usize>) -> Self {
        let nearest = Nearest::new(indices.iter().map(|&i| gaussians.positions[i]));
        Self { indices, nearest }
    }

    /// The indices of the `count` nearest to a place, by Euclidean distance.
    fn near(&self, to: [f32; 3], count: usize) -> impl Iterator<Item = usize> {
        self.nearest.find(to, count).into_iter().map(|(_, at)| self.indices[at as usize])
    }
}

/// The seen Gaussians of each connected surface; empty for a splat.
fn by_surface(gaussians: &Gaussians, seen: &[usize]) -> BTreeMap<u32, Seen> {
    let mut of_surface: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for &i in seen.iter().filter(|_| !gaussians.surface.is_empty()) {
        of_surface.entry(gaussians.surface_of(i)).or_default().push(i);
    }
    of_surface.into_iter().map(|(surface, indices)| (surface, Seen::of(gaussians, indices))).collect()
}

/// Sorts by squared Mahalanobis distance; among equals, the order stays.
fn in_own_metric(gaussians: &Gaussians, i: usize, others: impl Iterator<Item = usize>) -> Vec<usize> {
    let covariance = gaussians.covariance(i);
    let mut ranked: Vec<(f64, usize)> = others
        .map(|j| {
            let offset = gaussians.center(j) - gaussians.center(i);
            (squared_deviations(covariance + gaussians.covariance(j), offset), j)
        })
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.into_iter().map(|(_, j)| j).collect()
}

/// Infinite if the covariance has no inverse, as for two flat Gaussians in one plane. Such neighbours come last, those
/// that are nearest by Euclidean distance first.
fn squared_deviations(covariance: Matrix3<f64>, offset: Vector3<f64>) -> f64 {
    covariance.cholesky().map_or(f64::INFINITY, |factor| offset.dot(&factor.solve(&offset)))
}

/// The most frequent choice among the first `count`; among equals, the one found first.
fn most_frequent(neighbors: &[usize], count: usize, elected: &[Option<Elected>]) -> Option<PartMaterial> {
    let mut tally: Vec<(PartMaterial, usize)> = Vec::new();
    for choice in neighbors.iter().take(count).filter_map(|&j| elected[j]).map(|elected| elected.choice) {
        match tally.iter_mut().find(|(known, _)| *known == choice) {
            Some((_, votes)) => *votes += 1,
            None => tally.push((choice, 1)),
        }
    }
    let more = |best: (PartMaterial, usize), next: (PartMaterial, usize)| if next.1 > best.1 { next } else { best };
    tally.into_iter().reduce(more).map(|(choice, _)| choice)
}
