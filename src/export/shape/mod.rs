//! The object's shape as meshes, from the cells that the parts stage filled:
//!
//! 1. [`solid`] gives every cell of the object, enclosed voids included, to a part;
//! 2. [`surface`] wraps cells in a closed mesh, [`simplify`] reduces its triangles;
//! 3. [`atlas`] lays the triangles out on a picture, [`bake`] paints it with the splat;
//! 4. [`colliders`] decomposes each part into convex [`hull`](crate::numeric::hull)s, for collisions;
//! 5. [`footing`] makes the undersides of all of them flat where the object touches the surface on which it stands.

mod atlas;
mod bake;
mod clearance;
mod colliders;
mod footing;
mod sieve;
mod simplify;
mod solid;
mod surface;

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::{names, png};
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::parallel;
use crate::parts::{Interior, OUTSIDE};
use crate::scene::SupportSurface;
use crate::vote::FieldPart;
pub use bake::Painter;
pub use colliders::Collider;
use footing::Footing;
use solid::Solid;

/// Triangles of a visual mesh: enough for a household object to look round, and few enough to read.
const TRIANGLES: usize = 12_000;

/// A closed mesh: every edge belongs to two triangles, which run along it in opposite directions.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// World frame; scene units while it is made, then metres relative to the shape's origin.
    pub vertices: Vec<Point3<f64>>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    pub fn corners(&self, triangle: [u32; 3]) -> [Point3<f64>; 3] {
        triangle.map(|v| self.vertices[v as usize])
    }

    /// Normal of a triangle with twice its area as length.
    fn area_normal(&self, triangle: [u32; 3]) -> Vector3<f64> {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(&(c - a))
    }

    /// The enclosed volume, by the divergence theorem.
    pub fn volume(&self) -> f64 {
        let cone = |triangle: &[u32; 3]| {
            let [a, b, c] = self.corners(*triangle).map(|p| p.coords);
            a.dot(&b.cross(&c))
        };
        self.triangles.iter().map(cone).sum::<f64>() / 6.0
    }

    /// Unit normals of the vertices: the mean of their triangles', weighted by area.
    pub fn normals(&self) -> Vec<Vector3<f64>> {
        let mut normals = vec![Vector3::zeros(); self.vertices.len()];
        for triangle in &self.triangles {
            let normal = self.area_normal(*triangle);
            triangle.iter().for_each(|v| normals[*v as usize] += normal);
        }
        normals.into_iter().map(|n: Vector3<f64>| n.try_normalize(0.0).unwrap_or_else(Vector3::z)).collect()
    }

    /// Unit normals for shading: those of the vertices, averaged with their neighbours' except across edges. Carving leaves
    /// bumps of a fraction of a cell, which hardly show in the shape but do show in the shading.
    pub fn shading_normals(&self) -> Vec<Vector3<f64>> {
        let (mut normals, neighbours) = (self.normals(), self.neighbours());
        for _ in 0..SHADING_ROUNDS {
            let averaged = normals.iter().zip(&neighbours).map(|(own, beside)| {
                let alike = beside.iter().map(|n| normals[*n as usize]).filter(|other| own.dot(other) > SHADING_EDGE);
                (own + alike.sum::<Vector3<f64>>()).try_normalize(0.0).unwrap_or(*own)
            });
            normals = averaged.collect();
        }
        normals
    }

    /// By vertex of a closed mesh, the other ends of its edges.
    fn neighbours(&self) -> Vec<Vec<u32>> {
        let mut neighbours: Vec<Vec<u32>> = vec![Vec::with_capacity(6); self.vertices.len()];
        for &[a, b, c] in &self.triangles {
            // Each edge runs once in either direction, so every neighbour is counted once.
            for (from, to) in [(a, b), (b, c), (c, a)] {
                neighbours[from as usize].push(to);
            }
        }
        neighbours
    }

    fn scaled(mut self, factor: f64) -> Self {
        self.vertices.iter_mut().for_each(|v| *v *= factor);
        self
    }
}

/// Rounds of averaging normals for shading.
const SHADING_ROUNDS: usize = 6;
/// Cosine of the smallest angle between two normals that counts as an edge: 45 degrees.
const SHADING_EDGE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The outer surface of the whole object with a picture on it.
#[derive(Debug, Clone)]
pub struct Skin {
    /// In metres.
    pub mesh: Mesh,
    /// Per triangle: the id of the part that it belongs to.
    pub part: Vec<u32>,
    /// Per triangle and corner: where it lies on the picture, from 0 to 1, v upwards.
    pub uv: Vec<[[f64; 2]; 3]>,
    /// sRGB, as PNG.
    pub picture: Vec<u8>,
}

/// The surface of one part.
pub struct PartMesh {
    /// Id of the part.
    pub part: u32,
    /// In metres.
    pub mesh: Mesh,
    /// Per vertex: sRGB.
    pub colors: Vec<[u8; 3]>,
}

/// What two parts share.
#[derive(Clone, Copy, Default)]
pub struct Contact {
    pub faces: usize,
    /// The sum of the middles of the faces, scene units.
    pub sum: Vector3<f64>,
}

/// The object's cells and their colliders.
pub struct Shape {
    solid: Solid,
    meters_per_unit: f64,
    footing: Option<Footing>,
    /// Colliders and finished meshes are relative to this point of the world's frame, m.
    pub origin: Vector3<f64>,
    pub colliders: Vec<Collider>,
}

impl Shape {
    pub fn of(
        interior: &Interior,
        labels: &[FieldPart],
        support: Option<&SupportSurface>,
        meters_per_unit: f64,
    ) -> Self {
        let solid = Solid::of(interior, labels);
        let mut colliders = colliders::colliders(&solid, &names::of_parts(labels), meters_per_unit);
        let footing = support.and_then(|support| Footing::of(support, meters_per_unit, &colliders));
        if let Some(footing) = &footing {
            colliders.iter_mut().for_each(|collider| footing.flatten_collider(collider));
        }
        Self { solid, meters_per_unit, footing, origin: Vector3::zeros(), colliders }
    }

    /// The same relative to another point.
    pub fn around(mut self, origin: Vector3<f64>) -> Self {
        let by = origin - self.origin;
        self.colliders.iter_mut().flat_map(|collider| &mut collider.vertices).for_each(|vertex| *vertex -= by);
        Self { origin, ..self }
    }

    pub fn meters_per_unit(&self) -> f64 {
        self.meters_per_unit
    }

    /// The id of the part that owns a cell of the object's grid; `None` outside.
    pub fn part_of_cell(&self, cell: usize) -> Option<u32> {
        Some(self.solid.part[cell]).filter(|part| *part != OUTSIDE)
    }

    /// Paints the surfaces of this object with the colours that Gaussians show to cameras.
    pub fn painter<'a>(&self, gaussians: &'a Gaussians, cameras: &[Camera]) -> Painter<'a> {
        Painter::new(gaussians, cameras, &self.solid.grid)
    }

    /// By id of a part, how large its surface is beside that of the largest: surfaces grow with the square of the size.
    fn shares(&self) -> BTreeMap<u32, f64> {
        let mut cells: BTreeMap<u32, usize> = BTreeMap::new();
        self.solid.part.iter().filter(|part| **part != OUTSIDE).for_each(|part| *cells.entry(*part).or_default() += 1);
        let most = cells.values().copied().max().unwrap_or(1) as f64;
        cells.into_iter().map(|(part, count)| (part, (count as f64 / most).powf(2.0 / 3.0))).collect()
    }

    /// By the ids of two parts, the lesser first: the faces of cells that they share.
    pub fn contacts(&self) -> BTreeMap<(u32, u32), Contact> {
        let Solid { grid, part } = &self.solid;
        let mut contacts: BTreeMap<(u32, u32), Contact> = BTreeMap::new();
        for i in (0..part.len()).filter(|i| part[*i] != OUTSIDE) {
            for n in grid.neighbours(i).filter(|n| part[*n] != OUTSIDE && part[i] < part[*n]) {
                let contact = contacts.entry((part[i], part[n])).or_default();
                let [own, other] = [i, n].map(|cell| grid.center(grid.coords(cell)));
                contact.faces += 1;
                contact.sum += nalgebra::center(&own, &other).coords;
            }
        }
        contacts
    }

    /// A mesh of the object, made in scene units, in metres, with a flat underside and its own origin.
    pub fn finished(&self, mesh: Mesh) -> Mesh {
        let mut mesh = mesh.scaled(self.meters_per_unit);
        if let Some(footing) = &self.footing {
            footing.flatten_mesh(&mut mesh);
        }
        mesh.vertices.iter_mut().for_each(|vertex| *vertex -= self.origin);
        mesh
    }
}

/// The triangles of a mesh whose surface is this share of the largest.
fn triangles_of(share: f64) -> usize {
    (TRIANGLES as f64 * share).max(200.0) as usize
}

/// The outer surface of the whole object with the splat's colours.
pub fn skin_of(painter: &Painter, shape: &Shape) -> Skin {
    skin(painter, shape, None, 1.0)
}

/// The outer surface of these parts together.
pub fn skin_of_parts(painter: &Painter, shape: &Shape, parts: &[u32]) -> Skin {
    let shares = shape.shares();
    let share = parts.iter().filter_map(|part| shares.get(part)).sum::<f64>().min(1.0);
    skin(painter, shape, Some(parts), share)
}

/// The surfaces of these parts with the splat's colours. Where a part touches others, it has the colour of the nearest Gaussian.
pub fn skins_of(painter: &Painter, shape: &Shape, parts: &[u32]) -> Vec<Skin> {
    let shares = shape.shares();
    parallel::map(parts, |part| skin(painter, shape, Some(&[*part]), shares[part]))
}

fn skin(painter: &Painter, shape: &Shape, parts: Option<&[u32]>, share: f64) -> Skin {
    let solid = &shape.solid;
    let mesh = surface::of(&solid.grid, &solid.mask(parts));
    let mesh = simplify::simplified(mesh, triangles_of(share), 0.5 * solid.grid.cell);
    let (layout, size) = atlas::layout(&mesh, &painter.triangle_colors(&mesh), share);
    let picture = png::encoded(&painter.picture(&mesh, &layout, size));
    let uv = layout.iter().map(|tile| tile.uv(size)).collect();
    let part = mesh.triangles.iter().map(|t| solid.part_at(&mesh.corners(*t))).collect();
    Skin { mesh: shape.finished(mesh), part, uv, picture }
}

/// The surfaces of the parts that have a closed one, with the splat's colours.
pub fn part_meshes(painter: &Painter, shape: &Shape) -> Vec<PartMesh> {
    let solid = &shape.solid;
    let shares: Vec<(u32, f64)> = shape.shares().into_iter().collect();
    let mut meshed = parallel::map(&shares, |&(part, share)| {
        let mesh = surface::of(&solid.grid, &solid.mask(Some(&[part])));
        let mesh = simplify::simplified(mesh, triangles_of(share), 0.5 * solid.grid.cell);
        let colors = painter.vertex_colors(&mesh);
        PartMesh { part, mesh: shape.finished(mesh), colors }
    });
    meshed.retain(|meshed| meshed.mesh.volume() > 0.0);
    meshed
}

/// The standard deviations at which a Gaussian ends: beyond, 1.1 % of its opacity is left.
const REACH: f64 = 3.0;

/// Half the sides of the box that holds Gaussian `i` out to [`REACH`].
fn reach_of(gaussians: &Gaussians, i: usize) -> Vector3<f64> {
    gaussians.covariance(i).diagonal().map(|variance| REACH * variance.sqrt())
}
