//! MuJoCo's XML: one free body with the object's mass, centre of mass and full inertia, a geom for every collider,
//! and the skin, which collides with nothing; and a scene with this body on a floor. All names begin with that of the
//! body, so that a scene may include several.
//!
//! If each part is a link, its body is inside that of its neighbour, without a joint.
//!
//! A body that deforms is a [`flex`](write_flex): a node that touches something rigid belongs to that body, which gets its mass; every other is
//! a body with three slide joints. Only the integrator `discrete` computes the elasticity implicitly, with usual time steps.
//!
//! Friction is the part's on rubber or steel: MuJoCo uses the larger friction of two geoms in
//! contact, unless a pair says otherwise: a file of its own has pairs with the geoms of a gripper's pads. As in MuJoCo's own models, visual geoms are in group 2 and colliders in group 3, which viewers hide.

use std::fmt::Write;

use nalgebra::Vector3;

use super::deformable::DeformableBody;
use super::links::Inertial;
use super::shape::Collider;
use super::{ExportError, Files, Rigid, body_splats, escaped, obj, spaced};
use crate::pictures::palette;
use crate::vote::FieldPart;

/// MuJoCo's default time constant of contacts, s. Stiffer parts keep it, since no time step could resolve theirs.
const DEFAULT_TIME_CONSTANT_S: f64 = 0.02;
/// MuJoCo's torsional and rolling friction, m.
const TORSIONAL_M: f64 = 0.005;
const ROLLING_M: f64 = 0.0001;
/// Damping ratio of a deformable body's lowest standing wave. The loss factor of foams and rubbers is around 0.1 to 0.2, twice that.
const DAMPING_RATIO: f64 = 0.08;
/// Contacts of deformable bodies. Their stiffness grows with the mass of a node, which is a small share of what it bears, so they have a short
/// time constant, s, and nearly full impedance.
const NODE_TIME_CONSTANT_S: f64 = 0.004;
const NODE_IMPEDANCE: &str = "0.99 0.999 0.001";
/// Iterations in which MuJoCo may solve a time step: the stiffness of thousands of tetrahedra takes more than its 100.
const ITERATIONS: u32 = 1000;

pub(super) fn write(rigid: &Rigid, files: &mut Files) -> Result<(), ExportError> {
    files.write(format!("{}.xml", rigid.name), |out| out.write_all(body(rigid).as_bytes()))?;
    files.write("scene.xml", |out| out.write_all(scene(rigid).as_bytes()))?;
    if !rigid.pad_geoms.is_empty() {
        files.write(format!("{}_pads.xml", rigid.name), |out| out.write_all(pads(rigid).as_bytes()))?;
    }
    obj::write_meshes(rigid, files)
}

fn body(rigid: &Rigid) -> String {
    let mut assets = String::new();
    for (name, _) in rigid.skins() {
        let _ = write!(
            assets,
            r#"    <texture name="{name}_skin" type="2d" file="meshes/{name}_skin.png"/>
    <material name="{name}_skin" texture="{name}_skin" specular="0.2" shininess="0.2"/>
    <mesh name="{name}_skin" file="meshes/{name}_skin.obj"/>
"#
        );
    }
    for collider in rigid.colliders {
        let _ = writeln!(
            assets,
            r#"    <mesh name="{name}" file="meshes/{name}.obj"/>"#,
            name = rigid.collider_name(collider)
        );
    }
    let mut bodies = String::new();
    if rigid.is_one_body() {
        write_whole(&mut bodies, rigid);
    } else if !rigid.links.is_empty() {
        write_link(&mut bodies, rigid, 0);
    }
    let mut flexes = String::new();
    for body in rigid.deformable {
        write_nodes(&mut bodies, rigid, body);
        write_flex(&mut flexes, rigid, body);
    }
    let (mut option, mut slides) = (String::new(), String::new());
    if !rigid.deformable.is_empty() {
        flexes = format!("  <deformable>\n{flexes}  </deformable>\n");
        let _ = writeln!(option, r#"  <option integrator="discrete" iterations="{ITERATIONS}"/>"#);
        let _ = write!(
            slides,
            "    <default class=\"{}_node\">\n      <joint type=\"slide\"/>\n    </default>\n",
            rigid.name
        );
    }
    format!(
        r#"{note}<mujoco model="{name}">
{option}  <default>
    <default class="{name}_visual">
      <geom type="mesh" contype="0" conaffinity="0" group="2" mass="0"/>
    </default>
    <default class="{name}_collision">
      <geom type="mesh" group="3"/>
    </default>
{slides}  </default>
  <asset>
{assets}  </asset>
{splats}  <worldbody>
{bodies}  </worldbody>
{flexes}</mujoco>
"#,
        splats = if rigid.has_splats { body_splats::texts(rigid) } else { String::new() },
        note = rigid.comments(),
        name = rigid.name,
    )
}

/// The object as one body.
fn write_whole(text: &mut String, rigid: &Rigid) {
    open_root(text, rigid, &rigid.name);
    write_content(text, rigid, &rigid.name, &rigid.inertial(), Vector3::zeros(), rigid.colliders.iter());
    text.push_str("    </body>\n");
}

/// A part as a body, with those that are fixed to it inside: a body without a joint is fixed to the one around it.
fn write_link(text: &mut String, rigid: &Rigid, index: usize) {
    let link = &rigid.links[index];
    match link.parent {
        None => open_root(text, rigid, &link.name),
        Some(parent) => {
            let at = link.joint - rigid.links[parent].joint;
            let _ = writeln!(text, r#"    <body name="{}" pos="{}">"#, link.name, spaced(at.iter().copied()));
        }
    }
    let inertial = with_attached(rigid, index);
    write_content(text, rigid, &link.name, &inertial, link.joint, rigid.colliders_of(index));
    let fixed = |n: &usize| rigid.links[*n].parent == Some(index);
    (0..rigid.links.len()).filter(fixed).for_each(|n| write_link(text, rigid, n));
    text.push_str("    </body>\n");
}

/// The mass properties of a link with the nodes of deformable bodies that hang on it.
fn with_attached(rigid: &Rigid, index: usize) -> Inertial {
    let mut all = vec![rigid.links[index].inertial];
    for body in rigid.deformable {
        let masses = body.node_masses_kg();
        let nodes = body.attached.iter().filter(|(_, link)| *link == index).map(|(node, _)| *node as usize);
        all.extend(nodes.map(|node| Inertial::of_point(masses[node], body.mesh.nodes[node].coords)));
    }
    if all.len() == 1 { all[0] } else { Inertial::together(&all) }
}

/// The name of the body of a node.
fn node_name(body: &DeformableBody, node: usize) -> String {
    format!("{}__{node}", body.name)
}

/// The nodes that hang on nothing, as bodies of the world that slide along its axes.
fn write_nodes(text: &mut String, rigid: &Rigid, body: &DeformableBody) {
    let mut is_attached = vec![false; body.mesh.nodes.len()];
    body.attached.iter().for_each(|(node, _)| is_attached[*node as usize] = true);
    let (masses, place) = (body.node_masses_kg(), rigid.placement.place());
    for (n, node) in body.mesh.nodes.iter().enumerate().filter(|(n, _)| !is_attached[*n]) {
        // It never turns, but MuJoCo wants an inertia: that of a cube.
        let inertia = masses[n] * body.mesh.cell.min().powi(2) / 6.0;
        let slides: String = ["1 0 0", "0 1 0", "0 0 1"]
            .map(|axis| format!(r#"<joint class="{}_node" axis="{axis}"/>"#, rigid.name))
            .concat();
        let _ = writeln!(
            text,
            r#"    <body name="{name}" pos="{pos}"><inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>{slides}</body>"#,
            name = node_name(body, n),
            pos = spaced((node + place).iter().copied()),
            mass = masses[n],
        );
    }
}

/// The tetrahedra between the nodes.
fn write_flex(text: &mut String, rigid: &Rigid, body: &DeformableBody) {
    let mut nodes: Vec<String> = (0..body.mesh.nodes.len()).map(|n| node_name(body, n)).collect();
    let mut vertices = vec![Vector3::zeros(); nodes.len()];
    for (node, link) in &body.attached {
        let (node, link) = (*node as usize, &rigid.links[*link]);
        nodes[node].clone_from(&link.name);
        vertices[node] = body.mesh.nodes[node].coords - link.joint;
    }
    let elements: Vec<String> = body.mesh.elements.as_flattened().iter().map(u32::to_string).collect();
    let label = super::label_of(rigid.labels, body.parts[0]);
    let _ = write!(
        text,
        r#"    <flex name="{name}" dim="3" radius="0" rgba="{color} 1" body="{nodes}" vertex="{vertices}" element="{elements}">
      <contact selfcollide="none" friction="{friction} {TORSIONAL_M} {ROLLING_M}" solref="{NODE_TIME_CONSTANT_S} 1" solimp="{NODE_IMPEDANCE}"/>
      <elasticity young="{young}" poisson="{poisson}" damping="{damping}"/>
    </flex>
"#,
        name = body.name,
        color = spaced(body.color),
        nodes = nodes.join(" "),
        vertices = spaced(vertices.iter().flatten().copied()),
        elements = elements.join(" "),
        friction = super::friction(label, rigid.on_steel),
        young = body.youngs_modulus_pa,
        poisson = body.poisson_ratio,
        damping = damping_s(body),
    );
}

/// Rayleigh's coefficient of stiffness, which damps a wave of angular frequency omega by the ratio beta omega / 2. The lowest wave that
/// stands in a body of length l that is held at one end has omega = pi c / 2 l with c = sqrt(E / rho).
fn damping_s(body: &DeformableBody) -> f64 {
    let nodes = &body.mesh.nodes;
    let (low, high) = nodes.iter().fold((nodes[0], nodes[0]), |(low, high), node| (low.inf(node), high.sup(node)));
    let speed_m_s = (body.youngs_modulus_pa / body.density_kg_m3()).sqrt();
    let omega = std::f64::consts::PI * speed_m_s / (2.0 * (high - low).max());
    2.0 * DAMPING_RATIO / omega
}

/// A body that moves freely.
fn open_root(text: &mut String, rigid: &Rigid, name: &str) {
    let pos = moved(rigid.placement.place());
    let _ = write!(text, "    <body name=\"{name}\"{pos}>\n      <freejoint name=\"{}_free\"/>\n", rigid.name);
}

/// The attribute of what is elsewhere than at the origin around it.
fn moved(to: Vector3<f64>) -> String {
    if to == Vector3::zeros() { String::new() } else { format!(r#" pos="{}""#, spaced(to.iter().copied())) }
}

/// What is in a body of this name, whose own origin is at `origin` in the object's axes.
fn write_content<'a>(
    text: &mut String,
    rigid: &Rigid,
    name: &str,
    inertial: &Inertial,
    origin: Vector3<f64>,
    colliders: impl Iterator<Item = &'a Collider>,
) {
    let i = &inertial.inertia;
    // fullinertia: xx yy zz xy xz yz.
    let inertia = spaced([i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(0, 1)], i[(0, 2)], i[(1, 2)]]);
    let (center, mass) = (spaced((inertial.center_m - origin).iter().copied()), inertial.mass_kg);
    let pos = moved(-origin);
    let _ = write!(
        text,
        r#"      <inertial pos="{center}" mass="{mass}" fullinertia="{inertia}"/>
      <geom name="{name}_skin" class="{model}_visual" mesh="{name}_skin" material="{name}_skin"{pos}/>
"#,
        model = rigid.name,
    );
    for collider in colliders {
        let (name, label) = (rigid.collider_name(collider), rigid.label(collider));
        let color = spaced(palette::part(collider.part).map(f64::from));
        let (friction, time) = (rigid.friction(collider), time_constant_s(rigid, label));
        let softness = time.map_or_else(String::new, |time| format!(r#" solref="{time} 1""#));
        let _ = writeln!(
            text,
            r#"      <geom name="{name}" class="{model}_collision" mesh="{name}" friction="{friction} {TORSIONAL_M} {ROLLING_M}"{softness} rgba="{color} 1"{pos}/>"#,
            model = rigid.name,
        );
    }
}

/// A pair for each pad and collider. What two geoms that touch have in common is then that of the pair, whatever either says by
/// itself: MuJoCo would take the larger friction of the two.
fn pads(rigid: &Rigid) -> String {
    let mut pairs = String::new();
    for pad in rigid.pad_geoms {
        for collider in rigid.colliders {
            let friction = rigid.friction(collider);
            let time = time_constant_s(rigid, rigid.label(collider)).unwrap_or(DEFAULT_TIME_CONSTANT_S);
            let _ = writeln!(
                pairs,
                r#"    <pair geom1="{pad}" geom2="{name}" condim="4" friction="{friction} {friction} {TORSIONAL_M} {ROLLING_M} {ROLLING_M}" solref="{time} 1"/>"#,
                pad = escaped(pad),
                name = rigid.collider_name(collider),
            );
        }
    }
    format!("<mujoco model=\"{} between pads\">\n  <contact>\n{pairs}  </contact>\n</mujoco>\n", rigid.name)
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
fn time_constant_s(rigid: &Rigid, label: &FieldPart) -> Option<f64> {
    let part = rigid.parts.part(label.id)?;
    let (volume, thickness) = (part.volume_m3?.mid, part.thickness_m?.mid);
    let stiffness = label.youngs_modulus_pa.mid * volume / (thickness * thickness);
    let time = (rigid.parts.object.mass_kg.mid / stiffness).sqrt();
    (time.is_finite() && time > DEFAULT_TIME_CONSTANT_S).then_some(time)
}
