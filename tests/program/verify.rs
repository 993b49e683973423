//! `morphcog verify`: its list of claims, and a claim that is measured again.

use crate::common::program::{Sandbox, files, json_lines, mnist, said};
use clap::Parser;
use morphcog::cli::Cli;
use morphcog::commands::verify::{Claim, claims};
use serde_json::Value;

#[test]
fn the_program_understands_every_command_of_a_claim() {
    for claim in claims().unwrap() {
        for command in &claim.commands {
            let words = std::iter::once("morphcog").chain(command.split_whitespace());
            Cli::try_parse_from(words).unwrap_or_else(|error| panic!("{command}: {error}"));
        }
    }
}

#[test]
fn a_claim_is_measured_in_its_folder_once_and_is_reproduced() {
    let sandbox = Sandbox::new();
    let said = sandbox.run("verify same-bits --json").ended(0, &[]);
    let events = said.json_lines();
    let verified = events.iter().find(|event| event["event"] == "verified");
    let verified = verified.expect("the claim has a result");
    assert_eq!(verified["agreements"][0], "reproduced");
    assert_eq!(verified["error"], serde_json::Value::Null);
    let before = files(&sandbox.path("verify/same-bits"));
    sandbox.run("verify same-bits").ended(0, &[]);
    assert_eq!(
        files(&sandbox.path("verify/same-bits")),
        before,
        "it is known"
    );
}

/// Asserts that an event has every value of a claim.
#[track_caller]
fn assert_measured(claim: &Claim, events: &[Value]) {
    let event = events.iter().rfind(|event| event["event"] == *claim.event);
    let event = event.unwrap_or_else(|| panic!("{}: no event {}", claim.name, claim.event));
    for value in &claim.values {
        let measured = value.measured(event);
        assert!(measured.is_some(), "{}: {}", claim.name, value.label);
    }
}

#[test]
fn an_evaluation_tells_every_value_that_is_claimed_of_it() {
    let Some(mnist) = mnist("where claims find the values of evaluations") else {
        return;
    };
    let sandbox = Sandbox::new();
    let mut found = 0;
    for claim in claims().unwrap() {
        let command = claim.commands.last().filter(|_| claim.event == "evaluated");
        if let Some(few) = command.filter(|command| command.contains("--images 1000")) {
            let few = few.replace("--images 1000", "--images 8");
            let mut command = sandbox.command(few.split_whitespace());
            command.args(["--json", "--data"]).arg(&mnist);
            let events = said(command).ended(0, &[]).json_lines();
            assert_measured(&claim, &events);
            found += 1;
        }
    }
    assert_eq!(found, 4);
}

#[test]
fn the_team_that_ships_has_the_values_that_are_claimed_of_it() {
    let Some(mnist) = mnist("the values that are claimed of the team") else {
        return;
    };
    let sandbox = Sandbox::new();
    let shipped = include_str!("../../data/team/team.json");
    let mut shipped: Value = serde_json::from_str(shipped).unwrap();
    // No other version may go on with it.
    shipped["program_version"] = env!("CARGO_PKG_VERSION").into();
    sandbox.write("verify/team/gallery-team.json", shipped.to_string());
    let mut command = sandbox.command(["verify", "team", "--json", "--data"]);
    command.arg(mnist);
    let events = said(command).ended(0, &[]).json_lines();
    let verified = events.iter().find(|event| event["event"] == "verified");
    let agreements = verified.expect("the claim has a result")["agreements"].clone();
    assert_eq!(agreements, serde_json::json!(["reproduced", "reproduced"]));
    let events = json_lines(&sandbox.read("verify/team/events.jsonl"));
    for claim in claims().unwrap() {
        if claim.event == "team" {
            assert_measured(&claim, &events);
        }
    }
}

#[test]
fn what_is_asked_is_checked_before_anything_is_measured() {
    let sandbox = Sandbox::new();
    sandbox
        .run("verify")
        .ended(2, &["--quick", "--all", "--list"]);
    sandbox
        .run("verify --quick --all")
        .ended(2, &["--quick", "--all"]);
    sandbox
        .run("verify nothing")
        .ended(2, &["nothing", "same-bits"]);
    sandbox
        .run("verify evogym")
        .ended(2, &["evogym", "cargo test"]);
    sandbox
        .run("verify same-bits zero-or-one --data nowhere")
        .ended(3, &["nowhere", "morphcog data fetch mnist"]);
    assert!(!sandbox.path("verify").exists());
    let listed = sandbox.run("verify --list").ended(0, &[]);
    for claim in claims().unwrap() {
        assert!(listed.out.contains(&claim.claim), "{}", claim.name);
        for command in claim.typed() {
            assert!(listed.out.contains(&command), "{command}");
        }
    }
}
