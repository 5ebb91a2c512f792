//! 3x3 matrices of lanes.

use super::particles::Row;
use crate::simd::Lanes;

/// A 3x3 matrix per particle, row by row.
#[derive(Clone, Copy)]
pub struct Mat3<L>(pub [[L; 3]; 3]);

/// A symmetric 3x3 matrix per particle.
#[derive(Clone, Copy)]
pub struct Sym3<L> {
    pub xx: L,
    pub yy: L,
    pub zz: L,
    pub xy: L,
    pub xz: L,
    pub yz: L,
}

/// Scalar product.
#[inline(always)]
pub fn dot<L: Lanes>(a: &[L; 3], b: &[L; 3]) -> L {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

impl<L: Lanes> Mat3<L> {
    #[inline(always)]
    pub fn load(from: &[Row; 9]) -> Self {
        Self([
            [L::load(&from[0]), L::load(&from[1]), L::load(&from[2])],
            [L::load(&from[3]), L::load(&from[4]), L::load(&from[5])],
            [L::load(&from[6]), L::load(&from[7]), L::load(&from[8])],
        ])
    }

    #[inline(always)]
    pub fn store(self, to: &mut [Row; 9]) {
        for r in 0..3 {
            for c in 0..3 {
                self.0[r][c].store(&mut to[3 * r + c]);
            }
        }
    }

    /// `self * s * other + other`: a step of the deformation gradient for `self` = velocity gradient, `s` = dt.
    #[inline(always)]
    pub fn step(self, s: L, other: Self) -> Self {
        let mut out = other;
        for r in 0..3 {
            let (a, b, c) = (self.0[r][0] * s, self.0[r][1] * s, self.0[r][2] * s);
            for k in 0..3 {
                let o = &other.0;
                out.0[r][k] = a.mul_add(o[0][k], b.mul_add(o[1][k], c.mul_add(o[2][k], o[r][k])));
            }
        }
        out
    }

    #[inline(always)]
    pub fn determinant(&self) -> L {
        dot(&self.0[0], &self.cofactors().0[0])
    }

    /// The cofactor matrix, det(self) self^-T.
    #[inline(always)]
    pub fn cofactors(&self) -> Self {
        let m = &self.0;
        let mut out = *self;
        for r in 0..3 {
            let (p, q) = ((r + 1) % 3, (r + 2) % 3);
            for c in 0..3 {
                let (s, t) = ((c + 1) % 3, (c + 2) % 3);
                out.0[r][c] = m[p][s].mul_add(m[q][t], -(m[p][t] * m[q][s]));
            }
        }
        out
    }

    /// `self` for the lanes where `mask` is set, exactly `other` for the others.
    #[inline(always)]
    pub fn or_else(mut self, mask: L::Mask, other: &Self) -> Self {
        for r in 0..3 {
            for c in 0..3 {
                self.0[r][c] = L::select(mask, self.0[r][c], other.0[r][c]);
            }
        }
        self
    }

    /// `self * other^T`, which must be known to be symmetric.
    #[inline(always)]
    pub fn times_transposed_symmetric(&self, other: &Self) -> Sym3<L> {
        let (a, b) = (&self.0, &other.0);
        Sym3 {
            xx: dot(&a[0], &b[0]),
            yy: dot(&a[1], &b[1]),
            zz: dot(&a[2], &b[2]),
            xy: dot(&a[0], &b[1]),
            xz: dot(&a[0], &b[2]),
            yz: dot(&a[1], &b[2]),
        }
    }
}

impl<L: Lanes> Sym3<L> {
    #[inline(always)]
    pub fn zero() -> Self {
        let zero = L::splat(0.0);
        Self { xx: zero, yy: zero, zz: zero, xy: zero, xz: zero, yz: zero }
    }

    #[inline(always)]
    pub fn scaled(self, s: L) -> Self {
        Self { xx: self.xx * s, yy: self.yy * s, zz: self.zz * s, xy: self.xy * s, xz: self.xz * s, yz: self.yz * s }
    }

    #[inline(always)]
    pub fn plus_diagonal(self, d: L) -> Self {
        Self { xx: self.xx + d, yy: self.yy + d, zz: self.zz + d, ..self }
    }

    #[inline(always)]
    pub fn to_matrix(self) -> Mat3<L> {
        Mat3([[self.xx, self.xy, self.xz], [self.xy, self.yy, self.yz], [self.xz, self.yz, self.zz]])
    }

    /// `self * m`.
    #[inline(always)]
    pub fn times(self, m: &Mat3<L>) -> Mat3<L> {
        let s = self.to_matrix();
        let mut out = *m;
        for r in 0..3 {
            for c in 0..3 {
                let k = &m.0;
                out.0[r][c] = s.0[r][0].mul_add(k[0][c], s.0[r][1].mul_add(k[1][c], s.0[r][2] * k[2][c]));
            }
        }
        out
    }
}
