//! Robots as buttons; a click plays them.

use crate::analysis::dossier::Dossier;
use crate::base::number;
use crate::base::remedy::Invocation;
use crate::body::{Body, Material};
use crate::draw::colour::{MARK_WIDTH, mark, mark_colour, placed};
use crate::draw::html::escape;
use crate::draw::plot::canvas::Piece;
use crate::draw::plot::robot;
use crate::draw::report::Spell;
use crate::store::run::Robot;
use std::collections::BTreeMap;
use std::collections::BTreeSet;
use std::fmt::Write;

/// Packed rollouts by run and robot.
pub(super) struct Rollouts(pub(super) BTreeMap<(usize, String), String>);

/// Robots of each kind in the page.
const SHOWN: usize = 5;

/// The look of a button that plays a robot.
#[derive(Default)]
pub(super) struct Look<'a> {
    pub(super) class: &'a str,
    pub(super) style: &'a str,
    /// A name before the robot's figures, for screen readers.
    pub(super) name: &'a str,
    /// True if it plays first.
    pub(super) first: bool,
}

/// Returns a button that plays a robot.
pub(super) fn button(
    run: usize,
    (dossier, spell): (&Dossier, Spell),
    rollouts: &Rollouts,
    robot: &Robot,
    look: &Look,
    content: &str,
) -> String {
    let Look {
        class,
        style,
        name,
        first,
    } = *look;
    let about = about(dossier, robot);
    let rollout = rollouts.id(run, &robot.id).unwrap_or_default();
    let replay = Invocation::new("replay").option("robot", robot.id.as_str());
    let command = spell(&replay.option("archive", dossier.path.as_path()));
    format!(
        "<button type=\"button\" class=\"{class}\" style=\"{style}\" data-robot=\"{}\" data-rollout=\"{}\" data-about=\"{}\" \
         data-command=\"{}\" \
         aria-pressed=\"false\" aria-label=\"{}\" title=\"{}\"{}>{content}</button>",
        escape(&robot.id),
        escape(&rollout),
        escape(&about),
        escape(&command),
        escape(&format!(
            "{name}{}{about}",
            if name.is_empty() { "" } else { ": " }
        )),
        escape(&about),
        if first { " data-first" } else { "" }
    )
}

fn about(dossier: &Dossier, robot: &Robot) -> String {
    let counts = robot.voxels;
    let verdict = dossier
        .findings
        .audit
        .as_ref()
        .and_then(|audit| audit.robot(&robot.id));
    let verdict = verdict.map_or(String::new(), |found| format!("; {}", found.conclusion()));
    let born = match dossier.run.origin {
        Some(_) => String::new(),
        None => format!(", born in generation {}", robot.generation),
    };
    format!(
        "{} ({}), fitness {}: {} muscle, {} sensor, {} voxels in all{born}{verdict}.",
        robot.id,
        robot.task,
        number::fixed(robot.objective, 2),
        counts.muscle,
        counts.sensor,
        counts.total
    )
}

/// Returns buttons for the fittest robots and the most different ones.
pub(super) fn bodies(run: usize, dossier: &Dossier, rollouts: &Rollouts, spell: Spell) -> String {
    let mut fittest: Vec<&Robot> = dossier.run.elites.iter().collect();
    fittest.sort_by(|a, b| b.objective.total_cmp(&a.objective));
    let mut seen = BTreeSet::new();
    // A training has one robot, and no map that would play it.
    let is_first = dossier.run.origin.is_some();
    let chosen = fittest
        .into_iter()
        .take(SHOWN)
        .chain(dossier.most_different(SHOWN + 1));
    let buttons: String = chosen
        .filter(|robot| seen.insert(robot.id.clone()))
        .map(|robot| {
            let id = escape(&robot.id);
            // The walks of a training had raised starts and so on; the page plays others.
            let walks: Vec<String> = match dossier.run.follows_protocol() {
                true => robot
                    .displacements
                    .iter()
                    .take(4)
                    .map(|d| number::signed(*d, 1))
                    .collect(),
                false => vec![format!("fitness {}", number::fixed(robot.objective, 2))],
            };
            let content = format!(
                "{}<span>{id}</span><small>{}: {}</small>",
                picture(&robot.body),
                escape(&robot.task),
                walks.join(" ")
            );
            button(
                run,
                (dossier, spell),
                rollouts,
                robot,
                &Look {
                    first: is_first,
                    ..Look::default()
                },
                &content,
            )
        })
        .collect();
    format!("<div class=\"bodies\">{buttons}</div>\n")
}

fn picture(body: &Body) -> String {
    let (height, width) = (body.voxels().height(), body.voxels().width());
    let mut out = format!(
        "<svg viewBox=\"0 0 {width} {height}\" aria-hidden=\"true\" shape-rendering=\"crispEdges\">"
    );
    for material in Material::ALL
        .into_iter()
        .filter(|material| *material != Material::Empty)
    {
        let mut path = String::new();
        for ((row, column), _) in body
            .voxels()
            .iter()
            .filter(|(_, found)| **found == material)
        {
            // Writing text to memory cannot fail.
            let _ = write!(path, "M{column} {row}h1v1h-1z");
        }
        if !path.is_empty() {
            let _ = write!(
                out,
                "<path fill=\"{}\" d=\"{path}\"/>",
                robot::plain(material).hex()
            );
            out += &marks(body, material);
        }
    }
    out + "</svg>"
}

/// Returns the marks on a body's voxels of a material, as one path.
fn marks(body: &Body, material: Material) -> String {
    let mut data = String::new();
    for ((row, column), _) in body
        .voxels()
        .iter()
        .filter(|(_, found)| **found == material)
    {
        let (x, y) = (column as f64, row as f64);
        let corners = [[x, y], [x + 1.0, y], [x + 1.0, y + 1.0], [x, y + 1.0]];
        for line in mark(material) {
            let line = Piece::Line(line.iter().map(|point| placed(*point, corners)).collect());
            data += &line.to_string();
        }
    }
    if data.is_empty() {
        return data;
    }
    let colour = mark_colour(material, robot::plain(material)).hex();
    format!(
        "<path fill=\"none\" stroke=\"{colour}\" stroke-width=\"{MARK_WIDTH}\" shape-rendering=\"auto\" d=\"{data}\"/>"
    )
}
