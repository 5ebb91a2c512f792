//! Floaters: Gaussians that training left in mid-air do not belong to the object, nor do those that were set aside.

use std::collections::HashMap;

use crate::gaussians::Gaussians;
use crate::numeric::median;

/// Two Gaussians are connected if their voxels touch; a voxel's side is the diagonal of the cloud divided by this.
const VOXELS_PER_DIAGONAL: f64 = 64.0;
/// Least side of a voxel, in standard deviations of the Gaussians along their longest axes, in the median: those of a coarse
/// surface are this far apart. (Of a mug of 689 Gaussians, voxels without this limit lose three quarters.)
const LEAST_DEVIATIONS_PER_VOXEL: f64 = 1.5;
/// Share of the Gaussians at either end of each axis that is left out when the diagonal is measured, since floaters lie
/// far out.
const TRIMMED: f64 = 0.005;
/// Voxels farther out than this are merged into one, so that no position, however far, overflows an index.
const FARTHEST_VOXEL: f64 = 1e15;

/// Returns for each Gaussian whether to keep it: those of connected bodies with at least `min_share` of the summed
/// opacity are kept. If no body has that much, all are kept except those set aside.
pub fn without_floaters(gaussians: &Gaussians, min_share: f64) -> Vec<bool> {
    let own: Vec<usize> = (0..gaussians.len()).filter(|&i| !gaussians.is_set_aside(i)).collect();
    let mut kept = vec![false; gaussians.len()];
    own.iter().for_each(|&i| kept[i] = true);
    let deviation = median(own.iter().map(|&i| gaussians.scale(i).max()).collect()).unwrap_or(0.0);
    let fine = trimmed_diagonal(gaussians, &own) / VOXELS_PER_DIAGONAL;
    let side = fine.max(LEAST_DEVIATIONS_PER_VOXEL * deviation);
    if side <= 0.0 {
        return kept;
    }
    let place = |v: f32| (f64::from(v) / side).floor().clamp(-FARTHEST_VOXEL, FARTHEST_VOXEL) as i64;
    let mut voxels: Vec<[i64; 3]> = own.iter().map(|&i| gaussians.positions[i].map(place)).collect();
    let of_own = voxels.clone();
    voxels.sort_unstable();
    voxels.dedup();
    let number: HashMap<[i64; 3], usize> = voxels.iter().enumerate().map(|(n, v)| (*v, n)).collect();
    let body = bodies(&voxels, &number);

    let mut weight = vec![0.0; voxels.len()];
    for (&i, voxel) in own.iter().zip(&of_own) {
        weight[body[number[voxel]]] += gaussians.opacity(i);
    }
    let least = min_share * weight.iter().sum::<f64>();
    let stays = |voxel: &[i64; 3]| weight[body[number[voxel]]] >= least;
    if of_own.iter().any(stays) {
        own.iter().zip(&of_own).for_each(|(&i, voxel)| kept[i] = stays(voxel));
    }
    kept
}

/// Per voxel, the lowest number of the voxels that it is connected with, across faces, edges and corners.
fn bodies(voxels: &[[i64; 3]], number: &HashMap<[i64; 3], usize>) -> Vec<usize> {
    let mut body = vec![usize::MAX; voxels.len()];
    for seed in 0..voxels.len() {
        if body[seed] != usize::MAX {
            continue;
        }
        body[seed] = seed;
        let mut open = vec![seed];
        while let Some(at) = open.pop() {
            let [x, y, z] = voxels[at];
            for step in 0..27 {
                let beside = [x + step % 3 - 1, y + step / 3 % 3 - 1, z + step / 9 - 1];
                if let Some(&next) = number.get(&beside).filter(|&&n| body[n] == usize::MAX) {
                    body[next] = seed;
                    open.push(next);
                }
            }
        }
    }
    body
}

fn trimmed_diagonal(gaussians: &Gaussians, among: &[usize]) -> f64 {
    if among.is_empty() {
        return 0.0;
    }
    let side = |axis: usize| {
        let mut values: Vec<f32> = among.iter().map(|&i| gaussians.positions[i][axis]).collect();
        let cut = (values.len() as f64 * TRIMMED) as usize;
        let last = values.len() - 1 - cut;
        let low = *values.select_nth_unstable_by(cut, f32::total_cmp).1;
        let high = *values.select_nth_unstable_by(last, f32::total_cmp).1;
        f64::from(high - low)
    };
    (0..3).map(|axis| side(axis).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A surface whose Gaussians lie farther apart on one half than a 64th of it, and one in mid-air.
    #[test]
    fn a_coarse_surface_is_one_body() {
        const DEVIATION: f32 = 0.07;
        let half = |step: f32, from: f32| {
            (0..10).flat_map(move |i| (0..10).map(move |j| [from + step * i as f32, step * j as f32, 0.0]))
        };
        let mut positions: Vec<[f32; 3]> = half(0.04, -0.4).chain(half(0.1, 0.0)).collect();
        positions.push([0.5, 0.5, 0.5]);
        let count = positions.len();
        let gaussians = Gaussians {
            positions,
            log_scales: vec![[DEVIATION.ln(); 3]; count],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; count],
            opacity_logits: vec![3.0; count],
            sh_dc: vec![[0.0; 3]; count],
            ..Gaussians::default()
        };
        let kept = without_floaters(&gaussians, 0.05);
        assert!(kept[..count - 1].iter().all(|kept| *kept));
        assert!(!kept[count - 1]);
    }
}
