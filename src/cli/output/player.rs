//! Plays a recording in the terminal at the robot's own speed, with keys to pause and step. It
//! restores the terminal at the end.

use crate::base::error::Error;
use crate::base::signals;
use crate::cli::output::console::{Console, Mode};
use crate::cli::output::terminal;
use crate::cli::output::terminal::Depth;
use crate::draw::walk::Walk;
use crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use crossterm::terminal::{disable_raw_mode, enable_raw_mode, size};
use std::io::IsTerminal;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Time from one picture to the next: thirty per second.
const TICK: Duration = Duration::from_millis(33);
/// Control steps per second of the robot's time.
const STEPS_PER_SECOND: f64 = 50.0;
/// Columns and rows of a terminal of unknown size, and the largest view.
const USUAL: (u16, u16) = (80, 24);
const LARGEST: (usize, usize) = (140, 46);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Key {
    Pause,
    Forward,
    Back,
    Quit,
}

/// The position in the recording.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Player {
    last: usize,
    at: f64,
    is_paused: bool,
    has_ended: bool,
}

impl Player {
    fn new(frames: usize) -> Self {
        Player {
            last: frames.saturating_sub(1),
            at: 0.0,
            is_paused: false,
            has_ended: false,
        }
    }

    fn frame(&self) -> usize {
        (self.at as usize).min(self.last)
    }

    fn press(&mut self, key: Key) {
        match key {
            Key::Pause => self.is_paused = !self.is_paused,
            Key::Quit => self.has_ended = true,
            // A single step pauses.
            Key::Forward => {
                (self.at, self.is_paused) = ((self.frame() + 1).min(self.last) as f64, true)
            }
            Key::Back => (self.at, self.is_paused) = (self.frame().saturating_sub(1) as f64, true),
        }
    }

    fn pass(&mut self, time: Duration) {
        if !self.is_paused {
            // Displays the last frame before the end.
            self.has_ended |= self.frame() == self.last;
            self.at = (self.at + STEPS_PER_SECOND * time.as_secs_f64()).min(self.last as f64);
        }
    }
}

/// Plays a recording, or writes only its last frame if stdout is no terminal for people. The
/// terminal is restored in any case.
pub(crate) fn play(console: &Console, walk: &Walk) -> Result<(), Error> {
    let variable = |name| std::env::var(name).unwrap_or_default();
    let depth = Depth::of(
        console.has_colour(),
        &variable("COLORTERM"),
        &variable("TERM"),
    );
    let Some(mut live) = console.live() else {
        let (columns, rows) = view(USUAL, false);
        match console.mode() {
            Mode::Json => console.line(&terminal::frame(
                walk,
                walk.frames() - 1,
                columns,
                rows,
                Depth::Plain,
            )),
            _ => console
                .text(&(terminal::frame(walk, walk.frames() - 1, columns, rows, depth) + "\n")),
        }
        return Ok(());
    };
    let stop = signals::stop_flag()?;
    let screen = Screen::new(console);
    let mut player = Player::new(walk.frames());
    let mut shown = None;
    let mut place = terminal_size();
    let mut then = Instant::now();
    while !player.has_ended && !console.is_closed() {
        if stop.load(Ordering::Relaxed) {
            return Err(Error::stopped("stopped by a signal".to_string()));
        }
        let now = terminal_size();
        if now != place {
            // The terminal rewrapped the lines: begin on a clean screen.
            console.text("\x1b[2J\x1b[H");
            (place, shown) = (now, None);
            live = console.live().unwrap_or(live);
        }
        if shown != Some((player.frame(), player.is_paused)) {
            shown = Some((player.frame(), player.is_paused));
            let (columns, rows) = view(place, screen.has_keys);
            let mut picture = terminal::frame(walk, player.frame(), columns, rows, depth);
            if screen.has_keys {
                let word = if player.is_paused {
                    "space plays on"
                } else {
                    "space pauses "
                };
                let line: String = format!("{word}   , . step   q quits")
                    .chars()
                    .take(columns)
                    .collect();
                picture += &format!("\n{line}\x1b[K");
            }
            // In raw mode, the terminal does not return to the first column by itself.
            live.show(&picture.replace('\n', "\r\n"));
        }
        if let Some(key) = screen.wait(TICK.saturating_sub(then.elapsed())) {
            player.press(key);
        }
        // A key neither stops the clock nor makes it faster.
        let elapsed = then.elapsed();
        if elapsed >= TICK {
            player.pass(elapsed);
            then = Instant::now();
        }
    }
    Ok(())
}

fn terminal_size() -> (u16, u16) {
    size()
        .ok()
        .filter(|(columns, rows)| *columns > 0 && *rows > 0)
        .unwrap_or(USUAL)
}

/// Returns the picture's columns and rows, less a free column and line, and a line for the keys.
fn view((columns, rows): (u16, u16), has_keys: bool) -> (usize, usize) {
    let free = if has_keys { 2 } else { 1 };
    let (columns, rows) = (
        usize::from(columns).saturating_sub(1),
        usize::from(rows).saturating_sub(free),
    );
    (columns.clamp(1, LARGEST.0), rows.clamp(1, LARGEST.1))
}

/// The terminal during playback, without a cursor and with immediate keys. It is restored on drop.
struct Screen<'c> {
    console: &'c Console,
    has_keys: bool,
}

impl<'c> Screen<'c> {
    fn new(console: &'c Console) -> Self {
        let has_keys = std::io::stdin().is_terminal() && enable_raw_mode().is_ok();
        console.text("\x1b[?25l");
        Screen { console, has_keys }
    }

    /// Returns the next known key, if it comes in time.
    fn wait(&self, time: Duration) -> Option<Key> {
        let is_there = self.has_keys && event::poll(time).unwrap_or(false);
        if !is_there {
            if !self.has_keys {
                std::thread::sleep(time);
            }
            return None;
        }
        meaning(&event::read().ok()?)
    }
}

impl Drop for Screen<'_> {
    fn drop(&mut self) {
        if self.has_keys {
            // If that fails, the terminal is gone.
            let _ = disable_raw_mode();
        }
        self.console.text("\r\x1b[0m\x1b[?25h");
    }
}

fn meaning(event: &Event) -> Option<Key> {
    let Event::Key(key) = event else { return None };
    if key.kind == KeyEventKind::Release {
        return None;
    }
    match key.code {
        KeyCode::Char('c' | 'd') if key.modifiers.contains(KeyModifiers::CONTROL) => {
            Some(Key::Quit)
        }
        KeyCode::Char('q') | KeyCode::Esc => Some(Key::Quit),
        KeyCode::Char(' ') => Some(Key::Pause),
        KeyCode::Char('.') | KeyCode::Right => Some(Key::Forward),
        KeyCode::Char(',') | KeyCode::Left => Some(Key::Back),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crossterm::event::KeyEvent;

    #[test]
    fn a_film_runs_at_the_robots_speed_and_ends_after_its_last_frame() {
        let mut player = Player::new(101);
        player.pass(Duration::from_secs(1));
        assert_eq!((player.frame(), player.has_ended), (50, false));
        player.pass(Duration::from_secs(9));
        assert_eq!((player.frame(), player.has_ended), (100, false));
        player.pass(TICK);
        assert!(player.has_ended);
        let mut single = Player::new(1);
        single.pass(TICK);
        assert!(single.has_ended);
    }

    #[test]
    fn a_film_can_be_held_stepped_and_left() {
        let mut player = Player::new(4);
        player.press(Key::Pause);
        player.pass(Duration::from_secs(1));
        assert_eq!(player.frame(), 0);
        for _ in 0..9 {
            player.press(Key::Forward);
        }
        assert_eq!(
            (player.frame(), player.is_paused, player.has_ended),
            (3, true, false)
        );
        player.press(Key::Back);
        assert_eq!(player.frame(), 2);
        player.press(Key::Pause);
        player.pass(Duration::from_millis(20));
        assert_eq!(player.frame(), 3);
        player.press(Key::Quit);
        assert!(player.has_ended);
    }

    #[test]
    fn keys_mean_what_the_line_below_says() {
        let key = |code, modifiers| meaning(&Event::Key(KeyEvent::new(code, modifiers)));
        let plain = KeyModifiers::NONE;
        assert_eq!(key(KeyCode::Char(' '), plain), Some(Key::Pause));
        assert_eq!(key(KeyCode::Char('.'), plain), Some(Key::Forward));
        assert_eq!(key(KeyCode::Left, plain), Some(Key::Back));
        assert_eq!(key(KeyCode::Char('q'), plain), Some(Key::Quit));
        assert_eq!(
            key(KeyCode::Char('c'), KeyModifiers::CONTROL),
            Some(Key::Quit)
        );
        assert_eq!(
            (
                key(KeyCode::Char('c'), plain),
                meaning(&Event::Resize(1, 1))
            ),
            (None, None)
        );
    }

    #[test]
    fn any_terminal_has_room_for_a_view() {
        assert_eq!(view((80, 24), true), (79, 22));
        assert_eq!(view((0, 0), true), (1, 1));
        assert_eq!(view((u16::MAX, u16::MAX), false), LARGEST);
    }
}
