//! One client's connection.

use std::io::{self, Read};
use std::net::TcpStream;
use std::time::Duration;

use super::request::Refusal;
use super::{Request, Response};

/// A browser's head takes a few hundred bytes.
const MOST_HEAD_BYTES: usize = 16 << 10;
/// How long a client may stay silent; a page asks every two seconds.
const PATIENCE: Duration = Duration::from_secs(30);

/// Answers a client's requests until it goes or is silent for long. What fails here is the client's connection alone.
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
                return hear_out(&mut stream);
            }
        };
        answer(&request).write(&mut stream, request.head_only, request.keep_alive)?;
        if !request.keep_alive {
            return Ok(());
        }
    }
}

/// Takes what a refused client still sends, for a moment: closing before would take the answer from it.
fn hear_out(stream: &mut TcpStream) -> io::Result<()> {
    stream.shutdown(std::net::Shutdown::Write)?;
    stream.set_read_timeout(Some(Duration::from_secs(1)))?;
    io::copy(&mut stream.take(1 << 20), &mut io::sink())?;
    Ok(())
}

/// The next request; `None` where the client has gone.
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
                return Ok(Some(Err(Response::problem(
                    400,
                    "no request that is understood",
                    None,
                ))));
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
