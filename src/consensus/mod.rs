//! The parts of the object in 3D, on which the views agree: found before anything is asked about them.
//!
//! A single view may merge parts into one segment or split a part into several. A part is what many views separate from
//! its surroundings and what has a shape of its own:
//! 1. [`membership`]: how much of every Gaussian's light each segment of a view shows;
//! 2. [`neighbors`]: pairs of Gaussians, nearest neighbours and others a few Gaussians apart;
//! 3. [`evidence`]: for every pair, how much the views that see both split it (the largest difference between the
//!    shares of their light in a segment; views with more light weigh more), which of these views cannot tell
//!    ([`undersegmentation`]), the angle between the surface's normals ([`normals`]), and what the file of a mesh says
//!    ([`structure`]);
//! 4. [`linkage`]: joins Gaussians into pieces that views do not split, by average linkage over all pairs that cross
//!    their border, then pieces into parts across borders without an edge in the surface ([`normals`]) or on one smooth
//!    surface ([`planes`]): a printed pattern is not a part. The pieces are kept, in case the part turns out to consist
//!    of several materials;
//! 5. [`masks`]: the parts in each view, and [`mod@best_views`]: the views that show each part best.
//!
//! What surroundings hide in a view is not seen there: it is no evidence, and the view's masks leave it out.
//!
//! Crumbs join the neighbour from which views separate them least. Gaussians that are then in no part, because no view
//! sees them or they touch nothing, join the nearest part. If there are only crumbs, they are one part.

mod best_views;
mod evidence;
mod linkage;
pub mod masks;
mod membership;
mod neighbors;
mod normals;
mod options;
mod planes;
pub mod sides;
mod structure;
mod undersegmentation;

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::numeric::nearest::Nearest;
use crate::parallel;
use crate::scene::Origin;
use crate::segment::ViewSegments;
use crate::words::progress::Progress;
use evidence::Evidence;
use linkage::{Border, NONE, link};
use membership::Membership;
use neighbors::Pairs;
use normals::Normals;
use planes::Planes;
use undersegmentation::Regions;

pub use best_views::{PartView, best_views, sharpness};
pub use options::{AskAbout, Options, SCENE_KEYS};

/// Neighbours that views split by less are taken as one from the start, which leaves a sixth of the nodes to link.
const CORE_SPLIT: f64 = 0.02;
/// Pieces are joined while views split, on average, fewer of the pairs across their border than this. A border that
/// half of the views see has pairs of soft Gaussians on it, with about half of their light on either side.
const PIECE_SPLIT: f64 = 0.2;
/// Pieces are joined into parts while the [`strength`] of their border is at most this.
const PART_STRENGTH: f64 = 0.3;
/// The pieces of a part that are asked about one by one, if it consists of several materials, each have at least this
/// share of the object's light: smaller ones change little, and on a printed can they are where label and metal meet.
const ASKED_PIECE_SHARE: f64 = 0.02;
/// Angles in degrees between normals across a border: up to the first, the surface goes on smoothly; from the second,
/// it has an edge. Pairs on a smooth printed surface differ by 8 to 22 degrees, those across borders of parts by 42 and
/// more (the four fixtures and six measured objects).
const SMOOTH_TO_EDGE_DEG: [f64; 2] = [20.0, 50.0];
/// A border is print if at least this share of its pairs lie on one smooth surface ([`planes`]). Most pairs between
/// large printed fields do (up to 0.92 of a border's pairs; a soup can and a cracker box), at most 0.2 of those between
/// parts (the four fixtures and two workshop tools).
const PRINT_SHARE: f64 = 0.25;
/// Pieces of a part are joined across borders of which at least this share of the pairs is smooth.
const SURE_PRINT_SHARE: f64 = 0.5;
/// A border's mean angle starts from this many assumed pairs of [`SURE_EDGE_DEG`], none of which is smooth, so that few
/// pairs do not decide.
const PRIOR_PAIRS: f64 = 20.0;
const SURE_EDGE_DEG: f64 = 60.0;
/// A piece with a smaller share of the object's light is a scrap, as found along borders: it joins a neighbour before
/// pieces are joined into parts, so that the pieces touch each other.
const SCRAP_SHARE: f64 = 0.0002;
/// A part with a smaller share of the object's light is a crumb, as is one with less light than this many Gaussians
/// have on average.
const CRUMB_SHARE: f64 = 0.003;
const CRUMB_GAUSSIANS: f64 = 10.0;
/// A Gaussian with less light than this in all views together, in pixels, counts as not seen.
const LEAST_LIGHT: f32 = 1.0;

/// A view with its segments.
#[derive(Debug, Clone, Copy)]
pub struct SegmentedView<'a> {
    pub camera: &'a Camera,
    /// All that the view shows: the object's Gaussians first, then those of its surroundings, which may hide some of it.
    pub cloud: &'a Gaussians,
    /// Of the same size as the camera's picture.
    pub segments: &'a ViewSegments,
}

/// A part of the object, or a piece of one that views tell apart but whose border with the others is not an edge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// From 1: parts first, those with the most light first; then the pieces of each.
    pub id: u16,
    /// The part of which this is a piece; `None` for a part.
    pub piece_of: Option<u16>,
    /// Number of its Gaussians.
    pub gaussians: usize,
    /// The light of its Gaussians in all views, in pixels.
    pub light: f64,
    /// The mean, over the pairs of Gaussians on its border, of the share of views that split them; 1 if it has no border.
    pub separation: f64,
}

/// The parts of the object.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// For every Gaussian, the id of its piece; of its part if that has no pieces.
    pub id_of_gaussian: Vec<u16>,
    /// For every Gaussian, the share of the views' evidence about its pairs that agrees with the parts, 0 to 1; 0 if no
    /// view sees it.
    pub confidence: Vec<f32>,
    /// By id. A part has either no pieces or several.
    pub parts: Vec<Part>,
}

/// A region that was found later, where the answer what the object is names a thing without a number.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FoundThing {
    /// Its index among the things without a number.
    pub thing: usize,
    /// The new number.
    pub id: u16,
    /// The regions from which it was cut, the one that lost most first.
    pub cut_from: Vec<u16>,
}

impl Parts {
    /// The part that an id stands for: that of a piece, or itself.
    pub fn part_of(&self, id: u16) -> u16 {
        self.parts[usize::from(id) - 1].piece_of.unwrap_or(id)
    }

    /// For every Gaussian, the id of its part.
    pub fn part_of_gaussian(&self) -> Vec<u16> {
        self.id_of_gaussian.iter().map(|&id| self.part_of(id)).collect()
    }

    /// Number of parts, without pieces.
    pub fn count(&self) -> usize {
        self.parts.iter().filter(|part| part.piece_of.is_none()).count()
    }
}

/// Finds the parts. `origins` says where in its file a mesh's Gaussians come from, and is empty for a splat. The result does
/// not depend on the number of threads.
///
/// The whole object is one part if no view sees anything, or if none sees enough of any two Gaussians to compare them.
pub fn find(gaussians: &Gaussians, origins: &[Origin], views: &[SegmentedView], progress: Progress) -> Parts {
    let bar = progress.bar("parts", 2 * views.len() as u64);
    let mut light = vec![0.0f32; gaussians.len()];
    let mut seen_by = vec![0u32; gaussians.len()];
    let mut toward_views = vec![Vector3::zeros(); gaussians.len()];
    let mut regions = Vec::with_capacity(views.len());
    for view in views {
        let eye = view.camera.center_in_world();
        let membership = Membership::new(gaussians.len(), view);
        for (i, seen) in membership.light().enumerate().filter(|(_, seen)| *seen > 0.0) {
            light[i] += seen;
            seen_by[i] += 1;
            let toward = (eye - gaussians.center(i)).try_normalize(0.0).unwrap_or_default();
            toward_views[i] += toward.map(|value| value as f32) * seen;
        }
        regions.push(Regions::new(&membership, view.segments));
        bar.inc(1);
    }
    let seen: Vec<u32> = (0..gaussians.len() as u32).filter(|&i| light[i as usize] > LEAST_LIGHT).collect();
    let nearest = Nearest::new(seen.iter().map(|&i| gaussians.positions[i as usize]));
    let normals = Normals::new(gaussians, &seen, &nearest, &light, &toward_views);
    let pairs = Pairs::new(gaussians, &seen, &nearest);
    undersegmentation::mark(&mut regions, &views.iter().map(|view| view.segments).collect::<Vec<_>>());
    let mut evidence = Evidence::new(&pairs);
    for (view, regions) in views.iter().zip(&regions) {
        // Computed a second time, to save the memory that those of all views would take.
        evidence.add(&pairs, &Membership::new(gaussians.len(), view), view.segments, regions);
        bar.inc(1);
    }
    bar.finish_and_clear();
    evidence.add_structure(&pairs, origins, |i| light[i] / seen_by[i] as f32);
    let borders = || evidence.borders(&pairs, &normals);

    let (core_of, cores) = compact(&linkage::contract(gaussians.len(), borders(), CORE_SPLIT), &seen);
    let between_cores = linkage::between(&core_of, cores, borders());
    let light_of_core = sum_by(&core_of, cores, &seen, &light);
    let near_split = |border: &Border| if border.near > 0 { border.split() } else { f64::INFINITY };
    let piece_of_core = link(cores, &between_cores, PIECE_SPLIT, near_split);
    let piece_of_core = linkage::absorb(piece_of_core, &between_cores, &light_of_core, SCRAP_SHARE);
    let group_of = |groups: &[u32], member: u32| groups.get(member as usize).copied().unwrap_or(NONE);
    let of_gaussian = |of_core: &[u32]| -> Vec<u32> { core_of.iter().map(|&core| group_of(of_core, core)).collect() };
    let piece_of = of_gaussian(&piece_of_core);
    let planes = Planes::new(gaussians, &seen, &nearest, &toward_views, &piece_of, borders());
    let between_cores = linkage::between(&core_of, cores, borders().chain(planes.borders(&piece_of, borders())));
    let between_pieces = linkage::between(&piece_of_core, cores, between_cores.iter().copied());
    let part_of_piece = link(cores, &between_pieces, PART_STRENGTH, strength);
    let part_of_core = piece_of_core.iter().map(|&piece| group_of(&part_of_piece, piece)).collect();
    let crumb_share = CRUMB_SHARE.max(CRUMB_GAUSSIANS / seen.len().max(1) as f64);
    let part_of_core = linkage::absorb(part_of_core, &between_cores, &light_of_core, crumb_share);
    let least_share = crumb_share.max(ASKED_PIECE_SHARE);
    let piece_of_core = pieces(&piece_of_core, &part_of_core, &between_cores, &light_of_core, least_share);
    finish(gaussians, &of_gaussian(&part_of_core), &of_gaussian(&piece_of_core), &seen, &light, &borders)
}

/// Borders between nodes.
type Borders<'a> = &'a [(u32, u32, Border)];

/// The pieces to ask about within parts, named by one of their cores; [`NONE`] if there is none. Printed fields are not
/// pieces of their own, unless a part has no others.
fn pieces(piece_of: &[u32], part_of: &[u32], borders: Borders, light: &[f64], least_share: f64) -> Vec<u32> {
    let inside: Vec<(u32, u32, Border)> = borders
        .iter()
        .copied()
        .filter(|&(a, b, _)| part_of[a as usize] == part_of[b as usize] && part_of[a as usize] != NONE)
        .collect();
    // A crumb may have joined a different part from the rest of its piece.
    let mut first: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let within: Vec<u32> = (0..)
        .zip(piece_of.iter().zip(part_of))
        .map(|(core, (&piece, &part))| *first.entry((part, piece)).or_insert(core))
        .collect();
    let between = linkage::between(&within, within.len(), inside.iter().copied());
    let joined = |split: &dyn Fn(&Border) -> f64| {
        let joined = link(within.len(), &between, PIECE_SPLIT, split);
        let joined = within.iter().map(|&piece| joined[piece as usize]).collect();
        linkage::absorb(joined, &inside, light, least_share)
    };
    let by_shape = joined(&|border| match border.smooth_share() {
        share if share >= SURE_PRINT_SHARE => -share,
        _ => border.split(),
    });
    let by_color = joined(&Border::split);
    let mut of_part: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    for (&part, &piece) in part_of.iter().zip(&by_shape).filter(|(_, piece)| **piece != NONE) {
        of_part.entry(part).or_default().insert(piece);
    }
    let has_several = |part: &u32| of_part.get(part).is_some_and(|pieces| pieces.len() > 1);
    let of_core = part_of.iter().zip(by_shape.iter().zip(&by_color));
    of_core.map(|(part, (&shape, &color))| if has_several(part) { shape } else { color }).collect()
}

/// How much a border separates two parts, 0 to 1: the share of views that split it, times how much of an edge it is. A
/// border of print is no edge at all. Segments that span the border but are split by most other views do not count
/// against it.
fn strength(border: &Border) -> f64 {
    if border.smooth_share() >= PRINT_SHARE {
        return 0.0;
    }
    let angle = (border.angle_deg + PRIOR_PAIRS * SURE_EDGE_DEG) / (f64::from(border.angles) + PRIOR_PAIRS);
    let [smooth, edge] = SMOOTH_TO_EDGE_DEG;
    border.trusted_split() * ((angle - smooth) / (edge - smooth)).clamp(0.0, 1.0)
}

/// Renumbers the groups of the seen Gaussians from 0, in the order of the first of each; others, and those in no group,
/// get [`NONE`].
fn compact(group: &[u32], seen: &[u32]) -> (Vec<u32>, usize) {
    let (mut number, mut groups) = (vec![NONE; group.len()], 0);
    let mut of = vec![NONE; group.len()];
    for &i in seen {
        let Some(number) = number.get_mut(group[i as usize] as usize) else { continue };
        if *number == NONE {
            *number = groups;
            groups += 1;
        }
        of[i as usize] = *number;
    }
    (of, groups as usize)
}

fn sum_by(group: &[u32], groups: usize, seen: &[u32], light: &[f32]) -> Vec<f64> {
    let mut sums = vec![0.0; groups];
    for &i in seen {
        if let Some(sum) = sums.get_mut(group[i as usize] as usize) {
            *sum += f64::from(light[i as usize]);
        }
    }
    sums
}

/// Numbers the parts and their pieces by their light, and gives Gaussians in none of them to the nearest.
fn finish<B: Iterator<Item = (u32, u32, Border)>>(
    gaussians: &Gaussians,
    part_of: &[u32],
    piece_of: &[u32],
    seen: &[u32],
    light: &[f32],
    borders: &impl Fn() -> B,
) -> Parts {
    let (part_of, parts) = compact(part_of, seen);
    if parts == 0 {
        let whole = Part { id: 1, piece_of: None, gaussians: gaussians.len(), light: 0.0, separation: 1.0 };
        let confidence = vec![0.0; gaussians.len()];
        return Parts { id_of_gaussian: vec![1; gaussians.len()], confidence, parts: vec![whole] };
    }
    let numbers = Numbers::new(&part_of, parts, piece_of, seen, light);
    let mut ids: Vec<u16> = (0..gaussians.len()).map(|i| numbers.id(part_of[i], piece_of[i])).collect();
    let known: Vec<usize> = (0..gaussians.len()).filter(|&i| ids[i] > 0).collect();
    let nearest = Nearest::new(known.iter().map(|&i| gaussians.positions[i]));
    let of_known: Vec<u16> = known.iter().map(|&i| ids[i]).collect();
    parallel::for_each_mut(&mut ids, |i, id| {
        if *id == 0 {
            *id = nearest.find(gaussians.positions[i], 1).first().map_or(1, |&(_, n)| of_known[n as usize]);
        }
    });
    let mut found = Parts { id_of_gaussian: ids, confidence: vec![0.0; gaussians.len()], parts: numbers.parts };
    for &id in &found.id_of_gaussian {
        let part = &mut found.parts[usize::from(id) - 1];
        part.gaussians += 1;
        if let Some(whole) = part.piece_of {
            found.parts[usize::from(whole) - 1].gaussians += 1;
        }
    }
    measure(&mut found, borders());
    found
}

/// Fills in how clearly the parts and their Gaussians are separated.
fn measure(found: &mut Parts, borders: impl Iterator<Item = (u32, u32, Border)>) {
    let mut around = vec![Border::default(); found.parts.len()];
    let mut agreement = vec![[0.0f64; 2]; found.id_of_gaussian.len()];
    for (a, b, border) in borders {
        let ids = [a, b].map(|i| found.id_of_gaussian[i as usize]);
        let parts = ids.map(|id| found.part_of(id));
        let agrees = if parts[0] == parts[1] { border.weight - border.split } else { border.split };
        for i in [a, b] {
            agreement[i as usize][0] += agrees;
            agreement[i as usize][1] += border.weight;
        }
        if ids[0] != ids[1] {
            for side in 0..2 {
                around[usize::from(ids[side]) - 1] += border;
                if parts[0] != parts[1] && parts[side] != ids[side] {
                    around[usize::from(parts[side]) - 1] += border;
                }
            }
        }
    }
    for (part, border) in found.parts.iter_mut().zip(&around) {
        part.separation = if border.weight > 0.0 { border.split() } else { 1.0 };
    }
    for (confidence, [agrees, all]) in found.confidence.iter_mut().zip(agreement) {
        *confidence = if all > 0.0 { (agrees / all) as f32 } else { 0.0 };
    }
}

/// The ids of parts and pieces.
struct Numbers {
    parts: Vec<Part>,
    /// By the number of the part: its id, and the id of each of its pieces by the piece's name; no pieces if it has
    /// only one.
    ids: Vec<(u16, Vec<(u32, u16)>)>,
}

impl Numbers {
    fn new(part_of: &[u32], parts: usize, piece_of: &[u32], seen: &[u32], light: &[f32]) -> Self {
        let mut of_part = vec![(0.0, BTreeMap::<u32, f64>::new()); parts];
        for &i in seen {
            let (i, part) = (i as usize, part_of[i as usize]);
            if part != NONE {
                let (sum, pieces) = &mut of_part[part as usize];
                *sum += f64::from(light[i]);
                *pieces.entry(piece_of[i]).or_default() += f64::from(light[i]);
            }
        }
        let mut order: Vec<usize> = (0..parts).collect();
        order.sort_by(|&a, &b| of_part[b].0.total_cmp(&of_part[a].0));
        let mut found = Self { parts: Vec::new(), ids: vec![(0, Vec::new()); parts] };
        for &part in &order {
            found.ids[part].0 = found.add(None, of_part[part].0);
        }
        for &part in &order {
            // Gaussians in no piece belong to the part's largest.
            let mut pieces: Vec<(u32, f64)> = of_part[part]
                .1
                .iter()
                .filter(|(piece, _)| **piece != NONE)
                .map(|(&piece, &light)| (piece, light))
                .collect();
            pieces.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            if pieces.len() > 1 {
                let whole = found.ids[part].0;
                found.ids[part].1 =
                    pieces.into_iter().map(|(piece, light)| (piece, found.add(Some(whole), light))).collect();
            }
        }
        found
    }

    fn add(&mut self, piece_of: Option<u16>, light: f64) -> u16 {
        // Each has at least CRUMB_SHARE of the light, unless it is the only part.
        let id = u16::try_from(self.parts.len() + 1).expect("parts are few");
        self.parts.push(Part { id, piece_of, gaussians: 0, light, separation: 1.0 });
        id
    }

    /// The id of a Gaussian in this part and piece; 0 if it is in no part.
    fn id(&self, part: u32, piece: u32) -> u16 {
        let Some((whole, pieces)) = self.ids.get(part as usize) else { return 0 };
        let of_piece = pieces.iter().find(|(name, _)| *name == piece).or(pieces.first());
        of_piece.map_or(*whole, |(_, id)| *id)
    }
}
