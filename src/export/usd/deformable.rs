//! Deformable bodies, in the form of the AOUSD's proposal for deformables that Newton imports: a `TetMesh` with
//! `PhysicsVolumeDeformableSimAPI` below a prim with `PhysicsDeformableBodyAPI`, beside the mesh that is shown and deforms with it, and a
//! `PhysicsAttachment` for each rigid body on which it hangs. The moduli are in the part's [material](super::physics).

use std::fmt::Write;

use super::meshes;
use super::text::{extent, list, rounded, triple};
use crate::export::Rigid;
use crate::export::deformable::DeformableBody;

/// The body and its attachments.
pub fn write(text: &mut String, rigid: &Rigid, body: &DeformableBody) {
    let (object, name, mesh) = (&rigid.name, &body.name, &body.mesh);
    let points = || mesh.nodes.iter().map(|node| [node.x, node.y, node.z]);
    let indices = |nodes: &[u32]| format!("({})", nodes.iter().map(u32::to_string).collect::<Vec<_>>().join(", "));
    let _ = write!(
        text,
        r#"    def Xform "{name}" (
        prepend apiSchemas = ["PhysicsDeformableBodyAPI"]
    )
    {{
        float physics:mass = {mass}

        def TetMesh "simulation" (
            prepend apiSchemas = ["PhysicsVolumeDeformableSimAPI", "PhysicsCollisionAPI", "MaterialBindingAPI"]
        )
        {{
            float3[] extent = {extent}
            rel material:binding:physics = </{object}/materials/{material}> (
                bindMaterialAs = "weakerThanDescendants"
            )
            float[] physics:masses = {masses}
            uniform token physics:masses:elementType = "tetrahedron"
            point3f[] points = {points}
            uniform token purpose = "guide"
            int3[] surfaceFaceVertexIndices = {surface}
            int4[] tetVertexIndices = {elements}
        }}

"#,
        mass = body.mass_kg,
        extent = extent(points()),
        material = rigid.part_name(body.parts[0]),
        masses = list(body.masses_kg.iter().map(|mass| (*mass as f32).to_string())),
        points = list(points().map(triple)),
        surface = list(mesh.surface.iter().map(|face| indices(face))),
        elements = list(mesh.elements.iter().map(|element| indices(element))),
    );
    meshes::write_skin(text, rigid, &body.skin);
    text.push_str("    }\n\n");
    for (link, nodes) in body.attachments() {
        write_attachment(text, rigid, body, link, &nodes);
    }
}

/// Nodes that are fixed to a rigid body; the axes of all of them are the object's.
fn write_attachment(text: &mut String, rigid: &Rigid, body: &DeformableBody, link: usize, nodes: &[u32]) {
    let place = |node: &u32| {
        let node = body.mesh.nodes[*node as usize];
        format!("({})", [node.x, node.y, node.z].map(|c| rounded(c, 9)).join(", "))
    };
    let link = &rigid.links[link].name;
    let _ = write!(
        text,
        r#"    def PhysicsAttachment "{name}_on_{link}"
    {{
        vector3f[] physics:coords1 = {coords}
        int[] physics:indices0 = {indices}
        rel physics:src0 = </{object}/{name}/simulation>
        rel physics:src1 = </{object}/{link}>
        uniform token physics:type0 = "point"
        uniform token physics:type1 = "xform"
    }}

"#,
        name = body.name,
        object = rigid.name,
        coords = list(nodes.iter().map(place)),
        indices = list(nodes.iter().map(u32::to_string)),
    );
}
