//! Progress on stderr: a bar on a terminal, a line now and then elsewhere.

use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

pub(crate) use deepfusion_jobs::duration::duration_text;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

static QUIET: AtomicBool = AtomicBool::new(false);

/// Elsewhere than on a terminal, lines come no more often than this.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Turns all progress off (`--quiet`).
pub(crate) fn set_quiet(quiet: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
}

/// A line of information on stderr, unless quiet.
pub(crate) fn say(text: &str) {
    if !QUIET.load(Ordering::Relaxed) {
        print_line(text);
    }
}

/// A line on stderr. Where nobody reads it any more, as after the terminal was closed, the work goes on.
fn print_line(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Progress of one piece of work.
pub(crate) struct Progress {
    what: String,
    bar: Option<ProgressBar>,
    last_line: Instant,
    /// Short work needs no line: only what had one gets a last one.
    printed: bool,
    quiet: bool,
}

impl Progress {
    /// Begins; `what` is printed beside the numbers.
    pub(crate) fn new(what: &str) -> Self {
        let quiet = QUIET.load(Ordering::Relaxed);
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
            // The template is a constant: were it wrong, the default style would do.
            if let Ok(style) =
                ProgressStyle::with_template("{msg} [{bar:30}] {pos}/{len}, {eta} left")
            {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.set_message(what.to_owned());
            bar
        });
        Self {
            what: what.to_owned(),
            bar,
            last_line: Instant::now(),
            printed: false,
            quiet,
        }
    }

    /// Whether a bar is shown (else lines).
    pub(crate) fn is_bar(&self) -> bool {
        self.bar.is_some()
    }

    /// Words beside the bar; nothing where there is none.
    pub(crate) fn note(&self, text: &str) {
        if let Some(bar) = &self.bar {
            bar.set_message(text.to_owned());
        }
    }

    /// `done` of `total` are done.
    pub(crate) fn set(&mut self, done: usize, total: usize) {
        if let Some(bar) = &self.bar {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        } else if !self.quiet
            && (self.last_line.elapsed() >= LINE_EVERY || (self.printed && done == total))
        {
            self.last_line = Instant::now();
            self.printed = true;
            print_line(&format!("{}: {done}/{total}", self.what));
        }
    }
}

impl Drop for Progress {
    /// The bar goes away with the work; what was achieved is said by the command.
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
