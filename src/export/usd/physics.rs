//! Mass properties and materials. A part's material is both physical and visual: its look is the picture that all
//! parts share.

use std::fmt::Write;

use super::text::{quoted, triple};
use crate::export::deformable::DeformableBody;
use crate::export::links::Inertial;
use crate::export::{Rigid, friction, restitution};
use crate::numeric::principal_axes;
use crate::vote::FieldPart;

/// The attributes of a rigid body's mass.
pub fn mass(Inertial { mass_kg, center_m, inertia }: &Inertial) -> String {
    let (diagonal, axes) = principal_axes(inertia).unwrap_or_default();
    format!(
        r"    point3f physics:centerOfMass = {center}
    float3 physics:diagonalInertia = {diagonal}
    float physics:mass = {mass}
    quatf physics:principalAxes = ({w}, {i}, {j}, {k})
",
        center = triple((*center_m).into()),
        mass = mass_kg,
        diagonal = triple(diagonal.into()),
        w = axes.w,
        i = axes.i,
        j = axes.j,
        k = axes.k,
    )
}

/// The materials of all parts, and the one of the Gaussians.
pub fn write_materials(text: &mut String, rigid: &Rigid) {
    text.push_str("    def Scope \"materials\"\n    {\n");
    rigid.labels.iter().for_each(|label| write_part_material(text, rigid, label));
    write_splat_material(text, &rigid.name);
    text.push_str("    }\n\n");
}

fn write_part_material(text: &mut String, rigid: &Rigid, label: &FieldPart) {
    let name = &rigid.name;
    let part = rigid.part_name(label.id);
    let path = format!("/{name}/materials/{part}");
    // Each link has a picture of its own.
    let of_link = rigid.links.iter().find(|link| link.parts.contains(&label.id)).map(|link| &link.name);
    let picture = of_link.or(rigid.deformable_of(label.id).map(|body| &body.name)).unwrap_or(name);
    // A body of several parts is bound to the material of the first.
    let deforms = rigid.deformable_of(label.id).filter(|body| body.parts[0] == label.id);
    let modulus = |name: &str, of: fn(&DeformableBody) -> f64| {
        deforms.map_or_else(String::new, |body| format!("            float physics:{name} = {}\n", of(body)))
    };
    let bounce = restitution(label)
        .map_or_else(String::new, |restitution| format!("\n            float physics:restitution = {restitution}"));
    let _ = write!(
        text,
        r#"        def Material "{part}" (
            prepend apiSchemas = ["PhysicsMaterialAPI", {schema}"SemanticsLabelsAPI:material"]
            doc = {doc}
        )
        {{
            float physics:density = {density}
            float physics:dynamicFriction = {friction}{bounce}
{poisson}            float physics:staticFriction = {friction}
{young}            token[] semantics:labels:material = [{family}, {material}]
            token outputs:surface.connect = <{path}/surface.outputs:surface>

            def Shader "surface"
            {{
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = <{path}/picture.outputs:rgb>
                float inputs:metallic = 0
                float inputs:roughness = 0.6
                token outputs:surface
            }}

            def Shader "picture"
            {{
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @./textures/{picture}.png@
                token inputs:sourceColorSpace = "sRGB"
                float2 inputs:st.connect = <{path}/place.outputs:result>
                token inputs:wrapS = "clamp"
                token inputs:wrapT = "clamp"
                float3 outputs:rgb
            }}

            def Shader "place"
            {{
                uniform token info:id = "UsdPrimvarReader_float2"
                string inputs:varname = "st"
                float2 outputs:result
            }}
        }}
"#,
        schema = if deforms.is_some() { r#""PhysicsVolumeDeformableMaterialAPI", "# } else { "" },
        poisson = modulus("poissonsRatio", |body| body.poisson_ratio),
        young = modulus("youngsModulus", |body| body.youngs_modulus_pa),
        doc = quoted(&format!("{}: {}", label.material, label.caption)),
        density = label.density_kg_m3.mid,
        friction = friction(label, rigid.on_steel),
        family = quoted(&label.family),
        material = quoted(&label.material),
    );
}

/// The material of the Gaussians of a prim, for its scope of materials.
pub fn write_splat_material(text: &mut String, name: &str) {
    let _ = write!(
        text,
        r#"        # For renderers that draw the Gaussians as points.
        def Material "splat" (
            prepend apiSchemas = ["SemanticsLabelsAPI:material"]
        )
        {{
            token[] semantics:labels:material = ["splat"]
            token outputs:surface.connect = </{name}/materials/splat/surface.outputs:surface>

            def Shader "surface"
            {{
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </{name}/materials/splat/color.outputs:result>
                float inputs:roughness = 0.6
                token outputs:surface
            }}

            def Shader "color"
            {{
                uniform token info:id = "UsdPrimvarReader_float3"
                string inputs:varname = "displayColor"
                float3 outputs:result
            }}
        }}
"#
    );
}
