//! The exit codes and which error leads to which: the one place that knows.

use thiserror::Error;

use crate::batch::BatchError;
use crate::config::ConfigError;
use crate::evaluate::EvaluateError;
use crate::evaluate::grasp::OutcomesError;
use crate::evaluate::masks::MasksError;
use crate::evaluate::simulation::SimulationError;
use crate::export::ExportError;
use crate::grasp::GraspError;
use crate::materials::LibraryError;
use crate::parts::PartsError;
use crate::query::client::ClientError;
use crate::query::cost::PriceError;
use crate::query::exchange::ExchangeError;
use crate::query::recorded::RecordingError;
use crate::query::{LabelsError, PromptError, QueryError};
use crate::scene::SceneError;
use crate::scene::ply::PlyError;
use crate::segment::SegmentError;
use crate::segment::formats::ImportError;
use crate::setup::SetupError;
use crate::simulate::SimulateError;
use crate::vote::VoteError;
use crate::workdir::WorkDirError;

/// How gprop ends. The numbers are part of the command-line contract.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// Everything asked for was done.
    Done = 0,
    /// Wrong usage or configuration: flags, `gprop.toml`, an unwritable folder.
    Usage = 2,
    /// The scene's data is bad or missing.
    Scene = 3,
    /// ONNX Runtime or a model is missing or broken.
    Model = 4,
    /// An answer is missing: no recording, no endpoint, a refusal, the budget is spent.
    Answer = 5,
    /// Part of a batch failed.
    Batch = 6,
    /// A bug in gprop.
    Bug = 70,
}

/// A request that cannot be carried out as it was typed.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct UsageError(pub String);

/// The exit code of an error: that of the first typed error in its chain. An error without a type is a bug.
pub fn of(error: &anyhow::Error) -> Exit {
    error.chain().find_map(code).unwrap_or(Exit::Bug)
}

/// An error in one line: what failed, then each cause that is not told yet.
pub fn message(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |told, cause| match told.as_str() {
        "" => cause,
        _ if told.contains(&cause) => told,
        _ => format!("{told}: {cause}"),
    })
}

fn code(cause: &(dyn std::error::Error + 'static)) -> Option<Exit> {
    if let Some(SceneError::UnknownView { .. }) = cause.downcast_ref() {
        return Some(Exit::Usage);
    }
    if let Some(ExportError::Scale(_) | ExportError::NoMass) = cause.downcast_ref() {
        return Some(Exit::Scene);
    }
    if let Some(BatchError::Incomplete { .. }) = cause.downcast_ref() {
        return Some(Exit::Batch);
    }
    let exits: [(Exit, &[bool]); 4] = [
        (
            Exit::Usage,
            &[
                cause.is::<UsageError>(),
                cause.is::<BatchError>(),
                cause.is::<ConfigError>(),
                cause.is::<WorkDirError>(),
                cause.is::<LibraryError>(),
                cause.is::<PromptError>(),
                cause.is::<LabelsError>(),
                cause.is::<PriceError>(),
                cause.is::<ClientError>(),
                cause.is::<ExchangeError>(),
                cause.is::<EvaluateError>(),
                cause.is::<MasksError>(),
                cause.is::<OutcomesError>(),
                cause.is::<SimulationError>(),
                cause.is::<SimulateError>(),
                cause.is::<GraspError>(),
                cause.is::<ExportError>(),
            ],
        ),
        (
            Exit::Scene,
            &[
                cause.is::<SceneError>(),
                cause.is::<ImportError>(),
                cause.is::<PlyError>(),
                cause.is::<VoteError>(),
                cause.is::<PartsError>(),
            ],
        ),
        (Exit::Model, &[cause.is::<SetupError>(), cause.is::<SegmentError>()]),
        (Exit::Answer, &[cause.is::<QueryError>(), cause.is::<RecordingError>()]),
    ];
    exits.into_iter().find(|(_, found)| found.contains(&true)).map(|(exit, _)| exit)
}

/// Makes a panic end the process with [`Exit::Bug`] and a request to report it.
pub fn report_panics_as_bugs() {
    std::panic::set_hook(Box::new(|panic| {
        eprintln!("error: gprop has a bug: {panic}\nplease report it with the command and, if you can, the scene");
        std::process::exit(Exit::Bug as i32);
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_is_told_once() {
        let source = std::io::Error::other("no room");
        let error = anyhow::Error::from(WorkDirError::Write { path: "a".into(), source });
        let text = error.to_string();
        assert!(text.contains("no room"), "{text}");
        assert_eq!(message(&error.context("scene 7")), format!("scene 7: {text}"));
        assert_eq!(message(&anyhow::anyhow!("left").context("right")), "right: left");
    }
}
