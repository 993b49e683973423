//! What is found out about robots: responses, verdicts, the published robots and numbers.

pub mod gallery;
pub mod measure;
pub mod published;
pub mod verdict;
