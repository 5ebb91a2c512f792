//! Reading the files of a scene, and everything that can be wrong with them.

// Intrinsics, distortion, poses.
mod camera;
// Camera files of COLMAP, nerfstudio, Blender, 3DGS; photos, masks, orientation, scale.
mod cameras;
// Data sets: ABO-500, MVImgNet.
mod dataset;
// Photos, models, splats and masks under the names that people give them.
mod files;
// Loading a whole scene folder: files found and missing, the choice of views.
mod folder;
// Compact splats: .splat, .spz, .compressed.ply.
mod formats;
// Photos, masks, cameras and splats that lie outside the scene, by links and by name.
mod outside;
// The search for neighbours.
mod nearest;
// Gaussians that are set aside, and scales that are refused.
mod outliers;
// Meshes of known solids, built in code.
pub mod shapes;
// The solids that meshes bound, against closed forms.
mod solid;
// The scale from a printed marker.
mod marker;
// Several things on one table, told apart.
pub mod objects;
// Round trips with splat-transform.
mod peer;
// Meshes of every format, good and bad.
mod mesh;
// Photos: colour types, alpha, size.
mod photo;
// PLY files of every kind, good and bad.
mod ply;
// The table of docs/formats.md: what you have, what to type.
mod table;
// Which way is up, and scenes in any frame.
mod up;

/// A failing case is printed in full; no file is kept beside the sources.
fn proptest_config() -> proptest::test_runner::Config {
    proptest::test_runner::Config { failure_persistence: None, ..Default::default() }
}
