//! Round trips with PlayCanvas' splat-transform, in every format that both programs know.
//!
//! gprop writes PLY, so that is the one format that goes both ways; of the others, gprop must read what splat-transform
//! writes, and both must read the same from the same file.

use std::path::Path;
use std::process::Command;

use gprop::gaussians::Gaussians;
use gprop::numeric::nearest::Nearest;
use gprop::scene::splat::dot_splat as splat;
use gprop::scene::splat::ksplat;
use gprop::scene::splat::ply;
use gprop::scene::splat::sog;
use gprop::scene::splat::spz;
use tempfile::TempDir;

use super::formats::{ksplat_file, splat_row};
use crate::support::skipped;

/// The largest differences between Gaussians.
#[derive(Debug, Clone, Copy, Default)]
struct Differences {
    /// Scene units.
    position: f32,
    log_scale: f32,
    /// 0 to 1.
    opacity: f32,
    /// Of the constant coefficient, and of the others.
    sh_dc: f32,
    sh_rest: f32,
    /// Of the rotations.
    degrees: f32,
}

impl Differences {
    /// Each of `found` is compared with the nearest of `expected`: writers sort.
    fn of(found: &Gaussians, expected: &Gaussians) -> Self {
        assert_eq!((found.len(), found.sh_degree), (expected.len(), expected.sh_degree));
        let nearest = Nearest::new(expected.positions.iter().copied());
        let mut taken = vec![false; expected.len()];
        let mut most = Self::default();
        let apart = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        for i in 0..found.len() {
            let twin = nearest.find(found.positions[i], 1)[0].1 as usize;
            assert!(!std::mem::replace(&mut taken[twin], true), "two Gaussians at the place of one");
            let turned = found.rotation(i).angle_to(&expected.rotation(twin)).to_degrees() as f32;
            let pairs = [
                (&mut most.position, apart(&found.positions[i], &expected.positions[twin])),
                (&mut most.log_scale, apart(&found.log_scales[i], &expected.log_scales[twin])),
                (&mut most.opacity, (found.opacity(i) - expected.opacity(twin)).abs() as f32),
                (&mut most.sh_dc, apart(&found.sh_dc[i], &expected.sh_dc[twin])),
                (&mut most.sh_rest, apart(found.sh_rest_of(i), expected.sh_rest_of(twin))),
                (&mut most.degrees, turned),
            ];
            for (most, own) in pairs {
                assert!(own.is_finite());
                *most = most.max(own);
            }
        }
        most
    }

    fn within(self, limits: [f32; 6]) -> bool {
        let own = [self.position, self.log_scale, self.opacity, self.sh_dc, self.sh_rest, self.degrees];
        own.iter().zip(limits).all(|(own, limit)| *own <= limit)
    }
}

/// A part of the hammer: few enough for SOG's search for common harmonics, and far enough apart to be told apart after
/// the coarsest rounding of positions (SPZ's, 1/4096).
fn sample() -> Gaussians {
    const APART: f32 = 1e-3;
    const EVERY: usize = 48;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer/point_cloud.ply");
    let mut gaussians = ply::read(&path).unwrap().gaussians;
    let kept: Vec<bool> = (0..gaussians.len()).map(|i| i % EVERY == 0).collect();
    gaussians.retain(&kept);
    let nearest = Nearest::new(gaussians.positions.iter().copied());
    let alone = |at: &[f32; 3]| nearest.find(*at, 2)[1].0.sqrt() > APART;
    let kept: Vec<bool> = gaussians.positions.iter().map(alone).collect();
    gaussians.retain(&kept);
    gaussians.extra.clear();
    gaussians
}

fn transformed(from: &Path, to: &Path, options: &[&str]) {
    let output = Command::new("splat-transform")
        .args(["-q", "-w", "-g", "cpu"])
        .arg(from)
        .arg(to)
        .args(options)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

fn has_splat_transform(test: &str) -> bool {
    let found = Command::new("splat-transform").arg("--version").output().is_ok();
    if !found {
        skipped(test, "no splat-transform; `npm install --global @playcanvas/splat-transform` brings it");
    }
    found
}

fn read(path: &Path) -> Gaussians {
    let bytes = std::fs::read(path).unwrap();
    let loaded = match path.extension().unwrap().to_str() {
        Some("splat") => splat::parse(&bytes).unwrap(),
        Some("ksplat") => ksplat::parse(&bytes).unwrap(),
        Some("spz") => spz::parse(&bytes).unwrap(),
        Some("sog") => sog::parse(&bytes).unwrap(),
        Some("json") => sog::read_folder(path).unwrap(),
        _ => ply::parse(&bytes).unwrap(),
    };
    loaded.gaussians
}

/// Both programs compute in 32 bits, in another order.
const SAME: [f32; 6] = [1e-5, 1e-4, 1e-5, 1e-4, 1e-4, 0.1];

/// Chunks of 256 Gaussians: 11 bits over a chunk that may span the sample (0.4), 11 bits over its log scales (8), a byte for
/// the opacity and for each colour (over SH_C0), 8 units of harmonics in a byte, 10 bits for each of three components.
const LIMITS_COMPRESSED: [f32; 6] = [2e-4, 4e-3, 4e-3, 2e-2, 2e-2, 0.5];
/// 12 fractional bits; 1/16 of a log scale; bytes for opacity, colour (over 0.15) and harmonics (5 bits for the first band, 4
/// for the others, of a range of 2, after rounding to 8); 9 bits for each of three components.
const LIMITS_SPZ: [f32; 6] = [1.3e-4, 3.2e-2, 4e-3, 1.4e-2, 6.7e-2, 0.5];
/// 16 bits over the logarithmic range; 256 log scales, colours and harmonics, found by clustering: a few steps of a byte over
/// their ranges (8, 4 and 2); a byte for the opacity; 8 bits, cut off, for each of three components of a rotation.
const LIMITS_SOG: [f32; 6] = [2e-5, 0.1, 4e-3, 0.05, 0.1, 1.6];

/// Limits follow from the bits of each format: position, log scale, opacity, colour, harmonics, degrees.
#[test]
fn splat_transform_writes_what_gprop_reads() {
    if !has_splat_transform("splat_transform_writes_what_gprop_reads") {
        return;
    }
    let original = sample();
    let folder = TempDir::new().unwrap();
    let [own, back] = ["own.ply", "back.ply"].map(|name| folder.path().join(name));
    ply::write(std::fs::File::create(&own).unwrap(), &original, &[]).unwrap();
    let formats: [(&str, &[&str], [f32; 6]); 6] = [
        ("copy.ply", &[], [0.0, 0.0, 0.0, 0.0, 0.0, 1e-6]),
        ("small.compressed.ply", &[], LIMITS_COMPRESSED),
        ("three.spz", &["--spz-version", "3"], LIMITS_SPZ),
        ("four.spz", &["--spz-version", "4"], LIMITS_SPZ),
        ("bundle.sog", &["-i", "2"], LIMITS_SOG),
        ("loose/meta.json", &["-i", "2"], LIMITS_SOG),
    ];
    for (name, options, limits) in formats {
        let file = folder.path().join(name);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        transformed(&own, &file, options);
        let found = read(&file);
        let lost = Differences::of(&found, &original);
        transformed(&file, &back, &[]);
        let readers = Differences::of(&read(&back), &found);
        println!("{name}: {} Gaussians\n  from the original {lost:?}\n  between the readers {readers:?}", found.len());
        assert!(lost.within(limits), "{name}: {lost:?}");
        assert!(readers.within(SAME), "{name}: {readers:?}");
    }
}

/// What splat-transform reads but does not write.
#[test]
fn splat_transform_reads_the_same_from_splat_and_ksplat() {
    if !has_splat_transform("splat_transform_reads_the_same_from_splat_and_ksplat") {
        return;
    }
    let folder = TempDir::new().unwrap();
    let rows = (0..64u8).flat_map(|i| {
        let place = [f32::from(i % 4), f32::from(i / 4 % 4), f32::from(i / 16)];
        splat_row(place, [0.1, 0.2, 0.3], [4 * i, 255 - i, 128, 2 * i + 1], [255 - i, 128 + i, 100, 90 + 2 * i])
    });
    let back = folder.path().join("back.ply");
    // splat-transform takes bytes 0 to 255 of a .splat's quaternion for -1 to 1, gprop and the format's first reader 128 for 0.
    let half_a_byte = [&SAME[..5], &[1.0]].concat().try_into().unwrap();
    for (name, bytes, limits) in
        [("a.splat", rows.collect::<Vec<u8>>(), half_a_byte), ("b.ksplat", ksplat_file(1, 1), SAME)]
    {
        let file = folder.path().join(name);
        std::fs::write(&file, bytes).unwrap();
        transformed(&file, &back, &[]);
        let readers = Differences::of(&read(&back), &read(&file));
        println!("{name}: between the readers {readers:?}");
        assert!(readers.within(limits), "{name}: {readers:?}");
    }
}
