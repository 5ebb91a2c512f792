//! Viscoplastic foam on Hencky strain (Yue et al., *Continuum Foam*, 2015, without thickening): above the yield radius
//! the deviatoric stress s relaxes at a rate that the plastic viscosity eta sets; within a step of dt it falls by
//! excess / (1 + eta / (2 mu' dt)), mu' = mu tr(b) / 3. Without viscosity this is von Mises.

use super::Point;
use super::hencky::{Strain, norm};
use crate::mpm::matrix::{Mat3, Sym3};
use crate::simd::Lanes;

/// The stress, and the elastic deformation if any particle flowed.
#[inline(always)]
pub(super) fn stress<L: Lanes>(point: Point<L>, viscosity_pa_s: f32, dt_s: f32) -> (Sym3<L>, Option<Mat3<L>>) {
    let Point { elastic, mu, lambda, state } = point;
    let strain = Strain::of(&elastic);
    let deviator = strain.deviator();
    let size = norm(deviator);
    let two_mu = mu + mu;
    let excess = size - L::load(state) / two_mu;
    let zero = L::splat(0.0);
    let flows = zero.less(excess);
    if !L::any(flows) {
        return (strain.stress(strain.eps, mu, lambda), None);
    }
    let one = L::splat(1.0);
    let mu_hat = mu * strain.mean_square_stretch();
    let relaxed = excess / (one + L::splat(viscosity_pa_s / (2.0 * dt_s)) / mu_hat);
    let share = L::select(flows, relaxed / size, zero);
    let mut eps = strain.eps;
    for i in 0..3 {
        eps[i] = eps[i] - share * deviator[i];
    }
    let elastic = strain.replaced(eps, &elastic).or_else(flows, &elastic);
    (strain.stress(eps, mu, lambda), Some(elastic))
}
