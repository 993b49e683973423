//! One self-contained page about runs: their settings and progress, an archive whose robots can be
//! played, and test results. It needs no network and works from `file://`.

mod bodies;
pub(crate) mod comparison;
pub(crate) mod decisions;
mod maps;
pub(crate) mod tables;
mod team;
mod words;

use crate::analysis::comparison::Comparison;
use crate::analysis::dossier::{Dossier, Findings, Gathered};
use crate::base::remedy::Invocation;
use crate::draw::error::PictureError;
use crate::draw::html::{escape, fill};
use crate::draw::plot::{Figure, Style};
use crate::draw::{html, plot};
use bodies::Rollouts;
use std::sync::atomic::{AtomicU64, Ordering};

const SCRIPT: &str = concat!(
    include_str!("../drawing.js"),
    include_str!("../stages.js"),
    include_str!("report.js")
);

/// Spells a command as its users type it.
pub(crate) type Spell<'a> = &'a dyn Fn(&Invocation) -> String;

#[derive(Clone, Copy)]
pub(crate) struct Content<'a> {
    pub(crate) gathered: &'a Gathered,
    /// The first run compared with the others.
    pub(crate) comparison: Option<&'a Comparison>,
    /// Maximum number of robots of each run that can be played, the fittest first.
    pub(crate) rollouts: usize,
    pub(crate) spell: Spell<'a>,
}

/// Returns the names of runs on the page.
pub(crate) fn names(runs: &[Dossier]) -> Vec<String> {
    runs.iter().map(words::name).collect()
}

impl Content<'_> {
    /// Returns the number of rollouts to simulate for the page.
    pub(crate) fn count(&self) -> usize {
        let of_runs: usize = self
            .gathered
            .runs
            .iter()
            .map(|dossier| maps::played(dossier, self.rollouts).len())
            .sum();
        of_runs + self.gathered.team.as_ref().map_or(0, team::count)
    }

    /// Returns the page as text; `simulated` receives the number of rollouts simulated so far.
    pub(crate) fn page(&self, simulated: &(dyn Fn(u64) + Sync)) -> Result<String, PictureError> {
        let Gathered {
            runs,
            together,
            team,
        } = self.gathered;
        let done = AtomicU64::new(0);
        let simulated = || simulated(done.fetch_add(1, Ordering::Relaxed) + 1);
        let rollouts = Rollouts::record(self.gathered, self.rollouts, &simulated)?;
        let mut content = words::contents(runs);
        if let Some(team) = team {
            content += &team::section(team, runs, &simulated)?;
        }
        if runs.len() > 1 {
            content += &overview(runs, together);
        }
        if let Some(comparison) = self.comparison {
            content += &comparison::section(comparison);
        }
        for (number, dossier) in runs.iter().enumerate() {
            content += &run(number, dossier, &rollouts, runs.len() > 1, self.spell);
        }
        content += &rollouts.elements();
        let style = [
            include_str!("../replay.css"),
            include_str!("../stages.css"),
            include_str!("../cells.css"),
            include_str!("report.css"),
        ]
        .concat();
        let player = serde_json::Value::from(html::player("%ROLLOUT%"))
            .to_string()
            .replace('<', "\\u003c");
        Ok(fill(
            include_str!("report.html"),
            &[
                ("title", &escape(&words::title(runs))),
                ("style", &style),
                ("content", &content),
                ("player", &player),
                ("script", SCRIPT),
            ],
        ))
    }
}

/// Embeds a figure in the page, in a column's or a page's width.
fn figure(figure: &Figure, class: &str) -> String {
    format!(
        "<figure class=\"figure {class}\">{}</figure>\n",
        figure.svg()
    )
}

fn overview(runs: &[Dossier], together: &Findings) -> String {
    let mut out = "<section id=\"together\">\n<h2>All runs together</h2>\n".to_string();
    let are_trained = runs.iter().all(|dossier| dossier.run.origin.is_some());
    out += &if are_trained {
        tables::trainings(runs)
    } else {
        tables::runs(runs)
    };
    let progress: Option<Vec<_>> = runs
        .iter()
        .map(|dossier| dossier.progress.clone())
        .collect();
    if let Some(progress) = progress.filter(|_| !are_trained) {
        out += &format!(
            "<div class=\"figures\">{}</div>\n",
            figure(&plot::progress(&progress, &Style::default()), "column")
        );
    }
    out += &findings(together);
    out + "</section>\n"
}

fn run(
    number: usize,
    dossier: &Dossier,
    rollouts: &Rollouts,
    is_one_of_several: bool,
    spell: Spell,
) -> String {
    let name = if is_one_of_several {
        format!("{}: ", words::name(dossier))
    } else {
        String::new()
    };
    let heading = |what: &str| format!("<h2>{}{what}</h2>\n", escape(&name));
    let mut out = format!(
        "<section id=\"run{number}\" data-run=\"{number}\">\n{}",
        heading("What was run")
    );
    out += &tables::about(dossier);
    if dossier.run.origin.is_some() {
        // A training has one robot, and no archive with a history.
        out += &heading("The robot");
        out += &maps::robots(number, dossier, rollouts, spell);
    } else {
        out += &heading("Archive");
        out += &maps::archive(number, dossier, rollouts, spell);
        out += &heading("The fittest, and the most different");
        out += "<p>The fittest robots, then those whose bodies differ most from each other. Press one to watch \
         it above.</p>\n";
        out += &bodies::bodies(number, dossier, rollouts, spell);
        let mut figures = String::new();
        if let Some(progress) = &dossier.progress {
            figures += &figure(
                &plot::progress(std::slice::from_ref(progress), &Style::default()),
                "column",
            );
        }
        let tasks = dossier.run.dimensions.tasks.len();
        figures += &figure(
            &plot::archive(&dossier.run, &Style::default()),
            if tasks > 1 { "page" } else { "column" },
        );
        out += &format!(
            "{}<div class=\"figures\">\n{figures}</div>\n",
            heading("Progress")
        );
    }
    out += &findings(&dossier.findings);
    out += &heading("Methods");
    out += &words::methods(dossier);
    out += &heading("Commands");
    out += &words::commands(dossier, spell);
    out + "</section>\n"
}

fn findings(found: &Findings) -> String {
    let mut out = String::new();
    if let Some(report) = found
        .eval
        .as_ref()
        .filter(|report| !report.robots.is_empty())
    {
        out += "<h2>Test on held-out images</h2>\n";
        out += &tables::eval(report);
        out += &format!(
            "<div class=\"figures\">{}</div>\n",
            figure(&plot::accuracy(report, &Style::default()), "column")
        );
    }
    if let Some(audit) = &found.audit {
        out += "<h2>Audit</h2>\n";
        out += &tables::audit(audit);
    }
    if let Some(file) = found
        .capacity
        .as_ref()
        .filter(|file| !file.tasks.is_empty())
    {
        out += "<h2>Capacity</h2>\n";
        out += &tables::capacity(file);
        out += &format!(
            "<div class=\"figures\">{}</div>\n",
            figure(&plot::capacity(file, &Style::default()), "page")
        );
    }
    out
}
