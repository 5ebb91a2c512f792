//! Work in parallel, on the ambient rayon pool. Results keep the order of the items, and so are the same whatever the
//! number of threads.
//!
//! Only this module calls rayon's iterators. They are compiled anew, some thousand lines each, for every closure; here
//! that happens once, in [`split`], and a caller's closure is compiled into a plain loop over a range.

use std::cmp;
use std::ops::Range;
use std::panic::resume_unwind;
use std::slice;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

/// [`flat_map_range`] cuts its range into at most this many pieces: many times more than there are threads, so that all
/// of them are busy to the end.
const PIECES: usize = 512;

/// The value of every item.
pub fn map<'a, T: Sync, V: Send>(items: &'a [T], value_of: impl Fn(&'a T) -> V + Sync) -> Vec<V> {
    map_range(items.len(), |i| value_of(&items[i]))
}

/// The value of every index below `count`.
pub fn map_range<V: Send>(count: usize, value_of: impl Fn(usize) -> V + Sync) -> Vec<V> {
    let mut values = Vec::with_capacity(count);
    for_each_mut(&mut values.spare_capacity_mut()[..count], |i, place| {
        place.write(value_of(i));
    });
    // SAFETY: every one of the first `count` places has been written; a panic has left this function.
    unsafe { values.set_len(count) };
    values
}

/// The value of every item.
///
/// # Errors
/// That of the first item that has one. Items behind it may be left out.
pub fn try_map<'a, T: Sync, V: Send, E: Send>(
    items: &'a [T],
    value_of: impl Fn(&'a T) -> Result<V, E> + Sync,
) -> Result<Vec<V>, E> {
    let first_failed = AtomicUsize::new(usize::MAX);
    let results = map_range(items.len(), |i| {
        if i > first_failed.load(Ordering::Relaxed) {
            return None;
        }
        let result = value_of(&items[i]);
        if result.is_err() {
            first_failed.fetch_min(i, Ordering::Relaxed);
        }
        Some(result)
    });
    let mut values = Vec::with_capacity(items.len());
    for result in results.into_iter().flatten() {
        values.push(result?);
    }
    Ok(values)
}

/// The values of every item, one after the other: none, one or several of each.
pub fn flat_map<'a, T: Sync, V: Send, I: IntoIterator<Item = V>>(
    items: &'a [T],
    values_of: impl Fn(&'a T) -> I + Sync,
) -> Vec<V> {
    flat_map_range(items.len(), |i| values_of(&items[i]))
}

/// The values of every index below `count`, one after the other: none, one or several of each.
pub fn flat_map_range<V: Send, I: IntoIterator<Item = V>>(
    count: usize,
    values_of: impl Fn(usize) -> I + Sync,
) -> Vec<V> {
    let size = count.div_ceil(PIECES).max(1);
    let pieces = map_range(count.div_ceil(size), |piece| {
        let mut values = Vec::new();
        for i in piece * size..count.min((piece + 1) * size) {
            values.extend(values_of(i));
        }
        values
    });
    let mut values = Vec::with_capacity(pieces.iter().map(Vec::len).sum());
    for mut piece in pieces {
        values.append(&mut piece);
    }
    values
}

/// Changes every item; `change` also gets its index.
pub fn for_each_mut<T: Send>(items: &mut [T], change: impl Fn(usize, &mut T) + Sync) {
    struct Start<T>(*mut T);
    // SAFETY: below, each thread reaches other items through it.
    unsafe impl<T: Send> Sync for Start<T> {}
    impl<T> Start<T> {
        fn at(&self, index: usize) -> *mut T {
            self.0.wrapping_add(index)
        }
    }
    let start = Start(items.as_mut_ptr());
    split(items.len(), &|range| {
        // SAFETY: the ranges that `split` gives lie inside of the items, which are borrowed as long as this runs, and do
        // not overlap.
        let part = unsafe { slice::from_raw_parts_mut(start.at(range.start), range.len()) };
        for (i, item) in range.zip(part) {
            change(i, item);
        }
    });
}

/// Changes every item and returns its value; `value_of` also gets its index. For items that take long: several
/// allocations are made for all of them.
pub fn map_mut<T: Send, V: Send>(items: &mut [T], value_of: impl Fn(usize, &mut T) -> V + Sync) -> Vec<V> {
    let mut pairs: Vec<(&mut T, Option<V>)> = items.iter_mut().map(|item| (item, None)).collect();
    for_each_mut(&mut pairs, |i, (item, value)| *value = Some(value_of(i, item)));
    pairs.into_iter().map(|(_, value)| value.expect("every item has been changed")).collect()
}

/// Changes every chunk of `size` items, the last of which may be shorter, and returns its value; `value_of` also gets the
/// chunk's number.
pub fn map_chunks_mut<T: Send, V: Send>(
    items: &mut [T],
    size: usize,
    value_of: impl Fn(usize, &mut [T]) -> V + Sync,
) -> Vec<V> {
    map_mut(&mut items.chunks_mut(size).collect::<Vec<_>>(), |i, chunk| value_of(i, chunk))
}

/// Changes every chunk of `size` items, the last of which may be shorter; `change` also gets the chunk's number.
pub fn for_each_chunk_mut<T: Send>(items: &mut [T], size: usize, change: impl Fn(usize, &mut [T]) + Sync) {
    for_each_mut(&mut items.chunks_mut(size).collect::<Vec<_>>(), |i, chunk| change(i, chunk));
}

/// Sorts; items that compare equal may change places.
pub fn sort_unstable_by<T: Send>(items: &mut [T], compare: impl Fn(&T, &T) -> cmp::Ordering + Sync) {
    use rayon::slice::ParallelSliceMut;

    #[expect(clippy::disallowed_methods, reason = "this is where it is called")]
    items.par_sort_unstable_by(compare);
}

/// Sorts; items that compare equal keep their order.
pub fn sort_by<T: Send>(items: &mut [T], compare: impl Fn(&T, &T) -> cmp::Ordering + Sync) {
    use rayon::slice::ParallelSliceMut;

    #[expect(clippy::disallowed_methods, reason = "this is where it is called")]
    items.par_sort_by(compare);
}

/// The results of two functions.
pub fn join<A: Send, B: Send>(one: impl FnOnce() -> A + Send, other: impl FnOnce() -> B + Send) -> (A, B) {
    fn join(one: &mut (dyn FnMut() + Send), other: &mut (dyn FnMut() + Send)) {
        #[expect(clippy::disallowed_methods, reason = "this is where it is called")]
        rayon::join(one, other);
    }
    let (mut one, mut other) = (Some(one), Some(other));
    let (mut of_one, mut of_other) = (None, None);
    join(&mut || of_one = one.take().map(|one| one()), &mut || of_other = other.take().map(|other| other()));
    (of_one.expect("it has run"), of_other.expect("it has run"))
}

/// Calls `work` with every item, up to `lanes` of them at the same time, each on a thread of its own outside of the pool. For
/// long pieces of work that do most of what they do on the pool: while one has work for a single thread, another fills it.
///
/// # Errors
/// That of the first item that has one. Once an item has failed, no others begin.
pub fn side_by_side<T: Sync, E: Send>(
    items: &[T],
    lanes: usize,
    work: impl Fn(&T) -> Result<(), E> + Sync,
) -> Result<(), E> {
    if lanes < 2 || items.len() < 2 {
        return items.iter().try_for_each(work);
    }
    let (next, has_failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let lane = || -> Option<(usize, E)> {
        while !has_failed.load(Ordering::Relaxed) {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if let Err(error) = work(items.get(index)?) {
                has_failed.store(true, Ordering::Relaxed);
                return Some((index, error));
            }
        }
        None
    };
    let failed = thread::scope(|scope| {
        let lanes: Vec<_> = (0..lanes.min(items.len())).map(|_| scope.spawn(lane)).collect();
        let ended = lanes.into_iter().map(|lane| lane.join().unwrap_or_else(|panic| resume_unwind(panic)));
        ended.flatten().min_by_key(|(index, _)| *index)
    });
    failed.map_or(Ok(()), |(_, error)| Err(error))
}

/// Calls `task` with ranges that make up `0..count`, each index once: as many ranges as there are threads, and more
/// where a thread has become idle.
fn split(count: usize, task: &(dyn Fn(Range<usize>) + Sync)) {
    use rayon::iter::ParallelIterator;

    let halves = |range: Range<usize>| {
        let middle = range.start + range.len() / 2;
        if range.len() < 2 { (range, None) } else { (range.start..middle, Some(middle..range.end)) }
    };
    #[expect(clippy::disallowed_methods, reason = "this is where it is called")]
    rayon::iter::split(0..count, halves).for_each(task);
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;

    fn with_threads(threads: usize, work: impl Fn() + Send + Sync) {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work);
    }

    #[test]
    fn values_come_in_the_order_of_the_items() {
        for threads in [1, 3] {
            with_threads(threads, || {
                for count in [0, 1, 2, 511, 512, 513, 3000] {
                    assert_eq!(
                        map_range(count, |i| i.to_string()),
                        (0..count).map(|i| i.to_string()).collect::<Vec<_>>()
                    );
                    let multiples = |i: usize| (0..i % 3).map(move |n| n * i);
                    assert_eq!(flat_map_range(count, multiples), (0..count).flat_map(multiples).collect::<Vec<_>>());
                    let mut items = vec![0; count];
                    for_each_mut(&mut items, |i, item| *item += i);
                    assert!(items.iter().enumerate().all(|(i, item)| *item == i));
                    for_each_chunk_mut(&mut items, 7, |chunk, items| items.fill(chunk));
                    assert!(items.iter().enumerate().all(|(i, item)| *item == i / 7));
                    let sums = map_chunks_mut(&mut items, 10, |chunk, items| items.iter().sum::<usize>() + chunk);
                    assert_eq!(
                        sums,
                        (0..).zip(items.chunks(10)).map(|(n, c)| c.iter().sum::<usize>() + n).collect::<Vec<_>>()
                    );
                }
            });
        }
        assert_eq!(join(|| 1, || "two"), (1, "two"));
    }

    #[test]
    fn the_error_is_that_of_the_first_item_that_has_one() {
        let items: Vec<usize> = (0..1000).collect();
        let fails = |i: &usize| if i % 300 == 299 { Err(*i) } else { Ok(*i) };
        for threads in [1, 3] {
            with_threads(threads, || {
                assert_eq!(try_map(&items, fails), Err(299));
                assert_eq!(try_map(&items[..299], fails).unwrap(), items[..299]);
            });
        }
    }

    #[test]
    fn pieces_of_work_side_by_side_overlap_and_the_first_error_ends_them() {
        let (running, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let both = std::sync::Barrier::new(2);
        let work = |_: &usize| {
            most.fetch_max(running.fetch_add(1, Ordering::Relaxed) + 1, Ordering::Relaxed);
            both.wait();
            running.fetch_sub(1, Ordering::Relaxed);
            Ok::<(), usize>(())
        };
        assert_eq!(side_by_side(&[0, 1, 2, 3], 2, work), Ok(()));
        assert_eq!(most.into_inner(), 2);
        for lanes in [1, 2, 9] {
            let done = AtomicUsize::new(0);
            let work = |item: &usize| {
                done.fetch_add(1, Ordering::Relaxed);
                if *item >= 3 { Err(*item) } else { Ok(()) }
            };
            assert_eq!(side_by_side(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12], lanes, work), Err(3));
            assert!((4..=4 + 8).contains(&done.into_inner()), "{lanes} lanes");
        }
    }

    #[test]
    fn a_panic_reaches_the_caller() {
        let panics = |i: usize| if i == 700 { panic!("seven hundred") } else { vec![i] };
        for threads in [1, 3] {
            with_threads(threads, || {
                let caught = catch_unwind(AssertUnwindSafe(|| map_range(1000, panics))).unwrap_err();
                assert_eq!(caught.downcast_ref::<&str>(), Some(&"seven hundred"));
            });
        }
    }
}
