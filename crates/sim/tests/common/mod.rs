//! Trajectories of EvoGym's own (see `tests/golden/README.md`).
#![allow(
    clippy::disallowed_methods,
    reason = "a test needs no same bits everywhere"
)]
#![allow(dead_code, reason = "every test program uses its own part")]

use flate2::read::MultiGzDecoder;
use morphcog_sim::{
    Body, Grid, Material, Physics, Start, System, Terrain, TerrainObject, Unstable, World,
};
use serde::de::{DeserializeOwned, Error};
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// One reference simulation.
#[derive(Deserialize)]
pub struct Reference {
    pub name: String,
    #[serde(deserialize_with = "body")]
    pub body: Body,
    #[serde(deserialize_with = "grid")]
    pub stimulus: Grid<f64>,
    pub start_column: i64,
    pub start_row: u32,
    pub control_steps: u64,
    pub unstable_at: i64,
    pub com: Vec<[f64; 2]>,
    pub points: BTreeMap<u64, Vec<[f64; 2]>>,
    /// Runs of the simulation in EvoGym itself at other columns; only for sensitive ones.
    #[serde(default)]
    evogym_elsewhere: Vec<Elsewhere>,
}

#[derive(Deserialize)]
struct Elsewhere {
    largest_difference_voxels: f64,
}

// Not by feature `serde`, so that it need not be on.
fn grid<'de, T: Deserialize<'de>, D: Deserializer<'de>>(reader: D) -> Result<Grid<T>, D::Error> {
    Grid::from_rows(Vec::deserialize(reader)?).map_err(D::Error::custom)
}

fn body<'de, D: Deserializer<'de>>(reader: D) -> Result<Body, D::Error> {
    let codes: Grid<u8> = grid(reader)?;
    let material = |&code: &u8| Material::from_code(code).expect("the files hold bodies");
    Body::new(codes.map(material)).map_err(D::Error::custom)
}

impl Reference {
    pub fn system(&self, physics: &Physics) -> Arc<System> {
        Arc::new(System::new(&self.body, physics.clone()))
    }

    /// At its beginning.
    pub fn world(&self, physics: &Physics) -> World {
        let start = Start {
            column: self.start_column,
            row: self.start_row,
        };
        let mut world = World::new(self.system(physics), start);
        world.set_stimulus(&self.stimulus);
        world
    }

    /// The largest distance of EvoGym from itself at other columns \[voxel lengths\].
    pub fn spread(&self) -> f64 {
        self.evogym_elsewhere
            .iter()
            .map(|other| other.largest_difference_voxels)
            .fold(0.0, f64::max)
    }
}

/// A file of `tests/golden`.
pub fn golden<T: DeserializeOwned>(name: &str) -> T {
    let path = folder().join(format!("{name}.json.gz"));
    serde_json::from_reader(MultiGzDecoder::new(std::fs::File::open(path).unwrap())).unwrap()
}

/// `tests/golden`, for the program's tests as well.
fn folder() -> PathBuf {
    let folders = ["tests/golden", "crates/sim/tests/golden"];
    let mut folders = folders
        .map(|folder| Path::new(env!("CARGO_MANIFEST_DIR")).join(folder))
        .into_iter();
    folders
        .find(|folder| folder.is_dir())
        .expect("it is part of the project")
}

/// The names of a folder's simulations, in order.
fn names(folder: &Path) -> Vec<String> {
    let files = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name());
    let names =
        files.filter_map(|name| Some(name.to_str().unwrap().strip_suffix(".json.gz")?.to_string()));
    let mut names: Vec<String> = names.filter(|name| name != "published_robots").collect();
    names.sort();
    names
}

/// All reference simulations.
pub fn references() -> Vec<Reference> {
    let all: Vec<Reference> = names(&folder()).iter().map(|name| golden(name)).collect();
    assert_eq!(all.len(), 17);
    all
}

/// All simulations in which small differences grow.
pub fn sensitive() -> Vec<Reference> {
    let names = names(&folder().join("sensitive"));
    let all: Vec<Reference> = names
        .iter()
        .map(|name| golden(&format!("sensitive/{name}")))
        .collect();
    assert_eq!(all.len(), 4);
    all
}

/// The bits of all points before the first control step and after each, until the simulation
/// becomes unstable.
pub fn bits(mut world: World) -> impl Iterator<Item = Vec<u8>> {
    let mut begun = false;
    std::iter::from_fn(move || {
        if std::mem::replace(&mut begun, true) {
            world.step().ok()?;
        }
        Some(
            world
                .points()
                .flatten()
                .flat_map(|coordinate| coordinate.to_bits().to_le_bytes())
                .collect(),
        )
    })
}

/// A robot of EvoGym's own materials on a terrain.
#[derive(Deserialize)]
pub struct TerrainReference {
    body: Vec<Vec<u8>>,
    pub control_steps: u64,
    phase: f64,
    pub ended_at: i64,
    pub com: Vec<[f64; 2]>,
    pub points: BTreeMap<u64, Vec<[f64; 2]>>,
    pub spread_voxels_elsewhere: f64,
    pub first_step_beyond_1e_9: i64,
    terrain_objects: Vec<FixedObject>,
    pub start_column: i64,
    start_row: u32,
}

#[derive(Deserialize)]
struct FixedObject {
    column: u32,
    row: u32,
    grid: Vec<String>,
}

impl TerrainReference {
    /// At its beginning.
    pub fn world(&self) -> World {
        let physics = Physics::default();
        // EvoGym's 3 and 4 are actuators.
        let codes = Grid::from_rows(self.body.clone()).unwrap();
        let ours = |&code: &u8| Material::from_code(if code > 2 { code + 4 } else { code });
        let body = Body::new(codes.map(|code| ours(code).unwrap())).unwrap();
        let object = |object: &FixedObject| {
            let cells = |row: &String| row.chars().map(|cell| cell == '5').collect();
            TerrainObject {
                column: object.column,
                row: object.row,
                cells: Grid::from_rows(object.grid.iter().map(cells).collect()).unwrap(),
            }
        };
        let objects: Vec<TerrainObject> = self.terrain_objects.iter().map(object).collect();
        let terrain = Terrain::new(&objects, physics.cell_size).unwrap();
        let start = Start {
            column: self.start_column,
            row: self.start_row,
        };
        World::on_terrain(System::new(&body, physics), start, terrain).unwrap()
    }

    /// Simulates the next control step of its open-loop controller.
    pub fn step(&self, world: &mut World) -> Result<(), Unstable> {
        let actuators = self.body.iter().flatten().filter(|code| **code > 2).count();
        let turn = TAU * world.control_step() as f64 / 25.0;
        let target = |k: usize| 1.1 + 0.5 * (turn + self.phase * k as f64).sin();
        let targets: Vec<f64> = (0..actuators).map(target).collect();
        world.set_targets(&targets).unwrap();
        world.step()
    }
}

/// All runs on terrain, by name.
pub fn terrain_references() -> Vec<(String, TerrainReference)> {
    let names = names(&folder().join("terrain"));
    let read = |name: String| {
        let reference = golden(&format!("terrain/{name}"));
        (name, reference)
    };
    let all: Vec<_> = names.into_iter().map(read).collect();
    assert_eq!(all.len(), 39);
    all
}
