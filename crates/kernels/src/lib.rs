//! The inner loops of gprop and the types on which they work. They are a crate of their own so that they are not compiled
//! again whenever the rest of gprop changes, and are compiled for speed in the profile `quick`, in which the rest is not.
//!
//! [`simd`] has the vector registers with which the others compute; [`mask_decoder`] is that of SAM, [`mpm`] the simulation's
//! solver with its [`boundary`] conditions, [`render`] draws [`gaussians`] as a [`camera`] sees them; [`bounds`] is the
//! size of a cloud. A function that is generic over its caller's types is compiled with the caller, so every loop that
//! takes time is called by a function of this crate that is not generic.

pub mod boundary;
pub mod bounds;
pub mod camera;
pub mod gaussians;
pub mod mask_decoder;
pub mod mpm;
pub mod render;
pub mod simd;
