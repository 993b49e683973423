//! `morphcog verify`: its list of claims, and a claim that is measured again.

use crate::common::program::{Sandbox, files};
use clap::Parser;
use morphcog::cli::Cli;
use morphcog::commands::verify::claims;

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
