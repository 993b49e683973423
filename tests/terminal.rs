//! What a person at a terminal sees and types: films, keys, Ctrl-C, and the terminal as it was
//! before.
#![cfg(unix)]

mod common;

use common::program::{PROGRAM, SETTINGS, Sandbox};
use pty_process::Size;
use pty_process::blocking::{self, Pty};
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
        // Ctrl-C reaches the shell, too, which has more to say.
        let script = format!(
            "trap : INT; before=$(stty -g); {PROGRAM} {args}; code=$?; \
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
        Session { keyboard, screen, open: String::new(), shell }
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
            match self.screen.recv_timeout(end.saturating_duration_since(Instant::now())) {
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

#[test]
fn a_table_that_is_wider_than_the_terminal_is_one_robot_below_the_other() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    let mut table = Session::new(&sandbox, "eval -q -a run --images 4 --cycles 1 --robots best");
    // The table of robots has ten columns, and 130 characters of them.
    table.shows("\r\nfitness ");
    table.shows("\r\nbalanced %");
    table.shows("as before, code=0");
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
