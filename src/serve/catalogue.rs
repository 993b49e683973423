//! [`Catalogue`]: the robots that can be watched: published ones, and those of archives.

use crate::analysis::gallery;
use crate::base::error::Error;
use crate::base::shipped;
use crate::body::{Body, VoxelCounts};
use crate::config::Config;
use crate::serve::course::Course;
use crate::serve::refusal::Refusal;
use crate::sim::Physics;
use crate::store::audit::AuditFile;
use crate::store::images::DatasetRef;
use crate::store::names::RUN_JSON;
use crate::store::run::{Robot, RunFile};
use crate::task::judge::Judge;
use crate::task::protocol::Protocol;
use crate::task::stimulus::StimulusParams;
use serde::Serialize;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

/// Robots from one source. They live in the same world; robots that ship together may look at
/// different windows of an image.
pub struct Collection {
    /// What it is called.
    pub name: String,
    /// Where it is from; none: built in.
    pub path: Option<PathBuf>,
    /// How its robots were evolved, but for how each sees.
    pub config: Config,
    /// On which data; none: published ones.
    pub dataset: Option<DatasetRef>,
    /// Generations of the run that are done.
    pub generations: Option<u64>,
    /// Bins of the archive's dimensions muscle, sensor and total.
    pub bins: Vec<usize>,
    /// Names of the tasks.
    pub tasks: Vec<String>,
    /// The robots, fittest first.
    pub robots: Vec<Entry>,
    /// Robots that were in the archive when it was read before, the last of them: a page may still
    /// list them.
    pub gone: Vec<Entry>,
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
    /// How it sees.
    pub encoding: StimulusParams,
    /// What its walks say; none if all classes walk the same way.
    pub judge: Option<Judge>,
    /// What an audit found, if one is beside the archive.
    pub audit: Option<Audited>,
    /// Its body.
    pub body: Body,
}

/// Which body, with all that its simulation depends on.
#[derive(Clone, Debug)]
pub struct Who {
    /// The body.
    pub body: Body,
    /// The constants of its world.
    pub physics: Physics,
    /// Where it starts, and how long it sees an image.
    pub protocol: Protocol,
    /// How it sees.
    pub encoding: StimulusParams,
    /// What its walks say; none of a body without a task.
    pub judge: Option<Judge>,
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
    /// Generations of the run that are done.
    pub generations: Option<u64>,
    /// Generations that it was asked for.
    pub asked: Option<u64>,
    /// How often it has changed since it was read first.
    pub changes: u64,
    /// Largest fitness.
    pub best: Option<f64>,
}

/// An archive whose file is looked at again and again.
struct Watched {
    path: PathBuf,
    /// Of the run, and of the audit beside it.
    stamps: [Option<Stamp>; 2],
    changes: u64,
    collection: Arc<Collection>,
}

/// By what a file that was written anew is known: when, and how long it is.
type Stamp = (SystemTime, u64);

fn stamp(path: &Path) -> Option<Stamp> {
    let about = path.metadata().ok()?;
    Some((about.modified().ok()?, about.len()))
}

/// Of a run and of the verdicts on it.
fn stamps(run_json: &Path) -> [Option<Stamp>; 2] {
    [stamp(run_json), stamp(&AuditFile::path(run_json))]
}

/// Most robots that are known though they are in their archive no more.
const MOST_GONE: usize = 1000;

/// How often files are looked at, however often the page asks.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// All that can be watched; what is built in comes first, and of that the trained robots. Archives
/// are read anew when they have changed, and runs that begin or go on meanwhile are added.
pub struct Catalogue {
    built_in: Vec<Arc<Collection>>,
    archives: Mutex<Archives>,
    /// Where new runs appear.
    runs: PathBuf,
    opened: SystemTime,
}

struct Archives {
    watched: Vec<Watched>,
    looked: Option<Instant>,
}

impl Catalogue {
    /// Reads the archives, and the audits beside them; an audit that cannot be used is told in a
    /// note, and so is a `newest` run that nobody has named. `runs` is the folder whose runs are added
    /// when they change.
    ///
    /// # Errors
    /// What is wrong with an archive.
    pub fn open(
        archives: &[PathBuf],
        newest: Option<&Path>,
        runs: &Path,
    ) -> Result<(Self, Vec<String>), Error> {
        let mut notes = Vec::new();
        let zero_one = trained(shipped::ZERO_ONE, "Trained on thousands of images")?;
        let team = trained(shipped::TEAM, "Ten digits: a robot for each pair")?;
        let built_in = [zero_one, published()?, team].map(Arc::new).to_vec();
        let opened = SystemTime::now();
        let mut watched = Vec::new();
        for path in archives {
            watched.push(Watched::read(path, &mut notes)?);
        }
        if let Some(path) = newest {
            match Watched::read(path, &mut notes) {
                Ok(newest) => watched.push(newest),
                Err(error) => notes.push(format!("{error}; left out")),
            }
        }
        let archives = Mutex::new(Archives { watched, looked: None });
        Ok((Catalogue { built_in, archives, runs: runs.to_path_buf(), opened }, notes))
    }

    /// The archives as they are now.
    fn archives(&self) -> MutexGuard<'_, Archives> {
        let mut archives = self.archives.lock().unwrap_or_else(PoisonError::into_inner);
        if archives.looked.is_none_or(|looked| looked.elapsed() >= LOOK_EVERY) {
            archives.watched.iter_mut().for_each(Watched::look);
            for path in self.begun() {
                if archives.watched.iter().all(|watched| !is_same(&watched.path, &path)) {
                    // One that cannot be read, perhaps not yet, is no reason to stop.
                    archives.watched.extend(Watched::read(&path, &mut Vec::new()));
                }
            }
            archives.looked = Some(Instant::now());
        }
        archives
    }

    /// Runs that were written since the page was opened, by name.
    fn begun(&self) -> Vec<PathBuf> {
        let folders = std::fs::read_dir(&self.runs).into_iter().flatten().flatten();
        let files = folders.map(|folder| folder.path().join(RUN_JSON));
        let is_new = |path: &PathBuf| stamp(path).is_some_and(|(modified, _)| modified >= self.opened);
        let mut begun: Vec<PathBuf> = files.filter(is_new).collect();
        begun.sort();
        begun
    }

    /// All collections in short.
    pub fn list(&self) -> Vec<Summary> {
        let short = |(from, asked, changes): (&Collection, Option<u64>, u64)| Summary {
            index: 0,
            name: from.name.clone(),
            path: from.path.as_ref().map(|path| path.display().to_string()),
            robots: from.robots.len(),
            tasks: from.tasks.clone(),
            dataset: from.config.data.dataset.clone(),
            generations: from.generations,
            asked,
            changes,
            best: from.robots.first().map(|robot| robot.fitness),
        };
        let archives = self.archives();
        let built_in = self.built_in.iter().map(|from| (&**from, None, 0));
        let read = archives.watched.iter().map(|Watched { collection, changes, .. }| {
            (&**collection, Some(collection.config.generations), *changes)
        });
        let list = built_in.chain(read).map(short).enumerate();
        list.map(|(index, summary)| Summary { index, ..summary }).collect()
    }

    /// The collections.
    pub fn collections(&self) -> Vec<Arc<Collection>> {
        let archives = self.archives();
        self.built_in
            .iter()
            .chain(archives.watched.iter().map(|watched| &watched.collection))
            .cloned()
            .collect()
    }

    /// A collection by its number.
    ///
    /// # Errors
    /// If there is none.
    pub fn collection(&self, index: usize) -> Result<Arc<Collection>, Refusal> {
        let collections = self.collections();
        let unknown =
            || Refusal::Unknown(format!("there is no archive {index}: there are {}", collections.len()));
        collections.get(index).cloned().ok_or_else(unknown)
    }

    /// How the run of a collection went so far.
    ///
    /// # Errors
    /// If there is no such run, or its `metrics.csv` cannot be read.
    pub fn course(&self, index: usize) -> Result<Course, Refusal> {
        let collection = self.collection(index)?;
        let Some(path) = &collection.path else {
            return Err(Refusal::Unknown(format!("{}: it is no run", collection.name)));
        };
        Course::of(path, collection.config.generations).map_err(|error| Refusal::Unknown(error.message))
    }
}

/// Whether two paths name one file.
fn is_same(a: &Path, b: &Path) -> bool {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    a == b || real(a) == real(b)
}

impl Watched {
    fn read(path: &Path, notes: &mut Vec<String>) -> Result<Self, Error> {
        let stamps = stamps(path);
        let collection = Arc::new(archive(path, notes)?);
        Ok(Watched { path: path.to_path_buf(), stamps, changes: 0, collection })
    }

    /// Reads it anew if it has changed; one that cannot be read, perhaps for the moment, stays as it
    /// was.
    fn look(&mut self) {
        let now = stamps(&self.path);
        if now != self.stamps
            && let Ok(collection) = archive(&self.path, &mut Vec::new())
        {
            let Collection { robots, gone, .. } = &*self.collection;
            let mut known: HashSet<&str> = collection.robots.iter().map(|robot| robot.id.as_str()).collect();
            let gone = robots.iter().chain(gone).filter(|robot| known.insert(&robot.id));
            let gone = gone.take(MOST_GONE).cloned().collect();
            (self.stamps, self.collection) = (now, Arc::new(Collection { gone, ..collection }));
            self.changes += 1;
        }
    }
}

impl Collection {
    /// A robot by its id.
    ///
    /// # Errors
    /// If there is none.
    pub fn robot(&self, id: &str) -> Result<&Entry, Refusal> {
        let found = self.robots.iter().chain(&self.gone).find(|robot| robot.id == id);
        found.ok_or_else(|| Refusal::Unknown(format!("{}: there is no robot {id:?}", self.name)))
    }

    /// A robot by its id, with all that its simulation depends on.
    ///
    /// # Errors
    /// If there is none.
    pub fn who(&self, id: &str) -> Result<Who, Refusal> {
        let (robot, config) = (self.robot(id)?, &self.config);
        Ok(Who {
            body: robot.body.clone(),
            physics: config.physics.clone(),
            protocol: config.protocol.clone(),
            encoding: robot.encoding,
            judge: robot.judge.clone(),
        })
    }
}

fn fittest_first(robots: &mut [Entry]) {
    robots.sort_by(|a, b| b.fitness.total_cmp(&a.fitness));
}

fn published() -> Result<Collection, Error> {
    let config = gallery::config()?;
    let grouping = config.grouping()?;
    let tasks: Vec<String> = grouping.tasks().iter().map(|split| split.name()).collect();
    let entry = |robot: gallery::Published| Entry {
        judge: Some(robot.judge()),
        id: robot.name,
        task: tasks.first().expect("the published robots perform a task").clone(),
        fitness: robot.fitness,
        voxels: robot.body.counts(),
        cell: Vec::new(),
        generation: None,
        encoding: config.stimulus,
        audit: None,
        body: robot.body,
    };
    let mut robots: Vec<Entry> = gallery::gallery()?.into_iter().map(entry).collect();
    fittest_first(&mut robots);
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
        gone: Vec::new(),
    })
}

/// The robots of a set that ships with the program. All walk in the same world (which a test
/// holds).
fn trained(set: &str, name: &str) -> Result<Collection, Error> {
    let mut all = Vec::new();
    for (run, audit) in gallery::trained(set)? {
        all.push(of_run(run, Some(&audit))?);
    }
    let mut robots: Vec<Entry> = all.iter_mut().flat_map(|one| std::mem::take(&mut one.robots)).collect();
    fittest_first(&mut robots);
    let mut tasks: Vec<String> = all.iter().flat_map(|one| one.tasks.clone()).collect();
    tasks.dedup();
    let first = all.swap_remove(0);
    let name = name.to_string();
    // Cells are of one run.
    Ok(Collection { name, generations: None, dataset: None, bins: Vec::new(), tasks, robots, ..first })
}

fn archive(path: &Path, notes: &mut Vec<String>) -> Result<Collection, Error> {
    let run = RunFile::read(path)?;
    let audit = AuditFile::if_any(&run, path).unwrap_or_else(|error| {
        notes.push(error.message);
        None
    });
    Ok(Collection { path: Some(path.to_path_buf()), ..of_run(run, audit.as_ref())? })
}

fn of_run(run: RunFile, audit: Option<&AuditFile>) -> Result<Collection, Error> {
    let audited = |robot: &Robot| {
        let found = audit?.robot(&robot.id)?;
        Some(Audited { verdict: found.verdict.name(), conclusion: found.conclusion() })
    };
    let entry = |robot: &Robot| Entry {
        id: robot.id.clone(),
        task: robot.task.clone(),
        fitness: robot.objective,
        voxels: robot.voxels,
        cell: robot.cell.clone(),
        generation: Some(robot.generation),
        encoding: run.config.stimulus,
        judge: run.judge(robot),
        audit: audited(robot),
        body: robot.body.clone(),
    };
    let mut robots: Vec<Entry> = run.elites.iter().map(entry).collect();
    fittest_first(&mut robots);
    Ok(Collection {
        name: format!("{}, seed {}", run.name, run.config.seed),
        path: None,
        generations: Some(run.generations),
        bins: run.dimensions.bins.iter().take(3).copied().collect(),
        tasks: run.dimensions.tasks.clone(),
        dataset: Some(run.dataset),
        config: run.config,
        robots,
        gone: Vec::new(),
    })
}
