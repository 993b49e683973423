//! [`ClassNames`] in the names of tasks: two groups of classes, as people read and write them.

pub(crate) use crate::data::class_names::ClassNames;
use crate::task::grouping::{GroupingError, Groups, groups_text};

/// Longest name of a class in the name of a folder, characters.
const LONGEST: usize = 24;

impl ClassNames {
    /// Returns the name of two groups: `cat|dog,wolf`, or without names as [`groups_text`].
    pub(crate) fn groups(&self, groups: [&[u8]; 2]) -> String {
        if !groups
            .iter()
            .copied()
            .flatten()
            .any(|class| self.given(*class).is_some())
        {
            return groups_text(groups, "|");
        }
        let names = groups.map(|group| {
            let names: Vec<String> = group.iter().map(|class| self.name(*class)).collect();
            names.join(",")
        });
        names.join("|")
    }

    /// Returns the name of two groups for a folder: `cat-v-dog`, or `0v1` without names, or where
    /// one is no part of a file name.
    pub(crate) fn in_files(&self, groups: [&[u8]; 2]) -> String {
        let is_plain = |name: &str| {
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
            name.len() <= LONGEST && name.chars().all(plain)
        };
        let word = |group: &[u8]| -> Option<String> {
            let names: Option<Vec<&str>> = group
                .iter()
                .map(|class| self.given(*class).filter(|name| is_plain(name)))
                .collect();
            names.map(|names| names.join("-"))
        };
        match groups.map(word) {
            [Some(a), Some(b)] => format!("{a}-v-{b}"),
            _ => groups_text(groups, "v"),
        }
    }

    /// Reads two groups: names, as in `cat|dog,wolf`, or numbers in their own grammar.
    ///
    /// # Errors
    /// Returns a text that says what was expected.
    pub(crate) fn read(&self, text: &str) -> Result<Groups, String> {
        let is_named = self.all().iter().any(|name| !name.is_empty());
        let has_letters = !text.chars().all(|c| "0123456789|, ".contains(c));
        let groups = if is_named {
            self.read_names(text)
        } else {
            Err(String::new())
        };
        match (groups, text.parse::<Groups>()) {
            (Ok(groups), _) | (Err(_), Ok(groups)) => Ok(groups.named(self)),
            (Err(error), Err(_)) if is_named && has_letters => Err(error),
            (Err(_), Err(error)) => Err(error),
        }
    }

    fn read_names(&self, text: &str) -> Result<Groups, String> {
        let of = |part: &str| -> Result<Vec<u8>, String> {
            part.split(',').map(|name| self.class(name)).collect()
        };
        let (a, b) = text
            .split_once('|')
            .ok_or_else(|| format!("{text}: expected two groups of classes, as in cat|dog"))?;
        let refused = |error| match error {
            GroupingError::Repeated(class) => {
                format!("{text}: {} occurs more than once", self.name(class))
            }
            error => format!("{text}: {error}"),
        };
        Groups::of([of(a)?, of(b)?]).map_err(refused)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names() -> ClassNames {
        ClassNames::of(&["cat", "dog", "", "guinea pig", "7"].map(String::from))
    }

    #[test]
    fn groups_are_called_by_the_names_of_their_classes_and_read_by_them() {
        let names = names();
        for (classes, text) in [
            ([vec![0], vec![1]], "cat|dog"),
            ([vec![1, 0], vec![3]], "dog,cat|guinea pig"),
            ([vec![0], vec![2]], "cat|2"),
            ([vec![4], vec![1]], "7|dog"),
        ] {
            let groups = names.read(text).unwrap();
            assert_eq!(groups.classes(), &classes, "{text}");
            assert_eq!(groups.to_string(), text);
            assert_eq!(names.groups([&classes[0], &classes[1]]), text);
        }
    }

    #[test]
    fn numbers_are_read_where_they_are_no_names() {
        let read = |text: &str| names().read(text).map(|groups| groups.classes().clone());
        assert_eq!(read("0|1"), Ok([vec![0], vec![1]]));
        assert_eq!(read("7|0"), Ok([vec![4], vec![0]]), "a name wins");
        assert_eq!(read("01|3"), Ok([vec![0, 1], vec![3]]));
        let none = ClassNames::default();
        assert_eq!(
            none.read("0|123").unwrap().classes(),
            &[vec![0], vec![1, 2, 3]]
        );
        assert_eq!(none.groups([&[1], &[26]]), "1|26,");
    }

    #[test]
    fn a_name_that_no_class_has_is_refused_with_those_there_are() {
        let error = names().read("cat|cow").unwrap_err();
        assert!(
            error.contains("cow") && error.contains("guinea pig"),
            "{error}"
        );
        let error = names().read("dog|dog").unwrap_err();
        assert_eq!(error, "dog|dog: dog occurs more than once");
        assert!(names().read("cat").is_err());
        assert!(names().read("cat|").is_err());
        assert!(ClassNames::default().read("cat|dog").is_err());
    }

    #[test]
    fn folders_have_names_where_these_are_words() {
        let names = names();
        assert_eq!(names.in_files([&[0], &[1]]), "cat-v-dog");
        assert_eq!(names.in_files([&[0], &[3]]), "0v3");
        assert_eq!(ClassNames::default().in_files([&[10], &[2]]), "10v2,");
    }
}
