//! Clouds and cameras built in code.

use gprop::camera::{Camera, Distortion, Intrinsics};
use gprop::gaussians::Gaussians;
use gprop::materials::MaterialLibrary;
use gprop::query::Answer;
use nalgebra::{Isometry3, Point3, Vector3};

use crate::support::changed;

/// A camera at the origin that looks along +z; 64 x 48 px, focal length 50 px, principal point in the middle.
pub fn camera() -> Camera {
    let intrinsics =
        Intrinsics { width: 64, height: 48, fx: 50.0, fy: 50.0, cx: 32.0, cy: 24.0, distortion: Distortion::default() };
    Camera { intrinsics, camera_from_world: Isometry3::identity() }
}

/// [`camera`] at `eye`, looking at `target`, world up +z.
pub fn camera_at(eye: [f64; 3], target: [f64; 3]) -> Camera {
    // nalgebra's right-handed look_at gives x right, y up, z backward; half a turn about x makes it OpenCV's.
    let view = Isometry3::look_at_rh(&Point3::from(eye), &Point3::from(target), &Vector3::z());
    let flip = Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
    Camera { camera_from_world: flip * view, ..camera() }
}

/// One Gaussian of a built cloud.
#[derive(Clone, Copy)]
pub struct Blob {
    pub position: [f32; 3],
    /// Standard deviations, scene units.
    pub scale: [f32; 3],
    /// w x y z.
    pub rotation: [f32; 4],
    pub opacity: f32,
    /// RGB, 0 to 1, from every side.
    pub color: [f32; 3],
}

impl Blob {
    /// A round grey Gaussian.
    pub fn round(position: [f32; 3], deviation: f32, opacity: f32) -> Self {
        Self { position, scale: [deviation; 3], rotation: [1.0, 0.0, 0.0, 0.0], opacity, color: [0.5; 3] }
    }
}

/// The cloud of `blobs`, SH degree 0.
pub fn cloud(blobs: &[Blob]) -> Gaussians {
    let mut cloud = Gaussians::default();
    for blob in blobs {
        cloud.positions.push(blob.position);
        cloud.log_scales.push(blob.scale.map(f32::ln));
        cloud.rotations.push(blob.rotation);
        cloud.opacity_logits.push((blob.opacity / (1.0 - blob.opacity)).ln());
        cloud.sh_dc.push(blob.color.map(|c| (c - 0.5) / gprop::gaussians::SH_C0));
    }
    cloud
}

/// Pseudo-random numbers in 0..1, the same on every machine (SplitMix64).
pub struct Noise(pub u64);

impl Noise {
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32
    }

    pub fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }
}

/// A jumble of `count` long, flat and round Gaussians of SH degree 3 in front of [`camera`], some outside its picture,
/// some behind it.
pub fn jumble(count: usize, seed: u64) -> Gaussians {
    let mut noise = Noise(seed);
    let mut blobs = Vec::new();
    for _ in 0..count {
        blobs.push(Blob {
            position: [noise.within(-2.0, 2.0), noise.within(-1.5, 1.5), noise.within(-0.5, 4.0)],
            scale: std::array::from_fn(|_| noise.within(-5.0, -1.5).exp()),
            rotation: std::array::from_fn(|_| noise.within(-1.0, 1.0)),
            opacity: noise.within(0.02, 0.98),
            color: std::array::from_fn(|_| noise.next()),
        });
    }
    let mut gaussians = cloud(&blobs);
    gaussians.sh_degree = 3;
    gaussians.sh_rest = (0..count * 45).map(|_| noise.within(-0.2, 0.2)).collect();
    gaussians
}

/// The answer "`name` is made of the library's row number `row`".
pub fn answer(name: &str, row: usize) -> Answer {
    let material = &MaterialLibrary::builtin().materials()[row];
    changed(Answer::of(material), |answer| answer.caption = name.to_owned())
}
