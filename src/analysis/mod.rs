//! Analysis of tested robots: verdicts of audits, votes of a team, simple classifiers, and the
//! paper's own numbers.

pub mod baselines;
pub mod dossier;
pub mod progress;
pub mod published;
pub mod sweep;
pub mod verdict;
pub mod votes;
