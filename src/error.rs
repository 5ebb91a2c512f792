//! The error that every room may report, and how an error is told.

use thiserror::Error;

/// A request that cannot be carried out as it was typed.
#[derive(Debug, Error)]
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
