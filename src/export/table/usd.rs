//! `scene.usda` refers to the layers of the objects, which lie beside it; `scene.usdz` has all of them in one package. The Gaussians
//! of the surroundings are a layer of their own, since they are many: `scene_surroundings.usda`.
//!
//! The variant set `appearance` chooses, as that of an object does, between the meshes and the Gaussians: of all objects on the
//! support, or of all objects in their surroundings.

use std::fmt::Write;
use std::io::{Cursor, Read};

use nalgebra::UnitQuaternion;
use zip::ZipArchive;

use super::super::usd::text::{extent, head, quoted, triple, tuple};
use super::super::usd::{gaussians, package, physics};
use super::super::{ExportError, Files};
use super::Table;
use crate::files::read_large;
use crate::units::GRAVITY_M_S2;

/// The layer of the surroundings.
const SURROUNDINGS: &str = "scene_surroundings.usda";

pub fn write_usda(table: &Table, files: &mut Files) -> Result<(), ExportError> {
    let scene = scene(table, |name| format!("./{name}/usd/{name}.usda"));
    files.write("scene.usda", |out| out.write_all(scene.as_bytes()))?;
    match surroundings(table) {
        Some(layer) => files.write(SURROUNDINGS, |out| out.write_all(layer.as_bytes())),
        None => Ok(()),
    }
}

pub fn write_usdz(table: &Table, files: &mut Files) -> Result<(), ExportError> {
    // The first file is the root layer.
    let mut contents =
        vec![("scene.usda".to_owned(), scene(table, |name| format!("./{name}/{name}.usda")).into_bytes())];
    contents.extend(surroundings(table).map(|layer| (SURROUNDINGS.to_owned(), layer.into_bytes())));
    for body in table.bodies {
        contents.extend(packed(&body.name, files)?);
    }
    let contents: Vec<(String, &[u8])> = contents.iter().map(|(name, bytes)| (name.clone(), &bytes[..])).collect();
    files.write("scene.usdz", |out| out.write_all(&package::usdz(&contents)?))
}

/// The files in the package of an object, in a folder of its name.
fn packed(name: &str, files: &Files) -> Result<Vec<(String, Vec<u8>)>, ExportError> {
    let path = files.folder.join(format!("{name}/usdz/{name}.usdz"));
    let read = || -> Option<Vec<(String, Vec<u8>)>> {
        let mut archive = ZipArchive::new(Cursor::new(read_large(&path).ok()?)).ok()?;
        let count = archive.len();
        let mut file = |index: usize| {
            let mut file = archive.by_index(index).ok()?;
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes).ok()?;
            Some((format!("{name}/{}", file.name().ok()?), bytes))
        };
        (0..count).map(&mut file).collect()
    };
    read().ok_or(ExportError::Changed { path: path.clone() })
}

/// The root layer; `layer_of` is where that of an object lies.
fn scene(table: &Table, layer_of: impl Fn(&str) -> String) -> String {
    let has_surroundings = !table.surroundings.is_empty();
    let note = table.note_on_scale().map(|note| format!("        string note = {}\n", quoted(note)));
    let mut text = format!(
        r#"{head}
def Xform "{name}" (
    kind = "assembly"
    prepend variantSets = "appearance"
    variants = {{
        string appearance = "skin"
    }}
)
{{
{appearances}
    def PhysicsScene "physics"
    {{
        vector3f physics:gravityDirection = (0, 0, -1)
        float physics:gravityMagnitude = {GRAVITY_M_S2}
    }}

"#,
        head = head(&table.name(), &table.placement(), &note.unwrap_or_default()),
        name = table.name(),
        appearances = appearances(table, has_surroundings),
    );
    text.push_str(&support(table));
    let references = table.bodies.iter().map(|body| (body.name.as_str(), layer_of(&body.name)));
    let surroundings = has_surroundings.then(|| ("surroundings", format!("./{SURROUNDINGS}")));
    for (name, layer) in references.chain(surroundings) {
        let _ = write!(text, "\n    def \"{name}\" (\n        prepend references = @{layer}@\n    )\n    {{\n    }}\n");
    }
    text.push_str("}\n");
    text
}

/// The variants of the whole scene.
fn appearances(table: &Table, has_surroundings: bool) -> String {
    let hidden = |name: &str| {
        format!(
            "            over \"{name}\"\n            {{\n                token visibility = \"invisible\"\n            }}\n"
        )
    };
    let of_object = |name: &str| {
        format!(
            "            over \"{name}\" (\n                variants = {{\n                    string appearance = \"splat\"\n                \
             }}\n            )\n            {{\n            }}\n"
        )
    };
    let surroundings = if has_surroundings { hidden("surroundings") } else { String::new() };
    let objects: String = table.bodies.iter().map(|body| of_object(&body.name)).collect();
    format!(
        "    variantSet \"appearance\" = {{\n        \"skin\" {{\n{surroundings}        }}\n        \"splat\" {{\n{support}{objects}        \
         }}\n    }}\n",
        support = hidden("support"),
    )
}

/// The support, which collides without end and is drawn under the objects.
fn support(table: &Table) -> String {
    let square = table.drawn_support();
    let turn = if square.turn == UnitQuaternion::identity() { String::new() } else { orientation(&square.turn) };
    let operations = if turn.is_empty() { "" } else { ", \"xformOp:orient\"" };
    let half = 0.5 * square.side;
    format!(
        r#"    def Plane "support" (
        prepend apiSchemas = ["PhysicsCollisionAPI"]
    )
    {{
        uniform token axis = "Z"
        float3[] extent = {extent}
        double length = {side}
        color3f[] primvars:displayColor = [(0.75, 0.75, 0.75)]
        double width = {side}
        double3 xformOp:translate = {center}
{turn}        uniform token[] xformOpOrder = ["xformOp:translate"{operations}]
    }}
"#,
        extent = extent([[-half, -half, 0.0], [half, half, 0.0]].into_iter()),
        side = square.side,
        center = triple(square.center.coords.into()),
    )
}

fn orientation(turn: &UnitQuaternion<f64>) -> String {
    format!("        quatd xformOp:orient = {}\n", tuple([turn.w, turn.i, turn.j, turn.k], 12))
}

/// The layer with the Gaussians of no object, raised as all are; `None` if there are none.
fn surroundings(table: &Table) -> Option<String> {
    if table.surroundings.is_empty() {
        return None;
    }
    let mut text = format!(
        r#"#usda 1.0
(
    defaultPrim = "surroundings"
    metersPerUnit = 1
    upAxis = "Z"
)

def Xform "surroundings"
{{
    double3 xformOp:translate = {}
    uniform token[] xformOpOrder = ["xformOp:translate"]

    def Scope "materials"
    {{
"#,
        triple(table.placement().place().into()),
    );
    physics::write_splat_material(&mut text, "surroundings");
    text.push_str("    }\n\n");
    let splat = table.splat_of_surroundings();
    gaussians::write(&mut text, &splat, &splat.all(), "surroundings");
    text.push_str("}\n");
    Some(text)
}
