//! One client's connection.

use std::io::{self, Read};
use std::net::TcpStream;
use std::time::Duration;

use super::request::Refusal;
use super::{Request, Response};

/// Longest head of a request; a browser's takes a few hundred bytes.
const MOST_HEAD_BYTES: usize = 16 << 10;
/// How long a client may stay silent; the page sends a request every two seconds.
const PATIENCE: Duration = Duration::from_secs(30);

/// Answers a client's requests until it disconnects or is silent for too long. An error concerns only this client's connection.
pub(crate) fn serve(
    mut stream: TcpStream,
    answer: &dyn Fn(&Request) -> Response,
) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    stream.set_nodelay(true)?;
    let mut waiting = Vec::new();
    loop {
        let request = match next(&mut stream, &mut waiting)? {
            None => return Ok(()),
            Some(Ok(request)) => request,
            Some(Err(refusal)) => {
                refusal.write(&mut stream, false, false)?;
                return drain(&mut stream);
            }
        };
        answer(&request).write(&mut stream, request.head_only, request.keep_alive)?;
        if !request.keep_alive {
            return Ok(());
        }
    }
}

/// Reads what a refused client still sends, for a moment: closing the connection earlier would discard the answer.
fn drain(stream: &mut TcpStream) -> io::Result<()> {
    stream.shutdown(std::net::Shutdown::Write)?;
    stream.set_read_timeout(Some(Duration::from_secs(1)))?;
    io::copy(&mut stream.take(1 << 20), &mut io::sink())?;
    Ok(())
}

/// The next request; `None` if the client has disconnected.
fn next(
    stream: &mut TcpStream,
    waiting: &mut Vec<u8>,
) -> io::Result<Option<Result<Request, Response>>> {
    let mut piece = [0; 4096];
    loop {
        match Request::parse(waiting) {
            Ok(Some((request, taken))) => {
                waiting.drain(..taken);
                return Ok(Some(Ok(request)));
            }
            Ok(None) if waiting.len() > MOST_HEAD_BYTES => {
                return Ok(Some(Err(Response::problem(
                    431,
                    "the request's head is too long",
                    None,
                ))));
            }
            Ok(None) => {}
            Err(Refusal::Malformed) => {
                return Ok(Some(Err(Response::problem(400, "malformed request", None))));
            }
            Err(Refusal::Method) => {
                return Ok(Some(Err(Response::problem(
                    405,
                    "only GET and HEAD, without a body",
                    None,
                ))));
            }
        }
        match stream.read(&mut piece) {
            Ok(0) => return Ok(None),
            Ok(n) => waiting.extend(&piece[..n]),
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
}
