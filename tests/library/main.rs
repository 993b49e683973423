//! The library, called as other projects call it.

#[path = "../common/mod.rs"]
mod common;

mod architecture;
mod constants;
mod data_fetch;
mod idx_reader;
mod published_robots;
mod trained_robots;
