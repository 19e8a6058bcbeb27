//! Ctrl-C: the first asks the work to stop where nothing is lost, a second one ends the program at once.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);

/// From now on Ctrl-C sets [`asked`] and says `notice`.
pub fn catch(notice: &'static str) {
    static SET: OnceLock<()> = OnceLock::new();
    SET.get_or_init(|| {
        let caught = ctrlc::set_handler(move || {
            if ASKED.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
            eprintln!("{notice} (Ctrl-C again: at once)");
        });
        if let Err(error) = caught {
            tracing::warn!("Ctrl-C will end the program at once: {error}");
        }
    });
}

/// Whether Ctrl-C was pressed.
pub fn asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}
