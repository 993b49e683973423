//! What several test programs share.
#![allow(dead_code, reason = "every test program uses its own part")]

#[cfg(unix)]
pub mod browser;
pub mod program;
pub mod server;

use flate2::read::GzDecoder;
use morphcog::base::Grid;
use morphcog::body::Body;
use morphcog::sim::{Lattice, Physics, Start};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::Path;

/// One reference life (see `tests/golden/README.md`).
#[derive(Deserialize)]
pub struct Reference {
    pub name: String,
    pub body: Body,
    pub stimulus: Grid<f64>,
    pub start_column: i64,
    pub start_row: u32,
    pub control_steps: u64,
    pub unstable_at: i64,
    pub com: Vec<[f64; 2]>,
    pub points: BTreeMap<u64, Vec<[f64; 2]>>,
}

impl Reference {
    pub fn start(&self) -> Start {
        Start { column: self.start_column, row: self.start_row }
    }

    pub fn lattice(&self, physics: &Physics) -> Lattice {
        Lattice::new(&self.body, physics)
    }
}

/// A file of `tests/golden`.
pub fn golden<T: DeserializeOwned>(name: &str) -> T {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{name}.json.gz"));
    serde_json::from_reader(GzDecoder::new(std::fs::File::open(path).unwrap())).unwrap()
}

/// All reference lives.
pub fn references() -> Vec<Reference> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<String> = files.map(|name| name.into_string().unwrap()).collect();
    names.sort();
    let names = names.iter().filter_map(|name| name.strip_suffix(".json.gz"));
    let lives: Vec<Reference> = names.filter(|&name| name != "published_robots").map(golden).collect();
    assert_eq!(lives.len(), 17);
    lives
}
