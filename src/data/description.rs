//! [`Description`]: what a dataset's folder says about its images, in `dataset.json`.

use crate::base::error::Error;
use crate::base::files::{read_text, write_atomically};
use crate::data::class_names::ClassNames;
use serde::{Deserialize, Serialize};
use std::io;
use std::path::Path;

/// The file in a dataset's folder.
pub(crate) const DATASET_JSON: &str = "dataset.json";

const FORMAT: (&str, u32) = ("morphcog-dataset", 1);

/// What the IDX files of a dataset do not say. `morphcog data import` writes it; users may, too.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Description {
    format: String,
    format_version: u32,
    /// Names of the classes, from class 0; without one, or with an empty one, a class has its
    /// number.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) class_names: Vec<String>,
    /// True if rows and columns of the images are exchanged in the files; `None`: by their names.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) transpose: Option<bool>,
}

impl Description {
    pub(crate) fn new(class_names: Vec<String>, transpose: Option<bool>) -> Self {
        Description {
            format: FORMAT.0.to_string(),
            format_version: FORMAT.1,
            class_names,
            transpose,
        }
    }

    pub(crate) fn names(&self) -> ClassNames {
        ClassNames::of(&self.class_names)
    }

    /// Reads the description in a folder; `None` if there is none.
    pub(crate) fn read(folder: &Path) -> Result<Option<Self>, Error> {
        let path = folder.join(DATASET_JSON);
        let text = match read_text(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(Error::reading(&path, &error)),
            Ok(text) => text,
        };
        let refused = |text: String| Error::input(format!("{}: {text}", path.display()));
        let found: Description =
            serde_json::from_str(&text).map_err(|error| refused(error.to_string()))?;
        if (found.format.as_str(), found.format_version) != FORMAT {
            let (name, version) = FORMAT;
            return Err(refused(format!(
                "format {} {}: expected {name} {version}",
                found.format, found.format_version
            )));
        }
        check_names(&found.class_names).map_err(refused)?;
        Ok(Some(found))
    }

    pub(crate) fn write(&self, folder: &Path) -> Result<(), Error> {
        let path = folder.join(DATASET_JSON);
        let text = serde_json::to_string_pretty(self).expect("texts and a flag are JSON") + "\n";
        write_atomically(&path, text.as_bytes()).map_err(|error| Error::writing(&path, &error))
    }
}

/// Checks that names of classes can be told apart in a task's name, such as `cat|dog,wolf`.
pub(crate) fn check_names(names: &[String]) -> Result<(), String> {
    for (class, name) in names.iter().enumerate() {
        let is_other = |c: char| c == '|' || c == ',' || c.is_control();
        if name.contains(is_other) || name.trim() != name || name.chars().count() > 64 {
            return Err(format!(
                "class {class} is called {name:?}: expected at most 64 characters without | and \
                 comma, with no space at either end"
            ));
        }
        if !name.is_empty() && names[..class].contains(name) {
            return Err(format!(
                "two classes are called {name}: expected different names"
            ));
        }
    }
    match names.len() > 256 {
        true => Err(format!(
            "{} names of classes: expected at most 256",
            names.len()
        )),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_description_goes_through_its_file_and_a_slip_in_it_is_said_with_the_file() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Description::read(folder.path()), Ok(None));
        let own = Description::new(vec!["cat".into(), "guinea pig".into()], Some(false));
        own.write(folder.path()).unwrap();
        assert_eq!(Description::read(folder.path()), Ok(Some(own)));
        let head = "{\"format\": \"morphcog-dataset\", \"format_version\"";
        for (text, said) in [
            (format!("{head}: 2}}"), "expected morphcog-dataset 1"),
            (format!("{head}: 1, \"names\": []}}"), "unknown field"),
            (
                format!("{head}: 1, \"class_names\": [\"a|b\"]}}"),
                "without |",
            ),
            (
                format!("{head}: 1, \"class_names\": [\"a\", \"a\"]}}"),
                "two classes are called a",
            ),
            ("{".to_string(), "dataset.json"),
        ] {
            std::fs::write(folder.path().join(DATASET_JSON), text).unwrap();
            let error = Description::read(folder.path()).unwrap_err().to_string();
            assert!(
                error.contains(said) && error.contains("dataset.json"),
                "{error}"
            );
        }
    }

    #[test]
    fn names_that_a_tasks_name_could_not_tell_apart_are_refused() {
        let check = |names: &[&str]| {
            check_names(&names.iter().map(ToString::to_string).collect::<Vec<_>>())
        };
        assert_eq!(check(&["cat", "", "", "dog 2"]), Ok(()));
        for bad in ["a|b", "a,b", " a", "a\n", &"x".repeat(65)] {
            assert!(check(&[bad]).is_err(), "{bad}");
        }
        assert!(check(&["a", "a"]).is_err());
    }
}
