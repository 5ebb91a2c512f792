//! [`Vector`] in one AVX-512 register.

use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

use super::{MOST_LANES, Vector};

/// Evaluates instructions on registers.
macro_rules! registers {
    ($instructions:expr) => {
        // SAFETY: they are instructions of AVX-512F and access no memory. Only `instructions` can name `Avx512`, and it
        // does so behind `is_x86_feature_detected!` of "avx512f".
        unsafe { $instructions }
    };
}

/// Sixteen f32 in a register.
#[derive(Clone, Copy)]
pub(super) struct Avx512(__m512);

impl Add for Avx512 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(registers!(_mm512_add_ps(self.0, other.0)))
    }
}

impl Sub for Avx512 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(registers!(_mm512_sub_ps(self.0, other.0)))
    }
}

impl Mul for Avx512 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(registers!(_mm512_mul_ps(self.0, other.0)))
    }
}

impl Div for Avx512 {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(registers!(_mm512_div_ps(self.0, other.0)))
    }
}

impl Vector for Avx512 {
    const WIDTH: usize = MOST_LANES;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(registers!(_mm512_set1_ps(value)))
    }
    #[inline(always)]
    unsafe fn read(from: *const f32) -> Self {
        // SAFETY: the caller guarantees WIDTH = 16 readable values, the 64 bytes that are read; the address needs no
        // alignment. As for the instruction, see `registers`.
        Self(unsafe { _mm512_loadu_ps(from) })
    }
    #[inline(always)]
    unsafe fn write(self, to: *mut f32) {
        // SAFETY: the caller guarantees room for WIDTH = 16 values, the 64 bytes that are written; the address needs no
        // alignment. As for the instruction, see `registers`.
        unsafe { _mm512_storeu_ps(to, self.0) }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(registers!(_mm512_max_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(registers!(_mm512_min_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self(registers!(_mm512_roundscale_ps::<0x01>(self.0)))
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(registers!(_mm512_fmadd_ps(self.0, b.0, c.0)))
    }
    #[inline(always)]
    fn exp2_of_whole(self) -> Self {
        Self(registers!(_mm512_scalef_ps(_mm512_set1_ps(1.0), self.0)))
    }
    #[inline(always)]
    fn sum(self) -> f32 {
        registers!(_mm512_reduce_add_ps(self.0))
    }
}
