//! The peer's eigendecomposition of a covariance: Taichi's `sym_eig` in f32, after Kopp, *Efficient numerical
//! diagonalization of hermitian 3x3 matrices*, 2008.
//!
//! If an eigenvector nearly vanishes, Kopp's algorithm falls back on QL iterations. Taichi's version stops too early
//! and starts from the unfinished eigenvectors, so such a Gaussian enters the density with a wrong orientation. This is
//! reproduced here.

use nalgebra::{Matrix3, Vector3};

type Mat3 = Matrix3<f32>;
type Vec3 = Vector3<f32>;

/// Eigenvalues and, as columns, the eigenvectors of the symmetric `a`.
pub fn symmetric_eigen(a: &Mat3) -> (Vec3, Mat3) {
    let values = eigenvalues(a);
    let largest = values.amax();
    let scale = if largest < 1.0 { largest } else { largest * largest };
    let least = (256.0 * f64::EPSILON) as f32 * scale * scale;
    let start = Vec3::new(a.m12 * a.m23 - a.m13 * a.m22, a.m13 * a.m12 - a.m23 * a.m11, a.m12 * a.m12);
    // (A - l e1) x (A - l e2), a vector that is orthogonal to two of the rows.
    let vector = |l: f32| Vec3::new(start.x + a.m13 * l, start.y + a.m23 * l, (a.m11 - l) * (a.m22 - l) - start.z);
    let (first, second) = (vector(values.x), vector(values.y));
    if first.norm_squared() <= least {
        return iterated(a, Mat3::from_columns(&[first, start, Vec3::zeros()]));
    }
    let first = first * (1.0 / first.norm_squared()).sqrt();
    if second.norm_squared() <= least {
        return iterated(a, Mat3::from_columns(&[first, second, Vec3::zeros()]));
    }
    let second = second * (1.0 / second.norm_squared()).sqrt();
    (values, Mat3::from_columns(&[first, second, first.cross(&second)]))
}

/// Cardano's formula.
fn eigenvalues(a: &Mat3) -> Vec3 {
    let m = a.trace();
    let (dd, ee, ff) = (a.m12 * a.m12, a.m23 * a.m23, a.m13 * a.m13);
    let c1 = a.m11 * a.m22 + a.m11 * a.m33 + a.m22 * a.m33 - (dd + ee + ff);
    let c0 = a.m33 * dd + a.m11 * ee + a.m22 * ff - a.m11 * a.m22 * a.m33 - 2.0 * a.m13 * a.m12 * a.m23;
    let p = m * m - 3.0 * c1;
    let q = m * (p - 1.5 * c1) - 13.5 * c0;
    let root = p.abs().sqrt();
    let phi = 27.0 * (0.25 * c1 * c1 * (p - c1) + c0 * (q + 6.75 * c0));
    let phi = phi.abs().sqrt().atan2(q) / 3.0;
    let (c, s) = (root * phi.cos(), root * phi.sin() / 3.0_f32.sqrt());
    let middle = (m - c) / 3.0;
    Vec3::new(middle + c, middle - s, middle + s)
}

/// QL iterations on the tridiagonal form of `a`; their rotations are applied to the vectors already in `q`. Of the two
/// elements beside the diagonal, only the first is brought to zero; the second is dropped.
fn iterated(a: &Mat3, mut q: Mat3) -> (Vec3, Mat3) {
    let (mut w, mut off) = tridiagonal(a, &mut q);
    /// More than are ever needed; Taichi has no bound.
    const MOST: usize = 100;
    for _ in 0..MOST {
        let size = w.x.abs() + w.y.abs();
        if off.abs() + size == size {
            break;
        }
        let g = (w.y - w.x) / (off + off);
        let r = (g * g + 1.0).sqrt();
        let g = w.y - w.x + if g > 0.0 { off / (g + r) } else { off / (g - r) };
        // One rotation in the plane of the first two axes.
        let (s, c) = if off.abs() > g.abs() {
            let ratio = g / off;
            let s = 1.0 / (ratio * ratio + 1.0).sqrt();
            (s, ratio * s)
        } else {
            let ratio = off / g;
            let c = 1.0 / (ratio * ratio + 1.0).sqrt();
            (ratio * c, c)
        };
        let b = off;
        let r = (w.x - w.y) * s + 2.0 * c * b;
        let p = s * r;
        w.y += p;
        off = c * r - b;
        for k in 0..3 {
            let t = q[(k, 1)];
            q[(k, 1)] = s * q[(k, 0)] + c * t;
            q[(k, 0)] = c * q[(k, 0)] - s * t;
        }
        w.x -= p;
    }
    (w, q)
}

/// Householder's tridiagonal form: the diagonal, and the first element beside it.
fn tridiagonal(a: &Mat3, q: &mut Mat3) -> (Vec3, f32) {
    q.fill_diagonal(1.0);
    let h = a.m12 * a.m12 + a.m13 * a.m13;
    let g = if a.m12 > 0.0 { -h.sqrt() } else { h.sqrt() };
    let omega = h - g * a.m12;
    if omega <= 0.0 {
        return (a.diagonal(), g);
    }
    let omega = 1.0 / omega;
    let u = [a.m12 - g, a.m13];
    let f = [a.m22 * u[0] + a.m23 * u[1], a.m23 * u[0] + a.m33 * u[1]];
    let k = (u[0] * f[0] + u[1] * f[1]) * 0.5 * omega * omega;
    let p = [omega * f[0] - k * u[0], omega * f[1] - k * u[1]];
    for j in 0..2 {
        for i in 0..2 {
            q[(i + 1, j + 1)] -= omega * u[j] * u[i];
        }
    }
    (Vec3::new(a.m11, a.m22 - 2.0 * p[0] * u[0], a.m33 - 2.0 * p[1] * u[1]), g)
}
