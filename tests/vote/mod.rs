//! The vote.

// Clouds and cameras built in code.
pub mod build;
// The scenes with ground truth.
pub mod scenes;

// The vote on built clouds.
mod field;
// The best labels that a splat's Gaussians could have.
mod bound;
// The vote with true parts: the error of the vote alone.
pub mod oracle;
