//! The object's shape as convex pieces, for collision: simulators use the convex hull of any mesh, and the hull of a
//! mug is solid.
//!
//! The outer faces of each part's cells form a mesh, which is decomposed by V-HACD (Mamou 2016), as implemented in the
//! crate parry.

use nalgebra::Point3;
use parry3d_f64::math::Vector;
use parry3d_f64::transformation::vhacd::{VHACD, VHACDParameters};
use rayon::prelude::*;

use crate::parts::Interior;

/// Voxels along a part's longest side: a few millimetres on a household object.
const RESOLUTION: u32 = 64;
/// Maximum number of pieces per part: as many as a simulator can step in real time.
const PIECES_MAX: u32 = 32;
/// Volume that its hull may add to a piece, as a share of the piece's volume.
const CONCAVITY: f64 = 0.002;

/// A convex piece of one part.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Label of the part.
    pub part: u32,
    /// Its index among the part's pieces.
    pub index: usize,
    /// World frame, m.
    pub vertices: Vec<Point3<f64>>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Piece {
    pub fn name(&self) -> String {
        format!("part{}_{}", self.part, self.index)
    }
}

/// The pieces of every part that fills cells, ordered by part.
pub fn pieces(interior: &Interior, meters_per_unit: f64) -> Vec<Piece> {
    let mut parts: Vec<u32> = interior.filled().map(|(_, part, _)| part).collect();
    parts.sort_unstable();
    parts.dedup();
    parts.into_par_iter().flat_map_iter(|part| of_part(interior, part, meters_per_unit)).collect()
}

fn of_part(interior: &Interior, part: u32, meters_per_unit: f64) -> Vec<Piece> {
    let (vertices, triangles) = skin(interior, part, meters_per_unit);
    let parameters = VHACDParameters {
        resolution: RESOLUTION,
        concavity: CONCAVITY,
        max_convex_hulls: PIECES_MAX,
        ..Default::default()
    };
    let hulls = VHACD::decompose(&parameters, &vertices, &triangles, false).compute_convex_hulls(1);
    let solid = hulls.into_iter().filter(|(vertices, triangles)| vertices.len() > 3 && !triangles.is_empty());
    solid
        .enumerate()
        .map(|(index, (vertices, triangles))| Piece {
            part,
            index,
            vertices: vertices.into_iter().map(|v| Point3::new(v.x, v.y, v.z)).collect(),
            triangles,
        })
        .collect()
}

/// The faces between the part's cells and all others, two triangles each, m.
fn skin(interior: &Interior, part: u32, meters_per_unit: f64) -> (Vec<Vector>, Vec<[u32; 3]>) {
    let grid = &interior.grid;
    let is_part = |i: usize| interior.part[i] == part;
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    let strides = grid.strides();
    for i in (0..interior.part.len()).filter(|&i| is_part(i)) {
        let corner = grid.origin + nalgebra::Vector3::from(grid.coords(i).map(|c| c as f64 * grid.cell));
        for axis in 0..3 {
            for (side, beside) in [(0.0, i.checked_sub(strides[axis])), (1.0, i.checked_add(strides[axis]))] {
                if beside.is_some_and(|n| n < interior.part.len() && is_part(n)) {
                    continue;
                }
                let first = vertices.len() as u32;
                for [a, b] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
                    let mut offset = [0.0; 3];
                    (offset[axis], offset[(axis + 1) % 3], offset[(axis + 2) % 3]) = (side, a, b);
                    let at = |k: usize| (corner[k] + offset[k] * grid.cell) * meters_per_unit;
                    vertices.push(Vector::new(at(0), at(1), at(2)));
                }
                let quad = if side > 0.0 { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
                triangles.extend(quad.map(|t| t.map(|v| first + v)));
            }
        }
    }
    (vertices, triangles)
}
