//! A 3DGS PLY for each part, in the scene's own frame and unit, with the columns of `field.ply`, so that any editor of splats can show,
//! move or delete one part: `NAME/parts/partN_CAPTION.ply`. Parts that an earlier export left there under other
//! captions stay.

use super::{ExportError, Files, Model, identifier};
use crate::gaussians::ExtraProperty;
use crate::scene::splat::ply;
use crate::vote::field_ply;

/// Most bytes of a caption in a file's name: a model may write a paragraph, and file systems allow 255 bytes.
const LONGEST: usize = 120;

pub(super) fn write(model: &Model, files: &mut Files) -> Result<(), ExportError> {
    let columns = field_ply::columns(model.field);
    let folder = format!("{}/parts", identifier(model.name));
    for label in &model.field.parts {
        let kept: Vec<bool> = model.field.part_ids().map(|id| id == label.id).collect();
        if !kept.contains(&true) {
            continue;
        }
        let mut gaussians = model.as_read.clone();
        gaussians.retain(&kept);
        let kept_of = |column: &ExtraProperty| ExtraProperty {
            name: column.name.clone(),
            values: column.values.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(value, _)| *value).collect(),
        };
        let columns: Vec<ExtraProperty> = columns.iter().map(kept_of).collect();
        let mut caption = identifier(&label.caption);
        caption.truncate(LONGEST);
        let name = format!("{folder}/part{}_{caption}.ply", label.id);
        files.write(name, |out| ply::write(out, &gaussians, &columns))?;
    }
    Ok(())
}
