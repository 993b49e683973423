//! The archive as buttons, and the rollouts that they play.

use crate::analysis::dossier::{Dossier, Gathered};
use crate::base::threads::in_pool;
use crate::draw::error::PictureError;
use crate::draw::html::{escape, packed};
use crate::draw::plot::cells::{Cell, CellMap, TaskMap};
use crate::draw::report::Spell;
use crate::draw::report::bodies::{Look, Rollouts, bodies, button};
use crate::draw::walk::Walk;
use crate::store::run::Robot;
use rayon::prelude::*;
use std::collections::BTreeMap;

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

/// Returns the map with its player.
pub(super) fn archive(
    number: usize,
    dossier: &Dossier,
    rollouts: &Rollouts,
    spell: Spell,
) -> String {
    let run = &dossier.run;
    let map = CellMap::of(run);
    let mut out = "<p>A square is a cell of the archive: how many muscle voxels (right) and sensor voxels (up) a \
                   body has, one panel for each range of voxels in all. Press one to watch its robot.</p>\n"
        .to_string();
    if map.tasks.len() > 1 {
        let option = |(place, task): (usize, &TaskMap)| {
            format!("<option value=\"{place}\">{}</option>", escape(&task.name))
        };
        let options: String = map.tasks.iter().enumerate().map(option).collect();
        out += &format!("<p><label>Task <select class=\"task\">{options}</select></label></p>\n");
    }
    out += "<div class=\"archive\">\n<div>\n";
    let best = played(dossier, 1).first().map(|robot| robot.id.clone());
    let elites: BTreeMap<&str, &Robot> = run
        .elites
        .iter()
        .map(|robot| (robot.id.as_str(), robot))
        .collect();
    for (place, task) in map.tasks.iter().enumerate() {
        out += &format!(
            "<div class=\"map\" data-task=\"{place}\" role=\"group\" aria-label=\"Cells of {}\">\n{}",
            escape(&task.name),
            key(&map, task, &run.in_units(task.highest))
        );
        for panel in &task.panels {
            let mut cells = String::new();
            for (row, found) in panel.rows.iter().enumerate() {
                for (column, cell) in found.iter().enumerate() {
                    let sensor = panel.rows.len() - 1 - row;
                    let name = format!(
                        "muscle {}, sensor {}, voxels {}",
                        map.counts(column),
                        map.counts(sensor),
                        panel.total()
                    );
                    cells += &match cell {
                        Cell::Elite {
                            robot,
                            fitness,
                            colour,
                        } => {
                            let class = if *fitness < 0.0 { "below" } else { "" };
                            let style = format!("background-color:{}", colour.hex());
                            let first = best.as_ref() == Some(robot);
                            let look = Look {
                                class,
                                style: &style,
                                name: &name,
                                first,
                            };
                            let robot = elites[robot.as_str()];
                            button(number, (dossier, spell), rollouts, robot, &look, "")
                        }
                        Cell::Empty => format!(
                            "<span class=\"empty\" role=\"img\" aria-label=\"{name}: empty\"></span>"
                        ),
                        Cell::Impossible => "<span></span>".to_string(),
                    };
                }
            }
            out += &format!(
                "<figure><div class=\"cells\" data-columns=\"{}\">{cells}</div>\
                 <figcaption>{} voxels</figcaption></figure>\n",
                panel.columns(),
                panel.total()
            );
        }
        out += "</div>\n";
    }
    out + "</div>\n" + PLAYER + "</div>\n"
}

/// Returns the meaning of the colours.
fn key(map: &CellMap, task: &TaskMap, highest: &str) -> String {
    let colours: Vec<String> = map.colours.iter().map(|colour| colour.hex()).collect();
    let own = match task.has_own_scale {
        true => " (a scale of its own, since it dwarfs the other tasks)",
        false => "",
    };
    let below = match map.has_below {
        true => format!(
            "<span><b class=\"below\" style=\"background-color:{}\"></b> below 0</span>",
            map.below.hex()
        ),
        false => String::new(),
    };
    format!(
        "<div class=\"key\"><span>fitness 0 <i style=\"background:linear-gradient(90deg,{})\"></i> \
         {highest}{own}</span>{below}<span><b class=\"empty\"></b> no robot</span></div>\n",
        colours.join(",")
    )
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
