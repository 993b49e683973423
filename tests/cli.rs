//! The command line, as its users meet it: what it prints, where it writes, how it ends.

mod common;

use common::program::{Sandbox, TINY, files, gaits, said};
use common::reference::{Reference, golden};
use morphcog::commands::plan::PAPER_TOML;
use morphcog::config::{BUILT_IN, Config};
use morphcog::store::eval::EvalFile;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::OnceLock;

/// A finished tiny run and what belongs to it, made once; copy it with [`with_run`].
fn run_once() -> &'static BTreeMap<String, Vec<u8>> {
    static RUN: OnceLock<BTreeMap<String, Vec<u8>>> = OnceLock::new();
    RUN.get_or_init(|| {
        let sandbox = Sandbox::tiny();
        sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
        files(&sandbox.path("run"))
    })
}

/// A sandbox with a finished run in `run`.
fn with_run() -> Sandbox {
    let sandbox = Sandbox::tiny();
    run_once().iter().for_each(|(name, content)| {
        sandbox.write(&format!("run/{name}"), content);
    });
    sandbox
}

// ---- help ----

const COMMANDS: [&str; 25] = [
    "",
    "evolve",
    "response",
    "train",
    "eval",
    "team",
    "audit",
    "capacity",
    "sweep",
    "reproduce",
    "report",
    "replay",
    "plot",
    "simulate",
    "data",
    "data fetch",
    "data info",
    "data sheet",
    "serve",
    "bench",
    "gallery",
    "config",
    "completions",
    "man",
    "help",
];

#[test]
fn the_help_of_every_command_has_an_example_that_names_it() {
    let sandbox = Sandbox::new();
    for command in COMMANDS.iter().filter(|command| **command != "help") {
        let said = sandbox.run(&format!("{command} --help")).ended(0, &[]);
        let example = format!("morphcog {command}");
        let (_, examples) = said.out.split_once("Example").unwrap_or_else(|| panic!("{command}: no example"));
        assert!(examples.contains(example.trim()), "{command}: {examples}");
    }
}

#[test]
fn the_help_documents_every_exit_code() {
    let help = Sandbox::new().run("--help").ended(0, &[]).out;
    let (_, codes) = help.split_once("Exit codes").unwrap();
    for code in ["0 ", "1 ", "2 ", "3 ", "4 ", "5 ", "75 ", "130 "] {
        assert!(codes.contains(code), "{code} is not in {codes}");
    }
}

#[test]
fn a_wrong_command_line_ends_with_2() {
    let sandbox = Sandbox::tiny();
    for wrong in [
        "",
        "evolv",
        "evolve",
        "evolve -c tiny.toml --seed x",
        "evolve -c tiny.toml --threads 0",
        "evolve -c tiny.toml --threads 99999",
        "evolve -c tiny.toml --resume --force",
        "evolve -c tiny.toml --seed -1",
        "evolve -c tiny.toml --seed 18446744073709551616",
        "evolve -c tiny.toml --seed 9223372036854775808",
        "data sheet builtin -o sheet.gif",
        "replay --robot YJTLA --dataset builtin --format html -o walk.gif",
        "evolve -c tiny.toml -g 1.5",
        "evolve -c tiny.toml -q --json",
        "eval --images 0",
        "eval --images -5",
        "eval --robots top:0",
        "eval --robots top:x",
        "eval --robots worst:3",
        "eval --cycles 0",
        "replay --images x",
        "replay --images dev:3",
        "replay --images train:-1",
        "replay --format mpeg",
        "replay --width x",
        "simulate",
        "data",
        "data sheet --samples x",
        "completions csh",
        "config zero_one.toml --unknown",
        "plot bodies",
        "schema rnu",
        "data fetch emnist",
    ] {
        sandbox.run(wrong).ended(2, &[]);
    }
}

#[test]
fn completions_for_all_shells_name_every_command() {
    let sandbox = Sandbox::new();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let said = sandbox.run(&format!("completions {shell}")).ended(0, &[]);
        for command in ["evolve", "eval", "replay", "simulate", "gallery", "--resume"] {
            let word = command.trim_start_matches('-');
            assert!(said.out.contains(word), "{shell}: {command}");
        }
    }
}

#[test]
fn where_a_few_words_are_meant_shells_offer_them() {
    let sandbox = Sandbox::new();
    let [bash, zsh] = ["bash", "zsh"].map(|shell| sandbox.run(&format!("completions {shell}")).out);
    let offered = |words: &str, times: usize| {
        assert_eq!(zsh.matches(&format!(":({words})")).count(), times, "zsh: {words}");
        assert!(bash.contains(words), "bash: {words}");
    };
    offered("body spacetime snapshots archive progress accuracy capacity", 1);
    // Of eval and of team; bash has it for options.
    offered("test validation", 2);
    assert_eq!(bash.matches("compgen -W \"test validation\"").count(), 2);
    offered("gif html png terminal", 2);
    offered("plain paper", 1);
    offered("mnist fashion-mnist", 1);
    offered("builtin mnist fashion-mnist", 2);
    offered(&morphcog::commands::schema::ALL.map(|schema| schema.name).join(" "), 1);
    let configs = BUILT_IN.map(|(name, _)| name).join(" ");
    offered(&format!("{configs} {}", PAPER_TOML.0), 1);
    // Errors have them, too, where nothing else may be meant.
    sandbox.run("plot bodies").ended(2, &["expected one of body, spacetime"]);
    sandbox.run("eval --split train").ended(2, &["expected test or validation"]);
    sandbox.run("replay --format mpeg").ended(2, &["expected gif, html, png or terminal"]);
    sandbox.write("mine.toml", TINY);
    sandbox.run("config mine.toml").ended(0, &[]);
}

#[test]
fn the_man_page_renders() {
    let page = Sandbox::new().run("man").ended(0, &[]).out;
    assert!(page.contains(".TH morphcog 1") && page.contains(".SH NAME"), "{page}");
    assert!(page.contains("evolve") && page.contains("Exit codes"));
    // Where there is a man, it must understand it.
    let sandbox = Sandbox::new();
    let file = sandbox.write("morphcog.1", &page);
    if let Ok(shown) = std::process::Command::new("man").arg("-l").arg(file).env("MANPAGER", "cat").output() {
        let text = String::from_utf8_lossy(&shown.stdout).into_owned();
        assert!(!shown.status.success() || text.is_empty() || text.contains("morphcog"), "{text}");
    }
}

// ---- configs ----

#[test]
fn every_shipped_config_is_valid_and_its_built_in_copy_is_the_same() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let shipped = files(&folder);
    let built_in: BTreeMap<String, Vec<u8>> = BUILT_IN
        .iter()
        .chain([&PAPER_TOML])
        .map(|(name, text)| (name.to_string(), text.as_bytes().to_vec()))
        .collect();
    assert_eq!(shipped, built_in);
    let sandbox = Sandbox::new();
    let list = sandbox.run("config").ended(0, &[]).out;
    for (name, text) in BUILT_IN {
        Config::parse(text, name, &[]).unwrap();
        assert!(list.contains(name), "{list}");
    }
    let plan = sandbox.run("config paper.toml --set seeds=[7]").ended(0, &[]).out;
    sandbox.write("mine.toml", &plan);
    assert!(list.contains("paper.toml") && plan.contains("seeds = [7]"), "{plan}");
    sandbox.run("reproduce mine.toml --scale 2").ended(2, &["--scale 2"]);
}

#[test]
fn a_printed_config_is_itself_a_config_equal_to_the_original() {
    let sandbox = Sandbox::new();
    for (name, text) in BUILT_IN {
        let printed = sandbox.run(&format!("config {name}")).ended(0, &[]).out;
        let original = Config::parse(text, name, &[]).unwrap();
        assert_eq!(Config::parse(&printed, "printed.toml", &[]).unwrap(), original, "{name}");
        sandbox.write("printed.toml", &printed);
        assert_eq!(sandbox.run("config printed.toml").ended(0, &[]).out, printed);
        assert!(printed.contains("[physics]") && printed.contains("gravity"), "every key is printed");
    }
    let changed =
        sandbox.run("config zero_one.toml --set map_elites.parents=7 --set seed=5").ended(0, &[]).out;
    let changed = Config::parse(&changed, "changed.toml", &[]).unwrap();
    assert_eq!((changed.map_elites.parents, changed.seed), (7, 5));
}

#[test]
fn a_file_in_this_folder_comes_before_the_built_in_config_of_its_name() {
    let sandbox = Sandbox::new();
    let built_in = sandbox.run("config quickstart.toml").ended(0, &[]).out;
    assert_eq!(sandbox.run("config quickstart").ended(0, &[]).out, built_in);
    sandbox.write("quickstart.toml", TINY);
    assert_ne!(sandbox.run("config quickstart.toml").ended(0, &[]).out, built_in);
}

#[test]
fn toml_and_json_with_the_same_keys_make_the_same_run() {
    let sandbox = Sandbox::tiny();
    let table: toml::Table = toml::from_str(TINY).unwrap();
    sandbox.write("json/tiny.json", serde_json::to_string_pretty(&table).unwrap());
    sandbox.run("evolve -q -c tiny.toml -o a").ended(0, &[]);
    sandbox.run("evolve -q -c json/tiny.json -o b").ended(0, &[]);
    assert_eq!(sandbox.read("a/run.json"), sandbox.read("b/run.json"));
    assert_eq!(sandbox.read("a/config.toml"), sandbox.read("b/config.toml"));
    // The config that a run writes makes the same run again.
    std::fs::copy(sandbox.path("a/config.toml"), sandbox.path("json/tiny.toml")).unwrap();
    sandbox.run("evolve -q -c json/tiny.toml -o c").ended(0, &[]);
    assert_eq!(sandbox.read("a/run.json"), sandbox.read("c/run.json"));
}

#[test]
fn a_wrong_config_is_refused_with_file_line_and_key() {
    let sandbox = Sandbox::new();
    let wrong = |name: &str, text: &str, words: &[&str]| {
        sandbox.write(name, text);
        sandbox.run(&format!("evolve -c {name} -o run")).ended(3, words);
        assert!(!sandbox.path("run").exists(), "{name}: {text}");
    };
    let with = |line: &str| format!("{TINY}\n[physics]\n{line}\n");
    let line = |text: &str| text.lines().count();
    let place = format!("own.toml:{}", line(&with("x")));
    wrong("own.toml", &with("gravitee = 3"), &[&place, "physics", "gravitee", "unknown field"]);
    wrong("own.toml", &with("gravity = \"much\""), &[&place, "physics.gravity", "expected a number"]);
    wrong("own.toml", &with("substeps = -1"), &[&place, "physics.substeps"]);
    wrong("own.toml", &with("substeps = 1e3"), &[&place, "physics.substeps"]);
    wrong("own.toml", &with("substeps = = 3"), &[&place]);
    wrong("own.toml", &TINY.replace("[[0], [1]]", "[[0], [300]]"), &["own.toml:10", "task.groups"]);
    let two = ["own.toml:10", "task.groups", "a list of two"];
    wrong("own.toml", &TINY.replace("[[0], [1]]", "[[0], [1], [2]]"), &two);
    wrong("own.toml", &TINY.replace("[[0], [1]]", "[[0]]"), &two);
    wrong("own.toml", &TINY.replace("\"fresh\"", "\"stale\""), &["own.toml:20", "protocol.rollout", "stale"]);
    wrong("own.toml", &TINY.replace("seed = 3", "seed = 3\nseed = 4"), &["own.toml:3", "duplicate key"]);
    wrong("own.toml", &TINY.replace("seed = 3", "sed = 3"), &["own.toml:2", "sed"]);
    // What is wrong with values that are well typed.
    wrong("own.toml", &TINY.replace("[[0], [1]]", "[[0], []]"), &["own.toml", "task"]);
    wrong("own.toml", &TINY.replace("[[0], [1]]", "[[0], [0]]"), &["own.toml", "task", "more than once"]);
    wrong("own.toml", &TINY.replace("[0, 1]", "[0, 1, 2]"), &["data.train_images", "image 2 shows a 2"]);
    wrong("own.toml", &TINY.replace("[0, 1]", "[0]"), &["data.train_images", "class 1"]);
    wrong("own.toml", &TINY.replace("[0, 1]", "[0, 10000000]"), &["data.train_images", "10000000"]);
    wrong(
        "own.toml",
        &TINY.replace("height = 5", "height = 0"),
        &["own.toml:6: ", "body.height = 0", "1 to 64"],
    );
    wrong("own.toml", &TINY.replace("control_steps = 20", "control_steps = 0"), &["protocol.control_steps"]);
    wrong("own.toml", &with("time_step = nan"), &["own.toml", "physics.time_step"]);
    wrong("own.toml", &with("time_step = -inf"), &["own.toml", "physics.time_step"]);
    wrong("own.toml", "", &["own.toml", "task"]);

    let table: toml::Table = toml::from_str(TINY).unwrap();
    let json = serde_json::to_string_pretty(&table).unwrap();
    let at = |word: &str| format!("own.json:{}", 1 + json.lines().position(|l| l.contains(word)).unwrap());
    let changed = |from: &str, to: &str| {
        assert!(json.contains(from), "{json}");
        json.replace(from, to)
    };
    let at_steps = at("control_steps");
    wrong("own.json", &changed("control_steps", "control_step"), &[&at_steps, "protocol", "control_step"]);
    wrong(
        "own.json",
        &changed("\"control_steps\": 20", "\"control_steps\": \"20\""),
        &[&at_steps, "protocol.control_steps"],
    );
    wrong(
        "own.json",
        &changed("\"control_steps\": 20", "\"control_steps\": 1e99"),
        &[&at_steps, "protocol.control_steps"],
    );
    wrong("own.json", &changed("\"control_steps\": 20", "\"control_steps\": NaN"), &[&at_steps]);
    wrong("own.json", &json[..json.len() / 2], &["own.json:"]);
    wrong("own.json", &format!("{json} {json}"), &["own.json:", "after the end"]);
    wrong("own.json", "", &["own.json"]);
    wrong("own.json", "[]", &["own.json"]);
}

#[test]
fn a_wrong_set_is_refused_with_2_and_quotes_it() {
    let sandbox = Sandbox::tiny();
    for (set, words) in [
        ("seed", "key=value"),
        ("=3", "--set =3"),
        ("sed=3", "sed"),
        ("seed=x", "seed=x"),
        ("seed.x=3", "seed"),
        ("physics.gravitee=3", "gravitee"),
        ("physics=3", "physics=3"),
        ("map_elites.initial=0", "map_elites.initial=0"),
        ("a..b=1", "a..b=1"),
        ("", "key=value"),
    ] {
        let command = sandbox.command(["evolve", "-c", "tiny.toml", "-o", "run", "--set", set]);
        said(command).ended(2, &["--set", words]);
        assert!(!sandbox.path("run").exists());
    }
    // Well typed, but not what can be: the config's fault. What no file can hold is not taken for
    // the same as anything else.
    let table: toml::Table =
        toml::from_str(&TINY.replace("[data]\n", "[data]\nbuiltin = { seed = 77 }\n")).unwrap();
    let large = serde_json::to_string(&table).unwrap().replace(":77", ":9223372036854775808");
    sandbox.write("large.json", large);
    sandbox
        .run("evolve -c large.json -o run")
        .ended(3, &["data.builtin.seed = 9223372036854775808", "0 to 9223372036854775807"]);
    sandbox
        .run("evolve -c tiny.toml -o run --set generations=0")
        .ended(3, &["--set generations=0: ", "generations = 0"]);
}

/// What `config` prints of `own.toml`, [`TINY`] for gaits, with some overrides.
fn changed(sandbox: &Sandbox, set: &[&str]) -> toml::Table {
    let set = set.iter().flat_map(|set| ["--set", set]);
    let said = said(sandbox.command(["config", "own.toml"].into_iter().chain(set))).ended(0, &[]);
    toml::from_str(&said.out).unwrap()
}

#[test]
fn set_reaches_a_key_and_unsets_it() {
    let sandbox = Sandbox::new();
    sandbox.write("own.toml", gaits());
    let plain = changed(&sandbox, &[]);
    let other = changed(&sandbox, &["archive.keep=7", "evaluation.fitness="]);
    assert_eq!(other["archive"]["keep"].as_integer(), Some(7));
    assert!(plain.get("evaluation").is_some() && other.get("evaluation").is_none());
    assert_eq!(plain["body"], other["body"]);
    // Unset is what it would be if it did not stand in the file, and once more changes nothing.
    assert_eq!(
        changed(&sandbox, &["generations=", "train.rounds="])["generations"].as_integer(),
        Some(30_000)
    );
    assert_eq!(
        changed(&sandbox, &["task.groups.2.1=8"])["task"]["groups"][1],
        toml::Value::Array(vec![8.into()])
    );
    // What was set is what is run.
    sandbox.run("evolve -q -c own.toml -o run --set archive.keep=3 -g 2").ended(0, &[]);
    assert_eq!(sandbox.run_file("run").config.archive.keep, Some(3));
}

#[test]
fn an_error_blames_the_override_that_caused_it() {
    let sandbox = Sandbox::new();
    sandbox.write("one.toml", TINY);
    let blamed = |set: &[&str], code: i32, blamed: &str, words: &[&str]| {
        let all = set.iter().flat_map(|set| ["--set", set]);
        let command = sandbox.command(["evolve", "-c", "one.toml", "-o", "run"].into_iter().chain(all));
        let place = format!("error: --set {blamed}: ");
        said(command).ended(code, &[&[place.as_str()], words].concat());
        assert!(!sandbox.path("run").exists());
    };
    // By itself, alone or beside others.
    blamed(&["archive.keep=0"], 3, "archive.keep=0", &["archive.keep = 0"]);
    blamed(&["archive.keep=0", "seed=4"], 3, "archive.keep=0", &[]);
    blamed(&["train.rounds=2", "archive.keep=0"], 3, "archive.keep=0", &[]);
    // With what stands in the file only, where the message begins with a key of the file.
    blamed(&["physics.ground_row=9"], 3, "physics.ground_row=9", &["protocol.start_row"]);
    // Keys and items that are not there, to be set or unset.
    blamed(&["seed=4", "task.groups.3.1=1"], 2, "task.groups.3.1=1", &["from 1 to 2"]);
    blamed(&["task.groups.0.1=1"], 2, "task.groups.0.1=1", &["from 1 to 2"]);
    blamed(&["stages.1.keep=1"], 2, "stages.1.keep=1", &["unknown field `stages`"]);
    blamed(&["seed=4", "archive.kep=1"], 2, "archive.kep=1", &["unknown field `kep`"]);
    blamed(&["seed=4", "archive.kep="], 2, "archive.kep=", &["unknown field `kep`"]);
    blamed(&["data.dataset=", "seed=4"], 2, "data.dataset=", &["missing field `dataset`"]);
    blamed(&["body.height=x", "seed=4"], 2, "body.height=x", &["a whole number"]);
    // The file's own fault stays the file's.
    sandbox.write("bad.toml", TINY.replace("height = 5", "height = 0"));
    sandbox.run("evolve -c bad.toml -o run --set seed=4").ended(3, &["error: bad.toml:6: body.height = 0"]);
    // So it is with what else is set.
    sandbox.run("audit --set least_kept=2 --set threshold=1").ended(3, &["--set least_kept=2: "]);
    sandbox.run("audit --set perturbations.start.9=1").ended(2, &["no perturbations.start 9"]);
    sandbox
        .run("capacity --eval no.json --set step=2 --set mlp.epochs=0")
        .ended(3, &["--set mlp.epochs=0: "]);
}

#[test]
fn a_config_that_is_not_there_is_refused_naming_the_built_in_ones() {
    let said =
        Sandbox::new().run("evolve -c nowhere.toml").ended(3, &["nowhere.toml", "hint:", "quickstart.toml"]);
    assert!(said.out.is_empty());
}

// ---- data ----

#[test]
fn missing_data_are_refused_naming_file_place_and_remedy() {
    let sandbox = Sandbox::tiny();
    std::fs::create_dir(sandbox.path("empty")).unwrap();
    let words = ["train-images-idx3-ubyte", "morphcog data fetch mnist"];
    let run = "evolve -c tiny.toml -o run --set data.dataset=mnist";
    sandbox.run(run).ended(3, &["data/mnist", "morphcog data fetch mnist"]);
    sandbox.run(&format!("{run} --data empty")).ended(3, &[&words[..], &["empty", "--data"]].concat());
    let mut command = sandbox.command(run.split(' '));
    command.env("MORPHCOG_DATA", sandbox.path("empty"));
    said(command).ended(3, &[&words[..], &["MORPHCOG_DATA"]].concat());
    sandbox.run(&format!("{run} --set data.dir=empty")).ended(3, &[&words[..], &["[data] dir"]].concat());
    sandbox.run("data info mnist").ended(3, &["data/mnist", "morphcog data fetch mnist"]);
    sandbox.run("data info ../x").ended(3, &["../x"]);
    assert!(!sandbox.path("run").exists());
}

#[test]
fn broken_data_are_refused_naming_the_file() {
    let sandbox = Sandbox::tiny();
    sandbox.write("data/mnist/train-images-idx3-ubyte", [0u8, 0, 8, 3, 0, 0, 0, 9, 0, 0]);
    sandbox.write("data/mnist/train-labels-idx1-ubyte", [0u8, 0, 8, 1, 0, 0, 0, 9]);
    let run = "evolve -c tiny.toml -o run --set data.dataset=mnist";
    sandbox.run(run).ended(3, &["train-images-idx3-ubyte"]);
    sandbox.write("data/mnist/train-images-idx3-ubyte", "this is no image");
    sandbox.run(run).ended(3, &["train-images-idx3-ubyte"]);
    // Also where the other split can be used.
    sandbox.write("data/mnist/t10k-images-idx3-ubyte", [0u8, 0, 8, 3, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 9]);
    sandbox.write("data/mnist/t10k-labels-idx1-ubyte", [0u8, 0, 8, 1, 0, 0, 0, 1, 5]);
    let said = sandbox.run("data info mnist").ended(3, &["error: train: ", "train-images-idx3-ubyte"]);
    assert!(said.out.contains("test: 1 image"), "{said:?}");
    assert!(!said.err.contains("warning"), "{said:?}");
    for file in ["train-images-idx3-ubyte", "train-labels-idx1-ubyte"] {
        std::fs::remove_file(sandbox.path("data/mnist").join(file)).unwrap();
    }
    sandbox.run("data info mnist").ended(0, &["warning: train: "]);
}

#[test]
fn every_image_is_shown_if_all_are_asked_for() {
    let sandbox = Sandbox::tiny();
    let mut labels = vec![0_u8, 0, 0, 1, 1, 0, 7, 1];
    let header = |magic: u8, sizes: &[u32]| {
        let mut bytes = vec![0, 0, 8, magic];
        sizes.iter().for_each(|size| bytes.extend(size.to_be_bytes()));
        bytes
    };
    for split in ["train", "t10k"] {
        let count = labels.len() as u32;
        let pixels: Vec<u8> = (0..count * 64).map(|place| (place * 37 % 251) as u8).collect();
        let images = [header(3, &[count, 8, 8]), pixels].concat();
        sandbox.write(&format!("own/{split}-images-idx3-ubyte"), images);
        sandbox
            .write(&format!("own/{split}-labels-idx1-ubyte"), [header(1, &[count]), labels.clone()].concat());
        labels.push(0);
    }
    let set = "--set data.dataset=own --set data.train_images=[0,3]";
    sandbox.run(&format!("evolve -q -c tiny.toml {set} --data own -o run")).ended(0, &[]);
    sandbox.run("eval -q -a run --data own --images all --cycles 1 --robots top:1").ended(0, &[]);
    let eval: serde_json::Value = serde_json::from_str(&sandbox.read("run/eval.json")).unwrap();
    let shown: Vec<u64> =
        eval["images"].as_array().unwrap().iter().map(|image| image["index"].as_u64().unwrap()).collect();
    // Class after class; no sevens, which the run does not know.
    assert_eq!(shown, [0, 1, 2, 5, 8, 3, 4, 7]);
    // A report's commands ask for the same.
    sandbox.run("report -q run --rollouts 0 --data own").ended(0, &[]);
    assert!(sandbox.read("run/report.html").contains("--images all"));
    sandbox.run("team -q -a run --data own --classes 0,1 --images all -o team.json").ended(0, &[]);
    let team: serde_json::Value = serde_json::from_str(&sandbox.read("team.json")).unwrap();
    assert_eq!(team["images"].as_array().unwrap().len(), 8);
    sandbox
        .run("eval -q -a run --data own --images most")
        .ended(2, &["--images", "expected all, or a number"]);
}

#[test]
fn what_contradicts_itself_or_asks_for_too_much_is_refused() {
    let sandbox = Sandbox::new();
    sandbox.run("-q data info --json").ended(2, &["--quiet", "--json"]);
    sandbox.run("data info -q --json").ended(2, &["--quiet", "--json"]);
    let mut command = sandbox.command(["data", "info"]);
    command.env("RAYON_NUM_THREADS", "100000");
    said(command).ended(2, &["RAYON_NUM_THREADS = 100000", "at most 1024"]);
}

#[test]
fn data_info_and_sheet_work_on_the_built_in_digits() {
    let sandbox = Sandbox::new();
    let info = sandbox.run("data info").ended(0, &[]).out;
    assert!(info.contains("10000 images of 28 × 28") && info.contains("5000 images"), "{info}");
    sandbox.run("data sheet -o made.png --samples 2 --test").ended(0, &[]);
    assert!(std::fs::read(sandbox.path("made.png")).unwrap().starts_with(b"\x89PNG"));
    sandbox.run("data sheet -o none.png --samples 0").ended(2, &["--samples"]);
    assert!(!sandbox.path("none.png").exists());
}

// ---- simulate ----

/// A reference rollout as a scenario file, as it is, results and all.
fn scenario(sandbox: &Sandbox, name: &str) -> Reference {
    let text: serde_json::Value = golden(name);
    sandbox.write("scenario.json", serde_json::to_string(&text).unwrap());
    golden(name)
}

/// Reads a trajectory; numbers must name the f64 they were.
fn rows(csv: &str) -> Vec<[f64; 2]> {
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("step,com_x,com_y"));
    let row = |(number, line): (usize, &str)| {
        let fields: Vec<&str> = line.split(',').collect();
        assert_eq!((fields.len(), fields[0]), (3, number.to_string().as_str()), "{line}");
        let digits = |text: &str| text.chars().filter(char::is_ascii_digit).count();
        assert!(fields[1..].iter().all(|text| digits(text) >= 17), "{line}");
        [fields[1], fields[2]].map(|text| text.parse().unwrap())
    };
    lines.enumerate().map(row).collect()
}

fn agree(ours: &[[f64; 2]], theirs: &[[f64; 2]]) {
    assert_eq!(ours.len(), theirs.len());
    for (a, b) in ours.iter().zip(theirs) {
        assert!((a[0] - b[0]).abs() < 1e-7 && (a[1] - b[1]).abs() < 1e-7, "{a:?} and {b:?}");
    }
}

#[test]
fn simulate_agrees_with_a_reference_trajectory() {
    let sandbox = Sandbox::new();
    let rollout = scenario(&sandbox, "disc_5x5_00");
    let printed = sandbox.run("simulate scenario.json").ended(0, &[]);
    assert!(printed.err.is_empty(), "{}", printed.err);
    agree(&rows(&printed.out), &rollout.com);
    let written = sandbox.run("simulate scenario.json --out traj.csv").ended(0, &[]);
    assert!(written.out.is_empty());
    assert_eq!(sandbox.read("traj.csv"), printed.out);
}

#[test]
fn simulate_reads_standard_input_and_writes_every_point_and_pixel() {
    let sandbox = Sandbox::new();
    let scenario = "{\"body\": [[3, 6], [4, 0]], \"stimuli\": [[[0, 0.5], [0, 0]], [[1, 1], [1, 1]]], \
     \"switch_every\": 3}";
    let mut command = sandbox.command(["simulate", "-", "--points"]);
    command.write_stdin(scenario);
    let said = common::program::said(command).ended(0, &[]);
    let table: Vec<Vec<&str>> = said.out.lines().map(|line| line.split(',').collect()).collect();
    let names = "step,com_x,com_y,x_0,y_0,x_1,y_1,x_2,y_2,x_3,y_3,x_4,y_4,x_5,y_5,x_6,y_6,x_7,y_7,\
                 pixel_0_0,pixel_0_1,pixel_1_0,pixel_1_1";
    assert_eq!((table[0].join(",").as_str(), table.len()), (names, 8));
    for row in &table[1..] {
        let numbers: Vec<f64> = row.iter().map(|text| text.parse().unwrap()).collect();
        let mean = |axis: usize| (0..8).map(|point| numbers[3 + 2 * point + axis]).sum::<f64>() / 8.0;
        assert!((mean(0) - numbers[1]).abs() < 1e-9 && (mean(1) - numbers[2]).abs() < 1e-9, "{row:?}");
    }
    let pixels: Vec<String> = table[1..].iter().map(|row| row[19..].join(" ")).collect();
    assert_eq!(pixels, ["0 0 0 0", "0 0.5 0 0", "0 0.5 0 0", "0 0.5 0 0", "1 1 1 1", "1 1 1 1", "1 1 1 1"]);
    // The centre is the same without them.
    sandbox.write("s.json", scenario);
    let plain = sandbox.run("simulate s.json").ended(0, &[]).out;
    let centres = table.iter().map(|row| row[..3].join(",") + "\n").collect::<String>();
    assert_eq!(plain, centres);
    let mut command = sandbox.command(["simulate", "-"]);
    command.write_stdin("{\"body\": [[9]]}");
    common::program::said(command).ended(3, &["standard input", "body"]);
}

#[test]
fn an_unstable_rollout_ends_with_4_after_its_rows_and_says_when() {
    let sandbox = Sandbox::new();
    let rollout = scenario(&sandbox, "unstable_comb");
    let said = sandbox.run("simulate scenario.json").ended(4, &[]);
    agree(&rows(&said.out), &rollout.com);
    let last = said.err.lines().last().unwrap();
    assert!(last.contains("unstable in control step 70"), "{last}");
    sandbox.run("simulate scenario.json -o traj.csv").ended(4, &["control step 70"]);
    assert_eq!(sandbox.read("traj.csv"), said.out);
}

#[test]
fn contacts_without_offset_or_stiffness_blow_nothing_up() {
    let sandbox = Sandbox::new();
    for physics in
        ["\"contact_offset\": 0", "\"contact_stiffness\": 0", "\"contact_damping\": 0, \"friction\": 0"]
    {
        let body = "[[3, 3, 6], [4, 2, 5]]";
        sandbox.write(
            "s.json",
            format!("{{\"body\": {body}, \"control_steps\": 3, \"physics\": {{{physics}}}}}"),
        );
        sandbox.run("simulate s.json").ended(0, &[]);
    }
}

#[test]
fn simulate_switches_stimuli_and_resets_when_asked() {
    let sandbox = Sandbox::new();
    let run = |text: &str| {
        sandbox.write("s.json", text);
        rows(&sandbox.run("simulate s.json").ended(0, &[]).out)
    };
    let body = r#""body": [[6, 4, 5], [3, 0, 3]]"#;
    let [a, b] = ["[[1, 0, 0.5], [0, 0, 0]]", "[[0, 1, 1], [0, 0, 0]]"];
    let alone = |stimulus: &str| run(&format!("{{{body}, \"stimulus\": {stimulus}, \"control_steps\": 9}}"));
    let fresh =
        run(&format!("{{{body}, \"stimuli\": [{a}, {b}], \"switch_every\": 9, \"reset_between\": true}}"));
    let (first, second) = (alone(a), alone(b));
    assert_eq!((fresh.len(), &fresh[..10], &fresh[10..]), (19, &first[..], &second[1..]));
    let continuous = run(&format!("{{{body}, \"stimuli\": [{a}, {b}], \"switch_every\": 9}}"));
    assert_eq!(continuous[..10], first[..]);
    assert_ne!(continuous[10..], fresh[10..]);
    let moved = run(&format!("{{{body}, \"stimulus\": {a}, \"control_steps\": 9, \"start_column\": 499}}"));
    assert!(
        (moved[9][0] - first[9][0] - 0.6).abs() < 1e-9,
        "start_column is a voxel's tenth of a world unit"
    );
}

#[test]
fn a_wrong_scenario_is_refused_with_file_line_and_key() {
    let sandbox = Sandbox::new();
    for (text, word) in [
        ("", "s.json"),
        ("{\n\"body\": [[3]],\n\"bodi\": 1}", "s.json:3"),
        ("{\"body\": [[3], [3, 3]]}", "row 1"),
        ("{\"body\": []}", "body"),
        ("{\"body\": [[7]]}", "body"),
        ("{\"body\": [[-1]]}", "body"),
        ("{\"body\": [[3.5]]}", "body"),
        ("{\"body\": [[0]]}", "body"),
        ("{\"body\": [[3]], \"stimulus\": [[1e999]]}", "stimulus"),
        ("{\"body\": [[3]], \"stimulus\": [[-0.1]]}", "stimulus"),
        ("{\"body\": [[3]], \"stimulus\": [[null]]}", "stimulus"),
        ("{\"body\": [[3]], \"stimulus\": [[1, 1]]}", "stimulus"),
        ("{\"body\": [[3]], \"stimuli\": []}", "stimuli"),
        ("{\"body\": [[3]], \"stimuli\": [[[1]]], \"switch_every\": 0}", "switch_every"),
        ("{\"body\": [[3]], \"stimuli\": [[[1]]], \"stimulus\": [[1]], \"switch_every\": 1}", "stimuli"),
        ("{\"body\": [[3]], \"switch_every\": 3}", "switch_every"),
        ("{\"body\": [[3]], \"reset_between\": true}", "reset_between"),
        ("{\"body\": [[3]], \"physics\": {\"servo_gain\": 0}}", "servo_gain"),
        ("{\"body\": [[3]], \"control_steps\": -3}", "control_steps"),
        ("{\"body\": [[3]], \"control_steps\": 1e3}", "control_steps"),
        ("{\"body\": [[3]], \"start_column\": 9223372036854775807}", "start_column"),
        ("{\"body\": [[3]], \"start_column\": -9223372036854775808}", "start_column"),
        ("{\"body\": [[3]], \"start_row\": 1}", "start_row"),
        ("{\"body\": [[3]], \"start_row\": -1}", "start_row"),
        ("{\"body\": [[3]], \"physics\": {\"gravity\": \"x\"}}", "physics.gravity"),
        ("{\"body\": [[3]], \"physics\": {\"mass\": 0}}", "physics.mass"),
        ("{\"body\": [[3]], \"physics\": {\"peg_spacing\": 0}}", "physics.peg_spacing"),
    ] {
        sandbox.write("s.json", text);
        let said = sandbox.run("simulate s.json").ended(3, &["s.json", word]);
        assert!(said.out.is_empty(), "{text}");
    }
    sandbox.run("simulate nowhere.json").ended(3, &["nowhere.json"]);
    let huge = vec![vec![1; 65]; 65];
    sandbox.write("s.json", format!("{{\"body\": {huge:?}}}"));
    sandbox.run("simulate s.json").ended(3, &["65", "64"]);
}

// ---- archives and robots ----

/// A sandbox with two finished runs, `a` and `b`, that have few validation images.
fn with_two_runs() -> Sandbox {
    let sandbox = Sandbox::tiny();
    for (run, seed) in [("a", 3), ("b", 4)] {
        let evolve = format!("evolve -q -c tiny.toml -o {run} --seed {seed} --set validation.images=40");
        sandbox.run(&evolve).ended(0, &[]);
    }
    sandbox
}

#[test]
fn several_archives_are_named_in_the_same_way_by_every_command() {
    let sandbox = with_two_runs();
    let commands = [
        "eval -q -n 4 --cycles 1 --robots top:1",
        "audit -q --robots top:1",
        "plot -q archive",
        "plot -q progress",
        "plot -q body",
        "report -q --rollouts 0",
    ];
    for command in commands {
        for archives in ["--archive a b", "--archive a/run.json --archive b", "-a a -a b/run.json"] {
            sandbox.run(&format!("{command} {archives}")).ended(0, &[]);
        }
        sandbox.run(&format!("{command} -a a b a/run.json")).ended(2, &["expected different runs"]);
        sandbox.run(&format!("{command} -a a none")).ended(3, &["none"]);
    }
    let words = |command: &str| {
        let help = sandbox.run(&format!("{command} --help")).ended(0, &[]).out;
        let (_, words) =
            help.split_once("--archive <FILE>...").unwrap_or_else(|| panic!("{command}: {help}"));
        let words: Vec<&str> =
            words.split("under runs/)").next().unwrap_or_default().split_whitespace().collect();
        words.join(" ")
    };
    assert!(words("eval").contains("several may follow"));
    for command in ["audit", "plot", "report", "serve"] {
        assert_eq!(words(command), words("eval"), "{command}");
    }
}

#[test]
fn robots_are_selected_in_the_same_words_by_every_command() {
    let sandbox = with_two_runs();
    let run = sandbox.run_file("a");
    let [first, second] = [0, 1].map(|place| run.elites[place].id.as_str());
    let commands = ["eval -q -n 4 --cycles 1", "audit -q", "plot -q body"];
    for command in commands {
        for robots in ["best", first, &format!("{first},{second}"), "top:1", "random:2", "best-validation:1"]
        {
            for word in ["--robots", "--robot", "--select"] {
                sandbox.run(&format!("{command} -a a {word} {robots}")).ended(0, &[]);
            }
        }
        sandbox.run(&format!("{command} -a a --robots {first} --robots {second}")).ended(0, &[]);
        sandbox
            .run(&format!("{command} -a a --robots best --robots top:1"))
            .ended(2, &["expected one selection"]);
    }
    for command in commands.iter().chain(&["replay", "response"]) {
        sandbox.run(&format!("{command} -a a --robots worst:3")).ended(2, &["expected all, top:N, random:N"]);
        sandbox.run(&format!("{command} -a a --robots top:0")).ended(2, &["a number from 1 after the colon"]);
        sandbox.run(&format!("{command} -a a --robots zzz")).ended(3, &["there is no robot zzz"]);
    }
    // A figure each.
    sandbox.run("plot body -a a --robots all").ended(0, &[]);
    assert!(run.elites.iter().all(|robot| sandbox.path(&format!("a/plot-body-{}.svg", robot.id)).exists()));
    sandbox.run("plot body --robots gallery").ended(0, &[]);
    assert!(["APUKI", "YJTLA"].iter().all(|name| sandbox.path(&format!("plot-body-{name}.svg")).exists()));
    // Of several archives together.
    let best = ["a", "b"].map(|run| sandbox.run_file(run).best().unwrap().clone());
    let fittest = if best[1].objective > best[0].objective { &best[1] } else { &best[0] };
    let said = sandbox.run("plot body -a a b --robots top:1").ended(0, &[]);
    assert_eq!(said.out.matches("wrote").count(), 2, "{}", said.out);
    assert!(said.out.contains(&fittest.id), "{}", said.out);
}

#[test]
fn a_command_that_shows_one_robot_says_what_to_do_where_several_are_selected() {
    let sandbox = with_two_runs();
    let run = sandbox.run_file("a");
    for one in ["best", "top:1", "random:1", "best-validation:1", &run.elites[0].id] {
        sandbox.run(&format!("replay -a a --robot {one} -o walk.png")).ended(0, &[]);
    }
    let [first, second] = [0, 1].map(|place| run.elites[place].id.as_str());
    for many in ["all", "top:2", "random:2", "best-validation:2", &format!("{first},{second}")] {
        let said = sandbox.run(&format!("replay -a a --robot {many} -o many.png"));
        said.ended(2, &["--robot: expected one robot", "hint: name one, as in --robot ", "morphcog plot"]);
    }
    let said = sandbox.run("replay --robot gallery --dataset builtin -o many.png");
    said.ended(2, &["expected one robot", "5 (APUKI", "--robot APUKI"]);
    assert!(!sandbox.path("many.png").exists());
}

// ---- robots ----

#[test]
fn robots_are_found_by_unique_beginnings_of_their_ids_only() {
    let sandbox = with_run();
    let run = sandbox.run_file("run");
    let ids: Vec<&str> = run.elites.iter().map(|robot| robot.id.as_str()).collect();
    let id = ids[0];
    let unique = (1..=id.len())
        .map(|len| &id[..len])
        .find(|begin| ids.iter().filter(|other| other.starts_with(*begin)).count() == 1)
        .unwrap();
    let replay = |robot: &str| sandbox.run(&format!("replay -a run/run.json --robot {robot} -o out.png"));
    for known in [id, unique, &id.to_uppercase(), "best"] {
        replay(known).ended(0, &[]);
    }
    replay("zzz").ended(3, &["zzz", "hint:"]);
    let eval = |robots: &str| sandbox.run(&format!("eval -a run/run.json -n 2 --cycles 1 --robots {robots}"));
    assert!(eval(unique).ended(0, &[]).out.contains(id));
    eval(&format!("{unique},zzz")).ended(3, &["zzz"]);
    // With more than sixteen robots two ids must begin alike.
    let twice = ids.iter().find_map(|id| {
        let begin = &id[..1];
        (ids.iter().filter(|other| other.starts_with(begin)).count() > 1).then_some(begin)
    });
    if let Some(begin) = twice {
        eval(begin).ended(3, &["begin with", "hint:", "more digits"]);
    }
}

#[test]
fn robots_drawn_at_random_depend_on_the_seed_and_are_different_ones() {
    let sandbox = with_run();
    let drawn = |seed: u32, count: usize| -> Vec<String> {
        let eval = format!("eval -q -a run/run.json -n 2 --cycles 1 --robots random:{count} --seed {seed}");
        sandbox.run(&eval).ended(0, &[]);
        let report: EvalFile = serde_json::from_str(&sandbox.read("run/eval.json")).unwrap();
        report.robots.into_iter().map(|robot| robot.id).collect()
    };
    let all = sandbox.run_file("run").elites.len();
    assert_eq!(drawn(1, 3), drawn(1, 3));
    assert!((2..8).any(|seed| drawn(seed, 3) != drawn(1, 3)));
    let mut everyone = drawn(1, all + 5);
    everyone.sort();
    everyone.dedup();
    assert_eq!(everyone.len(), all);
}

#[test]
fn a_broken_run_json_is_refused_saying_how() {
    let sandbox = with_run();
    let whole = sandbox.read("run/run.json");
    let replaced = |from: &str, to: &str| {
        assert!(whole.contains(from), "{from}");
        whole.replacen(from, to, 1)
    };
    let edge = whole.find("\"edges\":[[").unwrap() + "\"edges\":[".len();
    let cyclic = format!("{}[4,4,1.0],{}", &whole[..edge], &whole[edge..]);
    let elite = whole.lines().nth(1).unwrap();
    let id = &sandbox.run_file("run").elites[0].id;
    for (content, word) in [
        (String::new(), "run.json"),
        (whole[..whole.len() / 2].to_string(), "run.json:"),
        ("{\"a\": 1}".to_string(), "not morphcog's run.json"),
        ("[1, 2]".to_string(), "run.json"),
        (replaced("\"format_version\":1", "\"format_version\":2"), "format_version"),
        (replaced("\"format\":\"morphcog-run\"", "\"format\":\"other\""), "not morphcog's run.json"),
        (cyclic, "elites[0].genome"),
        (replaced("\"elites\":[", &format!("\"elites\":[\n{},", elite.trim_end_matches(','))), "elite"),
        (replaced("\"displacements\":[", "\"displacements\":[1.0,"), "displacement"),
        (replaced("\"cell\":[", "\"cell\":[999,"), "cell"),
        (replaced("\"gravity\":110.0", "\"gravity\":null"), "config.physics.gravity"),
        (replaced("\"body\":[[", "\"body\":[[9],["), "body"),
        (replaced(&format!("\"id\":\"{id}\""), "\"id\":\"../../x\""), "its id"),
        (replaced("\"voxels\":{\"muscle\":", "\"voxels\":{\"muscle\":1"), "voxel counts"),
        (replaced("\"task\":\"0|1\"", "\"task\":\"0|2\""), "task"),
        (replaced("\"label\":0", "\"label\":7"), "training_images"),
        (replaced("\"possible_cells\":", "\"possible_cells\":1"), "dimensions"),
    ] {
        sandbox.write("bad/run.json", &content);
        for command in ["eval -n 2 --cycles 1 -a bad/run.json", "replay -a bad/run.json"] {
            let said = sandbox.run(command).ended(3, &["bad/run.json"]);
            assert!(said.err.contains(word), "expected {word:?} in {}", said.err);
        }
    }
    assert_eq!(files(&sandbox.path("bad")).len(), 1, "nothing was written");
}

// ---- eval ----

#[test]
fn an_evaluation_adds_up() {
    let sandbox = with_run();
    let said = sandbox
        .run("eval -a run/run.json --images 31 --cycles 1 --threshold 0.05 --robots all")
        .ended(0, &[]);
    let report: EvalFile = serde_json::from_str(&sandbox.read("run/eval.json")).unwrap();
    let run = sandbox.run_file("run");
    assert_eq!((report.images.len(), report.robots.len(), report.stopped), (31, run.elites.len(), false));
    assert_eq!(report.control_steps, 50);
    let of = |class: u8| report.images.iter().filter(|image| image.label == class).count();
    assert_eq!((of(0), of(1)), (16, 15));
    for robot in &report.robots {
        assert_eq!((robot.images, robot.displacements.len()), (31, 31));
        assert_eq!(robot.accuracy, robot.right as f64 / 31.0);
        let [low, high] = robot.interval;
        assert!(low <= robot.accuracy && robot.accuracy <= high && low >= 0.0 && high <= 1.0);
        assert_eq!(robot.balanced_accuracy, (robot.per_class[&0] + robot.per_class[&1]) / 2.0);
        let zero_walks = if robot.first_group_walks == "right" { 1.0 } else { -1.0 };
        let right = |(image, d): (&morphcog::store::images::ImageRef, &Option<f64>)| {
            let towards = if image.label == 0 { zero_walks } else { -zero_walks };
            d.is_some_and(|d| d * towards > 0.05)
        };
        assert_eq!(
            report.images.iter().zip(&robot.displacements).filter(|pair| right(*pair)).count(),
            robot.right
        );
        let still = robot.displacements.iter().flatten().filter(|d| d.abs() <= 0.05).count();
        assert_eq!(robot.not_moved, still as f64 / 31.0);
        assert_eq!(robot.unstable, robot.displacements.iter().filter(|d| d.is_none()).count());
        assert!((1..=31).contains(&robot.simulated));
        assert!(said.out.contains(&robot.id));
    }
    let [mean, baselines] = [report.means.len(), report.baselines.len()];
    assert_eq!((mean, baselines), (1, 1));
    let mean = report.robots.iter().map(|robot| robot.accuracy).sum::<f64>() / report.robots.len() as f64;
    assert!((report.means["0|1"].accuracy - mean).abs() < 1e-12);
    let baselines = &report.baselines["0|1"];
    assert_eq!(baselines.larger_group, 16.0 / 31.0);
    assert!(
        baselines.best_single_pixel > 0.5 && baselines.nearest_training_image > Some(0.5),
        "{baselines:?}"
    );

    let text = sandbox.read("run/eval.csv");
    let mut csv = csv::Reader::from_reader(text.as_bytes());
    let lines: Vec<BTreeMap<String, String>> = csv.deserialize().map(Result::unwrap).collect();
    assert_eq!(lines.len(), report.robots.len());
    for (line, robot) in lines.iter().zip(&report.robots) {
        assert_eq!(line["id"], robot.id);
        assert_eq!(line["accuracy"].parse::<f64>().unwrap(), robot.accuracy);
        assert_eq!(line["accuracy_1"].parse::<f64>().unwrap(), robot.per_class[&1]);
        assert_eq!(line["simulated"], robot.simulated.to_string());
    }
}

#[test]
fn held_out_images_are_the_same_for_the_same_seed_and_others_for_another() {
    let sandbox = with_run();
    let images = |seed: u32| {
        sandbox
            .run(&format!("eval -q -a run/run.json -n 10 --cycles 1 --robots best --seed {seed}"))
            .ended(0, &[]);
        let report: EvalFile = serde_json::from_str(&sandbox.read("run/eval.json")).unwrap();
        report.images
    };
    assert_eq!(images(1), images(1));
    assert_ne!(images(1), images(2));
}

#[test]
fn too_many_images_are_refused_saying_how_many_there_are() {
    let sandbox = with_run();
    sandbox.run("eval -a run/run.json --images 1002").ended(3, &["500", "hint:", "at most 1000 images"]);
    assert!(!sandbox.path("run/eval.json").exists());
}

#[test]
fn the_results_of_an_evaluation_never_overwrite_each_other_or_the_run() {
    let sandbox = with_run();
    let before = files(&sandbox.path("run"));
    for out in ["results.csv", "run/run.json", "run/../run/run.json", "run/elites.json", "run/metrics.json"] {
        sandbox.run(&format!("eval -a run/run.json -n 2 --cycles 1 --robots best -o {out}")).ended(2, &[out]);
        assert_eq!(files(&sandbox.path("run")), before, "{out}");
        assert!(!sandbox.path("results.csv").exists());
    }
}

#[test]
fn the_results_of_one_command_never_overwrite_those_of_another() {
    let sandbox = with_run();
    for name in ["audit", "validation", "capacity", "eval-validation"] {
        sandbox.write(&format!("run/{name}.json"), "kept");
        // Nor by the CSV.
        for ending in ["json", "txt"] {
            let out = format!("run/{name}.{ending}");
            let eval = format!("eval -a run/run.json -n 2 --cycles 1 --robots best -o {out}");
            sandbox.run(&eval).ended(2, &[&out, &format!("{name}.json")]);
        }
        assert_eq!(sandbox.read(&format!("run/{name}.json")), "kept");
    }
    sandbox.run("audit -a run/run.json -o run/eval.json").ended(2, &["run/eval.json"]);
    let trainings = "run/capacity.trainings.json";
    sandbox.run(&format!("eval -a run/run.json -n 2 --cycles 1 -o {trainings}")).ended(2, &[trainings]);
    // Elsewhere, and under its own name, it may.
    for out in ["audit.json", "run/eval.json", "run/mine.json"] {
        sandbox.run(&format!("eval -q -a run/run.json -n 2 --cycles 1 --robots best -o {out}")).ended(0, &[]);
    }
}

#[test]
fn without_a_run_the_best_body_of_the_program_is_shown_on_its_own_digits() {
    let sandbox = Sandbox::new();
    let said = sandbox.run("replay --format gif").ended(0, &[]);
    assert!(said.out.contains("gallery:zero_one"), "{}", said.out);
    // A zero and a one.
    for seen in [": sees 0", ": sees 1"] {
        assert_eq!(said.out.matches(seen).count(), 1, "{}", said.out);
    }
    let made = files(&sandbox.path("."));
    assert!(
        made.keys().any(|name| name.starts_with("replay-") && name.ends_with(".gif")),
        "{:?}",
        made.keys()
    );
    // What is asked for by name is not replaced.
    let said = sandbox.run("replay --dataset mnist --format gif").ended(3, &[]);
    assert!(said.err.contains("mnist"), "{}", said.err);
}

#[test]
fn a_run_may_be_named_by_its_folder() {
    let sandbox = with_run();
    for command in [
        "eval -q -a run -n 2 --cycles 1 --robots best",
        "audit -q -a run --robots top:1",
        "replay -q -a run --format gif",
        "plot accuracy -q -a run -o accuracy.svg",
        "report -q run --rollouts 0",
    ] {
        sandbox.run(command).ended(0, &[]);
    }
    let made = files(&sandbox.path("run"));
    for name in ["eval.json", "audit.json", "report.html"] {
        assert!(made.contains_key(name), "{name}: {:?}", made.keys());
    }
}

#[test]
fn an_evaluation_that_cannot_be_written_fails_before_its_first_rollout() {
    let sandbox = with_run();
    sandbox.write("file", "in the way");
    let said =
        sandbox.run("eval -a run/run.json -n 2 --cycles 1 -o file/eval.json").ended(1, &["file/eval.json"]);
    assert!(!said.err.contains("evaluating"), "{}", said.err);
}

#[test]
fn what_an_evaluation_is_asked_for_must_make_sense() {
    let sandbox = with_run();
    for wrong in ["--threshold nan", "--threshold=-1", "--threshold inf", "--images 1"] {
        sandbox.run(&format!("eval -a run/run.json --cycles 1 {wrong}")).ended(2, &[&wrong[..8]]);
    }
    sandbox
        .run("eval -a nowhere/run.json")
        .ended(3, &["nowhere/run.json", "hint: expected a run.json, its folder"]);
    std::fs::create_dir(sandbox.path("empty")).unwrap();
    sandbox.run("eval -a empty").ended(3, &["empty/run.json"]);
    // The same robots twice would count twice.
    sandbox.write("copy.json", sandbox.read("run/run.json"));
    sandbox
        .run("eval -a run/run.json copy.json --cycles 1")
        .ended(2, &["run/run.json", "copy.json", "different"]);
    Sandbox::new().run("eval").ended(3, &["runs/", "hint:", "--archive"]);
}

// ---- replay, gallery ----

#[test]
fn replay_writes_a_gif_and_a_page_beside_the_run() {
    let sandbox = with_run();
    let said = sandbox.run("replay --robot best -a run/run.json").ended(0, &[]);
    let id = &sandbox
        .run_file("run")
        .elites
        .iter()
        .max_by(|a, b| a.objective.total_cmp(&b.objective))
        .unwrap()
        .id
        .clone();
    let gif = std::fs::read(sandbox.path(&format!("run/replay-{id}.gif"))).unwrap();
    assert!(gif.starts_with(b"GIF89a") && gif.ends_with(b";"));
    let page = sandbox.read(&format!("run/replay-{id}.html"));
    assert!(page.contains("<canvas") && page.contains(id));
    assert!(!page.contains("http://") && !page.contains("https://"), "it must work without a network");
    assert!(
        said.out.contains(&format!("replay-{id}.gif")) && said.out.contains("0 (train 0)"),
        "{}",
        said.out
    );
}

#[test]
fn replay_shows_the_images_and_formats_it_is_asked_for() {
    let sandbox = with_run();
    let said = sandbox.run("replay -a run/run.json -i test:17,3 -o here.png --width 400").ended(0, &[]);
    assert!(said.out.contains("7 (test 17)") && said.out.contains("3 (train 3)"), "{}", said.out);
    assert!(std::fs::read(sandbox.path("here.png")).unwrap().starts_with(b"\x89PNG"));
    let view = sandbox.run("replay -a run/run.json --format terminal").ended(0, &[]);
    assert!(view.out.lines().count() > 10 && !view.out.contains('\x1b'), "{}", view.out);
    sandbox.run("replay -a run/run.json -i test:99999999").ended(2, &["--images", "99999999"]);
    // A folder of the name that the pictures have but for their endings is no hindrance.
    std::fs::create_dir(sandbox.path("walk")).unwrap();
    sandbox.run("replay -a run/run.json -o walk --format png").ended(0, &[]);
    sandbox.run("plot body -a run/run.json -o walk").ended(0, &[]);
    assert!(sandbox.path("walk.png").exists() && sandbox.path("walk.svg").exists());
    sandbox.run("replay -a run/run.json -o nowhere/walk.gif").ended(1, &["nowhere/walk.gif"]);
    sandbox.run("replay -a run/run.json -o walk.avi").ended(2, &["walk.avi", ".gif"]);
    for width in ["0", "1", "4294967295"] {
        sandbox.run(&format!("replay -a run/run.json -o walk.gif --width {width}")).ended(2, &["--width"]);
    }
    let many = vec!["1"; 21].join(",");
    sandbox.run(&format!("replay -a run/run.json -i {many}")).ended(2, &["--images", "20"]);
}

#[test]
fn a_published_robot_replays_on_the_built_in_digits_without_any_run() {
    let sandbox = Sandbox::new();
    let table = sandbox.run("gallery").ended(0, &[]).out;
    assert!(["APUKI", "IHSUJ", "QMAXD", "XFJPI", "YJTLA"].iter().all(|name| table.contains(name)), "{table}");
    sandbox.run("replay --robot xfjpi --dataset builtin").ended(0, &[]);
    assert!(sandbox.path("replay-XFJPI.gif").exists() && sandbox.path("replay-XFJPI.html").exists());
    sandbox.run("replay --robot XFJPI").ended(3, &["mnist", "hint:", "--dataset builtin"]);
    sandbox.run("replay --robot nobody").ended(3, &["runs/"]);
}

#[test]
fn the_newest_run_is_what_commands_look_at_when_they_are_not_told() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -g 2").ended(0, &[]);
    assert!(sandbox.path("runs/tiny-seed3/run.json").exists());
    sandbox.run("evolve -q -c tiny.toml -g 2 --seed 8").ended(0, &[]);
    assert!(sandbox.path("runs/tiny-seed8/run.json").exists());
    sandbox.run("eval -q -n 2 --cycles 1 --robots best").ended(0, &[]);
    assert!(sandbox.path("runs/tiny-seed8/eval.json").exists());
    sandbox.run("replay -q").ended(0, &[]);
    assert!(files(&sandbox.path("runs/tiny-seed8")).keys().any(|name| name.ends_with(".gif")));
}

#[test]
fn evolve_with_replay_leaves_the_pictures_in_the_run_folder() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -g 2 -o run --replay").ended(0, &[]);
    let names: Vec<String> = files(&sandbox.path("run")).into_keys().collect();
    assert!(
        names.iter().any(|name| name.ends_with(".gif")) && names.iter().any(|name| name.ends_with(".html"))
    );
}

// ---- where the words go ----

#[test]
fn no_table_shows_a_minus_nothing() {
    let sandbox = with_run();
    let mut run: serde_json::Value = serde_json::from_str(&sandbox.read("run/run.json")).unwrap();
    for elite in run["elites"].as_array_mut().unwrap() {
        elite["objective"] = (-0.001).into();
        elite["displacements"] = serde_json::json!([-0.001, 0.001]);
    }
    sandbox.write("run/run.json", run.to_string());
    let mut said = sandbox.run("eval -a run -n 4 --cycles 1 --robots top:2").ended(0, &[]).out;
    said += &sandbox.run("replay -a run --format html").ended(0, &[]).out;
    sandbox.run("report -q --archive run --rollouts 1").ended(0, &[]);
    sandbox.run("plot -q archive --archive run").ended(0, &[]);
    sandbox.run("plot -q body --archive run -o body.svg").ended(0, &[]);
    for file in ["run/report.html", "run/plot-archive.svg", "body.svg"] {
        said += &sandbox.read(file);
    }
    for nothing in
        ["-0.00<", "-0.00 ", "−0.00", "-0.0<", "-0.0 ", "-0.0]", "−0.0<", "−0.0 ", "+0.0<", "+0.0 "]
    {
        let at =
            said.find(nothing).map(|at| said[at.saturating_sub(60)..].chars().take(90).collect::<String>());
        assert_eq!(at, None, "{nothing:?}");
    }
}

#[test]
fn speed_is_measured_in_processor_time_and_says_so() {
    let sandbox = Sandbox::new();
    let said = sandbox.run("bench --json").ended(0, &[]);
    let clocks: Vec<_> = said.json_lines().iter().map(|line| line["clock"].clone()).collect();
    let expected = if cfg!(any(target_os = "linux", target_os = "macos")) { "processor" } else { "wall" };
    assert!(clocks.len() >= 5 && clocks.iter().all(|clock| clock == expected), "{clocks:?}");
    assert!(sandbox.run("bench --help").ended(0, &[]).out.contains("processor time"));
}

#[test]
fn quiet_leaves_results_only() {
    let sandbox = Sandbox::tiny();
    let said = sandbox.run("evolve --quiet -c tiny.toml -o run").ended(0, &[]);
    assert!(said.err.is_empty() && said.out.contains("cells filled"), "{said:?}");
    let said = sandbox.run("evolve -c tiny.toml -o loud").ended(0, &["evolving in", "generation"]);
    assert!(said.out.contains("cells filled"));
    let said = sandbox.run("eval -q -a run/run.json -n 2 --cycles 1").ended(0, &[]);
    assert!(said.err.is_empty() && said.out.contains("accuracy"));
}

#[test]
fn with_json_every_line_on_stdout_is_json() {
    let sandbox = with_run();
    let events = |args: &str, code: i32| -> Vec<String> {
        let lines = sandbox.run(&format!("--json {args}")).ended(code, &[]).json_lines();
        assert!(!lines.is_empty(), "{args}");
        lines.iter().map(|line| line["event"].as_str().unwrap().to_string()).collect()
    };
    let evolve = events("evolve -c tiny.toml -o new", 0);
    assert_eq!(evolve.iter().filter(|name| *name == "generation").count(), 13);
    assert_eq!(evolve.last().unwrap(), "finished");
    events("eval -a run/run.json -n 4 --cycles 1", 0);
    events("replay -a run/run.json", 0);
    events("replay -a run/run.json --format terminal", 0);
    events("gallery", 0);
    events("config", 0);
    events("data info", 0);
    events("data sheet -o sheet.png --samples 1", 0);
    assert_eq!(events("evolve -c tiny.toml -o run", 5), ["error"]);
    assert_eq!(events("eval -a nowhere.json", 3), ["error"]);
    assert_eq!(events("evolve -c tiny.toml -o x --set a=1", 2), ["error"]);
}

/// The rows of tables in the documentation, from a heading on: what the first cell names, and the
/// whole row.
fn documented(name: &str, heading: &str) -> Vec<(Vec<String>, String)> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap();
    let (_, text) = text.split_once(heading).unwrap();
    let row = |line: &str| {
        let line = line.replace("\\|", "¦");
        let first = line.strip_prefix("| ")?.split(" | ").next()?.replace('¦', "|");
        let names = first.split('`').skip(1).step_by(2).map(str::to_string).collect::<Vec<_>>();
        Some((names, line))
    };
    text.lines().filter_map(row).collect()
}

#[test]
fn every_event_of_json_is_documented_with_its_fields() {
    let rows = documented("docs/command-line.md", "### JSON");
    let row = |event: &str| {
        let found = rows.iter().find(|(names, _)| names.len() == 1 && names[0] == event);
        &found.unwrap_or_else(|| panic!("the event {event} is not documented")).1
    };
    // All that the source has.
    let mut open = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    let mut events = BTreeSet::new();
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(std::fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()));
            continue;
        }
        let Ok(source) = std::fs::read_to_string(&path) else { continue };
        let code = source.split("#[cfg(test)]").next().unwrap();
        for call in [".event(", ".finding("] {
            let names = code.split(call).skip(1).filter_map(|rest| rest.trim_start().strip_prefix('"'));
            events.extend(names.map(|name| name.split('"').next().unwrap().to_string()));
        }
    }
    assert!(events.len() > 20, "{events:?}");
    events.iter().for_each(|event| {
        row(event);
    });
    // Those of quick commands, as they come.
    let sandbox = with_run();
    sandbox.write("plan.toml", "config = \"tiny.toml\"\nseeds = [3]\n");
    let train = "train -a run --robots all --task 0|1 --out taught --set train.random_images=20 --set \
                 train.windows=4 --set stimulus.reduction=area --set train.rounds=1 --set train.images=4 --set \
                 train.final_images=4 --set train.challengers=1 --set protocol.control_steps=50 --set \
                 validation.images=40";
    let mut seen = BTreeSet::new();
    for args in [
        "evolve -c tiny.toml -o new",
        train,
        "train -a run --robots all --task 0|1 --out own --set train.rounds=0 --set train.random_images=20 \
         --set train.final_images=4 --set train.challengers=1 --set validation.images=40",
        "response -a taught --images 60",
        "eval -a run -n 20 --cycles 1",
        "capacity --eval run/eval.json --set trainings=2 --set sizes=[1,3]",
        "team -a run --classes 0,1 --images 20",
        "replay -a run --format png",
        "report run --rollouts 0",
        "data info",
        "data sheet",
        "gallery",
        "sweep plan.toml",
        "sweep plan.toml --status",
        "sweep plan.toml --collect",
        "eval -a nowhere.json",
    ] {
        let said = sandbox.run(&format!("{args} --json"));
        assert_eq!(said.code, Some(if args.contains("nowhere") { 3 } else { 0 }), "{said:#?}");
        for line in said.json_lines() {
            let event = line["event"].as_str().unwrap();
            for field in line.as_object().unwrap().keys().filter(|field| *field != "event") {
                assert!(row(event).contains(&format!("`{field}`")), "{args}: {event} has {field}");
            }
            seen.insert(event.to_string());
        }
    }
    // These take longer.
    events.retain(|event| !["speed", "reproduced"].contains(&event.as_str()));
    assert_eq!(seen, events);
}

#[test]
fn a_written_file_is_named_for_programs() {
    let sandbox = with_run();
    for (args, file) in
        [("report run --rollouts 0", "run/report.html"), ("data sheet -o sheet.png --samples 1", "sheet.png")]
    {
        let lines = sandbox.run(&format!("{args} --json")).ended(0, &[]).json_lines();
        let last = lines.last().unwrap();
        assert_eq!((&last["event"], &last["file"]), (&"result".into(), &file.into()), "{lines:?}");
        assert!(last["text"].as_str().unwrap().starts_with(&format!("wrote {file}")), "{last}");
    }
}

#[test]
fn every_column_of_a_test_and_of_an_audit_is_explained() {
    let sandbox = Sandbox::tiny();
    // Some of its robots are walkers.
    sandbox
        .run("evolve -q -c tiny.toml -o run --generations 40 --set protocol.control_steps=150")
        .ended(0, &[]);
    let rows = documented("docs/analysing.md", "## Test");
    let explained: Vec<&str> = rows.iter().flat_map(|(names, _)| names).map(String::as_str).collect();
    let explained = [explained, vec!["robot", "task", "change"]].concat();
    let mut columns = 0;
    for args in [
        "eval -a run -n 20 --cycles 1 --robots best-validation:1 --validation 40",
        "audit -a run --robots top:4 --set least_walk=0 --set threshold=0",
    ] {
        let said = sandbox.run(args).ended(0, &[]).out;
        let lines: Vec<&str> = said.lines().collect();
        // A header stands above a rule.
        for pair in lines.windows(2).filter(|pair| pair[1].starts_with("--")) {
            for column in pair[0].split("  ").map(str::trim).filter(|column| !column.is_empty()) {
                assert!(explained.contains(&column), "{column} is not explained");
                columns += 1;
            }
        }
    }
    assert_eq!(columns, 13 + 9 + 8 + 4);
}

#[test]
fn rows_of_a_collected_sweep_are_numbers_or_null_for_programs() {
    let sandbox = Sandbox::tiny();
    let plan = "config = \"tiny.toml\"\nseeds = [1, 2]\n[vary]\nmap_elites.parents = [4]\n[eval]\nrobots = \
                \"top:2\"\nimages = 20\n";
    sandbox.write("plan.toml", plan);
    sandbox.run("sweep plan.toml --out all -q --task 1").ended(0, &[]);
    let lines = sandbox.run("sweep plan.toml --out all --collect --json").ended(0, &["not all"]).json_lines();
    let rows: Vec<_> = lines.iter().filter(|line| line["event"] == "collected").collect();
    let [done, waiting] = rows.as_slice() else { panic!("{lines:?}") };
    let eval: EvalFile = serde_json::from_str(&sandbox.read("all/tiny-parents=4-seed1/eval.json")).unwrap();
    let mean = &eval.means["0|1"];
    assert_eq!((done["number"].as_u64(), done["state"].as_str()), (Some(1), Some("done")));
    assert_eq!((done["accuracy"].as_f64(), done["robots"].as_u64()), (Some(mean.accuracy), Some(2)));
    let ends = [&done["accuracy_low"], &done["accuracy_high"]].map(|end| end.as_f64());
    assert_eq!(ends, mean.interval.unwrap().map(Some));
    assert_eq!(done["varied"], serde_json::json!({ "map_elites.parents": 4, "seed": 1 }));
    assert_eq!((&waiting["state"], &waiting["accuracy"]), (&"waiting".into(), &serde_json::Value::Null));
    // The columns of the table.
    let table = sandbox.read("all/sweep.csv");
    let columns = table.lines().next().unwrap().split(',').filter(|column| !column.starts_with("varied_"));
    assert!(columns.clone().count() > 15);
    columns.for_each(|column| assert!(done.get(column).is_some(), "{column}"));
    // Nothing is empty, and every file is named.
    let results: Vec<_> = lines.iter().filter(|line| line["event"] == "result").collect();
    assert!(results.len() >= 3 && results.len() + rows.len() == lines.len(), "{lines:?}");
    assert_eq!(results[0]["file"], "all/sweep.csv");
    assert!(results.iter().all(|line| line["text"] != "" && line["file"].is_string()), "{results:?}");
}

#[test]
fn how_far_tasks_are_has_no_column_without_a_name() {
    let sandbox = Sandbox::tiny();
    sandbox.write("plan.toml", "config = \"tiny.toml\"\nseeds = [3]\n");
    let status = || sandbox.run("sweep plan.toml --out all --status").ended(0, &[]).out;
    let plain = status();
    assert!(plain.lines().next().unwrap().ends_with("  left"), "{plain}");
    assert!(plain.lines().all(|line| line.trim_end() == line), "{plain:?}");
    assert!(plain.ends_with("1 task: 1 waiting\n"), "one task is no tasks: {plain}");
    sandbox.run("sweep plan.toml --out all -q").ended(0, &[]);
    let path = "all/tiny-seed3/task.json";
    let mut task: serde_json::Value = serde_json::from_str(&sandbox.read(path)).unwrap();
    (task["state"], task["error"]) = ("failed".into(), "no room".into());
    sandbox.write(path, task.to_string());
    let failed = status();
    assert!(failed.lines().next().unwrap().ends_with("  about"), "{failed}");
    assert!(failed.contains("no room") && failed.ends_with("1 task: 1 failed\n"), "{failed}");
}

#[test]
fn away_from_a_terminal_there_are_no_escape_sequences_with_or_without_no_color() {
    let sandbox = with_run();
    for value in [None, Some("1"), Some("")] {
        for args in [
            "evolve -c tiny.toml -o run",
            "eval -a run/run.json -n 2 --cycles 1",
            "replay -a run/run.json --format terminal",
        ] {
            let mut command = sandbox.command(args.split(' '));
            value.map(|value| command.env("NO_COLOR", value));
            let said = said(command);
            assert!(!said.out.contains('\x1b') && !said.err.contains('\x1b'), "{said:?}");
        }
    }
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_error() {
    let sandbox = with_run();
    let rollout = scenario(&sandbox, "disc_5x5_00");
    assert_eq!(rollout.control_steps, 500);
    for args in [
        "simulate scenario.json",
        "config zero_one.toml",
        "completions bash",
        "man",
        "gallery",
        "evolve -c tiny.toml -o piped",
    ] {
        let mut child = sandbox.start(args);
        drop(child.stdout.take());
        let ended = child.wait_with_output().unwrap();
        let err = String::from_utf8_lossy(&ended.stderr);
        assert!(
            ended.status.success() && !err.contains("panicked") && !err.contains("error"),
            "{args}: {ended:?}"
        );
    }
    // Nobody waits for the rest of a rollout that would take minutes.
    let forever = r#"{"body": [[3]], "control_steps": 1000000}"#;
    sandbox.write("forever.json", forever);
    let mut child = sandbox.start("simulate forever.json");
    drop(child.stdout.take());
    assert!(child.wait().unwrap().success());
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_and_is_said() {
    let sandbox = with_run();
    scenario(&sandbox, "disc_5x5_00");
    for args in [
        "simulate scenario.json",
        "config zero_one.toml",
        "man",
        "completions zsh",
        "gallery",
        "--json gallery",
        "--help",
    ] {
        let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
        let mut command = std::process::Command::new(common::program::PROGRAM);
        let ended =
            command.current_dir(sandbox.path("")).args(args.split(' ')).stdout(full).output().unwrap();
        let err = String::from_utf8_lossy(&ended.stderr);
        assert!(
            !ended.status.success() && ended.status.code().is_some_and(|c| c != 101),
            "{args}: {ended:?}"
        );
        assert!(err.contains("No space left") && !err.contains("panicked"), "{args}: {err}");
    }
}

#[test]
fn where_nothing_can_be_written_it_says_where() {
    let sandbox = with_run();
    scenario(&sandbox, "disc_5x5_00");
    sandbox.write("file", "in the way");
    for args in [
        "evolve -c tiny.toml -o file",
        "evolve -c tiny.toml -o file/run",
        "replay -a run/run.json -o file/walk.gif",
        "replay -a run/run.json -o file/walk.html",
        "simulate scenario.json -o file/traj.csv",
        "simulate scenario.json -o run",
        "data sheet -o file/sheet.png",
        "replay -a run/run.json -o nowhere/walk.png",
    ] {
        let place = args.rsplit(' ').next().unwrap();
        sandbox.run(args).ended(1, &[place]);
    }
    assert_eq!(sandbox.read("file"), "in the way");
}

#[test]
fn an_instruction_set_that_is_not_there_is_an_error_that_names_those_that_are() {
    let sandbox = Sandbox::new();
    for (set, code) in [("avx1024", 2), ("", 0), ("baseline", 0)] {
        let mut command = sandbox.command(["gallery"]);
        command.env("MORPHCOG_ISA", set);
        let words: &[&str] = if code == 2 { &["MORPHCOG_ISA=avx1024", "baseline"] } else { &[] };
        said(command).ended(code, words);
    }
}

#[test]
fn robots_that_ship_with_the_program_are_named_where_archives_are() {
    let sandbox = Sandbox::new();
    sandbox.run("plot body -q -a gallery:zero_one-2 -o body.svg").ended(0, &[]);
    sandbox
        .run("replay -q -a gallery:zero_one --robot best --dataset builtin --images 0 -o walk.png")
        .ended(0, &[]);
    // Of a set, every run; results go to the present folder.
    sandbox
        .run("eval -q -a gallery:zero_one --dataset builtin --images 2 --cycles 1 --physical-only")
        .ended(0, &[]);
    let tested: serde_json::Value = serde_json::from_str(&sandbox.read("gallery-eval.json")).unwrap();
    let robots = tested["robots"].as_array().unwrap();
    assert!(robots.len() >= 2 && robots.iter().all(|robot| robot["task"] == "0|1"), "{robots:?}");
    sandbox.run("plot body -q -a gallery:zero_one-1 --robot best").ended(0, &[]);
    let id =
        &morphcog::analysis::gallery::trained(morphcog::base::shipped::ZERO_ONE).unwrap()[0].0.elites[0].id;
    assert!(sandbox.path(&format!("gallery-zero_one-1-plot-body-{id}.svg")).exists());
    let refused = sandbox.run("eval -a gallery:zero --images 2");
    refused.ended(2, &["gallery:zero", "expected gallery:all, gallery:zero_one, gallery:zero_one-1"]);
}

#[test]
fn runs_of_the_atlas_are_read_compressed_and_leave_their_results_here() {
    let sandbox = with_run();
    let compressed = |name: &str| {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        std::io::Write::write_all(&mut encoder, sandbox.read(name).as_bytes()).unwrap();
        encoder.finish().unwrap()
    };
    sandbox.run("audit -q -a run --robots best --set least_walk=0").ended(0, &[]);
    for file in ["run.json", "audit.json"] {
        sandbox.write(&format!("data/atlas/tiny-1/{file}.gz"), compressed(&format!("run/{file}")));
        sandbox.write(&format!("elsewhere/tiny-2/{file}.gz"), compressed(&format!("run/{file}")));
    }
    let results_of =
        |from: &str| (sandbox.read(&format!("{from}.json")), sandbox.read(&format!("{from}.csv")));
    sandbox.run("eval -q -a run --robots best --images 4").ended(0, &[]);
    sandbox.run("eval -q -a atlas:tiny-1 --robots best --images 4").ended(0, &[]);
    assert_eq!(results_of("run/eval").1, results_of("atlas-tiny-1-eval").1);
    sandbox.run("plot archive -q -a atlas:tiny").ended(0, &[]);
    sandbox.run("report -q -a atlas:tiny-1 -o report.html").ended(0, &[]);
    assert!(sandbox.read("report.html").contains("robots, 1 were audited"));

    // An audit goes on from the verdicts that came with the run, and what it finds here counts.
    let missing = ["atlas:tiny-1/audit.json: robot", "has not been audited (1 of"];
    sandbox.run("eval -q -a atlas:tiny-1 --robots random:2 --images 4 --physical-only").ended(3, &missing);
    let run: serde_json::Value = serde_json::from_str(&sandbox.read("run/run.json")).unwrap();
    let audited = sandbox.read("run/audit.json");
    let ids = run["elites"].as_array().unwrap().iter().map(|robot| robot["id"].as_str().unwrap());
    let all = ids.clone().count();
    let others: Vec<&str> = ids.filter(|id| !audited.contains(id)).collect();
    assert_eq!(others.len(), all - 1);
    let others = others.join(",");
    sandbox.run(&format!("audit -q -a atlas:tiny-1 --robots {others} --set least_walk=0")).ended(0, &[]);
    sandbox.run("report -q -a atlas:tiny-1 -o all.html").ended(0, &[]);
    assert!(sandbox.read("all.html").contains(&format!("robots, {all} were audited")));
    let drawn = sandbox.run("eval -a atlas:tiny-1 --robots random:2 --images 4 --cycles 1 --physical-only");
    assert!(!drawn.err.contains("has not been audited"), "{}", drawn.err);
    sandbox.write(
        "atlas-tiny-1-audit.json",
        sandbox.read("atlas-tiny-1-audit.json").replace("sha256\":\"", "sha256\":\"0"),
    );
    let stale = ["atlas-tiny-1-audit.json: stale", "morphcog audit --archive atlas:tiny-1 audits the run"];
    sandbox.run("eval -a atlas:tiny-1 --robots random:2 --images 4 --physical-only").ended(3, &stale);

    let elsewhere = |args: &str| {
        let mut command = sandbox.command(args.split_whitespace());
        command.env("MORPHCOG_ATLAS", "elsewhere");
        said(command)
    };
    elsewhere("eval -q -a atlas:tiny-2 --robots best --images 4").ended(0, &[]);
    elsewhere("eval -q -a atlas:tiny-1 --robots best --images 4").ended(0, &[]);
    let both =
        ["elsewhere/tiny-3/run.json.gz and no data/atlas/tiny-3/run.json.gz", "expected one of tiny-2"];
    elsewhere("eval -a atlas:tiny-3 --images 4").ended(3, &both);
    let unset =
        ["atlas:tiny-2/run.json: cannot be read", "MORPHCOG_ATLAS is not set", "expected one of tiny-1"];
    sandbox.run("eval -a atlas:tiny-2 --images 4").ended(3, &unset);
    Sandbox::new().run("replay -a atlas:tiny-2").ended(3, &["set MORPHCOG_ATLAS to its data/atlas"]);
    sandbox.write("data/atlas/broken-1/run.json.gz", &compressed("run/run.json")[..200]);
    sandbox.run("eval -a atlas:broken --images 4").ended(3, &["atlas:broken-1/run.json: cannot be read"]);
}
