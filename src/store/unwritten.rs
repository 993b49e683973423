//! `Unwritten`: results that could not be written. The work continues all the same: they can still
//! be displayed, and perhaps written later.

use crate::base::error::{Error, ErrorKind};
use crate::base::session::Session;

/// The outcome of the last attempt to write the results.
#[derive(Debug, Default)]
pub(crate) struct Unwritten(Option<Error>);

impl Unwritten {
    /// Records the outcome of writing, and warns when it begins to fail. The error is that the
    /// folder is no longer this process's: to try again would not help.
    pub(crate) fn tried(
        &mut self,
        outcome: Result<(), Error>,
        session: &Session,
    ) -> Result<(), Error> {
        if matches!(&outcome, Err(error) if error.kind == ErrorKind::Lost) {
            return outcome;
        }
        if let (Err(error), None) = (&outcome, &self.0) {
            session
                .observer
                .failed(error, "the work goes on, and it is tried again");
        }
        self.0 = outcome.err();
        Ok(())
    }

    /// Returns the reason why the latest results are not in their file, if they are not.
    pub(crate) fn error(self) -> Option<Error> {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::observer::Observer;
    use crate::base::stop::NEVER;
    use std::sync::atomic::{AtomicU32, Ordering};

    #[test]
    fn a_failure_is_told_once_and_forgotten_when_writing_succeeds() {
        struct Counting(AtomicU32);
        impl Observer for Counting {
            fn failed(&self, _: &Error, _: &str) {
                self.0.fetch_add(1, Ordering::Relaxed);
            }
        }
        let counting = Counting(AtomicU32::new(0));
        let mut unwritten = Unwritten::default();
        let full = || Err(Error::other("full".to_string()));
        for (outcome, warnings) in [
            (Ok(()), 0),
            (full(), 1),
            (full(), 1),
            (Ok(()), 1),
            (full(), 2),
        ] {
            let is_full = outcome.is_err();
            unwritten
                .tried(outcome, &Session::new(&NEVER, &counting))
                .unwrap();
            assert_eq!(
                (counting.0.load(Ordering::Relaxed), unwritten.0.is_some()),
                (warnings, is_full)
            );
        }
        assert_eq!(
            unwritten.error().map(|error| error.message),
            Some("full".to_string())
        );
    }
}
