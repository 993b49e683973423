//! What robots are worth in networks: trained on the robots' images, kept, the same however it is
//! stopped or spread.

use crate::common::program::{Made, Sandbox, TINY};
use morphcog::base::session::Session;
use morphcog::commands::capacity::CapacityOptions;
use morphcog::config::capacity::CapacityConfig;
use morphcog::store::capacity::CapacityFile;
use morphcog::store::eval::EvalFile;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

const FEW: &str = "--set trainings=3 --set sizes=[1,4]";

/// Two runs of different seeds, evaluated together.
fn sandbox() -> Sandbox {
    static RUNS: OnceLock<Made> = OnceLock::new();
    Sandbox::once(&RUNS, |sandbox| {
        sandbox.write("tiny.toml", TINY);
        for seed in [3, 4] {
            sandbox
                .run(&format!(
                    "evolve -q -c tiny.toml --seed {seed} -o runs/{seed}"
                ))
                .ended(0, &[]);
        }
        let archives = "--archive runs/3/run.json runs/4/run.json";
        sandbox
            .run(&format!(
                "eval -q {archives} --images 40 --cycles 1 --robots top:4"
            ))
            .ended(0, &[]);
    })
}

fn capacity(sandbox: &Sandbox, options: &str) -> CapacityFile {
    sandbox
        .run(&format!(
            "capacity -q --eval runs/eval.json {FEW} {options}"
        ))
        .ended(0, &[]);
    CapacityFile::read(&sandbox.path("runs/capacity.json")).unwrap()
}

#[test]
fn several_archives_are_evaluated_together_above_their_folders() {
    let sandbox = sandbox();
    let report = EvalFile::read(&sandbox.path("runs/eval.json")).unwrap();
    assert_eq!(
        report.runs.iter().map(|run| run.seed).collect::<Vec<_>>(),
        [3, 4]
    );
    assert_eq!(report.robots.len(), 4);
    // The fittest of both, not those of each.
    let mut all: Vec<(f64, usize)> = ["runs/3", "runs/4"]
        .iter()
        .enumerate()
        .flat_map(|(number, run)| {
            sandbox
                .run_file(run)
                .elites
                .into_iter()
                .map(move |elite| (elite.objective, number))
        })
        .collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let tested: Vec<(f64, usize)> = report
        .robots
        .iter()
        .map(|robot| (robot.objective, robot.run))
        .collect();
    assert_eq!(tested, all[..4]);
    assert!(
        sandbox
            .read("runs/eval.csv")
            .lines()
            .nth(1)
            .unwrap()
            .contains(",0|1,")
    );
    // What is shown and where they live must be the same.
    sandbox
        .run("evolve -q -c tiny.toml --set protocol.control_steps=21 -o runs/5")
        .ended(0, &[]);
    sandbox
        .run("eval --archive runs/3/run.json --archive runs/5/run.json --images 4 -o x.json")
        .ended(3, &["runs/5/run.json", "[protocol]", "runs/3/run.json"]);
}

#[test]
fn robots_that_know_less_than_the_smallest_network_are_worth_less_than_it() {
    let sandbox = sandbox();
    let mut report: serde_json::Value =
        serde_json::from_str(&sandbox.read("runs/eval.json")).unwrap();
    for robot in report["robots"].as_array_mut().unwrap() {
        (robot["right"], robot["accuracy"]) = (1.into(), 0.025.into());
    }
    report["means"]["0|1"]["accuracy"] = 0.025.into();
    sandbox.write("runs/eval.json", report.to_string());
    let said = sandbox
        .run(&format!(
            "capacity --eval runs/eval.json {FEW} --set sizes.1=2"
        ))
        .ended(0, &[]);
    let row = said
        .out
        .lines()
        .find(|line| line.starts_with("0|1"))
        .unwrap();
    assert_eq!(row.matches("< 2").count(), 2, "{row}");
    let found: serde_json::Value =
        serde_json::from_str(&sandbox.read("runs/capacity.json")).unwrap();
    assert_eq!(
        found["tasks"][0]["curves"][1]["capacity"],
        serde_json::json!({ "below": 2.0 })
    );
    assert!(sandbox.read("runs/capacity.svg").contains("&lt; 2"));
    sandbox
        .run("report -q --archive runs/3 runs/4 --rollouts 0 -o runs/page.html")
        .ended(0, &[]);
    assert!(sandbox.read("runs/page.html").contains(">&lt; 2<"));
}

#[test]
fn networks_are_trained_once_and_the_same_on_any_number_of_threads() {
    let sandbox = sandbox();
    let first = capacity(&sandbox, "--threads 1");
    let task = &first.tasks[0];
    assert_eq!(
        (task.task.as_str(), task.robots, task.curves.len()),
        ("0|1", 4, 2)
    );
    for curve in &task.curves {
        assert_eq!(
            curve
                .points
                .iter()
                .map(|point| point.size)
                .collect::<Vec<_>>(),
            [1, 2, 3, 4]
        );
        assert!(
            curve
                .points
                .iter()
                .all(|point| (0.0..=1.0).contains(&point.mean))
        );
        assert!(curve.points.is_sorted_by_key(|point| point.parameters) && curve.fit.is_some());
    }
    // 25 pixels: (25 + 1)·size + (size + 1)·2 parameters.
    assert_eq!(task.curves[0].points[2].parameters, 26 * 3 + 4 * 2);
    let trainings = sandbox.read("runs/capacity.trainings.json");
    assert_eq!(capacity(&sandbox, "--threads 3"), first);
    std::fs::remove_file(sandbox.path("runs/capacity.trainings.json")).unwrap();
    assert_eq!(capacity(&sandbox, "--threads 3"), first);
    assert_eq!(sandbox.read("runs/capacity.trainings.json"), trainings);
    // More trainings go on from those there are; another setting begins anew.
    let more =
        sandbox.run("capacity --json --eval runs/eval.json --set trainings=4 --set sizes=[1,4]");
    assert!(more.ended(0, &[]).out.contains("\"capacity\""));
    let other = capacity(&sandbox, "--set mlp.learning_rate=0.01");
    assert_ne!(other.tasks[0].curves[0], first.tasks[0].curves[0]);
    assert_eq!(other.tasks[0].curves[1], first.tasks[0].curves[1]);
    assert!(
        sandbox
            .read("runs/capacity.csv")
            .starts_with("task,network,size,parameters,mean,")
    );
}

#[test]
fn an_evaluation_shows_the_capacity_of_its_robots_and_of_no_others() {
    let sandbox = sandbox();
    let known = capacity(&sandbox, "").tasks[0].clone();
    let eval = |robots: &str| {
        let archives = "--archive runs/3/run.json runs/4/run.json";
        sandbox
            .run(&format!(
                "eval {archives} --images 40 --cycles 1 --robots {robots}"
            ))
            .ended(0, &[])
            .out
    };
    let same = eval("top:4");
    let row = same
        .lines()
        .skip_while(|line| !line.contains("MLP neurons"))
        .nth(2)
        .unwrap();
    // As the analysis says it: in whole neurons, with the interval.
    let page = sandbox
        .run(&format!("capacity --eval runs/eval.json {FEW}"))
        .ended(0, &[])
        .out;
    let said = page.lines().find(|line| line.starts_with("0|1")).unwrap();
    assert_eq!((row, known.curve("mlp").is_some()), (said, true), "{page}");
    assert!(!eval("top:3").contains("MLP neurons"));
}

#[test]
fn clean_training_never_waits_on_the_test_images() {
    let sandbox = sandbox();
    let published = capacity(&sandbox, "");
    let clean = capacity(&sandbox, "--clean --set waiting_images=60");
    assert_eq!(
        (published.patience_on.as_str(), clean.patience_on.as_str()),
        ("test", "validation")
    );
    assert_ne!(clean.tasks, published.tasks);
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let sandbox = sandbox();
    let with = |options: &str| sandbox.run(&format!("capacity --eval runs/eval.json {options}"));
    with("--set trainings=0").ended(3, &["trainings"]);
    with("--set sizes=[1,4,9]").ended(2, &["--set sizes=[1,4,9]"]);
    with("--set sizes=[3,2]").ended(3, &["sizes = [3, 2]"]);
    with("--set cnn.kernel=5").ended(3, &["cnn.kernel = 5", "max2"]);
    with("--set cnn.kernel=6 --set cnn.pooling=none").ended(3, &["cnn.kernel = 6"]);
    with("--set mlp.rate=1").ended(2, &["mlp.rate"]);
    with("--physical-only").ended(3, &["audit.json", "morphcog audit"]);
    for run in ["runs/3", "runs/4"] {
        sandbox
            .run(&format!(
                "audit -q -a {run} --robots top:1 --set perturbations.time_step=[2]"
            ))
            .ended(0, &[]);
    }
    with("--physical-only").ended(3, &["runs/eval.json: robot ", "morphcog audit"]);
    with("-o runs/eval.json").ended(2, &["--out runs/eval.json"]);
    with("-o runs/c.svg").ended(2, &["--out runs/c.svg"]);
    with("--set trainings=9223372036854775807")
        .ended(3, &["trainings = 9223372036854775807", "1 to 100000"]);
    // Nothing to learn from.
    let mut runless: serde_json::Value =
        serde_json::from_str(&sandbox.read("runs/eval.json")).unwrap();
    runless["runs"] = serde_json::json!([]);
    runless["robots"]
        .as_array_mut()
        .unwrap()
        .iter_mut()
        .for_each(|robot| robot["run"] = 0.into());
    sandbox.write("runless.json", runless.to_string());
    sandbox
        .run("capacity --eval runless.json")
        .ended(3, &["runless.json: runs"]);
    let published = sandbox
        .read("runs/eval.json")
        .replace("\"name\":\"tiny\"", "\"name\":\"gallery\"");
    sandbox.write("gallery.json", published);
    sandbox
        .run("capacity --eval gallery.json --physical-only")
        .ended(3, &["morphcog audit"]);
    sandbox
        .run("capacity --eval runs/3/run.json")
        .ended(3, &["morphcog-eval"]);
    sandbox
        .run("capacity --eval nowhere.json")
        .ended(3, &["nowhere.json", "morphcog eval"]);
}

#[test]
fn what_was_found_stays_if_the_next_search_is_stopped_before_it_finds_anything() {
    let sandbox = sandbox();
    capacity(&sandbox, "");
    let found = sandbox.read("runs/capacity.json");
    let options = CapacityOptions {
        eval: sandbox.path("runs/eval.json"),
        config: CapacityConfig::load(None, &["seed=2".to_string()]).unwrap(),
        physical_only: false,
        out: sandbox.path("runs/capacity.json"),
    };
    let stopped = morphcog::commands::capacity::capacity(
        &options,
        &Session::new(&AtomicBool::new(true), &()).threads(Some(1)),
    )
    .unwrap()
    .file;
    assert!(stopped.stopped && stopped.tasks.is_empty());
    assert_eq!(sandbox.read("runs/capacity.json"), found);
}
