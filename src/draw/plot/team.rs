//! The figures of a team: its confusion matrix, and all its bodies.

use crate::base::number::percent;
use crate::body::{Body, Material};
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::fonts;
use crate::draw::plot::axes::{MARGIN, heading};
use crate::draw::plot::canvas::{Canvas, Pen, TEXT, TextStyle};
use crate::draw::plot::figure::{COLUMN, Figure, PAGE};
use crate::draw::plot::{robot, scales};
use crate::store::team::{Member, TeamFile};
use crate::task::answer::Direction;

/// Space between bodies, points.
const GAP: f64 = 4.0;

/// Largest side of a body, points.
const LARGEST: f64 = 110.0;

/// Space for the caption below a body, points.
const CAPTION: f64 = 17.0;

/// Plots images by class and by the team's answer, most votes; returns `None` without answers.
pub fn confusion(file: &TeamFile) -> Option<Figure> {
    let votes = &file.answers.as_ref()?.votes;
    let count = file.classes.len();
    let mut canvas = Canvas::new();
    let of = format!(
        "{} robots, most votes: {} % of {} {} images",
        file.members.len(),
        percent(votes.accuracy.accuracy),
        file.images.len(),
        file.split
    );
    let widest = |texts: &mut dyn Iterator<Item = String>| {
        texts
            .map(|text| fonts::width(&text, TEXT, false))
            .fold(0.0, f64::max)
    };
    let names = widest(&mut file.classes.iter().map(u8::to_string));
    let numbers = widest(&mut votes.confusion.iter().flatten().map(usize::to_string));
    let left = MARGIN + (3.0 * TEXT).max(TEXT + names + 8.0);
    // With many classes the figure is as wide as names and numbers need, up to a page.
    let within = |width: f64| (width - MARGIN - left) / count as f64;
    let side = (names.max(numbers) + 3.0)
        .min(within(PAGE))
        .max(within(COLUMN));
    let width = left + side * count as f64 + MARGIN;
    let [every_row, every_column] = [TEXT, names + 2.0].map(|room| (room / side).ceil() as usize);
    let has_numbers = numbers <= side && TEXT <= side;
    let top = heading(&mut canvas, "Answers of the team", &of, width) + 8.0 + 2.0 * TEXT;
    let middle = left + side * count as f64 / 2.0;
    canvas.text([middle, top - 1.7 * TEXT], "answer", TextStyle::middle());
    let at = [MARGIN + TEXT, top + side * count as f64 / 2.0];
    canvas.text(
        at,
        "class",
        TextStyle {
            upwards: true,
            ..TextStyle::middle()
        },
    );
    for (row, class) in file.classes.iter().enumerate() {
        let of_class: usize = votes.confusion[row].iter().sum();
        let name = class.to_string();
        let y = top + side * row as f64;
        if row % every_row == 0 {
            canvas.text(
                [left - 3.0, y + side / 2.0 + 0.36 * TEXT],
                &name,
                TextStyle::end(),
            );
        }
        if row % every_column == 0 {
            canvas.text(
                [left + side * (row as f64 + 0.5), top - 3.0],
                &name,
                TextStyle::middle(),
            );
        }
        for (column, images) in votes.confusion[row].iter().enumerate() {
            let x = left + side * column as f64;
            let share = *images as f64 / of_class.max(1) as f64;
            let size = [side - 0.5, side - 0.5];
            canvas.rectangle(
                [x, y],
                size,
                if *images == 0 {
                    Colour::gray(0.97)
                } else {
                    scales::sequential(share)
                },
            );
            if *images > 0 && has_numbers {
                let ink = if share > 0.6 {
                    colour::INK
                } else {
                    colour::PAPER
                };
                let at = [x + side / 2.0, y + side / 2.0 + 0.36 * TEXT];
                canvas.text(at, &images.to_string(), TextStyle::middle().colour(ink));
            }
        }
    }
    let height = top + side * count as f64 + MARGIN;
    Some(Figure::new(
        &format!("Answers: {of}"),
        [width, height],
        canvas,
    ))
}

/// Plots all bodies, with the classes that each tells apart and its accuracy. If every task is a
/// pair of classes, they form a triangle, with the lower class from top to bottom and the higher
/// from left to right. Returns `None` without robots.
pub fn poster(file: &TeamFile) -> Option<Figure> {
    if file.members.is_empty() {
        return None;
    }
    let captions = file
        .members
        .iter()
        .map(|member| fonts::width(&ways(member, f64::INFINITY), TEXT, false));
    let widest = captions.fold(1.0, f64::max).min(LARGEST);
    // Columns wide enough for the caption below a body.
    let most = ((PAGE - 2.0 * MARGIN) / widest) as usize;
    let of_pairs = triangle(file).filter(|_| file.classes.len() - 1 <= most);
    let places = of_pairs.unwrap_or_else(|| rows(file.members.len(), most));
    let columns = places.iter().map(|[column, _]| column + 1).max()?;
    let lines = places.iter().map(|[_, line]| line + 1).max()?;
    let mut canvas = Canvas::new();
    let of = match &file.answers {
        Some(answers) => {
            let accuracy = percent(answers.votes.accuracy.accuracy);
            format!(
                "together they answer {accuracy} % of {} {} images",
                file.images.len(),
                file.split
            )
        }
        None => file.dataset.clone(),
    };
    let count = file.members.len();
    let top = heading(&mut canvas, &format!("A team of {count} bodies"), &of, PAGE) + 4.0;
    let side = ((PAGE - 2.0 * MARGIN) / columns as f64 - GAP).min(LARGEST);
    for (member, [column, line]) in file.members.iter().zip(&places) {
        let at = [
            MARGIN + (side + GAP) * *column as f64,
            top + (side + CAPTION) * *line as f64,
        ];
        drawn(&mut canvas, at, side, &member.body);
        caption(
            &mut canvas,
            [at[0] + side / 2.0, at[1] + side],
            side,
            member,
        );
    }
    // The lower left of the triangle is free.
    let bottom = top + (side + CAPTION) * lines as f64;
    let materials: Vec<Material> = Material::ALL
        .into_iter()
        .filter(|material| !material.is_empty())
        .collect();
    let names: Vec<(Material, Colour, &str)> = materials
        .iter()
        .map(|material| (*material, robot::plain(*material), material.name()))
        .collect();
    let is_free = columns > 3
        && lines > 3
        && places
            .iter()
            .all(|[column, line]| *column >= 3 || *line < lines - 2);
    let start = if is_free {
        bottom - 11.0 * names.len() as f64
    } else {
        bottom
    };
    let below = robot::legend(&mut canvas, [MARGIN, start], names, PAGE / 3.0);
    Some(Figure::new(
        &format!("Team: {of}"),
        [PAGE, bottom.max(below) + MARGIN],
        canvas,
    ))
}

/// Returns the places of the robots if every task is a pair of classes and every pair has a robot.
fn triangle(file: &TeamFile) -> Option<Vec<[usize; 2]>> {
    let place = |class: u8| file.classes.iter().position(|other| *other == class);
    let of = |member: &Member| match &member.groups {
        [a, b] if a.len() == 1 && b.len() == 1 => {
            let (a, b) = (place(a[0])?, place(b[0])?);
            Some([a.max(b) - 1, a.min(b)])
        }
        _ => None,
    };
    let places = file.members.iter().map(of).collect::<Option<Vec<_>>>()?;
    let mut different = places.clone();
    different.sort_unstable();
    different.dedup();
    let pairs = file.classes.len() * file.classes.len().saturating_sub(1) / 2;
    (different.len() == places.len() && places.len() == pairs && pairs > 1).then_some(places)
}

/// Returns column and line of `count` bodies, about as many lines as columns, at most `most`
/// columns.
fn rows(count: usize, most: usize) -> Vec<[usize; 2]> {
    let columns = ((count as f64).sqrt().ceil().max(4.0) as usize).min(most);
    (0..count)
        .map(|number| [number % columns, number / columns])
        .collect()
}

fn drawn(canvas: &mut Canvas, at: [f64; 2], side: f64, body: &Body) {
    let cell = side / body.height().max(body.width()).max(1) as f64;
    let there = body
        .voxels()
        .iter()
        .filter(|(_, material)| !material.is_empty());
    robot::squares(
        canvas,
        at,
        cell,
        -0.05,
        there.map(|(place, material)| (place, robot::plain(*material))),
    );
    robot::marks(
        canvas,
        at,
        cell,
        body.voxels()
            .iter()
            .map(|(place, material)| (place, *material)),
        robot::plain,
    );
    robot::body_outline(canvas, at, cell, body, Pen::new(colour::INK, 0.4));
}

/// Writes the classes that a robot tells apart by walking left or right, and its accuracy.
fn caption(canvas: &mut Canvas, [middle, y]: [f64; 2], most: f64, member: &Member) {
    canvas.text(
        [middle, y + 7.5],
        &ways(member, most + GAP),
        TextStyle::middle(),
    );
    let accuracy = format!("{} %", percent(member.own.accuracy));
    canvas.fitted(
        [middle, y + 15.0],
        &accuracy,
        most,
        TextStyle {
            size: 6.2,
            ..TextStyle::middle()
        }
        .colour(colour::FAINT),
    );
}

/// Returns the classes under which the robot walks left, a bar, and those under which it walks
/// right, as many as fit.
fn ways(member: &Member, most: f64) -> String {
    let (a, b) = if member.first_group_walks == Direction::Left.name() {
        (0, 1)
    } else {
        (1, 0)
    };
    let groups = [a, b].map(|k| {
        let classes: Vec<String> = member.groups[k].iter().map(u8::to_string).collect();
        classes.join(" ")
    });
    let with = |[left, right]: [&str; 2]| format!("← {left} | {right} →");
    let room = most - fonts::width(&with(["", ""]), TEXT, false);
    let [left, right] = [&groups[0], &groups[1]].map(|group| fonts::width(group, TEXT, false));
    // A side that needs less than half leaves the rest to the other.
    let fitted = |k: usize, other: f64| {
        fonts::fitted(&groups[k], TEXT, false, (room / 2.0).max(room - other))
    };
    with([&fitted(0, right), &fitted(1, left)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::team::Accuracy;

    #[test]
    fn a_caption_has_a_bar_between_the_classes_of_the_two_ways() {
        let mut member = Member {
            id: "a".into(),
            run: "toy".into(),
            run_sha256: String::new(),
            task: "0|123".into(),
            groups: [vec![0], vec![1, 2, 3]],
            first_group_walks: "right".into(),
            body: "3".parse().unwrap(),
            own: Accuracy {
                right: 9,
                accuracy: 0.9,
                interval: [0.8, 1.0],
            },
            not_moved: 0.0,
            displacements: Vec::new(),
            shown: Vec::new(),
        };
        let said = |member: &Member| {
            let mut canvas = Canvas::new();
            caption(&mut canvas, [50.0, 50.0], 110.0, member);
            canvas.svg()
        };
        assert!(
            said(&member).contains(">← 1 2 3 | 0 →<"),
            "{}",
            said(&member)
        );
        member.first_group_walks = "left".into();
        assert!(
            said(&member).contains(">← 0 | 1 2 3 →<"),
            "{}",
            said(&member)
        );
        // With many classes on one side, the few on the other are still there.
        member.groups = [(1..26).collect(), vec![26]];
        let text = ways(&member, 80.0);
        assert!(
            text.starts_with("← 1 2 3") && text.ends_with("… | 26 →"),
            "{text}"
        );
        assert!(fonts::width(&text, TEXT, false) <= 80.0);
        member.groups = [(1..14).collect(), (14..27).collect()];
        let text = ways(&member, 80.0);
        assert!(
            text.starts_with("← 1 2 3") && text.contains("… | 14 1") && text.ends_with("… →"),
            "{text}"
        );
    }
}
