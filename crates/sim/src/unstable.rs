//! [`Unstable`] and [`StepError`]: why a simulation ended before its time.

use crate::stop::Stopped;

/// How a simulation became unstable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum UnstableReason {
    /// Too many distant surface voxels overlap (EvoGym's criterion).
    Overlaps,
    /// A voxel has blown up, or a coordinate is no number any more.
    BlownUp,
}

/// A simulation became unstable: it ended there, and has no displacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[error("unstable in control step {control_step}: {}", match reason {
    UnstableReason::Overlaps => "too many surface voxels overlap",
    UnstableReason::BlownUp => "a voxel has blown up",
})]
pub struct Unstable {
    /// The control step in which it happened, from 0.
    pub control_step: u64,
    /// What happened.
    pub reason: UnstableReason,
}

/// Why a step was not completed. The state is then of no use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(transparent)]
pub enum StepError {
    /// The simulation became unstable in it, which is an outcome.
    Unstable(#[from] Unstable),
    /// It was stopped: nothing is known.
    Stopped(#[from] Stopped),
}

impl StepError {
    /// Turns instability into a value, where that is an outcome like any other.
    ///
    /// # Errors
    /// [`Stopped`], after which there is no outcome.
    pub fn outcome<T>(result: Result<T, StepError>) -> Result<Result<T, Unstable>, Stopped> {
        match result {
            Ok(value) => Ok(Ok(value)),
            Err(StepError::Unstable(unstable)) => Ok(Err(unstable)),
            Err(StepError::Stopped(stopped)) => Err(stopped),
        }
    }
}
