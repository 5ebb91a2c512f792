//! Gives a number to what has none: things that the answer about the object names, with a place in a photo, and that no part
//! shows.
//!
//! SAM's automatic masks miss what lies flat on something else and changes its look from view to view, such as a blade on a
//! board. Whoever sees it can point at it:
//! 1. [`proposals`]: SAM is prompted at that place, and in other views where they show the Gaussians that are there, on the
//!    whole object and, if that shows anything new, enlarged;
//! 2. [`sighting`]: of all masks, the one is taken that other views confirm most, with the masks that confirm it, also those
//!    of the views in which SAM was not prompted before;
//! 3. [`numbering`]: what these masks show and has no number of its own becomes a part.
//!
//! A mask that holds every part whole or not at all shows nothing new. So does one that too few views confirm. What the answer
//! knows to be inside, or a part that it takes for two, thus leaves the parts as they are.

mod agreement;
mod numbering;
mod proposals;
mod sighting;

use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::scene::Photo;
use crate::segment::mask::Mask;
use crate::segment::{SegmentError, Segmenter, SelectionOptions, Shown};

pub use numbering::{Numbering, Sighted};
use proposals::{Masks, Points, Prompts, lit};
use sighting::{Sighting, is_possible};

/// A view in which to look.
#[derive(Clone, Copy)]
pub struct Look<'a> {
    pub camera: &'a Camera,
    /// All that the view shows: the object's Gaussians first.
    pub cloud: &'a Gaussians,
    pub photo: &'a Photo,
}

/// A place in a view: its index, and pixels from the upper left corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    pub view: usize,
    pub at: [f64; 2],
}

/// Why a thing gets no number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Missed {
    /// Too few views confirm a mask that shows more than what has a number.
    Unconfirmed,
    /// What the views agree on has a number already, but for crumbs.
    Numbered,
}

/// Looks for what is at these places, one after the other, and gives it numbers.
///
/// # Errors
/// If SAM fails.
pub fn look(
    segmenter: &Segmenter,
    looks: &[Look],
    places: &[Place],
    numbering: &mut Numbering,
    selection: &SelectionOptions,
) -> Result<Vec<Result<Sighted, Missed>>, SegmentError> {
    let count = numbering.id_of_gaussian.len();
    let prompts = Prompts::new(looks, places, count);
    let propose = |points: &Points, shown, wanted: &[bool]| points.masks(segmenter, looks, shown, wanted, selection);
    let mut found = propose(&prompts.best, Shown::Whole, &vec![true; places.len()])?;
    // Where nothing shows more than what has a number, a closer look would not either; it takes as long again.
    let wanted: Vec<bool> =
        found.iter().map(|masks| is_possible(masks, &|view, mask| numbering.is_new(view, mask))).collect();
    for (masks, closer) in found.iter_mut().zip(propose(&prompts.best, Shown::Enlarged, &wanted)?) {
        masks.iter_mut().zip(closer).for_each(|(masks, more)| masks.extend(more));
    }
    let add = |(place, masks): (usize, &Masks)| {
        let is_new = |view: usize, mask: &Mask| numbering.is_new(view, mask);
        // Something may have got its number by now.
        if !is_possible(masks, &is_new) {
            return Ok(Err(Missed::Numbered));
        }
        let by_view = lit(looks, masks, count);
        let Some(mut sighting) = Sighting::of(&by_view, &is_new) else { return Ok(Err(Missed::Unconfirmed)) };
        let only: Vec<bool> = (0..places.len()).map(|of| of == place).collect();
        let rest = lit(looks, &propose(&prompts.rest, Shown::Whole, &only)?[place], count);
        sighting.confirm(&rest);
        Ok(numbering.add(looks, &sighting).ok_or(Missed::Numbered))
    };
    found.iter().enumerate().map(add).collect()
}
