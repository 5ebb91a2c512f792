//! URDF: one link, which is free in PyBullet, Drake and Gazebo. MuJoCo welds a root link to the world, and it loses its mass; so the
//! link can hang on a floating joint to a grain. PyBullet, which knows no floating joint, fixes the link to the grain, which
//! moves, since it has a mass and is not called "world". Meshes are OBJ files in `meshes/`: the skin with its picture, and the
//! convex colliders.
//!
//! URDF itself has no friction. It is written in the three ways that readers understand: per collider for Drake, and per
//! link for PyBullet and for Gazebo, which get the lowest friction of all parts. PyBullet alone reads a restitution. URDF has no
//! soft contacts either.

use std::fmt::Write;

use nalgebra::Vector3;

use super::{ExportError, Files, OwnMesh, Rigid, obj, spaced};

/// What the root weighs: a milligram with the inertia of a ball of 1 mm, 2/5 m r^2.
const GRAIN: &str = r#"<inertial><origin xyz="0 0 0"/><mass value="1e-6"/><inertia ixx="4e-13" iyy="4e-13" izz="4e-13" ixy="0" ixz="0" iyz="0"/></inertial>"#;

pub(super) fn write(rigid: &Rigid, files: &mut Files) -> Result<(), ExportError> {
    files.write(format!("{}.urdf", rigid.name), |out| out.write_all(text(rigid).as_bytes()))?;
    obj::write_meshes(rigid, files)
}

/// The grain and the joint on which the link hangs.
fn root(rigid: &Rigid) -> String {
    let (name, at) = (&rigid.name, rigid.placement.at);
    let origin = if at == Vector3::zeros() {
        String::new()
    } else {
        format!(r#"<origin xyz="{}" rpy="0 0 0"/>"#, spaced(at.iter().copied()))
    };
    format!(
        r#"  <link name="{name}_root">{GRAIN}</link>
  <joint name="{name}_free" type="floating">{origin}<parent link="{name}_root"/><child link="{name}"/></joint>
"#
    )
}

fn text(rigid: &Rigid) -> String {
    let (mass, [x, y, z], i) = rigid.inertial();
    let rise = rigid.placement.rise;
    let raised = if rise == 0.0 { String::new() } else { format!(r#"<origin xyz="0 0 {rise}" rpy="0 0 0"/>"#) };
    let mut colliders = String::new();
    for collider in rigid.colliders {
        let (name, friction) = (rigid.collider_name(collider), rigid.friction(collider));
        let _ = write!(
            colliders,
            r#"    <collision name="{name}">
      {raised}<geometry><mesh filename="meshes/{name}.obj"><drake:declare_convex/></mesh></geometry>
      <drake:proximity_properties><drake:mu_static value="{friction}"/><drake:mu_dynamic value="{friction}"/></drake:proximity_properties>
    </collision>
"#,
        );
    }
    let least = rigid.least_friction();
    let bounce =
        rigid.least_restitution().map_or_else(String::new, |least| format!(r#"<restitution value="{least}"/>"#));
    let skin = || format!(r#"<mesh filename="meshes/{}_skin.obj"/>"#, rigid.name);
    let own_geometry =
        |mesh: &OwnMesh| format!(r#"<mesh filename="{}" scale="{}"/>"#, escaped(&mesh.file), spaced(mesh.scale));
    let visual = rigid.own_mesh.as_ref().map_or_else(skin, own_geometry);
    format!(
        r#"{note}<robot name="{name}" xmlns:drake="http://drake.mit.edu">
  <mujoco><compiler strippath="false" discardvisual="false"/></mujoco>
{root}  <link name="{name}">
    <contact><lateral_friction value="{least}"/>{bounce}</contact>
    <inertial>
      <origin xyz="{center}" rpy="0 0 0"/>
      <mass value="{mass}"/>
      <inertia ixx="{}" iyy="{}" izz="{}" ixy="{}" ixz="{}" iyz="{}"/>
    </inertial>
    <visual name="skin">{raised}<geometry>{visual}</geometry></visual>
{colliders}  </link>
  <gazebo reference="{name}"><mu1>{least}</mu1><mu2>{least}</mu2></gazebo>
</robot>
"#,
        i[0][0],
        i[1][1],
        i[2][2],
        i[0][1],
        i[0][2],
        i[1][2],
        root = if rigid.floating { root(rigid) } else { String::new() },
        note = rigid.comments(),
        name = rigid.name,
        center = spaced([x, y, z + rise]),
    )
}

/// A text as the value of an attribute.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
