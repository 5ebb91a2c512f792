//! Compact splats: built in code, damaged, and compared with the same Gaussians as PLY if the files are available.

use std::collections::BTreeSet;
use std::io::Write;

use gprop::gaussians::Gaussians;
use gprop::render::{RenderOptions, render};
use gprop::scene::cameras::colmap;
use gprop::scene::splat::dot_splat as splat;
use gprop::scene::splat::ksplat;
use gprop::scene::splat::ply;
use gprop::scene::splat::sog;
use gprop::scene::splat::spz;
use gprop::scene::{self, Options};
use proptest::prelude::*;

use crate::support::shared;

fn close(a: &[f32], b: &[f32], tolerance: f32) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance)
}

/// One row of a .splat.
pub fn splat_row(position: [f32; 3], scale: [f32; 3], rgba: [u8; 4], quaternion: [u8; 4]) -> Vec<u8> {
    let floats = position.into_iter().chain(scale).flat_map(f32::to_le_bytes);
    floats.chain(rgba).chain(quaternion).collect()
}

#[test]
fn a_splat_row_is_what_it_says() {
    let file = splat_row([1.0, -2.0, 3.5], [0.5, 1.0, 2.0], [255, 0, 128, 64], [255, 128, 128, 0]);
    let gaussians = splat::parse(&file).unwrap().gaussians;
    assert_eq!(gaussians.positions, [[1.0, -2.0, 3.5]]);
    assert!((gaussians.scale(0) - nalgebra::Vector3::new(0.5, 1.0, 2.0)).amax() < 1e-6);
    assert!((gaussians.opacity(0) - 64.0 / 255.0).abs() < 1e-6);
    // Colour = 0.5 + C0 f_dc.
    let color = gaussians.sh_dc[0].map(|f_dc| 0.5 + 0.282_094_8 * f_dc);
    assert!(close(&color, &[1.0, 0.0, 128.0 / 255.0], 1e-5), "{color:?}");
    assert!(close(&gaussians.rotations[0], &[127.0 / 128.0, 0.0, 0.0, -1.0], 1e-6));
}

#[test]
fn a_bad_splat_is_refused() {
    let row = splat_row([0.0; 3], [1.0; 3], [255; 4], [255, 128, 128, 128]);
    assert!(splat::parse(&[]).unwrap_err().to_string().contains("no Gaussians"));
    assert!(splat::parse(&row[..31]).unwrap_err().to_string().contains("31 bytes"));
    for scale in [f32::NAN, -1.0] {
        let undrawable = splat_row([0.0; 3], [1.0, scale, 1.0], [255; 4], [255, 128, 128, 128]);
        assert!(splat::parse(&undrawable).unwrap_err().to_string().contains("none of the 1 Gaussians"), "{scale}");
    }
    let flat = splat_row([0.0; 3], [1.0, 0.0, 1.0], [255; 4], [255, 128, 128, 128]);
    assert_eq!(splat::parse(&flat).unwrap().gaussians.log_scales, [[0.0, -20.0, 0.0]]);
    let nan = splat_row([f32::NAN; 3], [1.0; 3], [255; 4], [255, 128, 128, 128]);
    assert!(splat::parse(&nan).unwrap_err().to_string().contains("none of the 1 Gaussians"));
    let loaded = splat::parse(&[row.clone(), nan, row].concat()).unwrap();
    assert_eq!((loaded.gaussians.len(), loaded.warnings.len()), (2, 1));
    assert!(loaded.warnings[0].starts_with("1 of 3 Gaussians"), "{:?}", loaded.warnings);
}

/// A plain (uncompressed) SPZ of version 1 to 3 with one Gaussian of SH degree 1.
fn spz_plain(version: u32, positions: &[u8], rotation: &[u8]) -> Vec<u8> {
    let mut file = b"NGSP".to_vec();
    file.extend(version.to_le_bytes());
    file.extend(1u32.to_le_bytes());
    // SH degree 1, 8 fractional bits, antialiased, reserved.
    file.extend([1, 8, 1, 0]);
    file.extend(positions);
    // Opacity; colours; log scales -10 + byte / 16.
    file.extend([128, 0, 128, 255, 160, 144, 176]);
    file.extend(rotation);
    // y, z, x coefficients of red, green, blue side by side.
    file.extend([192, 128, 64, 0, 128, 255, 160, 96, 128]);
    file
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// 24-bit fixed point with 8 fractional bits: 1, -2, 0.5.
const FIXED: [u8; 9] = [0, 1, 0, 0, 254, 255, 128, 0, 0];

#[test]
fn spz_versions_read_alike() {
    // Half floats 1, -2, 0.5.
    let half = [0x00, 0x3c, 0x00, 0xc0, 0x00, 0x38];
    let first_three = [255, 128, 128];
    // Largest is x (bits 00), y z w all 0.
    let smallest_three = [0, 0, 0, 0];
    for file in
        [spz_plain(1, &half, &first_three), spz_plain(2, &FIXED, &first_three), spz_plain(3, &FIXED, &smallest_three)]
    {
        for file in [gzip(&file), file] {
            let loaded = spz::parse(&file).unwrap();
            let gaussians = &loaded.gaussians;
            assert!(loaded.gaussians.antialiased);
            // Right up back becomes right down front.
            assert_eq!(gaussians.positions, [[1.0, 2.0, -0.5]]);
            assert_eq!(gaussians.log_scales, [[0.0, -1.0, 1.0]]);
            assert!((gaussians.opacity(0) - 128.0 / 255.0).abs() < 1e-6);
            assert!(close(&gaussians.sh_dc[0], &[-0.5 / 0.15, 0.013, 0.5 / 0.15], 1e-3), "{:?}", gaussians.sh_dc);
            // Half a turn about x.
            assert!(gaussians.rotation(0).angle() > 3.1 && gaussians.rotation(0).vector().x.abs() > 0.99);
            // Channel-major, y and z negated.
            let expected = [-0.5, 1.0, 0.25, 0.0, 0.0, -0.25, 0.5, -127.0 / 128.0, 0.0];
            assert!(close(&gaussians.sh_rest, &expected, 1e-6), "{:?}", gaussians.sh_rest);
        }
    }
}

#[test]
fn a_bad_spz_is_refused() {
    let good = spz_plain(2, &FIXED, &[128; 3]);
    let message = |file: &[u8]| spz::parse(file).unwrap_err().to_string();
    let changed = |at: usize, byte: u8| {
        let mut file = good.clone();
        file[at] = byte;
        message(&file)
    };
    assert!(message(b"ply\n").contains("is not an .spz"));
    assert!(message(&gzip(b"not a splat at all")).contains("is not an .spz"));
    assert!(message(&good[..10]).contains("ends within its header"));
    assert!(message(&good[..40]).contains("bytes of"));
    assert!(changed(4, 9).contains("version 9"));
    assert!(changed(8, 0).contains("no Gaussians"));
    assert!(changed(11, 200).contains("far more than its"));
    assert!(changed(12, 4).contains("degree 4"));
    assert!(changed(13, 25).contains("25 fractional bits"));
    let mut truncated = gzip(&good);
    truncated.truncate(30);
    assert!(message(&truncated).contains("cannot be decompressed"), "{}", message(&truncated));
}

/// The file as gzip and uncompressed, with `more` at the end of the uncompressed data.
fn legacy(flags: u8, more: &[u8]) -> [Vec<u8>; 2] {
    let mut file = spz_plain(3, &FIXED, &[0; 4]);
    file[14] = flags;
    file.extend(more);
    [gzip(&file), file]
}

#[test]
fn an_spz_is_checked_to_its_last_byte() {
    let message = |file: &[u8]| spz::parse(file).expect_err("it is damaged").to_string();
    let good = gzip(&spz_plain(3, &FIXED, &[0; 4]));
    assert!(spz::parse(&good).is_ok());
    // The trailer: CRC-32 and length of the uncompressed data, four bytes each.
    for at in good.len() - 8..good.len() {
        let mut damaged = good.clone();
        damaged[at] ^= 0x10;
        assert!(message(&damaged).contains("cannot be decompressed"), "byte {at}: {}", message(&damaged));
    }
    for missing in 1..=8 {
        let cut = &good[..good.len() - missing];
        assert!(message(cut).contains("cannot be decompressed"), "{missing} bytes cut off: {}", message(cut));
    }
    for rest in [&b"x"[..], &[0; 512], &good] {
        let message = message(&[&good, rest].concat());
        assert!(message.contains(&format!("{} bytes after its end", rest.len())), "{message}");
    }
    for file in legacy(0, &[7]) {
        assert!(message(&file).contains("than its 1 Gaussians take"), "{}", message(&file));
    }
    // Records of other programs are announced, and checked as part of the stream.
    for (file, is_gzip) in legacy(2, &[7; 100]).into_iter().zip([true, false]) {
        assert_eq!(spz::parse(&file).unwrap().gaussians.len(), 1);
        if is_gzip {
            assert!(message(&file[..file.len() - 1]).contains("cannot be decompressed"));
        }
    }
    // A stored block: damaged data in it decompress without an error, so only the checksum can tell.
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::none());
    encoder.write_all(&spz_plain(3, &FIXED, &[0; 4])).unwrap();
    let mut stored = encoder.finish().unwrap();
    let (color, at) = ([128, 0, 128, 255], stored.len() - 8 - 20);
    let at = (0..=at).rfind(|&at| stored[at..].starts_with(&color)).unwrap();
    stored[at] = 129;
    assert!(message(&stored).contains("cannot be decompressed"), "{}", message(&stored));
}

#[test]
fn the_checksum_of_a_zstd_stream_is_checked() {
    let file = |checksum: Option<u32>| {
        // Frames of one raw block (RFC 8878): a single segment whose length is in one byte.
        let frame = |bytes: &[u8]| {
            let flags = 0x20 | if checksum.is_some() { 4 } else { 0 };
            let mut frame = [0xFD2F_B528_u32.to_le_bytes().as_slice(), &[flags, bytes.len() as u8]].concat();
            frame.extend(&((bytes.len() as u32) << 3 | 1).to_le_bytes()[..3]);
            frame.extend(bytes);
            frame.extend(checksum.into_iter().flat_map(u32::to_le_bytes));
            frame
        };
        let streams = [9, 1, 3, 3, 4].map(|length| (length as u64, frame(&vec![128; length])));
        let mut file = [b"NGSP".as_slice(), &4_u32.to_le_bytes(), &1_u32.to_le_bytes(), &[0, 12, 0, 5]].concat();
        file.extend(32_u32.to_le_bytes());
        file.resize(32, 0);
        for (length, stream) in &streams {
            file.extend((stream.len() as u64).to_le_bytes());
            file.extend(length.to_le_bytes());
        }
        file.extend(streams.map(|(_, stream)| stream).concat());
        file
    };
    let good = file(None);
    assert_eq!(spz::parse(&good).unwrap().gaussians.len(), 1);
    let damaged = spz::parse(&file(Some(1))).unwrap_err().to_string();
    assert!(damaged.contains("its checksum does not match"), "{damaged}");
    let longer = spz::parse(&[good, vec![0; 3]].concat()).unwrap_err().to_string();
    assert!(longer.contains("3 bytes after its end"), "{longer}");
}

/// A compressed PLY of one chunk.
fn compressed_ply(count: usize, with_sh: bool) -> Vec<u8> {
    let bounds = ["x", "y", "z", "scale_x", "scale_y", "scale_z", "r", "g", "b"];
    let names = |end: &str| bounds.iter().map(|name| format!("property float {end}_{name}\n")).collect::<String>();
    let sh: String = (0..9).map(|i| format!("property uchar f_rest_{i}\n")).collect();
    let mut file = format!(
        "ply\nformat binary_little_endian 1.0\nelement chunk 1\n{}{}element vertex {count}\nproperty uint packed_position\n\
         property uint packed_rotation\nproperty uint packed_scale\nproperty uint packed_color\n{}end_header\n",
        names("min"),
        names("max"),
        if with_sh { format!("element sh {count}\n{sh}") } else { String::new() }
    )
    .into_bytes();
    let low: [f32; 9] = [-1.0, -1.0, -1.0, -5.0, -5.0, -5.0, 0.0, 0.0, 0.0];
    let high: [f32; 9] = [1.0, 1.0, 3.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0];
    file.extend(low.into_iter().chain(high).flat_map(f32::to_le_bytes));
    for _ in 0..count {
        // x at its maximum, y at its minimum, z in the middle; w is largest, the rest zero; scales at their minimum;
        // red.
        let position: u32 = 2047 << 21 | 1024;
        let rotation: u32 = 512 << 20 | 512 << 10 | 512;
        for word in [position, rotation, 0, 0xff00_0080] {
            file.extend(word.to_le_bytes());
        }
    }
    if with_sh {
        file.extend(std::iter::repeat_n([0, 128, 255], 3 * count).flatten());
    }
    file
}

#[test]
fn a_compressed_ply_is_unpacked() {
    for with_sh in [false, true] {
        let gaussians = ply::parse(&compressed_ply(3, with_sh)).unwrap().gaussians;
        assert_eq!((gaussians.len(), gaussians.sh_degree), (3, u8::from(with_sh)));
        assert!(close(&gaussians.positions[2], &[1.0, -1.0, 1.0 + 2.0 / 2047.0], 1e-5), "{:?}", gaussians.positions);
        assert_eq!(gaussians.log_scales[0], [-5.0; 3]);
        // Ten bits have no middle: 512 of 1023 is half a step above zero.
        assert!(gaussians.rotation(0).angle() < 0.005, "{}", gaussians.rotation(0).angle());
        assert!((gaussians.opacity(0) - 128.0 / 255.0).abs() < 1e-6);
        assert!(close(&gaussians.sh_dc[0], &[1.772_45, -1.772_45, -1.772_45], 1e-4));
        if with_sh {
            assert!(close(gaussians.sh_rest_of(1), &[-4.0, 0.0156, 4.0, -4.0, 0.0156, 4.0], 1e-3));
        }
    }
}

#[test]
fn a_bad_compressed_ply_is_refused() {
    let message = |file: &[u8]| ply::parse(file).unwrap_err().to_string();
    let good = compressed_ply(3, true);
    let replaced = |from: &str, to: &str| {
        let text = good.iter().map(|byte| char::from(*byte)).collect::<String>().replacen(from, to, 1);
        message(&text.chars().map(|c| c as u8).collect::<Vec<u8>>())
    };
    assert!(message(&good[..good.len() - 1]).contains("is truncated"));
    assert!(replaced("element vertex 3", "element vertex 4000000000").contains("is truncated"));
    assert!(replaced("element vertex 3", "element vertex 0").contains("zero Gaussians"));
    assert!(replaced("element chunk", "element chink").contains("without its element `chunk`"));
    assert!(replaced("packed_scale", "packed_skale").contains("missing: packed_scale"));
    assert!(replaced("f_rest_0", "f_rest_9").contains("f_rest"));
    assert!(message(&compressed_ply(300, false)).contains("300 Gaussians with 1 chunks"));
}

/// Quantised or not, the splat looks the same: over 45 dB is under half a percent of full scale.
#[test]
fn the_plant_looks_the_same_in_every_format() {
    const LEAST_DB: f64 = 45.0;
    let Some(folder) = shared("the_plant_looks_the_same_in_every_format", "captures/plant") else { return };
    let scene = scene::load(&folder, &Options::default()).unwrap();
    let mut camera = scene.views[0].camera.clone();
    camera.intrinsics = camera.intrinsics.resized(240, 240);
    let picture = |gaussians: &Gaussians| render(gaussians, &camera, &RenderOptions::default()).rgb;
    let original = picture(&scene.gaussians);
    for path in ["splat/plant.splat", "spz/plant.spz", "compressed_ply/plant.compressed.ply"] {
        let Some(file) = shared("the_plant_looks_the_same_in_every_format", &format!("formats/{path}")) else {
            continue;
        };
        let options = Options { splat: Some(file), ..Options::default() };
        let found = scene::load(&folder, &options).unwrap().gaussians;
        assert_eq!(found.len(), scene.gaussians.len());
        let pairs = original.iter().flatten().zip(picture(&found).into_iter().flatten());
        let errors: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
        let psnr = -10.0 * (errors / (3 * original.len()) as f64).log10();
        println!("{path}: {psnr:.1} dB");
        assert!(psnr > LEAST_DB);
    }
}

#[test]
fn files_of_other_programs_are_read() {
    let counts = [
        ("formats/spz/biker_v4.spz", 152_746),
        ("formats/spz/minimal-v2.spz", 4),
        ("formats/spz/minimal-v3.spz", 4),
        ("formats/spz/minimal-v4.spz", 4),
        ("formats/spz/minimal-raw.spz", 4),
        ("formats/splat/hammer_10k.splat", 10_000),
        ("formats/compressed_ply/guitar.compressed.ply", 90_854),
        ("formats/ply/playbot_sh2_no_normals.ply", 31_000),
        ("formats/ply/hammer_10k_no_sh.ply", 10_000),
    ];
    for (path, count) in counts {
        let Some(file) = shared("files_of_other_programs_are_read", path) else { continue };
        let bytes = std::fs::read(&file).unwrap();
        let loaded = match file.extension().unwrap().to_str() {
            Some("spz") => spz::parse(&bytes).unwrap(),
            Some("splat") => splat::parse(&bytes).unwrap(),
            _ => ply::parse(&bytes).unwrap(),
        };
        assert_eq!((loaded.gaussians.len(), loaded.warnings), (count, vec![]), "{path}");
        let finite = (0..loaded.gaussians.len()).all(|i| loaded.gaussians.is_usable(i));
        assert!(finite, "{path}");
    }
}

proptest! {
    #![proptest_config(super::proptest_config())]

    #[test]
    fn no_bytes_make_a_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = splat::parse(&bytes);
        let _ = spz::parse(&bytes);
        let _ = spz::parse(&[b"NGSP".as_slice(), &bytes].concat());
        let _ = spz::parse(&gzip(&[b"NGSP".as_slice(), &bytes].concat()));
        let _ = ply::parse(&[b"ply\n".as_slice(), &bytes].concat());
    }

    #[test]
    fn no_damage_makes_a_reader_panic(at in any::<prop::sample::Index>(), byte in any::<u8>(), cut in any::<prop::sample::Index>()) {
        for good in [
            spz_plain(1, &FIXED[..6], &[1, 2, 3]),
            spz_plain(3, &FIXED, &[1, 2, 3, 4]),
            compressed_ply(3, true),
        ] {
            let mut bad = good.clone();
            let index = at.index(bad.len());
            bad[index] = byte;
            bad.truncate(cut.index(bad.len()) + 1);
            let _ = spz::parse(&bad);
            let _ = spz::parse(&gzip(&bad));
            let _ = ply::parse(&bad);
            let mut whole = good;
            whole[index] = byte;
            let _ = spz::parse(&whole);
            let _ = ply::parse(&whole);
        }
    }
}

/// A .ksplat of level 0 with Gaussians of SH degree 1, whose harmonics are 0, 1, 2 ...
pub fn ksplat_file(count: u32, fitting: u32) -> Vec<u8> {
    let mut file = vec![0; 4096 + 1024];
    file[1] = 1;
    file[4..8].copy_from_slice(&1u32.to_le_bytes());
    // Sections and Gaussians in use, which gprop does not need.
    file[8..12].copy_from_slice(&1u32.to_le_bytes());
    file[16..20].copy_from_slice(&count.to_le_bytes());
    let section = 4096;
    file[section..section + 4].copy_from_slice(&count.to_le_bytes());
    file[section + 4..section + 8].copy_from_slice(&fitting.to_le_bytes());
    file[section + 40] = 1;
    for _ in 0..fitting {
        let numbers = [1.0f32, -2.0, 3.5, 0.5, 1.0, 2.0, 1.0, 0.0, 0.0, 0.0];
        file.extend(numbers.into_iter().flat_map(f32::to_le_bytes));
        file.extend([255, 0, 128, 64]);
        file.extend((0..9u8).flat_map(|n| f32::from(n).to_le_bytes()));
    }
    file
}

#[test]
fn a_ksplat_is_what_it_says() {
    // There is room for a second Gaussian, which is not in use.
    let gaussians = ksplat::parse(&ksplat_file(1, 2)).unwrap().gaussians;
    assert_eq!(gaussians.positions, [[1.0, -2.0, 3.5]]);
    assert!((gaussians.scale(0) - nalgebra::Vector3::new(0.5, 1.0, 2.0)).amax() < 1e-6);
    assert!((gaussians.opacity(0) - 64.0 / 255.0).abs() < 1e-6);
    assert_eq!(gaussians.rotations, [[1.0, 0.0, 0.0, 0.0]]);
    // Channel by channel within the band, as in a PLY.
    assert_eq!(gaussians.sh_rest_of(0), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
}

/// Every 2, 4 and 8 bytes of small files are given the largest and the next smaller powers of two as numbers, so that every
/// count in them is too large once: whatever it counts, the reader returns and takes no memory for it.
#[test]
fn no_count_makes_a_reader_overflow() {
    let camera = [1, 0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0, 1, 0, 0, 0].into_iter().chain([8, 0, 0, 0, 0, 0, 0, 0].repeat(6));
    let image = [1, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0].into_iter().chain([0, 0, 0, 0, 0, 0, 240, 63].repeat(7));
    let image: Vec<u8> = image.chain([7, 0, 0, 0, b'a', 0, 1, 0, 0, 0, 0, 0, 0, 0]).chain([9; 24]).collect();
    let mut by_buckets = ksplat_file(2, 2);
    by_buckets[20] = 1;
    by_buckets[4096 + 8] = 1;
    by_buckets[4096 + 12] = 1;
    by_buckets[4096 + 20] = 12;
    by_buckets[4096 + 32] = 1;
    type Reader = fn(&[u8]);
    let readers: [(&str, Vec<u8>, Reader); 6] = [
        ("ksplat", ksplat_file(2, 2), |bytes| drop(ksplat::parse(bytes))),
        ("ksplat with buckets", by_buckets, |bytes| drop(ksplat::parse(bytes))),
        ("cameras.bin", camera.collect(), |bytes| drop(colmap::parse_cameras_binary(bytes))),
        ("images.bin", image, |bytes| drop(colmap::parse_images_binary(bytes))),
        ("sog", sog_bundle(|_| {}), |bytes| drop(sog::parse(bytes))),
        ("spz", spz_plain(3, &FIXED, &[0; 4]), |bytes| drop(spz::parse(bytes))),
    ];
    for (name, file, read) in readers {
        // The rows of Gaussians at the end of a file are many, and have no counts.
        for at in (0..file.len().min(4096 + 1024)).filter(|at| name != "ksplat" || *at < 64 || *at >= 4096) {
            for (bytes, number) in [2, 4, 8].into_iter().flat_map(|bytes| [0, 1].map(|less| (bytes, u64::MAX >> less)))
            {
                let mut changed = file.clone();
                let end = (at + bytes).min(file.len());
                changed[at..end].copy_from_slice(&(number >> (64 - 8 * bytes)).to_le_bytes()[..end - at]);
                // Shown if the reader panics.
                println!("{name}: {bytes} bytes at {at}");
                read(&changed);
            }
        }
    }
}

#[test]
fn a_bad_ksplat_is_refused() {
    let file = ksplat_file(2, 2);
    assert!(ksplat::parse(&file[..100]).unwrap_err().to_string().contains("100 bytes"));
    assert!(ksplat::parse(&file[..file.len() - 1]).unwrap_err().to_string().contains("section 0 needs"));
    assert!(ksplat::parse(&ksplat_file(0, 1)).unwrap_err().to_string().contains("no Gaussians"));
    let changed = |at: usize, byte: u8| {
        let mut changed = file.clone();
        changed[at] = byte;
        ksplat::parse(&changed).unwrap_err().to_string()
    };
    assert!(changed(0, 1).contains("version 1.1"));
    assert!(changed(20, 3).contains("compression level 3"));
    assert!(changed(4096 + 40, 4).contains("degree 4"));
    assert!(changed(7, 255).contains("within its headers"), "four billion sections");
}

#[test]
fn the_sample_ksplat_is_read() {
    let Some(path) = shared("the_sample_ksplat_is_read", "formats/ksplat/minimal.ksplat") else { return };
    let gaussians = ksplat::parse(&std::fs::read(path).unwrap()).unwrap().gaussians;
    assert!(!gaussians.is_empty());
    assert!((0..gaussians.len()).all(|i| gaussians.is_usable(i)));
}

/// A SOG bundle of two Gaussians with PNGs for pictures; `change` alters its description.
pub fn sog_bundle(change: impl Fn(&mut serde_json::Value)) -> Vec<u8> {
    let encoded = |picture: image::RgbaImage| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    };
    let png = |pixel: [u8; 4]| encoded(image::RgbaImage::from_pixel(2, 2, image::Rgba(pixel)));
    // One row of a palette of degree 1: pixel x holds the entries x, x + 3 and x + 6 of a codebook.
    let palette = image::RgbaImage::from_fn(64 * 3, 1, |x, _| image::Rgba([x, x + 3, x + 6, 255].map(|v| v as u8)));
    let mut meta = serde_json::json!({
        "version": 2, "count": 2,
        "means": { "mins": [0.0, -1.0, 0.0], "maxs": [1.0, 1.0, 1.0], "files": ["low.png", "high.png"] },
        "scales": { "codebook": [-3.0, -2.0], "files": ["scales.png"] },
        "quats": { "files": ["quats.png"] },
        "sh0": { "codebook": [0.5, -0.5], "files": ["sh0.png"] },
    });
    change(&mut meta);
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let files = [
        ("meta.json", meta.to_string().into_bytes()),
        ("low.png", png([255, 255, 0, 255])),
        ("high.png", png([255, 255, 0, 255])),
        ("scales.png", png([0, 1, 0, 255])),
        ("quats.png", png([255, 128, 128, 253])),
        ("sh0.png", png([0, 1, 1, 128])),
        ("palette.png", encoded(palette)),
        ("entries.png", png([0, 0, 0, 255])),
    ];
    for (name, bytes) in files {
        archive.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        archive.write_all(&bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn a_sog_is_what_it_says() {
    let gaussians = sog::parse(&sog_bundle(|_| ())).unwrap().gaussians;
    assert_eq!(gaussians.len(), 2);
    // sign(x) (e^|x| - 1) of the ends of the range.
    let far = 1f32.exp() - 1.0;
    assert!(close(&gaussians.positions[1], &[far, far, 0.0], 1e-6), "{:?}", gaussians.positions);
    assert_eq!(gaussians.log_scales[0], [-3.0, -2.0, -3.0]);
    assert_eq!(gaussians.sh_dc[0], [0.5, -0.5, -0.5]);
    assert!((gaussians.opacity(0) - 128.0 / 255.0).abs() < 1e-6);
    // x is the largest component; w, the first of the others, is sqrt(1/2).
    assert!(
        close(&gaussians.rotations[0], &[std::f32::consts::FRAC_1_SQRT_2, 0.707_096, 0.002_773, 0.002_773], 1e-4),
        "{gaussians:?}"
    );
}

#[test]
fn a_sog_has_harmonics_by_channel() {
    let codebook: Vec<f32> = (0..9).map(|n| n as f32 / 8.0).collect();
    let with_harmonics = |count: usize| {
        sog_bundle(|meta| {
            let files = ["palette.png", "entries.png"];
            meta["shN"] = serde_json::json!({ "bands": 1, "count": count, "codebook": codebook, "files": files });
        })
    };
    let gaussians = sog::parse(&with_harmonics(1)).unwrap().gaussians;
    assert_eq!((gaussians.sh_degree, gaussians.sh_rest), (1, codebook.repeat(2)));
    assert!(sog::parse(&with_harmonics(0)).unwrap_err().to_string().contains("entry 0 of the palette"));
}

#[test]
fn a_bad_sog_is_refused() {
    let refused = |change: fn(&mut serde_json::Value)| sog::parse(&sog_bundle(change)).unwrap_err().to_string();
    assert!(sog::parse(b"PK").unwrap_err().to_string().contains("is not a .sog"));
    assert!(refused(|meta| meta["version"] = 1.into()).contains("version 1"));
    assert!(refused(|meta| meta["count"] = 5.into()).contains("2 x 2 pixels"));
    assert!(refused(|meta| meta["count"] = u64::MAX.into()).contains("far more than"));
    assert!(refused(|meta| meta["scales"]["codebook"] = serde_json::json!([1.0])).contains("entry 1 of the codebook"));
    let outside = refused(|meta| meta["quats"]["files"] = serde_json::json!(["../quats.png"]));
    assert!(outside.contains("not the name of a file"), "{outside}");
    assert!(refused(|meta| meta["quats"]["files"] = serde_json::json!(["gone.png"])).contains("no gone.png"));
}

/// splat-transform made the bundle from the splat beside it; its writer sorts the Gaussians.
#[test]
fn a_sog_bundle_and_its_folder_are_the_same_splat() {
    const TEST: &str = "a_sog_bundle_and_its_folder_are_the_same_splat";
    let Some(path) = shared(TEST, "formats/sog/plant.sog") else { return };
    let bundle = sog::parse(&std::fs::read(&path).unwrap()).unwrap().gaussians;
    let folder = tempfile::tempdir().unwrap();
    let mut archive = zip::ZipArchive::new(std::fs::File::open(&path).unwrap()).unwrap();
    archive.extract(folder.path()).unwrap();
    let loose = sog::read_folder(&folder.path().join("meta.json")).unwrap();
    assert_eq!(bundle, loose.gaussians);
    let read: BTreeSet<_> = loose.files.into_iter().chain([folder.path().join("meta.json")]).collect();
    let there: BTreeSet<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(read, there, "the scene's hash covers every file");
    assert_eq!(bundle.len(), 113_648);
    let Some(splat) = shared(TEST, "formats/splat/plant.splat") else { return };
    let original = splat::parse(&std::fs::read(splat).unwrap()).unwrap().gaussians;
    let nearest = gprop::numeric::nearest::Nearest::new(original.positions.iter().copied());
    let (mut farthest, mut off) = (0f32, [0f32; 2]);
    for i in (0..bundle.len()).step_by(97) {
        let (distance2, twin) = nearest.find(bundle.positions[i], 1)[0];
        farthest = farthest.max(distance2.sqrt());
        off[0] += (bundle.opacity(i) - original.opacity(twin as usize)).abs() as f32;
        off[1] += (bundle.sh_dc[i][0] - original.sh_dc[twin as usize][0]).abs();
    }
    let count = bundle.len().div_ceil(97) as f32;
    println!("farthest {farthest}, mean differences of opacity {} and colour {}", off[0] / count, off[1] / count);
    // 16 bits over about half a unit; a byte for an opacity; 256 colours.
    assert!(farthest < 2e-5 && off[0] / count < 0.004 && off[1] / count < 0.02);
}
