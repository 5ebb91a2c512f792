//! Numbers and rotations as URDF, MJCF and USD write them.

use nalgebra::{Matrix3, Rotation3, Unit, UnitQuaternion, Vector3};

/// The finite numbers of a list that spaces (or commas) separate.
///
/// # Errors
/// The word that is not one.
pub fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let words = text.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
    words
        .map(|word| word.parse().ok().filter(|number: &f64| number.is_finite()).ok_or_else(|| word.to_owned()))
        .collect()
}

/// As [`numbers`], if there are exactly `N`.
///
/// # Errors
/// What is wrong, as the end of a sentence about the value.
pub fn exactly<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let found = numbers(text).map_err(|word| format!("has {word:?}, which is not a finite number"))?;
    let count = found.len();
    found.try_into().map_err(|_| format!("has {count} numbers instead of {N}"))
}

/// The rotation of URDF's `rpy`: about the fixed axes x, y and z, in this order, in radians.
pub fn of_roll_pitch_yaw([roll, pitch, yaw]: [f64; 3]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(roll, pitch, yaw)
}

/// The rotation of a quaternion in the order w x y z; `None` if it is zero.
pub fn of_wxyz([w, x, y, z]: [f64; 4]) -> Option<UnitQuaternion<f64>> {
    UnitQuaternion::try_new(nalgebra::Quaternion::new(w, x, y, z), f64::MIN_POSITIVE)
}

/// The rotation by `angle` about an axis; `None` if the axis is zero.
pub fn about(axis: [f64; 3], angle: f64) -> Option<UnitQuaternion<f64>> {
    Some(UnitQuaternion::from_axis_angle(&Unit::try_new(Vector3::from(axis), f64::MIN_POSITIVE)?, angle))
}

/// The least rotation that takes the z axis to a direction; `None` if that is zero.
pub fn of_z_axis(direction: [f64; 3]) -> Option<UnitQuaternion<f64>> {
    let direction = Vector3::from(direction).try_normalize(f64::MIN_POSITIVE)?;
    let half_turn = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    Some(UnitQuaternion::rotation_between(&Vector3::z(), &direction).unwrap_or_else(half_turn))
}

/// The rotation whose x axis is the first vector, and whose y axis is the second one made orthogonal to it; `None` if they
/// are parallel.
pub fn of_xy_axes([x, y, z, u, v, w]: [f64; 6]) -> Option<UnitQuaternion<f64>> {
    let first = Vector3::new(x, y, z).try_normalize(f64::MIN_POSITIVE)?;
    let second = Vector3::new(u, v, w);
    let second = (second - first * first.dot(&second)).try_normalize(1e-12 * second.norm().max(f64::MIN_POSITIVE))?;
    let axes = Matrix3::from_columns(&[first, second, first.cross(&second)]);
    Some(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)))
}

/// The rotation of MuJoCo's `euler`: a lower-case letter of `sequence` turns about an axis that moves along, a capital about a
/// fixed one; `None` for other sequences.
pub fn of_euler(sequence: &str, angles: [f64; 3]) -> Option<UnitQuaternion<f64>> {
    let letters: Vec<char> = sequence.chars().collect();
    if letters.len() != angles.len() {
        return None;
    }
    let mut rotation = UnitQuaternion::identity();
    for (letter, angle) in letters.into_iter().zip(angles) {
        let axis = match letter.to_ascii_lowercase() {
            'x' => Vector3::x_axis(),
            'y' => Vector3::y_axis(),
            'z' => Vector3::z_axis(),
            _ => return None,
        };
        let turn = UnitQuaternion::from_axis_angle(&axis, angle);
        rotation = if letter.is_ascii_lowercase() { rotation * turn } else { turn * rotation };
    }
    Some(rotation)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn lists_are_read_strictly() {
        assert_eq!(exactly::<3>(" 1 -2e-3\n.5 "), Ok([1.0, -0.002, 0.5]));
        assert_eq!(exactly::<3>("1,2,3"), Ok([1.0, 2.0, 3.0]));
        assert!(exactly::<3>("1 2").unwrap_err().contains("2 numbers instead of 3"));
        assert!(exactly::<1>("nan").unwrap_err().contains("\"nan\""));
        assert!(exactly::<1>("1.0f").unwrap_err().contains("\"1.0f\""));
    }

    #[test]
    fn rotations_turn_the_axes_as_the_formats_say() {
        let turned = |rotation: UnitQuaternion<f64>, v: [f64; 3]| {
            let v = rotation * Vector3::from(v);
            [v.x, v.y, v.z].map(|number| (number * 1e9).round() / 1e9)
        };
        let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        // URDF: Rz(yaw) Ry(pitch) Rx(roll).
        assert_eq!(turned(of_roll_pitch_yaw([FRAC_PI_2, 0.0, FRAC_PI_2]), y), z);
        assert_eq!(turned(of_roll_pitch_yaw([FRAC_PI_2, 0.0, FRAC_PI_2]), x), y);
        // The z axis moved with the first turn.
        assert_eq!(turned(of_euler("xyz", [FRAC_PI_2, 0.0, FRAC_PI_2]).unwrap(), x), z);
        assert_eq!(turned(of_euler("XYZ", [FRAC_PI_2, 0.0, FRAC_PI_2]).unwrap(), x), y);
        assert_eq!(of_euler("xyw", [0.0; 3]), None);
        assert_eq!(turned(of_z_axis([1.0, 0.0, 0.0]).unwrap(), z), x);
        assert_eq!(turned(of_z_axis([0.0, 0.0, -2.0]).unwrap(), z), [0.0, 0.0, -1.0]);
        assert_eq!(turned(of_xy_axes([0.0, 2.0, 0.0, 1.0, 1.0, 0.0]).unwrap(), z), [0.0, 0.0, -1.0]);
        assert_eq!(of_xy_axes([1.0, 0.0, 0.0, 2.0, 0.0, 0.0]), None);
        assert_eq!(turned(of_wxyz([1.0, 0.0, 0.0, 1.0]).unwrap(), x), y);
        assert_eq!(turned(about([0.0, 0.0, 3.0], FRAC_PI_2).unwrap(), x), y);
    }
}
