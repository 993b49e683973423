//! What the user has: folders of pictures, or files of arrays, tables and encoded pictures.

use crate::base::error::Error;
use crate::base::files::{home_expanded, open_file};
use crate::base::session::Session;
use crate::data::files::names_emnist;
use crate::data::idx;
use crate::data::import::arrays::{self, Array, Values};
use crate::data::import::item::{Found, Item, Label, Part, Picture, Refused, beginning, natural};
use crate::data::import::tables::{self, TableFile};
use crate::data::import::{npy, pictures};
use flate2::read::MultiGzDecoder;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Deepest folder that is looked into: links may lead in a circle.
const DEEPEST: usize = 8;

const EXPECTED: &str = "a folder with one subfolder of pictures for each class, or files as .npz, \
                        .npy, CSV, Parquet or IDX";

/// Kinds of files with many images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Idx,
    Npy,
    Npz,
    Csv,
    Parquet,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Kind::Idx => "IDX",
            Kind::Npy => ".npy",
            Kind::Npz => ".npz",
            Kind::Csv => "CSV",
            Kind::Parquet => "Parquet",
        }
    }
}

#[derive(Clone, Debug)]
struct Entry {
    name: String,
    path: PathBuf,
}

/// The entries of a folder, sorted by name, without hidden ones.
#[derive(Debug)]
struct Listing {
    folders: Vec<Entry>,
    files: Vec<Entry>,
}

/// Searches sources for labelled images of a dataset.
pub(crate) fn find(sources: &[PathBuf], dataset: &str, session: &Session) -> Result<Found, Error> {
    let sources: Vec<PathBuf> = sources.iter().map(|path| home_expanded(path)).collect();
    let search = Search {
        dataset,
        session,
        are_several: sources.len() > 1,
    };
    let (mut folders, mut files) = (Vec::new(), Vec::new());
    for path in &sources {
        let found = std::fs::metadata(path).map_err(|error| Error::reading(path, &error))?;
        match found.is_dir() {
            true => folders.push(path.clone()),
            false => files.push(entry(path)),
        }
    }
    let mut found = Found::default();
    if search.are_several && files.is_empty() && folders.iter().all(|path| is_plain(path)) {
        for path in &folders {
            search.class(&entry(path), None, "", &mut found)?;
        }
        return Ok(found);
    }
    for path in &folders {
        let prefix = match search.are_several {
            true => format!("{}/", entry(path).name),
            false => String::new(),
        };
        found.add(search.folder(path, &prefix, 0)?);
    }
    let mut kinds: Vec<(Kind, Entry)> = Vec::new();
    for file in files {
        kinds.push((search.kind_of(&file, true)?, file));
    }
    kinds.sort_by(|(one, a), (other, b)| one.cmp(other).then_with(|| natural(&a.name, &b.name)));
    let place = kinds
        .first()
        .map(|(_, file)| file.path.display().to_string())
        .unwrap_or_default();
    for of in kinds.chunk_by(|(one, _), (other, _)| one == other) {
        let files: Vec<Entry> = of.iter().map(|(_, file)| file.clone()).collect();
        found.add(search.data(of[0].0, &files, &place)?);
    }
    Ok(found)
}

/// Returns a path with its last name.
fn entry(path: &Path) -> Entry {
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    let name = path
        .file_name()
        .or(whole.file_name())
        .unwrap_or(path.as_os_str());
    Entry {
        name: name.to_string_lossy().into_owned(),
        path: path.to_path_buf(),
    }
}

/// True if a path in a folder is a link to a folder on the way there, so that it leads to itself.
fn leads_back(path: &Path, folder: &Path) -> bool {
    let is_link = path
        .symlink_metadata()
        .is_ok_and(|about| about.is_symlink());
    is_link
        && path.canonicalize().is_ok_and(|target| {
            folder
                .ancestors()
                .filter_map(|on_the_way| on_the_way.canonicalize().ok())
                .any(|real| real.starts_with(&target))
        })
}

/// Lists a folder, without links that lead back.
fn list(folder: &Path) -> Result<Listing, Error> {
    let failed = |error: std::io::Error| Error::reading(folder, &error);
    let mut listing = Listing {
        folders: Vec::new(),
        files: Vec::new(),
    };
    for found in std::fs::read_dir(folder).map_err(failed)? {
        let found = found.map_err(failed)?;
        let name = found.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') || name == "__MACOSX" {
            continue;
        }
        let path = found.path();
        match path.is_dir() {
            true if leads_back(&path, folder) => {}
            true => listing.folders.push(Entry { name, path }),
            false => listing.files.push(Entry { name, path }),
        }
    }
    listing.folders.sort_by(|a, b| natural(&a.name, &b.name));
    listing.files.sort_by(|a, b| natural(&a.name, &b.name));
    Ok(listing)
}

/// True if a file is a picture, or claims to be one by its name.
fn is_picture(file: &Entry) -> bool {
    let is_one = || beginning(&file.path).is_ok_and(|bytes| pictures::kind(&bytes).is_some());
    pictures::claims_to_be(&file.name) || is_one()
}

fn has_pictures(folder: &Path, depth: usize) -> bool {
    let Ok(listing) = list(folder) else {
        return false;
    };
    listing.files.iter().any(is_picture)
        || depth < DEEPEST
            && listing
                .folders
                .iter()
                .any(|inner| has_pictures(&inner.path, depth + 1))
}

/// True if pictures lie in a folder itself, and none below.
fn is_plain(folder: &Path) -> bool {
    list(folder).is_ok_and(|listing| {
        listing.files.iter().any(is_picture)
            && !listing
                .folders
                .iter()
                .any(|inner| has_pictures(&inner.path, 1))
    })
}

/// Returns the split that a folder is of: its whole name says so.
fn split_of(folder: &str) -> Option<Part> {
    match folder.to_lowercase().as_str() {
        "train" | "training" => Some(Part::Train),
        "test" | "testing" => Some(Part::Test),
        "val" | "valid" | "validation" => Some(Part::Validation),
        _ => None,
    }
}

struct Search<'a> {
    dataset: &'a str,
    session: &'a Session<'a>,
    are_several: bool,
}

impl Search<'_> {
    fn folder(&self, path: &Path, prefix: &str, depth: usize) -> Result<Found, Error> {
        self.session.check()?;
        let place = path.display().to_string();
        let listing = list(path)?;
        let mut kinds: Vec<(Kind, Entry)> = Vec::new();
        let mut has_loose = false;
        for file in &listing.files {
            match self.kind(file, false) {
                Some(kind) => kinds.push((kind, file.clone())),
                None => has_loose |= is_picture(file),
            }
        }
        let with_pictures: Vec<&Entry> = listing
            .folders
            .iter()
            .filter(|inner| has_pictures(&inner.path, 1))
            .collect();
        let is_one = listing.folders.len() == 1 && kinds.is_empty() && !has_loose;
        if let [only] = listing.folders.as_slice()
            && is_one
            && depth < DEEPEST
            && (with_pictures.is_empty() || !is_plain(&only.path))
        {
            return self.folder(&only.path, &format!("{prefix}{}/", only.name), depth + 1);
        }
        if !with_pictures.is_empty() {
            let mut found = Found::default();
            for file in &listing.files {
                match is_picture(file) {
                    true => found.refused.push(Refused::new(
                        format!("{prefix}{}", file.name),
                        "lies in no class's folder",
                    )),
                    false => found.passed_over += 1,
                }
            }
            let is_split = |inner: &&&Entry| split_of(&inner.name).is_some();
            let splits = with_pictures.iter().filter(is_split).count();
            let has_train = with_pictures
                .iter()
                .any(|inner| split_of(&inner.name) == Some(Part::Train));
            // Without classes in it, a folder called train holds pictures of trains.
            let has_classes = with_pictures
                .iter()
                .filter(is_split)
                .all(|inner| !is_plain(&inner.path));
            if has_train && has_classes && splits == with_pictures.len() {
                for inner in with_pictures {
                    let prefix = format!("{prefix}{}/", inner.name);
                    self.classes(&inner.path, split_of(&inner.name), &prefix, &mut found)?;
                }
            } else {
                for class in &listing.folders {
                    self.class(class, None, prefix, &mut found)?;
                }
            }
            return Ok(found);
        }
        let mut of: Vec<Kind> = kinds.iter().map(|(kind, _)| *kind).collect();
        of.sort_unstable();
        of.dedup();
        match of[..] {
            [kind] => {
                let named = |file: &Entry| Entry {
                    name: format!("{prefix}{}", file.name),
                    path: file.path.clone(),
                };
                let files: Vec<Entry> = kinds.iter().map(|(_, file)| named(file)).collect();
                self.data(kind, &files, &place)
            }
            [] if has_loose => Err(Error::input(format!(
                "{place}: has pictures, but no subfolder for each class, by which their classes are known"
            ))
            .advice("move the pictures of each class into a subfolder with its name")),
            [] => Err(Error::input(format!("{place}: expected {EXPECTED}; found nothing of these"))),
            _ => {
                let names: Vec<&str> = of.iter().map(|kind| kind.name()).collect();
                Err(Error::input(format!(
                    "{place}: has files of several kinds: {}",
                    names.join(", ")
                ))
                .advice("name those that are meant"))
            }
        }
    }

    /// Adds the classes of a split's folder.
    fn classes(
        &self,
        path: &Path,
        part: Option<Part>,
        prefix: &str,
        found: &mut Found,
    ) -> Result<(), Error> {
        let listing = list(path)?;
        for file in &listing.files {
            match is_picture(file) {
                true => found.refused.push(Refused::new(
                    format!("{prefix}{}", file.name),
                    "lies in no class's folder",
                )),
                false => found.passed_over += 1,
            }
        }
        for class in &listing.folders {
            self.class(class, part, prefix, found)?;
        }
        Ok(())
    }

    /// Adds the pictures of a class's folder.
    fn class(
        &self,
        class: &Entry,
        part: Option<Part>,
        prefix: &str,
        found: &mut Found,
    ) -> Result<(), Error> {
        let before = found.items.len();
        let label = Label::Name(class.name.clone());
        self.pictures(
            &class.path,
            &label,
            part,
            &format!("{prefix}{}/", class.name),
            0,
            found,
        )?;
        match found.items.len() == before {
            true => Err(Error::input(format!(
                "{}: has no picture: expected those of a class",
                class.path.display()
            ))
            .advice("put some into it, or remove the folder")),
            false => Ok(()),
        }
    }

    fn pictures(
        &self,
        folder: &Path,
        label: &Label,
        part: Option<Part>,
        prefix: &str,
        depth: usize,
        found: &mut Found,
    ) -> Result<(), Error> {
        self.session.check()?;
        let listing = list(folder)?;
        for file in listing.files {
            if !is_picture(&file) {
                found.passed_over += 1;
                continue;
            }
            found.items.push(Item {
                picture: Picture::File(file.path),
                label: label.clone(),
                part,
                source: format!("{prefix}{}", file.name),
                is_emnist: false,
            });
        }
        for inner in listing.folders.iter().filter(|_| depth < DEEPEST) {
            let prefix = format!("{prefix}{}/", inner.name);
            self.pictures(&inner.path, label, part, &prefix, depth + 1, found)?;
        }
        Ok(())
    }

    /// Returns the kind of a file with many images; a file that the user names may be any text.
    fn kind(&self, file: &Entry, is_named: bool) -> Option<Kind> {
        let bytes = beginning(&file.path).ok()?;
        let lower = file.name.to_lowercase();
        let plain = lower.strip_suffix(".gz").unwrap_or(&lower);
        let is_table = [".csv", ".tsv"]
            .iter()
            .any(|ending| plain.ends_with(ending));
        let is_idx = |bytes: &[u8]| matches!(bytes, [0, 0, 8..=14, 1..=4, ..]);
        match &bytes[..] {
            [b'P', b'A', b'R', b'1', ..] => Some(Kind::Parquet),
            [b'P', b'K', 3, 4, ..] => (is_named || lower.ends_with(".npz")).then_some(Kind::Npz),
            bytes if bytes.starts_with(npy::MAGIC) => Some(Kind::Npy),
            bytes if is_idx(bytes) => Some(Kind::Idx),
            [0x1f, 0x8b, ..] => {
                let mut inner = Vec::new();
                let unpacked = MultiGzDecoder::new(open_file(&file.path).ok()?);
                let is_read = unpacked.take(4).read_to_end(&mut inner).is_ok();
                match is_idx(&inner) || is_read && inner.is_empty() || plain.contains("ubyte") {
                    true => Some(Kind::Idx),
                    false => (is_table || is_named).then_some(Kind::Csv),
                }
            }
            // What is broken is refused by its reader.
            _ if lower.ends_with(".parquet") => Some(Kind::Parquet),
            _ if lower.ends_with(".npz") => Some(Kind::Npz),
            _ if lower.ends_with(".npy") => Some(Kind::Npy),
            _ if lower.ends_with("-ubyte") => Some(Kind::Idx),
            bytes => (is_table || is_named && !bytes.contains(&0)).then_some(Kind::Csv),
        }
    }

    fn kind_of(&self, file: &Entry, is_named: bool) -> Result<Kind, Error> {
        let place = file.path.display();
        let bytes = beginning(&file.path).map_err(|error| Error::reading(&file.path, &error))?;
        if pictures::kind(&bytes).is_some() || pictures::other_kind(&bytes).is_some() {
            return Err(Error::input(format!(
                "{place}: is one picture: expected {EXPECTED}"
            )));
        }
        self.kind(file, is_named).ok_or_else(|| {
            Error::input(format!(
                "{place}: is none of what is read: expected {EXPECTED}"
            ))
        })
    }

    /// Reads files of one kind that belong together.
    fn data(&self, kind: Kind, files: &[Entry], place: &str) -> Result<Found, Error> {
        self.session.check()?;
        match kind {
            Kind::Idx => {
                let arrays: Result<Vec<Array>, Error> = files.iter().map(idx_array).collect();
                let is_emnist = files.iter().any(|file| self.is_emnist(file));
                arrays::items(&arrays::pairs(place, arrays?, is_emnist)?)
            }
            Kind::Npy => {
                let arrays: Result<Vec<Array>, Error> = files
                    .iter()
                    .map(|file| npy::read_npy(&file.path, &file.name))
                    .collect();
                arrays::items(&arrays::pairs(place, arrays?, false)?)
            }
            Kind::Npz => {
                let mut pairs = Vec::new();
                for file in files {
                    self.session.check()?;
                    let arrays = npy::read_npz(&file.path, &file.name)?;
                    let own = arrays::pairs(&file.path.display().to_string(), arrays, false)?;
                    pairs.extend(own.into_iter().map(|pair| arrays::Pair {
                        part: pair.part.or(Part::named(&file.name)),
                        ..pair
                    }));
                }
                arrays::items(&pairs)
            }
            Kind::Csv => {
                let table = |file: &Entry| TableFile {
                    path: file.path.clone(),
                    name: file.name.clone(),
                    part: Part::named(&file.name),
                    is_emnist: self.is_emnist(file),
                };
                tables::read(&files.iter().map(table).collect::<Vec<_>>())
            }
            Kind::Parquet => self.parquet(files),
        }
    }

    #[cfg(feature = "parquet")]
    fn parquet(&self, files: &[Entry]) -> Result<Found, Error> {
        let mut found = Found::default();
        for file in files {
            self.session.check()?;
            let part = Part::named(&file.name);
            found.add(crate::data::import::parquet::read(
                &file.path, &file.name, part,
            )?);
        }
        Ok(found)
    }

    #[cfg(not(feature = "parquet"))]
    fn parquet(&self, files: &[Entry]) -> Result<Found, Error> {
        let place = files.first().map(|file| file.path.display().to_string());
        let text = format!(
            "{}: this program was built without Parquet",
            place.unwrap_or_default()
        );
        Err(Error::other(text).advice("build it with the feature parquet"))
    }

    /// True if EMNIST is a word of the names of the dataset, the file or its folder.
    fn is_emnist(&self, file: &Entry) -> bool {
        let path = file
            .path
            .canonicalize()
            .unwrap_or_else(|_| file.path.clone());
        let folder = path.parent().and_then(Path::file_name).unwrap_or_default();
        names_emnist(self.dataset)
            || names_emnist(&file.name)
            || names_emnist(&folder.to_string_lossy())
    }
}

/// Reads images or labels.
fn idx_array(file: &Entry) -> Result<Array, Error> {
    let failed = |error: idx::IdxError| Error::input(error.to_string());
    let labels = idx::read_labels(&file.path);
    let (shape, values) = match labels {
        Ok(labels) => (vec![labels.content.len()], labels.content),
        Err(idx::IdxError::Dimensions { .. }) => {
            let images = idx::read_images(&file.path).map_err(failed)?.content;
            (
                vec![images.count, images.height, images.width],
                images.pixels,
            )
        }
        Err(error) => return Err(failed(error)),
    };
    Ok(Array {
        name: file.name.clone(),
        shape,
        values: Values::Bytes(values),
    })
}
