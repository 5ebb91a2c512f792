//! On the grid: momentum to velocity, gravity, boundary conditions.

use std::mem::take;

use super::grid::{Columns, NODE};
use crate::mpm::boundary::Boundary;
use crate::parallel;

/// Nodes lighter than this, in kg, hold only rounding errors.
const LEAST_MASS_KG: f32 = 1e-30;

/// Turns the momentum of every node into its velocity at the end of the substep.
pub fn update(
    columns: &Columns,
    nodes: &mut [f32],
    boundaries: &[Boundary],
    gravity_m_s2: [f32; 3],
    spacing_m: f32,
    dt_s: f32,
) {
    let kick = gravity_m_s2.map(|g| g * dt_s);
    let mut planes = Vec::with_capacity(columns.count[0]);
    let mut rest = nodes;
    for i in 0..columns.count[0] {
        let (plane, after) = rest.split_at_mut((columns.plane[i + 1] - columns.plane[i]) * NODE);
        planes.push(plane);
        rest = after;
    }
    parallel::for_each_mut(&mut planes, |i, plane| {
        let mut plane = take(plane);
        for j in 0..columns.count[1] {
            let span = columns.span[i * columns.count[1] + j].clone();
            let (column, after) = plane.split_at_mut(span.len() * NODE);
            plane = after;
            for (k, node) in span.zip(column.as_chunks_mut::<NODE>().0) {
                let mass = node[3];
                if mass <= LEAST_MASS_KG {
                    *node = [0.0; NODE];
                    continue;
                }
                let per_mass = 1.0 / mass;
                let mut velocity = [0, 1, 2].map(|a| node[a] * per_mass + kick[a]);
                let at = [i as i32 + columns.first[0], j as i32 + columns.first[1], k];
                let mut position = [0.0; 3];
                for (n, a) in at.into_iter().zip(columns.axes) {
                    position[a] = n as f32 * spacing_m;
                }
                for boundary in boundaries {
                    velocity = boundary.apply(position, velocity);
                }
                *node = [velocity[0], velocity[1], velocity[2], mass];
            }
        }
    });
}
