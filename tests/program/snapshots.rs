//! What the program prints, word for word: help, results, and the typical errors of every kind.
//!
//! Each snapshot in `snapshots/` is a command or a few, how they end, and what they say. Other tests
//! hold what is done, and which file, key or number is named. After a change that is meant,
//! `UPDATE_SNAPSHOTS=1 cargo test --release --test program snapshots` writes them anew; the
//! difference is reviewed with the change.

use crate::common::program::{PROGRAM, Sandbox, TINY, gaits, write_images, write_pictures};
use crate::with_run;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/snapshots")
}

/// Units before which a number depends on the machine.
const UNITS: [&str; 10] = [
    "s",
    "ms",
    "min",
    "h",
    "s,",
    "evaluations/s",
    "rollouts/s",
    "rollouts/s,",
    "images/s",
    "s;",
];

/// A text without what depends on the machine or the version: paths, durations, speeds, checksums.
fn masked(text: &str, sandbox: &Sandbox) -> String {
    let text = text
        .replace(&sandbox.path("").display().to_string(), "FOLDER/")
        .replace(PROGRAM, "morphcog");
    let line = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        let mask = |(number, word): (usize, &&str)| {
            let is_number = word
                .trim_start_matches('(')
                .replace(',', "")
                .parse::<f64>()
                .is_ok();
            let before_unit = words
                .get(number + 1)
                .is_some_and(|unit| UNITS.contains(unit));
            // The beginning of the SHA-256 of what the program wrote, its version with it.
            let begun = word.trim_end_matches([',', ')', ';']).strip_suffix('…');
            let is_sum =
                begun.is_some_and(|sum| sum.len() == 10 && u64::from_str_radix(sum, 16).is_ok());
            if is_number && before_unit || is_sum {
                "#".to_string()
            } else {
                (*word).to_string()
            }
        };
        words
            .iter()
            .enumerate()
            .map(mask)
            .collect::<Vec<_>>()
            .join(" ")
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// A command, how it ends, and all that it says.
fn told(sandbox: &Sandbox, args: &str) -> String {
    let said = sandbox.run(args);
    let code = said.code.expect("ended by itself");
    let [out, err] = [&said.out, &said.err].map(|text| masked(text, sandbox));
    format!("$ morphcog {args}\nexit code {code}\n--- stdout\n{out}\n--- stderr\n{err}\n")
}

/// Where a text first differs from the snapshot of this name, if it does.
fn difference(name: &str, found: &str) -> Option<String> {
    let path = folder().join(name).with_extension("txt");
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        std::fs::create_dir_all(folder()).unwrap();
        std::fs::write(&path, found).unwrap();
        return None;
    }
    let expected = std::fs::read_to_string(&path).unwrap_or_default();
    if found == expected {
        return None;
    }
    let (mut was, mut is) = (expected.lines(), found.lines());
    let first = loop {
        let pair = (was.next(), is.next());
        if pair.0 != pair.1 || pair.0.is_none() {
            break pair;
        }
    };
    Some(format!(
        "{name}: was {:?}\n{name}: is  {:?}",
        first.0, first.1
    ))
}

/// Checks texts, each with its snapshot's name.
#[track_caller]
fn compare(texts: &[(&str, String)]) {
    let differences: Vec<String> = texts
        .iter()
        .filter_map(|(name, text)| difference(name, text))
        .collect();
    assert!(
        differences.is_empty(),
        "UPDATE_SNAPSHOTS=1 takes them over:\n{}",
        differences.join("\n")
    );
}

/// Checks these commands, each with its snapshot's name.
#[track_caller]
fn check_all(sandbox: &Sandbox, commands: &[(&str, &str)]) {
    let texts: Vec<_> = commands
        .iter()
        .map(|(name, args)| (*name, told(sandbox, args)))
        .collect();
    compare(&texts);
}

/// What these commands say, one after the other.
fn all_told(sandbox: &Sandbox, commands: &[&str]) -> String {
    commands
        .iter()
        .map(|args| told(sandbox, args))
        .collect::<Vec<_>>()
        .join("\n")
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
            ("help-compare", "compare --help"),
            ("help-capacity", "capacity --help"),
            ("help-team", "team --help"),
            ("help-sweep", "sweep --help"),
            ("help-reproduce", "reproduce --help"),
            ("help-verify", "verify --help"),
            ("help-report", "report --help"),
            ("help-replay", "replay --help"),
            ("help-plot", "plot --help"),
            ("help-simulate", "simulate --help"),
            ("help-serve", "serve --help"),
            ("help-data-fetch", "data fetch --help"),
            ("help-data-import", "data import --help"),
            ("help-bench", "bench --help"),
        ],
    );
}

#[test]
fn results_read_as_they_were_reviewed() {
    let sandbox = with_run();
    sandbox.write("plan.toml", "config = \"tiny.toml\"\nseeds = [1, 2]\n");
    write_pictures(&sandbox, "photos", 6);
    let other = "evolve -q -c tiny.toml -o other --set seed=4 --set map_elites.parents=9";
    sandbox.run(other).ended(0, &[]);
    check_all(
        &sandbox,
        &[
            ("evolve", "evolve -q -c tiny.toml -o again --threads 1"),
            (
                "eval",
                "eval -q -a run --images 20 --cycles 1 --robots top:3 --threads 1",
            ),
            (
                "audit",
                "audit -q -a run --robots top:1 --threads 1 --set perturbations.time_step=[2]",
            ),
            ("compare", "compare -q run other -n 20 --threads 1"),
            ("gallery", "gallery"),
            ("data-info", "data info builtin"),
            ("data-import", "data import photos --name shapes"),
            ("error-import", "data import photos --name shapes"),
            (
                "sweep-list",
                "sweep plan.toml --out sweep --list --threads 1",
            ),
            ("sweep-status", "sweep plan.toml --out sweep --status"),
            (
                "sweep-slurm",
                "sweep plan.toml --out sweep --slurm --threads 1",
            ),
            (
                "team",
                "team -q -a run --classes 0,1 --images 20 --threads 1",
            ),
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
            (
                "error-no-data",
                "evolve -q -c tiny.toml --set data.dataset=mnist -o mnist",
            ),
            ("error-task", "train -q -a run --task 1|1 -o task"),
            ("error-plan", "sweep nowhere.toml"),
        ],
    );
}

#[test]
fn errors_about_configs_read_as_they_were_reviewed() {
    let sandbox = Sandbox::tiny();
    let changed = |name: &str, from: &str, to: &str| {
        assert!(TINY.contains(from), "{from}");
        sandbox.write(name, TINY.replace(from, to));
    };
    changed(
        "typed.toml",
        "[protocol]",
        "[physics]\ngravity = \"much\"\n[protocol]",
    );
    changed(
        "nested.toml",
        "[protocol]",
        "[physics]\ngravitee = 3\n[protocol]",
    );
    changed("twice.toml", "seed = 3", "seed = 3\nseed = 4");
    changed("three.toml", "[[0], [1]]", "[[0], [1], [2]]");
    changed("same.toml", "[[0], [1]]", "[[0], [0]]");
    changed("image.toml", "[0, 1]", "[0, 1, 2]");
    changed("class.toml", "[0, 1]", "[0]");
    sandbox.write("half.toml", [0xff, 0xfe, b'a']);
    let table: toml::Table = toml::from_str(TINY).unwrap();
    sandbox.write(
        "two.json",
        format!("{} {{}}", serde_json::to_string(&table).unwrap()),
    );
    let files = [
        "typed.toml",
        "nested.toml",
        "twice.toml",
        "three.toml",
        "same.toml",
        "image.toml",
        "class.toml",
    ];
    let of_files = files
        .into_iter()
        .chain(["half.toml", "two.json"])
        .map(|name| format!("evolve -c {name} -o new"));
    let sets = [
        "seed",
        "task.groups.3.1=1",
        "stages.1.keep=1",
        "archive.kep=1",
        "data.dataset=",
        "body.height=x",
        "generations=0",
        "data.transpose=true",
    ];
    let of_sets = sets.map(|set| format!("evolve -c tiny.toml -o new --set {set}"));
    let commands: Vec<String> = of_files.chain(of_sets).collect();
    let commands: Vec<&str> = commands.iter().map(String::as_str).collect();
    compare(&[("errors-config", all_told(&sandbox, &commands))]);
}

#[test]
fn errors_of_single_commands_read_as_they_were_reviewed() {
    let sandbox = with_run();
    sandbox
        .run("eval -q -a run --images 20 --cycles 1 --robots top:3")
        .ended(0, &[]);
    sandbox.write("plan.toml", "config = \"tiny.toml\"\nseeds = [1, 2]\n");
    sandbox.write("absent.toml", "config = \"own.toml\"\n");
    sandbox.write("block.json", "{\"body\": [[1]], \"control_steps\": 1}");
    let all = |start: &str, ends: &[&str]| {
        let commands: Vec<String> = ends.iter().map(|end| format!("{start} {end}")).collect();
        all_told(
            &sandbox,
            &commands.iter().map(String::as_str).collect::<Vec<_>>(),
        )
    };
    let compare_with = [
        "",
        "run",
        "nowhere",
        "gallery:zero_one-1 -o table.json",
        "gallery:zero_one-1 -o run/metrics.csv",
        "gallery:zero_one-1 --robots top:2",
        "gallery:zero_one-1 --physical-only",
    ];
    let capacity = [
        "--set sizes=[1,4,9]",
        "--set sizes=[3,2]",
        "--set cnn.kernel=5",
        "--set cnn.kernel=6 --set cnn.pooling=none",
        "--set trainings=0",
        "--physical-only",
        "-o run/eval.json",
        "-o run/c.svg",
    ];
    let eval = [
        "--images 1002",
        "--images most",
        "--threshold nan",
        "--split train",
        "--physical-only",
        "--robots worst:3",
        "--robots top:0",
        "--robots best --robots top:1",
        "--robots best-validation --validation 10",
        "--validation 60",
        "-o run/run.json",
        "-o run/audit.json",
        "-o results.csv",
    ];
    let train = [
        "--task 4",
        "--task 3|10,11",
        "--task 0|1 --set train.images=1",
        "--task 3|14 --set train.final_images=3",
        "--task 0|1 --set stimulus.reduction=stride --set train.windows=10",
        "--task 0|1 --set train.windows=10001",
        "--task 0|1 --set stimulus.margin=[20,0,8,0]",
        "--task 0|1 --set body.height=4",
        "--task 0|1 --set task.groups=[[3],[4]]",
        "--task 0|1 --seed 4 --set seed=3",
        "--task 0|1 --set generations=5",
        "--task 0|1 --robots best-validation:1",
        "--task 0|1 -o run",
    ];
    let response = [
        "--images 59",
        "--error 1",
        "--error=-0.1",
        "--error nan",
        "--task 4",
        "--set train.windows=5",
        "--task 3|14 --set physics.gravity=90",
        "-o run/eval.json",
        "-o map.png",
        "-o map.csv",
    ];
    let team = [
        "--classes 0,1,2",
        "--classes 0,77",
        "--classes 0,1 --images 1",
        "--classes 0,1 --images 99999",
        "--robots best-validation:1",
    ];
    let sweep = [
        "plan.toml --set seeds=[1,1]",
        "plan.toml --set set=[\"seed=3\"]",
        "plan.toml --set set=[\"generations=0\"]",
        "plan.toml --set eval.images=most",
        "plan.toml --set eval.images=1",
        "plan.toml --set groups=[\"0|1\",\"1|0\"]",
        "plan.toml --task 5",
        "plan.toml --task",
        "absent.toml",
    ];
    let pictures = [
        "plot archive -a run run/run.json",
        "plot archive -a run --robot best",
        "plot archive -a run -o figure.eps",
        "plot body -a run -o run/",
        "plot body -a run --robot top:2 -o a.svg",
        "plot capacity -a run",
        "plot pie -a run",
        "replay -a run --robot top:2 -o many.png",
        "replay -a run --look pretty",
        "replay -a run --images test:99999999",
        "replay --robot gallery --dataset builtin -o many.png",
        "replay --robot XFJPI",
        "report block.json",
        "simulate block.json -o block.json",
    ];
    let audit = [
        "-o run/eval.json",
        "--set perturbations.time_step=[1]",
        "--set perturbations.start.9=1",
    ];
    compare(&[
        (
            "errors-capacity",
            all("capacity --eval run/eval.json", &capacity),
        ),
        ("errors-eval", all("eval -a run", &eval)),
        ("errors-train", all("train -q -a run", &train)),
        ("errors-response", all("response -q -a run", &response)),
        ("errors-team", all("team -q -a run", &team)),
        ("errors-audit", all("audit -a run", &audit)),
        ("errors-compare", all("compare -q run", &compare_with)),
        ("errors-sweep", all("sweep", &sweep)),
        ("errors-pictures", all_told(&sandbox, &pictures)),
    ]);
}

#[test]
fn what_no_longer_belongs_to_a_run_is_said_as_it_was_reviewed() {
    let sandbox = with_run();
    let test = "eval -q -a run --images 20 --cycles 1 --robots top:2 --threads 1";
    let audit = "audit -q -a run --robots top:1 --threads 1 --set perturbations.time_step=[2]";
    sandbox.run(test).ended(0, &[]);
    sandbox.run(audit).ended(0, &[]);
    let mut text = all_told(
        &sandbox,
        &[
            &audit.replace("top:1", "top:1 --set threshold=1"),
            &audit.replace(" -q", ""),
            "eval -a run --robots random:2 --physical-only",
            "evolve -q -c tiny.toml -o run -g 13 --resume --threads 1",
            "eval -a run --robots random:2 --physical-only",
            "plot accuracy -a run",
            "report -a run --rollouts 0",
        ],
    );
    for name in ["eval.json", "audit.json", "validation.json"] {
        sandbox.write(&format!("run/{name}"), "{");
    }
    text += "\n";
    text += &all_told(
        &sandbox,
        &[
            "eval -a run",
            "audit -a run",
            "replay -a run --format png",
            "report -a run --rollouts 0",
        ],
    );
    compare(&[("stale", text)]);
}

#[test]
fn what_stands_in_the_way_of_going_on_is_said_as_it_was_reviewed() {
    let sandbox = with_run();
    let resume = "evolve -q -c tiny.toml -o run --threads 1 --resume -g";
    let mut texts = vec![
        told(&sandbox, &format!("{resume} 5")),
        told(&sandbox, &format!("{resume} 13 --set seed=4")),
    ];
    sandbox.write("run/checkpoint.json", "{");
    texts.push(told(&sandbox, &format!("{resume} 13")));
    for name in ["checkpoint.json", "checkpoint.previous.json"] {
        sandbox.write(&format!("run/{name}"), "{");
    }
    texts.push(told(&sandbox, &format!("{resume} 14")));
    for name in ["checkpoint.json", "checkpoint.previous.json"] {
        std::fs::remove_file(sandbox.path("run").join(name)).unwrap();
    }
    texts.push(told(&sandbox, &format!("{resume} 14")));
    compare(&[("resume", texts.join("\n"))]);
}

#[test]
fn what_other_images_and_gaits_are_not_for_is_said_as_it_was_reviewed() {
    let sandbox = Sandbox::tiny();
    write_images(&sandbox, "there/emnist-letters-", [6, 9], 1);
    let letters = all_told(
        &sandbox,
        &[
            "data info letters --data there",
            "data sheet letters --data there -o a.png",
        ],
    );
    sandbox.write("gaits.toml", gaits());
    sandbox
        .run("evolve -q -c gaits.toml -g 2 -o gaits")
        .ended(0, &[]);
    let gaits = all_told(
        &sandbox,
        &[
            "eval -a gaits",
            "audit -a gaits",
            "team -a gaits",
            "evolve -c gaits.toml --set validation.best=1 -o none",
        ],
    );
    compare(&[("transposed", letters), ("errors-gaits", gaits)]);
}
