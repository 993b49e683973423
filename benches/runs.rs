//! Cost of a rollout, a generation's rollouts, an evaluation, and a run's bookkeeping.

mod processor;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use morphcog::base::Grid;
use morphcog::base::random::{Purpose, stream};
use morphcog::base::session::Session;
use morphcog::base::stop::NEVER;
use morphcog::body::Body;
use morphcog::commands::bench;
use morphcog::commands::evolve::{EvolveOptions, evolve};
use morphcog::config::Config;
use morphcog::genome::Genome;
use morphcog::sim::{InstructionSet, System, Worlds};
use morphcog::store::checkpoint::{self, Checkpoint, KnownBodies};
use morphcog::store::folder::IfExists;
use morphcog::store::metrics::Totals;
use morphcog::store::run::RunFile;
use morphcog::task::evaluation::{Job, Savings, evaluate};
use morphcog::task::rollout::{fresh_rollout, fresh_rollouts_of};
use processor::Processor;
use std::sync::Arc;

/// The paper's bodies and rollouts, on built-in digits.
const OVERRIDES: [&str; 5] = [
    "data.dataset=builtin",
    "data.train_images=[0, 1]",
    "protocol.rollout=fresh",
    "generations=40",
    "protocol.control_steps=50",
];

fn config(overrides: &[&str]) -> Config {
    let overrides: Vec<String> = overrides.iter().map(ToString::to_string).collect();
    Config::load("zero_one.toml", &overrides).expect("the config is valid")
}

fn stimulus(seed: usize) -> Grid<f64> {
    Grid::from_fn(14, 14, |row, column| {
        f64::from(u8::from((row * 3 + column * 5 + seed).is_multiple_of(7)))
    })
}

fn rollouts(criterion: &mut Criterion<Processor>) {
    let config = config(&OVERRIDES[..4]);
    let mut group = criterion.benchmark_group("rollout, 500 control steps");
    group.sample_size(10);
    for specimen in bench::specimens() {
        let system = Arc::new(System::new(&specimen.body, config.physics.clone()));
        let stimulus = stimulus(0);
        group.bench_function(specimen.name, |bencher| {
            bencher.iter(|| fresh_rollout(&system, &config.protocol, &stimulus, &NEVER));
        });
    }
}

/// Simulates one body eight times, one by one and side by side, as the program may or may not do.
fn side_by_side(criterion: &mut Criterion<Processor>) {
    let config = config(&OVERRIDES);
    let stimuli: Vec<Grid<f64>> = (0..Worlds::MOST).map(stimulus).collect();
    let mut group = criterion.benchmark_group("eight simulations of 50 control steps");
    group.sample_size(20);
    for specimen in bench::specimens() {
        let system = Arc::new(System::new(&specimen.body, config.physics.clone()));
        let by_itself = |stimulus: &Grid<f64>| {
            fresh_rollout(&system, &config.protocol, stimulus, &NEVER).is_ok()
        };
        group.bench_function(format!("{}, one by one", specimen.name), |bencher| {
            bencher.iter(|| stimuli.iter().map(by_itself).collect::<Vec<bool>>());
        });
        group.bench_function(format!("{}, side by side", specimen.name), |bencher| {
            bencher.iter(|| fresh_rollouts_of(&system, &config.protocol, &stimuli, &NEVER));
        });
    }
}

fn evaluations(criterion: &mut Criterion) {
    let config = config(&OVERRIDES);
    let bodies: Vec<Body> = (0..20)
        .map(|child| stream(1, Purpose::RandomImmigrant, 0, child))
        .filter_map(|mut rng| Genome::random(config.body_spec(), &config.genome, &mut rng).ok())
        .map(|(_, body)| body)
        .collect();
    let specimens = bench::specimens();
    let cases: [(&str, Vec<&Body>, usize); 3] = [
        (
            "generation: 20 random robots, 2 images",
            bodies.iter().collect(),
            2,
        ),
        (
            "eval: the full robot, 100 images",
            vec![&specimens[0].body],
            100,
        ),
        (
            "eval: the mostly rigid robot, 100 images",
            vec![&specimens[3].body],
            100,
        ),
    ];
    let savings = Savings {
        known_bodies: false,
        early_stop: false,
        shared_rollouts: false,
    };
    let mut group = criterion.benchmark_group(format!(
        "rollouts of 50 control steps, {}",
        InstructionSet::in_use().name()
    ));
    group.sample_size(10);
    for (name, bodies, images) in cases {
        let images: Vec<Grid<f64>> = (0..images).map(stimulus).collect();
        let jobs: Vec<Job> = bodies
            .iter()
            .map(|&body| Job {
                body,
                order: Vec::new(),
                may_win: Box::new(|_| true),
                given_up: None,
            })
            .collect();
        group.throughput(Throughput::Elements((bodies.len() * images.len()) as u64));
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads start");
            group.bench_function(format!("{name}, {threads} threads"), |bencher| {
                let run = || {
                    evaluate(
                        &jobs,
                        &images,
                        &[],
                        &config.physics,
                        &config.protocol,
                        savings,
                        &Session::default(),
                    )
                };
                bencher.iter(|| pool.install(run));
            });
        }
    }
}

fn bookkeeping(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("there is a temporary folder");
    let options = EvolveOptions {
        config: config(&OVERRIDES),
        name: "bench".to_string(),
        out: folder.path().join("run"),
        if_exists: IfExists::Refuse,
    };
    let run: RunFile = evolve(&options, &Session::default())
        .expect("the run ends")
        .run;
    let mut known_bodies = KnownBodies::default();
    for i in 0..600_000_u128 {
        known_bodies.insert((i * 0x9E37_79B9_7F4A_7C15_F39C_C060_5CED_C834).to_le_bytes());
    }
    let checkpoint = Checkpoint {
        run,
        totals: Totals::default(),
        known_bodies,
    };
    let mut group = criterion.benchmark_group("bookkeeping");
    group.sample_size(10);
    group.bench_function("an offspring and its body", |bencher| {
        let (config, mut child) = (&options.config, 0);
        let parents: Vec<&Genome> = checkpoint
            .run
            .elites
            .iter()
            .map(|robot| &robot.genome)
            .collect();
        bencher.iter(|| {
            child += 1;
            let mut rng = stream(1, Purpose::Mutation, 1, child);
            parents[child as usize % parents.len()].offspring(
                config.body_spec(),
                &config.genome,
                &mut rng,
            )
        });
    });
    group.bench_function("run.json as text", |bencher| {
        bencher.iter(|| checkpoint.run.to_json())
    });
    group.bench_function("a checkpoint after 600,000 bodies", |bencher| {
        bencher.iter(|| checkpoint::write(folder.path(), &checkpoint));
    });
}

criterion_group! {
    name = one_thread;
    config = Criterion::default().with_measurement(Processor);
    targets = rollouts, side_by_side
}
// Threads that wait for each other, and files, take wall-clock time.
criterion_group!(by_the_clock, evaluations, bookkeeping);
criterion_main!(one_thread, by_the_clock);
