//! Colours that distinguish labels.

/// Okabe and Ito's colours for all kinds of colour vision (2008), without the lightest and darkest: sRGB.
const FIRST: [[u8; 3]; 7] =
    [[230, 159, 0], [86, 180, 233], [0, 158, 115], [213, 94, 0], [0, 114, 178], [204, 121, 167], [240, 228, 66]];

/// Colour of label `n`, sRGB, 0 to 1. The first seven are distinct also to colour-blind people; after that, each hue is
/// advanced by the golden angle, so that similar hues are far apart in the sequence.
pub fn color(n: u32) -> [f32; 3] {
    match FIRST.get(n as usize) {
        Some(rgb) => rgb.map(|channel| f32::from(channel) / 255.0),
        None => hue(n as f32 * 0.618_034),
    }
}

/// A colour of medium lightness; `turns` is the hue in turns of the colour circle.
fn hue(turns: f32) -> [f32; 3] {
    let (low, high) = (0.25, 0.85);
    [0.0, 1.0 / 3.0, 2.0 / 3.0].map(|offset| {
        let distance = ((turns + offset).fract() * 6.0 - 3.0).abs();
        low + (high - low) * (distance - 1.0).clamp(0.0, 1.0)
    })
}
