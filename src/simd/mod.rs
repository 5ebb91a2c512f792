//! Vectors of f32 in registers. Arithmetic is written once, over [`Vector`] or [`Lanes`], and compiled for AVX-512, for
//! AVX2 with FMA, and for any processor; which one runs is decided at run time.
//!
//! 1. [`Vector`]: as many f32 as the register holds. [`Lanes`]: eight, with comparisons and moves between lanes.
//! 2. `functions`: [`exp`], [`ln`], [`gelu`].
//! 3. `plain`, `avx2`, `avx512`: the registers.
//! 4. [`Instructions`]: the instructions that this processor has, and the way to call code that uses them, a [`Kernel`]
//!    or a [`LanesKernel`].
//!
//! Code over vectors uses loops and functions marked `#[inline(always)]`, never closures or iterator adapters: those
//! are separate functions, compiled without the processor's features, and are three times slower.
//!
//! A fused multiply-add rounds once, the plain version twice, so results are the same bytes on any number of threads of
//! one machine, and agree to rounding between machines.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod functions;
mod instructions;
mod plain;

use std::ops::{Add, Div, Mul, Neg, Sub};

pub use functions::{MOST_EXPONENT, exp, gelu, ln};
pub use instructions::{Instructions, Kernel, LanesKernel, run_lanes};
pub use plain::Plain;

/// Number of f32 in the widest of the vectors.
pub const MOST_LANES: usize = 16;
/// Number of f32 in [`Lanes`].
pub const LANES: usize = 8;

/// Several f32 that go through the same operations.
pub trait Vector: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    const WIDTH: usize;

    fn splat(value: f32) -> Self;

    /// # Safety
    /// [`Self::WIDTH`] values must be readable at `from`.
    unsafe fn read(from: *const f32) -> Self;

    /// # Safety
    /// [`Self::WIDTH`] values must be writable at `to`.
    unsafe fn write(self, to: *mut f32);

    fn max(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn floor(self) -> Self;
    /// `self * b + c`.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// 2^self for whole numbers in [-126, 127].
    fn exp2_of_whole(self) -> Self;
    /// Sum of all, in an order that depends on the implementation.
    fn sum(self) -> f32;

    /// Reads the first [`Self::WIDTH`] values.
    #[inline(always)]
    fn load(from: &[f32]) -> Self {
        assert!(from.len() >= Self::WIDTH);
        // SAFETY: `from` holds at least WIDTH values, as asserted.
        unsafe { Self::read(from.as_ptr()) }
    }

    /// Writes to the first [`Self::WIDTH`] values.
    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        assert!(to.len() >= Self::WIDTH);
        // SAFETY: `to` holds at least WIDTH values, as asserted.
        unsafe { self.write(to.as_mut_ptr()) }
    }
}

/// A [`Vector`] of eight.
pub trait Lanes: Vector + Neg<Output = Self> {
    /// A truth value per lane.
    type Mask: Copy;

    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    fn less(self, other: Self) -> Self::Mask;
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    fn any(mask: Self::Mask) -> bool;
    /// Converts whole numbers below 2^31 to integers.
    fn to_whole(self) -> [i32; LANES];
    /// Mantissa in [1, 2) and exponent of positive normal numbers.
    fn split_exponent(self) -> (Self, Self);
    /// Row i of the result holds lane i of each of the eight rows.
    fn transpose(rows: [Self; LANES]) -> [Self; LANES];
    /// The first four lanes twice.
    fn twice_low(self) -> Self;
    /// The last four lanes twice.
    fn twice_high(self) -> Self;
    /// Sum of the two halves of `a` in the first four lanes, of `b` in the last four.
    fn fold(a: Self, b: Self) -> Self;
}
