//! Wavefront OBJ: vertices with colours, texture coordinates, polygons, objects and groups, and materials from `mtl`.
//!
//! tobj panics at `Kd 0.5`, tells neither line nor index of what is wrong, loses the pairing of texture coordinates where only
//! some corners have them, gives every material its own copies of the vertices, and reads single precision. So the lines are
//! read here.

mod mtl;

use std::borrow::Cow;
use std::collections::HashMap;

use super::assembly::{Assembly, Corner};
use super::beside::{Beside, shortened};
use super::problems::ObjProblem as Problem;
use super::texture::linear;
use super::{Material, Mesh, Problem as MeshProblem};

/// The most texture coordinates that are kept.
const MOST_COORDINATES: usize = super::MOST_VERTICES;

pub(super) fn read(bytes: &[u8], beside: &mut Beside<'_>) -> Result<Mesh, MeshProblem> {
    let mut reader = Reader::new(beside);
    for line in Lines::new(bytes) {
        reader.line(&line)?;
    }
    reader.finished()
}

/// A line, with those that continue it.
struct Line<'a> {
    number: usize,
    text: Cow<'a, str>,
}

impl Line<'_> {
    fn problem(&self, expected: &'static str) -> Problem {
        Problem { file: String::new(), line: self.number, text: shortened(self.text.trim()), expected }
    }

    fn place(&self) -> String {
        format!("line {}", self.number)
    }
}

/// The lines of a text; one that ends with a backslash goes on in the next.
struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> Lines<'a> {
    fn new(text: &'a [u8]) -> Self {
        Self { rest: text, number: 0 }
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    fn next(&mut self) -> Option<Line<'a>> {
        if self.rest.is_empty() {
            return None;
        }
        let number = self.number + 1;
        let mut text = Cow::Borrowed("");
        loop {
            let end = self.rest.iter().position(|byte| *byte == b'\n');
            let (line, rest) = end.map_or((self.rest, &[][..]), |end| (&self.rest[..end], &self.rest[end + 1..]));
            self.rest = rest;
            self.number += 1;
            let line = line.trim_ascii_end();
            let goes_on = line.strip_suffix(b"\\").filter(|_| !rest.is_empty());
            let part = String::from_utf8_lossy(goes_on.unwrap_or(line));
            text = if text.is_empty() { part } else { text + " " + part };
            if goes_on.is_none() {
                return Some(Line { number, text });
            }
        }
    }
}

struct Reader<'b, 'p> {
    beside: &'b mut Beside<'p>,
    assembly: Assembly,
    texture_coordinates: Vec<[f32; 2]>,
    material_of_name: HashMap<String, u32>,
    /// That of the next faces; `None` before the first `usemtl`.
    material: Option<u32>,
    /// The name of the shape that begins with the next face.
    next_shape: Option<String>,
    /// Number of statements about curves and surfaces without triangles.
    free_forms: usize,
}

impl<'b, 'p> Reader<'b, 'p> {
    fn new(beside: &'b mut Beside<'p>) -> Self {
        Self {
            beside,
            assembly: Assembly::default(),
            texture_coordinates: Vec::new(),
            material_of_name: HashMap::new(),
            material: None,
            next_shape: Some(String::new()),
            free_forms: 0,
        }
    }

    fn line(&mut self, line: &Line<'_>) -> Result<(), MeshProblem> {
        let mut words = line.text.split_ascii_whitespace();
        let Some(statement) = words.next() else { return Ok(()) };
        let rest = || line.text.trim_ascii_start()[statement.len()..].trim();
        match statement {
            "v" => self.vertex(line)?,
            "vt" => self.coordinates(line)?,
            "f" | "fo" => self.face(line)?,
            "o" | "g" => self.next_shape = Some(rest().to_owned()),
            "usemtl" => self.use_material(rest()),
            "mtllib" => self.library(rest())?,
            "curv" | "curv2" | "surf" => self.free_forms += 1,
            // Normals follow from the triangles; comments, lines, points and smoothing have no surface.
            _ => {}
        }
        Ok(())
    }

    /// `v x y z`, `v x y z w` or `v x y z r g b`.
    fn vertex(&mut self, line: &Line<'_>) -> Result<(), MeshProblem> {
        let values = numbers(line)?;
        let position = values.first_chunk().ok_or_else(|| line.problem("a vertex has three numbers"))?;
        let color = match values.as_slice() {
            [_, _, _, color @ ..] if color.len() >= 3 => {
                let full = if color[..3].iter().any(|value| *value > 1.0) { 255.0 } else { 1.0 };
                Some([linear(color[0] / full), linear(color[1] / full), linear(color[2] / full), 1.0])
            }
            _ => None,
        };
        self.assembly.vertex(*position, color, || line.place())
    }

    /// `vt u v`, which count v from the picture's lower border.
    fn coordinates(&mut self, line: &Line<'_>) -> Result<(), MeshProblem> {
        let values = numbers(line)?;
        let u = values.first().ok_or_else(|| line.problem("texture coordinates have one to three numbers"))?;
        let v = values.get(1).copied().unwrap_or(0.0);
        if self.texture_coordinates.len() == MOST_COORDINATES {
            let most = MOST_COORDINATES as u64;
            return Err(MeshProblem::TooMany { place: line.place(), what: "texture coordinates", most });
        }
        self.texture_coordinates.push([*u as f32, (1.0 - v) as f32]);
        Ok(())
    }

    fn face(&mut self, line: &Line<'_>) -> Result<(), MeshProblem> {
        let words = line.text.split_ascii_whitespace().skip(1).take_while(|word| !word.starts_with('#'));
        let corners: Vec<Corner> = words.map(|word| self.corner(word, line)).collect::<Result<_, _>>()?;
        if corners.len() < 3 {
            return Err(line.problem("a face has at least three corners").into());
        }
        if let Some(name) = self.next_shape.take() {
            self.assembly.shape(name, || line.place())?;
        }
        let material = match self.material {
            Some(material) => material,
            None => self.material_named(""),
        };
        self.material = Some(material);
        self.assembly.polygon(&corners, material, || line.place())
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 1, or backwards from -1.
    fn corner(&self, word: &str, line: &Line<'_>) -> Result<Corner, MeshProblem> {
        let mut parts = word.split('/');
        let number =
            |part: &str| part.parse::<i64>().map_err(|_| line.problem("a corner is written v, v/vt, v//vn or v/vt/vn"));
        let within = |index: i64, count: usize, what: &'static str| {
            let from_zero = if index > 0 { index - 1 } else { index.saturating_add(count as i64) };
            let is_inside = index != 0 && (0..count as i64).contains(&from_zero);
            let out_of_range = || MeshProblem::OutOfRange { place: line.place(), index, count, what };
            if is_inside { Ok(from_zero as usize) } else { Err(out_of_range()) }
        };
        let vertex = within(number(parts.next().unwrap_or_default())?, self.assembly.vertices().len(), "vertices")?;
        let texture_coordinates = match parts.next() {
            None | Some("") => None,
            Some(part) => {
                let index = within(number(part)?, self.texture_coordinates.len(), "texture coordinates")?;
                Some(self.texture_coordinates[index])
            }
        };
        Ok(Corner { vertex: vertex as u32, texture_coordinates })
    }

    fn use_material(&mut self, name: &str) {
        if !self.material_of_name.contains_key(name) {
            let warning =
                format!("line with `usemtl {}`: no MTL has this material; it is shown white", shortened(name));
            self.assembly.warnings.push(warning);
        }
        self.material = Some(self.material_named(name));
    }

    /// The index of the material; a white one is made for a name that is not known.
    fn material_named(&mut self, name: &str) -> u32 {
        let materials = &mut self.assembly.materials;
        *self.material_of_name.entry(name.to_owned()).or_insert_with(|| {
            materials.push(Material::default());
            self.assembly.material_names.push(name.to_owned());
            materials.len() as u32 - 1
        })
    }

    /// `mtllib a.mtl b.mtl`; a name may have spaces.
    fn library(&mut self, names: &str) -> Result<(), MeshProblem> {
        let several =
            names.split_ascii_whitespace().filter(|name| name.to_ascii_lowercase().ends_with(".mtl")).count() > 1;
        let names: Vec<&str> = if several { names.split_ascii_whitespace().collect() } else { vec![names] };
        for name in names {
            let name = name.replace('\\', "/");
            let bytes = match self.beside.read("material library", &name) {
                Ok(bytes) => bytes,
                Err(MeshProblem::Beside { reason, .. }) if reason.kind() == std::io::ErrorKind::NotFound => {
                    let warning = format!(
                        "material library `{}` is not there; the mesh is shown without its materials",
                        shortened(&name)
                    );
                    self.assembly.warnings.push(warning);
                    continue;
                }
                Err(other) => return Err(other),
            };
            let known = &mut self.material_of_name;
            for (name, material) in mtl::read(&bytes, &name, self.beside, &mut self.assembly)? {
                // Of two materials with one name, the first counts.
                let index = self.assembly.materials.len() as u32;
                if *known.entry(name.clone()).or_insert(index) == index {
                    self.assembly.materials.push(material);
                    self.assembly.material_names.push(name);
                }
            }
        }
        Ok(())
    }

    fn finished(mut self) -> Result<Mesh, MeshProblem> {
        if self.free_forms > 0 {
            let warning = format!("{} curves and surfaces without triangles are left out", self.free_forms);
            self.assembly.warnings.push(warning);
        }
        self.assembly.finished(None)
    }
}

/// The numbers after a statement's name, up to a comment.
fn numbers(line: &Line<'_>) -> Result<Vec<f64>, Problem> {
    let words = line.text.split_ascii_whitespace().skip(1).take_while(|word| !word.starts_with('#'));
    words.map(|word| word.parse().map_err(|_| line.problem("these are not all numbers"))).collect()
}
