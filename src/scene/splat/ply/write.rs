//! Writes a cloud in the form used by 3DGS trainers, so that every splat viewer opens it.

use std::collections::HashSet;
use std::io::{self, Write};

use super::kinds::ANTIALIASED_COMMENT;
use crate::gaussians::{ExtraProperty, Gaussians};

/// Rows encoded at once.
const ROWS_PER_CHUNK: usize = 1024;

/// Writes `gaussians` as a binary little endian PLY of float32 properties in the order of the original 3DGS code: x y
/// z, nx ny nz if the cloud has them, f_dc, f_rest, opacity, scale, rot; then `extra`, then the other properties of the
/// cloud's own file that `extra` does not replace. Values read from float32 are written back bit for bit.
///
/// # Errors
/// `InvalidInput` if an array does not have one value per Gaussian or a name is not a PLY name; any error of `writer`.
pub fn write(writer: impl Write, gaussians: &Gaussians, extra: &[ExtraProperty]) -> io::Result<()> {
    write_with_comments(writer, gaussians, extra, &[])
}

/// As [`write`], with lines of comment in the header.
///
/// # Errors
/// As [`write`].
pub fn write_with_comments(
    mut writer: impl Write,
    gaussians: &Gaussians,
    extra: &[ExtraProperty],
    comments: &[String],
) -> io::Result<()> {
    let columns = columns(gaussians, extra);
    check(&columns, gaussians.len())?;
    writer.write_all(header(&columns, gaussians, comments).as_bytes())?;
    let mut buffer = Vec::new();
    for first in (0..gaussians.len()).step_by(ROWS_PER_CHUNK) {
        buffer.clear();
        for row in first..gaussians.len().min(first + ROWS_PER_CHUNK) {
            for column in &columns {
                let width = column.names.len();
                let values = &column.values[row * width..(row + 1) * width];
                buffer.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            }
        }
        writer.write_all(&buffer)?;
    }
    writer.flush()
}

/// One array, with a name for each value of a Gaussian.
struct Column<'a> {
    names: Vec<String>,
    values: &'a [f32],
}

fn columns<'a>(gaussians: &'a Gaussians, extra: &'a [ExtraProperty]) -> Vec<Column<'a>> {
    let named = |names: &[&str], values| Column { names: names.iter().map(|n| (*n).to_owned()).collect(), values };
    let numbered = |prefix: &str, count: usize, values| {
        let names = (0..count).map(|i| format!("{prefix}{i}")).collect();
        Column { names, values }
    };
    let single = |extra: &'a ExtraProperty| named(&[&extra.name], &extra.values);
    let replaced: HashSet<&str> = extra.iter().map(|e| e.name.as_str()).collect();
    let (normals, own): (Vec<&ExtraProperty>, Vec<_>) = gaussians
        .extra
        .iter()
        .filter(|e| !replaced.contains(e.name.as_str()))
        .partition(|e| ["nx", "ny", "nz"].contains(&e.name.as_str()));

    let mut columns = vec![named(&["x", "y", "z"], gaussians.positions.as_flattened())];
    columns.extend(normals.into_iter().map(single));
    columns.push(numbered("f_dc_", 3, gaussians.sh_dc.as_flattened()));
    columns.push(numbered("f_rest_", 3 * gaussians.sh_rest_per_channel(), &gaussians.sh_rest));
    columns.push(named(&["opacity"], &gaussians.opacity_logits));
    columns.push(numbered("scale_", 3, gaussians.log_scales.as_flattened()));
    columns.push(numbered("rot_", 4, gaussians.rotations.as_flattened()));
    columns.extend(extra.iter().map(single));
    columns.extend(own.into_iter().map(single));
    columns
}

fn check(columns: &[Column<'_>], count: usize) -> io::Result<()> {
    let invalid = |message| Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    let mut seen = HashSet::new();
    for column in columns {
        if column.values.len() != count * column.names.len() {
            let (found, names) = (column.values.len(), column.names.join(" "));
            return invalid(format!("PLY property {names}: {found} values for {count} Gaussians"));
        }
        for name in &column.names {
            if !is_ply_name(name) || !seen.insert(name) {
                return invalid(format!("PLY property `{name}`: not a valid name, or already taken"));
            }
        }
    }
    Ok(())
}

fn is_ply_name(name: &str) -> bool {
    let letter = |c: char| c.is_ascii_alphabetic() || c == '_';
    name.starts_with(letter) && name.chars().all(|c| letter(c) || c.is_ascii_digit() || c == '-')
}

fn header(columns: &[Column<'_>], gaussians: &Gaussians, comments: &[String]) -> String {
    let count = gaussians.len();
    let antialiased = gaussians.antialiased.then_some(ANTIALIASED_COMMENT);
    let comments = antialiased.into_iter().chain(comments.iter().map(String::as_str));
    let comments: String = comments.map(|comment| format!("comment {comment}\n")).collect();
    let properties: String =
        columns.iter().flat_map(|c| &c.names).map(|name| format!("property float {name}\n")).collect();
    format!("ply\nformat binary_little_endian 1.0\n{comments}element vertex {count}\n{properties}end_header\n")
}
