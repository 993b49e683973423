//! Same numbers, however: what evolves under a config depends on it and its seed alone. Threads,
//! savings, stops and instruction sets change no bit, and no bit changes unnoticed.
//!
//! Where a hash fails and the change is meant, the changelog says so under "Reproducibility-breaking",
//! and the new hash, which the failure shows, takes the place of the old one.

use crate::common::program::{Sandbox, TINY, gaits, said, without_seconds};
use morphcog::base::hash::sha256_hex;
use morphcog::sim::InstructionSet;
use morphcog::store::run::Robot;
use std::collections::BTreeMap;
use std::fmt::Write;

/// All three savings; bit `i` of a set of them switches the `i`-th on.
const SAVINGS: [&str; 3] = ["known_bodies", "early_stop", "shared_rollouts"];
const NONE: usize = 0;
const ALL: usize = 7;

/// A way to make a run that must not matter.
struct Way {
    threads: u32,
    savings: usize,
    set: InstructionSet,
    /// Stopped after as many generations, on two threads, and resumed.
    stopped_after: Option<u32>,
}

/// The instruction sets of this machine, the fastest first.
fn sets() -> Vec<InstructionSet> {
    InstructionSet::ALL
        .into_iter()
        .rev()
        .filter(|set| set.is_available())
        .collect()
}

/// The fastest set and the next: the last, which every machine has, is many times slower.
fn two_sets() -> [InstructionSet; 2] {
    let sets = sets();
    [sets[0], sets[sets.len().min(2) - 1]]
}

/// SHA-256 over the elites' cells, the first ten digits of their genomes' digests, and the bits of
/// objectives and displacements.
fn hash(elites: &[Robot]) -> String {
    let mut text = String::new();
    for elite in elites {
        let displacements: Vec<u64> = elite.displacements.iter().map(|d| d.to_bits()).collect();
        let objective = elite.objective.to_bits();
        let digest = &elite.genome.digest()[..10];
        writeln!(
            text,
            "{:?} {digest} {objective:016x} {displacements:016x?}",
            elite.cell
        )
        .unwrap();
    }
    sha256_hex(text.as_bytes())
}

/// What is left of a run.
#[derive(PartialEq)]
struct Made {
    run: String,
    metrics: Vec<String>,
    elites: Vec<Robot>,
}

fn make(sandbox: &Sandbox, way: &Way) -> Made {
    let switch = |bit: usize| {
        format!(
            "--set savings.{}={}",
            SAVINGS[bit],
            way.savings >> bit & 1 == 1
        )
    };
    let switches = [0, 1, 2].map(switch).join(" ");
    let run = |threads: u32, more: &str| {
        let args = format!("evolve -q -c run.toml -o out --threads {threads} {switches} {more}");
        let mut command = sandbox.command(args.split_whitespace());
        command.env("MORPHCOG_ISA", way.set.name());
        said(command).ended(0, &[]);
    };
    match way.stopped_after {
        None => run(way.threads, "--force"),
        Some(generations) => {
            run(2, &format!("--force -g {generations}"));
            run(way.threads, "--resume");
        }
    }
    let metrics = without_seconds(&sandbox.read("out/metrics.csv"));
    Made {
        run: sandbox.read("out/run.json"),
        metrics,
        elites: sandbox.run_file("out").elites,
    }
}

/// The last line of `metrics.csv` by column; in every line the counts must add up.
fn totals(metrics: &[String], images: u64) -> BTreeMap<String, u64> {
    let mut rows = csv::Reader::from_reader(std::io::Cursor::new(metrics.join("\n")));
    let mut last = BTreeMap::new();
    for row in rows.deserialize::<BTreeMap<String, String>>() {
        let row = row.unwrap();
        let number = |name: &str| row[name].parse::<u64>().unwrap();
        assert_eq!(
            number("simulated") + number("saved"),
            number("evaluations") * images,
            "{row:?}"
        );
        let parts = SAVINGS.map(|saving| number(&format!("saved_{saving}")));
        assert_eq!(number("saved"), parts.iter().sum::<u64>(), "{row:?}");
        let names = ["evaluations", "simulated"].map(str::to_string);
        let saved = SAVINGS.map(|saving| format!("saved_{saving}"));
        last = names
            .into_iter()
            .chain(saved)
            .map(|name| (name.clone(), number(&name)))
            .collect();
    }
    assert!(last["evaluations"] > 0);
    last
}

/// Makes a run in ways that differ in all that must not matter: the same elites, whose hash is `pinned`;
/// the same bytes where the savings are the same. `effective` savings, each alone, must have saved
/// something of as many rollouts a robot as there are `images`.
#[track_caller]
fn check(config: &str, images: u64, effective: &[&str], pinned: &str) {
    let sandbox = Sandbox::new();
    sandbox.write("run.toml", config);
    let [fastest, next] = two_sets();
    let plain = || Way {
        threads: 1,
        savings: ALL,
        set: fastest,
        stopped_after: None,
    };
    let whole = make(&sandbox, &plain());
    assert!(
        whole.elites.len() >= 4,
        "{} elites: too small a run to say anything",
        whole.elites.len()
    );
    assert_eq!(
        hash(&whole.elites),
        pinned,
        "see the beginning of this file"
    );
    // Where the savings are looked at one by one, so are the other ways.
    if !effective.is_empty() {
        let resumed = Way {
            threads: 3,
            stopped_after: Some(5),
            set: next,
            ..plain()
        };
        assert!(
            make(&sandbox, &resumed) == whole,
            "resumed, on 3 threads, {next:?}"
        );
    }
    let other = Way {
        threads: 7,
        savings: NONE,
        set: next,
        stopped_after: Some(7),
    };
    let unsaved = make(&sandbox, &other);
    assert!(
        unsaved.elites == whole.elites,
        "no savings, resumed, on 7 threads, {next:?}"
    );
    let (none, all) = (
        totals(&unsaved.metrics, images),
        totals(&whole.metrics, images),
    );
    assert!(all["evaluations"] == none["evaluations"] && all["simulated"] < none["simulated"]);
    // What an instability makes needless counts as stopped early.
    let saved = |counts: &BTreeMap<String, u64>, saving: &str| counts[&format!("saved_{saving}")];
    // A run of gaits never shows a body twice.
    assert!(
        saved(&none, "known_bodies") == 0 || config.contains("response"),
        "{none:?}"
    );
    assert_eq!(saved(&none, "shared_rollouts"), 0);
    for (bit, saving) in SAVINGS
        .iter()
        .enumerate()
        .filter(|(_, saving)| effective.contains(saving))
    {
        let made = make(
            &sandbox,
            &Way {
                threads: 2,
                savings: 1 << bit,
                ..plain()
            },
        );
        assert!(made.elites == whole.elites, "{saving} alone");
        let some = totals(&made.metrics, images);
        assert_eq!(some["evaluations"], none["evaluations"]);
        assert!(
            some["simulated"] < none["simulated"],
            "{saving} alone: {some:?}"
        );
        for name in SAVINGS {
            assert!(
                name == "early_stop" || (saved(&some, name) > 0) == (name == *saving),
                "{some:?}"
            );
        }
        assert!(saved(&some, saving) > 0, "{saving} alone: {some:?}");
    }
}

/// [`TINY`] with changes, each of which must have a place.
fn tiny(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(TINY.to_string(), |config, (from, to)| {
        assert!(config.contains(from), "{from}");
        config.replace(from, to)
    })
}

const SEQUENTIAL: (&str, &str) = ("rollout = \"fresh\"", "rollout = \"sequential\"");

#[test]
fn a_run_on_every_instruction_set() {
    let sandbox = Sandbox::new();
    sandbox.write("run.toml", TINY);
    let sets = sets();
    println!("instruction sets of this machine: {sets:?}");
    let made = |set| {
        make(
            &sandbox,
            &Way {
                threads: 2,
                savings: ALL,
                set,
                stopped_after: None,
            },
        )
    };
    let first = made(sets[0]);
    assert!(first.elites.len() >= 4 && sets[1..].iter().all(|&set| made(set) == first));
}

#[test]
fn two_groups() {
    // Long enough a rollout for robots that walk both ways: only a success can end a rollout early.
    let config = tiny(&[
        ("generations = 12", "generations = 30"),
        ("steps = 20", "steps = 50"),
    ]);
    check(
        &config,
        2,
        &SAVINGS,
        "1e4b7db220180aad0b06012c3b8d00084cad7e66aa940049e92f3d150737fd06",
    );
}

#[test]
fn sequential_rollouts() {
    let config = tiny(&[("generations = 12", "generations = 30"), SEQUENTIAL]);
    check(
        &config,
        2,
        &["known_bodies", "early_stop"],
        "993c70faaa85a1aeb058cb34fbe7169e252959f0baab3514dc08fbb08f5c229c",
    );
}

#[test]
fn the_paper_s_protocol() {
    let config = tiny(&[SEQUENTIAL, ("control_steps = 20", "control_steps = 500")]);
    check(
        &config,
        2,
        &[],
        "38e9052e5c9f95a3bd20ccd9b52f8b46c803f55a0e0a28dce0adb9538d2ce672",
    );
}

#[test]
fn all_splits() {
    let images = ("train_images = [0, 1]", "train_images = [0, 1, 2, 3]");
    let config = tiny(&[("groups = [[0], [1]]", "splits = [0, 1, 2, 3]"), images]);
    check(
        &config,
        4,
        &["known_bodies", "shared_rollouts"],
        "13de1d98c5883184ccb7f5450eee375a72f5aef73a6a47f15b2895a303d71c1e",
    );
}

#[test]
fn splits_with_the_bin_for_the_same_way() {
    let config = tiny(&[
        ("generations = 12", "generations = 25"),
        (
            "groups = [[0], [1]]",
            "splits = [3, 0, 7]\nsame_way_bin = true",
        ),
        ("train_images = [0, 1]", "train_images = [0, 3, 7]"),
    ]);
    check(
        &config,
        3,
        &["known_bodies", "shared_rollouts"],
        "0ff4d724d2a551d75bb38cfb3454e4fd12b4f271a983583cd77ec0781ff83023",
    );
}

#[test]
fn sequential_rollouts_of_splits() {
    let config = tiny(&[
        SEQUENTIAL,
        (
            "groups = [[0], [1]]",
            "splits = [0, 1, 2]\nsame_way_bin = true",
        ),
        ("train_images = [0, 1]", "train_images = [0, 1, 2]"),
    ]);
    check(
        &config,
        3,
        &[],
        "00922b09f85d215ad5fb5d3e369192ee1364982f06f2f3346c1f1dee048f457e",
    );
}

#[test]
fn splits_with_two_images_per_class() {
    let config = tiny(&[
        (
            "groups = [[0], [1]]",
            "splits = [0, 1, 2]\nsame_way_bin = true",
        ),
        ("train_images = [0, 1]", "images_per_class = 2"),
    ]);
    check(
        &config,
        6,
        &["known_bodies", "shared_rollouts"],
        "07b4ab38412cf314bf7ed6412441d1da9ec167b63f8e9f15af4727b477e93756",
    );
}

#[test]
fn three_images_per_class() {
    let config = tiny(&[("train_images = [0, 1]", "images_per_class = 3")]);
    check(
        &config,
        6,
        &SAVINGS,
        "59f4c72dba846132a21f926af11a83cb9918e693f8923bcc3f3c4c5dabcc16b8",
    );
}

#[test]
fn unequal_groups_of_drawn_images() {
    let config = tiny(&[
        ("train_images = [0, 1]", "images_per_class = 3"),
        ("[[0], [1]]", "[[0, 4], [1]]"),
    ]);
    check(
        &config,
        9,
        &[],
        "82bf757dcad76e179f39b216c9fabf4e5299f694b84a37e37e99f4b4da8bdcc3",
    );
}

#[test]
fn unequal_groups_and_saturated_images() {
    let config = tiny(&[
        ("groups = [[0], [1]]", "groups = [[5], [1, 2]]"),
        ("train_images = [0, 1]", "train_images = [1, 5, 2, 12]"),
        (
            "reduction = \"area\"",
            "reduction = \"area\"\nencoding = \"saturated\"",
        ),
    ]);
    check(
        &config,
        4,
        &["known_bodies", "shared_rollouts"],
        "ebd4020c593c55636c9214ca44ec4d3ae8b239073ef011bfcbe014c88ffe8d06",
    );
}

#[test]
fn thresholded_images_and_random_immigrants() {
    let config = tiny(&[
        (
            "reduction = \"area\"",
            "reduction = \"area\"\nencoding = \"threshold\"\nlevel = 0.3",
        ),
        ("parents = 8", "parents = 6\nrandom_immigrants = 3"),
    ]);
    check(
        &config,
        2,
        &["known_bodies", "shared_rollouts"],
        "c1cadaf8384addb9a5a6a276bf713284ac9db2aa6560cb1426c8730a6d352c1c",
    );
}

/// With `keep`, only so many of the fittest stay: exactly those of an archive that keeps all.
#[track_caller]
fn check_kept(config: &str) {
    let sandbox = Sandbox::new();
    let elites = |config: &str, options: &str| {
        sandbox.write("run.toml", config);
        sandbox
            .run(&format!("evolve -q -c run.toml -o out --force {options}"))
            .ended(0, &[]);
        sandbox.run_file("out").elites
    };
    assert_eq!(elites(config, "").len(), 6);
    let by_fitness = |mut elites: Vec<Robot>| {
        elites.sort_by(|a, b| b.objective.total_cmp(&a.objective));
        elites
    };
    let all = by_fitness(elites(&config.replace("keep = 6", ""), "-g 1"));
    assert!(all.len() > 6, "{} robots: none to be left out", all.len());
    assert_eq!(by_fitness(elites(config, "-g 1")), all[..6]);
}

#[test]
fn the_six_fittest() {
    let config = format!("{TINY}\n[archive]\nkeep = 6\n");
    check_kept(&config);
    check(
        &config,
        2,
        &[],
        "c10e43f3ae412bf220f1b0af6acfc547c44913d1008ab650810fed02cfc07123",
    );
}

#[test]
fn the_six_fittest_gaits() {
    check_kept(&gaits());
    check(
        &gaits(),
        8,
        &[],
        "2294ed6c40f0ef8f35ebfec24a0262a478108f67c2c9dd1aaea820fb75aa856c",
    );
}

#[test]
fn gaits_of_three_cycles() {
    let config = gaits()
        .replace("keep = 6", "")
        .replace("control_steps = 20", "control_steps = 60");
    check(
        &config,
        8,
        &[],
        "022ad60ca44a221f7cbef1c2eeaa768aaa1d81c05e1e5c6441183ee600263045",
    );
}

#[test]
fn another_seed_makes_another_run() {
    let sandbox = Sandbox::tiny();
    let result = |seed: u32| {
        sandbox
            .run(&format!("evolve -q -c tiny.toml --seed {seed} -o {seed}"))
            .ended(0, &[]);
        sandbox.run_file(&seed.to_string()).elites
    };
    assert_ne!(result(1), result(2));
}

/// Runs a command that looks at a run, on one to three threads and two instruction sets: the same words
/// and the same bytes of its files.
#[track_caller]
fn check_command(run: &str, command: &str, files: &[&str]) {
    let sandbox = Sandbox::new();
    sandbox.write("run.toml", run);
    sandbox.run("evolve -q -c run.toml -o run").ended(0, &[]);
    let made = |threads: u32, set: InstructionSet| {
        let line = format!("{command} --threads {threads}");
        let mut command = sandbox.command(line.split(' '));
        command.env("MORPHCOG_ISA", set.name());
        let said = said(command).ended(0, &[]);
        (
            said.out,
            files
                .iter()
                .map(|file| std::fs::read(sandbox.path(file)).unwrap())
                .collect::<Vec<_>>(),
        )
    };
    let [fastest, next] = two_sets();
    let first = made(1, fastest);
    assert!(first.1.iter().all(|file| !file.is_empty()));
    assert!(
        made(2, next) == first && made(3, fastest) == first,
        "1 to 3 threads, {fastest:?} and {next:?}"
    );
}

#[test]
fn an_evaluation() {
    let eval = "eval -q -a run -n 20 --cycles 1 --robots random:4";
    check_command(TINY, eval, &["run/eval.json", "run/eval.csv"]);
}

#[test]
fn an_audit() {
    let audit = "audit -q -a run --robots top:3 --fresh --set perturbations.time_step=[2]";
    check_command(TINY, audit, &["run/audit.json", "run/audit.csv"]);
}

#[test]
fn a_response() {
    let response = "response -q -a run --robots best --task 3|14 -n 60 --error 0 -o response.json";
    check_command(
        &gaits(),
        response,
        &[
            "response.json",
            "response.csv",
            "response.svg",
            "response.png",
            "response.pdf",
        ],
    );
}

#[test]
fn a_training() {
    let train = "train -q -a run --robots top:2 --task 0|1 -o taught --force --set train.random_images=40 \
                 --set train.rounds=2 --set train.images=24 --set train.final_images=20 --set \
                 train.challengers=6 --set validation.images=40 --set train.windows=50";
    let files = [
        "taught/run.json",
        "taught/elites.csv",
        "taught/training.json",
        "taught/validation.json",
    ];
    check_command(TINY, train, &files);
}
