//! A scene from a mesh instead of a splat: its surface sampled into flat Gaussians, its scale by the format. It has no views
//! yet; they are drawn of the mesh once there is a folder for them.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

use nalgebra::Point3;
use serde::Serialize;

use super::cameras::Registered;
use super::cameras::align::{Align, Conversion};
use super::mesh::{self, Axes, Mesh, MeshError, Names, PaintedMesh, sample};
use super::object::choice::ObjectChoice;
use super::up::choice::UpChoice;
use super::{ObjectSource, Options, Scene, SceneError, Up, scale};
use crate::gaussians::Gaussians;
use crate::gaussians::bounds::longest_side;
use crate::units::{MetricScale, ScaleSource};
use crate::words::output::{counted, thousands};

/// The mesh of a scene, with the triangles on which its Gaussians lie.
#[derive(Debug, Clone)]
pub struct SceneMesh {
    pub painted: PaintedMesh,
    /// For each of the scene's Gaussians, the index of its triangle.
    pub triangle_of_gaussian: Vec<u32>,
}

/// Where in the file the surface under a Gaussian comes from, without any names. The numbers say only what is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Origin {
    /// The look of its material: [`Mesh::looks`].
    pub look: u32,
    /// The node's primitive, object, group or solid: [`mesh::Face::shape`].
    pub shape: u32,
    /// The connected surface, whose triangles share corners.
    pub surface: u32,
}

/// Loads the mesh at `path` as a scene.
pub(super) fn load(path: &Path, options: &Options) -> Result<Scene, SceneError> {
    refuse_options_of_photos(options)?;
    let in_file = |problem| MeshError { path: path.to_owned(), problem };
    let mesh = mesh::read(path, Axes::ZUp, &options.read_scope(&super::home(path)))?;
    let stated = mesh.meters_per_unit.map(|meters_per_unit| MetricScale {
        meters_per_unit,
        source: ScaleSource::Format,
        provenance: "glTF is in metres".to_owned(),
        range: None,
    });
    let mut notes = vec![format!("mesh: {}", MeshCounts::of(&mesh))];
    notes.extend(mesh.notes.iter().cloned());
    let mut warnings = mesh.warnings.clone();
    let files = mesh.files.clone();
    // glTF is the format that says how long a unit is, and it also says which way is up.
    let up = if stated.is_some() { Up::CONVENTION } else { Up::ASSUMED };
    let painted = PaintedMesh::new(mesh).map_err(in_file)?;
    let sampled = sample(&painted).map_err(in_file)?;
    let measured = scale::Measured { object: &sampled.gaussians, floor: None, views: &[], data_set: stated };
    let (scale, unusual) = options.scale.metric_scale(&measured)?;
    let longest = longest_side(&sampled.gaussians, None);
    match &scale {
        Some(scale) => warnings.extend(unusual.map(|warning| {
            let hint = scale::unit::likely(longest, Some(scale.meters_per_unit));
            hint.map_or(warning.clone(), |hint| format!("{warning} {hint}"))
        })),
        None => warnings.push(scale::unit::unstated(longest)),
    }
    Ok(Scene {
        name: path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(),
        gaussians: sampled.gaussians,
        mesh: Some(Arc::new(SceneMesh { painted, triangle_of_gaussian: sampled.triangles })),
        surroundings: Gaussians::default(),
        object_source: ObjectSource::Whole,
        support: None,
        views: Vec::new(),
        conversion: Conversion::default(),
        registered: Registered::default(),
        up,
        up_in_doubt: None,
        as_read: None,
        scale,
        files,
        unchosen: None,
        notes,
        warnings,
    })
}

/// A mesh has no photos, cameras or masks, and is all object.
fn refuse_options_of_photos(options: &Options) -> Result<(), SceneError> {
    let given = [
        (options.splat.is_some(), "--splat"),
        (options.cameras.is_some(), "--cameras"),
        (options.images.is_some(), "--images"),
        (options.masks.is_some(), "--masks"),
        (options.align != Align::default(), "--align"),
        (options.up != UpChoice::Auto, "--up"),
        (options.object != ObjectChoice::Auto, "--object"),
        (options.object_at.is_some(), "--object-at"),
        (options.object_box.is_some(), "--object-box"),
    ];
    match given.into_iter().find(|(is_given, _)| *is_given) {
        Some((_, flag)) => Err(SceneError::NotForMeshes { flag }),
        None => Ok(()),
    }
}

/// What a mesh consists of, without any names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct MeshCounts {
    pub triangles: usize,
    pub vertices: usize,
    pub shapes: usize,
    pub materials: usize,
    pub textures: usize,
}

impl MeshCounts {
    fn of(mesh: &Mesh) -> Self {
        Self {
            triangles: mesh.surface.triangles.len(),
            vertices: mesh.surface.vertices.len(),
            shapes: mesh.shapes,
            materials: mesh.materials.len(),
            textures: mesh.pictures.len(),
        }
    }
}

impl fmt::Display for MeshCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} triangles, {} vertices, {}, {}, {}",
            thousands(self.triangles as u64),
            thousands(self.vertices as u64),
            counted(self.shapes, "shape"),
            counted(self.materials, "material"),
            counted(self.textures, "texture"),
        )
    }
}

impl SceneMesh {
    /// What the mesh consists of.
    pub fn counts(&self) -> MeshCounts {
        MeshCounts::of(&self.painted.mesh)
    }

    /// Where the surface under each of the scene's Gaussians comes from; `surface` has the connected surface of each.
    pub fn origins(&self, surface: &[u32]) -> Vec<Origin> {
        let mesh = &self.painted.mesh;
        let looks = mesh.looks();
        let origin = |(triangle, surface): (&u32, &u32)| {
            let face = &mesh.faces[*triangle as usize];
            Origin { look: looks[face.material as usize], shape: face.shape, surface: *surface }
        };
        self.triangle_of_gaussian.iter().zip(surface).map(origin).collect()
    }

    /// What its author called its materials and shapes, each name once, those of the largest surfaces first.
    pub fn names_in_file(&self) -> Names {
        let Mesh { faces, names, .. } = &self.painted.mesh;
        let faces = || self.triangle_of_gaussian.iter().map(|triangle| &faces[*triangle as usize]);
        Names {
            materials: by_frequency(faces().map(|face| &names.materials[face.material as usize])),
            shapes: by_frequency(faces().map(|face| &names.shapes[face.shape as usize])),
        }
    }

    /// The centre of the box around all triangles, and the greatest distance of a corner from it.
    pub fn bounding_sphere(&self) -> (Point3<f64>, f64) {
        let surface = &self.painted.mesh.surface;
        let corners =
            || surface.triangles.as_flattened().iter().map(|vertex| Point3::from(surface.vertices[*vertex as usize]));
        let empty = (Point3::from([f64::INFINITY; 3]), Point3::from([f64::NEG_INFINITY; 3]));
        let (min, max) = corners().fold(empty, |(min, max), corner| (min.inf(&corner), max.sup(&corner)));
        let center = nalgebra::center(&min, &max);
        (center, corners().map(|corner| (corner - center).norm()).fold(0.0, f64::max))
    }
}

/// Each name once, the most frequent first; among equals, in the order of the alphabet.
fn by_frequency<'a>(names: impl Iterator<Item = &'a String>) -> Vec<String> {
    let mut times: BTreeMap<&String, usize> = BTreeMap::new();
    names.filter(|name| !name.trim().is_empty()).for_each(|name| *times.entry(name).or_default() += 1);
    let mut times: Vec<(&String, usize)> = times.into_iter().collect();
    times.sort_by_key(|(_, times)| std::cmp::Reverse(*times));
    times.into_iter().map(|(name, _)| name.clone()).collect()
}
