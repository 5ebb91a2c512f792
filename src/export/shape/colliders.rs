//! The object's shape as colliders, which are convex: simulators use the convex hull of any mesh, and the hull of a
//! mug is solid.
//!
//! A hull reaches beyond the object by the distance from the object to the farthest place within the hull (its
//! [`Overreach`]). Of each part, the component whose hull reaches farthest is cut by the plane that leaves the least volume in the
//! hulls of both sides, until no hull reaches farther than a tolerance. Then neighbours are joined if their common hull
//! does not reach farther either. A hole stays open if a ball with twice the tolerance as its radius fits through it.
//! Finally, the surface of every component is moved inward until its hull has the component's volume.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::Solid;
use super::clearance::{Clearance, Overreach};
use crate::numeric::hull::Hull;
use crate::numeric::{evenly, scatter};
use crate::parallel;
use crate::parts::{Grid, OUTSIDE, blur};

/// How far a hull may reach beyond the object, as a share of the object's diagonal, and in cells at least: below that,
/// a hull only rounds off the cells' steps.
const TOLERANCE: f64 = 0.009;
const LEAST_CELLS: f64 = 2.0;
/// A part with this many colliders is not cut further: with more, simulators become slow.
const MOST_COLLIDERS: usize = 32;
/// Positions at which a plane of each direction is tried.
const CUTS: usize = 8;
/// Cost of cuts whose sides differ in size, as a share of the volume: among nearly equal ones, the middle is taken.
const BALANCE: f64 = 0.02;
/// Points that stand for a component while cuts are compared.
const SAMPLES: usize = 200;
/// Points of the border that are this close to a cut, in cells, stand for its section. Faces across an axis lie half a cell
/// apart from those along it.
const NEAR: f64 = 0.75;
/// How far a hull's surface may be moved inward, in cells, and in how many halvings the distance is found.
const INWARD_CELLS: f64 = 0.75;
const HALVINGS: usize = 6;
/// Slope of the blurred cells, per cell, above which a place is within a cell or so of the object's surface.
const NEAR_SURFACE: f64 = 0.1;
/// Points that are outside a face by less than this, in cells, lie in it.
const FLAT: f64 = 1e-3;
/// Components with a smaller share of their part's cells are crumbs, which are left out.
const CRUMB: f64 = 5e-4;

/// A convex collision shape of one part.
#[derive(Debug, Clone, PartialEq)]
pub struct Collider {
    /// Id of the part.
    pub part: u32,
    /// Its own name: that of the part, and its index among the part's colliders.
    pub name: String,
    /// World frame, m.
    pub vertices: Vec<Point3<f64>>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// The colliders of every part, ordered by part. `names` are those of the parts, by id.
pub fn colliders(solid: &Solid, names: &BTreeMap<u32, String>, meters_per_unit: f64) -> Vec<Collider> {
    let clearance = Clearance::of(solid);
    let blurred = blur(&solid.grid, &solid.mask(None));
    let tolerance = (TOLERANCE * diagonal(solid)).max(LEAST_CELLS * solid.grid.cell);
    let of_part = |&part: &u32| {
        let hulls = Decomposition::new(solid, part, &clearance, &blurred, tolerance).hulls();
        hulls.into_iter().enumerate().map(move |(index, hull)| Collider {
            part,
            name: format!("{}_{index}", names.get(&part).map_or("part", String::as_str)),
            vertices: hull.vertices.iter().map(|v| v * meters_per_unit).collect(),
            triangles: hull.triangles,
        })
    };
    parallel::flat_map(&solid.parts(), of_part)
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

/// A connected component of cells.
struct Component {
    cells: Vec<u32>,
    border: Vec<Face>,
    hull: Hull,
    overreach: Overreach,
}

/// A face between a component's cell and another cell.
#[derive(Clone, Copy)]
struct Face {
    center: Point3<f64>,
    /// Unit vector out of the object; zero deep inside it, where the component borders on another.
    outward: Vector3<f64>,
}

struct Decomposition<'a> {
    grid: Grid,
    clearance: &'a Clearance,
    /// Per cell: the share of the object in the cells around it.
    blurred: &'a [f32],
    tolerance: f64,
    crumb: usize,
    /// Per cell: its component, or [`NO_COMPONENT`].
    owner: Vec<u32>,
    /// Number of components that have been created.
    named: u32,
    components: Vec<Component>,
}

const NO_COMPONENT: u32 = u32::MAX;

impl<'a> Decomposition<'a> {
    fn new(solid: &Solid, part: u32, clearance: &'a Clearance, blurred: &'a [f32], tolerance: f64) -> Self {
        let cells: Vec<u32> = (0..solid.part.len() as u32).filter(|i| solid.part[*i as usize] == part).collect();
        let crumb = (CRUMB * cells.len() as f64) as usize;
        let owner = vec![NO_COMPONENT; solid.part.len()];
        let grid = solid.grid;
        let mut new = Self { grid, clearance, blurred, tolerance, crumb, owner, named: 0, components: Vec::new() };
        new.add(&cells);
        new
    }

    fn hulls(mut self) -> Vec<Hull> {
        while self.components.len() < MOST_COLLIDERS {
            let deepest = (0..self.components.len()).max_by(|a, b| {
                self.components[*a].overreach.depth.total_cmp(&self.components[*b].overreach.depth).then(b.cmp(a))
            });
            let Some(deepest) = deepest.filter(|n| self.components[*n].overreach.depth > self.tolerance) else { break };
            let component = self.components.swap_remove(deepest);
            let Some((normal, position)) = self.best_cut(&component) else {
                // It cannot be cut: it stays as it is, and counts as if its hull did not reach beyond the object.
                self.components.push(Component { overreach: Overreach { depth: 0.0, cell: 0 }, ..component });
                continue;
            };
            let (left, right): (Vec<u32>, Vec<u32>) =
                component.cells.iter().partition(|cell| normal.dot(&self.center(**cell).coords) < position);
            self.add(&left);
            self.add(&right);
        }
        self.join();
        let error = 0.25 * self.grid.cell;
        parallel::flat_map(&self.components, |component| self.fitted(component)?.simple(error))
    }

    /// The hull of a component with its surface moved inward until the hull has the component's volume, but not by more than
    /// [`INWARD_CELLS`]. Without that, hulls are too large: they reach to the outermost steps of the cells and dents of
    /// the surface, and over its hollows.
    fn fitted(&self, component: &Component) -> Option<Hull> {
        let volume = component.cells.len() as f64 * self.grid.cell_volume();
        let moved = |inward: f64| {
            let points: Vec<Point3<f64>> =
                component.border.iter().map(|face| face.center - face.outward * inward).collect();
            hull_of_many(&points, FLAT * self.grid.cell)
        };
        let (mut least, mut most) = (0.0, INWARD_CELLS * self.grid.cell);
        if component.hull.volume() <= volume {
            return moved(least);
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (least + most);
            let is_too_large = moved(middle).is_some_and(|hull| hull.volume() > volume);
            *(if is_too_large { &mut least } else { &mut most }) = middle;
        }
        moved(least)
    }

    fn center(&self, cell: u32) -> Point3<f64> {
        self.grid.center(self.grid.coords(cell as usize))
    }

    /// Adds the connected components of some cells.
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
            let mut component = vec![seed];
            let mut next = 0;
            while let Some(&cell) = component.get(next) {
                next += 1;
                for n in self.grid.neighbours(cell as usize) {
                    if self.owner[n] == fresh {
                        self.owner[n] = name;
                        component.push(n as u32);
                    }
                }
            }
            connected.push(component);
        }
        for cells in connected.into_iter().filter(|cells| cells.len() > self.crumb) {
            let border = self.border(&cells);
            self.components.extend(self.component(cells, border));
        }
    }

    fn component(&self, cells: Vec<u32>, border: Vec<Face>) -> Option<Component> {
        let points: Vec<Point3<f64>> = border.iter().map(|face| face.center).collect();
        let hull = hull_of_many(&points, FLAT * self.grid.cell)?;
        let overreach = self.clearance.overreach(&hull);
        Some(Component { cells, border, hull, overreach })
    }

    /// The faces between a component and everything else.
    fn border(&self, cells: &[u32]) -> Vec<Face> {
        let strides = self.grid.strides();
        let mut border = Vec::new();
        for &cell in cells {
            let (own, at) = (self.owner[cell as usize], self.center(cell));
            for axis in 0..3 {
                for (beside, side) in [(cell as usize - strides[axis], -0.5), (cell as usize + strides[axis], 0.5)] {
                    if self.owner[beside] != own {
                        let mut center = at;
                        center[axis] += side * self.grid.cell;
                        border.push(Face { center, outward: self.outward(cell as usize, beside) });
                    }
                }
            }
        }
        border
    }

    /// The direction out of the object at the face between two cells; zero deep inside.
    fn outward(&self, one: usize, other: usize) -> Vector3<f64> {
        let rise = |i: usize, stride: usize| f64::from(self.blurred[i - stride]) - f64::from(self.blurred[i + stride]);
        let strides = self.grid.strides();
        let slope = Vector3::from(strides.map(|stride| 0.25 * (rise(one, stride) + rise(other, stride))));
        slope.try_normalize(NEAR_SURFACE).unwrap_or_else(Vector3::zeros)
    }

    /// The plane, as normal and position, that leaves the least volume in the hulls of both sides.
    fn best_cut(&self, component: &Component) -> Option<(Vector3<f64>, f64)> {
        let border: Vec<Point3<f64>> = component.border.iter().map(|face| face.center).collect();
        let samples: Vec<Point3<f64>> =
            evenly(&component.hull.vertices, SAMPLES).chain(evenly(&border, SAMPLES)).copied().collect();
        let notch = self.grid.center(self.grid.coords(component.overreach.cell));
        let (mut cuts, mut through_notch) = (Vec::new(), Vec::new());
        for normal in directions(&samples) {
            let along = |p: &Point3<f64>| normal.dot(&p.coords);
            let (low, high) =
                samples.iter().map(along).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            let regular = (1..=CUTS).map(|n| low + (high - low) * n as f64 / (CUTS + 1) as f64);
            let at_notch = [-1.0, 0.0, 1.0].map(|side| along(&notch) + side * component.overreach.depth);
            let within = |position: &f64| *position > low + self.grid.cell && *position < high - self.grid.cell;
            through_notch.extend(Some(along(&notch)).filter(within).map(|position| (normal, position)));
            cuts.extend(regular.chain(at_notch).filter(within).map(|position| (normal, position)));
        }
        // The border where the plane cuts it belongs to both sides: without it, the samples leave a gap beside the plane,
        // and cutting thin slices would seem to save volume.
        let section = |normal: &Vector3<f64>, position: f64| -> Vec<Point3<f64>> {
            let onto_plane = |p: &Point3<f64>| {
                let off = normal.dot(&p.coords) - position;
                (off.abs() <= NEAR * self.grid.cell).then(|| p - normal * off)
            };
            evenly(&border.iter().filter_map(onto_plane).collect::<Vec<_>>(), SAMPLES).copied().collect()
        };
        let whole = component.hull.volume();
        let volume = |points: &[Point3<f64>]| Hull::of(points).map_or(0.0, |hull| hull.volume());
        let cost = |(normal, position): &(Vector3<f64>, f64)| {
            let section = section(normal, *position);
            let (mut left, mut right): (Vec<_>, Vec<_>) =
                samples.iter().partition(|p| normal.dot(&p.coords) < *position);
            left.extend_from_slice(&section);
            right.extend(section);
            let [left, right] = [volume(&left), volume(&right)];
            left + right + BALANCE * whole * (left - right).abs() / (left + right).max(f64::MIN_POSITIVE)
        };
        let costs: Vec<f64> = parallel::map(&cuts, cost);
        let best = (0..cuts.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
        // Halving a ring saves nothing, because the hulls of the halves fill the hole too; quartering it does.
        let pairs: Vec<[usize; 2]> = (0..through_notch.len()).flat_map(|b| (0..b).map(move |a| [a, b])).collect();
        let cost_of_both = |pair: &[usize; 2]| {
            let cuts = pair.map(|n| through_notch[n]);
            let mut quarters: [Vec<Point3<f64>>; 4] = Default::default();
            let side = |n: usize, p: &Point3<f64>| usize::from(cuts[n].0.dot(&p.coords) >= cuts[n].1);
            samples.iter().for_each(|p| quarters[side(0, p) + 2 * side(1, p)].push(*p));
            for p in section(&cuts[0].0, cuts[0].1) {
                (0..2).for_each(|first| quarters[first + 2 * side(1, &p)].push(p));
            }
            for p in section(&cuts[1].0, cuts[1].1) {
                (0..2).for_each(|second| quarters[side(0, &p) + 2 * second].push(p));
            }
            quarters.iter().map(|points| volume(points)).sum::<f64>()
        };
        let costs_of_both: Vec<f64> = parallel::map(&pairs, cost_of_both);
        let cross = (0..pairs.len()).min_by(|a, b| costs_of_both[*a].total_cmp(&costs_of_both[*b]));
        let is_better = |cross: &usize| 0.5 * (whole - costs_of_both[*cross]) > whole - costs[best];
        Some(cross.filter(is_better).map_or(cuts[best], |cross| through_notch[pairs[cross][0]]))
    }

    /// Joins pairs of components whose common hull does not reach too far beyond the object, those with the smallest hull
    /// first.
    fn join(&mut self) {
        let mut components: Vec<Option<Component>> = self.components.drain(..).map(Some).collect();
        let all: Vec<(usize, usize)> = (0..components.len()).flat_map(|b| (0..b).map(move |a| (a, b))).collect();
        let mut fitting = self.joints(&components, all);
        loop {
            let best = fitting.iter().min_by(|x, y| x.volume.total_cmp(&y.volume).then(x.pair.cmp(&y.pair)));
            let Some((a, b)) = best.map(|joint| joint.pair) else { break };
            let (Some(one), Some(other)) = (components[a].take(), components[b].take()) else { break };
            let place = fitting.iter().position(|joint| joint.pair == (a, b)).expect("it is the best");
            let Joint { hull, overreach, .. } = fitting.swap_remove(place);
            fitting.retain(|joint| ![joint.pair.0, joint.pair.1].iter().any(|n| [a, b].contains(n)));
            let (cells, border) = ([one.cells, other.cells].concat(), [one.border, other.border].concat());
            components[a] = Some(Component { cells, border, hull, overreach });
            let beside =
                (0..components.len()).filter(|n| *n != a && components[*n].is_some()).map(|n| (a.min(n), a.max(n)));
            fitting.extend(self.joints(&components, beside.collect()));
        }
        self.components = components.into_iter().flatten().collect();
    }

    /// The pairs that can be joined.
    fn joints(&self, components: &[Option<Component>], pairs: Vec<(usize, usize)>) -> Vec<Joint> {
        let joint = |&pair: &(usize, usize)| {
            let (one, other) = (components[pair.0].as_ref()?, components[pair.1].as_ref()?);
            if !self.touch(one, other) {
                return None;
            }
            let points = [one.hull.vertices.as_slice(), &other.hull.vertices].concat();
            let hull = Hull::of(&points)?;
            let overreach = self.clearance.overreach(&hull);
            (overreach.depth <= self.tolerance).then(|| Joint { pair, volume: hull.volume(), hull, overreach })
        };
        parallel::flat_map(&pairs, joint)
    }

    fn touch(&self, one: &Component, other: &Component) -> bool {
        let ([low, high], [others_low, others_high]) = (one.hull.extent(), other.hull.extent());
        let gap = self.grid.cell;
        (0..3).all(|axis| low[axis] <= others_high[axis] + gap && others_low[axis] <= high[axis] + gap)
    }
}

/// Two components as one.
struct Joint {
    pair: (usize, usize),
    volume: f64,
    hull: Hull,
    overreach: Overreach,
}

/// The world's axes, and the component's own as far as they differ.
fn directions(points: &[Point3<f64>]) -> Vec<Vector3<f64>> {
    /// Cosine of 10 degrees.
    const SAME: f64 = 0.985;
    let (_, spread) = scatter(points.iter().map(|point| &point.coords));
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
/// the hull of the others is computed.
fn hull_of_many(points: &[Point3<f64>], error: f64) -> Option<Hull> {
    if points.len() <= SAMPLES {
        return Hull::of(points);
    }
    let sample: Vec<Point3<f64>> = evenly(points, SAMPLES).copied().collect();
    let Some(inner) = Hull::of(&sample) else { return Hull::of(points) };
    let planes = inner.planes();
    let outside = points.iter().filter(|p| planes.iter().any(|(normal, d)| normal.dot(&p.coords) > d + error));
    Hull::of(&outside.chain(&inner.vertices).copied().collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solid(side: usize, is_inside: impl Fn(Vector3<f64>) -> bool) -> Solid {
        let grid = Grid { origin: Point3::origin(), cell: 1.0, dims: [side; 3] };
        let middle = grid.middle();
        let cell = |i: usize| if is_inside(grid.center(grid.coords(i)) - middle) { 0 } else { OUTSIDE };
        Solid { grid, part: (0..grid.len()).map(cell).collect() }
    }

    fn cells(solid: &Solid) -> f64 {
        solid.part.iter().filter(|part| **part != OUTSIDE).count() as f64
    }

    fn hulls(solid: &Solid) -> Vec<Hull> {
        colliders(solid, &BTreeMap::new(), 1.0)
            .into_iter()
            .map(|c| Hull { vertices: c.vertices, triangles: c.triangles })
            .collect()
    }

    /// A wall of 4 cells around a hole of 56: halves of a ring have hulls as large as the ring's.
    #[test]
    fn a_ring_stays_open_and_keeps_its_volume() {
        let ring = solid(80, |p| (28.0..32.0).contains(&p.xy().norm()) && p.z.abs() < 6.0);
        let hulls = hulls(&ring);
        assert!((8..=16).contains(&hulls.len()), "{} colliders", hulls.len());
        // The tolerance of two cells, and half a cell of the steps.
        let open = ring.grid.middle() + Vector3::new(25.5, 0.0, 0.0);
        for turn in 0..36 {
            let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), f64::from(turn).to_radians() * 10.0);
            let place = ring.grid.middle() + turn * (open - ring.grid.middle());
            let covers = |hull: &Hull| hull.bounds().iter().all(|(n, d)| n.dot(&place.coords) <= *d);
            assert!(!hulls.iter().any(covers), "{place}");
        }
        // The colliders hardly overlap.
        let volume: f64 = hulls.iter().map(Hull::volume).sum();
        assert!((volume / cells(&ring) - 1.0).abs() < 0.05, "{volume} of {}", cells(&ring));
    }

    /// A bar that is askew to the cells: the hull of its steps is a fifth too large.
    #[test]
    fn the_steps_of_the_cells_add_no_volume() {
        let [along, across] = [Vector3::new(1.0, 0.2, 0.1).normalize(), Vector3::new(-0.2, 1.0, 0.0).normalize()];
        let third = along.cross(&across);
        let bar = solid(90, |p| p.dot(&along).abs() < 35.0 && p.dot(&across).abs() < 4.0 && p.dot(&third).abs() < 4.0);
        let hulls = hulls(&bar);
        let volume: f64 = hulls.iter().map(Hull::volume).sum();
        assert_eq!(hulls.len(), 1);
        assert!((volume / cells(&bar) - 1.0).abs() < 0.05, "{volume} of {}", cells(&bar));
    }
}
