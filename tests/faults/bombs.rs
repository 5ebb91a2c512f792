//! Files that are small on disk but claim or unpack to far more: refused before the memory is allocated.

use std::fs;
use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use gprop::scene::SplatProblem;
use gprop::scene::splat::spz;
use gprop::segment::{LabelMap, LabelMapError};
use image::{GrayImage, ImageFormat};

use super::{assert_refused, run};
use crate::batch::ball::Balls;

/// A grey PNG whose header says `width` x `height`; its pixels are those of 1 x 1.
pub fn png_that_claims(width: u32, height: u32) -> Vec<u8> {
    let mut png = std::io::Cursor::new(Vec::new());
    GrayImage::new(1, 1).write_to(&mut png, ImageFormat::Png).unwrap();
    let mut png = png.into_inner();
    // Signature 8, length 4, then `IHDR`, width, height, five more bytes, and the checksum of everything but the
    // length.
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

/// A zstd frame (RFC 8878) of `count` bytes 128, repeated by one block, that declares its decoder's window size.
fn zstd_frame(count: u32, window: u8) -> Vec<u8> {
    const MAGIC: u32 = 0xFD2F_B528;
    const LAST: u32 = 1;
    const REPEATED: u32 = 1 << 1;
    let mut frame = MAGIC.to_le_bytes().to_vec();
    frame.extend([0, window]);
    frame.extend(&(count << 3 | REPEATED | LAST).to_le_bytes()[..3]);
    frame.push(128);
    frame
}

/// An SPZ of version 4 with one Gaussian, with `more` extra bytes in each of its five streams.
fn spz_of_streams(more: u32, window: u8) -> Vec<u8> {
    let lengths = [9, 1, 3, 3, 4];
    let streams = lengths.map(|length| zstd_frame(length + more, window));
    let mut file = b"NGSP".to_vec();
    file.extend(4_u32.to_le_bytes());
    file.extend(1_u32.to_le_bytes());
    file.extend([0, 12, 0, 5]);
    file.extend(32_u32.to_le_bytes());
    file.resize(32, 0);
    for (length, stream) in lengths.into_iter().zip(&streams) {
        file.extend((stream.len() as u64).to_le_bytes());
        file.extend(u64::from(length).to_le_bytes());
    }
    file.extend(streams.concat());
    file
}

#[test]
fn an_spz_whose_streams_want_terabytes() {
    // Windows of 1 KiB and of 2 TiB: exponents 0 and 31.
    assert_eq!(spz::parse(&spz_of_streams(0, 0)).unwrap().gaussians.len(), 1);
    // Bytes of a stream beyond its declared length are not unpacked.
    let problem = spz::parse(&spz_of_streams(100, 0)).expect_err("a stream is longer than it says");
    assert!(SplatProblem::from(problem).to_string().contains("than its 1 Gaussians take"));
    for (more, window) in [(0, 31 << 3), (100_000, 0)] {
        let problem = spz::parse(&spz_of_streams(more, window)).expect_err("no splat needs that");
        assert!(SplatProblem::from(problem).to_string().contains("cannot be decompressed"), "{more} {window}");
    }
}

#[test]
fn an_spz_that_unpacks_to_gigabytes() {
    // Version 2: magic, version, count, SH degree, fractional bits, flags, reserved; 19 bytes per Gaussian without
    // harmonics.
    let count: u32 = 200_000_000;
    let mut packed = GzEncoder::new(Vec::new(), Compression::best());
    packed.write_all(&0x5053_474e_u32.to_le_bytes()).unwrap();
    packed.write_all(&2_u32.to_le_bytes()).unwrap();
    packed.write_all(&count.to_le_bytes()).unwrap();
    packed.write_all(&[0, 12, 0, 0]).unwrap();
    // More than a reader needs to unpack to notice the false count.
    packed.write_all(&vec![0; 20 << 20]).unwrap();
    let bytes = packed.finish().unwrap();
    assert!(bytes.len() < 100_000);
    let problem = spz::parse(&bytes).expect_err("3.8 GB out of 20 KB");
    assert!(SplatProblem::from(problem).to_string().contains("far more than its"));
}
