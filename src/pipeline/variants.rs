//! The material field of a finished run, and the fields from the same segments under the paper's ablations.

use std::sync::Arc;

use crate::consensus::AskAbout;
use crate::error::Result;
use crate::query::{AnswerSource, Answers, Context, Options};
use crate::vote::{MaterialField, VoteError};

use super::stages::OpenScene;
use super::stages::questions::session_of;
use super::stages::subjects::FoundSubjects;
use super::stages::vote::{elect, voters};

/// The fields of one scene.
pub struct Variants {
    /// The field of the whole method, as the run stored it.
    pub voted: Arc<MaterialField>,
    /// The field from answers to sheets that show the segment without the object; `None` if one of them is not
    /// recorded.
    pub local_only: Option<MaterialField>,
    /// The field from each chosen view alone, by its name; without views that have no segment with an answer. Gaussians
    /// that the view does not see take the nearest label.
    pub single_views: Vec<(String, MaterialField)>,
}

/// The fields under the ablations; the scene must be voted on. Uses recordings only.
pub fn variants(open: &OpenScene) -> Result<Variants> {
    let (about, answers) = (FoundSubjects::of(open)?, open.get::<Answers>()?);
    let maps = about.settled_maps(open, &answers)?;
    let voters = voters(&open.views, &maps);
    let mut single_views = Vec::new();
    for view in &voters {
        match elect(open, &about, std::slice::from_ref(view), &answers) {
            Ok(field) => single_views.push((view.name.to_owned(), field)),
            Err(VoteError::NoVotes { .. }) => {}
            Err(error) => return Err(error.into()),
        }
    }
    let local = local_answers(open, &about)?;
    let local_only = local.map(|answers| elect(open, &about, &voters, &answers)).transpose()?;
    Ok(Variants { voted: open.get()?, local_only, single_views })
}

fn local_answers(open: &OpenScene, about: &FoundSubjects) -> Result<Option<Answers>> {
    // The question about the whole object shows no part alone.
    if open.options.consensus.ask == AskAbout::Object {
        return Ok(None);
    }
    let recorded = Options { answers: AnswerSource::Replay, lmm_url: None, ..open.options.query.clone() };
    let options = Options { context: Context::Local, ..recorded };
    let session = session_of(open, about, &options)?;
    let queries = session.queries()?;
    match session.count_open(&queries) {
        0 => Ok(Some(session.answer_parts(None, &|_| Ok(()))?.answers)),
        unanswered => {
            let (name, all) = (&open.scene.name, queries.subjects.len());
            let line = format!("{name}: {unanswered} of {all} questions have no answer recorded for the part alone");
            open.progress().line(&line);
            Ok(None)
        }
    }
}
