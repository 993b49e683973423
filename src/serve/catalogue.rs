//! [`RobotCatalogue`]: the robots that the page offers, published ones and those of archives.

use crate::base::error::Error;
use crate::body::{Body, VoxelCounts};
use crate::config::Config;
use crate::data::gates::Gates;
use crate::draw::plot::cells::CellMap;
use crate::robots::published;
use crate::search::held_out_run::task_of;
use crate::serve::course::Course;
use crate::serve::refusal::HttpRefusal;
use crate::shipped::gallery;
use crate::shipped::read_text;
use crate::sim::Physics;
use crate::store::audit::AuditFile;
use crate::store::images::DatasetRef;
use crate::store::names::RUN_JSON;
use crate::store::run::{Robot, RunFile};
use crate::task::answer::Readout;
use crate::task::class_names::ClassNames;
use crate::task::gates::gate;
use crate::task::protocol::Protocol;
use crate::task::stimulus::StimulusParams;
use serde::Serialize;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::{Duration, Instant, SystemTime};

/// Robots from one source. They share a world; robots that ship together may have different
/// windows.
pub(crate) struct Collection {
    pub(crate) name: String,
    /// The path of the run.json; `None` if it is built in.
    pub(crate) path: Option<PathBuf>,
    /// The configuration of the run, except each robot's stimulus.
    pub(crate) config: Config,
    /// The dataset of the run; `None` for published robots.
    pub(crate) dataset: Option<DatasetRef>,
    pub(crate) generations: Option<u64>,
    /// The cells of the archive; `None` if the robots are not those of one archive.
    pub(crate) map: Option<CellMap>,
    pub(crate) tasks: Vec<String>,
    /// The robots, fittest first.
    pub(crate) robots: Vec<Entry>,
    /// Robots that have left the archive, most recent first: a page may still list them.
    pub(crate) gone: Vec<Entry>,
}

/// A robot that the page can simulate.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Entry {
    pub(crate) id: String,
    /// The task, such as "0|123".
    pub(crate) task: String,
    /// The name of the logic gate that the task is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) gate: Option<String>,
    /// The fitness on the training images, as measured by its run.
    pub(crate) fitness: f64,
    pub(crate) voxels: VoxelCounts,
    /// The cell in the archive; empty for a published robot.
    pub(crate) cell: Vec<usize>,
    pub(crate) generation: Option<u64>,
    pub(crate) encoding: StimulusParams,
    /// The judge of its walks; `None` if all classes walk the same way.
    pub(crate) judge: Option<Readout>,
    /// The result of an audit, if one is beside the archive.
    pub(crate) audit: Option<Audited>,
    pub(crate) body: Body,
}

/// A body with everything that its simulation depends on.
#[derive(Clone, Debug)]
pub(crate) struct Who {
    pub(crate) body: Body,
    pub(crate) physics: Physics,
    /// Its start, and the duration of an image.
    pub(crate) protocol: Protocol,
    pub(crate) encoding: StimulusParams,
    /// The judge of its walks; `None` for a body without a task.
    pub(crate) judge: Option<Readout>,
    /// Names of the classes.
    pub(crate) names: ClassNames,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Audited {
    pub(crate) verdict: &'static str,
    pub(crate) conclusion: String,
}

/// A collection without its robots, for the list of collections.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct CollectionSummary {
    /// The number of the collection, from 0.
    pub(crate) index: usize,
    pub(crate) name: String,
    /// The path of the run.json; `None` if it is built in.
    pub(crate) path: Option<String>,
    /// True if the user named it when the page was opened: the page begins with the first of them.
    pub(crate) chosen: bool,
    pub(crate) robots: usize,
    pub(crate) tasks: Vec<String>,
    pub(crate) dataset: String,
    pub(crate) generations: Option<u64>,
    /// The number of generations requested.
    pub(crate) asked: Option<u64>,
    /// The number of changes since the archive was first read.
    pub(crate) changes: u64,
    pub(crate) best: Option<f64>,
}

/// An archive whose files are polled for changes.
struct Watched {
    path: PathBuf,
    /// The stamps of the files at the last reading.
    stamps: Stamps,
    known: Known,
}

/// An archive as of the last reading.
#[derive(Clone)]
struct Known {
    collection: Arc<Collection>,
    /// True if the user named it.
    chosen: bool,
    changes: u64,
}

/// Identifies a version of a file: its modification time and length.
type Stamp = (SystemTime, u64);

type Stamps = [Option<Stamp>; 2];

/// Returns the stamp of a file, or `None` if there is no such file.
fn stamp(path: &Path) -> Option<Stamp> {
    let about = path.metadata().ok().filter(|about| about.is_file())?;
    Some((about.modified().ok()?, about.len()))
}

fn stamps(run_json: &Path) -> Stamps {
    [stamp(run_json), stamp(&AuditFile::path(run_json))]
}

/// Maximum number of remembered robots that have left their archive.
const MOST_GONE: usize = 1000;

/// Minimum time between polls of the files, however often the page asks.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// All collections: the built-in ones first, led by the trained robots, then archives. Archives are
/// reloaded when they change, and runs that begin or continue meanwhile are added.
pub(crate) struct RobotCatalogue {
    built_in: Vec<Arc<Collection>>,
    /// The archives as of the last poll; locked only to copy or replace the list.
    known: Mutex<Arc<[Known]>>,
    /// Locked during polls, which may take time; concurrent requests use the last list. `None`
    /// without files to watch.
    watch: Option<Mutex<Watch>>,
}

struct Watch {
    watched: Vec<Watched>,
    /// Their paths, as given and with links resolved.
    paths: HashSet<PathBuf>,
    /// Runs that could not be read at these stamps; they are retried once they change.
    unreadable: HashMap<PathBuf, Stamps>,
    /// The folder where new runs appear.
    runs: PathBuf,
    opened: SystemTime,
    looked: Option<Instant>,
}

impl RobotCatalogue {
    /// Reads the archives, and the audits beside them. An unusable audit becomes a note, and so
    /// does a `newest` run, which nobody named, if it cannot be read. Changed runs in the folder
    /// `runs` are added later.
    pub(crate) fn open(
        archives: &[PathBuf],
        newest: Option<&Path>,
        runs: &Path,
    ) -> Result<(Self, Vec<String>), Error> {
        let (mut notes, built_in) = (Vec::new(), built_in()?);
        let mut watch = Watch {
            watched: Vec::new(),
            paths: HashSet::new(),
            unreadable: HashMap::new(),
            runs: runs.to_path_buf(),
            opened: SystemTime::now(),
            looked: None,
        };
        for path in archives {
            watch.open(path, true, &mut notes)?;
        }
        if let Some(path) = newest
            && let Err(error) = watch.open(path, false, &mut notes)
        {
            notes.push(format!("{error}; left out"));
        }
        Ok((
            RobotCatalogue {
                built_in,
                known: Mutex::new(watch.known()),
                watch: Some(Mutex::new(watch)),
            },
            notes,
        ))
    }

    /// Offers the built-in robots only.
    pub(crate) fn shipped() -> Result<Self, Error> {
        Ok(RobotCatalogue {
            built_in: built_in()?,
            known: Mutex::new(Arc::new([])),
            watch: None,
        })
    }

    /// Returns the current archives, or the last known ones while another request polls.
    fn archives(&self) -> Arc<[Known]> {
        let watch = match self.watch.as_ref().map(Mutex::try_lock) {
            Some(Ok(watch)) => Some(watch),
            Some(Err(TryLockError::Poisoned(watch))) => Some(watch.into_inner()),
            Some(Err(TryLockError::WouldBlock)) | None => None,
        };
        let is_due =
            |watch: &MutexGuard<Watch>| watch.looked.is_none_or(|at| at.elapsed() >= LOOK_EVERY);
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(mut watch) = watch.filter(is_due) {
            watch.look();
            *known() = watch.known();
        }
        Arc::clone(&known())
    }

    pub(crate) fn list(&self) -> Vec<CollectionSummary> {
        let short = |(from, chosen, asked, changes): (&Collection, bool, Option<u64>, u64)| {
            CollectionSummary {
                index: 0,
                name: from.name.clone(),
                path: from.path.as_ref().map(|path| path.display().to_string()),
                chosen,
                robots: from.robots.len(),
                tasks: from.tasks.clone(),
                dataset: from.config.data.dataset.clone(),
                generations: from.generations,
                asked,
                changes,
                best: from.robots.first().map(|robot| robot.fitness),
            }
        };
        let archives = self.archives();
        let built_in = self.built_in.iter().map(|from| (&**from, false, None, 0));
        let read = archives.iter().map(
            |Known {
                 collection,
                 chosen,
                 changes,
             }| {
                (
                    &**collection,
                    *chosen,
                    Some(collection.config.generations),
                    *changes,
                )
            },
        );
        let list = built_in.chain(read).map(short).enumerate();
        list.map(|(index, summary)| CollectionSummary { index, ..summary })
            .collect()
    }

    pub(crate) fn collections(&self) -> Vec<Arc<Collection>> {
        let archives = self.archives();
        self.built_in
            .iter()
            .chain(archives.iter().map(|known| &known.collection))
            .cloned()
            .collect()
    }

    pub(crate) fn collection(&self, index: usize) -> Result<Arc<Collection>, HttpRefusal> {
        let collections = self.collections();
        let unknown = || {
            HttpRefusal::Unknown(format!(
                "there is no archive {index}: there are {}",
                collections.len()
            ))
        };
        collections.get(index).cloned().ok_or_else(unknown)
    }

    pub(crate) fn course(&self, index: usize) -> Result<Course, HttpRefusal> {
        let collection = self.collection(index)?;
        let Some(path) = &collection.path else {
            return Err(HttpRefusal::Unknown(format!(
                "{}: it is no run",
                collection.name
            )));
        };
        Course::of(path, collection.config.generations)
            .map_err(|error| HttpRefusal::Unknown(error.message))
    }
}

/// Resolves the links of a path.
fn real(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}

impl Watch {
    fn open(&mut self, path: &Path, chosen: bool, notes: &mut Vec<String>) -> Result<(), Error> {
        let stamps = stamps(path);
        let collection = archive(RunFile::read(path)?, path, notes)?;
        self.add(path, stamps, collection, chosen);
        Ok(())
    }

    fn add(&mut self, path: &Path, stamps: Stamps, collection: Collection, chosen: bool) {
        self.paths.extend([path.to_path_buf(), real(path)]);
        let known = Known {
            collection: Arc::new(collection),
            chosen,
            changes: 0,
        };
        self.watched.push(Watched {
            path: path.to_path_buf(),
            stamps,
            known,
        });
    }

    fn known(&self) -> Arc<[Known]> {
        self.watched
            .iter()
            .map(|watched| watched.known.clone())
            .collect()
    }

    /// Reloads changed archives, and adds runs that have begun.
    fn look(&mut self) {
        self.watched.iter_mut().for_each(Watched::look);
        for path in self.begun() {
            let now = stamps(&path);
            if self.unreadable.get(&path) == Some(&now) || self.paths.contains(&real(&path)) {
                continue;
            }
            match read(&path) {
                Some(Ok(collection)) => {
                    self.unreadable.remove(&path);
                    self.add(&path, now, collection, false);
                }
                Some(Err(_)) => _ = self.unreadable.insert(path, now),
                None => {}
            }
        }
        self.looked = Some(Instant::now());
    }

    /// Returns unknown runs written since the page was opened, sorted by name.
    fn begun(&self) -> Vec<PathBuf> {
        let folders = std::fs::read_dir(&self.runs)
            .into_iter()
            .flatten()
            .flatten();
        let files = folders.map(|folder| folder.path().join(RUN_JSON));
        let files = files.filter(|path| !self.paths.contains(path));
        let is_new =
            |path: &PathBuf| stamp(path).is_some_and(|(modified, _)| modified >= self.opened);
        let mut begun: Vec<PathBuf> = files.filter(is_new).collect();
        begun.sort();
        begun
    }
}

impl Watched {
    /// Reloads the archive if it has changed; an unreadable one stays as it was.
    fn look(&mut self) {
        let now = stamps(&self.path);
        if now == self.stamps {
            return;
        }
        let Some(read) = read(&self.path) else { return };
        self.stamps = now;
        if let Ok(collection) = read {
            let Collection { robots, gone, .. } = &*self.known.collection;
            let mut known: HashSet<&str> = collection
                .robots
                .iter()
                .map(|robot| robot.id.as_str())
                .collect();
            let gone = robots
                .iter()
                .chain(gone)
                .filter(|robot| known.insert(&robot.id));
            let gone = gone.take(MOST_GONE).cloned().collect();
            self.known.collection = Arc::new(Collection { gone, ..collection });
            self.known.changes += 1;
        }
    }
}

/// Reads an archive that nobody named. An error lasts until the text changes; `None` means that the
/// text is missing, perhaps for the moment.
fn read(path: &Path) -> Option<Result<Collection, Error>> {
    let text = read_text(path).ok()?;
    let run = RunFile::parse(&text, &path.display().to_string());
    Some(run.and_then(|run| archive(run, path, &mut Vec::new())))
}

impl Collection {
    pub(crate) fn robot(&self, id: &str) -> Result<&Entry, HttpRefusal> {
        let found = self
            .robots
            .iter()
            .chain(&self.gone)
            .find(|robot| robot.id == id);
        found
            .ok_or_else(|| HttpRefusal::Unknown(format!("{}: there is no robot {id:?}", self.name)))
    }

    /// Returns a robot by its id, with everything that its simulation depends on.
    pub(crate) fn who(&self, id: &str) -> Result<Who, HttpRefusal> {
        let (robot, config) = (self.robot(id)?, &self.config);
        Ok(Who {
            body: robot.body.clone(),
            physics: config.physics.clone(),
            protocol: config.protocol.clone(),
            encoding: robot.encoding,
            judge: robot.judge.clone(),
            names: self.config.class_names(),
        })
    }
}

/// Returns the robots that ship, the trained ones first.
fn built_in() -> Result<Vec<Arc<Collection>>, Error> {
    let zero_one = trained(gallery::ZERO_ONE, "Trained on thousands of images")?;
    let team = trained(gallery::TEAM, "Ten digits: a robot for each pair")?;
    let gates = trained(gallery::GATES, "Logic gates")?;
    Ok([zero_one, published()?, team, gates].map(Arc::new).to_vec())
}

fn fittest_first(robots: &mut [Entry]) {
    robots.sort_by(|a, b| b.fitness.total_cmp(&a.fitness));
}

fn published() -> Result<Collection, Error> {
    let mut all = of_run(published::run()?, None)?;
    // Nothing is known of how they came about.
    for robot in &mut all.robots {
        robot.cell.clear();
        robot.generation = None;
    }
    Ok(Collection {
        name: "Published with the paper".to_string(),
        dataset: None,
        generations: None,
        map: None,
        ..all
    })
}

/// Loads the robots of a set that ships with the program. They share a world, as a test ensures.
fn trained(set: &str, name: &str) -> Result<Collection, Error> {
    let mut all = Vec::new();
    for (run, audit) in published::trained(set)? {
        all.push(of_run(run, Some(&audit))?);
    }
    let mut robots: Vec<Entry> = all
        .iter_mut()
        .flat_map(|one| std::mem::take(&mut one.robots))
        .collect();
    fittest_first(&mut robots);
    let mut tasks: Vec<String> = all.iter().flat_map(|one| one.tasks.clone()).collect();
    tasks.dedup();
    let first = all.swap_remove(0);
    let name = name.to_string();
    // Cells belong to a single run.
    Ok(Collection {
        name,
        generations: None,
        dataset: None,
        map: None,
        tasks,
        robots,
        ..first
    })
}

fn archive(run: RunFile, path: &Path, notes: &mut Vec<String>) -> Result<Collection, Error> {
    let audit = AuditFile::if_any(&run, path).unwrap_or_else(|error| {
        notes.push(error.message);
        None
    });
    Ok(Collection {
        path: Some(path.to_path_buf()),
        ..of_run(run, audit.as_ref())?
    })
}

fn of_run(run: RunFile, audit: Option<&AuditFile>) -> Result<Collection, Error> {
    let audited = |robot: &Robot| {
        let found = audit?.robot(&robot.id)?;
        Some(Audited {
            verdict: found.verdict.name(),
            conclusion: found.conclusion(),
        })
    };
    let cues = Gates::named(&run.config.data.dataset).map(|gates| gates.cues);
    let grouping = run.config.grouping().ok();
    let gate_of = |robot: &Robot| Some(gate(task_of(grouping.as_ref()?, robot)?, cues?)?.name);
    let entry = |robot: &Robot| Entry {
        id: robot.id.clone(),
        task: robot.task.clone(),
        gate: gate_of(robot),
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
    // A training has one robot, and no archive.
    let map = run.origin.is_none().then(|| CellMap::of(&run));
    Ok(Collection {
        name: format!("{}, seed {}", run.called(), run.config.seed),
        path: None,
        generations: Some(run.generations),
        map,
        tasks: run.dimensions.tasks.clone(),
        dataset: Some(run.dataset),
        config: run.config,
        robots,
        gone: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;

    fn run() -> &'static str {
        gallery::text("gallery:zero_one-1", RUN_JSON).unwrap()
    }

    fn write(runs: &Path, name: &str, text: &str) -> PathBuf {
        let path = runs.join(name).join(RUN_JSON);
        std::fs::create_dir_all(runs.join(name)).unwrap();
        std::fs::write(&path, text).unwrap();
        // File-system clocks tick more coarsely than the system's.
        let file = File::options().write(true).open(&path).unwrap();
        file.set_modified(SystemTime::now() + Duration::from_secs(10))
            .unwrap();
        path
    }

    /// Polls again and returns the names of the archives' folders.
    fn known(catalogue: &RobotCatalogue) -> Vec<String> {
        catalogue.watch.as_ref().unwrap().lock().unwrap().looked = None;
        let folder = |from: &CollectionSummary| {
            let path = PathBuf::from(from.path.clone()?);
            Some(path.parent()?.file_name()?.to_string_lossy().into_owned())
        };
        catalogue.list().iter().filter_map(folder).collect()
    }

    #[test]
    fn a_run_that_cannot_be_read_is_read_again_only_when_it_has_changed() {
        let runs = tempfile::tempdir().unwrap();
        let (catalogue, _) = RobotCatalogue::open(&[], None, runs.path()).unwrap();
        let good = run();
        // Same length and time.
        let path = write(runs.path(), "a", &good.replacen('{', "[", 1));
        assert_eq!(known(&catalogue), [""; 0]);
        let modified = path.metadata().unwrap().modified().unwrap();
        write(runs.path(), "a", good);
        let file = File::options().write(true).open(&path).unwrap();
        file.set_modified(modified).unwrap();
        assert_eq!(known(&catalogue), [""; 0]);
        file.set_modified(modified + Duration::from_millis(1))
            .unwrap();
        assert_eq!(known(&catalogue), ["a"]);
        // So does an archive that was readable before.
        write(runs.path(), "a", &good.replacen('{', "[", 1));
        file.set_modified(modified).unwrap();
        assert_eq!(
            (known(&catalogue), catalogue.list()[4].changes),
            (vec!["a".to_string()], 0)
        );
        write(runs.path(), "a", good);
        file.set_modified(modified).unwrap();
        assert_eq!(
            (known(&catalogue), catalogue.list()[4].changes),
            (vec!["a".to_string()], 0)
        );
        file.set_modified(modified + Duration::from_millis(1))
            .unwrap();
        assert_eq!(
            (known(&catalogue), catalogue.list()[4].changes),
            (vec!["a".to_string()], 1)
        );
    }

    #[test]
    fn requests_are_answered_while_another_one_reads() {
        let runs = tempfile::tempdir().unwrap();
        let (catalogue, _) = RobotCatalogue::open(&[], None, runs.path()).unwrap();
        write(runs.path(), "a", run());
        let reads = catalogue.watch.as_ref().unwrap().lock().unwrap();
        assert_eq!(
            (catalogue.list().len(), catalogue.collections().len()),
            (4, 4)
        );
        assert!(catalogue.collection(0).is_ok() && catalogue.course(0).is_err());
        drop(reads);
        assert_eq!(known(&catalogue), ["a"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_run_by_several_names_is_listed_once() {
        let runs = tempfile::tempdir().unwrap();
        let path = write(runs.path(), "a", run());
        let (catalogue, _) =
            RobotCatalogue::open(std::slice::from_ref(&path), None, runs.path()).unwrap();
        std::os::unix::fs::symlink("a", runs.path().join("link")).unwrap();
        write(runs.path(), "a", run());
        assert_eq!(known(&catalogue), ["a"]);
    }
}
