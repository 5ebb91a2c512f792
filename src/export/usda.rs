//! USD as text: a rigid body with mass properties, a collider for every convex piece bound to its part's physics
//! material, and the Gaussians' centres as points with their material values as primvars.

use std::fmt::Write;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use super::pieces::Piece;
use super::{ExportError, Files, Model, Rigid};
use crate::scene::gaussians::SH_C0;
use crate::vote::field_ply;

pub(super) fn write(model: &Model, rigid: &Rigid, files: &mut Files) -> Result<(), ExportError> {
    files.write(format!("{}.usda", rigid.name), |out| out.write_all(text(model, rigid).as_bytes()))
}

fn text(model: &Model, rigid: &Rigid) -> String {
    let name = &rigid.name;
    let (mass, center, inertia) = rigid.inertial();
    let (diagonal, axes) = principal(inertia);
    let colliders: String = rigid.pieces.iter().map(|piece| collider(name, piece)).collect();
    format!(
        r#"#usda 1.0
(
    defaultPrim = "{name}"
    metersPerUnit = 1
    kilogramsPerUnit = 1
    upAxis = "Z"
)

def Xform "{name}" (
    kind = "component"
    prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
)
{{
    float physics:mass = {mass}
    point3f physics:centerOfMass = {center}
    float3 physics:diagonalInertia = {diagonal}
    quatf physics:principalAxes = ({w}, {i}, {j}, {k})

    def Scope "Materials"
    {{
{materials}    }}

    def Scope "Colliders"
    {{
{colliders}    }}

{points}}}
"#,
        center = triple(center),
        diagonal = triple(diagonal),
        w = axes.w,
        i = axes.i,
        j = axes.j,
        k = axes.k,
        materials = materials(rigid),
        points = points(model),
    )
}

/// Principal moments and the rotation from their axes to the body's.
fn principal(inertia: [[f64; 3]; 3]) -> ([f64; 3], UnitQuaternion<f64>) {
    let eigen = Matrix3::from_fn(|row, column| inertia[row][column]).symmetric_eigen();
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    (eigen.eigenvalues.into(), turn)
}

fn materials(rigid: &Rigid) -> String {
    let mut text = String::new();
    for label in rigid.labels {
        let friction = label.friction_rubber.mid;
        let _ = write!(
            text,
            r#"        def Material "part{id}" (
            prepend apiSchemas = ["PhysicsMaterialAPI"]
            doc = {doc}
        )
        {{
            float physics:density = {density}
            float physics:staticFriction = {friction}
            float physics:dynamicFriction = {friction}
        }}
"#,
            id = label.id,
            doc = quoted(&format!("{}: {}", label.material, label.caption)),
            density = label.density_kg_m3.mid,
        );
    }
    text
}

/// A string literal for any text: USD uses the same escapes as JSON.
fn quoted(text: &str) -> String {
    serde_json::to_string(text).expect("a string is JSON")
}

fn collider(object: &str, piece: &Piece) -> String {
    let vertices = || piece.vertices.iter().map(|v| [v.x, v.y, v.z]);
    let indices: Vec<String> = piece.triangles.iter().flatten().map(u32::to_string).collect();
    format!(
        r#"        def Mesh "{name}" (
            prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMeshCollisionAPI", "MaterialBindingAPI"]
        )
        {{
            float3[] extent = {extent}
            int[] faceVertexCounts = [{counts}]
            int[] faceVertexIndices = [{indices}]
            point3f[] points = [{points}]
            uniform token subdivisionScheme = "none"
            uniform token physics:approximation = "convexHull"
            uniform token purpose = "guide"
            rel material:binding:physics = </{object}/Materials/part{part}>
        }}
"#,
        name = piece.name(),
        extent = extent(vertices()),
        counts = vec!["3"; piece.triangles.len()].join(", "),
        indices = indices.join(", "),
        points = vertices().map(triple).collect::<Vec<_>>().join(", "),
        part = piece.part,
    )
}

fn points(model: &Model) -> String {
    let gaussians = model.gaussians;
    let meters = model.scale.map_or(1.0, |scale| scale.meters_per_unit);
    let all = 0..gaussians.len();
    let positions = || all.clone().map(|i| (gaussians.center(i) * meters).into());
    let widths = all.clone().map(|i| 2.0 * gaussians.scale(i).max() * meters);
    let colors = gaussians.sh_dc.iter().map(|dc| dc.map(|c| f64::from((0.5 + SH_C0 * c).clamp(0.0, 1.0))));
    let opacities = all.clone().map(|i| gaussians.opacity(i));
    let mut primvars = String::new();
    for column in field_ply::columns(model.field).iter().filter(|c| c.values.iter().all(|v| v.is_finite())) {
        let values = list(column.values.iter().map(|&v| f64::from(v)));
        let name = &column.name;
        let _ = write!(
            primvars,
            "        float[] primvars:{name} = [{values}] (\n            interpolation = \"vertex\"\n        )\n"
        );
    }
    format!(
        r#"    def Points "Gaussians"
    {{
        float3[] extent = {extent}
        point3f[] points = [{points}]
        float[] widths = [{widths}] (
            interpolation = "vertex"
        )
        color3f[] primvars:displayColor = [{colors}] (
            interpolation = "vertex"
        )
        float[] primvars:displayOpacity = [{opacities}] (
            interpolation = "vertex"
        )
{primvars}    }}
"#,
        extent = wide_extent(gaussians, meters),
        points = positions().map(triple).collect::<Vec<_>>().join(", "),
        widths = list(widths),
        colors = colors.map(triple).collect::<Vec<_>>().join(", "),
        opacities = list(opacities),
    )
}

/// The box around the points, widened by half their widths, as USD computes it for points.
fn wide_extent(gaussians: &crate::scene::gaussians::Gaussians, meters: f64) -> String {
    let corners = (0..gaussians.len()).flat_map(|i| {
        let (center, half) = (gaussians.center(i), gaussians.scale(i).max());
        [-half, half].map(|h| center.coords.map(|c| (c + h) * meters).into())
    });
    extent(corners)
}

fn extent(points: impl Iterator<Item = [f64; 3]>) -> String {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points {
        for axis in 0..3 {
            (low[axis], high[axis]) = (low[axis].min(point[axis]), high[axis].max(point[axis]));
        }
    }
    format!("[{}, {}]", triple(low), triple(high))
}

/// USD stores these values in 32 bits; the text has the same precision.
fn triple([x, y, z]: [f64; 3]) -> String {
    format!("({}, {}, {})", x as f32, y as f32, z as f32)
}

fn list(values: impl Iterator<Item = f64>) -> String {
    values.map(|v| (v as f32).to_string()).collect::<Vec<_>>().join(", ")
}
