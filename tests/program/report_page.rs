//! A report in a real browser: a click on a cell plays its robot, at every width, without
//! complaints and from a file.
#![allow(clippy::disallowed_methods)]
#![cfg(unix)]

use crate::common::browser::{Browser, found, keep_picture};
use crate::common::program::{Sandbox, TINY, pairs};
use morphcog::store::team::TeamFile;
use serde_json::json;

#[test]
fn a_click_on_a_cell_plays_its_robot() {
    let sandbox = Sandbox::new();
    let Some(program) = found() else { return };
    sandbox.write("tiny.toml", TINY);
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    sandbox
        .run("eval -q --archive run/run.json --images 20 --cycles 1 --robots top:3")
        .ended(0, &[]);
    sandbox.run("report run").ended(0, &[]);
    let address = format!("file://{}", sandbox.path("run/report.html").display());
    let mut browser = Browser::start(&program, &sandbox);
    for (width, height, dark) in [(1280, 900, false), (390, 844, true)] {
        let mut tab = browser.tab(width, height, dark);
        tab.open(&address);
        // The fittest robot is there from the beginning.
        let playing = "document.querySelector('iframe')?.contentDocument\
                       ?.getElementById('label')?.textContent.length > 0";
        tab.wait(playing);
        let chosen = "document.querySelector('.cells [aria-pressed=true]').dataset.robot";
        let fittest = tab.eval(chosen);
        let mut elites = sandbox.run_file("run").elites;
        elites.sort_by(|a, b| b.objective.total_cmp(&a.objective));
        assert_eq!(fittest, elites[0].id.as_str());
        // Another one, by a click; what is played is that one.
        let other = &elites[1].id;
        tab.eval(&format!(
            "document.querySelector('.cells [data-robot=\"{other}\"]').click()"
        ));
        tab.wait(&format!(
            "document.querySelector('.about').textContent.startsWith('{other}')"
        ));
        tab.wait(&format!(
            "{playing} && JSON.parse(document.querySelector('iframe').contentDocument\
             .getElementById('rollout').textContent).robot === '{other}'"
        ));
        assert_eq!(tab.eval(chosen), other.as_str());
        // From cell to cell by keys.
        tab.eval("document.querySelector('.cells button').focus()");
        tab.key("ArrowRight", "");
        let second = "document.activeElement === document.querySelectorAll('.map button')[1]";
        assert_eq!(tab.eval(second), true);
        let wide = tab
            .eval("document.documentElement.scrollWidth")
            .as_u64()
            .unwrap();
        assert!(wide <= u64::from(width), "{wide} pixels wide");
        assert_eq!(tab.complaints(), Vec::<String>::new());
        tab.close();
    }
}

#[test]
fn only_the_map_of_the_chosen_task_and_the_chosen_robot_are_seen() {
    let Some(program) = found() else { return };
    let sandbox = Sandbox::new();
    let tasks = TINY.replace("groups = [[0], [1]]", "splits = [0, 1, 2]");
    sandbox.write(
        "tasks.toml",
        tasks.replace("train_images = [0, 1]", "images_per_class = 1"),
    );
    sandbox.run("evolve -q -c tasks.toml -o run").ended(0, &[]);
    sandbox.run("report -q run --rollouts 2").ended(0, &[]);
    let mut browser = Browser::start(&program, &sandbox);
    let mut tab = browser.tab(1280, 900, false);
    tab.open(&format!(
        "file://{}",
        sandbox.path("run/report.html").display()
    ));
    let playing = "document.querySelector('iframe')?.contentDocument?.getElementById('label')";
    tab.wait(playing);
    // One map at a time.
    let seen = "[...document.querySelectorAll('.map')].filter((map) => map.offsetHeight > 0)\
                .map((map) => map.dataset.task).join()";
    // At first that of the robot that is played.
    let first =
        tab.eval("document.querySelector('[data-first]').closest('[data-task]').dataset.task");
    assert_eq!(tab.eval(seen), first);
    let tasks = tab
        .eval("document.querySelector('select.task').options.length")
        .as_u64()
        .unwrap();
    assert!(tasks > 1, "{tasks}");
    for task in (0..tasks).rev() {
        tab.eval(&format!(
            "(() => {{ const s = document.querySelector('select.task'); s.value = '{task}'; \
             s.dispatchEvent(new Event('change')); }})()"
        ));
        assert_eq!(tab.eval(seen), task.to_string());
    }
    // Of a robot whose rollout is not there, or is damaged, no other one is seen in its place.
    let height = "document.querySelector('iframe').offsetHeight";
    let mut click = |robot: &str, says: &str, is_seen: bool| {
        tab.eval(&format!(
            "document.querySelector('button[data-robot]{robot}').click()"
        ));
        tab.wait(&format!(
            "document.querySelector('.about').textContent.includes('{says}')"
        ));
        assert_eq!(tab.eval(&format!("{height} > 0")), is_seen, "{robot}");
    };
    click("[data-rollout=\"\"]", "not in this report", false);
    click("[data-first]", "fitness", true);
    let damaged = "[data-rollout]:not([data-rollout=\"\"]):not([data-first])";
    click(damaged, "fitness", true);
    tab.eval(&format!(
        "document.getElementById(document.querySelector('button{damaged}').dataset.rollout).textContent = 'AAAA'"
    ));
    tab.eval(&format!(
        "document.querySelector('button{damaged}').click()"
    ));
    tab.wait("document.querySelector('.about').textContent.includes('cannot unpack')");
    assert_eq!(tab.eval(height), 0);
    assert_eq!(tab.complaints(), Vec::<String>::new());
    tab.close();
}

#[test]
fn a_team_walks_on_the_page_and_says_there_what_it_said_in_its_test() {
    let Some(program) = found() else { return };
    let sandbox = pairs();
    let runs = "--archive pairs/0v1 pairs/0v4 pairs/1v4";
    sandbox
        .run(&format!("team -q {runs} --classes 0,1,4 --images 6"))
        .ended(0, &[]);
    sandbox
        .run(&format!("report -q {runs} --rollouts 3"))
        .ended(0, &[]);
    let team = TeamFile::read(&sandbox.path("pairs/team.json")).unwrap();
    let answers = team.answers.unwrap().votes.answers;
    let address = format!("file://{}", sandbox.path("pairs/report.html").display());
    let mut browser = Browser::start(&program, &sandbox);
    for (width, height, dark) in [(1280, 900, false), (390, 844, true)] {
        let mut tab = browser.tab(width, height, dark);
        tab.open(&address);
        tab.wait("document.querySelectorAll('#team .stages figure').length === 3");
        tab.wait("document.querySelector('#team .says').textContent.startsWith('step ')");
        for (number, class) in team.classes.iter().enumerate() {
            let place = team
                .images
                .iter()
                .position(|image| image.label == *class)
                .unwrap();
            tab.eval(&format!(
                "document.querySelectorAll('#team .watch button')[{number}].click()"
            ));
            tab.wait(&format!(
                "document.getElementById('team').dataset.walks === 'team-{number}'"
            ));
            let end = "const time = document.querySelector('#team input'); time.value = time.max; \
                       time.dispatchEvent(new Event('input'))";
            tab.eval(&format!("(() => {{ {end} }})()"));
            let verdict = if answers[place] == *class {
                "correct"
            } else {
                "wrong"
            };
            assert_eq!(
                tab.text("#team .says"),
                format!("step 500 says {}: {verdict}", answers[place])
            );
            // Who walked farther than the threshold has voted.
            let turned = "document.querySelectorAll('#team figure:is([data-way=left], [data-way=right])').length";
            let voted = team
                .members
                .iter()
                .filter(|m| m.displacements[place].is_some_and(|d| d.abs() > team.threshold));
            assert_eq!(tab.eval(turned), voted.count());
        }
        keep_picture(&format!("report-team-{width}.png"), &tab.screenshot());
        let wide = tab
            .eval("document.documentElement.scrollWidth")
            .as_u64()
            .unwrap();
        assert!(wide <= u64::from(width), "{wide} pixels wide");
        assert_eq!(tab.complaints(), Vec::<String>::new());
        tab.close();
    }
    // A team of other runs is not theirs.
    let said = sandbox
        .run("report --archive pairs/0v1 pairs/0v4 --rollouts 0")
        .ended(0, &[]);
    assert!(said.err.contains("team.json: "), "{}", said.err);
}

/// Images of 26 classes in `letters/`, and runs of them: half of the classes against the other half,
/// and single ones against all others.
fn letters() -> Sandbox {
    let sandbox = Sandbox::new();
    for (split, count) in [("train", 52_u8), ("t10k", 104)] {
        let label = |image: u8| 1 + image % 26;
        let is_ink = |image: u8, pixel: u8| u32::from(pixel / 3) * u32::from(label(image)) % 7 < 3;
        let pixel = |image: u8, pixel: u8| if is_ink(image, pixel) { 255 } else { image };
        let pixels: Vec<u8> = (0..count)
            .flat_map(|image| (0..100).map(move |p| pixel(image, p)))
            .collect();
        let header = [0, 0, 8, 3, 0, 0, 0, count, 0, 0, 0, 10, 0, 0, 0, 10];
        sandbox.write(
            &format!("letters/{split}-images-idx3-ubyte"),
            [&header[..], &pixels].concat(),
        );
        let header = [0, 0, 8, 1, 0, 0, 0, count];
        let labels: Vec<u8> = (0..count).map(label).collect();
        sandbox.write(
            &format!("letters/{split}-labels-idx1-ubyte"),
            [&header[..], &labels].concat(),
        );
    }
    let groups = [vec![1], vec![13], vec![26], (1..=13).collect::<Vec<u8>>()];
    for (number, first) in groups.into_iter().enumerate() {
        let rest: Vec<u8> = (1..=26).filter(|class| !first.contains(class)).collect();
        let config = TINY
            .replace(
                "groups = [[0], [1]]",
                &format!("groups = [{first:?}, {rest:?}]"),
            )
            .replace("dataset = \"builtin\"", "dataset = \"letters\"")
            .replace("train_images = [0, 1]", "images_per_class = 1");
        sandbox.write("run.toml", config);
        sandbox
            .run(&format!(
                "evolve -q -c run.toml -g 3 --data letters -o runs/{number}"
            ))
            .ended(0, &[]);
    }
    sandbox
}

#[test]
fn with_26_classes_nothing_on_the_page_covers_anything_else() {
    let Some(program) = found() else { return };
    let sandbox = letters();
    let runs = "--archive runs/0 runs/1 runs/2 runs/3";
    sandbox
        .run("eval -q --archive runs/3 --images 26 --robots top:3")
        .ended(0, &[]);
    sandbox
        .run(&format!("team -q {runs} --images 104"))
        .ended(0, &[]);
    sandbox
        .run(&format!("report -q {runs} --rollouts 1"))
        .ended(0, &[]);
    // The same with names of three to fifteen letters: only the team's file has these, and its pages.
    let names: Vec<String> = std::iter::once(String::new())
        .chain((0..26_u8).map(|k| {
            let letter = char::from(b'a' + k).to_string();
            letter.repeat(3 + usize::from(k) % 13)
        }))
        .collect();
    sandbox.write(
        "letters/dataset.json",
        json!({ "format": "morphcog-dataset", "format_version": 1, "class_names": names })
            .to_string(),
    );
    sandbox
        .run(&format!("team {runs} --images 104"))
        .ended(0, &["(416 of 416 walks known"]);
    sandbox
        .run(&format!("report -q {runs} --rollouts 1 -o runs/named.html"))
        .ended(0, &[]);
    let mut browser = Browser::start(&program, &sandbox);
    for (page, width, height, dark) in [
        ("report", 1280, 900, false),
        ("report", 390, 844, true),
        ("named", 1280, 900, false),
        ("named", 390, 844, true),
    ] {
        let mut tab = browser.tab(width, height, dark);
        let path = sandbox.path(&format!("runs/{page}.html"));
        tab.open(&format!("file://{}", path.display()));
        tab.wait(
            "document.querySelector('.stages figcaption') && document.querySelector('.tally li')",
        );
        let first = if page == "named" { "aaa" } else { "1" };
        assert_eq!(
            tab.eval("document.querySelector('.tally b').textContent"),
            first
        );
        keep_picture(&format!("{page}-26-{width}.png"), &tab.screenshot());
        // Words of a figure, what stands beside each other, and what stands in a button.
        let covered = "(() => {
           const box = (e) => e.getBoundingClientRect(), found = [];
           const aside = (a, b) => a.right <= b.left + 1 || b.right <= a.left + 1;
           const apart = (a, b) => aside(a, b) || a.bottom <= b.top + 2 || b.bottom <= a.top + 2;
           const check = (all) => all.forEach((a, i) => all.slice(i + 1).forEach((b) => {
             if (!apart(box(a), box(b))) found.push(a.textContent + ' / ' + b.textContent);
           }));
           const seen = (e) => e.textContent && box(e).width > 0;
           const texts = (svg) => [...svg.querySelectorAll('text')];
           document.querySelectorAll('.figure svg').forEach((svg) => check(texts(svg).filter(seen)));
           document.querySelectorAll('.tally li, .stages figcaption, .watch button, .bodies button')
             .forEach((e) => check([...e.children].filter(seen)));
           document.querySelectorAll('.bodies button *, .stages figcaption *').forEach((e) => {
             const own = box(e), room = box(e.closest('button, figcaption'));
             const is = own.right > room.right + 1 || own.left < room.left - 1;
             if (is) found.push('sticks out: ' + e.tagName + ' ' + e.textContent);
           });
           document.querySelectorAll('.figure svg').forEach((svg) => texts(svg).forEach((e) => {
             const is = box(e).right > box(svg).right + 1 || box(e).left < box(svg).left - 1;
             if (is) found.push('cut off: ' + e.textContent);
           }));
           return found;
         })()";
        assert_eq!(tab.eval(covered), json!([]), "{page}, {width} pixels");
        let wide = tab
            .eval("document.documentElement.scrollWidth")
            .as_u64()
            .unwrap();
        assert!(wide <= u64::from(width), "{wide} pixels wide");
        assert_eq!(tab.complaints(), Vec::<String>::new());
        tab.close();
    }
}
