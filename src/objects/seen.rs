//! In how many photos an object is seen, and how much of it is hidden.

use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::parallel;
use crate::render::render_foregrounds;
use crate::scene::{ObjectNumber, StandingObjects};
use crate::words::progress::Progress;

/// Most photos looked at; of more, those spread evenly over their order.
const MOST_PHOTOS: usize = 60;
/// Longest side of the pictures that are looked at, in pixels.
const LOOK_PX: u32 = 320;
/// Fewest of their pixels in which an object shows: a hundredth of the longest side in either direction, and more than the
/// Gaussians that shine through what hides them.
const FEWEST_PIXELS: usize = 10;
/// An object shows well if no more than this share of it is hidden, and no more than [`MOST_CUT_OFF`] of it is outside the picture.
const MOST_HIDDEN: f64 = 0.5;
const MOST_CUT_OFF: f64 = 0.05;

/// One object in one photo.
#[derive(Debug, Clone, Copy, PartialEq)]
struct InPhoto {
    /// Pixels in which it is seen.
    seen: usize,
    /// Pixels in which it would be seen if it were alone.
    alone: usize,
    /// Share of its Gaussians whose centres the picture shows.
    within: f64,
}

/// All objects in one photo.
pub struct Look {
    /// Index of the view.
    view: usize,
    objects: Vec<InPhoto>,
}

/// An object in all photos.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    pub photos: usize,
    /// Share of its outline in these photos that something else hides.
    pub hidden: f64,
}

/// Looks at every object in the photos.
pub fn look(found: &StandingObjects, progress: Progress) -> Vec<Look> {
    let alone: Vec<Gaussians> = ObjectNumber::first(found.count).map(|number| found.gaussians_of(number)).collect();
    let count = found.views.len().min(MOST_PHOTOS);
    let chosen: Vec<usize> = (0..count).map(|n| n * found.views.len() / count).collect();
    let bar = progress.bar("objects", count as u64).with_message("photos");
    let look = |&view: &usize| {
        let camera = reduced(&found.views[view].camera);
        let labels = found.shown(&camera);
        let in_photo = |(number, gaussians): (u32, &Gaussians)| {
            let by_itself = render_foregrounds(gaussians, &camera, &vec![number; gaussians.len()]);
            let alone = by_itself.iter().filter(|label| label.is_some()).count();
            let both =
                labels.iter().zip(&by_itself).filter(|(label, alone)| **label == Some(number) && alone.is_some());
            InPhoto { seen: both.count(), alone, within: within(gaussians, &camera) }
        };
        let objects = (1..).zip(&alone).map(in_photo).collect();
        bar.inc(1);
        Look { view, objects }
    };
    let looks = parallel::map(&chosen, look);
    bar.finish_and_clear();
    looks
}

/// The view that shows most objects well; among those with as many, the one in which they are largest.
pub fn shows_most(looks: &[Look], count: usize) -> usize {
    let shown = |look: &Look| {
        let well = |object: &&InPhoto| {
            object.seen >= FEWEST_PIXELS
                && object.seen as f64 >= (1.0 - MOST_HIDDEN) * object.alone as f64
                && object.within >= 1.0 - MOST_CUT_OFF
        };
        let well: Vec<&InPhoto> = look.objects[..count].iter().filter(well).collect();
        (well.len(), well.iter().map(|object| object.seen).sum::<usize>())
    };
    // The first of equals.
    looks.iter().rev().max_by_key(|look| shown(look)).map_or(0, |look| look.view)
}

/// What all photos show of an object.
pub fn summary(looks: &[Look], object: ObjectNumber) -> Seen {
    let of_object = looks.iter().map(|look| look.objects[object.get() as usize - 1]);
    let showing: Vec<InPhoto> = of_object.filter(|object| object.seen >= FEWEST_PIXELS).collect();
    let [seen, alone] =
        [|of: &InPhoto| of.seen, |of: &InPhoto| of.alone].map(|pixels| showing.iter().map(pixels).sum());
    let share: f64 = seen as f64 / Ord::max(alone, 1_usize) as f64;
    Seen { photos: showing.len(), hidden: if showing.is_empty() { 1.0 } else { 1.0 - share } }
}

/// The same camera with a small picture.
fn reduced(camera: &Camera) -> Camera {
    let intrinsics = camera.intrinsics;
    let longest = intrinsics.width.max(intrinsics.height);
    if longest <= LOOK_PX {
        return camera.clone();
    }
    let side = |length: u32| (length * LOOK_PX / longest).max(1);
    Camera { intrinsics: intrinsics.resized(side(intrinsics.width), side(intrinsics.height)), ..camera.clone() }
}

/// The share of the Gaussians whose centres a camera's picture shows.
fn within(gaussians: &Gaussians, camera: &Camera) -> f64 {
    let (width, height) = (f64::from(camera.intrinsics.width), f64::from(camera.intrinsics.height));
    let is_shown = |i: &usize| {
        let pixel = camera.pixel(camera.point_in_camera(gaussians.center(*i)));
        pixel.is_some_and(|at| (0.0..width).contains(&at.x) && (0.0..height).contains(&at.y))
    };
    (0..gaussians.len()).filter(is_shown).count() as f64 / gaussians.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(view: usize, objects: &[(usize, usize, f64)]) -> Look {
        let objects = objects.iter().map(|&(seen, alone, within)| InPhoto { seen, alone, within });
        Look { view, objects: objects.collect() }
    }

    #[test]
    fn a_photo_in_which_all_objects_show_well_is_chosen_and_hidden_ones_are_counted() {
        let looks = [
            look(0, &[(500, 500, 1.0), (40, 100, 1.0)]),
            look(1, &[(200, 210, 1.0), (90, 100, 1.0)]),
            look(2, &[(900, 900, 0.4), (95, 100, 1.0)]),
            look(3, &[(0, 400, 1.0), (5, 100, 1.0)]),
        ];
        assert_eq!(shows_most(&looks, 2), 1);
        let second = summary(&looks, ObjectNumber::first(2).last().unwrap());
        assert_eq!(second.photos, 3, "5 pixels are too few");
        assert!((second.hidden - 0.25).abs() < 1e-12, "{second:?}");
        let unseen = summary(&looks[3..], ObjectNumber::first(1).next().unwrap());
        assert_eq!(unseen, Seen { photos: 0, hidden: 1.0 });
    }
}
