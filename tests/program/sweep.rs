//! Sweeps: every combination once, the same bytes however and wherever its tasks are done, and clear
//! words on what is wrong.

use crate::common::program::{Made, PROGRAM, SETTINGS, Sandbox, TINY, files, said};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

const PLAN: &str = r#"
config = "tiny.toml"
seeds = [1, 2]

[vary]
map_elites.parents = [4, 8]

[audit.criteria]
least_walk = 0.0
threshold = 0.0

[eval]
robots = "top:2"
images = 4
"#;

const TASKS: [&str; 4] = [
    "tiny-parents=4-seed1",
    "tiny-parents=4-seed2",
    "tiny-parents=8-seed1",
    "tiny-parents=8-seed2",
];

fn sandbox() -> Sandbox {
    let sandbox = Sandbox::tiny();
    sandbox.write("plan.toml", PLAN);
    sandbox
}

/// The same with all of the plan done in `all`, two tasks at a time.
fn swept() -> Sandbox {
    static SWEPT: OnceLock<Made> = OnceLock::new();
    Sandbox::once(&SWEPT, |sandbox| {
        sandbox.write("tiny.toml", TINY);
        sandbox.write("plan.toml", PLAN);
        sandbox
            .run("sweep plan.toml --out all --jobs 2 --threads 2")
            .ended(0, &["task 4", "4 of 4"]);
    })
}

/// What does not depend on the clock, of every task.
fn results(sandbox: &Sandbox, out: &str) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for task in TASKS {
        for (name, content) in files(&sandbox.path(&format!("{out}/{task}"))) {
            if ["run.json", "elites.csv", "audit.json", "eval.json"].contains(&name.as_str()) {
                all.insert(format!("{task}/{name}"), content);
            }
        }
    }
    all
}

/// The states of all tasks.
fn states(sandbox: &Sandbox, out: &str) -> Vec<String> {
    let said = sandbox
        .run(&format!("sweep plan.toml --out {out} --status --json"))
        .ended(0, &[]);
    said.json_lines()
        .iter()
        .map(|line| line["state"].as_str().unwrap().to_string())
        .collect()
}

#[test]
fn every_combination_is_run_and_a_second_call_has_nothing_left_to_do() {
    let sandbox = swept();
    assert_eq!(states(&sandbox, "none"), ["waiting"; 4]);
    let all = results(&sandbox, "all");
    assert_eq!(all.len(), 4 * 4, "{:?}", all.keys());
    assert_eq!(states(&sandbox, "all"), ["done"; 4]);
    let run = sandbox.run_file("all/tiny-parents=4-seed2");
    assert_eq!((run.config.seed, run.config.map_elites.parents), (2, 4));
    let before = files(&sandbox.path("all").join(TASKS[0]));
    let said = sandbox.run("sweep plan.toml --out all").ended(0, &[]);
    assert!(!said.err.contains("task 1"), "{said:?}");
    assert_eq!(files(&sandbox.path("all").join(TASKS[0])), before);
    // The same as a run of one's own.
    sandbox
        .run("evolve -q -c tiny.toml --seed 2 --set map_elites.parents=4 -o own")
        .ended(0, &[]);
    assert_eq!(
        sandbox.read("own/run.json").as_bytes(),
        all["tiny-parents=4-seed2/run.json"]
    );
}

#[test]
fn tasks_done_one_by_one_or_killed_at_any_moment_make_the_same_bytes() {
    let sandbox = swept();
    let all = results(&sandbox, "all");
    // By number, and by the numbers of engines.
    sandbox
        .run("sweep plan.toml --out alone --task 2 --threads 1")
        .ended(0, &[]);
    for (name, number) in [
        ("SLURM_ARRAY_TASK_ID", "1"),
        ("HQ_TASK_ID", "3"),
        ("PBS_ARRAY_INDEX", "4"),
    ] {
        let mut command = sandbox.command("sweep plan.toml --out alone --task".split(' '));
        command.env(name, number);
        let ended = said(command).ended(0, &[]);
        assert!(ended.out.contains(&format!("task {number} ")), "{ended:?}");
    }
    assert_eq!(results(&sandbox, "alone"), all);
    // Killed, again and again.
    let mut pause = Duration::from_millis(20);
    for _ in 0..6 {
        let mut child = sandbox.start("sweep plan.toml --out killed -q");
        std::thread::sleep(pause);
        child.kill().unwrap();
        child.wait().unwrap();
        pause += Duration::from_millis(35);
    }
    sandbox.run("sweep plan.toml --out killed -q").ended(0, &[]);
    assert_eq!(results(&sandbox, "killed"), all);
}

#[test]
fn listed_commands_do_the_tasks_from_any_folder() {
    let sandbox = swept();
    let list = sandbox
        .run("sweep plan.toml --out elsewhere --list")
        .ended(0, &[])
        .out;
    assert_eq!(list.lines().count(), 4);
    let away = tempfile::tempdir().unwrap();
    for line in list.lines() {
        assert!(line.starts_with(PROGRAM), "{line}");
        let mut command = std::process::Command::new("sh");
        command.current_dir(away.path()).args(["-c", line]);
        SETTINGS.iter().for_each(|name| {
            command.env_remove(name);
        });
        let output = command.output().unwrap();
        assert!(output.status.success(), "{line}: {output:?}");
    }
    assert_eq!(results(&sandbox, "elsewhere"), results(&sandbox, "all"));
    assert_eq!(std::fs::read_dir(away.path()).unwrap().count(), 0);
    let script = sandbox
        .run("sweep plan.toml --out elsewhere --slurm")
        .ended(0, &[])
        .out;
    assert!(
        script.starts_with("#!/bin/bash\n") && script.contains("#SBATCH --array=1-4\n"),
        "{script}"
    );
    assert!(
        script.contains("--requeue") && script.contains("--task \"$number\" &"),
        "{script}"
    );
}

#[test]
fn what_is_wrong_is_said_all_at_once_before_anything_starts() {
    let sandbox = sandbox();
    sandbox
        .run("sweep plan.toml --set seeds=[1,1]")
        .ended(3, &["--set seeds=[1,1]: seeds"]);
    sandbox.write(
        "bad.toml",
        PLAN.replace("[4, 8]", "[0, 8]\ngenerations = [0, 5]"),
    );
    let said = sandbox.run("sweep bad.toml").ended(
        3,
        &[
            "--set generations=0: bad.toml: task 1 (tiny-generations=0-parents=0-seed1) and 3 more: ",
            "--set map_elites.parents=0: bad.toml: task 5 (tiny-generations=5-parents=0-seed1) and 1 more: ",
        ],
    );
    assert_eq!(said.err.matches("error:").count(), 2, "{}", said.err);
    sandbox
        .run("sweep plan.toml --set set=[\"seed=3\"]")
        .ended(3, &["set: seed: "]);
    let mnist = "sweep plan.toml --set set=[\"data.dataset=mnist\"]";
    let said = sandbox
        .run(mnist)
        .ended(3, &["data/mnist", "data fetch mnist"]);
    assert_eq!(
        said.err.matches("error:").count() + said.err.matches("warning:").count(),
        1,
        "{}",
        said.err
    );
    sandbox.write("typo.toml", PLAN.replace("seeds", "seed"));
    sandbox
        .run("sweep typo.toml")
        .ended(3, &["typo.toml:3", "seed"]);
    sandbox
        .run("sweep plan.toml --task 5")
        .ended(2, &["--task 5", "1 to 4"]);
    sandbox
        .run("sweep plan.toml --task")
        .ended(2, &["HQ_TASK_ID, SLURM_ARRAY_TASK_ID, PBS_ARRAY_INDEX"]);
    sandbox
        .run("sweep plan.toml --task 1 --list")
        .ended(2, &["--list"]);
    assert!(!sandbox.path("runs").exists());
}

#[test]
fn a_changed_plan_keeps_what_is_done_and_refuses_other_settings_with_their_keys() {
    let sandbox = swept();
    let before = results(&sandbox, "all");
    // More seeds, and another order: names stay, numbers do not.
    sandbox.write(
        "plan.toml",
        PLAN.replace("[1, 2]", "[5, 2, 1]")
            .replace("[4, 8]", "[8, 4]"),
    );
    let said = sandbox
        .run("sweep plan.toml --out all")
        .ended(0, &["6 of 6"]);
    assert!(
        !said.err.contains("seed1)") && said.err.contains("tiny-parents=4-seed5"),
        "{}",
        said.err
    );
    assert_eq!(results(&sandbox, "all"), before);
    // More generations go on; another step is done.
    sandbox.write(
        "plan.toml",
        PLAN.replace("\nseeds", "\nset = [\"generations=20\"]\nseeds"),
    );
    assert_eq!(states(&sandbox, "all"), ["stopped"; 4]);
    sandbox
        .run("sweep plan.toml --out all -q --task 1")
        .ended(0, &[]);
    assert_eq!(
        sandbox.run_file(&format!("all/{}", TASKS[0])).generations,
        20
    );
    // Other bodies are other runs.
    let other = PLAN.replace(
        "\nseeds",
        "\nset = [\"body.height=4\", \"task.groups=[[0],[7]]\"]\nseeds",
    );
    sandbox.write("plan.toml", other);
    let before = results(&sandbox, "all");
    let said = sandbox.run("sweep plan.toml --out all").ended(
        3,
        &[
            "task 1 (tiny-parents=4-seed1): ",
            "body.height = 5",
            "task.groups = [[0], [1]]",
            "task 4",
        ],
    );
    assert_eq!(said.err.matches("error:").count(), 4, "{}", said.err);
    assert_eq!(results(&sandbox, "all"), before);
}

#[test]
fn a_test_of_physical_robots_is_done_again_if_others_are_physical_now() {
    let sandbox = sandbox();
    let plan = PLAN.replace("[1, 2]", "[1]").replace("[4, 8]", "[4]");
    sandbox.write("plan.toml", plan.split("[eval]").next().unwrap());
    sandbox.run("sweep plan.toml --out all -q").ended(0, &[]);
    // Verdicts as they might be.
    let path = "all/tiny-parents=4-seed1/audit.json";
    let judged = |ids: &[String]| {
        let mut audit: serde_json::Value = serde_json::from_str(&sandbox.read(path)).unwrap();
        for robot in audit["robots"].as_array_mut().unwrap() {
            let is_physical = ids.iter().any(|id| robot["id"] == id.as_str());
            robot["verdict"] = if is_physical { "physical" } else { "fragile" }.into();
        }
        sandbox.write(path, audit.to_string());
    };
    sandbox.write(
        "plan.toml",
        plan.replace("images = 4", "images = 4\nphysical_only = true"),
    );
    let tested = || {
        sandbox.run("sweep plan.toml --out all -q").ended(0, &[]);
        let text = sandbox.read("all/tiny-parents=4-seed1/eval.json");
        let eval: serde_json::Value = serde_json::from_str(&text).unwrap();
        let robots = eval["robots"].as_array().unwrap().iter();
        robots
            .map(|robot| robot["id"].as_str().unwrap().to_string())
            .collect::<Vec<_>>()
    };
    let robots = sandbox.run_file("all/tiny-parents=4-seed1").elites;
    let ids: Vec<String> = robots.into_iter().take(4).map(|robot| robot.id).collect();
    judged(&ids[..2]);
    let mut before = tested();
    before.sort_by_key(|id| ids.iter().position(|other| other == id));
    assert_eq!(before, ids[..2]);
    judged(&ids[1..3]);
    // Something is still to do, as after a kill.
    let task = "all/tiny-parents=4-seed1/task.json";
    sandbox.write(task, sandbox.read(task).replace("\"done\"", "\"stopped\""));
    let mut after = tested();
    after.sort_by_key(|id| ids.iter().position(|other| other == id));
    assert_eq!(after, ids[1..3]);
}

#[test]
fn a_task_that_fails_does_not_stop_the_others_and_is_tried_again() {
    let sandbox = swept();
    let broken = sandbox.path("all").join(TASKS[1]);
    TASKS[1..3]
        .iter()
        .for_each(|task| std::fs::remove_dir_all(sandbox.path("all").join(task)).unwrap());
    sandbox.write(&format!("all/{}/run.json", TASKS[1]), "{}");
    assert_eq!(states(&sandbox, "all")[2..], ["waiting", "done"]);
    let said = sandbox
        .run("sweep plan.toml --out all")
        .ended(1, &["task 2"]);
    assert!(
        !said.err.contains("--force"),
        "hints are those of a sweep: {}",
        said.err
    );
    assert_eq!(states(&sandbox, "all"), ["done", "failed", "done", "done"]);
    sandbox
        .run("sweep plan.toml --out all --task 2")
        .ended(3, &[]);
    std::fs::remove_file(broken.join("run.json")).unwrap();
    sandbox.run("sweep plan.toml --out all -q").ended(0, &[]);
    assert_eq!(states(&sandbox, "all"), ["done"; 4]);
}

/// Waits until a file is there.
fn wait_for(path: &Path) {
    let begin = Instant::now();
    while !path.exists() {
        assert!(
            begin.elapsed() < Duration::from_secs(60),
            "{}",
            path.display()
        );
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_task_is_one_process_s_and_a_stopped_one_says_so() {
    let sandbox = sandbox();
    sandbox.write(
        "plan.toml",
        PLAN.replace("\nseeds", "\nset = [\"generations=1000000\"]\nseeds"),
    );
    let task = |number: u32| format!("sweep plan.toml --out all --task {number}");
    let mut first = sandbox.start(&task(1));
    wait_for(&sandbox.path("all").join(TASKS[0]).join("task.json"));
    sandbox.run(&task(1)).ended(5, &[&first.id().to_string()]);
    assert_eq!(
        states(&sandbox, "all"),
        ["running", "waiting", "waiting", "waiting"]
    );
    first.kill().unwrap();
    first.wait().unwrap();
    assert_eq!(
        states(&sandbox, "all"),
        ["stopped", "waiting", "waiting", "waiting"]
    );
    for number in [1, 2] {
        let mut child = sandbox.start(&task(number));
        let until = Instant::now() + Duration::from_secs(60);
        while states(&sandbox, "all")[number as usize - 1] != "running" {
            assert!(Instant::now() < until, "task {number} does not begin");
        }
        crate::common::program::terminate(&child);
        let ended = child.wait().unwrap();
        assert_eq!(ended.code(), Some(75));
    }
    assert_eq!(
        states(&sandbox, "all"),
        ["stopped", "stopped", "waiting", "waiting"]
    );
    // All of them at once, too.
    let mut child = sandbox.start("sweep plan.toml --out all");
    std::thread::sleep(Duration::from_millis(300));
    crate::common::program::terminate(&child);
    assert_eq!(child.wait().unwrap().code(), Some(75));
}

#[test]
fn a_task_whose_lock_is_lost_ends_with_an_error_and_leaves_the_folder_alone() {
    let sandbox = sandbox();
    sandbox.write(
        "plan.toml",
        PLAN.replace("\nseeds", "\nset = [\"generations=1000000\"]\nseeds"),
    );
    let folder = sandbox.path("all").join(TASKS[0]);
    for (command, code) in [
        ("sweep plan.toml --out all --task 1", 5),
        ("sweep plan.toml --out all -q --jobs 1", 1),
    ] {
        let mut child = sandbox.start(command);
        wait_for(&folder.join("run.json"));
        std::fs::remove_file(folder.join(".task.lock")).unwrap();
        if command.ends_with("--jobs 1") {
            // The other tasks go on.
            let until = Instant::now() + Duration::from_secs(60);
            while !sandbox.path("all").join(TASKS[1]).join("run.json").exists() {
                assert!(Instant::now() < until, "the next task does not begin");
            }
            crate::common::program::terminate(&child);
        }
        let before = files(&folder);
        let mut said = String::new();
        child
            .stderr
            .take()
            .unwrap()
            .read_to_string(&mut said)
            .unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(code), "{said}");
        assert_eq!(said.matches("not written").count(), 1, "{said}");
        assert_eq!(files(&folder)["task.json"], before["task.json"]);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}

#[test]
fn what_was_found_is_collected_in_one_table_and_figures() {
    let sandbox = swept();
    let part = sandbox.path("all").join(TASKS[0]);
    files(&part).iter().for_each(|(name, content)| {
        sandbox.write(&format!("part/{}/{name}", TASKS[0]), content);
    });
    let said = sandbox
        .run("sweep plan.toml --out part --collect")
        .ended(0, &["3 waiting"]);
    assert!(said.out.contains("sweep.csv"), "{said:?}");
    let said = sandbox
        .run("sweep plan.toml --out all --collect")
        .ended(0, &[]);
    assert!(!said.err.contains("warning"), "{}", said.err);
    let table = sandbox.read("all/sweep.csv");
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    let rows: Vec<BTreeMap<String, String>> =
        reader.deserialize().collect::<Result<_, _>>().unwrap();
    assert_eq!(rows.len(), 4);
    for (row, task) in rows.iter().zip(TASKS) {
        let eval: serde_json::Value =
            serde_json::from_str(&sandbox.read(&format!("all/{task}/eval.json"))).unwrap();
        assert_eq!(
            (
                row["name"].as_str(),
                row["state"].as_str(),
                row["recognises"].as_str()
            ),
            (task, "done", "0|1")
        );
        let accuracy: f64 = row["accuracy"].parse().unwrap();
        assert_eq!(accuracy, eval["means"]["0|1"]["accuracy"].as_f64().unwrap());
        let run = sandbox.run_file(&format!("all/{task}"));
        assert_eq!(
            row["varied_map_elites.parents"],
            run.config.map_elites.parents.to_string()
        );
        assert_eq!(row["varied_seed"], run.config.seed.to_string());
        assert_eq!(row["num_elites"], run.elites.len().to_string());
        assert_eq!(row["audited"], run.elites.len().to_string());
    }
    // Two settings are two lines, each of two seeds.
    for figure in ["sweep-accuracy.svg", "sweep-progress.svg"] {
        let text = sandbox.read(&format!("all/{figure}"));
        assert!(
            text.contains("parents=4") && text.contains("parents=8"),
            "{figure}"
        );
    }
    assert!(sandbox.read("all/sweep-progress.svg").contains("2 seeds"));
    // What is of another state of a run is left out, and the rest is there.
    let before = sandbox.read("all/tiny-parents=4-seed1/run.json");
    sandbox
        .run("evolve -q -c all/tiny-parents=4-seed1/config.toml -o all/tiny-parents=4-seed1 --resume -g 30");
    assert_ne!(sandbox.read("all/tiny-parents=4-seed1/run.json"), before);
    sandbox
        .run("sweep plan.toml --out all --collect")
        .ended(0, &["seed1/audit.json", "seed1/eval.json"]);
    let table = sandbox.read("all/sweep.csv");
    assert_eq!(table.lines().count(), 5);
    // So they are in plot.
    let archives = TASKS.map(|task| format!("all/{task}")).join(" ");
    let said = sandbox
        .run(&format!("plot progress -a {archives} -o together.svg"))
        .ended(0, &[]);
    assert!(said.out.contains("map_elites.parents"), "{}", said.out);
    assert!(sandbox.read("together.svg").contains("parents=4 (2 seeds)"));
}

#[test]
fn trainings_are_swept_over_pairs_of_classes() {
    let sandbox = Sandbox::new();
    sandbox.write("run.toml", TINY);
    sandbox
        .run("evolve -q -c run.toml -o gaits/walkers")
        .ended(0, &[]);
    let plan = r#"
archive = "../gaits/walkers"
robots = "top:2"
pairs = [3, 1, 4]
set = ["train.random_images=20", "train.rounds=1", "train.images=4", "train.final_images=4",
       "train.challengers=2", "validation.images=40", "validation.best=0"]

[audit]

[eval]
images = 4
split = "validation"
"#;
    sandbox.write("plans/pairs.toml", plan);
    sandbox.write(
        "plans/validated.toml",
        plan.replace("validation.best=0", "validation.best=1"),
    );
    sandbox
        .run("sweep plans/pairs.toml --out pairs")
        .ended(0, &["3 of 3"]);
    for (task, name) in [
        ("1|3", "walkers-1v3-seed3"),
        ("3|4", "walkers-3v4-seed3"),
        ("1|4", "walkers-1v4-seed3"),
    ] {
        let run = sandbox.run_file(&format!("pairs/{name}"));
        assert_eq!(run.elites[0].task, task);
        for file in ["audit.json", "eval-validation.json"] {
            assert!(
                sandbox.path(&format!("pairs/{name}/{file}")).exists(),
                "{name}/{file}"
            );
        }
        assert!(
            !sandbox
                .path(&format!("pairs/{name}/validation.json"))
                .exists()
        );
    }
    let said = sandbox
        .run("sweep plans/pairs.toml --out pairs --collect")
        .ended(0, &[]);
    assert!(
        said.out.contains("1|3") && said.out.contains("validation"),
        "{}",
        said.out
    );
    // The robot that a training made is shown other images where the plan says so.
    sandbox
        .run("sweep plans/validated.toml --out validated --task 1")
        .ended(0, &[]);
    assert!(
        sandbox
            .path("validated/walkers-1v3-seed3/validation.json")
            .exists()
    );
    // One that is stopped says so, and goes on.
    let one = "sweep plans/pairs.toml --out one --task 1";
    let mut child = sandbox.start(&format!(
        "{one} --set set=[\"train.random_images=20\",\"train.challengers=1000000\"]"
    ));
    wait_for(&sandbox.path("one/walkers-1v3-seed3/training.json"));
    crate::common::program::terminate(&child);
    assert_eq!(child.wait().unwrap().code(), Some(75));
    let task: serde_json::Value =
        serde_json::from_str(&sandbox.read("one/walkers-1v3-seed3/task.json")).unwrap();
    assert_eq!(task["state"], "stopped");
    // Which classes there are, only the images tell.
    sandbox
        .run("sweep plans/pairs.toml --out pairs --set pairs=[1,12]")
        .ended(3, &["task 1 (walkers-1v12,-seed3)", "class 12"]);
}

#[test]
fn the_runs_of_a_reproduction_are_tasks_of_the_same_kind() {
    let sandbox = Sandbox::tiny();
    let plan = "seeds = [1, 2]\nrobots = 2\nimages = 4\n[[experiment]]\nconfig = \"tiny.toml\"\n\
                [audit]\nleast_walk = 0.0\nthreshold = 0.0\n[capacity]\ntrainings = 1\nsizes = [1, 2]\n";
    sandbox.write("paper.toml", plan);
    let reproduce = |more: &str| sandbox.run(&format!("reproduce paper.toml --scale 0.5 {more}"));
    let list = reproduce("--out one --list").ended(0, &[]).out;
    assert!(
        list.lines().count() == 2 && list.contains("--scale 0.5"),
        "{list}"
    );
    reproduce("--out one --task 2").ended(0, &[]);
    assert!(
        sandbox.path("one/tiny-seed2/run.json").exists()
            && !sandbox.path("one/tiny-seed1").exists()
    );
    let status = reproduce("--out one --status").ended(0, &[]).out;
    assert!(status.contains("2 tasks: 1 done, 1 waiting"), "{status}");
    reproduce("--out one").ended(0, &[]);
    let events = reproduce("--out two --json").ended(0, &[]).json_lines();
    let reproduced = events.iter().find(|event| event["event"] == "reproduced");
    let claims = morphcog::commands::verify::claims().unwrap();
    let claim = claims.iter().find(|claim| claim.event == "reproduced");
    let first = claim.unwrap().values[0].measured(reproduced.unwrap());
    assert!(first.is_some_and(|accuracy| accuracy <= 100.0));
    assert_eq!(
        sandbox.read("one/reproduction.csv"),
        sandbox.read("two/reproduction.csv")
    );
}

/// A short plan with two tasks.
const SHORT: &str = "config = \"tiny.toml\"\nseeds = [1, 2]\nset = [\"generations=2\"]\n";

#[test]
fn runs_of_another_plan_are_no_results_of_this_one() {
    let sandbox = Sandbox::tiny();
    sandbox.write("plan.toml", SHORT);
    sandbox.run("sweep plan.toml --out all -q").ended(0, &[]);
    // One was replaced by hand.
    sandbox
        .run("evolve -q -c tiny.toml -g 2 --seed 2 --set protocol.control_steps=5 -o all/tiny-seed2 --force")
        .ended(0, &[]);
    sandbox
        .run("sweep plan.toml --out all --collect")
        .ended(0, &["protocol.control_steps = 5"]);
    let csv = sandbox.read("all/sweep.csv");
    let lines: Vec<&str> = csv.lines().collect();
    assert!(
        lines[1].contains("0|1") && !lines[2].contains("0|1"),
        "{csv}"
    );
    // The plan was changed in a key that is in no folder's name.
    sandbox.write(
        "plan.toml",
        SHORT.replace("generations=2", "protocol.control_steps=5"),
    );
    for what in ["--collect", "--status", ""] {
        let words = ["task 1 (tiny-seed1)", "protocol.control_steps = 20"];
        sandbox
            .run(&format!("sweep plan.toml --out all {what}"))
            .ended(3, &words);
    }
}

#[test]
fn what_a_later_step_lacks_is_said_before_the_first_task_begins() {
    let sandbox = Sandbox::tiny();
    for (more, words) in [
        (
            "[eval]\nimages = 100000",
            &["task 1 (tiny-seed1)", "eval.images = 100000", "class 0"][..],
        ),
        ("[eval]\nimages = 1", &["eval.images = 1"]),
        ("[validation]", &["validation"]),
        (
            "[audit]\nrobots = \"top:1\"\n[eval]\nphysical_only = true",
            &["eval.physical_only", "audit.robots"],
        ),
        ("groups = [\"0|1\", \"1|0\"]", &["groups"]),
    ] {
        let (first, rest) = more.split_once('\n').unwrap_or((more, ""));
        let keys = if first.starts_with('[') {
            format!("{SHORT}{more}")
        } else {
            format!("{first}\n{SHORT}{rest}")
        };
        sandbox.write("plan.toml", keys);
        for task in ["", "--task 1"] {
            sandbox
                .run(&format!("sweep plan.toml --out all {task}"))
                .ended(3, words);
        }
        assert!(!sandbox.path("all/tiny-seed1/run.json").exists(), "{more}");
    }
    sandbox.write("plan.toml", format!("{SHORT}[eval]\nimages = \"all\"\n"));
    sandbox
        .run("sweep plan.toml --out none --status --set eval.images=most")
        .ended(2, &["eval.images"]);
    sandbox
        .run("sweep plan.toml --out all --status")
        .ended(0, &[]);
}

#[test]
fn a_run_of_another_kind_in_a_tasks_folder_is_a_failure_with_its_reason() {
    let sandbox = Sandbox::tiny();
    sandbox.write("plan.toml", SHORT);
    sandbox.write("all/tiny-seed1/training.json", "{}");
    let said = sandbox
        .run("sweep plan.toml --out all")
        .ended(1, &["task 1"]);
    assert!(
        said.err.contains("the run in this folder is a training"),
        "{said:?}"
    );
}

#[test]
fn a_plans_config_is_beside_the_plan_or_built_in_wherever_one_stands() {
    let sandbox = Sandbox::new();
    sandbox.write(
        "plans/plan.toml",
        "config = \"quickstart.toml\"\nset = [\"generations=1\", \"map_elites.initial=4\"]\n",
    );
    sandbox.write("quickstart.toml", TINY);
    sandbox
        .run("sweep plans/plan.toml --out all -q")
        .ended(0, &[]);
    assert_eq!(
        sandbox.run_file("all/quickstart-seed1").config.body.height,
        7
    );
    sandbox.write(
        "plans/quickstart.toml",
        TINY.replace("height = 5", "height = 6"),
    );
    sandbox
        .run("sweep plans/plan.toml --out beside -q")
        .ended(0, &[]);
    assert_eq!(
        sandbox
            .run_file("beside/quickstart-seed3")
            .config
            .body
            .height,
        6
    );
    sandbox.write("plans/plan.toml", "config = \"own.toml\"\n");
    sandbox.write("own.toml", TINY);
    sandbox
        .run("sweep plans/plan.toml --out none")
        .ended(3, &["plans/own.toml: "]);
}

#[test]
fn other_classes_draw_images_of_their_own() {
    let sandbox = Sandbox::tiny();
    sandbox.write("plan.toml", format!("{SHORT}pairs = [0, 4]\n"));
    sandbox.run("sweep plan.toml --out all -q").ended(0, &[]);
    let images = sandbox.run_file("all/tiny-0v4-seed1").training_images;
    assert_eq!(
        images.iter().map(|image| image.label).collect::<Vec<_>>(),
        [0, 4]
    );
}

#[test]
fn listed_commands_name_the_images_and_the_atlas_of_this_folder() {
    let sandbox = Sandbox::new();
    sandbox.write("data/mnist/train", "");
    sandbox.write("plan.toml", "config = \"zero_one.toml\"\n");
    let list = sandbox.run("sweep plan.toml --list").ended(0, &[]).out;
    let data = sandbox.path("data/mnist");
    assert!(
        list.contains(&format!("--data {}", data.display())),
        "{list}"
    );
    let atlas = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/atlas");
    sandbox.write(
        "plan.toml",
        "archive = \"atlas:zero_one-1\"\npairs = [0, 1]\nseeds = [1]\n",
    );
    let mut command = sandbox.command("sweep plan.toml --list".split(' '));
    command.env("MORPHCOG_ATLAS", &atlas);
    let list = said(command).ended(0, &[]).out;
    assert!(
        list.starts_with(&format!("env MORPHCOG_ATLAS={} ", atlas.display())),
        "{list}"
    );
}

/// A sandbox with one task and its folder.
fn one_task() -> (Sandbox, String) {
    let sandbox = sandbox();
    sandbox.write(
        "plan.toml",
        PLAN.replace("[1, 2]", "[1]").replace("[4, 8]", "[4]"),
    );
    (sandbox, "all/tiny-parents=4-seed1".to_string())
}

/// The one row of the table of a sweep with one task.
fn collected(sandbox: &Sandbox, words: &[&str]) -> BTreeMap<String, String> {
    sandbox
        .run("sweep plan.toml --out all --collect")
        .ended(0, words);
    let table = sandbox.read("all/sweep.csv");
    let rows: Result<Vec<_>, _> = csv::Reader::from_reader(table.as_bytes())
        .deserialize()
        .collect();
    let [mut row] = <[BTreeMap<_, _>; 1]>::try_from(rows.unwrap()).unwrap();
    row.remove("seconds");
    row
}

#[test]
fn a_test_with_other_settings_is_never_taken_for_the_plans_own() {
    let (sandbox, folder) = one_task();
    sandbox.run("sweep plan.toml --out all -q").ended(0, &[]);
    let (own, row) = (
        sandbox.read(&format!("{folder}/eval.json")),
        collected(&sandbox, &[]),
    );
    assert!(!row["accuracy"].is_empty());
    for (setting, key) in [
        ("--cycles 1", "control_steps = 50"),
        ("--threshold 1", "threshold = 1"),
        ("--seed 2", "seed = 2"),
        ("--images 6", "images = 6"),
        ("--robots top:1", "robots = "),
    ] {
        let others = if setting.contains("robots") {
            ""
        } else {
            "--robots top:2"
        };
        let images = if setting.contains("images") {
            ""
        } else {
            "--images 4"
        };
        let words = format!("eval -a {folder} {others} {images} {setting}");
        sandbox.run(&words).ended(0, &["eval.json"]);
        let row = collected(&sandbox, &["eval.json", key]);
        assert_eq!(
            (row["accuracy"].as_str(), row["state"].as_str()),
            ("", "stopped"),
            "{setting}"
        );
        sandbox
            .run("sweep plan.toml --out all")
            .ended(0, &["task 1", "eval.json"]);
        assert_eq!(
            sandbox.read(&format!("{folder}/eval.json")),
            own,
            "{setting}"
        );
    }
    assert_eq!(collected(&sandbox, &[]), row);
    // Every one of them is still there.
    let kept = files(&sandbox.path(&folder));
    let kept = kept
        .keys()
        .filter(|name| name.starts_with("eval-") && name.ends_with(".json"));
    assert_eq!(kept.count(), 1 + 5);
}

#[test]
fn verdicts_and_choices_by_other_settings_are_never_taken_for_the_plans_own() {
    let (sandbox, folder) = one_task();
    let validation =
        "set = [\"archive.keep=3\", \"validation.best=1\", \"validation.images=40\"]\n[vary]";
    sandbox.write(
        "plan.toml",
        sandbox.read("plan.toml").replace("[vary]", validation),
    );
    sandbox.run("sweep plan.toml --out all -q").ended(0, &[]);
    let row = collected(&sandbox, &[]);
    assert!(!row["validation_balanced_accuracy"].is_empty() && !row["audited"].is_empty());
    let chosen = "--robots best-validation:2 --validation 42 --images 4 -o other.json";
    sandbox
        .run(&format!("eval -q -a {folder} {chosen}"))
        .ended(0, &[]);
    assert_eq!(collected(&sandbox, &[]), row);
    std::fs::remove_file(sandbox.path(&format!("{folder}/audit.json"))).unwrap();
    sandbox
        .run(&format!("audit -q -a {folder} --set threshold=1"))
        .ended(0, &[]);
    let row = collected(&sandbox, &["audit.json"]);
    assert!(row["audited"].is_empty(), "{row:?}");
}

#[test]
fn a_done_task_whose_results_are_gone_is_done_again() {
    let (sandbox, folder) = one_task();
    sandbox.run("sweep plan.toml --out all -q").ended(0, &[]);
    let before = files(&sandbox.path(&folder));
    for name in ["eval.json", "audit.json", "run.json"] {
        std::fs::remove_file(sandbox.path(&format!("{folder}/{name}"))).unwrap();
        let said = sandbox
            .run("sweep plan.toml --out all --status")
            .ended(0, &[]);
        assert!(said.out.contains(name), "{said:?}");
        assert_eq!(states(&sandbox, "all"), ["stopped"]);
        sandbox.run("sweep plan.toml --out all -q").ended(0, &[]);
        assert_eq!(states(&sandbox, "all"), ["done"]);
        let now = files(&sandbox.path(&folder));
        assert_eq!(
            now.keys().collect::<Vec<_>>(),
            before.keys().collect::<Vec<_>>()
        );
        assert!(
            ["eval.json", "audit.json", "run.json"]
                .iter()
                .all(|name| now[*name] == before[*name])
        );
    }
    // No result: without it, the task is done, with all its generations.
    std::fs::remove_file(sandbox.path(&format!("{folder}/metrics.csv"))).unwrap();
    let said = sandbox
        .run("sweep plan.toml --out all --status --json")
        .ended(0, &[]);
    let status = &said.json_lines()[0];
    let generations = &status["generations"];
    assert_eq!(status["state"], "done");
    assert!(
        generations[0] == generations[1] && generations[0] != 0,
        "{status}"
    );
}

/// What a job script does that gets the signal before its time limit at once, with a `scontrol` that
/// fails. `change`: of the script.
#[cfg(unix)]
fn job(change: (&str, &str)) -> std::process::Output {
    use std::os::unix::fs::PermissionsExt;
    let sandbox = Sandbox::tiny();
    sandbox.write(
        "plan.toml",
        SHORT.replace("generations=2", "generations=10000000"),
    );
    let script = sandbox
        .run("sweep plan.toml --out all --slurm")
        .ended(0, &[])
        .out;
    assert!(script.contains(change.0), "{script}");
    sandbox.write("job.sh", script.replace(change.0, change.1));
    let scontrol = sandbox.write(
        "bin/scontrol",
        "#!/bin/sh\necho \"scontrol $*\" >&2\nexit 1\n",
    );
    std::fs::set_permissions(scontrol, std::fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!(
        "{}:{}",
        sandbox.path("bin").display(),
        std::env::var("PATH").unwrap()
    );
    let mut command = std::process::Command::new("bash");
    SETTINGS.iter().for_each(|name| {
        command.env_remove(name);
    });
    command
        .arg("job.sh")
        .current_dir(sandbox.path(""))
        .env("PATH", path);
    command
        .env("SLURM_ARRAY_JOB_ID", "7")
        .env("SLURM_ARRAY_TASK_ID", "1")
        .env("TASKS_BEFORE", "1");
    command
        .stderr(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped());
    let job = command.spawn().unwrap();
    // The second task: one was before.
    wait_for(&sandbox.path("all/tiny-seed2/metrics.csv"));
    crate::common::program::terminate(&job);
    job.wait_with_output().unwrap()
}

#[cfg(unix)]
#[test]
fn a_job_with_too_short_a_time_limit_is_not_queued_again() {
    let ended = job(("-lt 10 ]", "-lt 60 ]"));
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(75), "{said}");
    assert!(
        said.contains("task 2") && !said.contains("scontrol requeue"),
        "{said}"
    );
}

#[cfg(unix)]
#[test]
fn a_job_that_cannot_be_queued_again_says_what_to_do() {
    let ended = job(("-lt 10 ]", "-lt 0 ]"));
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(75), "{said}");
    assert!(
        said.contains("scontrol requeue 7_1") && said.contains("task 2"),
        "{said}"
    );
}

#[test]
fn more_tasks_than_slurm_takes_are_said_with_what_to_do() {
    let sandbox = Sandbox::tiny();
    let seeds: Vec<String> = (1..=2100).map(|seed: u32| seed.to_string()).collect();
    sandbox.write(
        "plan.toml",
        SHORT.replace("[1, 2]", &format!("[{}]", seeds.join(","))),
    );
    let words = [
        "2100 tasks",
        "MaxArraySize",
        "sbatch --array=1-1000 --export=ALL,TASKS_BEFORE=1000 job.sh",
        "sbatch --array=1-100 --export=ALL,TASKS_BEFORE=2000 job.sh",
    ];
    let script = sandbox.run("sweep plan.toml --slurm").ended(0, &words).out;
    assert!(script.contains("#SBATCH --array=1-1000\n"), "{script}");
}
