//! `morphcog gallery`: the zero-one robots published by the paper's authors, and robots trained
//! here.

use crate::base::error::Error;
use crate::base::remedy::{Invocation, Remedy};
use crate::body::Body;
use crate::config::{BUILT_IN, Config};
use crate::data::catalogue;
use crate::genome::Genome;
use crate::qd::Archive;
use crate::robots::selection::Selection;
use crate::shipped::gallery;
use crate::store::audit::AuditFile;
use crate::store::images::{DatasetRef, ImageRef};
use crate::store::names::{AUDIT_JSON, RUN_JSON};
use crate::store::run::{Robot, RunFile};
use crate::task::answer::Direction;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Config under which the published robots were evolved.
const CONFIG: &str = "zero_one_published.toml";

pub(crate) const ALL: &str = "gallery";

pub(crate) const TEXT: &str = include_str!("../../data/gallery.json");

/// Reads the runs of a shipped set that is audited, such as [`gallery::ZERO_ONE`], and the audits.
///
/// # Errors
/// Returns an error if there is no such set, or if it is damaged (which a test excludes).
pub fn trained(set: &str) -> Result<Vec<(RunFile, AuditFile)>, Error> {
    let paths = gallery::runs(set).map_err(Error::other)?;
    let read = |path: &PathBuf| {
        Ok((
            RunFile::read(path)?,
            AuditFile::read(&path.with_file_name(AUDIT_JSON))?,
        ))
    };
    paths.iter().map(read).collect()
}

/// A published robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Published {
    /// Its name, as published.
    pub name: String,
    /// Its published fitness \[voxel lengths\].
    pub fitness: f64,
    /// Direction in which it walks under a zero; under a one it walks the other way.
    pub zero_walks: Direction,
    /// Its body.
    pub body: Body,
}

/// Returns all published robots.
///
/// # Errors
/// Returns an error if the built-in list is damaged (which a test excludes).
pub fn gallery() -> Result<Vec<Published>, Error> {
    #[derive(Deserialize)]
    struct Entry {
        name: String,
        published_fitness: f64,
        zero_walks: String,
        body: String,
    }
    let entries: Vec<Entry> = crate::config::reading::read_json_list(TEXT, "gallery.json")?;
    let robot = |Entry {
                     name,
                     published_fitness,
                     zero_walks,
                     body,
                 }: Entry| {
        let body = body
            .parse()
            .map_err(|error| Error::other(format!("gallery.json: {name}: {error}")))?;
        let zero_walks = if zero_walks == "left" {
            Direction::Left
        } else {
            Direction::Right
        };
        Ok(Published {
            name,
            fitness: published_fitness,
            zero_walks,
            body,
        })
    };
    entries.into_iter().map(robot).collect()
}

/// Finds a published robot by name, ignoring case.
///
/// # Errors
/// As [`gallery()`].
pub fn find(name: &str) -> Result<Option<Published>, Error> {
    Ok(gallery()?
        .into_iter()
        .find(|robot| robot.name.eq_ignore_ascii_case(name)))
}

/// Returns the config under which the published robots were evolved.
///
/// # Errors
/// Returns an error if the built-in config is damaged (which a test excludes).
pub fn config() -> Result<Config, Error> {
    let text = BUILT_IN
        .iter()
        .find(|(name, _)| *name == CONFIG)
        .map_or("", |(_, text)| text);
    Config::parse(text, CONFIG, &[])
}

/// True if a selection without an archive names published robots, one by one or as "gallery".
pub(crate) fn is_meant(selection: &Selection) -> Result<bool, Error> {
    let Selection::Ids(ids) = selection else {
        return Ok(false);
    };
    if matches!(ids.as_slice(), [word] if word == ALL) {
        return Ok(true);
    }
    let published: Result<Vec<bool>, Error> =
        ids.iter().map(|id| Ok(find(id)?.is_some())).collect();
    let published = published?;
    match published
        .iter()
        .zip(ids)
        .find(|(is_published, _)| !**is_published)
    {
        Some((_, other)) if published.contains(&true) => {
            let text = format!("there is no published robot {other}");
            Err(Error::input(text).remedy(Remedy::Run(Invocation::new("gallery"), "lists them")))
        }
        other => Ok(other.is_none()),
    }
}

/// Describes the origin of robots: the name and seed of their run, or that they were published.
pub(crate) fn provenance(run: &str, seed: u64) -> String {
    match run == ALL {
        true => "published with the paper".to_string(),
        false => format!("{run}, seed {seed}"),
    }
}

pub(crate) fn archive() -> PathBuf {
    Path::new(gallery::PUBLISHED).join(RUN_JSON)
}

/// Builds a run of the published robots. Their genomes were not published, so each has the empty
/// one, and plus or minus its fitness as displacements.
pub(crate) fn run() -> Result<RunFile, Error> {
    let config = config()?;
    let indices = config.data.train_images.iter().flatten();
    let training_images = indices
        .zip(config.classes())
        .map(|(&index, label)| ImageRef { index, label })
        .collect();
    let robot = |(number, robot): (usize, Published)| {
        let (left, right) = (-robot.fitness, robot.fitness);
        let displacements = match robot.zero_walks {
            Direction::Left => vec![left, right],
            Direction::Right => vec![right, left],
        };
        Robot {
            id: robot.name,
            cell: vec![number],
            task: "0|1".to_string(),
            objective: robot.fitness,
            displacements,
            voxels: robot.body.counts(),
            generation: 0,
            parent: None,
            body: robot.body,
            genome: Genome::initial(),
        }
    };
    let train_sha256 = catalogue::MNIST_CONTENT[0].to_string();
    let dataset = DatasetRef {
        name: config.data.dataset.clone(),
        train_sha256,
    };
    let (data, none) = ((&dataset, training_images), Archive::new());
    let elites = gallery()?.into_iter().enumerate().map(robot).collect();
    // They fill no archive: several may be in one cell.
    let stats = none.stats(1, 0.0);
    Ok(RunFile {
        elites,
        stats,
        ..RunFile::new(ALL, &config, data, config.generations, &none)?
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::margins::Margins;
    use crate::task::stimulus::StimulusParams;
    use std::collections::BTreeSet;

    #[test]
    fn the_gallery_holds_the_five_published_zero_one_robots() {
        let robots = gallery().unwrap();
        let names: Vec<&str> = robots.iter().map(|robot| robot.name.as_str()).collect();
        assert_eq!(names, ["APUKI", "IHSUJ", "QMAXD", "XFJPI", "YJTLA"]);
        assert!(
            robots
                .iter()
                .all(|r| (r.body.height(), r.body.width()) == (14, 14) && r.body.is_valid(3))
        );
        assert_eq!(find("xfjpi").unwrap().unwrap().fitness, 17.316384958834874);
        assert_eq!(find("nobody").unwrap(), None);
        assert_eq!(config().unwrap().classes(), [0, 1]);
    }

    #[test]
    fn the_trained_robots_are_physical_and_live_in_one_world_and_see_alike_but_for_their_windows() {
        for (set, pairs) in [(gallery::ZERO_ONE, 1), (gallery::TEAM, 45)] {
            let trained = trained(set).unwrap();
            let like = |run: &RunFile| {
                let Config {
                    stimulus,
                    protocol,
                    physics,
                    ..
                } = &run.config;
                let stimulus = StimulusParams {
                    margin: Margins::default(),
                    ..*stimulus
                };
                let world = (stimulus, protocol.clone(), physics.clone());
                (run.config.body_spec(), world, run.dataset.clone())
            };
            for (run, audit) in &trained {
                assert_eq!(like(run), like(&trained[0].0));
                assert_eq!(audit.run_sha256, run.fingerprint());
                assert!(
                    run.elites
                        .iter()
                        .all(|robot| audit.robot(&robot.id).unwrap().is_physical())
                );
            }
            let tasks: BTreeSet<Vec<u8>> = trained
                .iter()
                .map(|(run, _)| run.config.classes())
                .collect();
            assert_eq!(tasks.len(), pairs, "{set}");
        }
    }
}
