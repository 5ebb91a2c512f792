//! Rasteriser, depth test, vote.

// A slow and plain renderer to compare with.
mod reference;
// Clouds and cameras built in code.
mod build;

// Projection, blending, depth, labels.
mod raster;
