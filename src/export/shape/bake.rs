//! The colours of the splat on a surface: those that a camera would see if it looked at each place along the normal.
//!
//! Gaussians within a few cells of the place are blended along the line of sight, the outermost first, as a renderer
//! does. The colour of each is the mean of those that it shows to the cameras that face the surface best: the colours
//! that it shows to other sides were never trained. Where the splat shows nothing, the colour is that of the nearest
//! Gaussian.

use image::{Rgb, RgbImage};
use nalgebra::{Matrix3, Point3, Vector3};

use super::atlas::Tile;
use super::sieve::{Sieve, Stretched};
use super::{Mesh, REACH, reach_of};
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::numeric::lists::Lists;
use crate::numeric::nearest::Nearest;
use crate::parallel;
use crate::parts::Grid;
use crate::render::sh_color;

/// Side of the cells in which Gaussians are looked up, in cells of the object's grid.
const COARSE: usize = 4;
/// How far before and behind a surface Gaussians are blended, in cells of the object's grid.
const DEPTH_CELLS: f64 = 4.0;
/// Below this opacity, the splat shows nothing.
const LEAST_OPACITY: f64 = 0.2;

/// What is added to the standard deviations of Gaussians, so that none is 0, in cells of the object's grid.
const LEAST_CELLS: f64 = 1e-3;

/// Cameras whose colours are averaged.
const VIEWS: usize = 4;

/// A Gaussian as lines along normals meet it.
struct Met {
    center: Point3<f64>,
    /// A line that passes the centre at a greater squared distance does not meet the Gaussian.
    reach2: f64,
    /// 1 less what rounding may take from the squared distance of a place from the centre.
    certain: f64,
    /// What rounding may add to the squared standard deviations of a place at distance 1 from the centre.
    uncertain: f64,
    precision: Matrix3<f64>,
    opacity: f64,
    /// Squared standard deviations from the centre at which it has ended or is too faint.
    ended: f64,
    /// Beyond this distance from its centre it has ended.
    radius: f64,
    stretched: Stretched,
}

impl Met {
    /// Least opacity with which a Gaussian is met, as in a picture.
    const LEAST: f64 = 1.0 / 255.0;

    /// `least` is added to the variances, so that none is 0.
    fn of(gaussians: &Gaussians, i: usize, least: f64) -> Self {
        /// Far more than what the products below are off by, relative to the largest eigenvalue.
        const ROUNDING: f64 = 1e-13;
        let covariance = gaussians.covariance(i) + Matrix3::identity() * least;
        let precision =
            covariance.try_inverse().filter(|p| p.iter().all(|v| v.is_finite())).unwrap_or_else(Matrix3::zeros);
        let opacity = gaussians.opacity(i);
        let ended = (REACH * REACH).min(2.0 * (opacity / Self::LEAST).ln()) + 1e-6;
        // A line's squared distance in standard deviations is at least its squared distance times the least eigenvalue.
        let eigenvalues = precision.symmetric_eigenvalues();
        let (most, fewest) = (eigenvalues.max(), eigenvalues.min() - ROUNDING * eigenvalues.max());
        let (reach2, certain) =
            if fewest > 0.0 { (ended / fewest, 1.0 - ROUNDING * most / fewest) } else { (f64::INFINITY, 0.0) };
        let radius = REACH * gaussians.scale(i).max();
        let (center, uncertain) = (gaussians.center(i), ROUNDING * most);
        let stretched = Stretched::of(precision, fewest > 0.0, ended);
        Self { center, reach2, certain, uncertain, precision, opacity, ended, radius, stretched }
    }

    /// Whether a line along the unit vector `axis` through a place within `width` of the axis through `middle` may meet the
    /// Gaussian: always true if any does.
    fn may_meet(&self, middle: Point3<f64>, axis: Vector3<f64>, width: f64) -> bool {
        let offset = middle - self.center;
        let across = self.precision * axis;
        let along = across.dot(&axis);
        if along <= self.uncertain {
            return true;
        }
        // The axis comes this close, in standard deviations; a place within `width` of it is at most as much closer as the
        // precision across the axis allows, whose largest eigenvalue is at most its trace.
        let closest2 = offset.dot(&(self.precision * offset)) - across.dot(&offset).powi(2) / along;
        let closest = (closest2 - self.uncertain * offset.norm_squared()).max(0.0).sqrt();
        let trace = self.precision.trace() - across.norm_squared() / along;
        closest <= self.ended.sqrt() + width * (trace.max(0.0) + self.uncertain).sqrt()
    }

    /// How far outward on the line along the unit vector `normal` through `at` the Gaussian is densest, and its opacity
    /// there; `None` if that is farther than `depth` or the line does not meet the Gaussian.
    fn on_line(&self, at: Point3<f64>, normal: Vector3<f64>, depth: f64) -> Option<(f64, f64)> {
        let offset = at - self.center;
        if self.certain * offset.norm_squared() - offset.dot(&normal).powi(2) > self.reach2 {
            return None;
        }
        let across = self.precision * normal;
        let along = across.dot(&normal);
        if along <= 0.0 {
            return None;
        }
        let place = -across.dot(&offset) / along;
        let distance2 = offset.dot(&(self.precision * offset)) - place * place * along;
        if place.abs() > depth || distance2 > REACH * REACH {
            return None;
        }
        let alpha = self.opacity * (-0.5 * distance2).exp();
        (alpha > Self::LEAST).then_some((place, alpha.min(0.99)))
    }
}

/// Paints with the colours of a splat.
pub struct Painter<'a> {
    gaussians: &'a Gaussians,
    grid: Grid,
    depth: f64,
    /// The Gaussians that touch each coarse cell.
    members: Lists,
    met: Vec<Met>,
    /// For a first look at many: the centre of each Gaussian and a distance from it at which none is met any more.
    balls: Vec<(Point3<f64>, f64)>,
    nearest: Nearest,
    /// Unit directions from the object to the cameras.
    towards: Vec<Vector3<f64>>,
}

impl<'a> Painter<'a> {
    /// A painter for surfaces on a grid.
    pub fn new(gaussians: &'a Gaussians, cameras: &[Camera], grid: &Grid) -> Self {
        let coarse = grid.coarser(COARSE);
        let spans: Vec<Option<[[usize; 2]; 3]>> = parallel::map_range(gaussians.len(), |i| {
            // Every cell that the box touches, not only those whose centre it holds.
            let reach = reach_of(gaussians, i).add_scalar(0.5 * coarse.cell);
            coarse.cells_between(gaussians.center(i) - reach, gaussians.center(i) + reach)
        });
        let each = |visit: &mut dyn FnMut(usize, u32)| {
            for (i, [xs, ys, zs]) in spans.iter().enumerate().filter_map(|(i, span)| Some((i, (*span)?))) {
                for z in zs[0]..=zs[1] {
                    for y in ys[0]..=ys[1] {
                        (xs[0]..=xs[1]).for_each(|x| visit(coarse.index([x, y, z]), i as u32));
                    }
                }
            }
        };
        let members = Lists::new(coarse.len(), each);
        let least = LEAST_CELLS * grid.cell;
        let met = parallel::map_range(gaussians.len(), |i| Met::of(gaussians, i, least * least));
        Self {
            gaussians,
            grid: coarse,
            depth: DEPTH_CELLS * grid.cell,
            members,
            balls: met.iter().map(|met| (met.center, met.radius + REACH * least)).collect(),
            met,
            nearest: Nearest::new(gaussians.positions.iter().copied()),
            towards: cameras.iter().filter_map(|c| (c.center_in_world() - grid.middle()).try_normalize(1e-9)).collect(),
        }
    }

    /// The picture for a mesh in scene units.
    pub fn picture(&self, mesh: &Mesh, layout: &[Tile], [width, height]: [u32; 2]) -> RgbImage {
        let normals = mesh.normals();
        let painted: Vec<Vec<([u32; 2], [u8; 3])>> =
            parallel::map_range(layout.len(), |n| self.tile(mesh, &normals, mesh.triangles[n], &layout[n]));
        // Pixels that no tile covers have the mean colour, because viewers blend them in from afar.
        let count = painted.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let sum = |channel: usize| painted.iter().flatten().map(|(_, color)| f64::from(color[channel])).sum::<f64>();
        let mean = [0, 1, 2].map(|channel| (sum(channel) / count) as u8);
        let mut picture = RgbImage::from_pixel(width, height, Rgb(mean));
        for ([x, y], color) in painted.into_iter().flatten() {
            picture.put_pixel(x, y, Rgb(color));
        }
        picture
    }

    fn tile(&self, mesh: &Mesh, normals: &[Vector3<f64>], triangle: [u32; 3], tile: &Tile) -> Vec<([u32; 2], [u8; 3])> {
        let (corners, normals) = (mesh.corners(triangle), triangle.map(|v| normals[v as usize]));
        let mut near = self.near(&corners, &normals);
        near.sieve = Some(self.sieve(&corners, &near.members));
        let steps = f64::from(tile.steps);
        let mut pixels = Vec::new();
        // One row more than the triangle has, for viewers to blend with, and the next row too if no other triangle has
        // it.
        for x in 0..=tile.steps + 2 {
            for y in 0..=tile.steps + 2 - x {
                let (mut one, mut two) = (f64::from(x) / steps, f64::from(y) / steps);
                let beyond = (one + two).max(1.0);
                (one, two) = (one / beyond, two / beyond);
                let share = [1.0 - one - two, one, two];
                let at: Vector3<f64> = (0..3).map(|k| corners[k].coords * share[k]).sum();
                let normal: Vector3<f64> = (0..3).map(|k| normals[k] * share[k]).sum();
                let normal = normal.try_normalize(1e-9).unwrap_or(normals[0]);
                if x + y < tile.steps + 2 || !tile.second {
                    pixels.push((tile.pixel([x, y]), near.color(at.into(), normal)));
                }
            }
        }
        pixels
    }

    /// A colour for the middle of each triangle of a mesh in scene units.
    pub fn triangle_colors(&self, mesh: &Mesh) -> Vec<[u8; 3]> {
        let normals = mesh.normals();
        let color = |triangle: &[u32; 3]| {
            let corners = mesh.corners(*triangle);
            let middle = Point3::from(corners.iter().map(|corner| corner.coords).sum::<Vector3<f64>>() / 3.0);
            let normal = mean_direction(&triangle.map(|v| normals[v as usize]));
            self.near(&corners, &[normal]).color(middle, normal)
        };
        parallel::map(&mesh.triangles, color)
    }

    /// A colour for each vertex of a mesh in scene units.
    pub fn vertex_colors(&self, mesh: &Mesh) -> Vec<[u8; 3]> {
        let normals = mesh.normals();
        parallel::map_range(normals.len(), |n| {
            let (at, normal) = (mesh.vertices[n], normals[n]);
            self.near(&[at], &[normal]).color(at, normal)
        })
    }

    /// The Gaussians that may be met on a line through a place between `corners`, along a normal between `normals`.
    fn near(&self, corners: &[Point3<f64>], normals: &[Vector3<f64>]) -> Near<'_> {
        let facing = mean_direction(normals);
        let (low, high) = bounds(corners);
        let middle = nalgebra::center(&low, &high);
        let extent = 0.5 * (high - low).norm() + self.depth;
        // No place on such a line is farther from the line through the middle along the mean normal.
        let sideways = |v: Vector3<f64>| (v - facing * v.dot(&facing)).norm();
        let spread = normals.iter().map(|n| if n.dot(&facing) > 0.0 { sideways(*n) } else { 1.0 }).fold(0.0, f64::max);
        let width = corners.iter().map(|p| sideways(p - middle)).fold(0.0, f64::max) + self.depth * spread;
        let half = Vector3::repeat(0.5 * self.grid.cell);
        let is_near = |i: &u32| {
            let (center, radius) = self.balls[*i as usize];
            sideways(center - middle) <= (width + radius) * (1.0 + 1e-9)
        };
        let mut members = Vec::new();
        if let Some([xs, ys, zs]) = self.grid.cells_between(low - half, high + half) {
            for z in zs[0]..=zs[1] {
                for y in ys[0]..=ys[1] {
                    let cells = (xs[0]..=xs[1]).map(|x| self.grid.index([x, y, z]));
                    members.extend(cells.flat_map(|cell| self.members.of(cell)).filter(|i| is_near(i)));
                }
            }
        }
        members.sort_unstable();
        members.dedup();
        let meets = |gaussian: &Met| {
            (gaussian.center - middle).norm() <= extent + gaussian.radius && gaussian.may_meet(middle, facing, width)
        };
        members.retain(|i| meets(&self.met[*i as usize]));
        let (views, colors) = (self.views(facing), vec![None; members.len()]);
        Near { painter: self, views, colors, members, sieve: None, left: Vec::new(), met: Vec::new() }
    }

    /// A sieve for Gaussians near a triangle, which pays if many lines pass through it.
    fn sieve(&self, corners: &[Point3<f64>], members: &[u32]) -> Sieve {
        let (low, high) = bounds(corners);
        let extent = 0.5 * (high - low).norm() + self.depth;
        let stretched = members.iter().map(|i| &self.met[*i as usize]).map(|met| (met.center, met.stretched));
        Sieve::new(stretched, nalgebra::center(&low, &high), extent, self.grid.cell)
    }

    /// Directions of sight of the cameras that face a surface best; along its normal if there are no cameras.
    fn views(&self, normal: Vector3<f64>) -> Vec<[f32; 3]> {
        let sight = |towards: &Vector3<f64>| towards.map(|c| -c as f32).into();
        let mut facing: Vec<(f64, usize)> =
            self.towards.iter().enumerate().map(|(n, towards)| (-towards.dot(&normal), n)).collect();
        if facing.is_empty() {
            return vec![sight(&normal)];
        }
        facing.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        facing.iter().take(VIEWS).map(|(_, n)| sight(&self.towards[*n])).collect()
    }

    /// The mean colour that a Gaussian shows.
    fn seen(&self, i: u32, views: &[[f32; 3]]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for view in views {
            let color = sh_color(self.gaussians, i as usize, *view);
            (0..3).for_each(|c| sum[c] += f64::from(color[c].clamp(0.0, 1.0)) / views.len() as f64);
        }
        sum
    }
}

/// The lowest and the highest corner of the box around places.
fn bounds(places: &[Point3<f64>]) -> (Point3<f64>, Point3<f64>) {
    places.iter().fold((places[0], places[0]), |(low, high), p| (low.inf(p), high.sup(p)))
}

/// The mean of unit vectors as a unit vector; the first if they cancel out.
fn mean_direction(of: &[Vector3<f64>]) -> Vector3<f64> {
    of.iter().sum::<Vector3<f64>>().try_normalize(1e-9).unwrap_or(of[0])
}

/// The Gaussians near a triangle or a vertex, each with the colour that it shows once that is known.
struct Near<'a> {
    painter: &'a Painter<'a>,
    /// Directions of sight.
    views: Vec<[f32; 3]>,
    members: Vec<u32>,
    colors: Vec<Option<[f64; 3]>>,
    /// For many places.
    sieve: Option<Sieve>,
    /// What the sieve leaves, as indices in `members`.
    left: Vec<usize>,
    /// The Gaussians met at one place: distance outward, opacity, index in `members`.
    met: Vec<(f64, f64, usize)>,
}

impl Near<'_> {
    /// The colour at a place on a surface, sRGB.
    fn color(&mut self, at: Point3<f64>, normal: Vector3<f64>) -> [u8; 3] {
        let Self { painter, views, members, colors, sieve, left: may_be_met, met } = self;
        may_be_met.clear();
        match sieve {
            Some(sieve) => sieve.sift(at, normal, may_be_met),
            None => may_be_met.extend(0..members.len()),
        }
        met.clear();
        for &n in may_be_met.iter() {
            let gaussian = &painter.met[members[n] as usize];
            met.extend(gaussian.on_line(at, normal, painter.depth).map(|(place, alpha)| (place, alpha, n)));
        }
        met.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.2.cmp(&b.2)));
        let (mut color, mut left) = ([0.0; 3], 1.0);
        for &(_, alpha, n) in met.iter() {
            let own = *colors[n].get_or_insert_with(|| painter.seen(members[n], views));
            (0..3).for_each(|c| color[c] += left * alpha * own[c]);
            left *= 1.0 - alpha;
            if left < 1e-3 {
                break;
            }
        }
        if 1.0 - left < LEAST_OPACITY {
            let (_, i) = painter.nearest.find(at.map(|c| c as f32).into(), 1)[0];
            color = painter.seen(i, views);
            left = 0.0;
        }
        color.map(|c| (c / (1.0 - left) * 255.0).round().clamp(0.0, 255.0) as u8)
    }
}
