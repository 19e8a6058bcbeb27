//! Three stages at the same time, on their own threads, with bounded queues between them: before the network, the network, after the
//! network.

use crossbeam_channel::bounded;

/// How many items may wait before and after the middle stage, per thread that makes or takes them: enough to even out slow items, few
/// enough that memory does not grow with the number of items.
const WAITING_PER_THREAD: usize = 2;

/// Number of threads before and after the middle stage.
#[derive(Debug, Clone, Copy)]
pub struct Threads {
    /// Threads of the first stage.
    pub before: usize,
    /// Threads of the last stage.
    pub after: usize,
}

impl Threads {
    /// The numbers for this machine. Writing pictures takes several times as long as reading one; the system's scheduler shares the cores
    /// with the network's own threads.
    #[must_use]
    pub fn for_this_machine() -> Self {
        Self::for_cores(std::thread::available_parallelism().map_or(1, usize::from))
    }

    /// The numbers for this many cores.
    #[must_use]
    pub fn for_cores(cores: usize) -> Self {
        Self {
            before: (cores / 4).clamp(1, 8),
            after: (cores / 2).clamp(1, 16),
        }
    }
}

/// Runs `before`, `middle` and `after` for the items 0 to `items` − 1, all stages at the same time; `middle` runs on the calling thread. If
/// `before` returns `None`, the item is dropped. Once `stop` returns true, no new item is begun; those that have passed the middle are
/// finished. `middle` takes the items in order; after it they may overtake each other.
pub fn run<P: Send, O: Send>(
    items: usize,
    threads: Threads,
    stop: &(dyn Fn() -> bool + Sync),
    before: &(dyn Fn(usize) -> Option<P> + Sync),
    mut middle: impl FnMut(P) -> O,
    after: &(dyn Fn(usize, O) + Sync),
) {
    let makers = threads.before.max(1);
    let (to_after, computed) = bounded(threads.after * WAITING_PER_THREAD);
    std::thread::scope(|scope| {
        // Each thread takes every n-th item and has its own queue, so that items arrive in order whichever thread is fastest.
        let prepared: Vec<_> = (0..makers)
            .map(|first| {
                let (to_middle, prepared) = bounded(WAITING_PER_THREAD);
                scope.spawn(move || {
                    for item in (first..items).step_by(makers) {
                        if stop() || to_middle.send(before(item)).is_err() {
                            break;
                        }
                    }
                });
                prepared
            })
            .collect();
        for _ in 0..threads.after.max(1) {
            let computed = computed.clone();
            scope.spawn(move || {
                for (item, output) in computed {
                    after(item, output);
                }
            });
        }
        // The threads of the last stage hold clones; their loops end when `to_after` is dropped.
        drop(computed);
        for item in 0..items {
            // A thread that ends early was asked to stop.
            let Ok(made) = prepared[item % makers].recv() else {
                break;
            };
            let Some(made) = made else { continue };
            if stop() || to_after.send((item, middle(made))).is_err() {
                break;
            }
        }
        drop((prepared, to_after));
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::{Duration, Instant};

    const THREADS: Threads = Threads {
        before: 2,
        after: 3,
    };

    #[test]
    fn every_item_goes_through_once() {
        let seen = Mutex::new(Vec::new());
        let before = |i: usize| (i % 10 != 3).then_some(i * 2);
        let after = |i: usize, value: usize| seen.lock().unwrap().push((i, value));
        run(200, THREADS, &|| false, &before, |v| v + 1, &after);
        let mut seen = seen.into_inner().unwrap();
        seen.sort_unstable();
        let expected = (0..200)
            .filter(|i| i % 10 != 3)
            .map(|i| (i, 2 * i + 1))
            .collect::<Vec<_>>();
        assert_eq!(seen, expected);
    }

    #[test]
    fn the_middle_takes_items_in_their_order() {
        let before = |i: usize| {
            // Even items are slow.
            std::thread::sleep(Duration::from_micros(if i.is_multiple_of(2) {
                300
            } else {
                10
            }));
            (i % 7 != 3).then_some(i)
        };
        let mut seen = Vec::new();
        run(
            200,
            THREADS,
            &|| false,
            &before,
            |i| seen.push(i),
            &|_, ()| (),
        );
        let expected: Vec<usize> = (0..200).filter(|i| i % 7 != 3).collect();
        assert_eq!(seen, expected);
    }

    #[test]
    fn items_computed_before_the_stop_are_finished() {
        let (computed, finished) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let stop = || computed.load(Ordering::SeqCst) >= 5;
        run(
            1000,
            THREADS,
            &stop,
            &Some,
            |_| computed.fetch_add(1, Ordering::SeqCst),
            &|_, _| {
                std::thread::sleep(Duration::from_millis(2));
                finished.fetch_add(1, Ordering::SeqCst);
            },
        );
        assert_eq!(finished.into_inner(), computed.into_inner());
    }

    #[test]
    fn the_stages_overlap() {
        let pause = || std::thread::sleep(Duration::from_millis(10));
        let one_each = Threads {
            before: 1,
            after: 1,
        };
        let start = Instant::now();
        let before = |_| {
            pause();
            Some(())
        };
        run(20, one_each, &|| false, &before, |()| pause(), &|_, ()| {
            pause();
        });
        // One after another would take 600 ms.
        assert!(start.elapsed() < Duration::from_millis(500));
    }
}
