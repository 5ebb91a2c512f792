//! How triangles hang together: edges, patches that can be oriented alike, connected components.
//!
//! A *patch* is a set of triangles connected across edges of exactly two triangles; a *component* consists of the patches
//! that share edges.

use super::weld::Welded;
use crate::numeric::forest::Forest;
use crate::parallel;

/// That two patches of a component are joined says nothing of their directions.
const ALIKE: bool = false;

/// A side of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Side {
    /// The edge's ends, in rising order.
    pub ends: [u32; 2],
    pub triangle: u32,
    /// Whether the triangle runs along it from the second end to the first.
    pub is_back: bool,
}

/// The sides of all triangles, grouped by edge.
pub struct Edges(Vec<Side>);

impl Edges {
    pub fn of(triangles: &[[u32; 3]]) -> Self {
        let of_triangle = |n: usize| {
            let [a, b, c] = triangles[n];
            [[a, b], [b, c], [c, a]].map(|[from, to]| Side {
                ends: [from.min(to), from.max(to)],
                triangle: n as u32,
                is_back: from > to,
            })
        };
        let mut sides = parallel::flat_map_range(triangles.len(), of_triangle);
        parallel::sort_unstable_by(&mut sides, Ord::cmp);
        Self(sides)
    }

    /// The sides along each edge.
    pub fn iter(&self) -> impl Iterator<Item = &[Side]> + Clone {
        self.0.chunk_by(|a, b| a.ends == b.ends)
    }

    /// The edges of only one triangle.
    pub fn boundary(&self) -> Vec<[u32; 2]> {
        self.iter().filter(|sides| sides.len() == 1).map(|sides| sides[0].ends).collect()
    }
}

/// Triangles with their patches and components, all triangles of a patch oriented alike.
pub struct Connected {
    pub edges: Edges,
    /// Per triangle.
    pub patch_of: Vec<u32>,
    pub patches: Vec<Patch>,
    /// Number of components.
    pub components: usize,
    /// Number of edges of two triangles that cannot be oriented alike: as on a Moebius strip.
    pub twisted_edges: usize,
    /// Number of triangles that were reversed.
    pub mended: usize,
}

/// A set of triangles oriented alike.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Patch {
    pub component: u32,
    pub area: f64,
    /// The area of the triangles whose direction was reversed, to be as that of most of the area.
    pub mended_area: f64,
    /// Whether it has edges of one triangle or of more than two.
    pub has_border: bool,
}

impl Connected {
    /// Finds the patches, and reverses triangles of `welded` that are oriented otherwise than most of the area of their patch.
    pub fn of(welded: &mut Welded) -> Self {
        let edges = Edges::of(&welded.triangles);
        let (alike, twisted_edges) = patches(&edges, welded.triangles.len());
        let (patch_of, count) = alike.numbered();
        let mut patches = vec![Patch::default(); count];
        let mut reversed_area = vec![0.0; count];
        let differs: Vec<bool> = parallel::map_range(patch_of.len(), |n| alike.root(n).1);
        for (n, patch) in patch_of.iter().map(|patch| *patch as usize).enumerate() {
            let area = area_of(&welded.corners(n));
            patches[patch].area += area;
            reversed_area[patch] += if differs[n] { area } else { 0.0 };
        }
        let minority_differs: Vec<bool> = (0..count).map(|p| reversed_area[p] <= 0.5 * patches[p].area).collect();
        let mut mended = 0;
        for (n, patch) in patch_of.iter().map(|patch| *patch as usize).enumerate() {
            if differs[n] == minority_differs[patch] {
                welded.triangles[n].swap(1, 2);
                patches[patch].mended_area += area_of(&welded.corners(n));
                mended += 1;
            }
        }
        let mut connected =
            Self { edges: Edges::of(&welded.triangles), patch_of, patches, components: 0, twisted_edges, mended };
        connected.find_components();
        connected
    }

    fn find_components(&mut self) {
        let mut joined = Forest::of(self.patches.len());
        for sides in self.edges.iter().filter(|sides| sides.len() != 2) {
            for side in sides {
                let patch = self.patch_of[side.triangle as usize] as usize;
                self.patches[patch].has_border = true;
                joined.join(self.patch_of[sides[0].triangle as usize] as usize, patch, ALIKE);
            }
        }
        let (component_of, count) = joined.numbered();
        self.patches.iter_mut().zip(component_of).for_each(|(patch, component)| patch.component = component);
        self.components = count;
    }

    /// Per component, whether it is closed: along every edge, as many triangles run forth as back. `is_reversed` says of
    /// each patch whether it is meant the other way round.
    pub fn closed(&self, is_reversed: &[bool]) -> Vec<bool> {
        let mut closed = vec![true; self.components];
        for sides in self.edges.iter() {
            let patch = |side: &Side| self.patch_of[side.triangle as usize] as usize;
            let runs_back = |side: &Side| side.is_back ^ is_reversed[patch(side)];
            let back = sides.iter().filter(|side| runs_back(side)).count();
            if 2 * back != sides.len() {
                closed[self.patches[patch(&sides[0])].component as usize] = false;
            }
        }
        closed
    }
}

/// Joins triangles across edges of two; also the number of edges at which that contradicts itself.
fn patches(edges: &Edges, triangles: usize) -> (Forest, usize) {
    let mut alike = Forest::of(triangles);
    let mut twisted = 0;
    for sides in edges.iter().filter(|sides| sides.len() == 2) {
        let [a, b] = [sides[0], sides[1]];
        // Neighbours run along their common edge in opposite directions.
        let fits = alike.join(a.triangle as usize, b.triangle as usize, a.is_back == b.is_back);
        twisted += usize::from(!fits);
    }
    (alike, twisted)
}

pub fn area_of([a, b, c]: &[nalgebra::Point3<f64>; 3]) -> f64 {
    0.5 * (b - a).cross(&(c - a)).norm()
}
