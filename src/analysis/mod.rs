//! Analysis of robots: audit verdicts, team votes, simple classifiers, and the paper's numbers.

pub mod baselines;
pub mod published;
pub mod verdict;
pub mod votes;
