//! Elects one label per Gaussian from the ballots.
//!
//! 1. Under [`Agreement::Part`] every view's segment stands for the material on which its 3D part agrees (see
//!    [`super::identity`]): the paper's vote, over all Gaussians of a part at once. A single odd answer then makes no
//!    patch in a region that few other views see. Under [`Agreement::Gaussian`] every answer stands for itself, which
//!    is exactly the paper's rule.
//! 2. A Gaussian takes the material with most of its votes.
//! 3. Among the 3D parts that gave it this material, it takes the one with most of its votes.
//!
//! Ties go to the larger sum of votes times the answers' confidence, then to the first material by name, then to the
//! first 3D part. A single view decides alone; if views conflict, the majority wins and `confidence` tells by how much.

use crate::parallel;

use super::answered_subjects::AnsweredSubjects;
use super::ballots::{Ballot, Ballots};
use super::identity::Identity;
use super::options::Agreement;
use super::plurality::{add, winner};

/// The meaning of a label: a 3D part and its material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PartMaterial {
    pub part: u32,
    pub material: u32,
}

/// The outcome for one Gaussian that some view votes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Elected {
    pub choice: PartMaterial,
    /// Votes for the material, whichever part they name.
    pub votes: f32,
    /// Sum of all its votes.
    pub cast: f32,
    /// Number of views that vote on it.
    pub views: u16,
}

/// The choice that each view's segment stands for.
pub(super) fn candidates(subjects: &AnsweredSubjects, identity: &Identity, agreement: Agreement) -> Vec<PartMaterial> {
    let own = subjects.subjects.iter().zip(&identity.part_of_segment);
    let own: Vec<PartMaterial> =
        own.map(|(segment, &part)| PartMaterial { part, material: segment.material }).collect();
    if agreement == Agreement::Gaussian {
        return own;
    }
    let agreed =
        |choice: PartMaterial| PartMaterial { material: identity.material_of_part[choice.part as usize], ..choice };
    own.into_iter().map(agreed).collect()
}

/// Every Gaussian's choice; `None` for those on which no view votes.
pub(super) fn elect(
    ballots: &Ballots,
    subjects: &AnsweredSubjects,
    candidates: &[PartMaterial],
) -> Vec<Option<Elected>> {
    parallel::map_range(ballots.gaussians(), |i| elect_one(ballots.of(i), subjects, candidates))
}

fn elect_one(ballots: &[Ballot], subjects: &AnsweredSubjects, candidates: &[PartMaterial]) -> Option<Elected> {
    let (mut materials, mut parts) = (Vec::new(), Vec::new());
    let mut views = 0;
    let mut last_view = None;
    for ballot in ballots {
        let segment = &subjects.subjects[ballot.segment as usize];
        views += u16::from(last_view != Some(segment.view));
        last_view = Some(segment.view);
        let material = candidates[ballot.segment as usize].material;
        add(&mut materials, material, f64::from(ballot.weight), segment.answer.confidence);
    }
    let (material, votes) = winner(&materials)?;
    for ballot in ballots {
        let choice = candidates[ballot.segment as usize];
        if choice.material == material {
            let confidence = subjects.subjects[ballot.segment as usize].answer.confidence;
            add(&mut parts, choice.part, f64::from(ballot.weight), confidence);
        }
    }
    let (part, _) = winner(&parts)?;
    // Rounded as the sums of `materials` are, so that they never exceed it.
    let cast = ballots.iter().map(|ballot| f64::from(ballot.weight)).sum::<f64>() as f32;
    Some(Elected { choice: PartMaterial { part, material }, votes: votes as f32, cast, views })
}
