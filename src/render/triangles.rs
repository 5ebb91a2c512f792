//! A rasteriser for surfaces of triangles: which of them a camera sees, where, and how far away.
//!
//! Every pixel has [`SAMPLES`] x [`SAMPLES`] samples. What covers a sample is decided exactly, by the triangle's edges and the
//! perspective depth of its plane, so that a pixel's coverage is a count of samples, and the depth at its centre, which is a
//! sample, that of the surface. Both sides of a triangle are drawn.
//!
//! 1. The corners are projected; triangles are listed by the bands of pixel rows that they touch.
//! 2. Each band is drawn by itself, triangles in their order, into a depth buffer of its own; of two at the same depth, the
//!    first stays. So the result does not depend on the number of threads.
//! 3. Each triangle in a pixel is shaded once, in the middle of its samples there, and counts by their number.

use nalgebra::Point3;

use super::NEAR;
use crate::camera::Camera;
use crate::numeric::lists::Lists;
use crate::parallel;

/// Samples along each side of a pixel: an odd number, so that one of them is its centre.
pub const SAMPLES: usize = 3;
/// Pixel rows of a band: its depth buffer, at a thousand pixels of width, fits a core's cache.
const BAND_ROWS: usize = 8;
/// Stands for no triangle.
const NOTHING: u32 = u32::MAX;

/// A surface as it is drawn.
#[derive(Clone, Copy)]
pub struct Surface<'a> {
    /// Positions in the world frame, scene units.
    pub vertices: &'a [[f64; 3]],
    /// Three indices of `vertices` each.
    pub triangles: &'a [[u32; 3]],
}

/// A point of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Index of the triangle.
    pub triangle: u32,
    /// The shares of its three corners, which sum to one.
    pub barycentric: [f64; 3],
}

/// A picture of a surface. Every plane holds `width * height` values, row by row from the upper left corner.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfacePicture {
    pub width: u32,
    pub height: u32,
    /// Premultiplied: the sum of the samples' colours, by the number of all samples.
    pub rgb: Vec<[f32; 3]>,
    /// Share of the pixel's samples that the surface covers.
    pub coverage: Vec<f32>,
    /// Planar depth of the surface at the pixel's centre, scene units; infinite where there is none.
    pub depth: Vec<f32>,
}

/// Draws the surface as `camera` sees it, which must have no lens distortion. `is_there` tells whether there is surface at a
/// point (a texture may cut holes), `color` its linear colour, given the area of its triangle in pixels. A triangle that reaches
/// nearer to the camera than [`NEAR`] is left out.
pub fn draw(
    surface: Surface<'_>,
    camera: &Camera,
    is_there: impl Fn(&SurfacePoint) -> bool + Sync,
    color: impl Fn(&SurfacePoint, f64) -> [f32; 3] + Sync,
) -> SurfacePicture {
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let corners: Vec<Corner> = parallel::map(surface.vertices, |vertex| Corner::new(*vertex, camera));
    let bands = by_band(surface.triangles, &corners, height);
    let mut picture = SurfacePicture {
        width: width as u32,
        height: height as u32,
        rgb: vec![[0.0; 3]; width * height],
        coverage: vec![0.0; width * height],
        depth: vec![f32::INFINITY; width * height],
    };
    let pixels = BAND_ROWS * width;
    let (rgb, coverage) = (picture.rgb.chunks_mut(pixels), picture.coverage.chunks_mut(pixels));
    let mut rows: Vec<_> = rgb.zip(coverage).zip(picture.depth.chunks_mut(pixels)).collect();
    parallel::for_each_mut(&mut rows, |index, ((rgb, coverage), depth)| {
        let mut band = Band::new(index * BAND_ROWS, rgb.len() / width.max(1), width);
        for triangle in bands.of(index) {
            let corners = surface.triangles[*triangle as usize].map(|corner| corners[corner as usize]);
            if let Some(flat) = Flat::new(*triangle, corners) {
                band.cover(&flat, &is_there);
            }
        }
        for (pixel, ((rgb, coverage), depth)) in
            rgb.iter_mut().zip(coverage.iter_mut()).zip(depth.iter_mut()).enumerate()
        {
            let mut covered = 0;
            for seen in band.seen_in(pixel) {
                let corners = surface.triangles[seen.triangle as usize].map(|corner| corners[corner as usize]);
                let Some(flat) = Flat::new(seen.triangle, corners) else { continue };
                let (x, y) = seen.middle();
                let shade = color(&flat.point(x, y), flat.area());
                *rgb = std::array::from_fn(|channel| rgb[channel] + seen.samples as f32 * shade[channel]);
                covered += seen.samples;
                if let Some((x, y)) = seen.center {
                    *depth = (1.0 / flat.at(x, y).1) as f32;
                }
            }
            const ALL: f32 = (SAMPLES * SAMPLES) as f32;
            *rgb = rgb.map(|sum| sum / ALL);
            *coverage = covered as f32 / ALL;
        }
    });
    picture
}

/// A vertex in the picture.
#[derive(Clone, Copy)]
struct Corner {
    /// In pixels from the upper left corner.
    x: f64,
    y: f64,
    /// One over its depth; not positive if it is not drawn.
    inverse_depth: f64,
}

impl Corner {
    fn new(vertex: [f64; 3], camera: &Camera) -> Self {
        let point = camera.point_in_camera(Point3::from(vertex));
        if point.z < NEAR {
            return Self { x: 0.0, y: 0.0, inverse_depth: 0.0 };
        }
        let lens = &camera.intrinsics;
        Self {
            x: lens.fx * point.x / point.z + lens.cx,
            y: lens.fy * point.y / point.z + lens.cy,
            inverse_depth: 1.0 / point.z,
        }
    }
}

/// A triangle in the picture.
struct Flat {
    index: u32,
    corners: [Corner; 3],
    /// One over twice its signed area in pixels.
    inverse_double_area: f64,
}

impl Flat {
    /// `None` if nothing of it can be drawn.
    fn new(index: u32, corners: [Corner; 3]) -> Option<Self> {
        let [a, b, c] = corners;
        let double_area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        let is_seen = corners.iter().all(|corner| corner.inverse_depth > 0.0) && double_area != 0.0;
        is_seen.then_some(Self { index, corners, inverse_double_area: 1.0 / double_area })
    }

    /// Its area in pixels.
    fn area(&self) -> f64 {
        (0.5 / self.inverse_double_area).abs()
    }

    /// The weights of the corners in the picture at this place, which sum to one and of which none is negative inside, and
    /// one over the depth there, which is linear in the picture.
    fn at(&self, x: f64, y: f64) -> ([f64; 3], f64) {
        self.row(y).at(x)
    }

    fn row(&self, y: f64) -> FlatRow<'_> {
        let [a, b, c] = &self.corners;
        let edge = |from: &Corner, to: &Corner| RowEdge {
            start_x: from.x,
            start: (to.x - from.x) * (y - from.y),
            slope: to.y - from.y,
        };
        FlatRow { flat: self, edges: [edge(b, c), edge(c, a), edge(a, b)] }
    }

    /// The point of the surface that is seen there: its shares follow from the weights in the picture by perspective.
    fn point(&self, x: f64, y: f64) -> SurfacePoint {
        let (weights, inverse_depth) = self.at(x, y);
        let share = |corner: usize| weights[corner] * self.corners[corner].inverse_depth / inverse_depth;
        SurfacePoint { triangle: self.index, barycentric: [share(0), share(1), share(2)] }
    }
}

/// A triangle along a row of the picture.
struct FlatRow<'a> {
    flat: &'a Flat,
    /// Those opposite of the corners.
    edges: [RowEdge; 3],
}

/// Twice the signed area between an edge and a point of the row at x: `start - slope * (x - start_x)`.
struct RowEdge {
    start_x: f64,
    start: f64,
    slope: f64,
}

impl FlatRow<'_> {
    fn at(&self, x: f64) -> ([f64; 3], f64) {
        let weight = |edge: &RowEdge| (edge.start - edge.slope * (x - edge.start_x)) * self.flat.inverse_double_area;
        let weights = [weight(&self.edges[0]), weight(&self.edges[1]), weight(&self.edges[2])];
        let inverse_depth =
            weights.iter().zip(&self.flat.corners).map(|(weight, corner)| weight * corner.inverse_depth).sum();
        (weights, inverse_depth)
    }

    /// Where along the row no weight is negative, up to rounding.
    fn inside(&self) -> [f64; 2] {
        let mut inside = [f64::NEG_INFINITY, f64::INFINITY];
        for edge in &self.edges {
            let root = edge.start_x + edge.start / edge.slope;
            match edge.slope * self.flat.inverse_double_area {
                falling if falling > 0.0 => inside[1] = inside[1].min(root),
                falling if falling < 0.0 => inside[0] = inside[0].max(root),
                _ => {}
            }
        }
        inside
    }
}

/// The triangles that touch each band, in their order.
fn by_band(triangles: &[[u32; 3]], corners: &[Corner], height: usize) -> Lists {
    let count = height.div_ceil(BAND_ROWS);
    let touched = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|corner| corners[corner as usize]);
        let (low, high) = (a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y));
        let is_seen = [a, b, c].iter().all(|corner| corner.inverse_depth > 0.0) && high >= 0.0 && low < height as f64;
        if !is_seen {
            return 0..0;
        }
        let band = |y: f64| (y.clamp(0.0, height as f64 - 1.0) as usize) / BAND_ROWS;
        band(low)..(band(high) + 1).min(count)
    };
    Lists::new(count, |visit| {
        for (index, triangle) in triangles.iter().enumerate() {
            touched(triangle).for_each(|band| visit(band, index as u32));
        }
    })
}

/// The samples of some rows of pixels, row by row.
struct Band {
    first_row: usize,
    rows: usize,
    width: usize,
    triangles: Vec<u32>,
    /// One over the depth of what covers the sample; 0 if nothing does.
    inverse_depths: Vec<f32>,
}

impl Band {
    fn new(first_row: usize, rows: usize, width: usize) -> Self {
        let samples = rows * width * SAMPLES * SAMPLES;
        Self { first_row, rows, width, triangles: vec![NOTHING; samples], inverse_depths: vec![0.0; samples] }
    }

    /// Enters the triangle wherever it is nearer than what is there.
    fn cover(&mut self, flat: &Flat, is_there: &impl Fn(&SurfacePoint) -> bool) {
        let across = self.width * SAMPLES;
        let [a, b, c] = &flat.corners;
        let columns = samples_between([a.x, b.x, c.x], 0, across);
        let rows = samples_between([a.y, b.y, c.y], self.first_row * SAMPLES, self.rows * SAMPLES);
        for row in rows {
            let y = place(self.first_row * SAMPLES + row);
            let flat_row = flat.row(y);
            // What rounding may hide lies within a sample of the roots.
            let [low, high] = flat_row.inside().map(|x| (x * SAMPLES as f64).clamp(0.0, across as f64));
            let first = columns.start.max((low as usize).saturating_sub(2));
            for column in first..columns.end.min(high as usize + 2) {
                let x = place(column);
                let (weights, inverse_depth) = flat_row.at(x);
                let sample = row * across + column;
                let is_inside = weights.iter().all(|weight| *weight >= 0.0);
                if is_inside && inverse_depth as f32 > self.inverse_depths[sample] && is_there(&flat.point(x, y)) {
                    self.inverse_depths[sample] = inverse_depth as f32;
                    self.triangles[sample] = flat.index;
                }
            }
        }
    }

    /// The triangles in a pixel, each with its samples. `pixel` counts from the band's first.
    fn seen_in(&self, pixel: usize) -> impl Iterator<Item = Seen> + use<> {
        let (row, column) = (pixel / self.width, pixel % self.width);
        let mut seen: [Seen; SAMPLES * SAMPLES] = Default::default();
        let mut count = 0;
        for sample in 0..SAMPLES * SAMPLES {
            let (row, column) = (row * SAMPLES + sample / SAMPLES, column * SAMPLES + sample % SAMPLES);
            let triangle = self.triangles[row * self.width * SAMPLES + column];
            if triangle == NOTHING {
                continue;
            }
            let known = seen[..count].iter().position(|seen| seen.triangle == triangle);
            let place = (place(column), place(self.first_row * SAMPLES + row));
            seen[known.unwrap_or(count)].add(triangle, place, sample == SAMPLES * SAMPLES / 2);
            count += usize::from(known.is_none());
        }
        seen.into_iter().take(count)
    }
}

/// A triangle in a pixel.
#[derive(Clone, Copy, Default)]
struct Seen {
    triangle: u32,
    /// Number of its samples, and the sum of their places.
    samples: usize,
    sum: (f64, f64),
    /// The pixel's centre, if it is one of them.
    center: Option<(f64, f64)>,
}

impl Seen {
    fn add(&mut self, triangle: u32, place: (f64, f64), is_center: bool) {
        self.triangle = triangle;
        self.samples += 1;
        self.sum = (self.sum.0 + place.0, self.sum.1 + place.1);
        if is_center {
            self.center = Some(place);
        }
    }

    /// The mean of its samples, which lies in the triangle, too.
    fn middle(&self) -> (f64, f64) {
        (self.sum.0 / self.samples as f64, self.sum.1 / self.samples as f64)
    }
}

/// The middle of a sample, in pixels.
fn place(sample: usize) -> f64 {
    (sample as f64 + 0.5) / SAMPLES as f64
}

/// Which of the samples `first..first + count` may lie between the least and the greatest of these places, counted from `first`.
fn samples_between([a, b, c]: [f64; 3], first: usize, count: usize) -> std::ops::Range<usize> {
    let sample = |place: f64| (place * SAMPLES as f64 - first as f64).clamp(0.0, count as f64);
    let (low, high) = (sample(a.min(b).min(c)), sample(a.max(b).max(c)));
    low.floor() as usize..(high.ceil() as usize).min(count)
}
