//! The triangles of a mesh's primitive, read once and placed for each instance.

use gltf::json::Index;
use gltf::json::mesh::{self, Mode, Semantic};
use gltf::json::validation::Checked;
use nalgebra::{Matrix4, Point3};

use super::look::Placement;
use super::{Document, Problem};
use crate::scene::mesh::assembly::{Assembly, Corner};
use crate::scene::mesh::{GltfPrimitive, MOST_TRIANGLES, PlacedPrimitive, Problem as MeshProblem};

const DRACO: &str = "KHR_draco_mesh_compression";

/// Vertices and triangles in the mesh's own frame.
pub(super) struct Primitive<'a> {
    place: &'a str,
    positions: Vec<[f64; 3]>,
    colors: Vec<[f32; 4]>,
    texture_coordinates: Vec<[f32; 2]>,
    triangles: Vec<[u32; 3]>,
    /// Index of the assembly's materials.
    material: u32,
}

impl<'a> Primitive<'a> {
    /// `None` for points and lines, which a note tells.
    pub fn read(
        document: &Document<'_>,
        from: &mesh::Primitive,
        placements: &[Option<Placement>],
        place: &'a str,
        assembly: &mut Assembly,
    ) -> Result<Option<Self>, MeshProblem> {
        let Checked::Valid(mode) = from.mode else {
            return Err(Problem::Primitive { place: place.to_owned() }.into());
        };
        if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            assembly.notes.push(format!("{place} has points or lines, which have no surface"));
            return Ok(None);
        }
        let attribute = |semantic| from.attributes.get(&Checked::Valid(semantic)).map(Index::value);
        let positions = attribute(Semantic::Positions);
        let indices = from.indices.map(|index| index.value());
        let is_draco = from.extensions.as_ref().is_some_and(|all| all.others.contains_key(DRACO));
        let is_stored = [positions, indices].into_iter().flatten().all(|index| document.has_values(index));
        if is_draco && !is_stored {
            return Err(Problem::Compressed { place: place.to_owned(), extension: DRACO }.into());
        }
        let positions = positions.ok_or_else(|| Problem::Primitive { place: place.to_owned() })?;
        let positions: Vec<[f64; 3]> = document.vectors(positions, &format!("{place}, POSITION"), [0.0; 3])?;
        let count = positions.len();
        let indices = match indices {
            Some(index) => document.indices(index, &format!("{place}, indices"))?,
            None => (0..count as u32).collect(),
        };
        if let Some(index) = indices.iter().find(|index| **index as usize >= count) {
            let place = format!("{place}, indices");
            return Err(MeshProblem::OutOfRange { place, index: i64::from(*index), count, what: "vertices" });
        }
        let colors = match attribute(Semantic::Colors(0)) {
            Some(index) => document.vectors(index, &format!("{place}, COLOR_0"), [0.0, 0.0, 0.0, 1.0])?,
            None => Vec::new(),
        };
        let material = from.material.map_or(placements.len() - 1, |material| material.value());
        let placement = placements.get(material).ok_or_else(|| Problem::NoSuch {
            place: place.to_owned(),
            what: "material",
            index: material,
        })?;
        let texture_coordinates = match placement.and_then(|p| Some((p, attribute(Semantic::TexCoords(p.set))?))) {
            Some((placement, index)) => {
                let raw: Vec<[f64; 2]> =
                    document.vectors(index, &format!("{place}, TEXCOORD_{}", placement.set), [0.0; 2])?;
                raw.into_iter().map(|coordinates| placement.apply(coordinates)).collect()
            }
            None => Vec::new(),
        };
        Ok(Some(Self {
            place,
            triangles: triangles(mode, &indices),
            colors: colors.into_iter().map(|color| color.map(|value| (value as f32).clamp(0.0, 1.0))).collect(),
            positions,
            texture_coordinates,
            material: material as u32,
        }))
    }

    /// Adds an instance as a shape of its own. A transform that mirrors turns the triangles around.
    pub fn place(
        &self,
        world_from_mesh: &Matrix4<f64>,
        name: &str,
        source: GltfPrimitive,
        assembly: &mut Assembly,
    ) -> Result<(), MeshProblem> {
        let place = || self.place.to_owned();
        if assembly.triangles() + self.triangles.len() > MOST_TRIANGLES {
            return Err(MeshProblem::TooMany { place: place(), what: "triangles", most: MOST_TRIANGLES as u64 });
        }
        assembly.shape(name.to_owned(), place)?;
        let first = assembly.vertices().len() as u32;
        assembly.placed.push(PlacedPrimitive { source, vertices: first..first + self.positions.len() as u32 });
        for (index, position) in self.positions.iter().enumerate() {
            let position = world_from_mesh.transform_point(&Point3::from(*position));
            let color = self.colors.get(index).copied();
            assembly.vertex(position.into(), color, || format!("{}, vertex {index}", self.place))?;
        }
        let is_mirrored = world_from_mesh.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        let corner = |index: u32| Corner {
            vertex: first + index,
            texture_coordinates: self.texture_coordinates.get(index as usize).copied(),
        };
        for [a, b, c] in &self.triangles {
            let corners = if is_mirrored { [*a, *c, *b] } else { [*a, *b, *c] };
            assembly.triangle(corners.map(corner), self.material, place)?;
        }
        Ok(())
    }
}

/// Triangles one by one, as a strip (every second one turned) or as a fan; corners that are left over have none.
fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let turned = |(i, [a, b, c]): (usize, &[u32; 3])| if i % 2 == 0 { [*a, *b, *c] } else { [*b, *a, *c] };
            indices.array_windows::<3>().enumerate().map(turned).collect()
        }
        Mode::TriangleFan => {
            let Some((center, rim)) = indices.split_first() else { return Vec::new() };
            rim.array_windows::<2>().map(|[a, b]| [*center, *a, *b]).collect()
        }
        _ => indices.as_chunks::<3>().0.to_vec(),
    }
}
