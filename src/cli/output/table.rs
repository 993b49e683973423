//! Tables as aligned text, for terminals of any width.

use crate::cli::output::wrapping::{least_of_cell, width, wrapped_cell};

/// Blanks between two columns.
const GAP: usize = 2;
/// Cell text breaks into lines no shorter than this, if it is longer.
const SHORT: usize = 24;

/// Returns the lines of a table as [`align`] does, if they fit into `most` columns. Otherwise
/// headers and texts break between words. If that is not enough, the table continues below,
/// repeating its first column. If not even two columns fit side by side, rows are stacked.
pub(crate) fn fitted(headers: &[&str], rows: &[Vec<String>], most: usize) -> Vec<String> {
    let columns: Vec<Column> = (0..headers.len())
        .map(|place| Column::new(headers, rows, place))
        .collect();
    let blocks = blocks(&columns, most);
    if rows.is_empty() || blocks.iter().any(|block| needed(block) > most) {
        return if rows.is_empty() {
            align(headers, rows)
        } else {
            stacked(headers, rows, most)
        };
    }
    blocks
        .iter()
        .map(|block| drawn(block, &widths(block, most)))
        .collect::<Vec<_>>()
        .join(&String::new())
}

/// Returns the lines of a table: headers, a rule, rows; two spaces between columns, numbers to the
/// right. Short rows are filled with empty cells; cells without a header are left out.
pub(crate) fn align(headers: &[&str], rows: &[Vec<String>]) -> Vec<String> {
    let columns: Vec<Column> = (0..headers.len())
        .map(|place| Column::new(headers, rows, place))
        .collect();
    let columns: Vec<&Column> = columns.iter().collect();
    drawn(&columns, &widths(&columns, usize::MAX))
}

struct Column<'a> {
    header: &'a str,
    cells: Vec<&'a str>,
    is_right: bool,
    /// The minimum width, and the width if there is room.
    least: usize,
    most: usize,
}

impl<'a> Column<'a> {
    fn new(headers: &[&'a str], rows: &'a [Vec<String>], place: usize) -> Self {
        let header = headers[place];
        let cells: Vec<&str> = rows
            .iter()
            .map(|row| row.get(place).map_or("", String::as_str))
            .collect();
        let is_numeric = cells.iter().any(|cell| is_number(cell))
            && cells.iter().all(|cell| is_number(cell) || is_blank(cell));
        let widest =
            |of: &dyn Fn(&str) -> usize| cells.iter().map(|cell| of(cell)).max().unwrap_or(0);
        let whole = widest(&width);
        let text = if is_numeric {
            whole
        } else {
            whole.min(SHORT).max(widest(&least_of_cell))
        };
        Column {
            header,
            cells,
            // Some ids look like numbers.
            is_right: is_numeric && header != "robot",
            least: text.max(least_of_cell(header)),
            most: whole.max(width(header)),
        }
    }
}

/// Returns the minimum width of a table with these columns.
fn needed(columns: &[&Column]) -> usize {
    columns.iter().map(|column| column.least).sum::<usize>() + GAP * columns.len().saturating_sub(1)
}

/// Splits columns into one table, or several tables that stand one below the other.
fn blocks<'a, 'b>(columns: &'b [Column<'a>], most: usize) -> Vec<Vec<&'b Column<'a>>> {
    let mut blocks: Vec<Vec<&Column>> = vec![Vec::new()];
    for column in columns {
        let block = blocks.last_mut().expect("there is one from the beginning");
        block.push(column);
        // The first column identifies the row.
        if block.len() > 2 && needed(block) > most {
            block.pop();
            blocks.push(vec![&columns[0], column]);
        }
    }
    blocks
}

/// Distributes the width: columns that need the least get the remaining room first.
fn widths(columns: &[&Column], most: usize) -> Vec<usize> {
    let mut room = most.saturating_sub(needed(columns));
    let mut widths: Vec<usize> = columns.iter().map(|column| column.least).collect();
    let mut places: Vec<usize> = (0..columns.len()).collect();
    places.sort_by_key(|&place| columns[place].most - columns[place].least);
    for place in places {
        let more = columns[place].most - columns[place].least;
        // Only sentences benefit from a part of the width that they need.
        let more = if columns[place].is_right && more > room {
            0
        } else {
            more.min(room)
        };
        (widths[place], room) = (widths[place] + more, room - more);
    }
    widths
}

fn drawn(columns: &[&Column], widths: &[usize]) -> Vec<String> {
    let line = |cells: Vec<&str>| {
        let padded = cells
            .iter()
            .zip(columns)
            .zip(widths)
            .map(|((text, column), columns)| {
                let gap = " ".repeat(columns.saturating_sub(width(text)));
                if column.is_right {
                    gap + text
                } else {
                    text.to_string() + &gap
                }
            });
        padded
            .collect::<Vec<_>>()
            .join(&" ".repeat(GAP))
            .trim_end()
            .to_string()
    };
    // A row of texts, each of several lines. Headers align at the bottom, right above their cells.
    let row = |texts: Vec<&str>, is_header: bool| -> Vec<String> {
        let cells: Vec<Vec<String>> = texts
            .iter()
            .zip(widths)
            .map(|(text, columns)| wrapped_cell(text, *columns))
            .collect();
        let height = cells.iter().map(Vec::len).max().unwrap_or(1);
        let at = |cell: &'_ Vec<String>, k: usize| -> Option<usize> {
            if is_header {
                (k + cell.len()).checked_sub(height)
            } else {
                Some(k)
            }
        };
        let text = |cell: &Vec<String>, k: usize| {
            at(cell, k)
                .and_then(|place| cell.get(place))
                .cloned()
                .unwrap_or_default()
        };
        (0..height)
            .map(|k| cells.iter().map(|cell| text(cell, k)).collect::<Vec<_>>())
            .map(|texts| line(texts.iter().map(String::as_str).collect()))
            .collect()
    };
    let mut lines = row(columns.iter().map(|column| column.header).collect(), true);
    lines.push(
        widths
            .iter()
            .map(|width| "-".repeat(*width))
            .collect::<Vec<_>>()
            .join(&" ".repeat(GAP)),
    );
    let rows = columns
        .iter()
        .map(|column| column.cells.len())
        .max()
        .unwrap_or(0);
    for place in 0..rows {
        lines.extend(row(
            columns.iter().map(|column| column.cells[place]).collect(),
            false,
        ));
    }
    lines
}

/// Stacks rows, each cell behind its header, or below it if there is no room; an empty line
/// separates rows. Empty cells are left out.
fn stacked(headers: &[&str], rows: &[Vec<String>], most: usize) -> Vec<String> {
    let widest = headers
        .iter()
        .map(|header| width(header))
        .max()
        .unwrap_or(0);
    let longest = rows
        .iter()
        .flatten()
        .map(|cell| least_of_cell(cell))
        .max()
        .unwrap_or(0);
    let is_below = widest + GAP + longest > most;
    let cell = |(header, text): (&&str, &String)| -> Vec<String> {
        if is_below {
            let lines = wrapped_cell(text, most.saturating_sub(GAP));
            let lines = lines.into_iter().map(|line| " ".repeat(GAP) + &line);
            return std::iter::once(header.to_string()).chain(lines).collect();
        }
        let lines = wrapped_cell(text, most.saturating_sub(widest + GAP));
        let begin = |place: usize| if place == 0 { *header } else { "" };
        let line = |(place, text): (usize, String)| {
            let gap = " ".repeat(widest + GAP - width(begin(place)));
            format!("{}{gap}{text}", begin(place))
        };
        lines.into_iter().enumerate().map(line).collect()
    };
    let row = |row: &Vec<String>| -> Vec<String> {
        headers
            .iter()
            .zip(row)
            .filter(|(_, text)| !text.is_empty())
            .flat_map(cell)
            .collect()
    };
    rows.iter()
        .map(row)
        .collect::<Vec<_>>()
        .join(&String::new())
}

/// Returns true if a text starts like a number, with an optional sign, and has a digit: "−3.2",
/// "76.5 %", "12/30", "81.0 [78.4, 83.3]".
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
        cells
            .iter()
            .map(|row| row.iter().map(|c| c.to_string()).collect())
            .collect()
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
        assert_eq!(
            align(
                &["robot"],
                &[vec!["02826e9052".to_string()], vec!["1e5".to_string()]]
            )[3],
            "1e5"
        );
    }

    #[test]
    fn what_is_wider_than_the_terminal_is_broken_between_words() {
        let cells = ["XFJPI", "76.5", "walks on the spot until it is shown a one"];
        let rows = rows(&[&cells, &["a", "100", "walks"]]);
        let expected = [
            "        mean",
            "robot  score  reason",
            "-----  -----  -------------------------",
            "XFJPI   76.5  walks on the spot until",
            "              it is shown a one",
            "a        100  walks",
        ];
        assert_eq!(
            fitted(&["robot", "mean score", "reason"], &rows, 39),
            expected
        );
    }

    #[test]
    fn what_is_still_too_wide_goes_on_below_behind_its_first_column() {
        let rows = rows(&[&["XFJPI", "76.5", "81.3", "30"], &["a", "100", "99.0", "9"]]);
        let headers = ["robot", "accuracy %", "balanced %", "voxels"];
        let expected = [
            "robot  accuracy %",
            "-----  ----------",
            "XFJPI        76.5",
            "a             100",
            "",
            "robot  balanced %  voxels",
            "-----  ----------  ------",
            "XFJPI        81.3      30",
            "a            99.0       9",
        ];
        assert_eq!(fitted(&headers, &rows, 25), expected);
        // A cell counts with its width in a terminal.
        assert_eq!(
            align(&["a", "b"], &[vec!["雪".to_string(), "x".to_string()]])[1..],
            ["--  -", "雪  x"]
        );
    }

    #[test]
    fn of_any_width_nothing_is_lost() {
        let rows = rows(&[&["XFJPI", "76.5 %", "zeros and ones"], &["", "–", "x"]]);
        for most in 0..60 {
            let text = fitted(&["robot", "accuracy", "task"], &rows, most).join(" ");
            for word in ["XFJPI", "76.5", "zeros", "and", "ones", "accuracy", "x"] {
                assert!(text.contains(word), "{most}: {text}");
            }
        }
    }

    #[test]
    fn where_no_two_columns_fit_rows_are_one_below_the_other() {
        let rows = rows(&[&["XFJPI", "76.5 %", "zeros and ones"], &["a", "", "x"]]);
        let headers = ["robot", "accuracy", "task"];
        assert_eq!(fitted(&headers, &rows, 31), align(&headers, &rows));
        let expected = [
            "robot     XFJPI",
            "accuracy  76.5 %",
            "task      zeros",
            "          and",
            "          ones",
            "",
            "robot     a",
            "task      x",
        ];
        assert_eq!(fitted(&headers, &rows, 16), expected);
        assert_eq!(
            fitted(&headers, &rows, 15)[..4],
            ["robot", "  XFJPI", "accuracy", "  76.5 %"]
        );
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
