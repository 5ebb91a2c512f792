//! Principal stretches and the rotation of a deformation gradient, eight at a time.
//!
//! All laws here are isotropic, so their stress and their return maps are functions of the left Cauchy-Green tensor
//! b = F F^T alone. Its eigenvectors (cyclic Jacobi) stand in for a full SVD of F: F = U S V^T has b = U S^2 U^T.

use super::matrix::{Mat3, Sym3, dot};
use crate::simd::Lanes;

/// Singular values of F, with the left singular vectors as the columns of `axes`. If det F < 0, the smallest is
/// negative.
#[derive(Clone, Copy)]
pub struct Stretches<L> {
    pub stretch: [L; 3],
    pub axes: Mat3<L>,
}

impl<L: Lanes> Stretches<L> {
    #[inline(always)]
    pub fn of(f: &Mat3<L>) -> Self {
        let one = L::splat(1.0);
        // Eigenvalues of b - I: small strains stay precise near the undeformed state.
        let (mut stretch, axes) = symmetric_eigen(f.times_transposed_symmetric(f).plus_diagonal(-one));
        for s in &mut stretch {
            // b is positive; the floor only catches the rounding errors of a flat F.
            *s = (*s + one).max(L::splat(1e-12)).sqrt();
        }
        Self { stretch: with_sign_of(f.determinant(), stretch), axes }
    }

    /// sum over i of d_i n_i n_i^T: the isotropic tensor with principal values `d`.
    #[inline(always)]
    pub fn compose(&self, d: [L; 3]) -> Sym3<L> {
        let mut scaled = self.axes;
        for row in &mut scaled.0 {
            for i in 0..3 {
                row[i] = row[i] * d[i];
            }
        }
        scaled.times_transposed_symmetric(&self.axes)
    }
}

/// The stretches, with the sign of the determinant on the smallest.
#[inline(always)]
fn with_sign_of<L: Lanes>(determinant: L, [a, b, c]: [L; 3]) -> [L; 3] {
    let inverted = determinant.less(L::splat(0.0));
    if !L::any(inverted) {
        return [a, b, c];
    }
    let one = L::splat(1.0);
    let sign = L::select(inverted, -one, one);
    let least = a.min(b).min(c);
    let (not_a, not_b) = (least.less(a), least.less(b));
    [
        a * L::select(not_a, one, sign),
        b * L::select(not_a, L::select(not_b, one, sign), one),
        c * L::select(not_a, L::select(not_b, sign, one), one),
    ]
}

/// Eigenvalues, and eigenvectors as columns, of a symmetric matrix by cyclic Jacobi rotations.
#[inline(always)]
pub fn symmetric_eigen<L: Lanes>(s: Sym3<L>) -> ([L; 3], Mat3<L>) {
    /// Convergence is cubic or better; six sweeps bring any 3x3 matrix far below f32 rounding.
    const SWEEPS: usize = 6;
    /// Off-diagonal share of the norm, squared, below which functions of the matrix stay the same in f32.
    const CONVERGED: f32 = 1e-14;
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let mut diagonal = [s.xx, s.yy, s.zz];
    // `off[k]` is the entry in the row and column of the two other indices.
    let mut off = [s.yz, s.xz, s.xy];
    let mut axes = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
    for _ in 0..SWEEPS {
        let small = dot(&diagonal, &diagonal).mul_add(L::splat(CONVERGED), L::splat(1e-37));
        if !L::any(small.less(dot(&off, &off))) {
            break;
        }
        for (p, q, r) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
            let entry = off[r];
            let difference = diagonal[q] - diagonal[p];
            let twice = entry + entry;
            let root = difference.mul_add(difference, twice * twice).sqrt();
            let signed = L::select(difference.less(zero), -twice, twice);
            let t = signed / (difference.abs() + root + L::splat(1e-30));
            let c = one / t.mul_add(t, one).sqrt();
            let s = t * c;
            diagonal[p] = diagonal[p] - t * entry;
            diagonal[q] = diagonal[q] + t * entry;
            off[r] = zero;
            (off[q], off[p]) = (c.mul_add(off[q], -(s * off[p])), s.mul_add(off[q], c * off[p]));
            for row in &mut axes {
                (row[p], row[q]) = (c.mul_add(row[p], -(s * row[q])), s.mul_add(row[p], c * row[q]));
            }
        }
    }
    (diagonal, Mat3(axes))
}

/// The rotation of the polar decomposition F = R S, by Newton's iteration R <- (R + R^-T) / 2 (Higham 1986), which
/// converges quadratically; computed from the stretches if a particle is nearly flat or inverted.
#[inline(always)]
pub fn rotation<L: Lanes>(f: &Mat3<L>) -> Mat3<L> {
    /// From any stretch between 1/20 and 20, Newton's iteration converges in eight steps.
    const STEPS: usize = 10;
    /// The error after a step is half the square of the change it made.
    const SMALL_CHANGE: f32 = 3e-4;
    if L::any(f.determinant().less(L::splat(0.05))) {
        return rotation_by_stretches(f);
    }
    let half = L::splat(0.5);
    let mut r = *f;
    for _ in 0..STEPS {
        let cofactors = r.cofactors();
        let scale = half / dot(&r.0[0], &cofactors.0[0]);
        let mut change = L::splat(0.0);
        let mut next = r;
        for i in 0..3 {
            for j in 0..3 {
                next.0[i][j] = cofactors.0[i][j].mul_add(scale, r.0[i][j] * half);
                change = change.max((next.0[i][j] - r.0[i][j]).abs());
            }
        }
        r = next;
        if !L::any(L::splat(SMALL_CHANGE).less(change)) {
            break;
        }
    }
    r
}

/// R = V^-1 F with the signed left stretch V.
#[inline(always)]
fn rotation_by_stretches<L: Lanes>(f: &Mat3<L>) -> Mat3<L> {
    let stretches = Stretches::of(f);
    let one = L::splat(1.0);
    let [a, b, c] = stretches.stretch;
    stretches.compose([one / a, one / b, one / c]).times(f)
}
