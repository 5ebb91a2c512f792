//! What the object is, as the query stage stored it, for the stages that follow its answer.

use super::{OpenScene, Stage, Stored};
use crate::consensus::AskAbout;
use crate::error::Result;
use crate::query::{ObjectAnswers, WholeAnswer, WholeOutcome};
use crate::workdir::Artifact;

/// What the object is, and what its parts are, as far as both were asked and answered.
pub struct Recognized(pub Option<ObjectAnswers>);

impl Stored for Recognized {
    const STAGE: Stage = Stage::Query;

    fn load(open: &OpenScene) -> Result<Self> {
        // Where answers about the parts served, there is no file.
        if open.options.consensus.ask != AskAbout::Object || !open.work.path(Artifact::Object).exists() {
            return Ok(Self(None));
        }
        let answer: WholeAnswer<ObjectAnswers> = open.work.read_json(Artifact::Object)?;
        let WholeOutcome::Answered(recognized) = answer.outcome else { return Ok(Self(None)) };
        let problem = recognized.problem().map(|problem| open.work.damaged(Artifact::Object, problem));
        problem.map_or(Ok(Self(Some(recognized))), |problem| Err(problem.into()))
    }
}
