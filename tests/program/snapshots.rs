//! What the program prints, word for word: help, results, and the typical errors of every kind.
//!
//! Each snapshot in `snapshots/` is a command, how it ends, and what it says. After a change that is
//! meant, `UPDATE_SNAPSHOTS=1 cargo test --release --test program snapshots` writes them anew; the
//! difference is reviewed with the change.

use crate::common::program::{PROGRAM, Sandbox, TINY};
use crate::with_run;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/snapshots")
}

/// Units before which a number depends on the machine.
const UNITS: [&str; 9] = ["s", "ms", "min", "h", "s,", "evaluations/s", "rollouts/s", "rollouts/s,", "s;"];

/// A text without what depends on the machine: paths, durations and speeds.
fn masked(text: &str, sandbox: &Sandbox) -> String {
    let text = text.replace(&sandbox.path("").display().to_string(), "FOLDER/").replace(PROGRAM, "morphcog");
    let line = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        let mask = |(number, word): (usize, &&str)| {
            let is_number = word.trim_start_matches('(').replace(',', "").parse::<f64>().is_ok();
            let before_unit = words.get(number + 1).is_some_and(|unit| UNITS.contains(unit));
            if is_number && before_unit { "#".to_string() } else { (*word).to_string() }
        };
        words.iter().enumerate().map(mask).collect::<Vec<_>>().join(" ")
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// Runs a command and compares all that it says with the snapshot of this name.
fn check(sandbox: &Sandbox, name: &str, args: &str, differences: &mut Vec<String>) {
    let said = sandbox.run(args);
    let code = said.code.expect("ended by itself");
    let [out, err] = [&said.out, &said.err].map(|text| masked(text, sandbox));
    let found = format!("$ morphcog {args}\nexit code {code}\n--- stdout\n{out}\n--- stderr\n{err}\n");
    let path = folder().join(name).with_extension("txt");
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        std::fs::create_dir_all(folder()).unwrap();
        std::fs::write(&path, &found).unwrap();
        return;
    }
    let expected = std::fs::read_to_string(&path).unwrap_or_default();
    if found == expected {
        return;
    }
    let (mut was, mut is) = (expected.lines(), found.lines());
    let first = loop {
        let pair = (was.next(), is.next());
        if pair.0 != pair.1 || pair.0.is_none() {
            break pair;
        }
    };
    differences.push(format!("{name}: was {:?}\n{name}: is  {:?}", first.0, first.1));
}

/// Checks these commands, each with its snapshot's name.
#[track_caller]
fn check_all(sandbox: &Sandbox, commands: &[(&str, &str)]) {
    let mut differences = Vec::new();
    for (name, args) in commands {
        check(sandbox, name, args, &mut differences);
    }
    assert!(differences.is_empty(), "UPDATE_SNAPSHOTS=1 takes them over:\n{}", differences.join("\n"));
}

#[test]
fn help_reads_as_it_was_reviewed() {
    check_all(
        &Sandbox::new(),
        &[
            ("help", "--help"),
            ("help-evolve", "evolve --help"),
            ("help-train", "train --help"),
            ("help-response", "response --help"),
            ("help-eval", "eval --help"),
            ("help-audit", "audit --help"),
            ("help-capacity", "capacity --help"),
            ("help-team", "team --help"),
            ("help-sweep", "sweep --help"),
            ("help-reproduce", "reproduce --help"),
            ("help-report", "report --help"),
            ("help-replay", "replay --help"),
            ("help-plot", "plot --help"),
            ("help-simulate", "simulate --help"),
            ("help-serve", "serve --help"),
            ("help-data-fetch", "data fetch --help"),
        ],
    );
}

#[test]
fn results_read_as_they_were_reviewed() {
    let sandbox = with_run();
    sandbox.write("plan.toml", "config = \"tiny.toml\"\nseeds = [1, 2]\n");
    check_all(
        &sandbox,
        &[
            ("evolve", "evolve -q -c tiny.toml -o again --threads 1"),
            ("eval", "eval -q -a run --images 20 --cycles 1 --robots top:3 --threads 1"),
            ("audit", "audit -q -a run --robots top:1 --threads 1 --set perturbations.time_step=[2]"),
            ("gallery", "gallery"),
            ("data-info", "data info builtin"),
            ("sweep-list", "sweep plan.toml --out sweep --list --threads 1"),
            ("sweep-status", "sweep plan.toml --out sweep --status"),
            ("robots", "replay -a run --robot nobody"),
            ("plot", "plot -q archive -a run"),
            ("report", "report -q run"),
        ],
    );
}

#[test]
fn errors_say_what_where_and_what_to_do_as_they_were_reviewed() {
    let sandbox = with_run();
    sandbox.write("typo.toml", TINY.replace("generations", "generation"));
    sandbox.write("far.toml", TINY.replace("height = 5", "height = 5000"));
    sandbox.write("broken.toml", "seed = \n");
    sandbox.write("empty.toml", "");
    sandbox.write("cut/run.json", &sandbox.read("run/run.json")[..200]);
    check_all(
        &sandbox,
        &[
            ("error-no-command", ""),
            ("error-unknown-command", "evolv"),
            ("error-unknown-flag", "evolve --seeds 3"),
            ("error-missing-config", "evolve -c nowhere.toml"),
            ("error-unknown-key", "evolve -c typo.toml"),
            ("error-range", "evolve -c far.toml"),
            ("error-toml", "evolve -c broken.toml"),
            ("error-set", "evolve -c tiny.toml --set archive.keep=many"),
            ("error-exists", "evolve -q -c tiny.toml -o run"),
            ("error-no-run", "eval -a nowhere"),
            ("error-cut-run", "eval -a cut/run.json"),
            ("error-no-robot", "eval -a run --robots nobody"),
            ("error-no-data", "evolve -q -c tiny.toml --set data.dataset=mnist -o mnist"),
            ("error-task", "train -q -a run --task 1|1 -o task"),
            ("error-plan", "sweep nowhere.toml"),
        ],
    );
}
