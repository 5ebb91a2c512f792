//! SDFormat: the model of one object, as [`table`](super::table) writes each of a scene, in a file of its own.

use super::table::sdf::write_body;
use super::{ExportError, Files, Shared, obj};

pub(super) fn write(shared: &Shared, files: &mut Files) -> Result<(), ExportError> {
    let (rigid, body) = (shared.rigid()?, shared.body()?.ok_or(ExportError::NoShape)?);
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n{}<sdf version=\"1.9\" xmlns:drake=\"http://drake.mit.edu\">\n",
        rigid.comments()
    );
    write_body(&mut text, &body);
    text.push_str("</sdf>\n");
    files.write(format!("{}.sdf", rigid.name), |out| out.write_all(text.as_bytes()))?;
    obj::write_meshes(&rigid, files)
}
