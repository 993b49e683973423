//! `morphcog capacity`: the networks that the robots are worth (paper, "Morphological cognition
//! capacity").

use crate::analysis::gallery;
use crate::base::error::{Error, ErrorKind};
use crate::base::hash::sha256_hex;
use crate::base::observer::{Observer, Work};
use crate::base::statistics::standard_deviation;
use crate::base::threads::pool;
use crate::baseline::{Kind, Pooling, Trained, curve};
use crate::commands::capacity_images::{Images, Task};
use crate::config::capacity::CapacityConfig;
use crate::store::audit::AuditFile;
use crate::store::capacity::{CapacityFile, Curve, FORMAT, FORMAT_VERSION, Point, TaskCapacity};
use crate::store::eval::{EvalFile, RobotReport};
use crate::store::folder::check_out;
use crate::store::images::HeldOut;
use crate::store::names::{CAPACITY_JSON, RUN_JSON};
use crate::store::results::write_with_table;
use crate::store::run::RunFile;
use crate::store::trainings::Trainings;
use crate::store::unwritten::Unwritten;
use crate::task::grouping;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Endings of the figure beside the results.
pub const FIGURES: [&str; 2] = ["svg", "png"];

/// What to compare with what.
#[derive(Clone, Debug)]
pub struct Options {
    /// The eval.json.
    pub eval: PathBuf,
    /// What is trained.
    pub config: CapacityConfig,
    /// Whether only robots count that an audit found physical.
    pub physical_only: bool,
    /// Where the data are, if the command line says.
    pub data: Option<PathBuf>,
    /// Where the results go (capacity.json; others beside it).
    pub out: PathBuf,
    /// Number of threads; `None`: one per core.
    pub threads: Option<usize>,
}

/// How it ended.
#[derive(Clone, Debug)]
pub struct Finished {
    /// The content of capacity.json.
    pub file: CapacityFile,
    /// Why that, or what was trained, is not, or not as a whole, in its file, if so.
    pub unwritten: Option<Error>,
}

/// Finds the capacity of evaluated robots. What was trained before is kept beside the results and
/// not trained again.
///
/// # Errors
/// What is wrong with the evaluation, the data or the settings.
pub fn capacity(options: &Options, stop: &AtomicBool, observer: &dyn Observer) -> Result<Finished, Error> {
    let report = EvalFile::read(&options.eval)?;
    let name = options.eval.display();
    let Some(setting) = &report.setting else {
        let text = format!("{name}: expected \"setting\": an earlier version wrote it");
        return Err(Error::input(text).hint("run morphcog eval again".to_string()));
    };
    if report.split != HeldOut::Test {
        let text =
            format!("{name}: expected an evaluation on test images, found one on {} images", report.split);
        return Err(Error::input(text).hint("morphcog eval --split test".to_string()));
    }
    if let Some(own) = &report.trained_on {
        let text = format!(
            "{name}: expected an evaluation on images of the data that the robots were trained on ({}), found one \
             on {}",
            own.name, report.dataset
        );
        return Err(Error::input(text).hint("morphcog eval without --dataset".to_string()));
    }
    if report.runs.is_empty() {
        let text = format!("{name}: runs: expected one or more, whose training images networks learn from");
        return Err(Error::input(text).hint("run morphcog eval again".to_string()));
    }
    if let [of] = report.runs.as_slice()
        && let Ok(run) = RunFile::read(&options.eval.with_file_name(RUN_JSON))
        && run.fingerprint() != of.sha256
    {
        observer.warning(&format!("{name}: stale: the run beside it is another one, or has gone on since"));
    }
    if report.stopped {
        observer.warning(&format!("{name}: the evaluation was stopped before its last robot"));
    }
    let config = &options.config;
    let side = setting.body.height.min(setting.body.width);
    let (kernel, pooling) = (config.cnn.kernel, config.cnn.pooling);
    // Something must be left to pool.
    let most = if pooling == Pooling::Max2 { side.saturating_sub(1) } else { side };
    if kernel > most && config.networks.contains(&Kind::Cnn) {
        let of = format!("with images of {side} pixels and pooling {pooling:?}").to_lowercase();
        return Err(Error::input(format!("capacity: cnn.kernel = {kernel}: expected up to {most}, {of}")));
    }
    check_out(&options.out, &options.eval, CAPACITY_JSON)?;
    if FIGURES.iter().any(|ending| options.out.with_extension(ending) == options.out) {
        let text = format!("--out {}: expected another ending", options.out.display());
        return Err(Error::usage(format!("{text}: the figure beside the results has that name")));
    }
    let robots = robots(&report, options)?;
    let images = Images::of(&report, setting, options)?;
    let grouping = setting.task.grouping()?;
    let splits: Vec<&grouping::Split> = grouping
        .tasks()
        .iter()
        .filter(|split| robots.iter().any(|robot| robot.task == split.name()))
        .collect();
    let per_task = config.networks.len() * config.sizes().count() * config.trainings;
    let mut known = Trainings::read(&options.out)?;
    let jobs = splits.iter().flat_map(|split| config.networks.iter().map(move |&kind| (*split, kind)));
    let key = |split: &grouping::Split, kind: Kind| {
        let hyper = serde_json::to_string(config.of(kind)).expect("JSON has all of it");
        sha256_hex(
            format!("{} {} {hyper} {} {}", split.name(), kind.name(), images.key, config.seed).as_bytes(),
        )
    };
    let already = jobs.flat_map(|(split, kind)| {
        let key = key(split, kind);
        let known = &known;
        config.sizes().map(move |size| known.of(&key, size).len().min(config.trainings)).collect::<Vec<_>>()
    });
    let done = AtomicU64::new(already.sum::<usize>() as u64);
    let (total, before) = ((splits.len() * per_task) as u64, done.load(Ordering::Relaxed));
    let kept = if before > 0 { format!(" ({before} known from before)") } else { String::new() };
    let label = format!("training {total} networks{kept}:");
    observer.begins(&Work { label, total, known: before, unit: "trainings" });
    let pool = pool(options.threads)?;
    let mut file = CapacityFile {
        format: FORMAT.to_string(),
        format_version: FORMAT_VERSION,
        program_version: env!("CARGO_PKG_VERSION").to_string(),
        run: report.run.clone(),
        selected: report.selected.clone(),
        dataset: report.dataset.clone(),
        patience_on: if config.clean { "validation" } else { "test" }.to_string(),
        trainings: config.trainings,
        physical_only: options.physical_only,
        stopped: false,
        tasks: Vec::new(),
    };
    let [mut unkept, mut unwritten] = <[Unwritten; 2]>::default();
    'tasks: for split in splits {
        let of_task: Vec<f64> =
            robots.iter().filter(|robot| robot.task == split.name()).map(|robot| robot.accuracy).collect();
        let accuracy = of_task.iter().sum::<f64>() / of_task.len() as f64;
        let mut curves = Vec::new();
        for &kind in &config.networks {
            let key = key(split, kind);
            let samples = Task::new(split, kind, config, &images)?;
            let mut points = Vec::new();
            for size in config.sizes() {
                let open = known.of(&key, size).len()..config.trainings;
                let train = |number: usize| {
                    let trained = samples.train(size, config, number, stop)?;
                    observer.progress(done.fetch_add(1, Ordering::Relaxed) + 1);
                    Ok(trained)
                };
                let trained: Vec<Result<Trained, Error>> =
                    pool.install(|| open.into_par_iter().map(train).collect());
                // Trainings are kept in their order: those before the first that was stopped.
                let mut finished = Vec::new();
                for trained in trained {
                    match trained {
                        Ok(trained) => finished.push(trained),
                        Err(error) if error.kind == ErrorKind::Stopped => {
                            file.stopped = true;
                            break;
                        }
                        Err(error) => return Err(error),
                    }
                }
                if !finished.is_empty() {
                    known.extend(&key, size, &finished);
                    unkept.tried(known.write(), |text| observer.warning(text));
                }
                if file.stopped {
                    break 'tasks;
                }
                points.push(point(size, &known.of(&key, size)[..config.trainings]));
            }
            curves.push(curve_of(kind, points, accuracy));
        }
        file.tasks.push(TaskCapacity { task: split.name(), robots: of_task.len(), accuracy, curves });
        unwritten.tried(write(options, &file), |text| observer.warning(text));
    }
    // What was found before is better than nothing.
    if !file.tasks.is_empty() {
        unwritten.tried(write(options, &file), |text| observer.warning(text));
    }
    Ok(Finished { file, unwritten: unwritten.error().or(unkept.error()) })
}

fn point(size: usize, trained: &[(f64, usize)]) -> Point {
    let accuracies: Vec<f64> = trained.iter().map(|(accuracy, _)| *accuracy).collect();
    let mean = accuracies.iter().sum::<f64>() / accuracies.len().max(1) as f64;
    let parameters = trained.first().map_or(0, |(_, parameters)| *parameters);
    Point { size, mean, standard_deviation: standard_deviation(&accuracies), parameters }
}

fn curve_of(kind: Kind, points: Vec<Point>, accuracy: f64) -> Curve {
    let means: Vec<(f64, f64)> = points.iter().map(|point| (point.size as f64, point.mean)).collect();
    let fit = curve::parabola(&means);
    let within = means.first().zip(means.last()).map(|(first, last)| (first.0, last.0));
    let capacity = fit.zip(within).and_then(|(fit, within)| curve::first_crossing(fit, accuracy, within));
    Curve { network: kind.name().to_string(), points, fit, capacity }
}

fn write(options: &Options, file: &CapacityFile) -> Result<(), Error> {
    write_with_table(&options.out, &file.to_json(), &file.to_csv())
}

/// The robots that count.
fn robots<'a>(report: &'a EvalFile, options: &Options) -> Result<Vec<&'a RobotReport>, Error> {
    let name = options.eval.display();
    if report.robots.is_empty() {
        return Err(Error::input(format!("{name}: there is no robot in it")));
    }
    if !options.physical_only {
        return Ok(report.robots.iter().collect());
    }
    if report.runs.iter().any(|run| run.name == gallery::ALL) {
        let text = "--physical-only: expected an evaluation of robots of an archive, not of published ones";
        return Err(Error::usage(text.to_string()).hint("morphcog audit --robots gallery".to_string()));
    }
    let folder = options.eval.parent().unwrap_or(Path::new(""));
    let audits: Result<Vec<_>, Error> =
        report.runs.iter().map(|run| AuditFile::near(folder, &run.sha256)).collect();
    let audits = audits?;
    let physical = |robot: &&RobotReport| {
        audits
            .get(robot.run)
            .and_then(|audit| audit.robot(&robot.id))
            .is_some_and(|found| found.is_physical())
    };
    let physical: Vec<&RobotReport> = report.robots.iter().filter(physical).collect();
    if physical.is_empty() {
        return Err(Error::input(format!("{name}: none of {} robots is physical", report.robots.len())));
    }
    Ok(physical)
}
