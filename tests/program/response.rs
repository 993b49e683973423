//! `morphcog response`: what it measures is true of other rollouts, the files are the same bytes on
//! any threads, what cannot be measured is a clear error.

use crate::common::program::{Sandbox, TINY, files, terminate};
use morphcog::base::session::Session;
use morphcog::base::stop::Stopped;
use morphcog::body::Body;
use morphcog::genome::Genome;
use morphcog::response::gait::Gait;
use morphcog::response::probing::Probing;
use morphcog::store::response::{EndedBy, ResponseFile};
use morphcog::store::run::Robot;
use morphcog::task::evaluation::fresh_rollouts;

/// An evolved walker: 28 soft voxels and sensors.
const WALKER: &str = "2222222/2222222/2225222/2441433/6661333/6661333/3333333";
/// One of muscles and rigid voxels alone.
const BLIND: &str = "3333333/4444444/1111111/3333333/4444444/1111111/3333333";

/// A run of these bodies, the first of them the fittest.
fn run_of(bodies: &[&str]) -> Sandbox {
    run_with(bodies, 60)
}

/// The same with rollouts of so many control steps.
fn run_with(bodies: &[&str], steps: usize) -> Sandbox {
    let sandbox = Sandbox::new();
    let large = TINY
        .replace("= 5\n", "= 7\n")
        .replace("= 20\n", &format!("= {steps}\n"));
    sandbox.write("tiny.toml", large);
    sandbox
        .run("evolve -q -c tiny.toml -o run --set protocol.control_steps=1 -g 1")
        .ended(0, &[]);
    let mut run = sandbox.run_file("run");
    run.config.protocol.control_steps = steps as _;
    let robot = |(number, body): (usize, &&str)| {
        let body: Body = body.parse().unwrap();
        let genome = Genome::initial().with_body(&body).unwrap();
        let mut robot = Robot {
            id: genome.id(),
            cell: Vec::new(),
            task: "0|1".to_string(),
            objective: -(number as f64),
            displacements: vec![0.0, 0.0],
            voxels: body.counts(),
            generation: 0,
            parent: None,
            body,
            genome,
        };
        robot.cell = robot.bins();
        robot
    };
    run.elites = bodies.iter().enumerate().map(robot).collect();
    run.stats = run
        .archive()
        .unwrap()
        .stats(run.dimensions.possible_cells, run.config.archive.qd_offset);
    sandbox.write("run/run.json", run.to_json());
    sandbox.run_file("run");
    sandbox
}

fn responses(sandbox: &Sandbox, name: &str) -> ResponseFile {
    serde_json::from_str(&sandbox.read(name)).unwrap()
}

#[test]
fn slopes_predict_other_rollouts_of_a_real_body_as_well_as_is_said() {
    let sandbox = run_with(&[WALKER], 150);
    sandbox.run("response -q -a run").ended(0, &[]);
    let file = responses(&sandbox, "run/response.json");
    let [robot] = &file.robots[..] else {
        panic!("{} robots", file.robots.len())
    };
    let (config, gait) = (
        sandbox.run_file("run").config,
        Gait::of(&robot.body).unwrap(),
    );
    let places: Vec<(usize, usize)> = robot
        .places
        .iter()
        .map(|place| (place.row, place.column))
        .collect();
    assert_eq!(places, gait.places());
    // Random images of another seed.
    let probing = Probing::new(&file.setting.conditions, file.setting.seed + 1);
    let shown = probing.shown(
        &gait,
        &config.physics,
        0..120,
        |probe, stimuli, conditions| {
            let setting = (&config.physics, &config.protocol);
            let (found, _) = fresh_rollouts(
                probe,
                stimuli,
                conditions,
                setting,
                &|_| (),
                &Session::default(),
            )?;
            Ok::<_, Stopped>(found.into_iter().map(Result::ok).collect())
        },
    );
    let shown = shown.unwrap();
    assert_eq!(shown.len(), 120);
    let mean = shown.iter().map(|shown| shown.displacement).sum::<f64>() / 120.0;
    let (mut missed, mut spread) = (0.0, 0.0);
    for shown in &shown {
        let moved: f64 = shown
            .widths
            .iter()
            .zip(&robot.places)
            .map(|(width, place)| width * place.slope)
            .sum();
        let off = shown.displacement - robot.intercepts[shown.condition].unwrap() - moved;
        missed += off * off;
        spread += (shown.displacement - mean) * (shown.displacement - mean);
    }
    let (found, said) = (1.0 - missed / spread, robot.r_squared);
    assert!(
        found > 0.6 && (found - said).abs() < 0.1,
        "found {found}, said {said}"
    );
}

#[test]
fn another_seed_draws_other_images_and_a_task_is_kept_with_how_well_it_could_be_taught() {
    let sandbox = run_with(&[WALKER], 100);
    for seed in [1, 2] {
        let line = format!("response -q -a run --task 3|14 -n 60 --seed {seed} -o {seed}.json");
        sandbox.run(&line).ended(0, &[]);
    }
    for ending in ["json", "csv", "svg", "png"] {
        let read = |seed: u32| std::fs::read(sandbox.path(&format!("{seed}.{ending}"))).unwrap();
        assert!(read(1) != read(2), "{ending}");
    }
    let file = responses(&sandbox, "1.json");
    assert_eq!(file.setting.task.as_deref(), Some("3|14"));
    let taught = file.robots[0].taught.unwrap();
    let [low, high] = taught.accuracy_interval;
    assert!(
        low < taught.accuracy && taught.accuracy < high && (0.0..=1.0).contains(&low),
        "{taught:?}"
    );
}

#[test]
fn robots_that_were_measured_before_are_kept_with_what_they_could_be_taught() {
    // In another cell, for it has fewer muscles.
    let other = WALKER.replace("/3333333", "/2222222");
    let sandbox = run_of(&[WALKER, &other]);
    let ids = sandbox
        .run_file("run")
        .elites
        .into_iter()
        .map(|robot| robot.id)
        .collect::<Vec<_>>();
    for (id, images) in ids.iter().zip([60, 80]) {
        let line = format!("response -q -a run --robots {id} --task 3|14 -n {images} --error 0");
        sandbox.run(&line).ended(0, &[]);
    }
    let file = responses(&sandbox, "run/response.json");
    assert_eq!(
        file.robots
            .iter()
            .filter(|robot| robot.taught.is_some())
            .count(),
        2
    );
    // A file that names places which the body does not have is refused, and stays.
    let text = sandbox.read("run/response.json");
    let broken = text.replacen("{\"row\":0,", "{\"row\":99,", 1);
    assert_ne!(text, broken);
    sandbox.write("run/response.json", &broken);
    let line = format!("response -q -a run --robots {} -n 60 --error 0", ids[0]);
    sandbox
        .run(&line)
        .ended(3, &["run/response.json: robots[0].places", "--out"]);
    assert_eq!(sandbox.read("run/response.json"), broken);
}

#[test]
fn a_measurement_that_was_stopped_goes_on_and_ends_with_the_same_bytes() {
    let sandbox = run_of(&[WALKER]);
    let line = "response -q -a run -n 90 --error 0 -o";
    sandbox.run(&format!("{line} whole.json")).ended(0, &[]);
    let whole: serde_json::Value = serde_json::from_str(&sandbox.read("whole.json")).unwrap();
    // In its first batch, between two batches, in a later one, after the last.
    for known in [17, 60, 77, 90] {
        let mut part = whole.clone();
        let mut robot = part["robots"].as_array_mut().unwrap().pop().unwrap();
        robot["displacements"]
            .as_array_mut()
            .unwrap()
            .truncate(known);
        part["unfinished"] = serde_json::json!([
            { "id": robot["id"], "body": robot["body"], "displacements": robot["displacements"] }
        ]);
        sandbox.write("part.json", part.to_string());
        sandbox.run(&format!("{line} part.json")).ended(0, &[]);
        assert!(
            sandbox.read("part.json") == sandbox.read("whole.json"),
            "{known}"
        );
    }
    // And what a signal leaves is such a file.
    let mut child = sandbox.start("response -q -a run -n 6000 --error 0 -o stopped.json");
    std::thread::sleep(std::time::Duration::from_millis(1500));
    terminate(&child);
    assert_eq!(child.wait().unwrap().code(), Some(75));
    let stopped = ResponseFile::read(&sandbox.path("stopped.json")).unwrap();
    let [begun] = &stopped.unfinished[..] else {
        panic!("{} unfinished", stopped.unfinished.len())
    };
    let measured = &responses(&sandbox, "whole.json").robots[0].displacements;
    let common = begun.displacements.len().min(measured.len());
    assert!(stopped.robots.is_empty() && common > 0);
    assert_eq!(begun.displacements[..common], measured[..common]);
}

#[test]
fn what_could_be_taught_is_said_for_the_config_that_the_training_would_have() {
    let sandbox = run_of(&[WALKER]);
    let measured = |out: &str, set: &str| {
        let line = format!("response -a run --task 3|14 -n 60 --error 0 {set} -o {out}.json");
        let said = sandbox.run(&line).ended(0, &[]);
        (said.out, responses(&sandbox, &format!("{out}.json")))
    };
    let (said, whole) = measured("whole", "");
    assert!(!said.contains("stimulus.margin"), "{said}");
    assert_eq!(whole.robots[0].taught.unwrap().margin, None);
    let (said, best) = measured("best", "--set train.windows=20");
    let margin = best.robots[0].taught.unwrap().margin.unwrap();
    assert!(
        said.contains("stimulus.margin") && said.contains(&margin.to_string()),
        "{said}"
    );
    assert_eq!(
        (best.setting.windows, best.setting.stimulus),
        (20, whole.setting.stimulus)
    );
    // Named by hand it could be taught the same; what was measured does not depend on any of it.
    let (_, hand) = measured(
        "hand",
        &format!(
            "--set stimulus.margin={}",
            margin.to_string().replace(' ', "")
        ),
    );
    assert_eq!(hand.setting.stimulus.unwrap().margin, margin);
    let [by_hand, found] = [&hand, &best].map(|file| file.robots[0].taught.unwrap());
    assert_eq!(
        (by_hand.accuracy, by_hand.fitness_interval),
        (found.accuracy, found.fitness_interval)
    );
    assert_eq!(best.robots[0].displacements, whole.robots[0].displacements);
    sandbox
        .run("response -q -a run --set train.windows=5")
        .ended(2, &["--task"]);
    // What is simulated is the run's own.
    for key in [
        "physics.gravity=90",
        "protocol.control_steps=9",
        "train.perturbations.start=1",
    ] {
        let section = format!("--set {}", key.rsplit_once('.').unwrap().0);
        let set = format!("response -q -a run --task 3|14 --set {key}");
        sandbox.run(&set).ended(2, &[&section]);
    }
    sandbox
        .run("response -q -a run --task 3|14 --set train.windows=5 --set stimulus.reduction=stride")
        .ended(3, &["train.windows = 5", "area"]);
}

#[test]
fn what_was_measured_before_is_not_simulated_again() {
    let sandbox = run_of(&[WALKER]);
    sandbox
        .run("response -q -a run -n 70 --error 0")
        .ended(0, &[]);
    let mut first: serde_json::Value =
        serde_json::from_str(&sandbox.read("run/response.json")).unwrap();
    let measured = first["robots"][0]["displacements"].clone();
    // A number that no simulation gives tells what is taken.
    first["robots"][0]["displacements"][7] = 12.5.into();
    sandbox.write("run/response.json", first.to_string());
    let displacements = |out: &str, options: &str| {
        sandbox
            .run(&format!("response -q -a run --error 0 {options}"))
            .ended(0, &[]);
        responses(&sandbox, out).robots[0].displacements.clone()
    };
    let more = displacements("more.json", "-n 80 -o more.json --task 3|14");
    assert!(more.len() == 80 && more[7] == Some(12.5));
    let same = |number: &usize| measured[*number].as_f64() == more[*number];
    assert!(
        (0..70)
            .filter(|number| *number != 7)
            .all(|number| same(&number))
    );
    // The longest that is known: here that of the results' file. It is taken whole.
    sandbox.write("run/response.json", "{");
    assert_eq!(displacements("more.json", "-n 60 -o more.json"), more);
    // That of another seed is not; nor is any of it without the files.
    assert_ne!(
        displacements("other.json", "-n 60 -o other.json --seed 5")[7],
        Some(12.5)
    );
    for file in ["run/response.json", "more.json"] {
        std::fs::remove_file(sandbox.path(file)).unwrap();
    }
    assert_eq!(
        displacements("more.json", "-n 60 -o more.json")[7],
        measured[7].as_f64()
    );
}

#[test]
fn what_was_known_before_makes_no_speed() {
    let sandbox = run_of(&[WALKER]);
    sandbox
        .run("response -a run --images 70 --error 0")
        .ended(0, &["60/70"]);
    sandbox
        .run("response -a run --images 70 --error 0")
        .ended(0, &["70/70", "· 0.0 rollouts/s"]);
    // Nor does what is not needed any more.
    let said = sandbox
        .run("response -a run --images 10000 --error 0.9")
        .ended(0, &["10000/10000"]);
    assert!(said.err.contains("· 0.0 rollouts/s"), "{}", said.err);
}

#[test]
fn a_file_keeps_what_it_has_of_other_robots() {
    let other = WALKER.replace("666", "444");
    let sandbox = run_of(&[WALKER, &other]);
    let ids: Vec<String> = sandbox
        .run_file("run")
        .elites
        .into_iter()
        .map(|robot| robot.id)
        .collect();
    sandbox
        .run("response -q -a run --robots all -n 80 --error 0 --task 3|14")
        .ended(0, &[]);
    let both = responses(&sandbox, "run/response.json");
    let said = sandbox.run(&format!(
        "response -a run --robots {} -n 60 --error 0 --task 0|1",
        ids[1]
    ));
    assert!(!said.ended(0, &[]).out.contains(&ids[0]));
    let file = responses(&sandbox, "run/response.json");
    let [first, second] = &file.robots[..] else {
        panic!("{} robots", file.robots.len())
    };
    // In the order in which they were measured first.
    assert_eq!((&first.id, &second.id), (&ids[0], &ids[1]));
    let measured = |id: &str| both.robots.iter().find(|robot| robot.id == id).unwrap();
    assert_eq!(second.displacements, measured(&ids[1]).displacements);
    assert_eq!(first.displacements, measured(&ids[0]).displacements);
    // What could be taught was another task.
    assert!(
        first.taught.is_none() && second.taught.is_some() && measured(&ids[0]).taught.is_some()
    );
    // Random images of another seed are others: nothing of them goes together, and nothing is lost.
    let other = format!("response -q -a run --robots {} -n 60 --seed 8", ids[0]);
    sandbox
        .run(&other)
        .ended(3, &["run/response.json: 2 ", "--out"]);
    assert_eq!(responses(&sandbox, "run/response.json"), file);
    sandbox.run(&format!("{other} -o other.json")).ended(0, &[]);
}

#[test]
fn results_and_pictures_lie_beside_the_run_and_say_why_a_measurement_ended() {
    let sandbox = run_of(&[WALKER, BLIND, &WALKER.replace("666", "444")]);
    let said = sandbox.run("response -a run -n 70 --error 0").ended(0, &[]);
    let file = responses(&sandbox, "run/response.json");
    let [robot] = &file.robots[..] else {
        panic!("{} robots", file.robots.len())
    };
    assert_eq!(
        (robot.rollouts, robot.unstable, robot.ended_by),
        (70, 0, EndedBy::Images)
    );
    assert!(
        said.out.contains("70") && said.out.contains("--images"),
        "{}",
        said.out
    );
    assert_eq!(file.setting.conditions.len(), 6);
    assert!(robot.intercepts.len() == 6 && robot.intercepts.iter().all(Option::is_some));
    let run = sandbox.run_file("run");
    assert_eq!(
        (&file.run, &file.run_sha256),
        (&run.name, &run.fingerprint())
    );
    for (name, material) in [("slope", "2"), ("error", "6")] {
        let csv = sandbox.read("run/response.csv");
        assert!(
            csv.lines().next().unwrap().contains(name) && csv.contains(&format!(",{material},")),
            "{csv}"
        );
    }
    assert_eq!(
        sandbox.read("run/response.csv").lines().count(),
        1 + robot.places.len()
    );
    let png = std::fs::read(sandbox.path("run/response.png")).unwrap();
    // 85 mm at 300 pixels per inch.
    let size = [16, 20].map(|at| u32::from_be_bytes(png[at..at + 4].try_into().unwrap()));
    assert!(
        size[0] == 1005 && (700..1100).contains(&size[1]),
        "{size:?}"
    );
    assert!(sandbox.read("run/response.svg").contains("voxel lengths"));
    // Less is enough for rough slopes. Of several robots each has a picture; one that nothing can
    // move is left out.
    let said = sandbox.run("response -a run --robots all --error 0.6 -o some.json");
    let said = said.ended(0, &["warning:", &run.elites[1].id]);
    let file = responses(&sandbox, "some.json");
    assert!(
        file.robots.len() == 2 && said.out.contains("--error"),
        "{said:?}"
    );
    for robot in &file.robots {
        assert!(
            robot.ended_by == EndedBy::Error && robot.rollouts < 1000,
            "{robot:?}"
        );
        assert!(sandbox.path(&format!("some-{}.png", robot.id)).exists());
    }
    // A published robot needs neither archive nor data.
    sandbox
        .run("response -q --robots XFJPI,xfjpi -n 60")
        .ended(0, &[]);
    assert_eq!(responses(&sandbox, "gallery-response.json").robots.len(), 1);
    assert!(sandbox.path("gallery-response.png").exists());
}

#[test]
fn what_cannot_be_measured_is_one_clear_error_and_writes_nothing() {
    let sandbox = run_of(&[BLIND, WALKER]);
    let run = sandbox.run_file("run");
    let (blind, walker) = (run.elites[0].id.clone(), run.elites[1].id.clone());
    let before = files(&sandbox.path("run"));
    let refused = |options: &str, code: i32, words: &[&str]| {
        let said = sandbox
            .run(&format!("response -q -a run {options}"))
            .ended(code, words);
        assert_eq!(said.err.matches("error:").count(), 1, "{said:?}");
        assert_eq!(files(&sandbox.path("run")), before, "{options}");
    };
    refused("", 3, &[&blind, "--robots"]);
    let to_walker = |options: &str| format!("--robots {walker} {options}");
    for (options, word) in [
        ("--images 59", "--images 59"),
        ("--images 100001", "--images 100001"),
        ("--error 1", "--error 1"),
        ("--error=-0.1", "--error -0.1"),
        ("--error nan", "--error"),
        ("-o run/run.json", "--out run/run.json"),
        ("-o run/eval.json", "--out run/eval.json"),
        ("-o map.png", "--out map.png"),
        ("-o map.csv", "--out map.csv"),
        ("--task 4", "--task"),
    ] {
        refused(&to_walker(options), 2, &[word]);
    }
    refused(&to_walker("--task 3|10,11"), 3, &["--task", "class 10"]);
    refused("--robots nobody", 3, &["nobody"]);
    sandbox
        .run("response --robots YJTLA --task 0|1")
        .ended(3, &["mnist", "data fetch"]);
    sandbox
        .run("response --robots YJTLA --physical-only")
        .ended(3, &["audit --archive gallery:"]);
    // Where nearly every rollout is unstable.
    let text = sandbox.read("run/run.json");
    let unstable = text.replace("\"blow_up_extent\":10.0", "\"blow_up_extent\":0.12");
    assert_ne!(text, unstable);
    sandbox.write("other/run.json", unstable);
    let before = files(&sandbox.path("other"));
    sandbox
        .run(&format!("response -a other --robots {walker}"))
        .ended(3, &[&walker, "unstable", "--robots"]);
    assert_eq!(files(&sandbox.path("other")), before);
}
