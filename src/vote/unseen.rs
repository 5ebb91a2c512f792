//! Gaussians on which no view votes, inside or below the object, take the choice of the nearest seen ones.
//!
//! Distance is measured in the Gaussians' own metric: that of two centres in standard deviations of the sum of their
//! covariances (Mahalanobis). Flat Gaussians of one wall are near each other along the wall and far apart across it.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::tally::{Elected, PartMaterial};
use crate::gaussians::Gaussians;
use crate::numeric::nearest::Nearest;

/// Number of candidates per wanted neighbour, nearest by Euclidean distance, from which the metric selects.
const CANDIDATES_PER_NEIGHBOR: usize = 4;

/// The choice of every Gaussian: its own if it is seen, otherwise the most frequent among its `neighbors` nearest seen
/// ones; among equals, the nearest one's. `None` only if no Gaussian is seen.
pub(super) fn fill(gaussians: &Gaussians, elected: &[Option<Elected>], neighbors: usize) -> Option<Vec<PartMaterial>> {
    let seen: Vec<usize> = (0..elected.len()).filter(|&i| elected[i].is_some()).collect();
    if seen.is_empty() {
        return None;
    }
    let nearest = Nearest::new(seen.iter().map(|&i| gaussians.positions[i]));
    let of_neighbors = |i: usize| {
        let found = nearest.find(gaussians.positions[i], neighbors * CANDIDATES_PER_NEIGHBOR);
        let found = found.into_iter().map(|(_, at)| seen[at as usize]);
        most_frequent(&in_own_metric(gaussians, i, found), neighbors, elected)
    };
    (0..elected.len()).into_par_iter().map(|i| elected[i].map(|e| e.choice).or_else(|| of_neighbors(i))).collect()
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
