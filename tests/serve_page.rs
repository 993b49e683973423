//! The page of `morphcog serve` in a real browser: what is drawn is walked, at every width, without
//! complaints.
#![allow(clippy::disallowed_methods)]
#![cfg(unix)]

mod common;

use common::browser::{Browser, Tab, found};
use common::program::Sandbox;
use common::server::Server;
use serde_json::Value;
use std::f64::consts::TAU;
use std::io::Write;
use std::time::{Duration, Instant};

/// A browser if there is one; says so past the harness, which keeps the output of passing tests to
/// itself, if not.
fn browser(sandbox: &Sandbox) -> Option<Browser> {
    let program = found();
    if program.is_none() {
        let text =
            "SKIPPED: no Chromium found (MORPHCOG_BROWSER may name one); the page of serve is not tested\n";
        std::io::stderr().write_all(text.as_bytes()).unwrap();
    }
    Some(Browser::start(&program?, sandbox))
}

fn open(tab: &mut Tab, server: &Server) {
    tab.open(&server.url());
    tab.wait("document.documentElement?.dataset.ready === 'yes'");
}

/// Draws on the pad with the mouse; places in pixels of the drawing.
fn draw(tab: &mut Tab, line: &[[f64; 2]]) {
    tab.click("#clear");
    let [x, y, width, height] = tab.place("#pad");
    let on_page: Vec<[f64; 2]> =
        line.iter().map(|[c, r]| [x + c / 28.0 * width, y + r / 28.0 * height]).collect();
    tab.drag(&on_page);
}

fn zero() -> Vec<[f64; 2]> {
    let place = |k: u32| {
        let angle = TAU * f64::from(k) / 40.0;
        [14.0 + 5.5 * angle.sin(), 14.0 - 8.5 * angle.cos()]
    };
    (0..=40).map(place).collect()
}

fn one() -> Vec<[f64; 2]> {
    (0..=12).map(|k| f64::from(k) / 12.0).map(|t| [16.0 - 4.0 * t, 5.0 + 18.0 * t]).collect()
}

/// Waits for the end of the simulation under the picture that was chosen last.
fn at_end(tab: &mut Tab) {
    tab.wait("document.documentElement.dataset.state === 'over'");
}

/// What the robot says in the end of the simulation under a drawing.
fn answer(tab: &mut Tab, line: &[[f64; 2]]) -> (String, String) {
    draw(tab, line);
    at_end(tab);
    (tab.text("#says"), tab.text("#moved"))
}

#[test]
fn a_drawn_zero_and_a_drawn_one_are_told_apart_and_the_page_fits_everywhere() {
    let sandbox = Sandbox::new();
    let Some(mut browser) = browser(&sandbox) else { return };
    let server = Server::start(&sandbox, "");

    let mut tab = browser.tab(1280, 900, false);
    open(&mut tab, &server);
    assert_eq!(tab.text("#who"), "QMAXD");
    tab.eval("(() => { const s = document.getElementById('speed'); s.value = '0'; s.onchange(); })()");
    // QMAXD walks right under a zero, left under a one.
    let (says, moved) = answer(&mut tab, &zero());
    assert!(says == "0" && moved.ends_with("right"), "{says}: {moved}");
    let (says, moved) = answer(&mut tab, &one());
    assert!(says == "1" && moved.ends_with("left"), "{says}: {moved}");
    let spoken = tab.text("#spoken");
    assert!(spoken.starts_with("QMAXD sees your drawing. It says 1: moved "), "{spoken}");

    // The same without a mouse: the pen is put down, moved and lifted by keys.
    tab.click("#clear");
    tab.eval("document.getElementById('pad').focus()");
    tab.key(" ", " ");
    (0..6).for_each(|_| tab.key("ArrowDown", ""));
    tab.key(" ", " ");
    at_end(&mut tab);
    let by_keys = tab.text("#spoken");
    assert!(by_keys.starts_with("QMAXD sees your drawing.") && by_keys != spoken, "{by_keys}");

    // Another robot, a test image of a known class, the editor.
    tab.click("[data-robot=YJTLA]");
    assert_eq!(tab.text("#who"), "YJTLA");
    tab.click("#tab-test");
    tab.click("#thumbs button");
    at_end(&mut tab);
    let judged = tab.eval("document.getElementById('verdict').dataset.state");
    assert!(["right", "wrong", "none"].contains(&judged.as_str().unwrap()), "{judged}");
    tab.click("#tab-editor");
    tab.wait("document.getElementById('checked').dataset.state === 'good'");
    tab.click("#live");
    assert_eq!(tab.text("#who"), "Your body");
    tab.click("#empty");
    tab.wait("document.getElementById('checked').dataset.state === 'bad' && document.getElementById('live').disabled");
    tab.click("#unpaint");
    tab.wait("!document.getElementById('live').disabled");
    assert_eq!(tab.eval("document.getElementById('error').hidden"), true);
    assert_eq!(tab.complaints(), Vec::<String>::new());
    tab.close();

    for (width, height, dark) in [(390, 844, false), (1280, 900, true)] {
        let mut tab = browser.tab(width, height, dark);
        open(&mut tab, &server);
        tab.wait("document.getElementById('moved').textContent.startsWith('moved')");
        let wide = tab.eval("document.documentElement.scrollWidth").as_u64().unwrap();
        assert!(wide <= u64::from(width), "{wide} pixels wide");
        // Nothing that can be used sticks out, and all of it has a name.
        let nameless = "[...document.querySelectorAll('button, select, input, canvas')].filter((e) => \
         e.offsetParent && \
             !(e.textContent.trim() || e.ariaLabel || e.title || e.labels?.length || e.closest('button'))).length";
        assert_eq!(tab.eval(nameless), 0);
        let shot = tab.screenshot();
        assert!(shot.len() > 20_000, "{} bytes", shot.len());
        if let Some(folder) = std::env::var_os("MORPHCOG_SCREENSHOTS") {
            std::fs::write(std::path::Path::new(&folder).join(format!("serve-{width}.png")), shot).unwrap();
        }
        assert_eq!(tab.complaints(), Vec::<String>::new());
        tab.close();
    }
}

#[test]
fn a_simulation_ends_with_its_tab() {
    let sandbox = Sandbox::new();
    let Some(mut browser) = browser(&sandbox) else { return };
    let server = Server::start(&sandbox, "");
    let simulations = || -> Value {
        let status: Value = serde_json::from_str(&server.get("/api/status").body).unwrap();
        status["simulations"].clone()
    };
    let mut tab = browser.tab(800, 600, false);
    open(&mut tab, &server);
    tab.wait("document.getElementById('step').textContent.startsWith('step ')");
    tab.eval("document.getElementById('play').click()");
    assert_eq!(simulations(), 1);
    tab.close();
    let until = Instant::now() + Duration::from_secs(5);
    while simulations() != 0 {
        assert!(Instant::now() < until, "{} simulations", simulations());
        std::thread::sleep(Duration::from_millis(30));
    }
}
