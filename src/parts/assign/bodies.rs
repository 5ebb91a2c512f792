//! Cells of a mesh that consists of several bodies, such as a cup and its saucer: each takes its label from the surface of its own
//! body, also where the other one hides it.

use nalgebra::Vector3;

use super::{Grid, Labelled, Labels, NONE, Surface, assign};
use crate::gaussians::Gaussians;
use crate::numeric::nearest::Nearest;
use crate::parallel;
use crate::scene::mesh::solid::Measured;

/// Of a mesh with more bodies, such as a heap of grains, all share one surface.
const MOST_BODIES: u32 = 64;
/// Points that tell which Gaussians lie on which body.
const POINTS: usize = 20_000;
/// Lines through the cells pass by their middles at these shares of a cell: a mesh whose edges run along the cells is not met at an
/// edge.
const BESIDE: [f64; 2] = [0.017, 0.029];

/// Gives the cells of each body the labels of its own Gaussians.
pub fn keep_to_bodies(cells: &mut Labelled, gaussians: &Gaussians, labels: Labels, mesh: &Measured) {
    let bodies = mesh.bodies();
    if !(2..=MOST_BODIES).contains(&bodies) {
        return;
    }
    let body_of_cell = body_of_cells(&cells.grid, &cells.label, mesh);
    let body_of_gaussian = body_of_gaussians(gaussians, mesh);
    for body in 0..bodies {
        let inside: Vec<bool> = body_of_cell.iter().map(|of_cell| *of_cell == Some(body)).collect();
        let kept: Vec<bool> = body_of_gaussian.iter().map(|of_gaussian| *of_gaussian == Some(body)).collect();
        if !inside.contains(&true) || !kept.contains(&true) {
            continue;
        }
        let surface = Surface::of(&cells.grid, &inside);
        let in_view = vec![true; surface.cells.len()];
        let own = assign(gaussians, Labels { kept: &kept, ..labels }, cells.grid, surface, &in_view);
        let found = own.label.into_iter().enumerate().filter(|(_, label)| *label != NONE);
        found.for_each(|(cell, label)| cells.label[cell] = label);
    }
}

/// Per cell that has a label, the body in which its middle lies.
fn body_of_cells(grid: &Grid, label: &[u32], mesh: &Measured) -> Vec<Option<u32>> {
    let [_, _, up] = grid.strides();
    let beside = Vector3::new(BESIDE[0], BESIDE[1], 0.0) * grid.cell;
    let column = |first: usize| {
        let from = grid.center(grid.coords(first)) + beside;
        mesh.bodies_along(from, Vector3::z() * grid.cell, grid.dims[2])
    };
    let columns: Vec<Vec<Option<u32>>> = parallel::map_range(up, column);
    (0..grid.len()).map(|cell| columns[cell % up][cell / up].filter(|_| label[cell] != NONE)).collect()
}

/// Per Gaussian, the body on which most of its connected surface lies.
fn body_of_gaussians(gaussians: &Gaussians, mesh: &Measured) -> Vec<Option<u32>> {
    let nearest = Nearest::new(gaussians.positions.iter().copied());
    let points = mesh.points_of_bodies(POINTS);
    let surface_at = |(point, body): &(nalgebra::Point3<f64>, u32)| {
        let found = nearest.find(point.coords.map(|x| x as f32).into(), 1);
        Some((gaussians.surface_of(found.first()?.1 as usize), *body))
    };
    let mut votes: Vec<(u32, u32)> = parallel::flat_map(&points, surface_at);
    votes.sort_unstable();
    let of_surface = |votes: &[(u32, u32)]| {
        let runs = votes.chunk_by(|a, b| a == b).map(|run| (run.len(), run[0]));
        runs.reduce(|best, next| if next.0 > best.0 { next } else { best }).map(|(_, elected)| elected)
    };
    let elected: Vec<(u32, u32)> = votes.chunk_by(|a, b| a.0 == b.0).filter_map(of_surface).collect();
    let body = |i: usize| {
        let at = elected.binary_search_by_key(&gaussians.surface_of(i), |(surface, _)| *surface).ok()?;
        Some(elected[at].1)
    };
    (0..gaussians.len()).map(body).collect()
}
