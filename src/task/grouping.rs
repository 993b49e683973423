//! [`Grouping`]: the tasks, each of which divides classes into a group that should walk one way and
//! one that should walk the other.
//!
//! A task's name and its [`Groups`] have one grammar. If all classes are below 10, every digit is a
//! class: `0|123`. Otherwise the name has a comma, and every number between commas is a class:
//! `10,11|3`, `1,3|26`. If both groups have a single class, the comma comes last: `1|26,` is 1
//! against 26, and `1|26` is 1 against 2 and 6. So a name means one task, whatever the data, and a
//! task has one name.

use crate::data::class_names::ClassNames;
use crate::task::fitness::{Fitness, Group};
use std::fmt;
use std::str::FromStr;

/// Classes in two groups; "all the same way" is the split with an empty second group. Two are equal
/// if their classes are, whatever these are called.
#[derive(Clone, Debug)]
pub struct ClassSplit {
    a: Vec<u8>,
    b: Vec<u8>,
    names: ClassNames,
}

impl PartialEq for ClassSplit {
    fn eq(&self, other: &Self) -> bool {
        (&self.a, &self.b) == (&other.a, &other.b)
    }
}

impl Eq for ClassSplit {}

impl ClassSplit {
    pub(crate) fn classes(&self, group: Group) -> &[u8] {
        match group {
            Group::A => &self.a,
            Group::B => &self.b,
        }
    }

    /// Returns the group of a class, `None` if it belongs to neither.
    pub(crate) fn group(&self, class: u8) -> Option<Group> {
        [Group::A, Group::B]
            .into_iter()
            .find(|g| self.classes(*g).contains(&class))
    }

    /// True if all classes are in one group: the bin of robots that always walk one way.
    pub(crate) fn is_same_way(&self) -> bool {
        self.b.is_empty()
    }

    /// Returns the names of a group's classes, joined by commas.
    pub(crate) fn listed(&self, group: Group) -> String {
        self.names.list(self.classes(group))
    }

    /// Returns its name, such as `0|123`, `10,11|12`, `cat|dog` or `same way`.
    pub fn name(&self) -> String {
        if self.is_same_way() {
            return "same way".to_string();
        }
        self.names.groups([&self.a, &self.b])
    }

    /// True if a file's name is its name; older files lack the comma at the end, or the names of
    /// the classes.
    pub(crate) fn is_called(&self, name: &str) -> bool {
        let is = |own: &str| own == name || own.strip_suffix(',') == Some(name);
        is(&self.name()) || !self.is_same_way() && is(&groups_text([&self.a, &self.b], "|"))
    }
}

/// Returns the name of two groups of classes with a separator: `0|123`, or `0v123` in file names.
pub(crate) fn groups_text(groups: [&[u8]; 2], between: &str) -> String {
    let are_digits = groups.iter().copied().flatten().all(|class| *class < 10);
    let mut text = joined(groups, between, if are_digits { "" } else { "," });
    if !are_digits && !text.contains(',') {
        text.push(',');
    }
    text
}

fn joined(groups: [&[u8]; 2], between: &str, separator: &str) -> String {
    groups
        .map(|group| {
            group
                .iter()
                .map(u8::to_string)
                .collect::<Vec<_>>()
                .join(separator)
        })
        .join(between)
}

/// Two groups of classes named by the user, such as `4|9`, `0|123` or `10,11|3`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Groups {
    classes: [Vec<u8>; 2],
    /// True if there was no comma, so that every digit was a class.
    are_digits: bool,
    names: ClassNames,
}

impl Groups {
    /// Makes two groups of classes.
    ///
    /// # Errors
    /// Returns an error if one is empty, or a class is in both.
    pub(crate) fn of(classes: [Vec<u8>; 2]) -> Result<Self, GroupingError> {
        Grouping::two_groups(&classes[0], &classes[1])?;
        Ok(classes.into())
    }

    /// Calls the classes by their names.
    #[must_use]
    pub(crate) fn named(self, names: &ClassNames) -> Self {
        Groups {
            names: names.clone(),
            ..self
        }
    }

    /// Returns the name for a folder: `4v9`, or `cat-v-dog`.
    pub(crate) fn in_files(&self) -> String {
        let [a, b] = &self.classes;
        self.names.in_files([a, b])
    }

    pub(crate) fn classes(&self) -> &[Vec<u8>; 2] {
        &self.classes
    }

    /// Checks that the text means nothing else: `1|26` without a comma may mean a class 26 if there
    /// is one.
    pub(crate) fn check_among(&self, there: &[u8]) -> Result<(), Ambiguous> {
        let number = |group: &Vec<u8>| -> Option<u8> {
            let digits: String = group.iter().map(u8::to_string).collect();
            let number = digits.parse().ok().filter(|number| there.contains(number));
            number.filter(|_| self.are_digits && group.len() > 1)
        };
        let numbers = self.classes.each_ref().map(number);
        let Some(class) = numbers.into_iter().flatten().next() else {
            return Ok(());
        };
        let [a, b] = &self.classes;
        let lone = |place: usize| {
            numbers[place].map_or(self.classes[place].clone(), |number| vec![number])
        };
        Err(Ambiguous {
            // Its grammar is that of numbers, whatever the classes are called.
            text: groups_text([a, b], "|"),
            class,
            lone: groups_text([&lone(0), &lone(1)], "|"),
            separate: joined([a, b], "|", ","),
        })
    }
}

/// A text that may name two tasks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "groups {text}: the data have a class {class}; expected \"{lone}\" for it, or \"{separate}\" for its digits"
)]
pub(crate) struct Ambiguous {
    text: String,
    class: u8,
    lone: String,
    separate: String,
}

impl From<[Vec<u8>; 2]> for Groups {
    fn from(classes: [Vec<u8>; 2]) -> Self {
        Groups {
            classes,
            are_digits: false,
            names: ClassNames::default(),
        }
    }
}

impl fmt::Display for Groups {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b] = &self.classes;
        f.write_str(&self.names.groups([a, b]))
    }
}

impl FromStr for Groups {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let expected =
            || format!("{text}: expected two groups of classes, as in 4|9, 0|123 or 10,11|3");
        let are_digits = !text.contains(',');
        let group = |part: &str| -> Option<Vec<u8>> {
            let part = part.trim();
            match are_digits {
                true => part
                    .chars()
                    .map(|c| u8::try_from(c.to_digit(10)?).ok())
                    .collect(),
                false => {
                    let part = part.strip_suffix(',').unwrap_or(part);
                    let number = |class: &str| class.trim().parse().ok();
                    part.split(',').map(number).collect()
                }
            }
        };
        let (a, b) = text.split_once('|').ok_or_else(expected)?;
        let classes = [
            group(a).ok_or_else(expected)?,
            group(b).ok_or_else(expected)?,
        ];
        if classes.iter().any(Vec::is_empty) {
            return Err(expected());
        }
        Grouping::two_groups(&classes[0], &classes[1])
            .map_err(|error| format!("{text}: {error}"))?;
        Ok(Groups {
            classes,
            are_digits,
            names: ClassNames::default(),
        })
    }
}

/// Returns the correct direction and the weight of images with these labels: 1, right, for the
/// first group and −1, left, for every other class. Either side weighs one half in total.
pub(crate) fn balanced<'a>(
    labels: impl Iterator<Item = u8> + Clone + 'a,
    first: &'a [u8],
) -> impl Iterator<Item = (f64, f64)> + 'a {
    let is_first = |label: u8| first.contains(&label);
    let of_first = labels.clone().filter(|label| is_first(*label)).count();
    let of_other = labels.clone().count() - of_first;
    let way = move |label| {
        if is_first(label) {
            (1.0, 0.5 / of_first as f64)
        } else {
            (-1.0, 0.5 / of_other as f64)
        }
    };
    labels.map(way)
}

/// The tasks of a run: one division of classes into two groups, or all of them. With more than one,
/// a robot's task is a dimension of the archive (paper, sections "Fitness" and "MAP-Elites").
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grouping {
    tasks: Vec<ClassSplit>,
    fitness: Fitness,
}

/// Most classes to split in all ways: ten have 511 splits.
pub(crate) const MAX_CLASSES: usize = 10;

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum GroupingError {
    #[error("expected two groups with at least one class each, as in [[0], [1, 2]]; one is empty")]
    EmptyGroup,
    #[error("class {0} occurs more than once, expected every class in one group only")]
    Repeated(u8),
    #[error("expected 2 to {MAX_CLASSES} classes to split in all ways, found {0}")]
    Classes(usize),
}

impl Grouping {
    /// Makes one task: the classes of `a` walk one way, those of `b` the other.
    pub(crate) fn two_groups(a: &[u8], b: &[u8]) -> Result<Self, GroupingError> {
        if a.is_empty() || b.is_empty() {
            return Err(GroupingError::EmptyGroup);
        }
        check_unique(&[a, b].concat())?;
        let tasks = vec![ClassSplit {
            a: a.to_vec(),
            b: b.to_vec(),
            names: ClassNames::default(),
        }];
        Ok(Grouping {
            tasks,
            fitness: Fitness::Min,
        })
    }

    /// Makes all ways to split the classes in two non-empty groups, 2^(k−1) − 1 for k classes.
    /// Small first groups come first, equally large ones in the order of the classes. (For 0, 1, 2,
    /// 3: 0|123, 1|023, 2|013, 3|012, 01|23, 02|13, 03|12.) With `same_way_bin`, "all the same way"
    /// is an additional last task.
    pub(crate) fn all_splits(classes: &[u8], same_way_bin: bool) -> Result<Self, GroupingError> {
        let k = classes.len();
        if !(2..=MAX_CLASSES).contains(&k) {
            return Err(GroupingError::Classes(k));
        }
        check_unique(classes)?;
        let subset = |mask: usize| (0..k).filter(|i| mask >> i & 1 == 1).collect::<Vec<_>>();
        // If both halves are equal, the first group is the one with the first class.
        let is_first = |s: &Vec<usize>| 2 * s.len() < k || 2 * s.len() == k && s[0] == 0;
        let mut firsts: Vec<Vec<usize>> = (1..1 << k).map(subset).filter(is_first).collect();
        firsts.sort_by(|s, t| (s.len(), s).cmp(&(t.len(), t)));
        let split = |first: Vec<usize>| {
            let (a, b) = (0..k).partition::<Vec<_>, _>(|i| first.contains(i));
            let labels = |group: Vec<usize>| group.into_iter().map(|i| classes[i]).collect();
            ClassSplit {
                a: labels(a),
                b: labels(b),
                names: ClassNames::default(),
            }
        };
        let same_way = same_way_bin.then(|| ClassSplit {
            a: classes.to_vec(),
            b: Vec::new(),
            names: ClassNames::default(),
        });
        let tasks = firsts.into_iter().map(split).chain(same_way).collect();
        Ok(Grouping {
            tasks,
            fitness: Fitness::Min,
        })
    }

    /// Calls the classes by their names.
    #[must_use]
    pub(crate) fn named(self, names: &ClassNames) -> Self {
        let named = |split| ClassSplit {
            names: names.clone(),
            ..split
        };
        Grouping {
            tasks: self.tasks.into_iter().map(named).collect(),
            ..self
        }
    }

    /// Replaces the fitness, which is the smallest margin by default.
    #[must_use]
    pub fn with_fitness(self, fitness: Fitness) -> Self {
        Grouping { fitness, ..self }
    }

    /// Returns the rule that combines answers to several images.
    pub(crate) fn fitness(&self) -> Fitness {
        self.fitness
    }

    /// Returns the tasks, in the order of their bins.
    pub fn tasks(&self) -> &[ClassSplit] {
        &self.tasks
    }

    pub(crate) fn has_same_way_bin(&self) -> bool {
        self.tasks.iter().any(ClassSplit::is_same_way)
    }

    pub(crate) fn has_all_splits(&self) -> bool {
        let classes = self.tasks.first().map_or(0, |s| s.a.len() + s.b.len());
        let splits = self.tasks.iter().filter(|s| !s.is_same_way()).count();
        (2..=MAX_CLASSES).contains(&classes) && splits == (1 << (classes - 1)) - 1
    }
}

fn check_unique(classes: &[u8]) -> Result<(), GroupingError> {
    let repeated = classes
        .iter()
        .enumerate()
        .find(|(i, class)| classes[..*i].contains(class));
    repeated.map_or(Ok(()), |(_, class)| Err(GroupingError::Repeated(*class)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_name_means_one_task_and_a_task_has_one_name(
            classes in proptest::sample::subsequence((0..=255).collect::<Vec<u8>>(), 2..9)
                .prop_flat_map(|classes| Just(classes).prop_shuffle()),
            below in prop_oneof![Just(10_u8), Just(30), Just(255)],
            cut in 1_usize..8,
        ) {
            let mut classes: Vec<u8> = classes.into_iter().map(|class| class % below).collect();
            let mut seen = std::collections::BTreeSet::new();
            classes.retain(|class| seen.insert(*class));
            prop_assume!(classes.len() > 1);
            let (a, b) = classes.split_at(cut.min(classes.len() - 1));
            let split = Grouping::two_groups(a, b).unwrap().tasks()[0].clone();
            let read: Groups = split.name().parse().unwrap();
            prop_assert_eq!(read.classes(), &[a.to_vec(), b.to_vec()]);
            prop_assert_eq!(read.to_string(), split.name());
            let in_files = groups_text([a, b], "v");
            prop_assert_eq!(&in_files.replace('v', "|").parse::<Groups>().unwrap(), &read);
            prop_assert!(split.is_called(&split.name()));
        }

        #[test]
        fn whatever_can_be_read_has_a_name_that_is_read_as_the_same(text in "[0-9]{1,3}[0-9, ]{0,6}\\|[0-9, ]{1,7}") {
            if let Ok(read) = text.parse::<Groups>() {
                let name = read.to_string();
                let again: Groups = name.parse().unwrap();
                prop_assert_eq!(again.classes(), read.classes());
                prop_assert_eq!(again.to_string(), name);
            }
        }
    }

    #[test]
    fn a_lone_class_above_nine_is_named_by_a_comma() {
        let name = |a: &[u8], b: &[u8]| groups_text([a, b], "|");
        assert_eq!(name(&[1], &[26]), "1|26,");
        assert_eq!(name(&[10], &[2]), "10|2,");
        assert_eq!(name(&[1], &[2, 6]), "1|26");
        assert_eq!(name(&[1, 3], &[26]), "1,3|26");
        let read = |text: &str| text.parse::<Groups>().map(|groups| groups.classes);
        assert_eq!(read("1|26"), Ok([vec![1], vec![2, 6]]));
        for text in ["1|26,", "1,|26", " 1 , | 26 , "] {
            assert_eq!(read(text), Ok([vec![1], vec![26]]), "{text}");
        }
        assert_eq!(
            read("10,11|23"),
            Ok([vec![10, 11], vec![23]]),
            "a comma separates in both groups"
        );
        for text in [
            "", "1", "1|", "|1", ",|1", "1|,", "1,,2|3", "1|256,", "1|1", "1|-2,", "1|2|3", "a|b",
        ] {
            assert!(read(text).is_err(), "{text}");
        }
    }

    #[test]
    fn digits_that_may_be_a_class_of_the_data_are_said_to_be_ambiguous() {
        let said = |text: &str, there: &[u8]| {
            let groups: Groups = text.parse().unwrap();
            groups
                .check_among(there)
                .err()
                .map(|error| error.to_string())
        };
        let letters: Vec<u8> = (1..=26).collect();
        assert_eq!(
            said("1|26", &letters).unwrap(),
            "groups 1|26: the data have a class 26; expected \"1|26,\" for it, or \"1|2,6\" for its digits"
        );
        let found = said("12|34", &letters).unwrap();
        assert!(
            found.contains("expected \"12|3,4\" for it, or \"1,2|3,4\" for its digits"),
            "{found}"
        );
        for text in ["1|26,", "1|2,6", "4|9", "1|34"] {
            assert_eq!(said(text, &letters), None, "{text}");
        }
        assert_eq!(said("0|123", &(0..10).collect::<Vec<u8>>()), None);
    }

    #[test]
    fn the_name_of_an_older_file_is_that_of_its_groups() {
        let split = |a: &[u8], b: &[u8]| Grouping::two_groups(a, b).unwrap().tasks()[0].clone();
        assert!(split(&[1], &[26]).is_called("1|26") && split(&[1], &[2, 6]).is_called("1|26"));
        assert!(!split(&[1], &[26]).is_called("1|2") && !split(&[1], &[2, 6]).is_called("1|26,"));
    }

    #[test]
    fn both_groups_weigh_a_half_however_many_images_they_have() {
        let ways: Vec<(f64, f64)> = balanced([7, 1, 2, 7, 3].into_iter(), &[1, 3]).collect();
        let (first, other) = ((1.0, 0.25), (-1.0, 0.5 / 3.0));
        assert_eq!(ways, [other, first, other, other, first]);
    }

    fn names(grouping: &Grouping) -> Vec<String> {
        grouping.tasks().iter().map(ClassSplit::name).collect()
    }

    #[test]
    fn four_classes_have_the_papers_seven_tasks() {
        let paper = [
            "0|123", "1|023", "2|013", "3|012", "01|23", "02|13", "03|12",
        ];
        let splits = Grouping::all_splits(&[0, 1, 2, 3], false).unwrap();
        assert_eq!(names(&splits), paper);
        let with_bin = Grouping::all_splits(&[0, 1, 2, 3], true).unwrap();
        assert_eq!(names(&with_bin)[..7], paper);
        assert_eq!(names(&with_bin)[7], "same way");
        assert!(
            with_bin.has_same_way_bin() && !splits.has_same_way_bin() && splits.has_all_splits()
        );
    }

    #[test]
    fn k_classes_have_half_of_two_to_the_k_splits_all_different() {
        for k in 2..=MAX_CLASSES as u8 {
            let grouping = Grouping::all_splits(&(0..k).collect::<Vec<_>>(), false).unwrap();
            let mut names = names(&grouping);
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), (1 << (k - 1)) - 1);
        }
        let three = Grouping::all_splits(&[12, 3, 7], false).unwrap();
        assert_eq!(names(&three), ["12|3,7", "3|12,7", "7|12,3"]);
    }

    #[test]
    fn classes_know_their_group() {
        let grouping = Grouping::two_groups(&[4, 9], &[1]).unwrap();
        let split = &grouping.tasks()[0];
        let groups = [4, 9, 1, 0].map(|class| split.group(class));
        assert_eq!(
            groups,
            [Some(Group::A), Some(Group::A), Some(Group::B), None]
        );
        assert_eq!(
            (grouping.tasks().len(), grouping.has_all_splits()),
            (1, false)
        );
        assert_eq!(split.name(), "49|1");
    }

    #[test]
    fn groupings_that_ask_nothing_are_refused() {
        assert_eq!(
            Grouping::two_groups(&[0], &[]),
            Err(GroupingError::EmptyGroup)
        );
        assert_eq!(
            Grouping::two_groups(&[0, 1], &[1]),
            Err(GroupingError::Repeated(1))
        );
        assert_eq!(
            Grouping::all_splits(&[2, 2], true),
            Err(GroupingError::Repeated(2))
        );
        assert_eq!(
            Grouping::all_splits(&[2], true),
            Err(GroupingError::Classes(1))
        );
        assert_eq!(
            Grouping::all_splits(&[0; 11], true),
            Err(GroupingError::Classes(11))
        );
    }
}
