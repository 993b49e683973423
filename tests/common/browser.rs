//! A real browser without a window, driven by JSON messages over its debugging pipe.

use super::program::{Sandbox, skipped};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Time limit of every wait.
const LIMIT: Duration = Duration::from_secs(120);
const NAMES: [&str; 4] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
];
const FLAGS: [&str; 12] = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-extensions",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
];

/// Finds a Chromium; without one, reports the test as skipped.
pub fn found() -> Option<PathBuf> {
    let found = named();
    if found.is_none() {
        skipped("no Chromium found (MORPHCOG_BROWSER may name one); a page is not tested");
    }
    found
}

/// Returns the path in `MORPHCOG_BROWSER`, or one of the usual names on the PATH.
fn named() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("MORPHCOG_BROWSER").filter(|name| !name.is_empty()) {
        return Some(named.into());
    }
    let path = std::env::var_os("PATH")?;
    let places = || std::env::split_paths(&path);
    NAMES.iter().find_map(|name| {
        places()
            .map(|folder| folder.join(name))
            .find(|file| file.is_file())
    })
}

/// A running browser; dropping it ends it.
pub struct Browser {
    child: Child,
    to: ChildStdin,
    from: Receiver<Value>,
    /// Events that came while waiting for an answer.
    events: VecDeque<Value>,
    number: u64,
}

impl Browser {
    /// Starts it with its own profile in the sandbox.
    pub fn start(program: &Path, sandbox: &Sandbox) -> Self {
        Browser::with(program, sandbox, &[])
    }

    /// Starts it with further options.
    pub fn with(program: &Path, sandbox: &Sandbox, options: &[&str]) -> Self {
        // It reads its commands from file 3 and answers to file 4.
        let mut child = Command::new("sh")
            .args([
                "-c",
                "exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null 2>&1",
            ])
            .arg(program)
            .args(FLAGS)
            .args(options)
            .arg(format!(
                "--user-data-dir={}",
                sandbox.path("profile").display()
            ))
            .arg("about:blank")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            // A group of its own, whose processor time can be told.
            .process_group(0)
            .spawn()
            .unwrap();
        let (to, mut out) = (
            child.stdin.take().unwrap(),
            BufReader::new(child.stdout.take().unwrap()),
        );
        let (send, from) = channel();
        std::thread::spawn(move || {
            loop {
                let mut message = Vec::new();
                if !matches!(out.read_until(0, &mut message), Ok(count) if count > 0) {
                    return;
                }
                message.pop();
                if send
                    .send(serde_json::from_slice(&message).unwrap())
                    .is_err()
                {
                    return;
                }
            }
        });
        Browser {
            child,
            to,
            from,
            events: VecDeque::new(),
            number: 0,
        }
    }

    /// Returns the processor time of all its processes so far, where `/proc` tells.
    pub fn processor_time(&self) -> Option<Duration> {
        let group = self.child.id().to_string();
        let ticks = std::fs::read_dir("/proc")
            .ok()?
            .flatten()
            .filter_map(|process| {
                let text = std::fs::read_to_string(process.path().join("stat")).ok()?;
                // After the name: state, parent, group, ...; user and system time are the 12th and 13th.
                let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
                let is_own = *fields.get(2)? == group;
                let of = |k: usize| fields.get(k)?.parse::<u64>().ok();
                is_own.then_some(of(11)? + of(12)?)
            });
        Some(Duration::from_millis(10 * ticks.sum::<u64>()))
    }

    fn next(&mut self, until: Instant) -> Value {
        let left = until.saturating_duration_since(Instant::now());
        self.from
            .recv_timeout(left)
            .expect("the browser answers in time")
    }

    #[track_caller]
    fn call(&mut self, session: Option<&str>, method: &str, params: Value) -> Value {
        self.number += 1;
        let mut message = json!({ "id": self.number, "method": method, "params": params });
        if let Some(session) = session {
            message["sessionId"] = session.into();
        }
        self.to.write_all(message.to_string().as_bytes()).unwrap();
        self.to.write_all(&[0]).unwrap();
        let until = Instant::now() + LIMIT;
        loop {
            let answer = self.next(until);
            if answer["id"] == self.number {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].clone();
            }
            self.events.push_back(answer);
        }
    }

    /// Opens a new tab of this size.
    pub fn tab(&mut self, width: u32, height: u32, dark: bool) -> Tab<'_> {
        let target = self.call(None, "Target.createTarget", json!({ "url": "about:blank" }));
        let id = target["targetId"].clone();
        let attached = self.call(
            None,
            "Target.attachToTarget",
            json!({ "targetId": id, "flatten": true }),
        );
        let session = attached["sessionId"].as_str().unwrap().to_string();
        let mut tab = Tab {
            browser: self,
            session,
            id,
            pointer: "mouse",
        };
        for domain in ["Page.enable", "Runtime.enable", "Log.enable"] {
            tab.call(domain, json!({}));
        }
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500 });
        tab.call("Emulation.setDeviceMetricsOverride", size);
        let scheme = if dark { "dark" } else { "light" };
        let features = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        tab.call("Emulation.setEmulatedMedia", features);
        tab
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It should end with its pipe; if not, it is killed.
        let _ = self
            .to
            .write_all(b"{\"id\":0,\"method\":\"Browser.close\"}\0");
        let until = Instant::now() + Duration::from_secs(3);
        while matches!(self.child.try_wait(), Ok(None)) && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub struct Tab<'a> {
    browser: &'a mut Browser,
    session: String,
    id: Value,
    /// Pointing device: "mouse" or "pen".
    pub pointer: &'static str,
}

impl Tab<'_> {
    #[track_caller]
    fn call(&mut self, method: &str, params: Value) -> Value {
        let session = self.session.clone();
        self.browser.call(Some(&session), method, params)
    }

    pub fn open(&mut self, url: &str) {
        self.call("Page.navigate", json!({ "url": url }));
    }

    /// Returns the value of an expression.
    #[track_caller]
    pub fn eval(&mut self, expression: &str) -> Value {
        let params =
            json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let result = self.call("Runtime.evaluate", params);
        assert!(
            result["exceptionDetails"].is_null(),
            "{expression}: {}",
            result["exceptionDetails"]
        );
        result["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    #[track_caller]
    pub fn wait(&mut self, expression: &str) {
        let until = Instant::now() + LIMIT;
        while self.eval(&format!("Boolean({expression})")) != true {
            assert!(Instant::now() < until, "never: {expression}");
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Returns the text of an element.
    #[track_caller]
    pub fn text(&mut self, selector: &str) -> String {
        let text = self.eval(&format!("document.querySelector('{selector}').textContent"));
        text.as_str().unwrap().to_string()
    }

    fn mouse(&mut self, kind: &str, [x, y]: [f64; 2], buttons: u32) {
        let button = if kind == "mouseMoved" { "none" } else { "left" };
        let mut params = json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1 });
        params["pointerType"] = self.pointer.into();
        self.call("Input.dispatchMouseEvent", params);
    }

    /// Returns left, top, width and height of an element, scrolled into view.
    #[track_caller]
    pub fn place(&mut self, selector: &str) -> [f64; 4] {
        // The mouse finds scrolled elements only after the next frame.
        let expression = format!(
            "(async () => {{ const e = document.querySelector('{selector}'), y = scrollY; \
             e.scrollIntoView({{ block: 'center', behavior: 'instant' }}); \
             if (scrollY !== y) await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))); \
             const b = e.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; }})()"
        );
        serde_json::from_value(self.eval(&expression)).unwrap()
    }

    /// Clicks the middle of an element.
    #[track_caller]
    pub fn click(&mut self, selector: &str) {
        let [x, y, w, h] = self.place(selector);
        self.drag(&[[x + w / 2.0, y + h / 2.0]]);
    }

    /// Draws along a line with the mouse.
    pub fn drag(&mut self, line: &[[f64; 2]]) {
        self.press(line[0]);
        self.trace(&line[1..]);
        self.release(line[line.len() - 1]);
    }

    /// Presses the mouse button at a position.
    pub fn press(&mut self, place: [f64; 2]) {
        self.mouse("mouseMoved", place, 0);
        self.mouse("mousePressed", place, 1);
    }

    /// Moves the pressed mouse along a line.
    pub fn trace(&mut self, line: &[[f64; 2]]) {
        line.iter()
            .for_each(|place| self.mouse("mouseMoved", *place, 1));
    }

    /// Releases the mouse button at a position.
    pub fn release(&mut self, place: [f64; 2]) {
        self.mouse("mouseReleased", place, 0);
    }

    /// Presses a key, given by its name and the text it types, if any.
    pub fn key(&mut self, key: &str, text: &str) {
        for kind in ["keyDown", "keyUp"] {
            let text = if kind == "keyDown" { text } else { "" };
            self.call(
                "Input.dispatchKeyEvent",
                json!({ "type": kind, "key": key, "text": text }),
            );
        }
    }

    /// Takes a picture of the visible part.
    pub fn screenshot(&mut self) -> Vec<u8> {
        let shot = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        BASE64.decode(shot["data"].as_str().unwrap()).unwrap()
    }

    /// Returns errors on the console, and those of scripts.
    pub fn complaints(&mut self) -> Vec<String> {
        self.eval("0");
        let own = |event: &Value| event["sessionId"] == self.session.as_str();
        let bad = |event: &Value| match event["method"].as_str() {
            Some("Runtime.exceptionThrown") => true,
            Some("Runtime.consoleAPICalled") => event["params"]["type"] == "error",
            Some("Log.entryAdded") => event["params"]["entry"]["level"] == "error",
            _ => false,
        };
        self.browser
            .events
            .iter()
            .filter(|e| own(e) && bad(e))
            .map(|e| e["params"].to_string())
            .collect()
    }

    pub fn close(self) {
        let id = self.id.clone();
        self.browser
            .call(None, "Target.closeTarget", json!({ "targetId": id }));
    }
}

/// Writes a screenshot into the folder that MORPHCOG_SCREENSHOTS names, if any.
pub fn keep_picture(name: &str, shot: &[u8]) {
    if let Some(folder) = std::env::var_os("MORPHCOG_SCREENSHOTS") {
        std::fs::write(std::path::Path::new(&folder).join(name), shot).unwrap();
    }
}
