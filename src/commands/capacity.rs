//! `morphcog capacity`: finds networks as accurate as robots ("Morphological cognition capacity" of
//! the paper).

pub(crate) mod images;

use crate::base::error::{Error, ErrorKind};
use crate::base::hash::sha256_hex;
use crate::base::observer::Work;
use crate::base::remedy::{Invocation, Remedy};
use crate::base::session::Session;
use crate::base::statistics::standard_deviation;
use crate::base::text::counted;
use crate::baseline::{NetworkKind, Pooling, Trained, curve};
use crate::commands::capacity::images::{Images, Task};
use crate::config::capacity::CapacityConfig;
use crate::store::audit::AuditFile;
use crate::store::capacity::{CapacityFile, Curve, FORMAT, FORMAT_VERSION, Point, TaskCapacity};
use crate::store::eval::{EvalFile, RobotReport};
use crate::store::folder::check_out;
use crate::store::images::HeldOut;
use crate::store::names::{CAPACITY_JSON, FigureFormat, RUN_JSON};
use crate::store::results::{replaced, write_with_table};
use crate::store::run::RunFile;
use crate::store::setting::{RunRef, RunSetting};
use crate::store::trainings::Trainings;
use crate::store::unwritten::Unwritten;
use crate::task::class_names::ClassNames;
use crate::task::fitness::Group;
use crate::task::grouping::{self};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Options of the comparison with networks.
#[derive(Clone, Debug)]
pub struct CapacityOptions {
    /// The eval.json.
    pub eval: PathBuf,
    /// Settings of the networks and their training.
    pub config: CapacityConfig,
    /// True if only robots count that an audit found physical.
    pub physical_only: bool,
    /// Path of the results (capacity.json; other files go beside it).
    pub out: PathBuf,
}

/// Result of the comparison.
#[derive(Clone, Debug)]
pub struct CapacityOutcome {
    /// The content of capacity.json.
    pub file: CapacityFile,
    pub(crate) unwritten: Option<Error>,
}

/// Finds the capacity of evaluated robots. Trainings are kept beside the results and reused.
///
/// # Errors
/// Returns an error if the evaluation, data or settings are wrong.
pub fn capacity(options: &CapacityOptions, session: &Session) -> Result<CapacityOutcome, Error> {
    let report = EvalFile::read(&options.eval)?;
    let setting = comparable(&report, options, session)?;
    let config = &options.config;
    kernel_fits(config, setting)?;
    check_out(&options.out, &options.eval, CAPACITY_JSON)?;
    if FigureFormat::beside(&options.out).contains(&options.out) {
        let text = "expected another ending: the figure beside the results has that name";
        return Err(Error::argument("out", options.out.display(), text));
    }
    replaced::<CapacityFile>(&options.out)?;
    let robots = robots(&report, options)?;
    let images = Images::of(&report, setting, (&options.eval, config), session)?;
    let names = ClassNames::of(&setting.data.class_names);
    let grouping = setting.task.grouping()?.named(&names);
    let of_split = |split: &grouping::ClassSplit| -> Vec<&RobotReport> {
        robots
            .iter()
            .copied()
            .filter(|robot| split.is_called(&robot.task))
            .collect()
    };
    let splits: Vec<&grouping::ClassSplit> = grouping
        .tasks()
        .iter()
        .filter(|split| !of_split(split).is_empty())
        .collect();
    let known = Trainings::read(&options.out)?;
    let mut networks = Networks {
        config,
        images: &images,
        known,
        unkept: Unwritten::default(),
        done: AtomicU64::new(0),
        pool: session.pool()?,
        session,
    };
    networks.begin(&splits);
    let mut file = CapacityFile {
        format: FORMAT.to_string(),
        format_version: FORMAT_VERSION,
        program_version: env!("CARGO_PKG_VERSION").to_string(),
        run: report.run.clone(),
        eval_sha256: Some(report.fingerprint()),
        selected: report.selection(),
        dataset: report.dataset.clone(),
        patience_on: if config.clean { "validation" } else { "test" }.to_string(),
        trainings: config.trainings,
        physical_only: options.physical_only,
        stopped: false,
        tasks: Vec::new(),
    };
    let mut unwritten = Unwritten::default();
    for split in splits {
        let of_task = of_split(split);
        let accuracies = by_run(&of_task);
        let Some(curves) = networks.curves(split, &accuracies)? else {
            file.stopped = true;
            break;
        };
        file.tasks.push(TaskCapacity {
            task: of_task[0].task.clone(),
            robots: of_task.len(),
            accuracy: mean(&accuracies),
            curves,
        });
        unwritten.tried(write(options, &file), session)?;
    }
    // Results up to the stop are better than none.
    if file.stopped && !file.tasks.is_empty() {
        unwritten.tried(write(options, &file), session)?;
    }
    Ok(CapacityOutcome {
        file,
        unwritten: unwritten.error().or(networks.unkept.error()),
    })
}

/// Returns the setting of an evaluation, or an error if no networks can be compared with it.
fn comparable<'a>(
    report: &'a EvalFile,
    options: &CapacityOptions,
    session: &Session,
) -> Result<&'a RunSetting, Error> {
    let name = options.eval.display();
    let Some(setting) = &report.setting else {
        let text = format!("{name}: expected \"setting\": an earlier version wrote it");
        return Err(
            Error::input(text).remedy(Remedy::Run(Invocation::new("eval"), "makes a new one"))
        );
    };
    if report.split != HeldOut::Test {
        let text = format!(
            "{name}: expected an evaluation on test images, found one on {} images",
            report.split
        );
        return Err(Error::input(text).remedy(Remedy::Run(
            Invocation::new("eval").option("split", "test"),
            "makes such a one",
        )));
    }
    if let Some(own) = &report.trained_on {
        let text = format!(
            "{name}: expected an evaluation on images of the data that the robots were trained on ({}), found one \
             on {}",
            own.name, report.dataset
        );
        return Err(Error::input(text).remedy(Remedy::Run(
            Invocation::new("eval"),
            "shows those, if it names no dataset",
        )));
    }
    if report.runs.is_empty() {
        let text = format!(
            "{name}: runs: expected one or more, whose training images networks learn from"
        );
        return Err(
            Error::input(text).remedy(Remedy::Run(Invocation::new("eval"), "makes a new one"))
        );
    }
    if let [of] = report.runs.as_slice()
        && let Ok(run) = RunFile::read(&options.eval.with_file_name(RUN_JSON))
        && run.fingerprint() != of.sha256
    {
        session.observer.warning(&format!(
            "{name}: stale: the run beside it is another one, or has gone on since"
        ));
    }
    if report.stopped {
        session.observer.warning(&format!(
            "{name}: the evaluation was stopped before its last robot"
        ));
    }
    Ok(setting)
}

/// Refuses kernels that leave nothing of the images to pool.
fn kernel_fits(config: &CapacityConfig, setting: &RunSetting) -> Result<(), Error> {
    let side = setting.body.height.min(setting.body.width);
    let (kernel, pooling) = (config.cnn.kernel, config.cnn.pooling);
    let most = if pooling == Pooling::Max2 {
        side.saturating_sub(1)
    } else {
        side
    };
    if kernel > most && config.networks.contains(&NetworkKind::Cnn) {
        let of = format!("with images of {side} pixels and pooling {pooling:?}").to_lowercase();
        return Err(Error::input(format!(
            "capacity: cnn.kernel = {kernel}: expected up to {most}, {of}"
        )));
    }
    Ok(())
}

/// Hashes all that the trainings of a kind of network depend on; `images` names their images.
fn key(
    split: &grouping::ClassSplit,
    kind: NetworkKind,
    config: &CapacityConfig,
    images: &str,
) -> String {
    let groups = [Group::A, Group::B].map(|group| split.classes(group));
    // Other arithmetic gives other trainings, so those of networks in f32 must not match.
    let by = concat!(env!("CARGO_PKG_VERSION"), " in f64");
    let all = (
        by,
        groups,
        kind.name(),
        config.of(kind),
        images,
        config.seed,
    );
    sha256_hex(
        serde_json::to_string(&all)
            .expect("JSON has all of it")
            .as_bytes(),
    )
}

struct Networks<'a> {
    config: &'a CapacityConfig,
    images: &'a Images,
    known: Trainings,
    unkept: Unwritten,
    /// Number of trainings done.
    done: AtomicU64,
    pool: &'a rayon::ThreadPool,
    session: &'a Session<'a>,
}

impl Networks<'_> {
    fn key(&self, split: &grouping::ClassSplit, kind: NetworkKind) -> String {
        key(split, kind, self.config, &self.images.key)
    }

    /// Reports how many networks there are to train, and how many are known.
    fn begin(&self, splits: &[&grouping::ClassSplit]) {
        let Networks { config, known, .. } = self;
        let of_one = |(split, kind): (&grouping::ClassSplit, NetworkKind)| -> usize {
            let key = self.key(split, kind);
            config
                .sizes()
                .map(|size| known.of(&key, size).len().min(config.trainings))
                .sum()
        };
        let kinds = |split| config.networks.iter().map(move |kind| (split, *kind));
        let before = splits
            .iter()
            .copied()
            .flat_map(kinds)
            .map(of_one)
            .sum::<usize>() as u64;
        let per_task = config.networks.len() * config.sizes().count() * config.trainings;
        let total = (splits.len() * per_task) as u64;
        let kept = if before > 0 {
            format!(" ({before} known from before)")
        } else {
            String::new()
        };
        let label = format!("training {}{kept}:", counted(total, "network", "networks"));
        let work = Work::new(label, total, "trainings");
        self.session.observer.begins(&Work {
            known: before,
            ..work
        });
        self.done.store(before, Ordering::Relaxed);
    }

    /// Returns the curves of a task whose robots have these accuracies, or `None` if stopped.
    fn curves(
        &mut self,
        split: &grouping::ClassSplit,
        robots: &[Vec<f64>],
    ) -> Result<Option<Vec<Curve>>, Error> {
        let config = self.config;
        let mut curves = Vec::new();
        for &kind in &config.networks {
            let key = self.key(split, kind);
            let samples = Task::new(split, kind, config, self.images)?;
            for size in config.sizes() {
                if !self.train(&samples, &key, size)? {
                    return Ok(None);
                }
            }
            let trained = |size| (size, &self.known.of(&key, size)[..config.trainings]);
            let trained: Vec<_> = config.sizes().map(trained).collect();
            curves.push(curve_of(kind, &trained, robots));
        }
        Ok(Some(curves))
    }

    /// Trains the networks of a size that are not known yet, and stores them. Returns false if
    /// stopped.
    fn train(&mut self, samples: &Task, key: &str, size: usize) -> Result<bool, Error> {
        let Networks {
            config,
            session,
            done,
            pool,
            ..
        } = &*self;
        let open = self.known.of(key, size).len()..config.trainings;
        let train = |number: usize| {
            let trained = samples.train(size, config, number, session)?;
            session
                .observer
                .progress(done.fetch_add(1, Ordering::Relaxed) + 1);
            Ok(trained)
        };
        let trained: Vec<Result<Trained, Error>> =
            pool.install(|| open.into_par_iter().map(train).collect());
        // Trainings are kept in order: those before the first that was stopped.
        let (mut finished, mut goes_on) = (Vec::new(), true);
        for trained in trained {
            match trained {
                Ok(trained) => finished.push(trained),
                Err(error) if error.kind == ErrorKind::Stopped => {
                    goes_on = false;
                    break;
                }
                Err(error) => return Err(error),
            }
        }
        if !finished.is_empty() {
            self.known.extend(key, size, &finished);
            self.unkept.tried(self.known.write(), self.session)?;
        }
        Ok(goes_on)
    }
}

/// Returns the accuracies of robots, by run: robots of one run are not independent.
fn by_run(robots: &[&RobotReport]) -> Vec<Vec<f64>> {
    let mut runs: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for robot in robots {
        runs.entry(robot.run).or_default().push(robot.accuracy);
    }
    runs.into_values().collect()
}

fn mean(robots: &[Vec<f64>]) -> f64 {
    let accuracies = robots.concat();
    accuracies.iter().sum::<f64>() / accuracies.len() as f64
}

fn point(size: usize, trained: &[(f64, usize)]) -> Point {
    let accuracies: Vec<f64> = trained.iter().map(|(accuracy, _)| *accuracy).collect();
    let mean = accuracies.iter().sum::<f64>() / accuracies.len().max(1) as f64;
    let parameters = trained.first().map_or(0, |(_, parameters)| *parameters);
    Point {
        size,
        mean,
        standard_deviation: standard_deviation(&accuracies),
        parameters,
    }
}

fn curve_of(kind: NetworkKind, trained: &[(usize, &[(f64, usize)])], robots: &[Vec<f64>]) -> Curve {
    let points: Vec<Point> = trained
        .iter()
        .map(|(size, trained)| point(*size, trained))
        .collect();
    let means: Vec<(f64, f64)> = points
        .iter()
        .map(|point| (point.size as f64, point.mean))
        .collect();
    let (fit, capacity) = curve::fit_and_crossing(&means, mean(robots));
    let accuracies = |(size, trained): &(usize, &[(f64, usize)])| {
        let of_all = trained.iter().map(|(accuracy, _)| *accuracy).collect();
        (*size as f64, of_all)
    };
    let samples: Vec<(f64, Vec<f64>)> = trained.iter().map(accuracies).collect();
    Curve {
        network: kind.name().to_string(),
        points,
        fit,
        capacity,
        interval: curve::crossing_interval(&samples, robots),
    }
}

fn write(options: &CapacityOptions, file: &CapacityFile) -> Result<(), Error> {
    let figures = FigureFormat::beside(&options.out);
    write_with_table(&options.out, &file.to_json(), &file.to_csv(), figures)
}

/// Returns the robots that count, all or the physical ones.
fn robots<'a>(
    report: &'a EvalFile,
    options: &CapacityOptions,
) -> Result<Vec<&'a RobotReport>, Error> {
    let name = options.eval.display();
    if report.robots.is_empty() {
        return Err(Error::input(format!("{name}: there is no robot in it")));
    }
    if !options.physical_only {
        return Ok(report.robots.iter().collect());
    }
    let folder = options.eval.parent().unwrap_or(Path::new(""));
    let audit = |run: &RunRef| match &run.archive {
        Some(archive) => AuditFile::of_state(&run.sha256, &Path::new(archive).join(RUN_JSON)),
        None => AuditFile::near(folder, &run.sha256),
    };
    let audits: Result<Vec<_>, Error> = report.runs.iter().map(audit).collect();
    let audits = audits?;
    let mut physical: Vec<&RobotReport> = Vec::new();
    for robot in &report.robots {
        match audits
            .get(robot.run)
            .and_then(|audit| audit.robot(&robot.id))
        {
            Some(found) if found.is_physical() => physical.push(robot),
            Some(_) => {}
            None => {
                let text = format!("{name}: robot {} has not been audited", robot.id);
                let audit = Invocation::new("audit");
                let remedy = Remedy::Run(audit, "goes on with the robots that are missing");
                return Err(Error::input(text).remedy(remedy));
            }
        }
    }
    if physical.is_empty() {
        return Err(Error::input(format!(
            "{name}: none of {} is physical",
            counted(report.robots.len(), "robot", "robots")
        )));
    }
    Ok(physical)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::grouping::Grouping;

    #[test]
    fn trainings_are_known_again_by_all_that_they_depend_on() {
        let config = CapacityConfig::default();
        let of = |groups: [&[u8]; 2], kind: NetworkKind, config: &CapacityConfig, images: &str| {
            let grouping = Grouping::two_groups(groups[0], groups[1]).unwrap();
            key(&grouping.tasks()[0], kind, config, images)
        };
        let other_seed = CapacityConfig {
            seed: config.seed + 1,
            ..config.clone()
        };
        let keys = [
            of([&[1], &[26]], NetworkKind::Mlp, &config, "a"),
            // A class of two digits is not two classes of one digit.
            of([&[1], &[2, 6]], NetworkKind::Mlp, &config, "a"),
            of([&[1], &[26]], NetworkKind::Cnn, &config, "a"),
            of([&[1], &[26]], NetworkKind::Mlp, &config, "b"),
            of([&[1], &[26]], NetworkKind::Mlp, &other_seed, "a"),
        ];
        let different: std::collections::BTreeSet<&String> = keys.iter().collect();
        assert_eq!(different.len(), keys.len());
    }
}
