//! The position and size of the object.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::gaussians::{ELLIPSOID_DEVIATIONS, Gaussians};
use crate::numeric::scatter;
use crate::parallel;

/// An axis-aligned box in the world frame, scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    pub min: Point3<f64>,
    pub max: Point3<f64>,
}

impl Bounds {
    pub fn center(&self) -> Point3<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    pub fn size(&self) -> Vector3<f64> {
        self.max - self.min
    }

    pub fn diagonal(&self) -> f64 {
        self.size().norm()
    }
}

/// An extent of the object in scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Side {
    pub length: f64,
    /// How far off the length may be either way: by as much as it shrinks if `STRAY_SHARE` of the ellipsoids count as strays,
    /// not `STRAY_BODIES`. It is estimated from the cloud alone and is no calibrated interval: of the twelve sides of the
    /// four fixtures, it covers the true lengths of nine, and misses the others by at most half a percent of the length. 0
    /// for so few ellipsoids that neither share amounts to one.
    pub error: f64,
}

/// The object's extents along the world's axes. `floor` is the height of the surface on which it stands, if it was cut out of
/// what surrounds it; see [`least_box`].
pub fn sides(gaussians: &Gaussians, floor: Option<f64>) -> [Side; 3] {
    sides_along(&Matrix3::identity(), gaussians, &opaque(gaussians), floor)
}

/// Length of the object's longest side in scene units, see [`least_box`].
pub fn longest_side(gaussians: &Gaussians, floor: Option<f64>) -> f64 {
    least_box(gaussians, floor)[0]
}

/// The sides of a box around the object in scene units, the longest first: of the box of least volume among those along the
/// world's axes, along the principal axes of the centres, and along either of these turned about one of its axes.
///
/// If the object stands on a surface at the height `floor`, the box stands on it, too, and is turned about the vertical only:
/// no photo shows the underside, so Gaussians reach into the surface, and scraps of the surface cling to the object. In a
/// capture of five objects, the heights were 9 to 47 % too large without this, and 1 to 15 % with it.
pub fn least_box(gaussians: &Gaussians, floor: Option<f64>) -> [f64; 3] {
    let chosen = opaque(gaussians);
    let center = |&i: &usize| gaussians.center(i).coords;
    // A single far stray would turn the principal axes.
    let near = robust_bounds(gaussians);
    let is_near = |center: &Vector3<f64>| *center >= near.min.coords && *center <= near.max.coords;
    let core: Vec<Vector3<f64>> = chosen.iter().map(center).filter(is_near).collect();
    let along = |axes: Matrix3<f64>| {
        let mut lengths = sides_along(&axes, gaussians, &chosen, floor).map(|side| side.length);
        lengths.sort_by(|a, b| b.total_cmp(a));
        lengths
    };
    if floor.is_some() {
        return along(turned(Matrix3::identity(), &core, &[VERTICAL]));
    }
    let (_, spread) = scatter(core.iter());
    let boxes = [Matrix3::identity(), spread.symmetric_eigen().eigenvectors].map(|axes| {
        let lengths = along(turned(axes, &core, &[0, 1, 2]));
        // Below the precision of positions, a side is as good as none: the volume of a flat object would be zero or rounding
        // errors, and would not tell how well the box fits.
        let volume: f64 = lengths.iter().map(|length| length.max(lengths[0] * f64::from(f32::EPSILON))).product();
        (volume, lengths)
    });
    let [along_world, principal] = boxes;
    if principal.0 < along_world.0 { principal.1 } else { along_world.1 }
}

/// The least extent of a surface through these points, in any direction: the thickness of a plate of the same spread. That of a
/// ball is its diameter, that of a long round rod 1.2 times that.
pub fn least_extent(points: impl Iterator<Item = Point3<f64>>) -> f64 {
    let points: Vec<Vector3<f64>> = points.map(|point| point.coords).collect();
    let count = points.len().max(1) as f64;
    let (_, spread) = scatter(points.iter());
    // A plate of thickness 1 has a standard deviation of 1 / sqrt(12).
    (12.0 * spread.symmetric_eigenvalues().min().max(0.0) / count).sqrt()
}

/// As many points as the best turn is sought for: more would find the same to half a degree.
const POINTS_TO_TURN: usize = 5000;
/// A turn is taken only if it makes the box smaller by more than this: an object along its axes stays there.
const LEAST_GAIN: f64 = 0.02;

/// The axes, turned about one of those `abouts` so that a box along them around the points is the smallest. The principal axes of a thing
/// that is as wide as deep, such as a square block, are arbitrary about its length.
fn turned(axes: Matrix3<f64>, points: &[Vector3<f64>], abouts: &[usize]) -> Matrix3<f64> {
    let few: Vec<&Vector3<f64>> = points.iter().step_by(points.len() / POINTS_TO_TURN + 1).collect();
    let length = |along: &Vector3<f64>| {
        let ends =
            |(low, high): (f64, f64), point: &&Vector3<f64>| (low.min(along.dot(point)), high.max(along.dot(point)));
        let (low, high) = few.iter().fold((f64::INFINITY, f64::NEG_INFINITY), ends);
        (high - low).max(0.0)
    };
    let area = |about: usize, degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let [a, b] = [(about + 1) % 3, (about + 2) % 3].map(|n| axes.column(n).into_owned());
        let [across, up] = [a * cos + b * sin, b * cos - a * sin];
        (length(&across) * length(&up), across, up)
    };
    let mut best = (1.0 - LEAST_GAIN, axes);
    for &about in abouts {
        let (straight, ..) = area(about, 0.0);
        for degrees in 1..90 {
            let (turned, across, up) = area(about, f64::from(degrees));
            if turned < best.0 * straight {
                let mut columns = axes;
                columns.set_column((about + 1) % 3, &across);
                columns.set_column((about + 2) % 3, &up);
                best = (turned / straight, columns);
            }
        }
    }
    best.1
}

/// Share of the centres that are left out at each end of an axis: trained splats have floaters, and one of them would
/// stretch the full box.
const STRAY_SHARE: f64 = 0.005;
/// Share of the ellipsoids that may reach beyond each end of a side: as for the half spaces that bound what no view sees (gprop's
/// `parts::inside::hull`), since there are always a few strays. Any share makes a side shorter, so a length that is to be
/// exact leaves out fewer than a box that only has to show where the object is.
const STRAY_BODIES: f64 = 0.001;
/// The same, and the share with which a length is compared, of an object that was cut out of what surrounds it: scraps of that
/// cling to it.
const SCRAPS: [f64; 2] = [0.005, 0.02];
/// The axis that points up in the world.
const VERTICAL: usize = 2;

/// The box between the 0.5 and the 99.5 percentile of the centres of the `opaque` Gaussians. It tells where the object is;
/// [`sides`] tell how large it is, since its surface is where the ellipsoids end, outside of their centres.
pub fn robust_bounds(gaussians: &Gaussians) -> Bounds {
    let chosen = opaque(gaussians);
    let mut bounds = Bounds { min: Point3::origin(), max: Point3::origin() };
    for axis in 0..3 {
        let mut values: Vec<f64> = chosen.iter().map(|&i| f64::from(gaussians.positions[i][axis])).collect();
        (bounds.min[axis], bounds.max[axis]) = between_strays(&mut values.clone(), &mut values, STRAY_SHARE);
    }
    bounds
}

/// The box between the 0.5 and the 99.5 percentile of the ends of the ellipsoids of the `opaque` Gaussians: the box around a
/// thing that need not stand along the axes, whose corners have few Gaussians.
pub fn ellipsoid_bounds(gaussians: &Gaussians) -> Bounds {
    let chosen = opaque(gaussians);
    let mut bounds = Bounds { min: Point3::origin(), max: Point3::origin() };
    for axis in 0..3 {
        let along = Vector3::ith(axis, 1.0);
        let (mut lows, mut highs): (Vec<f64>, Vec<f64>) =
            parallel::map(&chosen, |&i| ellipsoid_ends(gaussians, i, &along)).into_iter().unzip();
        (bounds.min[axis], bounds.max[axis]) = between_strays(&mut lows, &mut highs, STRAY_SHARE);
    }
    bounds
}

/// Where the ellipsoid of Gaussian `i` ends along a unit vector.
fn ellipsoid_ends(gaussians: &Gaussians, i: usize, along: &Vector3<f64>) -> (f64, f64) {
    let (center, reach) =
        (along.dot(&gaussians.center(i).coords), ELLIPSOID_DEVIATIONS * gaussians.deviation(i, along));
    (center - reach, center + reach)
}

/// The extents of the ellipsoids of the Gaussians `chosen` along each column of `axes`; along the vertical, nothing is below
/// `floor`.
fn sides_along(axes: &Matrix3<f64>, gaussians: &Gaussians, chosen: &[usize], floor: Option<f64>) -> [Side; 3] {
    let shares = if floor.is_some() { SCRAPS } else { [STRAY_BODIES, STRAY_SHARE] };
    [0, 1, 2].map(|axis| {
        let lowest = floor.filter(|_| axis == VERTICAL).unwrap_or(f64::NEG_INFINITY);
        let along: Vector3<f64> = axes.column(axis).into_owned();
        let ends = parallel::map(chosen, |&i| ellipsoid_ends(gaussians, i, &along));
        let (mut lows, mut highs): (Vec<f64>, Vec<f64>) = ends.into_iter().unzip();
        let [length, shorter] = shares.map(|share| {
            let (low, high) = between_strays(&mut lows, &mut highs, share);
            (high - low.max(lowest)).max(0.0)
        });
        Side { length, error: length - shorter }
    })
}

/// The Gaussians that are at least half opaque (all if none is), excluding those set aside.
fn opaque(gaussians: &Gaussians) -> Vec<usize> {
    let kept = || (0..gaussians.len()).filter(|&i| !gaussians.is_set_aside(i));
    let chosen: Vec<usize> = kept().filter(|&i| gaussians.opacity_logits[i] >= 0.0).collect();
    if chosen.is_empty() { kept().collect() } else { chosen }
}

/// The least of the lower ends and the greatest of the upper ends, apart from this share of each; zeros if there are none.
/// Reorders both.
fn between_strays(lows: &mut [f64], highs: &mut [f64], share: f64) -> (f64, f64) {
    let Some(last) = lows.len().checked_sub(1) else { return (0.0, 0.0) };
    let strays = (lows.len() as f64 * share) as usize;
    let low = *lows.select_nth_unstable_by(strays, f64::total_cmp).1;
    let high = *highs.select_nth_unstable_by(last - strays, f64::total_cmp).1;
    (low, high)
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    /// Round Gaussians at these places, with ellipsoids of this radius.
    fn cloud(positions: Vec<[f32; 3]>, radius: f64) -> Gaussians {
        let count = positions.len();
        Gaussians {
            positions,
            log_scales: vec![[(radius / ELLIPSOID_DEVIATIONS).ln() as f32; 3]; count],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; count],
            opacity_logits: vec![3.0; count],
            ..Gaussians::default()
        }
    }

    /// A rod of 10 x 1 x 1, turned by this angle, with one stray Gaussian. Its ellipsoids end at its faces.
    fn rod(angle: f64) -> Gaussians {
        const RADIUS: f64 = 0.25;
        let turned = Rotation3::from_euler_angles(0.3 * angle, angle, 0.7 * angle);
        let between =
            |side: f64, index: usize, count: usize| (side - 2.0 * RADIUS) * (index as f64 / (count - 1) as f64 - 0.5);
        let places =
            (0..201 * 25).map(|i| [between(10.0, i / 25, 201), between(1.0, i / 5 % 5, 5), between(1.0, i % 5, 5)]);
        let turn = |place: [f64; 3]| (turned * Vector3::from(place)).map(|v| v as f32).into();
        cloud(places.map(turn).chain([[500.0, 0.0, 0.0]]).collect(), RADIUS)
    }

    #[test]
    fn the_longest_side_does_not_depend_on_how_the_object_lies() {
        for angle in [0.0, 0.4, 1.0, 2.0] {
            let length = longest_side(&rod(angle), None);
            assert!((length / 10.0 - 1.0).abs() < 0.03, "turned by {angle}: {length}");
        }
        assert_eq!(longest_side(&Gaussians::default(), None), 0.0);
    }

    /// Positions and log scales are rounded to 24 bits.
    const ROUNDING: f64 = 1e-5;

    #[test]
    fn sides_reach_from_where_the_first_body_begins_to_where_the_last_ends() {
        for (side, length) in sides(&rod(0.0), None).into_iter().zip([10.0, 1.0, 1.0]) {
            assert!((side.length - length).abs() < ROUNDING, "{side:?} is not {length}");
        }
    }

    #[test]
    fn the_error_of_a_side_is_what_a_few_more_strays_would_take_off() {
        // 1000 centres on a line, a thousandth apart: one ellipsoid is left out at either end, or five.
        let line = cloud((0..1000).map(|i| [i as f32 / 1000.0, 0.0, 0.0]).collect(), 0.1);
        let [along, across, _] = sides(&line, None);
        assert!((along.length - (0.997 + 0.2)).abs() < ROUNDING && (along.error - 0.008).abs() < ROUNDING, "{along:?}");
        assert!((across.length - 0.2).abs() < ROUNDING && across.error.abs() < ROUNDING, "{across:?}");
        assert_eq!(sides(&Gaussians::default(), None), [Side { length: 0.0, error: 0.0 }; 3]);
    }

    /// A block of 2 x 1 x 1.5, turned about the vertical, on a surface at the height 5. Below it, Gaussians reach into the surface;
    /// scraps lie beside it.
    #[test]
    fn what_stands_on_a_surface_ends_there() {
        const RADIUS: f64 = 0.05;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.4);
        let between =
            |side: f64, index: usize, count: usize| RADIUS + (side - 2.0 * RADIUS) * index as f64 / (count - 1) as f64;
        let block = (0..20 * 10 * 15).map(|i| -> [f32; 3] {
            let place = [between(2.0, i / 150, 20), between(1.0, i / 15 % 10, 10), between(1.5, i % 15, 15)];
            let turned: Vector3<f64> = turn * Vector3::from(place);
            let [x, y, z]: [f64; 3] = turned.into();
            [x as f32, y as f32, (z + 5.0) as f32]
        });
        let roots = (0..30).map(|i| [0.5, 0.6, 5.0 - 0.02 * i as f32]);
        let scraps = (0..10).map(|i| [3.0 + 0.1 * i as f32, 3.0, 5.0]);
        let cloud = cloud(block.chain(roots).chain(scraps).collect(), RADIUS);
        let standing = least_box(&cloud, Some(5.0));
        for (found, side) in standing.into_iter().zip([2.0, 1.5, 1.0]) {
            assert!((found / side - 1.0).abs() < 0.02, "{standing:?}");
        }
        assert!((sides(&cloud, Some(5.0))[2].length - 1.5).abs() < 0.02);
        assert!(least_box(&cloud, None)[0] > 3.0);
    }

    #[test]
    fn a_flat_object_is_as_long_as_it_is_however_it_lies() {
        let flat = |angle: f64| {
            let (sin, cos) = angle.sin_cos();
            let place = |i: usize| [(i / 5) as f64 / 200.0 * 10.0, (i % 5) as f64 / 4.0];
            let turn = |[x, y]: [f64; 2]| [(cos * x - sin * y) as f32, (sin * x + cos * y) as f32, 0.5];
            let mut cloud = cloud((0..1005).map(place).map(turn).collect(), 0.01);
            // No thickness at all.
            cloud.log_scales.iter_mut().for_each(|scale| scale[2] = -1000.0);
            longest_side(&cloud, None)
        };
        for angle in [0.0, 0.4, std::f64::consts::FRAC_PI_4, 2.0] {
            assert!((flat(angle) / 10.0 - 1.0).abs() < 0.03, "turned by {angle}: {}", flat(angle));
        }
    }
}
