//! `scene.sdf`: a world of SDFormat, which Gazebo, Drake and PyBullet read, with the meshes of the objects' URDFs.
//!
//! PyBullet takes only a number for `static`, and wants a size for a plane without end. Its own element for friction is left out,
//! because Drake refuses what SDFormat does not know.

use std::fmt::Write;

use nalgebra::Vector3;

use super::super::links::Inertial;
use super::super::names::within;
use super::super::{ExportError, Files, spaced};
use super::{Body, BodyCollider, Table};
use crate::units::GRAVITY_M_S2;

/// Slower impacts do not rebound. The format's own default, 1e5 m/s, would let none rebound.
const BOUNCE_THRESHOLD_M_S: f64 = 0.01;

pub fn write(table: &Table, files: &mut Files) -> Result<(), ExportError> {
    let text = text(table);
    files.write("scene.sdf", |out| out.write_all(text.as_bytes()))
}

fn text(table: &Table) -> String {
    let mut text = format!(
        r#"<?xml version="1.0"?>
{notes}<sdf version="1.9" xmlns:drake="http://drake.mit.edu">
  <world name="{name}">
    <gravity>0 0 -{GRAVITY_M_S2}</gravity>
    <light name="sun" type="directional"><cast_shadows>true</cast_shadows><direction>-0.3 0.3 -0.9</direction></light>
"#,
        notes = notes(table),
        name = table.name(),
    );
    write_support(&mut text, table);
    table.bodies.iter().for_each(|body| write_body(&mut text, body));
    text.push_str("  </world>\n</sdf>\n");
    text
}

fn notes(table: &Table) -> String {
    let placement = table.placement().comment();
    let notes = table.note_on_scale().into_iter().chain([placement.as_str()]);
    notes.map(|note| format!("<!-- {note} -->\n")).collect()
}

fn write_support(text: &mut String, table: &Table) {
    let (surface, square) = (table.surface(), table.drawn_support());
    let plane = format!(
        "<geometry><plane><normal>{}</normal><size>{side} {side}</size></plane></geometry>",
        spaced(surface.normal.iter().copied()),
        side = square.side,
    );
    let _ = write!(
        text,
        r#"    <model name="support">
      <static>1</static>
      <pose>{at} 0 0 0</pose>
      <link name="support">
        <collision name="support">{plane}</collision>
        <visual name="support">{plane}</visual>
      </link>
    </model>
"#,
        at = spaced(square.center.iter().copied()),
    );
}

pub fn write_body(text: &mut String, body: &Body) {
    let Body { name, place_m, inertial, colliders } = body;
    open_model(text, name, place_m);
    let collider = |BodyCollider { shape, friction, restitution }: &BodyCollider| LinkCollider {
        name: within(name, &shape.name),
        friction: *friction,
        restitution: *restitution,
    };
    let link = Link {
        name,
        origin: Vector3::zeros(),
        inertial: *inertial,
        colliders: colliders.iter().map(collider).collect(),
    };
    write_link(text, &link);
    text.push_str("    </model>\n");
}

pub fn open_model(text: &mut String, name: &str, place_m: &Vector3<f64>) {
    let place = spaced(place_m.iter().copied());
    let _ = write!(text, "    <model name=\"{name}\">\n      <pose>{place} 0 0 0</pose>\n");
}

/// A link of a model.
pub struct Link<'a> {
    pub name: &'a str,
    /// Where its own axes are in those of the model, in which all else is.
    pub origin: Vector3<f64>,
    pub inertial: Inertial,
    pub colliders: Vec<LinkCollider>,
}

/// A collider, whose mesh is called like it.
pub struct LinkCollider {
    pub name: String,
    pub friction: f64,
    pub restitution: Option<f64>,
}

pub fn write_link(text: &mut String, link: &Link) {
    let Link { name, origin, inertial, colliders } = link;
    let Inertial { mass_kg, center_m, inertia: i } = inertial;
    let pose = |at: Vector3<f64>| {
        if at == Vector3::zeros() {
            String::new()
        } else {
            format!("<pose>{} 0 0 0</pose>", spaced(at.iter().copied()))
        }
    };
    let (placed, back) = (pose(*origin), pose(-origin));
    let _ = write!(
        text,
        r#"      <link name="{name}">
        {placed}<inertial>
          <pose>{center} 0 0 0</pose>
          <mass>{mass_kg}</mass>
          <inertia><ixx>{}</ixx><ixy>{}</ixy><ixz>{}</ixz><iyy>{}</iyy><iyz>{}</iyz><izz>{}</izz></inertia>
        </inertial>
        <visual name="{name}_skin">{back}<geometry><mesh><uri>meshes/{name}_skin.obj</uri></mesh></geometry></visual>
"#,
        i[(0, 0)],
        i[(0, 1)],
        i[(0, 2)],
        i[(1, 1)],
        i[(1, 2)],
        i[(2, 2)],
        center = spaced((center_m - origin).iter().copied()),
    );
    for LinkCollider { name, friction, restitution } in colliders {
        let bounce = restitution.map_or_else(String::new, |restitution| {
            format!(
                "<bounce><restitution_coefficient>{restitution}</restitution_coefficient><threshold>{BOUNCE_THRESHOLD_M_S}</threshold></bounce>"
            )
        });
        let _ = write!(
            text,
            r#"        <collision name="{name}">
          {back}<geometry><mesh><uri>meshes/{name}.obj</uri><drake:declare_convex/></mesh></geometry>
          <surface>{bounce}<friction><ode><mu>{friction}</mu><mu2>{friction}</mu2></ode></friction></surface>
        </collision>
"#
        );
    }
    text.push_str("      </link>\n");
}
