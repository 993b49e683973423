//! Reading configs: errors with file, line and key; `key=value` overrides.

use super::Error;
use crate::base::files::read_text;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::Path;

/// How a config is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Toml,
    Json,
}

/// Reads a value; `name` is the file's, for messages.
pub(super) fn read<T: DeserializeOwned>(text: &str, format: Format, name: &str) -> Result<T, Error> {
    match format {
        Format::Toml => {
            let reader = toml::Deserializer::parse(text)
                .map_err(|error| refused(name, line_at(text, error.span()), "", error.message()))?;
            serde_path_to_error::deserialize(reader).map_err(|error| {
                let inner = error.inner();
                refused(name, line_at(text, inner.span()), &error.path().to_string(), inner.message())
            })
        }
        Format::Json => read_json(text, name),
    }
}

/// Reads an object from JSON; `name` is the file's, for messages.
pub(super) fn read_json<T: DeserializeOwned>(text: &str, name: &str) -> Result<T, Error> {
    let text = text.trim_start_matches('\u{feff}');
    // A list would be taken for an object without keys.
    let begin = text.len() - text.trim_start().len();
    if !text[begin..].starts_with('{') {
        return Err(refused(name, line_at(text, Some(begin..begin)), "", "expected a JSON object, {…}"));
    }
    json(text, name)
}

/// Reads a list from JSON; `name` is the file's, for messages.
pub(super) fn read_json_list<T: DeserializeOwned>(text: &str, name: &str) -> Result<Vec<T>, Error> {
    json(text, name)
}

fn json<T: DeserializeOwned>(text: &str, name: &str) -> Result<T, Error> {
    let mut reader = serde_json::Deserializer::from_str(text);
    let value = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let line = Some(error.inner().line()).filter(|&line| line > 0);
        let message = error.inner().to_string();
        // serde_json ends its messages with the place, which is said already.
        let message = message.split(" at line ").next().unwrap_or_default();
        refused(name, line, &error.path().to_string(), message)
    })?;
    let tail = reader.end().map_err(|error| refused(name, Some(error.line()), "", "text after the end"));
    tail.map(|()| value)
}

/// Reads a JSON file of ours of a `format`, not of a version newer than `newest`.
pub(super) fn read_versioned<T: DeserializeOwned>(
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
        let text = format!("{name}: not a {file}.json of morphcog: expected \"format\": \"{format}\"");
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

/// Reads settings, a JSON file if its name ends in `.json`, else TOML; keys that are not in it have their defaults.
/// Then sets `overrides` (`key=value`).
pub(super) fn load<T: Serialize + DeserializeOwned + Default>(
    path: Option<&Path>,
    overrides: &[String],
) -> Result<T, Error> {
    let mut settings = match path {
        None => T::default(),
        Some(path) => {
            let text = read_text(path).map_err(|error| Error::reading(path, &error))?;
            let is_json = path.extension().is_some_and(|ending| ending == "json");
            let format = if is_json { Format::Json } else { Format::Toml };
            read(&text, format, &path.display().to_string())?
        }
    };
    for assignment in overrides {
        settings = set(&settings, assignment)?;
    }
    Ok(settings)
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
    for (kind, words) in words {
        if let Some(start) = message.strip_suffix(&format!("expected {kind}")) {
            return format!("{start}expected {words}");
        }
    }
    message.to_string()
}

fn line_at(text: &str, span: Option<std::ops::Range<usize>>) -> Option<usize> {
    Some(text.get(..span?.start)?.matches('\n').count() + 1)
}

/// Where that stands which a message about a config begins with, as `body.height = 0: …` or `stage 2: keep = 0: …`: the override that
/// set it, or file and, in TOML, line.
pub(super) fn place(text: &str, format: Format, name: &str, overrides: &[String], message: &str) -> String {
    let key = key_of(message);
    // The key itself, the table it is of, or a key of the table that is meant.
    let is_within = |inner: &str, outer: &str| {
        inner.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
    };
    let is_set = |assignment: &&String| {
        let set = assignment.split_once('=').map(|(set, _)| set.trim());
        set.is_some_and(|set| is_within(set, key) || is_within(key, set))
    };
    if let Some(assignment) = overrides.iter().rfind(is_set) {
        return format!("--set {assignment}");
    }
    let line = (format == Format::Toml).then(|| line_of(text, message)).flatten();
    line.map_or(name.to_string(), |line| format!("{name}:{line}"))
}

/// The key that a message begins with.
fn key_of(message: &str) -> &str {
    message.split([' ', ':']).next().unwrap_or_default()
}

/// The line of what a message begins with, or of the innermost table around it that the text has.
fn line_of(text: &str, message: &str) -> Option<usize> {
    let table = toml::de::DeTable::parse(text).ok()?.into_inner();
    let stage = message.strip_prefix("stage ").and_then(|rest| rest.split_once(": "));
    let (mut value, key) = match stage {
        Some((number, rest)) => {
            let place = number.parse::<usize>().ok()?.checked_sub(1)?;
            (table.get("stage")?.get_ref().get(place)?, Some(key_of(rest)))
        }
        None => {
            let (first, rest) = match key_of(message).split_once('.') {
                Some((first, rest)) => (first, Some(rest)),
                None => (key_of(message), None),
            };
            (table.get(first)?, rest)
        }
    };
    for part in key.iter().flat_map(|key| key.split('.')) {
        let Some(inner) = value.get_ref().get(part) else { break };
        value = inner;
    }
    line_at(text, Some(value.span()))
}

/// A copy with one key changed: `map_elites.parents=10`. What follows the sign is read as TOML, and as plain text if
/// it is none.
pub(super) fn set<T: Serialize + DeserializeOwned>(config: &T, assignment: &str) -> Result<T, Error> {
    let refuse = |message: String| Error::usage(format!("--set {assignment}: {message}"));
    let Some((key, text)) = assignment.split_once('=') else {
        return Err(refuse("expected key=value, as in --set map_elites.parents=10".to_string()));
    };
    let (key, text) = (key.trim(), text.trim());
    let value = toml::from_str::<toml::Table>(&format!("value = {text}"))
        .ok()
        .and_then(|mut table| table.remove("value"))
        .unwrap_or_else(|| toml::Value::String(text.to_string()));
    let mut root = toml::Value::try_from(config).map_err(|error| refuse(error.to_string()))?;
    let mut place = &mut root;
    for part in key.split('.') {
        let Some(table) = place.as_table_mut() else {
            return Err(refuse(format!("{key} is not a key: there is nothing below {part}")));
        };
        place = table.entry(part).or_insert_with(|| toml::Value::Table(toml::Table::new()));
    }
    *place = value;
    serde_path_to_error::deserialize(root).map_err(|error| refuse(spoken(error.inner().message())))
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
    fn what_cannot_be_is_said_with_the_override_or_the_line_it_stands_on() {
        let text = "seed = 3\n\n[body]\nwidth = 5\nheight = 0\n\n[[stage]]\nkeep = 1\n\n[[stage]]\n\nkeep = 0\n[task]\n";
        let place = |message: &str, set: &[&str]| {
            let set: Vec<String> = set.iter().map(|set| set.to_string()).collect();
            super::place(text, Format::Toml, "own.toml", &set, message)
        };
        assert_eq!(place("seed = 3: expected another", &[]), "own.toml:1");
        assert_eq!(place("body.height = 0: expected 1", &[]), "own.toml:5");
        assert_eq!(place("stage 2: keep = 0: expected 1", &[]), "own.toml:12");
        // Where the key itself is missing, or the whole table is meant.
        assert_eq!(place("stage 2: expected generations: only", &[]), "own.toml:10");
        assert_eq!(place("body.depth: expected it", &[]), "own.toml:3");
        assert_eq!(place("task: expected groups", &[]), "own.toml:13");
        assert_eq!(place("physics.gravity = 0: expected more", &[]), "own.toml");
        assert_eq!(place("stage 3: keep = 0", &[]), "own.toml");
        // What was set last.
        let set = ["body.height=7", "body.width=5", " body.height = 0"];
        assert_eq!(place("body.height = 0: expected 1", &set), "--set  body.height = 0");
        assert_eq!(
            place("task: expected groups", &["task.groups=[[0], [0]]"]),
            "--set task.groups=[[0], [0]]"
        );
        assert_eq!(place("body.height = 0: expected 1", &["body={height=0}"]), "--set body={height=0}");
        assert_eq!(place("body.height = 0: expected 1", &["body.heights=7"]), "own.toml:5");
        assert_eq!(super::place("{}", Format::Json, "own.json", &[], "seed = 3: expected"), "own.json");
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
        let set = |assignment: &str| set(&outer, assignment);
        assert_eq!(set("inner.count=4").unwrap().inner.count, 4);
        assert_eq!(set(" inner.count = 4 ").unwrap().inner.count, 4);
        assert_eq!(set("inner.list=[1.5, 2]").unwrap().inner.list, [1.5, 2.0]);
        assert_eq!(set("inner.list=['x']").unwrap_err().kind, crate::run::ErrorKind::Usage);
        // A key that is not there yet, and text with or without quotes.
        assert_eq!(set("inner.maybe=-5").unwrap().inner.maybe, Some(-5));
        assert_eq!(set("name=b c").unwrap().name, "b c");
        assert_eq!(set("name=\"b=c\"").unwrap().name, "b=c");
        assert_eq!(set("name=b").unwrap().inner, outer.inner);
        for wrong in
            ["inner.count", "inner.count=x", "inner.count=-1", "inner.cont=1", "name.x=1", "=1", "", "inner="]
        {
            let error = set(wrong).unwrap_err();
            assert!(error.message.starts_with(&format!("--set {wrong}: ")), "{}", error.message);
        }
    }
}
