//! [`Catalogue`]: the robots that can be watched: published ones, and those of archives.

use crate::analysis::gallery;
use crate::base::error::Error;
use crate::body::{Body, VoxelCounts};
use crate::config::Config;
use crate::serve::judge::Judge;
use crate::serve::refusal::Refusal;
use crate::store::audit::AuditFile;
use crate::store::images::DatasetRef;
use crate::store::names::AUDIT_JSON;
use crate::store::run::{Robot, RunFile};
use crate::task::direction::Assignment;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Robots from one source, all with the same config.
pub struct Collection {
    /// What it is called.
    pub name: String,
    /// Where it is from; none: built in.
    pub path: Option<PathBuf>,
    /// How its robots were evolved.
    pub config: Config,
    /// On which data; none: published ones.
    pub dataset: Option<DatasetRef>,
    /// Generations of the run.
    pub generations: Option<u64>,
    /// Bins of the archive's dimensions muscle, sensor and total.
    pub bins: Vec<usize>,
    /// Names of the tasks.
    pub tasks: Vec<String>,
    /// The robots, fittest first.
    pub robots: Vec<Entry>,
}

/// A robot that can be watched.
#[derive(Clone, Debug, Serialize)]
pub struct Entry {
    /// Its id or name.
    pub id: String,
    /// Its task, as "0|123".
    pub task: String,
    /// Its fitness on the training images, as its run measured it.
    pub fitness: f64,
    /// Its voxels by kind.
    pub voxels: VoxelCounts,
    /// Its cell in the archive; none of a published robot.
    pub cell: Vec<usize>,
    /// Generation it was born in.
    pub generation: Option<u64>,
    /// What its walks say; none if all classes walk the same way.
    pub judge: Option<Judge>,
    /// What an audit found, if one is beside the archive.
    pub audit: Option<Audited>,
    /// Its body.
    pub body: Body,
}

/// What an audit found.
#[derive(Clone, Debug, Serialize)]
pub struct Audited {
    /// The verdict in a word or two.
    pub verdict: &'static str,
    /// Verdict and reason.
    pub conclusion: String,
}

/// A collection without its robots, for the list of collections.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Its number, from 0.
    pub index: usize,
    /// What it is called.
    pub name: String,
    /// Where it is from; none: built in.
    pub path: Option<String>,
    /// Number of its robots.
    pub robots: usize,
    /// Names of the tasks.
    pub tasks: Vec<String>,
    /// The dataset its robots were evolved on.
    pub dataset: String,
    /// Generations of the run.
    pub generations: Option<u64>,
    /// Largest fitness.
    pub best: Option<f64>,
}

/// All that can be watched; the gallery comes first.
pub struct Catalogue {
    collections: Vec<Collection>,
}

impl Catalogue {
    /// Reads the archives, and the audits beside them; an audit that cannot be used is told in a
    /// note.
    ///
    /// # Errors
    /// What is wrong with an archive.
    pub fn open(archives: &[PathBuf]) -> Result<(Self, Vec<String>), Error> {
        let mut notes = Vec::new();
        let mut collections = vec![published()?];
        for path in archives {
            collections.push(archive(path, &mut notes)?);
        }
        Ok((Catalogue { collections }, notes))
    }

    /// All collections in short.
    pub fn list(&self) -> Vec<Summary> {
        let short = |(index, from): (usize, &Collection)| Summary {
            index,
            name: from.name.clone(),
            path: from.path.as_ref().map(|path| path.display().to_string()),
            robots: from.robots.len(),
            tasks: from.tasks.clone(),
            dataset: from.config.data.dataset.clone(),
            generations: from.generations,
            best: from.robots.first().map(|robot| robot.fitness),
        };
        self.collections.iter().enumerate().map(short).collect()
    }

    /// The collections.
    pub fn collections(&self) -> &[Collection] {
        &self.collections
    }

    /// A collection by its number.
    ///
    /// # Errors
    /// If there is none.
    pub fn collection(&self, index: usize) -> Result<&Collection, Refusal> {
        let unknown =
            || Refusal::Unknown(format!("there is no archive {index}: there are {}", self.collections.len()));
        self.collections.get(index).ok_or_else(unknown)
    }
}

impl Collection {
    /// A robot by its id.
    ///
    /// # Errors
    /// If there is none.
    pub fn robot(&self, id: &str) -> Result<&Entry, Refusal> {
        let found = self.robots.iter().find(|robot| robot.id == id);
        found.ok_or_else(|| Refusal::Unknown(format!("{}: there is no robot {id:?}", self.name)))
    }
}

fn published() -> Result<Collection, Error> {
    let config = gallery::config()?;
    let grouping = config.grouping()?;
    let tasks: Vec<String> = grouping.tasks().iter().map(|split| split.name()).collect();
    let entry = |robot: gallery::Published| Entry {
        id: robot.name,
        task: tasks.first().expect("the published robots perform a task").clone(),
        fitness: robot.fitness,
        voxels: robot.body.counts(),
        cell: Vec::new(),
        generation: None,
        judge: grouping
            .tasks()
            .first()
            .and_then(|split| Judge::of(split, Assignment { a: robot.zero_walks })),
        audit: None,
        body: robot.body,
    };
    let mut robots: Vec<Entry> = gallery::gallery()?.into_iter().map(entry).collect();
    robots.sort_by(|a, b| b.fitness.total_cmp(&a.fitness));
    let name = "Published with the paper".to_string();
    Ok(Collection {
        name,
        path: None,
        config,
        dataset: None,
        generations: None,
        bins: Vec::new(),
        tasks,
        robots,
    })
}

fn archive(path: &Path, notes: &mut Vec<String>) -> Result<Collection, Error> {
    let run = RunFile::read(path)?;
    let beside = path.with_file_name(AUDIT_JSON);
    let audit = match beside.exists() {
        true => AuditFile::of_run(&run, &beside).map_err(|error| notes.push(error.message)).ok(),
        false => None,
    };
    let grouping = run.config.grouping()?;
    let judge = |robot: &Robot| {
        let split = grouping.tasks().iter().find(|split| split.name() == robot.task)?;
        Judge::of(split, Assignment::from_training(split, run.fitness(), &run.answers(robot)))
    };
    let audited = |robot: &Robot| {
        let found = audit.as_ref()?.robot(&robot.id)?;
        Some(Audited { verdict: found.verdict.name(), conclusion: found.conclusion() })
    };
    let entry = |robot: &Robot| Entry {
        id: robot.id.clone(),
        task: robot.task.clone(),
        fitness: robot.objective,
        voxels: robot.voxels,
        cell: robot.cell.clone(),
        generation: Some(robot.generation),
        judge: judge(robot),
        audit: audited(robot),
        body: robot.body.clone(),
    };
    let mut robots: Vec<Entry> = run.elites.iter().map(entry).collect();
    robots.sort_by(|a, b| b.fitness.total_cmp(&a.fitness));
    Ok(Collection {
        name: format!("{}, seed {}", run.name, run.config.seed),
        path: Some(path.to_path_buf()),
        generations: Some(run.generations),
        bins: run.dimensions.bins.iter().take(3).copied().collect(),
        tasks: run.dimensions.tasks.clone(),
        dataset: Some(run.dataset),
        config: run.config,
        robots,
    })
}
