//! PLY with faces, in text and both byte orders: positions, colours and texture coordinates of vertices, polygons with
//! texture coordinates of their corners, one texture (MeshLab's `comment TextureFile`).
//!
//! ply-rs-bw reads the header. Bodies are read here: its elements are a map for each row, its numbers in text exclude `.5`
//! and `5.`, and the rows that a header claims are to be checked against the bytes that are there.

use std::io::Cursor;
use std::path::Path;

use super::assembly::{Assembly, Corner};
use super::beside::Beside;
use super::problems::PlyProblem as Problem;
use super::texture::{Source, linear};
use super::{Material, Mesh, Picture, Problem as MeshProblem, Texture, Wrapping};
use crate::files;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{DefaultElement, ElementDef, Encoding, PropertyType, ScalarType};

/// Far larger than any header seen, and small compared with any mesh.
const HEADER_LIMIT: usize = 1 << 20;
/// Far more corners than any polygon has.
const MOST_CORNERS: usize = 1 << 20;

pub(super) fn read(bytes: &[u8], beside: &mut Beside<'_>) -> Result<Mesh, MeshProblem> {
    let header = Header::read(bytes)?;
    let has = |name: &str| header.elements.iter().any(|element| element.name == name && element.count > 0);
    if !has("face") {
        return Err(if has("tristrips") { Problem::Strips } else { Problem::NoFaces }.into());
    }
    let mut body = Rows::new(&bytes[header.body_at..], header.encoding);
    let mut assembly = Assembly::default();
    header.add_material(&mut assembly, beside)?;
    let mut coordinates = Vec::new();
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => read_vertices(&mut body, element, &mut assembly, &mut coordinates)?,
            "face" => read_faces(&mut body, element, &mut assembly, &coordinates)?,
            _ => {
                for row in 0..rows_of(element) {
                    body.read_row(element, row, |_, _| {})?;
                }
            }
        }
    }
    assembly.finished(None)
}

/// True if the file at `path` has the header of a PLY with faces.
pub(super) fn has_faces(path: &Path) -> bool {
    use std::io::Read;
    let mut begin = Vec::new();
    let read = files::open(path).and_then(|file| file.take(HEADER_LIMIT as u64).read_to_end(&mut begin));
    read.is_ok()
        && Header::read(&begin).is_ok_and(|header| {
            header
                .elements
                .iter()
                .any(|element| matches!(element.name.as_str(), "face" | "tristrips") && element.count > 0)
        })
}

struct Header {
    encoding: Encoding,
    elements: Vec<ElementDef>,
    /// The name of the picture on the faces.
    texture: Option<String>,
    body_at: usize,
}

impl Header {
    fn read(bytes: &[u8]) -> Result<Self, Problem> {
        let begin = &bytes[..bytes.len().min(HEADER_LIMIT)];
        let mut reader = Reader::new(Cursor::new(begin));
        let header = Parser::<DefaultElement>::new()
            .read_header(&mut reader)
            .map_err(|error| Problem::Header(error.to_string().trim_end_matches('.').chars().take(200).collect()))?;
        let body_at = reader.into_inner().position() as usize;
        let elements: Vec<ElementDef> = header.elements.into_iter().map(|(_, element)| element).collect();
        let text = String::from_utf8_lossy(&begin[..body_at.min(begin.len())]);
        let declared = |word: &str| text.lines().filter(|line| line.split_whitespace().next() == Some(word)).count();
        let properties: usize = elements.iter().map(|element| element.properties.len()).sum();
        if declared("element") != elements.len() || declared("property") != properties {
            return Err(Problem::Duplicate);
        }
        let texture = text.lines().find_map(|line| line.trim().strip_prefix("comment TextureFile "));
        Ok(Self { encoding: header.encoding, elements, texture: texture.map(|name| name.trim().to_owned()), body_at })
    }

    /// The one material of a PLY.
    fn add_material(&self, assembly: &mut Assembly, beside: &mut Beside<'_>) -> Result<(), MeshProblem> {
        let mut material = Material::default();
        if let Some(name) = &self.texture {
            match beside.find_picture(name)? {
                Some(path) => {
                    assembly
                        .pictures
                        .push(Picture { place: format!("`{}`", path.display()), source: Source::File(path) });
                    material.texture = Some(Texture { picture: 0, wrapping: [Wrapping::Repeat; 2] });
                }
                None => assembly.warnings.push(format!("texture `{name}` is not there; the mesh is shown without it")),
            }
        }
        assembly.materials.push(material);
        Ok(())
    }
}

/// The place of a scalar property that may have any of several names.
fn column(element: &ElementDef, names: &[&str]) -> Option<usize> {
    element.properties.iter().position(|(name, _)| names.contains(&name.as_str()))
}

/// What an integer colour is divided by; floats are from 0 to 1.
fn full_color(element: &ElementDef, column: usize) -> f64 {
    match element.properties.get_index(column).map(|(_, property)| &property.data_type) {
        Some(PropertyType::Scalar(ScalarType::Float | ScalarType::Double)) => 1.0,
        Some(PropertyType::Scalar(ScalarType::UShort | ScalarType::Short)) => 65_535.0,
        _ => 255.0,
    }
}

fn read_vertices(
    body: &mut Rows<'_>,
    element: &ElementDef,
    assembly: &mut Assembly,
    coordinates: &mut Vec<[f32; 2]>,
) -> Result<(), MeshProblem> {
    let required = |property| column(element, &[property]).ok_or(Problem::Missing { element: "vertex", property });
    let position = [required("x")?, required("y")?, required("z")?];
    let color = [["red", "r"], ["green", "g"], ["blue", "b"]].map(|names| column(element, &names));
    let alpha = column(element, &["alpha", "a"]);
    let texture = [["u", "s", "texture_u"], ["v", "t", "texture_v"]].map(|names| column(element, &names));
    let mut row_values = vec![0.0; element.properties.len()];
    for row in 0..rows_of(element) {
        body.read_row(element, row, |column, values| row_values[column] = values.first().copied().unwrap_or(0.0))?;
        let shade = |column: usize| row_values[column] / full_color(element, column);
        let color = match color {
            [Some(r), Some(g), Some(b)] => {
                let [r, g, b] = [r, g, b].map(|column| linear(shade(column)));
                Some([r, g, b, alpha.map_or(1.0, |column| shade(column).clamp(0.0, 1.0) as f32)])
            }
            _ => None,
        };
        assembly.vertex(position.map(|column| row_values[column]), color, || format!("vertex {}", row + 1))?;
        if let [Some(u), Some(v)] = texture {
            // PLY counts v from the picture's lower border.
            coordinates.push([row_values[u] as f32, (1.0 - row_values[v]) as f32]);
        }
    }
    Ok(())
}

fn read_faces(
    body: &mut Rows<'_>,
    element: &ElementDef,
    assembly: &mut Assembly,
    coordinates: &[[f32; 2]],
) -> Result<(), MeshProblem> {
    let indices = column(element, &["vertex_indices", "vertex_index"])
        .ok_or(Problem::Missing { element: "face", property: "vertex_indices" })?;
    let of_corners = column(element, &["texcoord"]);
    let mut corners: Vec<Corner> = Vec::new();
    let mut named: Vec<f64> = Vec::new();
    let mut placed: Vec<f64> = Vec::new();
    for row in 0..rows_of(element) {
        named.clear();
        placed.clear();
        body.read_row(element, row, |column, values| {
            if column == indices {
                named.extend(values);
            } else if Some(column) == of_corners {
                placed.extend(values);
            }
        })?;
        let place = || format!("face {}", row + 1);
        let count = assembly.vertices().len();
        corners.clear();
        for (corner, index) in named.iter().enumerate() {
            if !(0.0..count as f64).contains(index) {
                return Err(MeshProblem::OutOfRange { place: place(), index: *index as i64, count, what: "vertices" });
            }
            let own = placed.as_chunks::<2>().0.get(corner).map(|[u, v]| [*u as f32, (1.0 - v) as f32]);
            let texture_coordinates = own.or_else(|| coordinates.get(*index as usize).copied());
            corners.push(Corner { vertex: *index as u32, texture_coordinates });
        }
        assembly.polygon(&corners, 0, place)?;
    }
    Ok(())
}

/// The number of rows to read: as many as declared, none if they hold nothing.
fn rows_of(element: &ElementDef) -> usize {
    if element.properties.is_empty() { 0 } else { element.count }
}

/// The bytes or words of the rows that are not read yet.
enum Rows<'a> {
    Text(std::str::SplitAsciiWhitespace<'a>),
    Binary { bytes: &'a [u8], is_little: bool },
}

/// Why a value cannot be had.
enum NoValue {
    Ended,
    Word(String),
}

impl<'a> Rows<'a> {
    fn new(bytes: &'a [u8], encoding: Encoding) -> Self {
        match encoding {
            Encoding::Ascii => {
                let valid = std::str::from_utf8(bytes).unwrap_or_else(|error| {
                    std::str::from_utf8(&bytes[..error.valid_up_to()]).expect("it is valid up to there")
                });
                Self::Text(valid.split_ascii_whitespace())
            }
            Encoding::BinaryLittleEndian => Self::Binary { bytes, is_little: true },
            Encoding::BinaryBigEndian => Self::Binary { bytes, is_little: false },
        }
    }

    /// Hands each property of the next row, by its column, to `take`: one value, or those of a list.
    fn read_row(
        &mut self,
        element: &ElementDef,
        row: usize,
        mut take: impl FnMut(usize, &[f64]),
    ) -> Result<(), Problem> {
        let problem = |cause| match cause {
            NoValue::Ended => Problem::Truncated { element: element.name.clone(), row: row + 1, count: element.count },
            NoValue::Word(word) => Problem::NotANumber { element: element.name.clone(), row: row + 1, word },
        };
        let mut list = Vec::new();
        for (column, (_, property)) in element.properties.iter().enumerate() {
            match &property.data_type {
                PropertyType::Scalar(kind) => take(column, &[self.value(kind).map_err(problem)?]),
                PropertyType::List(count, kind) => {
                    let count = self.value(count).map_err(problem)?;
                    if !(0.0..=MOST_CORNERS as f64).contains(&count) {
                        return Err(problem(NoValue::Word(count.to_string())));
                    }
                    list.clear();
                    for _ in 0..count as usize {
                        list.push(self.value(kind).map_err(problem)?);
                    }
                    take(column, &list);
                }
            }
        }
        Ok(())
    }

    fn value(&mut self, kind: &ScalarType) -> Result<f64, NoValue> {
        match self {
            Self::Text(words) => {
                let word = words.next().ok_or(NoValue::Ended)?;
                word.parse().map_err(|_| NoValue::Word(word.chars().take(40).collect()))
            }
            Self::Binary { bytes, is_little } => {
                let little = *is_little;
                Ok(match kind {
                    ScalarType::Char => f64::from(i8::from_le_bytes(take(bytes, little)?)),
                    ScalarType::UChar => f64::from(u8::from_le_bytes(take(bytes, little)?)),
                    ScalarType::Short => f64::from(i16::from_le_bytes(take(bytes, little)?)),
                    ScalarType::UShort => f64::from(u16::from_le_bytes(take(bytes, little)?)),
                    ScalarType::Int => f64::from(i32::from_le_bytes(take(bytes, little)?)),
                    ScalarType::UInt => f64::from(u32::from_le_bytes(take(bytes, little)?)),
                    ScalarType::Float => f64::from(f32::from_le_bytes(take(bytes, little)?)),
                    ScalarType::Double => f64::from_le_bytes(take(bytes, little)?),
                })
            }
        }
    }
}

/// The next value's bytes in little-endian order.
fn take<const N: usize>(bytes: &mut &[u8], is_little: bool) -> Result<[u8; N], NoValue> {
    let (value, rest) = bytes.split_first_chunk::<N>().ok_or(NoValue::Ended)?;
    *bytes = rest;
    let mut value = *value;
    if !is_little {
        value.reverse();
    }
    Ok(value)
}
