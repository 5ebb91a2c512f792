//! Progress within a picture.

/// Told how far a picture is, from any thread.
pub trait Observer: Sync {
    /// The picture will take this many prompts more.
    fn planned(&self, prompts: usize);
    /// One of them is done.
    fn prompted(&self);
}

/// Ignores everything.
impl Observer for () {
    fn planned(&self, _: usize) {}
    fn prompted(&self) {}
}
