//! Tables as aligned text.

/// The lines of a table as [`align`] makes them, or, where they are wider than so many columns, its
/// rows one below the other.
pub fn fitted(headers: &[&str], rows: &[Vec<String>], width: usize) -> Vec<String> {
    let lines = align(headers, rows);
    let is_wide = lines.iter().any(|line| line.chars().count() > width);
    if is_wide && !rows.is_empty() { stacked(headers, rows) } else { lines }
}

/// Rows one below the other, a cell a line behind its header; an empty line between two rows. Empty
/// cells are left out.
fn stacked(headers: &[&str], rows: &[Vec<String>]) -> Vec<String> {
    let widest = headers.iter().map(|header| header.chars().count()).max().unwrap_or(0);
    let line = |(header, text): (&&str, &String)| {
        let gap = " ".repeat(widest - header.chars().count());
        format!("{header}{gap}  {text}")
    };
    let row = |row: &Vec<String>| -> Vec<String> {
        headers.iter().zip(row).filter(|(_, text)| !text.is_empty()).map(line).collect()
    };
    rows.iter().map(row).collect::<Vec<_>>().join(&String::new())
}

/// The lines of a table: headers, a rule, rows; two spaces between columns, numbers to the right.
/// Short rows are filled up with empty cells; cells without a header are left out.
pub fn align(headers: &[&str], rows: &[Vec<String>]) -> Vec<String> {
    let cell = |row: &[String], c: usize| row.get(c).cloned().unwrap_or_default();
    let columns: Vec<(usize, bool)> = (0..headers.len())
        .map(|c| {
            let cells = || rows.iter().map(|row| cell(row, c));
            let widest = cells().map(|t| t.chars().count()).max().unwrap_or(0);
            let numbers = cells().any(|t| is_number(&t)) && cells().all(|t| is_number(&t) || is_blank(&t));
            // Some ids look like numbers.
            (widest.max(headers[c].chars().count()), numbers && headers[c] != "robot")
        })
        .collect();
    let line = |cells: Vec<String>| {
        let padded = cells.into_iter().zip(&columns).map(|(text, (width, right))| {
            let gap = " ".repeat(width - text.chars().count());
            if *right { gap + &text } else { text + &gap }
        });
        padded.collect::<Vec<_>>().join("  ").trim_end().to_string()
    };
    let mut lines = vec![line(headers.iter().map(|h| h.to_string()).collect())];
    lines.push(columns.iter().map(|(width, _)| "-".repeat(*width)).collect::<Vec<_>>().join("  "));
    lines.extend(rows.iter().map(|row| line((0..headers.len()).map(|c| cell(row, c)).collect())));
    lines
}

/// Starts like a number, perhaps with a sign, and has a digit: "−3.2", "76.5 %", "12/30", "81.0
/// [78.4, 83.3]".
fn is_number(text: &str) -> bool {
    let body = text.trim_start_matches(['+', '-', '−', '±', '<', '>', '≤', '≥', '.', ' ']);
    let unit = |c: char| c.is_ascii_digit() || " .,%/()[]–-−+±:eEµmskhMGB×".contains(c);
    body.starts_with(|c: char| c.is_ascii_digit()) && body.chars().all(unit)
}

fn is_blank(text: &str) -> bool {
    text.trim().is_empty() || ["-", "–", "—", "n/a", "none"].contains(&text.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(cells: &[&[&str]]) -> Vec<Vec<String>> {
        cells.iter().map(|row| row.iter().map(|c| c.to_string()).collect()).collect()
    }

    #[test]
    fn numbers_stand_right_and_words_left() {
        let rows = rows(&[&["XFJPI", "76.5 %", "−3.2"], &["a", "100 %", "–"], &["bb"]]);
        let lines = align(&["robot", "accuracy", "d"], &rows);
        let expected = [
            "robot  accuracy     d",
            "-----  --------  ----",
            "XFJPI    76.5 %  −3.2",
            "a         100 %     –",
            "bb",
        ];
        assert_eq!(lines, expected);
        assert_eq!(align(&["robot"], &[vec!["02826e9052".to_string()], vec!["1e5".to_string()]])[3], "1e5");
    }

    #[test]
    fn what_is_wider_than_the_terminal_is_one_row_below_the_other() {
        let rows = rows(&[&["XFJPI", "76.5 %", "zeros and ones"], &["a", "", "x"]]);
        let headers = ["robot", "accuracy", "task"];
        assert_eq!(fitted(&headers, &rows, 31), align(&headers, &rows));
        let expected = [
            "robot     XFJPI",
            "accuracy  76.5 %",
            "task      zeros and ones",
            "",
            "robot     a",
            "task      x",
        ];
        assert_eq!(fitted(&headers, &rows, 28), expected);
        assert_eq!(fitted(&headers, &[], 3), align(&headers, &[]));
    }

    #[test]
    fn ids_of_digits_and_letters_are_words() {
        assert!(!is_number("3f9a0c") && !is_number("robot 3") && !is_number(""));
        assert!(is_number("12 s") && is_number("+0.5") && is_number("81.0 [78.4, 83.3]"));
        assert_eq!(align(&["a"], &[]), ["a", "-"]);
        assert_eq!(align(&[], &rows(&[&["x"]])).concat(), "");
    }
}
