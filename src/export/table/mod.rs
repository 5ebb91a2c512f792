//! Several objects of a capture as one scene: each object a free body at its place, the surface on which they stand a static
//! collider, and, where a format draws Gaussians, those of the surroundings.
//!
//! [`Table`] describes the scene once. A module per format writes it as `scene.*` beside the files of the objects, which it
//! - includes ([`mjcf`]),
//! - refers to or packs ([`usd`]),
//! - joins ([`gltf`]),
//! - or writes out once more ([`sdf`]): a URDF is one robot, and SDF, in which its users describe worlds, is read by PyBullet only
//!   if it refers to no other file.

mod gltf;
mod mjcf;
pub(super) mod sdf;
mod usd;

use std::path::{Path, PathBuf};

use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::links::Inertial;
use super::placement::Placement;
use super::shape::Collider;
use super::{ESTIMATED_SCALE, ExportError, File, Files, Format, Splat, body_name};
use crate::gaussians::Gaussians;
use crate::scene::Plane;
use crate::scene::splat::ply;
use crate::units::{MetricScale, ScaleSource};

/// Objects of a capture that were exported into one folder.
#[derive(Debug, Clone, Copy)]
pub struct Table<'a> {
    /// Of the capture.
    pub name: &'a str,
    /// The [names](super::Model::name) of all objects.
    pub objects: &'a [String],
    /// All objects, in the same order, if a format [has bodies](Format::has_bodies).
    pub bodies: &'a [Body],
    pub world_from_input: UnitQuaternion<f64>,
    /// `None` if the metric scale is unknown.
    pub scale: Option<&'a MetricScale>,
    /// The surface, in the world's frame and scene units.
    pub support: Plane,
    /// The Gaussians of no object, in the world's frame.
    pub surroundings: &'a Gaussians,
    /// The same Gaussians in the input's frame.
    pub surroundings_as_read: &'a Gaussians,
    /// The files that the objects were read from, which no export replaces.
    pub inputs: &'a [PathBuf],
}

/// An exported object as a rigid body, in metres. Places are those of the object's files.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Of letters, digits and underscores; its files are called so.
    pub name: String,
    /// Where the body's axes are.
    pub place_m: Vector3<f64>,
    pub(super) inertial: Inertial,
    pub(super) colliders: Vec<BodyCollider>,
}

/// A convex collision shape of a body.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyCollider {
    pub(super) shape: Collider,
    pub(super) friction: f64,
    pub(super) restitution: Option<f64>,
}

impl Table<'_> {
    fn name(&self) -> String {
        body_name(self.name)
    }

    fn meters_per_unit(&self) -> f64 {
        self.scale.map_or(1.0, |scale| scale.meters_per_unit)
    }

    /// The surface in metres: in the world's frame if the objects were not turned; those that were stand on z = 0.
    fn surface(&self) -> Plane {
        if self.world_from_input == UnitQuaternion::identity() {
            Plane { offset: self.support.offset * self.meters_per_unit(), ..self.support }
        } else {
            Plane { normal: Vector3::z(), offset: 0.0 }
        }
    }

    /// Of all that the objects share; the support is its lowest part.
    fn placement(&self) -> Placement {
        let meters_per_unit = self.meters_per_unit();
        Placement::new(self.world_from_input, meters_per_unit, || self.support.offset * meters_per_unit)
    }

    fn splat_of_surroundings(&self) -> Splat<'_> {
        Splat {
            gaussians: self.surroundings,
            meters_per_unit: self.meters_per_unit(),
            origin: Vector3::zeros(),
            field: None,
        }
    }

    fn note_on_scale(&self) -> Option<&'static str> {
        self.scale.filter(|scale| scale.source == ScaleSource::Estimated).map(|_| ESTIMATED_SCALE)
    }

    /// The piece of the surface that is drawn: a square under all objects, half as long again as they reach.
    fn drawn_support(&self) -> Square {
        let surface = self.surface();
        let raised = |body: &Body| {
            let vertices = body.colliders.iter().flat_map(|collider| &collider.shape.vertices);
            vertices.map(|vertex| vertex + body.place_m).collect::<Vec<Point3<f64>>>()
        };
        let feet: Vec<Point3<f64>> = self.bodies.iter().flat_map(raised).collect();
        let first = feet.first().copied().unwrap_or_default();
        let (low, high) = feet.iter().fold((first, first), |(low, high), at| (low.inf(at), high.sup(at)));
        let middle = nalgebra::center(&low, &high);
        let center = middle - surface.normal * surface.height(&middle);
        Square { center, side: 1.5 * (high - low).xy().max(), turn: turn_to(&surface.normal) }
    }
}

/// A square on the surface, whose normal is `turn` times z.
struct Square {
    center: Point3<f64>,
    side: f64,
    turn: UnitQuaternion<f64>,
}

/// The shortest turn of z to this direction, which is upward.
fn turn_to(normal: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&Vector3::z(), normal).unwrap_or_else(UnitQuaternion::identity)
}

/// Writes the scene in each of the `formats` that can hold one into `folder`, where the objects were exported in the same formats,
/// and returns its files. MJCF's `scene.xml` takes the place of that of a single object.
///
/// # Errors
/// If a file cannot be written or would replace one of the capture, or one of the objects' files cannot be read.
pub fn compose(table: &Table, formats: &[Format], folder: &Path) -> Result<Vec<File>, ExportError> {
    let inputs = table.inputs.iter().filter_map(|path| path.canonicalize().ok()).collect();
    let mut files = Files::new(folder, inputs);
    for format in formats {
        files.format = Some(*format);
        match format {
            Format::Mjcf => mjcf::write(table, &mut files)?,
            Format::Urdf | Format::Sdf => sdf::write(table, &mut files)?,
            Format::Usda => usd::write_usda(table, &mut files)?,
            Format::Usdz => usd::write_usdz(table, &mut files)?,
            Format::Glb => gltf::write(table, &mut files)?,
            Format::GltfSplat => gltf::write_splat(table, &mut files)?,
            Format::PlyParts => {
                let write = |out: &mut dyn std::io::Write| ply::write(out, table.surroundings_as_read, &[]);
                files.write("scene_surroundings.ply", write)?;
            }
            Format::Npz | Format::Belief | Format::Physgaussian | Format::Asset | Format::Csv => {}
        }
    }
    Ok(files.written)
}
