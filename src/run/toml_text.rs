//! Reading configs: errors with file, line and key; `key=value` overrides.

use super::Error;
use serde::Serialize;
use serde::de::DeserializeOwned;

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

/// Reads a value from JSON; `name` is the file's, for messages.
pub(super) fn read_json<T: DeserializeOwned>(text: &str, name: &str) -> Result<T, Error> {
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

fn refused(name: &str, line: Option<usize>, key: &str, message: &str) -> Error {
    let line = line.map_or(String::new(), |line| format!(":{line}"));
    let key = if key.is_empty() || key == "." { String::new() } else { format!("{key}: ") };
    Error::input(format!("{name}{line}: {key}{}", message.trim_end()))
}

fn line_at(text: &str, span: Option<std::ops::Range<usize>>) -> Option<usize> {
    Some(text.get(..span?.start)?.matches('\n').count() + 1)
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
    serde_path_to_error::deserialize(root).map_err(|error| {
        let message = error.inner().message().trim_end().to_string();
        refuse(message)
    })
}
