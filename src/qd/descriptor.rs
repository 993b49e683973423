//! [`DescriptorSpace`]: the cells of an archive; and the paper's space of three voxel counts.

/// A box of cells with named dimensions. A cell is identified by its coordinates (one bin per
/// dimension) or by its index, in which the last dimension runs fastest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct DescriptorSpace {
    dimensions: Vec<(String, usize)>,
}

impl DescriptorSpace {
    /// Makes a space with these dimensions: name and number of bins.
    pub(crate) fn new(dimensions: Vec<(String, usize)>) -> Self {
        DescriptorSpace { dimensions }
    }

    /// Makes the paper's space (section "MAP-Elites"): muscle, sensor and total voxels in seven
    /// bins each, and the task if there are several.
    pub(crate) fn voxel_counts(tasks: usize) -> Self {
        let counts = ["muscle", "sensor", "total"].map(|name| (name.to_string(), COUNT_BINS));
        let task = (tasks > 1).then(|| ("task".to_string(), tasks));
        DescriptorSpace::new(counts.into_iter().chain(task).collect())
    }

    pub(crate) fn dimensions(&self) -> &[(String, usize)] {
        &self.dimensions
    }

    /// Returns the number of cells, possible or not.
    pub(crate) fn len(&self) -> usize {
        self.dimensions.iter().map(|(_, bins)| bins).product()
    }

    pub(crate) fn index(&self, coordinates: &[usize]) -> Option<usize> {
        if coordinates.len() != self.dimensions.len() {
            return None;
        }
        let mut paired = coordinates.iter().zip(&self.dimensions);
        paired.try_fold(0, |index, (c, (_, bins))| {
            (c < bins).then(|| index * bins + c)
        })
    }

    pub(crate) fn coordinates(&self, index: usize) -> Option<Vec<usize>> {
        if index >= self.len() {
            return None;
        }
        let mut rest = index;
        let mut coordinates = vec![0; self.dimensions.len()];
        for (c, (_, bins)) in coordinates.iter_mut().zip(&self.dimensions).rev() {
            *c = rest % bins;
            rest /= bins;
        }
        Some(coordinates)
    }
}

pub(crate) const COUNT_BINS: usize = 7;

fn bin_width(area: usize) -> usize {
    (area / COUNT_BINS).max(1)
}

/// Returns a count's bin on a grid of `area` cells: min(count div max(area div 7, 1), 6).
pub(crate) fn count_bin(count: usize, area: usize) -> usize {
    (count / bin_width(area)).min(COUNT_BINS - 1)
}

/// Returns the indices, ascending, of the cells of [`DescriptorSpace::voxel_counts`] that a
/// connected body on a grid of `area` cells with at least `min_muscles` muscles can have: muscle +
/// sensor ≤ total ≤ area, total ≥ 1. For 14 × 14 voxels they are 90 of 343 ("archive of size 90"),
/// times the number of tasks.
pub(crate) fn possible_cells(area: usize, min_muscles: usize, tasks: usize) -> Vec<usize> {
    let space = DescriptorSpace::voxel_counts(tasks);
    let width = bin_width(area);
    // Least and largest count in a bin, if there is one: the last bin takes the remainder.
    let range = |bin: usize, least: usize| {
        let first = (bin * width).max(least);
        let last = if bin == COUNT_BINS - 1 {
            area
        } else {
            ((bin + 1) * width - 1).min(area)
        };
        (first <= last).then_some((first, last))
    };
    (0..space.len())
        .filter(|&index| {
            let Some(bins) = space.coordinates(index) else {
                return false;
            };
            let muscle = range(bins[0], min_muscles);
            let (sensor, total) = (range(bins[1], 0), range(bins[2], 1));
            matches!((muscle, sensor, total), (Some(m), Some(s), Some(t)) if m.0 + s.0 <= t.1)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    #[test]
    fn fourteen_by_fourteen_voxels_have_90_possible_cells() {
        assert_eq!(DescriptorSpace::voxel_counts(1).len(), 343);
        assert_eq!(possible_cells(196, 0, 1).len(), 90);
        assert_eq!(possible_cells(196, 3, 1).len(), 90);
        assert_eq!(possible_cells(196, 3, 7).len(), 630);
        assert_eq!(possible_cells(196, 3, 8).len(), 720);
        assert_eq!(possible_cells(64 * 64, 3, 1).len(), 90);
    }

    #[test]
    fn counts_are_binned_as_in_the_paper() {
        let bins = [0, 27, 28, 55, 56, 167, 168, 196].map(|count| count_bin(count, 196));
        assert_eq!(bins, [0, 0, 1, 1, 2, 5, 6, 6]);
        // A remainder of the division by seven goes to the last bin; small grids have bins of one.
        assert_eq!([13, 14, 15].map(|count| count_bin(count, 15)), [6, 6, 6]);
        assert_eq!([0, 1, 4].map(|count| count_bin(count, 4)), [0, 1, 4]);
    }

    #[test]
    fn the_last_dimension_runs_fastest() {
        let space = DescriptorSpace::new(vec![("a".into(), 2), ("b".into(), 3)]);
        assert_eq!(
            (space.index(&[0, 2]), space.index(&[1, 0])),
            (Some(2), Some(3))
        );
        assert_eq!(
            (
                space.index(&[2, 0]),
                space.index(&[0]),
                space.coordinates(6)
            ),
            (None, None, None)
        );
        assert_eq!(
            DescriptorSpace::voxel_counts(7).dimensions()[3],
            ("task".to_string(), 7)
        );
    }

    proptest! {
        #[test]
        fn indices_and_coordinates_are_inverse(bins in prop::collection::vec(1..5usize, 1..5)) {
            let space = DescriptorSpace::new(bins.into_iter().map(|b| ("d".to_string(), b)).collect());
            for index in 0..space.len() {
                prop_assert_eq!(space.index(&space.coordinates(index).unwrap()), Some(index));
            }
        }

        #[test]
        fn possible_cells_are_those_some_counts_fall_into(area in 1..40usize, least in 0..6usize, tasks in 1..4usize) {
            let space = DescriptorSpace::voxel_counts(tasks);
            let mut found = BTreeSet::new();
            for total in 1..=area {
                for muscle in least..=total {
                    for sensor in 0..=total - muscle {
                        let mut cell = [muscle, sensor, total].map(|count| count_bin(count, area)).to_vec();
                        for task in 0..tasks {
                            cell.truncate(3);
                            if tasks > 1 {
                                cell.push(task);
                            }
                            found.insert(space.index(&cell).unwrap());
                        }
                    }
                }
            }
            prop_assert_eq!(possible_cells(area, least, tasks), found.into_iter().collect::<Vec<_>>());
        }
    }
}
