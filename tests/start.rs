//! `[start]`: a run that begins with the elites of another.

mod common;

use common::program::{Sandbox, TINY, without_seconds};
use morphcog::run::Config;
use morphcog::run::archive::RunFile;
use morphcog::run::curriculum::Period;
use morphcog::run::evolve::{Observer, Options, Progress, evolve};
use morphcog::run::folder::{IfExists, RunFolder};
use morphcog::run::held_out::images;
use morphcog::run::start::StartRef;
use morphcog::run::training::{Training, load_dataset};
use morphcog::task::dataset::Split;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};

/// A run of all tasks of three digits, to start from.
fn other(sandbox: &Sandbox) -> RunFile {
    let splits = TINY.replace("groups = [[0], [1]]", "splits = [0, 1, 2]").replace("[0, 1]", "[0, 1, 2]");
    sandbox.write("other.toml", splits);
    sandbox.run("evolve -q -c other.toml -o other").ended(0, &[]);
    sandbox.run_file("other")
}

fn sandbox() -> (Sandbox, RunFile) {
    let sandbox = Sandbox::new();
    let other = other(&sandbox);
    let stages = "[[stage]]\ngenerations = 4\nimages_per_class = 2\nfitness = \"mean_clipped\"\n[[stage]]\nimages_per_class = 3\nkeep = 6";
    sandbox.write("run.toml", format!("{TINY}\n[start]\narchive = \"other/run.json\"\n{stages}\n"));
    (sandbox, other)
}

#[test]
fn a_run_begins_with_the_elites_of_another_evaluated_on_its_own_task() {
    let (sandbox, other) = sandbox();
    let said = sandbox.run("evolve -c run.toml -o run -g 1").ended(0, &[]);
    let count = other.elites.len();
    assert!(
        said.err.contains(&format!("starting from {count} elites of other, 12 generations old")),
        "{}",
        said.err
    );
    let run = sandbox.run_file("run");
    let start = run.start.as_ref().unwrap();
    assert_eq!((start.name.as_str(), start.generations, start.sha256.len()), ("other", 12, 64));
    let ids: BTreeSet<&str> = other.elites.iter().map(|robot| robot.id.as_str()).collect();
    let (old, new): (Vec<_>, Vec<_>) = run.elites.iter().partition(|robot| ids.contains(robot.id.as_str()));
    assert!(old.len() >= 3, "{} of {} are elites of the other run", old.len(), run.elites.len());
    // Who is new is an elite's child; nobody is random.
    assert!(new.iter().all(|robot| robot.parent.as_deref().is_some_and(|parent| ids.contains(parent))));
    assert!(run.elites.iter().all(|robot| robot.generation == 0 && robot.task == "0|1"));
    assert!(run.elites.iter().all(|robot| robot.displacements.len() == 4 && robot.cell.len() == 3));
    // The fittest of each of its tasks, if no more are asked for.
    let few = sandbox.read("run.toml").replacen("generations = 4", "generations = 4\nstart_with = 2", 1);
    sandbox.write("few.toml", few);
    let tasks: BTreeSet<&str> = other.elites.iter().map(|robot| robot.task.as_str()).collect();
    let of_task = |task: &str| other.elites.iter().filter(|robot| robot.task == task).count();
    let beginners: usize = tasks.iter().map(|task| of_task(task).min(2)).sum();
    assert!(tasks.len() > 1 && beginners < count);
    let words = format!("starting from {beginners} elites of other");
    sandbox.run("evolve -c few.toml -o few -g 1").ended(0, &[&words]);
    // Neither savings nor threads change how it begins.
    sandbox.run("evolve -q -c run.toml -o without --set savings.early_stop=false --set savings.known_bodies=false --threads 3 -g 1").ended(0, &[]);
    assert_eq!(sandbox.run_file("without").elites, run.elites);
}

#[test]
fn images_that_the_other_run_was_trained_on_are_not_for_validation() {
    let (sandbox, other) = sandbox();
    sandbox.run("evolve -q -c run.toml -o run -g 6").ended(0, &[]);
    // A start of a start.
    let again =
        sandbox.read("run.toml").replace("other/run.json", "run/run.json").replace("seed = 3", "seed = 4");
    sandbox.write("again.toml", again);
    sandbox.run("evolve -q -c again.toml -o again -g 2").ended(0, &[]);
    let run = sandbox.run_file("again");
    let dataset = load_dataset(&run.config, None, &[Split::Train]).unwrap();
    let mut trained: BTreeSet<usize> = other.training_images.iter().map(|image| image.index).collect();
    let before = sandbox.run_file("run");
    for generation in [0, 5] {
        trained
            .extend(Training::indices(&before.config, &dataset, before.config.period(generation)).unwrap());
    }
    let start: BTreeSet<usize> = run.start.as_ref().unwrap().trained_on.iter().copied().collect();
    assert_eq!(start, trained);
    let own: BTreeSet<usize> = run.training_images.iter().map(|image| image.index).collect();
    let free = |class| {
        let all = dataset.indices_of(Split::Train, class).iter();
        all.filter(|index| !start.contains(index) && !own.contains(index)).count()
    };
    let most = 2 * free(0).min(free(1));
    let drawn = images(&[&run], &dataset, "--images", most).unwrap();
    assert!(drawn.iter().all(|image| !start.contains(&image.index) && !own.contains(&image.index)));
    assert!(images(&[&run], &dataset, "--images", most + 2).is_err());
}

#[test]
fn it_goes_on_to_the_same_bytes_and_needs_the_other_run_only_to_begin() {
    let (sandbox, _) = sandbox();
    let result = |folder: &str| {
        let read = |name: &str| sandbox.read(&format!("{folder}/{name}"));
        (read("run.json"), without_seconds(&read("metrics.csv")))
    };
    sandbox.run("evolve -q -c run.toml -o whole").ended(0, &[]);
    for generations in [1, 4, 7] {
        sandbox.run(&format!("evolve -q -c run.toml -o part{generations} -g {generations}")).ended(0, &[]);
    }
    std::fs::rename(sandbox.path("other"), sandbox.path("elsewhere")).unwrap();
    for generations in [1, 4, 7] {
        sandbox.run(&format!("evolve -q -c run.toml -o part{generations} --resume")).ended(0, &[]);
        assert_eq!(result(&format!("part{generations}")), result("whole"), "stopped after {generations}");
    }
    // Started anew it does need it, and does not touch what is there.
    sandbox.run("evolve -q -c run.toml -o whole --force").ended(3, &["start.archive", "other/run.json"]);
    assert_eq!(result("whole"), result("part1"));
    // The same archive elsewhere is the same start; another one is another run.
    let set = "--set start.archive=\"elsewhere/run.json\"";
    sandbox.run(&format!("evolve -q -c run.toml -o part1 -g 13 --resume {set}")).ended(0, &[]);
    sandbox.run("evolve -q -c run.toml -o part4 -g 13 --resume").ended(0, &[]);
    assert_eq!(sandbox.run_file("part1").elites, sandbox.run_file("part4").elites);
    let another = "--set start.archive=\"whole/run.json\"";
    let words = ["start.archive", "other/run.json", "whole/run.json"];
    sandbox.run(&format!("evolve -q -c run.toml -o whole -g 13 --resume {another}")).ended(3, &words);
    let none = "--set start.archive=\"other/run.json\"";
    sandbox
        .run(&format!("evolve -q -c run.toml -o part1 -g 14 --resume {none}"))
        .ended(3, &["start.archive"]);
    assert_eq!(result("whole"), result("part7"));
    sandbox.run(&format!("evolve -q -c run.toml -o moved {set}")).ended(0, &[]);
    let whole = sandbox.run_file("whole");
    let moved = sandbox.run_file("moved");
    assert_eq!((&moved.elites, &moved.start), (&whole.elites, &whole.start));
    // Or by its folder.
    let set = "--set start.archive=\"elsewhere\"";
    sandbox.run(&format!("evolve -q -c run.toml -o by_folder {set}")).ended(0, &[]);
    let by_folder = sandbox.run_file("by_folder");
    assert_eq!((&by_folder.elites, &by_folder.start), (&whole.elites, &whole.start));
}

#[test]
fn an_archive_that_cannot_be_started_from_is_refused_before_anything_is_written() {
    let (sandbox, _) = sandbox();
    let refused = |set: &str, code: i32, words: &[&str]| {
        sandbox.run(&format!("evolve -q -c run.toml -o none {set}")).ended(code, words);
        assert!(!sandbox.path("none").exists(), "{set}");
    };
    refused(
        "--set start.archive=\"no/run.json\"",
        3,
        &["start.archive", "no/run.json", "make that run first"],
    );
    refused("--resume --set start.archive=\"no/run.json\"", 3, &["start.archive", "no/run.json"]);
    refused("--set start.archive=\"run.toml\"", 3, &["start.archive", "run.toml"]);
    refused("--set body.width=6", 3, &["its bodies are 5 × 5 voxels, expected 5 × 6"]);
    refused("--set body.min_muscles=20", 3, &["muscles, expected 20 or more"]);
    refused("--set start.archives=3", 2, &["archives"]);
    refused("--set start.archive=3", 2, &["start.archive"]);
}

/// Sets `stop` before the other run's elites are evaluated, or after.
struct Hasty<'a>(&'a AtomicBool, bool);

impl Observer for Hasty<'_> {
    fn started(&mut self, _: &RunFolder, _: &Training, _: &Progress) {}
    fn starting_from(&mut self, _: &StartRef, _: usize) {
        self.0.store(!self.1, Ordering::Relaxed);
    }
    fn period(&mut self, _: Period, _: &Training, _: &Progress) {
        self.0.store(true, Ordering::Relaxed);
    }
    fn generation(&mut self, _: &Progress) {}
    fn warning(&mut self, _: &str) {}
}

#[test]
fn a_run_stopped_while_it_begins_begins_again() {
    let (sandbox, _) = sandbox();
    let archive = sandbox.path("other/run.json");
    let text = sandbox.read("run.toml").replace("other/run.json", &archive.display().to_string());
    sandbox.write("run.toml", &text);
    sandbox.run("evolve -q -c run.toml -o whole").ended(0, &[]);
    let options = |out: &str| Options {
        config: Config::parse(&text, "run.toml", &[]).unwrap(),
        name: "run".to_string(),
        out: sandbox.path(out),
        if_exists: IfExists::Refuse,
        data: None,
        threads: Some(1),
    };
    for (out, after) in [("before", false), ("after", true)] {
        let stop = AtomicBool::new(false);
        let finished = evolve(&options(out), &stop, &mut Hasty(&stop, after)).unwrap();
        assert_eq!((finished.stopped, finished.run.generations), (true, 0));
        assert_eq!(finished.run.elites.is_empty(), !after);
        sandbox.run(&format!("evolve -q -c run.toml -o {out} --resume")).ended(0, &[]);
        assert_eq!(sandbox.read(&format!("{out}/run.json")), sandbox.read("whole/run.json"));
        let metrics = |folder: &str| without_seconds(&sandbox.read(&format!("{folder}/metrics.csv")));
        assert_eq!(metrics(out), metrics("whole"));
    }
}
