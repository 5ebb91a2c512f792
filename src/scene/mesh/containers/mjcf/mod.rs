//! MJCF: MuJoCo's bodies, with their geoms and joints.
//!
//! 1. `documents` reads the model and the files that it includes as one;
//! 2. the compiler's settings, the [default classes](defaults) and the meshes of all sections are collected;
//! 3. the bodies are walked from the world down, through `<frame>`s.
//!
//! Not read: composites, flexible bodies, height fields, plugins and attached models. What `<replicate>` repeats is read once.

mod compiler;
mod defaults;
mod documents;
mod geom;

use std::collections::HashMap;
use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Translation3};

use super::numbers::exactly;
use super::xml::Document;
use super::{Body, Container, ContainerError, FileProblem, Format, Inertial, Joint, MeshUse, Mobility, Problem, files};
use crate::files::read_scope::ReadScope;
use compiler::Compiler;
use defaults::{Defaults, MAIN, Settings};
use documents::{Documents, Item};

/// The attributes that state an orientation.
pub const ORIENTATIONS: [&str; 5] = ["quat", "axisangle", "xyaxes", "zaxis", "euler"];

/// Reads the MJCF at `path`, of which `document` is the text.
pub(super) fn read(path: &Path, document: Document, scope: &ReadScope) -> Result<Container, ContainerError> {
    if document.root().name() != "mujoco" {
        let found = "it is a part that a model includes; name the model".to_owned();
        return Err(ContainerError::NotAContainer { path: path.to_owned(), found });
    }
    let documents = Documents::load(path, document, scope)?;
    let mut problems = Vec::new();
    let compiler = Compiler::read(&documents, &mut problems);
    let defaults = Defaults::read(&documents);
    let model = Model {
        meshes: meshes(&documents, &defaults, &Assets { path, scope, compiler: &compiler }, &mut problems),
        documents: &documents,
        defaults: &defaults,
        compiler: &compiler,
    };
    let mut container = Container {
        format: Format::Mjcf,
        name: documents.root().node.value("model").unwrap_or_default().to_owned(),
        sources: documents.paths.clone(),
        bodies: Vec::new(),
        joints: Vec::new(),
        total_mass_kg: compiler.total_mass_kg,
        problems,
    };
    for world in documents.sections("worldbody") {
        let inherited = world.node.value("childclass").unwrap_or(MAIN);
        let here = Here { body: None, class: inherited, frame: Isometry3::identity() };
        let mut body = new_body(world, "world", None, Mobility::Static);
        model.content(world, &here, &mut body, &mut container);
        if !body.shapes.is_empty() {
            container.bodies.push(body);
        }
    }
    container.bodies.iter_mut().for_each(geom::set_roles);
    Ok(container)
}

/// What the bodies refer to.
struct Model<'a> {
    documents: &'a Documents,
    defaults: &'a Defaults<'a>,
    compiler: &'a Compiler,
    meshes: HashMap<String, MeshUse>,
}

/// Where in the tree an element is.
struct Here<'a> {
    /// The body that it is in, by its index in the container; `None` for the world.
    body: Option<usize>,
    class: &'a str,
    /// The frame of the element in that of its body.
    frame: Isometry3<f64>,
}

/// A body of which nothing but its name is known yet.
fn new_body(item: Item, name: &str, parent: Option<usize>, mobility: Mobility) -> Body {
    Body {
        name: name.to_owned(),
        place: item.place(),
        parent,
        mobility,
        inertial: None,
        shapes: Vec::new(),
        friction: None,
        problems: Vec::new(),
    }
}

impl Model<'_> {
    /// Reads a body and those below it.
    fn body<'a>(&'a self, item: Item<'a>, here: &Here<'a>, container: &mut Container) {
        let is_fixed_to_world = here.body.is_none_or(|parent| container.bodies[parent].mobility == Mobility::Static);
        let is_mocap = item.node.value("mocap") == Some("true");
        let mobility = match () {
            () if self.has_joint(item) && !is_mocap => Mobility::Moves,
            () if is_fixed_to_world || is_mocap => Mobility::Static,
            () => Mobility::Fixed,
        };
        let index = container.bodies.len();
        let mut body = new_body(item, item.node.value("name").unwrap_or_default(), here.body, mobility);
        // It takes its place before those of the bodies below it, which look at how it moves.
        container.bodies.push(new_body(item, "", here.body, mobility));
        let class = item.node.value("childclass").unwrap_or(here.class);
        let inside = Here { body: Some(index), class, frame: Isometry3::identity() };
        self.content(item, &inside, &mut body, container);
        if self.compiler.inertia_from_geoms == compiler::FromGeoms::Always {
            body.inertial = None;
        }
        container.bodies[index] = body;
    }

    /// Reads what is in a body, or in a frame of it.
    fn content<'a>(&'a self, item: Item<'a>, here: &Here<'a>, body: &mut Body, container: &mut Container) {
        for child in self.documents.children(item) {
            match child.node.name() {
                "body" => self.body(child, here, container),
                "geom" => {
                    let settings = self.settings(child, here, body);
                    let geom = geom::Reader { model: self, item: child, settings, problems: &mut body.problems };
                    body.shapes.extend(geom.read(&here.frame));
                }
                "inertial" => body.inertial = Some(self.inertial(child, &mut body.problems)),
                kind @ ("joint" | "freejoint") => {
                    let settings = self.settings(child, here, body);
                    let of_joint = if kind == "freejoint" { "free" } else { settings.value("type").unwrap_or("hinge") };
                    container.joints.extend(here.body.map(|index| Joint {
                        name: child.node.value("name").map(str::to_owned),
                        place: child.place(),
                        kind: of_joint.to_owned(),
                        parent: body.parent,
                        child: index,
                    }));
                }
                kind @ ("frame" | "replicate") => {
                    let class = child.node.value("childclass").unwrap_or(here.class);
                    let settings = Settings::of(child, self.defaults, MAIN);
                    let pose = match kind {
                        "frame" => self.pose(child, &settings, &mut body.problems),
                        _ => Isometry3::identity(),
                    };
                    let inside = Here { body: here.body, class, frame: here.frame * pose };
                    self.content(child, &inside, body, container);
                }
                _ => {}
            }
        }
    }

    fn settings<'a>(&'a self, item: Item<'a>, here: &Here<'a>, body: &mut Body) -> Settings<'a> {
        if let Some(class) = item.node.value("class").filter(|class| !self.defaults.has(class)) {
            let text = format!("<{}>: there is no default class {class:?}", item.node.name());
            body.problems.push(Problem { place: item.place(), text });
        }
        Settings::of(item, self.defaults, here.class)
    }

    /// True if the body has a joint itself, directly or in a frame.
    fn has_joint(&self, item: Item) -> bool {
        self.documents.children(item).into_iter().any(|child| match child.node.name() {
            "joint" | "freejoint" => true,
            "frame" | "replicate" => self.has_joint(child),
            _ => false,
        })
    }

    /// The place and the orientation of an element in the frame that it is in.
    fn pose(&self, item: Item, settings: &Settings, problems: &mut Vec<Problem>) -> Isometry3<f64> {
        let mut problem = |text: String| problems.push(Problem { place: item.place(), text });
        let position = settings.value("pos").map_or(Ok([0.0; 3]), exactly::<3>);
        let position = position.unwrap_or_else(|error| {
            problem(format!("<{}>: pos {error}", item.node.name()));
            [0.0; 3]
        });
        let rotation = self.compiler.rotation(settings).unwrap_or_else(|error| {
            problem(format!("<{}>: {error}", item.node.name()));
            nalgebra::UnitQuaternion::identity()
        });
        Isometry3::from_parts(Translation3::from(position), rotation)
    }

    fn inertial(&self, item: Item, problems: &mut Vec<Problem>) -> Inertial {
        let settings = Settings::of(item, &Defaults::default(), MAIN);
        let body_from_inertial = self.pose(item, &settings, problems);
        let mut numbers = |name: &str, text: Result<Vec<f64>, String>| {
            text.map_err(|error| {
                problems.push(Problem { place: item.place(), text: format!("<inertial>: {name} {error}") });
            })
            .ok()
        };
        let value = |name: &str| item.node.value(name);
        let mass = value("mass").and_then(|text| numbers("mass", exactly::<1>(text).map(Vec::from)));
        let full = value("fullinertia").and_then(|text| numbers("fullinertia", exactly::<6>(text).map(Vec::from)));
        let diagonal = value("diaginertia").and_then(|text| numbers("diaginertia", exactly::<3>(text).map(Vec::from)));
        let inertia_kg_m2 = match (full.as_deref(), diagonal.as_deref()) {
            (Some(&[xx, yy, zz, xy, xz, yz]), _) => Some(Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)),
            (_, Some(&[x, y, z])) => Some(Matrix3::from_diagonal(&nalgebra::Vector3::new(x, y, z))),
            _ => None,
        };
        Inertial {
            place: item.place(),
            mass_kg: mass.map(|mass| mass[0]),
            body_from_inertial,
            states_center: value("pos").is_some(),
            inertia_kg_m2,
            inertia_place: item.place(),
        }
    }
}

/// Where a model's assets are.
struct Assets<'a> {
    path: &'a Path,
    scope: &'a ReadScope,
    compiler: &'a Compiler,
}

impl Assets<'_> {
    /// The file of a mesh.
    fn find(&self, named: &str) -> Result<std::path::PathBuf, FileProblem> {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let name = Path::new(named);
        let name = if self.compiler.strips_paths { name.file_name().map_or(name, Path::new) } else { name };
        let inside = match &self.compiler.mesh_folder {
            Some(meshes) => Path::new(meshes).join(name),
            None => name.to_owned(),
        };
        files::find(&inside.to_string_lossy(), folder, self.scope)
    }
}

/// The meshes of all asset sections, by name.
fn meshes(
    documents: &Documents,
    defaults: &Defaults,
    assets: &Assets,
    problems: &mut Vec<Problem>,
) -> HashMap<String, MeshUse> {
    let mut found = HashMap::new();
    let sections = documents.sections("asset");
    let all = sections.into_iter().flat_map(|section| documents.children(section));
    for item in all.filter(|item| item.node.name() == "mesh") {
        let settings = Settings::of(item, defaults, MAIN);
        // A mesh whose vertices are written in the model, or that MuJoCo makes itself, has no file.
        let Some(named) = item.node.value("file") else { continue };
        let mut numbers = |name: &str, value: Result<Vec<f64>, String>| {
            value.unwrap_or_else(|error| {
                problems.push(Problem { place: item.place(), text: format!("<mesh>: {name} {error}") });
                Vec::new()
            })
        };
        let three = |name| settings.value(name).map_or(Ok(Vec::new()), |text| exactly::<3>(text).map(Vec::from));
        let four = |name| settings.value(name).map_or(Ok(Vec::new()), |text| exactly::<4>(text).map(Vec::from));
        let scale = numbers("scale", three("scale")).try_into().unwrap_or([1.0; 3]);
        let position: [f64; 3] = numbers("refpos", three("refpos")).try_into().unwrap_or_default();
        let turn: [f64; 4] = numbers("refquat", four("refquat")).try_into().unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let turn = super::numbers::of_wxyz(turn).unwrap_or_default();
        let stem = || Path::new(named).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let name = item.node.value("name").map_or_else(stem, str::to_owned);
        let mesh = MeshUse {
            named: named.to_owned(),
            file: assets.find(named),
            scale,
            reference: Isometry3::from_parts(Translation3::from(position), turn),
        };
        found.insert(name, mesh);
    }
    found
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::scene::mesh::containers::{Geometry, Role, ShapeMass, read};

    fn model(files: &[(&str, &str)]) -> Result<Container, ContainerError> {
        let home = tempfile::tempdir().unwrap();
        for (name, text) in files {
            fs::create_dir_all(home.path().join(name).parent().unwrap()).unwrap();
            fs::write(home.path().join(name), text).unwrap();
        }
        read(&home.path().join(files[0].0), &ReadScope::new(home.path()))
    }

    #[test]
    fn classes_includes_frames_and_the_compiler_shape_a_body() {
        let container = model(&[
            (
                "model.xml",
                r#"<mujoco model="m">
  <include file="parts/defaults.xml"/>
  <compiler angle="radian" meshdir="meshes" eulerseq="XYZ"/>
  <asset><mesh file="a.stl" scale="2 2 2" refpos="1 0 0"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1"/>
    <body name="arm" childclass="link">
      <joint type="hinge"/>
      <geom class="seen" mesh="a"/>
      <geom fromto="0 0 0 0 0 2"/>
      <frame pos="1 0 0" euler="0 0 1.5707963267948966">
        <geom type="box" size="1 2 3" pos="1 0 0" mass="5" friction="0.3"/>
        <body name="hand"><inertial pos="0 0 1" mass="2" fullinertia="1 2 3 .1 .2 .3"/></body>
      </frame>
    </body>
  </worldbody>
</mujoco>"#,
            ),
            (
                "parts/defaults.xml",
                r#"<mujocoinclude><default>
  <geom density="500"/>
  <default class="link">
    <geom type="capsule" size="0.1" friction="0.8 0.1 0.1"/>
    <default class="seen"><geom type="mesh" contype="0" conaffinity="0" group="2" mass="0"/></default>
  </default>
</default></mujocoinclude>"#,
            ),
            ("meshes/a.stl", "solid"),
        ])
        .unwrap();
        assert_eq!(container.sources.len(), 2);
        let [arm, hand, world] = &container.bodies[..] else { panic!("{:?}", container.bodies) };
        assert!([arm, hand, world].iter().all(|body| body.problems.is_empty()), "{:?}", container.bodies);
        assert_eq!([arm.mobility, hand.mobility, world.mobility], [Mobility::Moves, Mobility::Fixed, Mobility::Static]);
        let [seen, capsule, framed] = &arm.shapes[..] else { panic!("{:?}", arm.shapes) };
        let Geometry::Mesh(mesh) = &seen.geometry else { panic!("{seen:?}") };
        assert!(mesh.file.is_ok() && mesh.scale == [2.0; 3] && mesh.reference.translation.vector.x == 1.0);
        assert_eq!((seen.role, seen.mass), (Role::Visual, ShapeMass::StatedKg(0.0)));
        assert_eq!(capsule.geometry, Geometry::Capsule { radius: 0.1, half_length: 1.0 });
        assert_eq!((capsule.role, capsule.mass), (Role::Collision, ShapeMass::Density(500.0)));
        assert_eq!(capsule.friction.as_ref().unwrap().coefficient, 0.8);
        assert_eq!((framed.mass, framed.friction.as_ref().unwrap().coefficient), (ShapeMass::StatedKg(5.0), 0.3));
        // Moved by 1 along x, turned about z: what is at x = 1 in the frame is at (1, 1).
        assert!((framed.body_from_shape.translation.vector - nalgebra::Vector3::new(1.0, 1.0, 0.0)).norm() < 1e-12);
        let inertia = hand.inertial.as_ref().unwrap().inertia_kg_m2.unwrap();
        assert_eq!((inertia[(0, 1)], inertia[(0, 2)], inertia[(1, 2)]), (0.1, 0.2, 0.3));
        assert_eq!((hand.parent, container.joints.len(), world.shapes[0].role), (Some(0), 1, Role::Both));
    }

    #[test]
    fn what_nobody_states_is_told_from_what_somebody_does() {
        let container = model(&[(
            "m.xml",
            "<mujoco><worldbody><body><freejoint/>
<geom size='1' class='none'/>
<geom type='box' size='1 2'/>
             <geom euler='0 0 90' size='a'/>
</body></worldbody></mujoco>",
        )])
        .unwrap();
        let body = &container.bodies[0];
        assert_eq!(body.shapes[0].mass, ShapeMass::DefaultDensity(1000.0));
        let problems: Vec<(usize, &str)> = body.problems.iter().map(|p| (p.place.line, p.text.as_str())).collect();
        assert_eq!(
            problems,
            [
                (2, "<geom>: there is no default class \"none\""),
                (3, "<geom>: a box needs more numbers in its size"),
                (4, "<geom>: size has \"a\", which is not a finite number"),
            ]
        );
    }

    #[test]
    fn includes_lead_neither_out_nor_round() {
        let model_of =
            |text: &str| model(&[("a/m.xml", text), ("a/b.xml", "<mujoco><include file='m.xml'/></mujoco>")]);
        let refused = |text: &str| model_of(text).unwrap_err().to_string();
        assert!(refused("<mujoco>\n<include file='b.xml'/></mujoco>").contains("includes itself"));
        assert!(refused("<mujoco>\n<include file='/etc/passwd'/></mujoco>").contains("outside"));
        assert!(refused("<mujoco>\n<include file='none.xml'/></mujoco>").contains("line 2"));
        assert!(refused("<mujocoinclude/>").contains("a part that a model includes"));
        assert!(refused("<html/>").contains("root element is <html>"));
    }
}
