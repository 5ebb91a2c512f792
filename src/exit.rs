//! How the program ends: the text of an error, and the kind of every typed error, from which the exit code follows.

use crate::audit::AuditError;
use crate::batch::BatchError;
use crate::config::ConfigError;
use crate::config::option_values::OptionError;
use crate::error::{Error, ErrorKind, Kinded, joined};
use crate::evaluate::EvaluateError;
use crate::evaluate::grasp::OutcomesError;
use crate::evaluate::masks::MasksError;
use crate::evaluate::simulation::SimulationError;
use crate::export::ExportError;
use crate::film::FilmError;
use crate::grasp::GraspError;
use crate::inspect::{InspectError, NotAligned, UpInDoubt};
use crate::links::LinksError;
use crate::materials::LibraryError;
use crate::objects::SomeFailed;
use crate::parts::PartsError;
use crate::query::ask::cost::PriceError;
use crate::query::client::ClientError;
use crate::query::exchange::ExchangeError;
use crate::query::recorded::RecordingError;
use crate::query::{LabelsError, PromptError, QueryError};
use crate::report::PictureError;
use crate::scene::SceneError;
use crate::scene::splat::ply::PlyError;
use crate::segment::formats::ImportError;
use crate::segment::{LabelMapError, SegmentError};
use crate::setup::SetupError;
use crate::simulate::SimulateError;
use crate::vote::VoteError;
use crate::words::output;
use crate::words::progress::Cancelled;
use crate::workdir::WorkDirError;

/// The text of an error: what failed, then each cause that is not yet part of the text. One line, except for errors
/// that list several problems.
pub fn message(error: &Error) -> String {
    joined(error.texts().map(|(text, is_list)| {
        if is_list { output::harmless(&text).into_owned() } else { output::one_line(&text).into_owned() }
    }))
}

/// Error types of which every error is of one kind.
macro_rules! kinds {
    ($($kind:ident: $($error:ty),+;)+) => {
        $($(impl Kinded for $error {
            fn kind(&self) -> ErrorKind {
                ErrorKind::$kind
            }
        })+)+
    };
}

kinds! {
    Usage: ConfigError, WorkDirError, LibraryError, PromptError, LabelsError, PriceError, ClientError, ExchangeError,
        EvaluateError, MasksError, OutcomesError, SimulationError, SimulateError, GraspError, FilmError, OptionError,
        clap::Error;
    Scene: NotAligned, UpInDoubt, ImportError, PlyError;
    Model: SetupError;
    Answer: RecordingError;
    Batch: SomeFailed;
    Cancelled: Cancelled;
    // What gprop itself made and could not write or read.
    Bug: std::io::Error, std::string::FromUtf8Error, serde_json::Error, toml::ser::Error, image::ImageError,
        LabelMapError;
}

impl Kinded for AuditError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Wrong { .. } => ErrorKind::Wrong,
            Self::Unwritable { .. } => ErrorKind::Usage,
            _ => ErrorKind::Scene,
        }
    }
}

impl Kinded for LinksError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Write { .. } | Self::OwnFolder { .. } => ErrorKind::Usage,
            _ => ErrorKind::Scene,
        }
    }
}

impl Kinded for SceneError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::UnknownView { .. }
            | Self::NoSuchObject { .. }
            | Self::AllObjects
            | Self::SeveralObjects { .. }
            | Self::Option(_) => ErrorKind::Usage,
            _ => ErrorKind::Scene,
        }
    }
}

impl Kinded for InspectError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Scene(error) => error.kind(),
            Self::Page(error) => error.kind(),
        }
    }
}

impl Kinded for PictureError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Photo(error) => error.kind(),
            Self::Encode(error) => error.kind(),
        }
    }
}

impl Kinded for SegmentError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Option(_) => ErrorKind::Usage,
            _ => ErrorKind::Model,
        }
    }
}

impl Kinded for VoteError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Option(_) | Self::Correction(_) => ErrorKind::Usage,
            _ => ErrorKind::Scene,
        }
    }
}

impl Kinded for PartsError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Option(_) => ErrorKind::Usage,
            _ => ErrorKind::Scene,
        }
    }
}

impl Kinded for QueryError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Prompt(_) | Self::Option(_) => ErrorKind::Usage,
            Self::Cancelled(_) => ErrorKind::Cancelled,
            _ => ErrorKind::Answer,
        }
    }

    fn is_list(&self) -> bool {
        matches!(self, Self::Missing { .. } | Self::MissingWhole { .. } | Self::Import { .. })
    }
}

impl Kinded for ExportError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Scale(_) | Self::NoMass | Self::NoShape => ErrorKind::Scene,
            _ => ErrorKind::Usage,
        }
    }
}

impl Kinded for BatchError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Incomplete { .. } => ErrorKind::Batch,
            _ => ErrorKind::Usage,
        }
    }

    fn is_list(&self) -> bool {
        matches!(self, Self::Incomplete { .. })
    }
}

/// Makes a panic end the process with [`ErrorKind::Bug`] and a request to report it.
pub fn report_panics_as_bugs() {
    std::panic::set_hook(Box::new(|panic| {
        let report = "please report it with the command and, if you can, the scene";
        output::tell(&format!("error: gprop has a bug: {panic}\n{report}"));
        std::process::exit(i32::from(ErrorKind::Bug.exit_code()));
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::FailedScene;
    use crate::error::UsageError;

    #[test]
    fn a_prompt_file_that_cannot_be_used_is_wrong_usage_wherever_it_shows() {
        let error = || PromptError::Schema { file: "answer.schema.json".to_owned(), problem: "it is []".to_owned() };
        assert_eq!(error().kind(), ErrorKind::Usage);
        assert_eq!(QueryError::from(error()).kind(), ErrorKind::Usage);
    }

    #[test]
    fn a_missing_ffmpeg_is_no_bug() {
        assert_eq!(Error::from(FilmError::NoFfmpeg).context("film.mp4").kind(), ErrorKind::Usage);
    }

    #[test]
    fn only_lists_have_lines_of_their_own() {
        let forged = Error::from(UsageError("bad name: a\x1b[2J\nerror: forged".to_owned())).context("scene 7");
        assert_eq!(message(&forged), r"scene 7: bad name: a\u001b[2J\nerror: forged");
        let failed = vec![FailedScene { scene: "a\nb".to_owned(), error: "no\x07 splat\nhere".to_owned() }];
        let list = BatchError::Incomplete { scenes: 2, failed, missing: vec!["c".to_owned()], lacks_answers: false };
        let lines: Vec<String> = message(&list.into()).lines().skip(1).map(str::to_owned).collect();
        assert_eq!(lines[0], r"  a\nb: no\u0007 splat");
        assert!(lines.len() == 2 && lines[1].starts_with("  c: it has no result"), "{lines:?}");
        let failed = vec![FailedScene {
            scene: "a".to_owned(),
            error: "no recorded answer for 1 of 2 questions:\n  view 000".to_owned(),
        }];
        let list =
            message(&BatchError::Incomplete { scenes: 1, failed, missing: Vec::new(), lacks_answers: true }.into());
        assert!(list.lines().count() == 3 && list.contains("`gprop answer`"), "{list}");
    }
}
