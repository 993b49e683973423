//! How files of results are written: a table beside each, and long lists line by line.

use crate::base::error::Error;
use crate::base::files::write_atomically;
use serde::Serialize;
use std::path::Path;

/// Why results are always JSON.
const JSON: &str = "numbers are finite and keys are text: JSON has all of it";

/// The text of an object whose last key is a list: the head on one line, with an empty list there,
/// then a line for each of the list.
pub(crate) fn by_lines(head: &impl Serialize, list: &[impl Serialize]) -> String {
    let head = serde_json::to_string(head).expect(JSON);
    let head = head.strip_suffix("]}").expect("the last key of the head is an empty list");
    let lines: Vec<String> = list.iter().map(|one| serde_json::to_string(one).expect(JSON)).collect();
    format!("{head}\n{}\n]}}\n", lines.join(",\n"))
}

/// Writes results, and their table beside them with the ending `csv`.
///
/// # Errors
/// If one of them cannot be written.
pub(crate) fn write_with_table(path: &Path, json: &str, table: &[u8]) -> Result<(), Error> {
    [(path, json.as_bytes()), (&path.with_extension("csv"), table)].into_iter().try_for_each(
        |(path, content)| write_atomically(path, content).map_err(|error| Error::writing(path, &error)),
    )
}
