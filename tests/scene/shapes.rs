//! Meshes of known solids.

use std::f64::consts::TAU;

use gprop::scene::mesh::Triangles;

/// The surface that a profile of (radius, height) sweeps around the z axis. It faces outward if the profile runs upward on
/// the outside.
pub fn revolved(profile: &[[f64; 2]], segments: u32) -> Triangles {
    let mut mesh = Triangles::default();
    for &[radius, height] in profile {
        for segment in 0..segments {
            let (sin, cos) = (TAU * f64::from(segment) / f64::from(segments)).sin_cos();
            mesh.vertices.push([radius * cos, radius * sin, height]);
        }
    }
    for ring in 0..profile.len() as u32 - 1 {
        for segment in 0..segments {
            let [a, b] = [segment, (segment + 1) % segments].map(|s| ring * segments + s);
            // Where the profile meets the axis, one of the two has no area.
            mesh.triangles.extend([[a, b, b + segments], [a, b + segments, a + segments]]);
        }
    }
    mesh
}

/// A sphere of so many segments from pole to pole.
pub fn sphere(center: [f64; 3], radius: f64, segments: u32) -> Triangles {
    let angle = |n: u32| TAU / 2.0 * (f64::from(n) / f64::from(segments) - 0.5);
    let mut profile: Vec<[f64; 2]> =
        (0..=segments).map(|n| [radius * angle(n).cos(), radius * angle(n).sin()]).collect();
    (profile[0], profile[segments as usize]) = ([0.0, -radius], [0.0, radius]);
    moved(revolved(&profile, 2 * segments), center)
}

/// A box between two corners.
pub fn cuboid(low: [f64; 3], high: [f64; 3]) -> Triangles {
    let vertex = |n: usize| std::array::from_fn(|axis| if n >> axis & 1 == 1 { high[axis] } else { low[axis] });
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Triangles { vertices: (0..8).map(vertex).collect(), triangles }
}

/// Several surfaces as one.
pub fn joined(meshes: &[Triangles]) -> Triangles {
    let mut all = Triangles::default();
    for mesh in meshes {
        let first = all.vertices.len() as u32;
        all.vertices.extend(&mesh.vertices);
        all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| first + v)));
    }
    all
}

pub fn moved(mut mesh: Triangles, by: [f64; 3]) -> Triangles {
    mesh.vertices.iter_mut().for_each(|vertex| (0..3).for_each(|axis| vertex[axis] += by[axis]));
    mesh
}

/// The surface facing the other way.
pub fn reversed(mut mesh: Triangles) -> Triangles {
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    mesh
}

/// Each triangle cut in four.
pub fn subdivided(mesh: &Triangles) -> Triangles {
    let mut cut = mesh.clone();
    cut.triangles.clear();
    for t in &mesh.triangles {
        let [a, b, c] = *t;
        let first = cut.vertices.len() as u32;
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let [from, to] = [mesh.vertices[from as usize], mesh.vertices[to as usize]];
            cut.vertices.push(std::array::from_fn(|axis| 0.5 * (from[axis] + to[axis])));
        }
        let [ab, bc, ca] = [first, first + 1, first + 2];
        cut.triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    cut
}

/// The triangles in another order, each starting with another corner.
pub fn shuffled(mesh: &Triangles) -> Triangles {
    let mut random = fastrand::Rng::with_seed(1);
    let mut order: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    random.shuffle(&mut order);
    let mut place = vec![0; order.len()];
    (0..).zip(&order).for_each(|(n, v)| place[*v as usize] = n);
    let vertices = order.iter().map(|v| mesh.vertices[*v as usize]).collect();
    let mut triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|v| place[v as usize])).collect();
    triangles.iter_mut().for_each(|t| t.rotate_left(random.usize(0..3)));
    random.shuffle(&mut triangles);
    Triangles { vertices, triangles }
}

/// Every tenth triangle, at random, facing the other way.
pub fn with_tenth_flipped(mesh: &Triangles) -> Triangles {
    let mut random = fastrand::Rng::with_seed(2);
    let mut mesh = mesh.clone();
    mesh.triangles.iter_mut().filter(|_| random.u32(0..10) == 0).for_each(|t| t.swap(1, 2));
    mesh
}
