//! URDF: links with inertial properties, visuals and collisions, and the joints between them.
//!
//! URDF has no friction. The forms that its readers take are read: `contact/lateral_friction` and `contact_coefficients`
//! (PyBullet), `drake:mu_static` and `drake:mu_dynamic` of a collision (Drake), and `gazebo/mu1` (Gazebo).

use std::collections::HashMap;
use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion};

use super::numbers::{exactly, of_roll_pitch_yaw};
use super::xml::{Document, Node};
use super::{
    Body, Container, ContainerError, Format, Friction, Geometry, Inertial, Joint, MeshUse, Mobility, Place, Problem,
    Role, Shape, ShapeMass, files,
};
use crate::files::read_scope::ReadScope;

/// The name of the link that readers take for the world.
const WORLD: &str = "world";

/// Reads the URDF at `path`, of which `document` is the text.
pub(super) fn read(path: &Path, document: &Document, scope: &ReadScope) -> Result<Container, ContainerError> {
    let root = document.root();
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut container = Container {
        format: Format::Urdf,
        name: root.value("name").unwrap_or_default().to_owned(),
        sources: vec![path.to_owned()],
        bodies: Vec::new(),
        joints: Vec::new(),
        total_mass_kg: None,
        problems: Vec::new(),
    };
    let mut by_name = HashMap::new();
    for node in root.children().filter(|child| child.name() == "link") {
        let body = Link { folder, scope, problems: Vec::new() }.read(node);
        if by_name.insert(body.name.clone(), container.bodies.len()).is_some() {
            let text = format!("there is a second link {:?}; give each link a name of its own", body.name);
            container.problems.push(Problem { place: place(node), text });
        }
        container.bodies.push(body);
    }
    for node in root.children().filter(|child| child.name() == "gazebo") {
        gazebo_friction(node, &by_name, &mut container.bodies);
    }
    for node in root.children().filter(|child| child.name() == "joint") {
        match joint(node, &by_name) {
            Ok(joint) => container.joints.push(joint),
            Err(text) => container.problems.push(Problem { place: place(node), text }),
        }
    }
    connect(&mut container);
    Ok(container)
}

fn place(node: Node) -> Place {
    Place { source: 0, line: node.line(), bytes: node.tag() }
}

/// The reader of a link, with what is wrong with it.
struct Link<'a> {
    folder: &'a Path,
    scope: &'a ReadScope,
    problems: Vec<Problem>,
}

impl Link<'_> {
    fn read(mut self, node: Node) -> Body {
        let shapes = node.children().filter_map(|child| match child.name() {
            "visual" => self.shape(child, Role::Visual),
            "collision" => self.shape(child, Role::Collision),
            _ => None,
        });
        let shapes = shapes.collect();
        let inertial = node.child("inertial").map(|inertial| self.inertial(inertial));
        let friction = self.friction(node);
        Body {
            name: node.value("name").unwrap_or_default().to_owned(),
            place: place(node),
            parent: None,
            mobility: Mobility::Moves,
            inertial,
            shapes,
            friction,
            problems: self.problems,
        }
    }

    fn inertial(&mut self, node: Node) -> Inertial {
        let mass = node.child("mass").and_then(|mass| self.number(mass, "value"));
        let inertia = node.child("inertia");
        let inertia_kg_m2 = inertia.and_then(|inertia| self.inertia(inertia));
        Inertial {
            place: place(node),
            mass_kg: mass,
            body_from_inertial: self.origin(node),
            states_center: node.child("origin").is_some_and(|origin| origin.value("xyz").is_some()),
            inertia_kg_m2,
            inertia_place: place(inertia.unwrap_or(node)),
        }
    }

    fn inertia(&mut self, node: Node) -> Option<Matrix3<f64>> {
        let [xx, yy, zz] = ["ixx", "iyy", "izz"].map(|name| self.number(node, name));
        // Readers take a product of inertia that is left out for zero.
        let [xy, xz, yz] = ["ixy", "ixz", "iyz"].map(|name| match node.value(name) {
            Some(_) => self.number(node, name),
            None => Some(0.0),
        });
        let (xx, yy, zz, xy, xz, yz) = (xx?, yy?, zz?, xy?, xz?, yz?);
        Some(Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz))
    }

    fn shape(&mut self, node: Node, role: Role) -> Option<Shape> {
        let Some(geometry) = node.child("geometry").and_then(|geometry| geometry.children().next()) else {
            self.problem(node, format!("<{}> has no geometry", node.name()));
            return None;
        };
        let drake = node.child("drake:proximity_properties");
        let drake = drake.and_then(|drake| drake.child("drake:mu_static").or_else(|| drake.child("drake:mu_dynamic")));
        let friction = drake.and_then(|friction| self.coefficient(friction, "value"));
        Some(Shape {
            name: node.value("name").map(str::to_owned),
            place: place(node),
            role,
            geometry: self.geometry(geometry)?,
            body_from_shape: self.origin(node),
            friction,
            mass: ShapeMass::None,
        })
    }

    fn geometry(&mut self, node: Node) -> Option<Geometry> {
        Some(match node.name() {
            "box" => Geometry::Box { half: self.numbers::<3>(node, "size")?.map(|side| side / 2.0) },
            "sphere" => Geometry::Sphere { radius: self.number(node, "radius")? },
            kind @ ("cylinder" | "capsule") => {
                let (radius, half_length) = (self.number(node, "radius")?, self.number(node, "length")? / 2.0);
                match kind {
                    "cylinder" => Geometry::Cylinder { radius, half_length },
                    _ => Geometry::Capsule { radius, half_length },
                }
            }
            "plane" => Geometry::Plane,
            "mesh" => {
                let named = node.value("filename").or_else(|| {
                    self.problem(node, "<mesh> has no filename".to_owned());
                    None
                })?;
                let scale = match node.value("scale") {
                    Some(_) => self.scale(node)?,
                    None => [1.0; 3],
                };
                Geometry::Mesh(MeshUse {
                    named: named.to_owned(),
                    file: files::find(named, self.folder, self.scope),
                    scale,
                    reference: Isometry3::identity(),
                })
            }
            other => Geometry::Other(other.to_owned()),
        })
    }

    /// Three factors, or one for all directions, which some readers take.
    fn scale(&mut self, node: Node) -> Option<[f64; 3]> {
        let one = node.value("scale").and_then(|text| exactly::<1>(text).ok());
        one.map(|[factor]| [factor; 3]).or_else(|| self.numbers(node, "scale"))
    }

    fn origin(&mut self, node: Node) -> Isometry3<f64> {
        let Some(origin) = node.child("origin") else { return Isometry3::identity() };
        let mut part = |name| origin.value(name).and_then(|_| self.numbers::<3>(origin, name));
        let rotation = part("rpy").map_or_else(UnitQuaternion::identity, of_roll_pitch_yaw);
        Isometry3::from_parts(Translation3::from(part("xyz").unwrap_or_default()), rotation)
    }

    fn friction(&mut self, node: Node) -> Option<Friction> {
        let contact = node.child("contact");
        let lateral = contact.and_then(|contact| contact.child("lateral_friction"));
        let coefficients = node.child("contact_coefficients").filter(|node| node.value("mu").is_some());
        match (lateral, coefficients) {
            (Some(lateral), _) => self.coefficient(lateral, "value"),
            (None, Some(coefficients)) => self.coefficient(coefficients, "mu"),
            (None, None) => None,
        }
    }

    fn coefficient(&mut self, node: Node, name: &str) -> Option<Friction> {
        Some(Friction { place: place(node), coefficient: self.number(node, name)? })
    }

    fn number(&mut self, node: Node, name: &str) -> Option<f64> {
        self.numbers(node, name).map(|[number]| number)
    }

    /// The numbers of an attribute; if they are missing or wrong, that is a problem of the link.
    fn numbers<const N: usize>(&mut self, node: Node, name: &str) -> Option<[f64; N]> {
        let found = match node.value(name) {
            Some(text) => exactly(text),
            None => Err("is missing".to_owned()),
        };
        found.map_err(|problem| self.problem(node, format!("<{}>: {name} {problem}", node.name()))).ok()
    }

    fn problem(&mut self, node: Node, text: String) {
        self.problems.push(Problem { place: place(node), text });
    }
}

/// The friction that a `<gazebo reference="LINK">` states, if the link itself states none.
fn gazebo_friction(node: Node, by_name: &HashMap<String, usize>, bodies: &mut [Body]) {
    let body = node.value("reference").and_then(|name| by_name.get(name)).map(|body| &mut bodies[*body]);
    let (Some(body), Some(written)) = (body, node.child("mu1").or_else(|| node.child("mu"))) else { return };
    // Some write the coefficient as the text of the element, some as its attribute.
    match exactly::<1>(written.value("value").unwrap_or(written.text())) {
        Ok([coefficient]) => {
            body.friction.get_or_insert(Friction { place: place(written), coefficient });
        }
        Err(problem) => {
            let text = format!("<{}> {problem}", written.name());
            body.problems.push(Problem { place: place(written), text });
        }
    }
}

/// # Errors
/// Which link is missing.
fn joint(node: Node, by_name: &HashMap<String, usize>) -> Result<Joint, String> {
    let link = |role: &str| {
        let name = node.child(role).and_then(|link| link.value("link"));
        let name =
            name.ok_or_else(|| format!("the joint {:?} has no {role} link", node.value("name").unwrap_or("")))?;
        match by_name.get(name) {
            Some(link) => Ok(Some(*link)),
            None if name == WORLD => Ok(None),
            None => Err(format!("the {role} link {name:?} of a joint does not exist")),
        }
    };
    Ok(Joint {
        name: node.value("name").map(str::to_owned),
        place: place(node),
        kind: node.value("type").unwrap_or("fixed").to_owned(),
        parent: link("parent")?,
        child: link("child")?.ok_or("the world cannot be the child of a joint")?,
    })
}

/// Sets the parents and the mobility of the links.
fn connect(container: &mut Container) {
    let mut fixed_to: Vec<Option<Option<usize>>> = vec![None; container.bodies.len()];
    for joint in &container.joints {
        let child = &mut container.bodies[joint.child];
        if child.parent.is_some() {
            let text = format!("the link {:?} has a second parent; a link has one", child.name);
            container.problems.push(Problem { place: joint.place.clone(), text });
            continue;
        }
        child.parent = joint.parent;
        fixed_to[joint.child] = (joint.kind == "fixed").then_some(joint.parent);
    }
    let is_world = |body: &Body| body.name == WORLD && body.parent.is_none();
    let mobility: Vec<Mobility> = (0..container.bodies.len())
        .map(|body| {
            // Up along fixed joints; in a circle, the walk ends after as many steps as there are links.
            let mut at = body;
            for _ in 0..container.bodies.len() {
                match fixed_to[at] {
                    Some(Some(parent)) => at = parent,
                    Some(None) => return Mobility::Static,
                    None => break,
                }
            }
            match () {
                () if is_world(&container.bodies[at]) => Mobility::Static,
                () if fixed_to[body].is_some() => Mobility::Fixed,
                () => Mobility::Moves,
            }
        })
        .collect();
    for (body, mobility) in container.bodies.iter_mut().zip(mobility) {
        body.mobility = mobility;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Container {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("robot.urdf");
        std::fs::write(home.path().join("part.stl"), "solid").unwrap();
        let document = Document::parse(text.as_bytes().to_vec()).unwrap();
        read(&path, &document, &ReadScope::new(home.path())).unwrap()
    }

    #[test]
    fn a_link_is_read_with_everything_that_it_states() {
        let container = read_text(
            r#"<robot name="arm" xmlns:drake="d">
  <link name="world"/>
  <link name="hand">
    <inertial>
      <origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/>
      <mass value="2"/>
      <inertia ixx="1" iyy="2" izz="2.5" ixy="0" ixz="0"/>
    </inertial>
    <visual><origin xyz="1 2 3"/><geometry><mesh filename="part.stl" scale="2 2 -2"/></geometry></visual>
    <collision name="c"><geometry><cylinder radius="0.1" length="0.6"/></geometry>
      <drake:proximity_properties><drake:mu_dynamic value="0.7"/></drake:proximity_properties></collision>
    <contact><lateral_friction value="0.9"/></contact>
  </link>
  <link name="finger"><collision><geometry><box size="2 4 6"/></geometry></collision></link>
  <gazebo reference="finger"><mu1>0.4</mu1></gazebo>
  <joint name="j" type="fixed"><parent link="world"/><child link="hand"/></joint>
  <joint name="k" type="revolute"><parent link="hand"/><child link="finger"/></joint>
</robot>"#,
        );
        assert!(container.problems.is_empty(), "{:?}", container.problems);
        let [world, hand, finger] = &container.bodies[..] else { panic!("{:?}", container.bodies) };
        assert_eq!(
            [world.mobility, hand.mobility, finger.mobility],
            [Mobility::Static, Mobility::Static, Mobility::Moves]
        );
        assert_eq!((hand.parent, finger.parent, finger.place.line), (Some(0), Some(1), 14));
        let inertial = hand.inertial.as_ref().unwrap();
        assert_eq!((inertial.mass_kg, inertial.center_m().z, inertial.inertia_place.line), (Some(2.0), 0.1, 7));
        let turned = inertial.inertia_in_body().unwrap();
        assert!((turned[(0, 0)] - 2.0).abs() < 1e-12 && (turned[(1, 1)] - 1.0).abs() < 1e-12, "{turned}");
        let Geometry::Mesh(mesh) = &hand.shapes[0].geometry else { panic!("{:?}", hand.shapes) };
        assert!(mesh.file.is_ok() && mesh.scale == [2.0, 2.0, -2.0]);
        assert_eq!(hand.shapes[1].geometry, Geometry::Cylinder { radius: 0.1, half_length: 0.3 });
        assert_eq!(hand.shapes[1].friction.as_ref().unwrap().coefficient, 0.7);
        assert_eq!(hand.friction.as_ref().unwrap().coefficient, 0.9);
        assert_eq!(finger.friction.as_ref().unwrap().coefficient, 0.4);
        assert_eq!(finger.shapes[0].geometry, Geometry::Box { half: [1.0, 2.0, 3.0] });
    }

    #[test]
    fn what_is_wrong_has_its_line_and_the_rest_is_read() {
        let container = read_text(
            "<robot>\n<link name='a'>\n<inertial><mass value='heavy'/></inertial>\n<visual/>\n\
             <collision><geometry><sphere/></geometry></collision></link>\n<link name='a'/>\n\
             <joint><parent link='a'/><child link='b'/></joint>\n</robot>",
        );
        let lines: Vec<(usize, &str)> =
            container.bodies[0].problems.iter().map(|problem| (problem.place.line, problem.text.as_str())).collect();
        assert_eq!(
            lines,
            [
                (4, "<visual> has no geometry"),
                (5, "<sphere>: radius is missing"),
                (3, "<mass>: value has \"heavy\", which is not a finite number"),
            ]
        );
        let of_file: Vec<&str> = container.problems.iter().map(|problem| problem.text.as_str()).collect();
        assert!(of_file[0].contains("second link") && of_file[1].contains("\"b\""), "{of_file:?}");
    }

    #[test]
    fn links_in_a_circle_end() {
        let joint =
            |parent, child| format!("<joint type='fixed'><parent link='{parent}'/><child link='{child}'/></joint>");
        let container = read_text(&format!(
            "<robot><link name='a'/><link name='b'/>{}{}</robot>",
            joint("a", "b"),
            joint("b", "a")
        ));
        assert!(container.bodies.iter().all(|body| body.mobility == Mobility::Fixed));
    }
}
