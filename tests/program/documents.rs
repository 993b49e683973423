//! Tables in the documentation: the program's own words, between two marks in a page. After a change
//! of these words, `UPDATE_SNAPSHOTS=1 cargo test --test program documents` writes the pages anew.

use clap::CommandFactory;
use morphcog::cli::Cli;
use morphcog::commands::schema::{self, Schema};
use morphcog::commands::verify;
use morphcog::config::Config;
use serde_json::Value;
use std::path::Path;

/// Sections of a config in the order in which a user needs them, the top level first. The constants
/// of the physics are too many for a page.
const SECTIONS: [&str; 14] = [
    "",
    "task",
    "data",
    "body",
    "stimulus",
    "protocol",
    "map_elites",
    "genome",
    "archive",
    "evaluation",
    "validation",
    "train",
    "checkpoint",
    "savings",
];

fn schema_named(name: &str) -> Value {
    let is_named = |schema: &&Schema| schema.name == name;
    schema::ALL.iter().find(is_named).unwrap().json()
}

/// A key of a config, as its schema describes it.
struct Key {
    /// Its name with its section, such as `train.perturbations.start`.
    name: String,
    schema: Value,
    is_required: bool,
}

impl Key {
    /// Its section; that of the top level is "".
    fn section(&self) -> &str {
        self.name.split_once('.').map_or("", |(section, _)| section)
    }

    /// Its description without examples and reasons: the first paragraph.
    fn first_paragraph(&self) -> &str {
        first_paragraph(&self.schema)
    }

    /// Its description without the sentence that begins with "Default", and what that says.
    fn parts(&self) -> (String, Option<&str>) {
        let text = self.first_paragraph();
        match text.split_once("Default ") {
            None => (text.to_string(), None),
            Some((before, default)) => {
                assert!(
                    default.ends_with('.') && !default.contains(". "),
                    "{}: the default is not at the end",
                    self.name
                );
                // Reasons come after the value.
                let value = default.split([',', ';']).next().unwrap();
                (
                    before.trim_end().to_string(),
                    Some(value.trim_end_matches('.')),
                )
            }
        }
    }

    /// Its default, then its range: "14 (1–64)".
    fn default_and_range(&self) -> String {
        let (_, said) = self.parts();
        let said = match (&self.schema["default"], said) {
            // `Value::Null` stands for none.
            (Value::Null, None) if self.is_required => "required".to_string(),
            (Value::Null, None) => "none".to_string(),
            (Value::Null, Some(said)) => said.to_string(),
            (value, None) => as_text(value),
            (value, Some(said)) => {
                let value = as_text(value);
                // A list may be described.
                assert!(
                    said == value || value.starts_with('['),
                    "{}: the default is {value}, not {said}",
                    self.name
                );
                said.to_string()
            }
        };
        let bound = |name: &str| self.schema[name].as_f64();
        let range = match (bound("minimum"), bound("maximum")) {
            (Some(least), Some(most)) => format!(" ({least}–{most})").replace('-', "−"),
            (Some(least), None) if least > 0.0 => format!(" (≥{least})"),
            _ => String::new(),
        };
        said + &range
    }

    fn row(&self, definitions: &Value) -> String {
        let (mut text, _) = self.parts();
        let choices = definition_of(&self.schema, definitions);
        for choice in choices["oneOf"].as_array().into_iter().flatten() {
            let value = choice["const"].as_str().unwrap();
            let (first, rest) = first_paragraph(choice).split_at(1);
            text += &format!(" `{value}`: {}{rest}", first.to_lowercase());
        }
        let name = self.name.strip_prefix(&format!("{}.", self.section()));
        let name = name.unwrap_or(&self.name);
        format!("`{name}` | {} | {text}\n", self.default_and_range())
    }
}

/// A value as people write it: 1 instead of 1.0, texts without quotes.
fn as_text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(number) => number.as_f64().unwrap().to_string(),
        value => value.to_string(),
    }
}

/// The schema that a key refers to, or its own.
fn definition_of<'a>(schema: &'a Value, definitions: &'a Value) -> &'a Value {
    let reference = &schema["allOf"][0]["$ref"];
    match reference.as_str() {
        Some(path) => &definitions[path.rsplit('/').next().unwrap()],
        None => schema,
    }
}

/// Paragraphs are separated by two blanks.
fn first_paragraph(schema: &Value) -> &str {
    let text = schema["description"].as_str().unwrap();
    text.split("  ").next().unwrap()
}

/// The keys of an object and of the objects in it.
fn keys(object: &Value, prefix: &str, definitions: &Value) -> Vec<Key> {
    let required = object["required"].as_array().cloned().unwrap_or_default();
    let mut all = Vec::new();
    for (name, schema) in object["properties"].as_object().unwrap() {
        let key = Key {
            name: format!("{prefix}{name}"),
            schema: schema.clone(),
            is_required: required.contains(&name.as_str().into()),
        };
        let definition = definition_of(schema, definitions);
        match definition["properties"].is_object() {
            true => all.extend(keys(definition, &format!("{}.", key.name), definitions)),
            false => all.push(key),
        }
    }
    all
}

fn config_keys() -> String {
    let schema = schema_named("config");
    let mut all = keys(&schema, "", &schema["definitions"]);
    let mut text = String::new();
    // Nested keys come after the others.
    all.sort_by_key(|key| key.name.matches('.').count());
    for section in SECTIONS {
        let heading = match section {
            "" => "Top level".to_string(),
            section => format!("`[{section}]`"),
        };
        text += &format!("## {heading}\n\nkey | default | meaning\n---|---|---\n");
        let is_here = |key: &&Key| key.section() == section;
        all.iter()
            .filter(is_here)
            .for_each(|key| text += &key.row(&schema["definitions"]));
        text += "\n";
    }
    for key in all {
        let section = key.section();
        assert!(
            section == "physics" || SECTIONS.contains(&section),
            "the section {section} has no table"
        );
    }
    text.trim_end().to_string()
}

fn commands() -> String {
    let mut text = "command | what it does\n---|---\n".to_string();
    for command in Cli::command().get_subcommands() {
        let about = command.get_about().unwrap().to_string();
        text += &format!("`{}` | {about}\n", command.get_name());
    }
    text.trim_end().to_string()
}

fn exit_codes() -> String {
    let help = Cli::command().get_after_help().unwrap().to_string();
    let (_, codes) = help.split_once("Exit codes:\n").unwrap();
    let mut text = "code | meaning\n---|---\n".to_string();
    for line in codes.lines() {
        let (code, meaning) = line.trim().split_once(' ').unwrap();
        text += &format!("{code} | {}\n", meaning.trim());
    }
    text.trim_end().to_string()
}

fn schemas() -> String {
    let mut text = "schema | describes\n---|---\n".to_string();
    for schema in schema::ALL {
        let title = schema.json()["title"].as_str().unwrap().to_string();
        let of = title.strip_prefix("morphcog: ").unwrap();
        text += &format!("`{}` | {of}\n", schema.name);
    }
    text.trim_end().to_string()
}

/// Claims with their commands, values, costs and places.
fn claims() -> String {
    let mut lines = vec![
        "claim, commands | expected | CPU minutes | needs | files".to_string(),
        "---|---|---|---|---".to_string(),
    ];
    for claim in verify::claims().unwrap() {
        let commands: Vec<String> = claim
            .typed()
            .iter()
            .map(|line| format!("`{line}`"))
            .collect();
        let name = match claim.by_hand {
            Some(_) => String::new(),
            None => format!("`{}`: ", claim.name),
        };
        let shipped = claim.shipped.split(", ").filter(|path| !path.is_empty());
        let shipped: Vec<String> = shipped.map(|path| format!("[{path}](../{path})")).collect();
        let cells = [
            format!("{name}{}<br>{}", claim.claim, commands.join("<br>")),
            claim.expected(),
            format!("{} ({})", claim.cpu_minutes, claim.processor),
            claim.needed(),
            shipped.join(", "),
        ];
        // A bar inside a cell would end it.
        lines.push(cells.map(|cell| cell.replace('|', "\\|")).join(" | "));
    }
    lines.join("\n")
}

/// A page as it must be: every part between its marks made anew.
fn made(page: &str) -> (String, usize) {
    const END: &str = "<!-- end of generated -->";
    let (mut text, mut rest, mut parts) = (String::new(), page, 0);
    while let Some((before, after)) = rest.split_once("<!-- generated: ") {
        let (name, after) = after.split_once(" -->").unwrap();
        let (_, after) = after
            .split_once(END)
            .unwrap_or_else(|| panic!("{name} has no end"));
        let part = match name {
            "config keys" => config_keys(),
            "commands" => commands(),
            "exit codes" => exit_codes(),
            "schemas" => schemas(),
            "claims" => claims(),
            _ => panic!("nothing makes {name}"),
        };
        text += &format!("{before}<!-- generated: {name} -->\n\n{part}\n\n{END}");
        (rest, parts) = (after, parts + 1);
    }
    (text + rest, parts)
}

#[test]
fn generated_parts_of_pages_are_what_the_program_says() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|ending| ending != "md") {
            continue;
        }
        let page = std::fs::read_to_string(&path).unwrap();
        let (made, parts) = made(&page);
        count += parts;
        if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
            if made != page {
                std::fs::write(&path, made).unwrap();
            }
            continue;
        }
        let differing = page.lines().zip(made.lines()).find(|(is, must)| is != must);
        let name = path.display();
        assert!(
            made == page,
            "{name}: UPDATE_SNAPSHOTS=1 writes it anew; the first difference: {differing:?}"
        );
    }
    assert_eq!(count, 5);
}

/// Ranges in a schema are those of the program: it refuses a value outside and accepts the ends.
#[test]
fn ranges_of_the_config_s_schema_hold() {
    let config = "[task]\ngroups = [[0], [1]]\n[data]\ndataset = \"builtin\"\n[body]\nmin_muscles = 1\n[stimulus]\n\
                  reduction = \"area\"\n";
    let schema = schema_named("config");
    let mut count = 0;
    for key in keys(&schema, "", &schema["definitions"]) {
        let set = |value: f64| {
            let value = format!("{}={value}", key.name);
            Config::parse(config, "c.toml", &[value]).map(drop)
        };
        let is_of_physics = key.name.starts_with("physics.");
        for (name, step) in [("minimum", -1.0), ("maximum", 1.0)] {
            let Some(end) = key.schema[name].as_f64().filter(|_| !is_of_physics) else {
                continue;
            };
            assert!(set(end + step).is_err(), "{} = {}", key.name, end + step);
            count += 1;
        }
    }
    assert!(count > 40, "{count}");
}
