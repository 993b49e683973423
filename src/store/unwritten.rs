//! `Unwritten`: results that could not be written. The work goes on all the same: they can still be
//! shown, and perhaps be written later.

use crate::base::error::{Error, ErrorKind};

/// How writing the results went the last time.
#[derive(Debug, Default)]
pub(crate) struct Unwritten(Option<Error>);

impl Unwritten {
    /// Notes how writing went; when it begins to fail, says so with `warn`.
    ///
    /// # Errors
    /// If the folder is no longer this process's: to try again would not help.
    pub fn tried(&mut self, outcome: Result<(), Error>, warn: impl FnOnce(&str)) -> Result<(), Error> {
        if matches!(&outcome, Err(error) if error.kind == ErrorKind::Lost) {
            return outcome;
        }
        if let (Err(error), None) = (&outcome, &self.0) {
            let hint = error.hint.as_ref().map_or(String::new(), |hint| format!(" ({hint})"));
            warn(&format!("{error}{hint}; the work goes on, and it is tried again"));
        }
        self.0 = outcome.err();
        Ok(())
    }

    /// Why the latest results are not in their file, if they are not.
    pub fn error(self) -> Option<Error> {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_is_told_once_and_forgotten_when_writing_succeeds() {
        let mut told = 0;
        let mut unwritten = Unwritten::default();
        let full = || Err(Error::other("full".to_string()));
        for (outcome, warnings) in [(Ok(()), 0), (full(), 1), (full(), 1), (Ok(()), 1), (full(), 2)] {
            let is_full = outcome.is_err();
            unwritten.tried(outcome, |_| told += 1).unwrap();
            assert_eq!((told, unwritten.0.is_some()), (warnings, is_full));
        }
        assert_eq!(unwritten.error().map(|error| error.message), Some("full".to_string()));
    }
}
