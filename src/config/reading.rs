//! Reading configs: errors with file, line and key; `key=value` overrides.

use crate::base::error::Error;
use crate::base::files::{home_expanded, read_given};
use crate::base::number;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::Path;

/// How a config is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Toml,
    Json,
}

impl Format {
    /// The format of a file with this name: JSON if it ends in `.json`, else TOML.
    pub(crate) fn of(name: &Path) -> Self {
        let is_json = name.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
        if is_json { Format::Json } else { Format::Toml }
    }
}

/// Reads settings; `name` is the file's, for messages.
pub(crate) fn read<T: Serialize + DeserializeOwned>(
    text: &str,
    format: Format,
    name: &str,
) -> Result<T, Error> {
    let settings = match format {
        Format::Toml => {
            let reader = toml::Deserializer::parse(text)
                .map_err(|error| refused(name, line_at(text, error.span()), "", error.message()))?;
            serde_path_to_error::deserialize(reader).map_err(|error| {
                let inner = error.inner();
                refused(name, line_at(text, inner.span()), &error.path().to_string(), inner.message())
            })?
        }
        Format::Json => read_json(text, name)?,
    };
    let given = match format {
        Format::Toml => toml::from_str::<Value>(text).ok(),
        Format::Json => serde_json::from_str(text.trim_start_matches('\u{feff}')).ok(),
    };
    match given.and_then(|given| listed(&given, &settings)) {
        None => Ok(settings),
        Some(key) => Err(placed(Error::input(no_list(&key)).of(&key), text, format, name)),
    }
}

/// The key of a table that is given as a list: serde takes a list for the values of a table's keys
/// in their order, which nobody means who writes `[[body]]`.
fn listed<T: Serialize>(given: &Value, settings: &T) -> Option<String> {
    fn within(given: &Value, read: &Value) -> Option<Vec<String>> {
        let keyed =
            |(key, found): (String, Option<Vec<String>>)| found.map(|inner| [vec![key], inner].concat());
        match (given, read) {
            (Value::Array(_), Value::Object(_)) => Some(Vec::new()),
            (Value::Array(given), Value::Array(read)) => {
                let pairs = given.iter().zip(read).zip(1..);
                pairs.map(|((given, read), n)| (format!("{n}"), within(given, read))).find_map(keyed)
            }
            (Value::Object(given), Value::Object(read)) => {
                let pairs = given.iter().filter_map(|(key, value)| Some((key, value, read.get(key)?)));
                pairs.map(|(key, given, read)| (key.clone(), within(given, read))).find_map(keyed)
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
    let text = text.trim_start_matches('\u{feff}');
    // A list would be taken for an object without keys.
    let begin = text.len() - text.trim_start().len();
    if !text[begin..].starts_with('{') {
        return Err(refused(name, line_at(text, Some(begin..begin)), "", "expected a JSON object, {…}"));
    }
    json(text, name)
}

/// Reads a list from JSON; `name` is the file's, for messages.
pub(crate) fn read_json_list<T: DeserializeOwned>(text: &str, name: &str) -> Result<Vec<T>, Error> {
    json(text, name)
}

fn json<T: DeserializeOwned>(text: &str, name: &str) -> Result<T, Error> {
    let mut reader = serde_json::Deserializer::from_str(text);
    let value = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let line = Some(error.inner().line()).filter(|&line| line > 0);
        let message = error.inner().to_string();
        // serde_json ends its messages with the place, which is said already.
        let message = message.split(" at line ").next().expect("a split text has a first piece");
        refused(name, line, &error.path().to_string(), message)
    })?;
    let tail = reader.end().map_err(|error| refused(name, Some(error.line()), "", "text after the end"));
    tail.map(|()| value)
}

/// Reads a JSON file of ours of a `format`, not of a version newer than `newest`.
pub(crate) fn read_versioned<T: DeserializeOwned>(
    text: &str,
    name: &str,
    format: &str,
    newest: u32,
) -> Result<T, Error> {
    /// What every version has, to tell a newer or foreign file before its details are refused.
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
            Error::input(text).hint("it was written by a newer morphcog; update this one".to_string())
        );
    }
    read_json(text, name)
}

/// Reads settings, a JSON file if its name ends in `.json`, else TOML; keys that are not in it have
/// their defaults. Then sets `overrides` (`key=value`), and checks what types cannot.
pub(crate) fn load<T: Serialize + DeserializeOwned + Default>(
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
    changed(settings, overrides, check, |error| placed(error, &text, format, &name))
}

fn refused(name: &str, line: Option<usize>, key: &str, message: &str) -> Error {
    let line = line.map_or(String::new(), |line| format!(":{line}"));
    // A key that is not read to its end is a question mark.
    let key = key.trim_end_matches(['?', '.']);
    let key = if key.is_empty() { String::new() } else { format!("{key}: ") };
    Error::input(format!("{name}{line}: {key}{}", spoken(message)))
}

/// A message of serde's with the type that it expected in words.
fn spoken(message: &str) -> String {
    let message = message.trim_end();
    let words = [
        ("u8", "a whole number from 0 to 255"),
        ("u16", "a whole number from 0 to 65535"),
        ("a nonzero u16", "a whole number from 1 to 65535"),
        ("u32", "a whole number from 0 to 4294967295"),
        ("u64", "a whole number from 0"),
        ("usize", "a whole number from 0"),
        ("i64", "a whole number"),
        ("f64", "a number"),
        ("a boolean", "true or false"),
        ("a sequence", "a list"),
    ];
    if let Some((start, _)) = message.split_once("expected struct ") {
        return format!("{start}expected a table");
    }
    // TOML has no numbers such as `.5` and `5.`
    if message.starts_with("invalid mantissa") || message.starts_with("invalid fraction") {
        return "expected digits before and after the point of a number, as in 0.5".to_string();
    }
    for (kind, words) in words {
        if let Some(start) = message.strip_suffix(&format!("expected {kind}")) {
            let meant = match kind {
                "a boolean" | "a sequence" => None,
                kind => meant(start, kind == "f64"),
            };
            let meant = meant.map_or(String::new(), |number| format!("; write {number}"));
            return format!("{start}expected {words}{meant}");
        }
    }
    message.to_string()
}

/// The number that a text stands for that is none in TOML, such as `.5`, `5.` or `05`; `start`
/// begins a message of serde's about it.
fn meant(start: &str, is_decimal: bool) -> Option<String> {
    let text = start.strip_prefix("invalid type: string \"")?.strip_suffix("\", ")?;
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite())?;
    match is_decimal {
        true => Some(format!("{value:?}")),
        false => (value.fract() == 0.0 && value.abs() < 1e15).then(|| number::fixed(value, 0)),
    }
}

fn line_at(text: &str, span: Option<std::ops::Range<usize>>) -> Option<usize> {
    Some(text.get(..span?.start)?.matches('\n').count() + 1)
}

/// An error with where in a file its key stands, or the innermost table around it that the text
/// has: the file and, in TOML, the line.
pub(crate) fn placed(error: Error, text: &str, format: Format, name: &str) -> Error {
    let line = error.key.as_deref().filter(|_| format == Format::Toml).and_then(|key| line_of(text, key));
    let place = line.map_or(name.to_string(), |line| format!("{name}:{line}"));
    error.within(&place)
}

/// The line of a key, or of the innermost table around it that the text has.
fn line_of(text: &str, key: &str) -> Option<usize> {
    let table = toml::de::DeTable::parse(text).ok()?.into_inner();
    let mut parts = key.split('.');
    let mut value = table.get(parts.next()?)?;
    for part in parts {
        let inner = match part.parse::<usize>() {
            Ok(number) => number.checked_sub(1).and_then(|place| value.get_ref().get(place)),
            Err(_) => value.get_ref().get(part),
        };
        let Some(inner) = inner else { break };
        value = inner;
    }
    line_at(text, Some(value.span()))
}

/// Settings with `overrides` set, checked. What is wrong is said of the override that causes it;
/// `in_file` puts the place in the file to an error that would be there without any.
pub(crate) fn changed<T: Serialize + DeserializeOwned>(
    settings: T,
    overrides: &[String],
    check: impl Fn(&T) -> Result<(), Error>,
    in_file: impl Fn(Error) -> Error,
) -> Result<T, Error> {
    if overrides.is_empty() {
        return check(&settings).map(|()| settings).map_err(in_file);
    }
    let root = match toml::Value::try_from(&settings) {
        Ok(root) => root,
        // Only a number from JSON can be too large for TOML; the check says which one it is.
        Err(error) => {
            return Err(in_file(check(&settings).err().unwrap_or(Error::input(error.to_string()))));
        }
    };
    let attempt = |overrides: &[&String]| -> Result<T, Error> {
        let mut root = root.clone();
        for assignment in overrides {
            set::<T>(&mut root, assignment)
                .map_err(|text| Error::usage(format!("--set {assignment}: {text}")).of(SET))?;
        }
        let given = serde_json::to_value(&root).ok();
        let settings: T = serde_path_to_error::deserialize(root)
            .map_err(|error| Error::usage(spoken(error.inner().message())).of(&error.path().to_string()))?;
        if let Some(key) = given.and_then(|given| listed(&given, &settings)) {
            return Err(Error::usage(no_list(&key)).of(&key));
        }
        check(&settings).map(|()| settings)
    };
    let all: Vec<&String> = overrides.iter().collect();
    let error = match attempt(&all) {
        Ok(settings) => return Ok(settings),
        Err(error) if error.key.as_deref() == Some(SET) => return Err(error),
        Err(error) => error,
    };
    // Those without which it would not be; of these the one that sets the key it is about, else the
    // last.
    let is_cause = |place: &usize| {
        let others: Vec<&String> = [&all[..*place], &all[place + 1..]].concat();
        attempt(&others).err().is_none_or(|other| other.message != error.message)
    };
    let causes: Vec<usize> = (0..all.len()).filter(is_cause).collect();
    let named = |place: &&usize| error.key.as_deref().is_some_and(|key| sets(all[**place], key));
    let every: Vec<usize> = (0..all.len()).collect();
    let culprit = causes.iter().rfind(named).or(causes.last()).or_else(|| every.iter().rfind(named));
    Err(match culprit {
        Some(place) => error.within(&format!("--set {}", all[*place])),
        None => in_file(error),
    })
}

/// What stands for the key of an error that names its override already.
const SET: &str = "--set";

/// Whether an override sets a key: itself, the table it is of, or a key of that table.
pub(crate) fn sets(assignment: &str, key: &str) -> bool {
    let set = assignment.split_once('=').map_or(assignment, |(set, _)| set).trim();
    let is_within = |inner: &str, outer: &str| {
        inner.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
    };
    is_within(set, key) || is_within(key, set)
}

/// Most parts of a key: many times what any has; tables in tables need the stack.
const DEEPEST: usize = 16;

/// Changes one key: `map_elites.parents=10`, or `task.groups.2=[1]` for the second of a list;
/// without a value, `keep=`, it has its default again. What follows the sign is read as TOML, and
/// as plain text if it is none.
fn set<T: DeserializeOwned>(root: &mut toml::Value, assignment: &str) -> Result<(), String> {
    let Some((key, text)) = assignment.split_once('=') else {
        return Err("expected key=value, as in --set map_elites.parents=10".to_string());
    };
    let (key, text) = (key.trim(), text.trim());
    if key.split('.').count() > DEEPEST {
        return Err(format!("expected a key of at most {DEEPEST} parts, as in --set map_elites.parents=10"));
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
                    return if was_there { Ok(()) } else { is_known::<T>(root, key) };
                }
                table.entry(part).or_insert_with(|| match is_of_list {
                    true => toml::Value::Array(Vec::new()),
                    false => toml::Value::Table(toml::Table::new()),
                })
            }
            toml::Value::Array(list) => {
                let count = list.len();
                let index = part.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
                let Some(index) = index.filter(|&index| index < count) else {
                    // Not a list at all, perhaps.
                    is_known::<T>(root, &before)?;
                    return Err(match count {
                        0 => format!("there is no {before} {part}: there is none at all"),
                        _ => format!("there is no {before} {part}: expected a number from 1 to {count}"),
                    });
                };
                if is_last && value.is_none() {
                    list.remove(index);
                    return Ok(());
                }
                &mut list[index]
            }
            _ => return Err(format!("{key} is not a key: there is nothing below {before}")),
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

/// Whether settings have a key, which may be at its default and left out: if not, its reader says
/// so.
fn is_known<T: DeserializeOwned>(root: &toml::Value, key: &str) -> Result<(), String> {
    let mut root = root.clone();
    let mut place = &mut root;
    for part in key.split('.') {
        let inner = match place {
            toml::Value::Table(table) => {
                Some(table.entry(part).or_insert_with(|| toml::Value::Table(toml::Table::new())))
            }
            toml::Value::Array(list) => {
                part.parse::<usize>().ok().and_then(|number| list.get_mut(number.checked_sub(1)?))
            }
            _ => None,
        };
        let Some(inner) = inner else { return Ok(()) };
        place = inner;
    }
    match serde_path_to_error::deserialize::<_, T>(root) {
        Err(error) => {
            let message = error.inner().message();
            let is_meant = |part: &str| message.starts_with(&format!("unknown field `{part}`"));
            if key.split('.').any(is_meant) { Err(spoken(message)) } else { Ok(()) }
        }
        Ok(_) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Outer {
        name: String,
        #[serde(default)]
        inner: Inner,
    }

    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    struct Inner {
        count: u8,
        list: Vec<f64>,
        maybe: Option<i64>,
    }

    fn toml_error(text: &str) -> String {
        read::<Outer>(text, Format::Toml, "own.toml").unwrap_err().message
    }

    fn json_error(text: &str) -> String {
        read::<Outer>(text, Format::Json, "own.json").unwrap_err().message
    }

    #[test]
    fn what_is_wrong_in_toml_is_said_with_file_line_and_key() {
        let error = toml_error("name = 'a'\n\n[inner]\ncount = 'x'\n");
        assert!(
            error.starts_with("own.toml:4: inner.count: ")
                && error.ends_with("expected a whole number from 0 to 255"),
            "{error}"
        );
        let error = toml_error("name = 'a'\n[inner]\nlist = [1.0,\n 2.0,\n 'x']\n");
        assert!(error.starts_with("own.toml:5: inner.list[2]: "), "{error}");
        let error = toml_error("name = 'a'\n[inner]\ncont = 1\n");
        assert!(
            error.starts_with("own.toml:3: ") && error.contains("cont") && error.contains("count"),
            "{error}"
        );
        assert!(toml_error("name = 'a'\n[inner]\ncount = 256\n").starts_with("own.toml:3: inner.count: "));
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
        let outer: Outer = read("name = 'a'\ninner.list = [1, 2]\n", Format::Toml, "own.toml").unwrap();
        assert_eq!(outer.inner.list, [1.0, 2.0]);
        let set = |text: &str| changed(outer.clone(), &[text.to_string()], |_| Ok(()), |error| error);
        assert_eq!(
            set("inner=[3]").unwrap_err().message,
            "--set inner=[3]: inner: expected a table, found a list"
        );
        assert_eq!(set("inner.list=[3]").unwrap().inner.list, [3.0]);
        // Nor is a number.
        let error = set("inner=3").unwrap_err().message;
        assert!(error.ends_with("expected a table"), "{error}");
    }

    #[test]
    fn what_is_wrong_in_json_is_said_with_file_line_and_key() {
        let error = json_error("{\"name\": \"a\",\n\"inner\": {\n\"count\": -1}}");
        assert!(
            error.starts_with("own.json:3: inner.count: ")
                && error.ends_with("expected a whole number from 0 to 255"),
            "{error}"
        );
        assert!(!error.contains("column"), "the place is said once: {error}");
        let error = json_error("{\"name\": \"a\",\n\"inner\": {\"list\": [1, null]}}");
        assert!(error.starts_with("own.json:2: inner.list[1]: "), "{error}");
        assert!(json_error("{\"name\": \"a\"}\n}").starts_with("own.json:2: "));
        assert!(json_error("{\"name\": \"a\"").starts_with("own.json:1: "));
        assert!(json_error("{\"nam\": \"a\"}").contains("nam"));
        // Cut off, or no object at all: nothing of the reader's own words.
        assert_eq!(json_error("{"), "own.json:1: EOF while parsing an object");
        assert_eq!(json_error("{\"name\": \"a\",}"), "own.json:1: trailing comma");
        for text in ["", " [\"a\"]", "7"] {
            assert_eq!(json_error(text), "own.json:1: expected a JSON object, {…}");
        }
        assert_eq!(json_error("\n\n7"), "own.json:3: expected a JSON object, {…}");
        // As some editors begin their files.
        assert!(read::<Outer>("\u{feff}{\"name\": \"a\"}", Format::Json, "own.json").is_ok());
        assert!(read::<Outer>("\u{feff}name = 'a'", Format::Toml, "own.toml").is_ok());
    }

    #[test]
    fn what_cannot_be_is_said_with_the_line_it_stands_on() {
        let text = "seed = 3\n\n[body]\nwidth = 5\nheight = 0\n\n[[item]]\nkeep = 1\n\n[[item]]\n\nkeep = 0\n[task]\n";
        let place = |key: &str| placed(Error::at(key, "wrong"), text, Format::Toml, "own.toml").message;
        let line = |key: &str| place(key).split(": ").next().expect("a text has a first part").to_string();
        assert_eq!(place("seed"), "own.toml:1: seed: wrong");
        assert_eq!(line("body.height"), "own.toml:5");
        assert_eq!(line("item.2.keep"), "own.toml:12");
        // Where the key itself is missing, or the whole table is meant.
        assert_eq!(line("item.2.generations"), "own.toml:10");
        assert_eq!(line("body.depth"), "own.toml:3");
        assert_eq!(line("task"), "own.toml:13");
        assert_eq!(line("physics.gravity"), "own.toml");
        assert_eq!(
            placed(Error::at("seed", "wrong"), "{}", Format::Json, "own.json").message,
            "own.json: seed: wrong"
        );
    }

    /// What is said of an [`Outer`] whose number is not below the first of its list, or negative.
    fn blamed(count: u8, list: &[f64], overrides: &[&str]) -> String {
        let inner = Inner { count, list: list.to_vec(), maybe: None };
        let overrides: Vec<String> = overrides.iter().map(|text| text.to_string()).collect();
        let check = |outer: &Outer| {
            let Inner { count, list, maybe } = &outer.inner;
            match (list.first(), maybe) {
                (Some(first), _) if f64::from(*count) >= *first => {
                    Err(Error::value("inner.count", count, &format!("less than {first}")))
                }
                (_, Some(maybe)) if *maybe < 0 => Err(Error::value("inner.maybe", maybe, "0 or more")),
                _ => Ok(()),
            }
        };
        let outer = Outer { name: "a".to_string(), inner };
        let error = changed(outer, &overrides, check, |error| error.within("own.toml:7")).unwrap_err();
        error.message.split(": ").next().expect("a text has a first part").to_string()
    }

    #[test]
    fn the_override_is_blamed_that_makes_what_cannot_be() {
        let file = "own.toml:7";
        assert_eq!(blamed(9, &[5.0], &[]), file);
        assert_eq!(blamed(9, &[5.0], &["name=b"]), file, "one that changes nothing of it");
        assert_eq!(blamed(3, &[5.0], &["name=b", "inner.count=9", "inner.maybe=1"]), "--set inner.count=9");
        // Bad only together with the file, by a key that the message does not begin with.
        assert_eq!(blamed(3, &[5.0], &["inner.list=[2]", "name=b"]), "--set inner.list=[2]");
        assert_eq!(blamed(3, &[5.0], &["name=b", "inner.list.1=2"]), "--set inner.list.1=2");
        // Bad only together: the one that the message is about; and the later one of a key.
        assert_eq!(blamed(3, &[9.0], &["inner.count=5", "inner.list=[4]"]), "--set inner.count=5");
        assert_eq!(blamed(3, &[9.0], &["inner.list=[4]", "inner.count=5"]), "--set inner.count=5");
        assert_eq!(blamed(3, &[9.0], &["inner.count=10", "inner.count=11"]), "--set inner.count=11");
        assert_eq!(blamed(3, &[9.0], &["inner.count=9", "inner.count=9"]), "--set inner.count=9");
        // Of two that are bad, that of which the message is.
        assert_eq!(blamed(3, &[9.0], &["inner.count=9", "inner.maybe=-1"]), "--set inner.count=9");
        assert_eq!(blamed(3, &[9.0], &["inner.maybe=-1", "inner.count=9"]), "--set inner.count=9");
        // One that another one has mended is not bad.
        let mended = ["inner.count=9", "inner.maybe=-1", "inner.count=1"];
        assert_eq!(blamed(3, &[9.0], &mended), "--set inner.maybe=-1");
        for wrong in ["inner.cont=1", "inner.cont=", "inner.count=x", "inner.list.2=1", "inner.list.2="] {
            let set = |others: &[&'static str]| blamed(3, &[9.0], &[&[wrong], others].concat());
            assert_eq!(set(&[]), format!("--set {wrong}"));
            assert_eq!(set(&["name=b"]), format!("--set {wrong}"));
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
        let outer = Outer { name: "a".to_string(), inner: Inner { count: 3, ..Inner::default() } };
        let set =
            |assignment: &str| changed(outer.clone(), &[assignment.to_string()], |_| Ok(()), |error| error);
        assert_eq!(set("inner.count=4").unwrap().inner.count, 4);
        assert_eq!(set(" inner.count = 4 ").unwrap().inner.count, 4);
        assert_eq!(set("inner.list=[1.5, 2]").unwrap().inner.list, [1.5, 2.0]);
        assert_eq!(set("inner.list=['x']").unwrap_err().kind, crate::base::error::ErrorKind::Usage);
        // A key that is not there yet, and text with or without quotes.
        assert_eq!(set("inner.maybe=-5").unwrap().inner.maybe, Some(-5));
        assert_eq!(set("name=b c").unwrap().name, "b c");
        assert_eq!(set("name=\"b=c\"").unwrap().name, "b=c");
        assert_eq!(set("name=b").unwrap().inner, outer.inner);
        for wrong in
            ["inner.count", "inner.count=x", "inner.count=-1", "inner.cont=1", "name.x=1", "=1", "", "name="]
        {
            let error = set(wrong).unwrap_err();
            assert!(error.message.starts_with(&format!("--set {wrong}: ")), "{}", error.message);
        }
    }

    #[test]
    fn a_text_that_is_nearly_a_number_is_said_with_the_number_to_write() {
        let outer = Outer { name: "a".to_string(), inner: Inner::default() };
        let said = |assignment: &str| {
            changed(outer.clone(), &[assignment.to_string()], |_| Ok(()), |error| error).unwrap_err().message
        };
        for (assignment, number) in [
            ("inner.list=['.5']", "0.5"),
            ("inner.list.1=-.5", "-0.5"),
            ("inner.list.1=5.", "5.0"),
            ("inner.count=05", "5"),
            ("inner.count=+05.", "5"),
        ] {
            let outer = Outer { inner: Inner { list: vec![1.0], ..Inner::default() }, ..outer.clone() };
            let error = changed(outer, &[assignment.to_string()], |_| Ok(()), |error| error).unwrap_err();
            assert!(error.message.ends_with(&format!("; write {number}")), "{}", error.message);
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
        let inner = Inner { count: 3, list: vec![1.0, 2.0], maybe: Some(4) };
        let outer = Outer { name: "a".to_string(), inner };
        let set =
            |assignment: &str| changed(outer.clone(), &[assignment.to_string()], |_| Ok(()), |error| error);
        assert_eq!(set("inner.list.2=7").unwrap().inner.list, [1.0, 7.0]);
        assert_eq!(set("inner.list.1=").unwrap().inner.list, [2.0]);
        assert_eq!(set("inner.maybe=").unwrap().inner.maybe, None);
        assert_eq!(set(" inner.maybe = ").unwrap().inner.maybe, None);
        assert_eq!(set("inner=").unwrap().inner, Inner::default());
        assert!(set("name=").unwrap_err().message.contains("missing field `name`"));
        assert!(set("inner.list.3=7").unwrap_err().message.contains("from 1 to 2"));
        assert!(set("inner.list.0=7").unwrap_err().message.contains("from 1 to 2"));
        // What is at its default already may be left out of what is written.
        let bare = Outer { name: "a".to_string(), inner: Inner::default() };
        let bare = changed(bare.clone(), &["inner.maybe=".to_string()], |_| Ok(()), |error| error);
        assert_eq!(bare.unwrap().inner, Inner::default());
    }
}
