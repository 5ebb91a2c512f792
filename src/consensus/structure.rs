//! What the file of a mesh says about two Gaussians: whether it tells them apart.
//!
//! It does if they lie on materials that look different, or on different shapes whose surfaces have no corner in common. Measured by
//! `scripts/measure_structure.py` on 13 files with true parts (ten models of furniture with materials, whose shapes were judged by
//! them, the cup of the fixtures, and two CAD tools with labelled points; docs/meshes.md has the table): such pairs belong to
//! different parts in 0 to 100 % of cases, depending on the file, and in 56 % on average. As a beta distribution, that is
//! worth a third of an observation, and it counts here as much as a third of a view.
//!
//! Not evidence, as measured: surfaces without a common corner within one shape (in eight of nine files none of them belonged to
//! different parts: boards of a table, screws); and that the file does not tell two Gaussians apart, since a scan has one shape
//! and one material whatever it shows.

use crate::scene::Origin;

/// The share of pairs told apart that belong to different parts.
pub(super) const SPLIT: f32 = 0.56;
/// The number of views that weigh as much.
pub(super) const VIEWS: f32 = 0.3;

pub(super) fn tells_apart(a: Origin, b: Origin) -> bool {
    a.look != b.look || (a.shape != b.shape && a.surface != b.surface)
}
