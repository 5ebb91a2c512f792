//! The depth of the surface at each pixel, derived from the Gaussians.
//!
//! A splat is soft: Gaussians have their centres below the surface and let light through. The surface is taken to be
//! where half of a pixel's light is absorbed, [`SURFACE_DEVIATIONS`](crate::render::SURFACE_DEVIATIONS) in front of the
//! centre of the Gaussian that absorbs it. On held-out views of the four scenes with ground truth its median error is
//! within 0.6 mm in either direction; half of the pixels are within 0.5 mm (hammer) to 2.5 mm (chair).

use crate::camera::{Camera, Intrinsics};
use crate::gaussians::Gaussians;
use crate::render::{LANES, RenderOptions, Sink, Splat, TILE, TileRect, close_holes, pixels, visit};

/// The surface is where this share of the light is absorbed.
const GONE: f32 = 0.5;

/// The alpha and depth that one view sees: planes of its camera's `width * height`, row by row.
pub struct DepthView {
    /// The camera of the rendered picture, which may be smaller than the photo.
    pub camera: Camera,
    /// Share of the pixel's light that comes from Gaussians, 0 to 1; at least a half in [highlights](close_holes).
    pub alpha: Vec<f32>,
    /// Planar depth of the surface, scene units; infinite where there is none.
    pub depth: Vec<f32>,
}

impl DepthView {
    /// The surface of the cloud as `camera` sees it, in a picture with at most `pixels_max` pixels along its longer
    /// side.
    pub fn of(gaussians: &Gaussians, camera: &Camera, pixels_max: u32) -> Self {
        let camera = Camera { intrinsics: reduced(&camera.intrinsics, pixels_max), ..camera.clone() };
        let width = camera.intrinsics.width as usize;
        let count = width * camera.intrinsics.height as usize;
        let (mut alpha, mut depth) = (vec![0.0; count], vec![f32::INFINITY; count]);
        for (rect, front) in visit(gaussians, &camera, &RenderOptions::default(), DepthSink::new) {
            for (inside, outside) in pixels(rect, width) {
                alpha[outside] = front.alpha[inside];
                depth[outside] = front.depth[inside];
            }
        }
        close_holes(&mut alpha, width);
        Self { camera, alpha, depth }
    }
}

/// The intrinsics of the same view with at most `pixels_max` pixels along its longer side.
fn reduced(intrinsics: &Intrinsics, pixels_max: u32) -> Intrinsics {
    let longest = intrinsics.width.max(intrinsics.height);
    if longest <= pixels_max {
        return *intrinsics;
    }
    let shrink = |side: u32| (f64::from(side) * f64::from(pixels_max) / f64::from(longest)).round().max(1.0) as u32;
    intrinsics.resized(shrink(intrinsics.width), shrink(intrinsics.height))
}

/// Collects one tile of the surface.
struct DepthSink {
    rect: TileRect,
    alpha: [f32; TILE * TILE],
    depth: [f32; TILE * TILE],
}

impl DepthSink {
    fn new(rect: TileRect) -> Self {
        Self { rect, alpha: [0.0; TILE * TILE], depth: [f32::INFINITY; TILE * TILE] }
    }
}

impl Sink for DepthSink {
    fn add(&mut self, splat: &Splat, first: usize, weights: &[f32; LANES], transmittance: &[f32; LANES]) {
        let [column, row] = [self.rect.x + first % TILE, self.rect.y + first / TILE];
        let surface = splat.surface_at([column as f32 + 0.5, row as f32 + 0.5]);
        for lane in 0..LANES {
            let (weight, after) = (weights[lane], transmittance[lane]);
            self.alpha[first + lane] += weight;
            if after < 1.0 - GONE && after + weight >= 1.0 - GONE {
                self.depth[first + lane] = surface + splat.depth_slope[0] * lane as f32;
            }
        }
    }
}
