//! [`ClassNames`]: names of classes, as people read and write them.

use std::sync::Arc;

/// The names of a dataset's classes, from class 0. A class without a name is called by its number.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct ClassNames(Arc<[String]>);

impl ClassNames {
    pub(crate) fn of(names: &[String]) -> Self {
        ClassNames(names.into())
    }

    /// Returns the names from class 0, as files and pages hold them; empty if there are none.
    pub(crate) fn all(&self) -> &[String] {
        &self.0
    }

    /// Returns the name of a class, if it has one.
    pub(crate) fn given(&self, class: u8) -> Option<&str> {
        let name = self.0.get(usize::from(class)).map(String::as_str);
        name.filter(|name| !name.is_empty())
    }

    /// Returns the name of a class, or its number.
    pub(crate) fn name(&self, class: u8) -> String {
        self.given(class)
            .map_or_else(|| class.to_string(), str::to_string)
    }

    /// Returns the names of classes, joined by commas, for messages.
    pub(crate) fn list<'a>(&self, classes: impl IntoIterator<Item = &'a u8>) -> String {
        let names: Vec<String> = classes.into_iter().map(|class| self.name(*class)).collect();
        names.join(", ")
    }

    /// Returns the names of the classes of a side, for signs and captions: numbers with blanks
    /// between them, and with commas where classes have names, which may have blanks.
    pub(crate) fn side(&self, classes: &[u8]) -> String {
        let is_named = classes.iter().any(|class| self.given(*class).is_some());
        let names: Vec<String> = classes.iter().map(|class| self.name(*class)).collect();
        names.join(if is_named { ", " } else { " " })
    }

    /// Returns the class with a name, or with a number if it has no name.
    ///
    /// # Errors
    /// Returns a text that lists the names.
    pub(crate) fn class(&self, text: &str) -> Result<u8, String> {
        let text = text.trim();
        let by_name = self.0.iter().position(|name| name == text);
        let number = || {
            text.parse()
                .ok()
                .filter(|class: &u8| text == class.to_string())
        };
        by_name
            .filter(|_| !text.is_empty())
            .and_then(|class| u8::try_from(class).ok())
            .or_else(number)
            .ok_or_else(|| {
                let all = self.0.iter().map(String::as_str);
                let names: Vec<&str> = all.filter(|name| !name.is_empty()).collect();
                match names.is_empty() {
                    true => format!("{text}: expected the number of a class, 0 to 255"),
                    false => format!("{text}: expected one of the classes {}", names.join(", ")),
                }
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_class_without_a_name_is_called_by_its_number() {
        let names = ClassNames::of(&["cat", "", "guinea pig"].map(String::from));
        assert_eq!(names.list(&[0, 1, 2, 9]), "cat, 1, guinea pig, 9");
        assert_eq!(names.side(&[1, 9]), "1 9");
        assert_eq!(names.side(&[2, 9]), "guinea pig, 9");
        assert_eq!(
            [names.class("guinea pig"), names.class("1")],
            [Ok(2), Ok(1)]
        );
        assert_eq!(
            names.class("cow").unwrap_err(),
            "cow: expected one of the classes cat, guinea pig"
        );
    }
}
