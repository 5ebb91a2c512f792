//! What the cameras look at, and the support under it (table, bed, floor).
//!
//! 1. The focus: the point nearest to all optical axes. A photographer who walks around an object keeps it in the middle.
//! 2. The ball around the focus in which the object could lie, sized by the cameras' distance. Gaussians larger than any object
//!    detail are walls.
//! 3. The support: the plane with most of these Gaussians close to it, almost none beyond it and almost all cameras on one side;
//!    if the cameras suggest which way is up, no wall can be it. It is then fitted to ever nearer Gaussians: a trained surface is
//!    thick, but densest where the true one is. Where something stands, there is no surface to see: what is low there belongs to that
//!    thing, and many small things would lift and tilt the plane.
//!
//! All lengths are fractions of the cameras' median distance from the focus.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Matrix3x2, Point3, UnitQuaternion, Vector2, Vector3};

use crate::gaussians::Gaussians;
use crate::numeric::{median, nearest_to_lines, principal, scatter, upper_median};
use crate::scene::View;

/// Radius of the ball: with the usual field of view of 50 to 60 degrees, an object that fills the picture has a radius
/// of about half the distance.
const REACH: f64 = 0.6;
/// Standard deviation of the largest Gaussian that may show a detail.
pub(super) const LARGEST: f64 = 0.03;
/// Distance from the support within which a Gaussian belongs to it: cloth wrinkles, and trained surfaces are thick.
pub(super) const THICKNESS: f64 = 0.03;
/// A support holds at least this share of the ball's Gaussians.
const LEAST_SHARE: f64 = 0.12;
/// Share of the Gaussians that may lie beyond the support: some always leak through it.
const MOST_BEYOND: f64 = 0.05;
/// Share of the cameras that must stand on one side of it.
const LEAST_ON_ONE_SIDE: f64 = 0.9;
/// Least cosine between the support's normal and the cameras' up (45 degrees): nothing stands on a steeper slope.
const LEAST_COSINE: f64 = 0.7;
/// Below this opacity a Gaussian is haze.
pub(super) const LEAST_OPACITY_LOGIT: f32 = -2.2;
/// Standard deviation of a normal distribution, in median absolute deviations.
const NORMAL_DEVIATIONS: f64 = 1.4826;
/// The plane is fitted twice to the Gaussians within each of these shares of the thickness. With them, the normal of a table
/// whose true one is known is 0.06 degrees off; with the first alone, 0.4 degrees.
const FITTED: [f64; 3] = [1.0, 0.5, 0.25];
/// The support is fitted where nothing stands on it if its spread is at most this share of that of the plane that is fitted to all
/// Gaussians: nearly 0 on built tables full of things, 0.97 on a table with five things, 0.9 on a bed whose folds are everywhere.
const FLATTER: f64 = 0.7;
/// After the second and the next two of these fits, the plane moves to the lowest layer, of this height, in which at least this share
/// as many columns have a Gaussian as in the fullest layer: many things on a table have more Gaussians than the table, but it covers
/// more of the area. Looked for within one and a half thicknesses of the plane.
const SEATED_AFTER: std::ops::RangeInclusive<usize> = 1..=3;
const LAYER: f64 = 0.0075;
const LAYERS: f64 = 12.0;
const FULL_LAYER: f64 = 0.75;
/// Side of a column.
const COLUMN: f64 = 1.0 / 80.0;
/// Something stands in a column if a Gaussian in it is higher than this, and higher than this many spreads of the surface.
const STANDS_FROM: f64 = LAYER;
const STANDS_FROM_SPREADS: f64 = 3.0;
/// Fewest Gaussians of a support that is seen beside what stands on it.
const FEWEST_BARE: usize = 24;

/// The poses of the views' cameras.
pub(in crate::scene) fn poses(views: &[View]) -> Vec<Isometry3<f64>> {
    views.iter().map(|view| view.camera.camera_from_world).collect()
}

/// The point that the cameras look at, and the Gaussians around it.
pub(in crate::scene) struct Focus {
    pub point: Point3<f64>,
    /// The cameras' median distance from the focus.
    pub unit: f64,
    /// The indices of the Gaussians in the ball.
    pub indices: Vec<usize>,
    /// Their centres.
    pub points: Vec<Point3<f64>>,
    /// The cameras' centres.
    cameras: Vec<Point3<f64>>,
}

impl Focus {
    /// `None` if the cameras do not look at a common point.
    pub fn of(gaussians: &Gaussians, cameras: &[Isometry3<f64>]) -> Option<Self> {
        let world_from_camera: Vec<_> = cameras.iter().map(Isometry3::inverse).collect();
        let centers: Vec<Point3<f64>> = world_from_camera.iter().map(|pose| pose.translation.vector.into()).collect();
        let axes: Vec<Vector3<f64>> = world_from_camera.iter().map(|pose| pose.rotation * Vector3::z()).collect();
        let focus = nearest_to_lines(&centers, &axes).filter(|focus| is_before_most(focus, &centers, &axes))?;
        let unit =
            upper_median(centers.iter().map(|center| (center - focus).norm()).collect()).filter(|unit| *unit > 0.0)?;
        let in_ball = |i: &usize| {
            gaussians.opacity_logits[*i] >= LEAST_OPACITY_LOGIT
                && (gaussians.center(*i) - focus).norm() < REACH * unit
                && gaussians.scale(*i).max() < LARGEST * unit
        };
        let indices: Vec<usize> = (0..gaussians.len()).filter(in_ball).collect();
        let points = indices.iter().map(|i| gaussians.center(*i)).collect();
        Some(Self { point: focus, unit, indices, points, cameras: centers })
    }

    /// The support, if there is one; `up` is what the cameras suggest.
    pub fn support(&self, up: Option<&Vector3<f64>>) -> Option<Plane> {
        self.sampled_support(up).map(|plane| self.fitted(plane))
    }

    /// Where the Gaussians of the support lie; `None` if there are none close to the plane.
    pub(super) fn scatter(&self, support: &Plane) -> Option<Scatter> {
        let all: Vec<&Point3<f64>> = self.points.iter().collect();
        let all = self.scatter_of(&all, support)?;
        let bare = self.scatter_of(&self.bare(support), support);
        Some(bare.filter(|bare| bare.spread <= FLATTER * all.spread).unwrap_or(all))
    }

    fn scatter_of(&self, points: &[&Point3<f64>], support: &Plane) -> Option<Scatter> {
        let band = THICKNESS * FITTED[FITTED.len() - 1];
        let heights: Vec<f64> =
            points.iter().map(|at| support.height(at) / self.unit).filter(|height| height.abs() < band).collect();
        let offset = median(heights.clone())?;
        let spread = NORMAL_DEVIATIONS * median(heights.iter().map(|height| (height - offset).abs()).collect())?;
        Some(Scatter { offset, spread })
    }

    /// The Gaussians where nothing stands on the support; all if something stands everywhere.
    fn bare(&self, support: &Plane) -> Vec<&Point3<f64>> {
        let all: Vec<&Point3<f64>> = self.points.iter().collect();
        let spread = self.scatter_of(&all, support).map_or(0.0, |scatter| scatter.spread);
        let least = STANDS_FROM.max(STANDS_FROM_SPREADS * spread) * self.unit;
        let axes = support.axes();
        let column = |point: &Point3<f64>| self.column(point, &axes);
        let high = all.iter().filter(|point| support.height(point) > least);
        let occupied: BTreeSet<[i64; 2]> = high.map(|point| column(point)).collect();
        let bare: Vec<&Point3<f64>> = all.iter().copied().filter(|point| !occupied.contains(&column(point))).collect();
        let close = bare.iter().filter(|point| support.height(point).abs() < LAYER * self.unit).count();
        if close < FEWEST_BARE { all } else { bare }
    }

    fn column(&self, point: &Point3<f64>, axes: &Matrix3x2<f64>) -> [i64; 2] {
        let along: Vector2<f64> = axes.transpose() * (point - self.point) / (COLUMN * self.unit);
        along.map(|side| side.floor() as i64).into()
    }

    /// The plane moved to the lowest of the layers that cover most of the area.
    fn seated(&self, plane: Plane) -> Plane {
        let axes = plane.axes();
        let layer = |point: &Point3<f64>| (plane.height(point) / (LAYER * self.unit) + LAYERS / 2.0).floor();
        let near = self.points.iter().filter(|point| (0.0..LAYERS).contains(&layer(point)));
        let covered: BTreeSet<(i64, [i64; 2])> =
            near.map(|point| (layer(point) as i64, self.column(point, &axes))).collect();
        let columns_of = |layer: i64| covered.range((layer, [i64::MIN; 2])..(layer + 1, [i64::MIN; 2])).count();
        let columns: Vec<usize> = (0..LAYERS as i64).map(columns_of).collect();
        let most = columns.iter().max().copied().unwrap_or(0);
        let lowest = columns.iter().position(|count| *count as f64 >= FULL_LAYER * most as f64);
        match lowest.filter(|_| most > 0) {
            Some(layer) => {
                Plane { offset: plane.offset + (layer as f64 + 0.5 - LAYERS / 2.0) * LAYER * self.unit, ..plane }
            }
            None => plane,
        }
    }

    /// The support with the spread of its Gaussians, in scene units.
    pub fn support_surface(&self, plane: Plane) -> Option<SupportSurface> {
        self.scatter(&plane).map(|scatter| SupportSurface { plane, spread: scatter.spread * self.unit })
    }

    /// RANSAC (Fischler and Bolles 1981) with a fixed sequence of samples.
    fn sampled_support(&self, up: Option<&Vector3<f64>>) -> Option<Plane> {
        const TRIALS: usize = 500;
        /// Enough to estimate shares to within a percent or two.
        const SAMPLES: usize = 1500;
        let thickness = THICKNESS * self.unit;
        let samples: Vec<&Point3<f64>> = self.points.iter().step_by((self.points.len() / SAMPLES).max(1)).collect();
        if samples.len() < 3 {
            return None;
        }
        let is_level = |plane: &Plane| up.is_none_or(|up| plane.normal.dot(up) >= LEAST_COSINE);
        let mut random = Sequence(0x9e37_79b9_7f4a_7c15);
        let mut best: Option<(usize, Plane)> = None;
        for _ in 0..TRIALS {
            let three = [(); 3].map(|()| samples[random.below(samples.len())]);
            let facing = Plane::through(three).and_then(|plane| plane.facing(&self.cameras));
            let Some(plane) = facing.filter(is_level) else { continue };
            let heights = samples.iter().map(|point| plane.height(point));
            let beyond = heights.clone().filter(|height| *height < -thickness).count();
            let close = heights.filter(|height| height.abs() < thickness).count();
            let is_border = beyond as f64 <= MOST_BEYOND * samples.len() as f64;
            if is_border && best.as_ref().is_none_or(|(most, _)| close > *most) {
                best = Some((close, plane));
            }
        }
        best.filter(|(close, _)| *close as f64 >= LEAST_SHARE * samples.len() as f64).map(|(_, plane)| plane)
    }

    /// The plane with the least mean square distance from the Gaussians close to it: from all, or, if that is far flatter, where
    /// nothing stands on it.
    fn fitted(&self, start: Plane) -> Plane {
        let rounds = || FITTED.iter().flat_map(|share| [share * THICKNESS * self.unit; 2]).enumerate();
        let all: Vec<&Point3<f64>> = self.points.iter().collect();
        let of_all = rounds().fold(start, |plane, (_, reach)| least_squares(plane, &all, reach));
        let of_bare = rounds().fold(start, |plane, (round, reach)| {
            // The first plane may lie between the support and the tops of low things.
            let bare = if round == 0 { all.clone() } else { self.bare(&plane) };
            let plane = least_squares(plane, &bare, reach);
            if SEATED_AFTER.contains(&round) { self.seated(plane) } else { plane }
        });
        let spread = |points: &[&Point3<f64>], plane: &Plane| self.scatter_of(points, plane).map(|found| found.spread);
        let is_flatter = match (spread(&all, &of_all), spread(&self.bare(&of_bare), &of_bare)) {
            (Some(all), Some(bare)) => bare <= FLATTER * all,
            (all, _) => all.is_none(),
        };
        if is_flatter { of_bare } else { of_all }
    }
}

/// The plane with the least mean square distance from those of the points that are within `reach` of another; that plane if they are
/// too few.
fn least_squares(plane: Plane, points: &[&Point3<f64>], reach: f64) -> Plane {
    let near: Vec<&Point3<f64>> = points.iter().copied().filter(|point| plane.height(point).abs() < reach).collect();
    let (middle, spread) = scatter(near.iter().map(|point| &point.coords));
    let normal = principal(&spread).map(|axes| {
        let across = axes.eigenvalues.imin();
        axes.eigenvectors.column(across).into_owned()
    });
    match normal.filter(|_| near.len() >= 3) {
        Some(normal) => {
            let normal = normal * normal.dot(&plane.normal).signum();
            Plane { normal, offset: normal.dot(&middle) }
        }
        None => plane,
    }
}

/// Whether more than half of the cameras look towards a point. The axes of cameras that look outwards, from the middle of a
/// room, meet behind them.
fn is_before_most(point: &Point3<f64>, centers: &[Point3<f64>], axes: &[Vector3<f64>]) -> bool {
    let before = centers.iter().zip(axes).filter(|(center, axis)| axis.dot(&(point - *center)) > 0.0).count();
    2 * before > centers.len()
}

/// Where the Gaussians of a support lie, in units of the cameras' distance.
pub(super) struct Scatter {
    /// Their median distance from the plane.
    pub offset: f64,
    /// Standard deviation across it, estimated from the median absolute deviation.
    pub spread: f64,
}

/// The surface on which an object stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SupportSurface {
    pub plane: Plane,
    /// Standard deviation of the surface's Gaussians across the plane, scene units: what is nearer to the plane than that cannot
    /// be told from it.
    pub spread: f64,
}

impl SupportSurface {
    /// The same surface in a frame that is turned about the origin.
    pub(in crate::scene) fn turned(self, turn: &UnitQuaternion<f64>) -> Self {
        Self { plane: self.plane.turned(turn), ..self }
    }
}

/// The points x with normal . x = offset; the cameras are on the side where normal . x is larger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// A unit vector.
    pub normal: Vector3<f64>,
    pub offset: f64,
}

impl Plane {
    fn through(points: [&Point3<f64>; 3]) -> Option<Self> {
        let normal = (points[1] - points[0]).cross(&(points[2] - points[0])).try_normalize(1e-12)?;
        Some(Self { normal, offset: normal.dot(&points[0].coords) })
    }

    /// How far a point lies on the cameras' side, negative beyond the plane.
    pub fn height(&self, point: &Point3<f64>) -> f64 {
        self.normal.dot(&point.coords) - self.offset
    }

    /// Two unit vectors along it, at right angles to each other.
    pub(super) fn axes(&self) -> Matrix3x2<f64> {
        let first = self.normal.cross(&Vector3::ith(self.normal.iamin(), 1.0)).normalize();
        Matrix3x2::from_columns(&[first, self.normal.cross(&first)])
    }

    /// The same plane in a frame that is turned about the origin.
    pub(in crate::scene) fn turned(self, turn: &UnitQuaternion<f64>) -> Self {
        Self { normal: turn * self.normal, ..self }
    }

    fn facing(self, cameras: &[Point3<f64>]) -> Option<Self> {
        let before = cameras.iter().filter(|camera| self.height(camera) > 0.0).count();
        let enough = LEAST_ON_ONE_SIDE * cameras.len() as f64;
        if before as f64 >= enough {
            Some(self)
        } else if (cameras.len() - before) as f64 >= enough {
            Some(Self { normal: -self.normal, offset: -self.offset })
        } else {
            None
        }
    }
}

/// A linear congruential generator (Knuth's MMIX), so that the samples are the same in every run.
struct Sequence(u64);

impl Sequence {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % end
    }
}
