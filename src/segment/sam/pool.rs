//! A handful of sessions shared by as many threads: `ort` lets only one thread at a time run a session.

use std::sync::{Condvar, Mutex, PoisonError};

/// Things of which one thread at a time may use each.
pub struct Pool<T> {
    idle: Mutex<Vec<T>>,
    returned: Condvar,
}

impl<T> Pool<T> {
    pub fn new(all: Vec<T>) -> Self {
        Self { idle: Mutex::new(all), returned: Condvar::new() }
    }

    /// Runs `work` on one that is idle, waiting for one if need be. `work` must not come back here.
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
