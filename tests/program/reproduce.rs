//! The whole paper in small: every step, stopped anywhere, the same table.

use crate::common::program::{Sandbox, TINY, files};
use std::collections::BTreeMap;

const PLAN: &str = r#"
seeds = [1, 2]
robots = 2
images = 4

[[experiment]]
config = "tiny.toml"

[audit]
least_walk = 0.0
threshold = 0.0

[capacity]
trainings = 1
sizes = [1, 2]
"#;

fn sandbox() -> Sandbox {
    let sandbox = Sandbox::new();
    sandbox.write("tiny.toml", TINY);
    sandbox.write("plan.toml", PLAN);
    sandbox
}

/// All results: what does not depend on the clock.
fn results(sandbox: &Sandbox, out: &str) -> BTreeMap<String, Vec<u8>> {
    let mut all = files(&sandbox.path(out));
    for seed in [1, 2] {
        for (name, content) in files(&sandbox.path(&format!("{out}/tiny-seed{seed}"))) {
            if ["run.json", "elites.csv", "audit.json"].contains(&name.as_str()) {
                all.insert(format!("{seed}/{name}"), content);
            }
        }
    }
    all
}

#[test]
fn all_steps_are_done_and_a_second_call_has_nothing_left_to_do() {
    let sandbox = sandbox();
    let said = sandbox
        .run("reproduce plan.toml --scale 0.5 --out small --threads 1")
        .ended(0, &["task 2"]);
    assert_eq!(sandbox.run_file("small/tiny-seed2").generations, 6);
    assert!(
        said.out.contains("0|1") && said.out.contains("reproduction.csv"),
        "{}",
        said.out
    );
    let first = results(&sandbox, "small");
    for file in [
        "reproduction.json",
        "reproduction.csv",
        "tiny-eval.json",
        "tiny-capacity.json",
        "2/audit.json",
    ] {
        assert!(first.contains_key(file), "{file} of {:?}", first.keys());
    }
    let table = String::from_utf8(first["reproduction.csv"].clone()).unwrap();
    let cells: Vec<&str> = table.lines().nth(1).unwrap().split(',').collect();
    assert_eq!((table.lines().count(), cells[0]), (2, "0|1"));
    assert!(cells[1].parse::<usize>().unwrap() <= 2);
    let again = sandbox
        .run("reproduce plan.toml --scale 0.5 --out small --threads 3")
        .ended(0, &[]);
    assert_eq!(results(&sandbox, "small"), first);
    assert!(said.err.contains("test images") && !again.err.contains("test images"));
    // A larger scale goes on with what there is.
    sandbox
        .run("reproduce plan.toml --scale 1 --out small")
        .ended(0, &["task 2"]);
    assert_eq!(sandbox.run_file("small/tiny-seed2").generations, 12);
    sandbox
        .run("reproduce plan.toml --scale 1 --out whole")
        .ended(0, &[]);
    let (grown, whole) = (results(&sandbox, "small"), results(&sandbox, "whole"));
    assert_eq!(grown["1/run.json"], whole["1/run.json"]);
    assert_eq!(grown["reproduction.csv"], whole["reproduction.csv"]);
}

#[test]
fn what_cannot_be_is_refused_before_anything_is_done() {
    let sandbox = sandbox();
    sandbox
        .run("reproduce plan.toml --scale 0")
        .ended(2, &["--scale 0"]);
    sandbox
        .run("reproduce plan.toml --scale nan")
        .ended(2, &["--scale"]);
    sandbox
        .run("reproduce plan.toml --set images=1")
        .ended(3, &["--set images=1: images = 1"]);
    sandbox
        .run("reproduce plan.toml --set robots=0")
        .ended(3, &["robots"]);
    sandbox
        .run("reproduce nowhere.toml")
        .ended(3, &["nowhere.toml"]);
    // An override is blamed for what it makes, of an experiment's config, too.
    let unkept = "experiment.1.set=[\"generations=0\"]";
    sandbox
        .run(&format!(
            "reproduce plan.toml --set seeds=[3] --set {unkept}"
        ))
        .ended(
            3,
            &[&format!("--set {unkept}: experiment 1: generations = 0: ")],
        );
    sandbox
        .run("reproduce plan.toml --set experiment.1.config=no.toml")
        .ended(3, &["no.toml", "--set exp"]);
    sandbox
        .run("reproduce plan.toml --set experiment.2.config=tiny.toml")
        .ended(2, &["--set experiment.2.config=tiny.toml: "]);
    sandbox
        .run("reproduce plan.toml --set seeds=[1,1]")
        .ended(3, &["--set seeds=[1,1]: "]);
    sandbox.write("bad.toml", PLAN.replace("tiny.toml", "missing.toml"));
    sandbox
        .run("reproduce bad.toml")
        .ended(3, &["bad.toml:6: experiment 1: ", "missing.toml"]);
    assert!(!sandbox.path("reproduction").exists());
}

#[test]
fn a_run_chooses_robots_at_its_end_if_its_config_says_so() {
    let sandbox = sandbox();
    let set = "config = \"tiny.toml\"\nset = [\"archive.keep=3\", \"validation.best=2\", \"validation.images=40\"]";
    sandbox.write("plan.toml", PLAN.replace("config = \"tiny.toml\"", set));
    let reproduce = "reproduce plan.toml --set seeds=[1] --scale 0.5 --out small";
    let said = sandbox.run(reproduce).ended(0, &["task 1"]);
    assert!(!said.err.contains("warning"), "{}", said.err);
    assert!(
        sandbox
            .read("small/tiny-seed1/validation.json")
            .contains("\"images\":40")
    );
    // Chosen once, they are known.
    let said = sandbox.run(reproduce).ended(0, &[]);
    assert!(!said.err.contains("task 1"), "{}", said.err);
}
