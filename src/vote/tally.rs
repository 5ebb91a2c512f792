//! From ballots to one label a Gaussian.
//!
//! 1. Under [`Agreement::Part`] every view's part stands for the material that its 3D part agrees on (see
//!    [`super::identity`]): the paper's vote, over all Gaussians of a part at once. A single odd answer then makes no
//!    patch where few other views look. Under [`Agreement::Gaussian`] every answer stands for itself, which is the
//!    paper's rule to the letter.
//! 2. A Gaussian takes the material with most of its votes.
//! 3. Among the 3D parts that gave it this material, it takes the one with most of its votes.
//!
//! Ties go to the larger sum of votes times the answers' confidence, then to the first material by name, to the first 3D
//! part. A single view decides alone; where views conflict the majority wins and `confidence` says by how much.

use rayon::prelude::*;

use super::ballots::{Ballot, Ballots};
use super::identity::Identity;
use super::options::Agreement;
use super::parts_of_views::ViewParts;
use super::plurality::{add, winner};

/// What a label is made of: a 3D part and a material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Choice {
    pub part_3d: u32,
    pub material: u32,
}

/// The outcome for one Gaussian that some view votes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Elected {
    pub choice: Choice,
    pub votes: f32,
    /// Votes for anything.
    pub cast: f32,
    /// Views that vote.
    pub views: u16,
}

/// The choice that each view's part stands for.
pub(super) fn candidates(parts: &ViewParts, identity: &Identity, agreement: Agreement) -> Vec<Choice> {
    let own = parts.parts.iter().zip(&identity.part_3d);
    let own: Vec<Choice> = own.map(|(part, &part_3d)| Choice { part_3d, material: part.material }).collect();
    if agreement == Agreement::Gaussian {
        return own;
    }
    let agreed = |choice: Choice| Choice { material: identity.material_3d[choice.part_3d as usize], ..choice };
    own.into_iter().map(agreed).collect()
}

/// Every Gaussian's choice; `None` for those that no view votes on.
pub(super) fn elect(ballots: &Ballots, parts: &ViewParts, candidates: &[Choice]) -> Vec<Option<Elected>> {
    (0..ballots.gaussians()).into_par_iter().map(|i| elect_one(ballots.of(i), parts, candidates)).collect()
}

fn elect_one(ballots: &[Ballot], parts: &ViewParts, candidates: &[Choice]) -> Option<Elected> {
    let (mut materials, mut parts_3d) = (Vec::new(), Vec::new());
    let mut views = 0;
    let mut last_view = None;
    for ballot in ballots {
        let part = &parts.parts[ballot.part as usize];
        views += u16::from(last_view != Some(part.view));
        last_view = Some(part.view);
        let material = candidates[ballot.part as usize].material;
        add(&mut materials, material, f64::from(ballot.weight), part.answer.confidence);
    }
    let (material, _) = winner(&materials)?;
    for ballot in ballots {
        let choice = candidates[ballot.part as usize];
        if choice.material == material {
            let confidence = parts.parts[ballot.part as usize].answer.confidence;
            add(&mut parts_3d, choice.part_3d, f64::from(ballot.weight), confidence);
        }
    }
    let (part_3d, votes) = winner(&parts_3d)?;
    let cast = ballots.iter().map(|ballot| ballot.weight).sum();
    Some(Elected { choice: Choice { part_3d, material }, votes: votes as f32, cast, views })
}
