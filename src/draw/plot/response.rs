//! The figure of a response: how far each soft voxel and sensor moves a body.

use crate::base::number;
use crate::body::Material;
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::panel::present;
use crate::draw::plot::axes::{Axis, MARGIN, colour_bar, heading};
use crate::draw::plot::canvas::{Canvas, Pen, Piece, TextStyle};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::style::{COLUMN, Style};
use crate::draw::plot::{robot, scales};
use crate::store::response::{EndedBy, RobotResponse};

/// Side of the map as a share of the width.
const MAP: f64 = 132.0 / COLUMN;

/// The share of a material's colour that remains, so that the slopes' colours stand out.
const FADED: f64 = 0.55;

/// Plots the slopes of a robot's soft voxels and sensors over its body. `of` names the robot,
/// `task` the task that `taught` estimates.
pub(crate) fn response(
    found: &RobotResponse,
    task: Option<&str>,
    of: &str,
    style: &Style,
) -> Figure {
    let mut canvas = Canvas::new(style);
    let body = &found.body;
    let top = heading(&mut canvas, "Response", of, style.column()) + 2.0;
    let at = [MARGIN + 1.0, top];
    let map = MAP * style.column();
    let cell = map / body.height().max(body.width()).max(1) as f64;
    let size = [cell * body.width() as f64, cell * body.height() as f64];
    canvas.frame(at, size, Pen::new(scales::GRID, 0.6));
    let largest = found
        .places
        .iter()
        .map(|place| place.slope.abs())
        .fold(0.0, f64::max);
    let largest = if largest > 0.0 { largest } else { 1.0 };
    let shade = |slope: f64| scales::diverging(slope / largest);
    let is_place = |material: &Material| *material == Material::Soft || material.is_sensor();
    let others = || {
        body.voxels()
            .iter()
            .filter(|(_, material)| !is_place(material))
    };
    let fill = |material: &Material| match material {
        Material::Empty => Colour::gray(0.985),
        material => faded(robot::plain(*material)),
    };
    let seam = (0.05 * cell).min(0.5);
    robot::squares(
        &mut canvas,
        at,
        cell,
        seam,
        others().map(|(place, material)| (place, fill(material))),
    );
    robot::marks(
        &mut canvas,
        at,
        cell,
        others().map(|(place, material)| (place, *material)),
        |m| fill(&m).with_opacity(90),
    );
    let places = found
        .places
        .iter()
        .map(|place| ((place.row, place.column), shade(place.slope)));
    robot::squares(&mut canvas, at, cell, seam, places);
    let crosses: Vec<Piece> = found
        .places
        .iter()
        .filter(|place| place.is_uncertain())
        .flat_map(|place| {
            cross(
                [
                    at[0] + place.column as f64 * cell,
                    at[1] + place.row as f64 * cell,
                ],
                cell,
            )
        })
        .collect();
    let uncertain = Pen::new(colour::FAINT, 0.5);
    if !crosses.is_empty() {
        canvas.path(crosses, uncertain);
    }
    robot::body_outline(&mut canvas, at, cell, body, Pen::new(colour::INK, 0.8));

    let x = at[0] + map + 10.0;
    let room = style.column() - MARGIN - x;
    let materials = present(body).filter(|material| !is_place(material));
    let lines: Vec<(Material, Colour, &str)> = materials
        .map(|m| (m, faded(robot::plain(m)), m.name()))
        .collect();
    let mut y = robot::legend(&mut canvas, [x, top], lines, room);
    canvas.frame([x, y], [7.0, 7.0], Pen::new(scales::CELL, 0.4));
    canvas.path(cross([x, y], 7.0).to_vec(), uncertain);
    canvas.fitted(
        [x + 10.5, y + 6.2],
        "within 2 errors of 0",
        room - 10.5,
        TextStyle::default(),
    );
    y += 24.0;
    for note in notes(found, task) {
        canvas.fitted(
            [x, y],
            &note,
            room,
            TextStyle::default().colour(colour::FAINT),
        );
        y += 10.0;
    }

    let below = (top + size[1]).max(y - 6.0) + 17.0;
    let axis = Axis::exact(-largest, largest, 4);
    let name = "displacement per rest width of a place [voxel lengths], right positive";
    let bar = style.column() - 2.0 * MARGIN - 12.0;
    let further = colour_bar(
        &mut canvas,
        [MARGIN + 6.0, below],
        [bar, bar + 6.0],
        &axis,
        name,
        shade,
    );
    Figure::new(
        &format!("Response: {of}"),
        [style.column(), below + further + 19.0 + MARGIN],
        canvas,
    )
}

fn notes(found: &RobotResponse, task: Option<&str>) -> Vec<String> {
    let places = found.places.len();
    let certain = found
        .places
        .iter()
        .filter(|place| !place.is_uncertain())
        .count();
    let mut notes = vec![
        format!("{certain} of {places} places certain"),
        format!("R² {}, cross-validated", number::fixed(found.r_squared, 2)),
        format!("scatter {} vl", number::fixed(found.scatter, 1)),
        format!("{} rollouts", found.rollouts),
    ];
    if found.ended_by == EndedBy::Images {
        notes.push(format!(
            "relative error {}",
            number::fixed(found.relative_error, 2)
        ));
    }
    if let (Some(taught), Some(task)) = (&found.taught, task) {
        let [low, high] = taught
            .accuracy_interval
            .map(|share| number::fixed(100.0 * share, 0));
        notes.push(format!("{task}: {low}–{high} % correct"));
    }
    notes
}

fn cross([x, y]: [f64; 2], side: f64) -> [Piece; 2] {
    let [near, far] = [0.25 * side, 0.75 * side];
    [
        Piece::Line(vec![[x + near, y + near], [x + far, y + far]]),
        Piece::Line(vec![[x + far, y + near], [x + near, y + far]]),
    ]
}

/// Mixes a colour with the paper's.
fn faded(fill: Colour) -> Colour {
    let mix = |k: usize| {
        let (own, paper) = (f64::from(fill.rgb[k]), f64::from(colour::PAPER.rgb[k]));
        (paper + FADED * (own - paper)).round() as u8
    };
    Colour::new(mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::response::{ResponsePlace, TrainingEstimate};

    fn found(slopes: [(f64, f64); 3]) -> RobotResponse {
        let places = slopes.into_iter().enumerate();
        let place = |(column, (slope, error)): (usize, (f64, f64))| ResponsePlace {
            row: 0,
            column,
            slope,
            error,
        };
        RobotResponse {
            displacements: vec![Some(1.0); 60],
            id: "a".to_string(),
            body: "256/314/000".parse().unwrap(),
            rollouts: 120,
            unstable: 0,
            ended_by: EndedBy::Images,
            relative_error: 0.31,
            r_squared: 0.875,
            noise: 3.0,
            scatter: 2.5,
            ridge: 4.0,
            intercept: 1.0,
            intercepts: vec![Some(1.0), None],
            places: places.map(place).collect(),
            taught: None,
        }
    }

    #[test]
    fn places_have_the_colour_of_their_slope_and_the_uncertain_ones_a_cross() {
        let svg = response(
            &found([(8.0, 1.0), (-4.0, 1.0), (1.0, 1.0)]),
            None,
            "robot a",
            &Style::default(),
        )
        .svg();
        for slope in [1.0, -0.5, 0.125] {
            assert!(svg.contains(&scales::diverging(slope).hex()), "{slope}");
        }
        let crosses = |svg: &str| {
            svg.matches(&format!("stroke=\"{}\"", colour::FAINT.hex()))
                .count()
        };
        // One is the legend's.
        assert_eq!(crosses(&svg), 2);
        let certain = response(
            &found([(8.0, 1.0), (-4.0, 1.0), (3.0, 1.0)]),
            None,
            "robot a",
            &Style::default(),
        )
        .svg();
        assert_eq!(crosses(&certain), 1);
        assert!(svg.contains("2 of 3 places certain") && certain.contains("3 of 3 places certain"));
        // Other voxels are named; places have a legend of their own.
        assert!(svg.contains("rigid") && svg.contains("antiphase") && !svg.contains("sensor"));
        assert!(
            svg.contains("R² 0.88") && svg.contains("relative error 0.31"),
            "{svg}"
        );
    }

    #[test]
    fn a_gait_that_does_not_move_has_a_map_too_and_a_task_is_told() {
        let mut still = found([(0.0, 0.0); 3]);
        let svg = response(&still, Some("4|9"), "robot a", &Style::default()).svg();
        assert!(svg.contains(&scales::diverging(0.0).hex()) && !svg.contains("4|9"));
        let interval = [0.612, 0.748];
        still.taught = Some(TrainingEstimate {
            fitness: 0.4,
            fitness_interval: interval,
            accuracy: 0.68,
            accuracy_interval: interval,
            margin: None,
        });
        assert!(
            response(&still, Some("4|9"), "robot a", &Style::default())
                .svg()
                .contains("4|9: 61–75 % correct")
        );
    }
}
