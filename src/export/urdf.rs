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

use super::links::Inertial;
use super::shape::Collider;
use super::{ExportError, Files, OwnMesh, Rigid, escaped, obj, spaced};

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
  <joint name="{name}_free" type="floating">{origin}<parent link="{name}_root"/><child link="{child}"/></joint>
"#,
        child = rigid.links.first().map_or(name, |root| &root.name),
    )
}

fn text(rigid: &Rigid) -> String {
    let mut links = String::new();
    if rigid.links.is_empty() {
        let own_geometry =
            |mesh: &OwnMesh| format!(r#"<mesh filename="{}" scale="{}"/>"#, escaped(&mesh.file), spaced(mesh.scale));
        let link = Content {
            name: &rigid.name,
            inertial: rigid.inertial(),
            shift: raised(rigid),
            visual: rigid.own_mesh.as_ref().map_or_else(|| skin(&rigid.name), own_geometry),
            colliders: rigid.colliders.iter().collect(),
        };
        write_link(&mut links, rigid, &link);
    }
    for (n, link) in rigid.links.iter().enumerate() {
        write_joint(&mut links, rigid, n);
        let (shift, visual) = (raised(rigid) - origin(rigid, n), skin(&link.name));
        let colliders = rigid.colliders_of(n).collect();
        write_link(&mut links, rigid, &Content { name: &link.name, inertial: link.inertial, shift, visual, colliders });
    }
    format!(
        r#"{note}<robot name="{name}" xmlns:drake="http://drake.mit.edu">
  <mujoco><compiler strippath="false" discardvisual="false"/></mujoco>
{root}{links}</robot>
"#,
        root = if rigid.floating { root(rigid) } else { String::new() },
        note = rigid.comments(),
        name = rigid.name,
    )
}

fn raised(rigid: &Rigid) -> Vector3<f64> {
    Vector3::z() * rigid.placement.rise
}

fn skin(name: &str) -> String {
    format!(r#"<mesh filename="meshes/{name}_skin.obj"/>"#)
}

/// Where a link's own origin is in the axes of the root: where it is fixed to its parent.
fn origin(rigid: &Rigid, link: usize) -> Vector3<f64> {
    if rigid.links[link].parent.is_some() { rigid.links[link].joint + raised(rigid) } else { Vector3::zeros() }
}

/// The joint that fixes a link to its parent.
fn write_joint(text: &mut String, rigid: &Rigid, n: usize) {
    let link = &rigid.links[n];
    let Some(parent) = link.parent else { return };
    let at = origin(rigid, n) - origin(rigid, parent);
    let _ = writeln!(
        text,
        r#"  <joint name="{name}_fixed" type="fixed"><origin xyz="{at}" rpy="0 0 0"/><parent link="{parent}"/><child link="{name}"/></joint>"#,
        name = link.name,
        at = spaced(at.iter().copied()),
        parent = rigid.links[parent].name,
    );
}

/// What is in a link.
struct Content<'a> {
    name: &'a str,
    inertial: Inertial,
    /// From the object's axes to those of the link.
    shift: Vector3<f64>,
    visual: String,
    colliders: Vec<&'a Collider>,
}

fn write_link(text: &mut String, rigid: &Rigid, link: &Content) {
    let Content { name, inertial, shift, visual, colliders: own } = link;
    let placed = if *shift == Vector3::zeros() {
        String::new()
    } else {
        format!(r#"<origin xyz="{}" rpy="0 0 0"/>"#, spaced(shift.iter().copied()))
    };
    let mut colliders = String::new();
    for collider in own {
        let (name, friction) = (rigid.collider_name(collider), rigid.friction(collider));
        let _ = write!(
            colliders,
            r#"    <collision name="{name}">
      {placed}<geometry><mesh filename="meshes/{name}.obj"><drake:declare_convex/></mesh></geometry>
      <drake:proximity_properties><drake:mu_static value="{friction}"/><drake:mu_dynamic value="{friction}"/></drake:proximity_properties>
    </collision>
"#,
        );
    }
    let least = rigid.least_friction(own);
    let bounce =
        rigid.least_restitution(own).map_or_else(String::new, |least| format!(r#"<restitution value="{least}"/>"#));
    let i = &inertial.inertia;
    let _ = write!(
        text,
        r#"  <link name="{name}">
    <contact><lateral_friction value="{least}"/>{bounce}</contact>
    <inertial>
      <origin xyz="{center}" rpy="0 0 0"/>
      <mass value="{mass}"/>
      <inertia ixx="{}" iyy="{}" izz="{}" ixy="{}" ixz="{}" iyz="{}"/>
    </inertial>
    <visual name="{name}_skin">{placed}<geometry>{visual}</geometry></visual>
{colliders}  </link>
  <gazebo reference="{name}"><mu1>{least}</mu1><mu2>{least}</mu2></gazebo>
"#,
        i[(0, 0)],
        i[(1, 1)],
        i[(2, 2)],
        i[(0, 1)],
        i[(0, 2)],
        i[(1, 2)],
        center = spaced((inertial.center_m + shift).iter().copied()),
        mass = inertial.mass_kg,
    );
}
