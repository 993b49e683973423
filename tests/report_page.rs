//! A report in a real browser: a click on a cell plays its robot, at every width, without
//! complaints and from a file.
#![allow(clippy::disallowed_methods)]
#![cfg(unix)]

mod common;

use common::browser::{Browser, found};
use common::program::{Sandbox, TINY};
use std::io::Write;

#[test]
fn a_click_on_a_cell_plays_its_robot() {
    let sandbox = Sandbox::new();
    let Some(program) = found() else {
        let text = "SKIPPED: no Chromium found (MORPHCOG_BROWSER may name one); the report is not tested\n";
        std::io::stderr().write_all(text.as_bytes()).unwrap();
        return;
    };
    sandbox.write("tiny.toml", TINY);
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    sandbox.run("eval -q --archive run/run.json --images 20 --cycles 1 --robots top:3").ended(0, &[]);
    sandbox.run("report run").ended(0, &[]);
    let address = format!("file://{}", sandbox.path("run/report.html").display());
    let mut browser = Browser::start(&program, &sandbox);
    for (width, height, dark) in [(1280, 900, false), (390, 844, true)] {
        let mut tab = browser.tab(width, height, dark);
        tab.open(&address);
        // The fittest robot is there from the beginning.
        let playing = "document.querySelector('iframe')?.contentDocument?.getElementById('label')?.textContent.length > 0";
        tab.wait(playing);
        let chosen = "document.querySelector('.cells [aria-pressed=true]').dataset.robot";
        let fittest = tab.eval(chosen);
        let mut elites = sandbox.run_file("run").elites;
        elites.sort_by(|a, b| b.objective.total_cmp(&a.objective));
        assert_eq!(fittest, elites[0].id.as_str());
        // Another one, by a click; what is played is that one.
        let other = &elites[1].id;
        tab.eval(&format!("document.querySelector('.cells [data-robot=\"{other}\"]').click()"));
        tab.wait(&format!("document.querySelector('.about').textContent.startsWith('{other}')"));
        tab.wait(&format!(
            "{playing} && JSON.parse(document.querySelector('iframe').contentDocument.getElementById('rollout').textContent).robot === '{other}'"
        ));
        assert_eq!(tab.eval(chosen), other.as_str());
        // From cell to cell by keys.
        tab.eval("document.querySelector('.cells button').focus()");
        tab.key("ArrowRight", "");
        let second = "document.activeElement === document.querySelectorAll('.map button')[1]";
        assert_eq!(tab.eval(second), true);
        let wide = tab.eval("document.documentElement.scrollWidth").as_u64().unwrap();
        assert!(wide <= u64::from(width), "{wide} pixels wide");
        assert_eq!(tab.complaints(), Vec::<String>::new());
        tab.close();
    }
}
