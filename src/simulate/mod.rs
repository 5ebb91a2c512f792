//! The Material Point Method on the Gaussians.
