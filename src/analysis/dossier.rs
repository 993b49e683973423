//! `morphcog report`: collects the results of runs for a page.

use crate::analysis::comparison::{Comparison, Subject, best_of_each_task, compare};
use crate::analysis::progress::Progress;
use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::config::Config;
use crate::data::dataset::Split;
use crate::images::whereabouts::{Whereabouts, labelled, load_dataset_of};
use crate::search::held_out_run::control_steps;
use crate::shipped::exists;
use crate::store::audit::AuditFile;
use crate::store::capacity::CapacityFile;
use crate::store::eval::EvalFile;
use crate::store::folder;
use crate::store::images::ImageRef;
use crate::store::names::{CAPACITY_JSON, EVAL_JSON, METRICS, TEAM_JSON};
use crate::store::run::{Robot, RunFile, different};
use crate::store::stored_run::StoredRun;
use crate::store::team::{Member, TeamFile};
use crate::task::protocol::{Protocol, RolloutMode};
use crate::task::recording::{LabelledStimulus, Recording};
use crate::task::rollout::{check_length, record};
use std::path::{Path, PathBuf};

/// Most images in the rollouts of a page: one of each class, if there are more.
const MOST_IMAGES: usize = 4;

#[derive(Clone, Debug)]
pub(crate) struct Dossier {
    pub(crate) path: PathBuf,
    /// Number of earlier runs with its name and seed; `None` if it is the only one.
    pub(crate) namesake: Option<usize>,
    pub(crate) run: RunFile,
    /// Its progress; `None` without a metrics.csv.
    pub(crate) progress: Option<Progress>,
    /// Results of this run alone.
    pub(crate) findings: Findings,
    /// Images for its robots on the page.
    pub(crate) images: Vec<LabelledStimulus>,
}

/// Results of tests; `None` for those not done.
#[derive(Clone, Debug, Default)]
pub(crate) struct Findings {
    pub(crate) eval: Option<EvalFile>,
    pub(crate) audit: Option<AuditFile>,
    pub(crate) capacity: Option<CapacityFile>,
}

impl Findings {
    /// Reads results that match the present state of these runs, from the place of these archives'
    /// results. Only a single run has verdicts.
    fn read(archives: &[PathBuf], runs: &[&RunFile], warn: &dyn Fn(&str)) -> Self {
        let existing =
            |name: &str| Some(folder::beside_all(archives, name)).filter(|path| exists(path));
        // A report of what can be read is better than none.
        let told = |error: Error| warn(&format!("{error}; left out"));
        let audit = match (runs, archives) {
            ([run], [path]) => AuditFile::if_any(run, path).map_err(told).ok().flatten(),
            _ => None,
        };
        let tested = existing(EVAL_JSON);
        let eval = tested
            .clone()
            .and_then(|path| EvalFile::of_runs(&path, runs).map_err(told).ok());
        let is_of_it = |capacity: &CapacityFile| match (&eval, &tested) {
            (Some(eval), _) => capacity.is_of(eval),
            (None, is_there) => is_there.is_none(),
        };
        let capacity = existing(CAPACITY_JSON).and_then(|path| {
            let capacity = CapacityFile::read(&path).map_err(told).ok()?;
            if !is_of_it(&capacity) {
                warn(&format!(
                    "{}: it is not of the robots of the {EVAL_JSON} beside it; left out",
                    path.display()
                ));
                return None;
            }
            Some(capacity)
        });
        Findings {
            eval,
            audit,
            capacity,
        }
    }
}

/// A team of robots of the runs, and images to watch it with.
#[derive(Clone, Debug)]
pub(crate) struct Team {
    /// Results of `team`.
    pub(crate) file: TeamFile,
    /// The run of each of its robots.
    pub(crate) runs: Vec<usize>,
    /// Images to watch it with, the first of each class: positions among the file's images.
    pub(crate) images: Vec<usize>,
    /// These images as the robots of each run see them.
    pub(crate) seen: Vec<Vec<LabelledStimulus>>,
    /// These images as all robots see them together.
    pub(crate) together: Vec<LabelledStimulus>,
}

#[derive(Clone, Debug)]
pub(crate) struct Gathered {
    pub(crate) runs: Vec<Dossier>,
    /// Results of several runs together, from above their folders.
    pub(crate) together: Findings,
    /// Results of `team` for robots of these runs, from there too.
    pub(crate) team: Option<Team>,
}

/// Reads runs and the results beside them; unreadable results go to `warn`. Without
/// `with_rollouts`, no images are needed.
pub(crate) fn gather(
    archives: &[PathBuf],
    data: Option<&Path>,
    with_rollouts: bool,
    warn: &dyn Fn(&str),
) -> Result<Gathered, Error> {
    let mut runs: Vec<Dossier> = Vec::new();
    for path in archives {
        let run = RunFile::read(path)?;
        let progress = match exists(&path.with_file_name(METRICS)) {
            true => Progress::of(&run, path)
                .map_err(|error| warn(&format!("{error}; left out")))
                .ok(),
            false => None,
        };
        let whereabouts = Whereabouts::given(data).and_of(path);
        let images = if with_rollouts {
            images(&run, path, &whereabouts)?
        } else {
            Vec::new()
        };
        let findings = Findings::read(std::slice::from_ref(path), &[&run], warn);
        runs.push(Dossier {
            path: path.clone(),
            namesake: None,
            run,
            progress,
            findings,
            images,
        });
    }
    let named: Vec<(String, u64)> = runs
        .iter()
        .map(|dossier| (dossier.run.called().to_string(), dossier.run.config.seed))
        .collect();
    let count = |name: &(String, u64), among: &[(String, u64)]| {
        among.iter().filter(|other| *other == name).count()
    };
    for (number, dossier) in runs.iter_mut().enumerate() {
        let name = &named[number];
        dossier.namesake = (count(name, &named) > 1).then(|| count(name, &named[..number]));
    }
    different(
        runs.iter()
            .map(|dossier| (dossier.path.as_path(), &dossier.run)),
    )?;
    let together = match archives.len() {
        0 | 1 => Findings::default(),
        _ => {
            let all: Vec<&RunFile> = runs.iter().map(|dossier| &dossier.run).collect();
            Findings::read(archives, &all, warn)
        }
    };
    let team = match folder::beside_all(archives, TEAM_JSON) {
        path if archives.len() > 1 && path.exists() => {
            let whereabouts = archives
                .iter()
                .fold(Whereabouts::given(data), |all, path| all.and_of(path));
            let found = Team::read(&path, &runs, with_rollouts.then_some(&whereabouts));
            found
                .map_err(|error| warn(&format!("{error}; left out")))
                .ok()
        }
        _ => None,
    };
    Ok(Gathered {
        runs,
        together,
        team,
    })
}

/// Compares the first run with the others by the tests that there are, and simulates nothing.
/// `None` if no other run has a task of the first. `names` are those of the runs.
pub(crate) fn compared(
    gathered: &Gathered,
    names: Vec<String>,
) -> Result<Option<Comparison>, Error> {
    let Gathered { runs, together, .. } = gathered;
    let tasks = |dossier: &Dossier| dossier.run.dimensions.tasks.clone();
    let first = runs.first().map(tasks).unwrap_or_default();
    let is_alike = |dossier: &Dossier| tasks(dossier).iter().any(|task| first.contains(task));
    if !runs.iter().skip(1).any(is_alike) {
        return Ok(None);
    }
    let mut subjects = Vec::new();
    for (dossier, name) in runs.iter().zip(names) {
        let tests = [&dossier.findings.eval, &together.eval];
        subjects.push(Subject {
            name,
            path: &dossier.path,
            run: &dossier.run,
            progress: dossier.progress.as_ref(),
            robots: best(&dossier.path, &dossier.run)?,
            tests: tests.into_iter().flatten().collect(),
        });
    }
    Ok(Some(compare(&subjects)))
}

/// Returns the best robots of a run, one of each task; none of an empty archive.
fn best<'a>(path: &Path, run: &'a RunFile) -> Result<Vec<&'a Robot>, Error> {
    if run.elites.is_empty() {
        return Ok(Vec::new());
    }
    let source = StoredRun {
        path: path.to_path_buf(),
        run: run.clone(),
    };
    let best = best_of_each_task(&source, false)?;
    let own = |best: &Robot| {
        let is_it = |robot: &&Robot| (&robot.id, &robot.task) == (&best.id, &best.task);
        run.elites.iter().find(is_it)
    };
    Ok(best.into_iter().filter_map(own).collect())
}

impl Team {
    /// Reads a team that has answered, all of these runs; without `whereabouts`, it has no images.
    fn read(
        path: &Path,
        runs: &[Dossier],
        whereabouts: Option<&Whereabouts>,
    ) -> Result<Self, Error> {
        let file = TeamFile::read(path)?;
        let wrong = |text: &str| Error::input(format!("{}: {text}", path.display()));
        if file.answers.is_none() {
            return Err(wrong(
                "this test was stopped: expected the answers of a whole team",
            ));
        }
        let hashes: Vec<String> = runs
            .iter()
            .map(|dossier| dossier.run.fingerprint())
            .collect();
        let of_member = |member: &Member| {
            let run = hashes.iter().position(|hash| *hash == member.run_sha256)?;
            let is_it = |robot: &Robot| robot.id == member.id && robot.body == member.body;
            runs[run].run.elites.iter().any(is_it).then_some(run)
        };
        let of: Option<Vec<usize>> = file.members.iter().map(of_member).collect();
        let of = of.ok_or_else(|| wrong("expected a team of robots of these runs"))?;
        let is_first = |(place, image): &(usize, &ImageRef)| {
            file.images
                .iter()
                .position(|other| other.label == image.label)
                == Some(*place)
        };
        let mut images: Vec<usize> = file
            .images
            .iter()
            .enumerate()
            .filter(is_first)
            .map(|(place, _)| place)
            .collect();
        let (Some(whereabouts), Some(first)) = (whereabouts, of.first()) else {
            return Ok(Team {
                file,
                runs: of,
                images: Vec::new(),
                seen: vec![Vec::new(); runs.len()],
                together: Vec::new(),
            });
        };
        images.sort_by_key(|place| file.images[*place].label);
        let (run, split) = (&runs[*first].run, file.split.split());
        let dataset = load_dataset_of(Some(&run.dataset), &run.config, whereabouts, &[split])?;
        let names = file.names();
        let seen = |config: &Config| {
            let one = |place: &usize| {
                let image = file.images[*place];
                Ok(LabelledStimulus {
                    label: image.called(split, &names),
                    ..labelled(config, &dataset, split, image)?
                })
            };
            images
                .iter()
                .map(one)
                .collect::<Result<Vec<LabelledStimulus>, Error>>()
        };
        let of_members = of.iter().map(|run| &runs[*run].run.config);
        let together =
            seen(&Config::together(of_members).expect("the first member's is among them"))?;
        let seen = runs
            .iter()
            .map(|dossier| seen(&dossier.run.config))
            .collect::<Result<_, Error>>()?;
        Ok(Team {
            file,
            runs: of,
            images,
            seen,
            together,
        })
    }

    /// Records the rollout of a member under one of the images to watch it with.
    pub(crate) fn record(&self, runs: &[Dossier], member: usize, image: usize) -> Recording {
        let run = self.runs[member];
        let config = &runs[run].run.config;
        let control_steps = control_steps(config, self.file.cycles);
        let protocol = Protocol {
            control_steps,
            ..config.protocol.clone()
        };
        let Member { id, body, .. } = &self.file.members[member];
        record(
            id,
            body,
            &config.physics,
            &protocol,
            true,
            std::slice::from_ref(&self.seen[run][image]),
        )
    }
}

/// Returns the training images, or one per class if there are many.
fn images(
    run: &RunFile,
    path: &Path,
    whereabouts: &Whereabouts,
) -> Result<Vec<LabelledStimulus>, Error> {
    let without = |error: Error| match error.remedies.is_empty() {
        true => error.remedy(Remedy::LeaveOutRollouts),
        false => error,
    };
    let dataset = load_dataset_of(
        Some(&run.dataset),
        &run.config,
        whereabouts,
        &[Split::Train],
    );
    let dataset = dataset.map_err(without)?;
    let mut shown: Vec<ImageRef> = run.training_images.clone();
    if shown.len() > MOST_IMAGES {
        let mut classes = Vec::new();
        shown.retain(|image| {
            let is_first = !classes.contains(&image.label);
            classes.push(image.label);
            is_first
        });
    }
    let body = [run.config.body.height, run.config.body.width];
    check_length(body, &run.config.protocol, shown.len()).map_err(without)?;
    let one = |image: &ImageRef| {
        labelled(&run.config, &dataset, Split::Train, *image).map_err(|error| {
            error
                .in_place("training_images")
                .in_place(&path.display().to_string())
        })
    };
    shown.iter().map(one).collect()
}

impl Dossier {
    /// Records the rollout of a robot under the images.
    pub(crate) fn record(&self, robot: &Robot) -> Recording {
        let config = &self.run.config;
        let fresh = config.protocol.rollout == RolloutMode::Fresh;
        let recording = record(
            &robot.id,
            &robot.body,
            &config.physics,
            &config.protocol,
            fresh,
            &self.images,
        );
        Recording {
            judge: self.run.judge(robot),
            names: self.run.config.class_names(),
            ..recording
        }
    }

    /// Returns the seconds of the run and its number of offspring; `None` without a metrics.csv.
    pub(crate) fn effort(&self) -> Option<(f64, f64)> {
        let last = self.progress.as_ref()?.moments.last()?;
        Some((last.seconds, last.evaluations))
    }

    /// Returns the robots that differ most: the fittest, then in turn the one whose body is
    /// farthest from all before (in voxels that differ), among those fitter than 0.
    pub(crate) fn most_different(&self, count: usize) -> Vec<&Robot> {
        let able = || self.run.elites.iter().filter(|robot| robot.objective > 0.0);
        let mut chosen: Vec<&Robot> = self
            .run
            .best()
            .filter(|best| best.objective > 0.0)
            .into_iter()
            .collect();
        while !chosen.is_empty() && chosen.len() < count {
            let nearest = |robot: &Robot| {
                chosen
                    .iter()
                    .map(|other| distance(robot, other))
                    .min()
                    .unwrap_or(0)
            };
            match able()
                .max_by_key(|robot| nearest(robot))
                .filter(|robot| nearest(robot) > 0)
            {
                Some(robot) => chosen.push(robot),
                None => break,
            }
        }
        chosen
    }
}

fn distance(a: &Robot, b: &Robot) -> usize {
    a.body
        .voxels()
        .cells()
        .iter()
        .zip(b.body.voxels().cells())
        .filter(|(a, b)| a != b)
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::names::RUN_JSON;
    use crate::store::samples;

    fn dossier(robots: &[(&str, f64)]) -> Dossier {
        let (path, run) = (PathBuf::from("run.json"), samples::run(robots));
        Dossier {
            path,
            namesake: None,
            run,
            progress: None,
            findings: Findings::default(),
            images: Vec::new(),
        }
    }

    #[test]
    fn the_most_different_begin_with_the_fittest_and_leave_out_who_fails() {
        let dossier = dossier(&[("a", 1.0), ("b", 9.0), ("c", -1.0), ("d", 2.0)]);
        let chosen: Vec<&str> = dossier
            .most_different(9)
            .iter()
            .map(|robot| robot.id.as_str())
            .collect();
        assert_eq!(chosen[0], "b");
        assert!(!chosen.contains(&"c") && chosen.len() <= 3, "{chosen:?}");
        let [a, d] =
            [0, 3].map(|place| distance(&dossier.run.elites[place], &dossier.run.elites[1]));
        assert_eq!(chosen.get(1), Some(&if d >= a { "d" } else { "a" }));
    }

    #[test]
    fn of_equals_the_first_is_the_best() {
        let dossier = dossier(&[("a", 1.0), ("b", 9.0), ("c", 9.0)]);
        assert_eq!(dossier.run.best().map(|robot| robot.id.as_str()), Some("b"));
        assert_eq!(dossier.most_different(1)[0].id, "b");
    }

    #[test]
    fn a_report_of_what_there_is_leaves_out_what_cannot_be_read() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(EVAL_JSON), "{").unwrap();
        let told = std::cell::RefCell::new(Vec::new());
        let here = [folder.path().join(RUN_JSON)];
        let findings = Findings::read(&here, &[], &|text| told.borrow_mut().push(text.to_string()));
        assert!(findings.eval.is_none() && findings.audit.is_none() && findings.capacity.is_none());
        assert!(
            told.borrow().len() == 1 && told.borrow()[0].contains("eval.json"),
            "{told:?}"
        );
    }
}
