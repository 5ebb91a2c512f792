//! USD, laid out as SimReady's profile `Robotics-Prop` requires: `NAME/usd/NAME.usda` with its picture in `textures/`,
//! or both in the package `NAME/usdz/NAME.usdz`; either with a thumbnail beside it.
//!
//! One rigid body with mass properties; under it
//! - `skin`, the visual mesh, with a subset and a material for each part,
//! - `colliders`, a convex mesh for each, bound to its part's physics material,
//! - `splat`, the Gaussians as `ParticleField3DGaussianSplat`,
//! - `grasps`, a line from finger to finger for each place to grasp at.
//!
//! The variant set `appearance` chooses whether `skin` or `splat` is visible. Metres, kilograms, z up.

pub(super) mod gaussians;
mod grasps;
mod meshes;
pub(super) mod package;
pub(super) mod physics;
pub(super) mod text;
mod thumbnail;

use std::fmt::Write;

use nalgebra::Vector3;

use super::{ExportError, Files, Model, Rigid, obj};
use text::{extent, head, quoted, triple};

/// Wikidata's item "physical object": gprop does not know what kind of thing it measured.
const QCODE: &str = "Q223557";

/// The layer as text, with its picture and thumbnail beside it.
pub(super) fn write_usda(model: &Model, rigid: &Rigid, files: &mut Files) -> Result<(), ExportError> {
    let (name, stage) = (&rigid.name, stage(model, rigid));
    files.write(format!("{name}/usd/{name}.usda"), |out| out.write_all(stage.as_bytes()))?;
    files.write(format!("{name}/usd/textures/{name}.png"), |out| out.write_all(&obj::png(&rigid.skin.picture)?))?;
    write_thumbnail(model, rigid, &format!("{name}/usd/.thumbs/256x256/{name}.usda.png"), files)
}

/// The layer and its picture in one file, with a thumbnail beside it.
pub(super) fn write_usdz(model: &Model, rigid: &Rigid, files: &mut Files) -> Result<(), ExportError> {
    let (name, stage) = (&rigid.name, stage(model, rigid));
    files.write(format!("{name}/usdz/{name}.usdz"), |out| {
        let picture = obj::png(&rigid.skin.picture)?;
        // The first file is the root layer.
        let contents =
            [(format!("{name}.usda"), stage.as_bytes()), (format!("textures/{name}.png"), picture.as_slice())];
        out.write_all(&package::usdz(&contents)?)
    })?;
    write_thumbnail(model, rigid, &format!("{name}/usdz/.thumbs/256x256/{name}.usdz.png"), files)
}

fn write_thumbnail(model: &Model, rigid: &Rigid, path: &str, files: &mut Files) -> Result<(), ExportError> {
    let picture = thumbnail::draw(model, rigid);
    files.write(path, |out| out.write_all(&obj::png(&picture)?))
}

fn stage(model: &Model, rigid: &Rigid) -> String {
    let name = &rigid.name;
    let mut text = format!(
        r#"{head}
def Xform "{name}" (
    prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI", "SemanticsLabelsAPI:class", "SemanticsLabelsAPI:wikidata_qcode"]
    kind = "component"
    prepend variantSets = "appearance"
    variants = {{
        string appearance = "skin"
    }}
)
{{
    float3[] extentsHint = {extent}
{mass}{moved}    token[] semantics:labels:class = ["prop"]
    # Physical object.
    token[] semantics:labels:wikidata_qcode = ["{QCODE}"]

    variantSet "appearance" = {{
        "skin" {{
            over "splat"
            {{
                token visibility = "invisible"
            }}
        }}
        "splat" {{
            over "skin"
            {{
                token visibility = "invisible"
            }}
        }}
    }}

"#,
        head = head(name, &rigid.placement, &metadata(rigid)),
        extent = {
            let (low, high) = rigid.extent();
            extent([low, high].into_iter().map(Into::into))
        },
        mass = physics::mass(rigid),
        moved = if rigid.placement.place() == Vector3::zeros() {
            String::new()
        } else {
            format!(
                "    double3 xformOp:translate = {}\n    uniform token[] xformOpOrder = [\"xformOp:translate\"]\n",
                triple(rigid.placement.place().into())
            )
        },
    );
    physics::write_materials(&mut text, rigid);
    meshes::write_skin(&mut text, rigid);
    meshes::write_colliders(&mut text, rigid);
    gaussians::write(&mut text, &model.splat(&rigid.placement), &rigid.name);
    grasps::write(&mut text, rigid);
    text.push_str("}\n");
    text
}

/// The metadata that SimReady's validators require of an asset.
fn metadata(rigid: &Rigid) -> String {
    let (low, high) = rigid.extent();
    let strings = [
        ("asset_license", "that of the splat"),
        ("asset_name", rigid.name.as_str()),
        ("asset_type", "Prop"),
        ("author", concat!("gprop ", env!("CARGO_PKG_VERSION"))),
        ("category", "Prop"),
        ("qcode", QCODE),
        ("source_file", rigid.source),
        // Without the clock, so that the same input gives the same bytes.
        ("usd_date_generated", "not recorded"),
    ];
    let mut text = "        dictionary SimReady_Metadata = {\n".to_owned();
    let note = rigid.note_on_scale.map(|note| ("note", note));
    for (key, value) in strings.into_iter().chain(note) {
        let _ = writeln!(text, "            string {key} = {}", quoted(value));
    }
    let _ = writeln!(text, "            float3 asset_extents = {}", triple((high - low).into()));
    let _ = writeln!(text, "            double mass = {}", rigid.parts.object.mass_kg.mid);
    let _ = writeln!(text, "            int rigid_body_count = 1");
    text.push_str("            dictionary validation = {\n");
    text.push_str("                string profile = \"Robotics-Prop\"\n");
    text.push_str("                string profile_version = \"4.0.0\"\n");
    text.push_str("            }\n        }\n");
    text
}
