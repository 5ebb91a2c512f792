//! Which way is up, and the turn that follows from it.
//!
//! A splat may stand in any frame: COLMAP's has the axes of whichever photo it started from, many trainers have y up or down.
//! That of the files is the *input's* frame. [`find`] says which way is up in it, once; then [`turn`] turns Gaussians and cameras
//! into the *world's* frame, in which all stages work: z up, with the origin and the unit of the input. If z is up already,
//! nothing changes, to the last bit.
//!
//! In this order, up is
//! 1. what the user [says](choice::UpChoice);
//! 2. z, if the cameras come from a data set in which it is;
//! 3. the normal of the [support](super::object::support) under the objects, unless the photos show the object alone;
//! 4. what the [`cameras`] suggest;
//! 5. z, if they suggest nothing.

pub(super) mod cameras;
pub(super) mod choice;
pub(super) mod turn;

use std::f64::consts::FRAC_PI_2;

use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;

use super::object::support::Plane;
use choice::UpChoice;

/// A direction that was found within this angle of z is taken for z, in radians (1 degree): as accurate as a support or
/// cameras are, and the scene stays as it is.
const SAME: f64 = 0.017_5;
/// Support, data set and cameras disagree if they differ by more than this, in radians (15 degrees): on a real capture of a soft
/// toy on a bed, whose photographer held the camera by hand, support and cameras differ by 6 degrees.
const DISAGREEMENT: f64 = 0.262;

/// Which way is up in the input's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Up {
    /// A unit vector in the input's frame.
    pub direction: [f64; 3],
    pub source: UpSource,
    /// The angle, in radians, between this direction and what the cameras suggest; `None` if they are its source, or suggest
    /// nothing.
    pub angle_to_cameras: Option<f64>,
}

/// How it is known which way is up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum UpSource {
    /// `--up`.
    Given,
    /// In this data set, or this format, z is up.
    DataSet,
    /// The normal of the plane on which the objects stand.
    Support,
    /// Cameras are held level.
    Cameras,
    /// Nothing tells; gprop takes z.
    Assumed,
}

/// What is known about up before it is sought.
pub(super) struct Evidence<'a> {
    pub choice: &'a UpChoice,
    /// Whether z is up by the convention of the data set or the camera file.
    pub z_by_convention: bool,
    pub cameras: Option<Vector3<f64>>,
    pub support: Option<&'a Plane>,
}

impl Up {
    /// z, without any evidence for it.
    pub(super) const ASSUMED: Self =
        Self { direction: [0.0, 0.0, 1.0], source: UpSource::Assumed, angle_to_cameras: None };
    /// z, by the convention of a format.
    pub(super) const CONVENTION: Self =
        Self { direction: [0.0, 0.0, 1.0], source: UpSource::DataSet, angle_to_cameras: None };

    /// The rotation from the input's frame to the world's: the shortest one that brings up to z. The identity if z is up.
    pub fn world_from_input(&self) -> UnitQuaternion<f64> {
        if self.is_z() {
            return UnitQuaternion::identity();
        }
        let half_turn = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        UnitQuaternion::rotation_between(&Vector3::from(self.direction), &Vector3::z()).unwrap_or_else(half_turn)
    }

    /// Whether z is up in the input's frame, so that it is also the world's.
    pub fn is_z(&self) -> bool {
        self.direction == [0.0, 0.0, 1.0]
    }

    /// What is said about the turn; `None` if there is none.
    pub(super) fn note(&self) -> Option<String> {
        let up = vector(&self.direction);
        (!self.is_z()).then(|| format!("turned so that z is up, which is {up} in the splat's frame (--up overrides)"))
    }

    fn along(direction: Vector3<f64>, source: UpSource, cameras: Option<Vector3<f64>>) -> Self {
        let is_z = direction.angle(&Vector3::z()) < SAME && source != UpSource::Given;
        let direction = if is_z { Vector3::z() } else { without_noise(direction.normalize()) };
        let angle_to_cameras = cameras.filter(|_| source != UpSource::Cameras).map(|up| up.angle(&direction));
        Self { direction: direction.into(), source, angle_to_cameras }
    }
}

/// The axis that a unit vector is, but for rounding.
fn without_noise(direction: Vector3<f64>) -> Vector3<f64> {
    const ROUNDING: f64 = 1e-6;
    let nearest = direction.map(f64::round);
    if (direction - nearest).norm() < ROUNDING { nearest.map(|side| side + 0.0) } else { direction }
}

/// Whether a plane of the world's frame is level.
pub(super) fn is_level(plane: &Plane) -> bool {
    plane.normal.angle(&Vector3::z()) < SAME
}

/// Which way is up.
pub(super) fn find(evidence: &Evidence) -> Up {
    let cameras = evidence.cameras;
    if let UpChoice::Along(direction) = evidence.choice {
        return Up::along(Vector3::from(*direction), UpSource::Given, cameras);
    }
    if evidence.z_by_convention {
        return Up::along(Vector3::z(), UpSource::DataSet, cameras);
    }
    if let Some(support) = evidence.support {
        return Up::along(support.normal, UpSource::Support, cameras);
    }
    cameras.map_or(Up::ASSUMED, |up| Up::along(up, UpSource::Cameras, cameras))
}

/// Why up is in doubt, if it is: it was found, and the cameras suggest another direction.
pub(super) fn doubt(up: &Up, cameras: Option<&Vector3<f64>>) -> Option<String> {
    let angle = up.angle_to_cameras.filter(|angle| *angle > DISAGREEMENT && up.source != UpSource::Given)?;
    let suggested = *cameras?;
    let by = match up.source {
        UpSource::Support => "the surface under the objects",
        _ => "the data set's convention",
    };
    Some(format!(
        "which way is up is in doubt: {} by {by}, which gprop takes, but {} by the cameras, {:.0} degrees from it; --up X,Y,Z \
         decides",
        vector(&up.direction),
        vector(&suggested.into()),
        angle.to_degrees()
    ))
}

/// What is said if the given direction would turn the photos upside down.
pub(super) fn upside_down(up: &Up, cameras: Option<&Vector3<f64>>) -> Option<String> {
    let angle = up.angle_to_cameras.filter(|angle| *angle > FRAC_PI_2 && up.source == UpSource::Given)?;
    Some(format!(
        "--up {} is {:.0} degrees from {}, which the cameras suggest: the photos would be upside down; leave --up out unless this is \
         so",
        vector(&up.direction),
        angle.to_degrees(),
        vector(&(*cameras?).into())
    ))
}

/// A direction as it is shown: the name of an axis, or its components.
pub(crate) fn vector(direction: &[f64; 3]) -> String {
    let name = choice::axis_name(direction).map(str::to_owned);
    name.unwrap_or_else(|| format!("({:.3}, {:.3}, {:.3})", direction[0], direction[1], direction[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn up(direction: [f64; 3]) -> Up {
        Up { direction, ..Up::ASSUMED }
    }

    #[test]
    fn up_becomes_z() {
        let tilted: [f64; 3] = Vector3::new(0.02, -0.67, -0.74).normalize().into();
        for direction in [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0], tilted] {
            let turned = up(direction).world_from_input() * Vector3::from(direction);
            assert!((turned - Vector3::z()).norm() < 1e-12, "{direction:?}: {turned}");
        }
        assert_eq!(up([0.0, 0.0, 1.0]).world_from_input(), UnitQuaternion::identity());
    }

    #[test]
    fn evidence_counts_in_order() {
        let support = Plane { normal: Vector3::y(), offset: 0.0 };
        let tilted = Vector3::new(0.0, 1.0, 0.5).normalize();
        let all = Evidence {
            choice: &"-x".parse().unwrap(),
            z_by_convention: true,
            cameras: Some(tilted),
            support: Some(&support),
        };
        let given = find(&all);
        assert_eq!((given.direction, given.source), ([-1.0, 0.0, 0.0], UpSource::Given));
        let all = Evidence { choice: &UpChoice::Auto, ..all };
        assert_eq!((find(&all).direction, find(&all).source), ([0.0, 0.0, 1.0], UpSource::DataSet));
        let all = Evidence { z_by_convention: false, ..all };
        let found = find(&all);
        assert_eq!((found.direction, found.source), ([0.0, 1.0, 0.0], UpSource::Support));
        assert!((found.angle_to_cameras.unwrap() - 0.5_f64.atan()).abs() < 1e-9, "{found:?}");
        let all = Evidence { support: None, ..all };
        assert_eq!((find(&all).source, find(&all).angle_to_cameras), (UpSource::Cameras, None));
        assert_eq!(find(&Evidence { cameras: None, ..all }), Up::ASSUMED);
    }

    #[test]
    fn what_is_found_within_a_degree_of_z_is_z_and_what_is_given_is_not() {
        let nearly = Vector3::new(0.01, 0.0, 1.0);
        let evidence =
            Evidence { choice: &UpChoice::Auto, z_by_convention: false, cameras: Some(nearly), support: None };
        assert!(find(&evidence).is_z());
        let given = UpChoice::Along(nearly.into());
        assert!(!find(&Evidence { choice: &given, ..evidence }).is_z());
    }
}
