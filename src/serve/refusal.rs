//! [`Refusal`]: why a request is not answered.

use crate::base::error::Error;

/// Why a request is not answered; each with one clear line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// It is wrong.
    #[error("{0}")]
    Wrong(String),
    /// It names what is not there.
    #[error("{0}")]
    Unknown(String),
    /// As many simulations as may run at once are running.
    #[error("{0}")]
    Busy(String),
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Refusal::Wrong(error.message)
    }
}
