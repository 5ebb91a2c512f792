//! Segments many views in parallel and passes each on as soon as it is done.

use std::sync::atomic::{AtomicU64, Ordering};

use super::error::SegmentError;
use super::observer::Observer;
use super::options::Options;
use super::segmenter::Segmenter;
use super::{Segmentation, ViewSegments};
use crate::parallel;
use crate::scene::Photo;
use crate::words::progress::{Bar, Progress, WHOLE};

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
    options.check().map_err(SegmentError::from)?;
    let tally = Tally::new(progress, names.len());
    let segment_one = |name: &&str| -> Result<ViewSegments, E> {
        let photo = load(name)?;
        let segments = segmenter.segment_view(name, &photo, options, &tally.view())?;
        finished(&segments)?;
        tally.view_done();
        Ok(segments)
    };
    let views = parallel::try_map(names, segment_one);
    tally.bar.finish_and_clear();
    Ok(Segmentation { views: views? })
}

/// A progress bar over the views. How many prompts a view takes is known only while it is segmented, and may still grow
/// then; so each view has an equal part of the bar, which its prompts fill up to [`BY_PROMPTS`] and never empty.
struct Tally<'a> {
    bar: Bar<'a>,
    views: u64,
    views_done: AtomicU64,
    /// The sum over the views of the parts that are filled, in [`WHOLE`]ths of a view.
    filled: AtomicU64,
}

/// How much of a view's part its prompts fill, in [`WHOLE`]ths. Filtering their masks takes about as long as the
/// prompts themselves.
const BY_PROMPTS: u64 = WHOLE / 2;

/// One view's part of the bar.
struct ViewTally<'a> {
    tally: &'a Tally<'a>,
    announced: AtomicU64,
    prompted: AtomicU64,
    /// How much of its part is filled, in [`WHOLE`]ths.
    filled: AtomicU64,
}

impl<'a> Tally<'a> {
    fn new(progress: Progress<'a>, views: usize) -> Self {
        let tally = Self {
            bar: progress.share_bar("segment"),
            views: views as u64,
            views_done: AtomicU64::new(0),
            filled: AtomicU64::new(0),
        };
        tally.show_views(0);
        tally
    }

    fn view(&self) -> ViewTally<'_> {
        let zero = || AtomicU64::new(0);
        ViewTally { tally: self, announced: zero(), prompted: zero(), filled: zero() }
    }

    fn view_done(&self) {
        self.show_views(self.views_done.fetch_add(1, Ordering::Relaxed) + 1);
    }

    fn show_views(&self, done: u64) {
        self.bar.set_message(format!("{done} of {} views", self.views));
    }

    fn fill(&self, more: u64) {
        let filled = self.filled.fetch_add(more, Ordering::Relaxed) + more;
        self.bar.set_position(filled / self.views.max(1));
    }
}

impl ViewTally<'_> {
    /// Fills the view's part up to `to`, unless it is fuller already.
    fn fill(&self, to: u64) {
        let before = self.filled.fetch_max(to, Ordering::Relaxed);
        self.tally.fill(to.saturating_sub(before));
    }
}

impl Observer for ViewTally<'_> {
    fn announced(&self, prompts: usize) {
        self.announced.fetch_add(prompts as u64, Ordering::Relaxed);
    }

    fn prompted(&self) {
        let prompted = self.prompted.fetch_add(1, Ordering::Relaxed) + 1;
        self.fill(BY_PROMPTS * prompted / self.announced.load(Ordering::Relaxed).max(prompted));
    }
}

/// A view that is done, or has failed, fills its whole part of the bar.
impl Drop for ViewTally<'_> {
    fn drop(&mut self) {
        self.fill(WHOLE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_only_moves_forwards_and_ends_full() {
        let tally = Tally::new(Progress::HIDDEN, 2);
        let mut positions = Vec::new();
        for late in [0, 7] {
            let view = tally.view();
            view.announced(3);
            for prompt in 0..3 + late {
                if prompt == 2 {
                    view.announced(late);
                }
                view.prompted();
                positions.push(tally.bar.position());
            }
            drop(view);
            positions.push(tally.bar.position());
        }
        assert!(positions.is_sorted(), "{positions:?}");
        assert_eq!((positions[3], positions.last()), (WHOLE / 2, Some(&WHOLE)));
    }
}
