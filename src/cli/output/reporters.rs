//! [`Reporter`]: displays the progress of a command on the console.

use crate::base::error::Error;
use crate::base::observer::{Generation, Observer, Work};
use crate::cli::explain::{Explained, explain};
use crate::cli::output::console::{Bar, Console, Counter, Mode};
use std::path::Path;
use std::sync::{PoisonError, RwLock};

/// Displays the progress of a command on a console.
pub struct Reporter<'c> {
    console: &'c Console,
    line: RwLock<Line<'c>>,
    /// True if only progress, findings and warnings are displayed, without notes and file names.
    brief: bool,
}

/// The moving part of the screen: at most one line.
enum Line<'c> {
    None,
    Evolution(Bar<'c>),
    Work(Counter<'c>),
}

impl<'c> Reporter<'c> {
    /// Creates a reporter on a console.
    pub fn new(console: &'c Console) -> Self {
        Reporter {
            console,
            line: RwLock::new(Line::None),
            brief: false,
        }
    }

    /// Leaves out notes and file names, for a command that says at its end what matters. JSON has
    /// them all the same.
    pub(crate) fn brief(self, brief: bool) -> Self {
        let brief = brief && self.console.mode() != Mode::Json;
        Reporter { brief, ..self }
    }

    fn show(&self, line: impl FnOnce() -> Line<'c>) {
        // A panic elsewhere is no reason to stop counting.
        let mut shown = self.line.write().unwrap_or_else(PoisonError::into_inner);
        // Ends the previous line first.
        *shown = Line::None;
        *shown = line();
    }
}

impl Observer for Reporter<'_> {
    fn note(&self, text: &str) {
        if !self.brief {
            self.console.info(text);
        }
    }

    fn wrote(&self, path: &Path, about: &str) {
        // Ends the line of the work that made it.
        self.show(|| Line::None);
        if self.brief {
            return;
        }
        let text = format!("wrote {}{about}", path.display());
        self.console.line_about(path, &text);
    }

    fn begins(&self, work: &Work) {
        self.show(|| {
            let counter = self.console.counter(&work.label, work.total, &work.unit);
            if work.known > 0 {
                counter.go_on_from(work.known);
            }
            Line::Work(counter)
        });
    }

    fn progress(&self, done: u64) {
        if let Line::Work(counter) = &*self.line.read().unwrap_or_else(PoisonError::into_inner) {
            counter.update(done);
        }
    }

    fn skips(&self, count: u64) {
        if let Line::Work(counter) = &*self.line.read().unwrap_or_else(PoisonError::into_inner) {
            counter.skip(count);
        }
    }

    fn generation(&self, generation: &Generation) {
        let is_shown = matches!(
            &*self.line.read().unwrap_or_else(PoisonError::into_inner),
            Line::Evolution(_)
        );
        if !is_shown {
            self.show(|| Line::Evolution(self.console.progress(generation.total)));
        }
        if let Line::Evolution(bar) = &*self.line.read().unwrap_or_else(PoisonError::into_inner) {
            bar.update(generation);
        }
    }

    fn finding(&self, kind: &str, fields: &serde_json::Value) {
        self.console.event(kind, fields);
    }

    fn warning(&self, text: &str) {
        self.console.warning(text);
    }

    fn failed(&self, error: &Error, then: &str) {
        let Explained { message, hint } = explain(error);
        let parts = [
            Some(message),
            hint,
            Some(then.to_string()).filter(|then| !then.is_empty()),
        ];
        self.console
            .warning(&parts.into_iter().flatten().collect::<Vec<_>>().join("; "));
    }
}
