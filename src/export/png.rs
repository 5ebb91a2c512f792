//! The pictures of exports as PNG: made once, read often, so they are packed as small as filters make them.

use image::RgbImage;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};

pub fn encoded(picture: &RgbImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive);
    picture.write_with_encoder(encoder).expect("a list of bytes can be written to");
    bytes
}
