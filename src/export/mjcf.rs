//! MuJoCo's XML: one free body with the object's mass, centre of mass and full inertia, a geom for every collider,
//! and the skin, which collides with nothing; and a scene with this body on a floor. All names begin with that of the
//! body, so that a scene may include several.
//!
//! Friction is the part's on rubber or steel: MuJoCo uses the larger friction of two geoms in
//! contact. As in MuJoCo's own models, visual geoms are in group 2 and colliders in group 3, which viewers hide.

use std::fmt::Write;

use nalgebra::Vector3;

use super::{ExportError, Files, Rigid, obj, spaced};
use crate::pictures::palette;
use crate::vote::FieldLabel;

/// MuJoCo's default time constant of contacts, s. Stiffer parts keep it, since no time step could resolve theirs.
const DEFAULT_TIME_CONSTANT_S: f64 = 0.02;
/// MuJoCo's torsional and rolling friction, m.
const OTHER_FRICTION: &str = "0.005 0.0001";

pub(super) fn write(rigid: &Rigid, files: &mut Files) -> Result<(), ExportError> {
    files.write(format!("{}.xml", rigid.name), |out| out.write_all(body(rigid).as_bytes()))?;
    files.write("scene.xml", |out| out.write_all(scene(rigid).as_bytes()))?;
    obj::write_meshes(rigid, files)
}

fn body(rigid: &Rigid) -> String {
    let (mass, center, i) = rigid.inertial();
    let mut assets = String::new();
    let mut geoms = String::new();
    for collider in rigid.colliders {
        let (name, label) = (rigid.collider_name(collider), rigid.label(collider));
        let _ = writeln!(assets, r#"    <mesh name="{name}" file="meshes/{name}.obj"/>"#);
        let color = spaced(palette::part(collider.part).map(f64::from));
        let (friction, time) = (rigid.friction(collider), time_constant_s(rigid, label));
        let softness = time.map_or_else(String::new, |time| format!(r#" solref="{time} 1""#));
        let _ = writeln!(
            geoms,
            r#"      <geom name="{name}" class="{model}_collision" mesh="{name}" friction="{friction} {OTHER_FRICTION}"{softness} rgba="{color} 1"/>"#,
            model = rigid.name,
        );
    }
    // fullinertia: xx yy zz xy xz yz.
    let inertia = spaced([i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2]]);
    format!(
        r#"{note}<mujoco model="{name}">
  <default>
    <default class="{name}_visual">
      <geom type="mesh" contype="0" conaffinity="0" group="2" mass="0"/>
    </default>
    <default class="{name}_collision">
      <geom type="mesh" group="3"/>
    </default>
  </default>
  <asset>
    <texture name="{name}_skin" type="2d" file="meshes/{name}_skin.png"/>
    <material name="{name}_skin" texture="{name}_skin" specular="0.2" shininess="0.2"/>
    <mesh name="{name}_skin" file="meshes/{name}_skin.obj"/>
{assets}  </asset>
  <worldbody>
    <body name="{name}"{place}>
      <freejoint name="{name}_free"/>
      <inertial pos="{center}" mass="{mass}" fullinertia="{inertia}"/>
      <geom name="{name}_skin" class="{name}_visual" mesh="{name}_skin" material="{name}_skin"/>
{geoms}    </body>
  </worldbody>
</mujoco>
"#,
        note = rigid.comments(),
        name = rigid.name,
        place = if rigid.placement.place() == Vector3::zeros() {
            String::new()
        } else {
            format!(r#" pos="{}""#, spaced(rigid.placement.place().iter().copied()))
        },
        center = spaced(center),
    )
}

/// The body on a floor under its lowest point, lit and seen from the front.
fn scene(rigid: &Rigid) -> String {
    let place = rigid.placement.place();
    let (low, high) = rigid.extent();
    let (low, high) = (low + place, high + place);
    let middle = nalgebra::center(&low, &high);
    let size = (high - low).norm();
    let at = spaced([middle.x, middle.y, middle.z]);
    format!(
        r#"<mujoco model="{name} on a floor">
  <include file="{name}.xml"/>
  <statistic center="{at}" extent="{size}"/>
{look}  <worldbody>
    <light pos="{light}" dir="{down}" directional="true" diffuse="0.5 0.5 0.5" castshadow="true"/>
    <geom name="floor" type="plane" size="0 0 0.05" pos="0 0 {floor}" material="floor"/>
  </worldbody>
</mujoco>
"#,
        name = rigid.name,
        look = look("floor"),
        floor = low.z,
        light = spaced([middle.x + size, middle.y - size, middle.z + 3.0 * size]),
        down = "-0.3 0.3 -0.9",
    )
}

/// The light, the sky and the material of a `plane` that things stand on.
pub(super) fn look(plane: &str) -> String {
    format!(
        r#"  <visual>
    <headlight ambient="0.35 0.35 0.35" diffuse="0.4 0.4 0.4" specular="0 0 0"/>
    <rgba haze="0.85 0.88 0.92 1"/>
    <global azimuth="125" elevation="-25" offwidth="1280" offheight="960"/>
  </visual>
  <asset>
    <texture type="skybox" builtin="gradient" rgb1="0.9 0.93 0.96" rgb2="0.6 0.65 0.7" width="256" height="1536"/>
    <texture name="{plane}" type="2d" builtin="checker" rgb1="0.8 0.8 0.8" rgb2="0.72 0.72 0.72" width="256" height="256"/>
    <material name="{plane}" texture="{plane}" texuniform="true" texrepeat="10 10" reflectance="0.05"/>
  </asset>
"#
    )
}

/// The time constant of a soft part's contacts, critically damped; `None` if MuJoCo's default is no stiffer than the
/// part.
///
/// A part of volume V and thickness d has an area of about V / d, and if pressed over all of it, the stiffness k = E V
/// / d^2. The object's mass m on it oscillates with omega = sqrt(k / m), and MuJoCo's time constant is 1 / omega.
fn time_constant_s(rigid: &Rigid, label: &FieldLabel) -> Option<f64> {
    let part = rigid.parts.of_label(label.id)?;
    let (volume, thickness) = (part.volume_m3?.mid, part.thickness_m?.mid);
    let stiffness = label.youngs_modulus_pa.mid * volume / (thickness * thickness);
    let time = (rigid.parts.object.mass_kg.mid / stiffness).sqrt();
    (time.is_finite() && time > DEFAULT_TIME_CONSTANT_S).then_some(time)
}
