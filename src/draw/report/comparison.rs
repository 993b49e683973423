//! Runs compared with the first: the tables and remarks that a report and the terminal share, and
//! the section of a report.

use crate::analysis::comparison::{
    ComparedAccuracy, ComparedRun, Comparison, PairedDifference, Quantity, Repetitions, listed,
};
use crate::base::number;
use crate::base::number::percent;
use crate::draw::html::escape;
use crate::draw::plot;
use crate::draw::plot::Style;
use crate::draw::report::{figure, tables};

/// A table for people.
pub(crate) struct Table {
    /// The subject, on a line above the table.
    pub(crate) title: &'static str,
    pub(crate) headers: Vec<String>,
    pub(crate) rows: Vec<Vec<String>>,
}

/// Returns the tables of a comparison: the keys that differ, archives, accuracies, repetitions.
/// What there is none of has no table.
pub(crate) fn tables(found: &Comparison) -> Vec<Table> {
    let all = [
        keys(found),
        archives(found),
        accuracies(found),
        repetitions(found),
    ];
    all.into_iter()
        .filter(|table| !table.rows.is_empty())
        .collect()
}

fn keys(found: &Comparison) -> Table {
    let names = found.runs.iter().map(|run| run.name.clone());
    let row = |key: &crate::analysis::comparison::DifferingKey| {
        let key_first = std::iter::once(key.key.clone());
        key_first.chain(key.texts.iter().cloned()).collect()
    };
    Table {
        title: "Config keys that differ",
        headers: std::iter::once("key".to_string()).chain(names).collect(),
        rows: found.keys.iter().map(row).collect(),
    }
}

fn archives(found: &Comparison) -> Table {
    let headers = [
        "run",
        "generations",
        "cells filled",
        "coverage %",
        "QD score",
        "best fitness",
    ];
    let row = |run: &ComparedRun| {
        vec![
            run.name.clone(),
            run.generations.to_string(),
            format!("{} of {}", run.stats.num_elites, run.possible_cells),
            percent(run.stats.coverage),
            number::fixed(run.stats.qd_score, 1),
            run.stats
                .obj_max
                .map_or("–".to_string(), |best| number::fixed(best, 2)),
        ]
    };
    Table {
        title: "Archives",
        headers: headers.map(str::to_string).to_vec(),
        rows: found.runs.iter().map(row).collect(),
    }
}

fn accuracies(found: &Comparison) -> Table {
    let is_paired = comparisons(found) > 0;
    let headers = [
        "run",
        "robot",
        "task",
        "images",
        "accuracy %",
        "95 % interval",
        "balanced %",
    ];
    let mut headers = headers.map(str::to_string).to_vec();
    if is_paired {
        let against = format!("against {}", found.runs[0].name);
        headers.extend(["difference".to_string(), "p".to_string(), against]);
    }
    let row = |one: &ComparedAccuracy| {
        let [low, high] = one.interval.map(percent);
        let mut row = vec![
            found.runs[one.run].name.clone(),
            one.robot.clone(),
            one.task.clone(),
            one.images.to_string(),
            percent(one.accuracy),
            format!("{low}–{high}"),
            percent(one.balanced_accuracy),
        ];
        if is_paired {
            row.extend(paired(one.difference.as_ref()));
        }
        row
    };
    Table {
        title: "Accuracy on held-out images",
        headers,
        rows: found.accuracies.iter().map(row).collect(),
    }
}

/// Returns the cells of a difference: percentage points with their interval, p, and the conclusion.
fn paired(difference: Option<&PairedDifference>) -> [String; 3] {
    let Some(difference) = difference else {
        return ["–"; 3].map(str::to_string);
    };
    let points = |share: f64| number::signed(100.0 * share, 1);
    let [low, high] = difference.interval.map(points);
    let p = match difference.p_adjusted {
        p if p < 0.001 => "<0.001".to_string(),
        // Never rounded up to the level at which it would not be significant.
        p if p < 0.05 => number::fixed((1000.0 * p).floor() / 1000.0, 3),
        p => number::fixed(p, 3),
    };
    let mean = points(difference.mean);
    [
        format!("{mean} [{low}, {high}]"),
        p,
        difference.verdict().to_string(),
    ]
}

/// Returns the number of accuracies that are compared with the first run's.
fn comparisons(found: &Comparison) -> usize {
    let is_compared = |one: &&ComparedAccuracy| one.difference.is_some();
    found.accuracies.iter().filter(is_compared).count()
}

fn repetitions(found: &Comparison) -> Table {
    let headers = ["repetitions", "quantity", "mean", "deviation", "range"];
    let of_group = |group: &Repetitions| {
        let names: Vec<&str> = found.runs.iter().map(|run| run.name.as_str()).collect();
        let names = match group.runs.len() == names.len() {
            true => format!("all {} runs", names.len()),
            false => listed(group.runs.iter().copied(), &names),
        };
        let row = |quantity: &Quantity| {
            let text = |value: f64| match quantity.is_share {
                true => percent(value),
                false => number::fixed(value, 1),
            };
            let unit = if quantity.is_share { " %" } else { "" };
            vec![
                names.clone(),
                format!("{}{unit}", quantity.name),
                text(quantity.mean),
                text(quantity.standard_deviation),
                format!("{} to {}", text(quantity.least), text(quantity.largest)),
            ]
        };
        group.quantities.iter().map(row).collect::<Vec<_>>()
    };
    Table {
        title: "Runs that differ in nothing but the seed",
        headers: headers.map(str::to_string).to_vec(),
        rows: found.repetitions.iter().flat_map(of_group).collect(),
    }
}

/// Returns what must be known to read the tables, a sentence each, without full stops.
pub(crate) fn remarks(found: &Comparison) -> Vec<String> {
    let mut lines = Vec::new();
    if found.keys.is_empty() {
        lines.push("no config key differs".to_string());
    }
    let count = comparisons(found);
    if count > 0 {
        let adjusted = match count {
            1 => String::new(),
            _ => format!(", adjusted for {count} comparisons (Holm)"),
        };
        lines.push(format!(
            "difference: percentage points from {} on the same images, with a 95 % bootstrap \
             interval over the images; p: McNemar's exact test{adjusted}; from 0.05 on it is not \
             significant",
            found.runs[0].name
        ));
        lines.push(
            "a difference is one between these robots; it says nothing about runs of other seeds"
                .to_string(),
        );
    }
    if !found.repetitions.is_empty() {
        let text =
            "repetitions: mean and standard deviation over runs; no others are taken together";
        lines.push(text.to_string());
    }
    lines.extend(found.notes.iter().cloned());
    lines
}

/// Returns the section of a report that compares its first run with the others.
pub(super) fn section(found: &Comparison) -> String {
    let first = found.runs.first().map_or("", |run| run.name.as_str());
    let mut out = format!(
        "<section id=\"compared\">\n<h2>Compared with {}</h2>\n",
        escape(first)
    );
    for Table {
        title,
        headers,
        rows,
    } in tables(found)
    {
        let headers: Vec<&str> = headers.iter().map(String::as_str).collect();
        out += &format!("<h3>{title}</h3>\n");
        out += &tables::table(&headers, rows);
    }
    for line in remarks(found) {
        out += &format!("<p>{}.</p>\n", escape(&line));
    }
    let figure = figure(&plot::comparison(found, &Style::default()), "page");
    out + &format!("<div class=\"figures\">{figure}</div>\n</section>\n")
}
