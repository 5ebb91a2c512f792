//! A closed surface around cells.
//!
//! The centres of the cells are the corners of the cubes of marching cubes (Lorensen and Cline 1987). Instead of a
//! table, the polygons of a cube are traced along its faces. If the two inside corners of a face lie diagonally, both
//! cubes that share the face separate them, so the surface is closed, every edge has two triangles, and a hole of one
//! cell stays open.

use nalgebra::{Point3, Vector3};

use super::Mesh;
use crate::parallel;
use crate::parts::{Grid, blur};

/// The surface crosses the line from an inside to an outside cell at this share of it, at least and at most. One half
/// is the cells' own border; how far blurring may move it is bounded, because it would dissolve walls of one cell.
const CROSSING: [f64; 2] = [0.3, 0.95];
/// Rounds of smoothing, and the shares by which each moves a vertex to the mean of its neighbours and back (Taubin
/// 1995): steps of the cells disappear, the volume does not.
const ROUNDS: usize = 8;
const SMOOTHING: [f64; 2] = [0.5, -0.53];

/// The corners of a cube as offsets along x, y, z.
const CORNERS: [[usize; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]];
/// The corners of each face, counter-clockwise seen from outside the cube.
const FACES: [[usize; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// The surface of the cells in `mask`, in scene units. No cell on the grid's border may be in it.
pub fn of(grid: &Grid, mask: &[bool]) -> Mesh {
    let blurred = blur(grid, mask);
    let strides = grid.strides();
    let corner = |cube: usize, c: usize| cube + (0..3).map(|axis| CORNERS[c][axis] * strides[axis]).sum::<usize>();
    let last = mask.len() - corner(0, 7);
    let is_mixed = |cube: usize| {
        let inside = (0..8).filter(|c| mask[corner(cube, *c)]).count();
        inside > 0 && inside < 8
    };
    let cubes: Vec<usize> = parallel::flat_map_range(last, |cube| is_mixed(cube).then_some(cube));

    let mut vertex_of = vec![u32::MAX; 3 * mask.len()];
    let mut mesh = Mesh::default();
    let mut vertex = |a: usize, b: usize, vertices: &mut Vec<Point3<f64>>| {
        let (low, high) = (a.min(b), a.max(b));
        let axis = strides.iter().position(|stride| *stride == high - low).expect("an edge of a cube");
        let known = &mut vertex_of[3 * low + axis];
        if *known == u32::MAX {
            *known = vertices.len() as u32;
            let (inside, outside) = if mask[low] { (low, high) } else { (high, low) };
            vertices.push(crossing(grid, &blurred, inside, outside));
        }
        *known
    };
    for cube in cubes {
        let inside: [bool; 8] = std::array::from_fn(|c| mask[corner(cube, c)]);
        for polygon in polygons(inside) {
            let ring: Vec<u32> =
                polygon.iter().map(|[a, b]| vertex(corner(cube, *a), corner(cube, *b), &mut mesh.vertices)).collect();
            fill(&mut mesh, &ring);
        }
    }
    smooth(&mut mesh);
    mesh
}

/// Where the surface crosses the line between two cells.
fn crossing(grid: &Grid, blurred: &[f32], inside: usize, outside: usize) -> Point3<f64> {
    let (inner, outer) = (f64::from(blurred[inside]), f64::from(blurred[outside]));
    let share = ((inner - 0.5) / (inner - outer).max(1e-6)).clamp(CROSSING[0], CROSSING[1]);
    let [from, to] = [inside, outside].map(|cell| grid.center(grid.coords(cell)));
    from + (to - from) * share
}

/// The polygons that separate a cube's inside corners from the others, each as the edges that it crosses: inside corner,
/// outside corner. Counter-clockwise seen from outside the object.
fn polygons(inside: [bool; 8]) -> Vec<Vec<[usize; 2]>> {
    // For each crossed edge, the crossed edge that follows on the face where the edge leads out of the object.
    let mut steps: Vec<([usize; 2], [usize; 2])> = Vec::with_capacity(12);
    for face in FACES {
        for (n, &corner) in face.iter().enumerate() {
            let previous = face[(n + 3) % 4];
            if !inside[corner] || inside[previous] {
                continue;
            }
            // The run of inside corners that begins here.
            let length = (1..4).find(|k| !inside[face[(n + k) % 4]]).expect("the previous corner is outside");
            let leaving = [face[(n + length - 1) % 4], face[(n + length) % 4]];
            steps.push(([corner, previous], leaving));
        }
    }
    let mut polygons = Vec::new();
    while let Some((first, mut at)) = steps.pop() {
        let mut polygon = vec![first];
        while at != first {
            polygon.push(at);
            let next = steps.iter().position(|(from, _)| *from == at).expect("crossed edges form rings");
            at = steps.swap_remove(next).1;
        }
        polygons.push(polygon);
    }
    polygons
}

/// Fills a polygon with triangles, none of whose sides lies on a face of the cube that the polygon does not follow.
fn fill(mesh: &mut Mesh, ring: &[u32]) {
    let vertex_at = |n: usize| mesh.vertices[ring[n] as usize];
    match ring.len() {
        3 => mesh.triangles.push([ring[0], ring[1], ring[2]]),
        4 => {
            let (one, other) =
                ((vertex_at(0) - vertex_at(2)).norm_squared(), (vertex_at(1) - vertex_at(3)).norm_squared());
            let start = usize::from(other < one);
            let corner = |n: usize| ring[(start + n) % 4];
            mesh.triangles.extend([[corner(0), corner(1), corner(2)], [corner(0), corner(2), corner(3)]]);
        }
        length => {
            let middle = (0..length).map(|n| vertex_at(n).coords).sum::<Vector3<f64>>() / length as f64;
            let hub = mesh.vertices.len() as u32;
            mesh.vertices.push(middle.into());
            mesh.triangles.extend((0..length).map(|n| [hub, ring[n], ring[(n + 1) % length]]));
        }
    }
}

fn smooth(mesh: &mut Mesh) {
    let neighbours = mesh.neighbours();
    for _ in 0..ROUNDS {
        for share in SMOOTHING {
            mesh.vertices = parallel::map_range(mesh.vertices.len(), |n| {
                let (at, beside) = (mesh.vertices[n], &neighbours[n]);
                let sum: Vector3<f64> = beside.iter().map(|n| mesh.vertices[*n as usize].coords).sum();
                at + (sum / beside.len() as f64 - at.coords) * share
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use nalgebra::center;

    use super::*;

    fn grid(side: usize) -> Grid {
        Grid { origin: Point3::origin(), cell: 1.0, dims: [side; 3] }
    }

    fn cells(grid: &Grid, mut inside: impl FnMut([f64; 3]) -> bool) -> Vec<bool> {
        (0..grid.len()).map(|i| inside(grid.center(grid.coords(i)).into())).collect()
    }

    /// Every edge runs once in either direction.
    fn assert_closed(mesh: &Mesh) {
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for &[a, b, c] in &mesh.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *edges.entry((from, to)).or_default() += 1;
            }
        }
        assert!(edges.iter().all(|((a, b), count)| *count == 1 && edges.get(&(*b, *a)) == Some(&1)));
    }

    #[test]
    fn a_ball_has_its_volume_and_looks_outward() {
        let grid = grid(40);
        let middle = center(&Point3::origin(), &Point3::new(40.0, 40.0, 40.0));
        let mesh = of(&grid, &cells(&grid, |p| (Point3::from(p) - middle).norm() < 15.0));
        assert_closed(&mesh);
        let volume = 4.0 / 3.0 * std::f64::consts::PI * 15f64.powi(3);
        assert!((mesh.volume() / volume - 1.0).abs() < 0.01, "{} of {volume}", mesh.volume());
        for (vertex, normal) in mesh.vertices.iter().zip(mesh.normals()) {
            assert!(((vertex - middle).norm() - 15.0).abs() < 0.4, "smooth: {}", (vertex - middle).norm());
            assert!((vertex - middle).normalize().dot(&normal) > 0.9);
        }
    }

    #[test]
    fn any_cells_give_a_closed_surface() {
        let grid = grid(12);
        for seed in 0..20 {
            let mut random = fastrand::Rng::with_seed(seed);
            let mask = cells(&grid, |p| p.iter().all(|c| (3.0..9.0).contains(c)) && random.bool());
            let mesh = of(&grid, &mask);
            assert_closed(&mesh);
            assert!(mesh.volume() > 0.0, "seed {seed}");
        }
    }

    #[test]
    fn a_sheet_of_one_cell_keeps_most_of_its_thickness_and_a_hole_stays_open() {
        let grid = grid(30);
        let sheet = cells(&grid, |[x, y, z]| {
            z.floor() == 15.0
                && (5.0..25.0).contains(&x)
                && (5.0..25.0).contains(&y)
                && !(x.floor() == 12.0 && y.floor() == 12.0)
        });
        let mesh = of(&grid, &sheet);
        assert_closed(&mesh);
        assert!((200.0..400.0).contains(&mesh.volume()), "{} of 399 cells", mesh.volume());
        // Euler's formula: a surface with one handle.
        let edges = mesh.triangles.len() * 3 / 2;
        assert_eq!(mesh.vertices.len() + mesh.triangles.len(), edges, "one hole");
    }
}
