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
    grid: ShadowGrid,
    /// Per pixel: the colour without a shadow.
    lit: Vec<[f32; 3]>,
    /// Per pixel: its place in the grid, counted from the middle of the first cell; NaN in the sky.
    places: Vec<[f32; 2]>,
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
        let grid = ShadowGrid::new(scale, bounds);
        let seen = |pixel: usize| {
            let (x, y) = ((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
            let ray = world_from_camera * Vector3::new((x - i.cx) / i.fx, (y - i.cy) / i.fy, 1.0);
            let distance = (z - eye.z) / ray.z;
            // The sky, and ground behind the camera.
            if distance <= 0.0 || !distance.is_finite() {
                return (BACKGROUND, [f32::NAN; 2]);
            }
            // Size of the pixel on the ground along the line of sight, for soft edges between the squares.
            let footprint = distance * ray.norm() / i.fx / (ray.z.abs() / ray.norm());
            let at = eye + ray * distance;
            (color(at, footprint, scale, center), grid.place([at.x, at.y]).map(|place| (place - 0.5) as f32))
        };
        let (lit, places) = parallel::map_range(i.height as usize * width, seen).into_iter().unzip();
        Self { z, grid, lit, places }
    }

    /// The shadow of these Gaussians.
    pub fn shadow(&self, gaussians: &Gaussians) -> Shadow {
        Shadow::of(gaussians, self.z, self.grid)
    }

    /// The colour at a pixel under a shadow.
    pub fn color(&self, pixel: usize, shadow: &Shadow) -> [f32; 3] {
        let light = 1.0 - SHADOW * shadow.at(self.places[pixel]);
        self.lit[pixel].map(|channel| channel * light)
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

/// The cells of the ground around the object.
#[derive(Clone, Copy)]
struct ShadowGrid {
    origin: [f64; 2],
    cell: f64,
    dims: [usize; 2],
}

impl ShadowGrid {
    /// The cells around an object whose longest side is `scale`.
    fn new(scale: f64, [low, high]: [[f64; 3]; 2]) -> Self {
        let cell = scale / CELLS;
        let margin = scale;
        let origin = [low[0] - margin, low[1] - margin];
        let dims = [0, 1].map(|a| ((high[a] - low[a] + 2.0 * margin) / cell).ceil() as usize);
        Self { origin, cell, dims }
    }

    /// A point of the ground, counted in cells.
    fn place(&self, at: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|a| (at[a] - self.origin[a]) / self.cell)
    }
}

/// How much light the object blocks, cell by cell.
pub struct Shadow {
    dims: [usize; 2],
    /// 0 lit, 1 dark.
    dark: Vec<f32>,
}

impl Shadow {
    fn of(gaussians: &Gaussians, z: f64, grid: ShadowGrid) -> Self {
        let ShadowGrid { cell, dims, .. } = grid;
        let mut depth = vec![0.0_f32; dims[0] * dims[1]];
        for i in 0..gaussians.len() {
            let p = gaussians.center(i);
            let fall = (p.z - z).max(0.0) / -LIGHT[2];
            let at = grid.place([0, 1].map(|a| p[a] + fall * LIGHT[a]));
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
        Self { dims, dark: depth.into_iter().map(|d| 1.0 - (-d).exp()).collect() }
    }

    /// Darkness at a place counted from the middle of the first cell, interpolated linearly between cells.
    fn at(&self, [u, v]: [f32; 2]) -> f32 {
        // False also if they are NaN.
        if !(u >= 0.0 && v >= 0.0) {
            return 0.0;
        }
        let (i, j) = (u as usize, v as usize);
        if i.saturating_add(1) >= self.dims[0] || j.saturating_add(1) >= self.dims[1] {
            return 0.0;
        }
        let (s, t) = (u - i as f32, v - j as f32);
        let row = |j: usize| {
            let k = j * self.dims[0] + i;
            self.dark[k] * (1.0 - s) + self.dark[k + 1] * s
        };
        row(j) * (1.0 - t) + row(j + 1) * t
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
