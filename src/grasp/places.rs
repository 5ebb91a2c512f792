//! Antipodal places: two opposite contacts on one part, each within the friction cone of the line between them.
//!
//! Seeds spread over the surface look straight inward for surface that faces the other way. The nearest such surface is
//! the other side of the wall on which they lie, the farthest is the other side of the whole object (for a mug, the other
//! side of its wall, and that of the whole mug); each makes a pair. Normals are first averaged over the finger's contact, because a finger
//! does not feel single Gaussians.

use nalgebra::{Point3, Vector3};

use super::cells::Cells;
use super::surface::{Surface, SurfacePoint};
use crate::numeric::evenly;
use crate::parallel;

/// Seeds, spread evenly over the points.
const SEEDS: usize = 2000;
/// Most points that are looked at, evenly chosen: a fingertip touches hundreds of so many, and the work grows with the square
/// of their number.
const MOST_POINTS: usize = 100_000;
/// If a part is thinner than this, its two sides cannot be distinguished from the noise of one, m.
const THINNEST_M: f64 = 0.002;

/// Where to look for places.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Where {
    /// On the whole object.
    Anywhere,
    /// On the part with this label: its index in the list of labels.
    Part(u32),
    /// As near as possible to this point, m.
    Near(Point3<f64>),
}

/// Two opposite contacts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// World frame, m.
    pub contacts: [Point3<f64>; 2],
    /// Label of the part that both contacts are on: its index in the list of labels.
    pub part: u32,
    /// Thickness of the part at the contact, m: the width, or less if the line leaves the part and enters it again.
    pub thickness_m: f64,
    /// The larger of the angles between the line and the two normals, radians.
    pub misalignment_rad: f64,
}

impl Place {
    /// Distance between the contacts, m.
    pub fn width_m(&self) -> f64 {
        (self.contacts[1] - self.contacts[0]).norm()
    }

    /// Unit vector from the first contact to the second.
    pub fn axis(&self) -> Vector3<f64> {
        (self.contacts[1] - self.contacts[0]).normalize()
    }

    pub fn middle(&self) -> Point3<f64> {
        nalgebra::center(&self.contacts[0], &self.contacts[1])
    }

    /// Distance of a point from the nearer contact, m.
    pub fn nearest_m(&self, point: Point3<f64>) -> f64 {
        self.contacts.iter().map(|contact| (contact - point).norm()).fold(f64::INFINITY, f64::min)
    }

    /// Distance of a point from the middle of the contacts along their line, m.
    pub fn offset_m(&self, point: Point3<f64>) -> f64 {
        (point - self.middle()).dot(&self.axis()).abs()
    }

    /// Distance of a point from the line through the contacts, m.
    pub fn lever_m(&self, point: Point3<f64>) -> f64 {
        (point - self.contacts[0]).cross(&self.axis()).norm()
    }
}

/// All antipodal pairs that the seeds find, of any width. `friction` is by label; `contact_radius_m` is the finger's.
pub fn places(surface: &Surface, place: Where, friction: &[f64], contact_radius_m: f64) -> Vec<Place> {
    let points: Vec<SurfacePoint> = evenly(&surface.points, MOST_POINTS).copied().collect();
    let smooth = smoothed(&points, contact_radius_m);
    let wanted = |p: &&SurfacePoint| match place {
        Where::Part(part) => p.part == part,
        Where::Anywhere | Where::Near(_) => true,
    };
    let mut seeds: Vec<&SurfacePoint> = smooth.iter().filter(wanted).collect();
    if let Where::Near(point) = place {
        seeds.sort_by(|a, b| (a.position - point).norm().total_cmp(&(b.position - point).norm()));
        seeds.truncate(SEEDS);
    }
    let count = seeds.len().min(SEEDS);
    parallel::flat_map_range(count, |k| {
        let seed = seeds[k * seeds.len() / count];
        opposite(seed, &smooth, friction[seed.part as usize], contact_radius_m)
    })
}

/// The points with the mean normal of those of the same part within a contact's radius that face the same way, moved
/// along it to their median.
fn smoothed(points: &[SurfacePoint], radius_m: f64) -> Vec<SurfacePoint> {
    /// Facing the same way: within 60 degrees.
    const ALIKE: f64 = 0.5;
    let positions: Vec<Point3<f64>> = points.iter().map(|p| p.position).collect();
    let cells = Cells::new(&positions, radius_m);
    let smooth = |p: &SurfacePoint| {
        let beside = || {
            let near = cells.near(p.position, radius_m).map(|i| &points[i]);
            near.filter(|q| q.part == p.part && q.normal.dot(&p.normal) > ALIKE)
        };
        let normal = beside().map(|q| q.normal).sum::<Vector3<f64>>().try_normalize(0.0).unwrap_or(p.normal);
        let mut heights: Vec<f64> = beside().map(|q| (q.position - p.position).dot(&normal)).collect();
        heights.sort_by(f64::total_cmp);
        let height = heights.get(heights.len() / 2).copied().unwrap_or(0.0);
        SurfacePoint { position: p.position + normal * height, normal, part: p.part }
    };
    parallel::map(points, smooth)
}

/// The nearest and the farthest place opposite a seed.
fn opposite(seed: &SurfacePoint, points: &[SurfacePoint], friction: f64, radius_m: f64) -> impl Iterator<Item = Place> {
    let cone = friction.atan();
    let mut nearest: Option<(f64, Place)> = None;
    let mut farthest: Option<(f64, Place)> = None;
    for other in points.iter().filter(|q| q.part == seed.part) {
        let between = other.position - seed.position;
        let depth = -between.dot(&seed.normal);
        if depth < THINNEST_M || (between + seed.normal * depth).norm() > radius_m {
            continue;
        }
        let width = between.norm();
        let angle = |cosine: f64| cosine.clamp(-1.0, 1.0).acos();
        let misalignment_rad = angle(depth / width).max(angle(other.normal.dot(&between) / width));
        if misalignment_rad > cone {
            continue;
        }
        let contacts = [seed.position, other.position];
        let place = Place { contacts, part: seed.part, thickness_m: width, misalignment_rad };
        // Among those in one sheet, the best aligned: each counts as less near, or less far, by its distance from the line.
        let off = width * misalignment_rad.sin();
        if nearest.is_none_or(|(least, _)| depth + off < least) {
            nearest = Some((depth + off, place));
        }
        if farthest.is_none_or(|(most, _)| depth - off > most) {
            farthest = Some((depth - off, place));
        }
    }
    let thickness_m = nearest.map(|(_, place)| place.thickness_m);
    let (near, far) = (nearest.map(|(_, place)| place), farthest.map(|(_, place)| place));
    let far = far.filter(|far| Some(*far) != near).zip(thickness_m);
    near.into_iter().chain(far.map(|(far, thickness_m)| Place { thickness_m, ..far }))
}
