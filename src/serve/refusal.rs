//! [`HttpRefusal`]: the reasons for refusing a request.

use crate::base::error::Error;

/// A reason for refusing a request, with one clear line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum HttpRefusal {
    #[error("{0}")]
    Wrong(String),
    /// The request names something that does not exist.
    #[error("{0}")]
    Unknown(String),
    /// The maximum number of simulations is running.
    #[error("{0}")]
    Busy(String),
}

impl From<Error> for HttpRefusal {
    fn from(error: Error) -> Self {
        HttpRefusal::Wrong(error.message)
    }
}
