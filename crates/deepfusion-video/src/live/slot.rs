//! Space for one frame, between the thread that reads the source and the one that uses its frames.

use crate::LiveFrameProblem;
use image::RgbImage;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::{Duration, Instant, SystemTime};

/// A frame of a live source.
#[derive(Debug, Clone)]
pub struct LiveFrame {
    /// Its index in the stream, counted from 0: skipped frames leave gaps.
    pub number: u64,
    /// The image.
    pub image: RgbImage,
    /// When its last pixel was received.
    pub arrived: Instant,
    /// The same time on the system's clock.
    pub arrived_at: SystemTime,
    /// Number of frames before it that were never taken.
    pub dropped: u64,
}

/// Holds the newest frame that has not been taken.
#[derive(Debug)]
pub(super) struct Slot {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug)]
struct State {
    newest: Option<LiveFrame>,
    arrived: u64,
    dropped: u64,
    /// When the last frame came, or the wait for the first began.
    last: Instant,
    closed: Option<Option<Arc<LiveFrameProblem>>>,
}

/// The result of taking from a slot.
#[derive(Debug)]
pub(super) enum SlotState {
    Frame(LiveFrame),
    Nothing {
        /// Time since the last frame, taken or not.
        silence: Duration,
    },
    /// No more frames will come; with the error, if reading failed.
    Closed(Option<Arc<LiveFrameProblem>>),
}

impl Slot {
    /// An empty slot.
    pub(super) fn new() -> Self {
        let state = State {
            newest: None,
            arrived: 0,
            dropped: 0,
            last: Instant::now(),
            closed: None,
        };
        Self {
            state: Mutex::new(state),
            changed: Condvar::new(),
        }
    }

    /// Puts the next frame in. A frame that is still there is dropped: its buffer is returned for the next one.
    pub(super) fn put(&self, image: RgbImage) -> Vec<u8> {
        let (arrived, arrived_at) = (Instant::now(), SystemTime::now());
        let mut state = self.lock();
        let old = state.newest.take();
        state.dropped += u64::from(old.is_some());
        state.newest = Some(LiveFrame {
            number: state.arrived,
            image,
            arrived,
            arrived_at,
            dropped: state.dropped,
        });
        state.arrived += 1;
        state.last = arrived;
        drop(state);
        self.changed.notify_all();
        old.map_or_else(Vec::new, |frame| frame.image.into_raw())
    }

    /// Says that no more will come; `problem` if that is a failure.
    pub(super) fn close(&self, problem: Option<LiveFrameProblem>) {
        self.lock().closed.get_or_insert(problem.map(Arc::new));
        self.changed.notify_all();
    }

    /// Takes the frame out, waiting for at most `wait`. A remaining frame is returned before the end is reported.
    pub(super) fn take(&self, wait: Duration) -> SlotState {
        let empty = |state: &mut State| state.newest.is_none() && state.closed.is_none();
        let waited = self.changed.wait_timeout_while(self.lock(), wait, empty);
        let (mut state, _) = waited.unwrap_or_else(|e| e.into_inner());
        match (state.newest.take(), &state.closed) {
            (Some(frame), _) => SlotState::Frame(frame),
            (None, Some(problem)) => SlotState::Closed(problem.clone()),
            (None, None) => SlotState::Nothing {
                silence: state.last.elapsed(),
            },
        }
    }

    /// Number of frames that have come.
    pub(super) fn arrived(&self) -> u64 {
        self.lock().arrived
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // No code panics halfway while it holds the lock.
        self.state.lock().unwrap_or_else(|e| e.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(value: u8) -> RgbImage {
        RgbImage::from_pixel(2, 1, image::Rgb([value; 3]))
    }

    fn frame(slot: &Slot) -> LiveFrame {
        match slot.take(Duration::ZERO) {
            SlotState::Frame(frame) => frame,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn only_the_newest_is_kept_and_the_others_are_counted() {
        let slot = Slot::new();
        assert!(slot.put(picture(0)).is_empty());
        for value in 1..=200 {
            // One frame in, one out: there is never more than one.
            assert_eq!(slot.put(picture(value)), [value - 1; 6]);
        }
        let newest = frame(&slot);
        assert_eq!((newest.number, newest.dropped), (200, 200));
        assert_eq!(newest.image, picture(200));
        assert!(matches!(
            slot.take(Duration::ZERO),
            SlotState::Nothing { .. }
        ));
        slot.put(picture(201));
        let next = frame(&slot);
        assert_eq!((next.number, next.dropped), (201, 200));
        assert_eq!(slot.arrived(), 202);
    }

    #[test]
    fn the_last_frame_comes_before_the_end() {
        let slot = Slot::new();
        slot.put(picture(7));
        slot.close(None);
        slot.close(Some(LiveFrameProblem::Magic));
        assert_eq!(frame(&slot).number, 0);
        assert!(matches!(slot.take(Duration::MAX), SlotState::Closed(None)));
        assert!(matches!(slot.take(Duration::MAX), SlotState::Closed(None)));
    }

    #[test]
    fn a_waiting_reader_is_woken() {
        let slot = Slot::new();
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| slot.take(Duration::from_secs(60)));
            slot.put(picture(1));
            assert!(matches!(waiting.join().unwrap(), SlotState::Frame(_)));
            let waiting = scope.spawn(|| slot.take(Duration::from_secs(60)));
            slot.close(Some(LiveFrameProblem::Magic));
            assert!(matches!(
                waiting.join().unwrap(),
                SlotState::Closed(Some(_))
            ));
        });
    }
}
