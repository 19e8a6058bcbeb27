//! Ctrl-C in long calls: Python's handler runs on its main thread alone, and only when that asks for it.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// How often is asked.
const PERIOD: Duration = Duration::from_millis(50);

/// Whether the work should end, asked by the work where nothing is lost.
#[derive(Default)]
pub(crate) struct Stop(AtomicBool);

/// What unwinds out of work that has a listener and no way to be stopped.
struct Stopped;

impl Stop {
    pub(crate) fn asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// The answer of a listener that is asked whether to go on.
    pub(crate) fn flow(&self) -> ControlFlow<()> {
        if self.asked() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// For a listener: unwinds to [`interruptible`] where the work should end. No panic: nothing is printed.
    pub(crate) fn unwind_if_asked(&self) {
        if self.asked() {
            std::panic::resume_unwind(Box::new(Stopped));
        }
    }
}

/// Does `work` without the interpreter on a thread of a pool of its own, while this thread asks for signals. In the pool that predictions
/// share one of them, waiting for its parts, could take up a whole training meanwhile, and a listener that predicts would wait for a thread
/// that its own training holds. After Ctrl-C `work` is asked to
/// stop, is waited for, and KeyboardInterrupt raised.
pub(crate) fn interruptible<R: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Stop) -> R + Send,
) -> PyResult<R> {
    let stop = &Stop::default();
    let (done, end) = mpsc::channel::<()>();
    let (result, interrupted) = py.detach(move || {
        thread::scope(|scope| {
            let worker = thread::Builder::new().spawn_scoped(scope, move || {
                // Dropped at the end, however that comes.
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

/// Does `work` that only reads and cannot be stopped: after Ctrl-C it is left alone, to end by itself.
pub(crate) fn abandonable<R: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> R + Send + 'static,
) -> PyResult<R> {
    let (send, mut result) = mpsc::channel();
    let worker = thread::Builder::new().spawn(move || {
        // Fails where nobody waits any more.
        drop(send.send(deepfusion_cli::in_this_process(work)));
    })?;
    loop {
        // The receiver is not shared between threads: it goes there and comes back.
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
