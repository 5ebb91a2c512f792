//! The frame that gsplat's example trainer works in by default: with `normalize_world_space`, it moves COLMAP's cameras and
//! points by a similarity that it writes nowhere, and saves the splat in the new frame. The similarity follows from the
//! model; see `examples/datasets/normalize.py` and `colmap.py` of nerfstudio-project/gsplat:
//!
//! 1. `similarity_from_cameras`: the mean of the cameras' up axes becomes -y; the median of the points at which the
//!    optical axes pass nearest to the origin becomes the origin; the median distance of the cameras from it becomes 1.
//! 2. `align_principal_axes`: the points' principal axes become x, y, z, the longest first, and their median the origin.
//! 3. In newer versions, a half turn about x if more of the points' spread is above their median.
//!
//! The signs of the principal axes are an accident of the eigenvalue solver, and step 3 depends on the version, so the
//! similarity is one of four, which differ by a half turn about an axis of the result.

use std::f64::consts::PI;
use std::fmt;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Similarity3, Translation3, UnitQuaternion, Vector3};

use crate::numeric::{median, scatter};

/// A half turn about one of the new axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HalfTurn {
    None,
    X,
    Y,
    Z,
}

impl HalfTurn {
    pub const ALL: [Self; 4] = [Self::None, Self::X, Self::Y, Self::Z];

    fn rotation(self) -> UnitQuaternion<f64> {
        match self {
            Self::None => UnitQuaternion::identity(),
            Self::X => UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI),
            Self::Y => UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PI),
            Self::Z => UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI),
        }
    }
}

/// As `--align` names the similarity.
impl fmt::Display for HalfTurn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "gsplat",
            Self::X => "gsplat-x",
            Self::Y => "gsplat-y",
            Self::Z => "gsplat-z",
        })
    }
}

/// The similarity from the world of `cameras`, all that are registered (camera from world, OpenCV axes), and of `points`,
/// COLMAP's 3D points, to the frame of the splat. Of each of the first two principal axes, the largest component is
/// positive before `turn` is applied. `None` if the cameras are all in one place, or there are no points.
pub(crate) fn similarity(
    cameras: &[Isometry3<f64>],
    points: &[Point3<f64>],
    turn: HalfTurn,
) -> Option<Similarity3<f64>> {
    let by_cameras = similarity_of_cameras(cameras)?;
    let moved: Vec<Point3<f64>> = points.iter().map(|point| by_cameras * point).collect();
    let by_points = turn.rotation() * principal_axes(&moved)?;
    Some(Similarity3::from_isometry(by_points, 1.0) * by_cameras)
}

/// Step 1.
fn similarity_of_cameras(cameras: &[Isometry3<f64>]) -> Option<Similarity3<f64>> {
    let world_from_camera: Vec<Isometry3<f64>> = cameras.iter().map(Isometry3::inverse).collect();
    let up: Vector3<f64> = world_from_camera.iter().map(|camera| camera.rotation * -Vector3::y()).sum();
    let up = up.try_normalize(f64::EPSILON)?;
    // The shortest rotation; it is undefined if up is the opposite.
    let align = UnitQuaternion::rotation_between(&up, &-Vector3::y())
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI));
    let centers: Vec<Vector3<f64>> = world_from_camera.iter().map(|camera| align * camera.translation.vector).collect();
    let nearest_to_origin = |(camera, center): (&Isometry3<f64>, &Vector3<f64>)| {
        let forward = align * (camera.rotation * Vector3::z());
        Point3::from(center - forward * forward.dot(center))
    };
    let nearest: Vec<Point3<f64>> = world_from_camera.iter().zip(&centers).map(nearest_to_origin).collect();
    let shift = -median_of(&nearest)?.coords;
    let distance = median(centers.iter().map(|center| (center + shift).norm()).collect())?;
    let scale = Some(1.0 / distance).filter(|scale| scale.is_normal())?;
    Some(Similarity3::from_parts(Translation3::from(shift * scale), align, scale))
}

/// Step 2: the rotation and translation of the points.
fn principal_axes(points: &[Point3<f64>]) -> Option<Isometry3<f64>> {
    let center = median_of(points)?;
    let (_, spread) = scatter(points.iter().map(|point| &point.coords));
    let eigen = spread.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let axis = |nth: usize| {
        let axis: Vector3<f64> = eigen.eigenvectors.column(order[nth]).into();
        if axis[axis.iamax()] < 0.0 { -axis } else { axis }
    };
    let (first, second) = (axis(0), axis(1));
    let rows = Matrix3::from_columns(&[first, second, first.cross(&second)]).transpose();
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows));
    let rotation = UnitQuaternion::try_new(rotation.into_inner(), f64::EPSILON)?;
    Some(Isometry3::from_parts(Translation3::from(-(rotation * center.coords)), rotation))
}

/// The median along each axis.
fn median_of(points: &[Point3<f64>]) -> Option<Point3<f64>> {
    let along = |axis: usize| median(points.iter().map(|point| point[axis]).collect());
    Some(Point3::new(along(0)?, along(1)?, along(2)?))
}
