//! The contents of a part, from the answers that agree on its material and form.

use super::estimate::middle_and_hull;
use super::{Contents, Filled};
use crate::materials::MaterialLibrary;
use crate::materials::fillings::Filling;
use crate::query::{Answer, Form, Inside};
use crate::units::{Estimate, Range};

/// The contents of a shell: empty or filled if more than half of the answers that see a shell say so, else unknown. Of
/// several fillings, the one that most answers name gives its name, stiffness and law; all of them span the ranges of
/// share and density.
pub(super) fn contents(form: Form, answers: &[&Answer], library: &MaterialLibrary) -> Option<Contents> {
    if !matches!(form, Form::Shell { .. }) {
        return None;
    }
    let said: Vec<&Inside> = answers.iter().filter_map(|answer| answer.inside.as_ref()).collect();
    let is_most = |count: usize| 2 * count > said.len();
    if is_most(said.iter().filter(|inside| ***inside == Inside::Empty).count()) {
        return Some(Contents::Empty);
    }
    let named = |inside: &&Inside| match inside {
        Inside::Filled { filling, share } => Some((library.filling(filling)?, *share)),
        Inside::Empty | Inside::Unknown => None,
    };
    let fillings: Vec<(&Filling, Range)> = said.iter().filter_map(named).collect();
    if !is_most(fillings.len()) {
        return Some(Contents::Unknown);
    }
    let naming = |name: &str| fillings.iter().filter(|(filling, _)| filling.name == name).count();
    let most = fillings.iter().map(|(filling, _)| *filling);
    let most = most.reduce(|best, next| if naming(&next.name) > naming(&best.name) { next } else { best })?;
    let estimate = |property: fn(&Filling) -> Range| -> Estimate {
        middle_and_hull(fillings.iter().map(|(filling, _)| property(filling)))
    };
    Some(Contents::Filled(Filled {
        filling: most.name.clone(),
        share: middle_and_hull(fillings.iter().map(|(_, share)| *share)),
        density_kg_m3: estimate(|filling| filling.density_kg_m3),
        youngs_modulus_pa: Estimate::from(most.youngs_modulus_pa),
        poisson_ratio: Estimate::from(most.poisson_ratio),
        law: most.law,
    }))
}
