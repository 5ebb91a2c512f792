//! Drucker-Prager sand on Hencky strain (Klar et al., *Drucker-Prager Elastoplasticity for Sand Animation*, 2016): no
//! tension, and shear up to alpha times the pressure. Cohesion moves the cone's apex to the tension c cot(phi).

use super::Point;
use super::hencky::{Strain, norm};
use crate::mpm::matrix::{Mat3, Sym3};
use crate::simd::Lanes;

/// alpha for an internal friction angle: the cone through the outer edges of Mohr-Coulomb's pyramid.
pub fn alpha(friction_angle_rad: f64) -> f64 {
    let sine = friction_angle_rad.sin();
    (2.0_f64 / 3.0).sqrt() * 2.0 * sine / (3.0 - sine)
}

/// The tension at the cone's apex, for a cohesion and an internal friction angle.
pub fn apex(cohesion_pa: f64, friction_angle_rad: f64) -> f64 {
    cohesion_pa / friction_angle_rad.tan()
}

/// The stress, and the elastic deformation if any particle yielded.
#[inline(always)]
pub(super) fn stress<L: Lanes>(point: Point<L>, apex_pa: f32) -> (Sym3<L>, Option<Mat3<L>>) {
    let Point { elastic, mu, lambda, state } = point;
    let zero = L::splat(0.0);
    let strain = Strain::of(&elastic);
    // The strain at which the tension is the apex's in every direction: tr(tau) = (3 lambda + 2 mu) tr(eps).
    let stiffness = (L::splat(3.0) * lambda + mu + mu).max(L::splat(f32::MIN_POSITIVE));
    let apex = L::splat(3.0 * apex_pa) / stiffness;
    let (deviator, trace) = (strain.deviator(), strain.trace() - apex);
    let size = norm(deviator);
    let two_mu = mu + mu;
    let bulk = (L::splat(3.0) * lambda + two_mu) / two_mu.max(L::splat(f32::MIN_POSITIVE));
    let excess = (bulk * trace).mul_add(L::load(state), size);
    let tension = zero.less(trace);
    let slides = zero.less(excess);
    let free = L::select(tension, L::splat(1.0), zero);
    let share = L::select(slides, excess / size.max(L::splat(f32::MIN_POSITIVE)), zero);
    let moves = zero.less(free.max(share));
    if !L::any(moves) {
        return (strain.stress(strain.eps, mu, lambda), None);
    }
    let mut eps = strain.eps;
    for i in 0..3 {
        eps[i] = L::select(tension, apex * L::splat(1.0 / 3.0), eps[i] - share * deviator[i]);
    }
    let elastic = strain.replaced(eps, &elastic).or_else(moves, &elastic);
    (strain.stress(eps, mu, lambda), Some(elastic))
}
