//! The splat in fewer Gaussians, for pictures in which the many cannot be told apart.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::gaussians::{Gaussians, wxyz};

/// At most `most` Gaussians, each of which stands for neighbours: it has their mean place and colour, their common
/// covariance, and their absorbing area, which is opacity times the two larger standard deviations. `cloud` itself if it
/// has no more than that. Properties that gprop does not know are dropped.
pub(super) fn merged(cloud: &Gaussians, most: usize) -> Gaussians {
    let mut merged = Gaussians { sh_degree: cloud.sh_degree, antialiased: cloud.antialiased, ..Gaussians::default() };
    let mut seen: Vec<usize> = (0..cloud.len()).filter(|i| cloud.opacity(*i) > 0.0).collect();
    for group in groups(cloud, &mut seen, most) {
        push(&mut merged, cloud, &group);
    }
    merged
}

/// Neighbours, split along the longest side of their box until there are enough groups of the same size.
fn groups(cloud: &Gaussians, indices: &mut [usize], most: usize) -> Vec<Vec<usize>> {
    if indices.len() <= 1 || most <= 1 {
        return if indices.is_empty() { Vec::new() } else { vec![indices.to_vec()] };
    }
    let places = || indices.iter().map(|i| Vector3::from(cloud.positions[*i]));
    let low = places().fold(Vector3::repeat(f32::INFINITY), |low, place| low.inf(&place));
    let high = places().fold(Vector3::repeat(f32::NEG_INFINITY), |high, place| high.sup(&place));
    let axis = (high - low).imax();
    let half = indices.len() / 2;
    let key = |i: &usize| cloud.positions[*i][axis];
    indices.select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
    let (below, above) = indices.split_at_mut(half);
    let mut all = groups(cloud, below, most / 2);
    all.extend(groups(cloud, above, most - most / 2));
    all
}

/// Adds one Gaussian that stands for the group.
fn push(merged: &mut Gaussians, cloud: &Gaussians, group: &[usize]) {
    if let [one] = group {
        merged.positions.push(cloud.positions[*one]);
        merged.log_scales.push(cloud.log_scales[*one]);
        merged.rotations.push(cloud.rotations[*one]);
        merged.opacity_logits.push(cloud.opacity_logits[*one]);
        merged.sh_dc.push(cloud.sh_dc[*one]);
        merged.sh_rest.extend(cloud.sh_rest_of(*one));
        return;
    }
    let areas: Vec<f64> = group.iter().map(|i| cloud.opacity(*i) * area(cloud.scale(*i))).collect();
    let total: f64 = areas.iter().sum();
    let share = |index: usize| if total > 0.0 { areas[index] / total } else { 1.0 / group.len() as f64 };
    let members = || group.iter().enumerate().map(|(index, i)| (*i, share(index)));
    let center: Vector3<f64> = members().map(|(i, share)| cloud.center(i).coords * share).sum();
    let spread = |(i, share): (usize, f64)| {
        let offset = cloud.center(i).coords - center;
        (cloud.covariance(i) + offset * offset.transpose()) * share
    };
    let covariance: Matrix3<f64> = members().map(spread).sum();
    let eigen = covariance.symmetric_eigen();
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(0).neg_mut();
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let deviations = eigen.eigenvalues.map(|variance| variance.max(f64::from(f32::MIN_POSITIVE)).sqrt());
    let opacity = (total / area(deviations)).clamp(1e-6, 1.0 - 1e-6);
    let mean =
        |values: &dyn Fn(usize) -> f32| members().map(|(i, share)| f64::from(values(i)) * share).sum::<f64>() as f32;
    merged.positions.push(center.map(|side| side as f32).into());
    merged.log_scales.push(deviations.map(|side| side.ln() as f32).into());
    merged.rotations.push(wxyz(&turn));
    merged.opacity_logits.push((opacity / (1.0 - opacity)).ln() as f32);
    merged.sh_dc.push([0, 1, 2].map(|channel| mean(&|i| cloud.sh_dc[i][channel])));
    merged.sh_rest.extend((0..3 * cloud.sh_rest_per_channel()).map(|at| mean(&|i| cloud.sh_rest_of(i)[at])));
}

/// The product of the two larger standard deviations.
pub(super) fn area(deviations: Vector3<f64>) -> f64 {
    let mut sides: [f64; 3] = deviations.into();
    sides.sort_by(f64::total_cmp);
    sides[1] * sides[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Round Gaussians along the x axis, half opaque.
    fn row(places: &[f32], deviation: f32) -> Gaussians {
        let count = places.len();
        Gaussians {
            positions: places.iter().map(|x| [*x, 0.0, 0.0]).collect(),
            log_scales: vec![[deviation.ln(); 3]; count],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; count],
            opacity_logits: vec![0.0; count],
            sh_dc: places.iter().map(|x| [*x; 3]).collect(),
            ..Gaussians::default()
        }
    }

    /// Values are stored in 24 bits.
    const ROUNDING: f64 = 1e-5;

    #[test]
    fn neighbours_become_one_with_their_mean_spread_and_area() {
        let merged = merged(&row(&[-1.0, 1.0, 10.0, 12.0], 0.5), 2);
        let mut centers: Vec<f64> = (0..merged.len()).map(|i| merged.center(i).x).collect();
        centers.sort_by(f64::total_cmp);
        assert!((centers[0]).abs() < ROUNDING && (centers[1] - 11.0).abs() < ROUNDING, "{centers:?}");
        for i in 0..2 {
            let covariance = merged.covariance(i);
            // 0.5^2, and along x the two centres, each 1 from their mean.
            assert!(
                (covariance.m11 - 1.25).abs() < ROUNDING && (covariance.m22 - 0.25).abs() < ROUNDING,
                "{covariance}"
            );
            // Two half opaque areas of 0.25.
            assert!((merged.opacity(i) * area(merged.scale(i)) - 0.25).abs() < ROUNDING);
            assert!((f64::from(merged.sh_dc[i][0]) - merged.center(i).x).abs() < ROUNDING);
        }
    }

    #[test]
    fn few_gaussians_stay_as_they_are() {
        let few = row(&[3.0, 1.0, 2.0], 0.1);
        let mut places = merged(&few, 3).positions;
        places.sort_by(|a, b| a[0].total_cmp(&b[0]));
        assert_eq!(places, [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]);
        assert!(merged(&Gaussians::default(), 3).is_empty());
    }
}
