//! `morphcog schema`: what the program writes is valid under its schemas, what it refuses is not.

mod common;

use common::program::{Sandbox, TINY};
use jsonschema::Validator;
use serde_json::{Value, json};
use std::path::Path;

const NAMES: [&str; 11] = [
    "config",
    "sweep",
    "plan",
    "audit-config",
    "capacity-config",
    "run",
    "eval",
    "audit",
    "response",
    "team",
    "capacity",
];

/// The schema of a name, as printed.
fn schema(sandbox: &Sandbox, name: &str) -> Value {
    let printed = sandbox.run(&format!("schema {name}")).ended(0, &[]);
    serde_json::from_str(&printed.out).unwrap()
}

fn validator(sandbox: &Sandbox, name: &str) -> Validator {
    jsonschema::draft7::new(&schema(sandbox, name)).unwrap()
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
    let sandbox = Sandbox::new();
    let listed = sandbox.run("schema").ended(0, &[]).out;
    for name in NAMES {
        assert!(listed.lines().any(|line| line.starts_with(name)), "{listed}");
        let schema = schema(&sandbox, name);
        assert!(jsonschema::meta::is_valid(&schema), "{name}");
        assert_eq!(schema["$id"], format!("morphcog-{name}-1.schema.json"));
        undescribed(&schema, name);
    }
    sandbox.run("schema rnu").ended(2, &["schema rnu: expected one of config, sweep, plan"]);
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
    let sandbox = Sandbox::new();
    let (config, plan) = (validator(&sandbox, "config"), validator(&sandbox, "plan"));
    for file in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/configs")).unwrap() {
        let path = file.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        let validator = if name == "paper.toml" { &plan } else { &config };
        let printed = sandbox.run(&format!("config {name}")).out;
        for text in [std::fs::read_to_string(&path).unwrap(), printed] {
            assert_eq!(wrong(validator, &toml(&text)), Vec::<String>::new(), "{name}");
        }
    }
}

#[test]
fn what_the_program_refuses_in_a_config_is_invalid() {
    let sandbox = Sandbox::new();
    let validator = validator(&sandbox, "config");
    assert_eq!(wrong(&validator, &toml(TINY)), Vec::<String>::new());
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
        let mut config = toml(TINY);
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
        sandbox.write("bad.json", config.to_string());
        let refused = sandbox.run("evolve -q -c bad.json -o bad");
        assert_ne!(refused.code, Some(0), "{place}");
    }
}

#[test]
fn written_results_are_valid_and_those_of_another_format_are_not() {
    let sandbox = Sandbox::new();
    sandbox.write("gallery/README.md", "what the gallery's robots read");
    sandbox.write("run.toml", TINY);
    sandbox.run("evolve -q -c run.toml -o run").ended(0, &[]);
    sandbox.run("eval -q --archive run --images 20 --cycles 1").ended(0, &[]);
    sandbox
        .run("eval -q --robots gallery --dataset builtin --images 4 --cycles 1 --out gallery/eval.json")
        .ended(0, &[]);
    sandbox.run("train -q --archive run --task 0|1 --out taught --set train.random_images=20 --set train.rounds=1 \
                 --set train.images=4 --set train.final_images=4 --set train.challengers=1 --set \
                  protocol.control_steps=50 \
                 --set validation.images=40")
        .ended(0, &[]);
    sandbox.run("response -q --archive taught --images 60 --task 0|1").ended(0, &[]);
    sandbox.run("capacity -q --eval run/eval.json --set trainings=2 --set sizes=[1,3]").ended(0, &[]);
    sandbox.run("team -q --archive run --classes 0,1 --images 20").ended(0, &[]);
    let files = ["run/run.json", "run/team.json", "taught/run.json", "run/eval.json", "gallery/eval.json"];
    let files = files.into_iter().chain(["taught/audit.json", "taught/response.json", "run/capacity.json"]);
    for file in files {
        let name = Path::new(file).file_stem().unwrap().to_str().unwrap();
        let validator = validator(&sandbox, name);
        let value: Value = serde_json::from_str(&sandbox.read(file)).unwrap();
        assert_eq!(wrong(&validator, &value), Vec::<String>::new(), "{file}");
        for (key, other) in [("format", json!("other")), ("format_version", json!(2))] {
            let mut value = value.clone();
            value[key] = other;
            assert!(!validator.is_valid(&value), "{file}: {key}");
        }
    }
}
