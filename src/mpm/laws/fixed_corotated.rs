//! Fixed corotated elasticity (Stomakhin et al., *Energetically Consistent Invertible Elasticity*, 2012):
//! tau = 2 mu (F - R) F^T + lambda J (J - 1) I.

use super::Point;
use crate::mpm::eigen::rotation;
use crate::mpm::matrix::{Mat3, Sym3};
use crate::simd::Lanes;

#[inline(always)]
pub(super) fn stress<L: Lanes>(point: &Point<L>) -> Sym3<L> {
    let f = &point.elastic;
    let r = rotation(f);
    let mut strain = Mat3(f.0);
    for i in 0..3 {
        for j in 0..3 {
            strain.0[i][j] = f.0[i][j] - r.0[i][j];
        }
    }
    let two_mu = point.mu + point.mu;
    let j = f.determinant();
    strain.times_transposed_symmetric(f).scaled(two_mu).plus_diagonal(point.lambda * j * (j - L::splat(1.0)))
}
