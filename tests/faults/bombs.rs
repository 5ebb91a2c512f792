//! Files that are small on disk and claim or unpack to far more: refused before the memory is asked for.

use std::fs;
use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use gprop::scene::{SplatProblem, spz};
use gprop::segment::{LabelMap, LabelMapError};
use image::{GrayImage, ImageFormat};

use super::{assert_refused, run};
use crate::batch::ball::Balls;

/// A grey PNG whose header says `width` x `height`; its pixels are those of 1 x 1.
fn png_that_claims(width: u32, height: u32) -> Vec<u8> {
    let mut png = std::io::Cursor::new(Vec::new());
    GrayImage::new(1, 1).write_to(&mut png, ImageFormat::Png).unwrap();
    let mut png = png.into_inner();
    // Signature 8, length 4, then `IHDR`, width, height, five more bytes, and the sum over all but the length.
    png[16..20].copy_from_slice(&width.to_be_bytes());
    png[20..24].copy_from_slice(&height.to_be_bytes());
    let mut sum = flate2::Crc::new();
    sum.update(&png[12..29]);
    png[29..33].copy_from_slice(&sum.sum().to_be_bytes());
    png
}

#[test]
fn a_label_map_that_claims_gigapixels() {
    let refused = LabelMap::from_png(&png_that_claims(60_000, 60_000));
    assert!(matches!(refused, Err(LabelMapError::Png(image::ImageError::Limits(_)))), "{refused:?}");
}

#[test]
fn a_photo_that_claims_gigapixels() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    fs::write(balls.scene(0).join("images/000.png"), png_that_claims(60_000, 60_000)).unwrap();
    assert_refused(&run(&balls, out.path()), 3, &["000.png", "60000 x 60000", "scale it down"]);
}

#[test]
fn an_spz_that_unpacks_to_gigabytes() {
    // Version 2: magic, version, count, SH degree, fractional bits, flags, reserved; 19 bytes a Gaussian without harmonics.
    let count: u32 = 200_000_000;
    let mut packed = GzEncoder::new(Vec::new(), Compression::best());
    packed.write_all(&0x5053_474e_u32.to_le_bytes()).unwrap();
    packed.write_all(&2_u32.to_le_bytes()).unwrap();
    packed.write_all(&count.to_le_bytes()).unwrap();
    packed.write_all(&[0, 12, 0, 0]).unwrap();
    // As far as anybody would unpack it to find out.
    packed.write_all(&vec![0; 20 << 20]).unwrap();
    let bytes = packed.finish().unwrap();
    assert!(bytes.len() < 100_000);
    let problem = spz::parse(&bytes).expect_err("3.8 GB out of 20 KB");
    assert!(SplatProblem::from(problem).to_string().contains("far more than its"));
}
