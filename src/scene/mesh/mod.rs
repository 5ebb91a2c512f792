//! Meshes: surfaces of triangles that people already have, instead of splats.

pub mod containers;
pub mod solid;

/// A surface of triangles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Triangles {
    /// Positions, in the unit and frame that the owner of the surface names.
    pub vertices: Vec<[f64; 3]>,
    /// Three indices of [`vertices`](Self::vertices) each, anticlockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}
