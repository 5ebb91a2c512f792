//! The Material Point Method on the Gaussians.

pub mod boundary;
pub mod mpm;
