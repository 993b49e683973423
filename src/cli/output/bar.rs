//! Moving output on the terminal: progress and live pictures. [`Console`] writes all of it.

use crate::base::observer::Generation;
use crate::base::text::one_line;
use crate::cli::output::console::{Console, Mode, lock};
use crate::cli::output::progress::{Pacer, ProgressWords, Recent, count_line, generation_line};
use crate::cli::output::wrapping::one_of;
use indicatif::ProgressBar;
use serde::Serialize;
use std::sync::Mutex;
use std::time::Instant;

/// A progress line, rewritten on a terminal and repeated from time to time elsewhere.
struct Line<'c> {
    console: &'c Console,
    total: u64,
    begin: Instant,
    moving: Option<ProgressBar>,
    pacer: Mutex<Pacer>,
}

impl<'c> Line<'c> {
    fn new(console: &'c Console, total: u64) -> Self {
        let moving = console.moving_line(total);
        Line {
            console,
            total,
            begin: Instant::now(),
            moving,
            pacer: Mutex::default(),
        }
    }

    /// Displays the text, which depends on the seconds since the beginning.
    fn show(&self, done: u64, text: impl FnOnce(f64) -> ProgressWords) {
        let seconds = self.begin.elapsed().as_secs_f64();
        let text = |columns: usize| {
            let ProgressWords { label, parts } = text(seconds);
            let parts: Vec<String> = parts.iter().map(|part| one_line(part)).collect();
            one_of(&one_line(&label), &parts, columns)
        };
        if let Some(line) = &self.moving {
            line.set_position(done);
            line.set_message(text(self.console.room()));
        } else if self.console.mode() == Mode::Human && self.is_due(done, seconds) {
            self.console.err(&format!("{}\n", text(usize::MAX)));
        }
    }

    fn is_due(&self, done: u64, seconds: f64) -> bool {
        lock(&self.pacer).is_due(seconds, done as f64 / self.total.max(1) as f64)
    }
}

impl Drop for Line<'_> {
    fn drop(&mut self) {
        if self.moving.is_some() {
            self.console.clear_line();
        }
    }
}

/// The progress of an evolution; the line disappears on drop.
pub(crate) struct Bar<'c> {
    recent: Mutex<Option<Recent<Generation>>>,
    line: Line<'c>,
}

impl<'c> Bar<'c> {
    pub(super) fn new(console: &'c Console, total: u64) -> Self {
        Bar {
            recent: Mutex::new(None),
            line: Line::new(console, total),
        }
    }

    /// Displays the progress (JSON: an event `generation`). The first call counts as the beginning:
    /// a resumed run calls it once before it continues.
    pub(crate) fn update(&self, progress: &Generation) {
        self.line.show(progress.done, |seconds| {
            let mut recent = lock(&self.recent);
            let recent = recent.get_or_insert(Recent::new(seconds, *progress));
            let (seconds, before) = recent.since(seconds, *progress, |now| now.done);
            generation_line(progress, &before, seconds)
        });
        self.line.console.event("generation", progress);
    }
}

/// The progress of something counted; the line disappears on drop.
pub(crate) struct Counter<'c> {
    label: String,
    unit: String,
    line: Line<'c>,
    recent: Mutex<Recent<u64>>,
}

impl<'c> Counter<'c> {
    pub(super) fn new(console: &'c Console, label: &str, total: u64, unit: &str) -> Self {
        Counter {
            label: label.into(),
            unit: unit.into(),
            line: Line::new(console, total),
            recent: Mutex::new(Recent::new(0.0, 0)),
        }
    }

    /// Marks `known` items as done before, so that they do not count for the speed.
    pub(crate) fn go_on_from(&self, known: u64) {
        *lock(&self.recent) = Recent::new(self.line.begin.elapsed().as_secs_f64(), known);
        self.update(known);
    }

    /// Excludes `count` items, later reported as done, from the speed.
    pub(crate) fn skip(&self, count: u64) {
        lock(&self.recent).shift(|done| *done += count);
    }

    /// Displays that `done` items are done (JSON: an event `progress`, as often as a plain line).
    pub(crate) fn update(&self, done: u64) {
        #[derive(Serialize)]
        struct Count<'a> {
            label: &'a str,
            done: u64,
            total: u64,
            unit: &'a str,
        }
        let (label, unit, total) = (self.label.as_str(), self.unit.as_str(), self.line.total);
        self.line.show(done, |seconds| {
            let (seconds, before) = lock(&self.recent).since(seconds, done, |done| *done);
            count_line(label, [before, done, total], unit, seconds)
        });
        let is_json = self.line.console.mode() == Mode::Json;
        if is_json
            && self
                .line
                .is_due(done, self.line.begin.elapsed().as_secs_f64())
        {
            self.line.console.event(
                "progress",
                &Count {
                    label,
                    done,
                    total,
                    unit,
                },
            );
        }
    }
}

/// A text picture on stdout, which the next one replaces.
pub(crate) struct Live<'c> {
    console: &'c Console,
    height: usize,
}

impl<'c> Live<'c> {
    pub(super) fn new(console: &'c Console) -> Self {
        Live { console, height: 0 }
    }

    /// Displays a picture in place of the previous one.
    pub(crate) fn show(&mut self, picture: &str) {
        let up = if self.height > 0 {
            format!("\x1b[{}F", self.height)
        } else {
            String::new()
        };
        self.height = picture.lines().count();
        self.console.out(&format!("{up}{picture}\n"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::output::console::tests::console;

    const PROGRESS: Generation = Generation {
        done: 0,
        total: 100,
        best: Some(1.0),
        coverage: 0.5,
        evaluations: 0,
        qd_score: 0.0,
    };

    #[test]
    fn without_a_terminal_progress_is_a_line_every_tenth() {
        let (console, out, err) = console(Mode::Human);
        let bar = console.progress(100);
        (0..=100).for_each(|done| {
            bar.update(&Generation {
                done,
                evaluations: 20 * done,
                ..PROGRESS
            })
        });
        let text = err.read();
        assert_eq!(
            (text.lines().count(), out.read().as_str()),
            (11, ""),
            "{text}"
        );
        assert!(
            text.starts_with("generation 0/100 · best 1.00 · coverage 50.0 %"),
            "{text}"
        );
        assert!(
            text.lines()
                .last()
                .unwrap()
                .starts_with("generation 100/100")
        );
    }

    #[test]
    fn quiet_shows_no_progress_and_json_every_generation() {
        for (mode, lines) in [(Mode::Quiet, 0), (Mode::Json, 5)] {
            let (console, out, err) = console(mode);
            let bar = console.progress(100);
            (1..=5).for_each(|done| bar.update(&Generation { done, ..PROGRESS }));
            assert_eq!(
                (out.read().lines().count(), err.read().as_str()),
                (lines, "")
            );
        }
    }

    #[test]
    fn counters_count_in_every_mode() {
        let (human, _, err) = console(Mode::Human);
        human.counter("eval", 4, "images").update(4);
        assert!(err.read().starts_with("eval 4/4 images"), "{}", err.read());
        let (json, out, _) = console(Mode::Json);
        let counter = json.counter("fetch", 2000, "bytes");
        (1..=2000).for_each(|done| counter.update(done));
        let lines: Vec<serde_json::Value> = out
            .read()
            .lines()
            .map(|l| serde_json::from_str(l).unwrap())
            .collect();
        assert!((11..=12).contains(&lines.len()), "{lines:?}");
        assert_eq!(lines[lines.len() - 1]["done"], 2000);
    }

    #[test]
    fn a_live_picture_is_drawn_over_the_one_before() {
        let (console, out, _) = console(Mode::Human);
        assert!(console.live().is_none(), "not a terminal");
        let mut live = Live::new(&console);
        live.show("a\nb");
        live.show("c\nd");
        assert_eq!(out.read(), "a\nb\n\x1b[2Fc\nd\n");
    }
}
