//! The reasons why a mesh cannot be used, and what to do about them.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::endings;
use super::problems::{GltfProblem, ObjProblem, PlyProblem, StlProblem};
use crate::scene::reference::Outside;
use crate::words::output::thousands;

/// A mesh file that cannot be used. The message is complete: it includes that of the problem.
#[derive(Debug, Error)]
#[error("mesh `{}`: {problem}", path.display())]
pub struct MeshError {
    pub path: PathBuf,
    pub problem: Problem,
}

/// An error in a mesh, where it is, and what to do about it.
#[derive(Debug, Error)]
pub enum Problem {
    #[error("cannot be read: {0}")]
    Io(io::Error),
    #[error("is not a mesh format that gprop reads, which are {endings}; {remedy}")]
    Format { endings: String, remedy: &'static str },
    #[error("has no triangles; export the object with its faces")]
    NoTriangles,
    #[error("its triangles have no area; export the object with its surface")]
    NoArea,
    #[error("{place}: a position is not a finite number, or is beyond 1e15; export the mesh again")]
    NotFinite { place: String },
    #[error("{place}: index {index} is out of range, there are {count} {what}; export the mesh again")]
    OutOfRange { place: String, index: i64, count: usize, what: &'static str },
    #[error(
        "{place}: has more than {} {what}, which is the most that gprop reads; simplify the mesh (for example with Blender's Decimate \
         modifier)",
        thousands(*most)
    )]
    TooMany { place: String, what: &'static str, most: u64 },
    #[error("{what} `{name}`: cannot be read: {reason}; put it beside the mesh, or export the mesh again with it")]
    Beside { what: &'static str, name: String, reason: io::Error },
    #[error(
        "{what} `{name}` is an address on the network, and gprop fetches nothing; save it beside the mesh and name it there"
    )]
    Remote { what: &'static str, name: String },
    #[error(
        "it and the files that it names have more than {} bytes, which is the most that gprop reads; make the textures smaller or \
         simplify the mesh",
        thousands(*most)
    )]
    TooManyBytes { most: u64 },
    #[error("{0}")]
    Outside(#[from] Box<Outside>),
    #[error("texture {place}: cannot be decoded: {reason}; save it again as PNG or JPEG")]
    Undecodable { place: String, reason: image::ImageError },
    #[error(
        "texture {place}: is {} x {} pixels, and gprop decodes up to {} pixels of a mesh's textures; scale it down",
        size.0, size.1, thousands(*most)
    )]
    TextureTooLarge { place: String, size: (u32, u32), most: u64 },
    #[error(transparent)]
    Gltf(#[from] GltfProblem),
    #[error(transparent)]
    Obj(#[from] ObjProblem),
    #[error(transparent)]
    Ply(#[from] PlyProblem),
    #[error(transparent)]
    Stl(#[from] StlProblem),
}

impl Problem {
    /// The error that no reader knows a file of this name.
    pub(super) fn format_of(path: &Path) -> Self {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
        let remedy = match ending.as_str() {
            "usd" | "usda" | "usdc" | "usdz" => {
                "convert it with `usd2gltf` (PyPI), or open it in Blender and export GLB"
            }
            _ => "open it in Blender, or any other program that reads it, and export GLB",
        };
        Self::Format { endings: endings(), remedy }
    }
}
