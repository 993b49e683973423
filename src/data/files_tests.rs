//! Contract of the search for a dataset's files.

use super::*;
use crate::data::dataset::{Dataset, DatasetError};
use std::fs;

/// Writes images and labels under the given names; every pixel of image i is i, label i is 10 − i.
fn write(folder: &Path, images: &str, labels: &str, count: u8) {
    let pixels: Vec<u8> = (0..count).flat_map(|i| [i; 6]).collect();
    let values: Vec<u8> = (0..count).map(|i| 10 - i).collect();
    let count = u32::from(count);
    fs::write(folder.join(images), [idx::header(&[count, 2, 3]), pixels].concat()).unwrap();
    fs::write(folder.join(labels), [idx::header(&[count]), values].concat()).unwrap();
}

fn given(folder: &Path) -> Vec<Place> {
    places(Some(folder), None, None)
}

fn failure(name: &str, folder: &Path, split: Split) -> String {
    Dataset::load(name, &given(folder), &[split]).unwrap_err().to_string()
}

#[test]
fn standard_names_in_every_spelling_are_found() {
    for (images, labels, split) in [
        ("train-images-idx3-ubyte", "train-labels-idx1-ubyte", Split::Train),
        ("train-images.idx3-ubyte", "train-labels.idx1-ubyte.gz", Split::Train),
        ("t10k-images-idx3-ubyte.gz", "t10k-labels.idx1-ubyte", Split::Test),
        ("emnist-digits-test-images-idx3-ubyte.gz", "emnist-digits-test-labels-idx1-ubyte.gz", Split::Test),
    ] {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), images, labels, 3);
        let data = Dataset::load("own", &given(folder.path()), &[split]).unwrap();
        assert_eq!((data.len(split), data.label(split, 2).unwrap()), (3, 8), "{images}");
        assert_eq!(data.image(split, 2).unwrap(), crate::base::Grid::filled(2, 3, 2));
        assert_eq!(data.indices_of(split, 9), [1]);
        assert_eq!(data.info().splits[&split].files[0].name, images);
    }
}

#[test]
fn only_the_wanted_split_needs_its_files() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "train-images-idx3-ubyte", "train-labels-idx1-ubyte", 3);
    assert!(Dataset::load("mnist", &given(folder.path()), &[Split::Train]).is_ok());
    let message = failure("mnist", folder.path(), Split::Test);
    for part in ["test images", "t10k-images-idx3-ubyte", "--data", "morphcog data fetch mnist --to"] {
        assert!(message.contains(part), "{part}: {message}");
    }
    assert!(message.contains(folder.path().to_str().unwrap()), "{message}");
}

#[test]
fn the_first_given_place_is_used_and_has_to_work() {
    let (good, empty) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    write(good.path(), "train-images-idx3-ubyte", "train-labels-idx1-ubyte", 3);
    let both = places(Some(empty.path()), Some(good.path().into()), Some(good.path()));
    let origins: Vec<&str> = both.iter().map(|p| p.origin.as_str()).collect();
    assert_eq!(origins, ["--data", "MORPHCOG_DATA", "[data] dir"]);
    assert!(Dataset::load("mnist", &both, &[Split::Train]).is_err());
    assert!(Dataset::load("mnist", &both[1..], &[Split::Train]).is_ok());
    assert!(places(None, Some(OsString::new()), None).is_empty());
    assert_eq!(choose("mnist", &[]).unwrap().path, Path::new("data/mnist"));
}

#[test]
fn a_subfolder_with_the_datasets_name_comes_first() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "train-images-idx3-ubyte", "train-labels-idx1-ubyte", 3);
    fs::create_dir(folder.path().join("own")).unwrap();
    write(&folder.path().join("own"), "train-images-idx3-ubyte", "train-labels-idx1-ubyte", 5);
    let load = |name| Dataset::load(name, &given(folder.path()), &[Split::Train]).unwrap().len(Split::Train);
    assert_eq!((load("own"), load("mnist")), (5, 3));
}

#[test]
fn broken_files_are_named_with_the_command_that_helps() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "train-images-idx3-ubyte", "train-labels-idx1-ubyte", 3);
    let labels = folder.path().join("train-labels-idx1-ubyte");
    fs::write(&labels, [idx::header(&[2]), vec![1, 2]].concat()).unwrap();
    let message = failure("mnist", folder.path(), Split::Train);
    assert!(message.contains("holds 2 labels, expected 3"), "{message}");
    fs::write(&labels, [idx::header(&[3]), vec![1, 2]].concat()).unwrap();
    let message = failure("mnist", folder.path(), Split::Train);
    assert!(message.contains("too short") && message.contains("--force"), "{message}");
    let message = failure("my-letters", folder.path(), Split::Train);
    assert!(message.contains("too short") && !message.contains("fetch"), "{message}");
}

#[test]
fn what_could_be_several_datasets_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for set in ["digits", "letters"] {
        let name = |content| format!("emnist-{set}-train-{content}-ubyte.gz");
        write(folder.path(), &name("images-idx3"), &name("labels-idx1"), 3);
    }
    let message = failure("emnist", folder.path(), Split::Train);
    assert!(message.contains("emnist-digits-train") && message.contains("emnist-letters-train"), "{message}");
}

#[test]
fn names_that_are_paths_and_missing_folders_are_errors() {
    for name in ["../mnist", "", "a/b", ".hidden"] {
        let error = Dataset::load(name, &[], &[Split::Train]).unwrap_err();
        assert!(matches!(error, DatasetError::Files(FilesError::Name(_))), "{error}");
    }
    let message = failure("fashion-mnist", Path::new("no/such/folder"), Split::Train);
    assert!(message.contains("no/such/folder") && message.contains("data fetch fashion-mnist"), "{message}");
}

#[test]
fn the_fingerprint_is_that_of_the_unpacked_files_in_a_row() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "train-images-idx3-ubyte", "train-labels-idx1-ubyte", 3);
    let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
    let both = [read("train-images-idx3-ubyte"), read("train-labels-idx1-ubyte")].concat();
    let data = Dataset::load("own", &given(folder.path()), &[Split::Train]).unwrap();
    assert_eq!(data.fingerprint(Split::Train).unwrap(), crate::base::hash::sha256_hex(&both));
}
