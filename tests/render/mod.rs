//! Rasteriser, depth maps, spherical harmonics.

// A slow and plain renderer to compare with.
mod reference;

// Photos and depths of the scenes.
mod photos;
// Projection, blending, depth, labels on built clouds.
mod raster;
