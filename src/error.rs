//! The errors that every module can report, and their messages.

use std::fmt;

use thiserror::Error as ThisError;

/// What kind of failure an error is. Each has its [exit code](Self::exit_code), which is part of the command-line contract.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[repr(u8)]
pub enum ErrorKind {
    /// A check found something wrong: `gprop audit`.
    Wrong = 1,
    /// Wrong usage or configuration: options, `gprop.toml`, an unwritable folder, no ffmpeg for an MP4.
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
    /// The run was cancelled; the code of programs that an interrupt ends.
    Cancelled = 130,
}

impl ErrorKind {
    /// The exit code of the program when it ends with such an error.
    pub const fn exit_code(self) -> u8 {
        self as u8
    }
}

/// An error that knows its kind.
pub trait Kinded: std::error::Error + Send + Sync + 'static {
    fn kind(&self) -> ErrorKind;

    /// True if its text lists several problems, one on each line.
    fn is_list(&self) -> bool {
        false
    }
}

/// Why a [`Pipeline`](crate::Pipeline) failed, in the program's words: what failed, where, why, and the remedy.
///
/// It can only be made from an error that [knows its kind](Kinded), so every failure has one.
pub struct Error {
    kind: ErrorKind,
    is_list: bool,
    /// How many of the texts at the beginning of the chain say where it happened.
    contexts: usize,
    chain: anyhow::Error,
}

/// A result of a function of the program.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// What kind of failure it is.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// The first cause that is a `T`, such as [`SceneError`](crate::scene::SceneError).
    pub fn downcast_ref<T: std::error::Error + 'static>(&self) -> Option<&T> {
        self.chain.chain().find_map(|cause| cause.downcast_ref())
    }

    /// The error as a `T`, if it is one.
    ///
    /// # Errors
    /// The error itself if it is not.
    pub(crate) fn downcast<T: std::error::Error + Send + Sync + 'static>(self) -> Result<T> {
        self.chain.downcast().map_err(|chain| Self { chain, ..self })
    }

    /// The error, with where it happened.
    #[must_use]
    pub(crate) fn context(self, place: impl fmt::Display + Send + Sync + 'static) -> Self {
        Self { contexts: self.contexts + 1, chain: self.chain.context(place), ..self }
    }

    /// The texts of the error and its causes, outermost first, each with whether it lists several problems.
    pub(crate) fn texts(&self) -> impl Iterator<Item = (String, bool)> {
        let is_list = |at: usize| self.is_list && at == self.contexts;
        self.chain.chain().enumerate().map(move |(at, cause)| (cause.to_string(), is_list(at)))
    }
}

impl<E: Kinded> From<E> for Error {
    fn from(error: E) -> Self {
        Self { kind: error.kind(), is_list: error.is_list(), contexts: 0, chain: error.into() }
    }
}

/// Says where an error happened.
pub(crate) trait Context<T> {
    fn context(self, place: impl fmt::Display + Send + Sync + 'static) -> Result<T>;
    fn with_context<C: fmt::Display + Send + Sync + 'static>(self, place: impl FnOnce() -> C) -> Result<T>;
}

impl<T, E: Into<Error>> Context<T> for Result<T, E> {
    fn context(self, place: impl fmt::Display + Send + Sync + 'static) -> Result<T> {
        self.map_err(|error| error.into().context(place))
    }

    fn with_context<C: fmt::Display + Send + Sync + 'static>(self, place: impl FnOnce() -> C) -> Result<T> {
        self.map_err(|error| error.into().context(place()))
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&joined(self.texts().map(|(text, _)| text)))
    }
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.chain, f)
    }
}

// Its text includes those of its causes, so it has no source.
impl std::error::Error for Error {}

/// A request that cannot be carried out as given.
#[derive(Debug, ThisError)]
#[error("{0}")]
pub struct UsageError(pub String);

impl Kinded for UsageError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Usage
    }
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
    use super::*;

    #[derive(Debug, ThisError)]
    #[error("no room: {0}")]
    struct NoRoom(#[source] std::io::Error);

    impl Kinded for NoRoom {
        fn kind(&self) -> ErrorKind {
            ErrorKind::Model
        }
    }

    #[test]
    fn a_cause_is_told_once_and_a_place_first() {
        let error = Error::from(NoRoom(std::io::Error::other("the disk is full")));
        assert_eq!(error.to_string(), "no room: the disk is full");
        let placed = Err::<(), _>(error).context("scene 7").unwrap_err();
        assert_eq!(placed.to_string(), "scene 7: no room: the disk is full");
        assert!(placed.kind() == ErrorKind::Model && placed.downcast_ref::<NoRoom>().is_some());
    }

    #[test]
    fn an_error_of_another_type_is_given_back() {
        let error = Error::from(UsageError("no".to_owned())).downcast::<NoRoom>().unwrap_err();
        assert!(error.kind() == ErrorKind::Usage && error.downcast::<UsageError>().is_ok());
    }
}
