//! Rasteriser, depth test, vote.

// A slow and plain renderer to compare with.
mod reference;
// Clouds and cameras built in code.
pub mod build;
// The scenes with ground truth.
pub mod scenes;

// Projection, blending, depth, labels on built clouds.
mod raster;
// Photos and depths of the scenes.
mod photos;

// The vote on built clouds.
mod field;
// The search for neighbours.
mod nearest;
// The best labels that a splat's Gaussians could have.
mod bound;
// The vote with true parts: its own loss.
mod oracle;
