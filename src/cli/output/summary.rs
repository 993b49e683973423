//! The results of commands.

use crate::analysis;
use crate::analysis::gates::{FoundGate, GateWalks};
use crate::analysis::published;
use crate::base::clock::CLOCK;
use crate::base::error::Error;
use crate::base::number;
use crate::base::number::percent;
use crate::base::shell::in_shell;
use crate::base::text::counted;
use crate::base::text::duration;
use crate::cli::output::console::{Console, Mode};
use crate::cli::output::networks;
use crate::commands::bench::Speed;
use crate::commands::data::FoundDataset;
use crate::commands::evolve::EvolveOutcome;
use crate::commands::pairs;
use crate::commands::tasks::{Task, TaskFolders};
use crate::commands::train;
use crate::data::fetch::{FetchOutcome, Fetched};
use crate::data::gates::Gates;
use crate::draw::report::tables::of_robot;
use crate::robots::published::Published;
use crate::store::capacity::CapacityFile;
use crate::store::eval::{EvalFile, RobotReport};
use crate::store::images::{HeldOut, ImageRef};
use crate::store::names::RUN_JSON;
use crate::store::run::RunFile;
use crate::store::setting::RunRef;
use crate::store::validation::Validated;
use crate::task::class_names::ClassNames;
use crate::task::gates::class_of_three;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The number of robots listed after an evolution.
const SHOWN: usize = 5;

/// Writes the results of an evolution: the fittest robots, the files and, unless the command itself
/// continues, the next steps.
pub(crate) fn evolution(console: &Console, finished: &EvolveOutcome, out: &Path, goes_on: bool) {
    let EvolveOutcome { run, totals, .. } = finished;
    if console.mode() == Mode::Json {
        let elites = run.elites.len();
        let best = finished.best();
        let done = serde_json::json!({
            "folder": out.display().to_string(), "generations": run.generations, "stopped": finished.stopped,
            "best": best,
            "elites": elites, "stats": run.stats, "totals": totals,
            "sees": run.config.stimulus.part(finished.size),
        });
        return console.event("finished", &done);
    }
    match analysis::gates::found(run, |_| true) {
        found if found.is_empty() => fittest(console, run),
        found if Gates::named(&run.config.data.dataset) == Some(Gates { cues: 3 }) => {
            classes_of_gates(console, &found);
        }
        found => gates(console, run, &found),
    }
    let stats = run.stats;
    let cells = run.dimensions.possible_cells;
    console.line(&format!(
        "{} of {cells} cells filled (coverage {} %), QD score {}, {} in {}",
        stats.num_elites,
        percent(stats.coverage),
        number::fixed(stats.qd_score, 1),
        counted(run.generations, "generation", "generations"),
        duration(totals.seconds)
    ));
    console.line(&format!(
        "robots see {}",
        run.config.stimulus.part(finished.size)
    ));
    let showings = (totals.simulated + totals.saved()).max(1) as f64;
    let share = |count: u64| percent(count as f64 / showings);
    console.line(&format!(
        "{} evaluations; of the images shown, simulated {} %, saved {} % (known bodies {} %, early stop {} %, \
         shared rollouts {} %)",
        totals.evaluations,
        share(totals.simulated),
        share(totals.saved()),
        share(totals.saved_known_bodies),
        share(totals.saved_early_stop),
        share(totals.saved_shared_rollouts)
    ));
    if run.elites.is_empty() {
        let unstable = match totals.unstable {
            0 => String::new(),
            count => format!("; {count} became unstable ([physics] may ask for too much)"),
        };
        return console.warning(&format!(
            "the archive is empty: no robot has walked yet and been as fit as the config wants{unstable}"
        ));
    }
    if goes_on {
        return;
    }
    let archive = in_shell(&out.join(RUN_JSON));
    // Gaits cannot tell images apart yet.
    if run.config.measures_response() {
        return console.suggest(
            "next:",
            &format!("morphcog train --archive {archive} --task \"4|9\""),
        );
    }
    console.suggest(
        "next:",
        &format!("morphcog replay --robot best --archive {archive}"),
    );
    // Test images of gates are those that they were evolved on.
    let then: &[&str] = match Gates::named(&run.config.data.dataset) {
        Some(Gates { cues: 2 }) => &["audit", "plot gates"],
        Some(_) => &["audit"],
        None => &["eval"],
    };
    for command in then {
        console.suggest("     ", &format!("morphcog {command} --archive {archive}"));
    }
}

/// Writes where each gate switches, and how robust it is.
pub(crate) fn gate_walks(console: &Console, gates: &[GateWalks]) {
    if gates.is_empty() {
        return;
    }
    let levels = |levels: &[f64]| match levels {
        [] => "–".to_string(),
        _ => {
            let levels: Vec<String> = levels.iter().map(|at| number::fixed(*at, 2)).collect();
            levels.join("+")
        }
    };
    let row = |gate: &GateWalks| {
        let [a_dark, a_bright, b_dark, b_bright] = gate.switches();
        vec![
            gate.gate.name.clone(),
            gate.side.name().to_string(),
            gate.robot.clone(),
            number::fixed(gate.fitness, 2),
            gate.audit.clone().unwrap_or("–".to_string()),
            format!("{} / {}", levels(&a_dark), levels(&a_bright)),
            format!("{} / {}", levels(&b_dark), levels(&b_bright)),
            format!("{} of {}", gate.starts.correct, gate.starts.all),
            format!("{} of {}", gate.changes.correct, gate.changes.all),
        ]
    };
    let headers = [
        "gate",
        "if true",
        "robot",
        "fitness",
        "audit",
        "a switches",
        "b switches",
        "starts",
        "changes",
    ];
    console.table(&headers, &gates.iter().map(row).collect::<Vec<_>>());
    console.line(
        "a switches, b switches: the brightness of the cue at which the walk reverses, with the other \
         cue dark / bright",
    );
    console.line(
        "starts: correct walks from raised starts; changes: correct walks after the input changes mid-walk",
    );
}

/// Writes the fittest robots of a run.
fn fittest(console: &Console, run: &RunFile) {
    let class_names = run.config.class_names();
    let mut robots: Vec<_> = run.elites.iter().collect();
    robots.sort_by(|a, b| b.objective.total_cmp(&a.objective));
    let rows = robots.iter().take(SHOWN).map(|robot| {
        let kinds = robot.voxels;
        vec![
            robot.id.clone(),
            robot.task.clone(),
            number::fixed(robot.objective, 2),
            walks(&run.training_images, &robot.displacements, &class_names),
            kinds.muscle.to_string(),
            kinds.sensor.to_string(),
            kinds.total.to_string(),
        ]
    });
    let headers = [
        "robot",
        "task",
        "fitness",
        "displacements",
        "muscle",
        "sensor",
        "voxels",
    ];
    console.table(&headers, &rows.collect::<Vec<_>>());
}

/// Writes how many gates of each class of three cues a run found, and the fittest of each.
fn classes_of_gates(console: &Console, found: &[FoundGate]) {
    let mut classes: BTreeMap<&str, Vec<&FoundGate>> = BTreeMap::new();
    for found in found {
        classes
            .entry(class_of_three(&found.gate))
            .or_default()
            .push(found);
    }
    let row = |(class, found): (&str, Vec<&FoundGate>)| {
        let best = found
            .iter()
            .max_by(|a, b| a.robot.objective.total_cmp(&b.robot.objective))
            .expect("a class has a gate");
        let right = found.iter().filter(|found| found.robot.objective > 0.0);
        vec![
            class.to_string(),
            right.count().to_string(),
            number::fixed(best.robot.objective, 2),
            best.gate.name.clone(),
            best.side.name().to_string(),
            best.robot.id.clone(),
        ]
    };
    let headers = [
        "class of gates",
        "found",
        "fitness",
        "table",
        "if true",
        "robot",
    ];
    console.table(&headers, &classes.into_iter().map(row).collect::<Vec<_>>());
}

/// Writes which logic gates a run found.
fn gates(console: &Console, run: &RunFile, found: &[FoundGate]) {
    let names = run.config.class_names();
    let row = |found: &FoundGate| {
        let FoundGate {
            gate, robot, side, ..
        } = found;
        vec![
            gate.name.clone(),
            format!("{} for {}", side.name(), names.list(&gate.true_for)),
            number::fixed(robot.objective, 2),
            walks(&run.training_images, &robot.displacements, &names),
            robot.id.clone(),
        ]
    };
    let headers = ["gate", "if true", "fitness", "displacements", "robot"];
    console.table(&headers, &found.iter().map(row).collect::<Vec<_>>());
}

pub(crate) fn training(console: &Console, finished: &train::TrainOutcome, out: &Path) {
    let train::TrainOutcome {
        run,
        rollouts,
        size,
        ..
    } = finished;
    let Some(robot) = run.best() else { return };
    if console.mode() == Mode::Json {
        let done = serde_json::json!({
            "folder": out.display().to_string(), "robot": robot.id, "task": robot.task, "objective": robot.objective,
            "gait_of": robot.parent, "images": run.training_images.len(), "rollouts": rollouts,
            "sees": run.config.stimulus.part(*size),
        });
        return console.event("trained", &done);
    }
    let gait = robot.parent.as_deref().unwrap_or("none");
    console.line(&format!(
        "{}: {} with the gait of {gait}, fitness {} on {} training images, after {}",
        robot.id,
        robot.task,
        number::fixed(robot.objective, 3),
        run.training_images.len(),
        counted(*rollouts, "rollout", "rollouts")
    ));
    console.line(&format!(
        "of an image it sees {}",
        run.config.stimulus.part(*size)
    ));
    console.line(&format!("wrote {}", out.display()));
}

/// Writes how many new digits the body of a demo reads, where to watch it, and the next step.
pub(crate) fn demo(console: &Console, robot: &RobotReport, out: &Path, pictures: &[PathBuf]) {
    let (zero, one) = match robot.first_group_walks.as_str() {
        "left" => ("left", "right"),
        _ => ("right", "left"),
    };
    console.line(&format!(
        "Your body reads {} of {} new digits: it walks {zero} for a 0 and {one} for a 1.",
        robot.right, robot.images
    ));
    let pictures: Vec<String> = pictures.iter().map(|path| in_shell(path)).collect();
    console.line(&format!(
        "Watch it read two of them: {}",
        pictures.join(" or ")
    ));
    console.suggest(
        "Draw digits for it yourself:",
        &format!("morphcog serve --archive {}", in_shell(out)),
    );
}

pub(crate) fn validation(console: &Console, best: &[Validated]) {
    if console.mode() == Mode::Json {
        return console.event("validated", &best);
    }
    let rows = best.iter().map(|robot| {
        let of = format!("{} of {}", robot.right, robot.images);
        vec![
            robot.id.clone(),
            robot.task.clone(),
            of,
            percent(robot.balanced_accuracy),
        ]
    });
    console.table(
        &["best on validation", "task", "correct", "balanced %"],
        &rows.collect::<Vec<_>>(),
    );
}

/// Writes what became of each pair of a team.
pub(crate) fn pairs(console: &Console, tasks: &[Task], place: &TaskFolders) -> Result<(), Error> {
    let found = pairs::outcomes(tasks, place)?;
    if console.mode() == Mode::Json {
        console.event("pairs", &found);
        return Ok(());
    }
    let rows = found.iter().map(|pair| {
        vec![
            pair.task.clone(),
            pair.robot.clone(),
            pair.gait.clone(),
            pair.validation.map_or_else(String::new, percent),
            pair.audit.clone(),
        ]
    });
    let headers = ["task", "robot", "gait", "validation %", "audit"];
    console.table(&headers, &rows.collect::<Vec<_>>());
    Ok(())
}

/// Writes the results of an evaluation: a table per robot, the means, the baselines and the paper's
/// table. `capacity` is a known analysis of these robots; `out` is the file, if it was written.
pub(crate) fn evaluation(
    console: &Console,
    report: &EvalFile,
    capacity: Option<&CapacityFile>,
    out: Option<&Path>,
) {
    if report.robots.is_empty() {
        return console.warning("no robot was evaluated");
    }
    if console.mode() == Mode::Json {
        let mut done = serde_json::json!({
            "file": out.map(|out| out.display().to_string()), "stopped": report.stopped,
            "images": report.images.len(), "split": report.split,
            "dataset": report.dataset, "trained_on": report.trained_on,
            "means": report.means, "baselines": report.baselines,
            "robots": report.robots.iter().map(RobotReport::without_displacements).collect::<Vec<_>>(),
        });
        if report.runs.len() > 1 {
            let runs: Vec<&str> = report.runs.iter().map(RunRef::in_tables).collect();
            done["runs"] = serde_json::json!(runs);
        }
        let class_names = report.names();
        if !class_names.all().is_empty() {
            done["class_names"] = serde_json::json!(class_names.all());
        }
        return console.event("evaluated", &done);
    }
    let class_names = report.names();
    let classes = report.robots[0].per_class.keys();
    let names: Vec<String> = classes
        .map(|class| format!("% of {}", class_names.name(*class)))
        .collect();
    let mut headers: Vec<&str> = (report.runs.len() > 1)
        .then_some("run")
        .into_iter()
        .collect();
    headers.extend([
        "robot",
        "task",
        "fitness",
        "accuracy %",
        "95 % interval",
        "balanced %",
    ]);
    headers.extend(names.iter().map(String::as_str));
    headers.extend(["mean |d|", "not moved %", "unstable", "rollouts"]);
    let validated = report.robots.iter().any(|robot| robot.validation.is_some());
    headers.extend(validated.then_some("validated %"));
    let rows = report.robots.iter().map(|robot| {
        let run = report.run_of(robot).map(str::to_string);
        let mut row: Vec<String> = run.into_iter().chain(of_robot(robot)).collect();
        row.extend(robot.per_class.values().map(|share| percent(*share)));
        row.extend([
            number::fixed(robot.mean_distance, 1),
            percent(robot.not_moved),
        ]);
        row.extend([robot.unstable.to_string(), robot.simulated.to_string()]);
        row.extend(
            robot
                .validation
                .as_ref()
                .map(|v| percent(v.balanced_accuracy)),
        );
        row
    });
    console.table(&headers, &rows.collect::<Vec<_>>());
    console.line("");
    let rows = report.means.iter().map(|(task, mean)| {
        let baselines = report.baselines.get(task);
        let baseline = |of: fn(&crate::store::eval::Baselines) -> f64| {
            baselines.map_or(String::new(), |b| percent(of(b)))
        };
        vec![
            task.clone(),
            mean.robots.to_string(),
            percent(mean.accuracy),
            mean.standard_deviation.map_or("–".to_string(), percent),
            mean.interval.map_or("–".to_string(), |[low, high]| {
                format!("{}–{}", percent(low), percent(high))
            }),
            percent(mean.balanced_accuracy),
            baseline(|b| b.larger_group),
            baseline(|b| b.best_single_pixel),
            baselines
                .and_then(|b| b.nearest_training_image)
                .map_or("–".to_string(), percent),
        ]
    });
    let headers = [
        "task",
        "robots",
        "mean accuracy %",
        "deviation",
        "95 % interval",
        "mean balanced %",
        "larger group %",
        "best pixel %",
        "nearest image %",
    ];
    console.table(&headers, &rows.collect::<Vec<_>>());
    console.line("");
    let is_test = report.split == HeldOut::Test && report.trained_on.is_none();
    let as_published = |task: &String| is_test && published::row(&report.dataset, task).is_some();
    if capacity.is_some() || report.means.keys().any(as_published) {
        let tasks = report.means.iter().map(|(task, mean)| {
            let known =
                capacity.and_then(|file| file.tasks.iter().find(|known| known.task == *task));
            (task.as_str(), mean.robots, mean.accuracy, known)
        });
        networks::papers_table(console, &report.dataset, tasks);
        console.line("");
    }
    console.line(&format!(
        "{} {} {} images, {} control steps each; {}; |d| up to {} voxel lengths is wrong",
        report.images.len(),
        report.dataset,
        report.split,
        report.control_steps,
        report.selection(),
        report.threshold
    ));
    let Some(out) = out else { return };
    console.line(&format!(
        "wrote {} and {}",
        out.display(),
        out.with_extension("csv").display()
    ));
    if capacity.is_none() && is_test {
        let command = format!("morphcog capacity --eval {}", in_shell(out));
        console.suggest("which networks are as accurate?", &command);
    }
}

pub(crate) fn speeds(console: &Console, speeds: &[Speed]) {
    if console.mode() == Mode::Json {
        return speeds
            .iter()
            .for_each(|speed| console.event("speed", speed));
    }
    let rows = speeds.iter().map(|speed| {
        let (micros, steps) = (
            number::fixed(speed.microseconds, 2),
            number::fixed(speed.control_steps, 0),
        );
        vec![
            speed.body.to_string(),
            speed.voxels.to_string(),
            speed.instruction_set.to_string(),
            micros,
            steps,
        ]
    });
    let headers = [
        "body",
        "voxels",
        "instruction set",
        "µs per substep",
        "control steps per second and core",
    ];
    console.table(&headers, &rows.collect::<Vec<_>>());
    console.line(match CLOCK {
        "processor" => "processor time of one thread: other work on the machine does not count",
        _ => "wall-clock time, since this system does not tell a thread's processor time: measure on a machine \
         without other work",
    });
}

pub(crate) fn gallery(console: &Console, robots: &[Published]) {
    let rows = robots.iter().map(|robot| {
        let counts = robot.body.counts();
        let counts = [counts.muscle, counts.sensor, counts.total].map(|count| count.to_string());
        [
            vec![
                robot.name.clone(),
                "0|1".to_string(),
                number::fixed(robot.fitness, 2),
            ],
            counts.to_vec(),
        ]
        .concat()
    });
    let headers = [
        "robot",
        "task",
        "published fitness",
        "muscle",
        "sensor",
        "voxels",
    ];
    console.table(&headers, &rows.collect::<Vec<_>>());
    console
        .info("watch one: morphcog replay --robot XFJPI (needs MNIST; or add --dataset builtin)");
}

/// Lists the built-in configs: name and first comment.
pub(crate) fn configs(console: &Console, configs: &[(&str, &str)]) {
    let rows = configs.iter().map(|(name, text)| {
        let about: Vec<&str> = text
            .lines()
            .map_while(|line| line.strip_prefix("# "))
            .collect();
        let about = about.join(" ");
        vec![
            name.to_string(),
            about
                .split_once(". ")
                .map_or(about.as_str(), |(first, _)| first)
                .to_string(),
        ]
    });
    console.table(&["config", "what it is"], &rows.collect::<Vec<_>>());
}

/// Lists the schemas: name and subject.
pub(crate) fn schemas(console: &Console, schemas: &[(&str, &str)]) {
    let rows: Vec<_> = schemas
        .iter()
        .map(|(name, of)| vec![name.to_string(), of.to_string()])
        .collect();
    console.table(&["schema", "what it is of"], &rows);
}

pub(crate) fn fetched(console: &Console, files: &[Fetched]) {
    for file in files {
        let how = match &file.outcome {
            FetchOutcome::Kept => "was there and is correct".to_string(),
            FetchOutcome::Downloaded(url) => format!("downloaded from {url}, checksum correct"),
        };
        console.line_about(&file.file, &format!("{}: {how}", file.file.display()));
    }
}

pub(crate) fn dataset(console: &Console, found: &FoundDataset) {
    let info = &found.info;
    if console.mode() == Mode::Json {
        let mut event = serde_json::to_value(info).expect("names, numbers and texts are JSON");
        if let (Some(event), false) = (event.as_object_mut(), found.others.is_empty()) {
            event.insert("known_as".to_string(), serde_json::json!(found.others));
        }
        return console.event("dataset", &event);
    }
    console.line(&format!("{}: {} ({})", info.name, info.source, info.origin));
    if info.splits.values().any(|split| split.transposed) {
        console.line("its files are EMNIST's, mirrored and turned: its images are transposed");
    }
    let (mut rows, class_names) = (Vec::new(), info.names());
    for (split, images) in &info.splits {
        console.line(&format!(
            "{split}: {} images of {} × {}, SHA-256 {}",
            images.images, images.height, images.width, images.fingerprint
        ));
        for file in &images.files {
            let is_published = if found.published.contains(&file.name) {
                ", as published"
            } else {
                ""
            };
            console.line(&format!(
                "  {}: {} bytes, SHA-256 {}{is_published}",
                file.name, file.bytes, file.sha256
            ));
        }
        rows.extend(images.per_class.iter().map(|(class, count)| {
            vec![
                split.to_string(),
                class.to_string(),
                class_names.given(*class).unwrap_or_default().to_string(),
                count.to_string(),
            ]
        }));
    }
    let mut headers = vec!["split", "class", "name", "images"];
    if class_names.all().is_empty() {
        headers.remove(2);
        rows.iter_mut().for_each(|row| drop(row.remove(2)));
    }
    console.table(&headers, &rows);
    for (split, known) in &found.others {
        console.warning(&format!(
            "{split}: these are the images of {known}, here under the name {}",
            info.name
        ));
    }
    info.differences()
        .iter()
        .for_each(|text| console.warning(text));
    for (split, problem) in &found.problems {
        console.warning(&format!("{split}: {problem}"));
    }
}

/// Formats displacements by class for people: one by one if they are few, else the class means.
fn walks(images: &[ImageRef], displacements: &[f64], names: &ClassNames) -> String {
    const FEW: usize = 8;
    let shown = images.iter().zip(displacements);
    if images.len() <= FEW {
        return shown
            .map(|(image, d)| format!("{}: {}", names.name(image.label), number::signed(*d, 1)))
            .collect::<Vec<_>>()
            .join("  ");
    }
    let mut classes = std::collections::BTreeMap::<u8, (f64, f64)>::new();
    for (image, displacement) in shown {
        let (sum, count) = classes.entry(image.label).or_default();
        (*sum, *count) = (*sum + displacement, *count + 1.0);
    }
    let mean = |(class, (sum, count)): (u8, (f64, f64))| {
        let class = names.name(class);
        format!("{class}: mean {}", number::signed(sum / count, 1))
    };
    classes.into_iter().map(mean).collect::<Vec<_>>().join("  ")
}
