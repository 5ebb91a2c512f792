//! Parts about which the answers disagree.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::query::{Answers, Outcome, SubjectId};

/// A part to which the answers give several materials.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Disagreement {
    /// The part id.
    pub part: u16,
    /// The materials, starting with the one that has the most answers; among equals, by name.
    pub materials: Vec<NamedMaterial>,
}

/// A material that some answers about a part name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct NamedMaterial {
    pub material: String,
    /// The views in which the answer was this material.
    pub views: Vec<String>,
}

impl Disagreement {
    /// The parts whose answers name more than one material, by id. Answers about segments do not count: a segment's number
    /// means something else in every view.
    pub fn all(answers: &Answers) -> Vec<Self> {
        let mut named: BTreeMap<u16, BTreeMap<&str, Vec<String>>> = BTreeMap::new();
        for answer in &answers.all {
            if let (SubjectId::Part(id), Outcome::Answered(said)) = (answer.subject, &answer.outcome) {
                let views = named.entry(id).or_default().entry(&said.material).or_default();
                views.push(answer.view.clone());
            }
        }
        let disagreement = |(part, materials): (u16, BTreeMap<&str, Vec<String>>)| {
            let named = materials.into_iter();
            let mut materials: Vec<NamedMaterial> =
                named.map(|(material, views)| NamedMaterial { material: material.to_owned(), views }).collect();
            materials.sort_by_key(|named| std::cmp::Reverse(named.views.len()));
            (materials.len() > 1).then_some(Self { part, materials })
        };
        named.into_iter().filter_map(disagreement).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::MaterialLibrary;
    use crate::query::{Answer, Failure, SubjectAnswer};

    fn answer(view: &str, part: u16, material: &str) -> SubjectAnswer {
        let any = &MaterialLibrary::builtin().materials()[0];
        let said = Answer { material: material.to_owned(), ..Answer::of(any) };
        SubjectAnswer { view: view.to_owned(), subject: SubjectId::Part(part), outcome: Outcome::Answered(said) }
    }

    #[test]
    fn parts_with_several_materials_are_listed_with_their_views() {
        let refused = Outcome::Failed(Failure::Refused { message: "no".to_owned() });
        let all = vec![
            answer("a", 1, "oak"),
            answer("a", 2, "pine"),
            answer("b", 1, "oak"),
            answer("b", 2, "ash"),
            answer("c", 2, "pine"),
            SubjectAnswer { view: "c".to_owned(), subject: SubjectId::Part(1), outcome: refused },
        ];
        let named = |material: &str, views: &[&str]| NamedMaterial {
            material: material.to_owned(),
            views: views.iter().map(|view| (*view).to_owned()).collect(),
        };
        let expected = Disagreement { part: 2, materials: vec![named("pine", &["a", "c"]), named("ash", &["b"])] };
        assert_eq!(Disagreement::all(&Answers { all }), [expected]);
    }
}
