//! Same bits: a run depends on config and seed only, not on the number of threads or the
//! instruction set.

mod common;

use common::program::{Sandbox, TINY, said, without_seconds};
use morphcog::sim::InstructionSet;

/// Configs that differ in what could depend on timing: kind of rollout, tasks, images per class.
fn configs() -> Vec<(&'static str, String)> {
    let splits = TINY
        .replace("groups = [[0], [1]]", "splits = [0, 1, 2]\nsame_way_bin = true")
        .replace("train_images = [0, 1]", "train_images = [0, 1, 2]");
    let sequential = "rollout = \"sequential\"";
    let drawn = "images_per_class = 3";
    vec![
        ("fresh", TINY.to_string()),
        ("sequential", TINY.replace("rollout = \"fresh\"", sequential)),
        ("many", TINY.replace("train_images = [0, 1]", drawn).replace("[[0], [1]]", "[[0, 4], [1]]")),
        ("splits", splits.clone()),
        ("splits-sequential", splits.replace("rollout = \"fresh\"", sequential)),
        (
            "no-savings",
            format!("{TINY}\n[savings]\nknown_bodies = false\nearly_stop = false\nshared_rollouts = false\n"),
        ),
    ]
}

#[test]
fn a_run_has_the_same_bytes_on_any_number_of_threads() {
    for (name, config) in configs() {
        let sandbox = Sandbox::new();
        sandbox.write("run.toml", config);
        let result = |threads: u32| {
            let out = format!("threads-{threads}");
            sandbox.run(&format!("evolve -q -c run.toml -o {out} --threads {threads}")).ended(0, &[]);
            let metrics = without_seconds(&sandbox.read(&format!("{out}/metrics.csv")));
            (sandbox.read(&format!("{out}/run.json")), metrics)
        };
        let one = result(1);
        for threads in [2, 3, 7] {
            assert_eq!(result(threads), one, "{name} on {threads} threads");
        }
    }
}

#[test]
fn a_run_has_the_same_bytes_on_every_instruction_set() {
    let sets: Vec<_> = InstructionSet::ALL.into_iter().filter(|set| set.is_available()).collect();
    println!("instruction sets of this machine: {sets:?}");
    for (name, config) in configs() {
        let sandbox = Sandbox::new();
        sandbox.write("run.toml", config);
        let result = |set: InstructionSet| {
            let mut command = sandbox.command(["evolve", "-q", "-c", "run.toml", "-o", set.name()]);
            command.env("MORPHCOG_ISA", set.name());
            said(command).ended(0, &[]);
            sandbox.read(&format!("{}/run.json", set.name()))
        };
        let first = result(sets[0]);
        for &set in &sets[1..] {
            assert_eq!(result(set), first, "{name} on {set:?}");
        }
    }
}

#[test]
fn another_seed_makes_another_run_and_the_same_seed_the_same() {
    let sandbox = Sandbox::tiny();
    let result = |seed: u32, out: &str| {
        sandbox.run(&format!("evolve -q -c tiny.toml --seed {seed} -o {out}")).ended(0, &[]);
        sandbox.run_file(out).elites
    };
    let first = result(1, "a");
    assert_eq!(result(1, "b"), first);
    assert_ne!(result(2, "c"), first);
}

#[test]
fn an_evaluation_has_the_same_bytes_on_any_number_of_threads() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    let result = |threads: u32| {
        let eval = format!("eval -q -a run/run.json -n 20 --cycles 1 --robots random:4 --threads {threads}");
        let said = sandbox.run(&eval).ended(0, &[]);
        (said.out, sandbox.read("run/eval.json"), sandbox.read("run/eval.csv"))
    };
    let one = result(1);
    assert!([2, 5].iter().all(|&threads| result(threads) == one));
}
