//! Analysis of robots: audit verdicts, team votes, simple classifiers, and the paper's numbers.

pub(crate) mod baselines;
pub(crate) mod comparison;
pub(crate) mod dossier;
pub(crate) mod gates;
pub(crate) mod progress;
pub(crate) mod published;
pub(crate) mod sweep;
pub(crate) mod verdict;
pub(crate) mod votes;
