//! Analysis of tested robots: verdicts of audits, votes of a team, simple classifiers, and the
//! paper's own numbers.

pub mod baselines;
pub mod published;
pub mod verdict;
pub mod votes;
