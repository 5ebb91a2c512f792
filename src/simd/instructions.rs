//! The instructions that this processor has, and the only way to call code that is compiled for them.

#[cfg(target_arch = "x86_64")]
use super::avx2::Avx2;
#[cfg(target_arch = "x86_64")]
use super::avx512::Avx512;
use super::{Lanes, Plain, Vector};

/// Instructions that this processor has: a value is only made after the processor has been checked for them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instructions(Set);

#[derive(Debug, Clone, Copy, PartialEq)]
enum Set {
    #[cfg(target_arch = "x86_64")]
    Avx512,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    Any,
}

/// Work on vectors of any width. [`Self::run`] and everything that it calls on vectors must be marked
/// `#[inline(always)]`.
pub trait Kernel {
    type Output;

    fn run<V: Vector>(self) -> Self::Output;
}

/// As [`Kernel`], on vectors of eight.
pub trait LanesKernel {
    type Output;

    fn run<L: Lanes>(self) -> Self::Output;
}

impl Instructions {
    /// The instructions that every processor has.
    pub const ANY: Self = Self(Set::Any);

    /// The best instructions that this processor has.
    pub fn of_this_processor() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") {
                return Self(Set::Avx512);
            }
            if let Some(avx2) = Self::avx2() {
                return avx2;
            }
        }
        Self::ANY
    }

    /// All instructions that this processor has, the best first.
    pub fn all_of_this_processor() -> Vec<Self> {
        let mut all = vec![Self::of_this_processor()];
        #[cfg(target_arch = "x86_64")]
        all.extend(Self::avx2());
        all.push(Self::ANY);
        all.dedup();
        all
    }

    #[cfg(target_arch = "x86_64")]
    fn avx2() -> Option<Self> {
        (is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")).then_some(Self(Set::Avx2))
    }

    /// Runs `kernel` on the widest vectors that these instructions support.
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f")]
        fn with_avx512<K: Kernel>(kernel: K) -> K::Output {
            kernel.run::<Avx512>()
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,fma")]
        fn with_avx2<K: Kernel>(kernel: K) -> K::Output {
            kernel.run::<Avx2>()
        }
        match self.0 {
            // SAFETY: `of_this_processor` makes `Set::Avx512` only if the processor has avx512f.
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => unsafe { with_avx512(kernel) },
            // SAFETY: `avx2` makes `Set::Avx2` only if the processor has avx2 and fma.
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => unsafe { with_avx2(kernel) },
            Set::Any => kernel.run::<Plain>(),
        }
    }
}

/// Runs `kernel` on vectors of eight, with AVX2 and FMA if this processor has both.
pub fn run_lanes<K: LanesKernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if Instructions::avx2().is_some() {
        #[target_feature(enable = "avx2,fma")]
        fn with_avx2<K: LanesKernel>(kernel: K) -> K::Output {
            kernel.run::<Avx2>()
        }
        // SAFETY: `Instructions::avx2` returns a value only if the processor has avx2 and fma.
        return unsafe { with_avx2(kernel) };
    }
    kernel.run::<Plain>()
}
