//! The forms in which an object is built for a belief about it. What a part fills depends on the forms of others (a solid goes on inside a
//! sleeve, but not inside another solid), so the masses of a state come from the object built of the forms of this state.
//!
//! States that differ in materials alone share their forms. How thick a wall is matters to the part itself and to the solid inside it, so
//! states that differ in thicknesses alone share a few builds: each part is taken from one in which it and what is around it are as thick
//! as in the state.

use std::collections::{BTreeMap, BTreeSet};

use super::belief::states::State;
use super::belief::{PartMasses, Possibilities};
use super::mass::unknowns::Unknowns;
use super::mass::weights;
use super::{Built, Construction, Found, Options};
use crate::vote::MaterialField;

/// Objects are built in the most probable forms until there are this many: each takes time, and three parts of which it is in doubt whether
/// they are solid have eight combinations. In states of other forms, each part is taken from the nearest build that has its own form.
const MOST_BUILT: usize = 8;

/// Whether a part is solid, a wall around nothing that the answers know of, or a wall around a filling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Solid,
    Wall,
    FilledWall,
}

impl Kind {
    fn of(construction: &Construction) -> Self {
        match construction {
            Construction::Solid => Self::Solid,
            Construction::Wall { filled: None, .. } => Self::Wall,
            Construction::Wall { filled: Some(_), .. } => Self::FilledWall,
        }
    }
}

/// The forms that the parts of an object may have.
pub struct Forms<'a> {
    field: &'a MaterialField,
    found: &'a Found,
    possible: &'a Possibilities,
    /// By label and choice.
    constructions: Vec<Vec<Construction>>,
    /// By label and choice, the first choice of the label with the same form.
    first_alike: Vec<Vec<usize>>,
}

/// What an object weighs that is built of these forms.
pub struct BuiltForms {
    /// By label, the first of the choices with this form.
    forms: Vec<usize>,
    /// By label and choice of this form.
    masses: Vec<BTreeMap<usize, PartMasses>>,
    /// By label, the solid inside it, if any.
    cores: Vec<Option<u32>>,
}

impl<'a> Forms<'a> {
    pub fn of(
        field: &'a MaterialField,
        found: &'a Found,
        possible: &'a Possibilities,
        meters_per_unit: f64,
        options: &Options,
    ) -> Self {
        let of_label = |label: usize| -> Vec<Construction> {
            let part = |choice| possible.part(&field.parts, label, choice);
            let construction = |choice| found.construction(label, part(choice), Some(meters_per_unit), options);
            (0..possible.choices(label)).map(construction).collect()
        };
        let constructions: Vec<Vec<Construction>> = (0..field.parts.len()).map(of_label).collect();
        let first_alike = constructions.iter().map(|of_label| {
            let first = |of: &Construction| of_label.iter().position(|other| other.fills_like(of)).unwrap_or(0);
            of_label.iter().map(first).collect()
        });
        Self { first_alike: first_alike.collect(), field, found, possible, constructions }
    }

    fn kind(&self, label: usize, choice: usize) -> Kind {
        Kind::of(&self.constructions[label][choice])
    }

    /// The forms, by label, of which objects are to be built for these states: the most probable ones, best first, and then some with the
    /// kinds that none of these has.
    pub fn to_build(&self, states: &[State]) -> Vec<Vec<usize>> {
        let labels = 0..self.constructions.len();
        let mut probability_of: BTreeMap<Vec<Kind>, f64> = BTreeMap::new();
        for state in states {
            let kinds = labels.clone().map(|label| self.kind(label, state.choices[label])).collect();
            *probability_of.entry(kinds).or_default() += state.probability;
        }
        let mut ranked: Vec<(Vec<Kind>, f64)> = probability_of.into_iter().collect();
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut found: Vec<Vec<usize>> = Vec::new();
        for (kinds, _) in &ranked {
            if found.len() < MOST_BUILT {
                found.extend(self.of_kinds(kinds));
            }
        }
        let missing = |label: usize| -> Vec<Kind> {
            let built: BTreeSet<Kind> = found.iter().map(|forms| self.kind(label, forms[label])).collect();
            let possible: BTreeSet<Kind> = self.constructions[label].iter().map(Kind::of).collect();
            possible.difference(&built).copied().collect()
        };
        let missing: Vec<Vec<Kind>> = labels.map(missing).collect();
        for place in 0..missing.iter().map(Vec::len).max().unwrap_or(0) {
            let kinds = missing.iter().zip(&ranked[0].0).map(|(missing, likely)| *missing.get(place).unwrap_or(likely));
            let of_kinds = self.of_kinds(&kinds.collect::<Vec<Kind>>());
            found.extend(of_kinds);
        }
        found
    }

    /// As few combinations of forms of these kinds as there are forms of the label with most of them.
    fn of_kinds(&self, kinds: &[Kind]) -> Vec<Vec<usize>> {
        let forms_of = |(label, kind): (usize, &Kind)| -> Vec<usize> {
            let is_form = |choice: &usize| self.first_alike[label][*choice] == *choice;
            let choices = 0..self.constructions[label].len();
            choices.filter(is_form).filter(|choice| self.kind(label, *choice) == *kind).collect()
        };
        let forms: Vec<Vec<usize>> = kinds.iter().enumerate().map(forms_of).collect();
        let most = forms.iter().map(Vec::len).max().unwrap_or(0);
        let combined =
            |place: usize| forms.iter().map(|of_label| *of_label.get(place).unwrap_or(&of_label[0])).collect();
        (0..most).map(combined).collect()
    }

    /// The object built of these forms.
    pub fn built(&self, forms: &[usize]) -> Built {
        let Self { field, found, possible, constructions, .. } = self;
        let labels =
            forms.iter().enumerate().map(|(label, choice)| possible.part(&field.parts, label, *choice).clone());
        let constructions = forms.iter().zip(constructions).map(|(choice, of_label)| of_label[*choice]);
        found.built(field, labels.collect(), constructions.collect())
    }

    /// What an object weighs that is `built` of these forms.
    pub fn weighed(
        &self,
        built: &Built,
        forms: Vec<usize>,
        scale: weights::Scale,
        unknowns: &mut Unknowns,
    ) -> BuiltForms {
        let mut masses_of = |label: usize, choice: usize| -> PartMasses {
            let mut masses = [None, None];
            let part = self.possible.part(&self.field.parts, label, choice);
            let weighable = built.is_used(label).then(|| built.weighable(label, part, &[]));
            for weight in weighable.iter().flat_map(|of| weights::weights(std::slice::from_ref(of), scale, unknowns)) {
                masses[usize::from(weight.is_filling)] = Some(weight.mass);
            }
            masses
        };
        let of_label = |(label, form): (usize, &usize)| {
            let alike = self.first_alike[label].iter().enumerate().filter(|(_, first)| *first == form);
            alike.map(|(choice, _)| (choice, masses_of(label, choice))).collect()
        };
        let masses = forms.iter().enumerate().map(of_label).collect();
        BuiltForms { masses, forms, cores: built.composed.cores.clone() }
    }

    /// By label, the masses of its material and of its filling if parts are made in the ways of these `choices`.
    pub fn masses(&self, built: &[BuiltForms], choices: &[usize]) -> Vec<PartMasses> {
        let labels = || 0..self.constructions.len();
        let has_form = |of: &BuiltForms, label: usize| of.forms[label] == self.first_alike[label][choices[label]];
        let other_kinds = |of: &BuiltForms| {
            labels().filter(|label| self.kind(*label, of.forms[*label]) != self.kind(*label, choices[*label])).count()
        };
        let other_kinds: Vec<usize> = built.iter().map(other_kinds).collect();
        let of_label = |label: usize| {
            let other_sleeves = |of: &BuiltForms| {
                let is_other = |shell: &usize| of.cores[*shell] == Some(label as u32) && !has_form(of, *shell);
                labels().filter(is_other).count()
            };
            let with_form = built.iter().zip(&other_kinds).filter(|(of, _)| has_form(of, label));
            let nearest = with_form.min_by_key(|(of, other_kinds)| (**other_kinds, other_sleeves(of)));
            nearest.and_then(|(of, _)| of.masses[label].get(&choices[label]).cloned()).unwrap_or_default()
        };
        labels().map(of_label).collect()
    }
}
