//! USD, laid out as SimReady's profile `Robotics-Prop` requires: `NAME/usd/NAME.usda` with its picture in `textures/`,
//! or both in the package `NAME/usdz/NAME.usdz`; either with a thumbnail beside it.
//!
//! One rigid body with mass properties; under it
//! - `skin`, the visual mesh, with a subset and a material for each part,
//! - `colliders`, a convex mesh for each, bound to its part's physics material,
//! - `splat`, the Gaussians as `ParticleField3DGaussianSplat`,
//! - `grasps`, a line from finger to finger for each place to grasp at.
//!
//! If each part is a link, `skin`, `colliders` and `splat` are under the rigid body of each, the places to grasp at under that of the
//! heaviest, and joints fix the links.
//!
//! Soft parts that deform are [`deformable`] bodies beside a link of what is rigid; their Gaussians, which cannot deform, are left out.
//!
//! The variant set `appearance` chooses whether `skin` or `splat` is visible. Metres, kilograms, z up.

mod deformable;
pub(super) mod gaussians;
mod grasps;
mod meshes;
pub(super) mod package;
pub(super) mod physics;
pub(super) mod text;
mod thumbnail;

use std::fmt::Write;

use nalgebra::Vector3;

use super::shape::Skin;
use super::{ExportError, Files, Model, Rigid, Splat, png};
use text::{extent, head, quoted, triple};

/// What both forms have in common.
pub(super) struct Layer {
    text: String,
    /// PNG.
    thumbnail: Vec<u8>,
}

impl Layer {
    pub(super) fn of(model: &Model, rigid: &Rigid) -> Self {
        Self { text: stage(model, rigid), thumbnail: png::encoded(&thumbnail::draw(model, rigid)) }
    }
}

/// The layer as text, with its pictures and thumbnail beside it.
pub(super) fn write_usda(rigid: &Rigid, layer: &Layer, files: &mut Files) -> Result<(), ExportError> {
    let name = &rigid.name;
    files.write(format!("{name}/usd/{name}.usda"), |out| out.write_all(layer.text.as_bytes()))?;
    for (of, skin) in shown(rigid) {
        files.write(format!("{name}/usd/textures/{of}.png"), |out| out.write_all(&skin.picture))?;
    }
    let thumbnail = format!("{name}/usd/.thumbs/256x256/{name}.usda.png");
    files.write(thumbnail, |out| out.write_all(&layer.thumbnail))
}

/// The layer and its pictures in one file, with a thumbnail beside it.
pub(super) fn write_usdz(rigid: &Rigid, layer: &Layer, files: &mut Files) -> Result<(), ExportError> {
    let name = &rigid.name;
    files.write(format!("{name}/usdz/{name}.usdz"), |out| {
        // The first file is the root layer.
        let root = (format!("{name}.usda"), layer.text.as_bytes());
        let pictures = shown(rigid).into_iter().map(|(of, skin)| (format!("textures/{of}.png"), &skin.picture[..]));
        let contents: Vec<(String, &[u8])> = std::iter::once(root).chain(pictures).collect();
        out.write_all(&package::usdz(&contents)?)
    })?;
    let thumbnail = format!("{name}/usdz/.thumbs/256x256/{name}.usdz.png");
    files.write(thumbnail, |out| out.write_all(&layer.thumbnail))
}

/// What is shown, with the name of its picture.
fn shown<'a>(rigid: &'a Rigid) -> Vec<(&'a str, &'a Skin)> {
    let mut shown = rigid.skins();
    shown.extend(rigid.deformable.iter().map(|body| (body.name.as_str(), &body.skin)));
    shown
}

fn stage(model: &Model, rigid: &Rigid) -> String {
    let name = &rigid.name;
    let mut text = format!(
        r#"{head}
def Xform "{name}" (
    prepend apiSchemas = [{physics}"SemanticsLabelsAPI:class", "SemanticsLabelsAPI:wikidata_qcode"]
    kind = "component"
    prepend variantSets = "appearance"
    variants = {{
        string appearance = "skin"
    }}
)
{{
    float3[] extentsHint = {extent}
{mass}{moved}    token[] semantics:labels:class = [{label}]
    token[] semantics:labels:wikidata_qcode = [{wikidata}]

    variantSet "appearance" = {{
        "skin" {{
{without_splat}        }}
        "splat" {{
{without_skin}        }}
    }}

"#,
        head = head(name, &rigid.placement, &metadata(rigid)),
        extent = {
            let (low, high) = rigid.extent();
            extent([low, high].into_iter().map(Into::into))
        },
        physics = match rigid.links.len() {
            _ if rigid.is_one_body() => r#""PhysicsRigidBodyAPI", "PhysicsMassAPI", "#,
            // One link has no joint, which an articulation would need.
            0 | 1 if !rigid.deformable.is_empty() => "",
            _ => r#""PhysicsArticulationRootAPI", "#,
        },
        mass = if rigid.is_one_body() { physics::mass(&rigid.inertial()) } else { String::new() },
        label = quoted(rigid.credits.semantic_label()),
        wikidata = quoted(rigid.credits.wikidata()),
        without_splat = hidden(rigid, "splat"),
        without_skin = hidden(rigid, "skin"),
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
    let splat = model.splat(&rigid.placement);
    if let Some(skin) = rigid.skin {
        meshes::write_skin(&mut text, rigid, skin);
        meshes::write_colliders(&mut text, rigid, rigid.colliders.iter());
        gaussians::write(&mut text, &splat, &splat.all(), &rigid.name);
        grasps::write(&mut text, rigid);
    }
    for n in 0..rigid.links.len() {
        write_link(&mut text, &splat, rigid, n);
    }
    if rigid.links.is_empty() && !rigid.is_one_body() {
        grasps::write(&mut text, rigid);
    }
    rigid.deformable.iter().for_each(|body| deformable::write(&mut text, rigid, body));
    text.push_str("}\n");
    text
}

/// Hides the prim of this name of the object or of each link.
fn hidden(rigid: &Rigid, prim: &str) -> String {
    let over = format!(
        "            over \"{prim}\"\n            {{\n                token visibility = \"invisible\"\n            }}\n"
    );
    if rigid.is_one_body() {
        return over;
    }
    rigid
        .links
        .iter()
        .map(|link| format!("            over \"{}\"\n            {{\n{over}            }}\n", link.name))
        .collect()
}

/// A link as a rigid body with what belongs to it, in the object's axes, and the joint that fixes it.
fn write_link(text: &mut String, splat: &Splat, rigid: &Rigid, n: usize) {
    let link = &rigid.links[n];
    let _ = write!(
        text,
        "    def Xform \"{}\" (\n        prepend apiSchemas = [\"PhysicsRigidBodyAPI\", \"PhysicsMassAPI\"]\n    )\n    {{\n{}\n",
        link.name,
        physics::mass(&link.inertial),
    );
    meshes::write_skin(text, rigid, &link.skin);
    meshes::write_colliders(text, rigid, rigid.colliders_of(n));
    gaussians::write(text, splat, &rigid.gaussians_of(splat, n), &rigid.name);
    if n == 0 {
        grasps::write(text, rigid);
    }
    text.push_str("    }\n\n");
    if let Some(parent) = link.parent {
        let at = triple(link.joint.into());
        let _ = write!(
            text,
            r#"    def PhysicsFixedJoint "{name}_fixed"
    {{
        rel physics:body0 = </{object}/{parent}>
        rel physics:body1 = </{object}/{name}>
        point3f physics:localPos0 = {at}
        point3f physics:localPos1 = {at}
        quatf physics:localRot0 = (1, 0, 0, 0)
        quatf physics:localRot1 = (1, 0, 0, 0)
    }}

"#,
            name = link.name,
            object = rigid.name,
            parent = rigid.links[parent].name,
        );
    }
}

/// The metadata that SimReady's requirement SR.001 wants in the layer's own data.
const CORE_METADATA: [&str; 4] = ["asset_name", "asset_type", "source_file", "usd_date_generated"];

/// The metadata that SimReady's validators require of an asset.
fn metadata(rigid: &Rigid) -> String {
    let (low, high) = rigid.extent();
    let strings = [
        ("asset_license", rigid.credits.license()),
        ("asset_name", rigid.name.as_str()),
        ("asset_type", "Prop"),
        ("author", rigid.credits.author()),
        ("category", "Prop"),
        ("qcode", rigid.credits.wikidata()),
        ("source_file", rigid.source),
        // Without the clock, so that the same input gives the same bytes.
        ("usd_date_generated", "not recorded"),
    ];
    let mut text = String::new();
    // Version 0.1.0 of the core feature, which the features for engines include, looks for these beside the dictionary.
    for (key, value) in strings.iter().filter(|(key, _)| CORE_METADATA.contains(key)) {
        let _ = writeln!(text, "        string {key} = {}", quoted(value));
    }
    text.push_str("        dictionary SimReady_Metadata = {\n");
    let note = rigid.note_on_scale.map(|note| ("note", note));
    for (key, value) in strings.into_iter().chain(note) {
        let _ = writeln!(text, "            string {key} = {}", quoted(value));
    }
    let _ = writeln!(text, "            float3 asset_extents = {}", triple((high - low).into()));
    let _ = writeln!(text, "            double mass = {}", rigid.parts.object.mass_kg.mid);
    let _ = writeln!(
        text,
        "            int rigid_body_count = {}",
        if rigid.is_one_body() { 1 } else { rigid.links.len() }
    );
    text.push_str("            dictionary validation = {\n");
    text.push_str("                string profile = \"Robotics-Prop\"\n");
    text.push_str("                string profile_version = \"4.0.0\"\n");
    text.push_str("            }\n        }\n");
    text
}
