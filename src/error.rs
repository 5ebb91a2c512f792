//! The errors that every module can report, and their messages.

use std::fmt;

use thiserror::Error as ThisError;

/// Why a [`Pipeline`](crate::Pipeline) failed, in the program's words: what failed, where, why, and the remedy.
/// [`kind`](Self::kind) is the exit code with which the program would end.
pub struct Error(pub(crate) anyhow::Error);

impl Error {
    /// The first cause that is a `T`, such as [`SceneError`](crate::scene::SceneError).
    pub fn downcast_ref<T: std::error::Error + 'static>(&self) -> Option<&T> {
        self.0.chain().find_map(|cause| cause.downcast_ref())
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&message(&self.0))
    }
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.0, f)
    }
}

// Its text includes those of its causes, so it has no source.
impl std::error::Error for Error {}

/// A request that cannot be carried out as given.
#[derive(Debug, ThisError)]
#[error("{0}")]
pub struct UsageError(pub String);

/// An error in one line: what failed, then each cause that is not yet part of the text.
pub fn message(error: &anyhow::Error) -> String {
    joined(error.chain().map(ToString::to_string))
}

/// Joins the texts of an error and its causes, outermost first; a cause that is already part of the text is left out.
pub fn joined(causes: impl Iterator<Item = String>) -> String {
    causes.fold(String::new(), |told, cause| match told.as_str() {
        "" => cause,
        _ if told.contains(&cause) => told,
        _ => format!("{told}: {cause}"),
    })
}

#[cfg(test)]
mod tests {
    use super::message;
    use crate::workdir::WorkDirError;

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
