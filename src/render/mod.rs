//! A splat rasteriser for the CPU: 3D Gaussian Splatting's image formation (Kerbl et al. 2023), tile by tile.
//!
//! In order: `project` turns Gaussians into 2D splats, `tiles` sorts them front to back and bins them,
//! `blend` passes the weight of every splat on every pixel to a [`Sink`]: `color` sums colour, alpha and depth,
//! `labels` finds the label that owns a pixel, [`contributions`](fn@contributions) the contribution of each Gaussian
//! to the pixels of each label, [`depth_test`] the surface and the Gaussians on it; `foregrounds` finds the pixels
//! that show an object. `sh` and [`sh_rotation`] evaluate and rotate spherical harmonics. [`triangles`] draws meshes.
//! The same input gives the same bytes on any number of threads: every sum belongs to one tile, and a tile is always
//! blended in the same order.

mod blend;
mod color;
mod contributions;
pub mod depth_test;
mod foregrounds;
mod labels;
mod project;
mod sh;
pub mod sh_rotation;
mod tiles;
pub mod triangles;

use image::{Rgba, RgbaImage};

use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::parallel;
pub use blend::{ALPHA_MAX, LANES, Sink, TRANSMITTANCE_MIN, TileRect};
use color::ColorSink;
pub use contributions::contributions;
pub use foregrounds::{close_holes, render_foregrounds};
use labels::LabelingsSink;
use project::Projector;
pub use project::{ALPHA_MIN, LOW_PASS_PX2, SURFACE_DEVIATIONS, Splat};
pub use sh::{basis as sh_basis, color as sh_color};
pub use tiles::TILE;
use tiles::Tiles;

/// Depth in scene units below which a Gaussian is not drawn, since perspective is meaningless for something that
/// touches the lens. This is the value that gsplat uses.
pub const NEAR: f64 = 0.01;

/// A pixel shows the object if at least this share of its light comes from Gaussians.
pub const FOREGROUND_ALPHA: f32 = 0.5;

/// The colour of each Gaussian.
#[derive(Debug, Clone, Copy, Default)]
pub enum Colors<'a> {
    /// Its spherical harmonics, seen from the camera.
    #[default]
    Sh,
    /// One colour per Gaussian, the same from every side, for materials, confidence or other values.
    Fixed(&'a [[f32; 3]]),
}

/// Options of rendering.
#[derive(Debug, Clone, Copy)]
pub struct RenderOptions<'a> {
    pub colors: Colors<'a>,
    /// Depth in scene units below which nothing is drawn.
    pub near: f64,
}

impl Default for RenderOptions<'_> {
    fn default() -> Self {
        Self { colors: Colors::Sh, near: NEAR }
    }
}

/// A picture of the cloud. Every plane holds `width * height` values, row by row from the upper left corner.
#[derive(Debug, Clone, PartialEq)]
pub struct Render {
    pub width: u32,
    pub height: u32,
    /// Premultiplied: what the Gaussians add to the light of the pixel.
    pub rgb: Vec<[f32; 3]>,
    /// Share of the pixel's light that comes from Gaussians, 0 to 1.
    pub alpha: Vec<f32>,
    /// Mean planar depth of the surfaces that light comes from, in scene units; infinite where there is none.
    pub expected_depth: Vec<f32>,
    /// Planar depth, in scene units, of the surface at which half of the pixel's light is reached; infinite where alpha
    /// stays below one half.
    pub median_depth: Vec<f32>,
}

impl Render {
    /// The picture over a background of one colour (RGB, 0 to 1), opaque.
    pub fn to_image(&self, background: [f32; 3]) -> RgbaImage {
        RgbaImage::from_fn(self.width, self.height, |x, y| {
            let pixel = (y * self.width + x) as usize;
            let rest = 1.0 - self.alpha[pixel];
            let [r, g, b] = std::array::from_fn(|c| to_byte(self.rgb[pixel][c] + rest * background[c]));
            Rgba([r, g, b, 255])
        })
    }
}

fn to_byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// Draws the cloud as `camera` sees it.
pub fn render(gaussians: &Gaussians, camera: &Camera, options: &RenderOptions) -> Render {
    let seen_from_camera;
    let colors: &[[f32; 3]] = match options.colors {
        Colors::Fixed(colors) => colors,
        Colors::Sh => {
            seen_from_camera = sh_colors(gaussians, camera);
            &seen_from_camera
        }
    };
    Projected::new(gaussians, camera, options).draw(colors)
}

/// The label with the largest blend weight on every pixel, row by row; `None` where alpha is below
/// [`FOREGROUND_ALPHA`]. `labels[i]` is the label of Gaussian `i`.
pub fn render_labels(
    gaussians: &Gaussians,
    camera: &Camera,
    labels: &[u32],
    options: &RenderOptions,
) -> Vec<Option<u32>> {
    render_labelings(gaussians, camera, &[labels], options).remove(0)
}

/// As [`render_labels`], for several ways to label the same Gaussians; they are blended once.
pub fn render_labelings(
    gaussians: &Gaussians,
    camera: &Camera,
    labelings: &[&[u32]],
    options: &RenderOptions,
) -> Vec<Vec<Option<u32>>> {
    let (width, height) = size(camera);
    let mut images = vec![vec![None; width * height]; labelings.len()];
    Projected::new(gaussians, camera, options).visit_in_bands(
        |rect| LabelingsSink::new(rect, labelings),
        |tile| {
            for (image, sink) in images.iter_mut().zip(&tile.sinks) {
                for (inside, outside) in pixels(tile.rect, width) {
                    let (label, alpha) = sink.winner(inside);
                    image[outside] = label.filter(|_| alpha >= FOREGROUND_ALPHA);
                }
            }
        },
    );
    images
}

/// Passes the blend weights of every tile to its own sink, front to back, with tiles processed in parallel. The sinks
/// are returned in the order of the tiles, row by row.
pub fn visit<S: Sink>(
    gaussians: &Gaussians,
    camera: &Camera,
    options: &RenderOptions,
    new_sink: impl Fn(TileRect) -> S + Sync,
) -> Vec<(TileRect, S)> {
    Projected::new(gaussians, camera, options).visit(new_sink)
}

/// The splats of all Gaussians in the picture, in the order of the Gaussians.
pub fn project(gaussians: &Gaussians, camera: &Camera, options: &RenderOptions) -> Vec<Splat> {
    Projector::new(camera, options.near, gaussians.antialiased).splats(gaussians)
}

/// The cloud as one camera sees it, ready to be blended any number of times.
pub struct Projected {
    width: usize,
    height: usize,
    tiles: Tiles,
}

impl Projected {
    pub fn new(gaussians: &Gaussians, camera: &Camera, options: &RenderOptions) -> Self {
        let (width, height) = size(camera);
        Self { width, height, tiles: Tiles::new(width, height, project(gaussians, camera, options)) }
    }

    /// Width and height of the picture.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The splats in the picture, front to back.
    pub fn splats(&self) -> &[Splat] {
        &self.tiles.splats
    }

    /// The picture with a colour for each Gaussian.
    pub fn draw(&self, colors: &[[f32; 3]]) -> Render {
        assemble(self.size(), &self.visit(|rect| ColorSink::new(rect, colors)))
    }

    /// As [`visit`].
    pub fn visit<S: Sink>(&self, new_sink: impl Fn(TileRect) -> S + Sync) -> Vec<(TileRect, S)> {
        blend::blend(&self.tiles, 0..self.tiles.rows, self.size(), new_sink)
    }

    /// As [`visit`], a few rows of tiles at a time: `take` receives their sinks before the next rows are blended.
    pub fn visit_in_bands<S: Sink>(&self, new_sink: impl Fn(TileRect) -> S + Sync, mut take: impl FnMut(S)) {
        /// Rows of tiles blended together: enough tiles for many threads.
        const BAND: usize = 8;
        for first in (0..self.tiles.rows).step_by(BAND) {
            let rows = first..self.tiles.rows.min(first + BAND);
            blend::blend(&self.tiles, rows, self.size(), &new_sink).into_iter().for_each(|(_, sink)| take(sink));
        }
    }
}

/// For each pixel of a tile, its index within the tile and within a picture of the given width.
pub fn pixels(rect: TileRect, width: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..rect.height).flat_map(move |y| (0..rect.width).map(move |x| (y * TILE + x, (rect.y + y) * width + rect.x + x)))
}

fn size(camera: &Camera) -> (usize, usize) {
    (camera.intrinsics.width as usize, camera.intrinsics.height as usize)
}

fn sh_colors(gaussians: &Gaussians, camera: &Camera) -> Vec<[f32; 3]> {
    let eye = camera.center_in_world();
    let color = |i| {
        let direction = (gaussians.center(i) - eye).try_normalize(0.0).unwrap_or_default();
        sh_color(gaussians, i, direction.map(|v| v as f32).into())
    };
    parallel::map_range(gaussians.len(), color)
}

fn assemble((width, height): (usize, usize), tiles: &[(TileRect, ColorSink)]) -> Render {
    let mut render = Render {
        width: width as u32,
        height: height as u32,
        rgb: vec![[0.0; 3]; width * height],
        alpha: vec![0.0; width * height],
        expected_depth: vec![f32::INFINITY; width * height],
        median_depth: vec![f32::INFINITY; width * height],
    };
    for (rect, sink) in tiles {
        for (inside, outside) in pixels(*rect, width) {
            let alpha = sink.alpha[inside];
            render.rgb[outside] = std::array::from_fn(|c| sink.rgb[c][inside]);
            render.alpha[outside] = alpha;
            if alpha > 0.0 {
                render.expected_depth[outside] = sink.weighted_depth[inside] / alpha;
            }
            render.median_depth[outside] = sink.median_depth[inside];
        }
    }
    render
}
