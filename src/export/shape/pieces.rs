//! The object's shape as convex pieces, for collisions: simulators use the convex hull of any mesh, and the hull of a
//! mug is solid.
//!
//! A hull reaches beyond the object by the distance from the object to the farthest place within the hull (its
//! [`Lie`]). Of each part, the body whose hull reaches farthest is cut by the plane that leaves the least volume in the
//! hulls of both sides, until no hull reaches farther than a tolerance. Then neighbours are joined if their common hull
//! does not either. A hole is open if a ball wider than the tolerance fits through it.

use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::Solid;
use super::clearance::{Clearance, Lie};
use super::hull::Hull;
use crate::parts::{Grid, OUTSIDE};

/// How far a hull may reach beyond the object, as a share of the object's diagonal, and in cells at least: below that,
/// a hull only rounds off the cells' steps.
const TOLERANCE: f64 = 0.006;
const LEAST_CELLS: f64 = 2.0;
/// Maximum number of pieces per part: with more, simulators become slow.
const PIECES: usize = 32;
/// Positions at which a plane of each direction is tried.
const CUTS: usize = 8;
/// Cost of cuts whose sides differ in size, as a share of the volume: among nearly equal ones, the middle is taken.
const BALANCE: f64 = 0.02;
/// Points that stand for a body while cuts are compared.
const SAMPLES: usize = 200;
/// Points of the border that are this close to a cut, in cells, stand for its section. Faces across an axis lie half a cell
/// apart from those along it.
const NEAR: f64 = 0.75;
/// Points that are outside a face by less than this, in cells, lie in it.
const FLAT: f64 = 1e-3;
/// Bodies with a smaller share of their part's cells are crumbs, which are left out.
const CRUMB: f64 = 5e-4;

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

/// The pieces of every part, ordered by part.
pub fn pieces(solid: &Solid, meters_per_unit: f64) -> Vec<Piece> {
    let clearance = Clearance::of(solid);
    let tolerance = (TOLERANCE * diagonal(solid)).max(LEAST_CELLS * solid.grid.cell);
    let of_part = |part: u32| {
        let hulls = Decomposition::new(solid, part, &clearance, tolerance).hulls();
        hulls.into_iter().enumerate().map(move |(index, hull)| Piece {
            part,
            index,
            vertices: hull.vertices.iter().map(|v| v * meters_per_unit).collect(),
            triangles: hull.triangles,
        })
    };
    solid.parts().into_par_iter().flat_map_iter(of_part).collect()
}

/// The diagonal of the object's box, scene units.
fn diagonal(solid: &Solid) -> f64 {
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    for i in (0..solid.part.len()).filter(|i| solid.part[*i] != OUTSIDE) {
        let at = solid.grid.coords(i);
        (0..3).for_each(|axis| (low[axis], high[axis]) = (low[axis].min(at[axis]), high[axis].max(at[axis] + 1)));
    }
    let side = |axis: usize| (high[axis].saturating_sub(low[axis])) as f64 * solid.grid.cell;
    Vector3::new(side(0), side(1), side(2)).norm()
}

/// A connected body of cells.
struct Body {
    cells: Vec<u32>,
    /// Centres of the faces of its border.
    border: Vec<Point3<f64>>,
    hull: Hull,
    lie: Lie,
}

struct Decomposition<'a> {
    grid: Grid,
    clearance: &'a Clearance,
    tolerance: f64,
    crumb: usize,
    /// Per cell: its body, or [`NOBODY`].
    owner: Vec<u32>,
    /// Number of bodies that there have been.
    named: u32,
    bodies: Vec<Body>,
}

const NOBODY: u32 = u32::MAX;

impl<'a> Decomposition<'a> {
    fn new(solid: &Solid, part: u32, clearance: &'a Clearance, tolerance: f64) -> Self {
        let cells: Vec<u32> = (0..solid.part.len() as u32).filter(|i| solid.part[*i as usize] == part).collect();
        let crumb = (CRUMB * cells.len() as f64) as usize;
        let owner = vec![NOBODY; solid.part.len()];
        let mut new = Self { grid: solid.grid, clearance, tolerance, crumb, owner, named: 0, bodies: Vec::new() };
        new.add(&cells);
        new
    }

    fn hulls(mut self) -> Vec<Hull> {
        while self.bodies.len() < PIECES {
            let deepest = (0..self.bodies.len())
                .max_by(|a, b| self.bodies[*a].lie.depth.total_cmp(&self.bodies[*b].lie.depth).then(b.cmp(a)));
            let Some(deepest) = deepest.filter(|n| self.bodies[*n].lie.depth > self.tolerance) else { break };
            let body = self.bodies.swap_remove(deepest);
            let Some((normal, position)) = self.best_cut(&body) else {
                // It cannot be cut: it stays as it is, and counts as if its hull did not reach beyond the object.
                self.bodies.push(Body { lie: Lie { depth: 0.0, cell: 0 }, ..body });
                continue;
            };
            let (left, right): (Vec<u32>, Vec<u32>) =
                body.cells.iter().partition(|cell| normal.dot(&self.center(**cell).coords) < position);
            self.add(&left);
            self.add(&right);
        }
        self.join();
        let error = 0.25 * self.grid.cell;
        self.bodies.iter().filter_map(|body| body.hull.simple(error)).collect()
    }

    fn center(&self, cell: u32) -> Point3<f64> {
        self.grid.center(self.grid.coords(cell as usize))
    }

    /// Adds the connected bodies of some cells.
    fn add(&mut self, cells: &[u32]) {
        let fresh = self.named;
        cells.iter().for_each(|cell| self.owner[*cell as usize] = fresh);
        self.named += 1;
        let mut connected = Vec::new();
        for &seed in cells {
            if self.owner[seed as usize] != fresh {
                continue;
            }
            let name = self.named;
            self.named += 1;
            self.owner[seed as usize] = name;
            let mut body = vec![seed];
            let mut next = 0;
            while let Some(&cell) = body.get(next) {
                next += 1;
                for n in self.grid.neighbours(cell as usize) {
                    if self.owner[n] == fresh {
                        self.owner[n] = name;
                        body.push(n as u32);
                    }
                }
            }
            connected.push(body);
        }
        for cells in connected.into_iter().filter(|cells| cells.len() > self.crumb) {
            let border = self.border(&cells);
            self.bodies.extend(self.body(cells, border));
        }
    }

    fn body(&self, cells: Vec<u32>, border: Vec<Point3<f64>>) -> Option<Body> {
        let hull = hull_of_many(&border, FLAT * self.grid.cell)?;
        let lie = self.clearance.lie(&hull);
        Some(Body { cells, border, hull, lie })
    }

    /// The centres of the faces between a body and everything else.
    fn border(&self, cells: &[u32]) -> Vec<Point3<f64>> {
        let strides = self.grid.strides();
        let mut border = Vec::new();
        for &cell in cells {
            let (own, at) = (self.owner[cell as usize], self.center(cell));
            for axis in 0..3 {
                for (beside, side) in [(cell as usize - strides[axis], -0.5), (cell as usize + strides[axis], 0.5)] {
                    if self.owner[beside] != own {
                        let mut face = at;
                        face[axis] += side * self.grid.cell;
                        border.push(face);
                    }
                }
            }
        }
        border
    }

    /// The plane, as normal and position, that leaves the least volume in the hulls of both sides.
    fn best_cut(&self, body: &Body) -> Option<(Vector3<f64>, f64)> {
        let some = |points: &'_ [Point3<f64>]| -> Vec<Point3<f64>> {
            points.iter().step_by(points.len().div_ceil(SAMPLES).max(1)).copied().collect()
        };
        let samples = [some(&body.hull.vertices), some(&body.border)].concat();
        let notch = self.grid.center(self.grid.coords(body.lie.cell));
        let mut cuts = Vec::new();
        for normal in directions(&samples) {
            let along = |p: &Point3<f64>| normal.dot(&p.coords);
            let (low, high) =
                samples.iter().map(along).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            let regular = (1..=CUTS).map(|n| low + (high - low) * n as f64 / (CUTS + 1) as f64);
            let at_notch = [-1.0, 0.0, 1.0].map(|side| along(&notch) + side * body.lie.depth);
            let within = |position: &f64| *position > low + self.grid.cell && *position < high - self.grid.cell;
            cuts.extend(regular.chain(at_notch).filter(within).map(|position| (normal, position)));
        }
        // The border where the plane cuts it belongs to both sides: without it, the samples leave a gap beside the plane,
        // and cutting thin slices would seem to save volume.
        let section = |normal: &Vector3<f64>, position: f64| -> Vec<Point3<f64>> {
            let onto_plane = |p: &Point3<f64>| {
                let off = normal.dot(&p.coords) - position;
                (off.abs() <= NEAR * self.grid.cell).then(|| p - normal * off)
            };
            some(&body.border.iter().filter_map(onto_plane).collect::<Vec<_>>())
        };
        let whole = body.hull.volume();
        let cost = |(normal, position): &(Vector3<f64>, f64)| {
            let section = section(normal, *position);
            let (mut left, mut right): (Vec<_>, Vec<_>) =
                samples.iter().partition(|p| normal.dot(&p.coords) < *position);
            left.extend_from_slice(&section);
            right.extend(section);
            let volume = |points: &[Point3<f64>]| Hull::of(points).map_or(0.0, |hull| hull.volume());
            let [left, right] = [volume(&left), volume(&right)];
            left + right + BALANCE * whole * (left - right).abs() / (left + right).max(f64::MIN_POSITIVE)
        };
        let costs: Vec<f64> = cuts.par_iter().map(cost).collect();
        let best = (0..cuts.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
        Some(cuts[best])
    }

    /// Joins pairs of bodies whose common hull does not reach too far beyond the object, those with the smallest hull
    /// first.
    fn join(&mut self) {
        let mut bodies: Vec<Option<Body>> = self.bodies.drain(..).map(Some).collect();
        let all: Vec<(usize, usize)> = (0..bodies.len()).flat_map(|b| (0..b).map(move |a| (a, b))).collect();
        let mut fitting = self.joints(&bodies, all);
        loop {
            let best = fitting.iter().min_by(|x, y| x.volume.total_cmp(&y.volume).then(x.pair.cmp(&y.pair)));
            let Some((a, b)) = best.map(|joint| joint.pair) else { break };
            let (Some(one), Some(other)) = (bodies[a].take(), bodies[b].take()) else { break };
            let place = fitting.iter().position(|joint| joint.pair == (a, b)).expect("it is the best");
            let Joint { hull, lie, .. } = fitting.swap_remove(place);
            fitting.retain(|joint| ![joint.pair.0, joint.pair.1].iter().any(|n| [a, b].contains(n)));
            let (cells, border) = ([one.cells, other.cells].concat(), [one.border, other.border].concat());
            bodies[a] = Some(Body { cells, border, hull, lie });
            let beside = (0..bodies.len()).filter(|n| *n != a && bodies[*n].is_some()).map(|n| (a.min(n), a.max(n)));
            fitting.extend(self.joints(&bodies, beside.collect()));
        }
        self.bodies = bodies.into_iter().flatten().collect();
    }

    /// The pairs that can be joined.
    fn joints(&self, bodies: &[Option<Body>], pairs: Vec<(usize, usize)>) -> Vec<Joint> {
        let joint = |pair: (usize, usize)| {
            let (one, other) = (bodies[pair.0].as_ref()?, bodies[pair.1].as_ref()?);
            if !self.touch(one, other) {
                return None;
            }
            let points = [one.hull.vertices.as_slice(), &other.hull.vertices].concat();
            let hull = Hull::of(&points)?;
            let lie = self.clearance.lie(&hull);
            (lie.depth <= self.tolerance).then(|| Joint { pair, volume: hull.volume(), hull, lie })
        };
        pairs.into_par_iter().filter_map(joint).collect()
    }

    fn touch(&self, one: &Body, other: &Body) -> bool {
        let ([low, high], [others_low, others_high]) = (one.hull.extent(), other.hull.extent());
        let gap = self.grid.cell;
        (0..3).all(|axis| low[axis] <= others_high[axis] + gap && others_low[axis] <= high[axis] + gap)
    }
}

/// Two bodies as one.
struct Joint {
    pair: (usize, usize),
    volume: f64,
    hull: Hull,
    lie: Lie,
}

/// The world's axes, and the body's own as far as they differ.
fn directions(points: &[Point3<f64>]) -> Vec<Vector3<f64>> {
    /// Cosine of 10 degrees.
    const SAME: f64 = 0.985;
    let middle = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len() as f64;
    let spread: Matrix3<f64> = points.iter().map(|p| (p.coords - middle) * (p.coords - middle).transpose()).sum();
    let own = spread.symmetric_eigen().eigenvectors;
    let mut directions = vec![Vector3::x(), Vector3::y(), Vector3::z()];
    for axis in own.column_iter() {
        if directions.iter().all(|known| known.dot(&axis).abs() < SAME) {
            directions.push(axis.into_owned());
        }
    }
    directions
}

/// The hull of many points: those within the hull of a sample, or outside it by less than `error`, are left out before
/// the others' is computed.
fn hull_of_many(points: &[Point3<f64>], error: f64) -> Option<Hull> {
    if points.len() <= SAMPLES {
        return Hull::of(points);
    }
    let sample: Vec<Point3<f64>> = points.iter().step_by(points.len().div_ceil(SAMPLES)).copied().collect();
    let Some(inner) = Hull::of(&sample) else { return Hull::of(points) };
    let planes = inner.planes();
    let outside = points.iter().filter(|p| planes.iter().any(|(normal, d)| normal.dot(&p.coords) > d + error));
    Hull::of(&outside.chain(&inner.vertices).copied().collect::<Vec<_>>())
}
