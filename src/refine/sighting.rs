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
                let confirming: Vec<(usize, f64, &Proposal)> = others
                    .filter_map(|(other, of)| nearest(&proposal.light, of).map(|(by, of)| (other, by, of)))
                    .collect();
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

    /// Adds the masks of further views that show the same.
    pub fn confirm(&mut self, by_view: &'a ByView) {
        let shown = |of: &'a Vec<Proposal>| nearest(&self.light, of).map(|(_, of)| of);
        let more: Vec<Option<&Proposal>> = by_view.iter().map(shown).collect();
        for (mask, of) in self.masks.iter_mut().zip(&more) {
            *mask = mask.or(of.map(|of| &of.mask));
        }
        self.light.extend(more.into_iter().flatten().flat_map(|of| &of.light));
        self.light = Light::added_up(std::mem::take(&mut self.light));
    }
}

/// The proposal that agrees best with what other views show, if it shows the same; among equals, the first.
fn nearest<'a>(light: &[Light], others: &'a [Proposal]) -> Option<(f64, &'a Proposal)> {
    let compared = others.iter().filter_map(|other| Some((agreement(light, &other.light)?, other)));
    compared.filter(|(agreement, _)| *agreement >= SAME).reduce(|a, b| if b.0 > a.0 { b } else { a })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mask of `columns` of a picture that shows a Gaussian in each of ten columns, from the column numbered `first` on.
    fn proposal(first: u32, columns: std::ops::Range<u32>) -> Proposal {
        let light = |gaussian: u32| {
            let is_inside = columns.contains(&(gaussian - first));
            Light { gaussian, all: 1.0, inside: f32::from(u8::from(is_inside)) }
        };
        Proposal {
            mask: Mask::from_fn(10, 1, |x, _| columns.contains(&x)),
            light: (first..first + 10).map(light).collect(),
        }
    }

    #[test]
    fn views_that_are_asked_later_add_what_shows_the_same() {
        // The thing is Gaussians 3 to 6, as views 0 to 2 show it.
        let first: ByView =
            vec![vec![proposal(0, 3..7)], vec![proposal(0, 3..7)], vec![proposal(0, 3..7)], vec![], vec![]];
        let mut sighting = Sighting::of(&first, &|_, _| true).unwrap();
        // View 3 shows it and one Gaussian more; view 4 shows something else.
        let later: ByView = vec![
            vec![proposal(0, 0..9)],
            vec![],
            vec![],
            vec![proposal(2, 0..2), proposal(2, 1..6)],
            vec![proposal(0, 7..9)],
        ];
        sighting.confirm(&later);
        let columns = |mask: &Mask| (0..10).filter(|x| mask.contains(*x, 0)).collect::<Vec<u32>>();
        let shown: Vec<_> = sighting.masks.iter().map(|mask| mask.map(columns)).collect();
        let known = Some(vec![3, 4, 5, 6]);
        assert_eq!(shown, [known.clone(), known.clone(), known, Some(vec![1, 2, 3, 4, 5]), None]);
        let inside: Vec<(u32, f32, f32)> = sighting.light.iter().map(|of| (of.gaussian, of.all, of.inside)).collect();
        assert_eq!(inside[2..5], [(2, 4.0, 0.0), (3, 4.0, 4.0), (4, 4.0, 4.0)]);
        assert_eq!(inside[7..11], [(7, 4.0, 1.0), (8, 4.0, 0.0), (9, 4.0, 0.0), (10, 1.0, 0.0)]);
    }
}
