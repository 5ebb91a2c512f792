//! Meshes of every format, good and bad.

// GLB and glTF: nodes, instances, accessors, compression, textures.
mod gltf;
// OBJ with MTL, STL and PLY.
mod formats;
// The rasteriser, sampled surfaces, a mesh as a scene of the commands.
mod stages;

use std::path::Path;

use gprop::files::read_scope::ReadScope;
use gprop::scene::mesh::{self, Axes, Mesh, MeshFormat};

/// The mesh in a file, in its own axes.
fn read(path: &Path) -> Result<Mesh, String> {
    mesh::read(path, Axes::OfFile, &ReadScope::new(path.parent().unwrap())).map_err(|error| error.to_string())
}

/// The mesh in these bytes, as a file with this name would be read.
fn parse(name: &str, bytes: &[u8]) -> Result<Mesh, String> {
    MeshFormat::of(Path::new(name)).unwrap().parse(bytes).map_err(|error| error.to_string())
}

/// Six times the enclosed volume of a closed mesh, from the corners of its triangles: positive if they are anticlockwise seen
/// from outside.
fn six_volumes(mesh: &Mesh) -> f64 {
    let corner = |index: u32| nalgebra::Vector3::from(mesh.surface.vertices[index as usize]);
    let volume = |[a, b, c]: &[u32; 3]| corner(*a).dot(&corner(*b).cross(&corner(*c)));
    mesh.surface.triangles.iter().map(volume).sum()
}

/// Every file that begins like this one, and every one with a byte of it altered, ends with a mesh or an error.
fn survives_damage(name: &str, bytes: &[u8]) {
    for end in 0..bytes.len() {
        let _ = parse(name, &bytes[..end]);
    }
    for place in 0..bytes.len() {
        let mut damaged = bytes.to_vec();
        for value in [0, 0x7f, 0xff, damaged[place].wrapping_add(1)] {
            damaged[place] = value;
            let _ = parse(name, &damaged);
        }
    }
}
