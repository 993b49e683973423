//! `morphcog audit`: does a robot's behaviour survive changes that no honest walker should notice?

use crate::analysis::verdict::Behaviour;
use crate::base::error::Error;
use crate::base::files::alone_beside;
use crate::base::observer::Work;
use crate::base::remedy::Remedy;
use crate::base::session::Session;
use crate::base::text::counted;
use crate::body::Body;
use crate::config::Config;
use crate::config::audit::Criteria;
use crate::data::dataset::Split;
use crate::images::training::TrainingImages;
use crate::images::whereabouts::{Whereabouts, load_dataset_of, stimulus_of};
use crate::robots;
use crate::robots::published;
use crate::robots::selection::Selection;
use crate::sim::{Energy, StepError, System};
use crate::store::audit::{AuditFile, PerturbedRollout, RobotAudit};
use crate::store::folder;
use crate::store::folder::check_out;
use crate::store::names::AUDIT_JSON;
use crate::store::results::replaced;
use crate::store::run::{Robot, RunFile};
use crate::store::unwritten::Unwritten;
use crate::task::class_names::ClassNames;
use crate::task::evaluation::displacements_in;
use crate::task::fitness::Fitness;
use crate::task::grouping::Grouping;
use crate::task::perturbation::{Perturbation, PerturbedSetting};
use crate::task::rollout::walk;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Robots simulated side by side; finished ones are saved after each batch.
const BATCH: usize = 8;

/// Most training images per class in an audit: each is simulated some twenty times.
const IMAGES_PER_CLASS: usize = 16;

/// Options of an audit.
#[derive(Clone, Debug)]
pub struct AuditOptions {
    /// The run.json.
    pub archive: PathBuf,
    /// The robots to audit.
    pub robots: Selection,
    /// Seed of `random:N`.
    pub seed: u64,
    /// Criteria of the verdicts.
    pub criteria: Criteria,
    /// True if robots that have verdicts are audited again.
    pub fresh: bool,
    /// Path of the verdicts (audit.json; audit.csv goes beside it).
    pub out: PathBuf,
}

/// Result of an audit.
#[derive(Clone, Debug)]
pub struct AuditOutcome {
    /// The name of the run for people.
    pub(crate) called: String,
    pub(crate) file: AuditFile,
    /// Ids of the requested robots.
    pub(crate) asked: Vec<String>,
    /// Number of these that already had verdicts and were skipped.
    pub(crate) known: usize,
    /// Path of the verdicts that came with the run, if any were used.
    pub(crate) shipped: Option<PathBuf>,
    /// True if a signal stopped the audit before its last robot.
    pub stopped: bool,
    /// The error if the verdicts could not be written, or only in part.
    pub unwritten: Option<Error>,
}

struct Subject {
    id: String,
    task: String,
    body: Body,
    /// Its displacements in the run, if they must be the same here.
    known: Option<Vec<f64>>,
}

/// The parts of an audit that all robots of a source share.
struct Trial {
    config: Config,
    grouping: Grouping,
    training: TrainingImages,
    criteria: Criteria,
}

/// Audits robots. It reuses verdicts on the same robots by the same criteria: from the output file
/// and, at the default path, those that came with a named run. However often it is stopped, the
/// final file has the same bytes.
///
/// # Errors
/// Returns an error if the archive, data, selection or criteria are wrong.
pub fn audit(options: &AuditOptions, session: &Session) -> Result<AuditOutcome, Error> {
    let Opened {
        called,
        config,
        fitness,
        training,
        subjects,
        order,
        mut file,
    } = open(options, session)?;
    let grouping = config.grouping()?.with_fitness(fitness);
    let trial = Trial {
        grouping,
        training,
        criteria: options.criteria.clone(),
        config,
    };
    if let Some(earlier) = replaced::<AuditFile>(&options.out)?
        && earlier.run_sha256 == file.run_sha256
        && earlier.criteria != file.criteria
    {
        let count = counted(
            earlier.robots.len(),
            "robot of this run is",
            "robots of this run are",
        );
        let text = format!(
            "{}: {count} audited by other criteria",
            options.out.display()
        );
        return Err(Error::input(text)
            .remedy(Remedy::ChooseOut)
            .remedy(Remedy::MoveAway));
    }
    file.add_known(&options.out);
    let mut shipped = None;
    if options.out == folder::beside(&options.archive, AUDIT_JSON) {
        // Verdicts that came with a named run; for other runs, this is the same file.
        let (with_it, before) = (
            options.archive.with_file_name(AUDIT_JSON),
            file.robots.len(),
        );
        file.add_known(&with_it);
        shipped = Some(with_it).filter(|_| file.robots.len() > before);
    }
    let asked: Vec<String> = subjects.iter().map(|subject| subject.id.clone()).collect();
    let is_open = |subject: &Subject| options.fresh || file.robot(&subject.id).is_none();
    let open: Vec<Subject> = subjects.into_iter().filter(is_open).collect();
    let known = asked.len() - open.len();
    let rollouts: usize = open
        .iter()
        .map(|subject| 1 + trial.perturbations(subject).len())
        .sum();
    let rollouts = rollouts.div_ceil(session.ranks.size());
    let label = format!("auditing {}:", counted(open.len(), "robot", "robots"));
    session
        .observer
        .begins(&Work::new(label, rollouts as u64, "rollouts"));
    let pool = session.pool()?;
    let done = AtomicU64::new(0);
    let mut unwritten = Unwritten::default();
    let ranks = session.ranks;
    let write = |file: &mut AuditFile| {
        alone_beside(&options.out, || {
            // Another audit of this run may have written meanwhile.
            file.add_known(&options.out);
            file.robots
                .sort_by_key(|robot| order.iter().position(|id| *id == robot.id));
            file.write(&options.out)
        })
    };
    for batch in open.chunks(BATCH * ranks.size()) {
        let own = batch
            .par_iter()
            .enumerate()
            .filter(|(place, _)| place % ranks.size() == ranks.rank());
        let own: Vec<Option<RobotAudit>> = pool.install(|| {
            own.map(|(_, subject)| trial.robot(subject, session, &done))
                .collect()
        });
        let mut shares: Vec<_> = ranks.share(own).into_iter().map(Vec::into_iter).collect();
        let next = |place: usize| {
            shares[place % ranks.size()]
                .next()
                .expect("a rank audits all of its share")
        };
        let found: Vec<Option<RobotAudit>> = (0..batch.len()).map(next).collect();
        let stopped = found.iter().any(Option::is_none);
        for (subject, found) in batch.iter().zip(&found) {
            let walked = found.as_ref().map(|found| &found.displacements);
            if subject.known.is_some() && walked.is_some_and(|walked| *walked != subject.known) {
                let text = "walks otherwise here than its run says: another version of the program made that";
                session.observer.warning(&format!("{}: {text}", subject.id));
            }
        }
        for found in found.into_iter().flatten() {
            file.robots.retain(|before| before.id != found.id);
            file.robots.push(found);
        }
        if ranks.leads() && !file.robots.is_empty() {
            unwritten.tried(write(&mut file), session)?;
        }
        if stopped {
            return Ok(AuditOutcome {
                called,
                file,
                asked,
                known,
                shipped,
                stopped,
                unwritten: unwritten.error(),
            });
        }
    }
    if ranks.leads() {
        unwritten.tried(write(&mut file), session)?;
    }
    Ok(AuditOutcome {
        called,
        file,
        asked,
        known,
        shipped,
        stopped: false,
        unwritten: unwritten.error(),
    })
}

struct Opened {
    called: String,
    config: Config,
    fitness: Fitness,
    training: TrainingImages,
    subjects: Vec<Subject>,
    /// Ids of all robots of the run, in order.
    order: Vec<String>,
    /// Has no verdicts yet.
    file: AuditFile,
}

fn open(options: &AuditOptions, session: &Session) -> Result<Opened, Error> {
    let path = &options.archive;
    let source = robots::open(path)?;
    source.has_task()?;
    let run = &source.run;
    check_out(&options.out, path, AUDIT_JSON)?;
    let whereabouts = Whereabouts::given(session.data_folder()).and_of(path);
    let training = training_of(run, path, &whereabouts)?;
    // A training may have had other conditions than the protocol, which the audit follows;
    // published robots come with their fitness only.
    let is_known = run.follows_protocol()
        && training.images == run.training_images
        && *path != published::archive();
    let subject = |robot: &Robot| Subject {
        id: robot.id.clone(),
        task: robot.task.clone(),
        body: robot.body.clone(),
        known: is_known.then(|| robot.displacements.clone()),
    };
    let mut subjects: Vec<Subject> = Vec::new();
    for chosen in options
        .robots
        .of(std::slice::from_ref(&source), options.seed)?
    {
        if subjects.iter().all(|other| other.id != chosen.robot.id) {
            subjects.push(subject(chosen.robot));
        }
    }
    let order: Vec<String> = run.elites.iter().map(|robot| robot.id.clone()).collect();
    let file = AuditFile::new(&run.name, run.fingerprint(), order.len(), &options.criteria);
    let (config, fitness) = (run.config.clone(), run.fitness());
    Ok(Opened {
        called: run.called().to_string(),
        config,
        fitness,
        training,
        subjects,
        order,
        file,
    })
}

/// Returns the first images per class that a run's robots were evolved on. With other data,
/// verdicts would mean nothing.
fn training_of(
    run: &RunFile,
    path: &Path,
    whereabouts: &Whereabouts,
) -> Result<TrainingImages, Error> {
    let dataset = load_dataset_of(
        Some(&run.dataset),
        &run.config,
        whereabouts,
        &[Split::Train],
    )?;
    let mut taken = [0; 256];
    let mut images = run.training_images.clone();
    images.retain(|image| {
        let taken = &mut taken[usize::from(image.label)];
        *taken += 1;
        *taken <= IMAGES_PER_CLASS
    });
    let see = |image: &crate::store::images::ImageRef| {
        let seen = stimulus_of(&run.config, &dataset, Split::Train, image.index);
        seen.map_err(|error| {
            error
                .in_place("training_images")
                .in_place(&path.display().to_string())
        })
    };
    let (dataset, stimuli) = (
        run.dataset.clone(),
        images.iter().map(see).collect::<Result<Vec<_>, Error>>(),
    );
    let names = ClassNames::default();
    // As in a test, all rollouts have the same conditions, however the robot was trained.
    let conditions = Vec::new();
    Ok(TrainingImages {
        dataset,
        images,
        stimuli: stimuli?,
        names,
        conditions,
    })
}

impl Trial {
    fn perturbations(&self, subject: &Subject) -> Vec<Perturbation> {
        Perturbation::all(
            &self.criteria.perturbations,
            &subject.body,
            self.config.protocol.rollout,
        )
    }

    /// Audits one robot; returns `None` if stopped.
    fn robot(&self, subject: &Subject, session: &Session, done: &AtomicU64) -> Option<RobotAudit> {
        let count = |rollouts: usize| {
            session
                .observer
                .progress(done.fetch_add(rollouts as u64, Ordering::Relaxed) + rollouts as u64);
        };
        let setting = PerturbedSetting {
            body: subject.body.clone(),
            physics: self.config.physics.clone(),
            protocol: self.config.protocol.clone(),
            stimuli: self.training.stimuli.clone(),
        };
        let system = Arc::new(System::new(&setting.body, setting.physics.clone()));
        let plain = StepError::outcome(walk(
            &system,
            &setting.protocol,
            &setting.stimuli,
            true,
            session.stop,
        ))
        .ok()?
        .ok();
        count(1);
        let (displacements, energy) =
            plain.map_or((None, Energy::default()), |(d, e)| (Some(d), e));
        let classes: Vec<u8> = self
            .training
            .images
            .iter()
            .map(|image| image.label)
            .collect();
        let still = vec![0.0; classes.len()];
        let split = self
            .grouping
            .tasks()
            .iter()
            .find(|split| split.is_called(&subject.task));
        // Robots of a run were checked to have one of its tasks.
        let split = split.unwrap_or(&self.grouping.tasks()[0]);
        let behaviour = Behaviour::new(
            &self.criteria,
            (split, self.grouping.fitness()),
            &classes,
            displacements.clone().unwrap_or(still),
        );
        let rollout = |perturbation: &Perturbation| {
            let walked = displacements_in(&perturbation.apply(&setting), session).ok()?;
            let walked = walked.map(|displacements| perturbation.undo(displacements));
            count(1);
            Some(behaviour.compare(perturbation.name(), perturbation.kind(), walked))
        };
        let perturbations = self.perturbations(subject);
        let rollouts: Vec<PerturbedRollout> = match behaviour.is_walker() {
            true => {
                let rollouts: Option<Vec<_>> = perturbations.par_iter().map(rollout).collect();
                let counts = |(rollout, perturbation): &(PerturbedRollout, &Perturbation)| {
                    rollout.displacements.is_some() || perturbation.counts_if_unstable()
                };
                rollouts?
                    .into_iter()
                    .zip(&perturbations)
                    .filter(counts)
                    .map(|(rollout, _)| rollout)
                    .collect()
            }
            false => {
                session.observer.skips(perturbations.len() as u64);
                count(perturbations.len());
                Vec::new()
            }
        };
        let (verdict, reason) = behaviour.judge(&rollouts);
        let persisting = rollouts.iter().filter(|rollout| rollout.persists).count() as f64;
        let steps = f64::from(setting.protocol.control_steps) * setting.stimuli.len() as f64;
        let cycles = steps / f64::from(setting.physics.cycle_steps);
        Some(RobotAudit {
            id: subject.id.clone(),
            task: subject.task.clone(),
            verdict,
            reason,
            persisting: persisting / rollouts.len().max(1) as f64,
            spread: behaviour.spread(&rollouts),
            energy_per_cycle: Energy {
                drive: energy.drive / cycles,
                limits: energy.limits / cycles,
            },
            displacements,
            rollouts,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Grid;
    use crate::base::stop::NEVER;
    use crate::config::BUILT_IN;
    use crate::sim::Physics;
    use crate::store::audit::Verdict;
    use crate::store::images::{DatasetRef, ImageRef};
    use crate::task::protocol::{Protocol, RolloutMode};
    use std::sync::atomic::AtomicBool;

    /// Two images, of classes 0 (dark) and 1 (bright), each in a fresh rollout of five cycles.
    fn trial(height: usize, width: usize, physics: Physics) -> Trial {
        let set = [
            "task={splits=[0,1],same_way_bin=true}",
            "protocol.control_steps=250",
        ]
        .map(str::to_string);
        let mut config = Config::parse(BUILT_IN[0].1, BUILT_IN[0].0, &set).unwrap();
        config.physics = physics;
        let criteria = Criteria::default();
        let dataset = DatasetRef {
            name: "none".to_string(),
            train_sha256: String::new(),
        };
        let images = [0, 1]
            .map(|label| ImageRef {
                index: usize::from(label),
                label,
            })
            .to_vec();
        let stimuli = [0.0, 1.0]
            .map(|pixel| Grid::filled(height, width, pixel))
            .to_vec();
        Trial {
            grouping: config.grouping().unwrap(),
            training: TrainingImages {
                dataset,
                images,
                stimuli,
                names: ClassNames::default(),
                conditions: Vec::new(),
            },
            criteria,
            config,
        }
    }

    fn audited(body: &str, task: &str, physics: Physics) -> RobotAudit {
        let body: Body = body.parse().unwrap();
        let trial = trial(body.height(), body.width(), physics);
        let subject = Subject {
            id: "x".to_string(),
            task: task.to_string(),
            body,
            known: None,
        };
        trial
            .robot(&subject, &Session::default(), &AtomicU64::new(0))
            .unwrap()
    }

    /// Muscles of opposite phases above and below, a soft front and a rigid foot: it walks right.
    const WALKER: &str = "444422/444422/333311/330011";

    #[test]
    fn a_symmetric_passive_block_is_not_a_walker() {
        for task in ["same way", "0|1"] {
            let found = audited("1221/1221", task, Physics::default());
            assert_eq!(found.verdict, Verdict::NotAWalker, "{found:?}");
            assert!(
                found.reason.contains("the correct way for 0"),
                "{}",
                found.reason
            );
            assert!(found.rollouts.is_empty() && found.energy_per_cycle.drive == 0.0);
        }
    }

    #[test]
    fn a_plain_walker_is_physical() {
        let found = audited(WALKER, "same way", Physics::default());
        assert_eq!(found.verdict, Verdict::Physical, "{found:#?}");
        assert_eq!((found.persisting, found.rollouts.len()), (1.0, 14));
        assert!(found.displacements.unwrap().iter().all(|d| *d > 5.0));
        assert!(found.spread < 1.0 && found.energy_per_cycle.drive > 0.0);
        // It sees nothing, so it cannot tell classes apart.
        assert_eq!(
            audited(WALKER, "0|1", Physics::default()).verdict,
            Verdict::NotAWalker
        );
    }

    #[test]
    fn a_stopped_audit_has_no_verdict() {
        let body: Body = WALKER.parse().unwrap();
        let trial = trial(body.height(), body.width(), Physics::default());
        let subject = Subject {
            id: "x".to_string(),
            task: "same way".to_string(),
            body,
            known: None,
        };
        assert!(
            trial
                .robot(
                    &subject,
                    &Session::new(&AtomicBool::new(true), &()),
                    &AtomicU64::new(0)
                )
                .is_none()
        );
    }

    #[test]
    fn images_that_are_the_same_to_the_sensors_are_one_rollout_with_the_same_end() {
        // Its one sensor sees the top right pixel; the images differ elsewhere too.
        let body: Body = "444425/444422/333311/330011".parse().unwrap();
        let image = |sensed: f64, other: f64| {
            Grid::from_fn(4, 6, |r, c| if (r, c) == (0, 5) { sensed } else { other })
        };
        let stimuli = vec![
            image(0.0, 0.0),
            image(1.0, 0.0),
            image(0.0, 1.0),
            image(1.0, 1.0),
            image(0.0, 0.5),
        ];
        let Trial { config, .. } = trial(4, 6, Physics::default());
        let setting = PerturbedSetting {
            body,
            physics: config.physics,
            protocol: config.protocol,
            stimuli,
        };
        let displacements = displacements_in(&setting, &Session::default())
            .unwrap()
            .unwrap();
        let system = Arc::new(System::new(&setting.body, setting.physics.clone()));
        let (all, _) = walk(&system, &setting.protocol, &setting.stimuli, true, &NEVER).unwrap();
        assert_eq!(displacements, all);
        assert_ne!(all[0], all[1], "it sees something");
        let sequential = PerturbedSetting {
            protocol: Protocol {
                rollout: RolloutMode::Sequential,
                ..setting.protocol.clone()
            },
            ..setting
        };
        let displacements = displacements_in(&sequential, &Session::default())
            .unwrap()
            .unwrap();
        assert_eq!(displacements.len(), 5);
        assert_ne!(
            displacements[0], displacements[2],
            "what comes later begins elsewhere"
        );
    }

    #[test]
    fn verdicts_that_another_audit_wrote_meanwhile_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(AUDIT_JSON);
        let file = |sha: &str, ids: &[&str]| {
            let robot = |id: &&str| RobotAudit {
                id: id.to_string(),
                ..audited("1", "0|1", Physics::default())
            };
            let robots = ids.iter().map(robot).collect();
            AuditFile {
                robots,
                ..AuditFile::new("run", sha.to_string(), 3, &Criteria::default())
            }
        };
        let ids = |file: &AuditFile| {
            file.robots
                .iter()
                .map(|robot| robot.id.clone())
                .collect::<Vec<_>>()
        };
        let mut ours = file("a", &["x", "y"]);
        ours.add_known(&path);
        assert_eq!(ids(&ours), ["x", "y"]);
        file("a", &["y", "z"]).write(&path).unwrap();
        ours.add_known(&path);
        assert_eq!(ids(&ours), ["x", "y", "z"]);
        // From another state of the run.
        let mut other = file("b", &["x"]);
        other.add_known(&path);
        assert_eq!(ids(&other), ["x"]);
    }
}
