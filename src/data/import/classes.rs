//! Numbers of classes from the labels of a source.

use crate::base::error::Error;
use crate::data::description::check_names;
use crate::data::import::item::{Label, natural};
use std::collections::{BTreeMap, BTreeSet};

/// Most classes: a label is a byte.
const MOST: usize = 256;

/// The numbers of labels, and the names of the classes from 0 on; none if they are their numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Classes {
    pub(crate) numbers: BTreeMap<Label, u8>,
    pub(crate) names: Vec<String>,
    /// Names that were changed, before and after.
    pub(crate) changed: Vec<[String; 2]>,
}

impl Classes {
    /// Numbers labels. Whole numbers from 0 to 255 keep their number; others are sorted by name.
    /// `named` has the source's own names for its numbers.
    ///
    /// # Errors
    /// Reports too many classes, and names that become the same.
    pub(crate) fn of(labels: &BTreeSet<Label>, named: Option<&[String]>) -> Result<Self, Error> {
        if labels.len() > MOST {
            return Err(Error::input(format!(
                "there are {} classes: expected at most {MOST}",
                labels.len()
            ))
            .advice("are the labels those of a classification?"));
        }
        let own: Option<BTreeMap<Label, u8>> = labels
            .iter()
            .map(|label| Some((label.clone(), number(label)?)))
            .collect();
        let names: Vec<String> = match (&own, named) {
            (Some(own), Some(named))
                if own
                    .values()
                    .all(|number| usize::from(*number) < named.len()) =>
            {
                let is_number = |(number, name): (usize, &String)| *name == number.to_string();
                match named.iter().enumerate().all(is_number) || named.len() > MOST {
                    true => Vec::new(),
                    false => named.to_vec(),
                }
            }
            (Some(_), _) => Vec::new(),
            (None, _) => {
                let mut names: Vec<String> = labels.iter().map(Label::to_string).collect();
                names.sort_by(|a, b| natural(a, b));
                names.dedup();
                names
            }
        };
        let numbers = own.unwrap_or_else(|| {
            let place = |label: &Label| names.iter().position(|name| *name == label.to_string());
            let numbered = |label: &Label| Some((label.clone(), u8::try_from(place(label)?).ok()?));
            labels.iter().filter_map(numbered).collect()
        });
        let mut changed = Vec::new();
        let names: Vec<String> = names
            .into_iter()
            .map(|name| {
                let plain = plain(&name);
                if plain != name {
                    changed.push([name, plain.clone()]);
                }
                plain
            })
            .collect();
        check_names(&names)
            .map_err(|text| Error::input(text).advice("rename one of the classes"))?;
        Ok(Classes {
            numbers,
            names,
            changed,
        })
    }

    pub(crate) fn name(&self, class: u8) -> Option<&str> {
        let name = self.names.get(usize::from(class))?;
        (!name.is_empty()).then_some(name)
    }
}

/// Returns the number that a label is, if it is one as people write it.
fn number(label: &Label) -> Option<u8> {
    match label {
        Label::Number(number) => u8::try_from(*number).ok(),
        Label::Name(name) => name
            .parse()
            .ok()
            .filter(|number: &u8| number.to_string() == *name),
    }
}

/// Returns a name without what a task's name could not hold.
fn plain(name: &str) -> String {
    let character = |c: char| match c {
        '|' => '/',
        ',' => ';',
        c if c.is_control() => ' ',
        c => c,
    };
    let text: String = name.chars().map(character).take(64).collect();
    text.trim().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn classes(labels: &[&str]) -> Classes {
        let labels = labels
            .iter()
            .map(|label| Label::Name(label.to_string()))
            .collect();
        Classes::of(&labels, None).unwrap()
    }

    #[test]
    fn numbers_stay_and_names_are_sorted_as_people_do() {
        let of = |classes: &Classes, name: &str| classes.numbers[&Label::Name(name.into())];
        let digits = classes(&["3", "10", "0"]);
        assert_eq!((of(&digits, "10"), digits.names.len()), (10, 0));
        let named = classes(&["zebra", "Ant", "room 10", "room 9"]);
        assert_eq!(named.names, ["Ant", "room 9", "room 10", "zebra"]);
        assert_eq!(of(&named, "room 10"), 2);
        // Not as they are written, or out of range.
        assert_eq!(classes(&["007", "1"]).names, ["1", "007"]);
        assert_eq!(classes(&["256", "1"]).names, ["1", "256"]);
        let signs = BTreeSet::from([Label::Number(-1), Label::Number(1)]);
        assert_eq!(Classes::of(&signs, None).unwrap().names, ["-1", "1"]);
    }

    #[test]
    fn names_of_the_source_belong_to_its_numbers() {
        let labels = BTreeSet::from([Label::Number(2), Label::Number(0)]);
        let named = ["shirt", "shoe, left", "bag"].map(String::from);
        let found = Classes::of(&labels, Some(&named)).unwrap();
        assert_eq!(found.names, ["shirt", "shoe; left", "bag"]);
        assert_eq!(
            found.changed,
            [["shoe, left".to_string(), "shoe; left".to_string()]]
        );
        assert_eq!(
            (found.name(2), found.numbers[&Label::Number(2)]),
            (Some("bag"), 2)
        );
        let digits = ["0", "1", "2"].map(String::from);
        assert!(
            Classes::of(&labels, Some(&digits))
                .unwrap()
                .names
                .is_empty()
        );
    }

    #[test]
    fn too_many_classes_and_names_that_become_the_same_are_refused() {
        let many = (0..257).map(Label::Number).collect();
        assert!(
            Classes::of(&many, None)
                .unwrap_err()
                .to_string()
                .contains("257 classes")
        );
        let same = BTreeSet::from(["a,b", "a;b"].map(|name| Label::Name(name.into())));
        assert!(
            Classes::of(&same, None)
                .unwrap_err()
                .to_string()
                .contains("two classes")
        );
    }
}
