//! STL, binary and text. Each triangle of an STL has corners of its own; corners at the same place become one vertex.
//!
//! stl_io would take a binary file whose header begins with `solid` for text (many exporters write that), stops at the first
//! of several solids, refuses the undefined normals of triangles without area, and says no line. So the two formats, which
//! are a few lines each, are read here.

use std::collections::HashMap;

use super::assembly::{Assembly, Corner};
use super::beside::Beside;
use super::problems::StlProblem as Problem;
use super::{Mesh, Problem as MeshProblem};

/// Bytes before the triangles of a binary STL: its header and their number.
const HEADER: usize = 84;
/// Bytes of a triangle: normal and corners, 12 floats, and an attribute of two bytes.
const ROW: usize = 50;

pub(super) fn read(bytes: &[u8], _beside: &mut Beside<'_>) -> Result<Mesh, MeshProblem> {
    let mut corners = Corners::default();
    if is_text(bytes) {
        read_text(bytes, &mut corners)?;
    } else {
        read_binary(bytes, &mut corners)?;
    }
    corners.assembly.finished(None)
}

/// A file of exactly the size that its binary header says is binary, even if that header begins with `solid`.
fn is_text(bytes: &[u8]) -> bool {
    const FIRST_FACET_WITHIN: usize = 1024;
    let has_binary_size = triangles_claimed(bytes)
        .is_some_and(|count| u64::from(count) * ROW as u64 + HEADER as u64 == bytes.len() as u64);
    let begin = &bytes[..bytes.len().min(FIRST_FACET_WITHIN)];
    let is_solid = begin.trim_ascii_start().to_ascii_lowercase().starts_with(b"solid");
    !has_binary_size && is_solid && !begin.contains(&0)
}

fn triangles_claimed(bytes: &[u8]) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(80..HEADER)?.first_chunk()?))
}

fn read_binary(bytes: &[u8], corners: &mut Corners) -> Result<(), MeshProblem> {
    let count = triangles_claimed(bytes).ok_or(Problem::NotStl)?;
    let expected = HEADER as u64 + u64::from(count) * ROW as u64;
    if expected > bytes.len() as u64 {
        return Err(Problem::Truncated { count, expected, found: bytes.len() }.into());
    }
    let (rows, _) = bytes[HEADER..expected as usize].as_chunks::<ROW>();
    for (index, row) in rows.iter().enumerate() {
        // After the normal.
        let (values, _) = row[12..48].as_chunks::<4>();
        for corner in values.as_chunks::<3>().0 {
            let position = corner.map(|value| f64::from(f32::from_le_bytes(value)));
            corners.add(position, || format!("triangle {}", index + 1))?;
        }
        corners.end_of_triangle(|| format!("triangle {}", index + 1))?;
    }
    let left_over = bytes.len() as u64 - expected;
    if left_over > 0 {
        corners.assembly.warnings.push(format!(
            "{left_over} bytes follow the last triangle; they are ignored, and the mesh is whole without them"
        ));
    }
    Ok(())
}

fn read_text(bytes: &[u8], corners: &mut Corners) -> Result<(), MeshProblem> {
    for (index, line) in bytes.split(|byte| *byte == b'\n').enumerate() {
        let number = index + 1;
        let place = || format!("line {number}");
        let text = String::from_utf8_lossy(line);
        let mut words = text.split_ascii_whitespace();
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("solid") => corners.assembly.shape(words.collect::<Vec<_>>().join(" "), place)?,
            Some("vertex") => {
                let values: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
                let position = values.first_chunk().ok_or_else(|| Problem::NotNumbers {
                    line: number,
                    text: text.trim().chars().take(60).collect(),
                })?;
                corners.add(*position, place)?;
            }
            Some("endfacet") => {
                let count = corners.open.len();
                if count != 3 {
                    return Err(Problem::Corners { line: number, corners: count }.into());
                }
                corners.end_of_triangle(place)?;
            }
            _ => {}
        }
    }
    if corners.open.is_empty() { Ok(()) } else { Err(Problem::TruncatedText.into()) }
}

/// The corners read so far.
#[derive(Default)]
struct Corners {
    assembly: Assembly,
    vertex_at: HashMap<[u64; 3], u32>,
    /// Those of the triangle that is not complete.
    open: Vec<Corner>,
}

impl Corners {
    fn add(&mut self, position: [f64; 3], place: impl Fn() -> String) -> Result<(), MeshProblem> {
        // Zero and negative zero are one place.
        let key = position.map(|value| (value + 0.0).to_bits());
        let vertex = match self.vertex_at.get(&key) {
            Some(vertex) => *vertex,
            None => {
                let vertex = self.assembly.vertices().len() as u32;
                self.assembly.vertex(position, None, place)?;
                self.vertex_at.insert(key, vertex);
                vertex
            }
        };
        self.open.push(Corner { vertex, texture_coordinates: None });
        Ok(())
    }

    fn end_of_triangle(&mut self, place: impl Fn() -> String) -> Result<(), MeshProblem> {
        if let Some(corners) = self.open.first_chunk() {
            self.assembly.triangle(*corners, 0, place)?;
        }
        self.open.clear();
        Ok(())
    }
}
