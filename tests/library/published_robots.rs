//! Faithful: the robots that the paper's authors published walk as published.
#![allow(clippy::disallowed_methods)]

use crate::common::program::{Sandbox, mnist, said};
use crate::common::reference::golden;
use morphcog::base::Grid;
use morphcog::base::stop::NEVER;
use morphcog::body::Body;
use morphcog::data::dataset::{Dataset, Split};
use morphcog::data::files::places;
use morphcog::robots::published;
use morphcog::sim::{Physics, System};
use morphcog::store::eval::EvalFile;
use morphcog::task::fitness::Group::{A, B};
use morphcog::task::protocol::{Protocol, RolloutMode};
use morphcog::task::rollout::{Rollout, fresh_rollout};
use morphcog::task::score::two_group_fitness;
use morphcog::task::stimulus::{Encoding, Reduction, StimulusParams, stimulus};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::Arc;

#[derive(Deserialize)]
struct Published {
    task: String,
    published_fitness: f64,
    body: Body,
    /// A row per run of EvoGym, a column per image.
    evogym_displacements: Vec<Vec<f64>>,
}

/// The training images of the published runs: one of each of 0, 1, 2, 3.
const IMAGES: [usize; 4] = [1, 3, 5, 7];

fn stimuli() -> Option<Vec<Grid<f64>>> {
    let given = places(None, Some(mnist("published robots")?), None);
    let mnist = Dataset::load("mnist", &given, &[Split::Train]).unwrap();
    let saturated = StimulusParams {
        reduction: Reduction::Stride,
        encoding: Encoding::Saturated,
        ..StimulusParams::default()
    };
    let see = |(digit, &index): (usize, &usize)| {
        assert_eq!(
            usize::from(mnist.label(Split::Train, index).unwrap()),
            digit
        );
        stimulus(
            &mnist.image(Split::Train, index).unwrap(),
            14,
            14,
            &saturated,
        )
        .unwrap()
    };
    Some(IMAGES.iter().enumerate().map(see).collect())
}

/// Displacements under the protocol of the robot's task.
fn displacements(robot: &Published, stimuli: &[Grid<f64>], physics: &Physics) -> Vec<f64> {
    let system = Arc::new(System::new(&robot.body, physics.clone()));
    let protocol = |rollout, control_steps| Protocol {
        rollout,
        control_steps,
        start_row: 2,
        start_column: 493,
    };
    match robot.task.as_str() {
        "zero_one" => {
            let protocol = protocol(RolloutMode::Sequential, 500);
            let mut rollout = Rollout::new(&system, &protocol);
            stimuli[..2]
                .iter()
                .map(|stimulus| rollout.show(stimulus, |_| ()).unwrap())
                .collect()
        }
        "four_digit" => {
            let protocol = protocol(RolloutMode::Fresh, 250);
            let rollout = |stimulus| fresh_rollout(&system, &protocol, stimulus, &NEVER).unwrap();
            stimuli.iter().map(rollout).collect()
        }
        other => panic!("no protocol for {other}"),
    }
}

#[test]
fn every_published_robot_walks_as_evogym_has_it_walk() {
    let Some(stimuli) = stimuli() else { return };
    let physics = Physics::default();
    let robots: BTreeMap<String, Published> = golden("published_robots");
    assert!(robots.len() >= 5 && robots.contains_key("XFJPI"));
    let mut wrong = Vec::new();
    for (name, robot) in &robots {
        let ours = displacements(robot, &stimuli, &physics);
        assert_eq!(ours.len(), robot.evogym_displacements[0].len(), "{name}");
        for (image, d) in ours.iter().enumerate() {
            let theirs = robot.evogym_displacements.iter().map(|row| row[image]);
            let low = theirs.clone().fold(f64::INFINITY, f64::min);
            let high = theirs.fold(f64::NEG_INFINITY, f64::max);
            let margin = (high - low) + 0.1 + 0.05 * low.abs().max(high.abs());
            println!("{name} image {image}: {d:.4}, EvoGym {low} to {high}");
            if !(low - margin..=high + margin).contains(d) {
                wrong.push(format!(
                    "{name} image {image}: {d}, expected {low} to {high} ± {margin}"
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn the_robot_that_starts_clear_of_the_ground_has_its_published_fitness_to_a_millionth() {
    let Some(stimuli) = stimuli() else { return };
    let robots: BTreeMap<String, Published> = golden("published_robots");
    let robot = &robots["XFJPI"];
    let walked = displacements(robot, &stimuli, &Physics::default());
    let fitness = two_group_fitness(&[(A, walked[0]), (B, walked[1])]);
    println!("XFJPI: {fitness}");
    assert!((fitness - 17.316384958834874).abs() < 1e-6, "{fitness}");
    assert_eq!(robot.published_fitness, 17.316384958834874);
}

#[test]
fn the_built_in_gallery_holds_these_very_robots() {
    let robots: BTreeMap<String, Published> = golden("published_robots");
    let gallery = published::gallery().unwrap();
    assert_eq!(gallery.len(), 5);
    for shipped in gallery {
        let published = &robots[&shipped.name];
        assert_eq!(
            (&shipped.body, shipped.fitness),
            (&published.body, published.published_fitness)
        );
        assert_eq!(published.task, "zero_one");
    }
    let config = published::config().unwrap();
    assert_eq!(
        (config.protocol.rollout, config.protocol.control_steps),
        (RolloutMode::Sequential, 500)
    );
    assert_eq!(
        (config.protocol.start_row, config.protocol.start_column),
        (2, 493)
    );
    assert_eq!(config.data.train_images.as_deref(), Some(&IMAGES[..2]));
    assert_eq!(config.physics, Physics::default());
}

#[test]
fn the_published_robots_answer_test_images() {
    let Some(data) = mnist("published robots") else {
        return;
    };
    let sandbox = Sandbox::new();
    let data = std::fs::canonicalize(data).unwrap();
    let args = [
        "eval",
        "-q",
        "--robots",
        "qmaxd,YJTLA",
        "--images",
        "40",
        "--data",
    ];
    let mut command = sandbox.command(args);
    command.arg(data);
    said(command).ended(0, &[]);
    let report = EvalFile::read(&sandbox.path("gallery-eval.json")).unwrap();
    let names: Vec<&str> = report
        .robots
        .iter()
        .map(|robot| robot.id.as_str())
        .collect();
    assert_eq!(names, ["QMAXD", "YJTLA"]);
    // 97.2 and 88.7 % of 1000 images.
    assert!(
        report.robots.iter().all(|robot| robot.right >= 30),
        "{:?}",
        report.means
    );
    // Which way a zero is to be answered is known of them.
    let walks = report
        .robots
        .iter()
        .map(|robot| robot.first_group_walks.as_str());
    assert_eq!(walks.collect::<Vec<_>>(), ["right", "left"]);
}
