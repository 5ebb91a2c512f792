//! The material field of a finished run, and the fields from the same segments under the paper's ablations.

use anyhow::Result;

use crate::query::{AnswerSource, Answers, Context, Options};
use crate::scene::Scene;
use crate::vote::{MaterialField, VoteError};

use super::Pipeline;
use super::vote::voters;

/// The fields of one scene.
pub struct Variants {
    /// The field of the whole method, as the run stored it.
    pub voted: MaterialField,
    /// The field from answers to sheets that show the segment without the object; `None` if one of them is not
    /// recorded.
    pub local_only: Option<MaterialField>,
    /// The field from each chosen view alone, by its name; without views that have no segment with an answer. Gaussians
    /// that the view does not see take the nearest label.
    pub single_views: Vec<(String, MaterialField)>,
}

impl Pipeline {
    /// The fields under the ablations; the scene must be voted on. Uses recordings only.
    pub(crate) fn variants(&self) -> Result<Variants> {
        let answers = self.stored_answers()?;
        let maps = self.settled_maps(answers)?;
        let voters = voters(&self.views, &maps);
        let mut single_views = Vec::new();
        for view in &voters {
            match self.vote(std::slice::from_ref(view), answers) {
                Ok(field) => single_views.push((view.name.to_owned(), field)),
                Err(error) if matches!(error.downcast_ref(), Some(VoteError::NoVotes { .. })) => {}
                Err(error) => return Err(error),
            }
        }
        let local_only = self.local_answers()?.map(|answers| self.vote(&voters, &answers)).transpose()?;
        Ok(Variants { voted: self.stored_field()?.clone(), local_only, single_views })
    }

    fn local_answers(&self) -> Result<Option<Answers>> {
        let recorded = Options { answers: AnswerSource::Replay, lmm_url: None, ..self.options.query.clone() };
        let options = Options { context: Context::Local, ..recorded };
        let session = self.query_session_with(&options)?;
        let queries = session.queries()?;
        match queries.unanswered(&session.recordings, None).len() {
            0 => Ok(Some(session.answer_all(&|_| Ok(()))?.0)),
            open => {
                let (name, all) = (&self.scene.name, queries.segments.len());
                self.progress
                    .line(&format!("{name}: {open} of {all} questions have no answer recorded for the part alone"));
                Ok(None)
            }
        }
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// True if a view is among those that vote.
    pub(crate) fn votes(&self, view: &str) -> bool {
        self.views.iter().any(|chosen| chosen.name == view)
    }

    /// The library that the answers were checked against.
    pub(crate) fn library(&self) -> &crate::materials::MaterialLibrary {
        &self.library
    }
}
