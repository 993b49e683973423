//! [`one_line`]: any text as one line that a terminal displays; [`counted`]: numbers with nouns.

use std::fmt::Display;

/// Most characters of a message: more than any of ours has.
const MOST: usize = 1500;

/// Writes a text as one line of printable characters. Control characters, line breaks and changes
/// of writing direction become `\u{…}` (or `\n`, `\r`, `\t`), so that a file or its name can
/// neither command the terminal nor forge a line. A very long text loses its middle.
pub(crate) fn one_line(text: &str) -> String {
    shortened(text, MOST)
}

/// Acts as [`one_line`], but cuts to about this number of characters.
pub(crate) fn shortened(text: &str, most: usize) -> String {
    let begin: String = text.chars().take(most + 1).map(written).collect();
    let whole = || text.chars().map(written).collect();
    // It is short enough, even when escaped.
    if text.chars().nth(most).is_none() && begin.chars().count() <= most {
        return whole();
    }
    // It was shortened before: do not cut it twice.
    if text.contains(CUT) && text.chars().count() <= most + 99 {
        return whole();
    }
    let half = most / 2;
    let mut last: Vec<char> = text.chars().rev().take(half).collect();
    last.reverse();
    let last: Vec<char> = last
        .into_iter()
        .map(written)
        .collect::<String>()
        .chars()
        .collect();
    let begin: String = begin.chars().take(half).collect();
    let end: String = last[last.len().saturating_sub(half)..].iter().collect();
    format!("{begin}{CUT}{end}")
}

/// Writes a number with the noun for one or for any other number of things: "1 robot", "2 robots".
pub(crate) fn counted<N: Display + PartialEq + From<u8>>(
    count: N,
    one: &str,
    more: &str,
) -> String {
    let word = if count == N::from(1) { one } else { more };
    format!("{count} {word}")
}

const CUT: &str = " … ";

fn written(c: char) -> String {
    if is_unseen(c) {
        c.escape_default().collect()
    } else {
        c.to_string()
    }
}

/// Returns true if a character is invisible or controls the display.
pub fn is_unseen(c: char) -> bool {
    c.is_control()
        || matches!(c,
            // Direction marks and overrides, line separators, tags, zero-width characters.
            '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

/// Formats a time span in its two largest units: "45 s", "12 min 3 s", "3 h 20 min", "2 d 4 h".
pub(crate) fn duration(seconds: f64) -> String {
    let whole = if seconds.is_finite() {
        seconds.max(0.0).round() as u64
    } else {
        0
    };
    let (minutes, hours, days) = (whole / 60, whole / 3600, whole / 86400);
    match (days, hours, minutes) {
        (0, 0, 0) => format!("{whole} s"),
        (0, 0, m) => format!("{m} min {} s", whole % 60),
        (0, h, m) => format!("{h} h {} min", m % 60),
        (d, h, _) => format!("{d} d {} h", h % 24),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_commands_a_terminal_is_written_out_and_anything_else_stays() {
        assert_eq!(
            one_line("a\x1b[2Jb\nc\r\td\u{7f}\u{9b}"),
            "a\\u{1b}[2Jb\\nc\\r\\td\\u{7f}\\u{9b}"
        );
        assert_eq!(
            one_line("x\u{202e}y\u{2066}\u{2028}\u{200b}"),
            "x\\u{202e}y\\u{2066}\\u{2028}\\u{200b}"
        );
        let plain = "runs/größe/雪: 0|123, −3.2 × \\ \"quoted\"";
        assert_eq!(one_line(plain), plain);
        assert_eq!(one_line(&one_line("a\x1b")), one_line("a\x1b"));
    }

    #[test]
    fn one_thing_is_not_several() {
        assert_eq!(counted(1_usize, "robot", "robots"), "1 robot");
        assert_eq!(
            [0_u64, 2].map(|n| counted(n, "task is", "tasks are")),
            ["0 tasks are", "2 tasks are"]
        );
    }

    #[test]
    fn of_what_is_very_long_beginning_and_end_stay() {
        let long = format!("begin {} end", "ä".repeat(1_000_000));
        let line = one_line(&long);
        assert!(line.starts_with("begin ä") && line.ends_with("ä end") && line.contains(CUT));
        assert_eq!(line.chars().count(), MOST + 3);
        assert_eq!(one_line(&line), line);
        assert_eq!(one_line(&"\x1b".repeat(MOST)).chars().count(), MOST + 3);
        assert_eq!(shortened("abcdef", 6), "abcdef");
        assert_eq!(shortened("abcdefg", 4), "ab … fg");
    }

    #[test]
    fn durations_have_two_units_at_most() {
        let spans = [0.4, 45.0, 723.0, 12_000.0, 187_200.0, f64::NAN].map(duration);
        assert_eq!(
            spans,
            ["0 s", "45 s", "12 min 3 s", "3 h 20 min", "2 d 4 h", "0 s"]
        );
    }
}
