//! Reads the lines of a process that may hang.

use std::io::{BufRead, BufReader, Read};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// An iterator over lines, which ends with the source, or when the next line takes too long.
pub(super) struct PatientLines {
    received: Receiver<String>,
    limit: Duration,
    gave_up: bool,
}

impl PatientLines {
    /// The lines of `source`, read by a thread of their own; each may take as long as `limit`.
    pub(super) fn of(source: impl Read + Send + 'static, limit: Duration) -> Self {
        let (send, received) = channel();
        thread::spawn(move || {
            let lines = BufReader::new(source).lines();
            for line in lines.map_while(Result::ok) {
                if send.send(line).is_err() {
                    break;
                }
            }
        });
        Self {
            received,
            limit,
            gave_up: false,
        }
    }

    /// Whether a line took too long.
    pub(super) fn gave_up(&self) -> bool {
        self.gave_up
    }
}

impl Iterator for PatientLines {
    type Item = String;

    fn next(&mut self) -> Option<String> {
        if self.gave_up {
            return None;
        }
        let received = self.received.recv_timeout(self.limit);
        self.gave_up = matches!(received, Err(RecvTimeoutError::Timeout));
        received.ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;
    use std::sync::mpsc::Sender;

    /// Bytes that arrive in pieces.
    struct Pieces(Receiver<&'static [u8]>);

    impl Read for Pieces {
        fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
            let piece = self.0.recv().unwrap_or_default();
            into[..piece.len()].copy_from_slice(piece);
            Ok(piece.len())
        }
    }

    fn lines(limit: Duration) -> (Sender<&'static [u8]>, PatientLines) {
        let (send, pieces) = channel();
        (send, PatientLines::of(Pieces(pieces), limit))
    }

    #[test]
    fn lines_are_read_until_the_source_ends() {
        let (send, mut lines) = lines(Duration::from_secs(60));
        send.send(b"one\ntw").unwrap();
        assert_eq!(lines.next().as_deref(), Some("one"));
        send.send(b"o\n").unwrap();
        assert_eq!(lines.next().as_deref(), Some("two"));
        drop(send);
        assert_eq!(lines.next(), None);
        assert!(!lines.gave_up());
    }

    #[test]
    fn a_source_that_hangs_is_given_up() {
        let (send, mut lines) = lines(Duration::from_millis(50));
        assert_eq!(lines.next(), None);
        assert!(lines.gave_up());
        // A line that comes too late is ignored.
        send.send(b"late\n").unwrap();
        assert_eq!(lines.next(), None);
    }
}
