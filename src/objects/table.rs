//! The objects in 3D, on what they stand on.

use nalgebra::Point3;

use crate::gaussians::bounds::ellipsoid_bounds;
use crate::report::Cloud;
use crate::scene::{ObjectNumber, StandingObjects, View};

#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    pub cloud: Cloud,
    /// The middle of the upper side of each object's box, world frame, by number.
    pub tops: Vec<Point3<f64>>,
}

impl Table {
    /// As it is seen from a view first.
    pub fn new(found: &StandingObjects, view: &View) -> Self {
        let top = |number: ObjectNumber| {
            let bounds = ellipsoid_bounds(&found.gaussians_of(number));
            let middle = bounds.center();
            Point3::new(middle.x, middle.y, bounds.max.z)
        };
        Self {
            cloud: Cloud::of_objects(&found.gaussians, &found.object_of_gaussian, view.camera.center_in_world()),
            tops: ObjectNumber::first(found.count).map(top).collect(),
        }
    }
}
