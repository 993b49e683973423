//! The program, as its users meet it: what it prints, where it writes, what it serves, how it ends.

#[path = "../common/mod.rs"]
mod common;

mod audit;
mod capacity;
mod configs;
mod data;
mod eval;
mod full_disk;
mod gaits;
mod help;
mod no_threads;
mod output;
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
mod snapshots;
mod sweep;
mod team;
mod terminal;
mod train;
mod tutorial;
mod validation;
mod watching;
mod whereabouts;

use crate::common::program::{Sandbox, files};
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// A finished tiny run and what belongs to it, made once; copy it with [`with_run`].
fn run_once() -> &'static BTreeMap<String, Vec<u8>> {
    static RUN: OnceLock<BTreeMap<String, Vec<u8>>> = OnceLock::new();
    RUN.get_or_init(|| {
        let sandbox = Sandbox::tiny();
        sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
        files(&sandbox.path("run"))
    })
}

/// A sandbox with a finished run in `run`.
fn with_run() -> Sandbox {
    Sandbox::with_run(run_once())
}
