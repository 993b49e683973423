//! Training of gaits: a run like any other, the same bits on any threads, exact after a stop, clear
//! errors.

use crate::common::program::{Made, Sandbox, TINY, files, gaits, write_images};
use morphcog::base::session::Session;
use morphcog::commands::evolve;
use morphcog::commands::train;
use morphcog::config::Config;
use morphcog::data::dataset::Split;
use morphcog::images::training::TrainingImages;
use morphcog::images::whereabouts::load_dataset;
use morphcog::response::gait::Gait;
use morphcog::robots::selection::Selection;
use morphcog::store::folder::IfExists;
use morphcog::store::images::ImageRef;
use morphcog::store::run::{Robot, RunFile};
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};
use std::collections::BTreeSet;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A little of everything: seconds in place of minutes. The robot walks on images it has not seen,
/// which takes longer than all the rest, only [`VALIDATED`].
const LITTLE: &str = "--set train.random_images=20 --set train.rounds=2 --set train.images=12 \
--set train.final_images=10 --set train.challengers=4 --set validation.images=40 --set validation.best=0";
const VALIDATED: &str = "--set validation.best=1";

/// A run whose robots walk a little.
fn sandbox() -> Sandbox {
    static WALKERS: OnceLock<Made> = OnceLock::new();
    Sandbox::once(&WALKERS, |sandbox| {
        sandbox.write("run.toml", TINY);
        sandbox
            .run("evolve -q -c run.toml -o walkers")
            .ended(0, &[]);
    })
}

#[test]
fn a_training_is_a_run_that_every_command_understands() {
    let sandbox = sandbox();
    let train = format!(
        "train -q -a walkers --task 3|14 --robots top:3 {LITTLE} --set train.challengers=0 -o taught"
    );
    sandbox.run(&train).ended(0, &[]);
    let run = sandbox.run_file("taught");
    let [robot] = &run.elites[..] else {
        panic!("{} robots", run.elites.len())
    };
    assert_eq!(
        (robot.task.as_str(), run.training_images.len()),
        ("3|14", robot.displacements.len())
    );
    assert_eq!(run.training_images.len(), 10);
    assert!(
        run.training_images
            .iter()
            .all(|image| [1, 3, 4].contains(&image.label))
    );
    // What walks is what walked before; only soft voxels and sensors were chosen anew.
    let walkers = sandbox.run_file("walkers");
    let parent = walkers
        .elites
        .iter()
        .find(|elite| Some(&elite.id) == robot.parent.as_ref())
        .unwrap();
    let passive = |code: u8| matches!(code, 2 | 5 | 6);
    for (place, before) in parent.body.voxels().iter() {
        let (before, after) = (before.code(), robot.body.voxels()[place].code());
        assert!(
            before == after || passive(before) && passive(after),
            "{place:?}: {before} became {after}"
        );
    }
    // It says on what, and whether the robot is physical.
    let audit: serde_json::Value =
        serde_json::from_str(&sandbox.read("taught/audit.json")).unwrap();
    assert_eq!(audit["robots"][0]["id"], robot.id);
    assert!(run.origin.is_some_and(|origin| origin.sha256.len() == 64));
    for command in [
        "eval -q -a taught --images 6 --cycles 1",
        "replay -q -a taught --robot best -o taught.png",
        "plot body -q -a taught -o body.svg",
        "report -q -a taught -o taught.html",
    ] {
        sandbox.run(command).ended(0, &[]);
    }
    // Its config is one that can be read, and asks for the same again.
    Config::load(&sandbox.path("taught/config.toml").to_string_lossy(), &[]).unwrap();
    // Another gait makes another training, with the same config.
    let is_other = |elite: &&Robot| {
        Some(&elite.id) != robot.parent.as_ref() && Gait::of(&elite.body).is_some()
    };
    let other = walkers.elites.iter().find(is_other).unwrap();
    let train = train
        .replace("top:3", &other.id)
        .replace("-o taught", "-o other");
    sandbox.run(&train).ended(0, &[]);
    sandbox
        .run("eval -q -a taught other --images 6 --cycles 1")
        .ended(0, &[]);
}

#[test]
fn a_training_ends_with_the_same_bytes_on_any_threads_and_after_any_stop() {
    let sandbox = sandbox();
    let train = |out: &str, more: &str| {
        format!(
            "train -q -a walkers --task 0|1 --robots top:2 {LITTLE} {VALIDATED} --set train.windows=20 -o {out} {more}"
        )
    };
    sandbox.run(&train("one", "--threads 1")).ended(0, &[]);
    sandbox.run(&train("two", "--threads 2")).ended(0, &[]);
    let same = ["run.json", "elites.csv", "training.json", "validation.json"];
    for file in same {
        let (one, two) = (
            sandbox.read(&format!("one/{file}")),
            sandbox.read(&format!("two/{file}")),
        );
        assert!(
            one.replace("\"name\":\"one\"", "") == two.replace("\"name\":\"two\"", ""),
            "{file}"
        );
    }
    // Killed at any moment, it has some of its rollouts; there may be no run.json yet.
    let whole: serde_json::Value =
        serde_json::from_str(&sandbox.read("one/training.json")).unwrap();
    let count = whole["rollouts"].as_array().unwrap().len();
    assert!(count >= 4, "{count}");
    for (kept, of_last) in [(0, 0), (1, 7), (1, 20), (count / 2, 3), (count - 1, 1000)] {
        let mut cut = unsummed(&whole);
        let batches = cut["rollouts"].as_array_mut().unwrap();
        batches.truncate(kept);
        if let Some(last) = batches.last_mut() {
            last.as_array_mut().unwrap().truncate(of_last);
        }
        // What is known of the robot on other images and of its verdict is known once it is the same.
        let found: &[&str] = if kept == count / 2 {
            &["validation.json", "audit.json", "audit.csv"]
        } else {
            &[]
        };
        for name in ["run.json", "elites.csv"].iter().chain(found) {
            _ = std::fs::remove_file(sandbox.path("two").join(name));
        }
        sandbox.write("two/training.json", cut.to_string());
        sandbox.run(&train("two", "--resume")).ended(0, &[]);
        for file in same {
            assert!(
                sandbox.read(&format!("one/{file}")) == sandbox.read(&format!("two/{file}")),
                "{kept} {of_last}: {file}"
            );
        }
    }
    assert!(
        files(&sandbox.path("two"))
            .keys()
            .all(|name| !name.contains("tmp"))
    );
    // After its end it goes on with more challengers, as if there had been as many from the start.
    let more = |options: &str| train("one", &format!("--set train.challengers=6 {options}"));
    sandbox.run(&more("--resume")).ended(0, &[]);
    let resumed = files(&sandbox.path("one"));
    sandbox.run(&more("--force")).ended(0, &[]);
    for file in same {
        assert!(resumed[file] == files(&sandbox.path("one"))[file], "{file}");
    }
    // Another training is not mixed with it.
    let other = train("two", "--resume --seed 9");
    sandbox.run(&other).ended(2, &["training.json", "--force"]);
}

/// A `training.json` as earlier versions wrote it: any of its rollouts may be left out.
fn unsummed(file: &serde_json::Value) -> serde_json::Value {
    let mut file = file.clone();
    file["format_version"] = 1.into();
    file.as_object_mut().unwrap().remove("checksum");
    file
}

#[test]
fn a_training_goes_on_from_no_batch_that_was_changed_left_out_or_repeated() {
    let sandbox = sandbox();
    let train = format!("train -q -a walkers --task 0|1 --robots top:2 {LITTLE} -o taught");
    sandbox.run(&train).ended(0, &[]);
    let whole: serde_json::Value =
        serde_json::from_str(&sandbox.read("taught/training.json")).unwrap();
    type Damage = fn(&mut Vec<serde_json::Value>);
    let damages: [Damage; 4] = [
        |batches| batches[0][3] = 0.25.into(),
        |batches| drop(batches.remove(0)),
        |batches| batches.swap(0, 1),
        |batches| batches.push(batches[0].clone()),
    ];
    for damage in damages {
        let mut damaged = whole.clone();
        damage(damaged["rollouts"].as_array_mut().unwrap());
        sandbox.write("taught/training.json", damaged.to_string());
        let before = files(&sandbox.path("taught"));
        sandbox
            .run(&format!("{train} --resume"))
            .ended(3, &["taught/training.json: checksum", "--force"]);
        assert!(files(&sandbox.path("taught")) == before);
    }
}

#[test]
fn a_response_that_was_measured_before_is_taken_and_changes_nothing() {
    let sandbox = sandbox();
    let train = |out: &str, more: &str| {
        let command =
            format!("train -q -a walkers --task 0|1 --robots top:2 {LITTLE} -o {out} {more}");
        sandbox.run(&command).ended(0, &[]);
        let log: serde_json::Value =
            serde_json::from_str(&sandbox.read(&format!("{out}/training.json"))).unwrap();
        log["rollouts"].clone()
    };
    let without = [train("one", ""), train("other-seed", "--seed 7")];
    // Fewer rollouts than train asks for would do; here are more.
    sandbox
        .run("response -q -a walkers --robots top:2 --images 60 --error 0")
        .ended(0, &[]);
    let with = [
        train("one", "--force"),
        train("other-seed", "--force --seed 7"),
    ];
    assert!(without == with);
    // It is what train begins with, for every seed: nothing of it is simulated again.
    assert_eq!(with[0][0], with[1][0]);
    assert_ne!(with[0][1], with[1][1]);
    let text = sandbox.read("walkers/response.json");
    let mut measured: serde_json::Value = serde_json::from_str(&text).unwrap();
    let first = &mut measured["robots"][0]["displacements"][0];
    *first = (first.as_f64().unwrap() + 0.5).into();
    let changed = first.clone();
    sandbox.write("walkers/response.json", measured.to_string());
    assert_eq!(train("one", "--force")[0][0], changed);
    // That of another seed, or of other physics, is not.
    std::fs::remove_file(sandbox.path("walkers/response.json")).unwrap();
    sandbox
        .run("response -q -a walkers --robots top:2 --images 60 --error 0 --seed 8")
        .ended(0, &[]);
    assert!(train("one", "--force") == without[0]);
    sandbox.write("walkers/response.json", &text);
    assert_ne!(
        train("one", "--force --set physics.gravity=90")[0],
        without[0][0]
    );
    // One that is damaged is said, and measured again.
    sandbox.write("walkers/response.json", "{");
    assert!(train("one", "--force") == without[0]);
}

#[test]
fn the_best_of_many_windows_is_what_a_training_with_that_margin_is() {
    let sandbox = sandbox();
    let train = |out: &str, more: &str| {
        let command =
            format!("train -a walkers --task 0|1 --robots top:2 {LITTLE} -o {out} {more}");
        let said = sandbox.run(&command).ended(0, &[]);
        (said, sandbox.run_file(out))
    };
    let (said, found) = train("found", "--set train.windows=20");
    let margin = found.config.stimulus.margin;
    assert!(!margin.is_none(), "{said:?}");
    assert!(
        said.err.contains(&format!("stimulus.margin = {margin}")),
        "{said:?}"
    );
    // What is asked for is in config.toml, what came of it in run.json.
    let asked = Config::load(&sandbox.path("found/config.toml").to_string_lossy(), &[]).unwrap();
    assert_eq!((asked.train.windows, found.config.train.windows), (20, 0));
    assert_eq!(found.origin.as_ref().unwrap().windows, 20);
    let parent = found.elites[0].parent.clone().unwrap();
    // Named by hand, for that gait alone, it gives the same robot.
    let by_hand = format!(
        "train -q -a walkers --task 0|1 --robots {parent} {LITTLE} -o hand --set stimulus.reduction=area"
    );
    sandbox
        .run(&format!(
            "{by_hand} --set stimulus.margin={}",
            margin.to_string().replace(' ', "")
        ))
        .ended(0, &[]);
    let hand = sandbox.run_file("hand");
    assert_eq!(
        (&hand.elites, &hand.training_images),
        (&found.elites, &found.training_images)
    );
    assert_eq!(hand.config.stimulus, found.config.stimulus);
    // Another number of windows is another training.
    let other = format!(
        "train -q -a walkers --task 0|1 --robots top:2 {LITTLE} --set train.windows=21 -o found"
    );
    sandbox
        .run(&format!("{other} --resume"))
        .ended(2, &["training.json"]);
    // A robot that keeps its own sensors keeps its window, too.
    sandbox
        .run(
            "train -q -a found --task 0|1 --robots all --set train.rounds=0 --set train.windows=20 \
             --set train.challengers=0 --set train.images=4 --set train.final_images=4 \
             --set validation.images=40 --set validation.best=0 -o kept",
        )
        .ended(0, &[]);
    let kept = sandbox.run_file("kept");
    assert_eq!(
        (kept.config.stimulus, kept.elites[0].body.clone()),
        (found.config.stimulus, found.elites[0].body.clone())
    );
    assert_eq!(kept.origin.unwrap().windows, 0);
}

#[test]
fn without_rounds_the_fittest_robot_is_refined_as_it_is() {
    let sandbox = sandbox();
    // Of those that have something to train.
    let walkers = sandbox.run_file("walkers").elites;
    let able = walkers
        .into_iter()
        .filter(|robot| robot.body.counts().sensor > 0);
    let fittest = able
        .max_by(|a, b| a.objective.total_cmp(&b.objective))
        .unwrap();
    let train = |challengers: u32, out: &str| {
        let set = format!(
            "--set train.rounds=0 --set train.final_images=20 --set train.challengers={challengers}"
        );
        let train = format!("train -q -a walkers --task 3|14 --robots all {LITTLE} {set} -o {out}");
        sandbox.run(&train).ended(0, &[]);
        let run = sandbox.run_file(out);
        (run.elites[0].body.clone(), run.elites[0].parent.clone())
    };
    assert_eq!(
        train(0, "own"),
        (fittest.body.clone(), Some(fittest.id.clone()))
    );
    // In whichever order they are named.
    let mut named: Vec<String> = sandbox
        .run_file("walkers")
        .elites
        .into_iter()
        .map(|robot| robot.id)
        .collect();
    named.sort_by_key(|id| *id == fittest.id);
    let last = format!(
        "train -q -a walkers --task 3|14 --robots {} {LITTLE} --set train.rounds=0 --set train.challengers=0 -o last",
        named.join(",")
    );
    sandbox.run(&last).ended(0, &[]);
    assert_eq!(
        sandbox.run_file("last").elites[0].parent,
        Some(fittest.id.clone())
    );
    // One that is beaten is another.
    let (body, parent) = train(40, "refined");
    assert!(body != fittest.body && parent.as_ref() == Some(&fittest.id));
}

#[test]
fn what_cannot_be_trained_is_one_clear_error_and_writes_nothing() {
    let sandbox = sandbox();
    let refused = |options: &str, code: i32, words: &[&str]| {
        sandbox
            .run(&format!("train -q -a walkers -o refused {options}"))
            .ended(code, words);
        assert!(!sandbox.path("refused/run.json").exists(), "{options}");
    };
    refused("--task 4", 2, &["4|9"]);
    refused("--task 4|", 2, &["4|9"]);
    refused("--task 4|4", 2, &["4|4"]);
    refused("--task a|b", 2, &["a|b"]);
    refused("--task 3|10,11", 3, &["class 10"]);
    refused(
        "--task 0|1 --set train.images=1",
        3,
        &["train.images = 1", "--set"],
    );
    let few = "--set train.final_images=3";
    refused(&format!("--task 3|14 {few}"), 3, &[few, "4"]);
    refused(
        "--task 0|1 --set train.random_images=5",
        3,
        &["train.random_images = 5"],
    );
    refused(
        "--task 0|1 --set train.random_images=1000000000000000000",
        3,
        &["train.random_images", "100000"],
    );
    refused(
        "--task 0|1 --set train.perturbations.start=101",
        3,
        &["train.perturbations.start", "100"],
    );
    refused("--task 0|1 --set train.round=5", 2, &["rounds"]);
    let stride = "--task 0|1 --set stimulus.reduction=stride --set train.windows=10";
    refused(
        stride,
        3,
        &["train.windows = 10", "stimulus.reduction \"area\""],
    );
    refused(
        "--task 0|1 --set train.windows=10001",
        3,
        &["train.windows = 10001", "10000"],
    );
    refused(
        "--task 0|1 --set stimulus.margin=[1,2,3]",
        2,
        &["stimulus.margin", "[top, right, bottom, left]"],
    );
    let nothing = "--task 0|1 --set stimulus.margin=[20,0,8,0]";
    refused(nothing, 3, &["stimulus.margin", "[20, 0, 8, 0]"]);
    let deep = "train.".repeat(10_000);
    refused(&format!("--task 0|1 --set {deep}rounds=1"), 2, &["16"]);
    refused("--task 0|1 --set validation.images=100000", 3, &["100000"]);
    refused("--task 0|1 --robots nobody", 3, &["nobody"]);
    // What is said elsewhere, or is the gaits' own, is no key.
    refused(
        "--task 0|1 --set body.height=4",
        3,
        &["body = 4 × 5 voxels", "5 × 5"],
    );
    refused("--task 0|1 --set task.groups=[[3],[4]]", 3, &["task: "]);
    refused("--task 0|1 --seed 4 --set seed=3", 3, &["seed = 3", "4"]);
    // One that no image can move.
    let mut run = sandbox.run_file("walkers");
    let mut blind = run.elites[0].clone();
    blind.body = "33333/44444/11111/33333/44444".parse().unwrap();
    blind.genome = blind.genome.with_body(&blind.body).unwrap();
    (blind.id, blind.voxels) = (blind.genome.id(), blind.body.counts());
    blind.cell = blind.bins();
    run.elites = vec![blind];
    run.stats = run
        .archive()
        .unwrap()
        .stats(run.dimensions.possible_cells, run.config.archive.qd_offset);
    sandbox.write("blind/run.json", run.to_json());
    let said = sandbox.run("train -q -a blind --task 0|1 -o refused");
    let said = said.ended(3, &["blind/run.json", "--robots"]);
    assert_eq!(said.err.matches("error:").count(), 1, "{said:?}");
    assert!(!sandbox.path("refused").exists());
    sandbox
        .run("train -q -a walkers --task 0|1 -o walkers")
        .ended(2, &["--out walkers"]);
    sandbox
        .run("train -q -a blind --task 0|1 -o walkers")
        .ended(3, &["blind/run.json"]);
    // A run and a training do not go on with each other.
    let before = files(&sandbox.path("walkers"));
    sandbox
        .run("train -q -a walkers --task 0|1 -o walkers --resume")
        .ended(5, &["walkers"]);
    assert_eq!(files(&sandbox.path("walkers")), before);
    // Nor does it replace its own gaits, by whichever name.
    for out in ["walkers", "./walkers", "walkers/../walkers/"] {
        sandbox
            .run(&format!("train -q -a walkers --task 0|1 -o {out} --force"))
            .ended(2, &["--out "]);
    }
    assert_eq!(files(&sandbox.path("walkers")), before);
    std::fs::write(sandbox.path("walkers").join("training.json"), "{}").unwrap();
    sandbox
        .run("evolve -q -c run.toml -o walkers --resume")
        .ended(5, &["walkers", "train --resume"]);
}

/// An IDX dataset of noise in `letters`, with classes as EMNIST's letters have them, from 1.
fn write_letters(sandbox: &Sandbox) {
    const SIDE: usize = 5;
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
    for (split, count) in [("train", 26 * 8_u32), ("t10k", 26 * 4)] {
        let pixels = (0..count * (SIDE * SIDE) as u32)
            .map(|place| place.wrapping_mul(2_654_435_761).to_be_bytes()[0]);
        let images = [header(&[count, SIDE as u32, SIDE as u32]), pixels.collect()].concat();
        let labels = [
            header(&[count]),
            (0..count).map(|image| (1 + image % 26) as u8).collect(),
        ]
        .concat();
        sandbox.write(&format!("letters/{split}-images-idx3-ubyte"), images);
        sandbox.write(&format!("letters/{split}-labels-idx1-ubyte"), labels);
    }
}

#[test]
fn a_class_above_nine_is_never_taken_for_its_digits() {
    let sandbox = sandbox();
    write_letters(&sandbox);
    let letters = "--data letters --set data.dataset=letters";
    let quick = format!("--robots top:2 {LITTLE} --set train.challengers=0 {letters}");
    let said = ["groups 1|26: ", "\"1|26,\"", "\"1|2,6\""];
    sandbox
        .run(&format!("train -q -a walkers --task 1|26 {quick}"))
        .ended(2, &said);
    sandbox
        .run(&format!("response -q -a walkers --task 1|26 {letters}"))
        .ended(2, &said);
    let plan = |task: &str| {
        let plan = format!(
            "archive = \"walkers\"\nrobots = \"top:2\"\nseeds = [1]\ngroups = [\"{task}\"]\n\
             set = [\"data.dataset=letters\", \"validation.best=0\", \"train.rounds=1\", \
             \"train.random_images=20\", \"train.challengers=0\", \"train.final_images=4\", \"train.images=4\"]\n"
        );
        sandbox.write("plan.toml", plan);
        sandbox.run("sweep plan.toml --out swept --data letters --jobs 1")
    };
    plan("1|26").ended(2, &said);
    assert!(!sandbox.path("swept").exists() && !sandbox.path("walkers-1v26").exists());

    // Both have a spelling, a name and a folder of their own.
    for (task, name, groups) in [
        ("1|26,", "1|26,", [vec![1], vec![26]]),
        ("1|2,6", "1|26", [vec![1], vec![2, 6]]),
    ] {
        plan(task).ended(0, &[]);
        let folder = format!("walkers-{}", name.replace('|', "v"));
        sandbox
            .run(&format!("train -q -a walkers --task {task} {quick}"))
            .ended(0, &[]);
        for folder in [folder.clone(), format!("swept/{folder}-seed1")] {
            let run = sandbox.run_file(&folder);
            assert_eq!(
                (run.config.task.groups, run.dimensions.tasks),
                (Some(groups.clone()), vec![name.to_string()])
            );
            sandbox
                .run(&format!("eval -q -a {folder} --images 6 --cycles 1"))
                .ended(0, &[]);
        }
        let response = format!(
            "response -q -a walkers --robots top:2 --task {task} {letters} -n 60 -o response.json"
        );
        sandbox.run(&response).ended(0, &[]);
        assert!(
            sandbox
                .read("response.json")
                .contains(&format!("\"task\":\"{name}\""))
        );
    }

    // What an older version called 1|26 is what its groups say.
    let older = sandbox
        .read("walkers-1v26,/run.json")
        .replace("1|26,", "1|26");
    sandbox.write("older/run.json", older);
    sandbox
        .run("eval -q -a older --data letters --images 6 --cycles 1")
        .ended(0, &[]);
    sandbox
        .run("audit -q -a older --data letters")
        .ended(0, &[]);
    sandbox
        .run("report -q -a older --data letters -o older.html")
        .ended(0, &[]);
    let eval: serde_json::Value = serde_json::from_str(&sandbox.read("older/eval.json")).unwrap();
    assert!(
        eval["means"]["1|26"].is_object() && eval["baselines"]["1|26"].is_object(),
        "{eval}"
    );
    assert_eq!(
        eval["robots"][0]["per_class"]
            .as_object()
            .unwrap()
            .keys()
            .collect::<Vec<_>>(),
        ["1", "26"]
    );
}

#[test]
fn a_training_that_compared_designs_without_a_class_can_still_be_read() {
    let sandbox = sandbox();
    let few = format!("{LITTLE} --set train.challengers=0 --set train.final_images=4");
    sandbox
        .run(&format!(
            "train -q -a walkers --task 3|14 --robots top:2 {few} -o taught"
        ))
        .ended(0, &[]);
    let mut run = sandbox.run_file("taught");
    let shown: BTreeSet<u8> = run
        .training_images
        .iter()
        .map(|image| image.label)
        .collect();
    assert_eq!(
        shown,
        BTreeSet::from([1, 3, 4]),
        "four images show every class"
    );
    // As older versions ended.
    let place = run
        .training_images
        .iter()
        .position(|image| image.label == 4)
        .unwrap();
    run.training_images[place].label = 1;
    let rest = |image: &ImageRef| image.label != 3;
    run.read_sha256 = None;
    sandbox.write("older/run.json", run.to_json());
    RunFile::read(&sandbox.path("older/run.json")).unwrap();
    // But not without one of its groups.
    run.training_images.retain(rest);
    run.elites
        .iter_mut()
        .for_each(|robot| robot.displacements.truncate(run.training_images.len()));
    sandbox.write("older/run.json", run.to_json());
    let error = RunFile::read(&sandbox.path("older/run.json")).unwrap_err();
    assert!(error.message.contains("training_images"), "{error}");
}

/// A config of a tiny run, as different from others as those that are valid can be.
fn any_config() -> impl Strategy<Value = String> {
    let task = (
        proptest::sample::subsequence((0..10).collect::<Vec<u8>>(), 2..6),
        1_usize..6,
        0..4,
    )
        .prop_map(|(classes, cut, kind)| match kind {
            0 if classes.len() < 5 => format!("splits = {classes:?}\nsame_way_bin = true"),
            1 if classes.len() < 5 => format!("splits = {classes:?}"),
            _ => {
                let (a, b) = classes.split_at(cut.min(classes.len() - 1));
                format!("groups = [{a:?}, {b:?}]")
            }
        });
    let body = (1_usize..6, 1_usize..6, 0_usize..3);
    let task_and_data = (task, 1_usize..4, any::<bool>());
    let fitness = proptest::sample::select(vec!["min", "mean_clipped", "response"]);
    let sizes = (
        0_u64..3,
        1_u64..5,
        0_u64..3,
        proptest::option::of(1_usize..4),
    );
    let showing = (1_u32..8, 2_u32..5, -3_i32..4, any::<bool>(), 0.0..1.0_f64);
    let measured = (-1e9..1e9_f64, 0_usize..3, 1_u64..4, any::<u32>());
    let train = (
        20_usize..24,
        0_usize..3,
        2_usize..8,
        2_usize..12,
        0_usize..3,
        0_u32..3,
    );
    (body, task_and_data, fitness, sizes, showing, measured, train).prop_map(
        |(body, (task, per_class, is_drawn), fitness, sizes, showing, measured, train)| {
            let (height, width, min_muscles) = body;
            let (initial, parents, immigrants, keep) = sizes;
            let (steps, row, column, is_fresh, voxel_mutations) = showing;
            let (offset, best, generations, seed) = measured;
            let (random_images, rounds, images, final_images, challengers, start) = train;
            let keep = keep.map_or(String::new(), |keep| format!("keep = {keep}"));
            let rollout = if is_fresh { "fresh" } else { "sequential" };
            let encoding = if is_drawn { "intensity" } else { "saturated" };
            format!(
                "seed = {seed}\ngenerations = {generations}\n\
                 [body]\nheight = {height}\nwidth = {width}\nmin_muscles = {min_muscles}\n\
                 [task]\n{task}\n[data]\ndataset = \"builtin\"\nimages_per_class = {per_class}\n\
                 [stimulus]\nreduction = \"area\"\nencoding = \"{encoding}\"\n\
                 [protocol]\nrollout = \"{rollout}\"\ncontrol_steps = {steps}\nstart_row = {row}\n\
                 start_column = {column}\n[genome]\nvoxel_mutations = {voxel_mutations}\n\
                 [map_elites]\ninitial = {initial}\nparents = {parents}\nrandom_immigrants = {immigrants}\n\
                 [archive]\nqd_offset = {offset}\n{keep}\n[evaluation]\nfitness = \"{fitness}\"\n\
                 [validation]\nimages = 40\nbest = {best}\n\
                 [train]\nimages_per_class = 10\nrandom_images = {random_images}\nrounds = {rounds}\n\
                 images = {images}\nfinal_images = {final_images}\nchallengers = {challengers}\n\
                 perturbations.start = {start}\n"
            )
        },
    )
}

/// Evolves and trains what a config says; how many runs that made. Whatever ended without an error
/// is read again, and what ended with one has written nothing that cannot be.
fn made_by(config: &str, groups: &str) -> usize {
    let sandbox = Sandbox::new();
    let read = |folder: &str| {
        let run = RunFile::read(&sandbox.path(folder).join("run.json"));
        run.unwrap_or_else(|error| panic!("{error}\n{groups}\n{config}"))
    };
    let Ok(config) = Config::parse(config, "any.toml", &[]) else {
        return 0;
    };
    let if_exists = IfExists::Refuse;
    let options = evolve::EvolveOptions {
        config: config.clone(),
        name: "any".to_string(),
        out: sandbox.path("any"),
        if_exists,
    };
    if evolve::evolve(&options, &Session::default().threads(Some(1))).is_err() {
        assert!(!sandbox.path("any/run.json").exists());
        return 0;
    }
    assert_eq!(
        Config::load(&sandbox.path("any/config.toml").to_string_lossy(), &[]).unwrap(),
        config
    );
    if read("any").elites.is_empty() {
        return 1;
    }
    let options = train::TrainOptions {
        archive: sandbox.path("any/run.json"),
        robots: Selection::Top(3),
        groups: groups.parse().unwrap(),
        seed: None,
        set: Vec::new(),
        name: "taught".to_string(),
        out: sandbox.path("taught"),
        if_exists,
    };
    match train::train(&options, &Session::default().threads(Some(1))) {
        Ok(_) => {
            let taught = read("taught");
            Config::load(&sandbox.path("taught/config.toml").to_string_lossy(), &[]).unwrap();
            assert_eq!(taught.elites.len(), 1);
            2
        }
        Err(_) => {
            assert!(!sandbox.path("taught/run.json").exists());
            1
        }
    }
}

#[test]
fn whatever_is_valid_evolves_and_trains_to_runs_that_can_be_read() {
    let groups = proptest::sample::select(vec!["0|1", "3|14", "02468|13579", "7|0123"]);
    let mut runner = TestRunner::new_with_rng(
        proptest::test_runner::Config {
            cases: 60,
            failure_persistence: None,
            ..Default::default()
        },
        TestRng::deterministic_rng(RngAlgorithm::ChaCha),
    );
    let made = [const { AtomicUsize::new(0) }; 3];
    let ran = runner.run(&(any_config(), groups), |(config, groups)| {
        made[made_by(&config, groups)].fetch_add(1, Ordering::Relaxed);
        Ok(())
    });
    ran.unwrap();
    let [none, one, both] = made.map(|count| count.into_inner());
    assert!(one > 5 && both > 10, "{none} {one} {both}");
}

#[test]
fn evolve_with_train_ends_with_the_robot_that_train_makes_of_its_gaits() {
    let sandbox = Sandbox::new();
    let little =
        "[train]\nrandom_images = 24\nrounds = 1\nimages = 8\nfinal_images = 6\nchallengers = 2\n";
    let validation = "[validation]\nimages = 40\nbest = 0\n";
    sandbox.write("gaits.toml", format!("{}\n{little}{validation}", gaits()));
    sandbox.write(
        "four.toml",
        TINY.replace("groups = [[0], [1]]", "splits = [0, 1, 2]"),
    );
    sandbox
        .run("evolve -q -c four.toml --train -o refused")
        .ended(2, &["--train", "task.groups"]);
    assert!(!sandbox.path("refused").exists());
    let said = sandbox
        .run("evolve -c gaits.toml --train --replay -o runs/one")
        .ended(0, &["runs/one-0v1"]);
    let robot = sandbox.run_file("runs/one-0v1").elites[0].clone();
    assert!(said.out.contains(&robot.id), "{said:?}");
    // It says how far it is in every step.
    for step in [" 24/24 ", " 8/8 ", " 2/2 "] {
        assert!(said.err.contains(step), "{step}: {}", said.err);
    }
    assert!(
        sandbox
            .path(&format!("runs/one-0v1/replay-{}.gif", robot.id))
            .exists()
    );
    assert!(sandbox.path("runs/one-0v1/audit.json").exists());
    sandbox
        .run("train -q -a runs/one --task 0|1 --set validation.best=0 -o by_hand")
        .ended(0, &[]);
    assert_eq!(sandbox.run_file("by_hand").elites[0], robot);
    // What is done is not done again; nothing is replaced unasked.
    let before = files(&sandbox.path("runs/one-0v1"))["run.json"].clone();
    sandbox
        .run("evolve -q -c gaits.toml --train -o runs/one")
        .ended(5, &["runs/one"]);
    sandbox
        .run("evolve -q -c gaits.toml --train -o runs/one --resume")
        .ended(0, &[]);
    assert_eq!(files(&sandbox.path("runs/one-0v1"))["run.json"], before);
    // That the folder of the training is taken is known before gaits evolve.
    std::fs::create_dir(sandbox.path("other")).unwrap();
    std::fs::rename(sandbox.path("runs/one-0v1"), sandbox.path("other/two-0v1")).unwrap();
    sandbox
        .run("evolve -q -c gaits.toml --train -o other/two")
        .ended(5, &["other/two-0v1"]);
    assert!(!sandbox.path("other/two").exists());
}

#[test]
fn keys_that_a_training_has_otherwise_are_refused() {
    let sandbox = sandbox();
    for key in [
        "generations=5",
        "data.images_per_class=7",
        "evaluation.fitness=response",
        "evaluation.fitness=min",
        "protocol.rollout=sequential",
    ] {
        let name = key.split('=').next().unwrap();
        sandbox
            .run(&format!(
                "train -a walkers --task 0|1 {LITTLE} --set {key} -o none"
            ))
            .ended(3, &[name]);
    }
    sandbox
        .run(&format!(
            "train -a walkers --task 0|1 --robots best-validation:1 {LITTLE} -o none"
        ))
        .ended(2, &["--robots best-validation"]);
    assert!(!sandbox.path("none").exists());
}

#[test]
fn a_small_dataset_is_divided_between_training_and_validation() {
    let sandbox = sandbox();
    let small = "--set data.builtin.train_per_class=60";
    let train = format!("train -a walkers --task 0|1 --robots top:2 {LITTLE} {VALIDATED} {small}");
    sandbox
        .run(&format!(
            "{train} --set validation.images=400 --set train.challengers=0 -o taught"
        ))
        .ended(0, &["40 images", "400"]);
    let config = sandbox.run_file("taught").config;
    assert_eq!(
        (config.data.images_per_class, config.validation.images),
        (40, 40)
    );
    // So few that neither goes.
    let fewer = train.replace("=60", "=30");
    sandbox
        .run(&format!("{fewer} -o none"))
        .ended(3, &["validation.images", "train.images_per_class"]);
}

#[test]
fn what_a_training_lacks_is_said_before_its_gaits_evolve() {
    let sandbox = Sandbox::new();
    sandbox.write(
        "run.toml",
        TINY.replace("train_images = [0, 1]", "builtin.train_per_class = 30"),
    );
    sandbox
        .run("evolve -c run.toml --train -o none")
        .ended(3, &["validation.images", "train.images_per_class"]);
    assert!(!sandbox.path("none").exists());
}

#[test]
fn an_evolution_goes_on_whatever_its_training_is_to_be() {
    let sandbox = Sandbox::new();
    sandbox.write("run.toml", gaits());
    sandbox
        .run("evolve -q -c run.toml -g 2 -o run")
        .ended(0, &[]);
    sandbox
        .run("evolve -q -c run.toml -g 3 -o run --resume --set train.challengers=6")
        .ended(0, &[]);
    assert_eq!(sandbox.run_file("run").config.train.challengers, 6);
}

#[test]
fn gaits_have_no_task_to_be_tested_or_audited_on() {
    let sandbox = Sandbox::new();
    sandbox.write("run.toml", gaits());
    let said = sandbox.run("evolve -c run.toml -g 2 -o run").ended(0, &[]);
    assert!(
        said.err.contains("morphcog train --archive run/run.json"),
        "{said:?}"
    );
    for command in ["eval -a run", "audit -a run", "team -a run"] {
        sandbox
            .run(command)
            .ended(3, &["morphcog train --archive run/run.json"]);
    }
    sandbox
        .run("evolve -c run.toml --set validation.best=1 -o none")
        .ended(3, &["validation.best"]);
}

#[test]
fn images_of_an_earlier_training_never_validate_a_later_one() {
    let sandbox = sandbox();
    let train = |from: &str, out: &str, seed: u64| {
        let data = format!("--set data.builtin.seed={seed}");
        sandbox
            .run(&format!(
                "train -q -a {from} --task 0|1 --robots top:2 {LITTLE} \
                 --set train.challengers=0 {data} -o {out}"
            ))
            .ended(0, &[]);
        sandbox.run_file(out)
    };
    let first = train("walkers", "first", 1);
    let second = train("first", "second", 2);
    let third = train("second", "third", 1);
    let of = |run: &morphcog::store::run::RunFile| run.origin.clone().unwrap();
    let elsewhere = of(&second).elsewhere;
    assert!(
        elsewhere
            .iter()
            .any(|other| other.train_sha256 == first.dataset.train_sha256)
    );
    let before = of(&third).trained_on;
    assert!(
        first
            .training_images
            .iter()
            .all(|image| before.contains(&image.index)),
        "{}",
        before.len()
    );
    // Also those that it drew and was not shown last.
    let drawn = TrainingImages::indices(
        &first.config,
        &load_dataset(&first.config, None, &[Split::Train]).unwrap(),
    );
    let drawn = drawn.unwrap();
    assert!(
        drawn.len() > first.training_images.len()
            && drawn.iter().all(|index| before.contains(index))
    );
}

#[test]
fn what_was_made_for_images_of_one_size_is_never_applied_to_another_without_a_word() {
    let sandbox = Sandbox::new();
    sandbox.write("run.toml", TINY.replace("\"area\"", "\"area\"\nmargin = 4"));
    let evolved = sandbox.run("evolve -c run.toml -o walkers").ended(0, &[]);
    let part = "20 × 20 of 28 × 28";
    assert!(evolved.out.contains(part), "{}", evolved.out);
    let margins = |run: &str| sandbox.run_file(run).config.stimulus.margin.to_string();
    let train = format!(
        "train -a walkers --task 0|1 --robots top:2 {LITTLE} --set train.challengers=0 --set data.dataset=own"
    );
    for (size, height, width) in [("square", 14, 14), ("narrow", 17, 5)] {
        write_images(&sandbox, &format!("{size}/"), [height, width], 1);
        let whole = format!("{height} × {width}");
        let said = sandbox.run(&format!("{train} --data {size} -o {size}-taught"));
        let said = said.ended(0, &["stimulus.margin = 4", "28 × 28", &whole]);
        assert!(said.out.contains(&whole), "{}", said.out);
        assert_eq!(margins(&format!("{size}-taught")), "0");
    }
    // What is asked for is done, and said.
    let asked = format!("{train} --data square --set stimulus.margin=4 -o asked");
    sandbox.run(&asked).ended(0, &["6 × 6 of 14 × 14"]);
    assert_eq!(margins("asked"), "4");
    let nothing = format!("{train} --data narrow --set stimulus.margin=4 -o none");
    sandbox.run(&nothing).ended(3, &["stimulus.margin"]);
    // Of the same size, what the gaits see is seen.
    sandbox
        .run(&format!(
            "train -q -a walkers --task 0|1 --robots top:2 {LITTLE} -o same"
        ))
        .ended(0, &[]);
    assert_eq!(margins("same"), "4");
    let response = "response -a walkers --robots top:1 --images 60 --task 0|1 --set data.dataset=own \
                    --data square --out response.json";
    sandbox.run(response).ended(0, &["28 × 28", "14 × 14"]);
    let measured: serde_json::Value = serde_json::from_str(&sandbox.read("response.json")).unwrap();
    assert!(measured["stimulus"].get("margin").is_none(), "{measured}");
    let eval = "eval -a walkers --robots top:1 --images 4 --cycles 1 --dataset own --data square";
    sandbox.run(eval).ended(0, &["28 × 28", "6 × 6 of 14 × 14"]);
}
