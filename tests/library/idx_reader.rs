//! Our IDX reader against an independent one (the `mnist` crate), and against what is known of the
//! real MNIST.
#![allow(clippy::disallowed_methods)]

use crate::common::program::mnist;
use morphcog::data::dataset::{Dataset, Split};
use morphcog::data::files::places;
use std::path::Path;

const SIDE: u32 = 28;

/// Bytes without a pattern (a linear congruential generator; constants of Numerical Recipes).
fn noise(count: usize, seed: u32) -> Vec<u8> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    (0..count).map(|_| next()).collect()
}

/// Writes an IDX file, its header spelled out here and not by the code under test.
fn write(file: &Path, magic: u32, sizes: &[u32], content: &[u8]) {
    let mut bytes = magic.to_be_bytes().to_vec();
    bytes.extend(sizes.iter().flat_map(|size| size.to_be_bytes()));
    bytes.extend(content);
    std::fs::write(file, bytes).unwrap();
}

#[test]
fn a_whole_set_is_read_as_the_mnist_crate_reads_it() {
    let folder = tempfile::tempdir().unwrap();
    for (stem, count, seed) in [("train", 60_000u32, 1), ("t10k", 10_000, 2)] {
        let pixels = noise((count * SIDE * SIDE) as usize, seed);
        let labels: Vec<u8> = noise(count as usize, seed + 10)
            .iter()
            .map(|b| b % 10)
            .collect();
        let path = |rest: &str| folder.path().join(format!("{stem}-{rest}"));
        write(
            &path("images-idx3-ubyte"),
            2051,
            &[count, SIDE, SIDE],
            &pixels,
        );
        write(&path("labels-idx1-ubyte"), 2049, &[count], &labels);
    }
    let theirs = mnist::MnistBuilder::new()
        .base_path(folder.path().to_str().unwrap())
        .label_format_digit()
        .finalize();
    let ours = Dataset::load(
        "mnist",
        &places(Some(folder.path()), None, None),
        &Split::ALL,
    )
    .unwrap();
    for (split, count, pixels, labels) in [
        (Split::Train, 60_000, &theirs.trn_img, &theirs.trn_lbl),
        (Split::Test, 10_000, &theirs.tst_img, &theirs.tst_lbl),
    ] {
        assert_eq!((ours.len(split), labels.len()), (count, count));
        for (index, (image, label)) in pixels
            .chunks((SIDE * SIDE) as usize)
            .zip(labels)
            .enumerate()
        {
            assert_eq!(ours.label(split, index).unwrap(), *label, "{split} {index}");
            assert!(
                ours.image(split, index).unwrap().cells() == image,
                "{split} {index}"
            );
        }
    }
}

#[test]
fn the_real_test_set_has_its_published_class_counts() {
    let Some(folder) = mnist("class counts of the real one") else {
        return;
    };
    let given = places(None, Some(folder), None);
    let data = Dataset::load("mnist", &given, &[Split::Test]).unwrap();
    let counts: Vec<usize> = (0..10)
        .map(|class| data.indices_of(Split::Test, class).len())
        .collect();
    assert_eq!(
        counts,
        [980, 1135, 1032, 1010, 982, 892, 958, 1028, 974, 1009]
    );
    assert_eq!(data.len(Split::Test), 10_000);
}

#[test]
fn the_papers_training_images_are_a_zero_a_one_a_two_and_a_three() {
    let Some(folder) = mnist("the paper's training images") else {
        return;
    };
    let given = places(None, Some(folder), None);
    let data = Dataset::load("mnist", &given, &[Split::Train]).unwrap();
    let labels = [1, 3, 5, 7].map(|index| data.label(Split::Train, index).unwrap());
    assert_eq!(labels, [0, 1, 2, 3]);
    let image = data.image(Split::Train, 1).unwrap();
    assert_eq!((image.height(), image.width()), (28, 28));
}
