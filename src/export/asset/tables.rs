//! `NAME_faces.csv` and `NAME_vertices.csv`: the part, the material and its properties, row by row, with the names that
//! `field.ply` has for its columns.

use std::io;

use super::super::{ExportError, Files, Model, identifier};
use super::Asset;
use super::labels::SurfaceLabels;
use crate::vote::{MaterialField, field_ply};

/// The columns of `field.ply` that say something of a label.
const COLUMNS: [&str; 8] = ["part_label", "material_id", "density", "E", "nu", "yield_stress", "friction", "hardness"];

pub fn write(asset: &Asset, model: &Model, files: &mut Files) -> Result<(), ExportError> {
    let labels = SurfaceLabels::of(model, asset.mesh);
    let name = identifier(model.name);
    // The columns of each label.
    let count = model.field.parts.len() as u32;
    let each = MaterialField::known(model.field.parts.clone(), (0..count).collect());
    let columns = field_ply::columns(&each);
    let columns: Vec<&Vec<f32>> =
        columns.iter().filter(|column| COLUMNS.contains(&column.name.as_str())).map(|column| &column.values).collect();
    let row = |label: u32| -> Vec<String> {
        let material = &model.field.parts[label as usize].material;
        let numbers = columns.iter().map(|column| column[label as usize]);
        let numbers = numbers.map(|number| if number.is_finite() { number.to_string() } else { String::new() });
        numbers.chain([material.clone()]).collect()
    };
    let rows: Vec<Vec<String>> = (0..count).map(row).collect();
    let of_faces = labels.of_triangle.iter().copied().map(Some).enumerate();
    files.write(format!("{name}_faces.csv"), |out| table(out, "face", of_faces, &rows))?;
    let of_vertices = labels.of_vertex.iter().copied().enumerate();
    files.write(format!("{name}_vertices.csv"), |out| table(out, "vertex", of_vertices, &rows))
}

/// One row for each face or vertex that has a label; `rows` are those of the labels.
fn table(
    out: &mut dyn io::Write,
    what: &str,
    labels: impl Iterator<Item = (usize, Option<u32>)>,
    rows: &[Vec<String>],
) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(out);
    table.write_record([what].into_iter().chain(COLUMNS).chain(["material"]))?;
    for (number, label) in labels {
        let Some(label) = label else { continue };
        table.write_field(number.to_string())?;
        table.write_record(&rows[label as usize])?;
    }
    table.flush()
}
