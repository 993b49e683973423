//! The results of `compare`.

use crate::cli::output::console::{Console, Mode};
use crate::commands::compare::ComparisonOutcome;
use crate::draw::report::comparison::{Table, remarks, tables};

/// Writes a comparison: its tables, what must be known to read them, and the files.
pub(crate) fn comparison(console: &Console, outcome: &ComparisonOutcome) {
    let ComparisonOutcome { comparison, files } = outcome;
    if console.mode() == Mode::Json {
        return console.event("compared", &outcome.to_json());
    }
    for Table {
        title,
        headers,
        rows,
    } in tables(comparison)
    {
        let headers: Vec<&str> = headers.iter().map(String::as_str).collect();
        console.line(&format!("{title}:"));
        console.table(&headers, &rows);
        console.line("");
    }
    remarks(comparison)
        .iter()
        .for_each(|line| console.line(line));
    let files: Vec<String> = files
        .iter()
        .map(|file| file.display().to_string())
        .collect();
    console.line(&format!("wrote {}", files.join(", ")));
}
