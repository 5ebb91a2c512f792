//! A few sessions shared by as many threads: `ort` lets only one thread at a time run a session.

use std::sync::{Condvar, Mutex, PoisonError};

/// A pool of items, each of which only one thread at a time may use.
pub struct Pool<T> {
    idle: Mutex<Vec<T>>,
    returned: Condvar,
}

impl<T> Pool<T> {
    pub fn new(all: Vec<T>) -> Self {
        Self { idle: Mutex::new(all), returned: Condvar::new() }
    }

    /// Runs `work` on an idle item, waiting for one if necessary. `work` must not call this method again.
    pub fn with<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let mut item = loop {
            match idle.pop() {
                Some(item) => break item,
                None => idle = self.returned.wait(idle).unwrap_or_else(PoisonError::into_inner),
            }
        };
        drop(idle);
        let result = work(&mut item);
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(item);
        self.returned.notify_one();
        result
    }
}
