//! A response, and how it is written.

use std::borrow::Cow;
use std::io::{self, Write};

use serde::Serialize;

/// An answer to a request.
#[derive(Debug, Clone)]
pub(crate) struct Response {
    pub status: u16,
    pub content_type: &'static str,
    pub body: Cow<'static, [u8]>,
}

/// A failure as sent to the page.
#[derive(Debug, Serialize)]
struct Problem<'a> {
    error: &'a str,
    hint: Option<&'a str>,
}

/// The page connects only to its own server, and runs only the server's scripts.
const POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; object-src 'none'; \
                      base-uri 'none'; frame-ancestors 'none'";

impl Response {
    /// A successful response.
    pub(crate) fn ok(content_type: &'static str, body: impl Into<Cow<'static, [u8]>>) -> Self {
        Self {
            status: 200,
            content_type,
            body: body.into(),
        }
    }

    /// A value as JSON.
    pub(crate) fn json<T: Serialize>(value: &T) -> Self {
        match serde_json::to_vec(value) {
            Ok(body) => Self::ok("application/json", body),
            Err(error) => Self {
                status: 500,
                ..Self::ok("text/plain; charset=utf-8", error.to_string().into_bytes())
            },
        }
    }

    /// A failure, as the page shows it.
    pub(crate) fn problem(status: u16, problem: &str, hint: Option<&str>) -> Self {
        let problem = Problem {
            error: problem,
            hint,
        };
        Self {
            status,
            ..Self::json(&problem)
        }
    }

    fn reason(&self) -> &'static str {
        match self.status {
            200 => "OK",
            400 => "Bad Request",
            403 => "Forbidden",
            404 => "Not Found",
            405 => "Method Not Allowed",
            422 => "Unprocessable Content",
            431 => "Request Header Fields Too Large",
            503 => "Service Unavailable",
            _ => "Internal Server Error",
        }
    }

    /// Writes head and body; for HEAD only the head, with the body's length.
    pub(crate) fn write(
        &self,
        out: &mut impl Write,
        head_only: bool,
        keep_alive: bool,
    ) -> io::Result<()> {
        let head = format!(
            "HTTP/1.1 {} {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nCache-Control: no-store\r\n\
             X-Content-Type-Options: nosniff\r\nCross-Origin-Resource-Policy: same-origin\r\nReferrer-Policy: no-referrer\r\n\
             Content-Security-Policy: {POLICY}\r\n{}Connection: {}\r\n\r\n",
            self.status,
            self.reason(),
            self.content_type,
            self.body.len(),
            if self.status == 405 {
                "Allow: GET, HEAD\r\n"
            } else {
                ""
            },
            if keep_alive { "keep-alive" } else { "close" },
        );
        out.write_all(head.as_bytes())?;
        if !head_only {
            out.write_all(&self.body)?;
        }
        out.flush()
    }
}
