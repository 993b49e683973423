//! Help, command lines, completions and the man page.

use crate::common::program::{Sandbox, TINY, skipped};
use morphcog::commands::plan::PAPER_TOML;
use morphcog::commands::schema;
use morphcog::config::BUILT_IN;

const COMMANDS: [&str; 29] = [
    "",
    "evolve",
    "response",
    "train",
    "eval",
    "team",
    "audit",
    "capacity",
    "compare",
    "sweep",
    "reproduce",
    "verify",
    "report",
    "replay",
    "plot",
    "simulate",
    "data",
    "data fetch",
    "data import",
    "data info",
    "data sheet",
    "serve",
    "site",
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
        let (_, examples) = said
            .out
            .split_once("Example")
            .unwrap_or_else(|| panic!("{command}: no example"));
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
        "data import",
        "data import photos",
        "data import photos --name mnist",
        "data import photos --name shapes --test 1",
        "data import photos --name shapes --fit tight",
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
        for command in [
            "evolve", "eval", "replay", "simulate", "gallery", "--resume",
        ] {
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
        assert_eq!(
            zsh.matches(&format!(":({words})")).count(),
            times,
            "zsh: {words}"
        );
        assert!(bash.contains(words), "bash: {words}");
    };
    offered(
        "body spacetime snapshots archive progress accuracy capacity gates",
        1,
    );
    // Of eval and of team; bash has it for options.
    offered("test validation", 2);
    assert_eq!(bash.matches("compgen -W \"test validation\"").count(), 2);
    offered("gif html png mp4 webm frames terminal", 2);
    offered("plain paper", 1);
    offered("mnist fashion-mnist", 1);
    offered("builtin gates gates-3 gates-4 mnist fashion-mnist", 2);
    offered(
        &morphcog::commands::schema::ALL
            .map(|schema| schema.name)
            .join(" "),
        1,
    );
    let configs = BUILT_IN.map(|(name, _)| name).join(" ");
    offered(&format!("{configs} {}", PAPER_TOML.0), 1);
    // Errors have them, too, where nothing else may be meant.
    sandbox.run("plot bodies").ended(2, &["body, spacetime"]);
    sandbox
        .run("eval --split train")
        .ended(2, &["test or validation"]);
    sandbox
        .run("replay --format mpeg")
        .ended(2, &["gif, html, png, mp4, webm, frames or terminal"]);
    sandbox.write("mine.toml", TINY);
    sandbox.run("config mine.toml").ended(0, &[]);
}

#[test]
fn the_man_page_renders() {
    let page = Sandbox::new().run("man").ended(0, &[]).out;
    assert!(
        page.contains(".TH morphcog 1") && page.contains(".SH NAME"),
        "{page}"
    );
    assert!(page.contains("evolve") && page.contains("Exit codes"));
    // Where there is a man, it understands it.
    let sandbox = Sandbox::new();
    let file = sandbox.write("morphcog.1", &page);
    let mut man = std::process::Command::new("man");
    match man.arg("-l").arg(file).env("MANPAGER", "cat").output() {
        Ok(shown) if shown.status.success() && !shown.stdout.is_empty() => {
            let text = String::from_utf8_lossy(&shown.stdout).into_owned();
            assert!(text.contains("morphcog"), "{text}");
        }
        _ => skipped("no man that reads a file; the page is not shown"),
    }
}

#[test]
fn every_schema_is_listed_and_printed_and_another_name_is_refused_with_2() {
    let sandbox = Sandbox::new();
    let listed = sandbox.run("schema").ended(0, &[]).out;
    for made in schema::ALL {
        assert!(
            listed.lines().any(|line| line.starts_with(made.name)),
            "{listed}"
        );
        let printed = sandbox
            .run(&format!("schema {}", made.name))
            .ended(0, &[])
            .out;
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(&printed).unwrap(),
            made.json()
        );
    }
    sandbox
        .run("schema rnu")
        .ended(2, &["schema rnu", "config, sweep, plan"]);
}
