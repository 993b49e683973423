//! Stop anywhere: a run that was interrupted, however, and resumed ends with the same bytes as one
//! that was not.
#![cfg(unix)]

use crate::common::program::{PROGRAM, Sandbox, TINY, files, gaits, without_seconds};
use morphcog::base::hash::sha256_hex;
use morphcog::store::run::RunFile;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

const EVERY_GENERATION: &str = "--set checkpoint.generations=1";

/// What a finished run is compared by.
#[derive(Debug, PartialEq)]
struct Result {
    run: String,
    elites: String,
    metrics: Vec<String>,
}

fn result(sandbox: &Sandbox, folder: &str) -> Result {
    let read = |name: &str| sandbox.read(&format!("{folder}/{name}"));
    let metrics = without_seconds(&read("metrics.csv"));
    Result {
        run: read("run.json"),
        elites: read("elites.csv"),
        metrics,
    }
}

/// `generations` of the tiny run, saved after every one, never interrupted.
fn uninterrupted(sandbox: &Sandbox, generations: u64) -> Result {
    let out = format!("whole-{generations}");
    let run = format!("evolve -q -c tiny.toml {EVERY_GENERATION} -g {generations} -o {out}");
    sandbox.run(&run).ended(0, &[]);
    result(sandbox, &out)
}

/// A folder with the first six generations of twelve, with two checkpoints; made once.
fn half_way() -> &'static BTreeMap<String, Vec<u8>> {
    static HALF: OnceLock<BTreeMap<String, Vec<u8>>> = OnceLock::new();
    HALF.get_or_init(|| {
        let sandbox = Sandbox::tiny();
        sandbox
            .run(&format!(
                "evolve -q -c tiny.toml {EVERY_GENERATION} -g 6 -o run"
            ))
            .ended(0, &[]);
        files(&sandbox.path("run"))
    })
}

fn sandbox_half_way() -> Sandbox {
    let sandbox = Sandbox::tiny();
    half_way().iter().for_each(|(name, content)| {
        sandbox.write(&format!("run/{name}"), content);
    });
    sandbox
}

fn resume_to_12() -> String {
    format!("evolve -c tiny.toml {EVERY_GENERATION} -g 12 -o run --resume")
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill")
        .args(["-s", name, &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
}

/// Reads events until a generation is done.
fn wait_for_generation(events: &mut impl BufRead, wanted: u64) {
    let mut line = String::new();
    while events.read_line(&mut line).unwrap() > 0 {
        let event: serde_json::Value = serde_json::from_str(&line).unwrap();
        if event["event"] == "generation" && event["generation"].as_u64() >= Some(wanted) {
            return;
        }
        line.clear();
    }
    panic!("it ended before generation {wanted}");
}

#[test]
fn a_run_stopped_by_a_signal_ends_with_75_and_goes_on_to_the_same_bytes() {
    let sandbox = Sandbox::tiny();
    let expected = uninterrupted(&sandbox, 60);
    for name in ["INT", "TERM", "USR1"] {
        let run = format!("evolve -c tiny.toml {EVERY_GENERATION} -g 60 -o {name}");
        let mut child = sandbox.start(&format!("{run} --json"));
        let mut events = BufReader::new(child.stdout.take().unwrap());
        wait_for_generation(&mut events, 3);
        signal(&child, name);
        events.read_to_string(&mut String::new()).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(75), "{name}");
        let saved = sandbox.run_file(name);
        assert!(
            (3..60).contains(&saved.generations),
            "{name}: {}",
            saved.generations
        );
        sandbox.run(&format!("{run} --resume")).ended(0, &[]);
        assert_eq!(result(&sandbox, name), expected, "{name}");
    }
}

#[test]
fn a_run_killed_at_any_moments_goes_on_to_the_same_bytes() {
    let sandbox = Sandbox::tiny();
    let expected = uninterrupted(&sandbox, 40);
    let mut random = 12345u64;
    let mut kills = 0;
    loop {
        let mut child = Command::new(PROGRAM)
            .current_dir(sandbox.path(""))
            .args(
                format!("evolve -q -c tiny.toml {EVERY_GENERATION} -g 40 -o run --resume")
                    .split(' '),
            )
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // Long enough for some generations in the end, however slow the machine is at the moment.
        random = random
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        std::thread::sleep(Duration::from_micros(
            (random >> 33) % (20_000 + 3_000 * kills),
        ));
        child.kill().unwrap();
        let ended = child.wait_with_output().unwrap();
        assert!(
            ended.stderr.is_empty(),
            "{}",
            String::from_utf8_lossy(&ended.stderr)
        );
        if ended.status.success() {
            break;
        }
        assert_eq!(ended.status.code(), None, "{ended:?}");
        kills += 1;
        let saved = sandbox.path("run/run.json");
        if saved.exists() {
            RunFile::read(&saved).expect("run.json is whole at any moment");
        }
        assert!(kills < 400, "it does not get on");
    }
    println!("killed {kills} times");
    assert!(kills >= 3, "killed {kills} times only");
    assert_eq!(result(&sandbox, "run"), expected);
    // What was half-written when the run was killed is not left lying about.
    let left: Vec<String> = files(&sandbox.path("run")).into_keys().collect();
    let own = [
        ".lock",
        "checkpoint.json",
        "checkpoint.previous.json",
        "config.toml",
        "elites.csv",
    ];
    assert_eq!(left, [&own[..], &["metrics.csv", "run.json"]].concat());
}

#[test]
fn a_broken_newest_checkpoint_is_passed_over_with_a_warning_and_the_end_is_the_same() {
    let expected = uninterrupted(&Sandbox::tiny(), 12);
    let newest = &half_way()["checkpoint.json"];
    let flipped = |at: usize| {
        let mut bytes = newest.clone();
        bytes[at] ^= 1;
        bytes
    };
    let broken = [
        newest[..newest.len() / 2].to_vec(),
        newest[..newest.len() - 3].to_vec(),
        newest[..10].to_vec(),
        Vec::new(),
        b"no checkpoint at all\n".to_vec(),
        vec![0; newest.len()],
        vec![0xff; 5000],
        flipped(3),
        flipped(newest.len() / 2),
        flipped(newest.len() - 5),
    ];
    for (number, content) in broken.iter().enumerate() {
        let sandbox = sandbox_half_way();
        sandbox.write("run/checkpoint.json", content);
        sandbox
            .run(&resume_to_12())
            .ended(0, &["warning:", "checkpoint.json"]);
        assert_eq!(result(&sandbox, "run"), expected, "{number}");
    }
    // A newest checkpoint that is missing (killed between the two renames) is no fault at all.
    let sandbox = sandbox_half_way();
    std::fs::remove_file(sandbox.path("run/checkpoint.json")).unwrap();
    let said = sandbox.run(&resume_to_12()).ended(0, &[]);
    assert!(!said.err.contains("warning"), "{}", said.err);
    assert_eq!(result(&sandbox, "run"), expected);
}

#[test]
fn when_both_checkpoints_are_broken_it_says_so_and_destroys_nothing() {
    let sandbox = sandbox_half_way();
    for name in ["checkpoint.json", "checkpoint.previous.json"] {
        sandbox.write(&format!("run/{name}"), &half_way()[name][..200]);
    }
    let before = files(&sandbox.path("run"));
    let said = sandbox
        .run(&resume_to_12())
        .ended(3, &["run/checkpoint", "run.json"]);
    // It would cost what can still be gone on with.
    assert!(!said.err.contains("--force"), "{}", said.err);
    assert_eq!(files(&sandbox.path("run")), before);
    // Without a whole run.json there is nothing to go on from.
    let run = sandbox.read("run/run.json");
    sandbox.write("run/run.json", &run[..200]);
    sandbox
        .run(&resume_to_12())
        .ended(3, &["run/checkpoint", "--force"]);
    sandbox.write("run/run.json", run);
    // What the hint says is what helps.
    remove_checkpoints(&sandbox);
    sandbox
        .run(&resume_to_12())
        .ended(0, &["warning:", "run.json"]);
    assert_eq!(sandbox.run_file("run").generations, 12);
}

/// A folder with six generations of twelve and without checkpoints.
fn without_checkpoints() -> Sandbox {
    let sandbox = sandbox_half_way();
    remove_checkpoints(&sandbox);
    sandbox
}

fn remove_checkpoints(sandbox: &Sandbox) {
    for name in ["checkpoint.json", "checkpoint.previous.json"] {
        std::fs::remove_file(sandbox.path("run").join(name)).unwrap();
    }
}

#[test]
fn a_run_json_alone_is_gone_on_from_with_a_warning_and_the_elites_are_the_same() {
    let sandbox = without_checkpoints();
    sandbox
        .run(&resume_to_12())
        .ended(0, &["warning:", "run.json", "metrics.csv"]);
    let (done, whole) = (result(&sandbox, "run"), uninterrupted(&sandbox, 12));
    assert_eq!((done.run, done.elites), (whole.run, whole.elites));
    // What is counted begins anew, what is measured does not.
    let measured = |line: &String| line.split(',').take(7).collect::<Vec<_>>().join(",");
    let [done, whole] =
        [done.metrics, whole.metrics].map(|all| all.iter().map(measured).collect::<Vec<_>>());
    assert_eq!(done, whole);
    // From now on it has checkpoints.
    let said = sandbox.run(&resume_to_12()).ended(0, &[]);
    assert!(!said.err.contains("warning:"), "{}", said.err);
}

#[test]
fn without_a_checkpoint_a_broken_run_json_is_an_error_and_stays() {
    let sandbox = without_checkpoints();
    let whole = sandbox.read("run/run.json");
    sandbox.write("run/run.json", &whole[..whole.len() / 2]);
    let before = files(&sandbox.path("run"));
    sandbox.run(&resume_to_12()).ended(3, &["run/run.json:"]);
    assert_eq!(files(&sandbox.path("run")), before);
}

#[test]
fn the_run_of_a_training_is_not_evolved_further() {
    let sandbox = without_checkpoints();
    let origin = r#""origin":{"name":"gaits","generations":9,"sha256":"0","trained_on":[]},"generations":6,"stats""#;
    let trained = sandbox
        .read("run/run.json")
        .replace(r#""generations":6,"stats""#, origin);
    assert!(trained.contains(origin));
    sandbox.write("run/run.json", trained);
    let before = files(&sandbox.path("run"));
    sandbox
        .run(&resume_to_12())
        .ended(3, &["run.json", "training", "--force"]);
    assert_eq!(files(&sandbox.path("run")), before);
}

#[test]
fn a_run_of_gaits_is_not_gone_on_with_without_a_checkpoint() {
    let sandbox = Sandbox::new();
    sandbox.write("gaits.toml", gaits());
    let run = "evolve -q -c gaits.toml -g 2 -o run";
    sandbox.run(run).ended(0, &[]);
    remove_checkpoints(&sandbox);
    let before = files(&sandbox.path("run"));
    let said = sandbox.run(&format!("{run} --resume"));
    said.ended(3, &["run.json", "fitness = response", "--force"]);
    assert_eq!(files(&sandbox.path("run")), before);
}

#[test]
fn resuming_with_more_generations_equals_the_long_run() {
    let sandbox = sandbox_half_way();
    sandbox.run(&resume_to_12()).ended(0, &[]);
    assert_eq!(result(&sandbox, "run"), uninterrupted(&sandbox, 12));
    // A finished run has nothing to go on with, and stays as it is.
    sandbox.run(&resume_to_12()).ended(0, &[]);
    assert_eq!(result(&sandbox, "run"), uninterrupted(&Sandbox::tiny(), 12));
}

#[test]
fn resuming_with_fewer_generations_than_are_done_is_refused() {
    let sandbox = sandbox_half_way();
    let before = files(&sandbox.path("run"));
    sandbox
        .run("evolve -c tiny.toml -g 5 -o run --resume")
        .ended(3, &["generations = 5", "6"]);
    assert_eq!(files(&sandbox.path("run")), before);
}

#[test]
fn resuming_with_another_config_is_refused_naming_the_key() {
    let sandbox = sandbox_half_way();
    let before = files(&sandbox.path("run"));
    for (change, key) in [
        ("seed=4", "seed"),
        ("body.height=6", "body.height"),
        ("body.min_muscles=2", "body.min_muscles"),
        ("task.groups=[[1],[0]]", "task.groups"),
        ("data.train_images=[0,11]", "data.train_images"),
        ("data.builtin.seed=2", "data.builtin.seed"),
        ("data.images_per_class=2", "data.images_per_class"),
        ("stimulus.encoding=saturated", "stimulus.encoding"),
        ("protocol.rollout=sequential", "protocol.rollout"),
        ("protocol.control_steps=21", "protocol.control_steps"),
        ("map_elites.parents=9", "map_elites.parents"),
        ("archive.qd_offset=1", "archive.qd_offset"),
        ("genome.weight_sigma=0.4", "genome.weight_sigma"),
        ("physics.gravity=100", "physics.gravity"),
    ] {
        let run = format!("evolve -c tiny.toml -g 12 -o run --resume --set {change}");
        sandbox
            .run(&run)
            .ended(3, &[&format!("{key} = "), "--force"]);
        assert_eq!(files(&sandbox.path("run")), before, "{change}");
    }
    // Keys that one config has and the other has not.
    sandbox.write("drawn.toml", TINY.replace("train_images = [0, 1]\n", ""));
    let said = sandbox.run("evolve -c drawn.toml -g 12 -o run --resume");
    said.ended(3, &["data.train_images"]);
    sandbox.write(
        "splits.toml",
        TINY.replace("groups = [[0], [1]]", "splits = [0, 1]"),
    );
    sandbox
        .run("evolve -c splits.toml -g 12 -o run --resume")
        .ended(3, &["task.groups"]);
    assert_eq!(files(&sandbox.path("run")), before);
    // What changes no result may change.
    let other = "--set checkpoint.seconds=1 --set savings.early_stop=false --threads 1";
    sandbox
        .run(&format!("{} {other}", resume_to_12()))
        .ended(0, &[]);
    sandbox
        .run("evolve -q -c tiny.toml -g 12 -o whole")
        .ended(0, &[]);
    assert_eq!(
        sandbox.run_file("run").elites,
        sandbox.run_file("whole").elites
    );
}

#[test]
fn a_run_of_another_version_of_the_program_is_not_gone_on_with() {
    let sandbox = sandbox_half_way();
    let version = format!("\"program_version\":\"{}\"", env!("CARGO_PKG_VERSION"));
    let [newest, previous] = ["run/checkpoint.json", "run/checkpoint.previous.json"];
    let saved = sandbox.read(newest);
    assert!(saved.contains(&version));
    let (_, content) = saved.split_once('\n').unwrap();
    let content = content.replace(&version, "\"program_version\":\"0.0.9\"");
    sandbox.write(
        newest,
        format!("{}\n{content}", sha256_hex(content.trim_end().as_bytes())),
    );
    if sandbox.path(previous).exists() {
        std::fs::remove_file(sandbox.path(previous)).unwrap();
    }
    let before = files(&sandbox.path("run"));
    sandbox
        .run(&resume_to_12())
        .ended(3, &["morphcog 0.0.9", "--force"]);
    assert_eq!(files(&sandbox.path("run")), before);
}

/// An IDX dataset of two blank classes; `ink` is every pixel of the ones.
fn write_dataset(sandbox: &Sandbox, folder: &str, ink: u8) {
    let header = |sizes: &[u32]| {
        let magic = [0, 0, 8, sizes.len() as u8];
        [
            &magic[..],
            &sizes
                .iter()
                .flat_map(|size| size.to_be_bytes())
                .collect::<Vec<_>>(),
        ]
        .concat()
    };
    let pixels: Vec<u8> = (0..4u8)
        .flat_map(|i| [if i % 2 == 1 { ink } else { 0 }; 25])
        .collect();
    for split in ["train", "t10k"] {
        let images = [header(&[4, 5, 5]), pixels.clone()].concat();
        sandbox.write(&format!("{folder}/{split}-images-idx3-ubyte"), images);
        sandbox.write(
            &format!("{folder}/{split}-labels-idx1-ubyte"),
            [header(&[4]), vec![0, 1, 0, 1]].concat(),
        );
    }
}

#[test]
fn resuming_with_other_images_is_refused_but_the_same_images_may_lie_elsewhere() {
    let sandbox = Sandbox::new();
    write_dataset(&sandbox, "one", 255);
    write_dataset(&sandbox, "moved", 255);
    write_dataset(&sandbox, "other", 254);
    sandbox.write("own.toml", TINY.replace("\"builtin\"", "\"own\""));
    let run = "evolve -c own.toml -o run";
    sandbox.run(&format!("{run} -g 3 --data one")).ended(0, &[]);
    let before = files(&sandbox.path("run"));
    sandbox
        .run(&format!("{run} -g 6 --data other --resume"))
        .ended(3, &["dataset"]);
    assert_eq!(files(&sandbox.path("run")), before);
    sandbox
        .run(&format!("{run} -g 6 --data moved --resume"))
        .ended(0, &[]);
    sandbox
        .run("evolve -c own.toml -o whole -g 6 --data one")
        .ended(0, &[]);
    assert_eq!(result(&sandbox, "run").run, result(&sandbox, "whole").run);
}

#[test]
fn resume_in_an_absent_folder_starts_the_run() {
    let sandbox = Sandbox::tiny();
    sandbox
        .run("evolve -c tiny.toml -g 3 -o runs/new/deep --resume")
        .ended(0, &["runs/new/deep"]);
    sandbox
        .run("evolve -c tiny.toml -g 3 -o plain")
        .ended(0, &[]);
    assert_eq!(result(&sandbox, "runs/new/deep"), result(&sandbox, "plain"));
}

#[test]
fn a_folder_in_use_is_refused_with_5_and_untouched() {
    let sandbox = sandbox_half_way();
    let lock = File::options()
        .write(true)
        .open(sandbox.path("run/.lock"))
        .unwrap();
    lock.try_lock().unwrap();
    let before = files(&sandbox.path("run"));
    for option in ["--resume", "--force", ""] {
        let run = format!("evolve -c tiny.toml -g 12 -o run {option}");
        sandbox.run(&run).ended(5, &["run: "]);
        assert_eq!(files(&sandbox.path("run")), before, "{option}");
    }
    drop(lock);
    sandbox.run(&resume_to_12()).ended(0, &[]);
}

#[test]
fn two_programs_do_not_share_a_folder() {
    let sandbox = Sandbox::tiny();
    let mut first = sandbox.start("evolve -c tiny.toml -g 100000 -o run --json");
    let mut events = BufReader::new(first.stdout.take().unwrap());
    wait_for_generation(&mut events, 1);
    let second = sandbox.run("evolve -c tiny.toml -g 100000 -o run --resume");
    let third = sandbox.run("evolve -c tiny.toml -g 100000 -o run --force");
    signal(&first, "TERM");
    events.read_to_string(&mut String::new()).unwrap();
    assert_eq!(first.wait().unwrap().code(), Some(75));
    second.ended(5, &["run: "]);
    third.ended(5, &["run: "]);
    sandbox.run_file("run");
}

/// Waits until a run has saved a generation.
fn wait_until_saved(sandbox: &Sandbox, folder: &str) {
    let begin = Instant::now();
    while RunFile::read(&sandbox.path(folder).join("run.json")).map_or(0, |run| run.generations)
        == 0
    {
        assert!(
            begin.elapsed() < Duration::from_secs(60),
            "{folder}: nothing is saved"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_run_that_lost_its_folder_or_its_lock_ends_with_one_error_and_leaves_the_second_run_alone() {
    let sandbox = Sandbox::tiny();
    for (out, what, is_stopped) in [
        ("folder", "folder", false),
        ("lock", "folder/.lock", false),
        ("folder-while-stopped", "folder", true),
        ("lock-while-stopped", "folder/.lock", true),
    ] {
        let first = sandbox.endless(out);
        wait_until_saved(&sandbox, out);
        if is_stopped {
            signal(&first, "STOP");
        }
        // A run that goes on makes new files meanwhile.
        let gone = sandbox.path(&what.replace("folder", out));
        while gone.exists() {
            let _ = if gone.is_dir() {
                std::fs::remove_dir_all(&gone)
            } else {
                std::fs::remove_file(&gone)
            };
        }
        sandbox
            .run(&format!("evolve -q -c tiny.toml -o {out} --force"))
            .ended(0, &[]);
        let second = files(&sandbox.path(out));
        if is_stopped {
            // As if the second were still at work.
            let holder = "{\"host\":\"another-machine\",\"process\":7,\"beats\":3}";
            std::fs::write(sandbox.path(out).join(".lock"), holder).unwrap();
            signal(&first, "CONT");
        }
        let ended = first.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(5), "{out}: {said}");
        let why = if is_stopped {
            "process 7 on another-machine has taken over"
        } else {
            "not written"
        };
        let errors = said
            .lines()
            .filter(|line| line.starts_with("error:"))
            .count();
        assert!(
            errors == 1 && said.contains(why) && said.contains(out),
            "{out}: {said}"
        );
        let mut after = files(&sandbox.path(out));
        after.insert(".lock".to_string(), second[".lock"].clone());
        assert_eq!(after, second, "{out}");
        assert_eq!(sandbox.run_file(out).generations, 12);
    }
}

#[test]
fn an_existing_run_is_replaced_by_force_only_and_foreign_files_survive() {
    let sandbox = sandbox_half_way();
    sandbox.write("run/notes.txt", "mine");
    sandbox.write("run/eval.json", "{}");
    let before = files(&sandbox.path("run"));
    sandbox
        .run("evolve -c tiny.toml -g 3 --seed 9 -o run")
        .ended(5, &["run", "--resume", "--force"]);
    assert_eq!(files(&sandbox.path("run")), before);
    sandbox
        .run("evolve -c tiny.toml -g 3 --seed 9 -o run --force")
        .ended(0, &[]);
    assert_eq!(
        (
            sandbox.run_file("run").config.seed,
            sandbox.run_file("run").generations
        ),
        (9, 3)
    );
    assert_eq!(
        (
            sandbox.read("run/notes.txt").as_str(),
            sandbox.read("run/eval.json").as_str()
        ),
        ("mine", "{}")
    );
    sandbox
        .run("evolve -c tiny.toml -g 3 --seed 9 -o plain")
        .ended(0, &[]);
    assert_eq!(result(&sandbox, "run"), result(&sandbox, "plain"));
}

#[test]
fn force_keeps_the_old_run_if_the_new_one_cannot_even_begin() {
    let sandbox = sandbox_half_way();
    let before = files(&sandbox.path("run"));
    for wrong in [
        "--set data.train_images=[0]",
        "--set data.dataset=mnist",
        "-g 0",
        "--set body.width=65",
    ] {
        let said = sandbox.run(&format!("evolve -c tiny.toml -o run --force {wrong}"));
        assert!(matches!(said.code, Some(2 | 3)), "{said:?}");
        assert_eq!(files(&sandbox.path("run")), before, "{wrong}");
    }
}

#[test]
fn a_second_sigint_ends_at_once_with_130_and_the_run_can_still_be_resumed() {
    let sandbox = Sandbox::tiny();
    let run = format!("evolve -c tiny.toml -g 40 {EVERY_GENERATION}");
    sandbox.run(&format!("{run} -q -o whole")).ended(0, &[]);
    let mut ended = None;
    for attempt in 0..30 {
        let out = format!("{run} -o run-{attempt}");
        let mut child = sandbox.start(&format!("{out} --json"));
        let mut events = BufReader::new(child.stdout.take().unwrap());
        wait_for_generation(&mut events, 2);
        // Two of a kind that are both still pending are one. Between the two a run has little to
        // do: it saves.
        let twice = format!(
            "kill -s INT {0}; sleep 0.00{1}; kill -s INT {0}",
            child.id(),
            attempt % 5
        );
        Command::new("sh")
            .args(["-c", &twice])
            .stderr(Stdio::null())
            .status()
            .unwrap();
        events.read_to_string(&mut String::new()).unwrap();
        ended = child.wait().unwrap().code();
        // 75: nothing was left to do between the two.
        assert!(matches!(ended, Some(130 | 75)), "{ended:?}");
        sandbox.run(&format!("{out} -q --resume")).ended(0, &[]);
        assert_eq!(
            result(&sandbox, &format!("run-{attempt}")),
            result(&sandbox, "whole")
        );
        if ended == Some(130) {
            break;
        }
    }
    assert_eq!(ended, Some(130));
}

#[test]
fn a_first_sigint_after_another_signal_still_lets_the_run_be_saved() {
    let sandbox = Sandbox::tiny();
    let slow = "--set protocol.control_steps=500 --set savings.known_bodies=false --set savings.early_stop=false";
    for other in ["USR1", "TERM"] {
        let ends = (0..10).map(|attempt| {
            let out = format!("{other}-{attempt}");
            let run = format!(
                "evolve -c tiny.toml -g 400 {EVERY_GENERATION} {slow} --threads 1 -o {out}"
            );
            let mut child = sandbox.start(&format!("{run} --json"));
            let mut events = BufReader::new(child.stdout.take().unwrap());
            wait_for_generation(&mut events, 1);
            std::thread::sleep(Duration::from_millis(60));
            signal(&child, other);
            std::thread::sleep(Duration::from_millis(25));
            signal(&child, "INT");
            events.read_to_string(&mut String::new()).unwrap();
            let code = child.wait().unwrap().code();
            assert!(sandbox.run_file(&out).generations >= 1);
            code
        });
        // Without a code: the run was saved within those 25 milliseconds, and the signal met its end.
        let ended = ends.into_iter().find(Option::is_some).flatten();
        assert_eq!(ended, Some(75), "{other}");
    }
}
