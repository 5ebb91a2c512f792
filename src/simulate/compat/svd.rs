//! The peer's singular value decomposition: McAdams, Selle, Tamstorf, Teran and Sifakis, *Computing the Singular Value
//! Decomposition of 3x3 Matrices with Minimal Branching and Elementary Floating Point Operations*, 2011.
//!
//! In f32 and with four sweeps, as the peer runs it: what it leaves over adds up where plastic flow rebuilds F from it at
//! every substep, so an exact decomposition drifts away from the peer's course.

use nalgebra::{Matrix3, Vector3};

type Mat3 = Matrix3<f32>;

const SWEEPS: usize = 4;

/// 3 + sqrt(8): beyond it the approximate Givens angle is no good, and pi/8 serves.
const FOUR_GAMMA_SQUARED: f32 = 5.828_427;
/// cos(pi/8), sin(pi/8).
const EIGHTH_TURN: [f32; 2] = [0.923_879_5, 0.382_683_43];

/// Columns shorter than this are not turned.
const LEAST_COLUMN: f32 = 1e-6;

/// F = U diag(s) V^T; U and V are rotations, the last of the falling singular values carries the sign of det F.
#[derive(Debug, Clone, Copy)]
pub struct Svd {
    pub u: Mat3,
    pub s: Vector3<f32>,
    pub v: Mat3,
}

impl Svd {
    pub fn of(f: &Mat3) -> Self {
        let mut v = eigenvectors(f.tr_mul(f));
        let mut b = f * v;
        for (left, right) in [(0, 1), (0, 2), (1, 2)] {
            if b.column(left).norm_squared() < b.column(right).norm_squared() {
                exchange(&mut b, left, right);
                exchange(&mut v, left, right);
            }
        }
        let (u, r) = triangularized(b);
        Self { u, s: r.diagonal(), v }
    }

    /// The matrix with singular values `s` instead.
    pub fn with(&self, s: &Vector3<f32>) -> Mat3 {
        self.u * Mat3::from_diagonal(s) * self.v.transpose()
    }
}

/// Swaps two columns, one of them negated: a rotation stays one.
fn exchange(m: &mut Mat3, left: usize, right: usize) {
    m.swap_columns(left, right);
    m.column_mut(right).neg_mut();
}

/// Eigenvectors of a symmetric matrix, as a rotation: cyclic Jacobi with approximate angles, summed up in a quaternion.
fn eigenvectors(mut s: Mat3) -> Mat3 {
    let mut axis = Vector3::<f32>::zeros();
    let mut w = 1.0_f32;
    for (p, q, r) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)].repeat(SWEEPS) {
        let (cosine, sine) = half_angle(s[(p, p)], s[(q, p)], s[(q, q)]);
        let scale = cosine * cosine + sine * sine;
        let (a, b) = ((cosine * cosine - sine * sine) / scale, 2.0 * sine * cosine / scale);
        let mut turn = Mat3::identity();
        (turn[(p, p)], turn[(p, q)], turn[(q, p)], turn[(q, q)]) = (a, -b, b, a);
        s = turn.tr_mul(&(s * turn));
        let before = axis * sine;
        let lift = w * sine;
        axis *= cosine;
        w = w * cosine - before[r];
        axis[r] += lift;
        axis[p] += before[q];
        axis[q] -= before[p];
    }
    let (x, y, z) = (axis.x, axis.y, axis.z);
    Mat3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
}

/// Cosine and sine of half the angle that about diagonalizes [[a, b], [b, c]].
fn half_angle(a: f32, b: f32, c: f32) -> (f32, f32) {
    let (cosine, sine) = (2.0 * (a - c), b);
    if FOUR_GAMMA_SQUARED * sine * sine < cosine * cosine {
        let scale = 1.0 / (cosine * cosine + sine * sine).sqrt();
        (cosine * scale, sine * scale)
    } else {
        (EIGHTH_TURN[0], EIGHTH_TURN[1])
    }
}

/// Q and R of `b` = Q R by three Givens rotations.
fn triangularized(b: Mat3) -> (Mat3, Mat3) {
    let (mut q, mut r) = (Mat3::identity(), b);
    for (pivot, row) in [(0, 1), (0, 2), (1, 2)] {
        let (a1, a2) = (r[(pivot, pivot)], r[(row, pivot)]);
        let length = (a1 * a1 + a2 * a2).sqrt();
        let mut sine = if length > LEAST_COLUMN { a2 } else { 0.0 };
        let mut cosine = a1.abs() + length.max(LEAST_COLUMN);
        if a1 < 0.0 {
            std::mem::swap(&mut sine, &mut cosine);
        }
        let scale = 1.0 / (cosine * cosine + sine * sine).sqrt();
        (cosine, sine) = (cosine * scale, sine * scale);
        let (a, b) = (1.0 - 2.0 * sine * sine, 2.0 * cosine * sine);
        let mut turn = Mat3::identity();
        (turn[(pivot, pivot)], turn[(pivot, row)], turn[(row, pivot)], turn[(row, row)]) = (a, -b, b, a);
        r = turn.tr_mul(&r);
        q *= turn;
    }
    (q, r)
}
