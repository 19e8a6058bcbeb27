//! The ffmpeg process that decodes a source.

use super::address::Address;
use super::ppm;
use super::slot::Slot;
use crate::program::not_started;
use crate::{ProgramTask, Result};
use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Number of lines of ffmpeg's messages that are kept: the last ones say why it ended.
const LINES: usize = 6;
/// How long an ffmpeg that has closed its pipe may take to end.
const GRACE: Duration = Duration::from_secs(2);

/// A running ffmpeg, with the threads that read its output and messages. Dropping it kills the process and waits for it; the threads
/// end with its pipes.
#[derive(Debug)]
pub(super) struct Ffmpeg {
    child: Child,
    slot: Arc<Slot>,
    lines: Arc<Mutex<VecDeque<String>>>,
    listener: Option<JoinHandle<()>>,
}

/// How an ffmpeg process ended.
#[derive(Debug)]
pub(super) struct FfmpegExit {
    pub(super) code: Option<i32>,
    pub(super) lines: Vec<String>,
}

impl Ffmpeg {
    /// Starts it. With `old_names`, uses the option names from before ffmpeg 5.1.
    ///
    /// # Errors
    /// [`crate::Error::Program`].
    pub(super) fn start(address: &Address, old_names: bool) -> Result<Self> {
        let mut command = Command::new("ffmpeg");
        command
            .args(["-nostdin", "-hide_banner", "-v", "error"])
            // No frame waits until others have been decoded.
            .args(["-flags", "low_delay"])
            // Nor does the first wait for twenty others to determine the rate, or for five seconds in which audio might be found.
            .args(["-fpsprobesize", "0", "-analyzeduration", "500000"])
            .args(address.input(std::env::consts::OS)?)
            .args(["-map", "0:v:0"])
            // No frame is duplicated or dropped to keep a rate.
            .args([
                if old_names { "-vsync" } else { "-fps_mode" },
                "passthrough",
            ])
            .args(["-f", "image2pipe", "-c:v", "ppm", "-pix_fmt", "rgb24"])
            .args(["-flush_packets", "1", "pipe:1"])
            .stdin(if address.is_stdin() {
                Stdio::inherit()
            } else {
                Stdio::null()
            })
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        out_of_reach_of_ctrl_c(&mut command);
        let mut child = command.spawn().map_err(|e| {
            let name = address.to_string();
            not_started(Path::new(&name), "ffmpeg", e, ProgramTask::ReadLive)
        })?;
        let slot = Arc::new(Slot::new());
        let lines = Arc::new(Mutex::new(VecDeque::new()));
        if let Some(pipe) = child.stdout.take() {
            let slot = slot.clone();
            std::thread::spawn(move || read_frames(pipe, &slot));
        }
        let listener = child.stderr.take().map(|pipe| {
            let lines = lines.clone();
            std::thread::spawn(move || listen(pipe, &lines))
        });
        Ok(Self {
            child,
            slot,
            lines,
            listener,
        })
    }

    /// The slot with its newest frame.
    pub(super) fn slot(&self) -> &Slot {
        &self.slot
    }

    /// Waits until it ends after its pipe was closed, and kills it if that takes too long.
    pub(super) fn end(&mut self) -> FfmpegExit {
        let begun = Instant::now();
        let mut code = None;
        while begun.elapsed() < GRACE {
            let status = self.child.try_wait().ok().flatten();
            let heard = self.listener.as_ref().is_none_or(JoinHandle::is_finished);
            if let Some(status) = status {
                code = status.code();
                if heard {
                    break;
                }
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let lines = self.last_lines();
        FfmpegExit { code, lines }
    }

    /// The last lines that it has printed so far.
    pub(super) fn last_lines(&self) -> Vec<String> {
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        lines.iter().cloned().collect()
    }
}

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        // If it has ended by itself, there is nothing to kill.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Ctrl-C in a terminal goes to all processes of the group. ffmpeg is kept out of it, so that it ends after the frames in progress.
fn out_of_reach_of_ctrl_c(command: &mut Command) {
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    #[cfg(windows)]
    {
        const CREATE_NEW_PROCESS_GROUP: u32 = 0x200;
        std::os::windows::process::CommandExt::creation_flags(command, CREATE_NEW_PROCESS_GROUP);
    }
}

/// Reads frames as fast as they come, so that none waits in a pipe.
fn read_frames(pipe: impl Read, slot: &Slot) {
    let mut pipe = BufReader::with_capacity(1 << 16, pipe);
    let mut spare = Vec::new();
    let problem = loop {
        match ppm::read(&mut pipe, spare) {
            Ok(Some(image)) => spare = slot.put(image),
            Ok(None) => break None,
            Err(problem) => break Some(problem),
        }
    };
    slot.close(problem);
}

/// Keeps the last lines that it prints.
fn listen(pipe: impl Read, lines: &Mutex<VecDeque<String>>) {
    for line in BufReader::new(pipe)
        .split(b'\n')
        .map_while(std::io::Result::ok)
    {
        let line = String::from_utf8_lossy(&line).trim().to_owned();
        if line.is_empty() {
            continue;
        }
        let mut lines = lines.lock().unwrap_or_else(PoisonError::into_inner);
        if lines.len() == LINES {
            lines.pop_front();
        }
        lines.push_back(line);
    }
}

/// What ffmpeg prints when a source is lost, even if it then ends with code 0. It also prints messages about damaged frames,
/// which do not mean a loss.
const LOSSES: [&str; 7] = [
    "Input/output error",
    "ends prematurely",
    "Connection reset",
    "timed out",
    "Network is unreachable",
    "No route to host",
    "Error during demuxing",
];

impl FfmpegExit {
    /// Whether it ended because its source ended.
    pub(super) fn is_clean(&self) -> bool {
        self.code == Some(0) && !self.printed_one_of(&LOSSES)
    }

    /// Whether it is too old for `-fps_mode`.
    pub(super) fn is_too_old(&self) -> bool {
        self.printed_one_of(&["'fps_mode'"])
    }

    /// Whether one of the texts is in its output.
    pub(super) fn printed_one_of(&self, texts: &[&str]) -> bool {
        let mut lines = self.lines.iter();
        lines.any(|line| texts.iter().any(|text| line.contains(text)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn end(code: i32, lines: &[&str]) -> FfmpegExit {
        FfmpegExit {
            code: Some(code),
            lines: lines.iter().map(|s| (*s).to_owned()).collect(),
        }
    }

    #[test]
    fn a_loss_is_distinguished_from_an_end() {
        assert!(end(0, &[]).is_clean());
        assert!(end(0, &["[h264 @ 0x1] error while decoding MB 12 3"]).is_clean());
        assert!(!end(1, &[]).is_clean());
        assert!(
            !end(
                0,
                &["[http @ 0x1] Stream ends prematurely at 3, should be 9"]
            )
            .is_clean()
        );
        assert!(end(1, &["Unrecognized option 'fps_mode'."]).is_too_old());
    }

    #[test]
    fn only_the_last_lines_are_kept() {
        let lines = Mutex::new(VecDeque::new());
        let text: String = (0..50).map(|i| format!("line {i}\n\n")).collect();
        listen(text.as_bytes(), &lines);
        let lines = lines.into_inner().unwrap();
        assert_eq!(lines.len(), LINES);
        assert_eq!(lines.back().unwrap(), "line 49");
    }
}
