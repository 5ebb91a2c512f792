//! The ground: a chequered plane that fades into the distance, with the object's shadow.

use nalgebra::{Point3, Vector3};

use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::parallel;
use crate::simulate::SimulationReport;

const BACKGROUND: [f32; 3] = [0.96, 0.96, 0.97];
const LIGHT_SQUARE: [f32; 3] = [0.86, 0.87, 0.88];
const DARK_SQUARE: [f32; 3] = [0.74, 0.76, 0.78];
/// Share of the light that a full shadow takes away.
const SHADOW: f32 = 0.55;
/// Direction of the light: down and slightly sideways, so that the shadow of an object in the air lies beside it.
const LIGHT: [f64; 3] = [0.25, 0.15, -1.0];
/// Squares along the object's longest side.
const SQUARES: f64 = 4.0;
/// Shadow cells along the object's longest side.
const CELLS: f64 = 90.0;
/// Half-width in cells of the box filter that softens the shadow; it is applied twice.
const BLUR: usize = 2;

/// The plane z = `z` as a camera sees it; world frame, scene units.
pub struct Ground {
    z: f64,
    /// Longest side of the object.
    scale: f64,
    bounds: [[f64; 3]; 2],
    /// Per pixel: the colour without a shadow.
    lit: Vec<[f32; 3]>,
    /// Per pixel: x and y on the plane; not finite in the sky.
    places: Vec<[f64; 2]>,
}

impl Ground {
    pub fn new(z: f64, report: &SimulationReport, camera: &Camera) -> Self {
        let bounds @ [low, high] = report.bounds();
        let scale = report.longest_side();
        let center = [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0];
        let i = camera.intrinsics;
        let world_from_camera = camera.camera_from_world.inverse();
        let eye = world_from_camera * Point3::origin();
        let width = i.width as usize;
        let seen = |pixel: usize| {
            let (x, y) = ((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
            let ray = world_from_camera * Vector3::new((x - i.cx) / i.fx, (y - i.cy) / i.fy, 1.0);
            let distance = (z - eye.z) / ray.z;
            // The sky, and ground behind the camera.
            if distance <= 0.0 || !distance.is_finite() {
                return (BACKGROUND, [f64::NAN; 2]);
            }
            // Size of the pixel on the ground along the line of sight, for soft edges between the squares.
            let footprint = distance * ray.norm() / i.fx / (ray.z.abs() / ray.norm());
            let at = eye + ray * distance;
            (color(at, footprint, scale, center), [at.x, at.y])
        };
        let (lit, places) = parallel::map_range(i.height as usize * width, seen).into_iter().unzip();
        Self { z, scale, bounds, lit, places }
    }

    /// The ground with the shadow of these Gaussians, row by row.
    pub fn under(&self, gaussians: &Gaussians) -> Vec<[f32; 3]> {
        let shadow = Shadow::of(gaussians, self.z, self.scale, self.bounds);
        let shaded = |i: usize| {
            let light = 1.0 - SHADOW * shadow.at(self.places[i][0], self.places[i][1]);
            self.lit[i].map(|channel| channel * light)
        };
        parallel::map_range(self.lit.len(), shaded)
    }
}

/// The colour of the plane at a point, around a `center` from which it fades.
fn color(at: Point3<f64>, footprint: f64, scale: f64, center: [f64; 2]) -> [f32; 3] {
    let square = scale / SQUARES;
    let wave = |v: f64| soft_sign((v / square).rem_euclid(2.0), footprint / square);
    let even = (0.5 + 0.5 * wave(at.x) * wave(at.y)) as f32;
    let away = (at.x - center[0]).hypot(at.y - center[1]) / scale;
    let seen = (1.0 - ((away - 1.0) / 2.0).clamp(0.0, 1.0)) as f32;
    std::array::from_fn(|c| {
        let plane = DARK_SQUARE[c] + even * (LIGHT_SQUARE[c] - DARK_SQUARE[c]);
        BACKGROUND[c] + seen * (plane - BACKGROUND[c])
    })
}

/// 1 for a phase in (0, 1), -1 in (1, 2), with edges `width` wide.
fn soft_sign(phase: f64, width: f64) -> f64 {
    let from_edge = if phase < 1.0 { phase.min(1.0 - phase) } else { -(phase - 1.0).min(2.0 - phase) };
    (2.0 * from_edge / width.max(1e-9)).clamp(-1.0, 1.0)
}

/// How much light the object blocks, cell by cell.
struct Shadow {
    origin: [f64; 2],
    cell: f64,
    dims: [usize; 2],
    /// 0 lit, 1 dark.
    dark: Vec<f32>,
}

impl Shadow {
    fn of(gaussians: &Gaussians, z: f64, scale: f64, [low, high]: [[f64; 3]; 2]) -> Self {
        let cell = scale / CELLS;
        let margin = scale;
        let origin = [low[0] - margin, low[1] - margin];
        let dims = [0, 1].map(|a| ((high[a] - low[a] + 2.0 * margin) / cell).ceil() as usize);
        let mut depth = vec![0.0_f32; dims[0] * dims[1]];
        for i in 0..gaussians.len() {
            let p = gaussians.center(i);
            let fall = (p.z - z).max(0.0) / -LIGHT[2];
            let at = [0, 1].map(|a| ((p[a] + fall * LIGHT[a] - origin[a]) / cell).floor());
            if (0..2).any(|a| !(at[a] >= 0.0 && at[a] < dims[a] as f64)) {
                continue;
            }
            // Area of a disc of one standard deviation, spread over the cell.
            let s = gaussians.scale(i);
            let (least, most) = (s.min(), s.max());
            let area = std::f64::consts::PI * most * (s.x * s.y * s.z / (least * most).max(f64::MIN_POSITIVE));
            depth[at[1] as usize * dims[0] + at[0] as usize] += (gaussians.opacity(i) * area / (cell * cell)) as f32;
        }
        for _ in 0..2 {
            depth = blurred(&depth, dims[0], dims[1]);
            depth = blurred(&depth, dims[1], dims[0]);
        }
        Self { origin, cell, dims, dark: depth.into_iter().map(|d| 1.0 - (-d).exp()).collect() }
    }

    /// Darkness at a point of the ground, interpolated linearly between cells.
    fn at(&self, x: f64, y: f64) -> f32 {
        let [u, v] = [(x - self.origin[0]) / self.cell - 0.5, (y - self.origin[1]) / self.cell - 0.5];
        let (i, j) = (u.floor(), v.floor());
        if !(i >= 0.0 && j >= 0.0 && i + 1.0 < self.dims[0] as f64 && j + 1.0 < self.dims[1] as f64) {
            return 0.0;
        }
        let (s, t) = ((u - i) as f32, (v - j) as f32);
        let row = |j: usize| {
            let k = j * self.dims[0] + i as usize;
            self.dark[k] * (1.0 - s) + self.dark[k + 1] * s
        };
        row(j as usize) * (1.0 - t) + row(j as usize + 1) * t
    }
}

/// Rows of `width` averaged over a sliding box, then transposed.
fn blurred(values: &[f32], width: usize, height: usize) -> Vec<f32> {
    let mut out = vec![0.0; values.len()];
    for (y, row) in values.chunks_exact(width).enumerate() {
        for x in 0..width {
            let window = &row[x.saturating_sub(BLUR)..(x + BLUR + 1).min(width)];
            out[x * height + y] = window.iter().sum::<f32>() / (2 * BLUR + 1) as f32;
        }
    }
    out
}
