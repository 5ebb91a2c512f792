//! A weakly compressible fluid without viscosity: pressure by Tait's equation, p = K / gamma (J^-gamma - 1), with K in
//! lambda's place (Monaghan, *Simulating Free Surface Flows with SPH*, 1994); it bears no tension. Its deformation is kept as
//! the volume ratio alone.

use super::Point;
use super::exp;
use crate::simd::{Lanes, ln};
use crate::simulate::mpm::matrix::{Mat3, Sym3};

/// Water's exponent.
pub(super) const GAMMA: f32 = 7.0;

/// The least volume ratio that a particle is pressed to.
pub(super) const LEAST_RATIO: f32 = 0.1;

#[inline(always)]
pub(super) fn stress<L: Lanes>(point: &Point<L>) -> (Sym3<L>, Option<Mat3<L>>) {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    // Where it is pulled apart it separates: the volume ratio does not remember how far.
    let j = point.elastic.determinant().max(L::splat(LEAST_RATIO)).min(one);
    let log = ln(j);
    let pressure = point.lambda * L::splat(1.0 / GAMMA) * (exp(-(log * L::splat(GAMMA))) - one);
    let side = exp(log * L::splat(1.0 / 3.0));
    let round = Mat3([[side, zero, zero], [zero, side, zero], [zero, zero, side]]);
    (Sym3::zero().plus_diagonal(-(pressure * j)), Some(round))
}
