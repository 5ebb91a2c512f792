//! Both ways from segmented views to a label for every Gaussian, by asking about parts or about segments, with answers
//! from true part maps.

use std::collections::BTreeMap;

use fastrand::Rng;
use image::GrayImage;

use super::{StudiedView, merged};
use crate::consensus::masks::{PartMasks, part_masks};
use crate::consensus::{self, AskAbout, Parts, SegmentedView, best_views};
use crate::evaluate::parts::NO_PART;
use crate::gaussians::Gaussians;
use crate::materials::{Material, MaterialLibrary};
use crate::query::ask::rounds::{self, Outcomes, PartOrPiece, Subject, SubjectInView};
use crate::query::{Answer, Answers, Outcome, SubjectAnswer, SubjectId};
use crate::segment::{LabelMap, ViewSegments};
use crate::vote::{self, AnsweredPart, MaterialField, VoteError, VotingView};
use crate::words::progress::Progress;

/// A mask shows several materials if no true part covers this share of it.
const ONE_MATERIAL_SHARE: f64 = 0.9;

/// Views that vote under one condition.
pub struct Voters<'a> {
    pub gaussians: &'a Gaussians,
    pub views: &'a [&'a StudiedView<'a>],
    /// Probabilities that a segment is merged with a neighbour and that an answer is wrong.
    pub merged: f64,
    pub wrong: f64,
}

impl Voters<'_> {
    /// The true part, plus 1, that every Gaussian is labelled as; 0 if no view shows a true part.
    pub fn labels(
        &self,
        asked: &consensus::Options,
        vote: &vote::Options,
        random: &mut Rng,
    ) -> Result<Vec<u16>, VoteError> {
        let oracle = Oracle::new(self.views, self.wrong);
        if oracle.parts.is_empty() {
            return Ok(vec![0; self.gaussians.len()]);
        }
        let segments: Vec<ViewSegments> =
            self.views.iter().map(|view| merged(view.segments, self.merged, random)).collect();
        let field = match asked.ask {
            AskAbout::Object | AskAbout::Parts => {
                self.on_parts(&segments, asked.ask_views.get(), vote, &oracle, random)
            }
            AskAbout::Segments => self.on_segments(&segments, vote, &oracle, random),
        }?;
        Ok(oracle.labels(&field))
    }

    fn on_parts(
        &self,
        segments: &[ViewSegments],
        ask_views: usize,
        options: &vote::Options,
        oracle: &Oracle,
        random: &mut Rng,
    ) -> Result<MaterialField, VoteError> {
        let views = self.views.iter().zip(segments);
        let views: Vec<SegmentedView> = views
            .map(|(view, segments)| SegmentedView { camera: view.camera, cloud: self.gaussians, segments })
            .collect();
        let parts = consensus::find(self.gaussians, &[], &views, Progress::HIDDEN);
        let masks: Vec<PartMasks> = views.iter().map(|view| part_masks(&parts, view)).collect();
        let shows = |id: u16, asked: u16| id > 0 && (id == asked || parts.part_of(id) == asked);
        let subjects = self.subjects(&parts, &masks);
        let mut answers: BTreeMap<SubjectInView, Outcome> = BTreeMap::new();
        loop {
            let outcomes = answers.iter().map(|(&target, outcome)| (target, outcome)).collect();
            let due: Vec<SubjectInView> =
                subjects.iter().flat_map(|subject| subject.due(ask_views, &outcomes)).collect();
            if due.is_empty() {
                break;
            }
            for target in due {
                let map = &masks[target.view].map;
                let answer = oracle.answer(&self.views[target.view].parts, map, |id| shows(id, target.id), random);
                answers.insert(target, Outcome::Answered(answer));
            }
        }
        let outcomes: Outcomes = answers.iter().map(|(&target, outcome)| (target, outcome)).collect();
        let settled = rounds::settled(&subjects, &outcomes);
        let settled = |id: &u16| settled.get(id).copied().unwrap_or(*id);
        let settled = |map: &LabelMap| LabelMap { labels: map.labels.iter().map(settled).collect(), ..*map };
        let maps: Vec<LabelMap> = masks.iter().map(|masks| settled(&masks.map)).collect();
        let answered = AnsweredPart::collect(answers.iter().filter_map(|(target, outcome)| match outcome {
            Outcome::Answered(answer) => {
                let pixels = masks[target.view].map.labels.iter().filter(|&&id| shows(id, target.id)).count();
                Some((target.id, answer, pixels as f64))
            }
            Outcome::Failed(_) => None,
        }));
        let (inputs, library) = (self.inputs(maps.iter()), MaterialLibrary::builtin());
        vote::vote_on_parts(self.gaussians, &inputs, &answered, library, options, Progress::HIDDEN)
    }

    fn on_segments(
        &self,
        segments: &[ViewSegments],
        options: &vote::Options,
        oracle: &Oracle,
        random: &mut Rng,
    ) -> Result<MaterialField, VoteError> {
        let mut answers = Answers::default();
        for (view, of) in self.views.iter().zip(segments) {
            for segment in of.segments.iter().filter(|segment| of.map.labels.contains(&segment.id)) {
                let answer = oracle.answer(&view.parts, &of.map, |id| id == segment.id, random);
                let (view, outcome) = (view.name.to_owned(), Outcome::Answered(answer));
                answers.all.push(SubjectAnswer { view, subject: SubjectId::Segment(segment.id), outcome });
            }
        }
        let inputs = self.inputs(segments.iter().map(|of| &of.map));
        vote::vote(self.gaussians, &inputs, &answers, MaterialLibrary::builtin(), options, Progress::HIDDEN)
    }

    fn inputs<'m>(&'m self, maps: impl Iterator<Item = &'m LabelMap>) -> Vec<VotingView<'m>> {
        let input =
            |(view, map): (&&'m StudiedView, &'m LabelMap)| VotingView { name: view.name, camera: view.camera, map };
        self.views.iter().zip(maps).map(input).collect()
    }

    /// The subjects of the questions, as in `gprop run`.
    fn subjects(&self, parts: &Parts, masks: &[PartMasks]) -> Vec<Subject> {
        let cameras: Vec<_> = self.views.iter().map(|view| view.camera).collect();
        let sharpness: Vec<&[f32]> = self.views.iter().map(|view| view.sharpness.as_slice()).collect();
        let maps: Vec<&LabelMap> = masks.iter().map(|masks| &masks.map).collect();
        let best = best_views(self.gaussians, parts, &cameras, &maps, &sharpness);
        rounds::subjects(parts.parts.iter().zip(best).map(|(part, best)| PartOrPiece {
            id: part.id,
            piece_of: part.piece_of,
            views: best.iter().map(|shown| shown.view).collect(),
        }))
    }
}

/// Answers from true part maps. Each true part has a material of its own; the families differ too while they last.
struct Oracle {
    /// The true parts in the voting views.
    parts: Vec<u8>,
    materials: Vec<&'static Material>,
    wrong: f64,
}

impl Oracle {
    fn new(views: &[&StudiedView], wrong: f64) -> Self {
        let mut parts: Vec<u8> = views.iter().flat_map(|view| view.parts.as_raw().iter().copied()).collect();
        parts.sort_unstable();
        parts.dedup();
        parts.retain(|&part| part != NO_PART);
        let library = MaterialLibrary::builtin();
        let of_family = |family: &'static crate::materials::Family| library.of_family(&family.name).next();
        // The first material of each family; if there are more parts than families, then all others in order.
        let firsts: Vec<&'static Material> = library.families().iter().filter_map(of_family).collect();
        let others =
            library.materials().iter().filter(|material| !firsts.iter().any(|first| first.name == material.name));
        let materials = firsts.iter().copied().chain(others).take(parts.len()).collect();
        Self { materials, parts, wrong }
    }

    /// The answer about the pixels for whose id `shows` is true.
    fn answer(&self, truth: &GrayImage, map: &LabelMap, shows: impl Fn(u16) -> bool, random: &mut Rng) -> Answer {
        let mut pixels = vec![0u64; self.parts.len()];
        for (&id, part) in map.labels.iter().zip(truth.as_raw()) {
            if shows(id)
                && let Ok(n) = self.parts.binary_search(part)
            {
                pixels[n] += 1;
            }
        }
        let all: u64 = pixels.iter().sum();
        let most = (0..pixels.len()).rev().max_by_key(|&n| pixels[n]).unwrap_or(0);
        let several = (pixels.get(most).copied().unwrap_or(0) as f64) < ONE_MATERIAL_SHARE * all as f64;
        let is_wrong = random.f64() < self.wrong && self.parts.len() > 1;
        let named = if is_wrong { (most + 1 + random.usize(..self.parts.len() - 1)) % self.parts.len() } else { most };
        Answer { several_materials: several, ..Answer::of(self.materials[named]) }
    }

    fn labels(&self, field: &MaterialField) -> Vec<u16> {
        let part = |label: &vote::FieldPart| {
            let named = self.materials.iter().position(|material| material.name == label.material);
            named.map_or(0, |n| u16::from(self.parts[n]) + 1)
        };
        let of_label: Vec<u16> = field.parts.iter().map(part).collect();
        field.part_index.iter().map(|&label| of_label[label as usize]).collect()
    }
}
