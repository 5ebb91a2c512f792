//! As many f32 as fit into a vector register. All arithmetic of the decoder is written once, over [`Vector`], and compiled
//! for AVX-512, for AVX2 with FMA, and for any processor; which one runs is decided at run time.
//!
//! Code over vectors uses loops and functions marked `#[inline(always)]`, never closures or iterator adapters: those are
//! functions of their own, compiled without the processor's features.

use std::array::from_fn;

/// f32 in the widest of the vectors.
pub const MOST_LANES: usize = 16;

/// Several f32 that go through the same operations.
pub trait Vector: Copy {
    const WIDTH: usize;

    fn splat(value: f32) -> Self;

    /// # Safety
    /// [`Self::WIDTH`] values can be read from there.
    unsafe fn read(from: *const f32) -> Self;

    /// # Safety
    /// [`Self::WIDTH`] values can be written there.
    unsafe fn write(self, to: *mut f32);

    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn floor(self) -> Self;
    /// `self * b + c`.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// 2^self for whole numbers in [-126, 127].
    fn exp2_of_whole(self) -> Self;
    /// Sum of all, in an order of its own.
    fn sum(self) -> f32;

    /// The first [`Self::WIDTH`] values.
    #[inline(always)]
    fn load(from: &[f32]) -> Self {
        assert!(from.len() >= Self::WIDTH);
        unsafe { Self::read(from.as_ptr()) }
    }

    /// Into the first [`Self::WIDTH`] values.
    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        assert!(to.len() >= Self::WIDTH);
        unsafe { self.write(to.as_mut_ptr()) }
    }

    /// Exponential, arguments clamped to [-87, 87], to about 2 ulp (Cephes' expf polynomial).
    #[inline(always)]
    fn exp(self) -> Self {
        let x = self.max(Self::splat(-87.0)).min(Self::splat(87.0));
        let n = x.mul_add(Self::splat(std::f32::consts::LOG2_E), Self::splat(0.5)).floor();
        let t = n.mul_add(Self::splat(-0.693_359_4), x);
        let t = n.mul_add(Self::splat(2.121_944_4e-4), t);
        let mut p = Self::splat(1.987_569_1e-4);
        for coefficient in [1.398_2e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5] {
            p = p.mul_add(t, Self::splat(coefficient));
        }
        p.mul_add(t.mul(t), t.add(Self::splat(1.0))).mul(n.exp2_of_whole())
    }

    /// The Gaussian error linear unit x Φ(x), Φ by Abramowitz and Stegun 7.1.26: to 1.5e-7 |x|.
    #[inline(always)]
    fn gelu(self) -> Self {
        let (zero, one) = (Self::splat(0.0), Self::splat(1.0));
        let size = self.max(zero.sub(self)).mul(Self::splat(std::f32::consts::FRAC_1_SQRT_2));
        let t = one.div(size.mul_add(Self::splat(0.327_591_1), one));
        let mut p = Self::splat(1.061_405_4);
        for coefficient in [-1.453_152, 1.421_413_8, -0.284_496_74, 0.254_829_6] {
            p = p.mul_add(t, Self::splat(coefficient));
        }
        // Half of erfc(|x| / √2): what is left of Φ on the far side.
        let far = p.mul(t).mul(zero.sub(size.mul(size)).exp()).mul(Self::splat(0.5));
        // x Φ(x) = max(x, 0) - |x| far.
        let far = far.mul(size).mul(Self::splat(std::f32::consts::SQRT_2));
        self.max(zero).sub(far)
    }
}

/// [`Vector`] for any processor.
#[derive(Clone, Copy)]
pub struct Plain([f32; 8]);

impl Vector for Plain {
    const WIDTH: usize = 8;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; 8])
    }

    #[inline(always)]
    unsafe fn read(from: *const f32) -> Self {
        Self(unsafe { from.cast::<[f32; 8]>().read_unaligned() })
    }

    #[inline(always)]
    unsafe fn write(self, to: *mut f32) {
        unsafe { to.cast::<[f32; 8]>().write_unaligned(self.0) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(from_fn(|i| self.0[i] + other.0[i]))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(from_fn(|i| self.0[i] - other.0[i]))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(from_fn(|i| self.0[i] * other.0[i]))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(from_fn(|i| self.0[i] / other.0[i]))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(from_fn(|i| if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(from_fn(|i| if self.0[i] < other.0[i] { self.0[i] } else { other.0[i] }))
    }

    #[inline(always)]
    fn floor(self) -> Self {
        Self(from_fn(|i| self.0[i].floor()))
    }

    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(from_fn(|i| self.0[i] * b.0[i] + c.0[i]))
    }

    #[inline(always)]
    fn exp2_of_whole(self) -> Self {
        Self(from_fn(|i| f32::from_bits(((self.0[i] as i32 + 127) << 23) as u32)))
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        self.0.iter().sum()
    }
}
