//! [`Vector`] and [`Lanes`] in one AVX2 register, with fused multiply-add.

use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::{LANES, Lanes, Vector};

/// Evaluates instructions on registers.
macro_rules! registers {
    ($instructions:expr) => {
        // SAFETY: they are instructions of AVX2 and FMA and access no memory. Only `instructions` can name `Avx2`, and
        // it does so behind `is_x86_feature_detected!` of "avx2" and "fma".
        unsafe { $instructions }
    };
}

/// Eight f32 in a register.
#[derive(Clone, Copy)]
pub(super) struct Avx2(__m256);

impl Add for Avx2 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(registers!(_mm256_add_ps(self.0, other.0)))
    }
}

impl Sub for Avx2 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(registers!(_mm256_sub_ps(self.0, other.0)))
    }
}

impl Mul for Avx2 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(registers!(_mm256_mul_ps(self.0, other.0)))
    }
}

impl Div for Avx2 {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(registers!(_mm256_div_ps(self.0, other.0)))
    }
}

impl Neg for Avx2 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(registers!(_mm256_xor_ps(self.0, _mm256_set1_ps(-0.0))))
    }
}

impl Vector for Avx2 {
    const WIDTH: usize = LANES;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(registers!(_mm256_set1_ps(value)))
    }
    #[inline(always)]
    unsafe fn read(from: *const f32) -> Self {
        // SAFETY: the caller guarantees WIDTH = 8 readable values, the 32 bytes that are read; the address needs no
        // alignment. As for the instruction, see `registers`.
        Self(unsafe { _mm256_loadu_ps(from) })
    }
    #[inline(always)]
    unsafe fn write(self, to: *mut f32) {
        // SAFETY: the caller guarantees room for WIDTH = 8 values, the 32 bytes that are written; the address needs no
        // alignment. As for the instruction, see `registers`.
        unsafe { _mm256_storeu_ps(to, self.0) }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(registers!(_mm256_max_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(registers!(_mm256_min_ps(self.0, other.0)))
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self(registers!(_mm256_floor_ps(self.0)))
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(registers!(_mm256_fmadd_ps(self.0, b.0, c.0)))
    }
    #[inline(always)]
    fn exp2_of_whole(self) -> Self {
        Self(registers!({
            let exponent = _mm256_add_epi32(_mm256_cvttps_epi32(self.0), _mm256_set1_epi32(127));
            _mm256_castsi256_ps(_mm256_slli_epi32::<23>(exponent))
        }))
    }
    #[inline(always)]
    fn sum(self) -> f32 {
        registers!({
            let half = _mm_add_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let quarter = _mm_add_ps(half, _mm_movehl_ps(half, half));
            _mm_cvtss_f32(_mm_add_ss(quarter, _mm_movehdup_ps(quarter)))
        })
    }
}

impl Lanes for Avx2 {
    type Mask = __m256;

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(registers!(_mm256_sqrt_ps(self.0)))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(registers!(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)))
    }
    #[inline(always)]
    fn less(self, other: Self) -> Self::Mask {
        registers!(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0))
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(registers!(_mm256_blendv_ps(no.0, yes.0, mask)))
    }
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        registers!(_mm256_movemask_ps(mask)) != 0
    }
    #[inline(always)]
    fn to_whole(self) -> [i32; LANES] {
        let mut whole = [0; LANES];
        // SAFETY: `whole` has room for the 8 i32, 32 bytes, that are written; the address needs no alignment. As for
        // the instructions, see `registers`.
        unsafe { _mm256_storeu_si256(whole.as_mut_ptr().cast(), _mm256_cvttps_epi32(self.0)) }
        whole
    }
    #[inline(always)]
    fn split_exponent(self) -> (Self, Self) {
        registers!({
            let bits = _mm256_castps_si256(self.0);
            let mantissa =
                _mm256_or_si256(_mm256_and_si256(bits, _mm256_set1_epi32(0x007f_ffff)), _mm256_set1_epi32(0x3f80_0000));
            let exponent = _mm256_sub_epi32(_mm256_srli_epi32::<23>(bits), _mm256_set1_epi32(127));
            (Self(_mm256_castsi256_ps(mantissa)), Self(_mm256_cvtepi32_ps(exponent)))
        })
    }
    #[inline(always)]
    fn transpose(rows: [Self; LANES]) -> [Self; LANES] {
        let top = quarters(rows[0].0, rows[1].0, rows[2].0, rows[3].0);
        let bottom = quarters(rows[4].0, rows[5].0, rows[6].0, rows[7].0);
        let mut columns = rows;
        for i in 0..4 {
            columns[i] = Self(registers!(_mm256_permute2f128_ps::<0x20>(top[i], bottom[i])));
            columns[i + 4] = Self(registers!(_mm256_permute2f128_ps::<0x31>(top[i], bottom[i])));
        }
        columns
    }
    #[inline(always)]
    fn twice_low(self) -> Self {
        Self(registers!(_mm256_permute2f128_ps::<0x00>(self.0, self.0)))
    }
    #[inline(always)]
    fn twice_high(self) -> Self {
        Self(registers!(_mm256_permute2f128_ps::<0x11>(self.0, self.0)))
    }
    #[inline(always)]
    fn fold(a: Self, b: Self) -> Self {
        Self(registers!(_mm256_permute2f128_ps::<0x20>(a.0, b.0)))
            + Self(registers!(_mm256_permute2f128_ps::<0x31>(a.0, b.0)))
    }
}

/// Both 4x4 quarters of four rows transposed: entry i holds lane i of the rows, then lane i + 4.
#[inline(always)]
fn quarters(a: __m256, b: __m256, c: __m256, d: __m256) -> [__m256; 4] {
    registers!({
        let (ab_low, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        let (cd_low, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
        [
            _mm256_shuffle_ps::<0x44>(ab_low, cd_low),
            _mm256_shuffle_ps::<0xee>(ab_low, cd_low),
            _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
            _mm256_shuffle_ps::<0xee>(ab_high, cd_high),
        ]
    })
}
