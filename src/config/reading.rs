//! Reading configs: errors with file, line and key; `key=value` overrides.

use crate::base::error::{Argument, Error};
use crate::base::files::{home_expanded, read_given};
use crate::base::text::one_line;
use crate::config::expected::{Mismatch, mismatch, unknown_part};
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use serde_path_to_error::Segment;
use std::path::Path;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Toml,
    Json,
}

impl Format {
    /// Returns the format of a file name: JSON if it ends in `.json`, else TOML.
    pub(crate) fn of(name: &Path) -> Self {
        let is_json = name
            .extension()
            .is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
        if is_json { Format::Json } else { Format::Toml }
    }
}

/// Reads settings; `name` is the file's, for messages.
pub(crate) fn read<T: Serialize + DeserializeOwned + JsonSchema>(
    text: &str,
    format: Format,
    name: &str,
) -> Result<T, Error> {
    let text = text.trim_start_matches('\u{feff}');
    let (given, settings) = match format {
        Format::Json => (serde_json::from_str(text).ok(), json_object(text)),
        Format::Toml => match toml::from_str::<toml::Table>(text) {
            Ok(root) => {
                let root = toml::Value::Table(root);
                // The same reader as for overrides: each further one would be compiled for every type.
                let settings = serde_path_to_error::deserialize(root.clone());
                let settings = settings.map_err(|error: serde_path_to_error::Error<_>| Refusal {
                    line: line_of(text, &key_of(error.path())),
                    path: Some(error.path().clone()),
                    message: toml::de::Error::message(error.inner()).to_string(),
                });
                (serde_json::to_value(root).ok(), settings)
            }
            Err(error) => {
                let message = half_a_number(text, error.span()).unwrap_or(error.message());
                (
                    None,
                    Err(Refusal::new(line_at(text, error.span()), message)),
                )
            }
        },
    };
    let settings = settings.map_err(|refusal| {
        let of_path = |path| mismatch::<T>(given.as_ref()?, path);
        let mismatch = refusal.path.as_ref().and_then(of_path);
        refusal.in_file(name, mismatch)
    })?;
    match given.and_then(|given| listed(&given, &settings)) {
        None => Ok(settings),
        Some(key) => Err(placed(
            Error::input(no_list(&key)).with_key(&key),
            text,
            format,
            name,
        )),
    }
}

struct Refusal {
    line: Option<usize>,
    /// The path within the file's content, if it has any.
    path: Option<serde_path_to_error::Path>,
    message: String,
}

impl Refusal {
    fn new(line: Option<usize>, message: &str) -> Self {
        Refusal {
            line,
            path: None,
            message: message.to_string(),
        }
    }

    /// Converts to an error; a mismatch explains more than the reader's message.
    fn in_file(self, name: &str, mismatch: Option<Mismatch>) -> Error {
        let Refusal {
            line,
            path,
            message,
        } = self;
        let line = line.map_or(String::new(), |line| format!(":{line}"));
        let key = path.as_ref().map_or(String::new(), key_of);
        let text = match mismatch {
            Some(mismatch) => mismatch.at(&key),
            None if key.is_empty() => message,
            None => format!("{key}: {message}"),
        };
        Error::input(format!("{name}{line}: {}", text.trim_end()))
    }
}

/// Explains a TOML number without a digit before or after its point, such as `.5` and `5.`.
fn half_a_number(text: &str, span: Option<std::ops::Range<usize>>) -> Option<&'static str> {
    let place = span?.start;
    let is_part = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '+' | '-' | '_');
    let begin = text.get(..place)?.trim_end_matches(is_part).len();
    let word = text[begin..]
        .split(|c| !is_part(c))
        .next()?
        .trim_start_matches(['+', '-']);
    let is_number =
        |digits: &str| !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
    let is_half = match word.split_once('.')? {
        ("", digits) | (digits, "") => is_number(digits),
        _ => false,
    };
    is_half.then_some("expected digits before and after the point of a number, as in 0.5")
}

/// Returns the key of a table given as a list, which serde would read as the values of its keys.
fn listed<T: Serialize>(given: &Value, settings: &T) -> Option<String> {
    fn within(given: &Value, read: &Value) -> Option<Vec<String>> {
        let keyed = |(key, found): (String, Option<Vec<String>>)| {
            found.map(|inner| [vec![key], inner].concat())
        };
        match (given, read) {
            (Value::Array(_), Value::Object(_)) => Some(Vec::new()),
            (Value::Array(given), Value::Array(read)) => {
                let pairs = given.iter().zip(read).zip(1..);
                pairs
                    .map(|((given, read), n)| (format!("{n}"), within(given, read)))
                    .find_map(keyed)
            }
            (Value::Object(given), Value::Object(read)) => {
                let pairs = given
                    .iter()
                    .filter_map(|(key, value)| Some((key, value, read.get(key)?)));
                pairs
                    .map(|(key, given, read)| (key.clone(), within(given, read)))
                    .find_map(keyed)
            }
            _ => None,
        }
    }
    let read = serde_json::to_value(settings).ok()?;
    within(given, &read).map(|parts| parts.join("."))
}

fn no_list(key: &str) -> String {
    format!("{key}: expected a table, found a list")
}

/// Reads an object from JSON; `name` is the file's, for messages.
pub(crate) fn read_json<T: DeserializeOwned>(text: &str, name: &str) -> Result<T, Error> {
    json_object(text.trim_start_matches('\u{feff}')).map_err(|refusal| refusal.in_file(name, None))
}

/// Reads a list from JSON; `name` is the file's, for messages.
pub(crate) fn read_json_list<T: DeserializeOwned>(text: &str, name: &str) -> Result<Vec<T>, Error> {
    json(text).map_err(|refusal| refusal.in_file(name, None))
}

fn json_object<T: DeserializeOwned>(text: &str) -> Result<T, Refusal> {
    // Serde would read a list as an object without keys.
    let begin = text.len() - text.trim_start().len();
    if !text[begin..].starts_with('{') {
        return Err(Refusal::new(
            line_at(text, Some(begin..begin)),
            "expected a JSON object, {…}",
        ));
    }
    json(text)
}

fn json<T: DeserializeOwned>(text: &str) -> Result<T, Refusal> {
    let mut reader = serde_json::Deserializer::from_str(text);
    let value = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let line = Some(error.inner().line()).filter(|&line| line > 0);
        let message = error.inner().to_string();
        // serde_json ends its messages with the place, which is already there.
        let message = message
            .split(" at line ")
            .next()
            .expect("a split text has a first piece");
        Refusal {
            line,
            path: Some(error.path().clone()),
            message: message.to_string(),
        }
    })?;
    let tail = reader
        .end()
        .map_err(|error| Refusal::new(Some(error.line()), "text after the end"));
    tail.map(|()| value)
}

/// Reads morphcog's JSON file of a `format`, in a version up to `newest`.
pub(crate) fn read_versioned<T: DeserializeOwned>(
    text: &str,
    name: &str,
    format: &str,
    newest: u32,
) -> Result<T, Error> {
    /// The part common to all versions, to reject a newer or foreign file before its details.
    #[derive(serde::Deserialize)]
    struct Head {
        format: Option<String>,
        format_version: Option<u32>,
    }
    let head: Head = read_json(text, name)?;
    if head.format.as_deref() != Some(format) {
        let file = format.strip_prefix("morphcog-").unwrap_or(format);
        let text = format!("{name}: not morphcog's {file}.json: expected \"format\": \"{format}\"");
        return Err(Error::input(text));
    }
    if head.format_version.is_none_or(|version| version > newest) {
        let text = format!("{name}: format_version: expected at most {newest}");
        return Err(
            Error::input(text).advice("it was written by a newer morphcog; update this one")
        );
    }
    read_json(text, name)
}

/// Reads settings, JSON if the name ends in `.json`, else TOML; missing keys have their defaults.
/// Then applies `overrides` (`key=value`), and checks what types cannot.
pub(crate) fn load<T: Serialize + DeserializeOwned + JsonSchema + Default>(
    path: Option<&Path>,
    overrides: &[String],
    check: impl Fn(&T) -> Result<(), Error>,
) -> Result<T, Error> {
    let Some(path) = path else {
        return changed(T::default(), overrides, check, |error| error);
    };
    let path = &home_expanded(path);
    let text = read_given(path).map_err(|error| Error::reading(path, &error))?;
    let format = Format::of(path);
    let name = path.display().to_string();
    let settings = read(&text, format, &name)?;
    changed(settings, overrides, check, |error| {
        placed(error, &text, format, &name)
    })
}

/// Returns the key at a path, with list items numbered from 1; empty for the whole.
fn key_of(path: &serde_path_to_error::Path) -> String {
    let parts = path.iter().filter_map(|segment| match segment {
        Segment::Map { key } => Some(key.clone()),
        Segment::Seq { index } => Some((index + 1).to_string()),
        Segment::Enum { .. } | Segment::Unknown => None,
    });
    parts.collect::<Vec<_>>().join(".")
}

fn line_at(text: &str, span: Option<std::ops::Range<usize>>) -> Option<usize> {
    Some(text.get(..span?.start)?.matches('\n').count() + 1)
}

/// Adds the place of an error's key, or of its innermost table: the file and, in TOML, the line.
pub(crate) fn placed(error: Error, text: &str, format: Format, name: &str) -> Error {
    let line = error
        .key
        .as_deref()
        .filter(|_| format == Format::Toml)
        .and_then(|key| line_of(text, key));
    let place = line.map_or(name.to_string(), |line| format!("{name}:{line}"));
    error.in_place(&place)
}

/// Returns the line of a key, or of the innermost enclosing table in the text.
fn line_of(text: &str, key: &str) -> Option<usize> {
    let table = toml::de::DeTable::parse(text).ok()?.into_inner();
    let mut parts = key.split('.');
    let mut value = table.get(parts.next()?)?;
    for part in parts {
        let inner = match part.parse::<usize>() {
            Ok(number) => number
                .checked_sub(1)
                .and_then(|place| value.get_ref().get(place)),
            Err(_) => value.get_ref().get(part),
        };
        let Some(inner) = inner else { break };
        value = inner;
    }
    line_at(text, Some(value.span()))
}

/// Applies `overrides` to settings, and checks them. An error about a key blames the last override
/// that sets it; otherwise `in_file` adds the place in the file.
pub(crate) fn changed<T: Serialize + DeserializeOwned + JsonSchema>(
    settings: T,
    overrides: &[String],
    check: impl Fn(&T) -> Result<(), Error>,
    in_file: impl Fn(Error) -> Error,
) -> Result<T, Error> {
    if overrides.is_empty() {
        return check(&settings).map(|()| settings).map_err(in_file);
    }
    let mut root = match toml::Value::try_from(&settings) {
        Ok(root) => root,
        // Only a number from JSON can be too large for TOML; the check names it.
        Err(error) => {
            return Err(in_file(
                check(&settings)
                    .err()
                    .unwrap_or(Error::input(error.to_string())),
            ));
        }
    };
    for assignment in overrides {
        set::<T>(&mut root, assignment).map_err(|text| Error::argument("set", assignment, text))?;
    }
    overridden(root)
        .and_then(|settings| check(&settings).map(|()| settings))
        .map_err(|error| {
            let culprit = |key: &str| overrides.iter().rfind(|assignment| sets(assignment, key));
            let key = error.key.as_deref().filter(|key| !key.is_empty());
            // A missing key can only be one that was unset.
            let unset = || {
                overrides
                    .iter()
                    .rfind(|assignment| assignment.trim_end().ends_with('='))
            };
            match key.map_or_else(unset, culprit) {
                Some(assignment) => {
                    let argument = Some(Argument {
                        name: "set",
                        value: Some(one_line(assignment)),
                    });
                    Error { argument, ..error }
                }
                None => in_file(error),
            }
        })
}

fn overridden<T: Serialize + DeserializeOwned + JsonSchema>(root: toml::Value) -> Result<T, Error> {
    let given = serde_json::to_value(&root).ok();
    let settings: T = serde_path_to_error::deserialize(root).map_err(|error| {
        let mismatch = given
            .as_ref()
            .and_then(|given| mismatch::<T>(given, error.path()));
        let text = mismatch.map_or(error.inner().message().to_string(), |found| {
            format!("expected {}", found.expected)
        });
        Error::usage(text).with_key(&key_of(error.path()))
    })?;
    match given.and_then(|given| listed(&given, &settings)) {
        Some(key) => Err(Error::usage(no_list(&key)).with_key(&key)),
        None => Ok(settings),
    }
}

/// Returns true if an override sets a key: itself, its table, or a key of its table.
pub(crate) fn sets(assignment: &str, key: &str) -> bool {
    let set = assignment
        .split_once('=')
        .map_or(assignment, |(set, _)| set)
        .trim();
    let is_within = |inner: &str, outer: &str| {
        inner
            .strip_prefix(outer)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
    };
    is_within(set, key) || is_within(key, set)
}

/// The maximum number of parts in a key, far above any real key's: nested tables need stack.
const DEEPEST: usize = 16;

/// Changes one key: `map_elites.parents=10`, or `task.groups.2=[1]` for the second item of a list.
/// Without a value, `keep=`, it restores the default. The value is TOML, or else plain text.
fn set<T: JsonSchema>(root: &mut toml::Value, assignment: &str) -> Result<(), String> {
    let parts = assignment
        .split_once('=')
        .map(|(key, text)| (key.trim(), text.trim()));
    let Some((key, text)) = parts.filter(|(key, _)| !key.is_empty()) else {
        return Err("expected key=value, as in map_elites.parents=10".to_string());
    };
    if assignment.contains(['\n', '\r']) {
        return Err("expected one line".to_string());
    }
    if key.split('.').count() > DEEPEST {
        return Err(format!(
            "expected a key of at most {DEEPEST} parts, as in map_elites.parents=10"
        ));
    }
    let value = (!text.is_empty()).then(|| {
        toml::from_str::<toml::Table>(&format!("value = {text}"))
            .ok()
            .and_then(|mut table| table.remove("value"))
            .unwrap_or_else(|| toml::Value::String(text.to_string()))
    });
    let mut before = String::new();
    let mut place = &mut *root;
    let mut parts = key.split('.').peekable();
    while let Some(part) = parts.next() {
        let is_last = parts.peek().is_none();
        let is_of_list = parts.peek().is_some_and(|next| is_number(next));
        place = match place {
            toml::Value::Table(table) => {
                if is_last && value.is_none() {
                    let was_there = table.remove(part).is_some();
                    return if was_there {
                        Ok(())
                    } else {
                        is_known::<T>(key)
                    };
                }
                table.entry(part).or_insert_with(|| match is_of_list {
                    true => toml::Value::Array(Vec::new()),
                    false => toml::Value::Table(toml::Table::new()),
                })
            }
            toml::Value::Array(list) => {
                let count = list.len();
                let index = part
                    .parse::<usize>()
                    .ok()
                    .and_then(|number| number.checked_sub(1));
                let Some(index) = index.filter(|&index| index < count) else {
                    // Perhaps it is no list at all.
                    is_known::<T>(&before)?;
                    return Err(match count {
                        0 => format!("there is no {before} {part}: there is none at all"),
                        _ => format!(
                            "there is no {before} {part}: expected a number from 1 to {count}"
                        ),
                    });
                };
                if is_last && value.is_none() {
                    list.remove(index);
                    return Ok(());
                }
                &mut list[index]
            }
            _ => {
                return Err(format!(
                    "{key} is not a key: there is nothing below {before}"
                ));
            }
        };
        if !before.is_empty() {
            before.push('.');
        }
        before.push_str(part);
    }
    if let Some(value) = value {
        *place = value;
    }
    Ok(())
}

fn is_number(part: &str) -> bool {
    !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit())
}

fn is_known<T: JsonSchema>(key: &str) -> Result<(), String> {
    match unknown_part::<T>(key) {
        None => Ok(()),
        Some((part, keys)) => Err(format!(
            "unknown field `{part}`, expected one of {}",
            keys.join(", ")
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    struct Outer {
        name: String,
        #[serde(default)]
        inner: Inner,
    }

    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields, default)]
    struct Inner {
        count: u8,
        list: Vec<f64>,
        maybe: Option<i64>,
    }

    fn toml_error(text: &str) -> String {
        read::<Outer>(text, Format::Toml, "own.toml")
            .unwrap_err()
            .message
    }

    fn json_error(text: &str) -> String {
        read::<Outer>(text, Format::Json, "own.json")
            .unwrap_err()
            .message
    }

    #[test]
    fn what_is_wrong_in_toml_is_said_with_file_line_and_key() {
        let error = toml_error("name = 'a'\n\n[inner]\ncount = 'x'\n");
        assert_eq!(
            error,
            "own.toml:4: inner.count = \"x\": expected a whole number from 0 to 255"
        );
        let error = toml_error("name = 'a'\n[inner]\nlist = [1.0,\n 2.0,\n 'x']\n");
        assert!(error.starts_with("own.toml:5: inner.list.3 = "), "{error}");
        let error = toml_error("name = 'a'\n[inner]\ncont = 1\n");
        assert!(
            error.starts_with("own.toml:3: ") && error.contains("cont") && error.contains("count"),
            "{error}"
        );
        assert!(
            toml_error("name = 'a'\n[inner]\ncount = 256\n")
                .starts_with("own.toml:3: inner.count = 256: ")
        );
        assert!(toml_error("name = 'a'\nname = = 3\n").starts_with("own.toml:2: "));
        assert!(toml_error("").contains("name"));
    }

    #[test]
    fn a_list_is_no_table() {
        assert_eq!(
            toml_error("name = 'a'\ninner = [3, [1.0]]\n"),
            "own.toml:2: inner: expected a table, found a list"
        );
        assert_eq!(
            json_error("{\"name\": \"a\", \"inner\": []}"),
            "own.json: inner: expected a table, found a list"
        );
        let outer: Outer = read(
            "name = 'a'\ninner.list = [1, 2]\n",
            Format::Toml,
            "own.toml",
        )
        .unwrap();
        assert_eq!(outer.inner.list, [1.0, 2.0]);
        let set = |text: &str| {
            changed(
                outer.clone(),
                &[text.to_string()],
                |_| Ok(()),
                |error| error,
            )
        };
        assert_eq!(
            set("inner=[3]").unwrap_err().to_string(),
            "set inner=[3]: inner: expected a table, found a list"
        );
        assert_eq!(set("inner.list=[3]").unwrap().inner.list, [3.0]);
        // Neither is a number.
        let error = set("inner=3").unwrap_err().message;
        assert!(error.ends_with("expected a table"), "{error}");
    }

    #[test]
    fn what_is_wrong_in_json_is_said_with_file_line_and_key() {
        let error = json_error("{\"name\": \"a\",\n\"inner\": {\n\"count\": -1}}");
        assert_eq!(
            error,
            "own.json:3: inner.count = -1: expected a whole number from 0 to 255"
        );
        assert!(!error.contains("column"), "the place is said once: {error}");
        let error = json_error("{\"name\": \"a\",\n\"inner\": {\"list\": [1, null]}}");
        assert!(error.starts_with("own.json:2: inner.list.2: "), "{error}");
        assert!(json_error("{\"name\": \"a\"}\n}").starts_with("own.json:2: "));
        assert!(json_error("{\"name\": \"a\"").starts_with("own.json:1: "));
        assert!(json_error("{\"nam\": \"a\"}").contains("nam"));
        // Cut off, or no object at all: the messages are not the reader's own.
        assert_eq!(json_error("{"), "own.json:1: EOF while parsing an object");
        assert_eq!(
            json_error("{\"name\": \"a\",}"),
            "own.json:1: trailing comma"
        );
        for text in ["", " [\"a\"]", "7"] {
            assert_eq!(json_error(text), "own.json:1: expected a JSON object, {…}");
        }
        assert_eq!(
            json_error("\n\n7"),
            "own.json:3: expected a JSON object, {…}"
        );
        // As some editors begin their files.
        assert!(read::<Outer>("\u{feff}{\"name\": \"a\"}", Format::Json, "own.json").is_ok());
        assert!(read::<Outer>("\u{feff}name = 'a'", Format::Toml, "own.toml").is_ok());
    }

    #[test]
    fn what_cannot_be_is_said_with_the_line_it_stands_on() {
        let text = "seed = 3\n\n[body]\nwidth = 5\nheight = 0\n\n[[item]]\nkeep = 1\n\n[[item]]\n\nkeep = 0\n[task]\n";
        let place =
            |key: &str| placed(Error::at_key(key, "wrong"), text, Format::Toml, "own.toml").message;
        let line = |key: &str| {
            place(key)
                .split(": ")
                .next()
                .expect("a text has a first part")
                .to_string()
        };
        assert_eq!(place("seed"), "own.toml:1: seed: wrong");
        assert_eq!(line("body.height"), "own.toml:5");
        assert_eq!(line("item.2.keep"), "own.toml:12");
        // The key itself is missing, or the whole table is meant.
        assert_eq!(line("item.2.generations"), "own.toml:10");
        assert_eq!(line("body.depth"), "own.toml:3");
        assert_eq!(line("task"), "own.toml:13");
        assert_eq!(line("physics.gravity"), "own.toml");
        assert_eq!(
            placed(
                Error::at_key("seed", "wrong"),
                "{}",
                Format::Json,
                "own.json"
            )
            .message,
            "own.json: seed: wrong"
        );
    }

    /// Returns what is blamed for an [`Outer`] with a negative number or one not below its first.
    fn blamed(count: u8, list: &[f64], overrides: &[&str]) -> String {
        let inner = Inner {
            count,
            list: list.to_vec(),
            maybe: None,
        };
        let overrides: Vec<String> = overrides.iter().map(|text| text.to_string()).collect();
        let check = |outer: &Outer| {
            let Inner { count, list, maybe } = &outer.inner;
            match (list.first(), maybe) {
                (Some(first), _) if f64::from(*count) >= *first => Err(Error::value(
                    "inner.count",
                    count,
                    &format!("less than {first}"),
                )),
                (_, Some(maybe)) if *maybe < 0 => {
                    Err(Error::value("inner.maybe", maybe, "0 or more"))
                }
                _ => Ok(()),
            }
        };
        let outer = Outer {
            name: "a".to_string(),
            inner,
        };
        let error = changed(outer, &overrides, check, |error| {
            error.in_place("own.toml:7")
        })
        .unwrap_err();
        error
            .to_string()
            .split(": ")
            .next()
            .expect("a text has a first part")
            .to_string()
    }

    #[test]
    fn the_override_is_blamed_that_makes_what_cannot_be() {
        let file = "own.toml:7";
        assert_eq!(blamed(9, &[5.0], &[]), file);
        assert_eq!(
            blamed(9, &[5.0], &["name=b"]),
            file,
            "one that changes nothing of it"
        );
        assert_eq!(
            blamed(3, &[5.0], &["name=b", "inner.count=9", "inner.maybe=1"]),
            "set inner.count=9"
        );
        // The key is one that no override sets.
        assert_eq!(blamed(3, &[5.0], &["inner.list=[2]", "name=b"]), file);
        // Bad only together: blames the one that the message is about, and the later one of a key.
        assert_eq!(
            blamed(3, &[9.0], &["inner.count=5", "inner.list=[4]"]),
            "set inner.count=5"
        );
        assert_eq!(
            blamed(3, &[9.0], &["inner.list=[4]", "inner.count=5"]),
            "set inner.count=5"
        );
        assert_eq!(
            blamed(3, &[9.0], &["inner.count=10", "inner.count=11"]),
            "set inner.count=11"
        );
        assert_eq!(
            blamed(3, &[9.0], &["inner.count=9", "inner.count=9"]),
            "set inner.count=9"
        );
        // Of two bad ones, blames the one that the message is about.
        assert_eq!(
            blamed(3, &[9.0], &["inner.count=9", "inner.maybe=-1"]),
            "set inner.count=9"
        );
        assert_eq!(
            blamed(3, &[9.0], &["inner.maybe=-1", "inner.count=9"]),
            "set inner.count=9"
        );
        // An override that a later one corrects is not bad.
        let mended = ["inner.count=9", "inner.maybe=-1", "inner.count=1"];
        assert_eq!(blamed(3, &[9.0], &mended), "set inner.maybe=-1");
        for wrong in [
            "inner.cont=1",
            "inner.cont=",
            "inner.count=x",
            "inner.list.2=1",
            "inner.list.2=",
        ] {
            let set = |others: &[&'static str]| blamed(3, &[9.0], &[&[wrong], others].concat());
            assert_eq!(set(&[]), format!("set {wrong}"));
            assert_eq!(set(&["name=b"]), format!("set {wrong}"));
        }
    }

    #[test]
    fn nesting_without_end_is_refused_and_no_stack_overflow() {
        let deep = 200_000;
        assert!(json_error(&format!("{{\"name\": {}", "[".repeat(deep))).contains("own.json"));
        assert!(toml_error(&format!("name = {}", "[".repeat(deep))).contains("own.toml"));
        assert!(toml_error(&format!("name = {}", "{a=".repeat(deep))).contains("own.toml"));
        assert!(toml_error(&format!("{}b = 1", "a.".repeat(deep))).contains("own.toml"));
    }

    #[test]
    fn one_key_is_set_and_the_others_stay() {
        let outer = Outer {
            name: "a".to_string(),
            inner: Inner {
                count: 3,
                ..Inner::default()
            },
        };
        let set = |assignment: &str| {
            changed(
                outer.clone(),
                &[assignment.to_string()],
                |_| Ok(()),
                |error| error,
            )
        };
        assert_eq!(set("inner.count=4").unwrap().inner.count, 4);
        assert_eq!(set(" inner.count = 4 ").unwrap().inner.count, 4);
        assert_eq!(set("inner.list=[1.5, 2]").unwrap().inner.list, [1.5, 2.0]);
        assert_eq!(
            set("inner.list=['x']").unwrap_err().kind,
            crate::base::error::ErrorKind::Usage
        );
        // A key that is not there yet, and text with or without quotes.
        assert_eq!(set("inner.maybe=-5").unwrap().inner.maybe, Some(-5));
        assert_eq!(set("name=b c").unwrap().name, "b c");
        assert_eq!(set("name=\"b=c\"").unwrap().name, "b=c");
        assert_eq!(set("name=b").unwrap().inner, outer.inner);
        for wrong in [
            "inner.count",
            "inner.count=x",
            "inner.count=-1",
            "inner.cont=1",
            "name.x=1",
            "=1",
            "",
            "name=",
        ] {
            let error = set(wrong).unwrap_err();
            assert!(
                error.to_string().starts_with(&format!("set {wrong}: ")),
                "{error}"
            );
        }
    }

    #[test]
    fn a_text_that_is_nearly_a_number_is_said_with_the_number_to_write() {
        let outer = Outer {
            name: "a".to_string(),
            inner: Inner::default(),
        };
        let said = |assignment: &str| {
            changed(
                outer.clone(),
                &[assignment.to_string()],
                |_| Ok(()),
                |error| error,
            )
            .unwrap_err()
            .to_string()
        };
        for (assignment, number) in [
            ("inner.list=['.5']", "0.5"),
            ("inner.list.1=-.5", "-0.5"),
            ("inner.list.1=5.", "5.0"),
            ("inner.count=05", "5"),
            ("inner.count=+05.", "5"),
        ] {
            let outer = Outer {
                inner: Inner {
                    list: vec![1.0],
                    ..Inner::default()
                },
                ..outer.clone()
            };
            let error =
                changed(outer, &[assignment.to_string()], |_| Ok(()), |error| error).unwrap_err();
            assert!(
                error.message.ends_with(&format!("; write {number}")),
                "{}",
                error.message
            );
        }
        assert_eq!(
            toml_error("name = 'a'\ninner.list = [.5]"),
            "own.toml:2: expected digits before and after the point of a number, as in 0.5"
        );
        for assignment in ["inner.count=.5", "inner.count=x", "inner.list=['inf.']"] {
            assert!(!said(assignment).contains("write"), "{}", said(assignment));
        }
    }

    #[test]
    fn an_item_of_a_list_is_set_by_its_number_and_a_key_unset_by_no_value() {
        let inner = Inner {
            count: 3,
            list: vec![1.0, 2.0],
            maybe: Some(4),
        };
        let outer = Outer {
            name: "a".to_string(),
            inner,
        };
        let set = |assignment: &str| {
            changed(
                outer.clone(),
                &[assignment.to_string()],
                |_| Ok(()),
                |error| error,
            )
        };
        assert_eq!(set("inner.list.2=7").unwrap().inner.list, [1.0, 7.0]);
        assert_eq!(set("inner.list.1=").unwrap().inner.list, [2.0]);
        assert_eq!(set("inner.maybe=").unwrap().inner.maybe, None);
        assert_eq!(set(" inner.maybe = ").unwrap().inner.maybe, None);
        assert_eq!(set("inner=").unwrap().inner, Inner::default());
        assert!(
            set("name=")
                .unwrap_err()
                .message
                .contains("missing field `name`")
        );
        assert!(
            set("inner.list.3=7")
                .unwrap_err()
                .message
                .contains("from 1 to 2")
        );
        assert!(
            set("inner.list.0=7")
                .unwrap_err()
                .message
                .contains("from 1 to 2")
        );
        // Writers may omit keys at their defaults.
        let bare = Outer {
            name: "a".to_string(),
            inner: Inner::default(),
        };
        let bare = changed(
            bare.clone(),
            &["inner.maybe=".to_string()],
            |_| Ok(()),
            |error| error,
        );
        assert_eq!(bare.unwrap().inner, Inner::default());
    }
}
