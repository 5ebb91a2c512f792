//! Functions of vectors, computed with polynomials.

use std::f32::consts::{FRAC_1_SQRT_2, LOG2_E, SQRT_2};

use super::{Lanes, Vector};

/// The largest whole number for which the exponentials of it and of its negative are normal numbers.
pub const MOST_EXPONENT: f32 = 87.0;

/// Exponential, arguments clamped to [-most, most], to about 2 ulp for `most` up to [`MOST_EXPONENT`] (Cephes' expf
/// polynomial).
#[inline(always)]
pub fn exp<V: Vector>(x: V, most: f32) -> V {
    const P: [f32; 6] = [1.987_569_1e-4, 1.398_2e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5];
    let x = x.max(V::splat(-most)).min(V::splat(most));
    let n = x.mul_add(V::splat(LOG2_E), V::splat(0.5)).floor();
    let t = n.mul_add(V::splat(2.121_944_4e-4), n.mul_add(V::splat(-0.693_359_4), x));
    polynomial(&P, t).mul_add(t * t, t + V::splat(1.0)) * n.exp2_of_whole()
}

/// Natural logarithm of positive normal numbers, to about 2 ulp (Cephes' logf polynomial).
#[inline(always)]
pub fn ln<L: Lanes>(x: L) -> L {
    const P: [f32; 9] = [
        7.037_683_6e-2,
        -1.151_461e-1,
        1.167_699_9e-1,
        -1.242_014_1e-1,
        1.424_932_3e-1,
        -1.666_805_8e-1,
        2.000_071_5e-1,
        -2.499_999_4e-1,
        3.333_333e-1,
    ];
    let (mantissa, exponent) = x.split_exponent();
    let large = L::splat(SQRT_2).less(mantissa);
    let t = L::select(large, mantissa * L::splat(0.5), mantissa) - L::splat(1.0);
    let exponent = L::select(large, exponent + L::splat(1.0), exponent);
    let t2 = t * t;
    let tail = (polynomial(&P, t) * t).mul_add(t2, exponent * L::splat(-2.121_944_4e-4)) - t2 * L::splat(0.5);
    exponent.mul_add(L::splat(0.693_359_4), t + tail)
}

/// The Gaussian error linear unit x Φ(x), Φ by Abramowitz and Stegun 7.1.26: to 1.5e-7 |x|.
#[inline(always)]
pub fn gelu<V: Vector>(x: V) -> V {
    const P: [f32; 5] = [1.061_405_4, -1.453_152, 1.421_413_8, -0.284_496_74, 0.254_829_6];
    let (zero, one) = (V::splat(0.0), V::splat(1.0));
    let size = x.max(zero - x) * V::splat(FRAC_1_SQRT_2);
    let t = one / size.mul_add(V::splat(0.327_591_1), one);
    // Half of erfc(|x| / √2): the tail of Φ on the far side.
    let far = polynomial(&P, t) * t * exp(zero - size * size, MOST_EXPONENT) * V::splat(0.5);
    // x Φ(x) = max(x, 0) - |x| far.
    x.max(zero) - far * size * V::splat(SQRT_2)
}

/// Horner's scheme, highest power first.
#[inline(always)]
fn polynomial<V: Vector, const N: usize>(coefficients: &[f32; N], t: V) -> V {
    let mut p = V::splat(coefficients[0]);
    for &c in &coefficients[1..] {
        p = p.mul_add(t, V::splat(c));
    }
    p
}
