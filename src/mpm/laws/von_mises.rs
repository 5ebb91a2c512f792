//! Von Mises plasticity on Hencky strain: if the deviatoric stress 2 mu |dev(eps)| exceeds the yield radius y, the
//! deviatoric strain is scaled back to it (radial return; Simo, *Algorithms for static and dynamic multiplicative
//! plasticity*, 1992). With hardening xi, y grows by 2 mu xi times the plastic strain; with softening, y decays by that
//! fraction of itself per unit of plastic strain, like kneaded clay.

use super::Point;
use super::hencky::{Strain, norm};
use crate::mpm::matrix::{Mat3, Sym3};
use crate::simd::Lanes;

/// The yield radius for a yield stress in uniaxial tension, both Pa: |dev(tau)| = sqrt(2/3) sigma_y.
pub fn yield_radius(yield_stress_pa: f64) -> f64 {
    (2.0_f64 / 3.0).sqrt() * yield_stress_pa
}

/// The stress, and the elastic deformation if any particle yielded.
#[inline(always)]
pub(super) fn stress<L: Lanes>(point: Point<L>, hardening: f32, softening: f32) -> (Sym3<L>, Option<Mat3<L>>) {
    let Point { elastic, mu, lambda, state } = point;
    let strain = Strain::of(&elastic);
    let deviator = strain.deviator();
    let size = norm(deviator);
    let two_mu = mu + mu;
    let yield_radius = L::load(state);
    let yields = yield_radius.less(two_mu * size);
    if !L::any(yields) {
        return (strain.stress(strain.eps, mu, lambda), None);
    }
    let zero = L::splat(0.0);
    // With hardening the stress returns to the grown surface: 2 mu (|dev| - g) = y + 2 mu xi g.
    let plastic = (size - yield_radius / two_mu) / L::splat(1.0 + hardening);
    let plastic = L::select(yields, plastic, zero);
    let share = L::select(yields, plastic / size, zero);
    let mut eps = strain.eps;
    for i in 0..3 {
        eps[i] = eps[i] - share * deviator[i];
    }
    let kept = L::splat(1.0) / plastic.mul_add(L::splat(softening), L::splat(1.0));
    (yield_radius * kept + two_mu * L::splat(hardening) * plastic).store(state);
    let elastic = strain.replaced(eps, &elastic).or_else(yields, &elastic);
    (strain.stress(eps, mu, lambda), Some(elastic))
}
