//! Ctrl-C, and what schedulers and closed terminals send (SIGTERM, SIGHUP): the first asks the work to stop where nothing is
//! lost, a second one ends the program at once.

use std::io::Write;
use std::ops::ControlFlow;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::CliError;
use crate::failure::{Result, STOPPED};

static ASKED: AtomicBool = AtomicBool::new(false);

/// From now on these signals set [`asked`] and say `notice`; the first call's stands.
pub(crate) fn catch(notice: &'static str) {
    static SET: OnceLock<()> = OnceLock::new();
    SET.get_or_init(|| {
        let caught = leaving_an_ignored_hangup(|| {
            ctrlc::set_handler(move || {
                if ASKED.swap(true, Ordering::SeqCst) {
                    std::process::exit(i32::from(STOPPED));
                }
                // After a hangup nobody may be left to read it.
                let _ = writeln!(std::io::stderr(), "{notice} (Ctrl-C again: at once)");
            })
        });
        if let Err(error) = caught {
            tracing::warn!("Ctrl-C will end the program at once: {error}");
        }
    });
}

/// Whether the work was asked to stop.
pub(crate) fn asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}

/// [`asked`], for work that hears of it from its listener.
pub(crate) fn flow() -> ControlFlow<()> {
    if asked() {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    }
}

/// Ends what cannot be gone on with, where the work was asked to stop.
pub(crate) fn check(what: &'static str) -> Result<()> {
    if asked() {
        Err(CliError::Ended { what }.into())
    } else {
        Ok(())
    }
}

/// Sets handlers, and ignores hangups again where they were ignored before: `nohup` is to go on when the terminal closes.
#[cfg(unix)]
fn leaving_an_ignored_hangup<T>(set: impl FnOnce() -> T) -> T {
    use nix::sys::signal::{SigHandler, Signal, signal};
    let hangups = |handler| {
        // SAFETY: neither of the two handlers given here is code of ours that a signal could run at a bad time.
        unsafe { signal(Signal::SIGHUP, handler) }
    };
    // There is no asking without setting. What was there before is no handler of this program: this runs once, first.
    let ignored = matches!(hangups(SigHandler::SigIgn), Ok(SigHandler::SigIgn));
    if !ignored {
        let _ = hangups(SigHandler::SigDfl);
    }
    let outcome = set();
    if ignored {
        let _ = hangups(SigHandler::SigIgn);
    }
    outcome
}

/// Elsewhere a hangup cannot be ignored.
#[cfg(not(unix))]
fn leaving_an_ignored_hangup<T>(set: impl FnOnce() -> T) -> T {
    set()
}
