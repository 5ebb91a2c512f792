//! The skin and the colliders.

use std::fmt::Write;

use nalgebra::Point3;

use super::text::{extent, list, quoted, rounded, triple, tuple};
use crate::export::shape::Skin;
use crate::export::{Collider, Rigid, label_of};

/// The visual mesh, with a subset and a material for each part.
pub fn write_skin(text: &mut String, rigid: &Rigid, skin: &Skin) {
    let name = &rigid.name;
    let normals = list(skin.mesh.shading_normals().into_iter().map(|n| tuple([n.x, n.y, n.z], 6)));
    // Enough for the pixels of any picture.
    let uv = list(skin.uv.iter().flatten().map(|uv| tuple(*uv, 5)));
    let _ = write!(
        text,
        r#"    def Mesh "skin" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
{topology}        uniform token subsetFamily:materialBind:familyType = "partition"
        normal3f[] normals = {normals} (
            interpolation = "vertex"
        )
        texCoord2f[] primvars:st = {uv} (
            interpolation = "faceVarying"
        )
"#,
        topology = topology(&skin.mesh.vertices, &skin.mesh.triangles),
    );
    let mut parts = skin.part.clone();
    parts.sort_unstable();
    parts.dedup();
    if let Some(first) = parts.first() {
        let _ = writeln!(
            text,
            "        rel material:binding = </{name}/materials/{first}>",
            first = rigid.part_name(*first)
        );
    }
    for part in parts {
        let own = (0..skin.part.len()).filter(|t| skin.part[*t] == part);
        let label = label_of(rigid.labels, part);
        let _ = write!(
            text,
            r#"
        def GeomSubset "{part}" (
            prepend apiSchemas = ["MaterialBindingAPI", "SemanticsLabelsAPI:class"]
            displayName = {caption}
        )
        {{
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = {indices}
            rel material:binding = </{name}/materials/{part}>
            token[] semantics:labels:class = [{caption}]
        }}
"#,
            part = rigid.part_name(part),
            caption = quoted(&label.caption),
            indices = list(own.map(|t| t.to_string())),
        );
    }
    text.push_str("    }\n\n");
}

pub fn write_colliders<'a>(text: &mut String, rigid: &Rigid, colliders: impl Iterator<Item = &'a Collider>) {
    text.push_str("    def Scope \"colliders\"\n    {\n");
    colliders.for_each(|collider| write_collider(text, rigid, collider));
    text.push_str("    }\n\n");
}

fn write_collider(text: &mut String, rigid: &Rigid, collider: &Collider) {
    let _ = write!(
        text,
        r#"        def Mesh "{name}" (
            prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMeshCollisionAPI", "MaterialBindingAPI"]
        )
        {{
{topology}            normal3f[] normals = {normals} (
                interpolation = "uniform"
            )
            uniform token physics:approximation = "convexHull"
            uniform token purpose = "guide"
            rel material:binding:physics = </{object}/materials/{part}> (
                bindMaterialAs = "weakerThanDescendants"
            )
        }}
"#,
        name = rigid.collider_name(collider),
        topology = topology(&collider.vertices, &collider.triangles),
        normals = list(collider.triangles.iter().map(|t| face_normal(&collider.vertices, *t))),
        object = rigid.name,
        part = rigid.part_name(collider.part),
    );
}

/// The unit normal of a face.
fn face_normal(vertices: &[Point3<f64>], triangle: [u32; 3]) -> String {
    let [a, b, c] = triangle.map(|v| vertices[v as usize]);
    let normal = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(nalgebra::Vector3::z);
    tuple(normal.iter().copied(), 6)
}

fn topology(vertices: &[Point3<f64>], triangles: &[[u32; 3]]) -> String {
    let points = || vertices.iter().map(|v| [v.x, v.y, v.z].map(|c| rounded(c, 6).parse().unwrap_or(c)));
    format!(
        r#"        float3[] extent = {extent}
        int[] faceVertexCounts = {counts}
        int[] faceVertexIndices = {indices}
        point3f[] points = {points}
        uniform token subdivisionScheme = "none"
"#,
        extent = extent(points()),
        counts = list(triangles.iter().map(|_| "3".to_owned())),
        indices = list(triangles.iter().flatten().map(u32::to_string)),
        points = list(points().map(triple)),
    )
}
