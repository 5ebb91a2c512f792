//! From label maps to a material for every Gaussian: ballots, tally.
//!
//! In order: [`answered_subjects`] lists the views' segments, or the parts in the views, that have an answer;
//! [`ballots`] lets every view vote on the Gaussians that it sees, by the light that arrives from them or, as in the
//! paper, by a depth test; [`identity`] finds which segments of different views are one part of the object, unless the
//! parts are known; [`tally`] elects, by [`plurality`], a material and a part for every Gaussian, and [`unseen`] for
//! those that no view sees; [`properties`] gives each elected part its properties, and
//! [`correction`] those that the user knows better.

mod answered_subjects;
mod ballots;
mod contents;
pub mod correction;
mod error;
mod estimate;
pub mod field_ply;
mod identity;
mod options;
mod plurality;
mod properties;
mod tally;
mod unseen;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::materials::{Law, Material, MaterialLibrary};
use crate::query::{Answer, Answers, Form};
use crate::render;
use crate::scene::robust_bounds;
use crate::segment::LabelMap;
use crate::units::{Estimate, ShoreHardness};
use crate::words::output::{agreeing, counted};
use crate::words::progress::Progress;
use answered_subjects::{AnsweredSubject, AnsweredSubjects};
use ballots::Ballots;
pub use correction::{Corrected, Correction, CorrectionError, Setting, check_materials, corrected};
pub use error::VoteError;
use identity::Identity;
pub use options::{Agreement, Options, Rule, SCENE_KEYS};
use tally::{Elected, PartMaterial};

/// A view that votes.
#[derive(Debug, Clone, Copy)]
pub struct VotingView<'a> {
    /// Its name, as in the answers.
    pub name: &'a str,
    pub camera: &'a Camera,
    /// Its label map, of the same size as the camera's picture.
    pub map: &'a LabelMap,
}

/// A part of the object with the answers about it.
#[derive(Debug, Clone)]
pub struct AnsweredPart<'a> {
    /// Its value in the label maps.
    pub id: u16,
    /// The answers, each with how much of the part its view shows, the one that shows most first.
    pub answers: Vec<(&'a Answer, f64)>,
}

impl<'a> AnsweredPart<'a> {
    /// The parts with their answers, from any order of answers: the part's id, the answer, and how much of the part its
    /// view shows.
    pub fn collect(answers: impl IntoIterator<Item = (u16, &'a Answer, f64)>) -> Vec<Self> {
        let mut of_part: BTreeMap<u16, Vec<(&Answer, f64)>> = BTreeMap::new();
        for (id, answer, shown) in answers {
            of_part.entry(id).or_default().push((answer, shown));
        }
        let of_part = of_part.into_iter().map(|(id, mut answers)| {
            answers.sort_by(|a, b| b.1.total_cmp(&a.1));
            Self { id, answers }
        });
        of_part.collect()
    }
}

/// The result of the vote for every Gaussian.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct MaterialField {
    /// The parts that a Gaussian may belong to, by id.
    pub parts: Vec<FieldPart>,
    /// Per Gaussian: index into `parts`.
    pub part_index: Vec<u32>,
    /// Per Gaussian: share of its votes that its material won, times the share of the answers about its part that name
    /// this material (under [`Agreement::Part`]), 0 to 1; 0 if it was never seen.
    pub confidence: Vec<f32>,
    /// Per Gaussian: votes for the winning material.
    pub votes: Vec<f32>,
    /// Per Gaussian: number of views that see it. 0 means that the part is that of the nearest seen Gaussians.
    pub views: Vec<u16>,
    /// Messages about what the user should check.
    pub warnings: Vec<String>,
    /// Messages about what the user may want to know.
    pub notes: Vec<String>,
}

impl MaterialField {
    /// Per Gaussian: the id of its part.
    pub fn part_ids(&self) -> impl Iterator<Item = u32> {
        self.part_index.iter().map(|&part| self.parts[part as usize].id)
    }

    /// The field of Gaussians whose parts are known: each was seen by one view, which was certain.
    pub fn known(parts: Vec<FieldPart>, part_index: Vec<u32>) -> Self {
        let count = part_index.len();
        Self {
            parts,
            part_index,
            confidence: vec![1.0; count],
            votes: vec![1.0; count],
            views: vec![1; count],
            warnings: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Keeps the Gaussians whose entry in `kept` is true, in their order.
    pub fn retain(&mut self, kept: &[bool]) {
        fn retain<T>(values: &mut Vec<T>, kept: &[bool]) {
            let mut kept = kept.iter();
            values.retain(|_| *kept.next().unwrap_or(&false));
        }
        retain(&mut self.part_index, kept);
        retain(&mut self.confidence, kept);
        retain(&mut self.votes, kept);
        retain(&mut self.views, kept);
    }
}

/// One part of the object in 3D, as the views agree on it: a material with its properties. Of every property, `low` and
/// `high` bound what the answers for this material say, and `mid` is the median of their middles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct FieldPart {
    /// The part id, from 1, which is also the part's value of `part_label` in `field.ply`.
    pub id: u32,
    pub caption: String,
    /// Name of the library row.
    pub material: String,
    pub family: String,
    /// Of the material; of a mixed part, its mass by the volume within its outer surface.
    pub density_kg_m3: Estimate,
    pub youngs_modulus_pa: Estimate,
    pub poisson_ratio: Estimate,
    /// Strength that limits a grasp.
    pub yield_strength_pa: Estimate,
    pub hardness: Option<ShoreHardness>,
    pub friction_rubber: Estimate,
    /// Coefficient of restitution on a hard surface, of the family; `None` if a user's family does not say.
    #[serde(default)]
    pub restitution: Option<Estimate>,
    pub form: Form,
    /// The contents of a shell; `None` for everything else.
    #[serde(default)]
    pub inside: Option<Contents>,
    /// Why a mixed part has the density that it has, in the words of an answer.
    #[serde(default)]
    pub bulk_reason: Option<String>,
    pub law: Law,
    /// What the user says of the part, and what the answers say instead; missing if nothing was corrected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "Corrected"))]
    pub corrected: Option<Box<Corrected>>,
}

impl FieldPart {
    /// The part with this id, if this answer about it holds.
    ///
    /// # Panics
    /// If the library does not have its material, which answers are checked for.
    pub fn answered(id: u32, answer: &Answer, library: &MaterialLibrary) -> Self {
        properties::agreed(id, &[answer], library)
    }

    /// A solid part that consists of this material alone, and is called as it is.
    pub fn of(id: u32, material: &Material) -> Self {
        Self {
            id,
            caption: material.name.clone(),
            material: material.name.clone(),
            family: material.family.clone(),
            density_kg_m3: material.density_kg_m3.into(),
            youngs_modulus_pa: material.youngs_modulus_pa.into(),
            poisson_ratio: material.poisson_ratio.into(),
            yield_strength_pa: material.strength_pa.into(),
            hardness: material.hardness,
            friction_rubber: material.friction_rubber.into(),
            restitution: material.restitution.map(Estimate::from),
            form: Form::Solid,
            inside: None,
            bulk_reason: None,
            law: material.law,
            corrected: None,
        }
    }
}

/// The contents of a shell, as the answers agree on them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(tag = "inside", rename_all = "snake_case")]
pub enum Contents {
    /// Air.
    Empty,
    /// A filling that no photo shows, of a kind that the answers name.
    Filled(Filled),
    /// The answers do not say, or do not agree.
    Unknown,
}

/// The filling of a shell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Filled {
    /// Name of a row of `fillings.csv`.
    pub filling: String,
    /// Its share of the hollow, with the gaps between its pieces, 0 to 1.
    pub share: Estimate,
    /// Mass divided by the volume that the filling takes up, including the gaps between its pieces.
    pub density_kg_m3: Estimate,
    pub youngs_modulus_pa: Estimate,
    pub poisson_ratio: Estimate,
    pub law: Law,
}

/// Gives every Gaussian a material from the segments that the views see it in. See [`tally`] for the rules.
///
/// # Errors
/// [`VoteError`] if an option is outside its domain, there are no Gaussians, a label map does not have its camera's size, an answer names a material
/// that is not in the library, or there is no vote at all.
pub fn vote(
    gaussians: &Gaussians,
    views: &[VotingView],
    answers: &Answers,
    library: &MaterialLibrary,
    options: &Options,
    progress: Progress,
) -> Result<MaterialField, VoteError> {
    options.check()?;
    check(gaussians, views)?;
    let mut subjects = AnsweredSubjects::new(views, answers, library)?;
    subjects.warnings.extend(cameras_inside(gaussians, views));
    subjects.notes.extend(strange_gaussians(gaussians));
    let ballots = Ballots::cast(gaussians, views, &subjects, options.vote, progress);
    let identity = Identity::new(&ballots, &subjects);
    Votes { views, subjects, ballots, identity }.elect(gaussians, library, options)
}

/// As [`vote`], for label maps in which an id stands for the same part in all views.
///
/// A part's material is the one that its answers name with the most weight, whatever `options.agree` says.
///
/// # Errors
/// As for [`vote`].
pub fn vote_on_parts(
    gaussians: &Gaussians,
    views: &[VotingView],
    parts: &[AnsweredPart],
    library: &MaterialLibrary,
    options: &Options,
    progress: Progress,
) -> Result<MaterialField, VoteError> {
    options.check()?;
    check(gaussians, views)?;
    let mut subjects = AnsweredSubjects::of_parts(views, parts, library)?;
    subjects.warnings.extend(cameras_inside(gaussians, views));
    subjects.notes.extend(strange_gaussians(gaussians));
    let ballots = Ballots::cast(gaussians, views, &subjects, options.vote, progress);
    let identity = Identity::of_parts(&ballots, &subjects, parts);
    let options = Options { agree: Agreement::Part, ..options.clone() };
    Votes { views, subjects, ballots, identity }.elect(gaussians, library, &options)
}

/// The votes of all views, and what they are about.
struct Votes<'a> {
    views: &'a [VotingView<'a>],
    subjects: AnsweredSubjects<'a>,
    ballots: Ballots,
    identity: Identity<'a>,
}

impl Votes<'_> {
    /// Elects a part for every Gaussian.
    fn elect(
        self,
        gaussians: &Gaussians,
        library: &MaterialLibrary,
        options: &Options,
    ) -> Result<MaterialField, VoteError> {
        let candidates = tally::candidates(&self.subjects, &self.identity, options.agree);
        let elected = tally::elect(&self.ballots, &self.subjects, &candidates);
        match unseen::fill(gaussians, &elected, options.neighbors.get()) {
            Some(choices) => Ok(self.field(&choices, &elected, library, options.agree)),
            None => Err(VoteError::NoVotes {
                views: self.views.len(),
                segments: self.subjects.in_maps,
                answered: self.subjects.subjects.len(),
            }),
        }
    }

    /// Gathers the properties of each choice that occurs. Its id is that of its part, if that was known before the vote;
    /// else the choices are numbered from 1, the most frequent first.
    fn field(
        self,
        choices: &[PartMaterial],
        elected: &[Option<Elected>],
        library: &MaterialLibrary,
        agree: Agreement,
    ) -> MaterialField {
        let Self { subjects, identity, .. } = &self;
        let mut made: Vec<(u32, PartMaterial)> = (1..).zip(by_frequency(choices)).collect();
        if let Some(ids) = &identity.ids {
            made.iter_mut().for_each(|(id, choice)| *id = ids[choice.part as usize]);
            made.sort_unstable();
        }
        let name = |choice: PartMaterial| subjects.materials[choice.material as usize];
        let parts =
            made.iter().map(|&(id, choice)| properties::part(id, choice, name(choice), identity, library)).collect();
        let index_of =
            |choice: &PartMaterial| made.iter().position(|(_, other)| other == choice).expect("listed above") as u32;
        // Gaussians that choose for themselves count every answer in their own votes.
        let agreement = |&(_, choice): &(u32, PartMaterial)| match agree {
            Agreement::Part => identity.agreement(choice.part, name(choice)) as f32,
            Agreement::Gaussian => 1.0,
        };
        let agreement: Vec<f32> = made.iter().map(agreement).collect();
        let confidence = |e: &Elected| e.votes / e.cast * agreement[index_of(&e.choice) as usize];
        MaterialField {
            parts,
            part_index: choices.iter().map(index_of).collect(),
            confidence: elected.iter().map(|e| e.as_ref().map_or(0.0, confidence)).collect(),
            votes: elected.iter().map(|e| e.as_ref().map_or(0.0, |e| e.votes)).collect(),
            views: elected.iter().map(|e| e.as_ref().map_or(0, |e| e.views)).collect(),
            notes: subjects.notes.iter().cloned().chain(self.notes_of_invisible()).collect(),
            warnings: self.subjects.warnings,
        }
    }

    /// A note for each answered subject in which no Gaussian lies.
    fn notes_of_invisible(&self) -> Vec<String> {
        let invisible = self.subjects.subjects.iter().zip(&self.identity.seen).filter(|(_, seen)| **seen == 0);
        let note = |subject: &AnsweredSubject| {
            let (view, caption) = (self.views[subject.view].name, &subject.answer.caption);
            format!(
                "the answer about part or segment {} in view `{view}` ({caption}) does not count: the splat shows nothing there",
                subject.id
            )
        };
        invisible.map(|(subject, _)| note(subject)).collect()
    }
}

fn check(gaussians: &Gaussians, views: &[VotingView]) -> Result<(), VoteError> {
    if gaussians.is_empty() {
        return Err(VoteError::NoGaussians);
    }
    for view in views {
        let camera = (view.camera.intrinsics.width, view.camera.intrinsics.height);
        let map = (view.map.width, view.map.height);
        if map != camera || view.map.labels.len() != map.0 as usize * map.1 as usize {
            return Err(VoteError::MapSize { view: view.name.to_owned(), map, camera });
        }
    }
    Ok(())
}

/// Warnings about oddities of the cloud that do not prevent the vote.
fn strange_gaussians(gaussians: &Gaussians) -> Vec<String> {
    let mut doubts = Vec::new();
    let diagonal = robust_bounds(gaussians).diagonal();
    let is_large = |&i: &usize| !gaussians.is_set_aside(i) && gaussians.scale(i).max() > diagonal;
    let large = (0..gaussians.len()).filter(is_large).count();
    if large > 0 {
        let are =
            agreeing(large, "is larger than the object: it gets its", "are larger than the object: they get their");
        doubts.push(format!("{} {are} material by vote, like any other", counted(large, "Gaussian")));
    }
    let is_faint = |&i: &usize| !gaussians.is_set_aside(i) && gaussians.opacity(i) < f64::from(render::ALPHA_MIN);
    let faint = (0..gaussians.len()).filter(is_faint).count();
    if faint > 0 {
        let are =
            agreeing(faint, "is too faint to be drawn: it takes its", "are too faint to be drawn: they take their");
        doubts.push(format!("{} {are} neighbours' material", counted(faint, "Gaussian")));
    }
    doubts
}

/// A warning for each view whose camera is inside the object, where it cannot be.
fn cameras_inside(gaussians: &Gaussians, views: &[VotingView]) -> Vec<String> {
    let bounds = robust_bounds(gaussians);
    let is_inside = |view: &&VotingView| {
        let eye = view.camera.center_in_world();
        (0..3).all(|axis| bounds.min[axis] <= eye[axis] && eye[axis] <= bounds.max[axis])
    };
    let text = |view: &VotingView| {
        format!(
            "the camera of view `{}` stands inside the object's bounding box: `gprop inspect SCENE --html FILE` shows whether cameras \
             and splat belong together",
            view.name
        )
    };
    views.iter().filter(is_inside).map(text).collect()
}

/// The choices that occur, the most frequent first; among equals, the lower 3D part first.
fn by_frequency(choices: &[PartMaterial]) -> Vec<PartMaterial> {
    let mut sorted = choices.to_vec();
    sorted.sort_unstable();
    let mut runs: Vec<(usize, PartMaterial)> = sorted.chunk_by(|a, b| a == b).map(|run| (run.len(), run[0])).collect();
    runs.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    runs.into_iter().map(|(_, choice)| choice).collect()
}
