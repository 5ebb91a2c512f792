//! The connected surfaces of a mesh: triangles that share a corner, wherever its vertices stand in the file. The two sides of
//! a texture's seam have vertices of their own at the same places.

use std::collections::HashMap;

use super::Triangles;
use crate::numeric::forest::Forest;

/// Whatever is said of directions does not matter here.
const ALIKE: bool = false;

/// Per triangle, the number of its surface, counted from 0 in the order of the surfaces' first vertices.
pub fn surface_of_triangles(mesh: &Triangles) -> Vec<u32> {
    let mut first_at: HashMap<[u64; 3], usize> = HashMap::with_capacity(mesh.vertices.len());
    let mut vertices = Forest::of(mesh.vertices.len());
    for (index, position) in mesh.vertices.iter().enumerate() {
        // Adding 0 makes -0 and 0 the same bits.
        let first = *first_at.entry(position.map(|x| (x + 0.0).to_bits())).or_insert(index);
        vertices.join(first, index, ALIKE);
    }
    for [a, b, c] in mesh.triangles.iter().map(|corners| corners.map(|corner| corner as usize)) {
        vertices.join(a, b, ALIKE);
        vertices.join(b, c, ALIKE);
    }
    let (surface_of, _) = vertices.numbered();
    mesh.triangles.iter().map(|[first, ..]| surface_of[*first as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seam_does_not_part_a_surface_and_nearness_joins_none() {
        let square =
            |z: f64| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z], [1.0, -0.0, z], [1.0, 1.0, z], [-0.0, 1.0, z]];
        let mesh = Triangles {
            vertices: [square(0.0), square(1e-9)].concat(),
            triangles: vec![[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]],
        };
        let [a, b, c, d]: [u32; 4] = surface_of_triangles(&mesh).try_into().unwrap();
        assert_eq!((a, c), (b, d));
        assert_ne!(a, c);
    }
}
