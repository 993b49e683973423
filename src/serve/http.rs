//! The subset of HTTP/1.1 that a local page needs: one request per connection, all sizes and times
//! bounded.

use crate::base::text::one_line;
use serde::Serialize;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// The longest request line with headers \[bytes\].
const MAX_HEAD: usize = 16 * 1024;
const MAX_HEADERS: usize = 64;
/// The longest body of a request \[bytes\]; a body and a stimulus of 64 × 64 fit.
pub(crate) const MAX_BODY: usize = 256 * 1024;
/// Time limit for a request to arrive.
const TO_READ: Duration = Duration::from_secs(10);
/// Time limit for the reader to take what is written.
const TO_WRITE: Duration = Duration::from_secs(20);

#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Request {
    pub(crate) method: String,
    /// The path without the query.
    pub(crate) path: String,
    /// The query: the text after the question mark.
    pub(crate) query: String,
    /// Names in lower case.
    headers: Vec<(String, String)>,
    pub(crate) body: Vec<u8>,
}

impl Request {
    /// Makes a request that comes from the page itself.
    pub(crate) fn new(method: &str, target: &str, body: &[u8]) -> Self {
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        Request {
            method: method.to_string(),
            path: path.to_string(),
            query: query.to_string(),
            headers: Vec::new(),
            body: body.to_vec(),
        }
    }

    /// Returns a header's value, or `None` if it is missing. It refuses one that occurs more than
    /// once: one might pass the check and another take effect.
    pub(crate) fn header(&self, name: &str) -> Result<Option<&str>, HttpResponse> {
        let mut found = self.headers.iter().filter(|(own, _)| own == name);
        let first = found.next().map(|(_, value)| value.as_str());
        match found.next() {
            None => Ok(first),
            Some(_) => Err(HttpResponse::refusal(
                400,
                &format!("expected one header {name}, found several"),
            )),
        }
    }

    /// Returns a value of the query, undecoded.
    pub(crate) fn asked(&self, key: &str) -> Option<&str> {
        let pairs = self
            .query
            .split('&')
            .filter_map(|pair| pair.split_once('='));
        pairs
            .into_iter()
            .find(|(own, _)| *own == key)
            .map(|(_, value)| value)
    }
}

/// A complete response, sent at once.
#[derive(Debug)]
pub(crate) struct HttpResponse {
    status: u16,
    content_type: &'static str,
    body: Vec<u8>,
    /// The allowed methods, for status 405.
    allow: Option<&'static str>,
}

impl HttpResponse {
    pub(crate) fn file(content_type: &'static str, text: &str) -> Self {
        HttpResponse {
            status: 200,
            content_type,
            body: text.as_bytes().to_vec(),
            allow: None,
        }
    }

    pub(crate) fn json(value: &impl Serialize) -> Self {
        match serde_json::to_vec(value) {
            Ok(body) => HttpResponse {
                status: 200,
                content_type: "application/json",
                body,
                allow: None,
            },
            Err(error) => HttpResponse::refusal(500, &error.to_string()),
        }
    }

    /// Creates a response without content.
    pub(crate) fn done() -> Self {
        HttpResponse {
            status: 204,
            content_type: "text/plain; charset=utf-8",
            body: Vec::new(),
            allow: None,
        }
    }

    /// Creates an error response of one line.
    pub(crate) fn refusal(status: u16, line: &str) -> Self {
        let body = format!("{}\n", one_line(line)).into_bytes();
        HttpResponse {
            status,
            content_type: "text/plain; charset=utf-8",
            body,
            allow: None,
        }
    }

    pub(crate) fn wrong_method(allow: &'static str) -> Self {
        HttpResponse {
            allow: Some(allow),
            ..HttpResponse::refusal(405, &format!("expected {allow}"))
        }
    }

    /// Returns the status and the body.
    pub(crate) fn into_parts(self) -> (u16, Vec<u8>) {
        (self.status, self.body)
    }

    /// Sends the response; only the head if `head_only`, in answer to HEAD.
    pub(crate) fn send(&self, stream: &mut TcpStream, head_only: bool) -> io::Result<()> {
        let allow = self
            .allow
            .map_or(String::new(), |methods| format!("Allow: {methods}\r\n"));
        let length = format!("Content-Length: {}\r\n", self.body.len());
        let length = if self.status == 204 { "" } else { &length };
        let mut text =
            head(self.status, self.content_type, &format!("{length}{allow}")).into_bytes();
        if !head_only {
            text.extend_from_slice(&self.body);
        }
        stream.write_all(&text)?;
        stream.flush()
    }
}

/// Formats a response's head. The page may load only from this server; no other page may embed it.
fn head(status: u16, content_type: &str, more: &str) -> String {
    let reason = match status {
        200 => "OK",
        204 => "No Content",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        411 => "Length Required",
        413 => "Content Too Large",
        431 => "Request Header Fields Too Large",
        503 => "Service Unavailable",
        _ => "Internal Server Error",
    };
    format!(
        "HTTP/1.1 {status} {reason}\r\nContent-Type: {content_type}\r\n{more}Connection: close\r\nCache-Control: \
         no-store\r\n\
         Content-Security-Policy: default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; \
         object-src 'none'\r\n\
         X-Content-Type-Options: nosniff\r\nX-Frame-Options: DENY\r\nReferrer-Policy: no-referrer\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Opener-Policy: same-origin\r\n\r\n"
    )
}

/// Begins a stream of server-sent events, which lasts until the connection is closed.
pub(crate) fn begin_events(stream: &mut TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    // Keeps proxies from buffering events.
    stream.write_all(head(200, "text/event-stream", "X-Accel-Buffering: no\r\n").as_bytes())
}

/// Reads a request, or `None` if the connection sent nothing.
pub(crate) fn read(stream: &mut TcpStream) -> Result<Option<Request>, HttpResponse> {
    let broken = |error: &io::Error| {
        HttpResponse::refusal(400, &format!("the request cannot be read: {error}"))
    };
    let deadline = Instant::now() + TO_READ;
    stream
        .set_write_timeout(Some(TO_WRITE))
        .map_err(|error| broken(&error))?;
    let mut bytes = Vec::new();
    let (mut request, begin) = loop {
        let found = parse(&bytes)?;
        if found.as_ref().map_or(bytes.len(), |(_, begin)| *begin) > MAX_HEAD {
            return Err(HttpResponse::refusal(431, "the request's head is too long"));
        }
        if let Some(found) = found {
            break found;
        }
        match more(stream, &mut bytes, deadline) {
            Ok(0) if bytes.is_empty() => return Ok(None),
            Ok(0) => return Err(HttpResponse::refusal(400, "the request ends in its head")),
            Ok(_) => {}
            // Browsers open connections that they then do not use.
            Err(_) if bytes.is_empty() => return Ok(None),
            Err(_) => {
                return Err(HttpResponse::refusal(
                    408,
                    "the request did not come in time",
                ));
            }
        }
    };
    let length = length(&request)?;
    while bytes.len() < begin + length {
        match more(stream, &mut bytes, deadline) {
            Ok(0) => return Err(HttpResponse::refusal(400, "the request ends in its body")),
            Ok(_) => {}
            Err(_) => {
                return Err(HttpResponse::refusal(
                    408,
                    "the request did not come in time",
                ));
            }
        }
    }
    request.body = bytes[begin..begin + length].to_vec();
    Ok(Some(request))
}

fn more(stream: &mut TcpStream, bytes: &mut Vec<u8>, deadline: Instant) -> io::Result<usize> {
    let left = deadline.saturating_duration_since(Instant::now());
    if left.is_zero() {
        return Err(io::ErrorKind::TimedOut.into());
    }
    stream.set_read_timeout(Some(left))?;
    let mut piece = [0; 8192];
    let count = stream.read(&mut piece)?;
    bytes.extend_from_slice(&piece[..count]);
    Ok(count)
}

/// Parses a request without its body, and its offset; `None` if the head is incomplete.
fn parse(bytes: &[u8]) -> Result<Option<(Request, usize)>, HttpResponse> {
    let mut space = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut head = httparse::Request::new(&mut space);
    let begin = match head.parse(bytes) {
        Ok(httparse::Status::Complete(begin)) => begin,
        Ok(httparse::Status::Partial) => return Ok(None),
        Err(httparse::Error::TooManyHeaders) => {
            return Err(HttpResponse::refusal(
                431,
                &format!("expected at most {MAX_HEADERS} headers"),
            ));
        }
        Err(error) => {
            return Err(HttpResponse::refusal(
                400,
                &format!("not an HTTP request: {error}"),
            ));
        }
    };
    let target = head.path.expect("a head that is whole has a path");
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let lower = |header: &httparse::Header| {
        (
            header.name.to_ascii_lowercase(),
            String::from_utf8_lossy(header.value).trim().to_string(),
        )
    };
    let request = Request {
        method: head
            .method
            .expect("a head that is whole has a method")
            .to_string(),
        path: path.to_string(),
        query: query.to_string(),
        headers: head.headers.iter().map(lower).collect(),
        body: Vec::new(),
    };
    Ok(Some((request, begin)))
}

fn length(request: &Request) -> Result<usize, HttpResponse> {
    if request
        .headers
        .iter()
        .any(|(own, _)| own == "transfer-encoding")
    {
        return Err(HttpResponse::refusal(
            411,
            "expected a body with a Content-Length",
        ));
    }
    let Some(digits) = request.header("content-length")? else {
        return match request.method.as_str() {
            "POST" => Err(HttpResponse::refusal(411, "expected a Content-Length")),
            _ => Ok(0),
        };
    };
    let digits = Some(digits).filter(|text| text.bytes().all(|b| b.is_ascii_digit()));
    match digits.map(str::parse::<usize>) {
        Some(Ok(length)) if length <= MAX_BODY => Ok(length),
        Some(Ok(_)) => Err(HttpResponse::refusal(
            413,
            &format!("the request's body is longer than {MAX_BODY} bytes"),
        )),
        _ => Err(HttpResponse::refusal(
            400,
            "Content-Length: expected one number",
        )),
    }
}

/// Closes a connection so that sent data arrive: closing with unread bytes would discard them.
pub(crate) fn close(stream: &mut TcpStream) {
    let _ = stream.shutdown(Shutdown::Write);
    let until = Instant::now() + Duration::from_millis(500);
    let mut rest = Vec::new();
    while rest.len() <= 2 * MAX_BODY
        && matches!(more(stream, &mut rest, until), Ok(count) if count > 0)
    {}
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(text: &str) -> u16 {
        match parse(text.as_bytes()) {
            Ok(Some((request, _))) => {
                length(&request).map_or_else(|refusal| refusal.status, |_| 200)
            }
            Ok(None) => 0,
            Err(refusal) => refusal.status,
        }
    }

    #[test]
    fn heads_are_read_or_refused() {
        let (request, begin) =
            parse(b"GET /a?b=c&d=e HTTP/1.1\r\nHost: x\r\nCookie: 1\r\ncookie: 2\r\n\r\nrest")
                .unwrap()
                .unwrap();
        assert_eq!(
            (
                request.path.as_str(),
                request.asked("d"),
                request.asked("b")
            ),
            ("/a", Some("e"), Some("c"))
        );
        assert_eq!(
            (
                request.header("host").unwrap(),
                request.header("cookie").is_err(),
                begin
            ),
            (Some("x"), true, 58)
        );
        assert_eq!(status("GET / HTTP/1.1\r\nHost"), 0);
        assert_eq!(status("GET / HTTP/1.1\r\n\r\n"), 200);
        assert_eq!(status("\u{1}\u{2}\r\n\r\n"), 400);
        assert_eq!(status("GET /\r\n\r\n"), 400);
        assert_eq!(
            status(&format!("GET / HTTP/1.1\r\n{}\r\n", "a: b\r\n".repeat(65))),
            431
        );
        let post = |header: &str| status(&format!("POST / HTTP/1.1\r\n{header}\r\n\r\n"));
        assert_eq!(
            (
                post("content-length: 5"),
                post("a: b"),
                post("content-length: +5")
            ),
            (200, 411, 400)
        );
        assert_eq!(
            (
                post("content-length: 1\r\ncontent-length: 2"),
                post("content-length: 99999999")
            ),
            (400, 413)
        );
        assert_eq!(post("transfer-encoding: chunked"), 411);
    }
}
