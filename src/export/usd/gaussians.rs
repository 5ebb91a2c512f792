//! The Gaussians as `UsdVol.ParticleField3DGaussianSplat` (OpenUSD 26.03 and later): positions and standard deviations
//! in metres, unit quaternions, opacities from 0 to 1, and spherical harmonics, one colour for each coefficient of each
//! Gaussian. Each has the number of its part as the primvar `part`; the part's properties are in the material `partN`.

use std::fmt::Write;

use super::text::{extent, list, rounded, tuple};
use crate::export::{Model, Rigid};
use crate::gaussians::{Gaussians, SH_C0};

/// The standard deviations within which a Gaussian is drawn.
const DRAWN: f64 = 3.0;

pub fn write(text: &mut String, model: &Model, rigid: &Rigid) {
    let gaussians = model.gaussians;
    let meters = model.scale.map_or(1.0, |scale| scale.meters_per_unit);
    let all = || 0..gaussians.len();
    let position = |i: usize| gaussians.center(i) * meters;
    let reach = |i: usize| gaussians.scale(i).max() * DRAWN * meters;
    let corners = all().flat_map(|i| [-1.0, 1.0].map(|side| position(i).map(|c| c + side * reach(i)).into()));
    let orientation = |i: usize| {
        let q = gaussians.rotation(i);
        tuple([q.w, q.i, q.j, q.k], 6)
    };
    let color = |i: usize| gaussians.sh_dc[i].map(|dc| f64::from((0.5 + SH_C0 * dc).clamp(0.0, 1.0)));
    let _ = write!(
        text,
        r#"    def ParticleField3DGaussianSplat "splat" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        float3[] extent = {extent}
        rel material:binding = </{name}/materials/splat>
        point3f[] positions = {positions}
        quatf[] orientations = {orientations}
        float3[] scales = {scales}
        float[] opacities = {opacities}
        uniform int radiance:sphericalHarmonicsDegree = {degree}
        float3[] radiance:sphericalHarmonicsCoefficients = {harmonics} (
            elementSize = {coefficients}
            interpolation = "vertex"
        )
        color3f[] primvars:displayColor = {colors} (
            interpolation = "vertex"
        )
        int[] primvars:part = {parts} (
            interpolation = "vertex"
        )
    }}

"#,
        extent = extent(corners),
        name = rigid.name,
        positions = list(all().map(|i| tuple(position(i).iter().copied(), 6))),
        orientations = list(all().map(orientation)),
        scales = list(all().map(|i| tuple(gaussians.scale(i).iter().map(|s| (s * meters).max(1e-7)), 7))),
        opacities = list(all().map(|i| rounded(gaussians.opacity(i), 4))),
        degree = gaussians.sh_degree,
        coefficients = gaussians.sh_rest_per_channel() + 1,
        harmonics = list(all().flat_map(|i| harmonics(gaussians, i))),
        colors = list(all().map(|i| tuple(color(i), 3))),
        parts = list(model.field.part_ids().map(|id| id.to_string())),
    );
}

/// The coefficients of a Gaussian, the constant one first, each as a colour.
fn harmonics(gaussians: &Gaussians, i: usize) -> Vec<String> {
    let (constant, rest, count) = (gaussians.sh_dc[i], gaussians.sh_rest_of(i), gaussians.sh_rest_per_channel());
    let others = (0..count).map(|k| [0, 1, 2].map(|channel| rest[channel * count + k]));
    // About a hundredth of the smallest step of a picture's colours.
    std::iter::once(constant).chain(others).map(|color| tuple(color.map(f64::from), 4)).collect()
}
