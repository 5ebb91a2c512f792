//! The parts of the object in 3D, on which the views agree: found before anything is asked about them.
//!
//! A single view may merge parts into one segment or split a part into several. A part is what many views separate from
//! its surroundings and what has a shape of its own:
//! 1. [`membership`]: how much of every Gaussian's light each segment of a view shows;
//! 2. [`neighbors`]: pairs of Gaussians, nearest neighbours and others a few Gaussians apart;
//! 3. [`evidence`]: for every pair, in how many of the views that see both some segment holds one and not the other,
//!    and the angle between the surface's normals ([`normals`]);
//! 4. [`linkage`]: joins Gaussians to pieces that views do not split, by average linkage over all pairs that cross
//!    their border, then pieces to parts across borders without an edge in the surface: a printed pattern is not a
//!    part.
//!
//! Crumbs join the neighbour from which views separate them least. Gaussians that are then in no part, because no view
//! sees them or they touch nothing, join the nearest part.

mod evidence;
mod linkage;
mod membership;
mod neighbors;
mod normals;

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::camera::Camera;
use crate::progress::Progress;
use crate::scene::gaussians::Gaussians;
use crate::scene::nearest::Nearest;
use crate::segment::tree::SegmentTree;
use evidence::Evidence;
use linkage::{Border, NONE, link};
use membership::Membership;
use neighbors::Pairs;
use normals::Normals;

/// Neighbours that views split by less are taken as one from the start, which leaves a sixth of the nodes to link.
const CORE_SPLIT: f64 = 0.02;
/// Pieces are joined while views split fewer of the pairs across their border, in the mean, than this. A border that
/// half of the views see has pairs of soft Gaussians on it, about half of whose light is on either side.
const PIECE_SPLIT: f64 = 0.2;
/// Pieces are joined to parts while the [`strength`] of their border is at most this.
const PART_STRENGTH: f64 = 0.2;
/// Angles in degrees between normals across a border: up to the first, the surface goes on smoothly; from the second,
/// it has an edge. Pairs on a smooth printed surface differ by 8 to 22 degrees, those across borders of parts by 42 and
/// more (the four fixtures and six measured objects).
const SMOOTH_TO_EDGE_DEG: [f64; 2] = [20.0, 50.0];
/// A border's mean angle starts from this many assumed pairs of [`SURE_EDGE_DEG`], so that few pairs do not decide.
const PRIOR_PAIRS: f64 = 20.0;
const SURE_EDGE_DEG: f64 = 60.0;
/// A piece with a smaller share of the object's light is a scrap, such as lie along borders: it joins a neighbour before
/// pieces are joined to parts, so that these touch each other.
const SCRAP_SHARE: f64 = 0.0002;
/// A part with a smaller share of the object's light is a crumb.
const CRUMB_SHARE: f64 = 0.003;
/// A Gaussian with less light than this in all views together, in pixels, counts as not seen.
const LEAST_LIGHT: f32 = 1.0;

/// A view with its segments.
#[derive(Debug, Clone, Copy)]
pub struct ViewTree<'a> {
    pub camera: &'a Camera,
    /// Of the same size as the camera's picture.
    pub tree: &'a SegmentTree,
}

/// The parts of the object.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// The part of every Gaussian, from 0; part 0 has the most light.
    pub part_of_gaussian: Vec<u32>,
    /// For every part, the light of its Gaussians in all views, in pixels.
    pub light: Vec<f64>,
    /// The mean, over the pairs of Gaussians on its border, of the share of views that split them; 1 if the part has no
    /// border.
    pub separation: Vec<f64>,
}

/// Finds the parts. The result does not depend on the number of threads.
///
/// If no view sees anything, the whole object is one part.
pub fn find(gaussians: &Gaussians, views: &[ViewTree], progress: Progress) -> Parts {
    let bar = progress.bar("parts", 2 * views.len() as u64);
    let mut light = vec![0.0f32; gaussians.len()];
    let mut toward_views = vec![Vector3::zeros(); gaussians.len()];
    for view in views {
        let eye = view.camera.center_in_world();
        for (i, seen) in Membership::new(gaussians, view).light().enumerate().filter(|(_, seen)| *seen > 0.0) {
            light[i] += seen;
            let toward = (eye - gaussians.center(i)).try_normalize(0.0).unwrap_or_default();
            toward_views[i] += toward.map(|value| value as f32) * seen;
        }
        bar.inc(1);
    }
    let seen: Vec<u32> = (0..gaussians.len() as u32).filter(|&i| light[i as usize] > LEAST_LIGHT).collect();
    let nearest = Nearest::new(seen.iter().map(|&i| gaussians.positions[i as usize]));
    let normals = Normals::new(gaussians, &seen, &nearest, &light, &toward_views);
    drop(toward_views);
    let pairs = Pairs::new(gaussians, &seen, &nearest);
    let mut evidence = Evidence::new(&pairs);
    for view in views {
        // A second time, rather than to keep those of all views.
        evidence.add(&pairs, &Membership::new(gaussians, view), view.tree);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let borders = || evidence.borders(&pairs, &normals);

    let (core_of, cores) = compact(&linkage::contract(gaussians.len(), borders(), CORE_SPLIT), &seen);
    let between_cores = linkage::between(&core_of, cores, borders());
    let light_of_core = sum_by(&core_of, cores, &seen, &light);
    let piece_of_core = link(cores, &between_cores, PIECE_SPLIT, Border::split);
    let piece_of_core = linkage::absorb(piece_of_core, &between_cores, &light_of_core, SCRAP_SHARE);
    let between_pieces = linkage::between(&piece_of_core, cores, between_cores.iter().copied());
    let part_of_piece = link(cores, &between_pieces, PART_STRENGTH, strength);
    let group_of = |groups: &[u32], member: u32| groups.get(member as usize).copied().unwrap_or(NONE);
    let part_of_core = piece_of_core.iter().map(|&piece| group_of(&part_of_piece, piece)).collect();
    let part_of_core = linkage::absorb(part_of_core, &between_cores, &light_of_core, CRUMB_SHARE);
    let part_of: Vec<u32> = core_of.iter().map(|&core| group_of(&part_of_core, core)).collect();
    finish(gaussians, &part_of, &seen, &light, borders())
}

/// How much a border separates two parts, 0 to 1: the share of views that split it, times how much of an edge it is.
fn strength(border: &Border) -> f64 {
    let angle = (border.angle_deg + PRIOR_PAIRS * SURE_EDGE_DEG) / (f64::from(border.angles) + PRIOR_PAIRS);
    let [smooth, edge] = SMOOTH_TO_EDGE_DEG;
    border.split() * ((angle - smooth) / (edge - smooth)).clamp(0.0, 1.0)
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

/// Numbers the parts by their light and gives what is in none of them to the nearest one.
fn finish(
    gaussians: &Gaussians,
    part_of: &[u32],
    seen: &[u32],
    light: &[f32],
    borders: impl Iterator<Item = (u32, u32, Border)>,
) -> Parts {
    let (mut part_of, parts) = compact(part_of, seen);
    if parts == 0 {
        return Parts { part_of_gaussian: vec![0; gaussians.len()], light: vec![0.0], separation: vec![1.0] };
    }
    let light = sum_by(&part_of, parts, seen, light);
    let mut order: Vec<usize> = (0..parts).collect();
    order.sort_by(|&a, &b| light[b].total_cmp(&light[a]));
    let mut rank = vec![0u32; parts];
    (0..).zip(&order).for_each(|(n, &part)| rank[part] = n);
    let known: Vec<(usize, u32)> = part_of.iter().copied().enumerate().filter(|(_, part)| *part != NONE).collect();
    let nearest = Nearest::new(known.iter().map(|&(i, _)| gaussians.positions[i]));
    part_of.par_iter_mut().enumerate().for_each(|(i, part)| {
        if *part == NONE {
            *part = nearest.find(gaussians.positions[i], 1).first().map_or(0, |&(_, n)| known[n as usize].1);
        }
        *part = rank[*part as usize];
    });
    let mut around = vec![Border::default(); parts];
    for (a, b, border) in borders {
        let (a, b) = (part_of[a as usize], part_of[b as usize]);
        if a != b {
            around[a as usize] += border;
            around[b as usize] += border;
        }
    }
    let separation = around.iter().map(|border| if border.weight > 0.0 { border.split() } else { 1.0 }).collect();
    Parts { part_of_gaussian: part_of, light: order.iter().map(|&part| light[part]).collect(), separation }
}
