//! Synthetic runs for tests.

use crate::base::random::{Purpose, stream};
use crate::config::{BUILT_IN, Config};
use crate::genome::Genome;
use crate::qd::Archive;
use crate::store::images::{DatasetRef, ImageRef};
use crate::store::run::{Robot, RunFile};

/// Creates a quick-start run with robots of these ids and objectives, each in its own cell.
pub(crate) fn run(robots: &[(&str, f64)]) -> RunFile {
    let config = Config::parse(BUILT_IN[0].1, BUILT_IN[0].0, &[]).unwrap();
    let image = |label| ImageRef {
        index: usize::from(label),
        label,
    };
    let robot = |(number, (id, objective)): (usize, &(&str, f64))| {
        let rng = &mut stream(1, Purpose::RandomImmigrant, 0, number as u64);
        let (genome, body) = Genome::random(config.body_spec(), &config.genome, rng).unwrap();
        Robot {
            id: id.to_string(),
            cell: vec![number % 7, number / 7, 6],
            task: "0|1".to_string(),
            objective: *objective,
            displacements: vec![*objective, -*objective],
            voxels: body.counts(),
            generation: 0,
            parent: None,
            body,
            genome,
        }
    };
    let dataset = DatasetRef {
        name: "builtin".to_string(),
        train_sha256: "0".to_string(),
    };
    let data = (&dataset, vec![image(0), image(1)]);
    let elites = robots.iter().enumerate().map(robot).collect();
    let run = RunFile::new("sample", &config, data, 1, &Archive::new()).unwrap();
    let run = RunFile {
        elites,
        program_version: "0".to_string(),
        ..run
    };
    let stats = |archive: Archive<Robot>| {
        archive.stats(run.dimensions.possible_cells, run.config.archive.qd_offset)
    };
    // Some tests need robots that no archive can hold.
    let stats = run.archive().map_or(run.stats, stats);
    RunFile { stats, ..run }
}
