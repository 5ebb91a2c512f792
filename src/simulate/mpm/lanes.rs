//! Eight particles side by side. All arithmetic on particles is written once, over [`Lanes`], and compiled twice: for
//! AVX2 with FMA (`avx2`) and, here, for any processor. Which one runs is decided at run time.
//!
//! Code over lanes uses loops and functions marked `#[inline(always)]`, never closures or iterator adapters: those are
//! functions of their own, compiled without the processor features, and cost a factor of three.
//!
//! A fused multiply-add rounds once where the plain version rounds twice, so results are the same bytes on any number
//! of threads of one machine, and agree to rounding between machines.

use std::array::from_fn;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Particles in a pack, and floats in a vector register.
pub const LANES: usize = 8;

/// One f32 of each particle of a pack in memory.
pub type Row = [f32; LANES];

/// Eight f32 that go through the same operations.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// A truth value per lane.
    type Mask: Copy;

    fn splat(value: f32) -> Self;
    fn load(from: &Row) -> Self;
    fn store(self, to: &mut Row);
    /// `self * b + c`.
    fn mul_add(self, b: Self, c: Self) -> Self;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn floor(self) -> Self;
    fn less(self, other: Self) -> Self::Mask;
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    fn any(mask: Self::Mask) -> bool;
    /// Whole numbers below 2^31 as such.
    fn to_whole(self) -> [i32; LANES];
    /// Mantissa in [1, 2) and exponent of positive normal numbers.
    fn split_exponent(self) -> (Self, Self);
    /// 2^self for whole numbers in [-126, 127].
    fn exp2_of_whole(self) -> Self;
    /// Column i of the result is what lane i of the eight rows held.
    fn transpose(rows: [Self; LANES]) -> [Self; LANES];
    /// The first four lanes twice.
    fn twice_low(self) -> Self;
    /// The last four lanes twice.
    fn twice_high(self) -> Self;
    /// Sum of the two halves of `a` in the first four lanes, of `b` in the last four.
    fn fold(a: Self, b: Self) -> Self;
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
    let large = L::splat(std::f32::consts::SQRT_2).less(mantissa);
    let t = L::select(large, mantissa * L::splat(0.5), mantissa) - L::splat(1.0);
    let exponent = L::select(large, exponent + L::splat(1.0), exponent);
    let t2 = t * t;
    let tail = (polynomial(&P, t) * t).mul_add(t2, exponent * L::splat(-2.121_944_4e-4)) - t2 * L::splat(0.5);
    exponent.mul_add(L::splat(0.693_359_4), t + tail)
}

/// Exponential, arguments clamped to [-80, 80], to about 2 ulp (Cephes' expf polynomial).
#[inline(always)]
pub fn exp<L: Lanes>(x: L) -> L {
    const P: [f32; 6] = [1.987_569_1e-4, 1.398_2e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5];
    let x = x.max(L::splat(-80.0)).min(L::splat(80.0));
    let n = x.mul_add(L::splat(std::f32::consts::LOG2_E), L::splat(0.5)).floor();
    let t = n.mul_add(L::splat(2.121_944_4e-4), n.mul_add(L::splat(-0.693_359_4), x));
    polynomial(&P, t).mul_add(t * t, t + L::splat(1.0)) * n.exp2_of_whole()
}

/// Horner's scheme, highest power first.
#[inline(always)]
fn polynomial<L: Lanes, const N: usize>(coefficients: &[f32; N], t: L) -> L {
    let mut p = L::splat(coefficients[0]);
    for &c in &coefficients[1..] {
        p = p.mul_add(t, L::splat(c));
    }
    p
}

/// [`Lanes`] for any processor.
#[derive(Clone, Copy)]
pub struct Plain(Row);

impl Plain {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(from_fn(|i| f(self.0[i], other.0[i])))
    }
}

impl Add for Plain {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Plain {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Plain {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl Div for Plain {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
}

impl Neg for Plain {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|a| -a))
    }
}

impl Lanes for Plain {
    type Mask = [bool; LANES];

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }
    #[inline(always)]
    fn load(from: &Row) -> Self {
        Self(*from)
    }
    #[inline(always)]
    fn store(self, to: &mut Row) {
        *to = self.0;
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        self * b + c
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self(self.0.map(f32::floor))
    }
    #[inline(always)]
    fn less(self, other: Self) -> Self::Mask {
        from_fn(|i| self.0[i] < other.0[i])
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(from_fn(|i| if mask[i] { yes.0[i] } else { no.0[i] }))
    }
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        mask.contains(&true)
    }
    #[inline(always)]
    fn to_whole(self) -> [i32; LANES] {
        self.0.map(|x| x as i32)
    }
    #[inline(always)]
    fn split_exponent(self) -> (Self, Self) {
        let mantissa = self.0.map(|x| f32::from_bits((x.to_bits() & 0x007f_ffff) | 0x3f80_0000));
        let exponent = self.0.map(|x| (x.to_bits() >> 23) as i32 as f32 - 127.0);
        (Self(mantissa), Self(exponent))
    }
    #[inline(always)]
    fn exp2_of_whole(self) -> Self {
        Self(self.0.map(|n| f32::from_bits(((n as i32 + 127) as u32) << 23)))
    }
    #[inline(always)]
    fn transpose(rows: [Self; LANES]) -> [Self; LANES] {
        from_fn(|i| Self(from_fn(|j| rows[j].0[i])))
    }
    #[inline(always)]
    fn twice_low(self) -> Self {
        Self(from_fn(|i| self.0[i % 4]))
    }
    #[inline(always)]
    fn twice_high(self) -> Self {
        Self(from_fn(|i| self.0[4 + i % 4]))
    }
    #[inline(always)]
    fn fold(a: Self, b: Self) -> Self {
        Self(from_fn(|i| if i < 4 { a.0[i] + a.0[i + 4] } else { b.0[i - 4] + b.0[i] }))
    }
}
