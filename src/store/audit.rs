//! `audit.json` and `audit.csv`: the verdicts on a run's robots, beside its `run.json`.

use crate::base::error::Error;
use crate::base::hash;
use crate::base::ranges;
use crate::base::remedy::{Invocation, Remedy, Value};
use crate::base::table;
use crate::config::audit::Criteria;
use crate::shipped::exists;
use crate::sim::Energy;
use crate::store::folder;
use crate::store::names::AUDIT_JSON;
use crate::store::results::{self, Stored, by_lines, write_with_table};
use crate::store::run::RunFile;
use crate::task::perturbation::PerturbationKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

pub(crate) const FORMAT: &str = "morphcog-audit";
pub(crate) const FORMAT_VERSION: u32 = 1;

/// The content of `audit.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AuditFile {
    /// The constant "morphcog-audit".
    #[schemars(extend("const" = FORMAT))]
    pub(crate) format: String,
    /// The version of this schema.
    #[schemars(range(min = 1, max = FORMAT_VERSION))]
    pub(crate) format_version: u32,
    /// The version of morphcog that wrote the file.
    pub(crate) program_version: String,
    /// The name of the audited run.
    pub(crate) run: String,
    /// The SHA-256 of that run's content: verdicts on another state of it are stale.
    pub run_sha256: String,
    /// The number of robots in that run.
    pub(crate) elites: usize,
    /// The criteria of the verdicts.
    pub criteria: Criteria,
    /// The robots audited so far, in the order of the run.
    pub robots: Vec<RobotAudit>,
}

/// The audit of one robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotAudit {
    /// The id of the robot.
    pub id: String,
    /// The task of the robot.
    pub(crate) task: String,
    /// The verdict.
    pub verdict: Verdict,
    /// The reason: for `exploits`, what the robot exploits.
    pub(crate) reason: String,
    /// The share of the perturbed rollouts in which its behaviour persists.
    #[serde(deserialize_with = "ranges::share")]
    pub(crate) persisting: f64,
    /// The root mean square change of displacements from the unchanged rollout, voxel lengths.
    #[serde(deserialize_with = "ranges::size")]
    pub(crate) spread: f64,
    /// The energies put in per actuation cycle in the unchanged rollout \[mass·wu²/s²\].
    pub(crate) energy_per_cycle: Energy,
    /// The displacements under the training images, unchanged, voxel lengths; null if unstable.
    #[serde(default, deserialize_with = "ranges::number")]
    pub displacements: Option<Vec<f64>>,
    /// The perturbed rollouts; empty for a robot that is not a walker.
    pub rollouts: Vec<PerturbedRollout>,
}

impl RobotAudit {
    /// Returns true if the verdict is physical.
    pub fn is_physical(&self) -> bool {
        self.verdict == Verdict::Physical
    }

    /// Joins verdict and reason: "exploits: time step".
    pub fn conclusion(&self) -> String {
        match self.verdict {
            Verdict::Physical => self.verdict.name().to_string(),
            verdict => format!("{}: {}", verdict.name(), self.reason),
        }
    }
}

impl Stored for AuditFile {
    const FORMAT: (&'static str, u32) = (FORMAT, FORMAT_VERSION);

    fn validate(&self) -> Result<(), Error> {
        self.criteria.validate()?;
        for (number, robot) in self.robots.iter().enumerate() {
            let at = |key: &str| format!("robots[{number}].{key}");
            if self.robots[..number]
                .iter()
                .any(|other| other.id == robot.id)
            {
                return Err(Error::at_key(
                    &at("id"),
                    format!("{} is there twice", robot.id),
                ));
            }
            let Energy { drive, limits } = robot.energy_per_cycle;
            ranges::check(&at("energy_per_cycle.drive"), drive)?;
            ranges::check(&at("energy_per_cycle.limits"), limits)?;
            let images = robot.displacements.as_ref().map(Vec::len);
            let walked = robot
                .rollouts
                .iter()
                .map(|rollout| rollout.displacements.as_ref().map(Vec::len));
            if let Some(place) = walked
                .clone()
                .position(|found| found.is_some() && found != images)
            {
                let text = "expected as many as of the unchanged rollout";
                return Err(Error::at_key(
                    &at(&format!("rollouts[{place}].displacements")),
                    text,
                ));
            }
        }
        if self.robots.len() > self.elites {
            let (found, most) = (self.robots.len(), self.elites);
            return Err(Error::at_key(
                "robots",
                format!("expected at most {most}, as elites says, found {found}"),
            ));
        }
        Ok(())
    }
}

impl AuditFile {
    pub(crate) fn new(run: &str, run_sha256: String, elites: usize, criteria: &Criteria) -> Self {
        AuditFile {
            format: FORMAT.to_string(),
            format_version: FORMAT_VERSION,
            program_version: env!("CARGO_PKG_VERSION").to_string(),
            run: run.to_string(),
            run_sha256,
            elites,
            criteria: criteria.clone(),
            robots: Vec::new(),
        }
    }

    /// Reads `audit.json`.
    ///
    /// # Errors
    /// Returns an error, with its line and key, if the file is missing or invalid.
    pub fn read(path: &Path) -> Result<Self, Error> {
        results::read(path, Some("audit"))
    }

    /// Returns the path of the verdicts on a run: beside its `run.json`, or for a shipped run in
    /// the current folder, if there are any.
    pub(crate) fn path(run_json: &Path) -> PathBuf {
        let made = folder::beside(run_json, AUDIT_JSON);
        if exists(&made) {
            made
        } else {
            run_json.with_file_name(AUDIT_JSON)
        }
    }

    /// Reads the verdicts on a run from [`path`](AuditFile::path).
    ///
    /// # Errors
    /// Returns an error if there are none, or they are invalid or about another state of the run.
    pub fn of_run(run: &RunFile, run_json: &Path) -> Result<Self, Error> {
        AuditFile::of_state(&run.fingerprint(), run_json)
    }

    pub(crate) fn of_state(fingerprint: &str, run_json: &Path) -> Result<Self, Error> {
        let path = &AuditFile::path(run_json);
        let audit = Invocation::new("audit").option("archive", folder::archive(run_json));
        if !exists(path) {
            let text = format!(
                "{}: there is no such file: these robots have not been audited",
                path.display()
            );
            return Err(Error::input(text).remedy(Remedy::Run(audit, "audits them")));
        }
        let file = AuditFile::read(path)?;
        // Verdicts that ship with the run are more complete than an audit that was stopped here.
        let shipped = run_json.with_file_name(AUDIT_JSON);
        if *path != shipped
            && let Ok(known) = AuditFile::read(&shipped)
            && (known.run_sha256.as_str(), &known.criteria) == (fingerprint, &file.criteria)
            && known.robots.len() > file.robots.len()
        {
            return Ok(known);
        }
        if file.run_sha256 != fingerprint {
            let text = format!(
                "{}: stale: it is about another state of the run (SHA-256 of its content {}…, expected {}…)",
                path.display(),
                hash::short(&file.run_sha256),
                hash::short(fingerprint)
            );
            return Err(
                Error::input(text).remedy(Remedy::Run(audit, "audits the run as it is now"))
            );
        }
        Ok(file)
    }

    /// Reads the verdicts on a run, or `None` without any; refuses those on another state of it.
    pub(crate) fn if_any(run: &RunFile, run_json: &Path) -> Result<Option<Self>, Error> {
        match exists(&AuditFile::path(run_json)) {
            true => AuditFile::of_run(run, run_json).map(Some),
            false => Ok(None),
        }
    }

    /// Reads the verdicts on the run with this fingerprint, from a folder or its subfolders.
    pub(crate) fn near(folder: &Path, run_sha256: &str) -> Result<Self, Error> {
        let here = if folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            folder
        };
        let mut folders: Vec<PathBuf> = std::fs::read_dir(here)
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path())
            .collect();
        folders.sort();
        folders.insert(0, folder.to_path_buf());
        for path in folders
            .into_iter()
            .map(|folder| folder.join(AUDIT_JSON))
            .filter(|path| exists(path))
        {
            let file = AuditFile::read(&path)?;
            if file.run_sha256 == run_sha256 {
                return Ok(file);
            }
        }
        let short = hash::short(run_sha256);
        let text = format!(
            "{}: expected an {AUDIT_JSON} there, or in a folder there, about the run with SHA-256 {short}…",
            here.display()
        );
        let audit = Invocation::new("audit").option("archive", Value::Placeholder("…"));
        Err(Error::input(text).remedy(Remedy::Run(audit, "makes one beside the run")))
    }

    /// Adds verdicts on other robots from a file about the same run, criteria and version.
    pub(crate) fn add_known(&mut self, path: &Path) {
        let Ok(known) = AuditFile::read(path) else {
            return;
        };
        let head = |file: &AuditFile| AuditFile {
            robots: Vec::new(),
            ..file.clone()
        };
        if head(&known) == head(self) {
            let others = known
                .robots
                .into_iter()
                .filter(|robot| self.robot(&robot.id).is_none());
            let others: Vec<RobotAudit> = others.collect();
            self.robots.extend(others);
        }
    }

    /// Returns the audit of a robot.
    pub fn robot(&self, id: &str) -> Option<&RobotAudit> {
        self.robots.iter().find(|robot| robot.id == id)
    }

    /// Encodes the file as JSON: the head on one line, then one line per robot.
    pub fn to_json(&self) -> String {
        let head = AuditFile {
            robots: Vec::new(),
            ..self.clone()
        };
        by_lines(&head, &self.robots)
    }

    /// Encodes `audit.csv`: a line per robot and rollout, the unchanged one first.
    pub(crate) fn to_csv(&self) -> Vec<u8> {
        let images = self
            .robots
            .iter()
            .filter_map(|r| r.displacements.as_ref())
            .map(Vec::len)
            .max();
        let images = images.unwrap_or(0);
        let about = [
            "id",
            "task",
            "verdict",
            "reason",
            "persisting",
            "spread",
            "drive_per_cycle",
        ];
        let rollout = [
            "limits_per_cycle",
            "rollout",
            "kept",
            "distance",
            "persists",
        ];
        let columns = about.into_iter().chain(rollout).map(str::to_string);
        let columns = columns.chain(table::numbered("displacement", images));
        let rows = self.robots.iter().flat_map(|robot| {
            let Energy { drive, limits } = robot.energy_per_cycle;
            let verdict = (&robot.id, &robot.task, robot.verdict.name(), &robot.reason);
            let about = (verdict, robot.persisting, robot.spread, drive, limits);
            let row = move |name,
                            compared: Option<(f64, f64, bool)>,
                            displacements: &Option<Vec<f64>>| {
                let (kept, distance, persists) = compared
                    .map_or((None, None, None), |(kept, distance, persists)| {
                        (Some(kept), Some(distance), Some(persists))
                    });
                let walks = table::padded(displacements.as_deref().unwrap_or_default(), images);
                (about, name, kept, distance, persists, walks)
            };
            let unchanged = row("unchanged", None, &robot.displacements);
            let changed = robot.rollouts.iter().map(move |rollout| {
                row(
                    rollout.name.as_str(),
                    Some((rollout.kept, rollout.distance, rollout.persists)),
                    &rollout.displacements,
                )
            });
            std::iter::once(unchanged).chain(changed)
        });
        table::csv(columns, rows)
    }

    /// Writes the file, and its CSV beside it.
    pub(crate) fn write(&self, path: &Path) -> Result<(), Error> {
        write_with_table(path, &self.to_json(), &self.to_csv(), [])
    }
}

/// The verdict of an audit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The robot's directions survive every change.
    Physical,
    /// Small changes of the world break its behaviour.
    Fragile,
    /// It survives changes of the world, but not changes of the computation or of the way images
    /// are presented: it exploits those.
    Exploits,
    /// It does not answer its training images, or no better than always walking the same way.
    NotAWalker,
}

impl Verdict {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Verdict::Physical => "physical",
            Verdict::Fragile => "fragile",
            Verdict::Exploits => "exploits",
            Verdict::NotAWalker => "not a walker",
        }
    }
}

/// A rollout with one change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PerturbedRollout {
    /// The change and its size.
    pub(crate) name: String,
    /// The kind of the change.
    pub(crate) kind: PerturbationKind,
    /// The displacement under each training image, voxel lengths (mirrored back if the rollout is
    /// mirrored); null if unstable.
    #[serde(default, deserialize_with = "ranges::number")]
    pub(crate) displacements: Option<Vec<f64>>,
    /// The share of the images answered correctly in the unchanged rollout for which the robot
    /// still walks the correct way.
    #[serde(deserialize_with = "ranges::share")]
    pub(crate) kept: f64,
    /// The walks in the correct direction under these images, relative to the unchanged rollout.
    #[serde(deserialize_with = "ranges::number")]
    pub(crate) distance: f64,
    /// True if the behaviour persists.
    pub persists: bool,
}
