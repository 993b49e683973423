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
mod store;
mod tables;

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::files::home_expanded;
use crate::base::observer::Work;
use crate::base::session::Session;
use crate::base::table;
use crate::base::text::{counted, one_line};
use crate::data::catalogue::FETCHABLE;
use crate::data::dataset::BUILTIN;
use crate::data::description::Description;
use crate::data::files::{check_name, default_folder};
use crate::data::idx;
use crate::data::import::arrays::{Labelled, Pair};
use crate::data::import::classes::Classes;
use crate::data::import::item::{Found, Grey, Item, Label, Part, Picture};
use crate::data::import::prepare::{Facts, Plan};
use crate::data::import::store::Staging;
use crate::data::info::Split;
pub use item::Refused;
pub use prepare::{Fit, Fitted};
use rayon::prelude::*;
use serde::Serialize;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Names that datasets of users cannot have, since they mean others.
const TAKEN: [&str; 1] = [BUILTIN];

/// The table of the images' sources, in a dataset's folder.
pub(crate) const IMAGES_CSV: &str = "images.csv";

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
        if TAKEN
            .iter()
            .chain(&FETCHABLE)
            .any(|taken| *taken == self.name)
        {
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
    Arrays(Vec<Labelled>),
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
        return Err(Error::input(format!(
            "all images are of one class, {only}: expected two or more"
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

/// Refuses to replace a folder that holds a source, or lies in one.
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

fn paired(arrays: Vec<Labelled>) -> Vec<Pair> {
    let pair = |labelled: Labelled| Pair {
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
        let failed = |reason: String| Refused::new(item.source.clone(), reason);
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
            let first = found.refused.first();
            let why = first.map(|refused| format!("; {} {}", refused.source, refused.reason));
            Err(Error::input(text + &why.unwrap_or_default()))
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
