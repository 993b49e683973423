//! A run can be looked at while it goes on.
#![cfg(unix)]

use crate::common::program::{Sandbox, TINY, terminate};
use crate::common::server::Server;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// How long anything here may take, on a machine that has other things to do.
const PATIENCE: Duration = Duration::from_secs(60);

#[track_caller]
fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn a_run_under_way_can_be_shown_plotted_tested_and_reported_and_all_say_that_it_is() {
    let sandbox = Sandbox::new();
    let mut child = sandbox.endless("runs/long");
    let path = sandbox.path("runs/long/run.json");
    until("run.json exists", || path.exists());
    until("there are robots", || {
        !sandbox.run_file("runs/long").elites.is_empty()
    });
    let lines = || sandbox.read("runs/long/metrics.csv").lines().count();
    let first = lines();
    until("metrics.csv grows", || lines() > first);
    for command in [
        "eval -a runs/long --images 4 --cycles 1 --robots best",
        "replay --robot best -o best.png",
        "plot progress -a runs/long -o progress.svg",
        "plot body -a runs/long -o body.svg",
        "report -a runs/long --rollouts 1 -o report.html",
        "audit --robots best -o audit.json",
    ] {
        sandbox.run(command).ended(0, &["of 10000000"]);
    }
    terminate(&child);
    assert_eq!(child.wait().unwrap().code(), Some(75));
}

#[test]
fn the_server_shows_runs_that_begin_how_far_they_are_and_that_they_have_ended() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    let read = |path: &str| -> Value { serde_json::from_str(&server.get(path).body).unwrap() };
    let built_in = read("/api/archives").as_array().unwrap().len();
    let mut child = sandbox.endless("runs/live");
    until("the run appears", || {
        read("/api/archives").as_array().unwrap().len() > built_in
    });
    until("it is read anew", || {
        read("/api/archives")[built_in]["changes"].as_u64().unwrap() > 1
    });
    let progress = format!("/api/archives/{built_in}/progress");
    until("it has gone on", || {
        server.get(&progress).status == 200 && read(&progress)["done"] != 0
    });
    let course = read(&progress);
    assert_eq!(
        (&course["asked"], &course["under_way"]),
        (&json!(10_000_000), &json!(true))
    );
    let done = course["done"].as_u64().unwrap();
    until("it goes on", || {
        read(&progress)["done"].as_u64().unwrap() > done
    });
    assert!(read(&progress)["seconds_left"].as_f64().unwrap() > 0.0);
    let curves = read(&progress);
    let points = |key: &str| curves[key].as_array().unwrap().len();
    assert!(
        ["qd_score", "coverage", "obj_max"]
            .iter()
            .all(|key| points(key) == points("generation"))
    );
    assert!((1..=240).contains(&points("generation")));
    terminate(&child);
    child.wait().unwrap();
    until("it has ended", || read(&progress)["under_way"] == false);
    assert_eq!(server.get("/api/archives/0/progress").status, 404);
    // A robot that has lost its place meanwhile can still be watched by a page that lists it.
    let mut run = sandbox.run_file("runs/live");
    let lost = run.elites.pop().unwrap();
    run.stats = run
        .archive()
        .unwrap()
        .stats(run.dimensions.possible_cells, run.config.archive.qd_offset);
    let lists = |id: &str| {
        let listed = read(&format!("/api/archives/{built_in}"));
        listed["robots"]
            .as_array()
            .unwrap()
            .iter()
            .any(|robot| robot["id"] == id)
    };
    until("the last state is read", || lists(&lost.id));
    sandbox.write("runs/live/run.json", run.to_json());
    until("it is read anew", || !lists(&lost.id));
    let subject = |id: &str| json!({ "subject": { "archive": built_in, "robot": id } });
    assert_eq!(server.post("/api/stimulus", &subject(&lost.id)).status, 200);
    assert_eq!(server.post("/api/stimulus", &subject("nobody")).status, 404);
    // What is not to be read for a moment is not lost.
    sandbox.write("runs/live/run.json", "{");
    std::thread::sleep(Duration::from_millis(600));
    assert!(
        !read(&format!("/api/archives/{built_in}"))["robots"]
            .as_array()
            .unwrap()
            .is_empty()
    );
}

#[test]
fn a_run_is_in_its_folder_before_its_first_generation_has_ended() {
    let sandbox = Sandbox::new();
    sandbox.write(
        "slow.toml",
        TINY.replace("control_steps = 20", "control_steps = 1000000"),
    );
    let mut child = sandbox.start("evolve -q -c slow.toml -o slow");
    let path = sandbox.path("slow/run.json");
    until("run.json exists", || path.exists());
    let run = sandbox.run_file("slow");
    assert_eq!((run.generations, run.elites.len()), (0, 0));
    sandbox
        .run("replay --robot best -a slow")
        .ended(3, &["slow/run.json"]);
    terminate(&child);
    assert_eq!(child.wait().unwrap().code(), Some(75));
}
