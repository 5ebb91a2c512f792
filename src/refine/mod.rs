//! Gives a number to what has none: things that the answer about the object names, with a place in a photo, and that no part
//! shows.
//!
//! SAM's automatic masks miss what lies flat on something else and changes its look from view to view, such as a blade on a
//! board. Whoever sees it can point at it:
//! 1. [`proposals`]: SAM is prompted at that place, and in other views where they show the Gaussians that are there, on the
//!    whole object and, if that shows anything new, enlarged;
//! 2. [`sighting`]: of all masks, the one is taken that other views confirm most, with the masks that confirm it;
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
use proposals::{ByView, Prompts};
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
    let prompts = Prompts::new(looks, places, numbering.id_of_gaussian.len());
    let propose = |shown, wanted: &[bool]| prompts.proposals(segmenter, looks, shown, wanted, selection);
    let mut found = propose(Shown::Whole, &vec![true; places.len()])?;
    // Where nothing shows more than what has a number, a closer look would not either; it takes as long again.
    let wanted: Vec<bool> =
        found.iter().map(|by_view| is_possible(by_view, &|view, mask| numbering.is_new(view, mask))).collect();
    for (by_view, closer) in found.iter_mut().zip(propose(Shown::Enlarged, &wanted)?) {
        by_view.iter_mut().zip(closer).for_each(|(proposals, more)| proposals.extend(more));
    }
    let add = |by_view: &ByView| {
        let is_new = |view: usize, mask: &Mask| numbering.is_new(view, mask);
        if !is_possible(by_view, &is_new) {
            return Err(Missed::Numbered);
        }
        let sighting = Sighting::of(by_view, &is_new).ok_or(Missed::Unconfirmed)?;
        numbering.add(looks, &sighting).ok_or(Missed::Numbered)
    };
    Ok(found.iter().map(add).collect())
}
