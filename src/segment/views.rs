//! Segments many views in parallel and passes each on as soon as it is done.

use std::sync::atomic::{AtomicU64, Ordering};

use indicatif::ProgressBar;
use rayon::prelude::*;

use super::error::SegmentError;
use super::observer::Observer;
use super::options::Options;
use super::segmenter::Segmenter;
use super::{Segmentation, ViewSegments};
use crate::progress::Progress;
use crate::scene::Photo;

/// Segments the named views on the ambient rayon pool. `load` reads a view's photo when its turn comes; `finished` gets
/// each view as soon as it is done, in no particular order. The result is in the order of `names` and does not depend
/// on the number of threads.
///
/// # Errors
/// The first error of `load` or `finished`, or [`SegmentError`]; views in progress are finished before it is returned.
pub fn segment_views<E: From<SegmentError> + Send>(
    segmenter: &Segmenter,
    names: &[&str],
    load: &(dyn Fn(&str) -> Result<Photo, E> + Sync),
    options: &Options,
    progress: Progress,
    finished: &(dyn Fn(&ViewSegments) -> Result<(), E> + Sync),
) -> Result<Segmentation, E> {
    let tally = Tally::new(progress, names.len());
    let segment_one = |name: &&str| -> Result<ViewSegments, E> {
        let photo = load(name)?;
        tally.view_begun();
        let segments = segmenter.segment_view(name, &photo, options, &tally)?;
        finished(&segments)?;
        tally.view_done();
        Ok(segments)
    };
    let views = names.par_iter().map(segment_one).collect::<Result<Vec<_>, E>>();
    tally.bar.finish_and_clear();
    Ok(Segmentation { views: views? })
}

/// A progress bar over all prompts of all views. The number of prompts of a view is known only once it has begun, so
/// the total is the mean of the views begun times the number of views.
struct Tally {
    bar: ProgressBar,
    views: u64,
    views_begun: AtomicU64,
    prompts_planned: AtomicU64,
    views_done: AtomicU64,
}

impl Tally {
    fn new(progress: Progress, views: usize) -> Self {
        let tally = Self {
            bar: progress.bar("segment", 0),
            views: views as u64,
            views_begun: AtomicU64::new(0),
            prompts_planned: AtomicU64::new(0),
            views_done: AtomicU64::new(0),
        };
        tally.show_views(0);
        tally
    }

    fn view_begun(&self) {
        self.views_begun.fetch_add(1, Ordering::Relaxed);
    }

    fn view_done(&self) {
        self.show_views(self.views_done.fetch_add(1, Ordering::Relaxed) + 1);
    }

    fn show_views(&self, done: u64) {
        self.bar.set_message(format!("prompts, {done} of {} views done", self.views));
    }
}

impl Observer for Tally {
    fn planned(&self, prompts: usize) {
        let prompts = self.prompts_planned.fetch_add(prompts as u64, Ordering::Relaxed) + prompts as u64;
        self.bar.set_length(prompts * self.views / self.views_begun.load(Ordering::Relaxed).max(1));
    }

    fn prompted(&self) {
        self.bar.inc(1);
    }
}
