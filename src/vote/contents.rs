//! The contents of a part, from the answers that agree on its material and form.

use super::estimate::middle_and_hull;
use super::{Contents, Filled};
use crate::materials::MaterialLibrary;
use crate::materials::fillings::Filling;
use crate::numeric::median;
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
        Inside::Filled { filling, share, density_kg_m3 } => {
            let filling = library.filling(filling)?;
            Some((filling, *share, density(filling, *density_kg_m3)))
        }
        Inside::Empty | Inside::Unknown => None,
    };
    let fillings: Vec<(&Filling, Range, Estimate)> = said.iter().filter_map(named).collect();
    if !is_most(fillings.len()) {
        return Some(Contents::Unknown);
    }
    let naming = |name: &str| fillings.iter().filter(|(filling, ..)| filling.name == name).count();
    let most = fillings.iter().map(|(filling, ..)| *filling);
    let most = most.reduce(|best, next| if naming(&next.name) > naming(&best.name) { next } else { best })?;
    let share = middle_and_hull(fillings.iter().map(|(_, share, _)| *share));
    let density_kg_m3 = combined(fillings.iter().map(|(.., density)| *density));
    Some(Contents::Filled(Filled { density_kg_m3, ..filled(most, share) }))
}

/// This filling, as the table has it, in this share of the hollow.
pub(super) fn filled(filling: &Filling, share: Estimate) -> Filled {
    Filled {
        filling: filling.name.clone(),
        share,
        density_kg_m3: Estimate::from(filling.density_kg_m3),
        youngs_modulus_pa: Estimate::from(filling.youngs_modulus_pa),
        poisson_ratio: Estimate::from(filling.poisson_ratio),
        law: filling.law,
    }
}

/// The density of a filling: that of its row; or, if the answer says how dense this product is, the middle of what it says,
/// within the hull of both.
fn density(filling: &Filling, said: Option<Range>) -> Estimate {
    let row = Estimate::from(filling.density_kg_m3);
    said.map_or(row, |said| Estimate::new(said.low.min(row.low), said.mid(), said.high.max(row.high)))
}

/// The median of the middles, and the hull.
fn combined(densities: impl Iterator<Item = Estimate> + Clone) -> Estimate {
    let is_named = "more than half of the answers name a filling";
    let hull = densities.clone().map(|density| Range::new(density.low, density.high)).reduce(Range::hull);
    let Range { low, high } = hull.expect(is_named);
    Estimate::new(low, median(densities.map(|density| density.mid).collect()).expect(is_named), high)
}
