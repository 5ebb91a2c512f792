//! The masks of several views that show one thing.

use super::agreement::{Light, agreement};
use super::proposals::{ByView, Masks, Proposal};
use crate::segment::mask::Mask;

/// Two masks of different views with at least this agreement show the same thing, as a segment with this IoU shows a part
/// ([`crate::consensus::masks`]).
const SAME: f64 = 0.5;
/// A mask counts if at least this many other views confirm it, and half of those that see the place: in one, it may be a shadow, or
/// a gloss that moves with the view.
const LEAST_CONFIRMING: usize = 2;

/// Whether a mask of a view shows something that has no number.
pub(super) type IsNew<'a> = &'a dyn Fn(usize, &Mask) -> bool;

/// A thing, as several views show it.
pub(super) struct Sighting<'a> {
    /// By view; `None` for one that does not see the thing, or whose masks do not agree.
    pub masks: Vec<Option<&'a Mask>>,
    /// By Gaussian: its light in the views with a mask.
    pub light: Vec<Light>,
}

/// Whether enough views have a mask that is new: otherwise none of these can be confirmed.
pub(super) fn is_possible(masks: &Masks, is_new: IsNew) -> bool {
    let has_new = |(view, masks): (usize, &Vec<Mask>)| masks.iter().any(|mask| is_new(view, mask));
    masks.iter().enumerate().filter(|of| has_new(*of)).count() >= LEAST_CONFIRMING
}

impl<'a> Sighting<'a> {
    /// The sighting of which the views are surest: of all masks that show something new, the one that the others confirm most;
    /// `None` if too few confirm any.
    pub fn of(by_view: &'a ByView, is_new: IsNew) -> Option<Self> {
        let seeing = by_view.iter().filter(|of| !of.is_empty()).count();
        let mut best: Option<(f64, Vec<(usize, &Proposal)>)> = None;
        for (view, proposals) in by_view.iter().enumerate() {
            for proposal in proposals.iter().filter(|proposal| is_new(view, &proposal.mask)) {
                let others = by_view.iter().enumerate().filter(|(other, _)| *other != view);
                let confirming: Vec<(usize, f64, &Proposal)> =
                    others.filter_map(|(other, of)| nearest(proposal, of).map(|(by, of)| (other, by, of))).collect();
                let confirmed_by: f64 = confirming.iter().map(|(_, agreement, _)| agreement).sum();
                let is_confirmed = confirming.len() >= LEAST_CONFIRMING && 2 * confirming.len() >= seeing - 1;
                if is_confirmed && best.as_ref().is_none_or(|(most, _)| confirmed_by > *most) {
                    let others = confirming.into_iter().map(|(other, _, of)| (other, of));
                    best = Some((confirmed_by, std::iter::once((view, proposal)).chain(others).collect()));
                }
            }
        }
        let (_, shown) = best?;
        let mut masks = vec![None; by_view.len()];
        let mut light = Vec::new();
        for (view, Proposal { mask, light: of_view }) in shown {
            masks[view] = Some(mask);
            light.extend(of_view);
        }
        Some(Self { masks, light: Light::added_up(light) })
    }
}

/// The proposal that agrees best with one of another view, if it shows the same; among equals, the first.
fn nearest<'a>(proposal: &Proposal, others: &'a [Proposal]) -> Option<(f64, &'a Proposal)> {
    let compared = others.iter().filter_map(|other| Some((agreement(&proposal.light, &other.light)?, other)));
    compared.filter(|(agreement, _)| *agreement >= SAME).reduce(|a, b| if b.0 > a.0 { b } else { a })
}
