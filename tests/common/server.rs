//! `morphcog serve` in the background, and a client that controls every byte it sends.

use super::program::Sandbox;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::Child;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Time limit of every wait.
const LIMIT: Duration = Duration::from_secs(30);

/// A running server; dropping it ends it.
pub struct Server {
    child: Option<Child>,
    pub port: u16,
}

#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    headers: Vec<(String, String)>,
    pub body: String,
}

impl Answer {
    #[track_caller]
    pub fn header(&self, name: &str) -> &str {
        let found = self.headers.iter().find(|(own, _)| own == name);
        found
            .map(|(_, value)| value.as_str())
            .unwrap_or_else(|| panic!("no header {name} in {self:?}"))
    }
}

impl Server {
    /// Starts it on a free port; blanks separate arguments.
    pub fn start(sandbox: &Sandbox, args: &str) -> Self {
        let mut child = sandbox.start(&format!("serve --no-open {args}"));
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        let port = line
            .trim()
            .strip_prefix("http://127.0.0.1:")
            .and_then(|rest| rest.strip_suffix('/'));
        let port = port
            .and_then(|digits| digits.parse().ok())
            .unwrap_or_else(|| panic!("no address: {line:?}"));
        Server {
            child: Some(child),
            port,
        }
    }

    pub fn url(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        stream
    }

    /// Sends these bytes as they are, and reads the whole answer.
    pub fn send(&self, request: impl AsRef<[u8]>) -> Answer {
        let mut stream = self.connect();
        // The server may refuse a request before its end, and still answers.
        let _ = stream.write_all(request.as_ref());
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        let (head, body) = text
            .split_once("\r\n\r\n")
            .unwrap_or_else(|| panic!("no answer: {text:?}"));
        let (first, headers) = head.split_once("\r\n").unwrap();
        let header = |line: &str| {
            let (name, value) = line.split_once(": ").unwrap();
            (name.to_ascii_lowercase(), value.to_string())
        };
        Answer {
            status: first.split(' ').nth(1).unwrap().parse().unwrap(),
            headers: headers.split("\r\n").map(header).collect(),
            body: body.to_string(),
        }
    }

    pub fn get(&self, path: &str) -> Answer {
        self.send(format!(
            "GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n",
            self.port
        ))
    }

    fn posted(&self, path: &str, body: &[u8]) -> Vec<u8> {
        let (port, length) = (self.port, body.len());
        let head = format!(
            "POST {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\n\
             Content-Type: application/json\r\nContent-Length: {length}\r\n\r\n"
        );
        [head.as_bytes(), body].concat()
    }

    pub fn post_bytes(&self, path: &str, body: &[u8]) -> Answer {
        self.send(self.posted(path, body))
    }

    pub fn post_text(&self, path: &str, body: &str) -> Answer {
        self.post_bytes(path, body.as_bytes())
    }

    pub fn post(&self, path: &str, body: &Value) -> Answer {
        self.post_text(path, &body.to_string())
    }

    /// Returns the events that answer a request, as they come; dropping them closes the connection.
    pub fn events(
        &self,
        path: &str,
        body: &Value,
    ) -> impl Iterator<Item = (String, Value)> + use<> {
        let mut stream = self.connect();
        stream
            .write_all(&self.posted(path, body.to_string().as_bytes()))
            .unwrap();
        let mut lines = BufReader::new(stream).lines().map(Result::unwrap);
        let status = lines.next().unwrap();
        assert_eq!(status, "HTTP/1.1 200 OK");
        let head: Vec<String> = lines.by_ref().take_while(|line| !line.is_empty()).collect();
        assert!(
            head.iter()
                .any(|line| line == "Content-Type: text/event-stream"),
            "{head:?}"
        );
        let mut name = String::new();
        lines.filter_map(move |line| {
            if let Some(given) = line.strip_prefix("event: ") {
                name = given.to_string();
            }
            let data = line.strip_prefix("data: ")?;
            Some((name.clone(), serde_json::from_str(data).unwrap()))
        })
    }

    /// Sends a signal; the server must end with 0, soon, and without a panic.
    #[cfg(unix)]
    pub fn ended_by(mut self, signal: &str) {
        let mut child = self.child.take().unwrap();
        let sent = std::process::Command::new("kill")
            .args(["-s", signal, &child.id().to_string()])
            .status();
        assert!(sent.unwrap().success());
        let until = Instant::now() + Duration::from_secs(5);
        let status = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break status;
            }
            assert!(Instant::now() < until, "still running");
            std::thread::sleep(Duration::from_millis(10));
        };
        let mut said = String::new();
        child
            .stderr
            .take()
            .unwrap()
            .read_to_string(&mut said)
            .unwrap();
        assert_eq!(
            (status.code(), said.contains("panicked")),
            (Some(0), false),
            "{said}"
        );
    }
}

/// A proxy that puts a server under a prefix, as Jupyter's does: it removes the prefix and passes
/// on all else unchanged.
pub struct Proxy {
    pub port: u16,
    strays: Arc<Mutex<Vec<String>>>,
}

impl Proxy {
    pub const PREFIX: &str = "/user/me/proxy/8080";

    pub fn start(server: &Server) -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let (port, to) = (listener.local_addr().unwrap().port(), server.port);
        let strays = Arc::new(Mutex::new(Vec::new()));
        let stray = Arc::clone(&strays);
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let stray = Arc::clone(&stray);
                std::thread::spawn(move || Proxy::pass_on(stream.unwrap(), to, &stray));
            }
        });
        Proxy { port, strays }
    }

    fn pass_on(stream: TcpStream, to: u16, strays: &Mutex<Vec<String>>) {
        let mut from = BufReader::new(stream.try_clone().unwrap());
        let mut first = String::new();
        // Browsers open connections that they then do not use.
        if from.read_line(&mut first).is_err() || first.is_empty() {
            return;
        }
        let asked = first.split(' ').nth(1).unwrap_or_default();
        if !asked.starts_with(&format!("{}/", Proxy::PREFIX)) {
            strays.lock().unwrap().push(first);
            let _ = (&stream).write_all(
                b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n",
            );
            return;
        }
        let mut server = TcpStream::connect(("127.0.0.1", to)).unwrap();
        server
            .write_all(first.replacen(Proxy::PREFIX, "", 1).as_bytes())
            .unwrap();
        let mut answers = server.try_clone().unwrap();
        std::thread::spawn(move || {
            let _ = std::io::copy(&mut answers, &mut &stream);
            let _ = stream.shutdown(Shutdown::Both);
        });
        let _ = std::io::copy(&mut from, &mut server);
        let _ = server.shutdown(Shutdown::Both);
    }

    /// Returns requests for paths outside the prefix.
    pub fn strays(&self) -> Vec<String> {
        self.strays.lock().unwrap().clone()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
