//! The exit codes and the errors that lead to them, all in one place.

use crate::batch::BatchError;
use crate::config::ConfigError;
use crate::config::option_values::OptionError;
use crate::error::{self, Error, UsageError};
use crate::evaluate::EvaluateError;
use crate::evaluate::grasp::OutcomesError;
use crate::evaluate::masks::MasksError;
use crate::evaluate::simulation::SimulationError;
use crate::export::ExportError;
use crate::film::FilmError;
use crate::grasp::GraspError;
use crate::inspect::NotAligned;
use crate::materials::LibraryError;
use crate::parts::PartsError;
use crate::query::ask::cost::PriceError;
use crate::query::client::ClientError;
use crate::query::exchange::ExchangeError;
use crate::query::recorded::RecordingError;
use crate::query::{LabelsError, PromptError, QueryError};
use crate::scene::SceneError;
use crate::scene::splat::ply::PlyError;
use crate::segment::SegmentError;
use crate::segment::formats::ImportError;
use crate::setup::SetupError;
use crate::simulate::SimulateError;
use crate::vote::VoteError;
use crate::words::output;
use crate::workdir::WorkDirError;

/// The exit codes of gprop. The numbers are part of the command-line contract.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// Everything asked for was done.
    Done = 0,
    /// Wrong usage or configuration: flags, `gprop.toml`, an unwritable folder, no ffmpeg for an MP4.
    Usage = 2,
    /// The scene's data is bad or missing.
    Scene = 3,
    /// ONNX Runtime or a model is missing or broken.
    Model = 4,
    /// An answer is missing: it is not recorded and no server is named, the model refused, or the budget is spent.
    Answer = 5,
    /// Part of a batch failed.
    Batch = 6,
    /// A bug in gprop.
    Bug = 70,
}

impl Error {
    /// The kind of the error: the exit code with which the program would end.
    pub fn kind(&self) -> Exit {
        of(&self.0)
    }
}

/// The exit code of an error: that of the first typed error in its chain. An error without a type is a bug.
pub fn of(error: &anyhow::Error) -> Exit {
    // Each stage's errors include those of its options.
    if error.chain().any(<dyn std::error::Error>::is::<OptionError>) {
        return Exit::Usage;
    }
    error.chain().find_map(code).unwrap_or(Exit::Bug)
}

/// The text of an error: what failed, then each cause that is not yet part of the text. One line, except for errors
/// that list several problems.
pub fn message(error: &anyhow::Error) -> String {
    error::joined(error.chain().map(text_of))
}

fn text_of(cause: &(dyn std::error::Error + 'static)) -> String {
    if let Some(error) = cause.downcast_ref::<Error>() {
        return message(&error.0);
    }
    let lists = matches!(
        cause.downcast_ref(),
        Some(QueryError::Missing { .. } | QueryError::MissingSize { .. } | QueryError::Import { .. })
    ) || matches!(cause.downcast_ref(), Some(BatchError::Incomplete { .. }));
    let text = cause.to_string();
    if lists { output::harmless(&text).into_owned() } else { output::one_line(&text).into_owned() }
}

fn code(cause: &(dyn std::error::Error + 'static)) -> Option<Exit> {
    if let Some(error) = cause.downcast_ref::<Error>() {
        return Some(error.kind());
    }
    if let Some(SceneError::UnknownView { .. }) = cause.downcast_ref() {
        return Some(Exit::Usage);
    }
    if let Some(ExportError::Scale(_) | ExportError::NoMass | ExportError::NoShape) = cause.downcast_ref() {
        return Some(Exit::Scene);
    }
    if let Some(BatchError::Incomplete { .. }) = cause.downcast_ref() {
        return Some(Exit::Batch);
    }
    if let Some(QueryError::Prompt(_)) = cause.downcast_ref() {
        return Some(Exit::Usage);
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
                cause.is::<FilmError>(),
            ],
        ),
        (
            Exit::Scene,
            &[
                cause.is::<SceneError>(),
                cause.is::<NotAligned>(),
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
        let report = "please report it with the command and, if you can, the scene";
        output::tell(&format!("error: gprop has a bug: {panic}\n{report}"));
        std::process::exit(Exit::Bug as i32);
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prompt_file_that_cannot_be_used_is_wrong_usage_wherever_it_shows() {
        let error = || PromptError::Schema { file: "answer.schema.json".to_owned(), problem: "it is []".to_owned() };
        assert_eq!(of(&error().into()), Exit::Usage);
        assert_eq!(of(&QueryError::from(error()).into()), Exit::Usage);
    }

    #[test]
    fn a_missing_ffmpeg_is_no_bug() {
        assert_eq!(of(&anyhow::Error::from(FilmError::NoFfmpeg).context("film.mp4")), Exit::Usage);
    }

    #[test]
    fn only_lists_have_lines_of_their_own() {
        let forged = anyhow::Error::from(UsageError("bad name: a\x1b[2J\nerror: forged".to_owned())).context("scene 7");
        assert_eq!(message(&forged), r"scene 7: bad name: a\u001b[2J\nerror: forged");
        let failed = vec![("a\nb".to_owned(), "no\x07 splat\nhere".to_owned())];
        let list = BatchError::Incomplete { scenes: 2, failed, missing: vec!["c".to_owned()] };
        let lines: Vec<String> = message(&list.into()).lines().skip(1).map(str::to_owned).collect();
        assert_eq!(lines[0], r"  a\nb: no\u0007 splat");
        assert!(lines.len() == 2 && lines[1].starts_with("  c: it has no result"), "{lines:?}");
    }
}
