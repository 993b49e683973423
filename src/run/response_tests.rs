use super::*;
use crate::run::training::Training;
use crate::task::condition::Condition;

/// Two classes of built-in digits, three images of each.
const CONFIG: &str = "[task]\ngroups = [[0], [1]]\n[data]\ndataset = \"builtin\"\nimages_per_class = 3\n";

fn config(more: &str, set: &[&str]) -> Result<Config, Error> {
    let set: Vec<String> = set.iter().map(ToString::to_string).collect();
    Config::parse(&format!("{CONFIG}{more}"), "a.toml", &set)
}

const RESPONSE: &str = "[evaluation]\nfitness = \"response\"\n";

#[test]
fn shuffling_keeps_the_values_of_every_pixel_and_is_the_same_for_the_same_seed() {
    let images = |more: &str, seed: &str| {
        Training::load(&config(more, &[&format!("seed={seed}")]).unwrap(), None).unwrap()
    };
    let (plain, random) = (images("", "1"), images(RESPONSE, "1"));
    assert_eq!(random.images, plain.images);
    assert_eq!(random.stimuli.len(), 6);
    let values = |training: &Training, place: (usize, usize)| {
        let mut values: Vec<f64> = training.stimuli.iter().map(|image| image[place]).collect();
        values.sort_unstable_by(f64::total_cmp);
        values
    };
    for (place, _) in plain.stimuli[0].iter() {
        assert_eq!(values(&random, place), values(&plain, place), "{place:?}");
    }
    // Not whole images in another order.
    assert!(random.stimuli.iter().all(|image| !plain.stimuli.contains(image)));
    assert_eq!(images(RESPONSE, "1").stimuli, random.stimuli);
    // Other orders of the same images with another seed, or in another period.
    let first = Period { stage: 0, draw: 0 };
    assert_eq!(shuffled(&plain.stimuli, 1, first), random.stimuli);
    assert_ne!(shuffled(&plain.stimuli, 2, first), random.stimuli);
    assert_ne!(shuffled(&plain.stimuli, 1, Period { draw: 1, ..first }), random.stimuli);
    assert!(shuffled(&[], 1, first).is_empty());
}

#[test]
fn every_second_image_is_shown_from_a_raised_start_without_length_limits() {
    let (ground, raised) = (Condition::default(), Condition { raised: 1, without_limits: true });
    let training = Training::load(&config(RESPONSE, &[]).unwrap(), None).unwrap();
    assert_eq!(training.conditions, [ground, raised, ground, raised, ground, raised]);
    let plain = Training::load(&config("", &[]).unwrap(), None).unwrap();
    assert_eq!(plain.conditions, [ground; 6]);
}

#[test]
fn what_does_not_go_with_a_response_is_refused_with_its_key() {
    assert!(config(RESPONSE, &[]).is_ok());
    assert!(config(RESPONSE, &["data.images_per_class=2"]).is_ok());
    assert!(config(RESPONSE, &["genome.voxel_mutations=0.5", "genome.voxel_changes=4"]).is_ok());
    let refused = [
        ("data.images_per_class=1", "data.images_per_class = 1", "4 training images or more"),
        ("data.train_images=[0, 1, 2]", "data.train_images = 3 images", "4 training images or more"),
        ("protocol.life=\"sequential\"", "protocol.life = \"sequential\"", "\"fresh\""),
        ("genome.voxel_candidates=2", "genome.voxel_candidates = 2", "expected 1"),
        ("genome.voxel_relatives=1", "genome.voxel_relatives = 1", "expected 0"),
    ];
    for (set, found, expected) in refused {
        let message = config(RESPONSE, &[set]).unwrap_err().message;
        assert!(message.contains(found) && message.contains(expected), "{set}: {message}");
        assert!(message.contains("evaluation.fitness = \"response\""), "{set}: {message}");
        assert!(config("", &[set]).is_ok(), "{set}: it is no error by itself");
    }
    let splits = CONFIG.replace("groups = [[0], [1]]", "splits = [0, 1, 2]");
    let message = Config::parse(&format!("{splits}{RESPONSE}"), "a.toml", &[]).unwrap_err().message;
    assert!(message.contains("a.toml:2: task.splits = 3 tasks: "), "{message}");
    assert!(message.contains("one task, as groups"), "{message}");
    let stages = format!("{RESPONSE}[[stage]]\nfitness = \"min\"\n");
    let message = config(&stages, &[]).unwrap_err().message;
    assert!(message.contains("stage = 1 stages: ") && message.contains("expected none"), "{message}");
    let message = config("[[stage]]\nfitness = \"response\"\n", &[]).unwrap_err().message;
    assert!(message.contains("stage 1: fitness = \"response\": expected another"), "{message}");
}
