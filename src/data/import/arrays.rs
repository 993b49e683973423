//! Arrays of images and of labels: which belong together, and their values as grey and classes.

use crate::base::error::Error;
use crate::data::import::item::{Found, Grey, Item, Label, Part, Picture, Refused};
use crate::data::import::pictures;

/// The numbers or texts of an array.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Truth values, 0 or 1.
    Bools(Vec<u8>),
    /// Whole numbers from 0 to 255.
    Bytes(Vec<u8>),
    /// Whole numbers.
    Whole(Vec<i64>),
    /// Numbers with fractions.
    Real(Vec<f64>),
    /// Texts.
    Texts(Vec<String>),
}

impl Values {
    /// Returns the values of these indices.
    pub(crate) fn picked(&self, places: impl Iterator<Item = usize>) -> Self {
        fn of<T: Clone>(all: &[T], places: impl Iterator<Item = usize>) -> Vec<T> {
            places.map(|place| all[place].clone()).collect()
        }
        match self {
            Values::Bools(all) => Values::Bools(of(all, places)),
            Values::Bytes(all) => Values::Bytes(of(all, places)),
            Values::Whole(all) => Values::Whole(of(all, places)),
            Values::Real(all) => Values::Real(of(all, places)),
            Values::Texts(all) => Values::Texts(of(all, places)),
        }
    }

    fn len(&self) -> usize {
        match self {
            Values::Bools(all) | Values::Bytes(all) => all.len(),
            Values::Whole(all) => all.len(),
            Values::Real(all) => all.len(),
            Values::Texts(all) => all.len(),
        }
    }
}

/// An array with its name, in row-major order.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// The file, and the key in it if there are several; in Python the keyword.
    pub name: String,
    /// The lengths of its dimensions.
    pub shape: Vec<usize>,
    /// As many values as the shape says.
    pub values: Values,
}

/// Images with their labels, as the caller has them in memory.
#[derive(Clone, Debug)]
pub struct LabelledArrays {
    /// The images.
    pub images: Array,
    /// One number or text for each image.
    pub labels: Array,
    /// The split that they are for; `None`: the split is drawn.
    pub split: Option<crate::data::info::Split>,
}

/// Images and labels that belong together.
#[derive(Debug)]
pub(crate) struct Pair {
    pub(crate) part: Option<Part>,
    pub(crate) images: Array,
    pub(crate) labels: Array,
    pub(crate) is_emnist: bool,
}

impl Array {
    fn count(&self) -> usize {
        self.shape.first().copied().unwrap_or(0)
    }

    /// Returns the number of values for one image.
    fn each(&self) -> usize {
        self.shape.iter().skip(1).product()
    }

    fn described(&self) -> String {
        let sizes: Vec<String> = self.shape.iter().map(ToString::to_string).collect();
        format!("{} ({})", self.name, sizes.join(" × "))
    }
}

/// Finds the images and the labels of each part among arrays, by their names and dimensions.
///
/// # Errors
/// Reports arrays that cannot be told apart, with their names and sizes.
pub(crate) fn pairs(place: &str, arrays: Vec<Array>, is_emnist: bool) -> Result<Vec<Pair>, Error> {
    let listed: Vec<String> = arrays.iter().map(Array::described).collect();
    let unclear = || {
        let found = listed.join(", ");
        Error::input(format!(
            "{place}: expected one array of images (count × height × width) and one of labels (count) for \
             each split, found {found}"
        ))
        .advice("name the arrays x_train, y_train, x_test and y_test, or give only two")
    };
    let mut parts: Vec<Option<Part>> = arrays.iter().map(|array| part(&array.name)).collect();
    parts.sort_unstable();
    parts.dedup();
    let is_split = parts.iter().any(Option::is_some);
    let mut left = arrays;
    let mut pairs = Vec::new();
    for of in parts {
        let (these, others): (Vec<Array>, Vec<Array>) =
            left.into_iter().partition(|array| part(&array.name) == of);
        left = others;
        // Such as the names of the classes, or a number of them.
        if of.is_none() && is_split {
            continue;
        }
        let [images, labels] = told_apart(these).ok_or_else(unclear)?;
        pairs.push(Pair {
            part: of,
            images,
            labels,
            is_emnist,
        });
    }
    match pairs.is_empty() {
        true => Err(unclear()),
        false => Ok(pairs),
    }
}

/// Returns the own name of an array without the file's, which may name another part.
fn key(name: &str) -> &str {
    name.rsplit_once(':').map_or(name, |(_, key)| key)
}

fn part(name: &str) -> Option<Part> {
    Part::named(key(name))
}

fn told_apart(arrays: Vec<Array>) -> Option<[Array; 2]> {
    let is_some = |array: &Array| array.count() > 0 && array.each() > 0;
    let (mut images, mut labels): (Vec<Array>, Vec<Array>) = arrays
        .into_iter()
        .filter(is_some)
        .partition(|array| array.each() > 1);
    const IMAGES: [&str; 6] = ["x", "im", "data", "pix", "input", "feature"];
    const LABELS: [&str; 4] = ["y", "label", "target", "class"];
    let narrow = |arrays: &mut Vec<Array>, words: &[&str]| {
        if arrays.len() > 1 {
            arrays.retain(|array| {
                let lower = key(&array.name).to_lowercase();
                let mut names = lower.split(|c: char| !c.is_alphanumeric());
                names.any(|name| words.iter().any(|word| name.starts_with(word)))
            });
        }
    };
    narrow(&mut images, &IMAGES);
    narrow(&mut labels, &LABELS);
    match (images.len(), labels.len()) {
        (1, 1) => Some([images.pop()?, labels.pop()?]),
        _ => None,
    }
}

/// The meaning of the numbers of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scale {
    /// 1 is white.
    Unit,
    /// 255 is white.
    Byte,
}

/// Returns the scale of all pixels together: a split of dark images alone would mislead.
pub(crate) fn scale<'a>(all: impl Iterator<Item = &'a Array>) -> Result<Scale, Error> {
    let mut most = 0.0_f64;
    let mut fractions = None;
    for array in all {
        let [least, largest] = match &array.values {
            Values::Bools(values) | Values::Bytes(values) => {
                [0.0, values.iter().max().copied().map_or(0.0, f64::from)]
            }
            Values::Whole(values) => {
                let [least, most] = [values.iter().min(), values.iter().max()];
                [least, most].map(|number| number.map_or(0.0, |number| *number as f64))
            }
            Values::Real(values) if values.iter().any(|value| !value.is_finite()) => {
                return Err(pixels_refused(&array.name, "a value that is no number"));
            }
            Values::Real(values) => [
                values.iter().copied().fold(f64::INFINITY, f64::min),
                values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            ],
            Values::Texts(_) => return Err(pixels_refused(&array.name, "texts")),
        };
        if least < 0.0 || largest > 255.0 {
            return Err(pixels_refused(
                &array.name,
                &format!("{least} to {largest}"),
            ));
        }
        most = most.max(largest);
        if largest <= 1.0 && matches!(array.values, Values::Real(_)) {
            fractions = Some(array);
        }
    }
    if let Some(array) = fractions.filter(|_| most > 1.0) {
        return Err(Error::input(format!(
            "{}: has pixels from 0 to 1, other images have pixels from 0 to {most}: expected one scale",
            array.name
        )));
    }
    Ok(match most <= 1.0 {
        true => Scale::Unit,
        false => Scale::Byte,
    })
}

fn pixels_refused(name: &str, found: &str) -> Error {
    let text = format!("{name}: expected pixels from 0 to 1 or from 0 to 255, found {found}");
    Error::input(text).advice("scale them back to 0 to 255 first")
}

pub(crate) fn byte(value: f64, scale: Scale) -> u8 {
    let white = match scale {
        Scale::Unit => 255.0,
        Scale::Byte => 1.0,
    };
    (value * white).round().clamp(0.0, 255.0) as u8
}

/// Layout of an image's values in an array.
#[derive(Clone, Copy, Debug)]
struct Layout {
    height: usize,
    width: usize,
    channels: usize,
    /// True if each channel is a plane of its own.
    is_planes: bool,
}

fn layout(array: &Array) -> Result<Layout, Error> {
    let of = |height, width, channels, is_planes| Layout {
        height,
        width,
        channels,
        is_planes,
    };
    let found = match array.shape[..] {
        [_, height, width] => Some(of(height, width, 1, false)),
        [_, height, width, channels @ (1 | 3 | 4)] => Some(of(height, width, channels, false)),
        [_, channels @ (1 | 3), height, width] => Some(of(height, width, channels, true)),
        [_, pixels] if pixels.isqrt() * pixels.isqrt() == pixels => {
            Some(of(pixels.isqrt(), pixels.isqrt(), 1, false))
        }
        _ => None,
    };
    found.ok_or_else(|| {
        Error::input(format!(
            "{}: expected images as count × height × width, with 1, 3 or 4 channels last or 1 or 3 first, \
             or count × pixels of squares",
            array.described()
        ))
    })
}

/// Makes labelled images of pairs of arrays.
pub(crate) fn items(pairs: &[Pair]) -> Result<Found, Error> {
    let scale = scale(pairs.iter().map(|pair| &pair.images))?;
    let mut found = Found::default();
    for pair in pairs {
        let (images, labels) = (&pair.images, &pair.labels);
        let (count, named) = (images.count(), labels.count());
        if count != named || labels.values.len() != count {
            return Err(Error::input(format!(
                "{}: has {named} labels, expected {count}, one for each image of {}",
                labels.name, images.name
            )));
        }
        let layout = layout(images)?;
        for index in 0..count {
            let source = format!("{}:{index}", images.name);
            let one = grey(images, index, layout, scale);
            match (one, label(labels, index)) {
                (Ok(grey), Ok(label)) => found.items.push(Item {
                    picture: Picture::Grey(grey),
                    label,
                    part: pair.part,
                    source,
                    is_emnist: pair.is_emnist,
                }),
                (Err(reason), _) | (_, Err(reason)) => {
                    found.refused.push(Refused::new(source, reason));
                }
            }
        }
    }
    Ok(found)
}

fn grey(array: &Array, index: usize, layout: Layout, scale: Scale) -> Result<Grey, String> {
    let each = array.each();
    let range = index * each..(index + 1) * each;
    let bytes: Vec<u8> = match &array.values {
        Values::Bools(all) => all[range]
            .iter()
            .map(|value| 255 * u8::from(*value > 0))
            .collect(),
        Values::Bytes(all) if scale == Scale::Byte => all[range].to_vec(),
        Values::Bytes(all) => all[range]
            .iter()
            .map(|value| byte(f64::from(*value), scale))
            .collect(),
        Values::Whole(all) => all[range]
            .iter()
            .map(|value| byte(*value as f64, scale))
            .collect(),
        Values::Real(all) => all[range].iter().map(|value| byte(*value, scale)).collect(),
        Values::Texts(_) => return Err("is a text".to_string()),
    };
    let Layout {
        height,
        width,
        channels,
        is_planes,
    } = layout;
    let bytes = match is_planes {
        true => {
            let places = (0..height * width).flat_map(|place| {
                (0..channels).map(move |channel| channel * height * width + place)
            });
            places.map(|place| bytes[place]).collect()
        }
        false => bytes,
    };
    pictures::of_channels(width, height, channels, &bytes)
}

fn label(array: &Array, index: usize) -> Result<Label, String> {
    Ok(match &array.values {
        Values::Bools(all) | Values::Bytes(all) => Label::Number(i64::from(all[index])),
        Values::Whole(all) => Label::Number(all[index]),
        Values::Real(all) if all[index].fract() == 0.0 && all[index].abs() < 1e15 => {
            Label::Number(all[index] as i64)
        }
        Values::Real(all) => {
            return Err(format!(
                "its label is {}: expected a whole number",
                all[index]
            ));
        }
        Values::Texts(all) if all[index].trim().is_empty() => {
            return Err("has no label".to_string());
        }
        Values::Texts(all) => Label::Name(all[index].trim().to_string()),
    })
}
