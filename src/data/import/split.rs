//! The split of a source that has none of its own: drawn by seed, class by class.

use crate::base::random::{Purpose, stream};
use crate::data::info::Split;
use std::collections::BTreeMap;

/// Returns the split of each image; a share of each class, but neither none nor all, is for tests.
///
/// # Errors
/// Returns the class that has only one image.
pub(crate) fn drawn(labels: &[u8], test: f64, seed: u64) -> Result<Vec<Split>, u8> {
    let mut by_class = BTreeMap::<u8, Vec<usize>>::new();
    for (index, label) in labels.iter().enumerate() {
        by_class.entry(*label).or_default().push(index);
    }
    let mut splits = vec![Split::Train; labels.len()];
    for (class, indices) in by_class {
        let all = indices.len();
        if all < 2 {
            return Err(class);
        }
        let count = ((all as f64 * test).round() as usize).clamp(1, all - 1);
        let picked = stream(seed, Purpose::Import, 0, class.into()).sample(all, count);
        picked
            .into_iter()
            .for_each(|place| splits[indices[place]] = Split::Test);
    }
    Ok(splits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_class_is_split_by_itself_and_neither_part_is_empty() {
        let labels: Vec<u8> = (0..100)
            .map(|index| u8::from(index % 10 > 0))
            .chain([7, 7])
            .collect();
        let tests = |splits: &[Split], class: u8| {
            let of = splits.iter().zip(&labels);
            of.filter(|(split, label)| **split == Split::Test && **label == class)
                .count()
        };
        let splits = drawn(&labels, 0.2, 1).unwrap();
        assert_eq!([0, 1, 7].map(|class| tests(&splits, class)), [2, 18, 1]);
        assert_eq!(splits, drawn(&labels, 0.2, 1).unwrap());
        assert_ne!(splits, drawn(&labels, 0.2, 2).unwrap());
        let most = drawn(&labels, 0.999, 1).unwrap();
        assert_eq!([0, 1, 7].map(|class| tests(&most, class)), [9, 89, 1]);
        // Another class does not change the draw of one.
        let alone: Vec<u8> = labels.iter().copied().filter(|label| *label == 0).collect();
        let of_first: Vec<Split> = splits
            .iter()
            .zip(&labels)
            .filter(|(_, label)| **label == 0)
            .map(|(split, _)| *split)
            .collect();
        assert_eq!(drawn(&alone, 0.2, 1).unwrap(), of_first);
        assert_eq!(drawn(&[0, 0, 5], 0.2, 1), Err(5));
    }
}
