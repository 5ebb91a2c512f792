//! MJCF keeps the centre in `pos`, and the inertia in `fullinertia` along the body's axes or in `diaginertia` along those of an
//! orientation.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use super::super::Inertial;
use super::super::mjcf::ORIENTATIONS;
use super::super::xml::Node;
use super::Statement;
use super::edit::{Edits, numbers};
use crate::numeric::principal;

/// Products of inertia below this share of the moments are rounding errors.
const DIAGONAL: f64 = 1e-7;

/// MuJoCo's torsional and rolling friction, m.
const OTHER_FRICTION: &str = "0.005 0.0001";

/// Changes the inertial properties that the element `inertial` states.
pub fn change(edits: &mut Edits, inertial: Node, stated: &Inertial, statement: &Statement) {
    if let Some(mass) = statement.mass_kg {
        edits.set(inertial, "mass", &numbers([mass]));
    }
    if let Some(center) = statement.center_m {
        edits.set(inertial, "pos", &numbers(center.iter().copied()));
    }
    let (Some(inertia), Some(as_stated)) = (statement.inertia_kg_m2, statement.inertia_as_stated(stated)) else {
        return;
    };
    if inertial.attribute("fullinertia").is_some() {
        edits.set(inertial, "fullinertia", &full(&inertia));
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

/// Gives a body that states none its inertial properties.
pub fn add(edits: &mut Edits, body: Node, statement: &Statement) {
    let Statement { mass_kg: Some(mass), center_m: Some(center), inertia_kg_m2: Some(inertia), .. } = statement else {
        return;
    };
    let Some(first) = body.children().next() else { return };
    let [center, mass, inertia] = [numbers(center.iter().copied()), numbers([*mass]), full(inertia)];
    edits.add_before(first, &format!(r#"<inertial pos="{center}" mass="{mass}" fullinertia="{inertia}"/>"#));
}

/// Sets the sliding friction of a geom.
pub fn set_friction(edits: &mut Edits, geom: Node, friction: f64) {
    let stated = geom.value("friction").and_then(|stated| stated.trim().split_once(char::is_whitespace));
    let others = stated.map_or(OTHER_FRICTION, |(_, others)| others.trim_start());
    edits.set(geom, "friction", &format!("{} {others}", numbers([friction])));
}

/// Lets the masses of bodies count, which the compiler may be told to overrule.
pub fn let_masses_count(edits: &mut Edits, root: Node) {
    for compiler in root.children().filter(|child| child.name() == "compiler") {
        if compiler.value("inertiafromgeom") == Some("true") {
            edits.set(compiler, "inertiafromgeom", "auto");
        }
        if compiler.attribute("settotalmass").is_some() {
            edits.set(compiler, "settotalmass", "-1");
        }
    }
}

/// The entries of an inertia in MuJoCo's order: xx yy zz xy xz yz.
fn full(inertia: &Matrix3<f64>) -> String {
    numbers([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|entry| inertia[entry]))
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
