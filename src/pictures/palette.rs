//! The colours of parts, materials and places to grasp at. A colour means one thing: light colours are parts, dark ones
//! materials, so that neither can be taken for the other, in any kind of colour vision.
//!
//! In Oklab (Ottosson, 2020), a part's lightness is at least 0.73 and a material's at most 0.61, even as people without
//! red, green or blue cones see them (Machado et al., 2009). Among the first [`DISTINCT`] parts, and among as many
//! materials, any two colours are at least 0.1 apart for all of these people; a random search maximised the least
//! distance. Pictures also number the parts.

use crate::numeric::srgb;

/// How many parts and how many materials have colours that everybody can tell apart.
pub const DISTINCT: usize = 7;

const PARTS: [[u8; 3]; DISTINCT] = [
    [241, 169, 23],
    [101, 219, 235],
    [196, 148, 250],
    [122, 188, 148],
    [237, 248, 90],
    [167, 254, 245],
    [182, 222, 156],
];

const MATERIALS: [[u8; 3]; DISTINCT] =
    [[89, 98, 240], [204, 69, 21], [91, 8, 1], [167, 101, 152], [45, 26, 107], [144, 45, 70], [93, 58, 164]];

/// The best place to grasp at, and the others: neither part nor material.
const BEST_PLACE: [u8; 3] = [230, 0, 120];
const OTHER_PLACE: [u8; 3] = [95, 100, 108];

/// Grey, for anything that is not a part.
pub const NOTHING: [f32; 3] = [0.6; 3];

/// Viridis (Smith and van der Walt, 2015), for numbers: it goes from dark to light even without colour.
const VIRIDIS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

/// Colour of the part with this id, sRGB, 0 to 1. After the distinct ones, each hue is advanced by the golden angle.
pub fn part(id: u32) -> [f32; 3] {
    let n = id.saturating_sub(1);
    PARTS.get(n as usize).map_or_else(|| hue(n, 0.84, 0.09), |rgb| unit(*rgb))
}

/// Colour of material `n`, sRGB, 0 to 1.
pub fn material(n: u32) -> [f32; 3] {
    MATERIALS.get(n as usize).map_or_else(|| hue(n, 0.48, 0.1), |rgb| unit(*rgb))
}

/// Colour of the place to grasp at of this rank, 0 for the best, sRGB, 0 to 1.
pub fn place(rank: usize) -> [f32; 3] {
    unit(if rank == 0 { BEST_PLACE } else { OTHER_PLACE })
}

/// Colour of a value from 0 to 1 on a scale, sRGB, 0 to 1.
pub fn scale(value: f32) -> [f32; 3] {
    let at = value.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f32;
    let low = (at as usize).min(VIRIDIS.len() - 2);
    let [from, to] = [unit(VIRIDIS[low]), unit(VIRIDIS[low + 1])];
    std::array::from_fn(|c| from[c] + (at - low as f32) * (to[c] - from[c]))
}

/// A colour as bytes.
pub fn bytes(color: [f32; 3]) -> image::Rgb<u8> {
    image::Rgb(color.map(|channel| (255.0 * channel).round() as u8))
}

fn unit(rgb: [u8; 3]) -> [f32; 3] {
    rgb.map(|channel| f32::from(channel) / 255.0)
}

/// Where the hues after the distinct colours begin, in turns: the first of them differs from the last distinct one.
const FIRST_HUE: f32 = 0.3;

/// A colour of this lightness and chroma in Oklab, both well inside sRGB for every hue; the hue follows from `n`.
fn hue(n: u32, lightness: f32, chroma: f32) -> [f32; 3] {
    let (b, a) = ((n as f32 * 0.618_034 + FIRST_HUE) * std::f32::consts::TAU).sin_cos();
    let [a, b] = [chroma * a, chroma * b];
    let [l, m, s] = [
        lightness + 0.396_337_78 * a + 0.215_803_76 * b,
        lightness - 0.105_561_346 * a - 0.063_854_17 * b,
        lightness - 0.089_484_18 * a - 1.291_485_5 * b,
    ]
    .map(|v| v * v * v);
    [
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_94 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_4 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    ]
    .map(srgb)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use super::*;
    use crate::numeric::linear;

    /// Normal vision, protanopia, deuteranopia, tritanopia: linear sRGB as seen (Machado, Oliveira and Fernandes, 2009,
    /// severity 1).
    const EYES: [[f64; 9]; 4] = [
        [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        [0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998],
        [0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.011820, 0.042940, 0.968881],
        [1.255528, -0.076749, -0.178779, -0.078411, 0.930809, 0.147602, 0.004733, 0.691367, 0.303900],
    ];

    fn oklab(color: [f32; 3], eye: &[f64; 9]) -> Vector3<f64> {
        let seen = Matrix3::from_row_slice(eye) * Vector3::from(color.map(|channel| linear(f64::from(channel))));
        let lms = Matrix3::new(
            0.4122214708,
            0.5363325363,
            0.0514459929, //
            0.2119034982,
            0.6806995451,
            0.1073969566, //
            0.0883024619,
            0.2817188376,
            0.6299787005,
        ) * seen.map(|v| v.clamp(0.0, 1.0));
        Matrix3::new(
            0.2104542553,
            0.7936177850,
            -0.0040720468, //
            1.9779984951,
            -2.4285922050,
            0.4505937099, //
            0.0259040371,
            0.7827717662,
            -0.8086757660,
        ) * lms.map(f64::cbrt)
    }

    #[test]
    fn parts_and_materials_are_told_apart_by_colour() {
        let parts: Vec<_> = (1..=40).map(part).collect();
        let materials: Vec<_> = (0..40).map(material).collect();
        for eye in &EYES {
            let seen = |colors: &[[f32; 3]]| colors.iter().map(|c| oklab(*c, eye)).collect::<Vec<_>>();
            let (parts, materials) = (seen(&parts), seen(&materials));
            for (n, light) in parts.iter().map(|color| color[0]).enumerate() {
                assert!(light > 0.73, "part {n}: {light}");
            }
            for (n, dark) in materials.iter().map(|color| color[0]).enumerate() {
                assert!(dark < 0.61, "material {n}: {dark}");
            }
            for colors in [&parts[..DISTINCT], &materials[..DISTINCT]] {
                for (i, j) in (0..DISTINCT).flat_map(|i| (0..i).map(move |j| (i, j))) {
                    let apart = (colors[i] - colors[j]).norm();
                    assert!(apart > 0.1, "{j} and {i} are {apart} apart");
                }
            }
        }
    }

    #[test]
    fn later_colours_differ_from_their_neighbours() {
        for color in [part as fn(u32) -> [f32; 3], material] {
            // Part ids begin with 1.
            for n in 1..60 {
                let apart = (oklab(color(n), &EYES[0]) - oklab(color(n + 1), &EYES[0])).norm();
                assert!(apart > 0.05, "{n} and {}: {apart}", n + 1);
            }
        }
    }

    #[test]
    fn a_scale_rises_in_lightness() {
        let light: Vec<f64> = (0..=20).map(|n| oklab(scale(n as f32 / 20.0), &EYES[0])[0]).collect();
        assert!(light.windows(2).all(|pair| pair[0] < pair[1]), "{light:?}");
    }
}
