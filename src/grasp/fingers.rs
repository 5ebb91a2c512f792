//! The assumed shape of the fingers, and the test whether they fit beside the object.

use nalgebra::{Point3, Vector3};

use super::cells::Cells;
use super::places::Place;

/// From the fingertip's contact to the palm, m: the shortest fingers of the built-in profiles.
pub const FINGER_LENGTH_M: f64 = 0.04;
/// Thickness of a finger, m.
pub const FINGER_THICKNESS_M: f64 = 0.01;
/// Thickness of the palm that is tested, m.
pub const PALM_M: f64 = 0.02;
/// Space between the contact and the finger that is not tested: the error of the splat's surface, m.
const GAP_M: f64 = 0.003;
/// Directions around the axis from which the hand may come.
const APPROACHES: usize = 16;
/// Up to this many Gaussians in the way are taken for strays.
const STRAYS: usize = 2;

/// A box in space: centre, unit axes, half sides along them.
#[derive(Debug, Clone, Copy)]
pub struct OrientedBox {
    pub center: Point3<f64>,
    pub axes: [Vector3<f64>; 3],
    pub half: [f64; 3],
}

impl OrientedBox {
    fn holds(&self, point: Point3<f64>) -> bool {
        (0..3).all(|k| (point - self.center).dot(&self.axes[k]).abs() <= self.half[k])
    }
}

/// Two fingers and the palm between them, for a hand that moves along -`approach`. `gap_m` is left free at the
/// contacts.
pub fn hand(contacts: [Point3<f64>; 2], approach: Vector3<f64>, side_m: f64, gap_m: f64) -> [OrientedBox; 3] {
    let axis = (contacts[1] - contacts[0]).normalize();
    let axes = [axis, approach, axis.cross(&approach)];
    let half_length = 0.5 * (FINGER_LENGTH_M + 0.5 * side_m);
    let finger = |contact: Point3<f64>, outward: Vector3<f64>| OrientedBox {
        center: contact + outward * (gap_m + 0.5 * FINGER_THICKNESS_M) + approach * (half_length - 0.5 * side_m),
        axes,
        half: [0.5 * FINGER_THICKNESS_M, half_length, 0.5 * side_m],
    };
    let width = (contacts[1] - contacts[0]).norm();
    let palm = OrientedBox {
        center: nalgebra::center(&contacts[0], &contacts[1]) + approach * (FINGER_LENGTH_M + 0.5 * PALM_M),
        axes,
        half: [0.5 * width + gap_m + FINGER_THICKNESS_M, 0.5 * PALM_M, 0.5 * side_m],
    };
    [finger(contacts[0], -axis), finger(contacts[1], axis), palm]
}

/// The direction from which a hand can reach the place without colliding with the object: from the contacts to the
/// palm, the most upward (+z) of the free directions.
pub fn free_approach(place: &Place, side_m: f64, obstacles: &[Point3<f64>], cells: &Cells) -> Option<Vector3<f64>> {
    let axis = place.axis();
    // The most upward approach that is square to the axis, and the one square to both.
    let wanted = if axis.z.abs() < 0.99 { Vector3::z() } else { Vector3::x() };
    let up = (wanted - axis * wanted.dot(&axis)).normalize();
    let aside = axis.cross(&up);
    let direction = |k: usize| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / APPROACHES as f64).sin_cos();
        up * cos + aside * sin
    };
    // Upward first, then rotated further and further to either side.
    let order = (0..APPROACHES).map(|n| if n % 2 == 0 { n / 2 } else { APPROACHES - n.div_ceil(2) });
    order.map(direction).find(|approach| {
        let boxes = hand(place.contacts, *approach, side_m, GAP_M);
        boxes.iter().map(|b| inside(b, obstacles, cells)).sum::<usize>() <= STRAYS
    })
}

fn inside(shape: &OrientedBox, obstacles: &[Point3<f64>], cells: &Cells) -> usize {
    let radius = shape.half.iter().map(|h| h * h).sum::<f64>().sqrt();
    cells.near(shape.center, radius).filter(|&i| shape.holds(obstacles[i])).count()
}
