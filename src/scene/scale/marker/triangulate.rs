//! A marker's corners in the world, from all views that show it.
//!
//! Any two views give a place for the corners. The place on which most views agree is refined over those views
//! (Gauss-Newton on the distances in pixels), and views that are then off are left out.

use nalgebra::{Matrix2x3, Matrix3, Matrix4, Point3, RowVector4, Vector2, Vector3};

use super::detect::{Detection, side};
use crate::camera::Camera;
use crate::numeric::{NORMAL_90, upper_median};

/// A marker in one view.
pub(super) struct Sighting<'a> {
    pub view: usize,
    pub camera: &'a Camera,
    pub detection: Detection,
}

/// The result of triangulating the corners.
pub(super) struct Corners {
    /// The sightings that agree, and the distance in pixels (root mean square over the corners) of those that do not.
    pub agreeing: Vec<usize>,
    pub disagreeing: Vec<(usize, f64)>,
    /// The mean length of the four sides, and the half-width of its 90 % interval.
    pub side: f64,
    pub side_error: f64,
}

/// At first, a view agrees with a place that is at most this far from its own corners, in pixels plus a share of the
/// marker's side: cameras from structure from motion are off by about a pixel, and a place from two views is off by more
/// in a third.
const AGREES_PX: f64 = 2.0;
const AGREES_SHARE: f64 = 0.03;
/// In the end, a view is left out if it is farther off than this many times the median of the others, and than a pixel.
const OUTLIER: f64 = 3.0;
const LEAST_OUTLIER_PX: f64 = 1.0;
/// Pairs are formed of at most this many sightings, spread evenly.
const PAIRED: usize = 30;
/// Steps of Gauss-Newton; from a linear start, three suffice.
const STEPS: usize = 10;
/// Rounds of leaving views out.
const ROUNDS: usize = 5;
/// How far an edge may seem to be from its place, in pixels, outwards or inwards in all photos alike, so that the distances
/// from where the views see the corners do not show it: a camera's tone curve and sharpening shift an edge by a share of
/// its blur (in photos rendered with known blur, by up to 0.1 pixels).
const EDGE_PX: f64 = 0.1;

/// The corners on which most sightings agree; `None` if no two from different views do.
pub(super) fn corners(sightings: &[Sighting]) -> Option<Corners> {
    let mut agreeing = most_agreeing(sightings)?;
    let mut points = place(sightings, &agreeing)?;
    for _ in 0..ROUNDS {
        let off = |at: &usize| distance(&sightings[*at], &points);
        let usual = upper_median(agreeing.iter().map(off).collect())?;
        let most = (OUTLIER * usual).max(LEAST_OUTLIER_PX);
        let kept = best_of_each_view(sightings, |at| Some(off(&at)).filter(|off| *off <= most));
        if kept.len() < 2 || kept == agreeing {
            break;
        }
        agreeing = kept;
        points = place(sightings, &agreeing)?;
    }
    let shown: Vec<usize> = agreeing.iter().map(|at| sightings[*at].view).collect();
    let nearest = best_of_each_view(sightings, |at| Some(distance(&sightings[at], &points)));
    let disagreeing = nearest.into_iter().filter(|at| !shown.contains(&sightings[*at].view));
    let disagreeing = disagreeing.map(|at| (at, distance(&sightings[at], &points))).collect();
    let (side, side_error) = length(sightings, &agreeing, &points)?;
    Some(Corners { agreeing, disagreeing, side, side_error })
}

/// The sightings that agree with the place that a pair of them gives, for the pair with which most agree.
fn most_agreeing(sightings: &[Sighting]) -> Option<Vec<usize>> {
    let step = sightings.len().div_ceil(PAIRED).max(1);
    let paired: Vec<usize> = (0..sightings.len()).step_by(step).collect();
    let mut best: Option<(usize, f64, Vec<usize>)> = None;
    for (n, first) in paired.iter().enumerate() {
        for second in &paired[n + 1..] {
            if sightings[*first].view == sightings[*second].view {
                continue;
            }
            let Some(points) = place(sightings, &[*first, *second]) else { continue };
            let off = |at: usize| {
                let most = AGREES_PX + AGREES_SHARE * side(&sightings[at].detection.corners);
                Some(distance(&sightings[at], &points)).filter(|off| *off <= most)
            };
            let agreeing = best_of_each_view(sightings, off);
            let (count, sum) = (agreeing.len(), agreeing.iter().map(|at| distance(&sightings[*at], &points)).sum());
            let is_better =
                best.as_ref().is_none_or(|(most, least, _)| count > *most || (count == *most && sum < *least));
            if count >= 2 && is_better {
                best = Some((count, sum, agreeing));
            }
        }
    }
    best.map(|(.., agreeing)| agreeing)
}

/// Of each view's sightings with a distance, the one with the least.
fn best_of_each_view(sightings: &[Sighting], off: impl Fn(usize) -> Option<f64>) -> Vec<usize> {
    let mut best: Vec<(usize, f64)> = Vec::new();
    for (at, sighting) in sightings.iter().enumerate() {
        let Some(off) = off(at) else { continue };
        match best.last_mut().filter(|(other, _)| sightings[*other].view == sighting.view) {
            Some((other, least)) if off < *least => (*other, *least) = (at, off),
            Some(_) => {}
            None => best.push((at, off)),
        }
    }
    best.into_iter().map(|(at, _)| at).collect()
}

/// Root mean square of the distances of a sighting's corners from where its camera sees `points`, in pixels.
fn distance(sighting: &Sighting, points: &[Point3<f64>; 4]) -> f64 {
    let squares =
        (0..4).map(|corner| residual(sighting, corner, &points[corner]).map_or(f64::INFINITY, |r| r.norm_squared()));
    (squares.sum::<f64>() / 4.0).sqrt()
}

/// From where the camera sees `point` to where the photo shows it, in pixels; `None` behind the camera.
fn residual(sighting: &Sighting, corner: usize, point: &Point3<f64>) -> Option<Vector2<f64>> {
    let i = &sighting.camera.intrinsics;
    let p = sighting.camera.point_in_camera(*point);
    let seen = sighting.detection.corners[corner];
    (p.z > 0.0).then(|| Vector2::new(seen.x - i.cx - i.fx * p.x / p.z, seen.y - i.cy - i.fy * p.y / p.z))
}

/// How the pixel at which the camera sees a point changes with the point.
fn jacobian(sighting: &Sighting, point: &Point3<f64>) -> Matrix2x3<f64> {
    let i = &sighting.camera.intrinsics;
    let p = sighting.camera.point_in_camera(*point);
    let of_camera =
        Matrix2x3::new(i.fx / p.z, 0.0, -i.fx * p.x / p.z.powi(2), 0.0, i.fy / p.z, -i.fy * p.y / p.z.powi(2));
    of_camera * sighting.camera.camera_from_world.rotation.to_rotation_matrix().matrix()
}

/// The points that these sightings see.
fn place(sightings: &[Sighting], of: &[usize]) -> Option<[Point3<f64>; 4]> {
    let corner = |corner: usize| {
        let mut point = linear(sightings, of, corner)?;
        for _ in 0..STEPS {
            let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
            for at in of {
                let (residual, jacobian) =
                    (residual(&sightings[*at], corner, &point)?, jacobian(&sightings[*at], &point));
                normal += jacobian.transpose() * jacobian;
                right += jacobian.transpose() * residual;
            }
            point += normal.try_inverse()? * right;
        }
        point.coords.iter().all(|value| value.is_finite()).then_some(point)
    };
    Some([corner(0)?, corner(1)?, corner(2)?, corner(3)?])
}

/// The point whose projections satisfy all sightings best, in the algebraic sense (Hartley and Zisserman, *Multiple View
/// Geometry*, 12.2).
fn linear(sightings: &[Sighting], of: &[usize], corner: usize) -> Option<Point3<f64>> {
    let mut normal = Matrix4::zeros();
    for at in of {
        let Sighting { camera, detection, .. } = &sightings[*at];
        let (i, seen) = (&camera.intrinsics, detection.corners[corner]);
        let pose = camera.camera_from_world.to_homogeneous();
        let row = |n: usize| RowVector4::from(pose.row(n));
        for row in [row(2) * ((seen.x - i.cx) / i.fx) - row(0), row(2) * ((seen.y - i.cy) / i.fy) - row(1)] {
            normal += row.transpose() * row;
        }
    }
    let eigen = normal.symmetric_eigen();
    Point3::from_homogeneous(eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned())
}

/// The mean length of the square's sides, and the half-width of its 90 % interval. It has three causes, added in quadrature:
///
/// - the corners' distances from where the views see them. They are taken to be independent of each other, or to be shared
///   by the corners of a view (whose camera is off), whichever gives the wider interval;
/// - the difference of height and width, of which one may be right: a printer may stretch a page along one side, and a
///   sheet may be bent;
/// - what moves all edges of the square outwards or inwards in every photo, by [`EDGE_PX`].
fn length(sightings: &[Sighting], of: &[usize], points: &[Point3<f64>; 4]) -> Option<(f64, f64)> {
    let sides: [f64; 4] = std::array::from_fn(|n| (points[(n + 1) % 4] - points[n]).norm());
    let mean = sides.iter().sum::<f64>() / 4.0;
    let toward = |n: usize, m: usize| (points[n] - points[m]) / (points[n] - points[m]).norm();
    let (mut independent, mut squares) = (0.0, 0.0);
    let mut of_views = vec![0.0; of.len()];
    for (corner, point) in points.iter().enumerate() {
        let slope = 0.25 * (toward(corner, (corner + 1) % 4) + toward(corner, (corner + 3) % 4));
        let mut normal = Matrix3::zeros();
        for at in of {
            let jacobian = jacobian(&sightings[*at], point);
            normal += jacobian.transpose() * jacobian;
        }
        let inverse = normal.try_inverse()?;
        independent += slope.dot(&(inverse * slope));
        for (at, shift) in of.iter().zip(&mut of_views) {
            let residual = residual(&sightings[*at], corner, point)?;
            squares += residual.norm_squared();
            *shift += slope.dot(&(inverse * jacobian(&sightings[*at], point).transpose() * residual));
        }
    }
    // Eight numbers per view less the twelve coordinates of four corners.
    let freedom = (8 * of.len()) as f64 - 12.0;
    let independent = independent * squares / freedom;
    // Three coordinates of a corner take up one and a half of its sightings.
    let count = of.len() as f64;
    let shared = of_views.iter().map(|shift| shift * shift).sum::<f64>() * count / (count - 1.5);
    // Student's distribution, to first order in 1 / freedom.
    let ends = NORMAL_90 * (1.0 + (NORMAL_90.powi(2) + 1.0) / (4.0 * freedom));
    let stretched = 0.25 * (sides[0] + sides[2] - sides[1] - sides[3]);
    let pixels = upper_median(of.iter().map(|at| side(&sightings[*at].detection.corners)).collect())?;
    let moved = 2.0 * EDGE_PX / pixels * mean;
    Some((mean, (ends * independent.max(shared).sqrt()).hypot(stretched).hypot(moved)))
}
