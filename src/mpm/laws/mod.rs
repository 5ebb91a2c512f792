//! Constitutive laws: from a trial deformation gradient to the elastic one that the yield condition allows, and the
//! Kirchhoff stress.
//!
//! Every law gets the particle's Lame constants mu and lambda and one scalar `state`, which it may change:
//!
//! | law | state |
//! | --- | --- |
//! | [`Law::FixedCorotated`] | none |
//! | [`Law::Fluid`] | none |
//! | [`Law::Rigid`] | none |
//! | [`Law::VonMises`], [`Law::Foam`] | radius of the yield surface: Frobenius norm of the deviatoric Kirchhoff stress at yield, Pa |
//! | [`Law::DruckerPrager`] | alpha, the slope of the yield cone |
//! | [`Law::Snow`] | volume ratio of the plastic part |

pub mod drucker_prager;
pub mod energy;
mod fixed_corotated;
mod fluid;
mod foam;
mod hencky;
pub mod snow;
pub mod von_mises;

use snow::Snow;

use super::matrix::{Mat3, Sym3};
use super::particles::{Pack, Row};
use crate::simd::{self, Lanes};

/// A constitutive law with the constants that all its particles share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// Fixed corotated elasticity.
    FixedCorotated,
    /// Hencky elasticity with von Mises yield.
    VonMises {
        /// Growth of the yield radius per plastic strain, as a multiple of 2 mu. 0: perfectly plastic.
        hardening: f32,
        /// Share of the yield radius lost per plastic strain.
        softening: f32,
    },
    /// Sand: Hencky elasticity with Drucker-Prager yield; tension up to `apex_pa` in every direction, 0 for dry sand.
    DruckerPrager {
        apex_pa: f32,
    },
    /// Hencky elasticity with viscous flow above a von Mises yield.
    Foam {
        viscosity_pa_s: f32,
    },
    Snow(Snow),
    /// No shear: only pressure, with lambda as the bulk modulus.
    Fluid,
    /// No stress: the particle moves with a rigid body.
    Rigid,
}

impl Law {
    /// True if the elastic deformation may differ from the total one.
    pub fn is_plastic(&self) -> bool {
        !matches!(self, Self::FixedCorotated | Self::Rigid)
    }
}

/// The quantities of a pack that a law needs.
struct Point<'a, L> {
    elastic: Mat3<L>,
    mu: L,
    lambda: L,
    state: &'a mut Row,
}

/// Kirchhoff stress of a pack, Pa; also brings the pack's elastic deformation and state back to what its law allows.
#[inline(always)]
pub fn stress<L: Lanes>(pack: &mut Pack, laws: &[Law], dt_s: f32) -> Sym3<L> {
    let point = Point {
        elastic: Mat3::load(&pack.elastic),
        mu: L::load(&pack.mu),
        lambda: L::load(&pack.lambda),
        state: &mut pack.state,
    };
    match laws[pack.law as usize] {
        Law::FixedCorotated => fixed_corotated::stress(&point),
        Law::VonMises { hardening, softening } => {
            returned(von_mises::stress(point, hardening, softening), &mut pack.elastic)
        }
        Law::DruckerPrager { apex_pa } => returned(drucker_prager::stress(point, apex_pa), &mut pack.elastic),
        Law::Foam { viscosity_pa_s } => returned(foam::stress(point, viscosity_pa_s, dt_s), &mut pack.elastic),
        Law::Snow(snow) => returned(snow::stress(point, snow), &mut pack.elastic),
        Law::Fluid => returned(fluid::stress(&point), &mut pack.elastic),
        Law::Rigid => Sym3::zero(),
    }
}

/// Exponential, arguments clamped to [-80, 80], to about 2 ulp.
#[inline(always)]
pub fn exp<L: Lanes>(x: L) -> L {
    simd::exp(x, 80.0)
}

/// The stress; stores the deformation if the return map changed it.
#[inline(always)]
fn returned<L: Lanes>((stress, mapped): (Sym3<L>, Option<Mat3<L>>), elastic: &mut [Row; 9]) -> Sym3<L> {
    if let Some(mapped) = mapped {
        mapped.store(elastic);
    }
    stress
}
