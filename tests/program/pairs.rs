//! `train --pairs`: a robot for each pair of classes, in tasks like those of a sweep.

use crate::common::program::{Made, Sandbox, TINY, files, write_images};
use morphcog::store::run::RunFile;
use serde_json::Value;
use std::sync::OnceLock;

/// A little of everything: seconds in place of minutes.
const LITTLE: &str = "--set train.random_images=60 --set train.rounds=1 --set train.images=12 --set train.windows=3 \
--set train.final_images=10 --set train.challengers=1 --set validation.images=40 --set validation.best=0";

/// A run whose robots walk a little, and images of three classes that have names.
fn sandbox() -> Sandbox {
    static WALKERS: OnceLock<Made> = OnceLock::new();
    Sandbox::once(&WALKERS, |sandbox| {
        sandbox.write("run.toml", TINY);
        sandbox
            .run("evolve -q -c run.toml -o walkers")
            .ended(0, &[]);
    })
}

fn pairs(more: &str) -> String {
    format!("train -q --pairs -a walkers --robots top:2 {LITTLE} --classes 1,3,4 {more}")
}

#[test]
fn each_pair_becomes_a_run_and_together_they_are_a_team() {
    let sandbox = sandbox();
    let said = sandbox
        .run(&pairs("-o team --threads 2").replace("-q ", ""))
        .ended(0, &[]);
    for word in ["1|3", "1|4", "3|4", "morphcog team --archive team"] {
        let all = format!("{}{}", said.out, said.err);
        assert!(all.contains(word), "{word}: {all}");
    }
    for (folder, task) in [("1v3", "1|3"), ("1v4", "1|4"), ("3v4", "3|4")] {
        let run = sandbox.run_file(&format!("team/{folder}"));
        assert_eq!(run.elites[0].task, task);
        let gaits = sandbox.read(&format!("team/{folder}/gaits.csv"));
        let predicted: Vec<f64> = gaits
            .lines()
            .skip(1)
            .map(|line| line.split(',').nth(2).unwrap().parse().unwrap())
            .collect();
        assert!(!predicted.is_empty() && predicted.is_sorted_by(|a, b| a >= b));
        let first = gaits.lines().nth(1).unwrap().split(',').nth(1).unwrap();
        let tried = sandbox.run_file(&format!("team/{folder}/gait-1"));
        assert_eq!(tried.elites[0].parent.as_deref(), Some(first));
    }
    sandbox
        .run("team -q --archive team --classes 1,3,4 --images 6")
        .ended(0, &[]);
    let team: Value = serde_json::from_str(&sandbox.read("team/team.json")).unwrap();
    assert_eq!(team["members"].as_array().unwrap().len(), 3);
}

#[test]
fn a_pair_alone_and_all_at_once_make_the_same_files() {
    let sandbox = sandbox();
    sandbox.run(&pairs("-o all --threads 1")).ended(0, &[]);
    for number in [3, 1, 2] {
        sandbox
            .run(&pairs(&format!("-o one --pair {number} --threads 3")))
            .ended(0, &[]);
    }
    let [all, one] = ["all", "one"].map(|folder| {
        let names = ["1v3", "1v4", "3v4"];
        names.map(|pair| {
            let read = |file: &str| sandbox.read(&format!("{folder}/{pair}/{file}"));
            ["run.json", "audit.json", "gaits.csv"].map(read)
        })
    });
    assert!(all == one);
    // Nothing is done twice.
    let before = files(&sandbox.path("one/1v3"));
    sandbox.run(&pairs("-o one")).ended(0, &[]);
    assert!(before == files(&sandbox.path("one/1v3")));
    let said = sandbox.run(&pairs("-o one --status")).ended(0, &[]);
    assert_eq!(said.out.matches("   done   ").count(), 3, "{}", said.out);
    let said = sandbox.run(&pairs("-o one --list")).ended(0, &[]);
    assert_eq!(said.out.lines().count(), 3);
    assert!(said.out.contains("--robots top:2") && said.out.contains("--pair 3"));
}

#[test]
fn classes_are_called_by_their_names_everywhere() {
    let sandbox = sandbox();
    write_images(&sandbox, "pets/", [14, 14], 5);
    sandbox.write(
        "pets/dataset.json",
        "{\"format\": \"morphcog-dataset\", \"format_version\": 1, \"class_names\": [\"ant\", \"bee\"]}",
    );
    let train = format!(
        "train -q -a walkers --robots top:2 {LITTLE} --dataset pets --data pets --set stimulus.margin= "
    );
    sandbox
        .run(&format!("{train} --task bee|ant -o taught"))
        .ended(0, &[]);
    let run = sandbox.run_file("taught");
    assert_eq!(run.elites[0].task, "bee|ant");
    assert_eq!(
        run.config.task.groups,
        Some([vec![1], vec![0]]),
        "classes have numbers in configs"
    );
    let said = sandbox
        .run(&format!("{train} --task bee|cow -o other"))
        .ended(2, &["--task", "cow", "ant, bee"]);
    assert!(!said.err.contains("panicked"));
    // Without a folder of its own, a training is called after its classes.
    sandbox.run(&format!("{train} --task 0|1")).ended(0, &[]);
    assert_eq!(
        sandbox.run_file("walkers-ant-v-bee").elites[0].task,
        "ant|bee"
    );
}

#[test]
fn what_cannot_be_paired_is_refused_before_anything_is_measured() {
    let sandbox = sandbox();
    for (arguments, code, said) in [
        ("--pairs --task 1|3", 2, vec!["--pairs", "--task"]),
        ("--pairs --classes 1", 2, vec!["--classes", "two or more"]),
        ("--pairs --classes 1,77", 2, vec!["--classes", "77"]),
        ("--pairs --classes 1,cow", 2, vec!["--classes", "cow"]),
        (
            "--pairs --pair 99 --classes 1,3",
            2,
            vec!["--pair 99", "1 to 1"],
        ),
        ("--pairs --set train.rounds=x", 2, vec!["train.rounds"]),
        (
            "--pairs --set protocol.control_steps=50 --classes 1,3",
            2,
            vec!["protocol", "what robots see"],
        ),
        ("--classes 1,3 --task 1|3", 2, vec!["--classes", "--pairs"]),
        ("", 2, vec!["--task"]),
    ] {
        sandbox
            .run(&format!("train -q -a walkers {arguments} -o none"))
            .ended(code, &said);
        assert!(!sandbox.path("none").exists());
    }
}

#[test]
fn of_several_archives_the_gait_with_the_highest_prediction_is_trained() {
    let sandbox = sandbox();
    sandbox
        .run("evolve -q -c run.toml --seed 9 -o others")
        .ended(0, &[]);
    let train = format!("train --robots top:2 {LITTLE} --task 1|3");
    let said = sandbox
        .run(&format!("{train} -a walkers others -o both"))
        .ended(0, &["the highest of all gaits"]);
    let parent = sandbox.run_file("both").elites[0].parent.clone().unwrap();
    assert!(said.err.contains(&parent), "{}", said.err);
    let of = ["walkers", "others"].map(|run| sandbox.run_file(run));
    let is_there = |run: &RunFile| run.elites.iter().any(|elite| elite.id == parent);
    let source = of.iter().position(is_there).expect("a gait of one of them");
    // As if this gait had been named.
    let alone = ["walkers", "others"][source];
    sandbox
        .run(&format!(
            "{} -q -a {alone} --robots {parent} -o alone",
            train.replace("--robots top:2 ", "")
        ))
        .ended(0, &[]);
    assert_eq!(
        sandbox.run_file("both").elites[0].body,
        sandbox.run_file("alone").elites[0].body
    );
}
