//! `asset.json`, beside the files of an export: what was written, in which frames, from what, and what is believed of it, in short.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Value, json};

use super::format::{self, Format, Frame};
use super::names::{self, within};
use super::placement::Axes;
use super::{Credits, ExportError, Exported, File, Files, Model, Shared, body_name, friction_range, restitution};
use crate::config::in_json;
use crate::files::json::pretty;
use crate::parts::Filling;
use crate::units::{Estimate, MetricScale};
use crate::vote::FieldPart;

/// The name of the file.
pub(super) const FILE: &str = "asset.json";

/// From what an export was made.
#[derive(Debug, Clone)]
pub struct Provenance {
    /// Name of the file that holds the splat or the mesh.
    source: String,
    answered_by: Vec<String>,
    scale: Option<MetricScale>,
    is_on_steel: bool,
    credits: Credits,
}

impl Provenance {
    pub(super) fn of(model: &Model) -> Self {
        Self {
            source: model.source.to_owned(),
            answered_by: model.answered_by.to_vec(),
            scale: model.scale.cloned(),
            is_on_steel: model.on_steel.is_some(),
            credits: model.credits.clone(),
        }
    }
}

/// A format that was not written, and why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    #[serde(serialize_with = "name")]
    pub format: Format,
    pub why: String,
}

fn name<S: serde::Serializer>(format: &Format, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(&format.name())
}

/// What is believed of an object, in short.
#[derive(Debug, Clone, Serialize)]
pub struct ObjectSummary {
    name: String,
    /// By frame: the matrix, by rows, that maps a point to the frame and unit of the scene's files.
    input_from: BTreeMap<Frame, [f64; 16]>,
    mass_kg: Option<Estimate>,
    parts: Vec<PartSummary>,
    fillings: Vec<Value>,
}

#[derive(Debug, Clone, Serialize)]
struct PartSummary {
    part: u32,
    /// In all formats.
    name: String,
    caption: String,
    material: String,
    mass_kg: Option<Estimate>,
    friction: Option<Estimate>,
    restitution: Option<f64>,
}

impl ObjectSummary {
    pub(super) fn of(shared: &Shared, formats: &[Format]) -> Result<Self, ExportError> {
        let model = shared.model;
        let mut input_from = BTreeMap::new();
        for frame in formats.iter().map(|format| format.frame()) {
            let axes = match frame {
                Frame::ZUp => Axes::ZUp,
                Frame::YUp => Axes::YUp,
                Frame::World | Frame::Input => continue,
            };
            input_from.insert(frame, shared.placement()?.input_from_asset(axes));
        }
        let filling = |filling: &Filling| json!({ "inside_of": filling.inside_of, "filling": filling.filling, "mass_kg": filling.mass_kg });
        Ok(Self {
            name: body_name(model.name),
            input_from,
            mass_kg: model.parts.map(|parts| parts.object.mass_kg),
            parts: model.field.parts.iter().map(|label| PartSummary::of(model, label)).collect(),
            fillings: model.parts.iter().flat_map(|parts| &parts.fillings).map(filling).collect(),
        })
    }
}

impl PartSummary {
    fn of(model: &Model, label: &FieldPart) -> Self {
        let weighed = model.parts.and_then(|parts| parts.part(label.id));
        Self {
            part: label.id,
            name: within(&body_name(model.name), &names::of_parts(&model.field.parts)[&label.id]),
            caption: label.caption.clone(),
            material: label.material.clone(),
            mass_kg: weighed.and_then(|part| part.mass_kg),
            friction: friction_range(label, model.on_steel),
            restitution: restitution(label),
        }
    }
}

#[derive(Serialize)]
struct Summary<'a> {
    generator: &'static str,
    source: &'a str,
    /// The models or persons with recorded answers.
    answered_by: &'a [String],
    /// `None` if it is unknown.
    scale: Option<Value>,
    frames: BTreeMap<Frame, Value>,
    friction_on: &'static str,
    /// What the user said of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    credits: Option<Value>,
    objects: &'a [ObjectSummary],
    formats: Vec<Value>,
    left_out: &'a [LeftOut],
    files: Vec<FileSummary<'a>>,
}

#[derive(Serialize)]
struct FileSummary<'a> {
    path: String,
    bytes: u64,
    #[serde(serialize_with = "format::names")]
    formats: &'a [Format],
}

/// Writes the file, and adds it to those of the export.
///
/// # Errors
/// If it would replace one of the scene's, or cannot be written.
pub fn write_summary(exported: &mut Exported, inputs: &[PathBuf], folder: &Path) -> Result<(), ExportError> {
    let Exported { provenance, formats, objects, left_out, .. } = &*exported;
    let scale = provenance.scale.as_ref();
    let of_format = |format: &Format| json!({ "format": format.name(), "purpose": format.purpose(), "frame": format.frame(), "readers": format.readers() });
    let frames = formats.iter().map(|format| (format.frame(), frame(format.frame(), scale.is_some()))).collect();
    let summary = Summary {
        generator: concat!("gprop ", env!("CARGO_PKG_VERSION")),
        source: &provenance.source,
        answered_by: &provenance.answered_by,
        scale: scale.map(
            |scale| json!({ "meters_per_unit": scale.meters_per_unit, "source": scale.source, "range": scale.range }),
        ),
        frames,
        friction_on: if provenance.is_on_steel { "steel" } else { "rubber" },
        credits: provenance.credits.said(),
        objects,
        formats: formats.iter().map(of_format).collect(),
        left_out,
        files: exported.files.iter().map(|file| FileSummary::of(file, folder)).collect(),
    };
    let text = pretty(&summary).expect("a summary is plain data");
    let inputs = inputs.iter().filter_map(|path| path.canonicalize().ok()).collect();
    let mut files = Files::new(folder, inputs);
    files.write(FILE, |out| {
        out.write_all(text.as_bytes())?;
        out.write_all(b"\n")
    })?;
    exported.files.append(&mut files.written);
    Ok(())
}

/// The up axis and the units of a frame. Without a scale, what would be in metres is in scene units.
fn frame(frame: Frame, has_scale: bool) -> Value {
    let up_axis = match frame {
        Frame::ZUp | Frame::World => Some("z"),
        Frame::YUp => Some("y"),
        Frame::Input => None,
    };
    let length = if has_scale && matches!(frame, Frame::ZUp | Frame::YUp) { "m" } else { "scene unit" };
    json!({ "up_axis": up_axis, "units": { "length": length, "mass": "kg" } })
}

impl<'a> FileSummary<'a> {
    fn of(file: &'a File, folder: &Path) -> Self {
        let path = file.path.strip_prefix(folder).unwrap_or(&file.path);
        Self { path: in_json(path).replace('\\', "/"), bytes: file.bytes, formats: &file.formats }
    }
}
