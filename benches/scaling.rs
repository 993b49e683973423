//! Estimates the scaling of one run over many processes (`mpirun morphcog evolve`).
//!
//! Evolves for a while, measures each robot's time in further generations on one thread, and then
//! divides these among 1 to 256 ranks as the program does. Started by mpirun with feature `mpi`, it
//! measures the exchange at the end of a generation instead.

use morphcog::base::clock::thread_time;
use morphcog::base::random::{Purpose, stream};
use morphcog::base::ranks::{Ranks, owners};
use morphcog::base::session::Session;
use morphcog::body::Body;
use morphcog::commands::evolve::{EvolveOptions, evolve};
use morphcog::config::Config;
use morphcog::data::dataset::Split;
use morphcog::images::training::TrainingImages;
use morphcog::images::whereabouts::Whereabouts;
use morphcog::store::folder::IfExists;
use morphcog::store::run::RunFile;
use morphcog::task::evaluation::{Evaluation, Job, Outcome, evaluate};
use std::time::Instant;

/// Numbers of ranks.
const RANKS: [usize; 9] = [1, 2, 4, 8, 16, 32, 64, 128, 256];
/// Assumed time of one exchange between nodes \[s\]; an all-gather needs log2(ranks), rounded up.
const HOP: f64 = 50e-6;

/// A case: name, changes of `zero_one_published.toml`, generations before measuring, measured
/// generations, and how many of these form one, as if with so many times the parents.
type Case = (&'static str, &'static [&'static str], u64, u64, usize);

const CASES: [Case; 3] = [
    ("2 images, 20 parents", &[], 60, 20, 1),
    ("2 images, 200 parents", &[], 60, 20, 10),
    ("100 images, 20 parents", &MANY_IMAGES, 2, 2, 1),
];

/// Changes of the last case.
const MANY_IMAGES: [&str; 3] = [
    "data.train_images=",
    "data.images_per_class=50",
    "evaluation.fitness=mean_clipped",
];

/// A robot's evaluation.
#[derive(Clone, Copy)]
struct Piece {
    voxels: u64,
    /// Processor time \[s\].
    seconds: f64,
    /// Number of simulated rollouts.
    rollouts: u64,
}

fn main() {
    let (ranks, _guard) = Ranks::join().expect("MPI is there, or there is one process");
    // `cargo test` calls it, too, but has nothing to measure.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    if ranks.size() > 1 {
        return exchange(ranks);
    }
    println!("case,ranks,seconds_per_generation,efficiency,efficiency_by_rollout,mean_rollouts");
    // Words on the command line choose cases.
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with('-'))
        .collect();
    let is_chosen =
        |name: &str| words.is_empty() || words.iter().any(|word| name.contains(word.as_str()));
    let mut known: Option<(&[&str], Vec<Vec<Piece>>)> = None;
    for (name, overrides, before, measured, together) in
        CASES.into_iter().filter(|case| is_chosen(case.0))
    {
        let measured = match known.take() {
            Some((of, measured)) if of == overrides => measured,
            _ => measure(overrides, before, measured),
        };
        let generations: Vec<Vec<Piece>> = measured
            .chunks(together)
            .map(<[Vec<Piece>]>::concat)
            .collect();
        known = Some((overrides, measured));
        for ranks in RANKS {
            let whole = |pieces: &Vec<Piece>| pieces.iter().map(|piece| piece.seconds).sum::<f64>();
            let hops = f64::from(ranks.next_power_of_two().trailing_zeros()) * HOP;
            let alone: f64 = generations.iter().map(whole).sum();
            let took: f64 = generations
                .iter()
                .map(|pieces| by_robot(pieces, ranks) + hops)
                .sum();
            let fine: f64 = generations
                .iter()
                .map(|pieces| by_rollout(pieces, ranks) + hops)
                .sum();
            let share = |took: f64| alone / took / ranks as f64;
            let count = generations.iter().flatten().count() as f64;
            let rollouts = generations
                .iter()
                .flatten()
                .map(|piece| piece.rollouts)
                .sum::<u64>() as f64
                / count;
            let each = took / generations.len() as f64;
            println!(
                "{name},{ranks},{each:.4},{:.3},{:.3},{rollouts:.2}",
                share(took),
                share(fine)
            );
        }
    }
}

/// Measures each robot of some generations.
fn measure(overrides: &[&str], before: u64, measured: u64) -> Vec<Vec<Piece>> {
    let own = [
        "data.dataset=builtin",
        "data.train_images=[0, 1]",
        "protocol.rollout=fresh",
    ];
    let all: Vec<String> = own
        .iter()
        .chain(overrides)
        .map(ToString::to_string)
        .collect();
    let config = Config::load("zero_one_published.toml", &all).expect("the config is valid");
    let folder = tempfile::tempdir().expect("there is a temporary folder");
    let run = |generations: u64| -> RunFile {
        let options = EvolveOptions {
            config: Config {
                generations,
                ..config.clone()
            },
            name: "scaling".to_string(),
            out: folder.path().join("run"),
            if_exists: IfExists::Resume,
        };
        evolve(&options, &Session::default())
            .expect("the run ends")
            .run
    };
    let dataset = Whereabouts::given(None)
        .load(&config.data, &[Split::Train])
        .expect("digits are drawn");
    let training = TrainingImages::of(&config, &dataset).expect("there are images");
    let grouping = config
        .grouping()
        .expect("the config has a task")
        .with_fitness(config.evaluation.fitness);
    (0..measured)
        .map(|generation| {
            let archive = run(before + generation);
            let parents = &archive.elites;
            let child = |number: u64| -> Option<Piece> {
                let mut rng = stream(9, Purpose::Mutation, before + generation, number);
                let parent = &parents[number as usize % parents.len()];
                let (_, body): (_, Body) = parent
                    .genome
                    .offspring(config.body_spec(), &config.genome, &mut rng)
                    .ok()?;
                let to_beat = parent.objective;
                let may_win = |known: &[Option<f64>]| {
                    grouping
                        .can_still_win(&training.answers(known.iter().copied()), |_| Some(to_beat))
                };
                let job = Job {
                    body: &body,
                    order: Vec::new(),
                    may_win: Box::new(may_win),
                    given_up: None,
                };
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(1)
                    .build()
                    .expect("a thread starts");
                let (protocol, physics) = (&config.protocol, &config.physics);
                let job = [job];
                let stimuli = &training.stimuli;
                pool.install(|| {
                    let began = thread_time();
                    let mut found = evaluate(
                        &job,
                        stimuli,
                        &[],
                        physics,
                        protocol,
                        config.savings,
                        &Session::default(),
                    )
                    .expect("nothing stops it");
                    let seconds = (thread_time() - began).as_secs_f64();
                    let rollouts = found.remove(0).simulated;
                    Some(Piece {
                        voxels: body.counts().total as u64,
                        seconds,
                        rollouts,
                    })
                })
            };
            (0..config.map_elites.parents as u64)
                .filter_map(child)
                .collect()
        })
        .collect()
}

/// Returns the time of a generation if robots are divided, as in the program \[s\].
fn by_robot(pieces: &[Piece], ranks: usize) -> f64 {
    let sizes: Vec<u64> = pieces.iter().map(|piece| piece.voxels).collect();
    longest(
        pieces.iter().map(|piece| piece.seconds),
        &owners(&sizes, ranks),
        ranks,
    )
}

/// Returns the time of a generation if single rollouts were divided \[s\].
fn by_rollout(pieces: &[Piece], ranks: usize) -> f64 {
    let single = |piece: &Piece| {
        let count = piece.rollouts.max(1);
        (0..count)
            .map(move |_| (piece.voxels, piece.seconds / count as f64))
            .collect::<Vec<_>>()
    };
    let all: Vec<(u64, f64)> = pieces.iter().flat_map(single).collect();
    let sizes: Vec<u64> = all.iter().map(|(voxels, _)| *voxels).collect();
    longest(
        all.iter().map(|(_, seconds)| *seconds),
        &owners(&sizes, ranks),
        ranks,
    )
}

fn longest(seconds: impl Iterator<Item = f64>, owners: &[usize], ranks: usize) -> f64 {
    let mut loads = vec![0.0; ranks];
    seconds
        .zip(owners)
        .for_each(|(seconds, owner)| loads[*owner] += seconds);
    loads.into_iter().fold(0.0, f64::max)
}

/// Measures the exchange of a generation's results among the ranks.
fn exchange(ranks: Ranks) {
    for (robots, images) in [(20, 2), (200, 2), (20, 300)] {
        let walked = Outcome::Walked((0..images).map(|image| 0.1 * f64::from(image)).collect());
        let one = Evaluation {
            outcome: walked,
            simulated: 2,
            shared: 0,
            stopped: 0,
        };
        let own = vec![one; robots / ranks.size() + 1];
        ranks.share(own.clone());
        let (began, times) = (Instant::now(), 200);
        (0..times).for_each(|_| _ = ranks.share(own.clone()));
        let each = began.elapsed().as_secs_f64() / f64::from(times);
        if ranks.leads() {
            println!(
                "exchange,{} ranks,{robots} robots,{images} images,{:.1} µs",
                ranks.size(),
                1e6 * each
            );
        }
    }
}
