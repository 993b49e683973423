//! Names of truth tables: the logic gate that a body computes by walking one way or the other.

use crate::task::fitness::Group;
use crate::task::grouping::ClassSplit;

/// Gates of two cues `a` and `b`, each with the inputs for which it is true.
const OF_TWO: [(&str, &[u8]); 7] = [
    ("OR", &[1, 2, 3]),
    ("AND", &[3]),
    ("XOR", &[1, 2]),
    ("a", &[2, 3]),
    ("b", &[1, 3]),
    ("a and not b", &[2]),
    ("b and not a", &[1]),
];

/// Gates of three cues that have names of their own.
const OF_THREE: [(&str, &[u8]); 4] = [
    ("OR", &[1, 2, 3, 4, 5, 6, 7]),
    ("AND", &[7]),
    ("majority", &[3, 5, 6, 7]),
    ("parity", &[1, 2, 4, 7]),
];

/// A truth table, computed by walking one way or the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Gate {
    pub(crate) name: String,
    /// The inputs (classes) for which it is true, in their order.
    pub(crate) bright: Vec<u8>,
}

impl Gate {
    pub(crate) fn is_true_for(&self, input: u8) -> bool {
        self.bright.contains(&input)
    }
}

/// Returns the gate that a split of all inputs computes. It is true on the other side than that of
/// all cues dark. Without a name of its own it is called by its truth table, from all cues bright
/// down to all dark.
pub(crate) fn gate(split: &ClassSplit, cues: usize) -> Gate {
    let [a, b] = [Group::A, Group::B].map(|group| split.classes(group));
    let mut bright = if a.contains(&0) { b } else { a }.to_vec();
    bright.sort_unstable();
    let known: &[(&str, &[u8])] = match cues {
        2 => &OF_TWO,
        3 => &OF_THREE,
        _ => &[],
    };
    let name = known.iter().find(|(_, classes)| *classes == bright);
    let bit = |input: u8| if bright.contains(&input) { '1' } else { '0' };
    let table = || (0..1 << cues).rev().map(bit).collect();
    Gate {
        name: name.map_or_else(table, |(name, _)| (*name).to_string()),
        bright,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::grouping::Grouping;

    #[test]
    fn all_splits_of_two_cues_are_gates_with_names() {
        let splits = Grouping::all_splits(&[0, 1, 2, 3], false).unwrap();
        let names: Vec<String> = splits
            .tasks()
            .iter()
            .map(|split| gate(split, 2).name)
            .collect();
        let expected = ["OR", "b and not a", "a and not b", "AND", "a", "b", "XOR"];
        assert_eq!(names, expected);
    }

    #[test]
    fn gates_of_three_cues_have_a_name_or_a_truth_table() {
        let of = |bright: &[u8]| {
            let dark: Vec<u8> = (0..8).filter(|class| !bright.contains(class)).collect();
            gate(&Grouping::two_groups(&dark, bright).unwrap().tasks()[0], 3).name
        };
        assert_eq!(of(&[3, 5, 6, 7]), "majority");
        assert_eq!(of(&[7, 4, 2, 1]), "parity");
        assert_eq!(of(&[1, 7]), "10000010");
    }
}
