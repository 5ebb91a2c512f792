//! What can be wrong with a file of each format. The formats' readers also report the [problems](super::Problem) that all have.

use thiserror::Error;

use crate::files::json;

/// An error in a glTF.
#[derive(Debug, Error)]
pub enum GltfProblem {
    #[error("the GLB's parts cannot be told apart: {0}; export the mesh again")]
    Container(gltf::Error),
    #[error("is glTF {version}; gprop reads glTF 2: convert it, for example with Blender")]
    Version { version: String },
    #[error("is not glTF: {0}; export the mesh again")]
    Json(json::Problem),
    #[error("{place} names {what} {index}, which is not there; export the mesh again")]
    NoSuch { place: String, what: &'static str, index: usize },
    #[error("{place}: {problem}; export the mesh again")]
    Accessor { place: String, problem: &'static str },
    #[error(
        "buffer {index} has {found} bytes, but {place} needs {needed}; copy or export the mesh again with its buffers"
    )]
    Short { index: usize, place: String, found: usize, needed: u64 },
    #[error("buffer {index} has no bytes in the file; export the mesh again with its buffers")]
    NoBytes { index: usize },
    #[error("{what} has a data URI that is not base64; export the mesh again")]
    DataUri { what: String },
    #[error(
        "{place} is compressed with {extension}, which gprop does not read; decompress it with `gltf-transform copy IN OUT` (npm)"
    )]
    Compressed { place: String, extension: &'static str },
    #[error("node {node} is reached twice: the nodes are not a tree; export the mesh again")]
    NotATree { node: usize },
    #[error("node {node}: its transform is not finite; export the mesh again")]
    Transform { node: usize },
    #[error("{place}: its mode or attributes are not glTF 2; export the mesh again")]
    Primitive { place: String },
}

/// An error in a line of an OBJ or MTL.
#[derive(Debug, Error)]
#[error("{file}line {line}: `{text}`: {expected}; export the mesh again")]
pub struct ObjProblem {
    /// The name of the MTL with a colon and a space; empty for the OBJ itself.
    pub file: String,
    pub line: usize,
    pub text: String,
    pub expected: &'static str,
}

/// An error in a PLY.
#[derive(Debug, Error)]
pub enum PlyProblem {
    #[error("the header is not PLY: {0}; export the mesh again")]
    Header(String),
    #[error("the header declares a property or element twice; export the mesh again")]
    Duplicate,
    #[error(
        "has no faces: it is a splat or a cloud of points; gprop needs a splat's folder with its cameras and photos, or a mesh \
         with an element `face`"
    )]
    NoFaces,
    #[error(
        "has strips of triangles (element `tristrips`), which gprop does not read; export it with an element `face`"
    )]
    Strips,
    #[error("element `{element}` has no property `{property}`; export the mesh again")]
    Missing { element: &'static str, property: &'static str },
    #[error("element `{element}`, row {row} of {count}: the file ends there; copy or export it again")]
    Truncated { element: String, row: usize, count: usize },
    #[error("element `{element}`, row {row}: `{word}` is not a number; export the mesh again")]
    NotANumber { element: String, row: usize, word: String },
}

/// An error in an STL.
#[derive(Debug, Error)]
pub enum StlProblem {
    #[error(
        "is truncated: its header claims {count} triangles, for which it needs {expected} bytes, but it has {found}; copy or export \
         it again"
    )]
    Truncated { count: u32, expected: u64, found: usize },
    #[error("is neither a binary STL, which has at least 84 bytes, nor text that begins with `solid`; export it again")]
    NotStl,
    #[error("line {line}: `{text}` are not three numbers; export it again")]
    NotNumbers { line: usize, text: String },
    #[error("line {line}: a facet ends after {corners} corners, and gprop reads triangles; export it again")]
    Corners { line: usize, corners: usize },
    #[error("the text ends within a facet; copy or export it again")]
    TruncatedText,
}
