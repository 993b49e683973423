//! Analysis of robots: audit verdicts, team votes, simple classifiers, and the paper's numbers.

pub mod baselines;
pub mod dossier;
pub mod progress;
pub mod published;
pub mod sweep;
pub mod verdict;
pub mod votes;
