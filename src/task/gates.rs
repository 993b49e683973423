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

/// One gate of each of the 13 classes of gates of three cues `a`, `b` and `c`: the others of a
/// class come from it by exchanging and negating cues and by negating the answer (NPN classes;
/// the fourteenth has the two constants).
const OF_THREE: [(&str, &[u8]); 13] = [
    ("a", &[4, 5, 6, 7]),
    ("a and b", &[6, 7]),
    ("a xor b", &[2, 3, 4, 5]),
    ("a and b and c", &[7]),
    ("a and (b or c)", &[5, 6, 7]),
    ("a and (b xor c)", &[5, 6]),
    ("a xor (b and c)", &[3, 4, 5, 6]),
    ("if a then b else c", &[1, 3, 6, 7]),
    ("majority", &[3, 5, 6, 7]),
    ("exactly one", &[1, 2, 4]),
    ("all or none", &[0, 7]),
    ("a and b, or c alone", &[1, 6, 7]),
    ("parity", &[1, 2, 4, 7]),
];

/// A truth table, computed by walking one way or the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Gate {
    pub(crate) name: String,
    /// The inputs (classes) for which it is true, in their order.
    pub(crate) true_for: Vec<u8>,
}

impl Gate {
    pub(crate) fn is_true_for(&self, input: u8) -> bool {
        self.true_for.contains(&input)
    }
}

/// Returns the gate that a split of all inputs computes: false when all cues are dark. A gate
/// without a name is called by its truth table, from all cues bright down to all dark. Returns
/// `None` if the split leaves inputs out.
pub(crate) fn gate(split: &ClassSplit, cues: usize) -> Option<Gate> {
    let [a, b] = [Group::A, Group::B].map(|group| split.classes(group));
    if a.len() + b.len() != 1 << cues {
        return None;
    }
    let mut true_for = if a.contains(&0) { b } else { a }.to_vec();
    true_for.sort_unstable();
    let mut known = OF_TWO.iter().filter(|_| cues == 2);
    let name = known.find(|(_, inputs)| *inputs == true_for);
    let bit = |input: u8| if true_for.contains(&input) { '1' } else { '0' };
    let table = || (0..1 << cues).rev().map(bit).collect();
    Some(Gate {
        name: name.map_or_else(table, |(name, _)| (*name).to_string()),
        true_for,
    })
}

/// Returns the name of the class of a gate of three cues.
pub(crate) fn class_of_three(gate: &Gate) -> &'static str {
    let table = |inputs: &[u8]| inputs.iter().fold(0_u8, |table, input| table | 1 << input);
    let wanted = least(table(&gate.true_for));
    let (name, _) = OF_THREE
        .into_iter()
        .find(|(_, inputs)| least(table(inputs)) == wanted)
        .expect("a gate is not constant, and all other classes of three cues are listed");
    name
}

/// Returns the least of all truth tables of three cues that have the same class; bit `i` is the
/// answer to input `i`.
fn least(table: u8) -> u8 {
    const ORDERS: [[u8; 3]; 6] = [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ];
    let other = |order: [u8; 3], negated: u8| {
        let from = |input: u8| {
            let moved = (0..3).map(|cue| (input >> order[cue] & 1) << cue);
            moved.sum::<u8>() ^ negated
        };
        (0..8).fold(0, |other, input| {
            other | (table >> from(input) & 1) << input
        })
    };
    let all = ORDERS
        .into_iter()
        .flat_map(|order| (0..8).map(move |negated| (order, negated)));
    all.map(|(order, negated)| other(order, negated))
        .map(|table: u8| table.min(!table))
        .min()
        .expect("there are orders")
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
            .map(|split| gate(split, 2).unwrap().name)
            .collect();
        let expected = ["OR", "b and not a", "a and not b", "AND", "a", "b", "XOR"];
        assert_eq!(names, expected);
    }

    #[test]
    fn all_gates_of_three_cues_have_one_of_thirteen_classes() {
        let inputs: Vec<u8> = (0..8).collect();
        let splits = Grouping::all_splits(&inputs, false).unwrap();
        let mut classes = std::collections::BTreeMap::<&str, usize>::new();
        for split in splits.tasks() {
            *classes
                .entry(class_of_three(&gate(split, 3).unwrap()))
                .or_default() += 1;
        }
        // Each split stands for two truth tables; the published sizes of the classes.
        let sizes: Vec<usize> = OF_THREE.iter().map(|(name, _)| 2 * classes[name]).collect();
        assert_eq!(sizes, [6, 24, 6, 16, 48, 24, 24, 24, 8, 16, 8, 48, 2]);
        for (name, true_for) in OF_THREE {
            let others: Vec<u8> = (0..8).filter(|input| !true_for.contains(input)).collect();
            let split = &Grouping::two_groups(&others, true_for).unwrap();
            assert_eq!(class_of_three(&gate(&split.tasks()[0], 3).unwrap()), name);
        }
    }

    #[test]
    fn gates_of_more_cues_are_called_by_their_truth_tables() {
        let split = Grouping::two_groups(&[0, 2, 3, 4, 5, 6], &[1, 7]).unwrap();
        assert_eq!(gate(&split.tasks()[0], 3).unwrap().name, "10000010");
        let partial = Grouping::two_groups(&[0], &[3]).unwrap();
        assert_eq!(gate(&partial.tasks()[0], 2), None);
    }
}
