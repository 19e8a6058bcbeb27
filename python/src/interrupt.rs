//! Ctrl-C in long calls: Python's handler runs only on its main thread, and only when that thread checks for signals.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Time between two checks for signals.
const PERIOD: Duration = Duration::from_millis(50);

/// Whether the work should stop; the work checks it where nothing is lost.
#[derive(Default)]
pub(crate) struct Stop(AtomicBool);

/// Payload that unwinds out of work that has a listener but cannot be stopped otherwise.
struct Stopped;

impl Stop {
    pub(crate) fn asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// The return value of a listener that says whether to continue.
    pub(crate) fn flow(&self) -> ControlFlow<()> {
        if self.asked() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// For a listener: unwinds to [`interruptible`] if the work should stop. This is not a panic, so nothing is printed.
    pub(crate) fn unwind_if_asked(&self) {
        if self.asked() {
            std::panic::resume_unwind(Box::new(Stopped));
        }
    }
}

/// Does `work` without the interpreter in its own pool of threads, while this thread checks for signals. After Ctrl-C, `work` is asked to
/// stop and waited for, and KeyboardInterrupt is raised.
///
/// The pool that predictions share would not do: there, a prediction that waits for its parts could start a whole training, and a listener
/// that predicts would wait for a thread that its own training holds.
pub(crate) fn interruptible<R: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Stop) -> R + Send,
) -> PyResult<R> {
    let stop = &Stop::default();
    let (done, end) = mpsc::channel::<()>();
    let (result, interrupted) = py.detach(move || {
        thread::scope(|scope| {
            let worker = thread::Builder::new().spawn_scoped(scope, move || {
                // Dropped when the work ends, even by unwinding.
                let _done = done;
                deepfusion_cli::in_own_pool(|| work(stop))
            })?;
            let mut interrupted = None;
            while let Err(RecvTimeoutError::Timeout) = end.recv_timeout(PERIOD) {
                if interrupted.is_none() {
                    interrupted = Python::attach(|py| py.check_signals()).err();
                    stop.0.store(interrupted.is_some(), Ordering::Relaxed);
                }
            }
            Ok::<_, std::io::Error>((worker.join(), interrupted))
        })
    })?;
    match (result, interrupted) {
        (_, Some(interrupt)) => Err(interrupt),
        (Ok(result), None) => Ok(result),
        (Err(panic), None) => std::panic::resume_unwind(panic),
    }
}

/// Does `work` that only reads and cannot be stopped: after Ctrl-C it is left to end by itself.
pub(crate) fn abandonable<R: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> R + Send + 'static,
) -> PyResult<R> {
    let (send, mut result) = mpsc::channel();
    let worker = thread::Builder::new().spawn(move || {
        // Fails after Ctrl-C, when the receiver is gone.
        drop(send.send(deepfusion_cli::in_this_process(work)));
    })?;
    loop {
        // A receiver cannot be shared between threads, so it is moved into the closure and returned.
        let (got, back) = py.detach(move || (result.recv_timeout(PERIOD), result));
        result = back;
        match got {
            Ok(result) => return Ok(result),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(match worker.join() {
                    Err(panic) => std::panic::resume_unwind(panic),
                    Ok(()) => PyRuntimeError::new_err("the work ended without a result"),
                });
            }
        }
    }
}
