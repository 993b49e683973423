//! `replay` and the published robots.

use crate::common::program::{Sandbox, files};
use crate::with_run;

#[test]
fn replay_writes_a_gif_and_a_page_beside_the_run() {
    let sandbox = with_run();
    let said = sandbox
        .run("replay --robot best -a run/run.json --every 5")
        .ended(0, &[]);
    let id = &sandbox
        .run_file("run")
        .elites
        .iter()
        .max_by(|a, b| a.objective.total_cmp(&b.objective))
        .unwrap()
        .id
        .clone();
    let gif = std::fs::read(sandbox.path(&format!("run/replay-{id}.gif"))).unwrap();
    assert!(gif.starts_with(b"GIF89a") && gif.ends_with(b";"));
    let page = sandbox.read(&format!("run/replay-{id}.html"));
    assert!(page.contains("<canvas") && page.contains(id));
    assert!(
        !page.contains("http://") && !page.contains("https://"),
        "it must work without a network"
    );
    assert!(
        said.out.contains(&format!("replay-{id}.gif")) && said.out.contains("0 (train 0)"),
        "{}",
        said.out
    );
}

#[test]
fn replay_shows_the_images_and_formats_it_is_asked_for() {
    let sandbox = with_run();
    let said = sandbox
        .run("replay -a run/run.json -i test:17,3 -o here.png --width 400")
        .ended(0, &[]);
    assert!(
        said.out.contains("7 (test 17)") && said.out.contains("3 (train 3)"),
        "{}",
        said.out
    );
    assert!(
        std::fs::read(sandbox.path("here.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );
    let view = sandbox
        .run("replay -a run/run.json --format terminal")
        .ended(0, &[]);
    assert!(
        view.out.lines().count() > 10 && !view.out.contains('\x1b'),
        "{}",
        view.out
    );
    sandbox
        .run("replay -a run/run.json -i test:99999999")
        .ended(2, &["--images", "99999999"]);
    // A folder of the name that the pictures have but for their endings is no hindrance.
    std::fs::create_dir(sandbox.path("walk")).unwrap();
    sandbox
        .run("replay -a run/run.json -o walk --format png")
        .ended(0, &[]);
    sandbox
        .run("plot body -a run/run.json -o walk")
        .ended(0, &[]);
    assert!(sandbox.path("walk.png").exists() && sandbox.path("walk.svg").exists());
    sandbox
        .run("replay -a run/run.json -o nowhere/walk.gif")
        .ended(1, &["nowhere/walk.gif"]);
    sandbox
        .run("replay -a run/run.json -o walk.avi")
        .ended(2, &["walk.avi", ".gif"]);
    for width in ["0", "1", "4294967295"] {
        sandbox
            .run(&format!(
                "replay -a run/run.json -o walk.gif --width {width}"
            ))
            .ended(2, &["--width"]);
    }
    let many = vec!["1"; 21].join(",");
    sandbox
        .run(&format!("replay -a run/run.json -i {many}"))
        .ended(2, &["--images", "20"]);
}

#[test]
fn a_published_robot_replays_on_the_built_in_digits_without_any_run() {
    let sandbox = Sandbox::new();
    let table = sandbox.run("gallery").ended(0, &[]).out;
    assert!(
        ["APUKI", "IHSUJ", "QMAXD", "XFJPI", "YJTLA"]
            .iter()
            .all(|name| table.contains(name)),
        "{table}"
    );
    sandbox
        .run("replay --robot xfjpi --dataset builtin --every 50")
        .ended(0, &[]);
    assert!(
        sandbox.path("replay-XFJPI.gif").exists() && sandbox.path("replay-XFJPI.html").exists()
    );
    sandbox
        .run("replay --robot XFJPI")
        .ended(3, &["mnist", "--dataset builtin"]);
    sandbox.run("replay --robot nobody").ended(3, &["runs/"]);
}

#[test]
fn the_newest_run_is_what_commands_look_at_when_they_are_not_told() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -g 2").ended(0, &[]);
    assert!(sandbox.path("runs/tiny-seed3/run.json").exists());
    sandbox
        .run("evolve -q -c tiny.toml -g 2 --seed 8")
        .ended(0, &[]);
    assert!(sandbox.path("runs/tiny-seed8/run.json").exists());
    sandbox
        .run("eval -q -n 2 --cycles 1 --robots best")
        .ended(0, &[]);
    assert!(sandbox.path("runs/tiny-seed8/eval.json").exists());
    sandbox.run("replay -q --format png").ended(0, &[]);
    assert!(
        files(&sandbox.path("runs/tiny-seed8"))
            .keys()
            .any(|name| name.ends_with(".png"))
    );
}

#[test]
fn evolve_with_replay_leaves_the_pictures_in_the_run_folder() {
    let sandbox = Sandbox::tiny();
    sandbox
        .run("evolve -q -c tiny.toml -g 2 -o run --replay")
        .ended(0, &[]);
    let names: Vec<String> = files(&sandbox.path("run")).into_keys().collect();
    assert!(
        names.iter().any(|name| name.ends_with(".gif"))
            && names.iter().any(|name| name.ends_with(".html"))
    );
}
