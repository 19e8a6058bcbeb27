//! Three stages at once, on threads of their own, with bounded queues between them: what comes before the
//! network, the network, what comes after it.

use crossbeam_channel::bounded;

/// How many items may wait for the next stage, for every thread that makes or takes them: enough to even out
/// slow ones, few enough that memory does not grow with the work.
const WAITING_PER_THREAD: usize = 2;

/// Threads before and after the middle stage.
#[derive(Debug, Clone, Copy)]
pub struct Threads {
    /// Threads that prepare.
    pub before: usize,
    /// Threads that finish.
    pub after: usize,
}

impl Threads {
    /// For this machine. Writing pictures costs several times what reading one does; the system's scheduler
    /// shares the cores with the network's own threads.
    #[must_use]
    pub fn for_this_machine() -> Self {
        Self::for_cores(std::thread::available_parallelism().map_or(1, usize::from))
    }

    /// For so many cores.
    #[must_use]
    pub fn for_cores(cores: usize) -> Self {
        Self {
            before: (cores / 4).clamp(1, 8),
            after: (cores / 2).clamp(1, 16),
        }
    }
}

/// Runs `before`, `middle` and `after` for the items 0 to `items` − 1, the stages at the same time; `middle` on
/// the calling thread. An item of which `before` makes nothing goes no further. Once `stop` says so, nothing new is
/// begun; what has left the middle is still finished. `middle` takes the items in their order; behind it they may overtake
/// each other.
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
        // In turn, each from a queue of its own: so they come in order whoever is done first.
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
        // The threads hold the other ends: the loops end when those do.
        drop(computed);
        for item in 0..items {
            // A maker that ends early was asked to stop.
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
            // The even ones are late.
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
    fn what_was_computed_before_the_stop_is_finished() {
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
        // One after another it would be 600 ms.
        assert!(start.elapsed() < Duration::from_millis(500));
    }
}
