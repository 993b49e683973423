//! The figure of a body: its voxels by material.

use crate::base::text::counted;
use crate::body::{Body, Material};
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::panel::present;
use crate::draw::plot::axes::{MARGIN, heading};
use crate::draw::plot::canvas::{Canvas, Pen, TextStyle};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::style::{COLUMN, Style};
use crate::draw::plot::{robot, scales};

/// Side of the map as a share of the width.
const MAP: f64 = 132.0 / COLUMN;

/// Plots a body's voxels by material, with a legend that counts them. `of` names the robot.
pub(crate) fn body(body: &Body, of: &str, style: &Style) -> Figure {
    let mut canvas = Canvas::new(style);
    let top = heading(&mut canvas, "Body", of, style.column()) + 2.0;
    let at = [MARGIN + 1.0, top];
    let map = MAP * style.column();
    let cell = map / body.height().max(body.width()).max(1) as f64;
    let size = [cell * body.width() as f64, cell * body.height() as f64];
    canvas.frame(at, size, Pen::new(scales::GRID, 0.6));
    let fill = |material: &Material| match material {
        Material::Empty => Colour::gray(0.985),
        material => robot::plain(*material),
    };
    let seam = (0.05 * cell).min(0.5);
    robot::squares(
        &mut canvas,
        at,
        cell,
        seam,
        body.voxels().iter().map(|(place, m)| (place, fill(m))),
    );
    let cells = || {
        body.voxels()
            .iter()
            .map(|(place, material)| (place, *material))
    };
    robot::marks(&mut canvas, at, cell, cells(), robot::plain);
    robot::body_outline(&mut canvas, at, cell, body, Pen::new(colour::INK, 0.8));
    let count = |material: Material| {
        body.voxels()
            .cells()
            .iter()
            .filter(|m| **m == material)
            .count()
    };
    let lines: Vec<(Material, String)> = present(body)
        .map(|m| (m, format!("{} ({})", m.name(), count(m))))
        .collect();
    let x = at[0] + map + 10.0;
    let below = robot::legend(
        &mut canvas,
        [x, top],
        lines
            .iter()
            .map(|(material, text)| (*material, robot::plain(*material), text.as_str())),
        style.column() - MARGIN - x,
    );
    let counts = body.counts();
    let faint = TextStyle::default().colour(colour::FAINT);
    let notes = [
        format!("{} × {} grid,", body.height(), body.width()),
        format!("{},", counted(counts.total, "voxel", "voxels")),
        format!("{},", counted(counts.muscle, "muscle", "muscles")),
        counted(counts.sensor, "sensor", "sensors"),
    ];
    for (k, note) in notes.iter().enumerate() {
        canvas.text([x, below + 11.0 + 10.0 * k as f64], note, faint);
    }
    let height = (top + size[1]).max(below + 45.0) + MARGIN + 1.0;
    Figure::new(&format!("Body: {of}"), [style.column(), height], canvas)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_material_that_is_there_is_named_and_drawn() {
        let svg = body(&"0123/4560".parse().unwrap(), "robot x", &Style::default()).svg();
        for material in Material::ALL.into_iter().skip(1) {
            assert!(
                svg.contains(material.name()) && svg.contains(&robot::plain(material).hex()),
                "{material:?}"
            );
        }
        let plain = body(&"33".parse().unwrap(), "robot y", &Style::default()).svg();
        assert!(plain.contains("muscle, in phase (2)") && !plain.contains("rigid"));
    }
}
