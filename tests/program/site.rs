//! The static page of `morphcog site` in a real browser, from a plain server of files.
#![allow(clippy::disallowed_methods)]
#![cfg(unix)]

use crate::common::browser::{Browser, Tab, found, keep_picture};
use crate::common::program::Sandbox;
use crate::common::server::Server;
use crate::serve_page::as_fast_as_possible;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The path below which the files are served: a site need not be at the root.
const BELOW: &str = "/some/where/";

/// A server of files, until it is dropped or the test ends.
pub struct Files {
    port: u16,
    is_up: Arc<AtomicBool>,
}

impl Files {
    /// Serves the files of a folder below [`BELOW`].
    fn serve(folder: &Path) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let is_up = Arc::new(AtomicBool::new(true));
        let (folder, up) = (folder.to_path_buf(), is_up.clone());
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                if !up.load(Ordering::Relaxed) {
                    return;
                }
                let folder = folder.clone();
                std::thread::spawn(move || serve_file(&folder, stream));
            }
        });
        Files { port, is_up }
    }

    pub fn url(&self) -> String {
        format!("http://127.0.0.1:{}{BELOW}", self.port)
    }

    /// Answers nothing from now on.
    fn end(&self) {
        self.is_up.store(false, Ordering::Relaxed);
        let _ = TcpStream::connect(("127.0.0.1", self.port));
    }
}

/// Answers one request as simple servers do: a type by the file's ending, nothing else.
fn serve_file(folder: &Path, mut stream: TcpStream) {
    let lines = BufReader::new(stream.try_clone().unwrap()).lines();
    let head: Vec<String> = lines
        .map_while(Result::ok)
        .take_while(|line| !line.is_empty())
        .collect();
    let Some(path) = head.first().and_then(|line| line.split(' ').nth(1)) else {
        return;
    };
    let name = path.strip_prefix(BELOW).map(|name| match name {
        "" => "index.html",
        name => name,
    });
    let file = name.and_then(|name| std::fs::read(folder.join(name)).ok());
    let content_type = match path.rsplit('.').next() {
        Some("js") => "text/javascript",
        Some("css") => "text/css",
        Some("svg") => "image/svg+xml",
        Some("gz") => "application/gzip",
        _ => "text/html",
    };
    let (status, body) = match file {
        Some(body) => ("200 OK", body),
        None => ("404 Not Found", Vec::new()),
    };
    let length = body.len();
    // The browser may have left.
    let _ = write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {content_type}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
    )
    .and_then(|()| stream.write_all(&body));
}

/// Writes the site and serves it.
pub fn site(sandbox: &Sandbox) -> Files {
    sandbox.run("site public/").ended(0, &["public"]);
    Files::serve(&sandbox.path("public"))
}

/// Opens the page, and waits until it can be used.
pub fn open(tab: &mut Tab, url: &str) {
    tab.open(url);
    tab.wait("document.documentElement?.dataset.ready === 'yes'");
}

/// Simulates in the page, and returns how far each body moves, in voxel lengths.
fn moved_in_page(tab: &mut Tab, requests: &[Value]) -> Vec<f64> {
    let script = format!(
        "import('./engine.js').then(async ({{ stream }}) => {{\n\
           const walk = async (request) => {{\n\
             let moved = null;\n\
             await stream('api/simulations', request, new AbortController().signal,\n\
               (name, data) => {{ if (name === 'end') moved = data.answer.moved; }});\n\
             return moved;\n\
           }};\n\
           return Promise.all({}.map(walk));\n\
         }})",
        json!(requests)
    );
    let moved = tab.eval(&script);
    moved
        .as_array()
        .unwrap()
        .iter()
        .map(|moved| moved.as_f64().unwrap())
        .collect()
}

/// Simulates by the program, and returns how far each body moves, in voxel lengths.
fn moved_in_program(server: &Server, requests: &[Value]) -> Vec<f64> {
    let moved = |request: &Value| {
        let (name, end) = server.events("/api/simulations", request).last().unwrap();
        assert_eq!(name, "end");
        end["answer"]["moved"].as_f64().unwrap()
    };
    requests.iter().map(moved).collect()
}

/// Requests for robots of the team, each under another test image.
fn walks(server: &Server, count: usize, control_steps: u32) -> Vec<Value> {
    let team: Value = serde_json::from_str(&server.get("/api/archives/2").body).unwrap();
    let robots = team["robots"].as_array().unwrap();
    let request = |number: usize| {
        let image = json!({ "set": "builtin", "index": 17 * number });
        json!({
            "subject": { "archive": 2, "robot": robots[number % robots.len()]["id"] },
            "shown": { "image": image }, "control_steps": control_steps, "speed": 0,
        })
    };
    (0..count).map(request).collect()
}

#[test]
fn from_any_folder_of_a_file_server_the_page_walks_as_the_program_does() {
    let Some(program) = found() else { return };
    let sandbox = Sandbox::new();
    let url = site(&sandbox).url();
    let mut browser = Browser::start(&program, &sandbox);
    let mut tab = browser.tab(1280, 800, false);
    open(&mut tab, &url);
    // It has measured how near it comes to the program.
    tab.wait("document.getElementById('engine').textContent");
    let said = tab.text("#engine");
    assert!(said.contains("computed in your browser"), "{said}");
    // Twenty bodies end where the program has them.
    let server = Server::start(&sandbox, "");
    let requests = walks(&server, 20, 50);
    let pairs = moved_in_page(&mut tab, &requests)
        .into_iter()
        .zip(moved_in_program(&server, &requests));
    for (number, (here, there)) in pairs.enumerate() {
        assert!(
            (here - there).abs() < 1e-6,
            "{number}: {here} in the page, {there} in the program"
        );
    }
    // Nothing comes from elsewhere, and nobody complains.
    let loaded = tab.eval("performance.getEntriesByType('resource').map((one) => one.name)");
    for name in loaded.as_array().unwrap() {
        assert!(name.as_str().unwrap().starts_with(&url), "{name}");
    }
    assert_eq!(tab.complaints(), Vec::<String>::new());
}

#[test]
fn a_link_leads_to_a_body_and_the_team_walks_on_a_phone() {
    let Some(program) = found() else { return };
    let sandbox = Sandbox::new();
    let url = site(&sandbox).url();
    let mut browser = Browser::start(&program, &sandbox);
    let mut tab = browser.tab(390, 844, false);
    open(&mut tab, &format!("{url}#body=446/334"));
    tab.wait("document.getElementById('who').textContent === 'Your body'");
    tab.close();
    let mut tab = browser.tab(390, 844, false);
    open(&mut tab, &format!("{url}#robot=XFJPI"));
    assert_eq!(tab.text("#who"), "XFJPI");
    as_fast_as_possible(&mut tab);
    tab.click("#tab-team");
    tab.wait("/step [1-9]/.test(document.getElementById('moved').textContent)");
    keep_picture("site-390.png", &tab.screenshot());
    assert_eq!(tab.complaints(), Vec::<String>::new());
}

/// Requests that the page makes, and some that are wrong.
const REQUESTS: [(&str, &str, &str); 16] = [
    ("GET", "/api/archives", ""),
    ("GET", "/api/archives/0", ""),
    ("GET", "/api/archives/1", ""),
    ("GET", "/api/archives/2", ""),
    ("GET", "/api/archives/3", ""),
    ("GET", "/api/archives/4", ""),
    ("GET", "/api/archives/0/progress", ""),
    ("GET", "/api/images", ""),
    (
        "GET",
        "/api/images?set=builtin&class=7&from=40&count=20",
        "",
    ),
    ("GET", "/api/images?set=gates&class=0&from=0&count=4", ""),
    ("GET", "/api/images?set=mine&class=0", ""),
    ("GET", "/api/materials", ""),
    ("GET", "/api/team", ""),
    (
        "POST",
        "/api/stimulus",
        r#"{"subject": {"archive": 0, "robot": "XFJPI"}, "shown": {"image": {"set": "builtin", "index": 9}}}"#,
    ),
    ("POST", "/api/body", r#"{"body": [[3, 4], [0, 5]]}"#),
    ("POST", "/api/scenario", "no scenario"),
];

#[test]
fn the_module_answers_requests_as_the_program_does() {
    let Some(program) = found() else { return };
    let sandbox = Sandbox::new();
    let site = site(&sandbox);
    let mut browser = Browser::start(&program, &sandbox);
    let mut tab = browser.tab(1280, 800, false);
    open(&mut tab, &site.url());
    let script = format!(
        "import('./engine.js').then(({{ answer }}) => \
         Promise.all({}.map(([method, target, body]) => answer(method, target, body))))",
        json!(REQUESTS)
    );
    let answers = tab.eval(&script);
    let server = Server::start(&sandbox, "");
    for ((method, target, body), answer) in REQUESTS.iter().zip(answers.as_array().unwrap()) {
        let there = match *method {
            "GET" => server.get(target),
            _ => server.post_text(target, body),
        };
        assert_eq!(answer["status"], there.status, "{target}: {answer}");
        assert_eq!(answer["text"], there.body, "{target}");
    }
}

#[test]
fn once_it_is_open_the_page_needs_no_server() {
    let Some(program) = found() else { return };
    let sandbox = Sandbox::new();
    let site = site(&sandbox);
    let mut browser = Browser::start(&program, &sandbox);
    let mut tab = browser.tab(390, 844, false);
    open(&mut tab, &site.url());
    // A plain server of files gives no page memory that threads share.
    let shared = "typeof SharedArrayBuffer !== 'undefined' && crossOriginIsolated";
    assert_eq!(tab.eval(shared), false);
    tab.wait("document.getElementById('engine').textContent");
    site.end();
    // The team needs further workers.
    tab.click("#tab-team");
    tab.wait("/step [3-9][0-9]/.test(document.getElementById('moved').textContent)");
    assert_eq!(tab.complaints(), Vec::<String>::new());
}

#[test]
fn in_a_hidden_tab_nothing_is_computed() {
    let Some(program) = found() else { return };
    let sandbox = Sandbox::new();
    let site = site(&sandbox);
    let mut browser = Browser::start(&program, &sandbox);
    let mut tab = browser.tab(1280, 800, false);
    open(&mut tab, &site.url());
    tab.wait("document.getElementById('engine').textContent");
    let calls = "window.calls = 0; const post = Worker.prototype.postMessage; \
                 Worker.prototype.postMessage = function (...all) { window.calls++; post.apply(this, all); }";
    tab.eval(&format!("{{ {calls} }}"));
    tab.click("#again");
    tab.wait("window.calls > 5");
    let hide = |tab: &mut Tab, on: bool| {
        tab.eval(&format!(
            "Object.defineProperty(document, 'hidden', {{ value: {on}, configurable: true }}), \
             document.dispatchEvent(new Event('visibilitychange')), 0"
        ))
    };
    hide(&mut tab, true);
    // What was under way ends.
    std::thread::sleep(Duration::from_millis(300));
    let before = tab.eval("window.calls");
    std::thread::sleep(Duration::from_millis(700));
    assert_eq!(tab.eval("window.calls"), before);
    hide(&mut tab, false);
    tab.wait(&format!("window.calls > {before} + 5"));
}

/// The processor time that all of a browser's processes may need to the first walk, on a machine
/// that is busy otherwise; on one that is not they need a third of it. A phone's four cores of a
/// quarter of the speed do so much in three seconds.
const TO_FIRST_WALK: Duration = Duration::from_secs(3);

#[test]
fn the_first_walk_begins_within_three_seconds_of_a_processor_a_quarter_as_fast() {
    let Some(program) = found() else { return };
    let sandbox = Sandbox::new();
    let site = site(&sandbox);
    // Time on the clock would depend on what else the machine does; and so does, a little, that of
    // the processor.
    let needs = (0..3).map(|_| {
        let mut browser = Browser::start(&program, &sandbox);
        let before = browser.processor_time()?;
        let mut tab = browser.tab(390, 844, false);
        tab.open(&site.url());
        tab.wait("Number(document.getElementById('time')?.value) > 0");
        Some(browser.processor_time()? - before)
    });
    let needs: Option<Vec<Duration>> = needs.collect();
    let least = needs.and_then(|needs| needs.into_iter().min());
    eprintln!("{least:?} of the processor to the first walk");
    assert!(least.is_none_or(|least| least < TO_FIRST_WALK), "{least:?}");
}

#[test]
fn a_browser_without_simd_is_told_what_is_missing() {
    let Some(program) = found() else { return };
    let sandbox = Sandbox::new();
    let site = site(&sandbox);
    let old = ["--js-flags=--no-enable-sse4-1 --no-enable-sse3 --no-enable-ssse3"];
    let mut browser = Browser::with(&program, &sandbox, &old);
    let mut tab = browser.tab(390, 844, false);
    tab.open(&site.url());
    tab.wait("document.getElementById('error')?.hidden === false");
    let said = tab.text("#error");
    assert!(said.contains("lacks WebAssembly with SIMD"), "{said}");
    assert!(said.contains("Firefox since 89"), "{said}");
    keep_picture("site-without-simd.png", &tab.screenshot());
}

#[test]
fn the_readme_leads_to_the_address_that_the_package_has_for_the_page() {
    let readme = std::fs::read_to_string("README.md").unwrap();
    let (first_screen, _) = readme.split_once("## ").unwrap();
    assert!(first_screen.contains(&format!("({})", env!("CARGO_PKG_HOMEPAGE"))));
}

#[test]
fn a_site_is_small_and_replaced_file_by_file() {
    let sandbox = Sandbox::new();
    sandbox.write("public/kept.txt", "mine");
    for _ in 0..2 {
        sandbox.run("site public").ended(0, &["try it", "public"]);
    }
    assert_eq!(sandbox.read("public/kept.txt"), "mine");
    let files: Vec<PathBuf> = std::fs::read_dir(sandbox.path("public"))
        .unwrap()
        .map(|file| file.unwrap().path())
        .collect();
    let bytes: u64 = files
        .iter()
        .map(|file| file.metadata().unwrap().len())
        .sum();
    assert!(bytes < 3_000_000, "{bytes}");
    // Addresses are relative: the site may be in any folder.
    let page = sandbox.read("public/index.html");
    assert!(!page.contains("=\"/") && !page.contains("://"));
    sandbox.write("file", "");
    sandbox.run("site file").ended(1, &["file"]);
}

#[test]
fn the_page_links_to_documentation_that_lies_in_its_folder() {
    let sandbox = Sandbox::new();
    let link = "href=\"docs/index.html\"";
    sandbox.run("site public").ended(0, &[]);
    assert!(!sandbox.read("public/index.html").contains(link));
    sandbox.write("public/docs/index.html", "documentation");
    sandbox.run("site public").ended(0, &[]);
    let page = sandbox.read("public/index.html");
    assert_eq!(page.matches(link).count(), 1);
    assert!(page.find("<footer>") < page.find(link));
    assert_eq!(sandbox.read("public/docs/index.html"), "documentation");
}

#[test]
fn only_files_of_an_earlier_site_are_replaced() {
    let sandbox = Sandbox::new();
    sandbox.write("mine/index.html", "my page");
    sandbox
        .run("site mine")
        .ended(5, &["mine/index.html: is there"]);
    assert_eq!(sandbox.read("mine/index.html"), "my page");
    sandbox.run("site public").ended(0, &[]);
    sandbox.write("public/about.txt", "mine");
    sandbox.run("site public").ended(0, &[]);
    assert_eq!(sandbox.read("public/about.txt"), "mine");
}
