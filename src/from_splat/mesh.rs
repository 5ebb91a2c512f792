//! Views of a mesh: its surface with its textures in simple light, as a photo over a transparent background.

use image::{Rgba, RgbaImage};

use crate::camera::Camera;
use crate::numeric::srgb;
use crate::render::triangles::{SurfacePicture, SurfacePoint, draw};
use crate::scene::mesh::PaintedMesh;

/// Light that comes from all sides, and light from the camera onto a surface that faces it. Together they stay below one, so
/// that a white object stands out before white, and none is so dark at its rim that its colour is lost.
const AMBIENT: f32 = 0.45;
const FROM_CAMERA: f32 = 0.5;

/// The mesh as `camera` sees it: straight alpha, which is the share of the pixel that it covers, and sRGB colours.
pub(super) fn picture(mesh: &PaintedMesh, camera: &Camera) -> RgbaImage {
    let eye = camera.center_in_world();
    let lit = |point: &SurfacePoint, area: f64| {
        let towards_eye = (eye - mesh.position(point)).try_normalize(0.0).unwrap_or_default();
        // Whichever side of the surface is seen.
        let facing = mesh.normal(point).dot(&towards_eye).abs() as f32;
        mesh.color(point, area).map(|channel| channel * (AMBIENT + FROM_CAMERA * facing))
    };
    straight(&draw(mesh.surface(), camera, |point| mesh.is_there(point), lit))
}

/// Bytes with straight alpha; white where nothing is.
fn straight(picture: &SurfacePicture) -> RgbaImage {
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
    RgbaImage::from_fn(picture.width, picture.height, |x, y| {
        let pixel = (y * picture.width + x) as usize;
        let coverage = picture.coverage[pixel];
        let [r, g, b] = picture.rgb[pixel].map(|sum| if coverage > 0.0 { byte(srgb(sum / coverage)) } else { 255 });
        Rgba([r, g, b, byte(coverage)])
    })
}
