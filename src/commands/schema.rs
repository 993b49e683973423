//! JSON Schemas of configs and results, made from the types that read them.

use crate::base::error::Error;
use crate::commands::plan::PaperPlan;
use crate::commands::simulate::Scenario;
use crate::commands::sweep::SweepPlan;
use crate::config::Config;
use crate::config::audit::Criteria;
use crate::config::capacity::CapacityConfig;
use crate::store::audit::{self, AuditFile};
use crate::store::capacity::{self, CapacityFile};
use crate::store::eval::{self, EvalFile};
use crate::store::response::{self, ResponseFile};
use crate::store::run::{self, RunFile};
use crate::store::team::{self, TeamFile};
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::Value;

/// Version of the schemas of configs; those of results have the version of their files.
const CONFIG_VERSION: u32 = 1;

/// A schema that the program prints.
#[derive(Clone, Copy, Debug)]
pub struct Schema {
    /// Its name on the command line.
    pub name: &'static str,
    /// The files it describes.
    pub(crate) of: &'static str,
    version: u32,
    make: fn() -> Value,
}

/// All schemas.
pub const ALL: [Schema; 12] = [
    of_config::<Config>("config", "config of evolve and train"),
    of_config::<SweepPlan>("sweep", "plan of sweep"),
    of_config::<PaperPlan>("plan", "plan of reproduce"),
    of_config::<Criteria>("audit-config", "config of audit"),
    of_config::<CapacityConfig>("capacity-config", "config of capacity"),
    of_config::<Scenario>("scenario", "scenario of simulate"),
    of::<RunFile>("run", "run.json", run::FORMAT_VERSION),
    of::<EvalFile>("eval", "eval.json", eval::FORMAT_VERSION),
    of::<AuditFile>("audit", "audit.json", audit::FORMAT_VERSION),
    of::<ResponseFile>("response", "response.json", response::FORMAT_VERSION),
    of::<TeamFile>("team", "team.json", team::FORMAT_VERSION),
    of::<CapacityFile>("capacity", "capacity.json", capacity::FORMAT_VERSION),
];

const fn of_config<T: JsonSchema>(name: &'static str, of: &'static str) -> Schema {
    self::of::<T>(name, of, CONFIG_VERSION)
}

const fn of<T: JsonSchema>(name: &'static str, of: &'static str, version: u32) -> Schema {
    Schema {
        name,
        of,
        version,
        make: made::<T>,
    }
}

impl Schema {
    pub(crate) fn named(name: &str) -> Result<Self, Error> {
        ALL.into_iter()
            .find(|schema| schema.name == name)
            .ok_or_else(|| {
                let names = ALL.map(|schema| schema.name).join(", ");
                Error::usage(format!("schema {name}: expected one of {names}"))
            })
    }

    /// Returns it as JSON Schema draft 7, which most editors know.
    pub fn json(&self) -> Value {
        let mut schema = (self.make)();
        let id = format!("morphcog-{}-{}.schema.json", self.name, self.version);
        schema["$id"] = Value::String(id);
        schema["title"] = Value::String(format!("morphcog: {}", self.of));
        plain(&mut schema);
        schema
    }
}

fn made<T: JsonSchema>() -> Value {
    SchemaSettings::draft07()
        .into_generator()
        .into_root_schema_for::<T>()
        .to_value()
}

/// Removes the markup of Rust's documentation from descriptions.
fn plain(schema: &mut Value) {
    match schema {
        Value::Object(keys) => {
            for (key, value) in keys {
                match value {
                    Value::String(text) if key == "description" => *text = without_links(text),
                    value => plain(value),
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(plain),
        _ => {}
    }
}

/// Removes links and line breaks: `[name](target)` and ``[`name`]`` become the name.
fn without_links(text: &str) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(['[', '\\', '\n']) {
        plain.push_str(&rest[..at]);
        let (mark, after) = rest[at..].split_at(1);
        rest = after;
        match mark {
            "\\" => {
                let escaped = rest.chars().next().map_or(0, char::len_utf8);
                plain.push_str(&rest[..escaped]);
                rest = &rest[escaped..];
            }
            "\n" => plain.push(' '),
            _ => {
                let (name, after) = rest.split_once(']').unwrap_or((rest, ""));
                let target = after
                    .strip_prefix('(')
                    .and_then(|target| target.split_once(')'));
                match target {
                    Some((_, after)) => {
                        plain.push_str(name);
                        rest = after;
                    }
                    None if name.starts_with('`') => {
                        plain.push_str(name);
                        rest = after;
                    }
                    None => plain.push('['),
                }
            }
        }
    }
    plain + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptions_lose_links_line_breaks_and_escapes_and_nothing_else() {
        let text = "A [`Body`] of\nrows \\[wu\\], see [there](crate::x) and [−1, 1].";
        assert_eq!(
            without_links(text),
            "A `Body` of rows [wu], see there and [−1, 1]."
        );
        assert_eq!(without_links("a ] b [ c"), "a ] b [ c");
    }

    #[test]
    fn an_unknown_schema_is_refused_with_those_that_there_are() {
        let error = Schema::named("rnu").unwrap_err();
        assert!(
            error.message.contains(
                "config, sweep, plan, audit-config, capacity-config, scenario, run, eval, audit"
            ),
            "{error}"
        );
    }
}
