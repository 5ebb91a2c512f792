//! Progress reports within a picture.

/// Receives progress reports about a picture, from any thread.
pub trait Observer: Sync {
    /// Announces this many more prompts for the picture.
    fn announced(&self, prompts: usize);
    /// One prompt is done.
    fn prompted(&self);
}

/// Ignores everything.
impl Observer for () {
    fn announced(&self, _: usize) {}
    fn prompted(&self) {}
}
