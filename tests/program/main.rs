//! The program, as its users meet it: what it prints, where it writes, what it serves, how it ends.

#[path = "../common/mod.rs"]
mod common;

mod audit;
mod capacity;
mod compare;
mod configs;
mod data;
mod documents;
mod eval;
mod film;
mod full_disk;
mod gaits;
mod gates;
mod help;
mod no_threads;
mod output;
mod pairs;
mod plot;
mod replay;
mod report;
mod report_page;
mod reproduce;
mod response;
mod robots;
mod serve;
mod serve_page;
mod simulate;
mod site;
mod snapshots;
mod sweep;
mod team;
mod terminal;
mod train;
mod tutorial;
mod validation;
mod verify;
mod watching;
mod whereabouts;

use crate::common::program::{Made, Sandbox, TINY};
use std::sync::OnceLock;

/// A sandbox with a finished tiny run in `run`.
fn with_run() -> Sandbox {
    static RUN: OnceLock<Made> = OnceLock::new();
    Sandbox::once(&RUN, |sandbox| {
        sandbox.write("tiny.toml", TINY);
        sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    })
}
