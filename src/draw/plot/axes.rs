//! Axes with whole numbers on them, headings, colour bars.

use crate::base::number;
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::fonts::Font;
use crate::draw::plot::canvas::{Canvas, HEADING, Pen, TEXT, TextStyle};
use crate::draw::plot::scales;

/// Line of an axis, points.
const LINE: f64 = 0.6;
/// Length of a tick, points.
const TICK: f64 = 2.5;
/// Distance from tick to number, points.
const GAP: f64 = 2.0;

/// A range of numbers with ticks.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Axis {
    pub(crate) from: f64,
    pub(crate) to: f64,
    step: f64,
}

impl Axis {
    /// Returns a range that covers low … high and ends on ticks, with about this number of them.
    pub(crate) fn nice(low: f64, high: f64, about: usize) -> Self {
        let Axis { from, to, step } = Axis::stepped(low, high, about);
        // Ends that miss a tick only by rounding stay.
        let slack = 1e-9 * step;
        let down = ((from + slack) / step).floor() * step;
        let up = ((to - slack) / step).ceil() * step;
        Axis {
            from: down,
            to: up,
            step,
        }
    }

    /// Returns exactly the range low … high, with about this number of ticks in it.
    pub(crate) fn exact(low: f64, high: f64, about: usize) -> Self {
        let axis = Axis::stepped(low, high, about);
        // A single tick gives no scale: a step longer than both sides leaves only zero. With about
        // six, steps are shorter than half the range, so there are two ticks wherever it begins.
        if axis.ticks().len() > 1 {
            axis
        } else {
            Axis::stepped(low, high, 6)
        }
    }

    fn stepped(low: f64, high: f64, about: usize) -> Self {
        let finite = |v: f64, other: f64| {
            if v.is_finite() {
                v.clamp(-1e12, 1e12)
            } else {
                other
            }
        };
        let (low, high) = (finite(low, 0.0), finite(high, 1.0));
        let (low, high) = if high - low > 1e-9 {
            (low, high)
        } else {
            (low - 0.5, low + 0.5)
        };
        let rough = (high - low) / about.max(1) as f64;
        let power = libm::pow(10.0, libm::log10(rough).floor());
        let factor = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .find(|f| f * power >= rough * 0.999)
            .unwrap_or(10.0);
        Axis {
            from: low,
            to: high,
            step: factor * power,
        }
    }

    /// Restricts ticks to whole numbers.
    pub(crate) fn whole(self) -> Self {
        Axis {
            step: self.step.max(1.0),
            ..self
        }
    }

    pub(crate) fn ticks(&self) -> Vec<f64> {
        let first = (self.from / self.step - 1e-6).ceil();
        let count = ((self.to / self.step + 1e-6).floor() - first).clamp(-1.0, 100.0) as i32;
        (0..=count)
            .map(|k| (first + f64::from(k)) * self.step)
            .collect()
    }

    pub(crate) fn label(&self, value: f64) -> String {
        let decimals = (-libm::log10(self.step).floor()).clamp(0.0, 6.0) as usize;
        grouped(&number::fixed(value, decimals))
    }

    /// Returns the width of the widest tick label, points.
    pub(crate) fn labels_width(&self, font: &Font) -> f64 {
        let widths = self
            .ticks()
            .into_iter()
            .map(|tick| font.width(&self.label(tick), TEXT, false));
        widths.fold(0.0, f64::max)
    }

    /// Returns the position of a value: 0 at the beginning of the axis, 1 at its end.
    pub(crate) fn share(&self, value: f64) -> f64 {
        (value - self.from) / (self.to - self.from)
    }
}

/// Groups digits in threes and uses a real minus sign.
fn grouped(text: &str) -> String {
    let (sign, digits) = text
        .strip_prefix('-')
        .map_or(("", text), |digits| ("−", digits));
    let (whole, rest) = digits.split_at(digits.find('.').unwrap_or(digits.len()));
    let mut out = String::from(sign);
    for (k, digit) in whole.chars().enumerate() {
        if k > 0 && (whole.len() - k) % 3 == 0 {
            out.push(',');
        }
        out.push(digit);
    }
    out + rest
}

/// A rectangle of the figure with two axes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plot {
    pub(crate) at: [f64; 2],
    pub(crate) size: [f64; 2],
    pub(crate) x: Axis,
    pub(crate) y: Axis,
}

impl Plot {
    /// Maps a pair of values to a point of the figure, in points.
    pub(crate) fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [
            self.at[0] + self.x.share(x) * self.size[0],
            self.at[1] + (1.0 - self.y.share(y)) * self.size[1],
        ]
    }

    pub(crate) fn grid(&self, canvas: &mut Canvas, across: bool, up: bool) {
        let pen = Pen::new(scales::GRID, 0.5);
        let [left, top] = self.at;
        for tick in self.y.ticks().into_iter().filter(|_| across) {
            let y = self.place([self.x.from, tick])[1];
            canvas.line([left, y], [left + self.size[0], y], pen);
        }
        for tick in self.x.ticks().into_iter().filter(|_| up) {
            let x = self.place([tick, self.y.from])[0];
            canvas.line([x, top], [x, top + self.size[1]], pen);
        }
    }

    pub(crate) fn lower_axis(&self, canvas: &mut Canvas, name: Option<&str>) {
        let bottom = self.at[1] + self.size[1];
        let pen = Pen::new(colour::INK, LINE);
        canvas.line(
            [self.at[0], bottom],
            [self.at[0] + self.size[0], bottom],
            pen,
        );
        for tick in self.x.ticks() {
            let x = self.place([tick, self.y.from])[0];
            canvas.line([x, bottom], [x, bottom + TICK], pen);
            if name.is_some() {
                canvas.text(
                    [x, bottom + TICK + GAP + 0.72 * TEXT],
                    &self.x.label(tick),
                    TextStyle::middle(),
                );
            }
        }
        if let Some(name) = name {
            let middle = self.at[0] + self.size[0] / 2.0;
            canvas.text([middle, bottom + AXIS - 2.0], name, TextStyle::middle());
        }
    }

    pub(crate) fn left_axis(&self, canvas: &mut Canvas, name: &str) {
        let labels = self.y.labels_width(canvas.font());
        self.left_axis_beside(canvas, name, labels);
    }

    /// Draws the left axis with a fixed room for labels, so that names of stacked plots line up.
    pub(crate) fn left_axis_beside(&self, canvas: &mut Canvas, name: &str, labels: f64) {
        let [left, top] = self.at;
        let pen = Pen::new(colour::INK, LINE);
        canvas.line([left, top], [left, top + self.size[1]], pen);
        for tick in self.y.ticks() {
            let y = self.place([self.x.from, tick])[1];
            canvas.line([left - TICK, y], [left, y], pen);
            canvas.text(
                [left - TICK - GAP, y + 0.36 * TEXT],
                &self.y.label(tick),
                TextStyle::end(),
            );
        }
        let x = left - TICK - GAP - labels - 4.0;
        let words = TextStyle {
            upwards: true,
            ..TextStyle::middle()
        };
        canvas.text([x, top + self.size[1] / 2.0], name, words);
    }
}

/// Space for a lower axis and its name, points.
pub(crate) const AXIS: f64 = 21.5;

/// Returns the space for a left axis and its name, points, if the labels have this width.
pub(crate) fn left_space(labels: f64) -> f64 {
    labels + TICK + GAP + 4.0 + TEXT + 2.0
}

/// Draws the title (bold) and the subject `of` below, unless the style leaves them out; returns the
/// y below them.
pub(crate) fn heading(canvas: &mut Canvas, title: &str, of: &str, width: f64) -> f64 {
    heading_in_lines(canvas, title, of, width, 1)
}

/// Draws the same as [`heading`], with up to `count` lines for the subject.
pub(crate) fn heading_in_lines(
    canvas: &mut Canvas,
    title: &str,
    of: &str,
    width: f64,
    count: usize,
) -> f64 {
    const LINE: f64 = 9.5;
    if !canvas.style().has_title() {
        return MARGIN;
    }
    let most = width - 2.0 * MARGIN;
    canvas.fitted(
        [MARGIN, MARGIN + 7.0],
        title,
        most,
        TextStyle {
            size: HEADING,
            ..TextStyle::default()
        }
        .bold(),
    );
    let lines = canvas.font().lines(of, TEXT, false, most, count);
    for (k, line) in lines.iter().enumerate() {
        let at = [MARGIN, MARGIN + 17.0 + LINE * k as f64];
        canvas.text(at, line, TextStyle::default().colour(colour::FAINT));
    }
    MARGIN + 24.0 + LINE * (lines.len() - 1) as f64
}

/// Margin at the figure's edges, points.
pub(crate) const MARGIN: f64 = 5.0;

/// Draws a horizontal bar of colours with its axis below and its name above, in up to three lines of
/// `room` points; returns the height of the further lines, by which the bar is lower.
pub(crate) fn colour_bar(
    canvas: &mut Canvas,
    [x, y]: [f64; 2],
    [width, room]: [f64; 2],
    axis: &Axis,
    name: &str,
    colour_of: impl Fn(f64) -> Colour,
) -> f64 {
    const STEPS: u32 = 64;
    const LINE_HEIGHT: f64 = 9.5;
    let lines = canvas.font().lines(name, TEXT, false, room, 3);
    for (k, line) in lines.iter().enumerate() {
        canvas.text(
            [x, y - 3.0 + LINE_HEIGHT * k as f64],
            line,
            TextStyle::default(),
        );
    }
    let further = LINE_HEIGHT * (lines.len() - 1) as f64;
    let y = y + further;
    let size = [width, 6.0];
    for k in 0..STEPS {
        let share = |k: u32| f64::from(k) / f64::from(STEPS);
        let value = axis.from
            + share(k) * (axis.to - axis.from)
            + 0.5 * (axis.to - axis.from) / f64::from(STEPS);
        // Slightly wider steps leave no gaps for light to shine through.
        let wide = if k + 1 < STEPS {
            width / f64::from(STEPS) + 0.4
        } else {
            width / f64::from(STEPS)
        };
        canvas.rectangle([x + width * share(k), y], [wide, size[1]], colour_of(value));
    }
    let pen = Pen::new(colour::INK, LINE);
    canvas.frame([x, y], size, Pen::new(colour::INK, 0.4));
    for tick in axis.ticks() {
        let at = x + width * axis.share(tick);
        canvas.line([at, y + size[1]], [at, y + size[1] + TICK], pen);
        canvas.text(
            [at, y + size[1] + TICK + GAP + 0.72 * TEXT],
            &axis.label(tick),
            TextStyle::middle(),
        );
    }
    further
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::plot::Style;
    use crate::draw::plot::canvas::{Element, Ink};

    #[test]
    fn axes_end_on_ticks_that_people_use() {
        let axis = Axis::nice(0.3, 28.4, 5);
        assert_eq!((axis.from, axis.to), (0.0, 30.0));
        assert_eq!(axis.ticks().len(), 4);
        let labels: Vec<String> = Axis::nice(0.0, 1.0, 5)
            .ticks()
            .iter()
            .map(|t| Axis::nice(0.0, 1.0, 5).label(*t))
            .collect();
        assert_eq!(labels, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        let exact = Axis::exact(-3.0, 11.0, 4);
        assert_eq!(
            (exact.ticks(), exact.share(4.0)),
            (vec![0.0, 5.0, 10.0], 0.5)
        );
        // Steps of fifty would leave one tick, at zero.
        assert_eq!(
            Axis::exact(-48.0, 48.0, 4).ticks(),
            [-40.0, -20.0, 0.0, 20.0, 40.0]
        );
        for side in (1..1000).map(|tenths| f64::from(tenths) / 10.0) {
            assert!(
                (1..10).all(|about| Axis::exact(-side, side, about).ticks().len() > 1),
                "{side}"
            );
        }
    }

    #[test]
    fn any_range_has_an_axis() {
        for (low, high) in [
            (0.0, 0.0),
            (f64::NAN, 1.0),
            (5.0, -5.0),
            (0.0, f64::INFINITY),
            (1e300, -1e300),
        ] {
            let axis = Axis::nice(low, high, 5);
            assert!(
                axis.from < axis.to && !axis.ticks().is_empty() && axis.ticks().len() < 50,
                "{low} {high}"
            );
            let exact = Axis::exact(low, high, 4).ticks().len();
            assert!((2..50).contains(&exact), "{low} {high}");
        }
    }

    #[test]
    fn numbers_are_grouped_and_have_a_minus() {
        assert_eq!(
            ["-12", "600000", "-1234.5", "0.50", "0"].map(grouped),
            ["−12", "600,000", "−1,234.5", "0.50", "0"]
        );
    }

    #[test]
    fn ticks_of_a_colour_bar_are_as_thin_as_those_of_axes() {
        let mut canvas = Canvas::new(&Style::default());
        let axis = Axis::exact(-5.0, 5.0, 3);
        colour_bar(&mut canvas, [0.0; 2], [100.0; 2], &axis, "fitness", |_| {
            colour::INK
        });
        let width = |element: &Element| match element {
            Element::Path {
                ink: Ink::Line(pen),
                ..
            } => Some(pen.width),
            _ => None,
        };
        let widths: Vec<f64> = canvas.elements().iter().filter_map(width).collect();
        assert!(widths.len() >= axis.ticks().len());
        assert!(widths.iter().all(|width| *width <= LINE), "{widths:?}");
    }
}
