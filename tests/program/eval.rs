//! `eval`: images that were not seen, and where results go.

use crate::common::program::{Sandbox, files};
use crate::with_run;
use morphcog::store::eval::EvalFile;
use std::collections::BTreeMap;

#[test]
fn whoever_simulates_a_run_of_another_version_says_so_once() {
    let sandbox = with_run();
    let run = sandbox.read("run/run.json");
    let version = format!("\"program_version\":\"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(run.contains(&version));
    let old = run.replace(&version, "\"program_version\":\"0.0.9\"");
    for (folder, text) in [("own", &run), ("old", &old)] {
        sandbox.write(&format!("{folder}/run.json"), text);
    }
    let train = "--task 0|1 --set train.images=4 --set train.random_images=20 --set train.rounds=1 \
                 --set train.final_images=4 --set train.challengers=0 --set validation.best=0";
    for command in [
        "eval -a FOLDER --images 4 --cycles 1".to_string(),
        "audit -a FOLDER --robots best".to_string(),
        "response -a FOLDER --robots top:3 -n 60".to_string(),
        "replay -a FOLDER --robots best -o replay.png".to_string(),
        "team -a FOLDER --robots best --images 4 --classes 0,1".to_string(),
        format!("train -a FOLDER --robots top:3 {train} --out FOLDER-taught"),
        "report -a FOLDER -o FOLDER.html".to_string(),
    ] {
        let said = |folder: &str| {
            let said = sandbox
                .run(&command.replace("FOLDER", folder))
                .ended(0, &[]);
            said.err.matches("0.0.9").count()
        };
        assert_eq!((said("own"), said("old")), (0, 1), "{command}");
    }
    let words = [
        "old/run.json: made by morphcog 0.0.9",
        env!("CARGO_PKG_VERSION"),
    ];
    sandbox
        .run("eval -a old --images 4 --cycles 1")
        .ended(0, &words);
    // What is only read is not simulated, and runs that ship are simulated by the tests of every
    // version.
    for command in [
        "plot archive -a old -o archive.svg",
        "report -a old --rollouts 0 -o old.html",
    ] {
        let said = sandbox.run(command).ended(0, &[]);
        assert!(!said.err.contains("0.0.9"), "{said:?}");
    }
    let said = sandbox
        .run("response -a gallery:gaits-6 -n 60 -o gaits.json")
        .ended(0, &[]);
    assert!(!said.err.contains("made by morphcog"), "{said:?}");
}

#[test]
fn an_evaluation_adds_up() {
    let sandbox = with_run();
    let said = sandbox
        .run("eval -a run/run.json --images 31 --cycles 1 --threshold 0.05 --robots all")
        .ended(0, &[]);
    let report: EvalFile = serde_json::from_str(&sandbox.read("run/eval.json")).unwrap();
    let run = sandbox.run_file("run");
    assert_eq!(
        (report.images.len(), report.robots.len(), report.stopped),
        (31, run.elites.len(), false)
    );
    assert_eq!(report.control_steps, 50);
    let of = |class: u8| {
        report
            .images
            .iter()
            .filter(|image| image.label == class)
            .count()
    };
    assert_eq!((of(0), of(1)), (16, 15));
    for robot in &report.robots {
        assert_eq!((robot.images, robot.displacements.len()), (31, 31));
        assert_eq!(robot.accuracy, robot.right as f64 / 31.0);
        let [low, high] = robot.interval;
        assert!(low <= robot.accuracy && robot.accuracy <= high && low >= 0.0 && high <= 1.0);
        assert_eq!(
            robot.balanced_accuracy,
            (robot.per_class[&0] + robot.per_class[&1]) / 2.0
        );
        let zero_walks = if robot.first_group_walks == "right" {
            1.0
        } else {
            -1.0
        };
        let right = |(image, d): (&morphcog::store::images::ImageRef, &Option<f64>)| {
            let towards = if image.label == 0 {
                zero_walks
            } else {
                -zero_walks
            };
            d.is_some_and(|d| d * towards > 0.05)
        };
        assert_eq!(
            report
                .images
                .iter()
                .zip(&robot.displacements)
                .filter(|pair| right(*pair))
                .count(),
            robot.right
        );
        let still = robot
            .displacements
            .iter()
            .flatten()
            .filter(|d| d.abs() <= 0.05)
            .count();
        assert_eq!(robot.not_moved, still as f64 / 31.0);
        assert_eq!(
            robot.unstable,
            robot.displacements.iter().filter(|d| d.is_none()).count()
        );
        assert!((1..=31).contains(&robot.simulated));
        assert!(said.out.contains(&robot.id));
    }
    let [mean, baselines] = [report.means.len(), report.baselines.len()];
    assert_eq!((mean, baselines), (1, 1));
    let mean = report
        .robots
        .iter()
        .map(|robot| robot.accuracy)
        .sum::<f64>()
        / report.robots.len() as f64;
    assert!((report.means["0|1"].accuracy - mean).abs() < 1e-12);
    let baselines = &report.baselines["0|1"];
    assert_eq!(baselines.larger_group, 16.0 / 31.0);
    assert!(
        baselines.best_single_pixel > 0.5 && baselines.nearest_training_image > Some(0.5),
        "{baselines:?}"
    );

    let text = sandbox.read("run/eval.csv");
    let mut csv = csv::Reader::from_reader(text.as_bytes());
    let lines: Vec<BTreeMap<String, String>> = csv.deserialize().map(Result::unwrap).collect();
    assert_eq!(lines.len(), report.robots.len());
    for (line, robot) in lines.iter().zip(&report.robots) {
        assert_eq!(line["id"], robot.id);
        assert_eq!(line["accuracy"].parse::<f64>().unwrap(), robot.accuracy);
        assert_eq!(
            line["accuracy_1"].parse::<f64>().unwrap(),
            robot.per_class[&1]
        );
        assert_eq!(line["simulated"], robot.simulated.to_string());
    }
}

#[test]
fn robots_of_several_runs_are_told_apart_by_the_folders_of_these() {
    let sandbox = with_run();
    for (folder, seed) in [("x/run", 5), ("other", 6)] {
        let evolve = format!("evolve -q -c tiny.toml --seed {seed} -o {folder}");
        sandbox.run(&evolve).ended(0, &[]);
    }
    let eval = "eval -a run x/run other -n 4 --cycles 1 --robots top:9";
    let said = sandbox.run(eval).ended(0, &[]);
    let header = said
        .out
        .lines()
        .find(|line| line.contains("robot"))
        .unwrap();
    assert!(header.trim_start().starts_with("run "), "{header}");
    let report: EvalFile = serde_json::from_str(&sandbox.read("eval.json")).unwrap();
    let text = sandbox.read("eval.csv");
    let mut csv = csv::Reader::from_reader(text.as_bytes());
    assert_eq!(&csv.headers().unwrap()[0], "run");
    let lines: Vec<BTreeMap<String, String>> = csv.deserialize().map(Result::unwrap).collect();
    // Two folders are called `run`.
    let folder = sandbox.path("");
    let above = folder.file_name().unwrap().to_str().unwrap();
    let names = [
        format!("{above}/run"),
        "x/run".to_string(),
        "other".to_string(),
    ];
    let seeds = [3, 5, 6];
    assert_eq!(lines.len(), 9);
    for (line, robot) in lines.iter().zip(&report.robots) {
        assert_eq!(line["run"], names[robot.run]);
        assert!(said.out.contains(&names[robot.run]), "{said:?}");
        assert_eq!(line["run_seed"], seeds[robot.run].to_string());
    }
    let json = sandbox
        .run(&format!("{eval} --json"))
        .ended(0, &[])
        .json_lines();
    assert_eq!(json.last().unwrap()["runs"], serde_json::json!(names));
    // The run of a single archive needs no column.
    sandbox.run("eval -a run -n 4 --cycles 1").ended(0, &[]);
    assert!(sandbox.read("run/eval.csv").starts_with("id,run_seed,"));
    assert!(!sandbox.read("run/eval.json").contains("\"folder\""));
}

#[test]
fn held_out_images_are_the_same_for_the_same_seed_and_others_for_another() {
    let sandbox = with_run();
    let images = |seed: u32| {
        sandbox
            .run(&format!(
                "eval -q -a run/run.json -n 10 --cycles 1 --robots best --seed {seed}"
            ))
            .ended(0, &[]);
        let report: EvalFile = serde_json::from_str(&sandbox.read("run/eval.json")).unwrap();
        report.images
    };
    assert_eq!(images(1), images(1));
    assert_ne!(images(1), images(2));
}

#[test]
fn too_many_images_are_refused_saying_how_many_there_are() {
    let sandbox = with_run();
    sandbox
        .run("eval -a run/run.json --images 1002")
        .ended(3, &["500", "1000"]);
    assert!(!sandbox.path("run/eval.json").exists());
}

#[test]
fn the_results_of_an_evaluation_never_overwrite_each_other_or_the_run() {
    let sandbox = with_run();
    let before = files(&sandbox.path("run"));
    for out in [
        "results.csv",
        "run/run.json",
        "run/../run/run.json",
        "run/elites.json",
        "run/metrics.json",
    ] {
        sandbox
            .run(&format!(
                "eval -a run/run.json -n 2 --cycles 1 --robots best -o {out}"
            ))
            .ended(2, &[out]);
        assert_eq!(files(&sandbox.path("run")), before, "{out}");
        assert!(!sandbox.path("results.csv").exists());
    }
}

#[test]
fn the_results_of_one_command_never_overwrite_those_of_another() {
    let sandbox = with_run();
    for name in ["audit", "validation", "capacity", "eval-validation"] {
        sandbox.write(&format!("run/{name}.json"), "kept");
        // Nor by the CSV.
        for ending in ["json", "txt"] {
            let out = format!("run/{name}.{ending}");
            let eval = format!("eval -a run/run.json -n 2 --cycles 1 --robots best -o {out}");
            sandbox
                .run(&eval)
                .ended(2, &[&out, &format!("{name}.json")]);
        }
        assert_eq!(sandbox.read(&format!("run/{name}.json")), "kept");
    }
    sandbox
        .run("audit -a run/run.json -o run/eval.json")
        .ended(2, &["run/eval.json"]);
    let trainings = "run/capacity.trainings.json";
    sandbox
        .run(&format!(
            "eval -a run/run.json -n 2 --cycles 1 -o {trainings}"
        ))
        .ended(2, &[trainings]);
    // The best robot is chosen by this one.
    std::fs::remove_file(sandbox.path("run/validation.json")).unwrap();
    // Elsewhere, and under its own name, it may.
    for out in ["audit.json", "run/eval.json", "run/mine.json"] {
        sandbox
            .run(&format!(
                "eval -q -a run/run.json -n 2 --cycles 1 --robots best -o {out}"
            ))
            .ended(0, &[]);
    }
}

#[test]
fn without_a_run_the_best_body_of_the_program_is_shown_on_its_own_digits() {
    let sandbox = Sandbox::new();
    let said = sandbox.run("replay --format gif --every 50").ended(0, &[]);
    assert!(said.err.contains("gallery:zero_one"), "{}", said.err);
    // A zero and a one.
    for seen in [": sees 0", ": sees 1"] {
        assert_eq!(said.out.matches(seen).count(), 1, "{}", said.out);
    }
    let made = files(&sandbox.path("."));
    assert!(
        made.keys()
            .any(|name| name.starts_with("replay-") && name.ends_with(".gif")),
        "{:?}",
        made.keys()
    );
    // What is asked for by name is not replaced.
    let said = sandbox
        .run("replay --dataset mnist --format gif")
        .ended(3, &[]);
    assert!(said.err.contains("mnist"), "{}", said.err);
}

#[test]
fn a_run_may_be_named_by_its_folder() {
    let sandbox = with_run();
    for command in [
        "eval -q -a run -n 2 --cycles 1 --robots best",
        "audit -q -a run --robots top:1",
        "replay -q -a run --format png",
        "plot accuracy -q -a run -o accuracy.svg",
        "report -q run --rollouts 0",
    ] {
        sandbox.run(command).ended(0, &[]);
    }
    let made = files(&sandbox.path("run"));
    for name in ["eval.json", "audit.json", "report.html"] {
        assert!(made.contains_key(name), "{name}: {:?}", made.keys());
    }
}

#[test]
fn an_evaluation_that_cannot_be_written_fails_before_its_first_rollout() {
    let sandbox = with_run();
    sandbox.write("file", "in the way");
    let said = sandbox
        .run("eval -a run/run.json -n 2 --cycles 1 -o file/eval.json")
        .ended(1, &["file/eval.json"]);
    assert!(said.err.starts_with("error:"), "{}", said.err);
}

#[test]
fn what_an_evaluation_is_asked_for_must_make_sense() {
    let sandbox = with_run();
    for wrong in [
        "--threshold nan",
        "--threshold=-1",
        "--threshold inf",
        "--images 1",
    ] {
        sandbox
            .run(&format!("eval -a run/run.json --cycles 1 {wrong}"))
            .ended(2, &[&wrong[..8]]);
    }
    sandbox
        .run("eval -a nowhere/run.json")
        .ended(3, &["nowhere/run.json"]);
    std::fs::create_dir(sandbox.path("empty")).unwrap();
    sandbox.run("eval -a empty").ended(3, &["empty/run.json"]);
    // The same robots twice would count twice.
    sandbox.write("copy.json", sandbox.read("run/run.json"));
    sandbox
        .run("eval -a run/run.json copy.json --cycles 1")
        .ended(2, &["run/run.json", "copy.json"]);
    Sandbox::new().run("eval").ended(3, &["runs/", "--archive"]);
}

#[test]
fn a_second_test_with_other_settings_keeps_the_first() {
    let sandbox = with_run();
    let test =
        |options: &str| sandbox.run(&format!("eval -a run --images 4 --robots top:2 {options}"));
    test("").ended(0, &[]);
    let first = files(&sandbox.path("run"));
    // The same again is no other test.
    test("").ended(0, &[]);
    assert_eq!(files(&sandbox.path("run")), first);
    let said = test("--cycles 2").ended(0, &["run/eval.json"]);
    let now = files(&sandbox.path("run"));
    assert_ne!(now["eval.json"], first["eval.json"]);
    for ending in ["json", "csv"] {
        let is_kept = |name: &&String| name.starts_with("eval-") && name.ends_with(ending);
        let kept: Vec<&String> = now.keys().filter(is_kept).collect();
        assert_eq!(kept.len(), 1, "{:?}", now.keys());
        assert_eq!(now[kept[0]], first[&format!("eval.{ending}")]);
        assert!(
            ending == "csv" || said.err.contains(kept[0].as_str()),
            "{}",
            said.err
        );
    }
}
