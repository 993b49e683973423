//! The tables of a report.

use crate::analysis::dossier::{Dossier, Findings};
use crate::analysis::published;
use crate::base::number;
use crate::base::number::percent;
use crate::base::text::counted;
use crate::base::text::duration;
use crate::data::dataset::Split;
use crate::draw::html::escape;
use crate::draw::report::words;
use crate::sim::InstructionSet;
use crate::store::audit::{AuditFile, Verdict};
use crate::store::capacity::{CapacityFile, Curve};
use crate::store::eval::{EvalFile, Mean, RobotReport};
use crate::store::images::HeldOut;

/// Maximum number of robots that a test or an audit lists one by one.
const LISTED: usize = 50;

/// Returns a table; the first column holds words, all others numbers.
pub(super) fn table(headers: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let class = |place: usize| if place == 0 { "" } else { " class=\"number\"" };
    let head: String = headers
        .iter()
        .enumerate()
        .map(|(place, header)| format!("<th scope=\"col\"{}>{}</th>", class(place), escape(header)))
        .collect();
    let row = |cells: Vec<String>| {
        let cells: String = cells
            .iter()
            .enumerate()
            .map(|(place, cell)| format!("<td{}>{}</td>", class(place), escape(cell)))
            .collect();
        format!("<tr>{cells}</tr>\n")
    };
    let rows: String = rows.into_iter().map(row).collect();
    format!(
        "<div class=\"card scroll\"><table><thead><tr>{head}</tr></thead><tbody>\n{rows}</tbody></table></div>\n"
    )
}

fn or_none<T>(value: Option<T>, text: impl Fn(T) -> String) -> String {
    value.map_or("–".to_string(), text)
}

pub(super) fn runs(runs: &[Dossier]) -> String {
    let row = |dossier: &Dossier| {
        let stats = dossier.run.stats;
        vec![
            words::name(dossier),
            dossier.run.generations.to_string(),
            format!(
                "{} of {}",
                stats.num_elites, dossier.run.dimensions.possible_cells
            ),
            number::fixed(stats.qd_score, 1),
            or_none(stats.obj_max, |best| number::fixed(best, 2)),
            or_none(dossier.effort(), |(seconds, _)| duration(seconds)),
        ]
    };
    let headers = [
        "run",
        "generations",
        "cells filled",
        "QD score",
        "best fitness",
        "time",
    ];
    table(&headers, runs.iter().map(row))
}

pub(super) fn trainings(runs: &[Dossier]) -> String {
    let row = |dossier: &Dossier| {
        let run = &dossier.run;
        let Findings { eval, audit, .. } = &dossier.findings;
        let robot = run.elites.first();
        let tested = robot.and_then(|robot| {
            eval.as_ref()?
                .robots
                .iter()
                .find(|tested| (&tested.id, &tested.task) == (&robot.id, &robot.task))
        });
        let audited = robot.and_then(|robot| audit.as_ref()?.robot(&robot.id));
        vec![
            words::name(dossier),
            run.dimensions.tasks.join(", "),
            or_none(run.stats.obj_max, |best| number::fixed(best, 2)),
            or_none(tested, |tested| percent(tested.accuracy)),
            or_none(tested, |tested| percent(tested.balanced_accuracy)),
            or_none(audited, |found| found.conclusion()),
            or_none(dossier.effort(), |(seconds, _)| duration(seconds)),
        ]
    };
    let headers = [
        "training",
        "task",
        "fitness",
        "test, correct %",
        "balanced %",
        "audit",
        "time",
    ];
    table(&headers, runs.iter().map(row))
}

/// Describes a run as keys and values.
pub(super) fn about(dossier: &Dossier) -> String {
    let run = &dossier.run;
    let stats = run.stats;
    let names = run.config.class_names();
    let images: Vec<String> = run
        .training_images
        .iter()
        .take(12)
        .map(|image| image.called(Split::Train, &names))
        .collect();
    let more = run.training_images.len().saturating_sub(images.len());
    let more = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let machine = format!(
        "{} {}, {cores} cores, {}",
        std::env::consts::OS,
        std::env::consts::ARCH,
        InstructionSet::in_use().name()
    );
    let effort = or_none(dossier.effort(), |(seconds, evaluations)| {
        format!(
            "{} evaluations in {}",
            number::fixed(evaluations, 0),
            duration(seconds)
        )
    });
    let time = or_none(dossier.effort(), |(seconds, _)| duration(seconds));
    let best = or_none(stats.obj_max, |best| run.in_units(best));
    let came_about = match &run.origin {
        Some(origin) => {
            let margin = run.config.stimulus.margin;
            let window = match origin.windows {
                0 => format!("stimulus.margin = {margin}"),
                tried => format!("stimulus.margin = {margin}, the best of {tried}"),
            };
            let age = counted(origin.generations, "generation", "generations");
            let gaits = format!("{} after {age}", origin.name);
            vec![
                ("Gaits", gaits),
                ("Window", window),
                ("Fitness", best),
                ("Time", time),
            ]
        }
        None => {
            let archive = format!(
                "{} of {} cells (coverage {} %), QD score {}, best fitness {best}",
                stats.num_elites,
                run.dimensions.possible_cells,
                percent(stats.coverage),
                number::fixed(stats.qd_score, 1),
            );
            let generations = format!("{} of {}", run.generations, run.config.generations);
            vec![
                ("Generations", generations),
                ("Effort", effort),
                ("Archive", archive),
            ]
        }
    };
    let mut rows = vec![
        ("Run", words::name(dossier)),
        ("Tasks", run.dimensions.tasks.join(", ")),
        (
            "Data",
            format!(
                "{}, training split SHA-256 {}",
                run.dataset.name, run.dataset.train_sha256
            ),
        ),
        ("Training images", format!("{}{more}", images.join(", "))),
    ];
    rows.extend(came_about);
    rows.extend([
        ("Made with", format!("morphcog {}", run.program_version)),
        ("Report made on", machine),
    ]);
    let rows: String = rows
        .into_iter()
        .map(|(key, value)| {
            format!(
                "<tr><th scope=\"row\">{key}</th><td>{}</td></tr>\n",
                escape(&value)
            )
        })
        .collect();
    format!(
        "<div class=\"card\"><table><tbody>\n{rows}</tbody></table></div>\n\
         <details><summary>Config</summary><pre>{}</pre></details>\n",
        escape(&run.config.to_toml())
    )
}

/// Lists accuracies by task and by robot.
pub(super) fn eval(report: &EvalFile) -> String {
    let mut out = format!(
        "<p>{} {} {} images; {}; a displacement up to {} voxel lengths counts as wrong.</p>\n",
        report.images.len(),
        escape(&report.dataset),
        report.split,
        escape(&report.selection()),
        report.threshold
    );
    let as_published = report.split == HeldOut::Test && report.trained_on.is_none();
    let row = |(task, mean): (&String, &Mean)| {
        let known = report.baselines.get(task);
        vec![
            task.clone(),
            mean.robots.to_string(),
            percent(mean.accuracy),
            or_none(mean.standard_deviation, percent),
            or_none(mean.interval, |[low, high]| {
                format!("{}–{}", percent(low), percent(high))
            }),
            or_none(
                published::row(&report.dataset, task).filter(|_| as_published),
                |row| number::fixed(row.accuracy, 1),
            ),
            percent(mean.balanced_accuracy),
            or_none(known, |known| percent(known.larger_group)),
            or_none(known, |known| percent(known.best_single_pixel)),
            or_none(
                known.and_then(|known| known.nearest_training_image),
                percent,
            ),
        ]
    };
    let headers = [
        "task",
        "robots",
        "accuracy %",
        "deviation",
        "95 % interval",
        "paper's %",
        "balanced %",
        "larger group %",
        "best pixel %",
        "nearest image %",
    ];
    out += &table(&headers, report.means.iter().map(row));
    let row = |robot: &RobotReport| {
        let mut row = of_robot(robot);
        row.push(percent(robot.not_moved));
        row.push(or_none(robot.validation.as_ref(), |found| {
            percent(found.balanced_accuracy)
        }));
        row
    };
    let headers = [
        "robot",
        "task",
        "fitness",
        "accuracy %",
        "95 % interval",
        "balanced %",
        "not moved %",
        "on validation %",
    ];
    out += "<h3>Robots</h3>\n";
    out += &table(&headers, report.robots.iter().take(LISTED).map(row));
    out += &more(report.robots.len(), "eval.csv");
    out
}

/// Notes how many entries are not listed, and which file has them.
fn more(count: usize, file: &str) -> String {
    let more = count.saturating_sub(LISTED);
    if more > 0 {
        format!("<p>And {more} more, in <code>{file}</code>.</p>\n")
    } else {
        String::new()
    }
}

pub(super) fn audit(audit: &AuditFile) -> String {
    let verdicts = [
        Verdict::Physical,
        Verdict::Exploits,
        Verdict::Fragile,
        Verdict::NotAWalker,
    ];
    let counts: Vec<String> = verdicts
        .map(|verdict| {
            let count = audit
                .robots
                .iter()
                .filter(|robot| robot.verdict == verdict)
                .count();
            format!("{count} {}", verdict.name())
        })
        .to_vec();
    let mut out = format!(
        "<p>Of {} robots, {} were audited: {}.</p>\n",
        audit.elites,
        audit.robots.len(),
        counts.join(", ")
    );
    let mut walkers: Vec<_> = audit
        .robots
        .iter()
        .filter(|robot| robot.verdict != Verdict::NotAWalker)
        .collect();
    walkers.sort_by(|a, b| b.persisting.total_cmp(&a.persisting));
    let row = |robot: &&crate::store::audit::RobotAudit| {
        vec![
            robot.id.clone(),
            robot.task.clone(),
            robot.conclusion(),
            percent(robot.persisting),
            number::fixed(robot.spread, 2),
        ]
    };
    let rows: Vec<Vec<String>> = walkers.iter().take(LISTED).map(row).collect();
    let headers = [
        "robot",
        "task",
        "verdict",
        "persists in % of changed rollouts",
        "spread",
    ];
    let listed = table(&headers, rows) + &more(walkers.len(), "audit.csv");
    out += &format!("<details><summary>Verdicts on the walkers</summary>\n{listed}</details>\n");
    out
}

pub(super) fn capacity(file: &CapacityFile) -> String {
    let rows = file.tasks.iter().map(|task| {
        let own = |network: &str| or_none(task.curve(network), Curve::spoken);
        let paper = published::row(&file.dataset, &task.task);
        vec![
            task.task.clone(),
            task.robots.to_string(),
            percent(task.accuracy),
            or_none(paper, |row| number::fixed(row.accuracy, 1)),
            own("mlp"),
            or_none(paper, |row| published_size(row.mlp)),
            own("cnn"),
            or_none(paper, |row| published_size(row.cnn)),
        ]
    });
    let headers = [
        "task",
        "robots",
        "accuracy %",
        "paper's %",
        "MLP neurons",
        "paper's",
        "CNN kernels",
        "paper's",
    ];
    let waits = if file.patience_on == "test" {
        "the test images, as in the paper"
    } else {
        "images of the training split"
    };
    let physical = if file.physical_only {
        " that are physical"
    } else {
        ""
    };
    format!(
        "<p>Of the robots{physical}: networks trained on their images, {} times per size; early stopping waits on \
         {waits}.</p>\n{}",
        file.trainings,
        table(&headers, rows)
    )
}

/// Returns a capacity that the paper published, with its digits.
pub(crate) fn published_size(capacity: Option<f64>) -> String {
    capacity.map_or_else(|| "no match".to_string(), |size| number::fixed(size, 1))
}

/// Returns the first cells of a row about an evaluated robot: robot, task, fitness, accuracy, its
/// interval, balanced accuracy.
pub(crate) fn of_robot(robot: &RobotReport) -> Vec<String> {
    let [low, high] = robot.interval.map(percent);
    vec![
        robot.id.clone(),
        robot.task.clone(),
        number::fixed(robot.objective, 2),
        percent(robot.accuracy),
        format!("{low}–{high}"),
        percent(robot.balanced_accuracy),
    ]
}
