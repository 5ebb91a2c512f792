//! What a glTF says of rigid bodies: the draft extension `KHR_physics_rigid_bodies`, in its form of 2026.
//!
//! A node with a `motion` is a body, and what lies below it belongs to it, down to the next motion. Its `mass` is in kg; a mass of 0
//! means one without end. `centerOfMass` and the axes of `inertiaDiagonal`, which `inertiaOrientation` turns, are in the node's own
//! frame. Nodes with a `collider` are what collides: the mesh that its `geometry` names (in the form of 2025, the meshes of a
//! node), a shape of `KHR_implicit_shapes`, or (in the form of 2023) a `shape` without a `geometry`.

use gltf::json::{Node, Root};
use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use serde_json::{Value, json};

use super::tree::{self, PlacedNode};
use super::{Problem, split};
use crate::files::json as strict_json;
use crate::files::json_patch::Patch;
use crate::numeric::principal_axes;

pub const EXTENSION: &str = "KHR_physics_rigid_bodies";

/// The nodes of a glTF and what is said of their physics.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    /// The scene that is shown; `None` if the file has no scenes.
    pub scene: Option<usize>,
    /// Of the scene, parents before their children.
    pub nodes: Vec<PlacedNode>,
    /// In the order of `nodes`.
    pub motions: Vec<Motion>,
    /// Indices of `nodes` that have a mesh.
    pub with_meshes: Vec<usize>,
    /// Indices of `nodes` that have a collider.
    pub with_colliders: Vec<usize>,
}

/// A node that a simulation moves.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Motion {
    /// Index of [`Outline::nodes`].
    pub node: usize,
    /// As stated; 0 stands for a mass without end.
    pub mass_kg: Option<f64>,
    /// In the node's frame.
    pub center: Option<Point3<f64>>,
    /// Principal moments of inertia, kg m2, as stated; 0 stands for one without end.
    pub moments: Option<Vector3<f64>>,
    /// From the principal axes to those of the node.
    pub node_from_axes: UnitQuaternion<f64>,
    /// Whether no force moves it.
    pub is_kinematic: bool,
}

impl Outline {
    /// The outline of the GLB or glTF in these bytes, without its buffers.
    ///
    /// # Errors
    /// [`Problem`] if it is not glTF 2, or its nodes are not a tree.
    pub fn of(bytes: &[u8]) -> Result<Self, Problem> {
        let (text, _) = split(bytes)?;
        Self::of_root(&strict_json::parse(text).map_err(Problem::Json)?)
    }

    pub(super) fn of_root(root: &Root) -> Result<Self, Problem> {
        let nodes = tree::placed(root)?;
        let node = |placed: &PlacedNode| &root.nodes[placed.index];
        let indices_of = |has: &dyn Fn(&Node) -> bool| -> Vec<usize> {
            nodes.iter().enumerate().filter(|(_, placed)| has(node(placed))).map(|(at, _)| at).collect()
        };
        let motions = nodes.iter().enumerate();
        let motions = motions.filter_map(|(at, placed)| Some(Motion::of(at, extension(node(placed))?.get("motion")?)));
        Ok(Self {
            scene: (!root.scenes.is_empty()).then(|| root.scene.map_or(0, |scene| scene.value())),
            motions: motions.collect(),
            with_meshes: indices_of(&|node| node.mesh.is_some()),
            with_colliders: indices_of(&|node| {
                extension(node).is_some_and(|extension| extension.get("collider").is_some())
            }),
            nodes,
        })
    }

    /// The index of the motion that moves a node of `nodes`; `None` if none does.
    pub fn motion_of(&self, node: usize) -> Option<usize> {
        let mut at = Some(node);
        while let Some(node) = at {
            if let Some(motion) = self.motions.iter().position(|motion| motion.node == node) {
                return Some(motion);
            }
            at = self.nodes[node].parent;
        }
        None
    }

    /// The stated mass of all bodies together; `None` if none is stated, or one of them has no end.
    pub fn mass_kg(&self) -> Option<f64> {
        let masses: Vec<f64> = self.motions.iter().filter_map(|motion| motion.mass_kg).collect();
        let are_known = !masses.is_empty() && masses.iter().all(|mass| *mass > 0.0);
        are_known.then(|| masses.iter().sum())
    }
}

impl Motion {
    fn of(node: usize, motion: &Value) -> Self {
        let numbers = |name: &str| motion.get(name).and_then(Value::as_array);
        let vector = |name: &str| -> Option<[f64; 3]> { exactly(numbers(name)?) };
        let orientation = numbers("inertiaOrientation").and_then(|numbers| exactly(numbers));
        Self {
            node,
            mass_kg: motion.get("mass").and_then(Value::as_f64),
            center: vector("centerOfMass").map(Point3::from),
            moments: vector("inertiaDiagonal").map(Vector3::from),
            node_from_axes: orientation.map_or_else(UnitQuaternion::identity, tree::rotation),
            is_kinematic: motion.get("isKinematic").and_then(Value::as_bool).unwrap_or(false),
        }
    }
}

/// What is to be stated of a node that moves, in its own frame; `None` leaves what is there.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct NodeStatement {
    pub mass_kg: Option<f64>,
    pub center: Option<Point3<f64>>,
    /// About the centre, along the node's axes, kg m2.
    pub inertia: Option<Matrix3<f64>>,
}

impl NodeStatement {
    /// Changes the node's `motion`.
    pub fn state(&self, motion: &mut Patch) {
        if let Some(mass) = self.mass_kg {
            motion.member("mass").set(mass);
        }
        if let Some(center) = self.center {
            motion.member("centerOfMass").set(json!([center.x, center.y, center.z]));
        }
        if let Some((moments, axes)) = self.inertia.as_ref().and_then(principal_axes) {
            let [x, y, z, w]: [f64; 4] = axes.coords.into();
            motion.member("inertiaDiagonal").set(json!([moments.x, moments.y, moments.z]));
            motion.member("inertiaOrientation").set(json!([x, y, z, w]));
        }
    }
}

/// The extension of a node.
pub(in crate::scene::mesh) fn extension(node: &Node) -> Option<&Value> {
    node.extensions.as_ref()?.others.get(EXTENSION)
}

/// Exactly `N` numbers.
pub(in crate::scene::mesh) fn exactly<const N: usize>(numbers: &[Value]) -> Option<[f64; N]> {
    numbers.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>()?.try_into().ok()
}
