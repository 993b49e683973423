//! What several test programs share.
#![allow(dead_code, reason = "every test program uses its own part")]

#[cfg(unix)]
pub mod browser;
pub mod hostile;
pub mod program;
pub mod server;

use flate2::read::GzDecoder;
use morphcog::base::Grid;
use morphcog::body::Body;
use morphcog::sim::{Lattice, Physics, Start};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

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
    /// The same life in EvoGym itself at other columns; of sensitive lives only.
    #[serde(default)]
    evogym_elsewhere: Vec<Elsewhere>,
}

#[derive(Deserialize)]
struct Elsewhere {
    largest_difference_voxels: f64,
}

impl Reference {
    pub fn start(&self) -> Start {
        Start { column: self.start_column, row: self.start_row }
    }

    pub fn lattice(&self, physics: &Physics) -> Lattice {
        Lattice::new(&self.body, physics)
    }

    /// The largest distance of EvoGym from itself at other columns \[voxel lengths\].
    pub fn spread(&self) -> f64 {
        self.evogym_elsewhere.iter().map(|other| other.largest_difference_voxels).fold(0.0, f64::max)
    }
}

/// A file of `tests/golden`.
pub fn golden<T: DeserializeOwned>(name: &str) -> T {
    let path = folder().join(format!("{name}.json.gz"));
    serde_json::from_reader(GzDecoder::new(std::fs::File::open(path).unwrap())).unwrap()
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden")
}

/// The names of a folder's lives, in order.
fn lives(folder: &Path) -> Vec<String> {
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let names = files.filter_map(|name| Some(name.to_str().unwrap().strip_suffix(".json.gz")?.to_string()));
    let mut names: Vec<String> = names.filter(|name| name != "published_robots").collect();
    names.sort();
    names
}

/// All reference lives.
pub fn references() -> Vec<Reference> {
    let lives: Vec<Reference> = lives(&folder()).iter().map(|name| golden(name)).collect();
    assert_eq!(lives.len(), 17);
    lives
}

/// All lives in which small differences grow.
pub fn sensitive() -> Vec<Reference> {
    let names = lives(&folder().join("sensitive"));
    let lives: Vec<Reference> = names.iter().map(|name| golden(&format!("sensitive/{name}"))).collect();
    assert_eq!(lives.len(), 4);
    lives
}
