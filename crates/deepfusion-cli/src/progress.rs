//! Progress on stderr: a bar on a terminal, otherwise a line from time to time.

use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

pub(crate) use deepfusion_jobs::duration::duration_text;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

static QUIET: AtomicBool = AtomicBool::new(false);

/// Shortest time between two lines, where stderr is not a terminal.
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

/// A line on stderr. If stderr is closed, as after the terminal was, the work continues.
fn print_line(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Progress of one piece of work.
pub(crate) struct Progress {
    what: String,
    bar: Option<ProgressBar>,
    last_line: Instant,
    /// Whether a line was printed. Only then a last line follows: short work needs none.
    printed: bool,
    quiet: bool,
}

impl Progress {
    /// Starts at nothing done; `what` is printed beside the numbers.
    pub(crate) fn new(what: &str) -> Self {
        let quiet = QUIET.load(Ordering::Relaxed);
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
            // The template is a constant; if it were wrong, the default style would be used.
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

    /// Shows a text beside the bar, if there is one.
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
    /// Removes the bar; the command itself reports the result.
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
