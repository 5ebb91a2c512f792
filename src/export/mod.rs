//! The result in the formats of other programs, with one module per format:
//!
//! - [`mjcf`], [`urdf`], [`sdf`]: a rigid body for simulators, with its [`shape`] as convex colliders and as a picture on a mesh;
//! - [`deformable`]: in MJCF and USD, parts that are soft as tetrahedra;
//! - [`usd`]: the same with its Gaussians and the places to grasp at;
//! - [`glb`]: meshes of the parts with their [physics](gltf_physics), or the convex colliders; [`gltf_splat`]: the Gaussians;
//! - [`ply_parts`]: the Gaussians of each part;
//! - [`npz`]: every number as NumPy arrays; [`belief`]: samples of what is believed;
//! - [`physgaussian`]: a model folder and configuration for the MPM simulator PhysGaussian and its forks;
//! - [`mod@asset`]: the mesh from which the scene was made, once more, with its physics, and tables of its faces and vertices.
//!
//! [`names`] are the same in all formats, [`mod@format`] lists the formats, [`summary`] is the file that says what was written, and [`table`] composes the files of several objects of a capture into one scene.
//!
//! Everything rigid is in metres, in the world's frame, z up; the asset of a scene that was turned for that stands on z = 0, and
//! every file says how it lies in the scene's own ([`placement`]). Gaussians that were set aside are left out.

mod asset;
mod belief;
mod body_splats;
mod credits;
mod deformable;
mod format;
mod glb;
pub(crate) mod gltf;
mod gltf_physics;
mod gltf_splat;
mod links;
mod mjcf;
mod names;
mod npz;
mod obj;
mod physgaussian;
mod placement;
mod ply_parts;
mod png;
mod sdf;
mod shape;
mod summary;
mod table;
mod urdf;
mod usd;

use std::borrow::Cow;
use std::cell::OnceCell;
use std::io;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::camera::Camera;
use crate::files::write::{Fill, Folder};
use crate::gaussians::Gaussians;
use crate::gaussians::bounds::robust_bounds;
use crate::grasp::candidates::Candidate;
use crate::materials::MaterialLibrary;
use crate::parts::samples::Sample;
use crate::parts::{Interior, Parts, PartsError};
use crate::scene::SupportSurface;
use crate::units::{Estimate, MetricScale, ScaleSource};
use crate::vote::{FieldPart, MaterialField};
pub use asset::{Asset, Colliders, below};
pub use credits::Credits;
use deformable::{Deformable, DeformableBody, Groups};
pub use format::{Format, Frame, Listed, list, text};
use links::{Inertial, Link, Weighed};
pub use placement::Origin;
use placement::{Axes, Placement};
use shape::{Collider, Painter, PartMesh, Shape, Skin};
pub use summary::{LeftOut, write_summary};
use summary::{ObjectSummary, Provenance};
use table::BodyCollider;
pub use table::{Body, Table, compose};

/// The surface with which the exported frictions are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Counterface {
    /// A gripper's rubber pads
    #[default]
    Rubber,
    /// Smooth steel, such as bare fingers or a machine's table
    Steel,
}

/// The links of an object in URDF, MJCF, SDF and USD.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Links {
    /// One rigid body
    #[default]
    One,
    /// Each part by itself, fixed to its neighbour, so that it can be jointed, broken off or replaced
    Parts,
}

/// What `NAME.glb` shows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum GlbLook {
    /// A closed mesh for each part
    #[default]
    Meshes,
    /// The Gaussians (`KHR_gaussian_splatting`)
    Splat,
    /// Both, one on the other
    Both,
}

/// The data to export.
#[derive(Debug, Clone, Copy)]
pub struct Model<'a> {
    pub name: &'a str,
    /// In the world's frame.
    pub gaussians: &'a Gaussians,
    /// The same Gaussians in the input's frame.
    pub as_read: &'a Gaussians,
    pub world_from_input: UnitQuaternion<f64>,
    pub field: &'a MaterialField,
    pub interior: &'a Interior,
    /// Both `None` if the metric scale is unknown.
    pub scale: Option<&'a MetricScale>,
    pub parts: Option<&'a Parts>,
    /// The surface on which the object stands, in the world's frame and scene units, if it is known.
    pub support: Option<&'a SupportSurface>,
    /// What is believed of it, for the format `belief`.
    pub samples: &'a [Sample],
    /// The cameras of its photos, for the colours of its surface.
    pub cameras: &'a [Camera],
    /// The places to grasp at, best first.
    pub grasps: &'a [Candidate],
    /// With steel, frictions are those that this library has for the parts' materials; else on rubber.
    pub on_steel: Option<&'a MaterialLibrary>,
    pub origin: Origin,
    /// Where the object stands by default, m.
    pub at: Vector3<f64>,
    /// Whether a URDF's object hangs on a floating joint. It does too if it stands elsewhere by default: a root has no pose.
    pub floating: bool,
    pub links: Links,
    /// Whether soft parts deform in formats that [can](Format::can_deform).
    pub deformable: bool,
    pub glb_look: GlbLook,
    /// Whether an MJCF comes with the Gaussians of each body.
    pub mjcf_splats: bool,
    /// Names of the geoms of a gripper's pads, for which MJCF has pairs with the object's.
    pub pad_geoms: &'a [String],
    pub credits: &'a Credits,
    /// Name of the file that holds the splat.
    pub source: &'a str,
    /// The models or persons with recorded answers.
    pub answered_by: &'a [String],
    /// The files that the scene was read from, which no export replaces.
    pub inputs: &'a [PathBuf],
    /// The mesh that the scene was made of.
    pub asset: Option<Asset<'a>>,
}

/// Stands in every export whose scale a model estimated.
const ESTIMATED_SCALE: &str =
    "estimated scale: a model judged how long the object is; lengths and masses are no more accurate than that";

impl Model<'_> {
    /// A remark on how far the scale can be trusted.
    fn note_on_scale(&self) -> Option<&'static str> {
        self.scale.filter(|scale| scale.source == ScaleSource::Estimated).map(|_| ESTIMATED_SCALE)
    }

    /// The friction of a part.
    fn friction(&self, label: &FieldPart) -> f64 {
        friction(label, self.on_steel)
    }

    fn splat(&self, placement: &Placement) -> Splat<'_> {
        let meters_per_unit = self.scale.map_or(1.0, |scale| scale.meters_per_unit);
        Splat { gaussians: self.gaussians, meters_per_unit, origin: placement.origin, field: Some(self.field) }
    }
}

/// Gaussians to draw.
#[derive(Debug, Clone, Copy)]
struct Splat<'a> {
    gaussians: &'a Gaussians,
    /// 1 if the scale is unknown.
    meters_per_unit: f64,
    /// Positions are relative to this point, m.
    origin: Vector3<f64>,
    /// The parts that they belong to; `None` if they were not divided into any.
    field: Option<&'a MaterialField>,
}

impl Splat<'_> {
    /// The indices of all Gaussians.
    fn all(&self) -> Vec<usize> {
        (0..self.gaussians.len()).collect()
    }
}

/// An error of the export.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    #[error(transparent)]
    Scale(#[from] PartsError),
    #[error(
        "the object has no mass, so it is not a rigid body: no part fills any volume; see the warnings of the parts stage"
    )]
    NoMass,
    #[error(
        "the object's shape has no closed surface, because no part fills enough cells; raise --volume-cells, or see \
         the warnings of the parts stage"
    )]
    NoShape,
    #[error(
        "`asset` and `csv` write the mesh from which a scene was made, and this one is a splat; choose other formats"
    )]
    NotAMesh,
    #[error(
        "the file has {count} rigid bodies that move by themselves, or meshes that move with none; gprop weighed all of it as one object. \
         Split it, and run each object by itself"
    )]
    Bodies { count: usize },
    #[error(
        "the library of materials has no {material:?}, so its friction on steel is unknown; give the --materials of the run"
    )]
    NoFriction { material: String },
    #[error(
        "its URDF and MJCF stay where the mesh is, and would replace those with --origin or --at; export it by itself into another folder"
    )]
    InPlace,
    #[error("{path:?} has changed since it was read; run again")]
    Changed { path: PathBuf },
    #[error("{path:?} lies outside of the folder of the mesh that uses it; copy it there, and name it there")]
    NotBeside { path: PathBuf },
    #[error("{path:?} is a file of the scene, which the export would replace; choose another folder with --out")]
    Input { path: PathBuf },
    #[error("cannot write {path:?}: {source}; make room or choose another folder with --out")]
    Write { path: PathBuf, source: io::Error },
}

/// The formats to write.
#[derive(Debug, Clone, Copy)]
pub enum Formats<'a> {
    /// Each of these; it is an error if the object cannot be written in one.
    Each(&'a [Format]),
    /// All in which the object can be written.
    Possible,
}

impl Formats<'_> {
    /// Whether one that is like this may be written.
    pub fn may_be(self, is_like: impl Fn(Format) -> bool) -> bool {
        match self {
            Self::Each(formats) => formats.iter().any(|format| is_like(*format)),
            Self::Possible => true,
        }
    }
}

impl ExportError {
    /// Whether it is about the mesh that is to be written again: found out only when it is read once more.
    fn is_of_mesh(&self) -> bool {
        matches!(self, Self::Bodies { .. } | Self::Changed { .. } | Self::NotBeside { .. })
    }
}

/// Writes the model into `folder` in each of the formats and returns the files, the main one of each format first.
/// Values that several formats need are computed once. Each file is written completely or not at all. The files of another
/// object in `folder` stay as they are, except for MJCF's `scene.xml`, if the two names differ in more than punctuation.
///
/// # Errors
/// If a format needs the scale, a mass or a closed surface and there is none; if a file would replace the splat or a
/// camera file of the scene, or cannot be written.
pub fn export(model: &Model, formats: &[Format], folder: &Path) -> Result<Vec<PathBuf>, ExportError> {
    let exported = export_body(model, Formats::Each(formats), folder)?;
    Ok(exported.files.into_iter().map(|file| file.path).collect())
}

/// A file of an export.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct File {
    pub path: PathBuf,
    pub bytes: u64,
    /// Those that it belongs to.
    pub formats: Vec<Format>,
}

impl File {
    /// A file that was just written and belongs to no format.
    pub fn of(path: PathBuf) -> Self {
        Self { bytes: path.metadata().map_or(0, |file| file.len()), path, formats: Vec::new() }
    }

    fn belongs_to(&mut self, format: Option<Format>) {
        let is_new = |format: &Format| !self.formats.contains(format);
        self.formats.extend(format.filter(is_new));
    }
}

/// What was exported.
#[derive(Debug)]
pub struct Exported {
    /// The main one of each format first.
    pub files: Vec<File>,
    /// The formats that were written.
    pub formats: Vec<Format>,
    pub left_out: Vec<LeftOut>,
    /// What the user should know of it.
    pub notes: Vec<String>,
    /// For a scene of several objects, if a format [has bodies](Format::has_bodies) and the object is rigid.
    pub body: Option<Body>,
    objects: Vec<ObjectSummary>,
    provenance: Provenance,
}

impl Exported {
    /// Adds another object of the same capture. A format counts as written if both were written in it.
    pub fn add(&mut self, other: Self) {
        let is_new = |file: &File| !self.files.iter().any(|known| known.path == file.path);
        let files: Vec<File> = other.files.into_iter().filter(is_new).collect();
        self.files.extend(files);
        self.objects.extend(other.objects);
        let left_out = other.left_out.into_iter().filter(|left| self.formats.contains(&left.format));
        self.left_out.extend(left_out);
        self.formats.retain(|format| other.formats.contains(format));
    }

    /// Puts the files of a scene of several objects before theirs.
    pub fn lead(&mut self, composed: Vec<File>) {
        self.files.retain(|file| !composed.iter().any(|other| other.path == file.path));
        self.files.splice(0..0, composed);
    }
}

/// As [`export`]; also returns what [`compose`] and the [summary](write_summary) need to know of the object.
///
/// # Errors
/// As [`export`].
pub fn export_body(model: &Model, formats: Formats, folder: &Path) -> Result<Exported, ExportError> {
    let own = without_set_aside(model);
    let model = &match &own {
        Some(own) => Model { gaussians: &own.gaussians, as_read: &own.as_read, field: &own.field, ..*model },
        None => *model,
    };
    if let Some(library) = model.on_steel
        && let Some(label) = model.field.parts.iter().find(|label| library.get(&label.material).is_none())
    {
        return Err(ExportError::NoFriction { material: label.material.clone() });
    }
    let shared = Shared::of(model);
    // A mesh that is written again stays where it is.
    let in_place =
        Model { origin: Origin::Input, at: Vector3::zeros(), links: Links::One, deformable: false, ..*model };
    let in_place = Shared::of(&in_place);
    let leaves_out = matches!(formats, Formats::Possible);
    let (mut formats, mut left_out) = possible(&shared, formats)?;
    let inputs = model.inputs.iter().filter_map(|path| path.canonicalize().ok()).collect();
    let mut files = Files::new(folder, inputs);
    for format in formats.clone() {
        files.format = Some(format);
        match write(format, &shared, &in_place, &mut files) {
            Err(error) if leaves_out && error.is_of_mesh() => {
                formats.retain(|other| *other != format);
                left_out.push(LeftOut { format, why: error.to_string() });
            }
            done => done?,
        }
    }
    let body = formats.iter().any(|format| format.has_bodies()).then(|| shared.body()).transpose()?.flatten();
    let objects = vec![ObjectSummary::of(&shared, &formats)?];
    let (notes, provenance) = (notes(&shared, &formats)?, Provenance::of(model));
    Ok(Exported { files: files.written, formats, left_out, notes, body, objects, provenance })
}

/// The formats that can be written, and why others cannot: what the object lacks for a format is found out before a file is written.
fn possible(shared: &Shared, formats: Formats) -> Result<(Vec<Format>, Vec<LeftOut>), ExportError> {
    if let Formats::Each(formats) = formats {
        formats.iter().try_for_each(|format| require(*format, shared))?;
        return Ok((formats.to_vec(), Vec::new()));
    }
    let (mut found, mut left_out) = (Vec::new(), Vec::new());
    for &format in Format::value_variants() {
        match require(format, shared).and_then(|()| require_beside_others(format, shared.model)) {
            Ok(()) => found.push(format),
            Err(error) => left_out.push(LeftOut { format, why: error.to_string() }),
        }
    }
    Ok((found, left_out))
}

/// An error if the object lacks something for the format.
fn require(format: Format, shared: &Shared) -> Result<(), ExportError> {
    match format {
        Format::Mjcf | Format::Urdf | Format::Sdf | Format::Usda | Format::Usdz => drop(shared.rigid()?),
        Format::Glb => drop(shared.part_meshes()?),
        Format::Asset => {
            shared.model.asset.ok_or(ExportError::NotAMesh)?;
            shared.parts()?;
        }
        Format::Csv => drop(shared.model.asset.ok_or(ExportError::NotAMesh)?),
        Format::Belief => drop(shared.parts()?),
        Format::GltfSplat => drop(shared.placement()?),
        Format::PlyParts | Format::Npz | Format::Physgaussian => {}
    }
    Ok(())
}

/// An error if the format's files would replace those of others that differ.
fn require_beside_others(format: Format, model: &Model) -> Result<(), ExportError> {
    let is_moved = model.origin != Origin::Input || model.at != Vector3::zeros();
    match model.asset {
        Some(asset) if format == Format::Asset && is_moved && asset.has_files_beside() => Err(ExportError::InPlace),
        _ => Ok(()),
    }
}

fn write(format: Format, shared: &Shared, in_place: &Shared, files: &mut Files) -> Result<(), ExportError> {
    let model = shared.model;
    match format {
        Format::Mjcf => {
            let rigid = shared.bodies()?;
            mjcf::write(&rigid, files)?;
            if model.mjcf_splats { body_splats::write(&rigid, &model.splat(&rigid.placement), files) } else { Ok(()) }
        }
        Format::Urdf => urdf::write(&shared.rigid()?, files),
        Format::Sdf => sdf::write(shared, files),
        Format::Usda => usd::write_usda(&shared.bodies()?, shared.usd()?, files),
        Format::Usdz => usd::write_usdz(&shared.bodies()?, shared.usd()?, files),
        Format::Glb => glb::write(shared, files),
        Format::GltfSplat => gltf_splat::write(model, &shared.placement()?, files),
        Format::PlyParts => ply_parts::write(model, files),
        Format::Npz => npz::write(model, files),
        Format::Belief => belief::write(model.name, model.samples, &shared.placement()?, model.note_on_scale(), files),
        Format::Physgaussian => physgaussian::write(model, files),
        Format::Asset => asset::write(&model.asset.ok_or(ExportError::NotAMesh)?, in_place, files),
        Format::Csv => asset::write_tables(&model.asset.ok_or(ExportError::NotAMesh)?, model, files),
    }
}

/// What the user should know of parts that are, or might be expected to be, deformable.
fn notes(shared: &Shared, formats: &[Format]) -> Result<Vec<String>, ExportError> {
    if !shared.model.deformable || !formats.iter().any(|format| format.has_bodies()) {
        return Ok(Vec::new());
    }
    let names = names::of_parts(&shared.model.field.parts);
    let called = |parts: &[u32]| parts.iter().map(|part| names[part].as_str()).collect::<Vec<_>>().join(", ");
    let groups = shared.soft()?;
    let soft = groups.parts();
    let mut notes = Vec::new();
    if soft.is_empty() && groups.too_thin.is_empty() {
        notes.push("no part is soft enough to be deformable: all stay rigid".to_owned());
    }
    if !groups.too_thin.is_empty() {
        notes.push(format!("too thin for tetrahedra, so rigid although soft: {}", called(&groups.too_thin)));
    }
    let rigid: Vec<String> = formats
        .iter()
        .filter(|format| format.has_bodies() && !format.can_deform())
        .map(|format| format.name())
        .collect();
    if !soft.is_empty() && !rigid.is_empty() {
        notes.push(format!("rigid in {}, which has no deformable bodies here: {}", rigid.join(", "), called(&soft)));
    }
    Ok(notes)
}

/// The Gaussians and their field, without the Gaussians that were set aside.
struct Kept {
    gaussians: Gaussians,
    as_read: Gaussians,
    field: MaterialField,
}

/// What is kept; `None` if no Gaussian was set aside.
fn without_set_aside(model: &Model) -> Option<Kept> {
    if model.gaussians.set_aside.is_empty() {
        return None;
    }
    let kept: Vec<bool> = model.gaussians.set_aside.iter().map(|set_aside| !set_aside).collect();
    let [mut gaussians, mut as_read] = [model.gaussians, model.as_read].map(Gaussians::clone);
    let mut field = model.field.clone();
    gaussians.retain(&kept);
    as_read.retain(&kept);
    field.retain(&kept);
    Some(Kept { gaussians, as_read, field })
}

/// The model with the values that several formats need, each computed when it is first asked for.
struct Shared<'a> {
    model: &'a Model<'a>,
    shape: OnceCell<Shape>,
    painter: OnceCell<Painter<'a>>,
    skin: OnceCell<Skin>,
    part_meshes: OnceCell<Vec<PartMesh>>,
    links: OnceCell<Vec<Link>>,
    soft: OnceCell<Groups>,
    deformable: OnceCell<Deformable>,
    usd: OnceCell<usd::Layer>,
}

impl<'a> Shared<'a> {
    fn of(model: &'a Model<'a>) -> Self {
        Self {
            model,
            shape: OnceCell::new(),
            painter: OnceCell::new(),
            skin: OnceCell::new(),
            part_meshes: OnceCell::new(),
            links: OnceCell::new(),
            soft: OnceCell::new(),
            deformable: OnceCell::new(),
            usd: OnceCell::new(),
        }
    }
}

impl Shared<'_> {
    fn shape(&self) -> Result<&Shape, ExportError> {
        let Model { interior, field, support, .. } = self.model;
        let scale = self.model.scale.ok_or(PartsError::ScaleUnknown)?;
        if let Some(shape) = self.shape.get() {
            return Ok(shape);
        }
        let shape = Shape::of(interior, &field.parts, *support, scale.meters_per_unit);
        let origin = self.origin(&shape.colliders)?;
        Ok(self.shape.get_or_init(|| shape.around(origin)))
    }

    fn painter(&self) -> Result<&Painter<'_>, ExportError> {
        let (shape, Model { gaussians, cameras, .. }) = (self.shape()?, self.model);
        Ok(self.painter.get_or_init(|| shape.painter(gaussians, cameras)))
    }

    fn part_meshes(&self) -> Result<&[PartMesh], ExportError> {
        let (shape, painter) = (self.shape()?, self.painter()?);
        let meshes = self.part_meshes.get_or_init(|| shape::part_meshes(painter, shape));
        if meshes.is_empty() { Err(ExportError::NoShape) } else { Ok(meshes) }
    }

    /// None if the object is one rigid body.
    fn links(&self) -> Result<&[Link], ExportError> {
        if self.model.links == Links::One {
            return Ok(&[]);
        }
        let (parts, shape, painter) = (self.parts()?, self.shape()?, self.painter()?);
        Ok(self.links.get_or_init(|| links::of(self.model, Weighed::of(parts), shape, painter)))
    }

    fn meshes(&self) -> Result<Meshes<'_>, ExportError> {
        Ok(Meshes { shape: self.shape()?, parts: self.part_meshes()?, placement: self.placement()? })
    }

    /// Where the object's own origin is in the world's frame, m.
    fn origin(&self, colliders: &[Collider]) -> Result<Vector3<f64>, ExportError> {
        Ok(match self.model.origin {
            Origin::Input => Vector3::zeros(),
            Origin::Base => {
                let (low, high) = self.reach(colliders);
                nalgebra::center(&low, &Point3::new(high.x, high.y, low.z)).coords
            }
            Origin::Com => self.parts()?.object.center_of_mass_m.into(),
        })
    }

    /// The corners of the box around the colliders or, if there are none, around the Gaussians.
    fn reach(&self, colliders: &[Collider]) -> (Point3<f64>, Point3<f64>) {
        let mut vertices = colliders.iter().flat_map(|collider| &collider.vertices);
        let Some(first) = vertices.next() else {
            let meters_per_unit = self.model.scale.map_or(1.0, |scale| scale.meters_per_unit);
            let bounds = robust_bounds(self.model.gaussians);
            return (bounds.min * meters_per_unit, bounds.max * meters_per_unit);
        };
        vertices.fold((*first, *first), |(low, high), v| (low.inf(v), high.sup(v)))
    }

    /// The object stands on its lowest collider or, if it has none, on its lowest Gaussian.
    fn placement(&self) -> Result<Placement, ExportError> {
        let Model { world_from_input, origin, at, .. } = *self.model;
        let meters_per_unit = self.model.scale.map_or(1.0, |scale| scale.meters_per_unit);
        let shape = || self.shape().ok();
        let mut placement = match origin {
            Origin::Input => Placement::new(world_from_input, meters_per_unit, || {
                self.reach(shape().map_or(&[], |shape| &shape.colliders)).0.z
            }),
            Origin::Base | Origin::Com => {
                let around = shape().map_or_else(|| self.origin(&[]), |shape| Ok(shape.origin))?;
                Placement::around(around, world_from_input, meters_per_unit)
            }
        };
        placement.at = at;
        Ok(placement)
    }

    /// The parts of an object that has a mass.
    fn parts(&self) -> Result<&Parts, ExportError> {
        let Some(parts) = self.model.parts else { return Err(PartsError::ScaleUnknown.into()) };
        if parts.object.mass_kg.mid > 0.0 { Ok(parts) } else { Err(ExportError::NoMass) }
    }

    /// `None` if the object has no mass or no collider.
    fn body(&self) -> Result<Option<Body>, ExportError> {
        let (Ok(parts), shape) = (self.parts(), self.shape()?) else { return Ok(None) };
        let labels = &self.model.field.parts;
        let placement = self.placement()?;
        let collider_of = |collider: &Collider| BodyCollider {
            shape: collider.clone(),
            friction: self.model.friction(label_of(labels, collider.part)),
            restitution: restitution(label_of(labels, collider.part)),
        };
        Ok((!shape.colliders.is_empty()).then(|| Body {
            name: body_name(self.model.name),
            place_m: placement.place(),
            inertial: inertial_of(parts, &placement),
            colliders: shape.colliders.iter().map(collider_of).collect(),
        }))
    }

    fn usd(&self) -> Result<&usd::Layer, ExportError> {
        let rigid = self.bodies()?;
        Ok(self.usd.get_or_init(|| usd::Layer::of(self.model, &rigid)))
    }

    /// The parts that deform; none if the user did not ask for them.
    fn soft(&self) -> Result<&Groups, ExportError> {
        let (parts, shape) = (self.parts()?, self.shape()?);
        let of = || if self.model.deformable { Groups::of(self.model, shape, parts) } else { Groups::default() };
        Ok(self.soft.get_or_init(of))
    }

    /// The object for formats that have deformable bodies: with those, or as [`rigid`](Self::rigid) if it has none.
    fn bodies(&self) -> Result<Rigid<'_>, ExportError> {
        let rigid = self.rigid()?;
        let groups = self.soft()?;
        if groups.soft.is_empty() {
            return Ok(rigid);
        }
        let (parts, shape, painter) = (self.parts()?, self.shape()?, self.painter()?);
        let Deformable { bodies, links, colliders } =
            self.deformable.get_or_init(|| Deformable::of(self.model, shape, painter, groups, parts));
        if links.is_empty() && !colliders.is_empty() {
            return Err(ExportError::NoShape);
        }
        Ok(Rigid { colliders, skin: None, links, deformable: bodies, ..rigid })
    }

    fn rigid(&self) -> Result<Rigid<'_>, ExportError> {
        let parts = self.parts()?;
        let shape = self.shape()?;
        let (links, painter) = (self.links()?, self.painter()?);
        let skin = links.is_empty().then(|| self.skin.get_or_init(|| shape::skin_of(painter, shape)));
        if shape.colliders.is_empty() || skin.is_some_and(|skin| skin.mesh.volume() <= 0.0) {
            return Err(ExportError::NoShape);
        }
        let placement = self.placement()?;
        Ok(Rigid {
            name: body_name(self.model.name),
            parts,
            labels: &self.model.field.parts,
            colliders: &shape.colliders,
            skin,
            grasps: moved(self.model.grasps, placement.origin),
            on_steel: self.model.on_steel,
            credits: self.model.credits,
            source: self.model.source,
            note_on_scale: self.model.note_on_scale(),
            own_mesh: None,
            links,
            deformable: &[],
            pad_geoms: self.model.pad_geoms,
            has_splats: self.model.mjcf_splats,
            floating: self.model.floating || self.model.at != Vector3::zeros(),
            placement,
        })
    }
}

/// The object as meshes.
struct Meshes<'a> {
    shape: &'a Shape,
    parts: &'a [PartMesh],
    placement: Placement,
}

/// The object as a rigid body.
struct Rigid<'a> {
    /// Name of letters, digits and underscores.
    name: String,
    parts: &'a Parts,
    labels: &'a [FieldPart],
    colliders: &'a [Collider],
    /// `None` if each link has its own.
    skin: Option<&'a Skin>,
    grasps: Cow<'a, [Candidate]>,
    on_steel: Option<&'a MaterialLibrary>,
    credits: &'a Credits,
    source: &'a str,
    note_on_scale: Option<&'static str>,
    placement: Placement,
    /// Whether it hangs on a floating joint in a URDF.
    floating: bool,
    /// Each part by itself, those to which others are fixed first; empty for one rigid body. Beside deformable bodies, what is rigid.
    links: &'a [Link],
    /// Bodies of soft parts, which are in no link.
    deformable: &'a [DeformableBody],
    pad_geoms: &'a [String],
    /// Whether an MJCF names the files with the Gaussians of each body.
    has_splats: bool,
    /// The mesh that URDF shows instead of the skin.
    own_mesh: Option<OwnMesh>,
}

/// A mesh file beside the export.
struct OwnMesh {
    file: String,
    /// Metres per unit, along each axis.
    scale: [f64; 3],
}

impl Rigid<'_> {
    /// Where the asset is in the input's frame, and the note on the scale if there is one, as comments of XML.
    fn comments(&self) -> String {
        let placement = self.placement.comment();
        let notes = self.note_on_scale.into_iter().chain([placement.as_str()]);
        notes.map(|note| format!("<!-- {note} -->\n")).collect()
    }

    /// Whether it is one rigid body, without links.
    fn is_one_body(&self) -> bool {
        self.links.is_empty() && self.deformable.is_empty()
    }

    /// The body that a part deforms with; `None` if it is rigid.
    fn deformable_of(&self, part: u32) -> Option<&DeformableBody> {
        self.deformable.iter().find(|body| body.parts.contains(&part))
    }

    /// The mass properties of the whole: the middle estimates.
    fn inertial(&self) -> Inertial {
        inertial_of(self.parts, &self.placement)
    }

    /// The index of the link to which a collider belongs: the root, if there are none.
    fn link_of(&self, collider: &Collider) -> usize {
        self.links.iter().position(|link| link.parts.contains(&collider.part)).unwrap_or(0)
    }

    /// The indices of the Gaussians that go with a link. Those of a part without a link go with the root, those of one that deforms
    /// with none.
    fn gaussians_of(&self, splat: &Splat, link: usize) -> Vec<usize> {
        let of = |part: u32| self.links.iter().position(|link| link.parts.contains(&part)).unwrap_or(0);
        let parts = splat.field.into_iter().flat_map(MaterialField::part_ids).enumerate();
        parts.filter(|(_, part)| of(*part) == link && self.deformable_of(*part).is_none()).map(|(i, _)| i).collect()
    }

    /// The colliders of a link.
    fn colliders_of(&self, link: usize) -> impl Iterator<Item = &Collider> {
        self.colliders.iter().filter(move |collider| self.link_of(collider) == link)
    }

    /// What is shown: the skin of the whole, or of each link.
    fn skins(&self) -> Vec<(&str, &Skin)> {
        let whole = self.skin.map(|skin| (self.name.as_str(), skin));
        whole.into_iter().chain(self.links.iter().map(|link| (link.name.as_str(), &link.skin))).collect()
    }

    /// The least friction of these colliders; of all parts that have a mass, if there are none.
    fn least_friction(&self, colliders: &[&Collider]) -> f64 {
        if colliders.is_empty() {
            return least_friction(self.labels, self.parts, self.on_steel);
        }
        colliders.iter().map(|collider| self.friction(collider)).fold(f64::INFINITY, f64::min)
    }

    /// The least restitution of these colliders; of all parts, if there are none.
    fn least_restitution(&self, colliders: &[&Collider]) -> Option<f64> {
        let of_colliders = colliders.iter().filter_map(|collider| restitution(self.label(collider)));
        of_colliders.reduce(f64::min).or_else(|| least_restitution(self.labels))
    }

    /// The corners of the box around the colliders, m; around the skin, if there are none.
    fn extent(&self) -> (Point3<f64>, Point3<f64>) {
        let of_skin = self.skins().into_iter().flat_map(|(_, skin)| &skin.mesh.vertices);
        let of_skin = of_skin.filter(|_| self.colliders.is_empty());
        let of_deformable = self.deformable.iter().flat_map(|body| &body.mesh.nodes);
        let of_colliders = self.colliders.iter().flat_map(|collider| &collider.vertices);
        let mut vertices = of_colliders.chain(of_skin).chain(of_deformable);
        let first = *vertices.next().expect("an object with a mass has a shape");
        vertices.fold((first, first), |(low, high), v| (low.inf(v), high.sup(v)))
    }

    fn friction(&self, collider: &Collider) -> f64 {
        friction(self.label(collider), self.on_steel)
    }

    fn label(&self, collider: &Collider) -> &FieldPart {
        label_of(self.labels, collider.part)
    }

    /// The name of a part that no other object has.
    fn part_name(&self, part: u32) -> String {
        names::of_parts(self.labels).get(&part).map_or_else(String::new, |own| names::within(&self.name, own))
    }

    /// The name of a collider that no other object has: several may be in one folder or one simulation.
    fn collider_name(&self, collider: &Collider) -> String {
        names::within(&self.name, &collider.name)
    }
}

/// The mass properties of the whole: the middle estimates.
fn inertial_of(parts: &Parts, placement: &Placement) -> Inertial {
    let object = &parts.object;
    let center = Vector3::from(object.center_of_mass_m) - placement.origin;
    Inertial::new(object.mass_kg.mid, center.into(), object.inertia_kg_m2)
}

/// The least friction of all parts that have a mass.
fn least_friction(labels: &[FieldPart], parts: &Parts, on_steel: Option<&MaterialLibrary>) -> f64 {
    let has_mass = |label: &&FieldPart| parts.part(label.id).is_some_and(|part| part.mass_kg.is_some());
    labels.iter().filter(has_mass).map(|label| friction(label, on_steel)).fold(f64::INFINITY, f64::min)
}

/// The friction of a part on rubber, or on steel as a library has it for the part's material.
fn friction(label: &FieldPart, on_steel: Option<&MaterialLibrary>) -> f64 {
    match on_steel {
        None => label.friction_rubber.mid,
        Some(library) => library.get(&label.material).map_or(f64::NAN, |material| material.friction_steel.mid()),
    }
}

/// What is believed of that friction; `None` if the library lacks the material.
fn friction_range(label: &FieldPart, on_steel: Option<&MaterialLibrary>) -> Option<Estimate> {
    let Some(library) = on_steel else { return Some(label.friction_rubber) };
    let range = library.get(&label.material)?.friction_steel;
    Some(Estimate::new(range.low, range.mid(), range.high))
}

/// The coefficient of restitution of a part on a hard surface, if the library says it.
fn restitution(label: &FieldPart) -> Option<f64> {
    label.restitution.map(|estimate| estimate.mid)
}

/// The least restitution of all parts, if the library says any.
fn least_restitution(labels: &[FieldPart]) -> Option<f64> {
    labels.iter().filter_map(restitution).reduce(f64::min)
}

/// Places to grasp at, relative to an origin.
fn moved(places: &[Candidate], origin: Vector3<f64>) -> Cow<'_, [Candidate]> {
    if origin == Vector3::zeros() {
        return Cow::Borrowed(places);
    }
    let relative = |point: [f64; 3]| (Vector3::from(point) - origin).into();
    let places = places.iter().cloned().map(|mut place| {
        place.contacts_m = place.contacts_m.map(relative);
        place.position_m = relative(place.position_m);
        place
    });
    Cow::Owned(places.collect())
}

/// What a glTF says of the whole asset: its place in the input's frame, the note on the scale if there is one, and the credits.
fn asset_extras(model: &Model, placement: &Placement) -> Value {
    let mut extras = json!({ "input_from_asset": placement.input_from_asset(Axes::YUp) });
    if let Some(note) = model.note_on_scale() {
        extras["note"] = json!(note);
    }
    if let Some(said) = model.credits.said() {
        extras["credits"] = said;
    }
    extras
}

/// The label of the part with this id, which owns cells of the object.
fn label_of(labels: &[FieldPart], part_id: u32) -> &FieldPart {
    labels.iter().find(|label| label.id == part_id).expect("cells belong to parts that have a label")
}

/// What is said of a part in `extras` and in JSON.
fn part_facts(model: &Model, part: u32) -> Value {
    let label = label_of(&model.field.parts, part);
    let weighed = model.parts.and_then(|parts| parts.part(part));
    json!({
        "part": part,
        "caption": label.caption,
        "material": label.material,
        "family": label.family,
        "density_kg_m3": label.density_kg_m3.mid,
        "mass_kg": weighed.as_ref().and_then(|part| part.mass_kg).map(|mass| mass.mid),
        "volume_m3": weighed.as_ref().and_then(|part| part.volume_m3).map(|volume| volume.mid),
        "friction_rubber": label.friction_rubber.mid,
        "restitution": restitution(label),
        "youngs_modulus_pa": label.youngs_modulus_pa.mid,
    })
}

/// Most bytes of an [`identifier`]: file systems allow 255, and an ending follows.
const LONGEST_NAME: usize = 200;

/// A name that every format accepts. Letters beyond ASCII become their code points (`u6728`), so that objects whose names
/// have no others do not get the same; all else becomes underscores.
fn identifier(name: &str) -> String {
    let spelled = |c: char| match c {
        c if c.is_ascii_alphanumeric() => c.to_string(),
        c if c.is_alphanumeric() => format!("u{:x}", u32::from(c)),
        _ => "_".to_owned(),
    };
    let mut letters: String = name.chars().map(spelled).collect();
    letters.truncate(LONGEST_NAME);
    if letters.starts_with(|c: char| c.is_ascii_alphabetic()) { letters } else { format!("object_{letters}") }
}

/// Names that a rigid body cannot have: MuJoCo and URDF call the fixed frame `world`, `scene.xml` is the file that puts
/// the body on a floor, and `asset.json` the [summary].
const TAKEN: [&str; 3] = ["world", "scene", "asset"];

/// The [`identifier`] of a rigid body.
fn body_name(name: &str) -> String {
    let name = identifier(name);
    if TAKEN.iter().any(|taken| name.eq_ignore_ascii_case(taken)) { format!("object_{name}") } else { name }
}

/// A text as the value of an attribute.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// Numbers separated by spaces, with all significant digits.
fn spaced(numbers: impl IntoIterator<Item = f64>) -> String {
    numbers.into_iter().map(|n| n.to_string()).collect::<Vec<_>>().join(" ")
}

/// The folder that is written into.
struct Files<'a> {
    folder: &'a Path,
    /// Canonical paths that must not be replaced.
    inputs: Vec<PathBuf>,
    /// The format that is being written; `None` for what belongs to all.
    format: Option<Format>,
    /// Each file once, although several formats may share it.
    written: Vec<File>,
}

impl<'a> Files<'a> {
    fn new(folder: &'a Path, inputs: Vec<PathBuf>) -> Self {
        Self { folder, inputs, format: None, written: Vec::new() }
    }

    fn write(
        &mut self,
        name: impl AsRef<Path>,
        fill: impl FnOnce(&mut dyn io::Write) -> io::Result<()>,
    ) -> Result<(), ExportError> {
        self.fill(name.as_ref(), Box::new(fill))
    }

    /// Writes a file that several formats have in common, if none of them has written it yet.
    fn share(
        &mut self,
        name: impl AsRef<Path>,
        fill: impl FnOnce(&mut dyn io::Write) -> io::Result<()>,
    ) -> Result<(), ExportError> {
        let path = self.folder.join(&name);
        match self.written.iter_mut().find(|known| known.path == path) {
            Some(known) => {
                known.belongs_to(self.format);
                Ok(())
            }
            None => self.write(name, fill),
        }
    }

    fn fill(&mut self, name: &Path, fill: Fill<'_>) -> Result<(), ExportError> {
        let path = self.folder.join(name);
        if path.canonicalize().is_ok_and(|path| self.inputs.contains(&path)) {
            return Err(ExportError::Input { path });
        }
        let written = Folder::open(self.folder).and_then(|folder| folder.fill(name, fill));
        let size = written.and_then(|()| path.metadata()).map(|file| file.len());
        let bytes = size.map_err(|source| ExportError::Write { path: path.clone(), source })?;
        let Some(known) = self.written.iter_mut().find(|known| known.path == path) else {
            self.written.push(File { path, bytes, formats: self.format.into_iter().collect() });
            return Ok(());
        };
        known.bytes = bytes;
        known.belongs_to(self.format);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::body_name;

    #[test]
    fn a_body_has_a_name_of_its_own() {
        assert_eq!(
            ["scene", "World", "mug", "7 mugs"].map(body_name),
            ["object_scene", "object_World", "mug", "object_7_mugs"]
        );
        assert_eq!(["木", "鉄", "café 2"].map(body_name), ["u6728", "u9244", "cafue9_2"]);
        assert!(body_name(&"木".repeat(85)).len() <= 200);
    }
}
