//! Configs: shipped ones, overrides, and what is wrong with them.

use crate::common::program::{Sandbox, TINY, files, gaits, said};
use morphcog::commands::plan::PAPER_TOML;
use morphcog::config::{BUILT_IN, Config};
use std::collections::BTreeMap;
use std::path::Path;

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
    let plan = sandbox
        .run("config paper.toml --set seeds=[7]")
        .ended(0, &[])
        .out;
    sandbox.write("mine.toml", &plan);
    assert!(
        list.contains("paper.toml") && plan.contains("seeds = [7]"),
        "{plan}"
    );
    sandbox
        .run("reproduce mine.toml --scale 2")
        .ended(2, &["--scale 2"]);
}

#[test]
fn a_printed_config_is_itself_a_config_equal_to_the_original() {
    let sandbox = Sandbox::new();
    for (name, text) in BUILT_IN {
        let printed = sandbox.run(&format!("config {name}")).ended(0, &[]).out;
        let original = Config::parse(text, name, &[]).unwrap();
        assert_eq!(
            Config::parse(&printed, "printed.toml", &[]).unwrap(),
            original,
            "{name}"
        );
        sandbox.write("printed.toml", &printed);
        assert_eq!(
            sandbox.run("config printed.toml").ended(0, &[]).out,
            printed
        );
        assert!(
            printed.contains("[physics]") && printed.contains("gravity"),
            "every key is printed"
        );
    }
    let changed = sandbox
        .run("config zero_one.toml --set map_elites.parents=7 --set seed=5")
        .ended(0, &[])
        .out;
    let changed = Config::parse(&changed, "changed.toml", &[]).unwrap();
    assert_eq!((changed.map_elites.parents, changed.seed), (7, 5));
}

#[test]
fn a_file_in_this_folder_comes_before_the_built_in_config_of_its_name() {
    let sandbox = Sandbox::new();
    let built_in = sandbox.run("config quickstart.toml").ended(0, &[]).out;
    assert_eq!(sandbox.run("config quickstart").ended(0, &[]).out, built_in);
    sandbox.write("quickstart.toml", TINY);
    assert_ne!(
        sandbox.run("config quickstart.toml").ended(0, &[]).out,
        built_in
    );
}

/// `morphcog config zero_one.toml > zero_one.toml` begins with an empty file of the shell's.
#[test]
fn an_empty_file_of_the_name_of_a_built_in_config_does_not_hide_it() {
    let sandbox = Sandbox::new();
    for name in ["zero_one.toml", "paper.toml"] {
        let printed = sandbox.run(&format!("config {name}")).ended(0, &[]).out;
        sandbox.write(name, "");
        let again = sandbox.run(&format!("config {name}")).ended(0, &[]).out;
        assert!(!printed.is_empty() && again == printed, "{name}: {again}");
        // Nothing runs with it.
        let command = if name == "paper.toml" {
            "reproduce"
        } else {
            "evolve -c"
        };
        sandbox.run(&format!("{command} {name}")).ended(3, &[name]);
    }
}

#[test]
fn a_folder_of_the_name_of_a_built_in_config_does_not_hide_it() {
    let sandbox = Sandbox::new();
    std::fs::create_dir(sandbox.path("zero_one")).unwrap();
    sandbox.run("config zero_one").ended(0, &[]);
    std::fs::create_dir(sandbox.path("other")).unwrap();
    sandbox.run("config other").ended(3, &["other: "]);
}

#[test]
fn a_config_that_is_somebody_elses_is_not_overwritten_unasked() {
    let sandbox = Sandbox::tiny();
    let foreign = "# Of a page\nbaseURL = \"x\"\n";
    sandbox.write("site/config.toml", foreign);
    sandbox
        .run("evolve -q -c tiny.toml -o site")
        .ended(5, &["site/config.toml", "--force"]);
    assert_eq!(sandbox.read("site/config.toml"), foreign);
    assert!(!sandbox.path("site/run.json").exists());
    // One's own, with what was written about it, is the config of its run, but not of another.
    let own = format!("# Why so\n{TINY}");
    sandbox.write("own/config.toml", &own);
    sandbox
        .run("evolve -q -c own/config.toml -o own --set seed=9")
        .ended(5, &["own/config.toml"]);
    sandbox
        .run("evolve -q -c own/config.toml -o own")
        .ended(0, &[]);
    assert_eq!(sandbox.read("own/config.toml"), own);
    sandbox
        .run("evolve -q -c tiny.toml -o site --force")
        .ended(0, &[]);
    // What the program wrote, and no run came of, is in nobody's way.
    std::fs::create_dir(sandbox.path("begun")).unwrap();
    std::fs::copy(
        sandbox.path("site/config.toml"),
        sandbox.path("begun/config.toml"),
    )
    .unwrap();
    sandbox
        .run("evolve -q -c tiny.toml -o begun --set seed=9")
        .ended(0, &[]);
}

#[test]
fn the_name_in_a_run_file_leads_nowhere() {
    let sandbox = crate::with_run();
    let text = sandbox.read("run/run.json");
    let named = text.replace("\"name\":\"tiny\"", "\"name\":\"../escaped\"");
    assert_ne!(named, text);
    sandbox.write("run/run.json", named);
    sandbox
        .run("evolve -q -c run/config.toml -g 1")
        .ended(0, &[]);
    assert!(sandbox.path("runs/escaped-seed3/run.json").exists());
}

#[test]
fn toml_and_json_with_the_same_keys_make_the_same_run() {
    let sandbox = Sandbox::tiny();
    let table: toml::Table = toml::from_str(TINY).unwrap();
    sandbox.write(
        "json/tiny.json",
        serde_json::to_string_pretty(&table).unwrap(),
    );
    sandbox.run("evolve -q -c tiny.toml -o a").ended(0, &[]);
    sandbox
        .run("evolve -q -c json/tiny.json -o b")
        .ended(0, &[]);
    assert_eq!(sandbox.read("a/run.json"), sandbox.read("b/run.json"));
    assert_eq!(sandbox.read("a/config.toml"), sandbox.read("b/config.toml"));
    // The config that a run writes makes the same run again.
    std::fs::copy(
        sandbox.path("a/config.toml"),
        sandbox.path("json/tiny.toml"),
    )
    .unwrap();
    sandbox
        .run("evolve -q -c json/tiny.toml -o c")
        .ended(0, &[]);
    assert_eq!(sandbox.read("a/run.json"), sandbox.read("c/run.json"));
}

#[test]
fn a_wrong_config_is_refused_with_file_line_and_key() {
    let sandbox = Sandbox::new();
    let wrong = |name: &str, text: &str, words: &[&str]| {
        sandbox.write(name, text);
        sandbox
            .run(&format!("evolve -c {name} -o run"))
            .ended(3, words);
        assert!(!sandbox.path("run").exists(), "{name}: {text}");
    };
    let with = |line: &str| format!("{TINY}\n[physics]\n{line}\n");
    let line = |text: &str| text.lines().count();
    let place = format!("own.toml:{}", line(&with("x")));
    wrong(
        "own.toml",
        &with("gravitee = 3"),
        &[&place, "physics", "gravitee"],
    );
    wrong(
        "own.toml",
        &with("gravity = \"much\""),
        &[&place, "physics.gravity"],
    );
    wrong(
        "own.toml",
        &with("substeps = -1"),
        &[&place, "physics.substeps"],
    );
    wrong(
        "own.toml",
        &with("substeps = 1e3"),
        &[&place, "physics.substeps"],
    );
    wrong("own.toml", &with("substeps = = 3"), &[&place]);
    wrong(
        "own.toml",
        &TINY.replace("[[0], [1]]", "[[0], [300]]"),
        &["own.toml:10", "task.groups"],
    );
    let two = ["own.toml:10", "task.groups"];
    wrong(
        "own.toml",
        &TINY.replace("[[0], [1]]", "[[0], [1], [2]]"),
        &two,
    );
    wrong("own.toml", &TINY.replace("[[0], [1]]", "[[0]]"), &two);
    wrong(
        "own.toml",
        &TINY.replace("\"fresh\"", "\"stale\""),
        &["own.toml:20", "protocol.rollout", "stale"],
    );
    wrong(
        "own.toml",
        &TINY.replace("seed = 3", "seed = 3\nseed = 4"),
        &["own.toml:3: "],
    );
    wrong(
        "own.toml",
        &TINY.replace("seed = 3", "sed = 3"),
        &["own.toml:2", "sed"],
    );
    // What is wrong with values that are well typed.
    wrong(
        "own.toml",
        &TINY.replace("[[0], [1]]", "[[0], []]"),
        &["own.toml", "task"],
    );
    wrong(
        "own.toml",
        &TINY.replace("[[0], [1]]", "[[0], [0]]"),
        &["own.toml", "task"],
    );
    wrong(
        "own.toml",
        &TINY.replace("[0, 1]", "[0, 1, 2]"),
        &["data.train_images", "image 2"],
    );
    wrong(
        "own.toml",
        &TINY.replace("[0, 1]", "[0]"),
        &["data.train_images", "class 1"],
    );
    wrong(
        "own.toml",
        &TINY.replace("[0, 1]", "[0, 10000000]"),
        &["data.train_images", "10000000"],
    );
    wrong(
        "own.toml",
        &TINY.replace("height = 5", "height = 0"),
        &["own.toml:6: ", "body.height = 0", "1 to 64"],
    );
    wrong(
        "own.toml",
        &TINY.replace("control_steps = 20", "control_steps = 0"),
        &["protocol.control_steps"],
    );
    wrong(
        "own.toml",
        &with("time_step = nan"),
        &["own.toml", "physics.time_step"],
    );
    wrong(
        "own.toml",
        &with("time_step = -inf"),
        &["own.toml", "physics.time_step"],
    );
    wrong("own.toml", "", &["own.toml", "task"]);

    let table: toml::Table = toml::from_str(TINY).unwrap();
    let json = serde_json::to_string_pretty(&table).unwrap();
    let at = |word: &str| {
        format!(
            "own.json:{}",
            1 + json.lines().position(|l| l.contains(word)).unwrap()
        )
    };
    let changed = |from: &str, to: &str| {
        assert!(json.contains(from), "{json}");
        json.replace(from, to)
    };
    let at_steps = at("control_steps");
    wrong(
        "own.json",
        &changed("control_steps", "control_step"),
        &[&at_steps, "protocol", "control_step"],
    );
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
    wrong(
        "own.json",
        &changed("\"control_steps\": 20", "\"control_steps\": NaN"),
        &[&at_steps],
    );
    wrong("own.json", &json[..json.len() / 2], &["own.json:"]);
    wrong("own.json", &format!("{json} {json}"), &["own.json:"]);
    wrong("own.json", "", &["own.json"]);
    wrong("own.json", "[]", &["own.json"]);
}

#[test]
fn a_wrong_set_is_refused_with_2_and_quotes_it() {
    let sandbox = Sandbox::tiny();
    for (set, words) in [
        ("seed", "key=value"),
        ("=3", "--set =3"),
        ("seed=7\ngenerations=5", "one line"),
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
    let large = serde_json::to_string(&table)
        .unwrap()
        .replace(":77", ":9223372036854775808");
    sandbox.write("large.json", large);
    sandbox.run("evolve -c large.json -o run").ended(
        3,
        &[
            "data.builtin.seed = 9223372036854775808",
            "0 to 9223372036854775807",
        ],
    );
    sandbox
        .run("evolve -c tiny.toml -o run --set generations=0")
        .ended(3, &["--set generations=0: ", "generations = 0"]);
}

#[test]
fn configs_are_read_in_utf16_and_under_names_in_capitals() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    // As PowerShell writes `morphcog config … > own.toml`.
    let units: Vec<u16> = std::iter::once(0xfeff).chain(TINY.encode_utf16()).collect();
    sandbox.write(
        "OWN.TOML",
        units
            .iter()
            .flat_map(|unit| unit.to_le_bytes())
            .collect::<Vec<u8>>(),
    );
    sandbox.write(
        "BIG.TOML",
        units
            .iter()
            .flat_map(|unit| unit.to_be_bytes())
            .collect::<Vec<u8>>(),
    );
    let table: toml::Table = toml::from_str(TINY).unwrap();
    sandbox.write("OWN.JSON", serde_json::to_string(&table).unwrap());
    for name in ["OWN.TOML", "BIG.TOML", "OWN.JSON"] {
        sandbox
            .run(&format!("evolve -q -c {name} -o run-{name}"))
            .ended(0, &[]);
        assert_eq!(
            sandbox.run_file(&format!("run-{name}")).elites,
            sandbox.run_file("run").elites
        );
    }
    sandbox.write("half.toml", [0xff, 0xfe, b'a']);
    sandbox
        .run("evolve -c half.toml -o none")
        .ended(3, &["half.toml: ", "UTF-8"]);
    // A resumed run's own config is compared with it.
    sandbox
        .run("evolve -q -c OWN.TOML -o run-OWN.TOML -g 14 --resume")
        .ended(0, &[]);
    let criteria = "{\"seconds\": \"no\"}";
    sandbox.write("CRITERIA.JSON", criteria);
    sandbox
        .run("audit -a run --criteria CRITERIA.JSON -o a.json")
        .ended(3, &["CRITERIA.JSON:1"]);
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
    sandbox
        .run("evolve -q -c own.toml -o run --set archive.keep=3 -g 2")
        .ended(0, &[]);
    assert_eq!(sandbox.run_file("run").config.archive.keep, Some(3));
}

#[test]
fn an_error_blames_the_override_that_caused_it() {
    let sandbox = Sandbox::new();
    sandbox.write("one.toml", TINY);
    let blamed = |set: &[&str], code: i32, blamed: &str, words: &[&str]| {
        let all = set.iter().flat_map(|set| ["--set", set]);
        let command = sandbox.command(
            ["evolve", "-c", "one.toml", "-o", "run"]
                .into_iter()
                .chain(all),
        );
        let place = format!("error: --set {blamed}: ");
        said(command).ended(code, &[&[place.as_str()], words].concat());
        assert!(!sandbox.path("run").exists());
    };
    // By itself, alone or beside others.
    blamed(
        &["archive.keep=0"],
        3,
        "archive.keep=0",
        &["archive.keep = 0"],
    );
    blamed(&["archive.keep=0", "seed=4"], 3, "archive.keep=0", &[]);
    blamed(
        &["train.rounds=2", "archive.keep=0"],
        3,
        "archive.keep=0",
        &[],
    );
    // Keys and items that are not there, to be set or unset.
    blamed(
        &["seed=4", "task.groups.3.1=1"],
        2,
        "task.groups.3.1=1",
        &["1 to 2"],
    );
    blamed(&["task.groups.0.1=1"], 2, "task.groups.0.1=1", &["1 to 2"]);
    blamed(&["stages.1.keep=1"], 2, "stages.1.keep=1", &["`stages`"]);
    blamed(&["seed=4", "archive.kep=1"], 2, "archive.kep=1", &["`kep`"]);
    blamed(&["seed=4", "archive.kep="], 2, "archive.kep=", &["`kep`"]);
    blamed(
        &["data.dataset=", "seed=4"],
        2,
        "data.dataset=",
        &["`dataset`"],
    );
    blamed(&["body.height=x", "seed=4"], 2, "body.height=x", &[]);
    // The file's own fault stays the file's.
    sandbox.write("bad.toml", TINY.replace("height = 5", "height = 0"));
    sandbox
        .run("evolve -c bad.toml -o run --set seed=4")
        .ended(3, &["error: bad.toml:6: body.height = 0"]);
    // So it is with what else is set.
    sandbox
        .run("audit --set least_kept=2 --set threshold=1")
        .ended(3, &["--set least_kept=2: "]);
    sandbox
        .run("audit --set perturbations.start.9=1")
        .ended(2, &["perturbations.start 9"]);
    sandbox
        .run("capacity --eval no.json --set step=2 --set mlp.epochs=0")
        .ended(3, &["--set mlp.epochs=0: "]);
}

#[test]
#[cfg(not(feature = "mpi"))]
fn what_needs_no_mpi_runs_also_under_its_launcher() {
    let sandbox = Sandbox::tiny();
    let launched = |args: &str| {
        let mut command = sandbox.command(args.split_whitespace());
        command.env("OMPI_COMM_WORLD_SIZE", "4");
        said(command)
    };
    launched("config tiny.toml").ended(0, &[]);
    launched("data info builtin").ended(0, &[]);
    launched("evolve -c tiny.toml").ended(2, &["MPI"]);
    launched("sweep plan.toml").ended(2, &["MPI"]);
}
