//! The figures of a team: its confusion matrix, and all its bodies.

use crate::base::number::percent;
use crate::body::{Body, Material};
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::fonts::Font;
use crate::draw::plot::axes::{MARGIN, heading};
use crate::draw::plot::canvas::{Canvas, Pen, TEXT, TextStyle};
use crate::draw::plot::figure::Figure;
use crate::draw::plot::style::{PAGE, Style};
use crate::draw::plot::{robot, scales};
use crate::store::team::{Member, TeamFile};
use crate::task::answer::Direction;
use crate::task::class_names::ClassNames;

/// Space between bodies, points.
const GAP: f64 = 4.0;

/// Largest side of a body on a page, points.
const LARGEST: f64 = 110.0;

/// Space for the caption below a body, points, and the height of its first lines.
const CAPTION: f64 = 17.0;
const CAPTION_LINE: f64 = 8.2;

/// Largest width of a class's name beside and above the confusion matrix, points.
const LONGEST_NAME: f64 = 90.0;

/// Plots images by class and by the team's answer, most votes; returns `None` without answers.
pub fn confusion(file: &TeamFile, style: &Style) -> Option<Figure> {
    let votes = &file.answers.as_ref()?.votes;
    let count = file.classes.len();
    let mut canvas = Canvas::new(style);
    let of = format!(
        "{} robots, most votes: {} % of {} {} images",
        file.members.len(),
        percent(votes.accuracy.accuracy),
        file.images.len(),
        file.split
    );
    let font = style.font();
    let widest = |texts: &mut dyn Iterator<Item = String>| {
        texts
            .map(|text| font.width(&text, TEXT, false))
            .fold(0.0, f64::max)
    };
    let class_names = file.names();
    let name = |class: &u8| font.fitted(&class_names.name(*class), TEXT, false, LONGEST_NAME);
    let names = widest(&mut file.classes.iter().map(name));
    let numbers = widest(&mut votes.confusion.iter().flatten().map(usize::to_string));
    let left = MARGIN + (3.0 * TEXT).max(TEXT + names + 8.0);
    // Names that are wider than their columns stand upright.
    let is_named = !class_names.all().is_empty();
    let needed = numbers.max(if is_named { TEXT } else { names });
    // With many classes the figure is as wide as names and numbers need, up to a page.
    let within = |width: f64| (width - MARGIN - left) / count as f64;
    let side = (needed + 3.0)
        .min(within(style.page()))
        .max(within(style.column()));
    let width = left + side * count as f64 + MARGIN;
    let is_upright = is_named && names + 2.0 > side;
    let (across, high) = if is_upright {
        (TEXT, names)
    } else {
        (names + 2.0, TEXT)
    };
    let [every_row, every_column] = [TEXT, across].map(|room| (room / side).ceil() as usize);
    let has_numbers = numbers <= side && TEXT <= side;
    let top =
        heading(&mut canvas, "Answers of the team", &of, width) + 8.0 + 2.0 * TEXT + (high - TEXT);
    let middle = left + side * count as f64 / 2.0;
    canvas.text(
        [middle, top - 1.7 * TEXT - (high - TEXT)],
        "answer",
        TextStyle::middle(),
    );
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
        let name = name(class);
        let y = top + side * row as f64;
        if row % every_row == 0 {
            canvas.text(
                [left - 3.0, y + side / 2.0 + 0.36 * TEXT],
                &name,
                TextStyle::end(),
            );
        }
        if row % every_column == 0 {
            let x = left + side * (row as f64 + 0.5);
            let upright = TextStyle {
                upwards: true,
                ..TextStyle::default()
            };
            let (x, style) = if is_upright {
                (x + 0.36 * TEXT, upright)
            } else {
                (x, TextStyle::middle())
            };
            canvas.text([x, top - 3.0], &name, style);
        }
        for (column, images) in votes.confusion[row].iter().enumerate() {
            let x = left + side * column as f64;
            let share = *images as f64 / of_class.max(1) as f64;
            let size = [side - 0.5, side - 0.5];
            canvas.rectangle([x, y], size, scales::share(share));
            canvas.frame([x, y], size, Pen::new(scales::GRID, 0.4));
            if has_numbers {
                let ink = match share {
                    0.0 => colour::FAINT,
                    share if share < 0.5 => colour::INK,
                    _ => colour::PAPER,
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
pub fn poster(file: &TeamFile, style: &Style) -> Option<Figure> {
    if file.members.is_empty() {
        return None;
    }
    let largest = LARGEST * style.page() / PAGE;
    let captions = Captions::of(file, style.font());
    let widths = file
        .members
        .iter()
        .flat_map(|member| captions.ways(member, f64::INFINITY))
        .map(|line| style.font().width(&line, TEXT, false));
    let (widest, below) = (widths.fold(1.0, f64::max).min(largest), captions.height());
    // Columns wide enough for the caption below a body.
    let most = ((style.page() - 2.0 * MARGIN) / widest) as usize;
    let of_pairs = triangle(file).filter(|_| file.classes.len() - 1 <= most);
    let places = of_pairs.unwrap_or_else(|| rows(file.members.len(), most));
    let columns = places.iter().map(|[column, _]| column + 1).max()?;
    let lines = places.iter().map(|[_, line]| line + 1).max()?;
    let mut canvas = Canvas::new(style);
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
    let top = heading(
        &mut canvas,
        &format!("A team of {count} bodies"),
        &of,
        style.page(),
    ) + 4.0;
    let side = ((style.page() - 2.0 * MARGIN) / columns as f64 - GAP).min(largest);
    for (member, [column, line]) in file.members.iter().zip(&places) {
        let at = [
            MARGIN + (side + GAP) * *column as f64,
            top + (side + below) * *line as f64,
        ];
        drawn(&mut canvas, at, side, &member.body);
        captions.write(
            &mut canvas,
            [at[0] + side / 2.0, at[1] + side],
            side,
            member,
        );
    }
    // The lower left of the triangle is free.
    let bottom = top + (side + below) * lines as f64;
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
    let below = robot::legend(&mut canvas, [MARGIN, start], names, style.page() / 3.0);
    Some(Figure::new(
        &format!("Team: {of}"),
        [style.page(), bottom.max(below) + MARGIN],
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

/// Writes the classes that a robot tells apart below its body, and its accuracy.
struct Captions<'a> {
    font: &'a Font,
    names: ClassNames,
    /// The number of lines for the classes: each side of named ones has its own.
    lines: usize,
}

impl<'a> Captions<'a> {
    fn of(file: &TeamFile, font: &'a Font) -> Self {
        let names = file.names();
        let lines = if names.all().is_empty() { 1 } else { 2 };
        Captions { font, names, lines }
    }

    /// Returns the height of a caption, points.
    fn height(&self) -> f64 {
        CAPTION + CAPTION_LINE * (self.lines - 1) as f64
    }

    fn write(&self, canvas: &mut Canvas, [middle, y]: [f64; 2], most: f64, member: &Member) {
        let below = CAPTION_LINE * (self.lines - 1) as f64;
        // A line with a side of its own leaves the gap free.
        let room = if self.lines == 1 { most + GAP } else { most };
        for (line, text) in self.ways(member, room).iter().enumerate() {
            let y = y + 7.5 + CAPTION_LINE * line as f64;
            canvas.text([middle, y], text, TextStyle::middle());
        }
        let accuracy = format!("{} %", percent(member.own.accuracy));
        canvas.fitted(
            [middle, y + below + 15.0],
            &accuracy,
            most,
            TextStyle {
                size: 6.2,
                ..TextStyle::middle()
            }
            .colour(colour::FAINT),
        );
    }

    /// Returns the classes under which the robot walks left, and those under which it walks right,
    /// as many as fit: in a line with a bar between them, or in a line each.
    fn ways(&self, member: &Member, most: f64) -> Vec<String> {
        let (a, b) = if member.first_group_walks == Direction::Left.name() {
            (0, 1)
        } else {
            (1, 0)
        };
        let groups = [a, b].map(|k| self.names.side(&member.groups[k]));
        let width = |text: &str| self.font.width(text, TEXT, false);
        let fitted = |text: &str, most| self.font.fitted(text, TEXT, false, most);
        if self.lines == 2 {
            let room = most - width("← ");
            let [left, right] = groups.map(|group| fitted(&group, room));
            return vec![format!("← {left}"), format!("{right} →")];
        }
        let with = |[left, right]: [&str; 2]| format!("← {left} | {right} →");
        let room = most - width(&with(["", ""]));
        let [left, right] = [&groups[0], &groups[1]].map(|group| width(group));
        // A side that needs less than half leaves the rest to the other.
        let side = |k: usize, other: f64| fitted(&groups[k], (room / 2.0).max(room - other));
        vec![with([&side(0, right), &side(1, left)])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::fonts::EMBEDDED;
    use crate::draw::plot::svg::Words;
    use crate::store::team::Accuracy;

    fn member() -> Member {
        Member {
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
        }
    }

    #[test]
    fn a_caption_has_a_bar_between_the_classes_of_the_two_ways() {
        let mut member = member();
        let captions = Captions {
            font: &EMBEDDED,
            names: ClassNames::default(),
            lines: 1,
        };
        let said = |member: &Member| {
            let mut canvas = Canvas::default();
            captions.write(&mut canvas, [50.0, 50.0], 110.0, member);
            canvas.svg(Words::Text)
        };
        let ways = |member: &Member, most| captions.ways(member, most).concat();
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
        assert!(EMBEDDED.width(&text, TEXT, false) <= 80.0);
        member.groups = [(1..14).collect(), (14..27).collect()];
        let text = ways(&member, 80.0);
        assert!(
            text.starts_with("← 1 2 3") && text.contains("… | 14 1") && text.ends_with("… →"),
            "{text}"
        );
    }

    #[test]
    fn named_classes_have_a_line_for_each_side_of_a_caption() {
        let names = ["cat", "guinea pig", "dog"].map(String::from);
        let captions = Captions {
            font: &EMBEDDED,
            names: ClassNames::of(&names),
            lines: 2,
        };
        let mut member = member();
        member.groups = [vec![0, 1], vec![2]];
        member.first_group_walks = "left".into();
        assert_eq!(
            captions.ways(&member, 200.0),
            ["← cat, guinea pig", "dog →"]
        );
        for line in captions.ways(&member, 40.0) {
            assert!(EMBEDDED.width(&line, TEXT, false) <= 40.0, "{line}");
        }
    }
}
