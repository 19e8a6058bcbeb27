//! A request's head.

/// A client's request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Request {
    /// Whether the body is left out (HEAD).
    pub head_only: bool,
    /// The path's parts, percent-decoded; `/` has none.
    pub path: Vec<String>,
    /// The query's pairs, percent-decoded.
    pub query: Vec<(String, String)>,
    /// The host that the client addressed, without its port.
    pub host: Option<String>,
    /// Whether the connection may stay open.
    pub keep_alive: bool,
}

/// Why a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// Not HTTP, or a path that cannot be decoded.
    Malformed,
    /// A method other than GET and HEAD, or a body.
    Method,
}

impl Request {
    /// Parses a request's head; `None` while it is incomplete. Returns it with its length in bytes.
    pub(crate) fn parse(bytes: &[u8]) -> Result<Option<(Self, usize)>, Refusal> {
        let mut headers = [httparse::EMPTY_HEADER; 64];
        let mut head = httparse::Request::new(&mut headers);
        let taken = match head.parse(bytes).map_err(|_| Refusal::Malformed)? {
            httparse::Status::Partial => return Ok(None),
            httparse::Status::Complete(taken) => taken,
        };
        let header = |name: &str| {
            let found = head
                .headers
                .iter()
                .find(|h| h.name.eq_ignore_ascii_case(name));
            found
                .and_then(|h| std::str::from_utf8(h.value).ok())
                .map(str::trim)
        };
        let head_only = match head.method {
            Some("GET") => false,
            Some("HEAD") => true,
            _ => return Err(Refusal::Method),
        };
        let has_body = header("transfer-encoding").is_some()
            || header("content-length").is_some_and(|n| n != "0");
        if has_body {
            return Err(Refusal::Method);
        }
        let target = head.path.ok_or(Refusal::Malformed)?;
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let path = path.strip_prefix('/').ok_or(Refusal::Malformed)?;
        let decoded = |text: &str| percent_decoded(text).ok_or(Refusal::Malformed);
        let parts = path
            .split('/')
            .map(decoded)
            .collect::<Result<Vec<_>, _>>()?;
        let pairs = query.split('&').filter(|p| !p.is_empty()).map(|pair| {
            let (key, value) = pair.split_once('=').unwrap_or((pair, ""));
            Ok((decoded(key)?, decoded(value)?))
        });
        let closes = header("connection").is_some_and(|c| c.to_ascii_lowercase().contains("close"));
        let request = Self {
            head_only,
            path: if path.is_empty() { Vec::new() } else { parts },
            query: pairs.collect::<Result<_, _>>()?,
            host: header("host").map(|h| without_port(h).to_owned()),
            keep_alive: head.version == Some(1) && !closes,
        };
        Ok(Some((request, taken)))
    }

    /// A number of the query.
    pub(crate) fn number(&self, key: &str) -> Option<u64> {
        let (_, value) = self.query.iter().find(|(k, _)| k == key)?;
        value.parse().ok()
    }
}

fn without_port(host: &str) -> &str {
    match host.rsplit_once(':') {
        // An IPv6 address without a port ends in its bracket.
        Some((name, port)) if port.bytes().all(|b| b.is_ascii_digit()) && !name.ends_with(':') => {
            name
        }
        _ => host,
    }
}

/// Decodes `%2e` and the like; `None` for a percent sign without two digits, or bytes that are not UTF-8.
fn percent_decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        if byte == b'%' {
            let digit = |b: u8| char::from(b).to_digit(16);
            let (high, low) = (digit(rest.next()?)?, digit(rest.next()?)?);
            bytes.push((high * 16 + low) as u8);
        } else {
            bytes.push(byte);
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parsed(text: &str) -> Result<Option<(Request, usize)>, Refusal> {
        Request::parse(text.as_bytes())
    }

    #[test]
    fn paths_are_split_before_they_are_decoded() {
        let text =
            "GET /api/runs/0/depth/a%2Fb%20c?known=7&x= HTTP/1.1\r\nHost: localhost:80\r\n\r\nrest";
        let (request, taken) = parsed(text).unwrap().unwrap();
        assert_eq!(request.path, ["api", "runs", "0", "depth", "a/b c"]);
        assert_eq!(request.number("known"), Some(7));
        assert_eq!(request.number("x"), None);
        assert_eq!(request.host.as_deref(), Some("localhost"));
        assert!(request.keep_alive && !request.head_only);
        assert_eq!(&text[taken..], "rest");
    }

    #[test]
    fn hosts_lose_only_their_port() {
        for (host, name) in [
            ("[::1]:80", "[::1]"),
            ("[::1]", "[::1]"),
            ("a.b:9", "a.b"),
            ("a.b", "a.b"),
        ] {
            assert_eq!(without_port(host), name);
        }
    }

    #[test]
    fn refused_requests_are_distinguished() {
        assert_eq!(parsed("GET / HTTP/1.1\r\nHo"), Ok(None));
        assert_eq!(parsed("POST / HTTP/1.1\r\n\r\n"), Err(Refusal::Method));
        assert_eq!(
            parsed("GET / HTTP/1.1\r\nContent-Length: 5\r\n\r\n"),
            Err(Refusal::Method)
        );
        assert_eq!(parsed("GET /%zz HTTP/1.1\r\n\r\n"), Err(Refusal::Malformed));
        assert_eq!(parsed("GET /%ff HTTP/1.1\r\n\r\n"), Err(Refusal::Malformed));
        assert_eq!(
            parsed("\x16\x03\x01 hello\r\n\r\n"),
            Err(Refusal::Malformed)
        );
        assert!(
            !parsed("GET / HTTP/1.0\r\n\r\n")
                .unwrap()
                .unwrap()
                .0
                .keep_alive
        );
    }

    proptest! {
        #[test]
        fn foreign_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let _ = Request::parse(&bytes);
        }
    }
}
