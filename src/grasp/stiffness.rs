//! Whether a part is stiff enough to carry the object: a leaf, a page or a flag folds instead.

use nalgebra::Point3;

use super::Inputs;
use super::places::Place;
use crate::parts::Part;
use crate::units::GRAVITY_M_S2;

/// A part that the object's weight would bend by more, in radians, folds instead of carrying it: formulas of small bending put its
/// end almost straight below the fingers.
pub const FOLDS_RAD: f64 = 1.0;
/// The sides of a thin sheet appear this far apart in a splat at most. Contacts that are farther apart press on two walls.
const SHEET_M: f64 = 0.006;

/// The slope at the end of a beam that is clamped at the contacts and carries the object's weight at its other end, as far away as
/// the centre of mass is: m g l^2 / (2 E I), in radians.
///
/// The beam is the connected body of the part that the fingers press on, as it alone is attached there. It has the thickness d that
/// the part has at the contacts, and the root of its area V / d as its width b. So I = b d^3 / 12 for a solid and a sheet. If the
/// fingers press on two walls of something hollow, w apart, each is b / 2 wide, and I = 2 (b / 2) d (w / 2)^2.
pub fn bend_rad(part: &Part, place: &Place, inputs: &Inputs, center_of_mass: Point3<f64>) -> f64 {
    let thickness_m = inputs.thickness_m.mid;
    let breadth_m = (body_m3(part, place.middle()) / thickness_m).sqrt();
    let is_hollow = part.is_wall && place.width_m() > SHEET_M.max(2.0 * thickness_m);
    let second_moment_m4 = if is_hollow {
        breadth_m * thickness_m * place.width_m().powi(2) / 4.0
    } else {
        breadth_m * thickness_m.powi(3) / 12.0
    };
    let length_m = (place.middle() - center_of_mass).norm();
    let bend_rad =
        inputs.mass_kg.mid * GRAVITY_M_S2 * length_m.powi(2) / (2.0 * inputs.youngs_modulus_pa.mid * second_moment_m4);
    // Of a body without a volume, infinite, for which JSON has no number.
    bend_rad.min(f64::MAX)
}

/// The volume of the part's body whose middle is nearest.
fn body_m3(part: &Part, near: Point3<f64>) -> f64 {
    let distance_m = |center: [f64; 3]| (Point3::from(center) - near).norm();
    let nearest =
        part.bodies.iter().min_by(|a, b| distance_m(a.center_of_mass_m).total_cmp(&distance_m(b.center_of_mass_m)));
    let whole_m3 = part.volume_m3.map_or(0.0, |volume| volume.mid);
    nearest.map_or(whole_m3, |body| body.volume_m3)
}
