//! Every subject of every view with its sheet and its questions: what can be replayed, asked or exported.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use super::cost::{Cost, Price};
use super::whole::AnyWholeQuestion;
use crate::consensus::AskAbout;
use crate::materials::MaterialLibrary;
use crate::parallel;
use crate::query::SubjectId;
use crate::query::answer::{Problem, Unknown};
use crate::query::error::QueryError;
use crate::query::options::Options;
use crate::query::question::prompt::Prompts;
use crate::query::question::sheet::Drawer;
use crate::query::question::shown_subject::ShownSubject;
use crate::query::question::{Question, Questions};
use crate::query::recorded::sha256::Sha256Hex;
use crate::query::recorded::{Mask, QuestionId};
use crate::scene::Photo;
use crate::segment::LabelMap;

/// The subjects that one view shows.
#[derive(Debug, Clone, Copy)]
pub struct ViewSubjects<'a> {
    /// Unique among the views.
    pub name: &'a str,
    pub photo: &'a Photo,
    /// As large as the photo. An id is that of the first map that has it.
    pub maps: &'a [Cow<'a, LabelMap>],
    /// The ids to ask about.
    pub ids: &'a [u16],
}

/// Everything that may be asked about a scene.
pub struct Queries<'a> {
    pub about: AskAbout,
    /// By view in the order of the views, then by id.
    pub subjects: Vec<ShownSubject>,
    /// The questions about the object as a whole that are to be asked.
    pub whole: Vec<&'a dyn AnyWholeQuestion>,
    pub questions: Questions,
    pub library: &'a MaterialLibrary,
    pub prompts: &'a Prompts,
    pub options: &'a Options,
}

impl<'a> Queries<'a> {
    /// Draws the sheet of every subject and writes the questions.
    pub fn prepare(
        views: &[ViewSubjects],
        library: &'a MaterialLibrary,
        prompts: &'a Prompts,
        options: &'a Options,
        about: AskAbout,
    ) -> Result<Self, QueryError> {
        options.check()?;
        let questions = Questions::new(prompts, library, options.guidance, options.context, about)?;
        let mut subjects = Vec::new();
        for view in views {
            subjects.extend(subjects_of(view, about, options)?);
        }
        Ok(Self { about, subjects, whole: Vec::new(), questions, library, prompts, options })
    }

    /// Checks a response to what was asked.
    ///
    /// # Errors
    /// The problem with the response.
    ///
    /// # Returns
    /// `None` if it is none of these questions.
    pub fn check(&self, asked: &QuestionId, response: &str, unknown: Unknown) -> Option<Result<(), Problem>> {
        if let Some(whole) = self.whole.iter().find(|whole| whole.question().is(asked)) {
            return Some(whole.check(response));
        }
        let question = self.questions.find(asked)?;
        Some(self.questions.read(question, response, self.library, unknown).map(drop))
    }

    /// The estimated cost of asking a question about the whole object, as in [`Self::cost`].
    pub fn cost_of_whole(&self, whole: &dyn AnyWholeQuestion, price: Option<&Price>) -> Cost {
        let (question, most) = (whole.question(), self.options.lmm_max_tokens);
        Cost::of_request(&[&question.prompt], whole.shown().sheet_size, question.usual_tokens, most, price)
    }

    /// The estimated cost of asking these questions, each answered at the first try.
    pub fn cost<'p>(
        &self,
        questions: impl Iterator<Item = (&'p ShownSubject, &'p Question)>,
        price: Option<&Price>,
    ) -> Cost {
        questions.fold(Cost::default(), |cost, (subject, question)| {
            let (usual, most) = (question.usual_tokens, self.options.lmm_max_tokens);
            cost.plus(Cost::of_request(&[&question.prompt], subject.sheet_size, usual, most, price))
        })
    }
}

/// By id.
fn subjects_of(view: &ViewSubjects, about: AskAbout, options: &Options) -> Result<Vec<ShownSubject>, QueryError> {
    let &ViewSubjects { name, photo, maps, ids } = view;
    let size = photo.rgb.dimensions();
    if let Some(map) = maps.iter().find(|map| (map.width, map.height) != size) {
        return Err(QueryError::SizeMismatch { view: name.into(), map: (map.width, map.height), photo: size });
    }
    let empty = |id: u16| QueryError::EmptySubject { view: name.into(), subject: SubjectId::of(about, id) };
    let mut ids = ids.to_vec();
    ids.sort_unstable();
    let in_map = |&id: &u16| {
        let map = maps.iter().position(|map| map.labels.contains(&id));
        map.map(|map| (id, map)).ok_or_else(|| empty(id))
    };
    let placed: Vec<(u16, usize)> = ids.iter().map(in_map).collect::<Result<_, _>>()?;
    let drawer = |map: usize| Drawer::new(photo, &maps[map], options.context, options.sheet_size);
    let drawers: BTreeMap<usize, Drawer> =
        placed.iter().map(|(_, map)| *map).collect::<BTreeSet<_>>().into_iter().map(|map| (map, drawer(map))).collect();
    let photo_sha256 = Sha256Hex::of_picture(size, photo.rgb.as_raw());
    parallel::try_map(&placed, |&(id, map)| {
        let sheet = drawers[&map].sheet(id).ok_or_else(|| empty(id))?;
        Ok(ShownSubject::in_hashed(name, id, photo, photo_sha256.clone(), Mask::of_id(&maps[map], id), &sheet))
    })
}
