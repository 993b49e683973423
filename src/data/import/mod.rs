//! `morphcog data import`: makes a dataset of pictures, arrays or tables.
//!
//! Sources are read twice: first to decide once for all pictures how they are prepared, then to
//! prepare them. Nothing depends on the order in which a folder lists its files, or on threads.

pub mod arrays;
mod classes;
mod item;
mod npy;
#[cfg(feature = "parquet")]
mod parquet;
mod pictures;
mod prepare;
mod source;
mod split;
pub(crate) mod store;
mod tables;

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::files::home_expanded;
use crate::base::observer::Work;
use crate::base::session::Session;
use crate::base::table;
use crate::base::text::{counted, one_line};
use crate::data::catalogue::FETCHABLE;
use crate::data::dataset::is_drawn;
use crate::data::description::Description;
use crate::data::files::{check_name, default_folder};
use crate::data::idx;
use crate::data::import::arrays::{LabelledArrays, Pair};
use crate::data::import::classes::Classes;
use crate::data::import::item::{Found, Grey, Item, Label, Part, Picture};
use crate::data::import::prepare::{Facts, Plan};
use crate::data::import::store::{IMAGES_CSV, Staging};
use crate::data::info::Split;
pub use item::Refused;
pub use prepare::{Fit, Fitted};
use rayon::prelude::*;
use serde::Serialize;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Most pixels of a picture that is kept between the two readings.
const FEW_PIXELS: usize = 1 << 14;

/// Number of pictures between two looks at whether to stop.
const BATCH: usize = 256;

/// Sides that images may be given.
const SIDES: std::ops::RangeInclusive<usize> = 4..=512;

/// A user's choices for an import.
#[derive(Clone, Debug)]
pub struct ImportOptions {
    /// Name of the dataset.
    pub name: String,
    /// The folder to write; `data/<name>` if not given.
    pub to: Option<PathBuf>,
    /// Share of each class that is for tests, if the source has no split of its own.
    pub test: f64,
    /// Seed of that split.
    pub seed: u64,
    /// Side of the images, unless they are kept as they are \[pixels\].
    pub size: usize,
    /// The way in which pictures are fitted into that.
    pub fit: Fit,
    /// True to invert all pictures; `None`: if most have a bright ground.
    pub invert: Option<bool>,
    /// True to exchange rows and columns; `None`: of EMNIST's files.
    pub transpose: Option<bool>,
    /// True to replace a dataset that is in the folder.
    pub force: bool,
}

impl ImportOptions {
    /// Returns the usual choices for a dataset of this name.
    pub fn named(name: impl Into<String>) -> Self {
        ImportOptions {
            name: name.into(),
            to: None,
            test: 0.2,
            seed: 1,
            size: 28,
            fit: Fit::Auto,
            invert: None,
            transpose: None,
            force: false,
        }
    }

    /// Returns the folder to write.
    fn folder(&self) -> PathBuf {
        match &self.to {
            Some(to) => home_expanded(to),
            None => default_folder(&self.name),
        }
    }

    fn check(&self) -> Result<(), Error> {
        check_name(&self.name).map_err(|_| {
            let expected = "expected a name of letters, digits, '-', '_' and '.'";
            Error::argument("name", &self.name, expected)
        })?;
        let name = self.name.as_str();
        if is_drawn(name) || FETCHABLE.contains(&name) {
            let text = "expected another name: this one means a dataset that is known";
            return Err(Error::argument("name", &self.name, text));
        }
        if !(self.test > 0.0 && self.test < 1.0) {
            let text = "expected a share above 0 and below 1, as 0.2";
            return Err(Error::argument("test", self.test, text));
        }
        if !SIDES.contains(&self.size) {
            let text = format!("expected {} to {} pixels", SIDES.start(), SIDES.end());
            return Err(Error::argument("size", self.size, text));
        }
        Ok(())
    }
}

/// The images of an import.
#[derive(Clone, Debug)]
pub enum ImportSource {
    /// Folders and files.
    Paths(Vec<PathBuf>),
    /// Arrays in memory.
    Arrays(Vec<LabelledArrays>),
    /// Pictures of any size in memory.
    Pictures(Vec<InMemory>),
}

/// A picture in memory with its class.
#[derive(Clone, Debug)]
pub struct InMemory {
    /// The picture: 0 is black.
    pub pixels: Grid<u8>,
    /// The class.
    pub class: ClassLabel,
    /// The split that it is for; `None`: the split is drawn.
    pub split: Option<Split>,
}

/// A class as the user calls it.
#[derive(Clone, Debug)]
pub enum ClassLabel {
    /// By a number.
    Number(i64),
    /// By a name.
    Name(String),
}

/// Images of a class in the dataset.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ClassCount {
    /// Number of the class.
    pub class: u8,
    /// Name of the class, if it has one.
    pub name: Option<String>,
    /// Number of training images.
    pub train: usize,
    /// Number of test images.
    pub test: usize,
}

/// A dataset that was made.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Imported {
    /// Name of the dataset.
    pub name: String,
    /// Its folder.
    pub folder: PathBuf,
    /// Height and width of its images.
    pub size: [usize; 2],
    /// Its classes.
    pub classes: Vec<ClassCount>,
    /// The way in which pictures were fitted.
    pub fit: Fitted,
    /// Height and width of the smallest and of the largest picture.
    pub sizes: [[usize; 2]; 2],
    /// True if pictures were inverted.
    pub inverted: bool,
    /// True if pictures were inverted or not because the user said so.
    pub inversion_chosen: bool,
    /// True if rows and columns were exchanged.
    pub transposed: bool,
    /// True if that was since these are EMNIST's files.
    pub emnist: bool,
    /// True if the source has a split of its own.
    pub own_split: bool,
    /// Images that were left out.
    pub refused: Vec<Refused>,
    /// Number of files that are no pictures.
    pub passed_over: usize,
    /// Remarks on the source.
    pub notes: Vec<String>,
}

/// A dataset that is written, but not yet in its place.
pub(crate) struct Staged {
    staging: Staging,
    imported: Imported,
}

impl Staged {
    /// Returns the folder in which it is as yet.
    pub(crate) fn path(&self) -> &Path {
        self.staging.path()
    }

    pub(crate) fn write(&self, name: &str, content: &[u8]) -> Result<(), Error> {
        self.staging.write(name, content)
    }

    /// Puts it in its place.
    pub(crate) fn commit(self) -> Result<Imported, Error> {
        self.staging.commit()?;
        Ok(self.imported)
    }
}

/// Makes a dataset in a folder beside its place.
///
/// # Errors
/// Reports sources without a dataset in them, and a place that is taken.
pub(crate) fn stage(
    source: ImportSource,
    options: &ImportOptions,
    session: &Session,
) -> Result<Staged, Error> {
    options.check()?;
    let folder = options.folder();
    store::check_free(&folder, options.force)?;
    let mut found = match source {
        ImportSource::Paths(paths) => {
            check_apart(&paths, &folder)?;
            source::find(&paths, &options.name, session)?
        }
        ImportSource::Arrays(arrays) => arrays::items(&paired(arrays))?,
        ImportSource::Pictures(pictures) => in_memory(pictures),
    };
    let own_split = settle_parts(&mut found);
    if found.items.is_empty() {
        return Err(nothing_readable(&found));
    }
    let labels: BTreeSet<Label> = found.items.iter().map(|item| item.label.clone()).collect();
    let classes = Classes::of(&labels, found.class_names.as_deref())?;
    if classes.numbers.values().collect::<BTreeSet<_>>().len() < 2 {
        let only = labels
            .iter()
            .next()
            .map(|label| format!("{label}"))
            .unwrap_or_default();
        let refused = match found.refused.as_slice() {
            [] => String::new(),
            [first, ..] => format!(
                "; {} left out, such as {} {}",
                counted(found.refused.len(), "other is", "others are"),
                first.source,
                first.reason
            ),
        };
        return Err(Error::input(format!(
            "all images are of one class, {only}: expected two or more{refused}"
        )));
    }
    let notes = classes.changed.iter().map(|[before, after]| {
        format!(
            "the class {:?} is called {after:?}, so that a task can name it",
            one_line(before)
        )
    });
    found.notes.extend(notes);
    let read = look(&mut found, options, session)?;
    check_classes_left(&found, &read, &classes)?;
    let plan = plan(&read, options, own_split)?;
    let mut images = prepared(&read, &plan, &mut found.refused, options, session)?;
    images
        .iter_mut()
        .for_each(|image| image.class = classes.numbers[&image.item.label]);
    check_prepared(&images, &read, &classes)?;
    let splits = splits(&images, &classes, own_split, options)?;
    let staging = Staging::beside(&folder)?;
    let size = match plan.fit {
        Fitted::Kept => read[0].facts.size,
        _ => [plan.side; 2],
    };
    write(&staging, &images, &splits, &classes, size, session)?;
    let is_turned = |image: &Prepared| options.transpose.unwrap_or(image.item.is_emnist);
    let by_area = |read: &&Read| read.facts.size[0] * read.facts.size[1];
    let smallest = read
        .iter()
        .min_by_key(by_area)
        .map_or(size, |read| read.facts.size);
    let largest = read
        .iter()
        .max_by_key(by_area)
        .map_or(size, |read| read.facts.size);
    let is_inverted = |image: &Prepared| !image.facts.is_cut_out || plan.inverts_cut_outs;
    let imported = Imported {
        name: options.name.clone(),
        folder,
        size,
        classes: counts(&images, &splits, &classes),
        fit: plan.fit,
        sizes: [smallest, largest],
        inverted: plan.is_inverted && images.iter().any(is_inverted),
        inversion_chosen: options.invert.is_some(),
        transposed: images.iter().any(is_turned),
        emnist: options.transpose.is_none() && images.iter().any(|image| image.item.is_emnist),
        own_split,
        refused: found.refused,
        passed_over: found.passed_over,
        notes: found.notes,
    };
    Ok(Staged { staging, imported })
}

/// Refuses to replace a folder that is a source, or holds one.
fn check_apart(sources: &[PathBuf], folder: &Path) -> Result<(), Error> {
    let Ok(folder) = folder.canonicalize() else {
        return Ok(());
    };
    let real = |path: &PathBuf| home_expanded(path).canonicalize().ok();
    match sources
        .iter()
        .filter_map(real)
        .find(|path| path.starts_with(&folder))
    {
        Some(path) => Err(Error::usage(format!(
            "{}: the dataset would replace it",
            path.display()
        ))
        .advice("give the dataset another name or folder")),
        None => Ok(()),
    }
}

fn paired(arrays: Vec<LabelledArrays>) -> Vec<Pair> {
    let pair = |labelled: LabelledArrays| Pair {
        part: labelled.split.map(Part::from),
        images: labelled.images,
        labels: labelled.labels,
        is_emnist: false,
    };
    arrays.into_iter().map(pair).collect()
}

fn in_memory(pictures: Vec<InMemory>) -> Found {
    let item = |(number, picture): (usize, InMemory)| Item {
        picture: Picture::Grey(Grey::new(
            picture.pixels.height(),
            picture.pixels.width(),
            picture.pixels.cells().to_vec(),
        )),
        label: match picture.class {
            ClassLabel::Number(number) => Label::Number(number),
            ClassLabel::Name(name) => Label::Name(name),
        },
        part: picture.split.map(Part::from),
        source: number.to_string(),
        is_emnist: false,
    };
    Found {
        items: pictures.into_iter().enumerate().map(item).collect(),
        ..Found::default()
    }
}

/// Makes two parts of up to three; returns true if the source has both.
fn settle_parts(found: &mut Found) -> bool {
    let has = |found: &Found, part: Part| found.items.iter().any(|item| item.part == Some(part));
    if has(found, Part::Validation) {
        let is_test = has(found, Part::Test);
        let before = found.items.len();
        match is_test {
            true => found
                .items
                .retain(|item| item.part != Some(Part::Validation)),
            false => found.items.iter_mut().for_each(|item| {
                if item.part == Some(Part::Validation) {
                    item.part = Some(Part::Test);
                }
            }),
        }
        found.notes.push(match is_test {
            true => format!(
                "{} left out: there are test images of their own",
                counted(
                    before - found.items.len(),
                    "validation image is",
                    "validation images are"
                )
            ),
            false => "the validation images are the test images: there are no others".to_string(),
        });
    }
    let is_split =
        has(found, Part::Test) && found.items.iter().any(|item| item.part != Some(Part::Test));
    if !is_split && let Some(part) = found.items.iter().find_map(|item| item.part) {
        let (own, other) = match part {
            Part::Test => ("test", "training"),
            _ => ("training", "test"),
        };
        found.notes.push(format!(
            "the source calls its images {own} images and has no {other} images: both are drawn from these"
        ));
    }
    is_split
}

fn nothing_readable(found: &Found) -> Error {
    let mut text = "no image can be read".to_string();
    for (refused, mark) in found.refused.iter().zip([": ", "; ", "; "]) {
        text += &format!("{mark}{} {}", refused.source, refused.reason);
    }
    match found.refused.len() {
        0..=3 => Error::input(text),
        all => Error::input(format!("{text}; and {} more", all - 3)),
    }
}

/// A picture that was read once.
struct Read {
    item: Item,
    facts: Facts,
}

/// Reads a picture as it is in its source, turned if that is wanted.
fn decoded<'a>(item: &'a Item, options: &ImportOptions) -> Result<Cow<'a, Grey>, String> {
    let grey = match &item.picture {
        Picture::File(path) => Cow::Owned(pictures::grey(&item::read(path)?)?),
        Picture::Encoded(bytes) => Cow::Owned(pictures::grey(bytes)?),
        Picture::Grey(grey) => Cow::Borrowed(grey),
    };
    Ok(match options.transpose.unwrap_or(item.is_emnist) {
        true => Cow::Owned(grey.transposed()),
        false => grey,
    })
}

/// Looks at all pictures once, and keeps small ones. Those that cannot be read are left out.
fn look(found: &mut Found, options: &ImportOptions, session: &Session) -> Result<Vec<Read>, Error> {
    let items = std::mem::take(&mut found.items);
    let total = items.len();
    let label = format!("reading {}:", counted(total, "image", "images"));
    session
        .observer
        .begins(&Work::new(label, total as u64, "images"));
    let see = |mut item: Item| -> Result<Read, Refused> {
        let failed = |reason: String| Refused::new(item.source.clone(), reason).of(&item.label);
        let grey = decoded(&item, options).map_err(failed)?;
        let facts = Facts::of(&grey).map_err(failed)?;
        let is_small = grey.pixels.len() <= FEW_PIXELS && !matches!(item.picture, Picture::Grey(_));
        let kept = is_small.then(|| grey.into_owned());
        if let Some(grey) = kept {
            // It is turned already.
            item.is_emnist = false;
            item.picture = Picture::Grey(match options.transpose {
                Some(true) => grey.transposed(),
                _ => grey,
            });
        }
        Ok(Read { item, facts })
    };
    let pool = session.pool()?;
    let mut read = Vec::with_capacity(total);
    let mut items = items.into_iter();
    loop {
        session.check()?;
        let batch: Vec<Item> = items.by_ref().take(BATCH).collect();
        if batch.is_empty() {
            break;
        }
        let seen: Vec<Result<Read, Refused>> =
            pool.install(|| batch.into_par_iter().map(see).collect());
        for one in seen {
            match one {
                Ok(one) => read.push(one),
                Err(refused) => found.refused.push(refused),
            }
        }
        session
            .observer
            .progress((read.len() + found.refused.len()).min(total) as u64);
    }
    match read.is_empty() {
        true => Err(nothing_readable(found)),
        false => Ok(read),
    }
}

/// Refuses a source of which no image of a class is left.
fn check_classes_left(found: &Found, read: &[Read], classes: &Classes) -> Result<(), Error> {
    let left: BTreeSet<u8> = read
        .iter()
        .map(|read| classes.numbers[&read.item.label])
        .collect();
    let lost = classes
        .numbers
        .iter()
        .find(|(_, number)| !left.contains(number));
    match lost {
        None => Ok(()),
        Some((label, _)) => {
            let text = format!("no image of the class {label} can be read");
            let folder = label.to_string();
            let is_of = |refused: &&Refused| match &refused.label {
                Some(own) => own == label,
                None => refused.source.split('/').any(|name| name == folder),
            };
            let why = match (found.refused.iter().find(is_of), found.refused.first()) {
                (Some(own), _) => format!("; {} {}", own.source, own.reason),
                (None, Some(other)) => format!(
                    "; of those that cannot be read, {} {}",
                    other.source, other.reason
                ),
                (None, None) => String::new(),
            };
            Err(Error::input(text + &why))
        }
    }
}

fn plan(read: &[Read], options: &ImportOptions, own_split: bool) -> Result<Plan, Error> {
    let facts: Vec<Facts> = read.iter().map(|read| read.facts).collect();
    let of = |part: Part| {
        let is_of =
            move |read: &&Read| (read.item.part == Some(Part::Test)) == (part == Part::Test);
        prepare::one_size(read.iter().filter(is_of).map(|read| &read.facts))
    };
    let said = |[height, width]: [usize; 2]| format!("{height} × {width}");
    if own_split
        && options.fit == Fit::Auto
        && let (Some(train), Some(test)) = (of(Part::Train), of(Part::Test))
        && train != test
    {
        let text = format!(
            "training images have {} pixels, test images {}: expected one size, or a way to fit them in",
            said(train),
            said(test)
        );
        return Err(Error::input(text).about("fit"));
    }
    let fit = match options.fit {
        Fit::Auto => prepare::fitting(&facts),
        Fit::Whole => Fitted::Whole,
        Fit::Content => Fitted::Content,
        Fit::Keep => Fitted::Kept,
    };
    let other = read.iter().find(|one| one.facts.size != read[0].facts.size);
    if let (Fitted::Kept, Some(other)) = (fit, other) {
        let text = format!(
            "images are kept only if all have one size: {} has {} pixels, {} has {}",
            read[0].item.source,
            said(read[0].facts.size),
            other.item.source,
            said(other.facts.size)
        );
        return Err(Error::input(text).about("fit"));
    }
    Ok(Plan {
        fit,
        is_inverted: options.invert.unwrap_or_else(|| prepare::is_bright(&facts)),
        inverts_cut_outs: options.invert.is_some(),
        side: options.size,
    })
}

/// An image of the dataset.
struct Prepared<'a> {
    item: &'a Item,
    facts: &'a Facts,
    class: u8,
    pixels: Vec<u8>,
}

fn prepared<'a>(
    read: &'a [Read],
    plan: &Plan,
    refused: &mut Vec<Refused>,
    options: &ImportOptions,
    session: &Session,
) -> Result<Vec<Prepared<'a>>, Error> {
    let label = format!("preparing {}:", counted(read.len(), "image", "images"));
    session
        .observer
        .begins(&Work::new(label, read.len() as u64, "images"));
    let make = |read: &'a Read| -> Result<Prepared<'a>, Refused> {
        let failed = |reason: String| Refused::new(read.item.source.clone(), reason);
        let grey = decoded(&read.item, options).map_err(failed)?;
        // Somebody may have replaced the file between the two readings.
        if [grey.height, grey.width] != read.facts.size {
            return Err(failed("has changed while it was read".to_string()));
        }
        Ok(Prepared {
            item: &read.item,
            facts: &read.facts,
            class: 0,
            pixels: plan.apply(&grey, &read.facts).map_err(failed)?,
        })
    };
    let pool = session.pool()?;
    let mut images = Vec::with_capacity(read.len());
    for (number, batch) in read.chunks(BATCH).enumerate() {
        session.check()?;
        let made: Vec<Result<Prepared, Refused>> =
            pool.install(|| batch.par_iter().map(make).collect());
        for one in made {
            match one {
                Ok(one) => images.push(one),
                Err(one) => refused.push(one),
            }
        }
        session
            .observer
            .progress((number * BATCH + batch.len()) as u64);
    }
    Ok(images)
}

/// Refuses a dataset that no robot could learn anything from.
fn check_prepared(images: &[Prepared], read: &[Read], classes: &Classes) -> Result<(), Error> {
    let left: BTreeSet<u8> = images.iter().map(|image| image.class).collect();
    if let Some((label, _)) = classes
        .numbers
        .iter()
        .find(|(_, number)| !left.contains(number))
    {
        let text = format!("no image of the class {label} is left when they are prepared");
        return Err(
            Error::input(text).advice("say how they are inverted, and how they are fitted in")
        );
    }
    let is_first = |image: &Prepared| image.pixels == images[0].pixels;
    match images.iter().all(is_first) {
        true => Err(Error::input(format!(
            "all {} images are the same when they are prepared",
            read.len()
        ))),
        false => Ok(()),
    }
}

fn splits(
    images: &[Prepared],
    classes: &Classes,
    own_split: bool,
    options: &ImportOptions,
) -> Result<Vec<Split>, Error> {
    let called = |class: u8| {
        classes
            .name(class)
            .map_or(class.to_string(), str::to_string)
    };
    if !own_split {
        let labels: Vec<u8> = images.iter().map(|image| image.class).collect();
        return split::drawn(&labels, options.test, options.seed).map_err(|class| {
            let text = format!(
                "there is only one image of the class {}: expected one for training and one for tests",
                called(class)
            );
            Error::input(text).advice("add images of it, or leave the class out")
        });
    }
    let split = |image: &Prepared| match image.item.part {
        Some(Part::Test) => Split::Test,
        _ => Split::Train,
    };
    let splits: Vec<Split> = images.iter().map(split).collect();
    for (of, called_split) in [(Split::Train, "training"), (Split::Test, "test")] {
        let has = |class: u8| {
            images
                .iter()
                .zip(&splits)
                .any(|(image, split)| image.class == class && *split == of)
        };
        if let Some(class) = classes.numbers.values().copied().find(|class| !has(*class)) {
            let text = format!(
                "there is no {called_split} image of the class {}: expected some of each class in both splits",
                called(class)
            );
            return Err(Error::input(text).advice("add some, or leave the class out"));
        }
    }
    Ok(splits)
}

fn counts(images: &[Prepared], splits: &[Split], classes: &Classes) -> Vec<ClassCount> {
    let mut counts = BTreeMap::<u8, [usize; 2]>::new();
    for (image, split) in images.iter().zip(splits) {
        counts.entry(image.class).or_default()[usize::from(*split == Split::Test)] += 1;
    }
    let count = |(class, [train, test]): (u8, [usize; 2])| ClassCount {
        class,
        name: classes.name(class).map(str::to_string),
        train,
        test,
    };
    counts.into_iter().map(count).collect()
}

/// Writes all files but the sheet.
fn write(
    staging: &Staging,
    images: &[Prepared],
    splits: &[Split],
    classes: &Classes,
    [height, width]: [usize; 2],
    session: &Session,
) -> Result<(), Error> {
    let mut rows = Vec::new();
    for (of, stem) in [(Split::Train, "train"), (Split::Test, "t10k")] {
        session.check()?;
        let these: Vec<&Prepared> = images
            .iter()
            .zip(splits)
            .filter(|(_, split)| **split == of)
            .map(|(image, _)| image)
            .collect();
        let sizes = [these.len(), height, width].map(|size| size as u32);
        let mut content = idx::header(&sizes);
        these
            .iter()
            .for_each(|image| content.extend_from_slice(&image.pixels));
        staging.write(&format!("{stem}-images-idx3-ubyte"), &content)?;
        let mut content = idx::header(&sizes[..1]);
        content.extend(these.iter().map(|image| image.class));
        staging.write(&format!("{stem}-labels-idx1-ubyte"), &content)?;
        rows.extend(these.into_iter().enumerate().map(|(index, image)| {
            let name = classes.name(image.class).unwrap_or_default().to_string();
            (
                of.to_string(),
                index,
                image.class,
                name,
                one_line(&image.item.source),
            )
        }));
    }
    session.check()?;
    let columns = ["split", "index", "class", "name", "source"];
    staging.write(IMAGES_CSV, &table::csv(columns, rows))?;
    // The images stand upright, whatever the dataset is called.
    Description::new(classes.names.clone(), Some(false))
        .write(staging.path())
        .map_err(|error| Error {
            message: error.message.replace(
                &staging.path().display().to_string(),
                &staging.target().display().to_string(),
            ),
            ..error
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::error::ErrorKind;
    use crate::base::random::{Purpose, stream};
    use crate::data::dataset::Dataset;
    use crate::data::files::places;
    use crate::data::import::arrays::{Array, Values};
    use crate::data::import::pictures::tests as made;
    use std::io::Write;
    use std::sync::atomic::AtomicBool;

    /// Returns a PNG with a bar of a brightness on a ground, at a place by its number.
    fn bar(is_upright: bool, number: u8, ground: u8, ink: u8) -> Vec<u8> {
        let at = usize::from(20 + number % 40);
        let is_ink = |row: usize, column: usize| match is_upright {
            true => (at..at + 6).contains(&column) && (10..80).contains(&row),
            false => (at..at + 6).contains(&row) && (10..80).contains(&column),
        };
        let pixels: Vec<u8> = (0..90 * 100)
            .map(|place| {
                if is_ink(place / 100, place % 100) {
                    ink
                } else {
                    ground
                }
            })
            .collect();
        made::png_bytes(
            100,
            90,
            png::ColorType::Grayscale,
            png::BitDepth::Eight,
            &pixels,
        )
    }

    struct Place(tempfile::TempDir);

    impl Place {
        fn new() -> Self {
            Place(tempfile::tempdir().unwrap())
        }

        /// A folder with these classes of bars in `pictures`.
        fn with_bars(count: u8) -> Self {
            let place = Place::new();
            for number in 0..count {
                place.put(
                    &format!("pictures/up/{number}.png"),
                    &bar(true, number, 240, 10),
                );
                place.put(
                    &format!("pictures/across/{number}.PNG"),
                    &bar(false, number, 240, 10),
                );
            }
            place
        }

        fn put(&self, name: &str, content: &[u8]) {
            let path = self.0.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, content).unwrap();
        }

        fn at(&self, name: &str) -> PathBuf {
            self.0.path().join(name)
        }

        fn options(&self, name: &str) -> ImportOptions {
            ImportOptions {
                to: Some(self.at("out").join(name)),
                ..ImportOptions::named(name)
            }
        }

        fn import_with(
            &self,
            sources: &[&str],
            options: &ImportOptions,
        ) -> Result<Imported, Error> {
            let paths = sources.iter().map(|name| self.at(name)).collect();
            stage(ImportSource::Paths(paths), options, &Session::default())?.commit()
        }

        fn import(&self, sources: &[&str]) -> Result<Imported, Error> {
            self.import_with(sources, &self.options("own"))
        }

        /// Imports what must be refused, and checks what is said and that nothing is left.
        fn refused(&self, sources: &[&str], said: &str) {
            let error = self.import(sources).unwrap_err();
            assert!(error.to_string().contains(said), "{said}: {error}");
            assert_eq!(error.kind, ErrorKind::Input, "{error}");
            assert!(!self.at("out").exists(), "{said}");
        }

        fn loaded(&self) -> Dataset {
            let places = places(Some(&self.at("out/own")), None, None);
            Dataset::load("own", &places, &Split::ALL).unwrap()
        }

        fn bytes(&self, name: &str) -> Vec<u8> {
            std::fs::read(self.at(name)).unwrap()
        }
    }

    fn npy(descr: &str, shape: &[usize], data: &[u8]) -> Vec<u8> {
        let sizes: Vec<String> = shape.iter().map(|size| format!("{size},")).collect();
        let sizes = sizes.join(" ");
        let header =
            format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({sizes}), }}\n");
        let length = (header.len() as u16).to_le_bytes();
        [npy::MAGIC, &[1, 0], &length, header.as_bytes(), data].concat()
    }

    fn npz(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
        let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for (name, content) in arrays {
            let options = zip::write::SimpleFileOptions::default();
            writer.start_file(format!("{name}.npy"), options).unwrap();
            writer.write_all(content).unwrap();
        }
        writer.finish().unwrap().into_inner()
    }

    /// Returns pixels of 4 × 4 images and their labels, 0 and 1 in turn.
    fn numbers(count: u8) -> (Vec<u8>, Vec<u8>) {
        let image =
            |number: u8| (0..16).map(move |pixel| if pixel == number % 16 { 255 } else { pixel });
        let pixels = (0..count).flat_map(image).collect();
        (pixels, (0..count).map(|number| number % 2).collect())
    }

    #[test]
    fn a_folder_of_pictures_becomes_a_dataset_that_says_what_was_done() {
        let place = Place::with_bars(5);
        place.put("pictures/up/6.jpg", &made::jpeg_bytes()[..100]);
        place.put("pictures/up/notes.txt", b"text");
        place.put("pictures/up/.hidden.png", b"x");
        let made = place.import(&["pictures"]).unwrap();
        let count = |class, name: &str| ClassCount {
            class,
            name: Some(name.into()),
            train: 4,
            test: 1,
        };
        assert_eq!(made.classes, [count(0, "across"), count(1, "up")]);
        assert_eq!(
            (made.fit, made.size, made.sizes),
            (Fitted::Content, [28, 28], [[90, 100]; 2])
        );
        assert!(made.inverted && !made.own_split && !made.transposed);
        assert_eq!((made.refused.len(), made.passed_over), (1, 1));
        assert_eq!(made.refused[0].source, "up/6.jpg");
        let data = place.loaded();
        assert_eq!((data.len(Split::Train), data.len(Split::Test)), (8, 2));
        assert_eq!(data.class_names().list(&[0, 1]), "across, up");
        let image = data
            .image(Split::Train, data.indices_of(Split::Train, 1)[0])
            .unwrap();
        // Upright and in the middle.
        assert!(image[(14, 13)] > 200 && image[(5, 13)] > 200 && image[(14, 20)] == 0);
        let table = String::from_utf8(place.bytes("out/own/images.csv")).unwrap();
        assert!(
            table.starts_with("split,index,class,name,source\ntrain,0,0,across,across/"),
            "{table}"
        );
        assert_eq!(table.lines().count(), 11);
        let entries = std::fs::read_dir(place.at("out")).unwrap();
        assert_eq!(entries.count(), 1);
    }

    #[test]
    fn nothing_depends_on_threads_and_the_split_on_the_seed_alone() {
        let place = Place::with_bars(9);
        let made = |name: &str, seed, threads| {
            let options = ImportOptions {
                seed,
                ..place.options(name)
            };
            let session = Session::default().threads(Some(threads));
            let source = ImportSource::Paths(vec![place.at("pictures")]);
            stage(source, &options, &session).unwrap().commit().unwrap();
            place.bytes(&format!("out/{name}/images.csv"))
        };
        let one = made("a", 1, 1);
        assert_eq!(one, made("b", 1, 3));
        assert_ne!(one, made("c", 2, 1));
    }

    #[test]
    fn folders_named_as_splits_are_the_split_and_validation_is_for_tests_if_nothing_else_is() {
        let place = Place::new();
        for split in ["train", "Testing", "val"] {
            for number in 0..3 {
                place.put(
                    &format!("p/{split}/a/{number}.png"),
                    &bar(true, number, 0, 200),
                );
                place.put(
                    &format!("p/{split}/b/{number}.png"),
                    &bar(false, number, 0, 200),
                );
            }
        }
        let made = place.import(&["p"]).unwrap();
        assert!(
            made.own_split && !made.inverted && made.notes[0].contains("left out"),
            "{made:?}"
        );
        assert_eq!((made.classes[0].train, made.classes[0].test), (3, 3));
        std::fs::remove_dir_all(place.at("p/Testing")).unwrap();
        std::fs::remove_dir_all(place.at("out")).unwrap();
        let made = place.import(&["p"]).unwrap();
        assert!(
            made.own_split && made.notes[0].contains("are the test images"),
            "{made:?}"
        );
        std::fs::remove_dir_all(place.at("p/val")).unwrap();
        std::fs::remove_dir_all(place.at("out")).unwrap();
        let made = place.import(&["p"]).unwrap();
        assert!(!made.own_split, "{made:?}");
        assert_eq!(made.classes.len(), 2);
        // A class of its own.
        place.put("q/train/1.png", &bar(true, 1, 0, 200));
        place.put("q/train/2.png", &bar(true, 2, 0, 200));
        place.put("q/car/1.png", &bar(false, 1, 0, 200));
        place.put("q/car/2.png", &bar(false, 2, 0, 200));
        let made = place.import_with(&["q"], &place.options("q")).unwrap();
        assert_eq!(made.classes[1].name.as_deref(), Some("train"));
    }

    #[test]
    fn folders_given_one_by_one_are_classes() {
        let place = Place::with_bars(2);
        let made = place.import(&["pictures/up", "pictures/across"]).unwrap();
        let names: Vec<Option<&str>> = made
            .classes
            .iter()
            .map(|class| class.name.as_deref())
            .collect();
        assert_eq!(names, [Some("across"), Some("up")]);
    }

    #[test]
    fn arrays_tables_and_idx_files_of_the_same_images_become_the_same_dataset() {
        let place = Place::new();
        let (pixels, labels) = numbers(10);
        let (test, of_test) = numbers(4);
        let [x, xt] =
            [(&pixels, 10), (&test, 4)].map(|(pixels, count)| npy("|u1", &[count, 4, 4], pixels));
        let wide = |labels: &[u8]| -> Vec<u8> {
            labels
                .iter()
                .flat_map(|l| i64::from(*l).to_le_bytes())
                .collect()
        };
        let [y, yt] =
            [(&labels, 10), (&of_test, 4)].map(|(l, count)| npy("<i8", &[count], &wide(l)));
        let keras = [
            ("x_test", xt.clone()),
            ("x_train", x.clone()),
            ("y_test", yt.clone()),
            ("y_train", y.clone()),
        ];
        place.put("keras.npz", &npz(&keras));
        keras
            .iter()
            .for_each(|(name, array)| place.put(&format!("npy/{name}.npy"), array));
        let table = |pixels: &[u8], labels: &[u8]| -> String {
            let rows = pixels.chunks(16).zip(labels);
            rows.map(|(row, label)| {
                format!(
                    "{label},{}\n",
                    row.iter().map(u8::to_string).collect::<Vec<_>>().join(",")
                )
            })
            .collect()
        };
        place.put("csv/my_train.csv", table(&pixels, &labels).as_bytes());
        place.put("csv/my_test.csv", table(&test, &of_test).as_bytes());
        let idx = |sizes: &[u32], content: &[u8]| [idx::header(sizes), content.to_vec()].concat();
        place.put("idx/train-pixels", &idx(&[10, 4, 4], &pixels));
        place.put("idx/train-answers", &idx(&[10], &labels));
        place.put("idx/t10k-pixels", &idx(&[4, 4, 4], &test));
        place.put("idx/t10k-answers", &idx(&[4], &of_test));
        let real = |pixels: &[u8]| -> Vec<u8> {
            let share = |pixel: &u8| (f64::from(*pixel) / 255.0).to_le_bytes();
            pixels.iter().flat_map(share).collect()
        };
        let names =
            |labels: &[u8]| -> Vec<u8> { labels.iter().map(|label| b'0' + label).collect() };
        place.put(
            "f.npz",
            &npz(&[
                ("train_images", npy("<f8", &[10, 16], &real(&pixels))),
                ("train_labels", npy("|S1", &[10, 1], &names(&labels))),
                ("test_images", npy("<f8", &[4, 4, 4, 1], &real(&test))),
                ("test_labels", yt),
            ]),
        );
        let mut all = Vec::new();
        for source in ["keras.npz", "npy", "csv", "idx", "f.npz"] {
            let made = place
                .import_with(&[source], &place.options(source))
                .unwrap();
            assert!(made.own_split && made.fit == Fitted::Kept, "{source}");
            let files = [
                "train-images-idx3-ubyte",
                "train-labels-idx1-ubyte",
                "t10k-images-idx3-ubyte",
            ];
            all.push(files.map(|file| place.bytes(&format!("out/{source}/{file}"))));
        }
        assert_eq!(all[0][0][16..], pixels);
        assert!(all.iter().all(|other| *other == all[0]));
    }

    #[test]
    fn files_of_emnist_are_turned_and_said_to_be_and_others_if_asked() {
        let place = Place::new();
        let (pixels, labels) = numbers(10);
        let idx = |sizes: &[u32], content: &[u8]| [idx::header(sizes), content.to_vec()].concat();
        for folder in ["emnist", "plain"] {
            place.put(&format!("{folder}/a"), &idx(&[10, 4, 4], &pixels));
            place.put(&format!("{folder}/b"), &idx(&[10], &labels));
        }
        let first = |name: &str| {
            place.bytes(&format!("out/{name}/train-images-idx3-ubyte"))[16..32].to_vec()
        };
        let made = place.import_with(&["emnist"], &place.options("a")).unwrap();
        assert!(made.transposed && made.emnist);
        assert!(
            !place
                .import_with(&["plain"], &place.options("b"))
                .unwrap()
                .transposed
        );
        let turned = ImportOptions {
            transpose: Some(true),
            ..place.options("c")
        };
        let made = place.import_with(&["plain"], &turned).unwrap();
        assert!(made.transposed && !made.emnist);
        let stored = ImportOptions {
            transpose: Some(false),
            ..place.options("emnist-d")
        };
        assert!(!place.import_with(&["emnist"], &stored).unwrap().transposed);
        assert_eq!(first("a"), first("c"));
        assert_eq!(first("b"), first("emnist-d"));
        assert_eq!(first("a")[1], first("b")[4]);
        // It is read as it is, whatever its name.
        let data = Dataset::load(
            "emnist-d",
            &places(Some(&place.at("out/emnist-d")), None, None),
            &Split::ALL,
        );
        assert!(!data.unwrap().is_transposed());
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_back_are_not_followed() {
        use std::os::unix::fs::symlink;
        let place = Place::with_bars(3);
        let plain = place.import_with(&["pictures"], &place.options("plain"));
        let plain = plain.unwrap();
        symlink("../up", place.at("pictures/up/again")).unwrap();
        symlink("../..", place.at("pictures/up/above")).unwrap();
        symlink(".", place.at("pictures/here")).unwrap();
        symlink("../across", place.at("pictures/up/other")).unwrap();
        symlink("../up", place.at("pictures/across/other")).unwrap();
        let linked = place.import_with(&["pictures"], &place.options("linked"));
        let count = |imported: &Imported| -> Vec<usize> {
            let classes = imported.classes.iter();
            classes.map(|class| class.train + class.test).collect()
        };
        // Each class has the pictures of the other one, once.
        let both: usize = count(&plain).iter().sum();
        assert_eq!(count(&linked.unwrap()), [both, both]);
    }

    #[test]
    fn sources_without_a_dataset_are_refused_and_nothing_is_left() {
        let place = Place::with_bars(3);
        let (pixels, labels) = numbers(4);
        place.refused(&["none"], "none: cannot be read");
        place.refused(&["pictures/up"], "no subfolder for each class");
        // The row of a class itself is named, not that of another.
        place.put(
            "flat.csv",
            b"1,0,9,300,0\n2,0,0,0,0\n1,0,9,200,0\n1,0,9,200,7\n",
        );
        place.refused(&["flat.csv"], "the class 2 can be read; flat.csv:2");
        place.put("bad.csv", b"1,0,9,300,0\n2,0,0,0,0\n");
        place.refused(
            &["bad.csv"],
            "1 other is left out, such as bad.csv:1 has \"300\"",
        );
        place.put("empty/readme", b"x");
        place.refused(&["empty"], "expected a folder with one subfolder");
        place.refused(
            &["empty/readme"],
            "expected a label and the pixels of a square",
        );
        place.put("one/a/1.png", &bar(true, 1, 0, 9));
        place.refused(&["one"], "of one class, a: expected two");
        place.put("broken/a/1.png", b"x");
        place.put("broken/b/1.png", b"");
        place.refused(&["broken"], "no image can be read: a/1.png is no picture");
        place.put("half/a/1.png", &bar(true, 1, 0, 9));
        place.put("half/b/1.png", b"");
        place.refused(
            &["half"],
            "no image of the class b can be read; b/1.png is empty",
        );
        place.put("few/a/1.png", &bar(true, 1, 0, 9));
        place.put("few/b/1.png", &bar(false, 1, 0, 9));
        place.refused(&["few"], "only one image of the class a");
        std::fs::create_dir_all(place.at("hollow/b")).unwrap();
        place.put("hollow/a/1.png", &bar(true, 1, 0, 9));
        place.refused(&["hollow"], "b: has no picture");
        for name in [
            "same/a/1.png",
            "same/a/2.png",
            "same/b/1.png",
            "same/b/2.png",
        ] {
            place.put(name, &bar(true, 1, 0, 9));
        }
        place.refused(&["same"], "are the same");
        for (name, is_test) in [
            ("t/train/a/1", false),
            ("t/train/b/2", true),
            ("t/test/a/3", false),
        ] {
            place.put(&format!("{name}.png"), &bar(is_test, 3, 0, 9));
        }
        place.refused(&["t"], "no test image of the class b");
        place.put("both/a.csv", b"1,2,3,4,5");
        place.put("both/b.npz", b"");
        place.refused(&["both"], "several kinds: .npz, CSV");
        place.put("b.npz", b"PK\x03\x04");
        place.refused(&["b.npz"], "no whole .npz");
        place.put(
            "count.npz",
            &npz(&[
                ("x", npy("|u1", &[4, 4, 4], &pixels)),
                ("y", npy("|u1", &[3], &labels[..3])),
            ]),
        );
        place.refused(&["count.npz"], "has 3 labels, expected 4");
        place.put(
            "three.npz",
            &npz(&[
                ("a", npy("|u1", &[4, 4, 4], &pixels)),
                ("b", npy("|u1", &[4, 4, 4], &pixels)),
            ]),
        );
        place.refused(&["three.npz"], "found three.npz:a (4 × 4 × 4)");
        place.put(
            "range.npz",
            &npz(&[
                ("x", npy("|i1", &[4, 4, 4], &pixels)),
                ("y", npy("|u1", &[4], &labels)),
            ]),
        );
        place.refused(&["range.npz"], "found -1 to 15");
        place.put(
            "shape.npz",
            &npz(&[
                ("x", npy("|u1", &[4, 8], &pixels[..32])),
                ("y", npy("|u1", &[4], &labels)),
            ]),
        );
        place.refused(&["shape.npz"], "squares");
        let other = npy("|u1", &[2, 5, 5], &[&pixels[..25], &pixels[9..34]].concat());
        let sizes = [
            ("x_train", npy("|u1", &[4, 4, 4], &pixels)),
            ("y_train", npy("|u1", &[4], &labels)),
            ("x_test", other),
            ("y_test", npy("|u1", &[2], &labels[..2])),
        ];
        place.put("sizes.npz", &npz(&sizes));
        place.refused(
            &["sizes.npz"],
            "training images have 4 × 4 pixels, test images 5 × 5",
        );
        let share = npy("<f8", &[2, 4, 4], &[0; 256]);
        let mixed = [
            ("x_train", npy("|u1", &[4, 4, 4], &pixels)),
            ("y_train", npy("|u1", &[4], &labels)),
            ("x_test", share),
            ("y_test", npy("|u1", &[2], &labels[..2])),
        ];
        place.put("mixed.npz", &npz(&mixed));
        place.refused(&["mixed.npz"], "expected one scale");
        let whole = ImportOptions {
            fit: Fit::Whole,
            ..place.options("whole")
        };
        assert_eq!(
            place.import_with(&["sizes.npz"], &whole).unwrap().size,
            [28, 28]
        );
        let keep = ImportOptions {
            fit: Fit::Keep,
            ..place.options("keep")
        };
        let error = place.import_with(&["sizes.npz"], &keep).unwrap_err();
        assert!(
            error.to_string().contains("only if all have one size"),
            "{error}"
        );
    }

    #[test]
    fn options_out_of_range_and_folders_that_are_taken_are_refused() {
        let place = Place::with_bars(2);
        let with = |change: fn(&mut ImportOptions)| {
            let mut options = place.options("own");
            change(&mut options);
            place.import_with(&["pictures"], &options)
        };
        for change in [
            |options: &mut ImportOptions| options.name = "mnist".into(),
            |options: &mut ImportOptions| options.name = "builtin".into(),
            |options: &mut ImportOptions| options.name = "../x".into(),
            |options: &mut ImportOptions| options.test = 0.0,
            |options: &mut ImportOptions| options.test = f64::NAN,
            |options: &mut ImportOptions| options.size = 3,
        ] {
            assert_eq!(with(change).unwrap_err().kind, ErrorKind::Usage);
        }
        with(|_| ()).unwrap();
        assert_eq!(with(|_| ()).unwrap_err().kind, ErrorKind::Occupied);
        with(|options| options.force = true).unwrap();
        // Sources and other files are never replaced.
        place.put("pictures/up/dataset.json", b"{}");
        for (source, folder, kind) in [
            ("out/own", "out/own", ErrorKind::Usage),
            ("pictures", "pictures", ErrorKind::Occupied),
            ("pictures", "pictures/up", ErrorKind::Occupied),
        ] {
            let onto = ImportOptions {
                to: Some(place.at(folder)),
                force: true,
                ..place.options("own")
            };
            let error = place.import_with(&[source], &onto).unwrap_err();
            assert_eq!(error.kind, kind, "{folder}");
        }
        assert!(place.at("pictures/up/0.png").exists());
    }

    #[test]
    fn a_stop_leaves_nothing() {
        let place = Place::with_bars(2);
        let stop = AtomicBool::new(true);
        let source = ImportSource::Paths(vec![place.at("pictures")]);
        let stopped = stage(source, &place.options("own"), &Session::new(&stop, &()));
        assert_eq!(
            stopped.err().map(|error| error.kind),
            Some(ErrorKind::Stopped)
        );
        assert!(!place.at("out").exists());
        // A folder that is dropped before it is in its place goes, too.
        let source = ImportSource::Paths(vec![place.at("pictures")]);
        drop(stage(source, &place.options("own"), &Session::default()).unwrap());
        assert!(!place.at("out").exists());
    }

    #[test]
    fn images_in_memory_are_imported_as_files_are() {
        let place = Place::new();
        let (pixels, labels) = numbers(10);
        let array = |name: &str, shape: &[usize], values| Array {
            name: name.into(),
            shape: shape.to_vec(),
            values,
        };
        let names = Values::Texts(
            labels
                .iter()
                .map(|label| format!("class {label}"))
                .collect(),
        );
        let labelled = LabelledArrays {
            images: array("pixels", &[10, 4, 4], Values::Bytes(pixels)),
            labels: array("labels", &[10], names),
            split: None,
        };
        let source = ImportSource::Arrays(vec![labelled]);
        let made = stage(source, &place.options("own"), &Session::default())
            .unwrap()
            .commit()
            .unwrap();
        assert_eq!(made.classes[1].name.as_deref(), Some("class 1"));
        let picture = |number: u8| InMemory {
            pixels: Grid::from_fn(3 + usize::from(number), 5, |row, column| {
                (row == 1 && column > 1) as u8 * 99 + number
            }),
            class: ClassLabel::Number(i64::from(number % 2)),
            split: Some(if number < 3 {
                Split::Train
            } else {
                Split::Test
            }),
        };
        let source = ImportSource::Pictures((0..6).map(picture).collect());
        let made = stage(source, &place.options("other"), &Session::default())
            .unwrap()
            .commit()
            .unwrap();
        assert_eq!(
            (made.own_split, made.classes[0].train, made.classes[1].test),
            (true, 2, 2)
        );
    }

    #[cfg(feature = "parquet")]
    mod of_parquet {
        use super::*;
        use ::parquet::data_type::{ByteArray, ByteArrayType, Int64Type};
        use ::parquet::file::metadata::KeyValue;
        use ::parquet::file::properties::WriterProperties;
        use ::parquet::file::writer::SerializedFileWriter;
        use ::parquet::schema::parser::parse_message_type;
        use std::sync::Arc;

        /// Returns a file as image datasets are published.
        pub(super) fn file(
            pictures: &[Vec<u8>],
            labels: &[i64],
            schema: &str,
            noted: Option<&str>,
        ) -> Vec<u8> {
            let schema = Arc::new(parse_message_type(schema).unwrap());
            let noted =
                noted.map(|text| vec![KeyValue::new("huggingface".to_string(), text.to_string())]);
            let properties = WriterProperties::builder()
                .set_compression(::parquet::basic::Compression::SNAPPY)
                .set_key_value_metadata(noted)
                .build();
            let mut bytes = Vec::new();
            let mut writer =
                SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties)).unwrap();
            let mut group = writer.next_row_group().unwrap();
            while let Some(mut column) = group.next_column().unwrap() {
                let count = pictures.len();
                match column.untyped() {
                    ::parquet::column::writer::ColumnWriter::ByteArrayColumnWriter(typed) => {
                        let values: Vec<ByteArray> =
                            pictures.iter().map(|bytes| bytes.clone().into()).collect();
                        typed
                            .write_batch(&values, Some(&vec![2; count]), None)
                            .unwrap();
                    }
                    _ => {
                        let typed = column.typed::<Int64Type>();
                        typed
                            .write_batch(labels, Some(&vec![1; count]), None)
                            .unwrap();
                    }
                }
                column.close().unwrap();
            }
            group.close().unwrap();
            writer.close().unwrap();
            let _ = std::marker::PhantomData::<ByteArrayType>;
            bytes
        }

        pub(super) const SCHEMA: &str = "message schema {
            optional group image { optional binary bytes; }
            optional int64 label;
        }";
        pub(super) const NOTED: &str = r#"{"info": {"features": {"label": {"names": ["up", "across"], "_type": "ClassLabel"}}}}"#;

        #[test]
        fn files_named_after_splits_are_read_with_the_names_of_their_classes() {
            let place = Place::new();
            let pictures: Vec<Vec<u8>> = (0..6)
                .map(|number| bar(number % 2 == 0, number, 0, 200))
                .collect();
            let labels = [0, 1, 0, 1, 0, -1];
            let test = file(&pictures[..2], &labels[..2], SCHEMA, Some(NOTED));
            place.put("repo/data/test-00000-of-00001.parquet", &test);
            for (number, range) in [(0, 0..3), (1, 3..6)] {
                let train = file(
                    &pictures[range.clone()],
                    &labels[range],
                    SCHEMA,
                    Some(NOTED),
                );
                place.put(
                    &format!("repo/data/train-0000{number}-of-00002.parquet"),
                    &train,
                );
            }
            place.put("repo/README.md", b"x");
            let made = place.import(&["repo"]).unwrap();
            let counts: Vec<(Option<&str>, usize, usize)> = made
                .classes
                .iter()
                .map(|class| (class.name.as_deref(), class.train, class.test))
                .collect();
            assert_eq!(counts, [(Some("up"), 3, 1), (Some("across"), 2, 1)]);
            assert_eq!(made.refused.len(), 1);
            assert!(
                made.refused[0].reason.contains("no label"),
                "{:?}",
                made.refused
            );
            let other = "message schema { optional int64 a; optional int64 b; }";
            place.put("other.parquet", &file(&pictures[..2], &[0, 1], other, None));
            std::fs::remove_dir_all(place.at("out")).unwrap();
            place.refused(&["other.parquet"], "found the columns a, b");
            place.put("cut.parquet", &test[..test.len() - 9]);
            place.refused(&["cut.parquet"], "no whole Parquet file");
        }
    }

    #[test]
    fn no_file_makes_the_import_panic_however_it_is_broken() {
        let place = Place::new();
        let (pixels, labels) = numbers(8);
        let x = npy("|u1", &[8, 4, 4], &pixels);
        let mut files: Vec<(&str, Vec<u8>)> = vec![
            (
                "a.npz",
                npz(&[("x", x.clone()), ("y", npy("|u1", &[8], &labels))]),
            ),
            (
                "a.csv",
                b"label,a,b,c,d\n1,0,1,2,3\n2,9,9,9,8\n1,0,1,2,4\n2,9,9,9,7\n".to_vec(),
            ),
        ];
        #[cfg(feature = "parquet")]
        {
            let pictures: Vec<Vec<u8>> = (0..4)
                .map(|number| bar(number % 2 == 0, number, 0, 200))
                .collect();
            let file = of_parquet::file(
                &pictures,
                &[0, 1, 0, 1],
                of_parquet::SCHEMA,
                Some(of_parquet::NOTED),
            );
            files.push(("a.parquet", file));
        }
        let pictures = made::all();
        assert!(
            pictures
                .iter()
                .all(|picture| pictures::grey(picture).is_ok())
        );
        let mut chance = stream(1, Purpose::Import, 1, 0);
        let mut broken = |good: &[u8]| {
            let mut bytes = good.to_vec();
            for _ in 0..1 + chance.below(3) {
                let at = chance
                    .below(bytes.len().max(1))
                    .min(bytes.len().saturating_sub(1));
                match chance.below(4) {
                    0 => bytes.truncate(at),
                    1 => bytes.insert(at, chance.below(256) as u8),
                    _ if bytes.is_empty() => {}
                    _ => bytes[at] = [0, 255, 128, chance.below(256) as u8][chance.below(4)],
                }
            }
            bytes
        };
        for picture in &pictures {
            (0..picture.len()).for_each(|end| drop(pictures::grey(&picture[..end])));
            (0..400).for_each(|_| drop(pictures::grey(&broken(picture))));
        }
        for (name, good) in &files {
            place.put(name, good);
            let keep = ImportOptions {
                fit: Fit::Keep,
                ..place.options(name)
            };
            place.import_with(&[name], &keep).unwrap();
            for _ in 0..150 {
                place.put(name, &broken(good));
                let found = source::find(&[place.at(name)], "own", &Session::default());
                if let Ok(found) = found {
                    found
                        .items
                        .iter()
                        .for_each(|item| drop(decoded(item, &place.options("x"))));
                }
            }
        }
    }
}
