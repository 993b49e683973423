//! The page about runs: whole in itself, with what there is, and the same every time.

use crate::common::program::{Sandbox, TINY};

fn sandbox() -> Sandbox {
    let sandbox = Sandbox::new();
    sandbox.write("tiny.toml", TINY);
    for seed in [3, 4] {
        sandbox
            .run(&format!(
                "evolve -q -c tiny.toml --seed {seed} -o runs/{seed}"
            ))
            .ended(0, &[]);
    }
    sandbox
}

/// Text between two marks, all of them.
fn between<'a>(text: &'a str, begin: &str, end: &str) -> Vec<&'a str> {
    text.split(begin)
        .skip(1)
        .filter_map(|rest| rest.split_once(end))
        .map(|(inner, _)| inner)
        .collect()
}

#[test]
fn every_elite_can_be_played_and_nothing_is_loaded() {
    let sandbox = sandbox();
    let said = sandbox.run("report runs/3").ended(0, &[]);
    assert!(said.out.contains("report.html"), "{}", said.out);
    let page = sandbox.read("runs/3/report.html");
    for forbidden in ["http://", "https://", "src=", "@import", "url(", "<link"] {
        let found = page
            .replace("http://www.w3.org/2000/svg", "")
            .contains(forbidden);
        assert!(!found, "{forbidden}");
    }
    let run = sandbox.run_file("runs/3");
    let rollouts = between(&page, "data-rollout=\"", "\"");
    assert!(!run.elites.is_empty());
    for elite in &run.elites {
        let id = format!("rollout-0-{}", elite.id);
        assert!(
            rollouts.contains(&id.as_str()) && page.contains(&format!("id=\"{id}\"")),
            "{id}"
        );
    }
    // What is packed is a rollout of that robot.
    let id = &run.elites[0].id;
    let packed = between(&page, &format!("id=\"rollout-0-{id}\">"), "</script>")[0];
    let bytes = base64::Engine::decode(&base64::engine::general_purpose::STANDARD, packed).unwrap();
    let rollout: serde_json::Value =
        serde_json::from_reader(flate2::read::GzDecoder::new(&bytes[..])).unwrap();
    assert_eq!(rollout["robot"], id.as_str());
    assert_eq!(rollout["phases"].as_array().unwrap().len(), 2);
    let walked = rollout["phases"][0]["displacement"].as_f64().unwrap();
    assert!((walked - run.elites[0].displacements[0]).abs() < 1e-9);
    sandbox
        .run("report runs/3/run.json -o again.html")
        .ended(0, &[]);
    let same = |page: &str| page.replace("runs/3/run.json", "").replace("runs/3", "");
    assert_eq!(same(&sandbox.read("again.html")), same(&page));
}

#[test]
fn what_lies_beside_the_run_is_in_it_and_several_runs_go_together() {
    let sandbox = sandbox();
    sandbox
        .run("eval -q --archive runs/3/run.json --images 20 --cycles 1 --robots top:3")
        .ended(0, &[]);
    sandbox
        .run("audit -q --archive runs/3/run.json")
        .ended(0, &[]);
    sandbox
        .run("capacity -q --eval runs/3/eval.json --set trainings=2 --set sizes=[1,4]")
        .ended(0, &[]);
    sandbox.run("report runs/3 runs/4").ended(0, &[]);
    let page = sandbox.read("runs/report.html");
    for part in [
        "All runs together",
        "<h2>Audit</h2>",
        "Test on held-out images",
        "Capacity",
        "run1",
        "Methods",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(page.contains("id=\"run0\"") && page.contains("id=\"run1\""));
    // The same run by another path would stand there twice.
    sandbox
        .run("report runs/3 runs/3/run.json --rollouts 0")
        .ended(2, &["runs/3/run.json"]);
    // Networks that other robots are worth are not put beside this test; without a test they stand
    // for themselves.
    sandbox
        .run("eval -q --archive runs/3/run.json --images 20 --cycles 1 --robots top:2")
        .ended(0, &[]);
    let capacity = |sandbox: &Sandbox| sandbox.read("runs/3/report.html").contains("Capacity");
    sandbox
        .run("report runs/3 --rollouts 0")
        .ended(0, &["runs/3/capacity.json"]);
    assert!(!capacity(&sandbox));
    std::fs::remove_file(sandbox.path("runs/3/eval.json")).unwrap();
    let said = sandbox.run("report runs/3 --rollouts 0").ended(0, &[]);
    assert!(
        capacity(&sandbox) && !said.err.contains("capacity.json"),
        "{}",
        said.err
    );
    // Nor would two states of one run be two.
    sandbox
        .run("evolve -q -c tiny.toml --seed 3 -g 14 -o later")
        .ended(0, &[]);
    sandbox
        .run("eval -a runs/3 later --images 20")
        .ended(2, &["later/run.json"]);
    // A broken file is left out, and said to be.
    sandbox.write("runs/3/eval.json", "{");
    sandbox
        .run("report runs/3 --rollouts 0")
        .ended(0, &["runs/3/eval.json"]);
    let page = sandbox.read("runs/3/report.html");
    assert!(!page.contains("Test on held-out images") && !page.contains("id=\"rollout-"));
}

#[test]
fn runs_of_one_name_and_seed_are_told_apart_and_so_are_their_copies() {
    let sandbox = Sandbox::tiny();
    for (run, groups) in [("a/run", "[[0],[1]]"), ("b/run", "[[0],[2]]")] {
        let images = "--set data.train_images= --set data.images_per_class=1";
        sandbox
            .run(&format!(
                "evolve -q -c tiny.toml --set task.groups={groups} {images} -o runs/{run}"
            ))
            .ended(0, &[]);
    }
    sandbox
        .run("report runs/a/run runs/b/run --rollouts 0")
        .ended(0, &[]);
    let page = sandbox.read("runs/report.html");
    let links = between(&page, "<a href=\"#run", "</a>");
    assert_eq!(links.len(), 2, "{links:?}");
    assert!(
        links[0].ends_with("run, seed 3 (runs/a/run)")
            && links[1].ends_with("run, seed 3 (runs/b/run)"),
        "{links:?}"
    );
    let copies = between(&page, "morphcog report --archive ", "<");
    assert!(copies.len() == 2 && copies[0] != copies[1], "{copies:?}");
}

#[test]
fn what_was_found_of_another_state_of_a_run_is_left_out_and_what_was_stopped_is_said() {
    let sandbox = sandbox();
    sandbox
        .run("eval -q --archive runs/3 --images 20 --cycles 1 --robots top:2")
        .ended(0, &[]);
    let whole = sandbox.read("runs/3/eval.json");
    sandbox.write(
        "runs/3/eval.json",
        whole.replace("\"stopped\":false", "\"stopped\":true"),
    );
    sandbox.run("report runs/3 --rollouts 0").ended(0, &[]);
    assert!(
        sandbox
            .read("runs/3/report.html")
            .contains("stopped before the last of them")
    );
    sandbox.write("runs/3/capacity.json", "{");
    sandbox
        .run("evolve -q -c tiny.toml -o runs/3 --resume -g 90")
        .ended(0, &[]);
    let said = sandbox
        .run("report runs/3 --rollouts 0")
        .ended(0, &["runs/3/eval.json", "runs/3/capacity.json"]);
    assert!(
        !sandbox
            .read("runs/3/report.html")
            .contains("Test on held-out images"),
        "{said:?}"
    );
    sandbox
        .run("plot accuracy -a runs/3")
        .ended(3, &["runs/3/eval.json", "morphcog eval"]);
    let trained = "capacity --eval runs/3/eval.json --set trainings=1 --set sizes=[1,3]";
    std::fs::remove_file(sandbox.path("runs/3/capacity.json")).unwrap();
    sandbox.run(trained).ended(0, &["runs/3/eval.json"]);
    assert!(
        sandbox
            .read("runs/3/capacity.json")
            .contains("\"standard_deviation\": null")
    );
    sandbox
        .run("plot capacity -a runs/3")
        .ended(3, &["runs/3/eval.json", "morphcog eval"]);
    sandbox
        .run("plot capacity -a runs/3/capacity.json -o networks.svg")
        .ended(0, &[]);
    // The file itself, named, is what is meant.
    sandbox
        .run("plot accuracy -a runs/3/eval.json -o figure.svg")
        .ended(0, &[]);
    assert!(sandbox.read("figure.svg").contains("stopped before"));
}

#[test]
fn its_commands_make_it_again() {
    let sandbox = sandbox();
    let run = "runs/it's 3";
    std::fs::rename(sandbox.path("runs/3"), sandbox.path(run)).unwrap();
    let told = |args: &[&str]| crate::common::program::said(sandbox.command(args));
    told(&[
        "eval",
        "-q",
        "-a",
        run,
        "--images",
        "20",
        "--cycles",
        "3",
        "--threshold",
        "1",
        "--robots",
        "top:2",
    ])
    .ended(0, &[]);
    told(&["audit", "-q", "-a", run, "--robots", "top:1"]).ended(0, &[]);
    let eval = format!("{run}/eval.json");
    told(&[
        "capacity",
        "-q",
        "--eval",
        &eval,
        "--clean",
        "--set",
        "trainings=2",
        "--set",
        "sizes=[1,5]",
        "--set",
        "step=2",
    ])
    .ended(0, &[]);
    told(&["report", "-q", run, "--rollouts", "0"]).ended(0, &[]);
    let page = sandbox.read(&format!("{run}/report.html"));
    let commands = between(&page, "<pre>morphcog evolve", "</pre>")[0];
    let commands = format!("morphcog evolve{commands}")
        .replace("&#39;", "'")
        .replace("&amp;", "&");
    for line in commands.lines() {
        let line = line.replace("morphcog", crate::common::program::PROGRAM);
        let ended = std::process::Command::new("sh")
            .args(["-c", &line])
            .current_dir(sandbox.path(""))
            .output();
        let ended = ended.unwrap();
        assert!(
            ended.status.success(),
            "{line}: {}",
            String::from_utf8_lossy(&ended.stderr)
        );
    }
    let again = "again/tiny-seed3";
    for file in ["run.json", "audit.json", "eval.csv", "capacity.csv"] {
        assert_eq!(
            sandbox.read(&format!("{again}/{file}")),
            sandbox.read(&format!("{run}/{file}")),
            "{file}"
        );
    }
}

#[test]
fn a_training_is_told_as_one_and_its_command_trains() {
    let sandbox = Sandbox::new();
    sandbox
        .run("report -q -a gallery:zero_one-1 --rollouts 0 -o page.html")
        .ended(0, &[]);
    let page = sandbox.read("page.html");
    assert!(page.contains("was trained with morphcog") && !page.contains("for 1 generations"));
    // It has one robot, which is played at first, and no archive.
    assert!(page.contains("<h2>The robot</h2>") && page.contains("data-first"));
    for word in [
        "class=\"map\"",
        "QD score",
        "born in generation",
        "<h2>Archive</h2>",
    ] {
        assert!(!page.contains(word), "{word}");
    }
    let commands = between(&page, "<pre># GAITS: run ", "</pre>")[0];
    let command = commands
        .lines()
        .nth(1)
        .unwrap()
        .replace("&#39;", "'")
        .replace("&amp;", "&");
    assert!(
        command.starts_with("morphcog train --archive GAITS --task '0|1' --seed 1 --robots "),
        "{command}"
    );
    // Gaits may have other pixels, windows and rounds: what the run had is said, defaults too.
    for set in [
        "stimulus.margin=[11, 2, 6, 10]",
        "stimulus.level=0.25",
        "train.windows=0",
        "train.rounds=6",
    ] {
        assert!(
            command.contains(&format!(" --set '{set}' ")),
            "{set}: {command}"
        );
    }
    // All of its flags are understood; it ends at the archive.
    let line = command.replace("morphcog", crate::common::program::PROGRAM);
    let ended = std::process::Command::new("sh")
        .args(["-c", &line])
        .current_dir(sandbox.path(""))
        .output();
    let said = String::from_utf8(ended.unwrap().stderr).unwrap();
    assert!(said.contains("error: GAITS"), "{said}");
    // Of an evolution without a config.toml beside it, the config is in the run.
    sandbox.write("tiny.toml", crate::common::program::TINY);
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    std::fs::remove_file(sandbox.path("run/config.toml")).unwrap();
    sandbox
        .run("report -q run --rollouts 0 -o page.html")
        .ended(0, &[]);
    assert!(
        sandbox
            .read("page.html")
            .contains("# CONFIG: the key &quot;config&quot; of run/run.json")
    );
}

#[test]
fn what_is_no_run_is_refused() {
    let sandbox = sandbox();
    sandbox.run("report nowhere").ended(3, &["nowhere"]);
    sandbox.run("report tiny.toml").ended(2, &["tiny.toml"]);
    sandbox.run("report runs/3 -o runs").ended(1, &["runs"]);
    // Nor is what was found of a run, or who is at it; nor a run that a link leads to.
    sandbox.write("runs/4/audit.json", "{}");
    for name in [
        "audit.json",
        "response.csv",
        "task.json",
        ".lock",
        ".task.lock",
    ] {
        let over = format!("report runs/3 --rollouts 0 -o runs/4/{name}");
        sandbox.run(&over).ended(2, &[&format!("runs/4/{name}: ")]);
    }
    #[cfg(unix)]
    {
        let link = sandbox.path("latest.json");
        std::os::unix::fs::symlink(sandbox.path("runs/4/run.json"), link).unwrap();
        let over = ["latest.json: "];
        sandbox
            .run("report runs/3 --rollouts 0 -o latest.json")
            .ended(2, &over);
        sandbox
            .run("eval -a runs/3 --images 2 --cycles 1 -o latest.json")
            .ended(2, &over);
    }
    // A run is not written over, be it another one.
    let kept = sandbox.read("runs/4/run.json");
    sandbox
        .run("report runs/3 -o runs/4/run.json")
        .ended(2, &["runs/4/run.json: "]);
    for name in ["run.json", "metrics.json", "elites.json"] {
        let over = format!("runs/4/{name}: ");
        sandbox
            .run(&format!("eval -a runs/3 --images 20 -o runs/4/{name}"))
            .ended(2, &[&over]);
    }
    sandbox.write("block.json", "{\"body\": [[1]], \"control_steps\": 1}");
    sandbox
        .run("simulate block.json -o runs/4/metrics.csv")
        .ended(2, &["runs/4/metrics.csv: "]);
    sandbox
        .run("simulate block.json -o block.json")
        .ended(2, &["block.json: "]);
    sandbox
        .run("eval -a runs/3 --images 20 -o runs/4/audit.json")
        .ended(2, &["audit.json"]);
    assert_eq!(sandbox.read("runs/4/run.json"), kept);
}
