//! Selection on validation images: from the training split, never trained on; the same every time;
//! kept beside the run.

use crate::common::program::{Made, Sandbox, TINY};
use morphcog::base::observer::{Generation, Observer};
use morphcog::base::session::Session;
use morphcog::base::stop::NEVER;
use morphcog::commands::evolve::{EvolveOptions, evolve};
use morphcog::config::Config;
use morphcog::data::dataset::Split;
use morphcog::images::held_out::images;
use morphcog::images::training::TrainingImages;
use morphcog::images::whereabouts::load_dataset;
use morphcog::store::audit::AuditFile;
use morphcog::store::eval::EvalFile;
use morphcog::store::folder::IfExists;
use morphcog::store::images::HeldOut;
use morphcog::store::run::Robot;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// A run that is trained on several images of each class.
fn sandbox() -> Sandbox {
    static RUN: OnceLock<Made> = OnceLock::new();
    once(
        &RUN,
        &TINY.replace("train_images = [0, 1]", "images_per_class = 3"),
        &[],
    )
}

/// A run of few robots that chose the best two of them at its end.
fn validated() -> Sandbox {
    static RUN: OnceLock<Made> = OnceLock::new();
    once(&RUN, &validating(), &["validating"])
}

fn validating() -> String {
    format!("{TINY}\n[archive]\nkeep = 4\n[validation]\nimages = 40\nbest = 2\n")
}

/// A sandbox with `run.toml` and its run, which is made once and says `words`.
fn once(run: &OnceLock<Made>, config: &str, words: &[&str]) -> Sandbox {
    Sandbox::once(run, |sandbox| {
        sandbox.write("run.toml", config);
        sandbox.run("evolve -c run.toml -o run").ended(0, words);
    })
}

fn eval(sandbox: &Sandbox, options: &str) -> EvalFile {
    sandbox
        .run(&format!(
            "eval -q --archive run/run.json --images 20 --cycles 1 {options}"
        ))
        .ended(0, &[]);
    serde_json::from_str(&sandbox.read("run/eval.json")).unwrap()
}

#[test]
fn validation_images_are_of_the_training_split_and_were_never_trained_on() {
    let sandbox = sandbox();
    let run = sandbox.run_file("run");
    let dataset = load_dataset(&run.config, None, &[Split::Train]).unwrap();
    // All that there are: whatever was trained on is left out.
    let trained: std::collections::BTreeSet<usize> = TrainingImages::indices(&run.config, &dataset)
        .unwrap()
        .into_iter()
        .collect();
    assert_eq!(trained.len(), 6);
    let of_class = |class| {
        dataset
            .indices_of(Split::Train, class)
            .iter()
            .filter(|i| !trained.contains(i))
            .count()
    };
    let most = 2 * of_class(0).min(of_class(1));
    let drawn = images(&[&run], &dataset, Some("images"), most).unwrap();
    assert_eq!(drawn.len(), most);
    assert!(drawn.iter().all(|image| !trained.contains(&image.index)));
    assert!(
        drawn
            .iter()
            .all(|image| dataset.label(Split::Train, image.index).unwrap() == image.label)
    );
    // Classes take turns: a round on the first of them is fair, too.
    assert_eq!(
        drawn[..20].iter().filter(|image| image.label == 0).count(),
        10
    );
    assert!(images(&[&run], &dataset, Some("images"), 10 * most).is_err());
}

#[test]
fn the_best_on_validation_images_are_found_the_same_every_time_and_kept() {
    let sandbox = sandbox();
    let first = eval(
        &sandbox,
        "--robots best-validation:3 --validation 40 --threads 1",
    );
    assert_eq!(first.robots.len(), 3);
    assert!(first.selected.contains("validation"), "{}", first.selected);
    let accuracies: Vec<f64> = first
        .robots
        .iter()
        .map(|robot| robot.validation.as_ref().unwrap().balanced_accuracy)
        .collect();
    assert!(accuracies.is_sorted_by(|a, b| a >= b), "{accuracies:?}");
    assert!(
        first
            .robots
            .iter()
            .all(|robot| robot.validation.as_ref().unwrap().images == 40)
    );
    let kept = sandbox.read("run/validation.json");
    assert_eq!(
        eval(
            &sandbox,
            "--robots best-validation:3 --validation 40 --threads 3"
        ),
        first
    );
    // One that cannot be read stays.
    sandbox.write("run/validation.json", "{");
    sandbox
        .run("eval -q -a run/run.json --images 40 --robots best-validation:3 --validation 40")
        .ended(3, &["run/validation.json"]);
    assert_eq!(sandbox.read("run/validation.json"), "{");
    // Another run's is not believed.
    sandbox.write(
        "run/validation.json",
        kept.replace("\"key\":\"", "\"key\":\"0"),
    );
    assert_eq!(
        eval(&sandbox, "--robots best-validation:3 --validation 40"),
        first
    );
    // Selected otherwise, a robot has no such figure.
    assert_eq!(
        eval(&sandbox, "--robots top:2")
            .robots
            .iter()
            .filter(|robot| robot.validation.is_none())
            .count(),
        2
    );
}

#[test]
fn robots_are_compared_on_validation_images_without_a_look_at_the_test_images() {
    let sandbox = sandbox();
    let run = sandbox.run_file("run");
    let dataset = load_dataset(&run.config, None, &[Split::Train]).unwrap();
    let command = "eval --archive run/run.json --cycles 1 --split validation";
    let said = sandbox
        .run(&format!(
            "{command} --images 60 --robots best-validation:3 --validation 40"
        ))
        .ended(0, &[]);
    assert!(
        said.out.contains("60 builtin validation images"),
        "{}",
        said.out
    );
    // An evaluation on test images is not replaced.
    assert!(!sandbox.path("run/eval.json").exists());
    let report = EvalFile::read(&sandbox.path("run/eval-validation.json")).unwrap();
    assert_eq!(report.split, HeldOut::Validation);
    // By what robots were chosen, they are not compared.
    let selected = images(&[&run], &dataset, Some("images"), 40).unwrap();
    assert!(
        report.images.len() == 60 && report.images.iter().all(|image| !selected.contains(image))
    );
    // Nor are others of the run, or robots that are named, afterwards.
    sandbox
        .run(&format!("{command} --images 60 --robots top:1"))
        .ended(0, &[]);
    let report = EvalFile::read(&sandbox.path("run/eval-validation.json")).unwrap();
    assert!(
        report.images.len() == 60 && report.images.iter().all(|image| !selected.contains(image))
    );
    let best = EvalFile::read(&sandbox.path("run/eval-validation.json"))
        .unwrap()
        .robots[0]
        .id
        .clone();
    sandbox
        .run(&format!("{command} --images 60 --robots {best}"))
        .ended(0, &[]);
    let report = EvalFile::read(&sandbox.path("run/eval-validation.json")).unwrap();
    assert!(
        report.images.len() == 60 && report.images.iter().all(|image| !selected.contains(image))
    );
    // Robots of two runs: on images that neither was trained on.
    sandbox.write(
        "other.toml",
        sandbox.read("run.toml").replace("seed = 3", "seed = 2"),
    );
    sandbox
        .run("evolve -q -c other.toml -o other")
        .ended(0, &[]);
    let other = sandbox.run_file("other");
    assert_ne!(other.config.seed, run.config.seed);
    let both = "eval -q --archive run/run.json other/run.json --cycles 1 --split validation --images 60 --robots top:1";
    sandbox.run(both).ended(0, &[]);
    let report = EvalFile::read(&sandbox.path("eval-validation.json")).unwrap();
    assert_eq!(report.images.len(), 60);
    let turned = both.replace("run/run.json other/run.json", "other/run.json run/run.json");
    sandbox.run(&turned).ended(0, &[]);
    let turned = EvalFile::read(&sandbox.path("eval-validation.json")).unwrap();
    assert_eq!(turned.images, report.images);
    for run in [&run, &other] {
        let trained = TrainingImages::indices(&run.config, &dataset).unwrap();
        assert!(!trained.is_empty());
        assert!(
            report
                .images
                .iter()
                .all(|image| !trained.contains(&image.index))
        );
    }
    // What cannot be.
    sandbox
        .run(&format!("{command} --images 1000000"))
        .ended(3, &["--images 1000000"]);
    sandbox
        .run("eval --archive run/run.json --split train")
        .ended(2, &["--split"]);
    sandbox
        .run("capacity --eval run/eval-validation.json")
        .ended(3, &["run/eval-validation.json"]);
}

#[test]
fn a_run_that_asks_for_it_chooses_robots_at_its_end() {
    let sandbox = validated();
    // What it found is what eval finds, and is not looked for again: eval asks for as many images
    // as the config says.
    let kept = sandbox.read("run/validation.json");
    let archive = "--archive run/run.json --robots best-validation:2 --images 4";
    let said = sandbox.run(&format!("eval {archive}")).ended(0, &[]);
    assert!(!said.err.contains("validating"), "{}", said.err);
    assert_eq!(sandbox.read("run/validation.json"), kept);
    let report = EvalFile::read(&sandbox.path("run/eval.json")).unwrap();
    assert_eq!(report.robots.len(), 2);
    assert!(
        report
            .robots
            .iter()
            .all(|robot| robot.validation.as_ref().unwrap().images == 40)
    );
    // Who asks for fewer gets the first of those.
    let said = sandbox
        .run("eval --archive run/run.json --robots best-validation:1 --images 4")
        .ended(0, &[]);
    assert!(!said.err.contains("validating"), "{}", said.err);
    assert_eq!(sandbox.read("run/validation.json"), kept);
    let fewer = EvalFile::read(&sandbox.path("run/eval.json"))
        .unwrap()
        .robots;
    let ids = |robots: &[morphcog::store::eval::RobotReport]| {
        robots
            .iter()
            .map(|robot| robot.id.clone())
            .collect::<Vec<_>>()
    };
    assert_eq!((fewer.len(), ids(&fewer)), (1, ids(&report.robots[..1])));
    // A file of a newer version is not written over.
    let newer = kept.replace("\"format_version\":1", "\"format_version\":2");
    sandbox.write("run/validation.json", &newer);
    sandbox
        .run(&format!("eval {archive}"))
        .ended(3, &["run/validation.json: format_version"]);
    assert_eq!(sandbox.read("run/validation.json"), newer);
    std::fs::remove_file(sandbox.path("run/validation.json")).unwrap();
    sandbox
        .run(&format!("eval {archive}"))
        .ended(0, &["validating"]);
    assert_eq!(sandbox.read("run/validation.json"), kept);
    // A run that is resumed at its end, with nothing left to do, says it again.
    sandbox
        .run("evolve -c run.toml -o run --resume")
        .ended(0, &[]);
    assert_eq!(sandbox.read("run/validation.json"), kept);
}

#[test]
fn too_few_or_too_many_validation_images_are_refused() {
    let sandbox = sandbox();
    let with = |options: &str| {
        sandbox.run(&format!(
            "eval --archive run/run.json --robots best-validation {options}"
        ))
    };
    with("--validation 10").ended(2, &["--validation 10", "40"]);
    with("--validation 1000000").ended(3, &["--validation 1000000"]);
    sandbox
        .run("eval --archive run/run.json --validation 40")
        .ended(2, &["--validation", "best-validation"]);
}

#[test]
fn nothing_is_chosen_by_other_images_of_the_same_number() {
    let sandbox = validated();
    let other = sandbox.read("run/run.json");
    let sha256 = &sandbox.run_file("run").dataset.train_sha256;
    sandbox.write(
        "other/run.json",
        other.replace(sha256.as_str(), &"0".repeat(64)),
    );
    for options in [
        "--robots best-validation:1 --validation 40",
        "--robots top:1 --split validation",
    ] {
        sandbox
            .run(&format!(
                "eval --archive other/run.json --images 20 {options}"
            ))
            .ended(3, &["SHA-256", "--data"]);
    }
    for command in [
        "replay -a other/run.json -o x.png",
        "replay -a other -i test:1 -o x.png",
        "report other",
    ] {
        sandbox.run(command).ended(3, &["SHA-256"]);
    }
}

#[test]
fn a_run_that_will_leave_too_few_of_them_is_refused_before_it_begins() {
    let sandbox = Sandbox::new();
    // Training takes 30 of the 40 images of each class, and leaves 10 where 20 are asked for.
    let few = TINY.replace("[data]\n", "[data]\nbuiltin = { train_per_class = 40 }\n");
    let few = few.replace("train_images = [0, 1]", "images_per_class = 30");
    sandbox.write(
        "run.toml",
        format!("{few}[validation]\nimages = 40\nbest = 1\n"),
    );
    let refused = [
        "validation.images = 40",
        "20",
        "data.images_per_class",
        "validation.best",
    ];
    sandbox
        .run("evolve -q -c run.toml -o run")
        .ended(3, &refused);
    assert!(!sandbox.path("run").exists());
    // One that leaves none has none to be tested on, however many are asked for.
    sandbox.write(
        "all.toml",
        few.replace("images_per_class = 30", "images_per_class = 40"),
    );
    sandbox
        .run("evolve -q -c all.toml -o all -g 1 --set map_elites.initial=2")
        .ended(0, &[]);
    sandbox
        .run("eval -a all --split validation --images all")
        .ended(3, &["--images all: ", "class 0"]);
    // Nor is one begun in a folder that is there already.
    std::fs::create_dir(sandbox.path("empty")).unwrap();
    sandbox
        .run("evolve -q -c run.toml -o empty --resume")
        .ended(3, &refused);
    // Who does not choose any needs none.
    sandbox
        .run("evolve -q -c run.toml -o run -g 1 --set validation.best=0")
        .ended(0, &[]);
}

#[test]
fn those_that_are_best_on_validation_images_can_be_audited_by_themselves() {
    let sandbox = validated();
    std::fs::remove_file(sandbox.path("run/validation.json")).unwrap();
    let audit = "audit --archive run/run.json --robots best-validation:2 --set threshold=0";
    sandbox.run(audit).ended(0, &["validating"]);
    // Found before, they are not searched for again; eval finds the same.
    let said = sandbox.run(audit).ended(0, &[]);
    assert!(!said.err.contains("validating"), "{}", said.err);
    sandbox
        .run("eval -q --archive run/run.json --images 4 --robots best-validation:2")
        .ended(0, &[]);
    let best: EvalFile = serde_json::from_str(&sandbox.read("run/eval.json")).unwrap();
    let audit = AuditFile::read(&sandbox.path("run/audit.json")).unwrap();
    let mut audited: Vec<&String> = audit.robots.iter().map(|robot| &robot.id).collect();
    let mut expected: Vec<&String> = best.robots.iter().map(|robot| &robot.id).collect();
    audited.sort();
    expected.sort();
    assert_eq!((audited.len(), audited), (2, expected));
}

#[test]
fn evolve_itself_chooses_robots_at_its_end_and_so_whatever_calls_it() {
    /// Sets the flag, if there is one, after the first generation.
    struct Quiet<'a>(Option<&'a AtomicBool>);
    impl Observer for Quiet<'_> {
        fn generation(&self, now: &Generation) {
            self.0
                .iter()
                .filter(|_| now.done > 0)
                .for_each(|stop| stop.store(true, Ordering::Relaxed));
        }
        fn warning(&self, text: &str) {
            panic!("{text}");
        }
    }
    let sandbox = validated();
    let config = Config::parse(&validating(), "run.toml", &[]).unwrap();
    let options = |folder: &str| EvolveOptions {
        config: config.clone(),
        name: "run".to_string(),
        out: sandbox.path(folder),
        if_exists: IfExists::Refuse,
    };
    let finished = evolve(
        &options("library"),
        &Session::new(&NEVER, &Quiet(None)).threads(Some(1)),
    )
    .unwrap();
    assert!(!finished.stopped);
    assert_eq!(finished.validated.len(), 2);
    let first = &finished.validated[0];
    assert_eq!(
        (first.images, finished.best()),
        (40, Some(first.id.as_str()))
    );
    // The program does the same.
    assert_eq!(
        sandbox.read("library/validation.json"),
        sandbox.read("run/validation.json")
    );
    // Stopped before its last generation, a run chooses none.
    let stop = AtomicBool::new(false);
    let stopped = evolve(
        &options("stopped"),
        &Session::new(&stop, &Quiet(Some(&stop))).threads(Some(1)),
    )
    .unwrap();
    assert!(stopped.stopped && stopped.validated.is_empty());
    assert!(!sandbox.path("stopped/validation.json").exists());
}

#[test]
fn the_best_robot_is_the_first_on_validation_images_where_the_run_ranked_them_else_the_fittest() {
    let sandbox = validated();
    let run = sandbox.run_file("run");
    let fittest = run.best().unwrap();
    let text = sandbox.read("run/validation.json");
    let is_other = |robot: &&Robot| robot.id != fittest.id && !text.contains(&robot.id);
    let first = run.elites.iter().find(is_other).unwrap();
    // Robots of a tiny run are as good as each other on images they have not seen: so that it is
    // not the fittest by chance.
    let mut ranking: serde_json::Value = serde_json::from_str(&text).unwrap();
    ranking["robots"][0]["id"] = first.id.as_str().into();
    ranking["robots"][0]["task"] = first.task.as_str().into();
    sandbox.write("run/validation.json", ranking.to_string());
    let is_best = |id: &str| {
        sandbox
            .run("eval -q -a run/run.json --images 4 --cycles 1 --robots best")
            .ended(0, &[]);
        let report = EvalFile::read(&sandbox.path("run/eval.json")).unwrap();
        assert_eq!((report.robots.len(), report.robots[0].id.as_str()), (1, id));
        sandbox
            .run("audit -q -a run/run.json --robots best -o audit.json")
            .ended(0, &[]);
        let audit = AuditFile::read(&sandbox.path("audit.json")).unwrap();
        assert!(audit.robot(id).is_some() && audit.robots.len() == 1);
        sandbox.run("plot body -a run/run.json").ended(0, &[]);
        assert!(sandbox.path(&format!("run/plot-body-{id}.svg")).exists());
        sandbox
            .run("replay -a run/run.json --format png")
            .ended(0, &[]);
        assert!(sandbox.path(&format!("run/replay-{id}.png")).exists());
        for name in [
            "audit.json".to_string(),
            format!("run/plot-body-{id}.svg"),
            format!("run/replay-{id}.png"),
        ] {
            std::fs::remove_file(sandbox.path(&name)).unwrap();
        }
    };
    is_best(&first.id);
    // A ranking of what the run was before says nothing of it.
    ranking["run_sha256"] = "0".repeat(64).into();
    sandbox.write("run/validation.json", ranking.to_string());
    is_best(&fittest.id);
    // One that is broken is no reason to show another robot.
    sandbox.write("run/validation.json", &ranking.to_string()[..60]);
    sandbox
        .run("replay -a run/run.json --format png")
        .ended(3, &["run/validation.json"]);
    std::fs::remove_file(sandbox.path("run/validation.json")).unwrap();
    is_best(&fittest.id);
}
