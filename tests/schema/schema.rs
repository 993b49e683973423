//! `morphcog schema`: what the program writes is valid under its schemas, what it refuses is not.

use jsonschema::Validator;
use morphcog::base::error::Error;
use morphcog::base::ranks::Ranks;
use morphcog::cli::{self, Cli};
use morphcog::commands::plan::Plan;
use morphcog::commands::schema::{self, Schema};
use morphcog::config::{BUILT_IN, Config};
use morphcog::view::console::{Console, Mode};
use serde_json::{Value, json};
use std::io;
use std::path::Path;

const CONFIG: &str = r#"
seed = 3
generations = 12
[body]
height = 5
width = 5
[task]
groups = [[0], [1]]
[data]
dataset = "builtin"
train_images = [0, 1]
[stimulus]
reduction = "area"
[protocol]
rollout = "fresh"
control_steps = 20
[map_elites]
initial = 8
parents = 8
"#;

/// Runs a command; its words are separated by blanks, and `DIR` stands for a folder.
fn run(folder: &Path, command: &str) -> Result<(), Error> {
    let command = command.replace("DIR", folder.to_str().unwrap());
    let words = std::iter::once("morphcog").chain(command.split_whitespace());
    let console = Console::with_writers(Mode::Quiet, Box::new(io::sink()), Box::new(io::sink()));
    cli::run(<Cli as clap::Parser>::try_parse_from(words).unwrap(), &console, Ranks::ALONE)
}

fn validator(name: &str) -> Validator {
    jsonschema::draft7::new(&Schema::named(name).unwrap().json()).unwrap()
}

/// What is wrong with a value, with its place; nothing if it is valid.
fn wrong(validator: &Validator, value: &Value) -> Vec<String> {
    validator.iter_errors(value).map(|error| format!("{}: {error}", error.instance_path())).collect()
}

fn toml(text: &str) -> Value {
    serde_json::to_value(toml::from_str::<toml::Table>(text).unwrap()).unwrap()
}

#[test]
fn every_schema_is_one_and_has_a_name_a_version_and_a_description_of_every_key() {
    for made in schema::ALL {
        let (name, schema) = (made.name, made.json());
        assert!(jsonschema::meta::is_valid(&schema), "{name}");
        assert_eq!(schema["$id"], format!("morphcog-{name}-1.schema.json"));
        undescribed(&schema, name);
    }
}

/// Every key has a description, and none has marks of Rust's documentation.
fn undescribed(schema: &Value, at: &str) {
    if let Some(keys) = schema["properties"].as_object() {
        for (key, value) in keys {
            let description = value["description"].as_str();
            assert!(description.is_some_and(|text| !text.contains("[`")), "{at}.{key}: {description:?}");
        }
    }
    match schema {
        Value::Object(keys) => {
            keys.iter().for_each(|(key, value)| undescribed(value, &format!("{at}.{key}")))
        }
        Value::Array(items) => items.iter().for_each(|value| undescribed(value, at)),
        _ => {}
    }
}

#[test]
fn shipped_configs_are_valid_as_they_are_and_with_all_their_keys() {
    let (config, plan) = (validator("config"), validator("plan"));
    let files: Vec<_> =
        std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs")).unwrap().collect();
    assert_eq!(files.len(), BUILT_IN.len() + 1, "and the paper's plan");
    for file in files {
        let path = file.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        let (validator, printed) = match name {
            "paper.toml" => (&plan, Plan::load(name, &[]).unwrap().to_toml()),
            _ => (&config, Config::load(name, &[]).unwrap().to_toml()),
        };
        for text in [std::fs::read_to_string(&path).unwrap(), printed] {
            assert_eq!(wrong(validator, &toml(&text)), Vec::<String>::new(), "{name}");
        }
    }
}

#[test]
fn what_the_program_refuses_in_a_config_is_invalid() {
    let folder = tempfile::tempdir().unwrap();
    let validator = validator("config");
    assert_eq!(wrong(&validator, &toml(CONFIG)), Vec::<String>::new());
    let bad = [
        ("/generations", json!("many")),
        ("/generations", json!(-1)),
        ("/seeed", json!(1)),
        ("/body/hieght", json!(3)),
        ("/protocol/rollout", json!("eternal")),
        ("/physics/mass", json!("heavy")),
        ("/stimulus/encoding", json!("colour")),
        ("/task/groups", json!([[0], [1], [2]])),
    ];
    for (place, value) in bad {
        let mut config = toml(CONFIG);
        let (section, key) = place.rsplit_once('/').unwrap();
        let keys = match section {
            "" => config.as_object_mut().unwrap(),
            section => {
                let name = section.trim_start_matches('/');
                config.as_object_mut().unwrap().entry(name).or_insert(json!({})).as_object_mut().unwrap()
            }
        };
        keys.insert(key.to_string(), value);
        assert!(!validator.is_valid(&config), "{place}");
        std::fs::write(folder.path().join("bad.json"), config.to_string()).unwrap();
        assert!(run(folder.path(), "evolve -c DIR/bad.json -o DIR/bad").is_err(), "{place}");
    }
}

#[test]
fn written_results_are_valid_and_those_of_another_format_are_not() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("run.toml"), CONFIG).unwrap();
    std::fs::create_dir(folder.path().join("gallery")).unwrap();
    for command in [
        "evolve -c DIR/run.toml -o DIR/run",
        "eval -a DIR/run --images 20 --cycles 1",
        "eval --robots gallery --dataset builtin --images 4 --cycles 1 -o DIR/gallery/eval.json",
        "train -a DIR/run --task 0|1 -o DIR/taught --set train.random_images=20 --set train.rounds=1 --set train.images=4 \
         --set train.final_images=4 --set train.challengers=1 --set protocol.control_steps=50 --set validation.images=40",
        "response -a DIR/taught --images 60 --task 0|1",
        "capacity --eval DIR/run/eval.json --set trainings=2 --set sizes=[1,3]",
        "team -a DIR/run --classes 0,1 --images 20",
    ] {
        run(folder.path(), command).unwrap_or_else(|error| panic!("{command}: {error}"));
    }
    let files = ["run/run.json", "run/team.json", "taught/run.json", "run/eval.json", "gallery/eval.json"];
    let files = files.into_iter().chain(["taught/audit.json", "taught/response.json", "run/capacity.json"]);
    for file in files {
        let name = Path::new(file).file_stem().unwrap().to_str().unwrap();
        let validator = validator(name);
        let value: Value = serde_json::from_slice(&std::fs::read(folder.path().join(file)).unwrap()).unwrap();
        assert_eq!(wrong(&validator, &value), Vec::<String>::new(), "{file}");
        for (key, other) in [("format", json!("other")), ("format_version", json!(2))] {
            let mut value = value.clone();
            value[key] = other;
            assert!(!validator.is_valid(&value), "{file}: {key}");
        }
    }
}
