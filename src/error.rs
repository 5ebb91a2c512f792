//! The errors that every room may report, and how an error is told.

use std::fmt;

use thiserror::Error as ThisError;

/// Why a [`Pipeline`](crate::Pipeline) could not do something, in the program's words: what failed, where, why, and what to
/// do. [`kind`](Self::kind) is the exit code that the program would end with.
pub struct Error(pub(crate) anyhow::Error);

impl Error {
    /// The first of the causes that is a `T`, such as [`SceneError`](crate::scene::SceneError).
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

// Its text holds those of its causes, so it names none as its source.
impl std::error::Error for Error {}

/// A request that cannot be carried out as it was typed.
#[derive(Debug, ThisError)]
#[error("{0}")]
pub struct UsageError(pub String);

/// An error in one line: what failed, then each cause that is not told yet.
pub fn message(error: &anyhow::Error) -> String {
    joined(error.chain().map(ToString::to_string))
}

/// Causes in one text, each that is not told yet behind the one that it caused.
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
