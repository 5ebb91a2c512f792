//! How much of a pad touches the object, and how far from its middle it presses: at an edge, on a rail that is narrower than the
//! pad, on ribs and on what is strongly curved, it is less than all of it.
//!
//! A pad is a disc with the finger's area. Points are spread evenly over it, and each stands as high as the surface below it, if
//! there is one. Soft rubber reaches [`GIVE_M`] below the highest of them, and presses in proportion to how far it is squeezed.

use nalgebra::{Matrix2, Point3, Vector2, Vector3};

use super::cells::Cells;
use super::places::Place;
use super::surface::{Surface, SurfacePoint};

/// Soft pads of 5 mm (E = 1 MPa) on 1.1e-4 m2 give way by as much under 33 N; a splat's surface is off by a third of it.
const GIVE_M: f64 = 0.0015;
/// What lies farther below a contact belongs to another side.
const DEEPEST_M: f64 = 0.006;
/// Points spread over a pad, as the seeds of a sunflower.
const SPREAD: usize = 48;
/// Facing the pad: within 60 degrees.
const FACING: f64 = 0.5;
/// The neighbour in this rank is as far away as the points of an even grid are apart.
const NEIGHBOUR: usize = 4;
/// The Gaussians of a splat cluster, so the spacing is that of this share of them, not of most.
const WIDELY: f64 = 0.9;
/// A gap as wide as this many spacings is a hole: half again as wide as the points are apart where they are few.
const HOLE: f64 = 1.5;
/// Points that are strewn so widely that only holes as large as this share of the pad's radius show do not tell what it touches.
const COARSE: f64 = 0.5;
/// Points from which the spacing is estimated, and by which a surface is known under a pad.
const MEASURED: usize = 24;
const MOST: usize = 1000;
/// The distance from a disc's middle within which a force on an evenly springy disc presses all of it, as a share of the mean
/// distance of even pressure: r/4 (the kern of a circle) of 2/3 r.
const KERN: f64 = 3.0 / 8.0;
/// Directions in which a place that is covered is surrounded.
const AROUND: usize = 8;
/// A highest point that is not one stray: of this share of the points, the lowest.
const TOP: f64 = 0.8;

/// How both pads touch the object at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// The share of a pad that touches, of the pad that touches less.
    pub share: f64,
    /// Mean distance of the pressure under a pad from its middle, m, over both pads.
    pub arm_m: f64,
    /// How far the pressure can move before an edge of a pad lifts off, m, over both pads.
    pub shift_m: f64,
}

/// Pads that may press anywhere on a surface.
pub struct Pads<'a> {
    points: &'a [SurfacePoint],
    cells: Cells<'a>,
    radius_m: f64,
}

/// A point of the plane of a pad, m from its middle.
type OnPad = [f64; 2];

/// A point of the surface under a pad.
struct Below {
    at: OnPad,
    /// Above the contact.
    height_m: f64,
    /// How fast the surface falls in both directions of the plane.
    falls: Vector2<f64>,
}

/// A point of a pad that touches.
struct Pressed {
    at: OnPad,
    /// How far the rubber is squeezed.
    depth_m: f64,
}

impl<'a> Pads<'a> {
    /// Pads of this radius; `positions` are those of the surface's points.
    pub fn new(surface: &'a Surface, positions: &'a [Point3<f64>], radius_m: f64) -> Self {
        Self { points: &surface.points, cells: Cells::new(positions, radius_m), radius_m }
    }

    /// How the pads touch at a place. A surface that is too sparse to tell counts as flat.
    pub fn touch(&self, place: &Place) -> Touch {
        let axis = place.axis();
        let flat = || self.spread().into_iter().map(|at| Pressed { at, depth_m: GIVE_M }).collect();
        let below = [self.below(place.contacts[0], -axis), self.below(place.contacts[1], axis)];
        let pressed = [0, 1].map(|pad| self.pressed(&below[pad]).unwrap_or_else(flat));
        let share = pressed.iter().map(|pad| pad.len() as f64 / SPREAD as f64).fold(1.0, f64::min);
        // Relative to a whole pad, since its points stand for a disc.
        let whole = mean_arm_m(&flat());
        let arm_m = pressed.iter().map(|pad| mean_arm_m(pad) / whole * whole_arm_m(self.radius_m)).sum::<f64>() / 2.0;
        // If the object turns about its middle, a surface with the radius of half its width rolls under the pads.
        let curvature_1_m = below.iter().map(|below| curvature_1_m(below, self.radius_m)).sum::<f64>() / 2.0;
        let flatness = (1.0 - 0.5 * place.width_m() * curvature_1_m).clamp(0.0, 1.0);
        Touch { share, arm_m, shift_m: flatness * whole_shift_m(arm_m) }
    }

    /// The points of a pad that touch; `None` if the surface is too sparse to tell.
    fn pressed(&self, below: &[Below]) -> Option<Vec<Pressed>> {
        let hole_m = HOLE * spacing_m(below)?;
        if hole_m > COARSE * self.radius_m {
            return None;
        }
        let height_at = |at: OnPad| covers(below, hole_m, at).then(|| height_m(below, hole_m, at)).flatten();
        let heights: Vec<(OnPad, f64)> =
            self.spread().into_iter().filter_map(|at| height_at(at).map(|height| (at, height))).collect();
        let mut sorted: Vec<f64> = heights.iter().map(|(_, height)| *height).collect();
        sorted.sort_by(f64::total_cmp);
        let deepest = sorted.get((TOP * sorted.len() as f64) as usize).map_or(0.0, |top| top - GIVE_M);
        let pressed = heights.into_iter().map(|(at, height)| Pressed { at, depth_m: height - deepest });
        Some(pressed.filter(|pressed| pressed.depth_m >= 0.0).collect())
    }

    /// The surface that faces a pad, in the pad's plane.
    fn below(&self, contact: Point3<f64>, outward: Vector3<f64>) -> Vec<Below> {
        let across = outward.cross(&if outward.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() }).normalize();
        let along = outward.cross(&across);
        let reach_m = (1.0 + COARSE) * self.radius_m;
        let near = self.cells.near(contact, reach_m.hypot(DEEPEST_M));
        let facing = near.filter(|&i| self.points[i].normal.dot(&outward) > FACING);
        let in_plane = |v: &Vector3<f64>| [v.dot(&across), v.dot(&along)];
        let point = |i: usize| {
            let SurfacePoint { position, normal, .. } = self.points[i];
            let off = position - contact;
            let falls = Vector2::from(in_plane(&normal)) / normal.dot(&outward);
            Below { at: in_plane(&off), height_m: off.dot(&outward), falls }
        };
        let is_near = |p: &Below| p.height_m.abs() <= DEEPEST_M && is_within(p.at, [0.0; 2], reach_m);
        let all: Vec<Below> = facing.map(point).filter(is_near).collect();
        let step = all.len().div_ceil(MOST).max(1);
        all.into_iter().step_by(step).collect()
    }

    /// Points that each stand for the same area of a pad.
    fn spread(&self) -> Vec<OnPad> {
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let seed = |k: usize| {
            let off = self.radius_m * ((k as f64 + 0.5) / SPREAD as f64).sqrt();
            let (sin, cos) = (k as f64 * golden).sin_cos();
            [off * cos, off * sin]
        };
        (0..SPREAD).map(seed).collect()
    }
}

/// Mean distance of the pressure from the middle of an evenly pressed disc, m.
pub fn whole_arm_m(radius_m: f64) -> f64 {
    2.0 / 3.0 * radius_m
}

/// How far the pressure on a pad whose pressure has this arm can move before an edge lifts off, m.
pub fn whole_shift_m(arm_m: f64) -> f64 {
    KERN * arm_m
}

/// The larger curvature of the surface under a pad: how fast it falls, by least squares over the place. Positive if it is convex.
fn curvature_1_m(below: &[Below], radius_m: f64) -> f64 {
    let under: Vec<&Below> = below.iter().filter(|point| is_within(point.at, [0.0; 2], radius_m)).collect();
    let middle = under.iter().map(|point| Vector2::from(point.at)).sum::<Vector2<f64>>() / under.len().max(1) as f64;
    let (mut spread, mut fall) = (Matrix2::zeros(), Matrix2::zeros());
    for point in under {
        let off = Vector2::from(point.at) - middle;
        spread += off * off.transpose();
        fall += point.falls * off.transpose();
    }
    let Some(inverse) = spread.try_inverse() else { return 0.0 };
    let curvature = fall * inverse;
    (0.5 * (curvature + curvature.transpose())).symmetric_eigenvalues().max()
}

/// How far apart the points are where they are few; `None` if there are too few of them.
fn spacing_m(points: &[Below]) -> Option<f64> {
    let count = points.len().min(MEASURED);
    let of_point = |k: usize| {
        let own = &points[k * points.len() / count];
        let mut distances: Vec<f64> = points.iter().map(|other| distance(other.at, own.at)).collect();
        // The first is the point itself.
        (distances.len() > NEIGHBOUR).then(|| *distances.select_nth_unstable_by(NEIGHBOUR, f64::total_cmp).1)
    };
    let mut all: Vec<f64> = (0..count).filter_map(of_point).collect();
    all.sort_by(f64::total_cmp);
    all.get((WIDELY * all.len() as f64) as usize).copied()
}

/// Whether points without a hole between them lie all around a place. (The union of discs around the points, from whose edge as
/// much is taken again: what they cover is no wider than they are.)
fn covers(points: &[Below], hole_m: f64, [x, y]: OnPad) -> bool {
    (0..AROUND).all(|k| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / AROUND as f64).sin_cos();
        let beside = [x + hole_m * cos, y + hole_m * sin];
        points.iter().any(|point| is_within(point.at, beside, hole_m))
    })
}

/// The mean height of the surface around a place; `None` in a hole.
fn height_m(points: &[Below], hole_m: f64, at: OnPad) -> Option<f64> {
    let near = points.iter().filter(|point| is_within(point.at, at, hole_m));
    let (count, sum) = near.fold((0, 0.0), |(count, sum), point| (count + 1, sum + point.height_m));
    (count > 0).then(|| sum / f64::from(count))
}

/// The mean distance of the pressure from its middle.
fn mean_arm_m(pressed: &[Pressed]) -> f64 {
    let all: f64 = pressed.iter().map(|point| point.depth_m).sum();
    if all <= 0.0 {
        return 0.0;
    }
    let mean = |value: &dyn Fn(OnPad) -> f64| pressed.iter().map(|p| p.depth_m * value(p.at)).sum::<f64>() / all;
    let middle = [mean(&|[x, _]| x), mean(&|[_, y]| y)];
    mean(&|at| distance(at, middle))
}

fn is_within([x, y]: OnPad, [u, v]: OnPad, reach_m: f64) -> bool {
    (x - u).powi(2) + (y - v).powi(2) <= reach_m * reach_m
}

fn distance([x, y]: OnPad, [u, v]: OnPad) -> f64 {
    (x - u).hypot(y - v)
}
