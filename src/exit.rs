//! The exit codes and which error leads to which: the one place that knows.

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
