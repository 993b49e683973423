//! [`Unstable`] and [`StepError`]: reasons why a simulation ended early.

use crate::stop::Stopped;

/// The way in which a simulation became unstable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum UnstableReason {
    /// Too many distant surface voxels overlap (EvoGym's criterion).
    Overlaps,
    /// A voxel has blown up, or a coordinate is no longer finite.
    BlownUp,
}

/// A simulation that became unstable: it ended there and has no displacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[error("unstable in control step {control_step}: {}", match reason {
    UnstableReason::Overlaps => "too many surface voxels overlap",
    UnstableReason::BlownUp => "a voxel has blown up",
})]
pub struct Unstable {
    /// The control step in which it happened, from 0.
    pub control_step: u64,
    /// The way in which it happened.
    pub reason: UnstableReason,
}

/// The reason why a step was not completed. The state is then useless.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(transparent)]
pub enum StepError {
    /// The simulation became unstable in it, which is an outcome.
    Unstable(#[from] Unstable),
    /// The simulation was stopped: there is no outcome.
    Stopped(#[from] Stopped),
}

impl StepError {
    /// Turns instability into a value, for callers to whom it is an outcome like any other.
    ///
    /// # Errors
    /// Returns [`Stopped`] if there is no outcome.
    pub fn outcome<T>(result: Result<T, StepError>) -> Result<Result<T, Unstable>, Stopped> {
        match result {
            Ok(value) => Ok(Ok(value)),
            Err(StepError::Unstable(unstable)) => Ok(Err(unstable)),
            Err(StepError::Stopped(stopped)) => Err(stopped),
        }
    }
}
