//! The results of `morphcog audit`.

use crate::base::number;
use crate::base::text::counted;
use crate::cli::output::console::{Console, Mode};
use crate::commands::audit::AuditOutcome;
use crate::store::audit::{AuditFile, RobotAudit, Verdict};
use std::path::Path;

/// Writes an audit's results: a line per robot, the verdict counts, and changes that break walks.
pub(crate) fn audit(console: &Console, finished: &AuditOutcome, out: &Path) {
    let AuditOutcome {
        called,
        file,
        asked,
        known,
        stopped,
        unwritten,
        ..
    } = finished;
    let robots: Vec<&RobotAudit> = asked.iter().filter_map(|id| file.robot(id)).collect();
    let is_written = unwritten.is_none() && !(*stopped && file.robots.is_empty());
    if console.mode() == Mode::Json {
        let short = |robot: &&RobotAudit| RobotAudit {
            rollouts: Vec::new(),
            ..(*robot).clone()
        };
        let done = serde_json::json!({
            "file": is_written.then(|| out.display().to_string()), "stopped": stopped, "run": file.run,
            "elites": file.elites, "known": known,
            "robots": robots.iter().map(short).collect::<Vec<_>>(),
        });
        return console.event("audited", &done);
    }
    let headers = [
        "robot",
        "task",
        "verdict",
        "persists %",
        "spread",
        "limits/drive",
        "displacements",
        "reason",
    ];
    console.table(
        &headers,
        &robots.iter().map(|robot| row(robot)).collect::<Vec<_>>(),
    );
    console.line("");
    let verdicts = [
        Verdict::Physical,
        Verdict::Exploits,
        Verdict::Fragile,
        Verdict::NotAWalker,
    ];
    let count = |verdict: Verdict| {
        robots
            .iter()
            .filter(|robot| robot.verdict == verdict)
            .count()
    };
    let counts: Vec<String> = verdicts
        .map(|v| format!("{} {}", count(v), v.name()))
        .to_vec();
    console.line(&format!(
        "{called}: {}: {}",
        counted(robots.len(), "robot", "robots"),
        counts.join(", ")
    ));
    breaking(console, &robots);
    let csv = out.with_extension("csv");
    if is_written {
        console.line(&format!("wrote {} and {}", out.display(), csv.display()));
    }
    if file.robots.len() < file.elites {
        note(console, file);
    }
}

fn note(console: &Console, file: &AuditFile) {
    let (known, all) = (file.robots.len(), file.elites);
    console.info(&format!(
        "{known} of {all} robots are audited; --physical-only draws from whole archives only"
    ));
}

fn row(robot: &RobotAudit) -> Vec<String> {
    let walks = |d: &Vec<f64>| match d.len() {
        0..=4 => d
            .iter()
            .map(|d| number::signed(*d, 1))
            .collect::<Vec<_>>()
            .join(" "),
        many => format!("{many} images"),
    };
    let energy = robot.energy_per_cycle;
    let is_walker = robot.verdict != Verdict::NotAWalker;
    let of_walker = |text: String| if is_walker { text } else { "–".to_string() };
    vec![
        robot.id.clone(),
        robot.task.clone(),
        robot.verdict.name().to_string(),
        of_walker(number::fixed(100.0 * robot.persisting, 0)),
        of_walker(number::fixed(robot.spread, 2)),
        if energy.drive > 0.0 {
            number::fixed(energy.limits / energy.drive, 3)
        } else {
            "–".to_string()
        },
        robot
            .displacements
            .as_ref()
            .map_or("unstable".to_string(), walks),
        robot.reason.clone(),
    ]
}

/// Counts, for every change, the robots whose walk does not persist.
fn breaking(console: &Console, robots: &[&RobotAudit]) {
    let mut names: Vec<&str> = Vec::new();
    let rollouts = || robots.iter().flat_map(|robot| &robot.rollouts);
    for rollout in rollouts() {
        if !names.contains(&rollout.name.as_str()) {
            names.push(&rollout.name);
        }
    }
    if names.is_empty() {
        return;
    }
    let rows = names.into_iter().map(|name| {
        let rollouts: Vec<_> = rollouts().filter(|rollout| rollout.name == name).collect();
        let broken = rollouts.iter().filter(|rollout| !rollout.persists).count();
        let mean =
            rollouts.iter().map(|rollout| rollout.distance).sum::<f64>() / rollouts.len() as f64;
        let counts = [broken, rollouts.len()].map(|count| count.to_string());
        [
            vec![name.to_string()],
            counts.to_vec(),
            vec![number::percent(mean)],
        ]
        .concat()
    });
    let rows: Vec<Vec<String>> = rows.collect();
    console.line("");
    console.table(
        &["change", "walks broken", "of", "mean distance kept %"],
        &rows,
    );
}
