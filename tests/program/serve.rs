//! `morphcog serve` over HTTP: what it answers, what it refuses, and that simulations are the
//! engine's and end when nobody listens.

// They end the server by signals.
#![cfg(unix)]

use crate::common::program::{PROGRAM, Sandbox, said};
use crate::common::server::{Answer, Server};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use morphcog::base::Grid;
use morphcog::base::session::Session;
use morphcog::data::dataset::{BUILTIN, Dataset, Split};
use morphcog::robots::published;
use morphcog::serve::simulations::MAX_SIMULATIONS;
use morphcog::shipped::gallery::TEAM;
use morphcog::task::answer::Direction;
use morphcog::task::evaluation::fresh_rollouts;
use morphcog::task::protocol::Protocol;
use morphcog::task::recording::{Frame, LabelledStimulus};
use morphcog::task::rollout::record;
use morphcog::task::stimulus::{Encoding, Reduction, StimulusParams, stimulus};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};
use std::process::Stdio;
use std::time::{Duration, Instant};

fn json_of(answer: &Answer) -> Value {
    assert_eq!(answer.status, 200, "{}", answer.body);
    serde_json::from_str(&answer.body).unwrap()
}

/// Refused, with one line that has the words.
#[track_caller]
fn refused(answer: &Answer, status: u16, words: &str) {
    assert_eq!(answer.status, status, "{}", answer.body);
    assert!(
        answer.body.contains(words),
        "expected {words:?} in: {}",
        answer.body
    );
    assert_eq!(answer.body.matches('\n').count(), 1, "{}", answer.body);
}

fn drawing() -> Grid<u8> {
    Grid::from_fn(28, 28, |r, c| {
        if (4..24).contains(&r) && (12..16).contains(&c) {
            200
        } else {
            0
        }
    })
}

#[test]
fn the_page_its_headers_and_what_there_is() {
    let sandbox = Sandbox::tiny();
    sandbox
        .run("evolve --config tiny.toml --out runs/one --quiet")
        .ended(0, &[]);
    let server = Server::start(&sandbox, "");
    let page = server.get("/");
    assert_eq!(
        (page.status, page.header("content-type")),
        (200, "text/html; charset=utf-8")
    );
    assert!(
        page.header("content-security-policy")
            .starts_with("default-src 'self';")
    );
    assert_eq!(page.header("x-content-type-options"), "nosniff");
    // Everything that the page and its scripts name is there, and nothing is from elsewhere.
    let mut files = vec!["/".to_string()];
    let mut next = 0;
    while let Some(path) = files.get(next).cloned() {
        next += 1;
        let text = server.get(&path);
        assert_eq!(text.status, 200, "{path}");
        assert!(
            !text.body.contains("https://") && !text.body.contains("//cdn"),
            "{path}"
        );
        // Addresses are relative: the page may be below a prefix of a proxy.
        assert!(
            ["\"/api", "'/api", "`/api"]
                .iter()
                .all(|address| !text.body.contains(address)),
            "{path}"
        );
        for piece in text
            .body
            .split('"')
            .filter(|piece| !piece.contains(char::is_whitespace))
        {
            let is_file = [".js", ".css", ".svg"]
                .iter()
                .any(|ending| piece.ends_with(ending));
            assert!(!is_file || !piece.starts_with('/'), "{path}: {piece}");
            let path = format!("/{}", piece.trim_start_matches("./"));
            if is_file && !files.contains(&path) {
                files.push(path);
            }
        }
    }
    assert!(files.len() >= 11, "{files:?}");
    let head = server.send(format!(
        "HEAD / HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n",
        server.port
    ));
    assert_eq!((head.status, head.body.as_str()), (200, ""));
    assert_eq!(head.header("content-length"), page.header("content-length"));

    // The newest run is offered without being named, after those that ship with the program.
    let archives = json_of(&server.get("/api/archives"));
    let numbers: Vec<&Value> = archives
        .as_array()
        .unwrap()
        .iter()
        .map(|from| &from["robots"])
        .collect();
    assert_eq!(
        (numbers.len(), numbers[1], numbers[2]),
        (5, &json!(5), &json!(45))
    );
    let trained = json_of(&server.get("/api/archives/0"));
    assert_eq!(trained["robots"][0]["audit"]["verdict"], "physical");
    let run = sandbox.run_file("runs/one");
    let listed = json_of(&server.get("/api/archives/4"));
    assert_eq!(listed["robots"].as_array().unwrap().len(), run.elites.len());
    let best = &listed["robots"][0];
    let robot = run
        .elites
        .iter()
        .find(|robot| best["id"] == robot.id.as_str())
        .unwrap();
    assert_eq!(best["fitness"], json!(run.stats.obj_max.unwrap()));
    assert_eq!(best["body"], serde_json::to_value(&robot.body).unwrap());
    assert_eq!(best["audit"], Value::Null);
    let sets = json_of(&server.get("/api/images"));
    assert!(
        sets.as_array()
            .unwrap()
            .iter()
            .any(|set| set["name"] == BUILTIN)
    );
    let images = json_of(&server.get("/api/images?set=builtin&class=3&from=2&count=2"));
    let digits = Dataset::load(BUILTIN, &[], &[Split::Test]).unwrap();
    let index = digits.indices_of(Split::Test, 3)[2];
    assert_eq!(
        (&images[0]["index"], &images[0]["label"]),
        (&json!(index), &json!(3))
    );
    assert_eq!(
        images[0]["pixels"],
        serde_json::to_value(digits.image(Split::Test, index).unwrap()).unwrap()
    );
    assert_eq!(images.as_array().unwrap().len(), 2);
}

#[test]
fn an_audit_beside_the_archive_is_shown() {
    let sandbox = Sandbox::tiny();
    sandbox
        .run("evolve --config tiny.toml --out runs/one --quiet")
        .ended(0, &[]);
    sandbox
        .run("audit --archive runs/one/run.json --robots top:1 --quiet")
        .ended(0, &[]);
    let server = Server::start(&sandbox, "--archive runs/one/run.json");
    let robots = json_of(&server.get("/api/archives/4"))["robots"].clone();
    assert!(robots[0]["audit"]["verdict"].is_string(), "{}", robots[0]);
    assert_eq!(robots[1]["audit"], Value::Null);
}

#[test]
fn the_robots_of_every_collection_are_listed_with_the_fittest_first() {
    let sandbox = Sandbox::tiny();
    sandbox
        .run("evolve --config tiny.toml --out runs/one --quiet")
        .ended(0, &[]);
    let server = Server::start(&sandbox, "");
    let archives = json_of(&server.get("/api/archives"));
    for (number, archive) in archives.as_array().unwrap().iter().enumerate() {
        let robots = json_of(&server.get(&format!("/api/archives/{number}")))["robots"].clone();
        let robots = robots.as_array().unwrap();
        let fitness: Vec<f64> = robots
            .iter()
            .map(|robot| robot["fitness"].as_f64().unwrap())
            .collect();
        assert!(fitness.is_sorted_by(|a, b| a >= b), "{number}: {fitness:?}");
        assert_eq!(archive["best"], json!(fitness[0]), "{number}");
        // The page begins with the robot that ships as the best.
        assert!(
            number > 0 || robots[0]["id"] == "1cd61e28e1",
            "{}",
            robots[0]["id"]
        );
    }
}

/// What it says before its page is open.
fn notes(sandbox: &Sandbox, args: &str) -> String {
    let mut child = sandbox.start(&format!("serve --no-open {args}"));
    let mut address = String::new();
    BufReader::new(child.stdout.take().unwrap())
        .read_line(&mut address)
        .unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
    let mut said = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    assert!(address.starts_with("http://"), "{said}");
    said
}

#[test]
fn a_newest_run_that_cannot_be_read_is_a_note_unless_it_was_named() {
    let sandbox = Sandbox::new();
    sandbox.write("runs/broken/run.json", "{}");
    let said = notes(&sandbox, "");
    assert!(said.contains("note: runs/broken/run.json"), "{said}");
    let server = Server::start(&sandbox, "");
    assert_eq!(
        json_of(&server.get("/api/archives"))
            .as_array()
            .unwrap()
            .len(),
        4
    );
    sandbox
        .run("serve --no-open --archive runs/broken")
        .ended(3, &["runs/broken/run.json"]);
}

#[test]
fn images_that_one_of_several_runs_finds_are_not_said_to_be_missing() {
    let sandbox = Sandbox::tiny();
    for (split, count) in [("train", 4u8), ("t10k", 2)] {
        let pixels: Vec<u8> = (0..count).flat_map(|image| [60 * image; 100]).collect();
        let header = [0, 0, 8, 3, 0, 0, 0, count, 0, 0, 0, 10, 0, 0, 0, 10];
        sandbox.write(
            &format!("there/{split}-images-idx3-ubyte"),
            [&header[..], &pixels].concat(),
        );
        let labels: Vec<u8> = (0..count).map(|image| image % 2).collect();
        let header = [0, 0, 8, 1, 0, 0, 0, count];
        sandbox.write(
            &format!("there/{split}-labels-idx1-ubyte"),
            [&header[..], &labels].concat(),
        );
    }
    for out in ["lost", "kept"] {
        sandbox
            .run(&format!(
                "evolve -q -c tiny.toml --set data.dataset=shapes --data there -o {out}"
            ))
            .ended(0, &[]);
    }
    std::fs::remove_file(sandbox.path("lost/data-folder.json")).unwrap();
    assert!(notes(&sandbox, "--archive lost").contains("shapes"));
    for archives in ["lost kept", "kept lost"] {
        let said = notes(&sandbox, &format!("--archive {archives}"));
        assert!(!said.contains("shapes"), "{said}");
    }
}

#[test]
fn what_is_wrong_is_refused_with_one_line_and_hurts_nothing() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    let own = format!("Host: 127.0.0.1:{}\r\n", server.port);
    refused(&server.get("/nothing"), 404, "the page is at /");
    refused(&server.get("/../Cargo.toml"), 404, "");
    refused(&server.get("/api/archives/7"), 404, "archive 7");
    refused(&server.get("/api/archives/x"), 400, "archive");
    refused(&server.get("/api/images?set=none"), 404, "none");
    refused(
        &server.get("/api/images?set=builtin&class=many"),
        400,
        "class",
    );
    let wrong = server.send(format!("POST / HTTP/1.1\r\n{own}Content-Length: 0\r\n\r\n"));
    refused(&wrong, 405, "GET");
    assert_eq!(wrong.header("allow"), "GET, HEAD");
    refused(&server.get("/api/simulations"), 405, "POST");
    refused(
        &server.send(format!("DELETE /api/status HTTP/1.1\r\n{own}\r\n")),
        405,
        "GET",
    );

    refused(&server.send("GET / HTTP/1.1\r\n\r\n"), 400, "Host");
    refused(
        &server.send(format!("GET / HTTP/1.1\r\n{own}{own}\r\n")),
        400,
        "host",
    );
    let with = |headers: String| {
        let body = "{\"body\": [[3]]}";
        server.send(format!(
            "POST /api/body HTTP/1.1\r\n{own}{headers}Content-Length: {}\r\n\r\n{body}",
            body.len()
        ))
    };
    // Two of them: neither is believed.
    let (ours, others) = (
        format!("http://127.0.0.1:{}", server.port),
        "http://evil.example",
    );
    for [first, second] in [[&ours, others], [others, &ours], [&ours, &ours]] {
        refused(
            &with(format!("Origin: {first}\r\norigin: {second}\r\n")),
            400,
            "origin",
        );
    }

    // What is no HTTP, or too much of it.
    refused(&server.send("\u{16}\u{3}\u{1} hello\r\n\r\n"), 400, "HTTP");
    refused(
        &server.send(format!(
            "GET / HTTP/1.1\r\n{own}X: {}\r\n\r\n",
            "x".repeat(40_000)
        )),
        431,
        "",
    );
    refused(
        &server.send(format!("POST /api/body HTTP/1.1\r\n{own}\r\n")),
        411,
        "Content-Length",
    );
    let long = format!(
        "POST /api/body HTTP/1.1\r\n{own}Content-Length: 99999999\r\n\r\n{}",
        "x".repeat(100_000)
    );
    refused(&server.send(long), 413, "262144");

    let robot = json!({ "archive": 1, "robot": "QMAXD" });
    let wide = vec![vec![0u8; 200]; 2];
    for (request, words) in [
        (json!({}), "subject"),
        (json!([]), ""),
        (json!({ "subject": robot, "speed": 99 }), "speed"),
        (json!({ "subject": robot, "speed": -1 }), "speed"),
        (
            json!({ "subject": robot, "control_steps": 0 }),
            "control_steps",
        ),
        (
            json!({ "subject": robot, "control_steps": 1_000_000 }),
            "control_steps",
        ),
        (json!({ "subject": robot, "colour": "red" }), "colour"),
        (json!({ "subject": { "archive": 1 } }), "subject"),
        (json!({ "subject": { "body": [[3, 0, 3]] } }), "body"),
        (json!({ "subject": { "body": [[0]] } }), "body"),
        (json!({ "subject": { "body": [[9]] } }), "9"),
        (
            json!({ "subject": { "body": vec![vec![3; 65]; 65] } }),
            "64",
        ),
        (
            json!({ "subject": robot, "shown": { "drawing": [[1, 2], [3]] } }),
            "drawing",
        ),
        (
            json!({ "subject": robot, "shown": { "drawing": [[300]] } }),
            "drawing",
        ),
        (
            json!({ "subject": robot, "shown": { "drawing": vec![vec![0; 13]; 13] } }),
            "(13)",
        ),
        (
            json!({ "subject": robot, "shown": { "drawing": wide } }),
            "at most 128",
        ),
        (
            json!({ "subject": robot, "shown": { "stimulus": [[0.5]] } }),
            "14 × 14",
        ),
        (
            json!({ "subject": { "body": [[3]] }, "shown": { "stimulus": [[1.5]] } }),
            "0 to 1",
        ),
        (
            json!({ "subject": robot, "shown": { "stimulus": [[0.5]], "drawing": [[5]] } }),
            "one of",
        ),
    ] {
        refused(&server.post("/api/simulations", &request), 400, words);
    }
    refused(
        &server.post_text("/api/simulations", "{\"subject\": "),
        400,
        "request:1",
    );
    refused(
        &server.post_bytes("/api/simulations", &[0xff, 0xfe]),
        400,
        "UTF-8",
    );
    refused(
        &server.post(
            "/api/simulations",
            &json!({ "subject": { "archive": 1, "robot": "x" } }),
        ),
        404,
        "no robot",
    );
    let image = json!({ "subject": robot, "shown": { "image": { "set": "builtin", "index": 99_999_999 } } });
    refused(&server.post("/api/simulations", &image), 404, "99999999");
    refused(
        &server.post("/api/simulations/5", &json!({ "paused": true })),
        404,
        "no simulation 5",
    );
    refused(
        &server.post_text(
            "/api/scenario",
            "{\"body\": [[3]], \"physics\": {\"substeps\": 9}}",
        ),
        400,
        "physics",
    );
    refused(
        &server.post_text("/api/scenario", "{\"body\": [[9]]}"),
        400,
        "scenario:1: body",
    );
    for path in ["/api/scenario", "/api/body"] {
        let answer = server.post_text(path, "{\"body\": [[7]]}");
        refused(&answer, 400, "actuators");
    }

    // After all that it is well, and no simulation has begun.
    let status = json_of(&server.get("/api/status"));
    assert_eq!(
        (&status["simulations"], &status["begun"]),
        (&json!(0), &json!(0))
    );
    server.ended_by("INT");
}

/// What a server answers to a POST with these headers.
fn posted_with(server: &Server, headers: &str) -> Answer {
    let body = "{\"body\": [[3]]}";
    let length = body.len();
    server.send(format!(
        "POST /api/body HTTP/1.1\r\n{headers}Content-Length: {length}\r\n\r\n{body}"
    ))
}

#[test]
fn the_page_is_reached_by_names_of_this_machine_on_any_port_and_by_no_others() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    let get = |host: &str| server.send(format!("GET /api/status HTTP/1.1\r\nHost: {host}\r\n\r\n"));
    // A tunnel has a port of its own.
    for host in ["localhost:9000", "LocalHost", "127.0.0.1:1", "[::1]:9000"] {
        assert_eq!(get(host).status, 200, "{host}");
    }
    // Names that others let point here.
    for host in [
        "evil.example",
        "localhost.evil.example:80",
        "evil.localhost",
        "0.0.0.0",
        "localhost:99999",
    ] {
        let answer = get(host);
        refused(&answer, 403, "Host");
        assert!(
            answer.body.contains("morphcog serve --allow-host NAME"),
            "{}",
            answer.body
        );
    }
    refused(
        &server.send("GET http://evil.example/ HTTP/1.1\r\nHost: evil.example\r\n\r\n"),
        403,
        "",
    );
}

#[test]
fn a_name_that_is_allowed_is_one_more_and_only_that_one() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "--allow-host Hub.example --allow-host 10.0.0.7");
    let get = |host: &str| server.send(format!("GET / HTTP/1.1\r\nHost: {host}\r\n\r\n"));
    for host in [
        "hub.example",
        "HUB.example:8443",
        "10.0.0.7:80",
        "localhost:9000",
    ] {
        assert_eq!(get(host).status, 200, "{host}");
    }
    for host in [
        "evil.hub.example",
        "hub.example.evil.example",
        "10.0.0.8",
        "hub.example:x",
        "hub",
    ] {
        refused(&get(host), 403, "Host");
    }
    let ours = "Host: hub.example\r\nOrigin: https://hub.example\r\n";
    assert_eq!(posted_with(&server, ours).status, 200);
    for wrong in ["*", "hub.example:80", "https://hub.example", ""] {
        let said = sandbox.command(["serve", "--no-open", "--allow-host", wrong]);
        crate::common::program::said(said).ended(2, &["--allow-host"]);
    }
}

#[test]
fn what_pages_of_other_origins_send_is_refused_also_from_other_ports_of_this_machine() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "--allow-host hub.example");
    let port = server.port;
    for (host, origin) in [
        ("localhost:9000", "http://localhost:9000"),
        ("localhost:9000", "http://LOCALHOST:9000"),
        ("127.0.0.1", "http://127.0.0.1"),
        ("hub.example:8888", "https://hub.example:8888"),
    ] {
        let answer = posted_with(&server, &format!("Host: {host}\r\nOrigin: {origin}\r\n"));
        assert_eq!(answer.status, 200, "{host}, {origin}: {}", answer.body);
    }
    let here = format!("127.0.0.1:{port}");
    for (host, origin) in [
        (here.as_str(), "http://evil.example"),
        (&here, "null"),
        (&here, ""),
        (&here, "http://127.0.0.1"),
        (&here, &format!("http://localhost:{port}")),
        (&here, &format!("ftp://{here}")),
        (&here, &here),
        (&here, &format!("http://{here}/")),
        (&here, &format!("http://{here}.evil.example")),
        (&here, &format!("http://evil.example@{here}")),
        (&here, "http://hub.example"),
        ("localhost:9000", "http://localhost:9001"),
        ("hub.example", "http://hub.example:9001"),
        ("hub.example", "http://evil.hub.example"),
    ] {
        let answer = posted_with(&server, &format!("Host: {host}\r\nOrigin: {origin}\r\n"));
        refused(&answer, 403, "Origin");
        assert!(
            answer.body.contains(&format!("this page is at {host}")),
            "{}",
            answer.body
        );
    }
    // Rebound names do not pass because the origin is theirs, too.
    refused(
        &posted_with(
            &server,
            "Host: evil.example\r\nOrigin: http://evil.example\r\n",
        ),
        403,
        "Host",
    );
}

/// Makes a pipe that nobody writes to.
fn pipe(sandbox: &Sandbox, name: &str) {
    let path = sandbox.path(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    assert!(
        std::process::Command::new("mkfifo")
            .arg(path)
            .status()
            .unwrap()
            .success()
    );
}

#[test]
fn a_pipe_in_the_place_of_a_file_of_a_run_blocks_nobody() {
    let sandbox = Sandbox::tiny();
    sandbox
        .run("evolve -q -c tiny.toml -o runs/one")
        .ended(0, &[]);
    // The newest there is.
    pipe(&sandbox, "runs/pipe/run.json");
    sandbox
        .run("eval -q --robots top:1 --images 2")
        .ended(0, &[]);
    sandbox
        .run("replay -q --format html -o walk.html")
        .ended(0, &[]);
    sandbox
        .run("plot -q archive -a runs/pipe")
        .ended(3, &["runs/pipe/run.json"]);
    let server = Server::start(&sandbox, "");
    let names = || {
        json_of(&server.get("/api/archives"))
            .as_array()
            .unwrap()
            .len()
    };
    assert_eq!(names(), 5);
    pipe(&sandbox, "runs/later/run.json");
    for name in ["metrics.csv", "audit.json", ".lock"] {
        pipe(&sandbox, &format!("runs/two/{name}"));
    }
    std::fs::copy(
        sandbox.path("runs/one/run.json"),
        sandbox.path("runs/two/run.json"),
    )
    .unwrap();
    std::thread::sleep(Duration::from_millis(600));
    assert_eq!(names(), 6);
    refused(
        &server.get("/api/archives/5/progress"),
        404,
        "runs/two/metrics.csv: ",
    );
    server.ended_by("TERM");
    for name in [
        "run.json",
        "metrics.csv",
        "config.toml",
        "checkpoint.json",
        ".lock",
    ] {
        pipe(&sandbox, &format!("busy/{name}"));
        sandbox
            .run("evolve -q -c tiny.toml -o busy")
            .ended(3, &[name]);
        std::fs::remove_dir_all(sandbox.path("busy")).unwrap();
    }
}

#[test]
fn bodies_and_scenarios_are_checked_and_pictures_reduced_as_runs_do() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    let check = |body: Value| json_of(&server.post("/api/body", &json!({ "body": body })));
    assert_eq!(check(json!([[3, 3, 6]]))["problem"], Value::Null);
    assert!(
        check(json!([[3, 0], [0, 3]]))["problem"]
            .as_str()
            .unwrap()
            .contains("hang together")
    );
    assert!(
        check(json!([[0]]))["problem"]
            .as_str()
            .unwrap()
            .contains("no voxel")
    );
    assert!(
        check(json!([[6]]))["note"]
            .as_str()
            .unwrap()
            .contains("muscle")
    );

    let scenario = sandbox.write(
        "scenario.json",
        r#"{"body": [[3, 6], [4, 5]], "stimulus": [[0, 0.5], [1, 0]], "control_steps": 7}"#,
    );
    let loaded = json_of(&server.post_text(
        "/api/scenario",
        &std::fs::read_to_string(&scenario).unwrap(),
    ));
    assert_eq!(loaded["stimulus"], json!([[0.0, 0.5], [1.0, 0.0]]));
    assert_eq!(
        (&loaded["control_steps"], &loaded["body"]),
        (&json!(7), &json!([[3, 6], [4, 5]]))
    );
    assert_eq!(loaded["note"], Value::Null);

    // A robot sees with its run's encoding, a body of one's own with the one that is asked for.
    let see = |subject: Value| {
        let asked = json!({ "subject": subject, "shown": { "drawing": drawing() } });
        let seen = json_of(&server.post("/api/stimulus", &asked))["stimulus"].clone();
        serde_json::from_value::<Grid<f64>>(seen).unwrap()
    };
    let config = published::config().unwrap();
    let expected = stimulus(&drawing(), 14, 14, &config.stimulus).unwrap();
    assert_eq!(see(json!({ "archive": 1, "robot": "XFJPI" })), expected);
    let own = StimulusParams {
        reduction: Reduction::Area,
        encoding: Encoding::Intensity,
        ..StimulusParams::default()
    };
    let expected = stimulus(&drawing(), 2, 3, &own).unwrap();
    assert_eq!(
        see(json!({ "body": [[3, 3, 6], [4, 4, 5]], "encoding": own })),
        expected
    );
}

#[test]
fn what_of_a_scenario_is_not_shown_is_said() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    let note = |keys: Value| {
        let mut scenario = json!({ "body": [[3]] });
        scenario
            .as_object_mut()
            .unwrap()
            .extend(keys.as_object().unwrap().clone());
        json_of(&server.post("/api/scenario", &scenario))["note"].clone()
    };
    assert_eq!(
        note(json!({ "start_row": 2, "start_column": 493, "control_steps": 5000 })),
        Value::Null
    );
    for start in [json!({ "start_row": 3 }), json!({ "start_column": 494 })] {
        assert_eq!(
            note(start),
            "it starts in row 2, column 493, as all bodies do here"
        );
    }
    assert_eq!(
        note(json!({ "control_steps": 5001 })),
        "it ends after 5000 control steps"
    );
    let all = json!({ "stimuli": [[[0]], [[1]]], "switch_every": 9000, "start_row": 9 });
    let all = note(all);
    for words in ["the first is shown; ", "row 2", "5000 control steps"] {
        assert!(all.as_str().unwrap().contains(words), "{all}");
    }
}

/// Moments as the page decodes them: centre and points.
fn moments(text: &str, points: usize) -> Vec<Frame> {
    let bytes = BASE64.decode(text).unwrap();
    let float = |bytes: &[u8]| f64::from_le_bytes(bytes.try_into().unwrap());
    let step = |bytes: &[u8]| f64::from(i16::from_le_bytes(bytes.try_into().unwrap())) / 200.0;
    let moment = |bytes: &[u8]| {
        let centre = [float(&bytes[..8]), float(&bytes[8..16])];
        let point = |pair: &[u8]| [step(&pair[..2]) + centre[0], step(&pair[2..]) + centre[1]];
        Frame {
            points: bytes[16..].chunks(4).map(point).collect(),
            centre,
        }
    };
    bytes.chunks(16 + 4 * points).map(moment).collect()
}

#[test]
fn a_simulation_is_what_the_engine_computes() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    let request = json!({
        "subject": { "archive": 1, "robot": "QMAXD" }, "shown": { "drawing": drawing() },
        "control_steps": 120, "speed": 0,
    });
    let events: Vec<(String, Value)> = server.events("/api/simulations", &request).collect();
    let names: Vec<&str> = events.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!((names[0], names[names.len() - 1]), ("begin", "end"));
    assert!(
        names[1..names.len() - 1]
            .iter()
            .all(|name| *name == "moments")
    );

    let config = published::config().unwrap();
    let robot = published::find("QMAXD").unwrap().unwrap();
    let seen = stimulus(&drawing(), 14, 14, &config.stimulus).unwrap();
    let protocol = Protocol {
        control_steps: 120,
        ..config.protocol.clone()
    };
    let images = [LabelledStimulus {
        class: 0,
        label: "drawing".to_string(),
        stimulus: seen.clone(),
        image: None,
    }];
    let expected = record(
        "QMAXD",
        &robot.body,
        &config.physics,
        &protocol,
        true,
        &images,
    );

    let begin = &events[0].1;
    assert_eq!(
        begin["seen"]["stimulus"],
        serde_json::to_value(&seen).unwrap()
    );
    assert_eq!(begin["judge"], json!({ "left": [1], "right": [0] }));
    let points = begin["points"].as_u64().unwrap() as usize;
    assert_eq!(points, expected.frames[0].points.len());
    for (voxel, expected) in begin["voxels"]
        .as_array()
        .unwrap()
        .iter()
        .zip(&expected.voxels)
    {
        assert_eq!(voxel[1], json!(expected.corners));
        assert_eq!(
            (&voxel[2], &voxel[3]),
            (&json!(expected.row), &json!(expected.column))
        );
    }
    let told = events
        .iter()
        .filter_map(|(_, data)| data["frames"].as_str());
    let told: Vec<Frame> = told.flat_map(|text| moments(text, points)).collect();
    assert_eq!(told.len(), expected.frames.len());
    let near =
        |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs() <= 0.00501 && (a[1] - b[1]).abs() <= 0.00501;
    for (told, expected) in told.iter().zip(&expected.frames) {
        assert!(near(told.centre, expected.centre));
        assert!(
            told.points
                .iter()
                .zip(&expected.points)
                .all(|(a, b)| near(*a, *b))
        );
    }
    let end = &events[events.len() - 1].1;
    assert_eq!(
        (&end["step"], &end["unstable"]),
        (&json!(120), &Value::Null)
    );
    let moved = expected.phases[0].displacement;
    assert_eq!(end["answer"]["moved"].as_f64(), Some(moved));
    let way = Direction::of(moved, 3.0).map(|way| {
        if way == Direction::Left {
            "left"
        } else {
            "right"
        }
    });
    assert_eq!(end["answer"]["way"], json!(way));
    let says = way.map_or(json!([]), |way| begin["judge"][way].clone());
    assert_eq!(end["answer"]["says"], says);
}

#[test]
fn a_body_of_ones_own_simulations_as_simulate_has_it() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    let stimulus = json!([[0, 0.5, 1], [0, 0, 1]]);
    let body = json!([[3, 3, 6], [4, 0, 5]]);
    let (subject, shown) = (json!({ "body": body }), json!({ "stimulus": stimulus }));
    let request = json!({ "subject": subject, "shown": shown, "control_steps": 60, "speed": 0 });
    let (_, end) = server.events("/api/simulations", &request).last().unwrap();
    let scenario = json!({ "body": body, "stimulus": stimulus, "control_steps": 60 });
    sandbox.write("scenario.json", scenario.to_string());
    let said = sandbox.run("simulate scenario.json").ended(0, &[]);
    let places: Vec<f64> = said
        .out
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(1).unwrap().parse().unwrap())
        .collect();
    let moved = places[60] - places[0];
    assert!((end["answer"]["moved"].as_f64().unwrap() - moved).abs() < 1e-9);
    assert_eq!(end["answer"]["says"], json!([]));
}

#[test]
fn a_simulation_keeps_its_pace_and_is_told_to_change() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    let request = json!({ "subject": { "body": [[3, 6, 4]] }, "control_steps": 50, "speed": 1 });
    let begun = Instant::now();
    let mut events = server.events("/api/simulations", &request);
    let (_, begin) = events.next().unwrap();
    let path = format!("/api/simulations/{}", begin["id"]);
    assert_eq!(server.post(&path, &json!({ "paused": true })).status, 204);
    std::thread::sleep(Duration::from_millis(600));
    refused(&server.post(&path, &json!({ "speed": 1000 })), 400, "speed");
    let bright = json!({ "shown": { "stimulus": [[1, 1, 1]] }, "paused": false });
    assert_eq!(server.post(&path, &bright).status, 204);
    let rest: Vec<(String, Value)> = events.collect();
    // Fifty control steps are a second, and it stood still for more than half of one.
    assert!(
        begun.elapsed() > Duration::from_millis(1400),
        "{:?}",
        begun.elapsed()
    );
    let seen = rest
        .iter()
        .find(|(name, _)| name == "seen")
        .map(|(_, data)| data.clone())
        .unwrap();
    assert_eq!(seen["stimulus"], json!([[1.0, 1.0, 1.0]]));
    let changed = seen["step"].as_u64().unwrap();
    assert!(changed < 40, "{changed}");
    // The new picture is shown for as long as the first would have been.
    assert_eq!(rest.last().unwrap().1["step"], json!(changed + 50));
}

#[test]
fn robots_of_several_tasks_walk_together_as_a_team_and_are_counted() {
    let sandbox = Sandbox::tiny();
    for (name, groups) in [("a", "[[0],[1]]"), ("b", "[[2],[3]]"), ("c", "[[0],[1]]")] {
        let options = format!(
            "--set task.groups={groups} --set data.train_images= --set data.images_per_class=1"
        );
        sandbox
            .run(&format!("evolve -q -c tiny.toml {options} -o {name}"))
            .ended(0, &[]);
    }
    let server = Server::start(&sandbox, "--archive a b c");
    let team = json_of(&server.get("/api/team"));
    // The first robot of each task.
    let members = team["members"].as_array().unwrap();
    let tasks: Vec<&str> = members
        .iter()
        .map(|member| member["task"].as_str().unwrap())
        .collect();
    assert_eq!(
        (tasks, &team["classes"]),
        (vec!["0|1", "2|3"], &json!([0, 1, 2, 3]))
    );
    assert_eq!(members[0]["archive"], 4);
    let request = json!({ "shown": { "drawing": drawing() }, "speed": 0 });
    let events: Vec<(String, Value)> = server.events("/api/team", &request).collect();
    let names: Vec<&str> = events.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(
        (names[0], names[1], names[names.len() - 1]),
        ("begin", "moment", "end")
    );
    assert_eq!(events[0].1["members"].as_array().unwrap().len(), 2);
    let end = &events[names.len() - 1].1;
    assert_eq!(end["step"], 20);
    // Each walks as it does by itself.
    for (place, member) in members.iter().enumerate() {
        let request = json!({
            "subject": { "archive": member["archive"], "robot": member["robot"] },
            "shown": { "drawing": drawing() }, "speed": 0,
        });
        let alone: Vec<(String, Value)> = server.events("/api/simulations", &request).collect();
        assert_eq!(
            alone[alone.len() - 1].1["answer"]["moved"],
            end["tally"]["moved"][place]
        );
    }
    let sum = |key: &str| {
        end["tally"][key]
            .as_array()
            .unwrap()
            .iter()
            .map(|v| v.as_f64().unwrap())
            .sum::<f64>()
    };
    assert_eq!(sum("votes") + end["tally"]["silent"].as_f64().unwrap(), 2.0);
    refused(
        &server.post("/api/team", &json!({ "control_steps": 0 })),
        400,
        "control_steps",
    );
    // Robots of one task are no team: the one that ships with the program answers.
    let server = Server::start(&sandbox, "--archive a");
    let team = json_of(&server.get("/api/team"));
    let members = team["members"].as_array().unwrap();
    assert!(
        members.len() == 45 && members.iter().all(|member| member["archive"] == 2),
        "{members:?}"
    );
    assert_eq!(team["classes"], json!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9]));
}

#[test]
fn each_robot_of_the_team_that_ships_sees_and_walks_as_its_own_run_says() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    let team = published::trained(TEAM).unwrap();
    let first = &team[0].0.config;
    assert!(
        team.iter()
            .any(|(run, _)| run.config.stimulus != first.stimulus),
        "all have one window"
    );
    let drawing = Grid::from_fn(28, 28, |r, c| if (r + 2 * c) % 7 < 3 { 255 } else { 0 });
    let steps = 30;
    let expected: BTreeMap<String, f64> = team
        .iter()
        .map(|(run, _)| {
            let (config, elite) = (&run.config, &run.elites[0]);
            let body = &elite.body;
            assert_eq!(
                (&config.physics, &config.protocol),
                (&first.physics, &first.protocol),
                "one world"
            );
            let seen = stimulus(&drawing, body.height(), body.width(), &config.stimulus).unwrap();
            let protocol = Protocol {
                control_steps: steps,
                ..config.protocol.clone()
            };
            let moved = fresh_rollouts(
                body,
                &[seen],
                &[],
                (&config.physics, &protocol),
                &|_| (),
                &Session::default(),
            )
            .unwrap()
            .0[0]
                .unwrap();
            (elite.id.clone(), moved)
        })
        .collect();
    let request = json!({ "shown": { "drawing": drawing }, "control_steps": steps, "speed": 0 });
    let events: Vec<(String, Value)> = server.events("/api/team", &request).collect();
    let moved: Vec<f64> =
        serde_json::from_value(events[events.len() - 1].1["tally"]["moved"].clone()).unwrap();
    let members = json_of(&server.get("/api/team"))["members"].clone();
    let members = members.as_array().unwrap();
    let ids = members
        .iter()
        .map(|member| member["robot"].as_str().unwrap().to_string());
    assert_eq!(ids.zip(moved).collect::<BTreeMap<String, f64>>(), expected);
    // The pairs of the first four digits come first.
    let tasks: Vec<&str> = members
        .iter()
        .take(6)
        .map(|member| member["task"].as_str().unwrap())
        .collect();
    assert_eq!(tasks, ["0|1", "0|2", "1|2", "0|3", "1|3", "2|3"]);
    // And by itself, with its own pixels in the list of robots.
    let listed = json_of(&server.get("/api/archives/2"));
    for (run, _) in team
        .iter()
        .filter(|(run, _)| run.config.stimulus != first.stimulus)
        .take(3)
    {
        let id = &run.elites[0].id;
        let robot = listed["robots"]
            .as_array()
            .unwrap()
            .iter()
            .find(|robot| robot["id"] == **id)
            .unwrap();
        assert_eq!(robot["encoding"], json!(run.config.stimulus));
        let request = json!({
            "subject": { "archive": 2, "robot": id }, "shown": { "drawing": drawing },
            "control_steps": steps, "speed": 0,
        });
        let alone: Vec<(String, Value)> = server.events("/api/simulations", &request).collect();
        assert_eq!(
            alone[alone.len() - 1].1["answer"]["moved"],
            json!(expected[&run.elites[0].id])
        );
    }
}

#[test]
fn simulations_end_when_nobody_listens_and_only_so_many_run() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    let simulations = || {
        json_of(&server.get("/api/status"))["simulations"]
            .as_u64()
            .unwrap() as usize
    };
    let wait_for = |count: usize| {
        let until = Instant::now() + Duration::from_secs(5);
        while simulations() != count {
            assert!(
                Instant::now() < until,
                "{} simulations, expected {count}",
                simulations()
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    let request = json!({ "subject": { "body": [[3, 6, 4]] }, "control_steps": 5000, "speed": 1 });
    let begin = || {
        let mut events = server.events("/api/simulations", &request);
        let (_, begin) = events.next().unwrap();
        (begin["id"].as_u64().unwrap(), events)
    };
    let mut open: Vec<_> = (0..MAX_SIMULATIONS).map(|_| begin()).collect();
    wait_for(MAX_SIMULATIONS);
    refused(
        &server.post("/api/simulations", &request),
        503,
        "simulations are running",
    );
    // One stands still when its tab closes.
    let (paused, events) = open.remove(0);
    server.post(
        &format!("/api/simulations/{paused}"),
        &json!({ "paused": true }),
    );
    drop(events);
    wait_for(MAX_SIMULATIONS - 1);
    open.push(begin());
    wait_for(MAX_SIMULATIONS);
    open.clear();
    wait_for(0);

    // A simulation that runs does not keep the server from ending; it is told.
    let (_, events) = begin();
    server.ended_by("TERM");
    assert_eq!(events.last().map(|(name, _)| name), Some("end".to_string()));
}

#[test]
fn many_requests_at_once_are_all_answered() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    // Connections that send nothing, as browsers open them, block no others.
    let _idle: Vec<_> = (0..10).map(|_| server.connect()).collect();
    std::thread::scope(|scope| {
        for _ in 0..16 {
            scope.spawn(|| {
                (0..10).for_each(|_| assert_eq!(server.get("/api/archives/0").status, 200))
            });
        }
    });
}

#[cfg(target_os = "linux")]
#[test]
fn where_nothing_opens_the_page_or_a_report_it_is_said_in_plain_words() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    // As xdg-open ends where it knows no browser.
    let opener = sandbox.write("bin/xdg-open", "#!/bin/sh\nexit 3\n");
    std::fs::set_permissions(&opener, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let bin = sandbox.path("bin");
    let mut report = sandbox.command("report run --rollouts 0 --open".split(' '));
    report.env("PATH", &bin);
    said(report).ended(1, &["run/report.html: "]);
    let mut serve = std::process::Command::new(PROGRAM);
    serve
        .arg("serve")
        .current_dir(sandbox.path(""))
        .env("PATH", &bin);
    let mut child = serve
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(child.stderr.take().unwrap())
        .lines()
        .map(Result::unwrap);
    let warning = lines
        .into_iter()
        .find(|line| line.contains("browser"))
        .unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(warning.contains("http://127.0.0.1:"), "{warning}");
}

#[test]
fn a_port_that_is_taken_and_a_broken_archive_are_clear_errors() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    let again = format!("serve --no-open --port {}", server.port);
    sandbox.run(&again).ended(5, &["--port"]);
    sandbox.write("run.json", "{}");
    sandbox
        .run("serve --no-open --archive run.json")
        .ended(3, &["run.json"]);
    sandbox
        .run("serve --no-open --archive none.json")
        .ended(3, &["none.json"]);
}

#[test]
fn the_gallery_walks_as_it_was_trained() {
    #[derive(serde::Deserialize)]
    struct Reference {
        evogym_displacements: Vec<Vec<f64>>,
    }
    let references: BTreeMap<String, Reference> =
        crate::common::reference::golden("published_robots");
    for robot in published::gallery().unwrap() {
        let under_zero = references[&robot.name].evogym_displacements[0][0];
        assert_eq!(
            Direction::of(under_zero, 3.0),
            Some(robot.zero_walks),
            "{}",
            robot.name
        );
    }
}
