//! The robots in `data/trained`, `data/four_digit`, `data/team` and `data/atlas` walk as their files say, and are
//! what the documentation says of them.
#![allow(clippy::disallowed_methods)]

use crate::common::program::{self, Sandbox, said};
use morphcog::base::Grid;
use morphcog::base::session::Session;
use morphcog::body::Body;
use morphcog::data::dataset::{Dataset, Split};
use morphcog::data::files::places;
use morphcog::images::whereabouts::stimulus_of;
use morphcog::search::held_out_run::CYCLES;
use morphcog::store::audit::{AuditFile, Verdict};
use morphcog::store::eval::EvalFile;
use morphcog::store::images::ImageRef;
use morphcog::store::run::RunFile;
use morphcog::store::team::TeamFile;
use morphcog::task::evaluation::fresh_rollouts;
use morphcog::task::protocol::{Protocol, RolloutMode};
use std::path::{Path, PathBuf};

/// Images of each class that are shown again.
const SHOWN: usize = 4;

fn folders() -> Vec<PathBuf> {
    let inside = |set: &str| {
        let mut folders: Vec<PathBuf> =
            std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(set))
                .unwrap()
                .map(|entry| entry.unwrap().path())
                .collect();
        folders.sort();
        folders.retain(|path| path.is_dir());
        assert!(!folders.is_empty(), "{set}");
        folders
    };
    [inside("trained"), inside("four_digit")].concat()
}

#[test]
fn every_trained_robot_is_physical_and_was_tested_on_1000_images() {
    for folder in folders() {
        let run = RunFile::read(&folder.join("run.json")).unwrap();
        let eval = EvalFile::read(&folder.join("eval.json")).unwrap();
        let audit = AuditFile::read(&folder.join("audit.json")).unwrap();
        let [robot] = &run.elites[..] else {
            panic!("{}: {} robots", folder.display(), run.elites.len())
        };
        let [tested] = &eval.robots[..] else {
            panic!("{}", folder.display())
        };
        assert_eq!(
            (&tested.id, eval.images.len()),
            (&robot.id, 1000),
            "{}",
            folder.display()
        );
        assert_eq!(
            eval.runs[0].sha256,
            run.fingerprint(),
            "{}",
            folder.display()
        );
        assert_eq!(audit.run_sha256, run.fingerprint(), "{}", folder.display());
        assert!(
            audit.robot(&robot.id).unwrap().is_physical(),
            "{}",
            folder.display()
        );
        assert!(run.origin.is_some(), "{}", folder.display());
    }
}

/// MNIST if it is there.
fn mnist() -> Option<Dataset> {
    let data = program::mnist("trained robots")?;
    Some(Dataset::load("mnist", &places(None, Some(data), None), &Split::ALL).unwrap())
}

/// How the robot of a run walks under test images, ten cycles each; none where it is unstable.
fn walks(run: &RunFile, mnist: &Dataset, images: &[ImageRef]) -> Vec<Option<f64>> {
    walks_of(run, &run.elites[0].body, mnist, images)
}

fn walks_of(run: &RunFile, body: &Body, mnist: &Dataset, images: &[ImageRef]) -> Vec<Option<f64>> {
    let stimulus =
        |image: &ImageRef| stimulus_of(&run.config, mnist, Split::Test, image.index).unwrap();
    let stimuli: Vec<Grid<f64>> = images.iter().map(stimulus).collect();
    let control_steps = CYCLES * run.config.physics.cycle_steps;
    let protocol = Protocol {
        rollout: RolloutMode::Fresh,
        control_steps,
        ..run.config.protocol.clone()
    };
    let setting = (&run.config.physics, &protocol);
    let (walks, _) =
        fresh_rollouts(body, &stimuli, &[], setting, &|_| (), &Session::default()).unwrap();
    walks.into_iter().map(Result::ok).collect()
}

#[test]
fn they_walk_to_the_bit_as_in_their_test() {
    let Some(mnist) = mnist() else { return };
    for folder in folders() {
        let run = RunFile::read(&folder.join("run.json")).unwrap();
        let eval = EvalFile::read(&folder.join("eval.json")).unwrap();
        let mut seen = [0; 256];
        let is_first = |label: u8, seen: &mut [usize; 256]| {
            seen[usize::from(label)] += 1;
            seen[usize::from(label)] <= SHOWN
        };
        let shown: Vec<usize> = (0..eval.images.len())
            .filter(|place| is_first(eval.images[*place].label, &mut seen))
            .collect();
        let images: Vec<ImageRef> = shown.iter().map(|place| eval.images[*place]).collect();
        let known: Vec<Option<f64>> = shown
            .iter()
            .map(|place| eval.robots[0].displacements[*place])
            .collect();
        assert_eq!(walks(&run, &mnist, &images), known, "{}", folder.display());
    }
}

#[test]
fn the_baselines_beside_them_are_those_that_eval_finds_today() {
    let Some(data) = program::mnist("the baselines of trained robots") else {
        return;
    };
    // One of them: the rule is the same for all.
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/four_digit/2v013");
    let sandbox = Sandbox::new();
    let mut command = sandbox.command([
        "eval",
        "--quiet",
        "--cycles",
        "1",
        "--out",
        "eval.json",
        "--archive",
    ]);
    command.arg(&folder).arg("--data").arg(&data);
    said(command).ended(0, &[]);
    let [then, now] = [folder.join("eval.json"), sandbox.path("eval.json")]
        .map(|file| EvalFile::read(&file).unwrap());
    assert_eq!((then.images, then.baselines), (now.images, now.baselines));
}

#[test]
fn the_team_that_ships_walks_and_answers_as_in_its_test() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/team");
    let team = TeamFile::read(&root.join("team.json")).unwrap();
    let votes = &team.answers.as_ref().expect("it was not stopped").votes;
    let right = team
        .images
        .iter()
        .zip(&votes.answers)
        .filter(|(image, answer)| image.label == **answer);
    assert_eq!(right.count(), votes.accuracy.right);
    assert_eq!(
        (team.members.len(), team.size, team.classes.len()),
        (45, 45, 10)
    );
    let mnist = mnist();
    for (number, member) in team.members.iter().enumerate() {
        let run =
            RunFile::read(&root.join(member.task.replace('|', "v")).join("run.json")).unwrap();
        assert_eq!(
            (run.fingerprint(), &run.elites[0].id),
            (member.run_sha256.clone(), &member.id)
        );
        if let Some(mnist) = &mnist {
            // Another image for each.
            let place = number * 7 % team.images.len();
            let walked = walks(&run, mnist, &team.images[place..=place]);
            assert_eq!(walked, [member.displacements[place]], "{}", member.task);
        }
    }
}

#[test]
fn the_robots_of_the_atlas_are_audited_and_walk_as_in_the_test_of_the_paper_s_table() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let table = std::fs::read_to_string(root.join("data/atlas/reproduction.csv")).unwrap();
    let mnist = mnist();
    let mut tasks = 0;
    for set in ["zero_one", "four_digit"] {
        // Tests run in the project's folder, where the atlas is looked for.
        let of_seed = |seed: usize| {
            RunFile::read(Path::new(&format!("atlas:{set}-{seed}/run.json"))).unwrap()
        };
        let runs: Vec<RunFile> = (1..=5).map(of_seed).collect();
        let eval = EvalFile::read(Path::new(&format!("atlas:{set}/eval.json"))).unwrap();
        let hashes = eval.runs.iter().map(|run| run.sha256.clone());
        assert!(hashes.eq(runs.iter().map(RunFile::fingerprint)), "{set}");
        let audit = |seed: usize| {
            AuditFile::of_run(
                &runs[seed - 1],
                Path::new(&format!("atlas:{set}-{seed}/audit.json")),
            )
            .unwrap()
        };
        let audits: Vec<AuditFile> = (1..=5).map(audit).collect();
        // data/README says so: all of zero or one, ten physical ones of each task of four digits.
        for (run, audit) in runs.iter().zip(&audits) {
            for task in run
                .dimensions
                .tasks
                .iter()
                .filter(|task| *task != "same way")
            {
                let of_task = run.elites.iter().filter(|elite| elite.task == *task);
                let audited: Vec<_> = of_task
                    .clone()
                    .filter_map(|elite| audit.robot(&elite.id))
                    .collect();
                let physical = audited
                    .iter()
                    .filter(|robot| robot.verdict == Verdict::Physical);
                match set {
                    "zero_one" => assert_eq!(audited.len(), of_task.count()),
                    _ => assert!(physical.count() >= 10, "{task}"),
                }
            }
        }
        for (number, robot) in eval.robots.iter().enumerate() {
            assert!(audits[robot.run].robot(&robot.id).is_some(), "{}", robot.id);
            if let Some(mnist) = &mnist {
                // Another image for each.
                let (run, place) = (&runs[robot.run], number * 7 % eval.images.len());
                let elite = run
                    .elites
                    .iter()
                    .find(|elite| elite.id == robot.id)
                    .unwrap();
                let walked = walks_of(run, &elite.body, mnist, &eval.images[place..=place]);
                assert_eq!(walked, [robot.displacements[place]], "{}", robot.id);
            }
        }
        for line in table.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let of_task: Vec<f64> = eval
                .robots
                .iter()
                .filter(|robot| robot.task == cells[0])
                .map(|robot| robot.accuracy)
                .collect();
            if !of_task.is_empty() {
                let mean = 100.0 * of_task.iter().sum::<f64>() / of_task.len() as f64;
                assert!(
                    (mean - cells[4].parse::<f64>().unwrap()).abs() < 1e-9,
                    "{line}"
                );
                tasks += 1;
            }
        }
    }
    assert_eq!(tasks, 8);
}
