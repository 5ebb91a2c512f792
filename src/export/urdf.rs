//! URDF: one link on a floating joint to the world. A root link without a joint would be welded to the world and lose
//! its mass. The pieces are OBJ files in `meshes/`. URDF supports neither friction nor soft contacts.

use std::fmt::Write;

use super::pieces::Piece;
use super::{ExportError, Files, Rigid, spaced};
use crate::pictures::palette;

pub(super) fn write(rigid: &Rigid, files: &mut Files) -> Result<(), ExportError> {
    files.write(format!("{}.urdf", rigid.name), |out| out.write_all(text(rigid).as_bytes()))?;
    for piece in &rigid.pieces {
        files.write(format!("meshes/{}.obj", piece.name()), |out| out.write_all(obj(piece).as_bytes()))?;
    }
    Ok(())
}

fn text(rigid: &Rigid) -> String {
    let (mass, center, i) = rigid.inertial();
    let mut shapes = String::new();
    for piece in &rigid.pieces {
        let (name, color) = (piece.name(), spaced(palette::part(piece.part).map(f64::from)));
        let geometry = format!(r#"<geometry><mesh filename="meshes/{name}.obj"/></geometry>"#);
        let _ = write!(
            shapes,
            r#"    <visual name="{name}">{geometry}<material name="part{part}"><color rgba="{color} 1"/></material></visual>
    <collision name="{name}">{geometry}</collision>
"#,
            part = piece.part,
        );
    }
    format!(
        r#"<robot name="{name}">
  <mujoco><compiler strippath="false"/></mujoco>
  <link name="world"/>
  <joint name="{name}_free" type="floating"><parent link="world"/><child link="{name}"/></joint>
  <link name="{name}">
    <inertial>
      <origin xyz="{center}" rpy="0 0 0"/>
      <mass value="{mass}"/>
      <inertia ixx="{}" iyy="{}" izz="{}" ixy="{}" ixz="{}" iyz="{}"/>
    </inertial>
{shapes}  </link>
</robot>
"#,
        i[0][0],
        i[1][1],
        i[2][2],
        i[0][1],
        i[0][2],
        i[1][2],
        name = rigid.name,
        center = spaced(center),
    )
}

fn obj(piece: &Piece) -> String {
    let mut text = String::new();
    for v in &piece.vertices {
        let _ = writeln!(text, "v {} {} {}", v.x, v.y, v.z);
    }
    for [a, b, c] in &piece.triangles {
        let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    text
}
