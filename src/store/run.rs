//! `run.json`: a run's archive with everything that made it. Commands such as `eval` read it.

use crate::base::error::Error;
use crate::base::hash::sha256_hex;
use crate::base::number;
use crate::base::ranges;
use crate::base::remedy::Remedy;
use crate::base::table;
use crate::body::{Body, VoxelCounts};
use crate::config::Config;
use crate::genome::Genome;
use crate::qd::descriptor::{count_bin, possible_cells};
use crate::qd::{Archive, ArchiveStats, DescriptorSpace, Elite};
use crate::shipped;
use crate::shipped::read_text;
use crate::store::images::{DatasetRef, ImageRef, answers};
use crate::store::results::{self, Stored, by_lines};
use crate::store::training::Origin;
use crate::task::answer::Answer;
use crate::task::answer::Assignment;
use crate::task::answer::Readout;
use crate::task::fitness::Fitness;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;

pub(crate) const FORMAT: &str = "morphcog-run";
pub(crate) const FORMAT_VERSION: u32 = 1;

/// The arguments that stand for a run.
const WHAT_RUNS: &str =
    "expected a run.json, its folder, or runs that ship, such as gallery:zero_one";

/// A robot: a genome, its body, and its walks under the training images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    /// The content hash of the genome: a letter and nine hexadecimal digits (ten in older files).
    pub id: String,
    /// The cell, one bin per dimension of the archive.
    pub cell: Vec<usize>,
    /// The task, such as "0|123": classes before the bar walk one way, the others the other.
    pub task: String,
    /// The fitness, in the fitness's [unit](crate::task::fitness::Fitness::unit).
    #[serde(deserialize_with = "ranges::number")]
    pub objective: f64,
    /// The displacement under each training image, voxel lengths, positive to the right. With
    /// `response` it is the probe's, under as many random images.
    #[serde(deserialize_with = "ranges::number")]
    pub displacements: Vec<f64>,
    /// The voxel counts by kind.
    pub voxels: VoxelCounts,
    /// The generation in which it was born.
    pub generation: u64,
    /// The id of its parent; null for a random individual.
    pub parent: Option<String>,
    /// The body.
    pub body: Body,
    /// The genome.
    pub genome: Genome,
}

impl Robot {
    /// Returns the bins of its three voxel counts.
    pub fn bins(&self) -> Vec<usize> {
        let area = self.body.voxels().area();
        let VoxelCounts {
            muscle,
            sensor,
            total,
            ..
        } = self.voxels;
        [muscle, sensor, total]
            .map(|count| count_bin(count, area))
            .to_vec()
    }
}

/// The dimensions of an archive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Dimensions {
    /// The names: muscle, sensor, total, and with several tasks, task.
    pub(crate) names: Vec<String>,
    /// The number of bins of each.
    pub(crate) bins: Vec<usize>,
    /// The number of cells that a body can have; coverage is a fraction of it.
    pub possible_cells: usize,
    /// The names of the tasks, in the order of their bins.
    pub tasks: Vec<String>,
}

impl Dimensions {
    pub(crate) fn of(config: &Config) -> Result<Self, Error> {
        let grouping = config.grouping()?;
        let tasks: Vec<String> = grouping.tasks().iter().map(|split| split.name()).collect();
        let space = DescriptorSpace::voxel_counts(tasks.len());
        let (names, bins) = space.dimensions().iter().cloned().unzip();
        let area = config.body.height * config.body.width;
        let possible_cells = possible_cells(area, config.body.min_muscles, tasks.len()).len();
        Ok(Dimensions {
            names,
            bins,
            possible_cells,
            tasks,
        })
    }
}

/// The content of `run.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RunFile {
    /// The constant "morphcog-run".
    #[schemars(extend("const" = FORMAT))]
    pub(crate) format: String,
    /// The version of this schema.
    #[schemars(range(min = 1, max = FORMAT_VERSION))]
    pub(crate) format_version: u32,
    /// The version of morphcog that wrote the file.
    pub(crate) program_version: String,
    /// The name of the run, from its config.
    pub name: String,
    /// The config with every key resolved, including the physics.
    pub config: Config,
    /// The data.
    pub dataset: DatasetRef,
    /// The training images.
    pub training_images: Vec<ImageRef>,
    /// The archive's dimensions.
    pub dimensions: Dimensions,
    /// The run whose gaits were trained, if this is a training.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<Origin>,
    /// The number of generations completed.
    pub generations: u64,
    /// The statistics of the archive.
    pub stats: ArchiveStats,
    /// The elites, in the order of their cells.
    pub elites: Vec<Robot>,
    /// The SHA-256 of the bytes of the file; `None` if the run was not read from its file.
    #[serde(skip)]
    pub read_sha256: Option<String>,
    /// The name of the folder that the file was read from, or of a run that ships.
    #[serde(skip)]
    pub(crate) folder: Option<String>,
}

impl Stored for RunFile {
    const FORMAT: (&'static str, u32) = (FORMAT, FORMAT_VERSION);

    fn validate(&self) -> Result<(), Error> {
        if self.format != FORMAT || self.format_version > FORMAT_VERSION {
            let text = format!("format: expected {FORMAT}, format_version up to {FORMAT_VERSION}");
            return Err(Error::input(text));
        }
        self.config.validate()?;
        let (done, all) = (self.generations, self.config.generations);
        if done > all {
            let text = format!("generations = {done}: expected at most config.generations, {all}");
            return Err(Error::input(text));
        }
        let (grouping, names) = (self.config.grouping()?, &self.dimensions.tasks);
        let are_called = grouping.tasks().len() == names.len()
            && grouping
                .tasks()
                .iter()
                .zip(names)
                .all(|(split, name)| split.is_called(name));
        let of_config = Dimensions {
            tasks: names.clone(),
            ..Dimensions::of(&self.config)?
        };
        if !are_called || self.dimensions != of_config {
            return Err(Error::input(
                "dimensions: they are not those of the config".to_string(),
            ));
        }
        let shown: BTreeSet<u8> = self
            .training_images
            .iter()
            .map(|image| image.label)
            .collect();
        let classes: BTreeSet<u8> = self.config.classes().into_iter().collect();
        // Older trainings may lack images of a class, but have some of both groups.
        let are_enough = match (&self.origin, &self.config.task.groups) {
            (Some(_), Some(groups)) => {
                shown.is_subset(&classes)
                    && groups
                        .iter()
                        .all(|group| group.iter().any(|class| shown.contains(class)))
            }
            _ => shown == classes,
        };
        if !are_enough {
            let text = "training_images: their labels are not the classes of the config's task";
            return Err(Error::input(text.to_string()));
        }
        let space = self.space();
        for robot in &self.elites {
            let refuse = |what: &str| Err(Error::input(format!("elite {}: {what}", robot.id)));
            let (height, width) = (self.config.body.height, self.config.body.width);
            if (robot.body.height(), robot.body.width()) != (height, width) {
                return refuse(&format!(
                    "its body is not {height} × {width} voxels, as the config says"
                ));
            }
            if !robot.genome.has_id(&robot.id) {
                return refuse("its id is not its genome's");
            }
            if robot.genome.body(height, width).as_ref() != Ok(&robot.body) {
                return refuse("its body is not what its genome describes");
            }
            if robot.voxels != robot.body.counts() {
                return refuse("its voxel counts are not its body's");
            }
            if !self.dimensions.tasks.contains(&robot.task) {
                return refuse("there is no such task in this run");
            }
            if space.index(&robot.cell).is_none() {
                return refuse("there is no such cell in the archive");
            }
            if robot.displacements.len() != self.training_images.len() {
                return refuse("it has not one displacement per training image");
            }
        }
        let stats = self.archive()?.stats(
            self.dimensions.possible_cells,
            self.config.archive.qd_offset,
        );
        match stats == self.stats {
            true => Ok(()),
            false => Err(Error::at_key("stats", "expected the figures of the elites")),
        }
    }
}

/// Returns the name of a run's folder, or of a run that ships; `None` if neither has a name.
fn folder_of(path: &Path) -> Option<String> {
    if let Some((of, run)) = shipped::name(path) {
        return Some(format!("{of}:{run}"));
    }
    let parent = path.parent()?;
    // In the present folder, only its absolute path has a name.
    let name = match parent.file_name() {
        Some(name) => name.to_os_string(),
        None => {
            let absolute = Path::new(".").join(parent).canonicalize().ok()?;
            absolute.file_name()?.to_os_string()
        }
    };
    Some(name.to_string_lossy().into_owned())
}

impl RunFile {
    /// Creates a run of this program from its archive after some generations.
    pub(crate) fn new(
        name: &str,
        config: &Config,
        (dataset, training_images): (&DatasetRef, Vec<ImageRef>),
        generations: u64,
        archive: &Archive<Robot>,
    ) -> Result<Self, Error> {
        let dimensions = Dimensions::of(config)?;
        Ok(RunFile {
            format: FORMAT.to_string(),
            format_version: FORMAT_VERSION,
            program_version: env!("CARGO_PKG_VERSION").to_string(),
            name: name.to_string(),
            config: config.clone(),
            dataset: dataset.clone(),
            training_images,
            stats: archive.stats(dimensions.possible_cells, config.archive.qd_offset),
            dimensions,
            origin: None,
            generations,
            elites: archive
                .elites()
                .map(|elite| elite.solution.clone())
                .collect(),
            read_sha256: None,
            folder: None,
        })
    }

    /// Reads `run.json`.
    ///
    /// # Errors
    /// Returns an error, with its line and key, if the file is missing or invalid.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = read_text(path)
            .map_err(|error| Error::reading_or(path, &error, Remedy::advice(WHAT_RUNS)))?;
        RunFile::parse(&text, &path.display().to_string())
    }

    /// Reads only the generations completed and requested, if the file contains them.
    pub(crate) fn progress(path: &Path) -> Option<(u64, u64)> {
        #[derive(Deserialize)]
        struct Whole {
            generations: u64,
            config: Asked,
        }
        #[derive(Deserialize)]
        struct Asked {
            generations: u64,
        }
        let run: Whole = serde_json::from_str(&read_text(path).ok()?).ok()?;
        Some((run.generations, run.config.generations))
    }

    /// Reads only the version of morphcog that made a run; returns it if it is not this one.
    pub(crate) fn other_version(path: &Path) -> Option<String> {
        #[derive(Deserialize)]
        struct Made {
            program_version: String,
        }
        let run: Made = serde_json::from_str(&read_text(path).ok()?).ok()?;
        Some(run.program_version).filter(|version| version != env!("CARGO_PKG_VERSION"))
    }

    /// Parses the text of the file; `name` appears in messages.
    pub(crate) fn parse(text: &str, name: &str) -> Result<Self, Error> {
        let run: RunFile = results::parse(text, name)?;
        Ok(RunFile {
            read_sha256: Some(sha256_hex(text.as_bytes())),
            folder: folder_of(Path::new(name)),
            ..run
        })
    }

    /// Returns the name of the run for people: its folder's, or that of a run that ships, without
    /// the seed at its end; its config's if it was not read from a file.
    pub(crate) fn called(&self) -> &str {
        let Some(folder) = &self.folder else {
            return &self.name;
        };
        let seed = self.config.seed;
        let ends = [format!("-seed{seed}"), format!("-{seed}")];
        let stem = ends
            .iter()
            .find_map(|end| folder.strip_suffix(end.as_str()));
        stem.filter(|stem| !stem.is_empty()).unwrap_or(folder)
    }

    fn space(&self) -> DescriptorSpace {
        let Dimensions { names, bins, .. } = &self.dimensions;
        DescriptorSpace::new(names.iter().cloned().zip(bins.iter().copied()).collect())
    }

    pub(crate) fn fitness(&self) -> Fitness {
        self.config.evaluation.fitness
    }

    pub(crate) fn in_units(&self, objective: f64) -> String {
        let unit = self
            .fitness()
            .unit()
            .map_or(String::new(), |unit| format!(" {unit}"));
        format!("{}{unit}", number::fixed(objective, 2))
    }

    /// Returns true if both are states of one run: the same config and seed give the same robots.
    /// Trainings also have gaits of their own.
    fn is_same_run(&self, other: &RunFile) -> bool {
        let essence = |run: &RunFile| (run.config.essence(), run.dataset.clone());
        let are_evolved = self.origin.is_none() && other.origin.is_none();
        self.fingerprint() == other.fingerprint() || are_evolved && essence(self) == essence(other)
    }

    /// Returns the fittest elite, or the one in the first cell if several are equal.
    pub fn best(&self) -> Option<&Robot> {
        let fitter = |best: &&Robot, robot: &&Robot| robot.objective > best.objective;
        self.elites
            .iter()
            .reduce(|best, robot| if fitter(&best, &robot) { robot } else { best })
    }

    pub(crate) fn answers(&self, robot: &Robot) -> Vec<Answer> {
        answers(
            &self.training_images,
            robot.displacements.iter().copied().map(Some),
        )
    }

    /// Returns the judge of a robot's walks, or `None` for a gait or a robot of the same-way task.
    pub fn judge(&self, robot: &Robot) -> Option<Readout> {
        if self.config.measures_response() {
            return None;
        }
        let grouping = self.config.grouping().ok()?;
        let split = grouping
            .tasks()
            .iter()
            .find(|split| split.is_called(&robot.task))?;
        Readout::of(
            split,
            Assignment::from_training(split, self.fitness(), &self.answers(robot)),
        )
    }

    /// Returns true if displacements are those of bodies under the training images by the config's
    /// protocol: not of probes, nor from raised starts or without length limits.
    pub fn follows_protocol(&self) -> bool {
        !self.config.measures_response() && self.origin.is_none()
    }

    /// Returns the elites as an archive, to continue the run.
    ///
    /// # Errors
    /// Returns an error if two elites are in one cell.
    pub fn archive(&self) -> Result<Archive<Robot>, Error> {
        let space = self.space();
        let mut archive = Archive::new();
        for robot in &self.elites {
            let cell = space
                .index(&robot.cell)
                .expect("elites are in cells of their archive: a file's are checked");
            if archive.get(cell).is_some() {
                return Err(Error::input(format!(
                    "elite {}: another one is in its cell",
                    robot.id
                )));
            }
            let elite = Elite {
                cell,
                objective: robot.objective,
                solution: robot.clone(),
            };
            archive
                .insert(elite)
                .map_err(|error| Error::input(error.to_string()))?;
        }
        Ok(archive)
    }

    /// Encodes the file as JSON: the head on one line, then one line per elite.
    pub fn to_json(&self) -> String {
        let head = RunFile {
            elites: Vec::new(),
            ..self.clone()
        };
        by_lines(&head, &self.elites)
    }

    /// Returns the identity of the run: the SHA-256 of its file's bytes, or of those to be written,
    /// in hexadecimal digits.
    pub fn fingerprint(&self) -> String {
        self.read_sha256
            .clone()
            .unwrap_or_else(|| sha256_hex(self.to_json().as_bytes()))
    }

    /// Encodes `elites.csv` for pyribs' `ArchiveDataFrame`. `index`: cell; `objective`;
    /// `measures_i`: voxel counts (and task); `solution_i`: voxels row-major; then id, task,
    /// generation and displacements.
    pub fn to_csv(&self) -> Vec<u8> {
        let space = self.space();
        let voxels = self.config.body.height * self.config.body.width;
        let images = self.training_images.len();
        let columns = ["index", "objective"].map(str::to_string).into_iter();
        let columns = columns
            .chain(table::numbered("measures", self.dimensions.bins.len()))
            .chain(table::numbered("solution", voxels))
            .chain(["id", "task", "generation"].map(str::to_string))
            .chain(table::numbered("displacement", images));
        let rows = self.elites.iter().map(|robot| {
            let index = space
                .index(&robot.cell)
                .expect("elites are in cells of their archive: a file's are checked");
            let VoxelCounts {
                muscle,
                sensor,
                total,
            } = robot.voxels;
            let task = robot.cell.get(3).copied();
            let measures: Vec<usize> = [muscle, sensor, total].into_iter().chain(task).collect();
            let solution: Vec<u8> = robot
                .body
                .voxels()
                .cells()
                .iter()
                .map(|voxel| voxel.code())
                .collect();
            let about = (&robot.id, &robot.task, robot.generation);
            (
                index,
                robot.objective,
                measures,
                solution,
                about,
                &robot.displacements,
            )
        });
        table::csv(columns, rows)
    }
}

/// Checks that runs, each with its path, differ, because duplicates would count twice.
pub(crate) fn different<'a>(
    runs: impl IntoIterator<Item = (&'a Path, &'a RunFile)>,
) -> Result<(), Error> {
    let mut known: Vec<(&Path, &RunFile)> = Vec::new();
    for (path, run) in runs {
        if let Some((first, other)) = known.iter().find(|(_, other)| other.is_same_run(run)) {
            let (first, path) = (first.display(), path.display());
            let these = match other.generations == run.generations {
                true => "these are the same",
                false => "these are two states of one",
            };
            return Err(Error::usage(format!(
                "{first} and {path}: expected different runs, {these}"
            )));
        }
        known.push((path, run));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::samples;

    #[test]
    fn a_run_is_identified_by_the_bytes_of_its_file() {
        let mut run = samples::run(&[("a", 1.5), ("b", -0.25)]);
        run.elites
            .iter_mut()
            .for_each(|robot| robot.id = robot.genome.id());
        let text = run.to_json();
        let read = |text: &str| RunFile::parse(text, "run.json").unwrap();
        // The file has this text, so its fingerprint is known without another reading.
        assert_eq!(read(&text).fingerprint(), run.fingerprint());
        // The same content in other bytes is another file, with the hash that sha256sum computes.
        for other in [
            text.replace("1.5", "1.50"),
            format!("{text}\n"),
            format!("\u{feff}{text}"),
        ] {
            assert_ne!(other, text);
            assert_eq!(read(&other).to_json(), text);
            assert_eq!(read(&other).fingerprint(), sha256_hex(other.as_bytes()));
        }
        // But it is the same run.
        let twice = [
            (Path::new("a.json"), &read(&text)),
            (Path::new("b.json"), &read(&format!("{text}\n"))),
        ];
        assert!(different(twice).is_err());
    }
}
