//! A mesh while its reader fills it. Whatever the file says is checked here: indices, numbers and counts.

use super::texture::check_pictures;
use super::{Face, Material, Mesh, Names, Picture, PlacedPrimitive, Problem, Triangles, polygon};

/// The most vertices of a mesh after its instances are placed: 30 times those of a detailed scan.
pub const MOST_VERTICES: usize = 30_000_000;
/// The most triangles of a mesh after its instances are placed.
pub const MOST_TRIANGLES: usize = 20_000_000;
/// The most shapes of a mesh, and the most nodes that are visited to find them.
pub const MOST_SHAPES: usize = 1_000_000;
/// Coordinates beyond this are refused: their squares and cubes, summed over a mesh, are finite in double precision, and they
/// are finite in single precision.
const FARTHEST: f64 = 1e15;

/// A mesh that is being read.
#[derive(Default)]
pub(super) struct Assembly {
    surface: Triangles,
    faces: Vec<Face>,
    vertex_colors: Vec<[f32; 4]>,
    pub materials: Vec<Material>,
    pub material_names: Vec<String>,
    pub pictures: Vec<Picture>,
    shape_names: Vec<String>,
    pub placed: Vec<PlacedPrimitive>,
    /// The mass that the file states.
    pub claimed_mass_kg: Option<f64>,
    pub notes: Vec<String>,
    pub warnings: Vec<String>,
}

/// A corner of a polygon.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    /// Index of the mesh's vertices, which the reader has checked.
    pub vertex: u32,
    pub texture_coordinates: Option<[f32; 2]>,
}

impl Assembly {
    pub fn vertices(&self) -> &[[f64; 3]] {
        &self.surface.vertices
    }

    pub fn triangles(&self) -> usize {
        self.surface.triangles.len()
    }

    /// Adds a vertex, white if it has no colour. `place` tells where the file has it.
    pub fn vertex(
        &mut self,
        position: [f64; 3],
        color: Option<[f32; 4]>,
        place: impl Fn() -> String,
    ) -> Result<(), Problem> {
        if self.surface.vertices.len() == MOST_VERTICES {
            return Err(Problem::TooMany { place: place(), what: "vertices", most: MOST_VERTICES as u64 });
        }
        if position.iter().any(|value| value.is_nan() || value.abs() > FARTHEST) {
            return Err(Problem::NotFinite { place: place() });
        }
        if color.is_some() || !self.vertex_colors.is_empty() {
            let is_color = |color: &[f32; 4]| color.iter().all(|value| value.is_finite());
            self.vertex_colors.resize(self.surface.vertices.len(), [1.0; 4]);
            self.vertex_colors.push(color.filter(is_color).unwrap_or([1.0; 4]));
        }
        self.surface.vertices.push(position);
        Ok(())
    }

    /// Begins a shape.
    pub fn shape(&mut self, name: String, place: impl Fn() -> String) -> Result<(), Problem> {
        if self.shape_names.len() == MOST_SHAPES {
            return Err(Problem::TooMany { place: place(), what: "shapes", most: MOST_SHAPES as u64 });
        }
        self.shape_names.push(name);
        Ok(())
    }

    /// Adds a polygon of the current shape, cut into triangles.
    pub fn polygon(&mut self, corners: &[Corner], material: u32, place: impl Fn() -> String) -> Result<(), Problem> {
        let corner_points: Vec<[f64; 3]> =
            corners.iter().map(|corner| self.surface.vertices[corner.vertex as usize]).collect();
        for triangle in polygon::triangles(&corner_points) {
            self.triangle(triangle.map(|corner| corners[corner]), material, &place)?;
        }
        Ok(())
    }

    /// Adds a triangle of the current shape.
    pub fn triangle(&mut self, corners: [Corner; 3], material: u32, place: impl Fn() -> String) -> Result<(), Problem> {
        if self.surface.triangles.len() == MOST_TRIANGLES {
            return Err(Problem::TooMany { place: place(), what: "triangles", most: MOST_TRIANGLES as u64 });
        }
        self.surface.triangles.push(corners.map(|corner| corner.vertex));
        let texture_coordinates = match corners.map(|corner| corner.texture_coordinates) {
            [Some(a), Some(b), Some(c)] if [a, b, c].as_flattened().iter().all(|value| value.is_finite()) => {
                Some([a, b, c])
            }
            _ => None,
        };
        let shape = self.shape_names.len().saturating_sub(1) as u32;
        self.faces.push(Face { material, shape, texture_coordinates });
        Ok(())
    }

    /// The mesh, if it has a triangle and its pictures can be decoded.
    pub fn finished(mut self, meters_per_unit: Option<f64>) -> Result<Mesh, Problem> {
        if self.surface.triangles.is_empty() {
            return Err(Problem::NoTriangles);
        }
        check_pictures(&self.pictures)?;
        if self.materials.is_empty() {
            self.materials.push(Material::default());
        }
        self.material_names.resize(self.materials.len(), String::new());
        if self.shape_names.is_empty() {
            self.shape_names.push(String::new());
        }
        if !self.vertex_colors.is_empty() {
            self.vertex_colors.resize(self.surface.vertices.len(), [1.0; 4]);
        }
        self.warn_of_bare_textures();
        Ok(Mesh {
            shapes: self.shape_names.len(),
            surface: self.surface,
            faces: self.faces,
            vertex_colors: self.vertex_colors,
            materials: self.materials,
            pictures: self.pictures,
            names: Names { shapes: self.shape_names, materials: self.material_names },
            meters_per_unit,
            placed: self.placed,
            claimed_mass_kg: self.claimed_mass_kg,
            files: Vec::new(),
            notes: self.notes,
            warnings: self.warnings,
        })
    }

    /// The surface alone, which may have no triangles.
    pub fn into_surface(self) -> Triangles {
        self.surface
    }

    /// Says how many triangles have a texture but no coordinates to place it with.
    fn warn_of_bare_textures(&mut self) {
        let is_bare = |face: &&Face| {
            face.texture_coordinates.is_none() && self.materials[face.material as usize].texture.is_some()
        };
        let bare = self.faces.iter().filter(is_bare).count();
        if bare > 0 {
            self.warnings.push(format!(
                "{bare} of {} triangles have a texture but no texture coordinates; they are shown in their base colour",
                self.faces.len()
            ));
        }
    }
}
