//! The reasons why a surface cannot be measured.

use thiserror::Error;

/// A surface that cannot be measured, and what to do about it.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SolidError {
    #[error("the mesh has no triangles; export it with its faces")]
    Empty,
    #[error("the mesh has {triangles} triangles, and gprop measures up to {most}; simplify it")]
    TooMany { triangles: usize, most: usize },
    #[error(
        "triangle {triangle} names vertex {index}, but there are {vertices}, counted from 0; export the mesh again"
    )]
    Index { triangle: usize, index: u32, vertices: usize },
    #[error(
        "vertex {vertex} lies at ({}, {}, {}); a coordinate must be a number of at most {most:e}; export the mesh again",
        position[0], position[1], position[2]
    )]
    Position { vertex: u32, position: [f64; 3], most: f64 },
    #[error("none of the {triangles} triangles has an area; check the scale with which the mesh was exported")]
    NoArea { triangles: usize },
}
