//! What a person at a terminal sees and types: films, keys, Ctrl-C, and the terminal as it was before.
#![cfg(unix)]

mod common;

use common::program::{PROGRAM, SETTINGS, Sandbox};
use rexpect::session::{PtySession, spawn_command};
use std::process::Command;

/// Nothing in these tests takes longer \[ms\].
const LIMIT: u64 = 60_000;

/// The program in a terminal, under a shell that says at its end how the program ended and whether the terminal's settings
/// are those from before. Blanks separate arguments.
fn at_a_terminal(sandbox: &Sandbox, args: &str) -> PtySession {
    let mut shell = Command::new("sh");
    // Ctrl-C reaches the shell, too, which has more to say.
    let script = format!(
        "trap : INT; before=$(stty -g); {PROGRAM} {args}; code=$?; test \"$(stty -g)\" = \"$before\" && echo as before, code=$code"
    );
    shell.current_dir(sandbox.path(".")).args(["-c", &script]);
    SETTINGS.iter().for_each(|name| {
        shell.env_remove(name);
    });
    shell.env("TERM", "xterm-256color");
    spawn_command(shell, Some(LIMIT)).unwrap()
}

/// What is shown up to these words, which must come.
#[track_caller]
fn shows(session: &mut PtySession, words: &str) -> String {
    session.exp_string(words).unwrap_or_else(|error| panic!("expected {words:?}: {error}"))
}

fn types(session: &mut PtySession, keys: &str) {
    session.send(keys).unwrap();
    session.flush().unwrap();
}

const FILM: &str = "replay --robot XFJPI --dataset builtin --format terminal";

#[test]
fn a_film_pauses_steps_and_quits_by_keys() {
    let sandbox = Sandbox::new();
    let mut film = at_a_terminal(&sandbox, FILM);
    shows(&mut film, "\x1b[?25l");
    shows(&mut film, "space pauses");
    types(&mut film, " ");
    shows(&mut film, "space plays on");
    types(&mut film, ".");
    shows(&mut film, "space plays on");
    types(&mut film, " ");
    shows(&mut film, "space pauses");
    types(&mut film, "q");
    shows(&mut film, "\x1b[?25h");
    shows(&mut film, "as before, code=0");
}

#[test]
fn ctrl_c_ends_a_film_and_the_terminal_is_as_it_was() {
    let sandbox = Sandbox::new();
    let mut film = at_a_terminal(&sandbox, FILM);
    shows(&mut film, "space pauses");
    types(&mut film, "\x03");
    shows(&mut film, "\x1b[?25h");
    shows(&mut film, "as before, code=0");
}

#[test]
fn ctrl_c_saves_a_run_that_shows_its_progress() {
    let sandbox = Sandbox::tiny();
    let mut run = at_a_terminal(&sandbox, "evolve -c tiny.toml --generations 1000000 -o run");
    // A line that moves: it is written over again and again.
    shows(&mut run, "\r");
    shows(&mut run, "generation");
    types(&mut run, "\x03");
    shows(&mut run, "--resume");
    shows(&mut run, "as before, code=75");
    assert!(sandbox.run_file("run").generations > 0);
}
