//! Which closed components lie inside of which.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::crossings::RAYS;
use super::sample::{Place, places};
use super::tree::Tree;
use crate::parallel;

/// Places on all components together, and on one.
const PLACES: usize = 16_384;
const PLACES_PER_COMPONENT: usize = 1024;
/// A component lies inside of another if this share of its surface does.
const MOST: f64 = 0.9;

/// How closed components lie to each other.
pub struct Nesting {
    /// Per component, those that it lies inside of.
    pub around: Vec<Vec<u32>>,
    /// Per component, whether it passes through itself or another one, as far as was found.
    pub crosses: Vec<bool>,
}

impl Nesting {
    /// Casts rays from all components that have triangles in `triangles_of`; they face outward. `component_of` is `None`
    /// for triangles that count for nothing.
    pub fn of(
        tree: &Tree,
        corners: &[[Point3<f64>; 3]],
        triangles_of: &[&[u32]],
        component_of: impl Fn(u32) -> Option<u32> + Sync,
    ) -> Self {
        let asked = triangles_of.iter().filter(|triangles| !triangles.is_empty()).count().max(1);
        let count = (PLACES / asked).clamp(1, PLACES_PER_COMPONENT);
        let of_component = |own: usize| {
            let seen = places(corners, triangles_of[own], count).into_iter().map(|p| in_front(tree, &p, &component_of));
            let seen: Vec<Vec<(u32, i32)>> = seen.flatten().collect();
            let crosses = seen.windows(2).any(|pair| pair[0] != pair[1])
                || seen.iter().flatten().any(|(other, turns)| *other == own as u32 || *turns != 1);
            let mut times: BTreeMap<u32, usize> = BTreeMap::new();
            for (other, _) in seen.iter().flatten().filter(|(other, turns)| *other != own as u32 && *turns > 0) {
                *times.entry(*other).or_default() += 1;
            }
            let most = MOST * seen.len() as f64;
            (times.into_iter().filter(|(_, n)| *n as f64 >= most).map(|(other, _)| other).collect(), crosses)
        };
        let (around, crosses) = parallel::map_range(triangles_of.len(), of_component).into_iter().unzip();
        Self { around, crosses }
    }

    /// The number of components that a component lies inside of.
    pub fn depth(&self, component: usize) -> usize {
        self.around[component].len()
    }

    /// The outermost component around a component: itself if there is none.
    pub fn outermost(&self, component: usize) -> usize {
        let around = self.around[component].iter().map(|other| *other as usize);
        around.min_by_key(|other| self.depth(*other)).unwrap_or(component)
    }
}

/// How often each component winds around the space just in front of a place, other than 0; `None` if the rays disagree.
fn in_front(tree: &Tree, place: &Place, component_of: impl Fn(u32) -> Option<u32>) -> Option<Vec<(u32, i32)>> {
    let turns = |direction: Vector3<f64>| {
        let mut turns: BTreeMap<u32, i32> = BTreeMap::new();
        if direction.dot(&place.normal) < 0.0 {
            // From the back, the ray counts one turn more.
            turns.extend(component_of(place.triangle).map(|own| (own, -1)));
        }
        tree.hits(place.point, direction, |hit| {
            if let Some(component) = component_of(hit.triangle).filter(|_| hit.triangle != place.triangle) {
                *turns.entry(component).or_default() += if hit.leaves { 1 } else { -1 };
            }
        });
        turns.into_iter().filter(|(_, n)| *n != 0).collect::<Vec<_>>()
    };
    let [a, b] = [turns(RAYS[0]), turns(RAYS[1])];
    if a == b {
        return Some(a);
    }
    let c = turns(RAYS[2]);
    if c == a || c == b { Some(c) } else { None }
}
