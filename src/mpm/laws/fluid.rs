//! A weakly compressible fluid without viscosity: pressure by Tait's equation, p = K / gamma (J^-gamma - 1), with K in
//! place of lambda (Monaghan, *Simulating Free Surface Flows with SPH*, 1994); it has no tension. Of its deformation,
//! only the volume ratio is kept.

use super::Point;
use super::exp;
use crate::mpm::matrix::{Mat3, Sym3};
use crate::simd::{Lanes, ln};

/// The exponent for water.
pub(super) const GAMMA: f32 = 7.0;

/// The smallest volume ratio to which a particle is compressed.
pub(super) const LEAST_RATIO: f32 = 0.1;

#[inline(always)]
pub(super) fn stress<L: Lanes>(point: &Point<L>) -> (Sym3<L>, Option<Mat3<L>>) {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    // If pulled apart, the fluid separates: the volume ratio does not store how far.
    let j = point.elastic.determinant().max(L::splat(LEAST_RATIO)).min(one);
    let log = ln(j);
    let pressure = point.lambda * L::splat(1.0 / GAMMA) * (exp(-(log * L::splat(GAMMA))) - one);
    let side = exp(log * L::splat(1.0 / 3.0));
    let round = Mat3([[side, zero, zero], [zero, side, zero], [zero, zero, side]]);
    (Sym3::zero().plus_diagonal(-(pressure * j)), Some(round))
}
