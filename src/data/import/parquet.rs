//! Parquet files as image datasets are published: a column of encoded pictures, one of labels.

use crate::base::error::Error;
use crate::base::files::open_file;
use crate::data::import::item::{Found, Item, Label, Part, Picture, Refused};
use parquet::basic::{ConvertedType, Type as Physical};
use parquet::file::metadata::{FileMetaData, RowGroupMetaData};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::{Field, Row};
use parquet::schema::types::Type;
use std::cell::Cell;
use std::path::Path;
use std::sync::{Arc, Once};

/// Names of the columns, if there are several that could be meant.
const IMAGES: [&str; 2] = ["image", "img"];
const LABELS: [&str; 4] = ["label", "labels", "fine_label", "class"];

/// Reads the images of a file; `name` is its path below the source.
pub(crate) fn read(path: &Path, name: &str, part: Option<Part>) -> Result<Found, Error> {
    // The library panics at some broken files; none leaves anything behind.
    let read = quietly(|| std::panic::catch_unwind(|| rows(path, name, part)));
    read.unwrap_or_else(|_| {
        let text = format!("{}: is no whole Parquet file", path.display());
        Err(Error::input(text))
    })
}

thread_local! {
    static IS_QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Runs `work` without a report of its panics on this thread.
fn quietly<T>(work: impl FnOnce() -> T) -> T {
    static HOOKED: Once = Once::new();
    HOOKED.call_once(|| {
        let usual = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |about| {
            if !IS_QUIET.get() {
                usual(about);
            }
        }));
    });
    let before = IS_QUIET.replace(true);
    let done = work();
    IS_QUIET.set(before);
    done
}

fn rows(path: &Path, name: &str, part: Option<Part>) -> Result<Found, Error> {
    let place = path.display();
    let failed = |text: String| Error::input(format!("{place}: {text}"));
    let broken = |error: parquet::errors::ParquetError| {
        let text = error.to_string();
        match text.contains("feature") || text.contains("not installed") || text.contains("codec") {
            true => failed(format!("is packed in a way that is not read: {text}"))
                .advice("write it anew with the compression snappy"),
            false => failed(format!("is no whole Parquet file: {text}")),
        }
    };
    let file = open_file(path).map_err(|error| Error::reading(path, &error))?;
    let reader = SerializedFileReader::new(file).map_err(broken)?;
    if !reader.metadata().row_groups().iter().all(is_sound) {
        return Err(failed(
            "is no whole Parquet file: its columns lie outside of it".to_string(),
        ));
    }
    let metadata = reader.metadata().file_metadata();
    let schema = metadata.schema();
    let (image, label) = columns(schema).map_err(failed)?;
    let wanted = schema
        .get_fields()
        .iter()
        .filter(|field| [&image, &label].contains(&&field.name().to_string()));
    let wanted: Vec<Arc<Type>> = wanted.cloned().collect();
    let projection = Type::group_type_builder(schema.name())
        .with_fields(wanted)
        .build()
        .map_err(broken)?;
    let mut found = Found {
        class_names: class_names(metadata, &label),
        ..Found::default()
    };
    for (number, row) in reader
        .get_row_iter(Some(projection))
        .map_err(broken)?
        .enumerate()
    {
        let row = row.map_err(broken)?;
        let source = format!("{name}:{number}");
        match item(row, &image, &label) {
            Ok((bytes, label)) => found.items.push(Item {
                picture: Picture::Encoded(bytes),
                label,
                part,
                source,
                is_emnist: false,
            }),
            Err(reason) => found.refused.push(Refused::new(source, reason)),
        }
    }
    Ok(found)
}

/// True if the places of columns are none before the file's beginning.
fn is_sound(group: &RowGroupMetaData) -> bool {
    group.columns().iter().all(|column| {
        let offsets = [
            Some(column.data_page_offset()),
            column.dictionary_page_offset(),
        ];
        column.compressed_size() >= 0 && offsets.into_iter().flatten().all(|offset| offset >= 0)
    })
}

/// Returns the names of the columns of pictures and of labels.
fn columns(schema: &Type) -> Result<(String, String), String> {
    let fields = schema.get_fields();
    let is_binary =
        |field: &Type| field.is_primitive() && field.get_physical_type() == Physical::BYTE_ARRAY;
    let is_image = |field: &Type| {
        field.is_group()
            && field
                .get_fields()
                .iter()
                .any(|inner| inner.name() == "bytes" && is_binary(inner))
    };
    let is_label = |field: &Type| {
        let is_text = matches!(
            field.get_basic_info().converted_type(),
            ConvertedType::UTF8 | ConvertedType::ENUM
        );
        field.is_primitive()
            && match field.get_physical_type() {
                Physical::INT32 | Physical::INT64 | Physical::BOOLEAN => true,
                Physical::BYTE_ARRAY => is_text,
                _ => false,
            }
    };
    let one = |is_it: &dyn Fn(&Type) -> bool, names: &[&'static str]| {
        let could: Vec<&str> = fields
            .iter()
            .filter(|field| is_it(field))
            .map(|field| field.name())
            .collect();
        let named = names.iter().find(|name| could.contains(name)).copied();
        named.or(match could[..] {
            [one] => Some(one),
            _ => None,
        })
    };
    let listed: Vec<&str> = fields.iter().map(|field| field.name()).collect();
    let missing = |what: &str| format!("expected {what}, found the columns {}", listed.join(", "));
    let image: &str = one(&is_image, &IMAGES)
        .ok_or_else(|| missing("a column image with encoded pictures (a struct with bytes)"))?;
    let label = one(&is_label, &LABELS)
        .ok_or_else(|| missing("a column label with whole numbers or texts"))?;
    Ok((image.to_string(), label.to_string()))
}

/// Returns the names of classes that the publisher has noted.
fn class_names(metadata: &FileMetaData, label: &str) -> Option<Vec<String>> {
    let pairs = metadata.key_value_metadata()?;
    let text = pairs
        .iter()
        .find(|pair| pair.key == "huggingface")?
        .value
        .as_deref()?;
    let noted: serde_json::Value = serde_json::from_str(text).ok()?;
    let names = noted
        .get("info")?
        .get("features")?
        .get(label)?
        .get("names")?;
    serde_json::from_value(names.clone()).ok()
}

fn item(row: Row, image: &str, label: &str) -> Result<(Vec<u8>, Label), String> {
    let (mut bytes, mut class) = (None, None);
    for (name, field) in row.into_columns() {
        match field {
            Field::Group(group) if name == image => {
                bytes = group
                    .into_columns()
                    .into_iter()
                    .find_map(|(name, field)| match field {
                        Field::Bytes(bytes) if name == "bytes" => Some(bytes.data().to_vec()),
                        _ => None,
                    });
            }
            field if name == label => class = class_of(field),
            _ => {}
        }
    }
    match (bytes, class) {
        (None, _) => Err("has no picture in the file".to_string()),
        // Test images of contests have the label −1.
        (_, None | Some(Label::Number(-1))) => Err("has no label".to_string()),
        (Some(bytes), Some(class)) => Ok((bytes, class)),
    }
}

fn class_of(field: Field) -> Option<Label> {
    Some(match field {
        Field::Bool(value) => Label::Number(value.into()),
        Field::Byte(value) => Label::Number(value.into()),
        Field::Short(value) => Label::Number(value.into()),
        Field::Int(value) => Label::Number(value.into()),
        Field::Long(value) => Label::Number(value),
        Field::UByte(value) => Label::Number(value.into()),
        Field::UShort(value) => Label::Number(value.into()),
        Field::UInt(value) => Label::Number(value.into()),
        Field::ULong(value) => Label::Number(value.try_into().ok()?),
        Field::Str(text) if !text.trim().is_empty() => Label::Name(text.trim().to_string()),
        _ => return None,
    })
}
