//! Whether frames can be decoded: found out once, by the first caller.

use crate::Error;
use deepfusion_hint::Hint;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What failed may succeed later, if ffmpeg was stopped, has been installed, or space was freed. It is tried a few times, not at once.
const TRIES: u32 = 4;
/// See [`TRIES`].
const PAUSE: Duration = Duration::from_secs(10);

/// Whether all frames are in their folder, or why they cannot be; `None` until the first is requested. Locked while they are decoded.
#[derive(Debug, Default)]
pub(crate) struct Decoded(Mutex<Option<Result<(), Refusal>>>);

/// Why frames could not be decoded: the message of the first error.
#[derive(Debug, Clone)]
struct Refusal {
    message: String,
    hint: Option<String>,
    when: Instant,
    /// Number of attempts.
    tries: u32,
}

impl Decoded {
    /// Calls `make` on the first call only. A failure is repeated to the other callers: a video that is damaged, or larger than the
    /// disk, is not decoded again for each of its frames, but a few times at most.
    ///
    /// # Errors
    /// Those of `make`; [`Error::NotDecoded`] with their message if it failed before.
    pub(crate) fn once<E: From<Error> + Hint>(
        &self,
        make: impl FnOnce() -> Result<(), E>,
    ) -> Result<(), E> {
        // A thread that panicked while decoding left nothing behind.
        let mut outcome = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let tries = match &*outcome {
            Some(Ok(())) => return Ok(()),
            Some(Err(refusal)) if !refusal.may_be_retried(PAUSE) => {
                return Err(refusal.again().into());
            }
            Some(Err(refusal)) => refusal.tries,
            None => 0,
        };
        let made = make();
        *outcome = Some(match &made {
            Ok(()) => Ok(()),
            Err(error) => Err(Refusal::of(error, tries + 1)),
        });
        made
    }
}

impl Refusal {
    fn of(error: &impl Hint, tries: u32) -> Self {
        let mut message = error.to_string();
        let mut cause = error.source();
        while let Some(error) = cause {
            let text = error.to_string();
            // Many messages already contain their cause's message.
            if !message.contains(&text) {
                message += &format!(": {text}");
            }
            cause = error.source();
        }
        Self {
            message,
            hint: error.hint(),
            when: Instant::now(),
            tries,
        }
    }

    fn may_be_retried(&self, pause: Duration) -> bool {
        self.tries < TRIES && self.when.elapsed() >= pause
    }

    fn again(&self) -> Error {
        let Self { message, hint, .. } = self.clone();
        Error::NotDecoded { message, hint }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::ErrorKind;
    use std::path::Path;

    #[test]
    fn a_failure_is_not_retried_at_once() {
        let decoded = Decoded::default();
        let full = || Error::file(Path::new("cache"), ErrorKind::StorageFull.into());
        let first = decoded.once(|| Err(full())).unwrap_err();
        assert!(matches!(first, Error::File { .. }));
        for _ in 0..2 {
            let again = decoded.once(|| -> Result<(), Error> { panic!("called a second time") });
            let again = again.unwrap_err();
            assert!(matches!(again, Error::NotDecoded { .. }));
            assert_eq!(again.to_string(), full().to_string());
            assert_eq!(again.hint(), full().hint());
        }
    }

    #[test]
    fn a_failure_is_retried_a_few_times_later() {
        let full = Error::file(Path::new("cache"), ErrorKind::StorageFull.into());
        let refusal = Refusal::of(&full, 1);
        assert!(!refusal.may_be_retried(PAUSE));
        assert!(refusal.may_be_retried(Duration::ZERO));
        assert!(!Refusal::of(&full, TRIES).may_be_retried(Duration::ZERO));
    }

    #[test]
    fn decoding_happens_once() {
        let decoded = Decoded::default();
        let mut times = 0;
        for _ in 0..3 {
            let made = decoded.once(|| -> Result<(), Error> {
                times += 1;
                Ok(())
            });
            made.unwrap();
        }
        assert_eq!(times, 1);
    }
}
