//! Wraps text to a terminal's columns. Lines break between words, and a command continues after a
//! backslash, so that it can be copied. A word wider than the terminal has a line of its own.

use unicode_width::UnicodeWidthStr;

/// The indentation of continuation lines.
const INDENT: usize = 2;
/// The end of a line whose command continues.
const GOES_ON: &str = " \\";

/// An unbreakable piece of text.
#[derive(Debug)]
struct Word {
    /// The blanks before the word.
    gap: usize,
    text: String,
    /// True if it belongs to the same command as the previous word.
    continues: bool,
}

/// The kind of a text, which decides where its lines may break.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Sentences, with commands in backticks.
    Prose,
    /// A command, in which quoted text is one word.
    Command,
    /// A cell of a table; items separated by two blanks stay whole.
    Cell,
}

/// Returns the columns that a text takes; colour sequences take none.
pub(crate) fn width(text: &str) -> usize {
    let mut parts = text.split('\x1b');
    let first = parts.next().map_or(0, UnicodeWidthStr::width);
    first
        + parts
            .map(|part| part.split_once('m').map_or(0, |(_, seen)| seen.width()))
            .sum::<usize>()
}

/// Wraps a one-line text and indents the continuation. Text in backticks is a command.
pub(crate) fn wrapped(text: &str, columns: usize) -> Vec<String> {
    fill(&words(text, Kind::Prose), INDENT, columns)
}

/// Wraps a command behind a label such as "next:", which may be blanks to align it.
pub(crate) fn wrapped_command(about: &str, command: &str, columns: usize) -> Vec<String> {
    let mut all = words(about, Kind::Prose);
    let mut command = words(command, Kind::Command);
    if let Some(first) = command.first_mut() {
        first.continues = false;
        first.gap = if all.is_empty() { width(about) } else { 0 } + 1;
    }
    all.extend(command);
    fill(&all, INDENT, columns)
}

pub(crate) fn wrapped_cell(text: &str, columns: usize) -> Vec<String> {
    fill(&words(text, Kind::Cell), 0, columns)
}

/// Returns the minimum columns of a table cell.
pub(crate) fn least_of_cell(text: &str) -> usize {
    words(text, Kind::Cell)
        .iter()
        .map(|word| width(&word.text))
        .max()
        .unwrap_or(0)
}

/// Joins a label and parts in one line: the first part always, later ones if they fit. A label that
/// is too long keeps its beginning and end.
pub(crate) fn one_of(label: &str, parts: &[String], columns: usize) -> String {
    let (first, others) = parts
        .split_first()
        .map_or(("", parts), |(first, others)| (first, others));
    let label = shortened(label, columns.saturating_sub(width(first) + 1));
    let mut line = if label.is_empty() {
        first.to_string()
    } else {
        format!("{label} {first}")
    };
    for part in others {
        let longer = format!("{line} · {part}");
        if width(&longer) > columns {
            break;
        }
        line = longer;
    }
    line
}

/// Shortens a text to its beginning and end if necessary; returns nothing if that does not fit.
fn shortened(text: &str, columns: usize) -> String {
    let characters: Vec<char> = text.chars().collect();
    let ends = |half: usize| -> String {
        let (begin, end) = (&characters[..half], &characters[characters.len() - half..]);
        begin.iter().chain(&['…']).chain(end).collect()
    };
    match width(text) <= columns {
        true => text.to_string(),
        // Characters may be two columns wide.
        false => (1..=columns / 2)
            .rev()
            .map(ends)
            .find(|short| width(short) <= columns)
            .unwrap_or_default(),
    }
}

/// Splits a text into words. A per cent sign stays with its number, or with what follows it.
fn words(text: &str, kind: Kind) -> Vec<Word> {
    let least_gap = if kind == Kind::Cell && text.contains("  ") {
        2
    } else {
        1
    };
    let (mut is_command, mut quote) = (kind == Kind::Command, None);
    let mut words: Vec<Word> = Vec::new();
    let (mut gap, mut is_escaped) = (0, false);
    for c in text.chars() {
        if c == ' ' && quote.is_none() {
            gap += 1;
            continue;
        }
        let begins_with_sign = words.last().is_some_and(|word| word.text == "%");
        let is_glued = gap < least_gap || gap == 1 && !is_command && (c == '%' || begins_with_sign);
        match words.last_mut().filter(|_| is_glued) {
            Some(word) => word.text.extend(std::iter::repeat_n(' ', gap).chain([c])),
            None => words.push(Word {
                gap,
                text: c.to_string(),
                continues: is_command,
            }),
        }
        gap = 0;
        match c {
            _ if is_escaped => {}
            '`' if kind == Kind::Prose => (is_command, quote) = (!is_command, None),
            '\'' | '"' if is_command && quote.is_none() => quote = Some(c),
            _ if quote == Some(c) => quote = None,
            _ => {}
        }
        // In single quotes a backslash is literal.
        is_escaped = c == '\\' && is_command && !is_escaped && quote != Some('\'');
    }
    words
}

fn fill(words: &[Word], indent: usize, columns: usize) -> Vec<String> {
    let indent = " ".repeat(words.first().map_or(0, |first| first.gap) + indent);
    let mut lines = Vec::new();
    let mut line = String::new();
    let mut rest = words;
    while let Some(first) = rest.first() {
        let end = rest
            .iter()
            .skip(1)
            .position(|word| !word.continues)
            .map_or(rest.len(), |place| place + 1);
        let (unit, others) = rest.split_at(end);
        rest = others;
        let whole: usize = unit.iter().map(|word| word.gap + width(&word.text)).sum();
        let is_command = unit.len() > 1;
        // A command that fits into a line is not broken.
        let fits_a_line = width(&indent) + whole - first.gap <= columns;
        if is_command && fits_a_line && !line.trim().is_empty() && width(&line) + whole > columns {
            lines.push(std::mem::replace(&mut line, indent.clone()));
        }
        for (place, word) in unit.iter().enumerate() {
            let goes_on = place + 1 < unit.len();
            let more = if goes_on && is_broken(unit, place, &line, columns) {
                width(GOES_ON)
            } else {
                0
            };
            let is_begun = !line.trim().is_empty();
            if is_begun && width(&line) + word.gap + width(&word.text) + more > columns {
                let end = if word.continues { GOES_ON } else { "" };
                lines.push(std::mem::replace(&mut line, indent.clone()) + end);
            } else if is_begun || lines.is_empty() {
                line += &" ".repeat(word.gap);
            }
            line += &word.text;
        }
    }
    lines.extend((!line.trim().is_empty() || lines.is_empty()).then_some(line));
    lines
}

/// Returns true if the rest of a command, from a word on, does not fit into the line.
fn is_broken(unit: &[Word], place: usize, line: &str, columns: usize) -> bool {
    let left: usize = unit[place..]
        .iter()
        .map(|word| word.gap + width(&word.text))
        .sum();
    width(line) + left > columns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::shell::quoted;

    #[test]
    fn lines_break_between_words_only() {
        assert_eq!(wrapped("a text that fits", 16), ["a text that fits"]);
        assert_eq!(
            wrapped("a text that fits not", 16),
            ["a text that fits", "  not"]
        );
        assert_eq!(
            wrapped("  far: 12.5 % of it", 13),
            ["  far: 12.5 %", "    of it"]
        );
        assert_eq!(wrapped("one  two  three", 9), ["one  two", "  three"]);
        assert_eq!(
            wrapped("a long/path/of/many/folders b", 10),
            ["a", "  long/path/of/many/folders", "  b"]
        );
        assert_eq!(wrapped("", 10), [""]);
        assert_eq!(wrapped("雪雪 雪雪", 8), ["雪雪", "  雪雪"]);
        assert_eq!(
            wrapped_cell("some words of a cell", 10),
            ["some words", "of a cell"]
        );
        assert_eq!(wrapped_cell("% of 0", 3), ["% of", "0"]);
        // Nothing fits, and nothing is lost.
        for columns in [0, 1, 2, 3] {
            assert_eq!(
                wrapped("ab `cd ef` g", columns)
                    .join("")
                    .replace([' ', '\\'], ""),
                "ab`cdef`g"
            );
        }
    }

    #[test]
    fn one_line_leaves_out_what_matters_least() {
        let parts = ["3/9 runs", "5 s left", "1 run/s"].map(str::to_string);
        assert_eq!(
            one_of("all:", &parts, 99),
            "all: 3/9 runs · 5 s left · 1 run/s"
        );
        assert_eq!(one_of("all:", &parts, 33), "all: 3/9 runs · 5 s left");
        assert_eq!(one_of("雪雪雪雪雪雪雪雪:", &parts, 18), "雪雪…雪: 3/9 runs");
        assert_eq!(one_of("all:", &parts, 24), "all: 3/9 runs · 5 s left");
        assert_eq!(
            [one_of("all:", &parts, 11), one_of("all:", &parts, 0)],
            ["3/9 runs"; 2]
        );
        assert_eq!(
            one_of("a_name_of_many_letters:", &parts, 20),
            "a_nam…ters: 3/9 runs"
        );
    }

    #[test]
    fn a_command_is_whole_in_a_line_or_goes_on_after_a_backslash() {
        let hint = "hint: `audit --archive run` makes all eligible";
        assert_eq!(wrapped(hint, 46), [hint]);
        assert_eq!(
            wrapped(hint, 30),
            ["hint: `audit --archive run`", "  makes all eligible"]
        );
        assert_eq!(
            wrapped(hint, 26),
            ["hint:", "  `audit --archive run`", "  makes all eligible"]
        );
        assert_eq!(
            wrapped("hint: `audit --archive run` it", 17),
            ["hint: `audit \\", "  --archive run`", "  it"]
        );
        let next = |columns| wrapped_command("next:", "audit --archive 'a b' -n 3", columns);
        assert_eq!(next(32), ["next: audit --archive 'a b' -n 3"]);
        assert_eq!(next(31), ["next:", "  audit --archive 'a b' -n 3"]);
        assert_eq!(next(24), ["next: audit --archive \\", "  'a b' -n 3"]);
        assert_eq!(
            wrapped_command("     ", "audit -a run", 20),
            ["      audit -a run"]
        );
        let quoted = quoted("it's here/a b");
        assert_eq!(
            wrapped_command("next:", &format!("eval -a {quoted}"), 26)[1..],
            [format!("  {quoted}")]
        );
    }
}
