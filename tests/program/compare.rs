//! `compare`: runs side by side, and what may be said about their differences.

use crate::common::program::{Made, Sandbox, TINY, write_images};
use morphcog::store::eval::EvalFile;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// A sandbox with short runs whose robots walk: `a1` and `a2` differ in the seed, `b1` also in a
/// key.
fn with_runs() -> Sandbox {
    static RUNS: OnceLock<Made> = OnceLock::new();
    Sandbox::once(&RUNS, |sandbox| {
        let walking = TINY
            .replace("control_steps = 20", "control_steps = 200")
            .replace("generations = 12", "generations = 30");
        sandbox.write("walking.toml", walking);
        for (name, options) in [
            ("a1", "--seed 1"),
            ("a2", "--seed 2"),
            ("b1", "--seed 1 --set map_elites.parents=9"),
        ] {
            let evolve = format!("evolve -q -c walking.toml -o runs/{name} {options}");
            sandbox.run(&evolve).ended(0, &[]);
        }
    })
}

/// Returns the event of a comparison.
fn compared(sandbox: &Sandbox, args: &str) -> Value {
    let said = sandbox.run(&format!("compare --json {args}")).ended(0, &[]);
    let last = said.json_lines().pop().unwrap();
    assert_eq!(last["event"], "compared", "{last}");
    last
}

/// Returns the QD score in the last line of a run's metrics.csv.
fn last_qd_score(sandbox: &Sandbox, run: &str) -> f64 {
    let text = sandbox.read(&format!("runs/{run}/metrics.csv"));
    let mut csv = csv::Reader::from_reader(text.as_bytes());
    let lines = csv.deserialize::<BTreeMap<String, String>>();
    let last = lines.last().unwrap().unwrap();
    last["qd_score"].parse().unwrap()
}

/// Returns for each image whether a robot of a test answered it correctly.
fn right(sandbox: &Sandbox, file: &str) -> Vec<bool> {
    let test: EvalFile = serde_json::from_str(&sandbox.read(file)).unwrap();
    let [robot] = test.robots.as_slice() else {
        panic!("{file}: {} robots", test.robots.len())
    };
    let zeros = if robot.first_group_walks == "left" {
        -1.0
    } else {
        1.0
    };
    let is_right = |(image, walk): (&morphcog::store::images::ImageRef, &Option<f64>)| {
        let way = if image.label == 0 { zeros } else { -zeros };
        walk.is_some_and(|walk| walk * way > 3.0)
    };
    let walks = test.images.iter().zip(&robot.displacements);
    walks.map(is_right).collect()
}

#[test]
fn runs_are_compared_key_by_key_and_image_by_image() {
    let sandbox = with_runs();
    let found = compared(&sandbox, "runs/a1 runs/a2 runs/b1 -n 40");
    let keys = json!([
        {"key": "map_elites.parents", "values": [8, 8, 9]}, {"key": "seed", "values": [1, 2, 1]},
    ]);
    assert_eq!(found["keys"], keys);
    for (name, run) in ["a1", "a2", "b1"]
        .iter()
        .zip(found["runs"].as_array().unwrap())
    {
        assert_eq!(
            (&run["name"], &run["generations"]),
            (&json!(name), &json!(30))
        );
        assert_eq!(
            run["qd_score"].as_f64(),
            Some(last_qd_score(&sandbox, name))
        );
    }
    // The same as `eval` finds, image by image.
    let answers: Vec<Vec<bool>> = ["a1", "a2", "b1"]
        .iter()
        .map(|name| {
            let eval = format!("eval -q -a runs/{name} --robots best -n 40 -o {name}.json");
            sandbox.run(&eval).ended(0, &[]);
            right(&sandbox, &format!("{name}.json"))
        })
        .collect();
    assert!(answers[1].contains(&true) && answers[1].contains(&false));
    for (accuracy, own) in found["accuracies"].as_array().unwrap().iter().zip(&answers) {
        let count = own.iter().filter(|right| **right).count();
        assert_eq!(accuracy["right"], json!(count));
        let difference = &accuracy["difference"];
        if accuracy["run"] == 0 {
            assert!(difference.is_null());
            continue;
        }
        let both = || own.iter().zip(&answers[0]);
        let only = |wanted: (bool, bool)| both().filter(|(a, b)| (**a, **b) == wanted).count();
        assert_eq!(difference["only_this"], json!(only((true, false))));
        assert_eq!(difference["only_first"], json!(only((false, true))));
        let mean = difference["mean"].as_f64().unwrap();
        let [low, high] = [0, 1].map(|end| difference["interval"][end].as_f64().unwrap());
        assert!(low <= mean && mean <= high, "{difference}");
        assert!(difference["p_adjusted"].as_f64() >= difference["p"].as_f64());
    }
    // b1 has another config: it is in no mean.
    let [group] = found["repetitions"].as_array().unwrap().as_slice() else {
        panic!("{found}")
    };
    assert_eq!(group["runs"], json!([0, 1]));
    assert_eq!(found["notes"], json!([]));
}

#[test]
fn a_comparison_writes_a_table_and_a_figure_above_the_runs() {
    let sandbox = with_runs();
    let said = sandbox.run("compare runs/a1 runs/b1 -n 10").ended(0, &[]);
    for word in ["map_elites.parents", "a1", "b1", "QD score", "coverage"] {
        assert!(said.out.contains(word), "{word}: {said:?}");
    }
    let text = sandbox.read("runs/compare.csv");
    let mut csv = csv::Reader::from_reader(text.as_bytes());
    let lines: Vec<BTreeMap<String, String>> = csv.deserialize().map(Result::unwrap).collect();
    let column = |name: &str| {
        lines
            .iter()
            .map(|line| line[name].as_str())
            .collect::<Vec<_>>()
    };
    assert_eq!(column("run"), ["a1", "b1"]);
    assert_eq!(column("map_elites.parents"), ["8", "9"]);
    assert!(column("difference")[0].is_empty() && !column("difference")[1].is_empty());
    let svg = sandbox.read("runs/compare.svg");
    for word in ["QD score", "coverage", "generation", "a1", "b1"] {
        let label = format!("aria-label=\"{word}");
        assert!(svg.contains(&label), "{word}");
    }
    for file in ["runs/compare.png", "runs/compare.pdf"] {
        assert!(sandbox.path(file).exists(), "{file}");
    }
    // Neither a run nor its test has changed.
    for file in ["runs/a1/eval.json", "runs/a1/compare.csv"] {
        assert!(!sandbox.path(file).exists(), "{file}");
    }
}

#[test]
fn results_of_the_same_images_are_not_simulated_again() {
    let sandbox = with_runs();
    sandbox
        .run("eval -q -a runs/a2 --robots top:2 -n 12")
        .ended(0, &[]);
    let simulated = |images: usize| -> Vec<String> {
        let args = format!("compare --json runs/a1 runs/a2 -n {images} -o c.csv");
        let lines = sandbox.run(&args).ended(0, &[]).json_lines();
        let labels = lines.iter().filter(|line| line["event"] == "progress");
        let labels = labels.map(|line| line["label"].as_str().unwrap().to_string());
        let mut labels: Vec<String> = labels.collect();
        labels.dedup();
        labels
    };
    let known = simulated(12);
    assert!(known.len() == 1 && known[0].contains("seed 1"), "{known:?}");
    assert_eq!(simulated(10).len(), 2);
    // What was not simulated is the same.
    let with = compared(&sandbox, "runs/a1 runs/a2 -n 12 -o c.csv");
    std::fs::remove_file(sandbox.path("runs/a2/eval.json")).unwrap();
    let without = compared(&sandbox, "runs/a1 runs/a2 -n 12 -o c.csv");
    assert_eq!(with, without);
}

#[test]
fn accuracies_of_other_tasks_or_images_are_not_paired_and_the_rest_is_compared() {
    let sandbox = with_runs();
    for (name, set) in [
        (
            "task",
            "--set task.groups=[[2],[3]] --set data.train_images=[2,3]",
        ),
        ("data", "--set data.builtin.seed=7"),
    ] {
        let evolve = format!("evolve -q -c walking.toml -o runs/{name} {set}");
        sandbox.run(&evolve).ended(0, &[]);
    }
    let found = compared(&sandbox, "runs/a1 runs/task runs/data -n 10");
    let accuracies = found["accuracies"].as_array().unwrap();
    assert_eq!(accuracies.len(), 3, "{found}");
    assert!(
        accuracies.iter().all(|one| one["difference"].is_null()),
        "{found}"
    );
    let notes = found["notes"].to_string();
    for said in [
        "task: accuracy not paired",
        "data: accuracy not paired",
        "other data",
    ] {
        assert!(notes.contains(said), "{notes}");
    }
    assert_eq!(found["repetitions"], json!([]));
    assert_eq!(found["runs"].as_array().unwrap().len(), 3);
}

#[test]
fn robots_of_other_data_are_compared_on_the_images_of_one_dataset() {
    let sandbox = with_runs();
    write_images(&sandbox, "there/", [28, 28], 1);
    let evolve = "evolve -q -c walking.toml -g 3 --set data.dataset=mnist --data there";
    sandbox
        .run(&format!("{evolve} -o runs/mnist"))
        .ended(0, &[]);
    let both = "runs/a2 runs/mnist -n 10";
    let apart = compared(&sandbox, both);
    assert!(
        apart["notes"]
            .to_string()
            .contains("mnist: accuracy not paired"),
        "{apart}"
    );
    assert!(apart["accuracies"][1]["difference"].is_null());
    let together = compared(&sandbox, &format!("{both} --dataset builtin"));
    assert_eq!(together["notes"], json!([]));
    assert!(
        together["accuracies"][1]["difference"].is_object(),
        "{together}"
    );
    // A test without its images says how it can be made.
    std::fs::remove_dir_all(sandbox.path("there")).unwrap();
    let said = sandbox.run(&format!("compare {both}"));
    said.ended(3, &["mnist", "--data", "--dataset"]);
}

#[test]
fn gaits_and_runs_without_a_history_are_compared_as_far_as_they_can_be() {
    let sandbox = with_runs();
    sandbox.write("gaits.toml", crate::common::program::gaits());
    sandbox
        .run("evolve -q -c gaits.toml -o runs/gaits")
        .ended(0, &[]);
    let qd_score = last_qd_score(&sandbox, "a2");
    std::fs::remove_file(sandbox.path("runs/a2/metrics.csv")).unwrap();
    let found = compared(&sandbox, "runs/a1 runs/a2 runs/gaits -n 10");
    let notes = found["notes"].to_string();
    for said in [
        "gaits: no accuracy",
        "a2: no curves",
        "gaits: another fitness",
    ] {
        assert!(notes.contains(said), "{notes}");
    }
    assert_eq!(found["accuracies"].as_array().unwrap().len(), 2);
    assert_eq!(found["runs"][1]["qd_score"].as_f64(), Some(qd_score));
}

#[test]
fn what_cannot_be_compared_is_refused_before_anything_is_written() {
    let sandbox = with_runs();
    let run = sandbox.read("runs/a2/run.json");
    let newer = run.replacen("\"format_version\":1", "\"format_version\":99", 1);
    sandbox.write("runs/newer/run.json", newer);
    let mut empty: Value = serde_json::from_str(&run).unwrap();
    empty["elites"] = json!([]);
    let stats = json!({
        "num_elites": 0, "coverage": 0.0, "qd_score": 0.0, "norm_qd_score": 0.0, "obj_max": null,
        "obj_mean": null,
    });
    empty["stats"] = stats;
    sandbox.write("runs/empty/run.json", empty.to_string());
    sandbox.write("runs/torn/run.json", &run);
    sandbox.write("runs/torn/metrics.csv", "generation,coverage\n0,x\n");
    for (args, code, words) in [
        ("runs/a1", 2, &["two runs or more", "runs/a1/run.json"][..]),
        ("", 2, &["ARCHIVE"]),
        ("runs/a1 runs/a1", 2, &["runs/a1/run.json", "the same"]),
        ("runs/a1 runs/nowhere", 3, &["runs/nowhere"]),
        (
            "runs/a1 runs/newer",
            3,
            &["runs/newer/run.json", "newer morphcog"],
        ),
        ("runs/a1 runs/empty", 3, &["runs/empty/run.json", "empty"]),
        ("runs/a1 runs/torn", 3, &["runs/torn/metrics.csv"]),
        (
            "runs/a1 runs/a2 --robots top:2",
            2,
            &["--robots top:2", "one robot"],
        ),
        (
            "runs/a1 runs/a2 --robots all",
            2,
            &["--robots all", "one robot"],
        ),
        ("runs/a1 runs/a2 --robots nobody", 3, &["nobody"]),
        ("runs/a1 runs/a2 -n 1", 2, &["--images 1"]),
        (
            "runs/a1 runs/a2 -o table.json",
            2,
            &["--out table.json", ".csv"],
        ),
        (
            "runs/a1 runs/a2 -o runs/a1/metrics.csv",
            2,
            &["metrics.csv"],
        ),
        ("runs/a1 runs/a2 -o runs/a1/eval.csv", 2, &["eval.csv"]),
        ("runs/a1 runs/a2 --physical-only", 3, &["audit"]),
    ] {
        let metrics = sandbox.read("runs/a1/metrics.csv");
        sandbox.run(&format!("compare {args}")).ended(code, words);
        assert!(!sandbox.path("runs/compare.csv").exists(), "{args}");
        assert_eq!(sandbox.read("runs/a1/metrics.csv"), metrics, "{args}");
    }
    // Robots may be named one by one.
    let ids = ["a1", "a2"].map(|name| {
        let run = sandbox.run_file(&format!("runs/{name}"));
        run.elites.last().unwrap().id.clone()
    });
    let args = format!("runs/a1 runs/a2 -n 4 --robots {}", ids.join(","));
    let found = compared(&sandbox, &args);
    let robots = [0, 1].map(|place| found["accuracies"][place]["robot"].clone());
    assert_eq!(robots, ids.map(Value::from));
}

#[test]
fn a_report_of_several_runs_compares_the_first_with_the_others() {
    let sandbox = with_runs();
    let report = |what: &str| {
        let args = format!("report -q --rollouts 0 -o page.html -a {what}");
        sandbox.run(&args).ended(0, &[]);
        sandbox.read("page.html")
    };
    assert!(!report("runs/a1").contains("Compared with"));
    let page = report("runs/a1 runs/b1");
    assert!(page.contains("<h2>Compared with a1, seed 1") && page.contains("map_elites.parents"));
    // Only known tests are in a page.
    assert!(page.contains("not tested") && !page.contains("95 % bootstrap"));
    let eval = "eval -q --robots best -n 40 -a";
    sandbox.run(&format!("{eval} runs/a1")).ended(0, &[]);
    sandbox.run(&format!("{eval} runs/b1")).ended(0, &[]);
    let page = report("runs/a1 runs/b1");
    assert!(!page.contains("not tested") && page.contains("95 % bootstrap"));
}
