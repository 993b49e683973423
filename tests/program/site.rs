//! The static page of `morphcog site` in a real browser, from a plain server of files.
#![allow(clippy::disallowed_methods)]
#![cfg(unix)]

use crate::common::browser::{Browser, Tab, found, keep_picture};
use crate::common::program::Sandbox;
use crate::common::server::Server;
use crate::serve_page::{answer, as_fast_as_possible, best, choose, one, zero};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};

/// The path below which the files are served: a site need not be at the root.
const BELOW: &str = "/some/where/";

/// Serves the files of a folder below [`BELOW`] until the test ends, and returns the address.
fn serve_files(folder: &Path) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}{BELOW}", listener.local_addr().unwrap());
    let folder = folder.to_path_buf();
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let folder = folder.clone();
            std::thread::spawn(move || serve_file(&folder, stream));
        }
    });
    url
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
fn site(sandbox: &Sandbox) -> String {
    sandbox.run("site public/").ended(0, &["public"]);
    serve_files(&sandbox.path("public"))
}

fn open(tab: &mut Tab, url: &str) {
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
    let url = site(&sandbox);
    let mut browser = Browser::start(&program, &sandbox);
    let mut tab = browser.tab(1280, 800, false);
    open(&mut tab, &url);
    assert_eq!(tab.text("#who"), best());
    // It has measured how near it comes to the program.
    tab.wait("document.getElementById('engine').textContent");
    let said = tab.text("#engine");
    assert!(said.contains("computed in your browser"), "{said}");
    // Bodies that tell a zero from a one at the desk do so here.
    choose(&mut tab, "1");
    assert_eq!(tab.text("#who"), "QMAXD");
    as_fast_as_possible(&mut tab);
    let (says, moved) = answer(&mut tab, &zero());
    assert!(says == "0" && moved.ends_with("right"), "{says}: {moved}");
    let (says, moved) = answer(&mut tab, &one());
    assert!(says == "1" && moved.ends_with("left"), "{says}: {moved}");
    keep_picture("site-1280.png", &tab.screenshot());
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
    let url = site(&sandbox);
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
