//! Von Mises plasticity on Hencky strain: where the deviatoric stress 2 mu |dev(eps)| exceeds the yield radius y, the
//! deviatoric strain is scaled back to it (radial return; Simo, *Algorithms for static and dynamic multiplicative
//! plasticity*, 1992). With hardening xi, y grows by 2 mu xi times the plastic strain.

use super::Point;
use super::hencky::{Strain, norm};
use crate::simulate::mpm::lanes::Lanes;
use crate::simulate::mpm::matrix::{Mat3, Sym3};

/// The stress, and the elastic deformation where any particle yielded.
#[inline(always)]
pub fn stress<L: Lanes>(point: Point<L>, hardening: f32) -> (Sym3<L>, Option<Mat3<L>>) {
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
    (yield_radius + two_mu * L::splat(hardening) * plastic).store(state);
    // Exactly the old deformation where nothing yields.
    let returned = strain.replaced(eps, &elastic);
    let mut elastic = elastic;
    for i in 0..3 {
        for j in 0..3 {
            elastic.0[i][j] = L::select(yields, returned.0[i][j], elastic.0[i][j]);
        }
    }
    (strain.stress(eps, mu, lambda), Some(elastic))
}
