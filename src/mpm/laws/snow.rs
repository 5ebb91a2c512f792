//! Snow (Stomakhin et al., *A Material Point Method for Snow Simulation*, 2013): principal stretches stay within
//! 1 - theta_c and 1 + theta_s, and anything beyond is plastic; compacted snow hardens and torn snow softens, by
//! exp(xi (1 - J_P)), with J_P the volume ratio of the plastic part; the stress is fixed corotated.

use super::Point;
use super::exp;
use crate::mpm::eigen::Stretches;
use crate::mpm::matrix::{Mat3, Sym3};
use crate::simd::Lanes;

/// The largest hardening factor of snow's stiffness: the time step relies on it.
pub const HARDEST: f32 = 10.0;

/// Critical compression and stretch, and the hardening exponent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snow {
    pub theta_c: f32,
    pub theta_s: f32,
    pub xi: f32,
}

impl Snow {
    /// The factor on the stiffness if the plastic part's volume ratio is `plastic`.
    pub fn hardening(&self, plastic: f64) -> f64 {
        (f64::from(self.xi) * (1.0 - plastic)).exp().min(HARDEST.into())
    }
}

/// The stress, and the elastic deformation if any particle yielded. State: J_P.
#[inline(always)]
pub(super) fn stress<L: Lanes>(point: Point<L>, Snow { theta_c, theta_s, xi }: Snow) -> (Sym3<L>, Option<Mat3<L>>) {
    let Point { elastic, mu, lambda, state } = point;
    let one = L::splat(1.0);
    let stretches = Stretches::of(&elastic);
    let (low, high) = (L::splat(1.0 - theta_c), L::splat(1.0 + theta_s));
    let mut kept = stretches.stretch;
    let mut ratio = kept;
    let mut outside = L::splat(0.0);
    for i in 0..3 {
        kept[i] = kept[i].max(low).min(high);
        outside = outside.max((kept[i] - stretches.stretch[i]).abs());
        ratio[i] = kept[i] / stretches.stretch[i];
    }
    let yields = L::splat(0.0).less(outside);
    let plastic = L::load(state) / (ratio[0] * ratio[1] * ratio[2]);
    plastic.store(state);
    let hardening = exp(L::splat(xi) * (one - plastic)).min(L::splat(HARDEST));
    let j = kept[0] * kept[1] * kept[2];
    let pressure = lambda * j * (j - one);
    let two_mu = mu + mu;
    let mut tau = kept;
    for i in 0..3 {
        tau[i] = hardening * (two_mu * (kept[i] - one)).mul_add(kept[i], pressure);
    }
    let stress = stretches.compose(tau);
    if !L::any(yields) {
        return (stress, None);
    }
    (stress, Some(stretches.compose(ratio).times(&elastic).or_else(yields, &elastic)))
}
