//! Lossless savings: the archive is the same with every combination of them on and off; with them,
//! less is simulated.

use crate::common::program::{Sandbox, TINY};
use morphcog::store::run::Robot;
use std::collections::BTreeMap;

/// All three savings; bit `i` of a combination switches the `i`-th on.
const SAVINGS: [&str; 3] = ["known_bodies", "early_stop", "shared_rollouts"];

/// The last line of `metrics.csv` by column; in every line the counts must add up.
fn totals(metrics: &str, images: u64) -> BTreeMap<String, u64> {
    let mut rows = csv::Reader::from_reader(metrics.as_bytes());
    let mut last = BTreeMap::new();
    for row in rows.deserialize::<BTreeMap<String, String>>() {
        let row = row.unwrap();
        let number = |name: &str| row[name].parse::<u64>().unwrap();
        assert_eq!(number("simulated") + number("saved"), number("evaluations") * images, "{row:?}");
        let parts = SAVINGS.map(|saving| number(&format!("saved_{saving}")));
        assert_eq!(number("saved"), parts.iter().sum::<u64>(), "{row:?}");
        let names = ["evaluations", "simulated"].map(str::to_string);
        let saved = SAVINGS.map(|saving| format!("saved_{saving}"));
        last = names.into_iter().chain(saved).map(|name| (name.clone(), number(&name))).collect();
    }
    last
}

/// Runs a config with all combinations of savings: same elites. `effective` savings must have saved
/// something.
fn check(config: &str, images: u64, effective: &[&str]) {
    let sandbox = Sandbox::new();
    sandbox.write("run.toml", config);
    let run = |mask: usize| -> (Vec<Robot>, BTreeMap<String, u64>) {
        let switch = |bit: usize| format!("--set savings.{}={}", SAVINGS[bit], mask >> bit & 1 == 1);
        let switches = [0, 1, 2].map(switch).join(" ");
        sandbox.run(&format!("evolve -q -c run.toml -o {mask} {switches}")).ended(0, &[]);
        let metrics = sandbox.read(&format!("{mask}/metrics.csv"));
        (sandbox.run_file(&mask.to_string()).elites, totals(&metrics, images))
    };
    let (elites, none) = run(0);
    assert!(elites.len() >= 4, "{} elites: too small a run to say anything", elites.len());
    for mask in 1..8 {
        let (same, some) = run(mask);
        assert_eq!(same, elites, "savings {mask:03b}");
        assert_eq!(some["evaluations"], none["evaluations"]);
        assert!(some["simulated"] <= none["simulated"], "savings {mask:03b}");
        for (bit, saving) in SAVINGS.iter().enumerate() {
            let saved = some[&format!("saved_{saving}")];
            if mask == 1 << bit && effective.contains(saving) {
                assert!(saved > 0 && some["simulated"] < none["simulated"], "{saving} alone: {some:?}");
            }
            // What an instability makes needless counts as stopped early.
            assert!(mask >> bit & 1 == 1 || *saving == "early_stop" || saved == 0, "{saving}: {some:?}");
        }
        assert!(mask < 7 || some["simulated"] < none["simulated"]);
    }
}

#[test]
fn two_groups() {
    // Long enough a rollout for robots that walk both ways: only a success can end a rollout early.
    let config = TINY
        .replace("generations = 12", "generations = 30")
        .replace("control_steps = 20", "control_steps = 50");
    check(&config, 2, &SAVINGS);
}

#[test]
fn all_splits() {
    let config = TINY
        .replace("groups = [[0], [1]]", "splits = [0, 1, 2, 3]")
        .replace("train_images = [0, 1]", "train_images = [0, 1, 2, 3]");
    check(&config, 4, &["known_bodies", "shared_rollouts"]);
}

#[test]
fn all_splits_with_the_bin_for_the_same_way() {
    let config = TINY
        .replace("generations = 12", "generations = 25")
        .replace("groups = [[0], [1]]", "splits = [3, 0, 7]\nsame_way_bin = true")
        .replace("train_images = [0, 1]", "train_images = [0, 3, 7]");
    check(&config, 3, &["known_bodies", "shared_rollouts"]);
}

#[test]
fn sequential_rollouts() {
    let config = TINY
        .replace("generations = 12", "generations = 30")
        .replace("rollout = \"fresh\"", "rollout = \"sequential\"");
    check(&config, 2, &["known_bodies", "early_stop"]);
}

#[test]
fn three_images_per_class() {
    let config = TINY.replace("train_images = [0, 1]", "images_per_class = 3");
    check(&config, 6, &SAVINGS);
}

#[test]
fn splits_with_two_images_per_class() {
    let config = TINY
        .replace("groups = [[0], [1]]", "splits = [0, 1, 2]\nsame_way_bin = true")
        .replace("train_images = [0, 1]", "images_per_class = 2");
    check(&config, 6, &["known_bodies", "shared_rollouts"]);
}

#[test]
fn unequal_groups_and_saturated_images() {
    let config = TINY
        .replace("groups = [[0], [1]]", "groups = [[5], [1, 2]]")
        .replace("train_images = [0, 1]", "train_images = [1, 5, 2, 12]")
        .replace("reduction = \"area\"", "reduction = \"area\"\nencoding = \"saturated\"");
    check(&config, 4, &["known_bodies", "shared_rollouts"]);
}

#[test]
fn thresholded_images_and_random_immigrants() {
    let config = TINY
        .replace("reduction = \"area\"", "reduction = \"area\"\nencoding = \"threshold\"\nlevel = 0.3")
        .replace("parents = 8", "parents = 6\nrandom_immigrants = 3");
    check(&config, 2, &["known_bodies", "shared_rollouts"]);
}
