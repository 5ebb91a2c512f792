//! `scene.xml`: MuJoCo includes the file of every object.

use super::super::mjcf::look;
use super::super::{ExportError, Files, spaced};
use super::Table;

pub fn write(table: &Table, files: &mut Files) -> Result<(), ExportError> {
    let text = text(table);
    files.write("scene.xml", |out| out.write_all(text.as_bytes()))
}

fn text(table: &Table) -> String {
    let surface = table.surface();
    let includes: String =
        table.bodies.iter().map(|body| format!("  <include file=\"{}.xml\"/>\n", body.name)).collect();
    format!(
        r#"<mujoco model="{name}">
{includes}{look}  <worldbody>
    <light pos="0 0 3" dir="-0.3 0.3 -0.9" directional="true" diffuse="0.5 0.5 0.5" castshadow="true"/>
    <geom name="support" type="plane" size="0 0 0.05" pos="{at}" zaxis="{normal}" material="support"/>
  </worldbody>
</mujoco>
"#,
        name = table.name(),
        at = spaced((surface.normal * surface.offset).iter().copied()),
        normal = spaced(surface.normal.iter().copied()),
        look = look("support"),
    )
}
