//! A few sessions shared by as many threads: `ort` lets only one thread at a time run a session.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// A pool of items, each of which only one thread at a time may use.
pub struct Pool<T> {
    state: Mutex<State<T>>,
    returned: Condvar,
}

struct State<T> {
    idle: Vec<T>,
    /// Number of items that may still be made.
    to_make: usize,
}

impl<T> Pool<T> {
    pub fn new(all: Vec<T>) -> Self {
        Self::of(State { idle: all, to_make: 0 })
    }

    /// A pool of one item that [`Self::with_or_make`] may enlarge to `most`.
    pub fn growing(first: T, most: usize) -> Self {
        Self::of(State { idle: vec![first], to_make: most.saturating_sub(1) })
    }

    fn of(state: State<T>) -> Self {
        Self { state: Mutex::new(state), returned: Condvar::new() }
    }

    /// Runs `work` on an idle item of a pool that does not grow, waiting for one if necessary. `work` must not call this
    /// method again.
    pub fn with<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        self.work_on(self.take_idle(), work)
    }

    /// Runs `work` on an idle item or, if there is none and the pool may still grow, on one that `make` makes. If there is
    /// none of either, waits for an item. `work` must not call this method again.
    pub fn with_or_make<R>(&self, make: impl FnOnce() -> Option<T>, work: impl FnOnce(&mut T) -> R) -> R {
        let mut state = self.locked();
        let idle = state.idle.pop();
        let may_make = idle.is_none() && state.to_make > 0;
        state.to_make -= usize::from(may_make);
        drop(state);
        let item = idle.or_else(|| if may_make { make() } else { None });
        self.work_on(item.unwrap_or_else(|| self.take_idle()), work)
    }

    /// Runs `work` on `item` and returns the item to the pool. It is returned even if `work` panics: other threads may wait for it.
    fn work_on<R>(&self, mut item: T, work: impl FnOnce(&mut T) -> R) -> R {
        let result = catch_unwind(AssertUnwindSafe(|| work(&mut item)));
        self.locked().idle.push(item);
        self.returned.notify_one();
        result.unwrap_or_else(|panic| resume_unwind(panic))
    }

    /// An idle item, waiting for one if necessary.
    fn take_idle(&self) -> T {
        let mut state = self.locked();
        loop {
            if let Some(item) = state.idle.pop() {
                return item;
            }
            state = self.returned.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn locked(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn a_growing_pool_makes_what_is_used_at_once_and_no_more() {
        let (pool, made, both) = (Pool::growing(0, 8), AtomicUsize::new(0), Barrier::new(2));
        let make = || Some(made.fetch_add(1, Ordering::Relaxed) + 1);
        for _ in 0..3 {
            assert_eq!(pool.with_or_make(make, |item| *item), 0);
        }
        assert_eq!(made.load(Ordering::Relaxed), 0, "one after another");
        for _ in 0..3 {
            let use_both = || pool.with_or_make(make, |_| both.wait().is_leader());
            std::thread::scope(|scope| [scope.spawn(use_both), scope.spawn(use_both)].map(|used| used.join().unwrap()));
        }
        assert_eq!(made.load(Ordering::Relaxed), 1, "two at once");
    }

    #[test]
    fn an_item_returns_to_its_pool_even_if_the_work_on_it_panics() {
        let pool = Pool::new(vec![7]);
        let work = || pool.with(|item| assert_eq!(*item, 0, "this panic is part of the test"));
        assert!(std::thread::scope(|scope| scope.spawn(work).join()).is_err());
        assert_eq!(pool.locked().idle, [7]);
    }

    #[test]
    fn a_pool_that_cannot_grow_shares_what_it_has() {
        let (pool, failed) = (Pool::growing(7, 2), AtomicUsize::new(0));
        let fail = || {
            failed.fetch_add(1, Ordering::Relaxed);
            None
        };
        std::thread::scope(|scope| {
            pool.with_or_make(fail, |_| {
                let other = scope.spawn(|| pool.with_or_make(fail, |item| *item));
                while failed.load(Ordering::Relaxed) == 0 {
                    std::thread::yield_now();
                }
                other
            })
            .join()
            .map(|item| assert_eq!(item, 7))
            .unwrap();
        });
        assert_eq!(pool.with_or_make(fail, |item| *item), 7);
        assert_eq!(failed.load(Ordering::Relaxed), 1);
    }
}
