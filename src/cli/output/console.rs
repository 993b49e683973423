//! [`Console`]: the only writer to the terminal. Results go to stdout, everything else to stderr.
#![allow(clippy::disallowed_methods, reason = "this is the module that writes")]

pub(crate) use crate::cli::output::bar::{Bar, Counter, Live};

use crate::base;
use crate::base::text::{is_unseen, one_line, shortened};
use crate::cli::explain::explain;
use crate::cli::output::table;
use crate::cli::output::wrapping::{wrapped, wrapped_command};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use std::error::Error;
use std::io::{self, IsTerminal, Write};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Maximum number of characters in a table cell.
const CELL: usize = 400;
/// Columns of the moving line's bar, and of the blank behind it.
const BAR: usize = 9;
/// Columns of a terminal of unknown width.
const USUAL: usize = 80;

/// The reader that the console writes for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// People: a moving progress line on a terminal, plain lines elsewhere.
    #[default]
    Human,
    /// Results, warnings and errors only.
    Quiet,
    /// Programs: one JSON object per line on stdout, its kind under `event`, including progress and
    /// notes. Warnings go to stderr, errors to both. docs/command-line.md lists all kinds.
    Json,
}

/// The terminal, or a replacement. Threads may share it.
pub struct Console {
    mode: Mode,
    /// True for stdout and stderr if they are terminals that can move the cursor.
    terminals: [bool; 2],
    colour: bool,
    /// True for stdout and stderr if their width is limited to the terminal's columns.
    narrow: [bool; 2],
    streams: Mutex<Streams>,
    /// The progress line on the terminal, which must step aside for other lines.
    line: Mutex<Option<ProgressBar>>,
}

struct Streams {
    out: Box<dyn Write + Send>,
    err: Box<dyn Write + Send>,
    /// True if the reader of stdout has gone (`| head`), or accepts no more.
    closed: bool,
    /// True if results were lost for another reason than a closed pipe, such as a full disk.
    lost: bool,
}

fn columns() -> usize {
    let told = crossterm::terminal::size()
        .ok()
        .map(|(columns, _)| usize::from(columns));
    told.filter(|columns| *columns > 0).unwrap_or(USUAL)
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A thread that panicked while it held a stream leaves it usable.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Console {
    /// Creates a console on the process's stdout and stderr. It has no colours if `NO_COLOR` is
    /// set, and no moving lines if `TERM` is `dumb`.
    pub(crate) fn new(mode: Mode) -> Self {
        let set = |name| std::env::var_os(name).filter(|v| !v.is_empty());
        let smart = set("TERM").is_none_or(|term| term != "dumb");
        let narrow = [io::stdout().is_terminal(), io::stderr().is_terminal()];
        Console {
            terminals: narrow.map(|is_terminal| is_terminal && smart),
            colour: set("NO_COLOR").is_none(),
            narrow,
            ..Console::with_writers(mode, Box::new(io::stdout()), Box::new(io::stderr()))
        }
    }

    /// Creates a console on any two writers, treated as files: no colours, no moving lines.
    pub fn with_writers(
        mode: Mode,
        out: Box<dyn Write + Send>,
        err: Box<dyn Write + Send>,
    ) -> Self {
        let streams = Mutex::new(Streams {
            out,
            err,
            closed: false,
            lost: false,
        });
        Console {
            mode,
            terminals: [false; 2],
            colour: false,
            narrow: [false; 2],
            streams,
            line: Mutex::new(None),
        }
    }

    /// Returns the current columns of stdout (0) or stderr (1), unlimited if it is no terminal.
    fn columns(&self, stream: usize) -> usize {
        if self.narrow[stream] {
            columns()
        } else {
            usize::MAX
        }
    }

    pub(crate) fn mode(&self) -> Mode {
        self.mode
    }

    /// Returns true if stdout may contain pictures in colour.
    pub(crate) fn has_colour(&self) -> bool {
        self.terminals[0] && self.colour
    }

    /// Returns true if the reader of stdout has gone.
    pub(crate) fn is_closed(&self) -> bool {
        lock(&self.streams).closed
    }

    /// Returns true if wanted results could not be written, for example because the disk is full.
    pub(crate) fn has_lost_results(&self) -> bool {
        lock(&self.streams).lost
    }

    /// Writes a line of results to stdout; an empty line separates results for people. Like all
    /// text for people, it displays control characters and line breaks, which can only come from a
    /// file or its name, and never obeys them. On a terminal, lines break between words.
    pub(crate) fn line(&self, text: &str) {
        match self.mode {
            Mode::Json if text.is_empty() => {}
            Mode::Json => self.event("result", &Text { text, file: None }),
            _ => self.out(&lines(wrapped(&one_line(text), self.columns(0)))),
        }
    }

    /// Writes a shell command to stdout, on one line however long it is.
    pub(crate) fn command(&self, text: &str) {
        match self.mode {
            Mode::Json => self.event("result", &Text { text, file: None }),
            _ => self.out(&format!("{text}\n")),
        }
    }

    /// Writes a line about a file, such as "wrote walk.gif" (JSON: with its path under `file`).
    pub(crate) fn line_about(&self, file: &Path, text: &str) {
        match self.mode {
            Mode::Json => self.event(
                "result",
                &Text {
                    text,
                    file: Some(file.display().to_string()),
                },
            ),
            _ => self.line(text),
        }
    }

    /// Writes a document unchanged to stdout, in every mode: a config, a man page, a trajectory.
    pub(crate) fn text(&self, text: &str) {
        self.out(text);
    }

    /// Writes a table of results to stdout, with numeric columns aligned to the right. On a
    /// terminal, [`table::fitted`] fits it to the width.
    pub(crate) fn table(&self, headers: &[&str], rows: &[Vec<String>]) {
        #[derive(Serialize)]
        struct Table<'a> {
            headers: &'a [&'a str],
            rows: &'a [Vec<String>],
        }
        match self.mode {
            Mode::Json => self.event("table", &Table { headers, rows }),
            _ => {
                let headers: Vec<String> =
                    headers.iter().map(|text| shortened(text, CELL)).collect();
                let headers: Vec<&str> = headers.iter().map(String::as_str).collect();
                let cells =
                    |row: &Vec<String>| row.iter().map(|text| shortened(text, CELL)).collect();
                let rows: Vec<Vec<String>> = rows.iter().map(cells).collect();
                self.out(&lines(table::fitted(&headers, &rows, self.columns(0))));
            }
        }
    }

    /// Writes one JSON line to stdout: the payload's fields after `"event": name` (a payload that
    /// is no object: as `value`). Does nothing in other modes.
    pub(crate) fn event(&self, name: &str, payload: &impl Serialize) {
        if self.mode != Mode::Json {
            return;
        }
        let (Ok(name), Ok(payload)) = (serde_json::to_string(name), serde_json::to_string(payload))
        else {
            return self.warning(&format!("the event {name:?} cannot be written as JSON"));
        };
        let fields = match payload.strip_prefix('{') {
            Some("}") => "}".to_string(),
            Some(fields) => format!(",{fields}"),
            None => format!(",\"value\":{payload}}}"),
        };
        // Escapes what a terminal may take for a command; it occurs only inside JSON strings.
        let fields: String = match fields.contains(is_unseen) {
            true => fields.chars().map(in_json).collect(),
            false => fields,
        };
        self.out(&format!("{{\"event\":{name}{fields}\n"));
    }

    /// Writes a note for people to stderr (JSON: an event).
    pub(crate) fn info(&self, text: &str) {
        match self.mode {
            Mode::Human => self.err(&lines(wrapped(&one_line(text), self.columns(1)))),
            Mode::Quiet => {}
            Mode::Json => self.event("info", &Text { text, file: None }),
        }
    }

    /// Writes a note with a command to copy: "next:" and the command. Blanks in place of "next:"
    /// align it with the note above.
    pub(crate) fn suggest(&self, about: &str, command: &str) {
        match self.mode {
            Mode::Human => self.err(&lines(wrapped_command(about, command, self.columns(1)))),
            _ => self.info(&format!("{about} {command}")),
        }
    }

    /// Writes a warning to stderr, in every mode.
    pub(crate) fn warning(&self, text: &str) {
        self.err(&self.painted("warning:", "1;33", text));
    }

    /// Writes an error and its remedy, in the command line's terms, to stderr, in every mode.
    pub(crate) fn failed(&self, error: &base::error::Error) {
        let explained = explain(error);
        self.error(&explained, explained.hint.as_deref());
    }

    /// Writes an error with its causes and an optional hint to stderr, in every mode. A cause that
    /// the line above already contains is left out.
    pub(crate) fn error(&self, error: &(dyn Error + 'static), hint: Option<&str>) {
        let mut told = error.to_string();
        let mut text = self.painted("error:", "1;31", &told);
        let mut causes = Vec::new();
        let mut source = error.source();
        while let Some(cause) = source {
            let words = cause.to_string();
            if !told.contains(&words) {
                text += &lines(wrapped(
                    &format!("  caused by: {}", one_line(&words)),
                    self.columns(1),
                ));
                told = words.clone();
                causes.push(words);
            }
            source = cause.source();
        }
        if let Some(hint) = hint {
            text += &self.painted("hint:", "1", hint);
        }
        self.err(&text);
        self.event(
            "error",
            &serde_json::json!({ "message": error.to_string(), "causes": causes, "hint": hint }),
        );
    }

    /// Writes a usage message, plain or coloured, to stderr.
    pub(crate) fn usage(&self, plain: &str, coloured: &str) {
        let text = if self.terminals[1] && self.colour {
            coloured
        } else {
            plain
        };
        let columns = self.columns(1);
        self.err(&lines(
            text.lines()
                .flat_map(|line| wrapped(line, columns))
                .collect(),
        ));
    }

    /// Creates the progress of an evolution: call [`Bar::update`] after every generation.
    pub(crate) fn progress(&self, total: u64) -> Bar<'_> {
        Bar::new(self, total)
    }

    /// Creates the progress of `total` counted `unit`s, such as "images", "robots" or "bytes".
    pub(crate) fn counter(&self, label: &str, total: u64, unit: &str) -> Counter<'_> {
        Counter::new(self, label, total, unit)
    }

    /// Creates a text picture on stdout that the next one replaces, or returns `None` if stdout is
    /// not a terminal for people.
    pub(crate) fn live(&self) -> Option<Live<'_>> {
        (self.mode == Mode::Human && self.terminals[0]).then(|| Live::new(self))
    }

    /// Formats a text behind a coloured word.
    fn painted(&self, word: &str, code: &str, text: &str) -> String {
        let text = lines(wrapped(
            &format!("{word} {}", one_line(text)),
            self.columns(1),
        ));
        match self.terminals[1] && self.colour {
            true => text.replacen(word, &format!("\x1b[{code}m{word}\x1b[0m"), 1),
            false => text,
        }
    }

    pub(super) fn out(&self, text: &str) {
        let failure = self.aside(|streams| {
            if streams.closed {
                return None;
            }
            let result = streams
                .out
                .write_all(text.as_bytes())
                .and_then(|()| streams.out.flush());
            streams.closed = result.is_err();
            let lost = result
                .err()
                .filter(|e| e.kind() != io::ErrorKind::BrokenPipe);
            streams.lost |= lost.is_some();
            lost
        });
        if let Some(e) = failure {
            self.warning(&format!(
                "results can no longer be written to the standard output: {e}"
            ));
        }
    }

    pub(super) fn err(&self, text: &str) {
        // If stderr is closed, nobody reads the error.
        let _ = self.aside(|streams| {
            streams
                .err
                .write_all(text.as_bytes())
                .and_then(|()| streams.err.flush())
        });
    }

    /// Writes while the progress line is suspended.
    fn aside<R>(&self, write: impl FnOnce(&mut Streams) -> R) -> R {
        let line = lock(&self.line).clone();
        let write = || write(&mut lock(&self.streams));
        match line {
            Some(line) => line.suspend(write),
            None => write(),
        }
    }

    /// Creates a moving line on a terminal for people, which [`Console::clear_line`] removes.
    pub(super) fn moving_line(&self, total: u64) -> Option<ProgressBar> {
        if self.mode != Mode::Human || !self.terminals[1] {
            return None;
        }
        let line =
            ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr_with_hz(10));
        let bar = if self.colour {
            "{bar:8.cyan/dim}"
        } else {
            "{bar:8}"
        };
        // The template is fixed; if it were wrong, the default would apply.
        if let Ok(style) = ProgressStyle::with_template(&format!("{bar} {{wide_msg}}")) {
            line.set_style(style.progress_chars("━━─"));
        }
        *lock(&self.line) = Some(line.clone());
        Some(line)
    }

    /// Returns the columns that the moving line leaves for words.
    pub(super) fn room(&self) -> usize {
        self.columns(1).saturating_sub(BAR)
    }

    pub(super) fn clear_line(&self) {
        if let Some(line) = lock(&self.line).take() {
            line.finish_and_clear();
        }
    }
}

/// Joins lines and ends the last.
fn lines(lines: Vec<String>) -> String {
    lines.join("\n") + "\n"
}

/// Escapes a character of a JSON text if it is invisible.
fn in_json(c: char) -> String {
    let mut units = [0; 2];
    match is_unseen(c) {
        true => c
            .encode_utf16(&mut units)
            .iter()
            .map(|unit| format!("\\u{unit:04x}"))
            .collect(),
        false => c.to_string(),
    }
}

#[derive(Serialize)]
struct Text<'a> {
    text: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::base::observer::Generation;
    use std::sync::Arc;

    /// A writer that can be read, or that fails like a closed pipe.
    #[derive(Clone, Default)]
    pub(crate) struct Page {
        text: Arc<Mutex<Vec<u8>>>,
        closed: bool,
    }

    impl Page {
        pub(crate) fn read(&self) -> String {
            String::from_utf8(lock(&self.text).clone()).unwrap()
        }
    }

    impl Write for Page {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.closed {
                return Err(io::ErrorKind::BrokenPipe.into());
            }
            lock(&self.text).extend_from_slice(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    pub(crate) fn console(mode: Mode) -> (Console, Page, Page) {
        let (out, err) = (Page::default(), Page::default());
        (
            Console::with_writers(mode, Box::new(out.clone()), Box::new(err.clone())),
            out,
            err,
        )
    }

    #[derive(Debug, thiserror::Error)]
    #[error("run.json cannot be read: {0}")]
    struct Outer(#[source] Middle);
    #[derive(Debug, thiserror::Error)]
    #[error("no such file")]
    struct Middle(#[source] Inner);
    #[derive(Debug, thiserror::Error)]
    #[error("disk 7 is gone")]
    struct Inner;

    #[test]
    fn results_go_to_stdout_and_everything_else_to_stderr() {
        let (console, out, err) = console(Mode::Human);
        console.line("best 3.2");
        console.table(&["a"], &[vec!["1".into()]]);
        console.info("note");
        console.warning("careful");
        console.error(&Outer(Middle(Inner)), Some("try again"));
        console.event("generation", &1);
        assert_eq!(out.read(), "best 3.2\na\n-\n1\n");
        let expected = "note\nwarning: careful\nerror: run.json cannot be read: no such file\n  \
                        caused by: disk 7 is gone\nhint: try again\n";
        assert_eq!(err.read(), expected);
    }

    #[test]
    fn quiet_leaves_results_warnings_and_errors() {
        let (console, out, err) = console(Mode::Quiet);
        console.line("result");
        console.info("note");
        console.warning("careful");
        assert_eq!(
            (out.read().as_str(), err.read().as_str()),
            ("result\n", "warning: careful\n")
        );
    }

    #[test]
    fn json_mode_writes_one_object_per_line_and_nothing_else_to_stdout() {
        let (console, out, _) = console(Mode::Json);
        console.event(
            "generation",
            &Generation {
                done: 3,
                total: 9,
                best: None,
                coverage: 0.5,
                evaluations: 60,
                qd_score: 1.5,
            },
        );
        console.event("list", &[1, 2]);
        console.event("done", &serde_json::json!({}));
        console.line("a\nb");
        console.line("");
        console.line_about(Path::new("walk.gif"), "wrote walk.gif");
        console.table(&["a"], &[vec!["1".into()]]);
        console.info("note");
        console.error(&Inner, None);
        let text = out.read();
        assert!(
            text.starts_with("{\"event\":\"generation\",\"generation\":3,"),
            "{text}"
        );
        let lines: Vec<serde_json::Value> = text
            .lines()
            .map(|l| serde_json::from_str(l).unwrap())
            .collect();
        let events: Vec<&str> = lines.iter().map(|l| l["event"].as_str().unwrap()).collect();
        assert_eq!(
            events,
            [
                "generation",
                "list",
                "done",
                "result",
                "result",
                "table",
                "info",
                "error"
            ]
        );
        assert_eq!(
            (&lines[1]["value"][1], &lines[3]["text"]),
            (&2.into(), &"a\nb".into())
        );
        assert_eq!(lines[3].get("file"), None);
        assert_eq!(
            (&lines[4]["text"], &lines[4]["file"]),
            (&"wrote walk.gif".into(), &"walk.gif".into())
        );
    }

    #[test]
    fn nothing_that_stands_in_files_commands_the_terminal_or_forges_a_line() {
        let evil = "id\x1b]0;x\x07\x1b[31m\u{9b}2J\r\nwarning: forged\u{202e}";
        for mode in [Mode::Human, Mode::Quiet, Mode::Json] {
            let (console, out, err) = console(mode);
            console.line(evil);
            console.info(evil);
            console.warning(evil);
            console.error(
                &crate::base::error::Error::input(evil.to_string()),
                Some(evil),
            );
            console.error(&std::io::Error::other(evil), None);
            console.table(
                &["robot", evil],
                &[vec![evil.to_string(), "x".repeat(100_000)]],
            );
            console.event(
                "robot",
                &serde_json::json!({ "id": evil, "of": "\u{e0041}" }),
            );
            console.counter(evil, 3, evil).update(3);
            let (out, err) = (out.read(), err.read());
            for text in [&out, &err] {
                assert!(text.chars().all(|c| c == '\n' || !is_unseen(c)), "{text:?}");
                assert!(
                    text.lines()
                        .all(|line| !line.starts_with("warning: forged")),
                    "{text}"
                );
                assert!(
                    text.lines().all(|line| line.len() < 6000) || mode == Mode::Json,
                    "{}",
                    text.len()
                );
            }
            if mode == Mode::Json {
                let last = out
                    .lines()
                    .rfind(|line| line.contains("\"robot\""))
                    .unwrap();
                let last: serde_json::Value = serde_json::from_str(last).unwrap();
                assert_eq!(
                    (&last["id"], &last["of"]),
                    (&evil.into(), &"\u{e0041}".into())
                );
            }
        }
    }

    #[test]
    fn a_closed_pipe_ends_output_quietly() {
        let err = Page::default();
        let out = Page {
            closed: true,
            ..Page::default()
        };
        let console = Console::with_writers(Mode::Human, Box::new(out), Box::new(err.clone()));
        assert!(!console.is_closed());
        console.line("nobody reads this");
        console.line("nor this");
        assert!(console.is_closed());
        assert_eq!(err.read(), "");
    }
}
