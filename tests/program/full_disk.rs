//! A disk that is full when the work is done: what was found is shown all the same, and what to do
//! is said.
#![cfg(unix)]

use crate::common::program::{PROGRAM, SETTINGS, Said, Sandbox, files, said};
use morphcog::response::gait::Gait;
use morphcog::store::run::Robot;
use std::process::Command;

/// Runs the program where no file may become larger than this number of blocks (of 512 or 1024
/// bytes): to it, a full disk.
fn without_room(sandbox: &Sandbox, blocks: u32, args: &str) -> Said {
    let mut command = Command::new("sh");
    let script = format!("ulimit -f {blocks}; exec \"$0\" \"$@\"");
    command
        .current_dir(sandbox.path(""))
        .args(["-c", &script, PROGRAM])
        .args(args.split_whitespace());
    SETTINGS.iter().for_each(|name| {
        command.env_remove(name);
    });
    said(command)
}

fn sandbox() -> Sandbox {
    let sandbox = Sandbox::tiny();
    sandbox
        .run("evolve -q --config tiny.toml --out run")
        .ended(0, &[]);
    sandbox
}

/// What a full disk must say in any case: which file, and what to do; no file that the user did not
/// ask for.
fn said_why(said: Said, file: &str) -> Said {
    let said = said.ended(1, &[&format!("error: {file}: "), "--out"]);
    assert!(
        !said.err.contains(".tmp") && !said.err.contains("tmp."),
        "{}",
        said.err
    );
    assert_eq!(
        said.err.matches("warning:").count(),
        1,
        "told once: {}",
        said.err
    );
    assert!(!said.out.contains("wrote"), "{}", said.out);
    said
}

#[test]
fn an_evaluation_that_cannot_be_written_is_shown() {
    let sandbox = sandbox();
    let before = files(&sandbox.path("run"));
    let eval = "eval --archive run/run.json --images 4 --cycles 1 --robots top:2";
    let said = said_why(without_room(&sandbox, 0, eval), "run/eval.csv");
    let run = sandbox.run_file("run");
    assert!(
        said.out.contains(&run.best().unwrap().id) && said.err.contains("ulimit -f"),
        "{said:#?}"
    );
    assert_eq!(
        files(&sandbox.path("run")),
        before,
        "nothing half-written is left"
    );
    let json = without_room(&sandbox, 0, &format!("{eval} --json"));
    let done = json
        .json_lines()
        .into_iter()
        .find(|line| line["event"] == "evaluated")
        .unwrap();
    assert_eq!(
        (&done["file"], done["robots"].as_array().unwrap().len()),
        (&serde_json::Value::Null, 2)
    );
}

#[cfg(target_os = "linux")]
#[test]
fn where_the_disk_is_full_the_hint_speaks_of_space() {
    let sandbox = sandbox();
    // A device that is always full.
    std::os::unix::fs::symlink("/dev/full", sandbox.path("full.json")).unwrap();
    let eval = "eval --archive run/run.json --images 4 --cycles 1 --robots top:2 --out full.json";
    let said = said_why(sandbox.run(eval), "full.json");
    assert!(said.err.contains("make space on the disk"), "{}", said.err);
    assert!(
        said.out
            .contains(&sandbox.run_file("run").best().unwrap().id),
        "{}",
        said.out
    );
}

#[test]
fn an_audit_that_cannot_be_written_is_shown() {
    let sandbox = sandbox();
    let before = files(&sandbox.path("run"));
    let audit = "audit --archive run/run.json --robots top:1 --set perturbations.time_step=[2]";
    let said = said_why(without_room(&sandbox, 0, audit), "run/audit.csv");
    assert!(
        said.out
            .contains(&sandbox.run_file("run").best().unwrap().id),
        "{}",
        said.out
    );
    assert_eq!(files(&sandbox.path("run")), before);
}

#[test]
fn a_response_that_cannot_be_written_is_shown() {
    let sandbox = sandbox();
    let before = files(&sandbox.path("run"));
    let run = sandbox.run_file("run");
    let is_place = |robot: &&Robot| Gait::of(&robot.body).is_some();
    let id = &run.elites.iter().find(is_place).unwrap().id;
    let response = format!("response --archive run --robots {id} --images 60");
    let said = said_why(without_room(&sandbox, 0, &response), "run/response.csv");
    assert!(said.out.contains(id), "{}", said.out);
    assert_eq!(files(&sandbox.path("run")), before);
}

#[test]
fn a_capacity_that_cannot_be_written_is_shown() {
    let sandbox = sandbox();
    sandbox
        .run("eval -q --archive run/run.json --images 40 --cycles 1 --robots top:2")
        .ended(0, &[]);
    let before = files(&sandbox.path("run"));
    let capacity = "capacity --eval run/eval.json --set trainings=1 --set sizes=[1,3] --set networks=[\"mlp\"]";
    let said = without_room(&sandbox, 0, capacity);
    let said = said.ended(1, &["error: run/capacity.csv: "]);
    assert!(
        said.out.contains("MLP neurons") && !said.out.contains("wrote"),
        "{}",
        said.out
    );
    assert!(!said.err.contains(".tmp"), "{}", said.err);
    assert_eq!(files(&sandbox.path("run")), before);
}

#[test]
fn a_run_that_cannot_be_saved_at_its_end_is_shown_and_can_be_resumed() {
    let sandbox = Sandbox::tiny();
    // Room for config and metrics, but not for the checkpoint.
    let evolve = "evolve --config tiny.toml --out run";
    let said = without_room(&sandbox, 8, evolve);
    let said = said.ended(1, &["checkpoint.json: ", "--resume"]);
    assert!(!said.err.contains(".tmp"), "{said:#?}");
    sandbox
        .run(&format!("{evolve} --resume --quiet"))
        .ended(0, &[]);
    let other = Sandbox::tiny();
    other.run(&format!("{evolve} --quiet")).ended(0, &[]);
    assert_eq!(sandbox.read("run/run.json"), other.read("run/run.json"));
    assert!(
        said.out
            .contains(&sandbox.run_file("run").best().unwrap().id),
        "{}",
        said.out
    );
}

#[test]
fn pictures_and_trajectories_without_room_say_so_with_a_hint() {
    let sandbox = sandbox();
    sandbox.write(
        "scenario.json",
        "{\"body\": [[3, 4]], \"control_steps\": 20}",
    );
    let without = |args: &str, file: &str| {
        let said = without_room(&sandbox, 0, args);
        let said = said.ended(1, &[&format!("{file}: "), "ulimit -f"]);
        assert!(!said.err.contains(".tmp"), "{}", said.err);
        assert!(!sandbox.path(file).exists());
    };
    without("simulate scenario.json --out rollout.csv", "rollout.csv");
    without(
        "plot body --archive run/run.json --out body.svg",
        "body.svg",
    );
    without("report run --rollouts 0 --out report.html", "report.html");
    without(
        "data sheet builtin --samples 1 --out sheet.png",
        "sheet.png",
    );
}
