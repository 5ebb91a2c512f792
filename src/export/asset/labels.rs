//! The labels of a mesh's faces and vertices. A face has the label of most Gaussians that lie on it; one on which none lies,
//! because it is small, that of the nearest one on the same connected surface. A vertex has the label of most of the area around
//! it.

use std::collections::BTreeMap;

use super::super::Model;
use crate::numeric::nearest::Nearest;
use crate::parallel;
use crate::scene::SceneMesh;
use crate::scene::mesh::{GltfPrimitive, Mesh, Triangles, surface_of_triangles};

/// Indices of the field's labels.
pub struct SurfaceLabels {
    pub of_triangle: Vec<u32>,
    /// `None` for a vertex of no triangle.
    pub of_vertex: Vec<Option<u32>>,
}

impl SurfaceLabels {
    /// The labels of the mesh on which the model's Gaussians lie, none of which was left out.
    pub fn of(model: &Model, mesh: &SceneMesh) -> Self {
        let surface = &mesh.painted.mesh.surface;
        let mut votes: Vec<(u32, u32)> =
            mesh.triangle_of_gaussian.iter().copied().zip(model.field.part_index.iter().copied()).collect();
        votes.sort_unstable();
        let mut elected: Vec<Option<u32>> = vec![None; surface.triangles.len()];
        for of_triangle in votes.chunk_by(|a, b| a.0 == b.0) {
            let runs = of_triangle.chunk_by(|a, b| a.1 == b.1).map(|run| (run.len(), run[0].1));
            let most = runs.reduce(|best, next| if next.0 > best.0 { next } else { best });
            elected[of_triangle[0].0 as usize] = most.map(|(_, label)| label);
        }
        let of_triangle = filled(model, surface, &elected);
        let of_vertex = of_vertices(surface, &of_triangle);
        Self { of_triangle, of_vertex }
    }

    /// The labels of the vertices of each primitive of a glTF: of several copies, the label that most of them have.
    pub fn of_primitives(&self, mesh: &Mesh) -> BTreeMap<GltfPrimitive, Vec<Option<u32>>> {
        let mut copies: BTreeMap<GltfPrimitive, Vec<&[Option<u32>]>> = BTreeMap::new();
        for placed in &mesh.placed {
            let vertices = placed.vertices.start as usize..placed.vertices.end as usize;
            copies.entry(placed.source).or_default().push(&self.of_vertex[vertices]);
        }
        let most = |copies: &[&[Option<u32>]], vertex: usize| {
            let mut labels: Vec<u32> = copies.iter().filter_map(|copy| copy[vertex]).collect();
            labels.sort_unstable();
            let runs = labels.chunk_by(|a, b| a == b).map(|run| (run.len(), run[0]));
            runs.reduce(|best, next| if next.0 > best.0 { next } else { best }).map(|(_, label)| label)
        };
        let of_copies =
            |copies: Vec<&[Option<u32>]>| (0..copies[0].len()).map(|vertex| most(&copies, vertex)).collect();
        copies.into_iter().map(|(source, copies)| (source, of_copies(copies))).collect()
    }
}

/// The labels of all triangles, given those on which Gaussians lie.
fn filled(model: &Model, surface: &Triangles, elected: &[Option<u32>]) -> Vec<u32> {
    let surface_of = surface_of_triangles(surface);
    let mut on_surface: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    (0..model.gaussians.len()).for_each(|i| on_surface.entry(model.gaussians.surface_of(i)).or_default().push(i));
    let searched = |indices: Vec<usize>| {
        let nearest = Nearest::new(indices.iter().map(|&i| model.gaussians.positions[i]));
        (indices, nearest)
    };
    let everywhere = searched((0..model.gaussians.len()).collect());
    let of_surface: BTreeMap<u32, (Vec<usize>, Nearest)> =
        on_surface.into_iter().map(|(surface, indices)| (surface, searched(indices))).collect();
    let of_nearest = |triangle: usize| {
        let corners = surface.triangles[triangle].map(|corner| surface.vertices[corner as usize]);
        let middle = std::array::from_fn(|axis| (corners.iter().map(|corner| corner[axis]).sum::<f64>() / 3.0) as f32);
        let (indices, nearest) = of_surface.get(&surface_of[triangle]).unwrap_or(&everywhere);
        nearest.find(middle, 1).first().map_or(0, |(_, at)| model.field.part_index[indices[*at as usize]])
    };
    parallel::map_range(elected.len(), |triangle| elected[triangle].unwrap_or_else(|| of_nearest(triangle)))
}

fn of_vertices(surface: &Triangles, of_triangle: &[u32]) -> Vec<Option<u32>> {
    let mut votes: Vec<(u32, u32, f64)> = Vec::with_capacity(3 * of_triangle.len());
    for (corners, label) in surface.triangles.iter().zip(of_triangle) {
        let [a, b, c] = corners.map(|corner| nalgebra::Vector3::from(surface.vertices[corner as usize]));
        let area = (b - a).cross(&(c - a)).norm();
        votes.extend(corners.map(|corner| (corner, *label, area)));
    }
    votes.sort_by_key(|(vertex, label, _)| (*vertex, *label));
    let mut labels = vec![None; surface.vertices.len()];
    for of_vertex in votes.chunk_by(|a, b| a.0 == b.0) {
        let runs = of_vertex.chunk_by(|a, b| a.1 == b.1);
        let areas = runs.map(|run| (run.iter().map(|vote| vote.2).sum::<f64>(), run[0].1));
        let most = areas.reduce(|best, next| if next.0 > best.0 { next } else { best });
        labels[of_vertex[0].0 as usize] = most.map(|(_, label)| label);
    }
    labels
}
