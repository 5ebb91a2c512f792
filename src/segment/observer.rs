//! Progress reports within a picture.

/// Receives progress reports about a picture, from any thread.
pub trait Observer: Sync {
    /// This many more prompts are planned for the picture.
    fn planned(&self, prompts: usize);
    /// One prompt is done.
    fn prompted(&self);
}

/// Ignores everything.
impl Observer for () {
    fn planned(&self, _: usize) {}
    fn prompted(&self) {}
}
