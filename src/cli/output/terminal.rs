//! Renders a frame of a recording as text, for a live view in a terminal.

use crate::base::Grid;
use crate::body::Material;
use crate::draw::colour;
use crate::draw::colour::Colour;
use crate::draw::panel::readout;
use crate::draw::walk::{Walk, area};
use crate::task::recording::FramedImage;

/// The minimum width, columns, of a view with the stimulus in a corner.
const WIDE: usize = 40;

/// The largest side of the whole image in the other corner, pixels.
const WHOLE: usize = 16;

/// The content of one pixel of the view.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pixel {
    Sky,
    Ground,
    /// Ground below a mark of the ruler (every ten voxel lengths from the start).
    Mark,
    Voxel(Material, f64),
    Image(f64),
    /// The frame around the part of the image that the sensors see.
    Window,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Depth {
    /// No colours: letters stand for materials.
    Plain,
    /// 256 colours of a fixed palette.
    Indexed,
    /// 24-bit colours.
    Full,
}

impl Depth {
    /// Infers the depth from the environment: whether colours are wanted, `COLORTERM` and `TERM`.
    pub(crate) fn of(is_wanted: bool, colorterm: &str, term: &str) -> Self {
        let full = ["direct", "kitty", "alacritty", "foot", "ghostty", "wezterm"];
        match () {
            () if !is_wanted || term == "dumb" => Depth::Plain,
            () if term.is_empty() && !cfg!(windows) => Depth::Plain,
            () if matches!(colorterm, "truecolor" | "24bit") => Depth::Full,
            () if full.iter().any(|name| term.contains(name)) => Depth::Full,
            () => Depth::Indexed,
        }
    }

    /// Returns the sequence that sets the colours of a half block's upper and lower half.
    fn sequence(self, [upper, lower]: [[u8; 3]; 2]) -> String {
        if self == Depth::Indexed {
            return format!("\x1b[38;5;{};48;5;{}m", indexed(upper), indexed(lower));
        }
        let [[r, g, b], [x, y, z]] = [upper, lower];
        format!("\x1b[38;2;{r};{g};{b};48;2;{x};{y};{z}m")
    }
}

/// Returns the nearest of the 256 colours: from a cube of 6 × 6 × 6, or one of 24 grays.
fn indexed(rgb: [u8; 3]) -> u8 {
    const LEVELS: [u8; 6] = [0, 95, 135, 175, 215, 255];
    let distance = |a: [u8; 3]| -> u32 {
        a.iter()
            .zip(rgb)
            .map(|(a, b)| u32::from(a.abs_diff(b)).pow(2))
            .sum()
    };
    let nearest = |v: u8| {
        (0u8..6)
            .min_by_key(|&k| LEVELS[usize::from(k)].abs_diff(v))
            .unwrap_or(0)
    };
    let [r, g, b] = rgb.map(nearest);
    let cube = (
        distance([r, g, b].map(|k| LEVELS[usize::from(k)])),
        16 + 36 * r + 6 * g + b,
    );
    let gray = (0u8..24)
        .map(|k| (distance([8 + 10 * k; 3]), 232 + k))
        .min()
        .unwrap_or(cube);
    if gray.0 < cube.0 { gray.1 } else { cube.1 }
}

/// Renders a frame as `rows` lines of exactly `columns` characters, joined by newlines: a line of
/// read-outs, then the world, with a moving camera. With colours, a character has two pixels (half
/// blocks). In ASCII, `#` is rigid, `:` soft, `/` and `\` muscles, `-` and `+` sensors.
pub(crate) fn frame(
    walk: &Walk,
    frame: usize,
    columns: usize,
    rows: usize,
    depth: Depth,
) -> String {
    let colour = depth != Depth::Plain;
    let (columns, rows) = (columns.min(1000), rows.min(1000));
    let words = readout(walk, frame);
    let status = format!(
        "{}  {}  {}  {}",
        words.label, words.time, words.displacement, words.verdict
    );
    let status = if colour {
        status
    } else {
        status.replace(['·', '−'], "-").replace(['←', '→'], "")
    };
    let shown = status.chars().map(|c| {
        if c.is_control() || (!colour && !c.is_ascii()) {
            '?'
        } else {
            c
        }
    });
    let status: String = shown.chain(std::iter::repeat(' ')).take(columns).collect();
    // A character is about twice as high as wide.
    let (height, tall) = if colour {
        (2 * rows.saturating_sub(1), 1.0)
    } else {
        (rows.saturating_sub(1), 2.0)
    };
    let pixels = pixels(walk, frame, columns, height, tall);
    let mut lines = vec![status];
    let at = |r: usize, c: usize| pixels.get(r * columns + c).copied().unwrap_or(Pixel::Sky);
    for row in 1..rows {
        let line = |cell: &dyn Fn(usize) -> String| -> String { (0..columns).map(cell).collect() };
        lines.push(if colour {
            let pair = |c: usize| [at(2 * row - 2, c), at(2 * row - 1, c)].map(|p| paint(p).rgb);
            let half = |c: usize| match pair(c) {
                // The colours stay set until they change.
                same if c > 0 && same == pair(c - 1) => "▀".to_string(),
                pair => depth.sequence(pair) + "▀",
            };
            line(&half) + "\x1b[0m"
        } else {
            line(&|c| letter(at(row - 1, c)).to_string())
        });
    }
    lines.truncate(rows);
    lines.join("\n")
}

/// Returns the view as rows of pixels, top row first; a pixel is `tall` times as high as wide.
fn pixels(walk: &Walk, frame: usize, columns: usize, rows: usize, tall: f64) -> Vec<Pixel> {
    if columns == 0 || rows == 0 {
        return vec![];
    }
    let first = walk.extent(0..1);
    let (width, top) = (
        (first.right - first.left).clamp(1.0, 128.0),
        first.top.clamp(1.0, 128.0),
    );
    let ground = 1 + rows / 16;
    // Pixels per voxel length: the robot, as much free ground beside it, and some sky above.
    let scale = (columns as f64 / (2.0 * width + 4.0))
        .min((rows - ground.min(rows - 1)) as f64 * tall / (1.2 * top + 1.0));
    let left = ((walk.centre(frame)[0] * scale).round() - (columns / 2) as f64) / scale;
    let surface = rows.saturating_sub(ground);
    let zero = walk.centre(walk.rollout(frame).start)[0];
    let mut out = vec![Pixel::Sky; columns * rows];
    for (i, pixel) in out.iter_mut().enumerate().skip(surface * columns) {
        let x = left + ((i % columns) as f64 + 0.5) / scale - zero;
        let is_mark = (x / 10.0 - (x / 10.0).round()).abs() * 10.0 * scale <= 0.5;
        *pixel = if is_mark { Pixel::Mark } else { Pixel::Ground };
    }
    for (material, quad) in walk.voxels(frame) {
        let shown = Pixel::Voxel(material, area(&quad));
        let place = quad.map(|[x, y]| [(x - left) * scale, surface as f64 - y * scale / tall]);
        let bounds = |k: usize, most: usize| {
            let low = place.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min);
            let high = place.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max);
            low.floor().clamp(0.0, most as f64) as usize
                ..high.ceil().clamp(0.0, most as f64) as usize
        };
        for row in bounds(1, surface) {
            for column in bounds(0, columns) {
                if contains(&place, [column as f64 + 0.5, row as f64 + 0.5]) {
                    out[row * columns + column] = shown;
                }
            }
        }
    }
    let image = &walk.phase(frame).seen.stimulus;
    if columns >= WIDE && 2 * image.width() < columns && image.height() < surface && tall == 1.0 {
        for ((row, column), intensity) in image.iter() {
            out[row * columns + column] = Pixel::Image(*intensity);
        }
    }
    if let Some(image) = &walk.phase(frame).seen.image {
        let whole = whole(image);
        if columns >= WIDE && 4 * whole.width() < columns && whole.height() < surface && tall == 1.0
        {
            let left = columns - whole.width();
            for ((row, column), pixel) in whole.iter() {
                out[row * columns + left + column] = *pixel;
            }
        }
    }
    out
}

/// Returns an image of which the sensors see a part, at most [`WHOLE`] pixels wide and high, with
/// that part framed.
fn whole(image: &FramedImage) -> Grid<Pixel> {
    let pixels = &image.pixels;
    let step = pixels.height().max(pixels.width()).div_ceil(WHOLE).max(1);
    let [rows, columns] = image.window();
    let mean = |row: usize, column: usize| {
        let rows = step * row..(step * (row + 1)).min(pixels.height());
        let columns = step * column..(step * (column + 1)).min(pixels.width());
        let count = rows.len() * columns.len();
        let all = rows.flat_map(|row| columns.clone().map(move |column| (row, column)));
        let sum: f64 = all.map(|place| f64::from(pixels[place])).sum();
        Pixel::Image(sum / (255.0 * count.max(1) as f64))
    };
    let ends = |[first, end]: [usize; 2]| [first / step, end.saturating_sub(1) / step];
    let ([top, bottom], [left, right]) = (ends(rows), ends(columns));
    let is_edge = |row: usize, column: usize| {
        let (across, up) = (
            (left..=right).contains(&column),
            (top..=bottom).contains(&row),
        );
        across && (row == top || row == bottom) || up && (column == left || column == right)
    };
    let side = |side: usize| side.div_ceil(step);
    Grid::from_fn(
        side(pixels.height()),
        side(pixels.width()),
        |row, column| match is_edge(row, column) {
            true => Pixel::Window,
            false => mean(row, column),
        },
    )
}

/// Returns true if a quadrilateral contains a point: an odd number of its sides are to the right.
fn contains(quad: &[[f64; 2]; 4], [x, y]: [f64; 2]) -> bool {
    let crossed = |k: &usize| {
        let ([ax, ay], [bx, by]) = (quad[*k], quad[(k + 1) % 4]);
        (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax)
    };
    (0..4).filter(crossed).count() % 2 == 1
}

fn paint(pixel: Pixel) -> Colour {
    match pixel {
        Pixel::Sky => Colour::gray(0.95),
        Pixel::Ground => Colour::new(206, 198, 182),
        Pixel::Mark => colour::GROUND_LINE,
        Pixel::Voxel(material, area) => colour::shade(material, area),
        Pixel::Image(intensity) => Colour::gray(intensity),
        Pixel::Window => colour::WINDOW,
    }
}

fn letter(pixel: Pixel) -> char {
    match pixel {
        Pixel::Sky => ' ',
        Pixel::Ground => '=',
        Pixel::Mark => '|',
        Pixel::Voxel(Material::Rigid, _) => '#',
        Pixel::Voxel(Material::MuscleInPhase, _) => '/',
        Pixel::Voxel(Material::MuscleAntiphase, _) => '\\',
        Pixel::Voxel(Material::ActuatorHorizontal, _) => '<',
        Pixel::Voxel(Material::ActuatorVertical, _) => '^',
        Pixel::Voxel(Material::SensorShrink, _) => '-',
        Pixel::Voxel(Material::SensorExpand, _) => '+',
        Pixel::Voxel(Material::Soft | Material::Empty, _) => ':',
        Pixel::Image(intensity) => {
            if intensity > 0.5 {
                '@'
            } else {
                '.'
            }
        }
        Pixel::Window => '*',
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::simulated;
    use crate::task::margins::Margins;
    use crate::task::recording::Recording;
    use crate::task::stimulus::StimulusParams;

    /// Counts the visible characters of every line.
    fn visible(text: &str) -> Vec<usize> {
        let strip = |line: &str| {
            let mut pieces = line.split('\x1b');
            let first = pieces.next().map_or(0, |p| p.chars().count());
            first
                + pieces
                    .map(|p| p.split_once('m').map_or(0, |(_, t)| t.chars().count()))
                    .sum::<usize>()
        };
        text.split('\n').map(strip).collect()
    }

    #[test]
    fn views_have_the_asked_size() {
        let mut recording = simulated("3344/1256", 2, 20, true);
        recording.frames[7].points[3] = [f64::NAN, 1e300];
        recording.frames[8].points[3] = [1e8, -1e8];
        let walk = Walk::new(&recording).unwrap();
        for (columns, rows) in [(80, 24), (20, 8), (1, 1), (2, 2), (200, 60), (41, 3)] {
            for f in [0, 7, 8, 30, 41] {
                for depth in [Depth::Plain, Depth::Indexed, Depth::Full] {
                    let text = frame(&walk, f, columns, rows, depth);
                    assert_eq!(visible(&text), vec![columns; rows], "{columns} × {rows}");
                    assert!(depth != Depth::Plain || text.is_ascii());
                }
            }
        }
        assert!(frame(&walk, 0, 10, 0, Depth::Full).is_empty());
    }

    #[test]
    fn colours_are_those_that_the_terminal_says_it_has() {
        assert_eq!(Depth::of(true, "truecolor", "xterm"), Depth::Full);
        assert_eq!(Depth::of(true, "", "xterm-kitty"), Depth::Full);
        assert_eq!(Depth::of(true, "", "xterm-256color"), Depth::Indexed);
        assert_eq!(Depth::of(false, "truecolor", "xterm"), Depth::Plain);
        assert_eq!(Depth::of(true, "truecolor", "dumb"), Depth::Plain);
        let colours = [
            [0, 0, 0],
            [255, 255, 255],
            [255, 0, 0],
            [118, 118, 118],
            [200, 36, 58],
        ];
        assert_eq!(colours.map(indexed), [16, 231, 196, 243, 161]);
    }

    #[test]
    fn the_whole_image_is_in_the_other_corner_with_the_part_framed_that_the_sensors_see() {
        let mut recording = simulated("3344/1256", 1, 5, true);
        let [red, green, blue] = colour::WINDOW.rgb;
        let seen = |recording: &Recording| {
            let walk = Walk::new(recording).unwrap();
            frame(&walk, 0, 80, 24, Depth::Full).contains(&format!("{red};{green};{blue}"))
        };
        assert!(!seen(&recording));
        let params = StimulusParams {
            margin: Margins {
                top: 8,
                right: 2,
                bottom: 4,
                left: 20,
            },
            ..StimulusParams::default()
        };
        let image = FramedImage::of(&Grid::filled(28, 28, 51), &params).unwrap();
        let small = whole(&image);
        let line =
            |row: usize| -> String { (0..14).map(|column| letter(small[(row, column)])).collect() };
        assert_eq!(
            [3, 4, 5, 11, 12].map(line),
            [
                "..............",
                "..........***.",
                "..........*.*.",
                "..........***.",
                ".............."
            ]
        );
        recording.phases[0].seen.image = Some(image);
        assert!(seen(&recording));
    }

    #[test]
    fn every_material_is_seen_in_its_colour_or_letter() {
        let recording = simulated("123/456", 1, 10, false);
        let walk = Walk::new(&recording).unwrap();
        let plain = frame(&walk, 0, 80, 24, Depth::Plain);
        assert!("#:/\\-+=|".chars().all(|c| plain.contains(c)), "{plain}");
        let colours = frame(&walk, 4, 80, 24, Depth::Full);
        for (material, quad) in walk.voxels(4) {
            let [r, g, b] = colour::shade(material, area(&quad)).rgb;
            assert!(colours.contains(&format!("{r};{g};{b}")), "{material:?}");
        }
    }
}
