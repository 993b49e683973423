//! The archive as buttons, and the rollouts that they play.

use crate::analysis::dossier::{Dossier, Gathered};
use crate::base::threads::in_pool;
use crate::draw::error::PictureError;
use crate::draw::html::{escape, packed};
use crate::draw::plot::{below, sequential};
use crate::draw::report::Spell;
use crate::draw::report::bodies::{Rollouts, bodies, button};
use crate::draw::walk::Walk;
use crate::qd::descriptor::{COUNT_BINS, DescriptorSpace, possible_cells};
use crate::store::run::Robot;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Bytes of all rollouts of a page before packing; packed and as text they take about as many.
const MOST_BYTES: usize = 13_000_000;
/// Maximum size of a single rollout, bytes.
const MOST_OF_ONE: usize = 1_500_000;

/// The element in which the chosen robot walks.
const PLAYER: &str = "<div>\n<p class=\"about\" aria-live=\"polite\"></p>\n<iframe title=\"The chosen \
     robot\"></iframe>\n</div>\n";

/// Returns the robots of a run that can be played: the fittest.
pub(super) fn played(dossier: &Dossier, most: usize) -> Vec<&Robot> {
    if dossier.images.is_empty() {
        return Vec::new();
    }
    let mut robots: Vec<&Robot> = dossier.run.elites.iter().collect();
    robots.sort_by(|a, b| b.objective.total_cmp(&a.objective));
    robots.truncate(most);
    robots
}

impl Rollouts {
    pub(crate) fn record(
        gathered: &Gathered,
        most: usize,
        simulated: &(dyn Fn() + Sync),
    ) -> Result<Self, PictureError> {
        let jobs: Vec<(usize, &Dossier, &Robot)> = gathered
            .runs
            .iter()
            .enumerate()
            .flat_map(|(number, dossier)| {
                played(dossier, most)
                    .into_iter()
                    .map(move |robot| (number, dossier, robot))
            })
            .collect();
        // A team's walks need room, too.
        let most_bytes = if gathered.team.is_some() {
            MOST_BYTES / 2
        } else {
            MOST_BYTES
        };
        let each = (most_bytes / jobs.len().max(1)).min(MOST_OF_ONE);
        let one = |&(number, dossier, robot): &(usize, &Dossier, &Robot)| {
            let recording = dossier.record(robot);
            let rollout = packed(&Walk::new(&recording)?, each)?;
            simulated();
            Ok(((number, robot.id.clone()), rollout))
        };
        in_pool(|| {
            jobs.par_iter()
                .map(one)
                .collect::<Result<BTreeMap<_, _>, _>>()
        })?
        .map(Rollouts)
    }

    /// Returns the id of the element with a robot's rollout.
    pub(crate) fn id(&self, run: usize, robot: &str) -> Option<String> {
        self.0
            .contains_key(&(run, robot.to_string()))
            .then(|| format!("rollout-{run}-{robot}"))
    }

    pub(crate) fn elements(&self) -> String {
        let element = |((run, robot), rollout): (&(usize, String), &String)| {
            format!(
                "<script type=\"text/plain\" id=\"rollout-{run}-{}\">{rollout}</script>\n",
                escape(robot)
            )
        };
        self.0.iter().map(element).collect()
    }
}

/// Describes the counts in a bin.
fn range(bin: usize, area: usize) -> String {
    let width = (area / COUNT_BINS).max(1);
    let last = if bin + 1 == COUNT_BINS {
        area
    } else {
        ((bin + 1) * width - 1).min(area)
    };
    format!("{}–{last}", bin * width)
}

/// Returns the map with its player.
pub(super) fn archive(
    number: usize,
    dossier: &Dossier,
    rollouts: &Rollouts,
    spell: Spell,
) -> String {
    let run = &dossier.run;
    let tasks = &run.dimensions.tasks;
    let area = run.config.body.height * run.config.body.width;
    let space = DescriptorSpace::voxel_counts(tasks.len());
    let possible: BTreeSet<Vec<usize>> =
        possible_cells(area, run.config.body.min_muscles, tasks.len())
            .into_iter()
            .filter_map(|index| space.coordinates(index))
            .collect();
    let elites: BTreeMap<&[usize], &Robot> = run
        .elites
        .iter()
        .map(|robot| (robot.cell.as_slice(), robot))
        .collect();
    let highest = run
        .elites
        .iter()
        .map(|robot| robot.objective)
        .fold(0.0, f64::max);
    let colour = |objective: f64| match objective < 0.0 {
        true => below(0.7).hex(),
        false => sequential(if highest > 0.0 {
            objective / highest
        } else {
            0.0
        })
        .hex(),
    };
    let mut out =
        "<p>A square is a cell of the archive: how many muscle voxels (right) and sensor voxels (up) a \
     body has, one map for each \
        range of voxels in all. Press one to watch its robot; hatched cells are empty.</p>\n"
            .to_string();
    if tasks.len() > 1 {
        let options: String = tasks
            .iter()
            .enumerate()
            .map(|(place, task)| format!("<option value=\"{place}\">{}</option>", escape(task)))
            .collect();
        out += &format!("<p><label>Task <select class=\"task\">{options}</select></label></p>\n");
    }
    let stops: Vec<String> = (0..=8)
        .map(|k| sequential(f64::from(k) / 8.0).hex())
        .collect();
    out += &format!(
        "<div class=\"scale\">fitness 0 <i style=\"background:linear-gradient(90deg,{})\"></i> {}; gray: below \
         0</div>\n",
        stops.join(","),
        run.in_units(highest)
    );
    out += "<div class=\"archive\">\n<div>\n";
    let best = played(dossier, 1).first().map(|robot| robot.id.clone());
    for (place, task) in tasks.iter().enumerate() {
        out += &format!(
            "<div class=\"map\" data-task=\"{place}\" role=\"group\" aria-label=\"Cells of {}\">\n",
            escape(task)
        );
        for total in 0..COUNT_BINS {
            let mut cells = String::new();
            // Leaves out rows in which no body is possible.
            let highest = possible
                .iter()
                .filter(|cell| cell[2] == total)
                .map(|cell| cell[1])
                .max();
            let Some(highest) = highest else { continue };
            for sensor in (0..=highest).rev() {
                for muscle in 0..COUNT_BINS {
                    let mut cell = vec![muscle, sensor, total];
                    cell.extend((tasks.len() > 1).then_some(place));
                    let name = format!(
                        "muscle {}, sensor {}, voxels {}",
                        range(muscle, area),
                        range(sensor, area),
                        range(total, area)
                    );
                    cells += &match elites.get(cell.as_slice()) {
                        Some(robot) => {
                            let style = format!("background:{}", colour(robot.objective));
                            let first = best.as_ref() == Some(&robot.id);
                            button(
                                number,
                                (dossier, spell),
                                rollouts,
                                robot,
                                (&style, &name, first),
                                "",
                            )
                        }
                        None if possible.contains(&cell) => {
                            format!(
                                "<span class=\"empty\" role=\"img\" aria-label=\"{name}: empty\"></span>"
                            )
                        }
                        None => "<span></span>".to_string(),
                    };
                }
            }
            out += &format!(
                "<figure><div class=\"cells\">{cells}</div><figcaption>{} voxels</figcaption></figure>\n",
                range(total, area)
            );
        }
        out += "</div>\n";
    }
    out + "</div>\n" + PLAYER + "</div>\n"
}

/// Returns the robots of a training with their player.
pub(super) fn robots(
    number: usize,
    dossier: &Dossier,
    rollouts: &Rollouts,
    spell: Spell,
) -> String {
    format!(
        "<div class=\"archive\">\n{}{PLAYER}</div>\n",
        bodies(number, dossier, rollouts, spell)
    )
}
