//! Ctrl-C, and the signals that schedulers and closed terminals send (SIGTERM, SIGHUP): the first asks the work to stop where nothing
//! is lost, the second ends the program at once.

use std::io::Write;
use std::ops::ControlFlow;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::CliError;
use crate::failure::{Result, STOPPED};

static ASKED: AtomicBool = AtomicBool::new(false);

/// From now on these signals set [`asked`] and print `notice`. Only the first call has an effect.
pub(crate) fn catch(notice: &'static str) {
    static SET: OnceLock<()> = OnceLock::new();
    SET.get_or_init(|| {
        let caught = leaving_an_ignored_hangup(|| {
            ctrlc::set_handler(move || {
                if ASKED.swap(true, Ordering::SeqCst) {
                    std::process::exit(i32::from(STOPPED));
                }
                // After a hangup stderr may be closed.
                let _ = writeln!(std::io::stderr(), "{notice} (Ctrl-C again to stop at once)");
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

/// [`asked`], for work whose progress callback returns it.
pub(crate) fn flow() -> ControlFlow<()> {
    if asked() {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    }
}

/// Fails if the work was asked to stop; for work that cannot be continued later.
pub(crate) fn check(what: &'static str) -> Result<()> {
    if asked() {
        Err(CliError::Ended { what }.into())
    } else {
        Ok(())
    }
}

/// Sets handlers, but keeps ignoring hangups if they were ignored before: under `nohup` work continues after the terminal closes.
#[cfg(unix)]
fn leaving_an_ignored_hangup<T>(set: impl FnOnce() -> T) -> T {
    use nix::sys::signal::{SigHandler, Signal, signal};
    let hangups = |handler| {
        // SAFETY: neither of the two handlers given here is our own code, which a signal could run at a bad time.
        unsafe { signal(Signal::SIGHUP, handler) }
    };
    // A handler can only be queried by setting another. The previous one is not this program's: this runs once, before any is set.
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

/// Other systems have no hangups to ignore.
#[cfg(not(unix))]
fn leaving_an_ignored_hangup<T>(set: impl FnOnce() -> T) -> T {
    set()
}
