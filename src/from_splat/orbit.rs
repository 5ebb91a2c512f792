//! Views rendered from the splat or the mesh, for scenes without photos: cameras spread over the sphere around the object.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{Rgba, RgbaImage};
use nalgebra::{Isometry3, Point3, Vector3};

use super::mesh;
use crate::camera::{Camera, Distortion, Intrinsics};
use crate::files::json;
use crate::files::write::Folder;
use crate::numeric::{sphere_directions, upper_median};
use crate::render::{NEAR, Render, RenderOptions, render};
use crate::scene::{Scene, Upright, View};
use crate::words::output::{agreeing, counted};
use crate::workdir::{Checksum, read_json};

/// Side of the pictures of a splat in pixels.
const SIDE: u32 = 768;
/// Side of those of a mesh: SAM sees as many, and a mesh's textures are as sharp.
const MESH_SIDE: u32 = 1024;
/// Field of view in radians: little perspective, as in product photos.
const FIELD_OF_VIEW: f64 = 0.7;
/// The file with the checksums of the pictures in a folder, by name.
const CHECKSUMS: &str = "checksums.json";
/// Distance of the camera from the object's bounding sphere, at least, in scene units: what is nearer than [`NEAR`] is not
/// drawn. A smaller object is seen through a longer lens.
const CLEARANCE: f64 = 2.0 * NEAR;
/// Share of the picture's height that the object's bounding sphere fills.
const FILLED: f64 = 0.9;

/// Gives the scene `count` views of the object from directions spread evenly over the sphere, each a picture with alpha
/// in `folder`, which must be used for this splat or mesh and this count only: a picture that is already there unchanged is not
/// rendered again.
///
/// # Errors
/// If a picture cannot be written, or if one must be written but there is no folder to write it into.
pub fn render_views(scene: &mut Scene, count: usize, folder: &Path, write_to: Option<&Folder>) -> io::Result<()> {
    let side = if scene.mesh.is_some() { MESH_SIDE } else { SIDE };
    let (center, radius) = match &scene.mesh {
        Some(mesh) => mesh.bounding_sphere(),
        None => {
            let bounds = scene.object_bounds();
            (bounds.center(), 0.5 * bounds.diagonal() + reach(scene))
        }
    };
    let cameras = orbit(center, radius, count, side);
    let list = folder.join(CHECKSUMS);
    let written: BTreeMap<String, Checksum> = read_json(&list).unwrap_or_default();
    let mut found = BTreeMap::new();
    for (index, camera) in cameras.into_iter().enumerate() {
        let name = format!("{index:03}");
        let image = folder.join(format!("{name}.png"));
        // A link may lead to a picture of something else.
        let is_link = image.is_symlink();
        let checksum = match Checksum::of_file(&image).ok() {
            Some(there) if !is_link && written.get(&name) == Some(&there) => there,
            there => {
                if there.is_some() && written.contains_key(&name) {
                    tracing::warn!("{image:?} has changed since gprop wrote it; it is rendered again");
                }
                let Some(write_to) = write_to else {
                    return Err(io::Error::other(format!(
                        "{name}.png has to be rendered, but the folder is read-only"
                    )));
                };
                render_into(write_to, &image, &drawn(scene, &camera))?
            }
        };
        found.insert(name.clone(), checksum);
        scene.views.push(View { name, camera, image, upright: Upright::AsStored, mask: None });
    }
    if found != written {
        let write_to = write_to.ok_or_else(|| io::Error::from(io::ErrorKind::ReadOnlyFilesystem))?;
        write_to.write(Path::new(CHECKSUMS), |out| out.write_all(json::compact(&found)?.as_bytes()))?;
    }
    let (views, verb) = (counted(count, "view"), agreeing(count, "was", "were"));
    match scene.mesh {
        Some(_) => scene.notes.push(format!("{views} of the mesh {verb} drawn")),
        None => scene.warnings.push(format!("there are no photos: {views} {verb} rendered from the splat itself")),
    }
    Ok(())
}

/// The object as the camera sees it, with alpha.
fn drawn(scene: &Scene, camera: &Camera) -> RgbaImage {
    match &scene.mesh {
        Some(mesh) => mesh::picture(&mesh.painted, camera),
        None => straight(&render(&scene.gaussians, camera, &RenderOptions::default())),
    }
}

/// Writes the picture into its folder and returns the checksum of its file.
fn render_into(folder: &Folder, image: &Path, picture: &RgbaImage) -> io::Result<Checksum> {
    let name = Path::new(image.file_name().expect("a picture has a name"));
    folder.write(name, |out| picture.write_with_encoder(PngEncoder::new(out)).map_err(io::Error::other))?;
    Checksum::of_file(image)
}

/// The extent of the object's Gaussians beyond their centres: twice their typical standard deviation.
fn reach(scene: &Scene) -> f64 {
    let deviations = (0..scene.gaussians.len()).map(|i| scene.gaussians.scale(i).max()).collect();
    2.0 * upper_median(deviations).unwrap_or_default()
}

/// Cameras that look at a sphere from all around, near enough for it to fill the picture, which has `side` pixels on each side.
pub fn orbit(center: Point3<f64>, radius: f64, count: usize, side: u32) -> Vec<Camera> {
    let usual = radius / (FILLED * (0.5 * FIELD_OF_VIEW).sin());
    let least = radius + CLEARANCE;
    let (distance, half_angle) =
        if usual >= least { (usual, 0.5 * FIELD_OF_VIEW) } else { (least, (radius / (FILLED * least)).asin()) };
    let middle = 0.5 * f64::from(side);
    let focal = middle / half_angle.tan();
    let (width, height) = (side, side);
    let distortion = Distortion::None;
    let intrinsics = Intrinsics { width, height, fx: focal, fy: focal, cx: middle, cy: middle, distortion };
    let camera = |direction: Vector3<f64>| {
        let eye = center + direction * distance;
        Camera { intrinsics, camera_from_world: looking(&eye, &center) }
    };
    sphere_directions(count).map(camera).collect()
}

/// A camera at `eye` that looks at `target`; its up direction is the world's z, or y if it looks nearly along z.
fn looking(eye: &Point3<f64>, target: &Point3<f64>) -> Isometry3<f64> {
    let forward = target - eye;
    let up = if forward.z.abs() > 0.95 * forward.norm() { Vector3::y() } else { Vector3::z() };
    // `face_towards` returns z forward and y towards `up`; OpenCV's y points down.
    Isometry3::face_towards(eye, target, &-up).inverse()
}

/// Straight alpha from the rasteriser's premultiplied colours.
fn straight(render: &Render) -> RgbaImage {
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
    RgbaImage::from_fn(render.width, render.height, |x, y| {
        let pixel = (y * render.width + x) as usize;
        let alpha = render.alpha[pixel];
        let [r, g, b] = render.rgb[pixel].map(|value| if alpha > 0.0 { byte(value / alpha) } else { 255 });
        Rgba([r, g, b, byte(alpha)])
    })
}
