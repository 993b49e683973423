//! Stages: robots trained on more and more images; as exact as any other run.

mod common;

use common::program::{Sandbox, TINY, staged, without_seconds};
use morphcog::run::Config;
use morphcog::run::archive::RunFile;
use morphcog::run::curriculum::Period;
use morphcog::run::evolve::{Observer, Options, Progress, evolve};
use morphcog::run::folder::{IfExists, RunFolder};
use morphcog::run::start::StartRef;
use morphcog::run::training::Training;
use morphcog::task::fitness::Fitness;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

fn sandbox() -> Sandbox {
    let sandbox = Sandbox::new();
    sandbox.write("run.toml", staged());
    sandbox
}

fn result(sandbox: &Sandbox, folder: &str) -> (String, Vec<String>) {
    let read = |name: &str| sandbox.read(&format!("{folder}/{name}"));
    (read("run.json"), without_seconds(&read("metrics.csv")))
}

#[test]
fn a_curriculum_stopped_after_any_generation_goes_on_to_the_same_bytes() {
    let sandbox = sandbox();
    sandbox.run("evolve -q -c run.toml -o whole").ended(0, &[]);
    let whole = result(&sandbox, "whole");
    let edited = |folder: &str| {
        sandbox.run_file(folder).elites.iter().filter(|robot| !robot.genome.edits().is_empty()).count()
    };
    assert!(edited("whole") > 0);
    for generations in 1..12 {
        sandbox.run(&format!("evolve -q -c run.toml -o part --force -g {generations}")).ended(0, &[]);
        // Voxels are mutated in the last stage only.
        assert!(generations > 7 || edited("part") == 0, "after {generations}");
        sandbox.run("evolve -q -c run.toml -o part --resume").ended(0, &[]);
        assert_eq!(result(&sandbox, "part"), whole, "stopped after {generations}");
    }
}

#[test]
fn a_run_goes_on_under_other_stages_that_have_not_begun_to_the_bytes_of_a_run_that_always_had_them() {
    let sandbox = sandbox();
    // As in `staged`, in its first stage and what it has of its second; then another third one, and a fourth.
    let others = |second: u64| {
        let stages: Vec<String> = staged().split("\n[[stage]]\n").map(String::from).collect();
        let [base, first, before, _] = &stages[..] else { panic!("{stages:?}") };
        let before = before.replace("generations = 3", &format!("generations = {second}"));
        let third = "generations = 2\nimages_per_class = 4\nfitness = \"mean_hinge\"\nrace = true\nkeep = 3";
        [base, first, &before, third, "images_of = 2\nfitness = \"mean_clipped\"\n"].join("\n[[stage]]\n")
    };
    for second in [2, 3, 5] {
        sandbox.write("others.toml", others(second));
        sandbox.run("evolve -q -c others.toml -o whole --force").ended(0, &[]);
        // In the second stage, and (where it has three generations) at its end.
        for generations in [5, 6, 7] {
            sandbox.run(&format!("evolve -q -c run.toml -o part --force -g {generations}")).ended(0, &[]);
            let resumed = sandbox.run("evolve -q -c others.toml -o part --resume");
            if generations <= 4 + second {
                resumed.ended(0, &[]);
                assert_eq!(result(&sandbox, "part"), result(&sandbox, "whole"), "{generations} of {second}");
                assert_eq!(sandbox.read("part/config.toml"), sandbox.read("whole/config.toml"));
            } else {
                let expected = format!("stage 2: generations: expected {} or more", generations - 4);
                resumed.ended(3, &[&expected, "--force"]);
            }
        }
    }
    // What has begun is as it was, and no stage that has not.
    sandbox.run("evolve -q -c run.toml -o part --force -g 5").ended(0, &[]);
    sandbox.write("first.toml", staged().replacen("generations = 4", "generations = 3", 1));
    let first = "stage 1: generations = 4 there, 3 now";
    sandbox.run("evolve -q -c first.toml -o part --resume").ended(3, &[first, "--force"]);
    sandbox
        .write("second.toml", staged().replace("images_per_class = 2", "images_per_class = 2\nrace = true"));
    let second = "stage 2: race = not set there, true now";
    sandbox.run("evolve -q -c second.toml -o part --resume").ended(3, &[second, "--force"]);
}

/// Sets `stop` a moment after a generation, when the next stage has begun to evaluate the archive anew.
struct Impatient {
    after: u64,
    stop: Arc<AtomicBool>,
}

impl Observer for Impatient {
    fn started(&mut self, _: &RunFolder, _: &Training, _: &Progress) {}
    fn starting_from(&mut self, _: &StartRef, _: usize) {}
    fn period(&mut self, _: Period, _: &Training, _: &Progress) {}
    fn warning(&mut self, _: &str) {}

    fn generation(&mut self, progress: &Progress) {
        if progress.done == self.after {
            let stop = Arc::clone(&self.stop);
            std::thread::spawn(move || {
                std::thread::sleep(Duration::from_millis(50));
                stop.store(true, Ordering::Relaxed);
            });
        }
    }
}

#[test]
fn a_run_stops_while_a_stage_evaluates_the_archive_anew_and_nothing_is_lost() {
    let sandbox = sandbox();
    // Seconds of work at the beginning of the second stage, in several parts.
    let text = staged().replace("images_per_class = 2", "images_per_class = 900");
    let config = Config::parse(&text, "run.toml", &[]).unwrap();
    let out = sandbox.path("run");
    let options = Options {
        config,
        name: "run".to_string(),
        out: out.clone(),
        if_exists: IfExists::Refuse,
        data: None,
        threads: Some(1),
    };
    let stop = Arc::new(AtomicBool::new(false));
    let mut observer = Impatient { after: 4, stop: Arc::clone(&stop) };
    let begin = Instant::now();
    let finished = evolve(&options, &stop, &mut observer).unwrap();
    assert_eq!((finished.stopped, finished.run.generations), (true, 4));
    assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
    // As if it had been stopped before the stage.
    sandbox.run("evolve -q -c run.toml -o before -g 4").ended(0, &[]);
    assert_eq!(sandbox.run_file("run").elites, sandbox.run_file("before").elites);
}

#[test]
fn neither_threads_nor_savings_change_a_curriculum() {
    let sandbox = sandbox();
    let elites = |options: &str| {
        sandbox.run(&format!("evolve -q --force -c run.toml -o run {options}")).ended(0, &[]);
        sandbox.run_file("run").elites
    };
    // With relatives all is saved that can be, whatever the config says.
    for text in [staged(), staged().replace("voxel_relatives = 3", "")] {
        sandbox.write("run.toml", text);
        let plain = elites("--threads 1");
        assert!(plain.len() >= 4, "{}", plain.len());
        assert_eq!(elites("--threads 3"), plain);
        for saving in ["known_bodies", "early_stop", "shared_lives"] {
            assert_eq!(elites(&format!("--set savings.{saving}=false")), plain, "{saving}");
        }
    }
}

#[test]
fn a_race_shows_less_and_is_as_exact_as_any_run() {
    let sandbox = Sandbox::new();
    let stage = "[[stage]]\nimages_per_class = 24\nfitness = \"mean_hinge\"\nkeep = 6\nvoxel_mutations = 0.5\nvoxel_candidates = 8\nvoxel_changes = 4\nvoxel_scope = \"sensors\"\nvoxel_relatives = 6\nraised_starts = 1\n";
    // Long enough lives for robots to differ.
    let base = TINY
        .replace("control_steps = 20", "control_steps = 100")
        .replace("generations = 12", "generations = 14");
    // With relatives all is saved that can be, whatever the config says.
    let plain = stage.replace("voxel_relatives = 6\n", "");
    sandbox.write("plain.toml", format!("{base}\n[[stage]]\ngenerations = 6\n{plain}"));
    sandbox.write("race.toml", format!("{base}\n[[stage]]\ngenerations = 6\n{stage}race = true\n"));
    let run = |options: &str| {
        sandbox.run(&format!("evolve -q {options} --force")).ended(0, &[]);
        sandbox.run_file(options.split_whitespace().last().unwrap())
    };
    let all_shown = "--set savings.early_stop=false -o";
    let (plain, race) =
        (run(&format!("-c plain.toml {all_shown} plain")), run(&format!("-c race.toml {all_shown} race")));
    // What was not shown counts as stopped early.
    let stopped = |folder: &str| -> u64 {
        let metrics = sandbox.read(&format!("{folder}/metrics.csv"));
        assert_eq!(
            metrics.lines().next().and_then(|names| names.split(',').nth(11)),
            Some("saved_early_stop")
        );
        metrics.lines().last().and_then(|line| line.split(',').nth(11)).unwrap().parse().unwrap()
    };
    assert!(stopped("plain") == 0 && stopped("race") > 0 && !plain.elites.is_empty());
    assert!(sandbox.read("race/checkpoint.json").contains("\"relatives\":[{\"body\""));
    for options in [
        "--threads 1",
        "--threads 3",
        "--set savings.known_bodies=false",
        "--set savings.shared_lives=false --set savings.early_stop=false",
    ] {
        assert_eq!(run(&format!("-c race.toml {options} -o other")).elites, race.elites, "{options}");
    }
    let whole = result(&sandbox, "race");
    sandbox.run(&format!("evolve -q -c race.toml --force -g 10 {all_shown} part")).ended(0, &[]);
    sandbox.run(&format!("evolve -q -c race.toml --resume {all_shown} part")).ended(0, &[]);
    assert_eq!(result(&sandbox, "part"), whole);
}

#[test]
fn elites_stand_in_the_archive_with_what_they_do_on_the_last_images() {
    let sandbox = sandbox();
    sandbox.run("evolve -q -c run.toml -o run").ended(0, &[]);
    let run: RunFile = sandbox.run_file("run");
    assert_eq!((run.training_images.len(), run.criterion().fitness), (6, Fitness::MeanHinge));
    let grouping = run.config.grouping().unwrap().with_fitness(run.criterion());
    for robot in &run.elites {
        assert_eq!(grouping.score(&run.answers(robot)).fitness, robot.objective, "{}", robot.id);
    }
    // Other commands read it.
    sandbox.run("eval --archive run/run.json --images 20 --robots top:2").ended(0, &[]);
    let audit = sandbox.run("audit --archive run/run.json --robots top:2").ended(0, &[]);
    // Every second start was raised, which is no reason to doubt the program.
    assert!(!audit.err.contains("walks otherwise"), "{}", audit.err);
}

#[test]
fn a_single_stage_on_the_images_of_the_config_is_the_run_without_stages() {
    let sandbox = Sandbox::tiny();
    sandbox.write("staged.toml", format!("{TINY}\n[[stage]]\ngenerations = 5\n"));
    sandbox.run("evolve -q -c tiny.toml -o plain").ended(0, &[]);
    sandbox.run("evolve -q -c staged.toml -o staged").ended(0, &[]);
    assert_eq!(sandbox.run_file("plain").elites, sandbox.run_file("staged").elites);
    assert_eq!(result(&sandbox, "plain").1, result(&sandbox, "staged").1);
}

#[test]
fn stages_that_want_more_images_than_there_are_are_refused_before_the_first_generation() {
    let sandbox = Sandbox::new();
    sandbox.write(
        "run.toml",
        format!("{TINY}\n[[stage]]\ngenerations = 5\n[[stage]]\nimages_per_class = 1000000\n"),
    );
    sandbox.run("evolve -c run.toml -o run").ended(3, &["stage 2: images_per_class: ", "1000000"]);
    assert!(!sandbox.path("run/run.json").exists());
}
