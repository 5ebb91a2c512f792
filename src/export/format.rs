//! The formats, and for whom each is.

use clap::ValueEnum;
use serde::{Deserialize, Serialize, Serializer};

/// A format to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// MuJoCo: a free body with mass, inertia, visual mesh, convex geoms, friction; a scene with a floor
    Mjcf,
    /// Robot description: one link, visual mesh, convex meshes, friction
    Urdf,
    /// SDFormat, for Gazebo: a model of one link, visual mesh, convex meshes, friction of each part
    Sdf,
    /// NumPy: per-Gaussian and per-part arrays
    Npz,
    /// Samples of mass, centre, inertia, materials and frictions, to randomise a simulation over what is not known
    Belief,
    /// PhysGaussian: configuration and a PLY with per-particle properties
    Physgaussian,
    /// USD as text: rigid body, visual mesh, colliders, materials, Gaussians, places to grasp at
    Usda,
    /// The same as `usda`, as one package
    Usdz,
    /// glTF: a rigid body (`KHR_physics_rigid_bodies`) with a mesh and convex colliders for each part; a second file shows the colliders
    Glb,
    /// glTF with the Gaussians (`KHR_gaussian_splatting`)
    GltfSplat,
    /// A 3DGS PLY for each part
    PlyParts,
    /// The mesh file itself, with physics filled in (glTF), or with URDF, MJCF and JSON beside it (OBJ, STL, PLY)
    Asset,
    /// Tables of a mesh's faces and vertices with part, material and properties
    Csv,
}

impl Format {
    /// Whether its files name places to grasp at.
    pub fn has_grasps(self) -> bool {
        matches!(self, Self::Usda | Self::Usdz)
    }

    /// Whether the scene of several objects in this format has them as [bodies](Body).
    pub fn has_bodies(self) -> bool {
        matches!(self, Self::Mjcf | Self::Urdf | Self::Sdf | Self::Usda | Self::Usdz | Self::Glb)
    }

    /// Whether soft parts can deform in it.
    pub fn can_deform(self) -> bool {
        matches!(self, Self::Mjcf | Self::Usda | Self::Usdz)
    }

    /// Whether only a scene that was made of a mesh has it.
    pub fn needs_mesh(self) -> bool {
        matches!(self, Self::Asset | Self::Csv)
    }

    /// Its name on the command line, and in what is written for programs.
    pub fn name(self) -> String {
        self.value().get_name().to_owned()
    }

    /// What it is for, as the help says it.
    pub fn purpose(self) -> String {
        self.value().get_help().map(ToString::to_string).unwrap_or_default()
    }

    fn value(self) -> clap::builder::PossibleValue {
        self.to_possible_value().expect("no format is hidden")
    }

    /// The programs that read it. `docs/robot.md` says with which it was tried.
    pub fn readers(self) -> &'static [&'static str] {
        match self {
            Self::Mjcf => &["MuJoCo", "MuJoCo Warp", "Newton", "Genesis"],
            Self::Urdf => &["PyBullet", "Drake", "ROS", "Gazebo", "MuJoCo", "Isaac Sim"],
            Self::Sdf => &["Gazebo", "Drake", "PyBullet"],
            Self::Npz => &["NumPy"],
            Self::Belief => &["any reader of JSON"],
            Self::Physgaussian => &["PhysGaussian"],
            Self::Usda | Self::Usdz => &["Isaac Sim", "Newton", "OpenUSD", "Blender"],
            Self::Glb => &["Blender", "three.js", "Babylon.js", "Godot", "trimesh"],
            Self::GltfSplat => &["Babylon.js", "readers of KHR_gaussian_splatting"],
            Self::PlyParts => &["readers of 3DGS PLY", "gprop"],
            Self::Asset => &["whatever reads the mesh"],
            Self::Csv => &["spreadsheets", "pandas"],
        }
    }

    /// The frame in which its positions are.
    pub fn frame(self) -> Frame {
        match self {
            Self::Mjcf | Self::Urdf | Self::Sdf | Self::Usda | Self::Usdz | Self::Belief => Frame::ZUp,
            Self::Glb | Self::GltfSplat => Frame::YUp,
            Self::Npz | Self::Physgaussian => Frame::World,
            Self::PlyParts | Self::Asset | Self::Csv => Frame::Input,
        }
    }

    /// What a scene must have for it.
    pub fn needs(self) -> Option<&'static str> {
        match self {
            Self::Mjcf | Self::Urdf | Self::Sdf | Self::Usda | Self::Usdz | Self::Glb | Self::Belief => {
                Some("a metric scale")
            }
            Self::Asset => Some("a mesh, and a metric scale"),
            Self::Csv => Some("a mesh"),
            Self::Npz | Self::Physgaussian | Self::GltfSplat | Self::PlyParts => None,
        }
    }
}

/// As on the command line.
pub(super) fn names<S: Serializer>(formats: &[Format], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(formats.iter().map(|format| format.name()))
}

/// The frames of exported files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Frame {
    /// Metres, z up: the axes of the object, which stands on z = 0 if the scene was turned.
    ZUp,
    /// The same as glTF has it: (x, y, z) is (x, z, -y) there.
    YUp,
    /// The world's frame: scene units, z up.
    World,
    /// That of the scene's own files.
    Input,
}

impl Frame {
    /// In words.
    pub fn about(self) -> &'static str {
        match self {
            Self::ZUp => "metres, z up",
            Self::YUp => "metres, y up",
            Self::World => "scene units, z up",
            Self::Input => "unit and axes of the scene's own files",
        }
    }
}

/// A format in the list of all.
#[derive(Debug, Serialize)]
pub struct Listed {
    format: String,
    purpose: String,
    readers: &'static [&'static str],
    frame: Frame,
    needs: Option<&'static str>,
}

/// All formats.
pub fn list() -> Vec<Listed> {
    let listed = |format: &Format| Listed {
        format: format.name(),
        purpose: format.purpose(),
        readers: format.readers(),
        frame: format.frame(),
        needs: format.needs(),
    };
    Format::value_variants().iter().map(listed).collect()
}

/// The list as text.
pub fn text(listed: &[Listed]) -> String {
    let entry = |of: &Listed| {
        let needs = of.needs.map_or_else(String::new, |needs| format!("; needs {needs}"));
        let (readers, frame) = (of.readers.join(", "), of.frame.about());
        format!("{:<13} {}\n{:<13} read by {readers}; {frame}{needs}\n", of.format, of.purpose, "")
    };
    listed.iter().map(entry).collect()
}
