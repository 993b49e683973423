//! `fitness = "response"`: the body's probe is measured with random images, and what reads a
//! run reads this one.
#![allow(clippy::disallowed_methods)]

use crate::common::program::{Sandbox, TINY};
use morphcog::base::session::Session;
use morphcog::body::{Body, Material};
use morphcog::config::Config;
use morphcog::images::training::TrainingImages;
use morphcog::store::run::RunFile;
use morphcog::task::evaluation::{Job, Outcome, Savings, evaluate};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Two classes, four images of each, half of the offspring changed in voxels.
fn sandbox() -> Sandbox {
    let tiny = TINY
        .replace("train_images = [0, 1]", "images_per_class = 4")
        .replace("control_steps = 20", "control_steps = 60");
    let sandbox = Sandbox::new();
    let more = "[evaluation]\nfitness = \"response\"\n[genome]\nvoxel_mutations = 0.5\nvoxel_changes = 4\n";
    sandbox.write("response.toml", format!("{tiny}\n{more}"));
    sandbox
}

fn evolve(sandbox: &Sandbox) -> RunFile {
    sandbox
        .run("evolve -q -c response.toml -o run")
        .ended(0, &[]);
    sandbox.run_file("run")
}

#[test]
fn a_robot_is_as_fit_as_opposite_images_move_its_probe_apart() {
    let sandbox = sandbox();
    let run = evolve(&sandbox);
    let training = TrainingImages::load(&run.config, None::<&Path>).unwrap();
    let mut moved = 0;
    for robot in &run.elites {
        // Bodies stay as their genomes say.
        let probe = robot.body.voxels().map(|material| match material {
            Material::Soft | Material::SensorShrink => Material::SensorExpand,
            other => *other,
        });
        let probe = Body::new(probe).unwrap();
        let places = probe.counts().sensor;
        let job = Job {
            body: &probe,
            order: vec![],
            may_win: Box::new(|_| true),
            given_up: None,
        };
        let TrainingImages {
            stimuli,
            conditions,
            ..
        } = &training;
        let Config {
            physics, protocol, ..
        } = &run.config;
        let (savings, stop) = (Savings::default(), AtomicBool::new(false));
        let evaluation = evaluate(
            &[job],
            stimuli,
            conditions,
            physics,
            protocol,
            savings,
            &Session::new(&stop, &()),
        )
        .unwrap();
        let Outcome::Walked(d) = &evaluation[0].outcome else {
            panic!("{}: unstable", robot.id)
        };
        assert_eq!(d, &robot.displacements, "{}", robot.id);
        let [odd, even] =
            [-1.0, 1.0].map(|sign| [0, 2, 4, 6].map(|i| (d[i] + sign * d[i + 1]) / 2.0));
        let within = |a: f64, b: f64| (a - b).powi(2) / 2.0;
        let chance = (within(even[0], even[2]) + within(even[1], even[3])) / 2.0;
        let linear = odd.iter().map(|odd| odd * odd).sum::<f64>() / 4.0 - chance;
        let anyway = (even.iter().sum::<f64>() / 4.0).abs();
        let size = robot.body.height() * robot.body.width();
        let response = (places.clamp(1, size * 2 / 3) as f64).sqrt()
            * (linear.signum() * linear.abs().sqrt() - anyway / 8.0);
        assert!(
            (response - robot.objective).abs() < 1e-9,
            "{}: {response}",
            robot.id
        );
        if places == 0 {
            assert!(robot.objective <= 0.0, "{}", robot.id);
        }
        moved += usize::from(robot.objective > 0.01);
    }
    assert!(moved >= 3, "{moved} of {} respond", run.elites.len());
    assert!(
        run.elites
            .iter()
            .any(|robot| robot.body != robot.body.probe())
    );
    assert!(!run.follows_protocol());
}

#[test]
fn what_reads_a_run_reads_this_one() {
    let sandbox = sandbox();
    let run = evolve(&sandbox);
    let best = &run.best().unwrap().id;
    for command in ["eval", "audit"] {
        sandbox
            .run(&format!("{command} -a run/run.json"))
            .ended(3, &["morphcog train"]);
    }
    sandbox
        .run(&format!(
            "replay -a run/run.json --robot {best} -o replay.png"
        ))
        .ended(0, &[]);
    sandbox
        .run("plot archive -a run/run.json -o archive.svg")
        .ended(0, &[]);
    sandbox.run("report run").ended(0, &[]);
    assert!(
        sandbox
            .read("run/report.html")
            .contains("the two images of a pair")
    );
}
