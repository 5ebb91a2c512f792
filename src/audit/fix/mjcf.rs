//! MJCF keeps the centre in `pos`, and the inertia in `fullinertia` along the body's axes or in `diaginertia` along those of an
//! orientation.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use super::super::moments::principal;
use super::Target;
use super::edit::{Edits, numbers};
use crate::scene::mesh::containers::mjcf::ORIENTATIONS;
use crate::scene::mesh::containers::xml::Node;

/// Products of inertia below this share of the moments are rounding errors.
const DIAGONAL: f64 = 1e-7;

pub fn write(edits: &mut Edits, inertial: Node, target: &Target) {
    if let Some(center) = target.center_m {
        edits.set(inertial, "pos", &numbers(center.iter().copied()));
    }
    let (Some(inertia), Some(as_stated)) = (target.inertia_kg_m2, target.inertia_as_stated()) else { return };
    if inertial.attribute("fullinertia").is_some() {
        let entries = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|entry| inertia[entry]);
        edits.set(inertial, "fullinertia", &numbers(entries));
        return;
    }
    let off_diagonal = as_stated - Matrix3::from_diagonal(&as_stated.diagonal());
    if off_diagonal.norm() <= DIAGONAL * as_stated.norm() {
        edits.set(inertial, "diaginertia", &numbers(as_stated.diagonal().iter().copied()));
        return;
    }
    let Some((moments, body_from_axes)) = largest_first(&inertia) else { return };
    edits.set(inertial, "diaginertia", &numbers(moments));
    let quat =
        format!(r#"quat="{}""#, numbers([body_from_axes.w, body_from_axes.i, body_from_axes.j, body_from_axes.k]));
    match ORIENTATIONS.iter().find(|name| inertial.attribute(name).is_some()) {
        Some(name) => edits.replace(inertial, name, &quat),
        None => edits.add(inertial, &quat),
    }
}

/// The principal moments, largest first as MuJoCo orders them, and their axes; `None` for numbers too large to compute with.
fn largest_first(inertia: &Matrix3<f64>) -> Option<([f64; 3], UnitQuaternion<f64>)> {
    let eigen = principal(inertia)?;
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let [first, second, _] = order.map(|n| eigen.eigenvectors.column(n).into_owned());
    let axes = Matrix3::from_columns(&[first, second, first.cross(&second)]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Some((order.map(|n| eigen.eigenvalues[n]), rotation))
}
