//! The peer's singular value decomposition: McAdams, Selle, Tamstorf, Teran and Sifakis, *Computing the Singular Value
//! Decomposition of 3x3 Matrices with Minimal Branching and Elementary Floating Point Operations*, 2011.
//!
//! In f32 and with four sweeps, as in the peer: the remaining error accumulates when plastic flow rebuilds F at every
//! substep, so an exact decomposition drifts away from the peer's results.

use nalgebra::{Matrix3, Vector3};

type Mat3 = Matrix3<f32>;

const SWEEPS: usize = 4;

/// 3 + sqrt(8): beyond it the approximate Givens angle is inaccurate, and pi/8 is used. The peer compares in f64.
const FOUR_GAMMA_SQUARED: f64 = 5.828_427_124;
/// cos(pi/8), sin(pi/8).
const EIGHTH_TURN: [f32; 2] = [0.923_879_5, 0.382_683_43];

/// Columns shorter than this are not rotated.
const LEAST_COLUMN: f32 = 1e-6;

/// F = U diag(s) V^T; U and V are rotations; the singular values are in descending order, and the last carries the sign
/// of det F.
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

    /// The matrix with its singular values replaced by `s`.
    pub fn with(&self, s: &Vector3<f32>) -> Mat3 {
        self.u * Mat3::from_diagonal(s) * self.v.transpose()
    }
}

/// Swaps two columns and negates one of them, so that a rotation remains a rotation.
fn exchange(m: &mut Mat3, left: usize, right: usize) {
    m.swap_columns(left, right);
    m.column_mut(right).neg_mut();
}

/// Eigenvectors of a symmetric matrix, as a rotation: cyclic Jacobi with approximate angles, accumulated in a
/// quaternion.
fn eigenvectors(s: Mat3) -> Mat3 {
    let mut axis = Vector3::<f32>::zeros();
    let mut w = 1.0_f32;
    // The lower triangle; its rows and columns are renumbered after every rotation so that the next one is in the first
    // two.
    let [mut s11, mut s21, mut s22] = [s[(0, 0)], s[(1, 0)], s[(1, 1)]];
    let [mut s31, mut s32, mut s33] = [s[(2, 0)], s[(2, 1)], s[(2, 2)]];
    for (p, q, r) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)].repeat(SWEEPS) {
        let (cosine, sine) = half_angle(s11, s21, s22);
        let scale = cosine * cosine + sine * sine;
        let (a, b) = ((cosine * cosine - sine * sine) / scale, 2.0 * sine * cosine / scale);
        let (left, right) = (-b * s11 + a * s21, -b * s21 + a * s22);
        [s11, s21, s22, s31, s32, s33] = [
            -b * left + a * right,
            -b * s31 + a * s32,
            s33,
            a * left + b * right,
            a * s31 + b * s32,
            a * (a * s11 + b * s21) + b * (a * s21 + b * s22),
        ];
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

/// Cosine and sine of half the angle that approximately diagonalizes [[a, b], [b, c]].
fn half_angle(a: f32, b: f32, c: f32) -> (f32, f32) {
    let (cosine, sine) = (2.0 * (a - c), b);
    if FOUR_GAMMA_SQUARED * f64::from(sine) * f64::from(sine) < f64::from(cosine * cosine) {
        let scale = 1.0 / (cosine * cosine + sine * sine).sqrt();
        (cosine * scale, sine * scale)
    } else {
        (EIGHTH_TURN[0], EIGHTH_TURN[1])
    }
}

/// Q and R of `b` = Q R by three Givens rotations, given by their half angles. Q is their product, written out.
fn triangularized(b: Mat3) -> (Mat3, Mat3) {
    let mut r = b;
    let mut halves = [[0.0; 2]; 3];
    for (half, (pivot, row)) in halves.iter_mut().zip([(0, 1), (0, 2), (1, 2)]) {
        let [c, s] = half_turn(r[(pivot, pivot)], r[(row, pivot)]);
        let (a, b) = (1.0 - 2.0 * s * s, 2.0 * c * s);
        for column in 0..3 {
            let (upper, lower) = (r[(pivot, column)], r[(row, column)]);
            r[(pivot, column)] = a * upper + b * lower;
            r[(row, column)] = -b * upper + a * lower;
        }
        *half = [c, s];
    }
    let [[c1, s1], [c2, s2], [c3, s3]] = halves;
    // The negated cosines of the full angles.
    let [n1, n2, n3] = [s1, s2, s3].map(|s| -1.0 + 2.0 * (s * s));
    let q = Mat3::new(
        n1 * n2,
        4.0 * c2 * c3 * n1 * s2 * s3 + 2.0 * c1 * s1 * n3,
        4.0 * c1 * c3 * s1 * s3 - 2.0 * c2 * n1 * s2 * n3,
        2.0 * c1 * s1 * -n2,
        -8.0 * c1 * c2 * c3 * s1 * s2 * s3 + n1 * n3,
        -2.0 * c3 * s3 + 4.0 * s1 * (c3 * s1 * s3 + c1 * c2 * s2 * n3),
        2.0 * c2 * s2,
        2.0 * c3 * -n2 * s3,
        n2 * n3,
    );
    (q, r)
}

/// Cosine and sine of half the angle of the rotation that makes the entry `below` a `pivot` zero.
fn half_turn(pivot: f32, below: f32) -> [f32; 2] {
    let square = pivot * pivot + below * below;
    // The peer's square root, which rounds differently from the plain one; at zero it is NaN and therefore not the
    // larger value.
    let length = square / square.sqrt();
    let mut sine = if length > LEAST_COLUMN { below } else { 0.0 };
    let mut cosine = pivot.abs() + length.max(LEAST_COLUMN);
    if pivot < 0.0 {
        std::mem::swap(&mut sine, &mut cosine);
    }
    let scale = 1.0 / (cosine * cosine + sine * sine).sqrt();
    [cosine * scale, sine * scale]
}
