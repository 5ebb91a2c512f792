//! SAM's masks at a place, in the views that see it best.

use std::collections::BTreeMap;

use super::agreement::{Light, SEEN_LIGHT};
use super::{Look, Place};
use crate::parallel;
use crate::render::{Projected, RenderOptions, contributions};
use crate::segment::mask::Mask;
use crate::segment::{SegmentError, Segmenter, SelectionOptions, Shown};

/// Radius around the place, in pixels, within which a Gaussian's light counts as there.
const RADIUS: f64 = 2.5;
/// Number of Gaussians that stand for the place: those with most of the light there.
const ANCHORS: usize = 12;
/// Another view sees the place if it sees Gaussians that have this share of the light there.
const SEEN_SHARE: f32 = 0.5;
/// Number of views besides the one of which the answer speaks, those that see most of these Gaussians, in which a thing is looked for:
/// each costs two runs of SAM's encoder. The rest cost one, once it is found.
const OTHER_VIEWS: usize = 4;

/// By view, SAM's masks for what is at a place; none in views in which it is not prompted.
pub(super) type Masks = Vec<Vec<Mask>>;

/// A mask that may show what is at a place.
pub(super) struct Proposal {
    pub mask: Mask,
    /// By Gaussian of the object, of those that the view sees.
    pub light: Vec<Light>,
}

/// As [`Masks`], with their light.
pub(super) type ByView = Vec<Vec<Proposal>>;

/// The points at which to prompt, in pixels, by place and view.
pub(super) struct Prompts {
    /// In the views that see the place best.
    pub best: Points,
    /// In the others that see it.
    pub rest: Points,
}

/// Points in pixels, by place.
pub(super) struct Points(Vec<InViews>);

/// A point in pixels by view.
type InViews = BTreeMap<usize, [f64; 2]>;

impl Prompts {
    /// Those for these places. `count` is the number of the object's Gaussians.
    pub fn new(looks: &[Look], places: &[Place], count: usize) -> Self {
        let seen = parallel::map(looks, |look| {
            let all = light(look, &vec![0; pixels(look)], count).into_iter();
            all.filter(|(.., light)| *light > SEEN_LIGHT).map(|(gaussian, _, light)| (gaussian, light)).collect()
        });
        let (best, rest) = places.iter().map(|place| points(looks, *place, &seen, count)).unzip();
        Self { best: Points(best), rest: Points(rest) }
    }
}

impl Points {
    /// For each place, the masks that SAM proposes if it sees this of the photos; none for those places that are not `wanted`.
    pub fn masks(
        &self,
        segmenter: &Segmenter,
        looks: &[Look],
        shown: Shown,
        wanted: &[bool],
        selection: &SelectionOptions,
    ) -> Result<Vec<Masks>, SegmentError> {
        let in_view = |view: &usize| -> Result<Vec<Vec<Mask>>, SegmentError> {
            let look = &looks[*view];
            let of_place = |(points, wanted): (&InViews, &bool)| points.get(view).filter(|_| *wanted).copied();
            let here: Vec<Option<[f64; 2]>> = self.0.iter().zip(wanted).map(of_place).collect();
            let points: Vec<[f64; 2]> = here.iter().flatten().copied().collect();
            if points.is_empty() {
                return Ok(here.iter().map(|_| Vec::new()).collect());
            }
            let mut found = segmenter.prompted(look.photo, &points, shown, selection)?.into_iter();
            let mut masks_at = |at: Option<[f64; 2]>| at.and_then(|_| found.next()).unwrap_or_default();
            let masks = here.into_iter().map(|at| masks_at(at).into_iter().map(|found| found.mask).collect());
            Ok(masks.collect())
        };
        let views: Vec<usize> = (0..looks.len()).collect();
        let by_view = parallel::try_map(&views, in_view)?;
        let mut by_view: Vec<_> = by_view.into_iter().map(Vec::into_iter).collect();
        Ok(wanted.iter().map(|_| by_view.iter_mut().filter_map(Iterator::next).collect()).collect())
    }
}

/// The Gaussians that a view sees, with their light in it, in pixels.
type Seen = Vec<(u32, f32)>;

/// The views that see a place best, with the point in pixels, and the rest of those that see it.
fn points(looks: &[Look], place: Place, seen: &[Seen], count: usize) -> (InViews, InViews) {
    let anchors = anchors(&looks[place.view], place.at, count);
    let others = looks.iter().zip(seen).enumerate().filter(|(view, _)| *view != place.view);
    let others = others.filter_map(|(view, (look, seen))| Some((view, where_seen(look, seen, &anchors)?)));
    let mut others: Vec<(usize, (f32, [f64; 2]))> = others.collect();
    others.sort_by(|(_, (a, _)), (_, (b, _))| b.total_cmp(a));
    let mut others = others.into_iter().map(|(view, (_, at))| (view, at));
    let best = std::iter::once((place.view, place.at)).chain(others.by_ref().take(OTHER_VIEWS)).collect();
    (best, others.collect())
}

/// The Gaussians with most of the light around a place of a view, each with its share.
fn anchors(look: &Look, [x, y]: [f64; 2], count: usize) -> BTreeMap<u32, f32> {
    let width = look.camera.intrinsics.width as usize;
    let is_there = |pixel: usize| {
        let offset = [(pixel % width) as f64 + 0.5 - x, (pixel / width) as f64 + 0.5 - y];
        offset[0] * offset[0] + offset[1] * offset[1] <= RADIUS * RADIUS
    };
    let labels: Vec<u16> = (0..pixels(look)).map(|pixel| u16::from(is_there(pixel))).collect();
    let mut there = light(look, &labels, count);
    there.retain(|(_, label, _)| *label == 1);
    there.sort_by(|a, b| b.2.total_cmp(&a.2).then(a.0.cmp(&b.0)));
    there.truncate(ANCHORS);
    let all: f32 = there.iter().map(|(.., light)| light).sum();
    there.into_iter().map(|(gaussian, _, light)| (gaussian, light / all)).collect()
}

/// How much light a view has of these Gaussians, in pixels, and their mean place in it; `None` if it does not see enough of them.
fn where_seen(look: &Look, seen_there: &Seen, anchors: &BTreeMap<u32, f32>) -> Option<(f32, [f64; 2])> {
    let intrinsics = &look.camera.intrinsics;
    let (mut sum, mut seen, mut all) = ([0.0; 2], 0.0f32, 0.0);
    for (gaussian, light) in seen_there {
        let Some(share) = anchors.get(gaussian) else { continue };
        let center = look.camera.point_in_camera(look.cloud.center(*gaussian as usize));
        let Some(pixel) = look.camera.pixel(center) else { continue };
        sum = [sum[0] + f64::from(*share) * pixel.x, sum[1] + f64::from(*share) * pixel.y];
        (seen, all) = (seen + share, all + light);
    }
    let at = sum.map(|sum| sum / f64::from(seen));
    let mut sides = at.iter().zip([intrinsics.width, intrinsics.height]);
    let is_inside = sides.all(|(at, side)| (0.0..f64::from(side)).contains(at));
    (seen >= SEEN_SHARE && is_inside).then_some((all, at))
}

/// The masks of a place with the light of the object's Gaussians, of which there are `count`.
pub(super) fn lit(looks: &[Look], masks: &Masks, count: usize) -> ByView {
    parallel::map_range(looks.len(), |view| lit_in(&looks[view], &masks[view], count))
}

fn lit_in(look: &Look, masks: &[Mask], count: usize) -> Vec<Proposal> {
    // As many as a label has bits.
    let masks = &masks[..masks.len().min(u16::BITS as usize)];
    if masks.is_empty() {
        return Vec::new();
    }
    let width = look.camera.intrinsics.width as usize;
    let bits = |pixel: usize| {
        let (x, y) = ((pixel % width) as u32, (pixel / width) as u32);
        masks.iter().enumerate().fold(0, |bits, (n, mask)| bits | u16::from(mask.contains(x, y)) << n)
    };
    let labels: Vec<u16> = (0..pixels(look)).map(bits).collect();
    let found = light(look, &labels, count);
    let proposal = |(n, mask): (usize, &Mask)| {
        let inside = |bits: u16, light: f32| if bits >> n & 1 == 1 { light } else { 0.0 };
        let light = found.iter().map(|&(gaussian, bits, all)| Light { gaussian, all, inside: inside(bits, all) });
        Proposal { mask: mask.clone(), light: Light::added_up(light.collect()) }
    };
    masks.iter().enumerate().map(proposal).collect()
}

/// The light of the object's Gaussians in the pixels of each label.
fn light(look: &Look, labels: &[u16], count: usize) -> Vec<(u32, u16, f32)> {
    let projected = Projected::new(look.cloud, look.camera, &RenderOptions::default());
    let mut found = contributions(look.cloud.len(), projected, labels, Some);
    found.truncate(found.partition_point(|(gaussian, ..)| (*gaussian as usize) < count));
    found
}

fn pixels(look: &Look) -> usize {
    look.camera.intrinsics.width as usize * look.camera.intrinsics.height as usize
}
