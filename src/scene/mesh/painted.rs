//! A mesh with its pictures decoded: the colour and the normal at each point of its surface.

use std::collections::HashMap;
use std::sync::LazyLock;

use image::RgbaImage;
use nalgebra::{Point3, Vector3};

use super::{Alpha, Mesh, Problem, Texture};
use crate::numeric::lists::Lists;
use crate::numeric::srgb_light;
use crate::parallel;
use crate::render::triangles::{Surface, SurfacePoint};

/// A blended surface of less alpha than this is not there.
const LEAST_ALPHA: f32 = 0.02;
/// Faces that meet at a smaller angle than this, 40 degrees, are shaded as one curved surface: its cosine. Modelling programs
/// use 30 to 60 degrees.
const SMOOTH_COSINE: f64 = 0.766;
/// A vertex with more faces around it is shaded flat: comparing them all with each other takes time quadratic in their number.
const MOST_FACES_AROUND: usize = 64;

/// A mesh that can be drawn.
#[derive(Debug, Clone)]
pub struct PaintedMesh {
    pub mesh: Mesh,
    /// By the index of [`Mesh::pictures`]: each picture, then halved again and again, down to a single texel.
    pictures: Vec<Vec<RgbaImage>>,
    /// The unit normals at the corners of each triangle, as the surface curves there.
    corner_normals: Vec<[[f32; 3]; 3]>,
}

impl PaintedMesh {
    /// Decodes the pictures and finds the normals.
    ///
    /// # Errors
    /// [`Problem::Undecodable`] if a picture is broken.
    pub fn new(mesh: Mesh) -> Result<Self, Problem> {
        let pictures = parallel::try_map(&mesh.pictures, |picture| picture.decode().map(pyramid))?;
        let corner_normals = corner_normals(&mesh);
        Ok(Self { mesh, pictures, corner_normals })
    }

    /// The surface as the rasteriser takes it.
    pub fn surface(&self) -> Surface<'_> {
        Surface { vertices: &self.mesh.surface.vertices, triangles: &self.mesh.surface.triangles }
    }

    /// The place of a point.
    pub fn position(&self, point: &SurfacePoint) -> Point3<f64> {
        let corners = corners(&self.mesh, point.triangle as usize);
        let share = |corner: usize| point.barycentric[corner] * corners[corner].coords;
        Point3::from(share(0) + share(1) + share(2))
    }

    /// The unit normal at a point of the surface that the triangles approximate.
    pub fn normal(&self, point: &SurfacePoint) -> Vector3<f64> {
        let normals = &self.corner_normals[point.triangle as usize];
        let share = |corner: usize| point.barycentric[corner] * Vector3::from(normals[corner].map(f64::from));
        (share(0) + share(1) + share(2)).try_normalize(f64::EPSILON).unwrap_or_else(Vector3::z)
    }

    /// False where the material's alpha cuts a hole, or is next to nothing.
    pub fn is_there(&self, point: &SurfacePoint) -> bool {
        let material = &self.mesh.materials[self.mesh.faces[point.triangle as usize].material as usize];
        match material.alpha {
            Alpha::Opaque => true,
            Alpha::CutBelow(least) => self.linear_color(point, f64::INFINITY)[3] >= least,
            Alpha::Blend => self.linear_color(point, f64::INFINITY)[3] >= LEAST_ALPHA,
        }
    }

    /// The linear colour at a point, 0 to 1; of a transparent surface, as it looks before white. `cells` is the number of pixels, or
    /// of whatever else the colour is for, over which its triangle is spread: the colour is the mean over about one of them.
    pub fn color(&self, point: &SurfacePoint, cells: f64) -> [f32; 3] {
        let [r, g, b, alpha] = self.linear_color(point, cells);
        let material = &self.mesh.materials[self.mesh.faces[point.triangle as usize].material as usize];
        match material.alpha {
            Alpha::Blend => [r, g, b].map(|channel| channel * alpha + 1.0 - alpha),
            Alpha::Opaque | Alpha::CutBelow(_) => [r, g, b],
        }
    }

    /// Base colour times texture times the vertices' colours.
    fn linear_color(&self, point: &SurfacePoint, cells: f64) -> [f32; 4] {
        let face = &self.mesh.faces[point.triangle as usize];
        let material = &self.mesh.materials[face.material as usize];
        let shares = point.barycentric.map(|share| share as f32);
        let mut color = material.base_color;
        let mut multiply = |by: [f32; 4]| color = std::array::from_fn(|channel| color[channel] * by[channel]);
        if let (Some(texture), Some(corners)) = (material.texture, face.texture_coordinates) {
            let levels = &self.pictures[texture.picture as usize];
            let place = mixed(&corners, &shares);
            multiply(texel(&levels[level(levels, &corners, cells)], texture, place));
        }
        if !self.mesh.vertex_colors.is_empty() {
            let triangle = self.mesh.surface.triangles[point.triangle as usize];
            multiply(mixed(&triangle.map(|vertex| self.mesh.vertex_colors[vertex as usize]), &shares));
        }
        color
    }
}

/// The corners' values by their shares.
fn mixed<const N: usize>(corners: &[[f32; N]; 3], shares: &[f32; 3]) -> [f32; N] {
    std::array::from_fn(|i| corners.iter().zip(shares).map(|(corner, share)| corner[i] * share).sum())
}

/// The picture, then halved again and again.
fn pyramid(picture: RgbaImage) -> Vec<RgbaImage> {
    let mut levels = vec![picture];
    while let Some(half) = levels.last().filter(|last| last.width().max(last.height()) > 1).map(halved) {
        levels.push(half);
    }
    levels
}

/// The means of two by two texels; the last of an odd number is left out.
fn halved(picture: &RgbaImage) -> RgbaImage {
    let (width, height) = picture.dimensions();
    RgbaImage::from_fn((width / 2).max(1), (height / 2).max(1), |x, y| {
        let (right, lower) = ((2 * x + 1).min(width - 1), (2 * y + 1).min(height - 1));
        let (left, upper) = ((2 * x).min(width - 1), (2 * y).min(height - 1));
        let four =
            [(left, upper), (right, upper), (left, lower), (right, lower)].map(|(x, y)| picture.get_pixel(x, y).0);
        let mean = |channel: usize| (four.iter().map(|texel| u16::from(texel[channel])).sum::<u16>() + 2) / 4;
        image::Rgba(std::array::from_fn(|channel| mean(channel) as u8))
    })
}

/// The level at which about one texel lies in each cell of a triangle with these texture coordinates.
fn level(levels: &[RgbaImage], [a, b, c]: &[[f32; 2]; 3], cells: f64) -> usize {
    let (width, height) = levels[0].dimensions();
    let double_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let texels = 0.5 * f64::from(double_area.abs()) * f64::from(width) * f64::from(height);
    // A level has a quarter of the texels of the one before.
    let level = (texels / cells).log(4.0).round().clamp(0.0, levels.len() as f64 - 1.0);
    if level.is_nan() { 0 } else { level as usize }
}

/// The linear colour of the picture at these coordinates, between the four nearest texels.
fn texel(picture: &RgbaImage, texture: Texture, [u, v]: [f32; 2]) -> [f32; 4] {
    static LIGHT: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|byte| srgb_light(byte as u8) as f32));
    let (width, height) = picture.dimensions();
    let (x, y) = (f64::from(u) * f64::from(width) - 0.5, f64::from(v) * f64::from(height) - 0.5);
    let (left, upper) = (x.floor(), y.floor());
    let light_at = |column: i64, row: i64| {
        let [along, down] = texture.wrapping;
        let image::Rgba([r, g, b, alpha]) =
            *picture.get_pixel(along.texel(left as i64 + column, width), down.texel(upper as i64 + row, height));
        let light = |channel: u8| LIGHT[usize::from(channel)];
        [light(r), light(g), light(b), f32::from(alpha) / 255.0]
    };
    let (right, lower) = ((x - left) as f32, (y - upper) as f32);
    let texels = [light_at(0, 0), light_at(1, 0), light_at(0, 1), light_at(1, 1)];
    let weights = [(1.0 - right) * (1.0 - lower), right * (1.0 - lower), (1.0 - right) * lower, right * lower];
    std::array::from_fn(|channel| texels.iter().zip(weights).map(|(texel, weight)| texel[channel] * weight).sum())
}

/// The corners of a triangle.
pub(super) fn corners(mesh: &Mesh, triangle: usize) -> [Point3<f64>; 3] {
    mesh.surface.triangles[triangle].map(|vertex| Point3::from(mesh.surface.vertices[vertex as usize]))
}

/// The normal of a triangle, twice its area long.
pub(super) fn area_normal(mesh: &Mesh, triangle: usize) -> Vector3<f64> {
    let [a, b, c] = corners(mesh, triangle);
    (b - a).cross(&(c - a))
}

/// At each corner, the sum of the area normals of the faces around it that turn away from the corner's own by less than
/// [`SMOOTH_COSINE`] says. Vertices at one place count as one: a seam of the texture is none of the surface.
fn corner_normals(mesh: &Mesh) -> Vec<[[f32; 3]; 3]> {
    let count = mesh.surface.triangles.len();
    let normals: Vec<Vector3<f64>> = parallel::map_range(count, |triangle| area_normal(mesh, triangle));
    let places = places_of_vertices(mesh);
    let around = triangles_around(mesh, &places);
    let at_corner = |triangle: usize, vertex: u32| {
        let own = normals[triangle];
        let unit = |normal: &Vector3<f64>| normal.try_normalize(0.0).unwrap_or_default();
        let direction = unit(&own);
        let faces = around.of(places[vertex as usize] as usize);
        let is_smooth = |other: &&u32| unit(&normals[**other as usize]).dot(&direction) >= SMOOTH_COSINE;
        let sum: Vector3<f64> = match faces.len() {
            ..=MOST_FACES_AROUND => faces.iter().filter(is_smooth).map(|other| normals[*other as usize]).sum(),
            _ => own,
        };
        unit(&sum).map(|value| value as f32).into()
    };
    let triangles = &mesh.surface.triangles;
    parallel::map_range(triangles.len(), |triangle| triangles[triangle].map(|vertex| at_corner(triangle, vertex)))
}

/// A number for each vertex, the same for those at the same place.
fn places_of_vertices(mesh: &Mesh) -> Vec<u32> {
    let mut known: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.surface.vertices.len());
    let place = |vertex: &[f64; 3]| {
        let next = known.len() as u32;
        // Zero and negative zero are one place.
        *known.entry(vertex.map(|value| (value + 0.0).to_bits())).or_insert(next)
    };
    mesh.surface.vertices.iter().map(place).collect()
}

/// The triangles around each place.
fn triangles_around(mesh: &Mesh, places: &[u32]) -> Lists {
    let count = places.iter().max().map_or(0, |last| *last as usize + 1);
    Lists::new(count, |visit| {
        for (index, vertex) in mesh.surface.triangles.as_flattened().iter().enumerate() {
            visit(places[*vertex as usize] as usize, (index / 3) as u32);
        }
    })
}
