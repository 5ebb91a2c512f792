//! Hencky (logarithmic) elasticity: tau = 2 mu eps + lambda tr(eps) I, with eps the logarithms of the principal
//! stretches. Return maps are plain vector arithmetic in eps.

use super::exp;
use crate::mpm::eigen::Stretches;
use crate::mpm::matrix::{Mat3, Sym3, dot};
use crate::simd::{Lanes, ln};

/// Stretches below this are raised to it: a crushed particle resists no further.
pub(super) const LEAST_STRETCH: f32 = 0.01;

/// Principal logarithmic strains, with their principal axes and stretches.
#[derive(Clone, Copy)]
pub struct Strain<L> {
    pub eps: [L; 3],
    stretches: Stretches<L>,
}

impl<L: Lanes> Strain<L> {
    #[inline(always)]
    pub fn of(elastic: &Mat3<L>) -> Self {
        let stretches = Stretches::of(elastic);
        let mut eps = stretches.stretch;
        for e in &mut eps {
            *e = ln(e.max(L::splat(LEAST_STRETCH)));
        }
        Self { eps, stretches }
    }

    /// tr(eps), the logarithm of the volume ratio.
    #[inline(always)]
    pub fn trace(&self) -> L {
        self.eps[0] + self.eps[1] + self.eps[2]
    }

    /// eps without its mean.
    #[inline(always)]
    pub fn deviator(&self) -> [L; 3] {
        let mean = self.trace() * L::splat(1.0 / 3.0);
        [self.eps[0] - mean, self.eps[1] - mean, self.eps[2] - mean]
    }

    /// tr(b) / 3.
    #[inline(always)]
    pub fn mean_square_stretch(&self) -> L {
        dot(&self.stretches.stretch, &self.stretches.stretch) * L::splat(1.0 / 3.0)
    }

    /// The stress of strain `eps` in this frame.
    #[inline(always)]
    pub fn stress(&self, eps: [L; 3], mu: L, lambda: L) -> Sym3<L> {
        let pressure = lambda * (eps[0] + eps[1] + eps[2]);
        let two_mu = mu + mu;
        let [a, b, c] = eps;
        self.stretches.compose([two_mu.mul_add(a, pressure), two_mu.mul_add(b, pressure), two_mu.mul_add(c, pressure)])
    }

    /// The deformation gradient with its strains replaced by `eps`: U exp(eps) S^-1 U^T F.
    #[inline(always)]
    pub fn replaced(&self, eps: [L; 3], elastic: &Mat3<L>) -> Mat3<L> {
        let [s, e] = [self.stretches.stretch, eps];
        self.stretches.compose([exp(e[0]) / s[0], exp(e[1]) / s[1], exp(e[2]) / s[2]]).times(elastic)
    }
}

/// Euclidean norm.
#[inline(always)]
pub fn norm<L: Lanes>(v: [L; 3]) -> L {
    dot(&v, &v).sqrt()
}
