//! Describes the values that settings accept, from the JSON Schema of their type. Unlike a reader's
//! errors, a schema does not change its wording.

use crate::base::number;
use crate::base::text::one_line;
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::Value;
use serde_path_to_error::{Path, Segment};

/// A value of the wrong kind for its key.
#[derive(Debug, PartialEq)]
pub(super) struct Mismatch {
    /// The value, on one line; `None` for a list or a table.
    scalar: Option<String>,
    /// The kind of the value: "a list", or the same as `scalar`.
    found: String,
    /// The expected kind, with the number to write if a text is nearly one.
    pub(crate) expected: String,
}

impl Mismatch {
    pub(crate) fn at(&self, key: &str) -> String {
        let Mismatch {
            scalar,
            found,
            expected,
        } = self;
        match scalar {
            Some(scalar) if !key.is_empty() => format!("{key} = {scalar}: expected {expected}"),
            _ if key.is_empty() => format!("expected {expected}, found {found}"),
            _ => format!("{key}: expected {expected}, found {found}"),
        }
    }
}

/// Checks the value at a path of settings; returns `None` if its kind is right, or unknown.
pub(super) fn mismatch<T: JsonSchema>(settings: &Value, path: &Path) -> Option<Mismatch> {
    let schema = Schema::of::<T>();
    let (mut value, mut schemas) = (settings, schema.alternatives(&schema.root));
    for segment in path {
        (value, schemas) = match segment {
            Segment::Map { key } => (value.get(key)?, schema.of_key(&schemas, key)),
            Segment::Seq { index } => (value.get(index)?, schema.of_index(&schemas, *index)),
            Segment::Enum { .. } => (value, schemas),
            Segment::Unknown => return None,
        };
    }
    let kinds: Option<Vec<Vec<Kind>>> = schemas.iter().map(|schema| Kind::all_of(schema)).collect();
    let kinds = kinds
        .map(|kinds| kinds.concat())
        .filter(|kinds| !kinds.is_empty() && !kinds.iter().any(|kind| kind.has(value)))?;
    let mut expected = Vec::new();
    for words in kinds
        .iter()
        .filter(|kind| !matches!(kind, Kind::Null))
        .map(Kind::words)
    {
        if !expected.contains(&words) {
            expected.push(words);
        }
    }
    let meant = kinds.iter().find_map(|kind| kind.meant(value));
    let meant = meant.map_or(String::new(), |number| format!("; write {number}"));
    let (scalar, found) = match value {
        Value::Array(_) => (None, "a list".to_string()),
        Value::Object(_) => (None, "a table".to_string()),
        // Numbers that JSON lacks, such as TOML's inf.
        Value::Null => return None,
        scalar => (
            Some(one_line(&scalar.to_string())),
            one_line(&scalar.to_string()),
        ),
    };
    Some(Mismatch {
        scalar,
        found,
        expected: format!("{}{meant}", expected.join(", or ")),
    })
}

/// Returns the unknown part of a key, if any, with the keys of its table.
pub(super) fn unknown_part<T: JsonSchema>(key: &str) -> Option<(String, Vec<String>)> {
    let schema = Schema::of::<T>();
    let mut schemas = schema.alternatives(&schema.root);
    for part in key.split('.') {
        let inner = match part.parse::<usize>() {
            Ok(number) => schema.of_index(&schemas, number.checked_sub(1)?),
            Err(_) => schema.of_key(&schemas, part),
        };
        if inner.is_empty() {
            let is_closed =
                |schema: &&Value| schema.get("additionalProperties") == Some(&Value::Bool(false));
            let closed: Vec<&Value> = schemas.iter().copied().filter(is_closed).collect();
            let keys = closed
                .iter()
                .filter_map(|schema| schema.get("properties")?.as_object());
            let keys = keys.flat_map(|keys| keys.keys().cloned()).collect();
            return (!closed.is_empty()).then(|| (part.to_string(), keys));
        }
        schemas = inner;
    }
    None
}

struct Schema {
    root: Value,
}

impl Schema {
    fn of<T: JsonSchema>() -> Self {
        let generator = SchemaSettings::draft2020_12().into_generator();
        Schema {
            root: generator.into_root_schema_for::<T>().to_value(),
        }
    }

    fn alternatives<'a>(&'a self, schema: &'a Value) -> Vec<&'a Value> {
        if let Some(name) = schema.get("$ref").and_then(Value::as_str) {
            let of_name = name
                .strip_prefix('#')
                .and_then(|pointer| self.root.pointer(pointer));
            return of_name.map_or(Vec::new(), |schema| self.alternatives(schema));
        }
        let several = ["anyOf", "oneOf"]
            .iter()
            .find_map(|one| schema.get(one)?.as_array());
        match several {
            Some(several) => several
                .iter()
                .flat_map(|schema| self.alternatives(schema))
                .collect(),
            None => vec![schema],
        }
    }

    fn of_key<'a>(&'a self, schemas: &[&'a Value], key: &str) -> Vec<&'a Value> {
        let inner = |schema: &&'a Value| {
            let of_key = schema
                .get("properties")
                .and_then(|properties| properties.get(key));
            of_key.or_else(|| {
                schema
                    .get("additionalProperties")
                    .filter(|other| other.is_object())
            })
        };
        schemas
            .iter()
            .filter_map(inner)
            .flat_map(|schema| self.alternatives(schema))
            .collect()
    }

    fn of_index<'a>(&'a self, schemas: &[&'a Value], index: usize) -> Vec<&'a Value> {
        let inner = |schema: &&'a Value| {
            let of_index = schema.get("prefixItems").and_then(|items| items.get(index));
            of_index.or_else(|| schema.get("items").filter(|items| items.is_object()))
        };
        schemas
            .iter()
            .filter_map(inner)
            .flat_map(|schema| self.alternatives(schema))
            .collect()
    }
}

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Null,
    Boolean,
    /// With the smallest and the largest number.
    Integer(Option<i128>, Option<i128>),
    Number,
    Text,
    List,
    Table,
}

impl Kind {
    /// Returns the kinds of a schema without alternatives, or `None` if it names none.
    fn all_of(schema: &Value) -> Option<Vec<Self>> {
        match schema.get("type")? {
            Value::Array(names) => names
                .iter()
                .map(|name| Kind::of(name.as_str()?, schema))
                .collect(),
            name => Some(vec![Kind::of(name.as_str()?, schema)?]),
        }
    }

    fn of(name: &str, schema: &Value) -> Option<Self> {
        Some(match name {
            "null" => Kind::Null,
            "boolean" => Kind::Boolean,
            "integer" => {
                let limit = |name: &str| schema.get(name).and_then(Value::as_i64).map(i128::from);
                let of_format = match schema.get("format").and_then(Value::as_str) {
                    Some("uint8") => Some(i128::from(u8::MAX)),
                    Some("uint16") => Some(i128::from(u16::MAX)),
                    Some("uint32") => Some(i128::from(u32::MAX)),
                    _ => None,
                };
                Kind::Integer(limit("minimum"), limit("maximum").or(of_format))
            }
            "number" => Kind::Number,
            "string" => Kind::Text,
            "array" => Kind::List,
            "object" => Kind::Table,
            _ => return None,
        })
    }

    fn has(&self, value: &Value) -> bool {
        match self {
            Kind::Null => value.is_null(),
            Kind::Boolean => value.is_boolean(),
            Kind::Integer(least, largest) => {
                let number = value
                    .as_i64()
                    .map(i128::from)
                    .or(value.as_u64().map(i128::from));
                number.is_some_and(|number| {
                    least.is_none_or(|least| number >= least)
                        && largest.is_none_or(|largest| number <= largest)
                })
            }
            Kind::Number => value.is_number(),
            Kind::Text => value.is_string(),
            Kind::List => value.is_array(),
            Kind::Table => value.is_object(),
        }
    }

    fn words(&self) -> String {
        match self {
            Kind::Null => "nothing".to_string(),
            Kind::Boolean => "true or false".to_string(),
            Kind::Integer(Some(least), Some(largest)) => {
                format!("a whole number from {least} to {largest}")
            }
            Kind::Integer(Some(least), None) => format!("a whole number from {least}"),
            Kind::Integer(..) => "a whole number".to_string(),
            Kind::Number => "a number".to_string(),
            Kind::Text => "a text".to_string(),
            Kind::List => "a list".to_string(),
            Kind::Table => "a table".to_string(),
        }
    }

    /// Returns the number meant by a text that is no TOML number, such as `.5`, `5.` or `05`.
    fn meant(&self, value: &Value) -> Option<String> {
        let number = value
            .as_str()?
            .parse::<f64>()
            .ok()
            .filter(|number| number.is_finite())?;
        match self {
            Kind::Number => Some(format!("{number:?}")),
            Kind::Integer(..) if number.fract() == 0.0 && number.abs() < 1e15 => {
                Some(number::fixed(number, 0))
            }
            _ => None,
        }
    }
}
