//! Tells apart things that touch: between them, their outline, seen from above, has a waist.
//!
//! A can touches a mug in one place, and from there both soon become wider. A handle is nowhere wider than where it ends, and the neck of a
//! spatula is long. The depth of a place in the outline is its distance from the border. Things are told apart where the outline is a waist:
//! from there, both become [`DEEPER`] within [`MOST_LENGTH`], relative to the depth of the thinner.
//!
//! The outline is flooded from its deepest places to its border. The basins of the flood join where they meet, except at a waist. Holes
//! count as filled: those of a plain board that has few Gaussians would be waists.
//!
//! Things that touch along a whole side, such as two boxes, stay one: nothing tells them from the head of a hammer and its handle.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use super::cells::Cells;
use super::foot::{FOOT_CELL, cover};
use super::{Cluster, Region, cell};
use crate::numeric::forest::Forest;
use crate::numeric::nearest::Nearest;

/// Gaps in the outline of up to twice this many cells are closed.
const GAP: usize = 1;
/// How much deeper than a waist the things at its ends are.
const DEEPER: f64 = 1.5;
/// Most way from one end to the other, relative to the depth of the thinner of the two things: what it is, by geometry, where two circles meet
/// at the deepest waist that counts. Of scans for fitting that were laid side by side at random, 60 % touch at such a waist.
const MOST_LENGTH: f64 = 1.5;
/// Least height of a thing, in thicknesses of the surface, up to which all things are cut off: where a low thing is thin, little of it may be
/// left. Tools that lie on a table are 4 high (a hammer, a hacksaw, between whose frame and grip there is such a waist), a bowl 7.
const LEAST_HEIGHT: f64 = 6.0;
/// Least depth of a thing in cells: one of 25 mm in width, if the cameras are a metre away.
const LEAST_DEPTH: f64 = 5.0;

/// The things of a cluster: several if there are waists, and what is between them is high enough and could stand by itself. What is not, and
/// what no waist but a gap divides from the others, joins the nearest.
pub(super) fn apart(region: &Region, cluster: Cluster) -> Vec<Cluster> {
    let mut covered = BTreeSet::new();
    cluster.indices.iter().for_each(|i| cover(region, *i, &mut covered));
    let outline = Outline::of(&covered);
    let mut pieces: BTreeMap<usize, Cluster> = BTreeMap::new();
    let (basins, touching) = outline.basins();
    for &i in &cluster.indices {
        let at = outline.cells.index(cell(&region.places[&i].along, FOOT_CELL));
        pieces.entry(basins[at.expect("a Gaussian covers its own cell")]).or_default().add(region, i);
    }
    let is_thing = |(basin, piece): &(usize, Cluster)| {
        let (_, high) = region.heights(piece);
        touching.contains(basin) && region.could_stand(piece) && high >= LEAST_HEIGHT * region.surface.thickness
    };
    let (things, rest): (Vec<_>, Vec<_>) = pieces.into_iter().partition(is_thing);
    let [mut things, rest]: [Vec<Cluster>; 2] =
        [things, rest].map(|of| of.into_iter().map(|(_, piece)| piece).collect());
    if things.len() < 2 {
        return vec![cluster];
    }
    let thing_of: Vec<(usize, usize)> =
        (0..).zip(&things).flat_map(|(thing, of)| of.indices.iter().map(move |i| (*i, thing))).collect();
    let nearest = Nearest::new(thing_of.iter().map(|(i, _)| region.point(*i)));
    for piece in rest {
        let beside = piece.indices.iter().map(|i| nearest.find(region.point(*i), 1)[0]);
        let (_, closest) =
            beside.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).expect("a piece has Gaussians");
        let thing = &mut things[thing_of[closest as usize].1];
        piece.indices.iter().for_each(|i| thing.add(region, *i));
    }
    things.iter_mut().for_each(|thing| thing.indices.sort_unstable());
    things
}

/// Cells that something covers, seen from above.
struct Outline {
    cells: Cells,
    /// By cell, the squared distance to the nearest cell outside, in cells; 0 outside.
    depth: Vec<u32>,
}

impl Outline {
    fn of(covered: &BTreeSet<[i64; 2]>) -> Self {
        let mut cells = Cells::new(covered, GAP);
        cells.close(GAP);
        let outside = Nearest::new((0..cells.count()).filter(|at| !cells.holds(*at)).map(|at| point(&cells, at)));
        let depth = |at: usize| if cells.holds(at) { outside.find(point(&cells, at), 1)[0].0 as u32 } else { 0 };
        let depth = (0..cells.count()).map(depth).collect();
        Self { cells, depth }
    }

    /// By cell, the basin that it is in, by the first of its cells; and the basins that touch another at a waist.
    fn basins(&self) -> (Vec<usize>, BTreeSet<usize>) {
        let mut order: Vec<usize> = (0..self.depth.len()).filter(|at| self.depth[*at] > 0).collect();
        order.sort_by_key(|at| (Reverse(self.depth[*at]), *at));
        let mut flood = Flood {
            outline: self,
            is_reached: vec![false; self.depth.len()],
            basins: Forest::of(self.depth.len()),
            deepest: self.depth.clone(),
            waists: BTreeSet::new(),
        };
        order.into_iter().for_each(|at| flood.reach(at));
        let basin_of = (0..self.depth.len()).map(|at| flood.basins.root(at).0).collect();
        (basin_of, flood.waists.into_iter().flatten().collect())
    }
}

/// A flood that has come to a depth. Basins are named by one of their cells.
struct Flood<'a> {
    outline: &'a Outline,
    is_reached: Vec<bool>,
    basins: Forest,
    /// By basin, the squared depth of its deepest cell.
    deepest: Vec<u32>,
    /// Pairs of basins that touch.
    waists: BTreeSet<[usize; 2]>,
}

impl Flood<'_> {
    /// Adds a cell to the basin of the deepest cell beside it, and joins the basins that meet there, except at a waist.
    fn reach(&mut self, at: usize) {
        self.is_reached[at] = true;
        let depth = &self.outline.depth;
        let beside = self.outline.cells.within(at, 1).map(|(beside, _)| beside);
        let mut reached: Vec<usize> = beside.filter(|beside| *beside != at && self.is_reached[*beside]).collect();
        reached.sort_by_key(|beside| (Reverse(depth[*beside]), *beside));
        let mut met: Vec<usize> = reached.into_iter().map(|beside| self.basins.root(beside).0).collect();
        met.dedup();
        let mut met = met.into_iter();
        let Some(highest) = met.next() else { return };
        let mut basin = self.join(at, highest);
        for other in met {
            let other = self.basins.root(other).0;
            let pair = [basin.min(other), basin.max(other)];
            if other != basin && !self.waists.contains(&pair) {
                if self.is_waist(at, pair) {
                    self.waists.insert(pair);
                } else {
                    basin = self.join(basin, other);
                }
            }
        }
    }

    /// Joins two basins.
    fn join(&mut self, a: usize, b: usize) -> usize {
        let deepest = self.deepest[a].max(self.deepest[b]);
        self.basins.join(a, b, false);
        let joined = self.basins.root(a).0;
        self.deepest[joined] = deepest;
        let renamed = |of: usize| if of == a || of == b { joined } else { of };
        let waists = self.waists.iter().map(|pair| pair.map(renamed));
        self.waists = waists.map(|[a, b]| [a.min(b), a.max(b)]).collect();
        joined
    }

    /// Whether two basins that meet at a cell are things that touch.
    fn is_waist(&self, at: usize, pair: [usize; 2]) -> bool {
        let waist = f64::from(self.outline.depth[at]).sqrt();
        let thinner = pair.map(|of| f64::from(self.deepest[of]).sqrt()).into_iter().fold(f64::INFINITY, f64::min);
        thinner >= LEAST_DEPTH && thinner >= DEEPER * waist && {
            let ends = pair.map(|of| self.end(at, of, DEEPER * waist, MOST_LENGTH * thinner));
            ends.into_iter().sum::<f64>() <= MOST_LENGTH * thinner
        }
    }

    /// The distance from a cell to where a basin has this depth; infinite if it is more than `most`.
    fn end(&self, at: usize, basin: usize, depth: f64, most: f64) -> f64 {
        let near = self.outline.cells.within(at, most as usize);
        let is_end = |beside: &(usize, f64)| {
            self.is_reached[beside.0]
                && f64::from(self.outline.depth[beside.0]).sqrt() >= depth
                && self.basins.root(beside.0).0 == basin
        };
        near.filter(is_end).map(|(_, distance)| distance).fold(f64::INFINITY, f64::min)
    }
}

/// A cell's place among the others.
fn point(cells: &Cells, at: usize) -> [f32; 3] {
    let [x, y] = cells.place(at);
    [x as f32, y as f32, 0.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How many things an outline is cut into: of the cells from -80 to 80 in which one of the shapes lies.
    fn things(shapes: &[&dyn Fn(f64, f64) -> bool]) -> usize {
        let all = (-80..80).flat_map(|x| (-80..80).map(move |y| [x, y]));
        let covered = all.filter(|[x, y]| shapes.iter().any(|holds| holds(*x as f64 + 0.5, *y as f64 + 0.5))).collect();
        let outline = Outline::of(&covered);
        let inside = outline.basins().0.into_iter().zip(&outline.depth).filter(|(_, depth)| **depth > 0);
        inside.map(|(basin, _)| basin).collect::<BTreeSet<usize>>().len()
    }

    fn disc(center: [f64; 2], radius: f64) -> impl Fn(f64, f64) -> bool {
        move |x, y| (x - center[0]).hypot(y - center[1]) < radius
    }

    fn bar(low: [f64; 2], high: [f64; 2]) -> impl Fn(f64, f64) -> bool {
        move |x, y| (low[0]..high[0]).contains(&x) && (low[1]..high[1]).contains(&y)
    }

    #[test]
    fn what_touches_in_one_place_is_told_apart() {
        let (can, mug) = (disc([-15.0, 0.0], 15.0), disc([20.0, 3.0], 20.0));
        assert_eq!(things(&[&can, &mug]), 2, "two round things");
        let handle = bar([38.0, 0.0], [50.0, 5.0]);
        assert_eq!(things(&[&can, &mug, &handle]), 2, "one with a handle");
        let crate_beside = bar([-70.0, -40.0], [-30.0, 30.0]);
        assert_eq!(things(&[&can, &mug, &crate_beside]), 3, "the side of a box, too");
        let (box_below, box_above) = (bar([-40.0, -40.0], [2.0, 2.0]), bar([0.0, 0.0], [50.0, 30.0]));
        assert_eq!(things(&[&box_below, &box_above]), 2, "corner to corner");
    }

    #[test]
    fn what_is_narrow_somewhere_stays_one() {
        let (handle, head) = (bar([-60.0, -6.0], [40.0, 6.0]), bar([36.0, -30.0], [48.0, 30.0]));
        assert_eq!(things(&[&handle, &head]), 1, "a hammer");
        let (blade, neck, grip) =
            (bar([10.0, -30.0], [60.0, 30.0]), bar([-40.0, -4.0], [12.0, 4.0]), bar([-75.0, -9.0], [-40.0, 9.0]));
        assert_eq!(things(&[&blade, &neck, &grip]), 1, "a spatula");
        let (round, handle) = (disc([0.0, 0.0], 40.0), bar([38.0, -5.0], [60.0, 5.0]));
        assert_eq!(things(&[&round, &handle]), 1, "a pan");
        let frame =
            |x: f64, y: f64| bar([-60.0, -30.0], [60.0, 30.0])(x, y) && !bar([-52.0, -22.0], [52.0, 22.0])(x, y);
        let grip = bar([58.0, -30.0], [75.0, -14.0]);
        assert_eq!(things(&[&frame, &grip]), 1, "a saw");
        let crumbs = disc([0.0, 0.0], 4.0);
        let more = disc([8.0, 0.0], 4.5);
        assert_eq!(things(&[&crumbs, &more]), 1, "too thin to tell");
    }
}
