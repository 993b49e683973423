//! What a person at a terminal sees and types: films, keys, Ctrl-C, and the terminal as it was
//! before.
#![cfg(unix)]

use crate::common::program::{PROGRAM, SETTINGS, Sandbox};
use pty_process::Size;
use pty_process::blocking::{self, Pty};
use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::process::Child;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Nothing in these tests takes longer.
const LIMIT: Duration = Duration::from_secs(60);

/// The program in a terminal of its own.
struct Session {
    keyboard: Arc<Pty>,
    screen: Receiver<Vec<u8>>,
    /// What was shown and not waited for yet.
    open: String,
    shell: Child,
}

impl Session {
    /// Starts the program, under a shell that says at its end how the program ended and whether the
    /// terminal's settings are those from before. Blanks separate arguments.
    fn new(sandbox: &Sandbox, args: &str) -> Self {
        let (pty, place) = blocking::open().unwrap();
        pty.resize(Size::new(24, 80)).unwrap();
        // Signals of the terminal reach the shell, too, which has more to say.
        let script = format!(
            "trap : INT HUP; before=$(stty -g); {PROGRAM} {args}; code=$?; \
             test \"$(stty -g)\" = \"$before\" && echo as before, code=$code"
        );
        let mut shell = blocking::Command::new("sh")
            .current_dir(sandbox.path("."))
            .args(["-c", &script])
            .env("TERM", "xterm-256color");
        for name in SETTINGS.iter().filter(|name| **name != "TERM") {
            shell = shell.env_remove(name);
        }
        let shell = shell.spawn(place).unwrap();
        let keyboard = Arc::new(pty);
        let output = Arc::clone(&keyboard);
        let (send, screen) = channel();
        std::thread::spawn(move || {
            let mut piece = [0; 4096];
            // Reading from a closed terminal is an error.
            while let Ok(count @ 1..) = (&*output).read(&mut piece) {
                if send.send(piece[..count].to_vec()).is_err() {
                    break;
                }
            }
        });
        Session {
            keyboard,
            screen,
            open: String::new(),
            shell,
        }
    }

    /// Waits for these words.
    #[track_caller]
    fn shows(&mut self, words: &str) {
        let end = Instant::now() + LIMIT;
        loop {
            if let Some(place) = self.open.find(words) {
                self.open.drain(..place + words.len());
                return;
            }
            match self
                .screen
                .recv_timeout(end.saturating_duration_since(Instant::now()))
            {
                // Words to wait for are ASCII: pieces may cut other letters in two.
                Ok(piece) => self.open += &String::from_utf8_lossy(&piece),
                Err(error) => panic!("expected {words:?}, {error}: {:?}", self.open),
            }
        }
    }

    fn types(&mut self, keys: &str) {
        (&*self.keyboard).write_all(keys.as_bytes()).unwrap();
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let _ = self.shell.kill();
        let _ = self.shell.wait();
    }
}

const FILM: &str = "replay --robot XFJPI --dataset builtin --format terminal";

#[test]
fn a_film_pauses_steps_and_quits_by_keys() {
    let sandbox = Sandbox::new();
    let mut film = Session::new(&sandbox, FILM);
    film.shows("\x1b[?25l");
    film.shows("space pauses");
    film.types(" ");
    film.shows("space plays on");
    film.types(".");
    film.shows("space plays on");
    film.types(" ");
    film.shows("space pauses");
    film.types("q");
    film.shows("\x1b[?25h");
    film.shows("as before, code=0");
}

#[test]
fn ctrl_c_ends_a_film_and_the_terminal_is_as_it_was() {
    let sandbox = Sandbox::new();
    let mut film = Session::new(&sandbox, FILM);
    film.shows("space pauses");
    film.types("\x03");
    film.shows("\x1b[?25h");
    film.shows("as before, code=0");
}

/// What a command shows in a terminal of so many columns, without colours: whatever stood in a line at
/// any time is a line.
fn shown(sandbox: &Sandbox, args: &str, columns: u16) -> Vec<String> {
    let (pty, place) = blocking::open().unwrap();
    pty.resize(Size::new(24, columns)).unwrap();
    let mut command = blocking::Command::new(PROGRAM)
        .current_dir(sandbox.path("."))
        .args(args.split_whitespace())
        .env("TERM", "xterm-256color");
    for name in SETTINGS.iter().filter(|name| **name != "TERM") {
        command = command.env_remove(name);
    }
    let mut program = command.spawn(place).unwrap();
    let (mut bytes, mut piece) = (Vec::new(), [0; 4096]);
    // Reading from a closed terminal is an error.
    while let Ok(count @ 1..) = (&pty).read(&mut piece) {
        bytes.extend_from_slice(&piece[..count]);
    }
    let code = program.wait().unwrap().code();
    let text = String::from_utf8(bytes).unwrap();
    assert!(code.is_some_and(|code| code != 101), "{args}: {text}");
    let mut parts = text.split("\x1b[");
    let mut seen = parts.next().unwrap_or_default().to_string();
    for part in parts {
        let end = part.find(|c: char| c.is_ascii_alphabetic()).unwrap();
        seen += &part[end + 1..];
    }
    seen.split(['\r', '\n'])
        .map(|line| line.trim_end().to_string())
        .collect()
}

/// Checks that no line is wider than the terminal, but for a single word that is.
#[track_caller]
fn check_widths(args: &str, lines: &[String], columns: u16) {
    for line in lines {
        let is_word = !line
            .trim_start()
            .trim_end_matches('\\')
            .trim_end()
            .contains(' ');
        let fits = line.chars().count() <= usize::from(columns);
        assert!(
            fits || is_word,
            "{args}: {columns} columns: {line:?} in:\n{}",
            lines.join("\n")
        );
    }
}

/// Words that are no numbers: those depend on the clock.
fn words(text: &str) -> BTreeSet<&str> {
    let is_word = |word: &&str| word.contains(char::is_alphabetic);
    text.split_whitespace()
        .map(|word| word.trim_matches('`'))
        .filter(is_word)
        .collect()
}

#[test]
fn a_hangup_ends_a_film_and_the_terminal_is_as_it_was() {
    if crate::common::program::is_ignored(1) {
        return;
    }
    let sandbox = Sandbox::new();
    let mut film = Session::new(&sandbox, FILM);
    film.shows("space pauses");
    // The shell leads the group of all that runs in its terminal.
    let group = format!("-{}", film.shell.id());
    let sent = std::process::Command::new("kill")
        .args(["-s", "HUP", "--", &group])
        .status()
        .unwrap();
    assert!(sent.success());
    film.shows("\x1b[?25h");
    film.shows("as before, code=75");
}

#[test]
fn a_run_whose_terminal_is_closed_is_saved() {
    if crate::common::program::is_ignored(1) {
        return;
    }
    let sandbox = Sandbox::tiny();
    let (terminal, place) = blocking::open().unwrap();
    terminal.resize(Size::new(24, 80)).unwrap();
    let evolve = "evolve -c tiny.toml --generations 99999 -o run";
    let mut command = blocking::Command::new(PROGRAM);
    for name in SETTINGS.iter().filter(|name| **name != "TERM") {
        command = command.env_remove(name);
    }
    let command = command
        .current_dir(sandbox.path("."))
        .args(evolve.split(' '))
        .env("TERM", "xterm-256color");
    let mut child = command.spawn(place).unwrap();
    let mut shown = String::new();
    while !shown.contains(" left") {
        let mut piece = [0; 4096];
        let count = (&terminal).read(&mut piece).unwrap();
        shown += &String::from_utf8_lossy(&piece[..count]);
    }
    drop(terminal);
    let end = Instant::now() + LIMIT;
    let ended = loop {
        if let Some(ended) = child.try_wait().unwrap() {
            break ended;
        }
        if Instant::now() > end {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("it does not end");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    assert_eq!(ended.code(), Some(75));
    assert!(sandbox.run_file("run").generations > 0);
}

#[test]
fn every_help_fits_a_terminal_and_its_words_are_whole() {
    let sandbox = Sandbox::new();
    let commands = "|demo|serve|site|evolve|response|train|eval|team|audit|capacity|sweep|reproduce|verify|report|\
                    replay|plot|simulate|data|data fetch|data info|data sheet|bench|gallery|config|schema|\
                    completions|man";
    for command in commands.split('|') {
        let args = format!("{command} --help");
        let whole = sandbox.run(&args).ended(0, &[]).out;
        assert!(
            whole.lines().all(|line| line.chars().count() <= 80),
            "{command}: {whole}"
        );
        for columns in [80, 60] {
            let lines = shown(&sandbox, &args, columns);
            check_widths(&args, &lines, columns);
            assert_eq!(words(&lines.join(" ")), words(&whole), "{command}");
        }
        // Narrower than any word, it is still there.
        shown(&sandbox, &args, 20);
    }
}

/// The indented lines below a line of help.
fn example(help: &[String], title: &str) -> String {
    let below = help.iter().skip_while(|line| *line != title).skip(1);
    below
        .filter(|line| !line.is_empty())
        .take_while(|line| line.starts_with(' '))
        .cloned()
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn a_plan_and_a_scenario_are_copied_from_help_as_they_are() {
    for columns in [80, 60] {
        let sandbox = Sandbox::new();
        sandbox.write(
            "plan.toml",
            example(&shown(&sandbox, "sweep --help", columns), "plan.toml:"),
        );
        let status = sandbox.run("sweep plan.toml --status").ended(0, &[]).out;
        assert!(status.contains("9 tasks"), "{status}");
        sandbox.write(
            "scenario.json",
            example(
                &shown(&sandbox, "simulate --help", columns),
                "scenario.json:",
            ),
        );
        let walk = sandbox.run("simulate scenario.json").ended(0, &[]).out;
        assert!(walk.lines().count() > 500, "{walk}");
    }
}

#[test]
fn what_commands_find_fits_a_terminal_and_its_words_are_whole() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    sandbox.write(
        "plan.toml",
        "config = \"tiny.toml\"\nseeds = [1, 2]\n[vary]\nmap_elites.parents = [4, 8]\n[eval]\nimages = 4\n",
    );
    sandbox.run("sweep plan.toml -q").ended(0, &[]);
    for args in [
        "evolve -q -c tiny.toml -o another --force",
        "eval -q -a run --images 4 --cycles 1",
        "audit -q -a run --robots top:2",
        "response -q -a run --images 60",
        "capacity -q --eval run/eval.json --set trainings=1 --set sizes=[1,2]",
        "team -q -a run --classes 0,1 --images 4",
        "report -q -a run --rollouts 0",
        "replay -q -a run --format png",
        "plot archive -q -a run",
        "sweep plan.toml -q --status",
        "sweep plan.toml -q --collect",
        "reproduce -q --status",
        "data info -q",
        "data sheet -q -o sheet.png --samples 1",
        "gallery -q",
        "config -q",
        "schema -q",
        // What is wrong, and what to do.
        "eval -a a_folder_with_a_long_name/in_another_with_a_longer_one/run.json",
        "evolve -c tiny.toml -o run",
        "evolve -c tiny.toml --set map_elites.parent=3",
        "eval --robots worst:3",
        "evolve",
        "audit -a run --physical-only",
        "eval -a run --physical-only",
    ] {
        let piped = sandbox.run(args);
        let whole = piped.out.clone() + &piped.err;
        for columns in [80, 60] {
            let lines = shown(&sandbox, args, columns);
            check_widths(args, &lines, columns);
            let text = lines.join(" ");
            assert_eq!(words(&text), words(&whole), "{args}: {columns} columns");
        }
        shown(&sandbox, args, 20);
    }
}

#[test]
fn progress_and_what_is_next_fit_a_terminal() {
    let sandbox = Sandbox::tiny();
    let out = "a_folder_with_a_long_name/in_another/with_a_name_that_is_longer";
    for columns in [80, 60, 20] {
        let args = format!("evolve -c tiny.toml --force -o {out}");
        let lines = shown(&sandbox, &args, columns);
        check_widths(&args, &lines, columns);
        // A command goes on where the line above it says so.
        let text = lines.join("\n").replace("\n\n", "\n");
        let (_, next) = text.split_once("next:").unwrap();
        let next: Vec<&str> = next
            .split_whitespace()
            .filter(|word| *word != "\\")
            .collect();
        let command = format!(
            "morphcog replay --robot best --archive {out}/run.json morphcog eval --archive"
        );
        assert!(next.join(" ").starts_with(&command), "{text}");
    }
}

#[test]
fn ctrl_c_saves_a_run_that_shows_its_progress() {
    let sandbox = Sandbox::tiny();
    let mut run = Session::new(&sandbox, "evolve -c tiny.toml --generations 9999 -o run");
    // A line that moves: it is written over again and again. How much time is left is known after
    // the first generation.
    run.shows("\r");
    run.shows("generation 0/9999");
    run.shows(" left");
    run.types("\x03");
    run.shows("--resume");
    run.shows("as before, code=75");
    assert!(sandbox.run_file("run").generations > 0);
}
