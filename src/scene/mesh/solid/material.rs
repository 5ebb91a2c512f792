//! Where the material is that a surface bounds: behind its outside, not in its voids.

use nalgebra::Point3;

use super::crossings::crossings;
use super::moments::Moments;
use super::nesting::Nesting;
use super::oriented::Oriented;
use super::quadrature::{INTEGRALS, Integrals, Sample, integrate};
use super::thickness::thickness;
use super::tree::Tree;
use super::winding::Winding;
use super::{Doubt, Kind};
use crate::numeric::forest::Forest;
use crate::numeric::hull::Hull;
use crate::units::Estimate;

/// A place belongs to the material if the surface winds around it more often than this: surely, probably, possibly.
const LEVELS: [f64; INTEGRALS] = [0.75, PROBABLY, 0.25];
/// See [`LEVELS`].
pub const PROBABLY: f64 = 0.5;
/// A surface is a sheet if less than this share of the space that it may enclose is surely enclosed.
const SHEET: f64 = 0.1;
/// A surface that is not closed has mere holes if more than this share is.
const HOLES: f64 = 0.9;
/// Material is a wall if its volume differs from half its surface times its thickness by at most this share,
const EVEN: f64 = 0.3;
/// 90 % of it are at most this many times as thick, or as thin, as the middle,
const ALIKE: f64 = 3.0;
/// it fills less than this share of its convex hull,
const HOLLOW: f64 = 0.5;
/// and it is thinner than this share of the cube root of the hull's volume.
const THIN: f64 = 0.15;

/// The material that a surface bounds, in the frame of the measurement.
pub struct Material {
    pub volume: Estimate,
    /// With the middle volume.
    pub moments: Moments,
    pub kind: Kind,
    pub doubts: Vec<Doubt>,
    /// Number of outermost components that faced inward.
    pub inverted: usize,
    /// How often each component winds around its inside: 1, or -1 for a void.
    pub turns: Vec<f64>,
    /// Per component, the body to which it belongs: components that lie in each other, or cross, are one.
    pub body_of: Vec<u32>,
}

/// How often a surface winds around places.
pub struct Turning {
    /// Per triangle of the surface, how often its component winds around its inside; 0 if that is not closed.
    turns: Vec<i32>,
    /// Of the components that are not closed, if there are any.
    open: Option<Winding>,
}

/// How often a surface winds around one place.
#[derive(Debug, Clone, Copy)]
pub struct Turns {
    /// Its closed components: a whole number.
    pub closed: f64,
    /// The others.
    pub open: f64,
}

impl Turns {
    pub fn sum(self) -> f64 {
        self.closed + self.open
    }
}

impl Turning {
    /// Of a surface whose components wind around their insides as often as `turns` say.
    pub fn of(surface: &Oriented, turns: &[f64]) -> Self {
        let Oriented { tree, component_of, components, .. } = surface;
        let is_closed = |component: u32| components[component as usize].is_closed;
        let turns_of = |of: &u32| if is_closed(*of) { turns[*of as usize] as i32 } else { 0 };
        let has_open = components.iter().any(|component| !component.is_closed);
        let open = |n: u32| if is_closed(component_of[n as usize]) { 0.0 } else { 1.0 };
        Self { turns: component_of.iter().map(turns_of).collect(), open: has_open.then(|| Winding::of(tree, open)) }
    }

    /// Around a point, given the tree of the same surface.
    pub fn around(&self, tree: &Tree, point: Point3<f64>) -> Turns {
        let open = self.open.as_ref().map_or(0.0, |open| open.at(tree, point));
        Turns { closed: f64::from(crossings(tree, point, &self.turns)), open }
    }
}

/// Finds the material.
pub fn material(surface: &Oriented) -> Material {
    let layers = Layers::of(surface);
    let [by_direction, by_parity] = [layers.by_direction(), layers.by_parity()];
    let (turns, mut doubts) = layers.choose(&by_direction, &by_parity);
    let readings = [&by_direction, &by_parity, &turns].map(|turns| layers.total(turns).volume);
    let chosen = readings[2];
    let [below, above] = [f64::min, f64::max].map(|end| readings.into_iter().fold(chosen, end) - chosen);
    let integrated = layers.integrated(&turns);
    let moments = integrated.moments[1];
    let [sure, possible] = [0, 2].map(|k| integrated.moments[k].volume);
    let error = integrated.errors[1];
    let volume = Estimate::new(
        (sure.min(moments.volume) - error + below).max(0.0),
        moments.volume,
        possible.max(moments.volume) + error + above,
    );
    doubts.extend(layers.numerical_doubts(error / moments.volume));
    let solidity = if possible > 0.0 { sure / possible } else { 0.0 };
    let kind = layers.kind(&turns, &volume, solidity);
    let (inverted, body_of) = (layers.inverted(), layers.bodies());
    if kind == Kind::Sheet {
        // Of a sheet, only what it might hold is known.
        let volume = Estimate::new(0.0, 0.0, volume.high);
        return Material { volume, moments: Moments::ZERO, kind, doubts, inverted, turns, body_of };
    }
    Material { volume, moments, kind, doubts, inverted, turns, body_of }
}

/// The components and how they lie within each other.
struct Layers<'a> {
    surface: &'a Oriented,
    /// Of the closed components.
    nesting: Nesting,
    /// Per component, whether it is closed and lies inside of those that are not.
    is_in_open: Vec<bool>,
}

impl<'a> Layers<'a> {
    fn of(surface: &'a Oriented) -> Self {
        let components = &surface.components;
        let closed = |n: u32| Some(surface.component_of[n as usize]).filter(|c| components[*c as usize].is_closed);
        let triangles_of: Vec<&[u32]> =
            components.iter().map(|c| if c.is_closed { c.triangles.as_slice() } else { &[] }).collect();
        let nesting = Nesting::of(&surface.tree, &surface.corners, &triangles_of, closed);
        let mut is_in_open = vec![false; components.len()];
        if components.iter().any(|component| !component.is_closed) {
            let open = Winding::of(&surface.tree, |n| if closed(n).is_none() { 1.0 } else { 0.0 });
            for (component, is_in_open) in components.iter().zip(&mut is_in_open) {
                let place = surface.corners[component.triangles[0] as usize][0];
                *is_in_open = component.is_closed && open.at(&surface.tree, place) > LEVELS[1];
            }
        }
        Self { surface, nesting, is_in_open }
    }

    /// How often the surface winds around the inside of each component because of this component, as their directions
    /// in the file say: 1, or -1 for a void. What is outermost faces outward.
    fn by_direction(&self) -> Vec<f64> {
        let faces = |c: usize| if self.surface.components[c].faced_inward { -1.0 } else { 1.0 };
        let turn = |c: usize| {
            let outermost = self.nesting.outermost(c);
            if self.is_in_open[outermost] { faces(c) } else { faces(c) * faces(outermost) }
        };
        (0..self.surface.components.len()).map(turn).collect()
    }

    /// The same if every component within another one is a void, and the next one solid again.
    fn by_parity(&self) -> Vec<f64> {
        let turn = |c: usize| {
            let depth = self.nesting.depth(c) + usize::from(self.is_in_open[self.nesting.outermost(c)]);
            if depth.is_multiple_of(2) { 1.0 } else { -1.0 }
        };
        (0..self.surface.components.len()).map(turn).collect()
    }

    /// Which of the two to take, and why that is in doubt.
    fn choose(&self, by_direction: &[f64], by_parity: &[f64]) -> (Vec<f64>, Vec<Doubt>) {
        let alike: Vec<usize> = (0..by_parity.len()).filter(|&c| by_direction[c] != by_parity[c]).collect();
        let unreliable = |c: usize| {
            let component = &self.surface.components[c];
            self.nesting.depth(c) > 0 && component.is_unreliable
        };
        let is_unreliable = (0..by_parity.len()).any(unreliable);
        let mut doubts = Vec::new();
        if !alike.is_empty() {
            doubts.push(Doubt::NestedAlike { components: alike.len() });
        }
        let volume = Estimate::exactly(self.total(by_parity).volume);
        let is_void = !alike.is_empty() && (is_unreliable || self.wall(by_parity, &volume).is_some());
        (if is_void { by_parity } else { by_direction }.to_vec(), doubts)
    }

    /// Per component, whether it bounds material if no components cross: 1 from inside, -1 from outside, 0 not at all.
    fn bounds(&self, turns: &[f64]) -> Vec<f64> {
        let is_material = |winding: f64| if winding > LEVELS[1] { 1.0 } else { 0.0 };
        let bound = |(c, around): (usize, &Vec<u32>)| {
            let open = if self.is_in_open[self.nesting.outermost(c)] { 1.0 } else { 0.0 };
            let outside = open + around.iter().map(|other| turns[*other as usize]).sum::<f64>();
            is_material(outside + turns[c]) - is_material(outside)
        };
        self.nesting.around.iter().enumerate().map(bound).collect()
    }

    /// The material within closed components if no components cross.
    fn total(&self, turns: &[f64]) -> Moments {
        let inside = self.surface.components.iter().zip(self.bounds(turns));
        inside.fold(Moments::ZERO, |sum, (component, bound)| sum + component.moments * bound)
    }

    fn is_simple(&self) -> bool {
        !self.nesting.crosses.contains(&true) && self.surface.components.iter().all(|component| component.is_closed)
    }

    /// The material at each of the [`LEVELS`]: exact if nothing crosses and all is closed.
    fn integrated(&self, turns: &[f64]) -> Integrals {
        if self.is_simple() {
            return Integrals { moments: [self.total(turns); INTEGRALS], errors: [0.0; INTEGRALS] };
        }
        let Oriented { tree, corners, components, .. } = self.surface;
        let turning = Turning::of(self.surface, turns);
        // What closed components contribute is known exactly, so only the difference is integrated.
        let sample = |point: Point3<f64>| {
            let around = turning.around(tree, point);
            let field = around.sum();
            Sample { values: LEVELS.map(|level| f64::from(u8::from(field > level)) - around.closed), field }
        };
        let levels: &[f64] = if turning.open.is_some() { &LEVELS } else { &[] };
        let mut integrals = integrate(corners, sample, levels);
        let known = components.iter().zip(turns).fold(Moments::ZERO, |sum, (c, turn)| sum + c.moments * *turn);
        integrals.moments = integrals.moments.map(|moments| moments + known);
        integrals
    }

    fn kind(&self, turns: &[f64], volume: &Estimate, solidity: f64) -> Kind {
        let is_closed = self.surface.components.iter().all(|component| component.is_closed);
        match self.wall(turns, volume) {
            _ if !is_closed && solidity < SHEET => Kind::Sheet,
            Some(thickness) if is_closed || solidity > HOLES => Kind::Wall { thickness },
            _ if is_closed => Kind::Solid,
            _ => Kind::Open,
        }
    }

    /// The thickness of the material if it is a wall.
    fn wall(&self, turns: &[f64], volume: &Estimate) -> Option<Estimate> {
        let Oriented { tree, corners, component_of, components, .. } = self.surface;
        let sides = if self.is_simple() { self.bounds(turns) } else { turns.to_vec() };
        let bounding = components.iter().zip(&sides).filter(|(_, side)| **side != 0.0);
        let triangles: Vec<u32> = bounding.clone().flat_map(|(component, _)| &component.triangles).copied().collect();
        let area: f64 = bounding.map(|(component, _)| component.area).sum();
        let wall = thickness(tree, corners, &triangles, |n| sides[component_of[n as usize] as usize])?;
        let is_even = (volume.mid / (0.5 * area * wall.mid) - 1.0).abs() < EVEN
            && wall.low * ALIKE > wall.mid
            && wall.high < ALIKE * wall.mid;
        if !is_even {
            return None;
        }
        let points: Vec<Point3<f64>> = corners.iter().flatten().copied().collect();
        let hull = Hull::inner(&points)?.volume();
        (volume.mid < HOLLOW * hull && wall.mid < THIN * hull.cbrt()).then_some(wall)
    }

    /// Doubts about surfaces that are not simple; the volume has a relative `error`.
    fn numerical_doubts(&self, error: f64) -> Vec<Doubt> {
        let crossing = self.nesting.crosses.iter().filter(|crosses| **crosses).count();
        let open = self.surface.components.iter().filter(|component| !component.is_closed).count();
        let boundary_edges = self.surface.topology.boundary_edges;
        let mut doubts = Vec::new();
        if open > 0 {
            doubts.push(Doubt::Open { components: open, boundary_edges });
        }
        if crossing > 0 {
            doubts.push(Doubt::Crossing { components: crossing, error });
        }
        doubts
    }

    fn bodies(&self) -> Vec<u32> {
        // That components are of one body says nothing of their directions.
        const ALIKE: bool = false;
        let mut bodies = Forest::of(self.nesting.around.len());
        let crossing: Vec<usize> = (0..self.nesting.crosses.len()).filter(|c| self.nesting.crosses[*c]).collect();
        let crossing = crossing.windows(2).map(|pair| (pair[0], pair[1]));
        let around = self.nesting.around.iter().enumerate();
        let nested = around.flat_map(|(c, around)| around.iter().map(move |other| (c, *other as usize)));
        for (one, other) in crossing.chain(nested) {
            bodies.join(one, other, ALIKE);
        }
        bodies.numbered().0
    }

    fn inverted(&self) -> usize {
        let is_inverted =
            |c: &usize| self.surface.components[*c].faced_inward && self.nesting.depth(*c) == 0 && !self.is_in_open[*c];
        (0..self.surface.components.len()).filter(is_inverted).count()
    }
}
