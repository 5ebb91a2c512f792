//! MuJoCo's XML: one free body with the object's mass, centre of mass and full inertia, and a geom for every convex
//! piece.
//!
//! Friction is the part's on rubber, the only one in the library: MuJoCo uses the larger friction of two geoms in
//! contact.

use std::fmt::Write;

use super::{ExportError, Files, Rigid, spaced};
use crate::pictures::palette;
use crate::vote::FieldLabel;

/// MuJoCo's default time constant of contacts, s. Stiffer parts keep it, since no time step could resolve theirs.
const DEFAULT_TIME_CONSTANT_S: f64 = 0.02;
/// MuJoCo's torsional and rolling friction, m.
const OTHER_FRICTION: &str = "0.005 0.0001";

pub(super) fn write(rigid: &Rigid, files: &mut Files) -> Result<(), ExportError> {
    files.write(format!("{}.xml", rigid.name), |out| out.write_all(text(rigid).as_bytes()))
}

fn text(rigid: &Rigid) -> String {
    let (mass, center, i) = rigid.inertial();
    let mut assets = String::new();
    let mut geoms = String::new();
    for piece in &rigid.pieces {
        let (name, label) = (piece.name(), rigid.label(piece));
        let vertices = spaced(piece.vertices.iter().flat_map(|v| [v.x, v.y, v.z]));
        let _ = writeln!(assets, r#"    <mesh name="{name}" vertex="{vertices}"/>"#);
        let color = spaced(palette::part(piece.part).map(f64::from));
        let (friction, time) = (label.friction_rubber.mid, time_constant_s(rigid, label));
        let softness = time.map_or_else(String::new, |time| format!(r#" solref="{time} 1""#));
        let _ = writeln!(
            geoms,
            r#"      <geom name="{name}" type="mesh" mesh="{name}" friction="{friction} {OTHER_FRICTION}"{softness} rgba="{color} 1"/>"#
        );
    }
    // fullinertia: xx yy zz xy xz yz.
    let inertia = spaced([i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2]]);
    format!(
        r#"<mujoco model="{name}">
  <asset>
{assets}  </asset>
  <worldbody>
    <body name="{name}">
      <freejoint name="{name}_free"/>
      <inertial pos="{center}" mass="{mass}" fullinertia="{inertia}"/>
{geoms}    </body>
  </worldbody>
</mujoco>
"#,
        name = rigid.name,
        center = spaced(center),
    )
}

/// The time constant of a soft part's contacts, critically damped; `None` if MuJoCo's default is no stiffer than the
/// part.
///
/// A part of volume V and thickness d has an area of about V / d, and if pressed over all of it, the stiffness k = E V
/// / d^2. The object's mass m on it oscillates with omega = sqrt(k / m), and MuJoCo's time constant is 1 / omega.
fn time_constant_s(rigid: &Rigid, label: &FieldLabel) -> Option<f64> {
    let part = rigid.parts.parts.iter().find(|part| part.id == label.id)?;
    let (volume, thickness) = (part.volume_m3?.mid, part.thickness_m?.mid);
    let stiffness = label.youngs_modulus_pa.mid * volume / (thickness * thickness);
    let time = (rigid.parts.object.mass_kg.mid / stiffness).sqrt();
    (time.is_finite() && time > DEFAULT_TIME_CONSTANT_S).then_some(time)
}
