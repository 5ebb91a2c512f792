//! Fewer triangles for a closed mesh: the edges whose removal moves the surface least are collapsed, by quadric error
//! metrics (Garland and Heckbert 1997). A collapse that would pinch the surface or turn a triangle over is left out, so
//! the mesh stays closed.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::{Matrix3, Point3, Vector3};

use super::Mesh;

/// Cosine of the largest angle by which a triangle may turn when a vertex moves: 78 degrees.
const LEAST_TURN_COSINE: f64 = 0.2;
/// Weight of the vertex's own position beside the planes of its triangles: it decides if the planes do not.
const STAY: f64 = 1e-3;

/// Sum of squared distances to planes, weighted by area: x^T A x - 2 b^T x + c.
#[derive(Clone, Copy, Default)]
struct Quadric {
    a: Matrix3<f64>,
    b: Vector3<f64>,
    c: f64,
    area: f64,
}

/// An edge that may be removed. Small, since the queue holds several for each edge: where the vertex goes follows from the ends as long
/// as they are unchanged.
struct Collapse {
    error: f64,
    ends: [u32; 2],
    /// Number of changes of both ends when it was computed.
    age: u32,
}

/// The mesh with at most `triangles` triangles, if enough can be removed without moving the surface by more than
/// `error` (root mean square around a vertex).
pub fn simplified(mesh: Mesh, triangles: usize, error: f64) -> Mesh {
    let mut work = Work::new(mesh);
    let mut left = work.triangles.len();
    while left > triangles {
        let Some(next) = work.queue.pop() else { break };
        if next.error > error * error {
            break;
        }
        if !work.is_current(&next) {
            continue;
        }
        let (to, _) = work.target(next.ends);
        if work.fits(next.ends, to) {
            work.carry_out(next.ends, to);
            left -= 2;
        }
    }
    work.finish()
}

struct Work {
    vertices: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
    alive: Vec<bool>,
    quadrics: Vec<Quadric>,
    /// Per vertex: its triangles.
    around: Vec<Vec<u32>>,
    changes: Vec<u32>,
    queue: BinaryHeap<Collapse>,
}

impl Work {
    fn new(mesh: Mesh) -> Self {
        let Mesh { vertices, triangles } = mesh;
        let mut quadrics = vec![Quadric::default(); vertices.len()];
        let mut around = vec![Vec::with_capacity(8); vertices.len()];
        for (t, triangle) in triangles.iter().enumerate() {
            let quadric = Quadric::of(triangle.map(|v| vertices[v as usize]));
            for &v in triangle {
                quadrics[v as usize].add(&quadric);
                around[v as usize].push(t as u32);
            }
        }
        for (quadric, at) in quadrics.iter_mut().zip(&vertices) {
            quadric.stay(at);
        }
        let (count, changes) = (triangles.len(), vec![0; vertices.len()]);
        let mut work =
            Self { vertices, triangles, alive: vec![true; count], quadrics, around, changes, queue: BinaryHeap::new() };
        let edges = work.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        work.queue = edges.filter(|[from, to]| from < to).map(|ends| work.collapse(ends)).collect();
        work
    }

    /// Where the edge's vertex goes, and the error there.
    fn target(&self, ends: [u32; 2]) -> (Point3<f64>, f64) {
        let [a, b] = ends.map(|v| v as usize);
        let mut sum = self.quadrics[a];
        sum.add(&self.quadrics[b]);
        let (p, q) = (self.vertices[a], self.vertices[b]);
        let middle = nalgebra::center(&p, &q);
        let best = sum.least().filter(|best| (best - middle).norm() < 2.0 * (p - q).norm()).unwrap_or(middle);
        (best, sum.at(&best))
    }

    /// `ends` in their order.
    fn collapse(&self, ends: [u32; 2]) -> Collapse {
        let [a, b] = ends.map(|v| v as usize);
        Collapse { error: self.target(ends).1, ends, age: self.changes[a] + self.changes[b] }
    }

    fn is_current(&self, collapse: &Collapse) -> bool {
        let [a, b] = collapse.ends.map(|v| v as usize);
        !self.around[a].is_empty() && !self.around[b].is_empty() && self.changes[a] + self.changes[b] == collapse.age
    }

    fn neighbours(&self, v: u32) -> Vec<u32> {
        let mut all: Vec<u32> = self.around[v as usize].iter().flat_map(|t| self.triangles[*t as usize]).collect();
        all.sort_unstable();
        all.dedup();
        all.retain(|n| *n != v);
        all
    }

    /// True if the two ends share just the two vertices opposite their edge, and no triangle turns over.
    fn fits(&self, [a, b]: [u32; 2], to: Point3<f64>) -> bool {
        let beside = self.neighbours(b);
        let shared: Vec<u32> = self.neighbours(a).into_iter().filter(|n| beside.binary_search(n).is_ok()).collect();
        // A vertex with three triangles would leave a flap behind.
        if shared.len() != 2 || shared.iter().any(|v| self.around[*v as usize].len() <= 3) {
            return false;
        }
        [(a, b), (b, a)].into_iter().all(|(moved, other)| {
            self.around[moved as usize].iter().map(|t| self.triangles[*t as usize]).all(|triangle| {
                if triangle.contains(&other) {
                    return true;
                }
                let before = triangle.map(|v| self.vertices[v as usize]);
                let after = triangle.map(|v| if v == moved { to } else { self.vertices[v as usize] });
                let normal = |[a, b, c]: [Point3<f64>; 3]| (b - a).cross(&(c - a));
                let (old, new) = (normal(before), normal(after));
                let least = 1e-3 * longest_side(after).powi(2);
                new.norm() > least && old.dot(&new) > LEAST_TURN_COSINE * old.norm() * new.norm()
            })
        })
    }

    /// Removes the second of the ends, and moves the first to `to`.
    fn carry_out(&mut self, [kept, gone]: [u32; 2], to: Point3<f64>) {
        let of_gone = std::mem::take(&mut self.around[gone as usize]);
        for t in of_gone {
            let triangle = self.triangles[t as usize];
            if triangle.contains(&kept) {
                self.alive[t as usize] = false;
                for v in triangle {
                    self.around[v as usize].retain(|other| *other != t);
                }
            } else {
                self.triangles[t as usize] = triangle.map(|v| if v == gone { kept } else { v });
                self.around[kept as usize].push(t);
            }
        }
        self.vertices[kept as usize] = to;
        let absorbed = self.quadrics[gone as usize];
        self.quadrics[kept as usize].add(&absorbed);
        // Beyond both ends' counts, so that no older offer of this vertex looks current.
        self.changes[kept as usize] += self.changes[gone as usize] + 1;
        for n in self.neighbours(kept) {
            self.queue.push(self.collapse([kept.min(n), kept.max(n)]));
        }
    }

    fn finish(self) -> Mesh {
        let mut index = vec![u32::MAX; self.vertices.len()];
        let mut mesh = Mesh::default();
        for (triangle, _) in self.triangles.iter().zip(&self.alive).filter(|(_, alive)| **alive) {
            let renumbered = triangle.map(|v| {
                let known = &mut index[v as usize];
                if *known == u32::MAX {
                    *known = mesh.vertices.len() as u32;
                    mesh.vertices.push(self.vertices[v as usize]);
                }
                *known
            });
            mesh.triangles.push(renumbered);
        }
        mesh
    }
}

fn longest_side([a, b, c]: [Point3<f64>; 3]) -> f64 {
    (b - a).norm().max((c - b).norm()).max((a - c).norm())
}

impl Quadric {
    fn of([p, q, r]: [Point3<f64>; 3]) -> Self {
        let normal = (q - p).cross(&(r - p));
        let area = 0.5 * normal.norm();
        let Some(n) = normal.try_normalize(0.0) else { return Self::default() };
        let offset = n.dot(&p.coords);
        Self { a: n * n.transpose() * area, b: n * (offset * area), c: offset * offset * area, area }
    }

    fn stay(&mut self, at: &Point3<f64>) {
        let weight = STAY * self.area;
        self.a += Matrix3::identity() * weight;
        self.b += at.coords * weight;
        self.c += at.coords.norm_squared() * weight;
    }

    fn add(&mut self, other: &Self) {
        self.a += other.a;
        self.b += other.b;
        self.c += other.c;
        self.area += other.area;
    }

    /// Where the error is least.
    fn least(&self) -> Option<Point3<f64>> {
        Some(Point3::from(self.a.cholesky()?.solve(&self.b))).filter(|p| p.iter().all(|c| c.is_finite()))
    }

    /// Mean squared distance from the planes.
    fn at(&self, p: &Point3<f64>) -> f64 {
        let x = p.coords;
        ((x.dot(&(self.a * x)) - 2.0 * self.b.dot(&x) + self.c) / self.area.max(f64::MIN_POSITIVE)).max(0.0)
    }
}

impl PartialEq for Collapse {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Collapse {}

impl PartialOrd for Collapse {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The heap yields the least error first; of equal ones, that of the earlier vertices.
impl Ord for Collapse {
    fn cmp(&self, other: &Self) -> Ordering {
        other.error.total_cmp(&self.error).then_with(|| other.ends.cmp(&self.ends)).then(other.age.cmp(&self.age))
    }
}
