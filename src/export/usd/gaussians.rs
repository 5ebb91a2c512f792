//! The Gaussians as `UsdVol.ParticleField3DGaussianSplat` (OpenUSD 26.03 and later): positions and standard deviations
//! in metres, unit quaternions, opacities from 0 to 1, and spherical harmonics, one colour for each coefficient of each
//! Gaussian. Each that belongs to a part has its number as the primvar `part`; its material, which is called like the part, has the part's properties.

use std::fmt::Write;

use super::text::{extent, list, rounded, tuple};
use crate::export::Splat;
use crate::gaussians::{Gaussians, SH_C0};
use crate::vote::MaterialField;

/// The standard deviations within which a Gaussian is drawn.
const DRAWN: f64 = 3.0;

/// Writes these Gaussians below the prim `owner`, whose materials have one for them.
pub fn write(text: &mut String, splat: &Splat, indices: &[usize], owner: &str) {
    let Splat { gaussians, meters_per_unit: meters, origin, field } = *splat;
    let all = || indices.iter().copied();
    let position = |i: usize| gaussians.center(i) * meters - origin;
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
        rel material:binding = </{owner}/materials/splat>
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
{parts}    }}

"#,
        extent = extent(corners),
        positions = list(all().map(|i| tuple(position(i).iter().copied(), 6))),
        orientations = list(all().map(orientation)),
        scales = list(all().map(|i| tuple(gaussians.scale(i).iter().map(|s| (s * meters).max(1e-7)), 7))),
        opacities = list(all().map(|i| rounded(gaussians.opacity(i), 4))),
        degree = gaussians.sh_degree,
        coefficients = gaussians.sh_rest_per_channel() + 1,
        harmonics = list(all().flat_map(|i| harmonics(gaussians, i))),
        colors = list(all().map(|i| tuple(color(i), 3))),
        parts = field.map_or_else(String::new, |field| parts(field, indices)),
    );
}

/// The part of each Gaussian.
fn parts(field: &MaterialField, indices: &[usize]) -> String {
    let ids: Vec<u32> = field.part_ids().collect();
    let ids = list(indices.iter().map(|i| ids[*i].to_string()));
    format!("        int[] primvars:part = {ids} (\n            interpolation = \"vertex\"\n        )\n")
}

/// The coefficients of a Gaussian, the constant one first, each as a colour.
fn harmonics(gaussians: &Gaussians, i: usize) -> Vec<String> {
    let (constant, rest, count) = (gaussians.sh_dc[i], gaussians.sh_rest_of(i), gaussians.sh_rest_per_channel());
    let others = (0..count).map(|k| [0, 1, 2].map(|channel| rest[channel * count + k]));
    // About a hundredth of the smallest step of a picture's colours.
    std::iter::once(constant).chain(others).map(|color| tuple(color.map(f64::from), 4)).collect()
}
