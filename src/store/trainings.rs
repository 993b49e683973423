//! Trainings of networks, kept beside the results so that none is repeated.

use crate::base::error::Error;
use crate::base::files::write_atomically;
use crate::baseline::Trained;
use crate::shipped::exists;
use crate::store::results::{self, Stored};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const FORMAT: (&str, u32) = ("morphcog-trainings", 2);

#[derive(Debug)]
pub(crate) struct Trainings {
    path: PathBuf,
    content: Content,
}

#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    format: String,
    format_version: u32,
    /// The accuracy and parameters of each training, in order, by a hash of everything that the
    /// trainings depend on and by size.
    trainings: BTreeMap<String, BTreeMap<usize, Vec<(f64, usize)>>>,
}

impl Stored for Content {
    const FORMAT: (&'static str, u32) = FORMAT;

    fn validate(&self) -> Result<(), Error> {
        for (key, sizes) in &self.trainings {
            for (size, trained) in sizes {
                if !trained
                    .iter()
                    .all(|(accuracy, _)| (0.0..=1.0).contains(accuracy))
                {
                    let text = "expected accuracies from 0 to 1";
                    return Err(Error::at_key(&format!("trainings.{key}.{size}"), text));
                }
            }
        }
        Ok(())
    }
}

impl Trainings {
    /// Reads the trainings beside a result file: `capacity.trainings.json` beside `capacity.json`.
    /// Without the file there are none; an unreadable one is an error, because they would be lost.
    pub(crate) fn read(results: &Path) -> Result<Self, Error> {
        let path = results.with_extension("trainings.json");
        let empty = || Content {
            format: FORMAT.0.to_string(),
            format_version: FORMAT.1,
            ..Content::default()
        };
        let anew = "move it away, and networks are trained anew";
        let content = match exists(&path) {
            true => results::read(&path, None).map_err(|error| error.advice(anew))?,
            false => empty(),
        };
        Ok(Trainings { path, content })
    }

    /// Returns the trainings of a size: accuracy, parameters.
    pub(crate) fn of(&self, key: &str, size: usize) -> &[(f64, usize)] {
        self.content
            .trainings
            .get(key)
            .and_then(|sizes| sizes.get(&size))
            .map_or(&[], Vec::as_slice)
    }

    pub(crate) fn extend(&mut self, key: &str, size: usize, trained: &[Trained]) {
        let sizes = self.content.trainings.entry(key.to_string()).or_default();
        sizes
            .entry(size)
            .or_default()
            .extend(trained.iter().map(|t| (t.accuracy, t.parameters)));
    }

    pub(crate) fn write(&self) -> Result<(), Error> {
        let text = serde_json::to_string(&self.content)
            .map_err(|error| Error::other(error.to_string()))?
            + "\n";
        write_atomically(&self.path, text.as_bytes())
            .map_err(|error| Error::writing(&self.path, &error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_trained_is_known_again_and_never_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("capacity.json");
        let mut trainings = Trainings::read(&out).unwrap();
        let trained = [0.5, 0.75].map(|accuracy| Trained {
            accuracy,
            epochs: 9,
            parameters: 12,
        });
        trainings.extend("a", 3, &trained[..1]);
        trainings.extend("a", 3, &trained[1..]);
        trainings.write().unwrap();
        let again = Trainings::read(&out).unwrap();
        assert_eq!(again.of("a", 3), [(0.5, 12), (0.75, 12)]);
        assert!(again.of("a", 4).is_empty() && again.of("b", 3).is_empty());
        std::fs::write(
            folder.path().join("capacity.trainings.json"),
            "{\"format\": 1",
        )
        .unwrap();
        assert!(
            Trainings::read(&out)
                .unwrap_err()
                .message
                .contains("capacity.trainings.json")
        );
    }
}
