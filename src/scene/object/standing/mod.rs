//! What stands on the support, each thing by itself.
//!
//! 1. [`Surface`]: where the support's Gaussians really lie. A trained surface is as thick as the photos leave it in doubt;
//!    what is higher than a few times its spread is not the surface.
//! 2. [`Region::clusters`]: opaque Gaussians above it whose voxels touch.
//! 3. [`Region::stands_on`]: clusters with the support around them are objects; walls, the edge of the table, what stands behind it,
//!    and what reaches out of the region that the cameras look at are parts of the room, and so are wrinkles of a table cloth: low
//!    and of its colours. A cluster that hovers over an object belongs to it.
//! 4. [`waist`]: what touches in one place is told apart.
//! 5. [`Joining`]: the other Gaussians in an object's voxels join it, and over its [`Foot`] also those as low as the surface, so
//!    that nothing is cut off at the bottom.
//! 6. [`sunken`]: on a rough surface, such as a bed, also those that are as low but of other colours than the surface.
//!
//! All lengths are fractions of the cameras' median distance from the focus.

mod cells;
mod foot;
mod sunken;
mod waist;

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3x2, Point2, Point3, Vector2, Vector3};

use self::cells::Cells;
use self::foot::{Foot, Standpoint};
use super::support::{Focus, LARGEST, LEAST_OPACITY_LOGIT, Plane, Scatter};
use crate::gaussians::Gaussians;
use crate::numeric::{evenly, median};

/// Distance from the focus within which things are looked for: what reaches farther is part of the room.
const REACH: f64 = 1.1;
/// Distance from the focus, along the support, within which the middle of an object lies: cameras that walk around several things
/// keep all of them in the picture.
const MIDDLE_WITHIN: f64 = 0.8;
/// Least side of a voxel, 13 mm if the cameras are a metre away. Gaps smaller than this do not split an object; a board with a
/// knife and a loaf on it falls apart below two thirds of it.
const LEAST_VOXEL: f64 = 1.0 / 80.0;
/// Most, which a coarse splat needs: the Gaussians of a surface touch within twice their largest standard deviation.
const MOST_VOXEL: f64 = 1.0 / 30.0;
const DEVIATIONS_PER_VOXEL: f64 = 2.0;
/// Opacity logit from which a Gaussian shows something solid: 0.3.
const SOLID_LOGIT: f32 = -0.85;
/// What is higher than this many spreads of the surface does not belong to it.
const SPREADS: f64 = 3.0;
/// Least such height: a flawless surface has no spread.
const LEAST_THICKNESS: f64 = 0.002;
/// Fewest Gaussians and voxels of an object: crumbs of a wrinkled table cloth have up to 11 solid Gaussians, a banana 203.
const FEWEST_GAUSSIANS: usize = 24;
const FEWEST_VOXELS: usize = 8;
/// Least height of an object, in thicknesses of the surface.
const LEAST_HEIGHT: f64 = 2.0;
/// Side of a cell of the support, seen from above, in voxels: the Gaussians of a table are larger than those of things.
const CELL: f64 = 2.0;
/// Gaps of up to twice this many cells between Gaussians of the support are closed: those of a plain table lie far apart.
const SUPPORT_GAP: usize = 1;
/// Width, in cells, of the ring around an object in which the support shows.
const RING: i64 = 2;
/// Least share of that ring where the support shows: half of it does along a straight edge or wall.
const LEAST_SURROUNDED: f64 = 0.6;
/// The same for an object in the middle of what the cameras look at, which may stand in the corner of two walls.
const LEAST_SURROUNDED_IN_MIDDLE: f64 = 0.25;
/// Distance from the focus, along the support, of the middle of such an object.
const IN_MIDDLE: f64 = 0.25;
/// Height, in thicknesses of the surface, from which a thing is no wrinkle: the wrinkles of a bed's cover are up to 3.3 high, a
/// banana 4.7.
const MOST_WRINKLE: f64 = 8.0;
/// Width, in cells, of the ring around a wrinkle whose colours are compared with its own.
const RING_OF_COLORS: i64 = 4;
/// How much farther than those of the surface from each other, in the median, the colours of a thing are from those of the surface:
/// 4 to 60 times for the things on a table and a plush on a bed, 0.6 to 0.7 times for the bed's wrinkles.
const LEAST_CONTRAST: f64 = 2.0;
/// Most Gaussians whose colours are compared.
const MOST_COMPARED: usize = 2000;
/// Least height, in thicknesses of the surface, of the Gaussians of an object: over the rim of its foot, where the surface is seen
/// beside it, and over the rest, where the surface is hidden and what is as low is the object's bottom. Chosen with the rendered
/// table whose masks docs/evaluation.md compares.
const LEAST_OVER_RIM: f64 = 0.25;
const LEAST_OVER_FOOT: f64 = -1.0 / SPREADS;
/// The things that stand on the support.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::scene) struct Standing {
    /// For each Gaussian, the number of its object, from 1; 0 if it belongs to none.
    pub object_of_gaussian: Vec<u32>,
    /// Number of objects. Those with more solid Gaussians come first.
    pub count: usize,
    /// Number of things that would be objects if they were closer to what the cameras look at.
    pub aside: usize,
}

/// A place relative to the support.
#[derive(Debug, Clone, Copy)]
struct Place {
    along: Point2<f64>,
    /// Above the surface.
    height: f64,
}

/// The support's surface, with axes along it and the unit of all lengths.
struct Surface {
    origin: Point3<f64>,
    /// Two unit vectors along the surface.
    axes: Matrix3x2<f64>,
    normal: Vector3<f64>,
    unit: f64,
    /// Distance of the surface from the plane that was fitted.
    offset: f64,
    /// Height below which a Gaussian may belong to the surface.
    thickness: f64,
}

impl Surface {
    /// `None` if no Gaussians are near the plane.
    fn of(focus: &Focus, plane: &Plane) -> Option<Self> {
        let (normal, axes) = (plane.normal, plane.axes());
        let origin = focus.point - normal * plane.height(&focus.point);
        let Scatter { offset, spread } = focus.scatter(plane)?;
        let thickness = (SPREADS * spread).max(LEAST_THICKNESS);
        Some(Self { origin, axes, normal, unit: focus.unit, offset, thickness })
    }

    fn place(&self, point: &Point3<f64>) -> Place {
        let from_origin = (point - self.origin) / self.unit;
        let along: Vector2<f64> = self.axes.transpose() * from_origin;
        Place { along: along.into(), height: self.normal.dot(&from_origin) - self.offset }
    }
}

/// What lies in the region that the cameras look at.
struct Region<'a> {
    gaussians: &'a Gaussians,
    surface: Surface,
    /// Side of a voxel.
    voxel: f64,
    /// The indices of its Gaussians that are no haze and no walls, with their places.
    places: BTreeMap<usize, Place>,
    /// The cells in which the support shows, and those that they enclose: things that stand close together hide the support around
    /// each other.
    support: Cells,
}

/// Gaussians whose voxels touch.
#[derive(Default)]
struct Cluster {
    voxels: BTreeSet<[i64; 3]>,
    /// In the order of the splat.
    indices: Vec<usize>,
}

impl Cluster {
    fn add(&mut self, region: &Region, i: usize) {
        self.indices.push(i);
        self.voxels.insert(region.voxel(&region.places[&i]));
    }
}

/// Finds what stands on the support; nothing if the support is not seen near the focus.
pub(in crate::scene) fn find(gaussians: &Gaussians, focus: &Focus, support: &Plane) -> Standing {
    let nothing = || Standing { object_of_gaussian: vec![0; gaussians.len()], count: 0, aside: 0 };
    let Some(region) = Region::around(gaussians, focus, support) else { return nothing() };
    let (standing, others): (Vec<Cluster>, Vec<Cluster>) =
        region.clusters().into_iter().partition(|cluster| region.stands_on(cluster));
    let standing = standing.into_iter().flat_map(|cluster| waist::apart(&region, cluster));
    let (mut standing, aside): (Vec<Cluster>, Vec<Cluster>) =
        standing.partition(|cluster| region.middle(cluster).norm() < MIDDLE_WITHIN);
    standing.sort_by(|a, b| b.indices.len().cmp(&a.indices.len()).then(a.indices[0].cmp(&b.indices[0])));
    region.join_hovering(&mut standing, others);
    let mut found = Standing { count: standing.len(), aside: aside.len(), ..nothing() };
    for (number, cluster) in (1..).zip(&standing) {
        cluster.indices.iter().for_each(|i| found.object_of_gaussian[*i] = number);
    }
    Joining::new(&region, &standing).join(&mut found.object_of_gaussian);
    found
}

impl<'a> Region<'a> {
    fn around(gaussians: &'a Gaussians, focus: &Focus, support: &Plane) -> Option<Self> {
        let surface = Surface::of(focus, support)?;
        let is_detail = |i: &usize| {
            gaussians.opacity_logits[*i] >= LEAST_OPACITY_LOGIT
                && (gaussians.center(*i) - focus.point).norm() < REACH * focus.unit
                && gaussians.scale(*i).max() < LARGEST * focus.unit
        };
        let details = (0..gaussians.len()).filter(is_detail);
        let places: BTreeMap<usize, Place> = details.map(|i| (i, surface.place(&gaussians.center(i)))).collect();
        let mut region =
            Self { gaussians, surface, voxel: LEAST_VOXEL, places, support: Cells::new(&BTreeSet::new(), 0) };
        let above = region.places.iter().filter(|(i, place)| region.is_solid(**i) && region.is_above(place));
        let sizes = above.map(|(i, _)| DEVIATIONS_PER_VOXEL * gaussians.scale(*i).max() / focus.unit).collect();
        region.voxel = median(sizes).unwrap_or(0.0).clamp(LEAST_VOXEL, MOST_VOXEL);
        let on_surface = region.places.values().filter(|place| place.height.abs() <= region.surface.thickness);
        let shown: BTreeSet<[i64; 2]> = on_surface.map(|place| region.cell(place)).collect();
        region.support = Cells::new(&shown, SUPPORT_GAP);
        region.support.close(SUPPORT_GAP);
        Some(region)
    }

    /// Clusters of the solid Gaussians above the surface.
    fn clusters(&self) -> Vec<Cluster> {
        let mut voxels: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
        for (&i, place) in self.places.iter().filter(|(i, place)| self.is_solid(**i) && self.is_above(place)) {
            voxels.entry(self.voxel(place)).or_default().push(i);
        }
        let mut left: BTreeSet<[i64; 3]> = voxels.keys().copied().collect();
        let mut clusters = Vec::new();
        while let Some(start) = left.pop_first() {
            let mut cluster = Cluster { voxels: BTreeSet::new(), indices: Vec::new() };
            let mut open = vec![start];
            while let Some(at) = open.pop() {
                cluster.indices.extend(&voxels[&at]);
                open.extend(around(at).filter(|neighbour| left.remove(neighbour)));
                cluster.voxels.insert(at);
            }
            cluster.indices.sort_unstable();
            clusters.push(cluster);
        }
        clusters
    }

    fn is_solid(&self, i: usize) -> bool {
        self.gaussians.opacity_logits[i] >= SOLID_LOGIT
    }

    /// The cell of the support below a place.
    fn cell(&self, place: &Place) -> [i64; 2] {
        cell(&place.along, CELL * self.voxel)
    }

    fn voxel(&self, place: &Place) -> [i64; 3] {
        let [x, y] = cell(&place.along, self.voxel);
        [x, y, (place.height / self.voxel).floor() as i64]
    }

    /// The place of a Gaussian, to search for those near it.
    fn point(&self, i: usize) -> [f32; 3] {
        let place = &self.places[&i];
        [place.along.x, place.along.y, place.height].map(|side| side as f32)
    }

    fn is_above(&self, place: &Place) -> bool {
        place.height > self.surface.thickness
    }

    /// Whether a cluster could stand on the surface by itself: it is large enough, high enough, and close to the surface.
    fn could_stand(&self, cluster: &Cluster) -> bool {
        let (low, high) = self.heights(cluster);
        cluster.indices.len() >= FEWEST_GAUSSIANS
            && cluster.voxels.len() >= FEWEST_VOXELS
            && high > LEAST_HEIGHT * self.surface.thickness
            && low < self.surface.thickness + self.voxel
    }

    /// Whether a cluster is an object, or several that touch: it could stand, is within the region, with the support around it, and no
    /// wrinkle.
    fn stands_on(&self, cluster: &Cluster) -> bool {
        let (_, high) = self.heights(cluster);
        let middle = self.middle(cluster);
        let is_outside = |i: &usize| self.places[i].along.coords.norm() > REACH - self.voxel;
        self.could_stand(cluster)
            && !cluster.indices.iter().any(is_outside)
            && self.surrounded(cluster)
                >= if middle.norm() < IN_MIDDLE { LEAST_SURROUNDED_IN_MIDDLE } else { LEAST_SURROUNDED }
            && (high > MOST_WRINKLE * self.surface.thickness || self.is_of_other_colors(cluster))
    }

    fn heights(&self, cluster: &Cluster) -> (f64, f64) {
        let heights = cluster.indices.iter().map(|i| self.places[i].height);
        heights.fold((f64::INFINITY, 0.0_f64), |(low, high), at| (low.min(at), high.max(at)))
    }

    /// The mean place of a cluster along the surface, as seen from the focus.
    fn middle(&self, cluster: &Cluster) -> Vector2<f64> {
        let places = cluster.indices.iter().map(|i| self.places[i].along.coords);
        places.sum::<Vector2<f64>>() / cluster.indices.len() as f64
    }

    /// The share of the ring around a cluster's outline, seen from above, in which the support shows.
    fn surrounded(&self, cluster: &Cluster) -> f64 {
        let ring = self.ring(cluster, RING);
        let shown = ring.iter().filter(|at| self.support.contains(**at)).count();
        shown as f64 / ring.len().max(1) as f64
    }

    /// Whether the colours of a cluster are others than those of the surface around it: each Gaussian is compared with the one
    /// that is most like it.
    fn is_of_other_colors(&self, cluster: &Cluster) -> bool {
        let ring = self.ring(cluster, RING_OF_COLORS);
        let is_around = |(i, place): &(&usize, &Place)| {
            self.is_solid(**i) && place.height.abs() <= self.surface.thickness && ring.contains(&self.cell(place))
        };
        let around: Vec<usize> = self.places.iter().filter(is_around).map(|(i, _)| *i).collect();
        let few = |indices: &[usize]| -> Vec<usize> { evenly(indices, MOST_COMPARED).copied().collect() };
        let around = few(&around);
        let contrast = |indices: &[usize]| {
            let nearest = |i: &usize| {
                let others = around.iter().filter(|other| *other != i);
                others.map(|other| self.color_distance(*i, *other)).min_by(f64::total_cmp)
            };
            median(indices.iter().filter_map(nearest).collect())
        };
        match (contrast(&few(&cluster.indices)), contrast(&around)) {
            (Some(own), Some(surface)) => own >= LEAST_CONTRAST * surface,
            _ => true,
        }
    }

    fn color_distance(&self, i: usize, j: usize) -> f64 {
        let [i, j] = [i, j].map(|i| Vector3::from(self.gaussians.sh_dc[i]));
        f64::from((i - j).norm())
    }

    /// The cells around a cluster's outline, seen from above, up to `width` away.
    fn ring(&self, cluster: &Cluster, width: i64) -> BTreeSet<[i64; 2]> {
        let outline = self.outline(cluster);
        let near = |at: &[i64; 2]| {
            let [x, y] = *at;
            (-width..=width).flat_map(move |i| (-width..=width).map(move |j| [x + i, y + j]))
        };
        outline.iter().flat_map(near).filter(|at| !outline.contains(at)).collect()
    }

    /// The cells below a cluster.
    fn outline(&self, cluster: &Cluster) -> BTreeSet<[i64; 2]> {
        cluster.indices.iter().map(|i| self.cell(&self.places[i])).collect()
    }

    /// Adds clusters that hover over an object to it: a pot's lid on a rim that no photo shows, the far side of glass.
    fn join_hovering(&self, standing: &mut [Cluster], others: Vec<Cluster>) {
        let outlines: Vec<BTreeSet<[i64; 2]>> = standing.iter().map(|cluster| self.outline(cluster)).collect();
        for other in others {
            let own = self.outline(&other);
            let above = |outline: &BTreeSet<[i64; 2]>| 2 * own.intersection(outline).count() > own.len();
            if let Some(below) = outlines.iter().position(above) {
                standing[below].indices.extend(other.indices);
                standing[below].voxels.extend(other.voxels);
            }
        }
    }
}

/// Adds the rest of the Gaussians to the objects around them.
struct Joining<'a> {
    region: &'a Region<'a>,
    object_of_voxel: BTreeMap<[i64; 3], u32>,
    /// By number, from 1.
    feet: Vec<Foot>,
}

impl<'a> Joining<'a> {
    fn new(region: &'a Region<'a>, standing: &[Cluster]) -> Self {
        let mut object_of_voxel = BTreeMap::new();
        for (number, cluster) in (1..).zip(standing) {
            object_of_voxel.extend(cluster.voxels.iter().map(|at| (*at, number)));
        }
        Self { region, object_of_voxel, feet: standing.iter().map(|cluster| Foot::of(region, cluster)).collect() }
    }

    fn join(mut self, object_of_gaussian: &mut [u32]) {
        let region = self.region;
        for (&i, place) in &region.places {
            if object_of_gaussian[i] == 0 {
                let found = if region.is_above(place) { self.near(place) } else { self.above_foot(place) };
                object_of_gaussian[i] = found.unwrap_or(0);
            }
        }
        sunken::join(region, &mut self.object_of_voxel, object_of_gaussian);
        for i in (0..object_of_gaussian.len()).filter(|i| !region.places.contains_key(i)) {
            object_of_gaussian[i] = self.around_large(i).unwrap_or(0);
        }
    }

    /// The object in whose voxel a place is, or in one that touches it.
    fn near(&self, place: &Place) -> Option<u32> {
        let own = self.region.voxel(place);
        let touching = || around(own).find_map(|at| self.object_of_voxel.get(&at));
        self.object_of_voxel.get(&own).or_else(touching).copied()
    }

    /// The object over whose foot a place as low as the surface is.
    fn above_foot(&self, place: &Place) -> Option<u32> {
        let height = place.height / self.region.surface.thickness;
        let is_over = |foot: &Foot| match foot.at(&place.along) {
            Standpoint::Beside => false,
            Standpoint::Rim => height >= LEAST_OVER_RIM,
            Standpoint::Foot => height >= LEAST_OVER_FOOT,
        };
        self.feet.iter().position(is_over).map(|at| at as u32 + 1)
    }

    /// The object in which a Gaussian too large to show a detail lies, with one standard deviation along its longest axis: the
    /// middle of a plain board may be a single one.
    fn around_large(&self, i: usize) -> Option<u32> {
        let Region { gaussians, surface, .. } = self.region;
        let center = gaussians.center(i);
        if gaussians.opacity_logits[i] < LEAST_OPACITY_LOGIT || surface.place(&center).along.coords.norm() > REACH {
            return None;
        }
        let scale = gaussians.scale(i);
        let longest = scale.imax();
        let reach = gaussians.rotation(i) * Vector3::ith(longest, scale[longest]);
        let ends = [center, center + reach, center - reach];
        let [middle, one, other] = ends.map(|end| self.near(&surface.place(&end)));
        middle.filter(|_| middle == one && middle == other)
    }
}

fn cell(along: &Point2<f64>, side: f64) -> [i64; 2] {
    (along / side).coords.map(|v| v.floor() as i64).into()
}

/// A voxel and those that touch it.
fn around([x, y, z]: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (-1..=1).flat_map(move |i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [x + i, y + j, z + k])))
}
