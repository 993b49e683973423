//! Where the words go: `--json`, `--quiet`, terminals, pipes and full disks.

use crate::common::program::{PROGRAM, Sandbox, files, said};
use crate::simulate::scenario;
use crate::with_run;
use morphcog::commands::schema::{self, Schema};
use morphcog::store::eval::EvalFile;
use morphcog::store::run::RunFile;
use std::collections::BTreeSet;
use std::path::Path;

#[test]
fn no_table_shows_a_minus_nothing() {
    let sandbox = with_run();
    let mut run: serde_json::Value = serde_json::from_str(&sandbox.read("run/run.json")).unwrap();
    for elite in run["elites"].as_array_mut().unwrap() {
        elite["objective"] = (-0.001).into();
        elite["displacements"] = serde_json::json!([-0.001, 0.001]);
    }
    let mut run: RunFile = serde_json::from_value(run).unwrap();
    run.stats = run
        .archive()
        .unwrap()
        .stats(run.dimensions.possible_cells, run.config.archive.qd_offset);
    sandbox.write("run/run.json", run.to_json());
    let mut said = sandbox
        .run("eval -a run -n 4 --cycles 1 --robots top:2")
        .ended(0, &[])
        .out;
    said += &sandbox.run("replay -a run --format html").ended(0, &[]).out;
    sandbox
        .run("report -q --archive run --rollouts 1")
        .ended(0, &[]);
    sandbox.run("plot -q archive --archive run").ended(0, &[]);
    sandbox
        .run("plot -q body --archive run -o body.svg")
        .ended(0, &[]);
    for file in ["run/report.html", "run/plot-archive.svg", "body.svg"] {
        said += &sandbox.read(file);
    }
    for nothing in [
        "-0.00<", "-0.00 ", "−0.00", "-0.0<", "-0.0 ", "-0.0]", "−0.0<", "−0.0 ", "+0.0<", "+0.0 ",
        "-0.0\"", "−0.0\"", "+0.0\"",
    ] {
        let at = said.find(nothing).map(|at| {
            said[at.saturating_sub(60)..]
                .chars()
                .take(90)
                .collect::<String>()
        });
        assert_eq!(at, None, "{nothing:?}");
    }
}

#[test]
fn an_error_of_the_command_line_is_an_event_too() {
    let sandbox = Sandbox::new();
    for command in [
        "--json eval -n 0",
        "serve --json --port 80000",
        "--json evl",
        "--json data",
    ] {
        let said = sandbox.run(command).ended(2, &[]);
        let events = said.json_lines();
        assert_eq!(events.len(), 1, "{said:?}");
        assert_eq!(events[0]["event"], "error", "{said:?}");
        let message = events[0]["message"].as_str().unwrap();
        assert!(!message.is_empty(), "{said:?}");
        for other in ["Usage", "For more", "\\n", "tip:", "Find, download"] {
            assert!(!message.contains(other), "{message}");
        }
    }
}

// On Linux, where no thread is left: see `no_threads`.
#[cfg(not(target_os = "linux"))]
#[test]
fn speed_is_measured_in_processor_time() {
    let sandbox = Sandbox::new();
    let said = sandbox.run("bench --json").ended(0, &[]);
    let clocks: Vec<_> = said
        .json_lines()
        .iter()
        .map(|line| line["clock"].clone())
        .collect();
    let expected = if cfg!(target_os = "macos") {
        "processor"
    } else {
        "wall"
    };
    assert!(
        clocks.len() >= 5 && clocks.iter().all(|clock| clock == expected),
        "{clocks:?}"
    );
}

#[test]
fn an_error_about_a_file_names_it_once_whatever_is_wrong_with_it() {
    let sandbox = with_run();
    for command in [
        "eval -q -a run -n 4 --cycles 1 --robots best",
        "audit -q -a run --robots best",
        "response -q -a run -n 60 --robots top:3",
    ] {
        sandbox.run(command).ended(0, &[]);
    }
    let good = files(&sandbox.path("run"));
    // What reads which file.
    let readers: [(&str, &[&str]); 6] = [
        (
            "run.json",
            &[
                "eval -a run -n 4",
                "audit -a run",
                "response -a run",
                "train -a run --task 0|1 -o taught",
                "team -a run --classes 0,1",
                "replay -a run",
                "report -a run",
                "plot archive -a run",
                "plot body -a run",
                "plot progress -a run",
                "serve -a run",
                "eval -a run --robots best-validation:1",
            ],
        ),
        (
            "eval.json",
            &[
                "plot accuracy -a run",
                "capacity --eval run/eval.json",
                "eval -a run -n 4",
            ],
        ),
        (
            "audit.json",
            &[
                "audit -a run",
                "eval -a run -n 4 --physical-only",
                "replay -a run --physical-only",
            ],
        ),
        ("response.json", &["response -a run --robots all"]),
        ("metrics.csv", &["plot progress -a run"]),
        (
            "config.toml",
            &[
                "evolve -c run/config.toml -o other",
                "config run/config.toml",
            ],
        ),
    ];
    for (name, commands) in readers {
        let text = String::from_utf8(good[name].clone()).unwrap();
        let half = text[..text.len() / 2].to_string();
        let wounds: [Vec<u8>; 7] = [
            Vec::new(),
            half.into(),
            b"\xff\xfe\x00".to_vec(),
            b"[]".to_vec(),
            text.replacen("morphcog-", "other-", 1)
                .replacen("seed = ", "sed = ", 1)
                .into(),
            text.replacen("\"format_version\":1", "\"format_version\":99", 1)
                .replacen("= 5", "= -5", 1)
                .into(),
            text.replacen(":0.", ":1e308,\"x\":0.", 1)
                .replacen("generation,", "", 1)
                .into(),
        ];
        let path = format!("run/{name}");
        for wound in wounds.iter().filter(|wound| **wound != good[name]) {
            sandbox.write(&path, wound);
            for command in commands {
                let said = sandbox.run(command);
                let line = said.err.lines().find(|line| line.starts_with("error:"));
                let line = line.unwrap_or_else(|| panic!("{command}: {name}: {said:?}"));
                assert_eq!(line.matches(&path).count(), 1, "{command}: {line}");
            }
        }
        // Nor is it read where there is no file, but a folder.
        std::fs::remove_file(sandbox.path(&path)).unwrap();
        std::fs::create_dir(sandbox.path(&path)).unwrap();
        for command in commands
            .iter()
            .filter(|command| !command.contains("plot accuracy"))
        {
            let said = sandbox.run(command);
            let line = said
                .err
                .lines()
                .find(|line| line.starts_with("error:"))
                .unwrap_or_default();
            assert_eq!(
                line.matches(&path).count(),
                1,
                "{command}: {name}: {said:?}"
            );
        }
        std::fs::remove_dir(sandbox.path(&path)).unwrap();
        sandbox.write(&path, &good[name]);
    }
}

#[test]
fn no_command_writes_over_results_that_it_cannot_read() {
    let sandbox = with_run();
    sandbox
        .run("eval -q -a run -n 4 --cycles 1 --robots best")
        .ended(0, &[]);
    for (name, command) in [
        ("run/eval.json", "eval -a run -n 4 --cycles 1"),
        (
            "run/eval-validation.json",
            "eval -a run --split validation -n 4 --cycles 1",
        ),
        ("run/audit.json", "audit -a run"),
        ("run/response.json", "response -a run"),
        (
            "capacity.json",
            "capacity --eval run/eval.json -o capacity.json",
        ),
        (
            "capacity.trainings.json",
            "capacity --eval run/eval.json -o capacity.json",
        ),
        (
            "run/validation.json",
            "eval -a run --robots best-validation:1",
        ),
    ] {
        let whole = std::fs::read(sandbox.path(name)).ok();
        sandbox.write(
            name,
            "{\"format\": \"morphcog-later\", \"format_version\": 7}",
        );
        sandbox.run(command).ended(3, &[name, "hint:"]);
        assert!(sandbox.read(name).contains("later"), "{command}");
        match whole {
            Some(whole) => drop(sandbox.write(name, whole)),
            None => std::fs::remove_file(sandbox.path(name)).unwrap(),
        }
    }
}

#[cfg(unix)]
#[test]
fn an_archive_that_is_no_file_is_refused_at_once() {
    let sandbox = with_run();
    let pipe = sandbox.path("pipe.json");
    assert!(
        std::process::Command::new("mkfifo")
            .arg(&pipe)
            .status()
            .unwrap()
            .success()
    );
    for archive in ["pipe.json", "/dev/stdin", "/dev/zero"] {
        for command in [
            "eval",
            "replay",
            "audit",
            "report",
            "plot archive",
            "plot progress",
            "team",
        ] {
            let said = sandbox
                .run(&format!("{command} -a {archive}"))
                .ended(3, &[]);
            assert_eq!(said.err.matches(archive).count(), 1, "{command}: {said:?}");
        }
    }
    sandbox
        .run("capacity --eval pipe.json")
        .ended(3, &["pipe.json"]);
}

#[test]
fn quiet_leaves_results_only() {
    let sandbox = Sandbox::tiny();
    let said = sandbox
        .run("evolve --quiet -c tiny.toml -o run")
        .ended(0, &[]);
    let run = sandbox.run_file("run");
    let best = &run.best().unwrap().id;
    assert!(said.err.is_empty() && said.out.contains(best), "{said:?}");
    let said = sandbox
        .run("evolve -c tiny.toml -o loud")
        .ended(0, &["12/12"]);
    assert!(said.out.contains(best), "{said:?}");
    let said = sandbox
        .run("eval -q -a run/run.json -n 2 --cycles 1")
        .ended(0, &[]);
    assert!(said.err.is_empty() && said.out.contains(best), "{said:?}");
}

#[test]
fn with_json_every_line_on_stdout_is_json() {
    let sandbox = with_run();
    let events = |args: &str, code: i32| -> Vec<String> {
        let lines = sandbox
            .run(&format!("--json {args}"))
            .ended(code, &[])
            .json_lines();
        assert!(!lines.is_empty(), "{args}");
        lines
            .iter()
            .map(|line| line["event"].as_str().unwrap().to_string())
            .collect()
    };
    let evolve = events("evolve -c tiny.toml -o new", 0);
    assert_eq!(
        evolve.iter().filter(|name| *name == "generation").count(),
        13
    );
    assert_eq!(evolve.last().unwrap(), "finished");
    events("eval -a run/run.json -n 4 --cycles 1", 0);
    events("replay -a run/run.json --every 20", 0);
    events("replay -a run/run.json --format terminal", 0);
    events("gallery", 0);
    events("config", 0);
    events("data info", 0);
    events("data sheet -o sheet.png --samples 1", 0);
    assert_eq!(events("evolve -c tiny.toml -o run", 5), ["error"]);
    assert_eq!(events("eval -a nowhere.json", 3), ["error"]);
    assert_eq!(events("evolve -c tiny.toml -o x --set a=1", 2), ["error"]);
}

/// The rows of tables in the documentation between two headings: what the first cell names, and the
/// whole row.
fn documented(name: &str, [from, to]: [&str; 2]) -> Vec<(Vec<String>, String)> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap();
    let (_, text) = text.split_once(from).unwrap();
    let (text, _) = text.split_once(to).unwrap();
    let row = |line: &str| {
        let line = line.replace("\\|", "¦");
        let first = line.split_once(" | ")?.0.replace('¦', "|");
        let names = first
            .split('`')
            .skip(1)
            .step_by(2)
            .map(str::to_string)
            .collect::<Vec<_>>();
        Some((names, line))
    };
    text.lines().filter_map(row).collect()
}

#[test]
fn every_event_of_json_is_documented_with_its_fields() {
    let rows = documented("docs/command-line.md", ["\n### JSON\n", "\n## "]);
    let row = |event: &str| {
        let found = rows
            .iter()
            .find(|(names, _)| names.len() == 1 && names[0] == event);
        &found
            .unwrap_or_else(|| panic!("the event {event} is not documented"))
            .1
    };
    // A row may name a file instead of the fields that it has from there.
    let columns = documented("docs/file-formats.md", ["\n## sweep.csv\n", "\n## "]);
    let is_of_a_file = |row: &str, field: &str| {
        let of_schema = |schema: &Schema| {
            row.contains(&format!("`{}.json`", schema.name))
                && schema.json()["properties"].get(field).is_some()
        };
        let is_column = || {
            columns
                .iter()
                .any(|(names, _)| names.iter().any(|name| name == field))
        };
        schema::ALL.iter().any(of_schema) || row.contains("`sweep.csv`") && is_column()
    };
    // All that the source has.
    let mut open = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    let mut events = BTreeSet::new();
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(
                std::fs::read_dir(path)
                    .unwrap()
                    .map(|entry| entry.unwrap().path()),
            );
            continue;
        }
        let Ok(source) = std::fs::read_to_string(&path) else {
            continue;
        };
        let code = source.split("#[cfg(test)]").next().unwrap();
        for call in [".event(", ".finding("] {
            let names = code
                .split(call)
                .skip(1)
                .filter_map(|rest| rest.trim_start().strip_prefix('"'));
            events.extend(names.map(|name| name.split('"').next().unwrap().to_string()));
        }
    }
    assert!(events.len() > 20, "{events:?}");
    events.iter().for_each(|event| {
        row(event);
    });
    // Those of quick commands, as they come.
    let sandbox = with_run();
    sandbox.write("plan.toml", "config = \"tiny.toml\"\nseeds = [3]\n");
    let train = "train -a run --robots top:2 --task 0|1 --out taught --set train.random_images=20 --set \
                 train.windows=4 --set stimulus.reduction=area --set train.rounds=1 --set train.images=4 --set \
                 train.final_images=4 --set train.challengers=1 --set protocol.control_steps=50 --set \
                 validation.images=40 --set validation.best=0";
    let [one_pair, pairs] = ["--pair 1", ""].map(|what| {
        let pairs = train.replace("--task 0|1", "--pairs --classes 0,1");
        format!(
            "{} {what}",
            pairs
                .replace("--out taught", "--out pairs")
                .replace("--set protocol.control_steps=50", "")
        )
    });
    let mut seen = BTreeSet::new();
    sandbox.write(
        "own.csv",
        "0,0,9,0,255\n0,9,0,0,255\n1,0,9,255,0\n1,9,0,255,0\n",
    );
    for args in [
        "evolve -c tiny.toml -o new",
        train,
        &one_pair,
        &pairs,
        "train -a run --robots all --task 0|1 --out own --set train.rounds=0 --set train.random_images=20 \
         --set train.final_images=4 --set train.challengers=1 --set validation.images=40",
        "response -a taught --images 60",
        "eval -a run -n 4 --cycles 1",
        "capacity --eval run/eval.json --set trainings=2 --set sizes=[1,3]",
        "team -a run --classes 0,1 --images 4",
        "replay -a run --format png",
        "compare run taught -n 4 -o compare.csv",
        "report run --rollouts 0",
        "data info",
        "data sheet",
        "data import own.csv --name own --fit keep",
        "gallery",
        "sweep plan.toml",
        "sweep plan.toml --status",
        "sweep plan.toml --collect",
        "verify --list",
        "eval -a nowhere.json",
    ] {
        let said = sandbox.run(&format!("{args} --json"));
        assert_eq!(
            said.code,
            Some(if args.contains("nowhere") { 3 } else { 0 }),
            "{said:#?}"
        );
        for line in said.json_lines() {
            let event = line["event"].as_str().unwrap();
            for field in line
                .as_object()
                .unwrap()
                .keys()
                .filter(|field| *field != "event")
            {
                let row = row(event);
                assert!(
                    row.contains(&format!("`{field}`")) || is_of_a_file(row, field),
                    "{args}: {event} has {field}"
                );
            }
            seen.insert(event.to_string());
        }
    }
    // These take longer.
    events.retain(|event| !["speed", "reproduced", "verified"].contains(&event.as_str()));
    assert_eq!(seen, events);
}

#[test]
fn a_written_file_is_named_for_programs() {
    let sandbox = with_run();
    for (args, file) in [
        ("report run --rollouts 0", "run/report.html"),
        ("data sheet -o sheet.png --samples 1", "sheet.png"),
    ] {
        let lines = sandbox
            .run(&format!("{args} --json"))
            .ended(0, &[])
            .json_lines();
        let last = lines.last().unwrap();
        assert_eq!(
            (&last["event"], &last["file"]),
            (&"result".into(), &file.into()),
            "{lines:?}"
        );
        assert!(
            last["text"]
                .as_str()
                .unwrap()
                .starts_with(&format!("wrote {file}")),
            "{last}"
        );
    }
}

#[test]
fn every_column_of_a_test_and_of_an_audit_is_explained() {
    let sandbox = Sandbox::tiny();
    // Some of its robots are walkers.
    sandbox
        .run("evolve -q -c tiny.toml -o run --generations 40 --set protocol.control_steps=150")
        .ended(0, &[]);
    let rows = documented("docs/analysing.md", ["\n## Test\n", "\n### Verdicts\n"]);
    let explained: Vec<&str> = rows
        .iter()
        .flat_map(|(names, _)| names)
        .map(String::as_str)
        .collect();
    let explained = [explained, vec!["robot", "task", "change"]].concat();
    let mut columns = 0;
    for args in [
        "eval -a run -n 20 --cycles 1 --robots best-validation:1 --validation 40",
        "audit -a run --robots top:4 --set least_walk=0 --set threshold=0",
    ] {
        let said = sandbox.run(args).ended(0, &[]).out;
        let lines: Vec<&str> = said.lines().collect();
        // A header stands above a rule.
        for pair in lines.windows(2).filter(|pair| pair[1].starts_with("--")) {
            for column in pair[0]
                .split("  ")
                .map(str::trim)
                .filter(|column| !column.is_empty())
            {
                assert!(explained.contains(&column), "{column} is not explained");
                columns += 1;
            }
        }
    }
    assert_eq!(columns, 13 + 9 + 8 + 4);
}

#[test]
fn rows_of_a_collected_sweep_are_numbers_or_null_for_programs() {
    let sandbox = Sandbox::tiny();
    let plan = "config = \"tiny.toml\"\nseeds = [1, 2]\n[vary]\nmap_elites.parents = [4]\n[eval]\nrobots = \
                \"top:2\"\nimages = 4\n";
    sandbox.write("plan.toml", plan);
    sandbox
        .run("sweep plan.toml --out all -q --task 1")
        .ended(0, &[]);
    let lines = sandbox
        .run("sweep plan.toml --out all --collect --json")
        .ended(0, &["not all"])
        .json_lines();
    let rows: Vec<_> = lines
        .iter()
        .filter(|line| line["event"] == "collected")
        .collect();
    let [done, waiting] = rows.as_slice() else {
        panic!("{lines:?}")
    };
    let eval: EvalFile =
        serde_json::from_str(&sandbox.read("all/tiny-parents=4-seed1/eval.json")).unwrap();
    let mean = &eval.means["0|1"];
    assert_eq!(
        (done["number"].as_u64(), done["state"].as_str()),
        (Some(1), Some("done"))
    );
    assert_eq!(
        (done["accuracy"].as_f64(), done["robots"].as_u64()),
        (Some(mean.accuracy), Some(2))
    );
    let ends = [&done["accuracy_low"], &done["accuracy_high"]].map(|end| end.as_f64());
    assert_eq!(ends, mean.interval.unwrap().map(Some));
    assert_eq!(
        done["varied"],
        serde_json::json!({ "map_elites.parents": 4, "seed": 1 })
    );
    assert_eq!(
        (&waiting["state"], &waiting["accuracy"]),
        (&"waiting".into(), &serde_json::Value::Null)
    );
    // The columns of the table.
    let table = sandbox.read("all/sweep.csv");
    let columns = table
        .lines()
        .next()
        .unwrap()
        .split(',')
        .filter(|column| !column.starts_with("varied_"));
    assert!(columns.clone().count() > 15);
    columns.for_each(|column| assert!(done.get(column).is_some(), "{column}"));
    // Nothing is empty, and every file is named.
    let results: Vec<_> = lines
        .iter()
        .filter(|line| line["event"] == "result")
        .collect();
    assert!(
        results.len() >= 3 && results.len() + rows.len() == lines.len(),
        "{lines:?}"
    );
    assert_eq!(results[0]["file"], "all/sweep.csv");
    assert!(
        results
            .iter()
            .all(|line| line["text"] != "" && line["file"].is_string()),
        "{results:?}"
    );
}

#[test]
fn how_far_tasks_are_has_no_column_without_a_name() {
    let sandbox = Sandbox::tiny();
    sandbox.write("plan.toml", "config = \"tiny.toml\"\nseeds = [3]\n");
    let status = || {
        sandbox
            .run("sweep plan.toml --out all --status")
            .ended(0, &[])
            .out
    };
    let plain = status();
    assert!(plain.lines().next().unwrap().ends_with("  left"), "{plain}");
    assert!(
        plain.lines().all(|line| line.trim_end() == line),
        "{plain:?}"
    );
    sandbox.run("sweep plan.toml --out all -q").ended(0, &[]);
    let path = "all/tiny-seed3/task.json";
    let mut task: serde_json::Value = serde_json::from_str(&sandbox.read(path)).unwrap();
    (task["state"], task["error"]) = ("failed".into(), "no room".into());
    sandbox.write(path, task.to_string());
    let failed = status();
    assert!(
        failed.lines().next().unwrap().ends_with("  about"),
        "{failed}"
    );
    assert!(failed.contains("no room"), "{failed}");
}

#[test]
fn away_from_a_terminal_there_are_no_escape_sequences_with_or_without_no_color() {
    let sandbox = with_run();
    for value in [None, Some("1"), Some("")] {
        for args in [
            "evolve -c tiny.toml -o run",
            "eval -a run/run.json -n 2 --cycles 1",
            "replay -a run/run.json --format terminal",
        ] {
            let mut command = sandbox.command(args.split(' '));
            value.map(|value| command.env("NO_COLOR", value));
            let said = said(command);
            assert!(
                !said.out.contains('\x1b') && !said.err.contains('\x1b'),
                "{said:?}"
            );
        }
    }
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_error() {
    let sandbox = with_run();
    let rollout = scenario(&sandbox, "disc_5x5_00");
    assert_eq!(rollout.control_steps, 500);
    for args in [
        "simulate scenario.json",
        "config zero_one.toml",
        "completions bash",
        "man",
        "gallery",
        "evolve -c tiny.toml -o piped",
    ] {
        let mut child = sandbox.start(args);
        drop(child.stdout.take());
        let ended = child.wait_with_output().unwrap();
        let err = String::from_utf8_lossy(&ended.stderr);
        assert!(
            ended.status.success() && !err.contains("panicked") && !err.contains("error"),
            "{args}: {ended:?}"
        );
    }
    // Nobody waits for the rest of a rollout that would take minutes.
    let forever = r#"{"body": [[3]], "control_steps": 1000000}"#;
    sandbox.write("forever.json", forever);
    let mut child = sandbox.start("simulate forever.json");
    drop(child.stdout.take());
    assert!(child.wait().unwrap().success());
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_and_is_said() {
    let sandbox = with_run();
    scenario(&sandbox, "disc_5x5_00");
    for args in [
        "simulate scenario.json",
        "config zero_one.toml",
        "man",
        "completions zsh",
        "gallery",
        "--json gallery",
        "--help",
    ] {
        let full = std::fs::File::options()
            .write(true)
            .open("/dev/full")
            .unwrap();
        let mut command = std::process::Command::new(PROGRAM);
        let ended = command
            .current_dir(sandbox.path(""))
            .args(args.split(' '))
            .stdout(full)
            .output()
            .unwrap();
        let err = String::from_utf8_lossy(&ended.stderr);
        assert!(
            !ended.status.success() && ended.status.code().is_some_and(|c| c != 101),
            "{args}: {ended:?}"
        );
        assert!(
            err.contains("No space left") && !err.contains("panicked"),
            "{args}: {err}"
        );
    }
}

#[test]
fn where_nothing_can_be_written_it_says_where() {
    let sandbox = with_run();
    scenario(&sandbox, "disc_5x5_00");
    sandbox.write("file", "in the way");
    for args in [
        "evolve -c tiny.toml -o file",
        "evolve -c tiny.toml -o file/run",
        "replay -a run/run.json -o file/walk.gif",
        "replay -a run/run.json -o file/walk.html",
        "simulate scenario.json -o file/traj.csv",
        "simulate scenario.json -o run",
        "data sheet -o file/sheet.png",
        "replay -a run/run.json -o nowhere/walk.png",
    ] {
        let place = args.rsplit(' ').next().unwrap();
        sandbox.run(args).ended(1, &[place]);
    }
    assert_eq!(sandbox.read("file"), "in the way");
}

#[test]
fn an_instruction_set_that_is_not_there_is_an_error_that_names_those_that_are() {
    let sandbox = Sandbox::new();
    for (set, code) in [("avx1024", 2), ("", 0), ("baseline", 0)] {
        let mut command = sandbox.command(["gallery"]);
        command.env("MORPHCOG_ISA", set);
        let words: &[&str] = if code == 2 {
            &["MORPHCOG_ISA=avx1024", "baseline"]
        } else {
            &[]
        };
        said(command).ended(code, words);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_shell_reads_the_commands_that_are_printed_whatever_the_path() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let sandbox = Sandbox::tiny();
    for name in [
        b"it's \"a\" $HOME `run`".as_slice(),
        b"-run",
        b"a|b;*\n",
        b"\xff\xfe",
    ] {
        let folder = OsStr::from_bytes(name);
        let out = [b"--out=", name].concat();
        let mut evolve = sandbox.command(["evolve", "-c", "tiny.toml"]);
        evolve.arg(OsStr::from_bytes(&out));
        let next = said(evolve).ended(0, &["next: "]).err;
        let test = next
            .lines()
            .find_map(|line| line.trim().strip_prefix("morphcog eval "))
            .unwrap();
        let mut unaudited = sandbox.command(["eval", "--physical-only"]);
        unaudited.arg(OsStr::from_bytes(&[b"--archive=", name].concat()));
        let hint = said(unaudited).ended(3, &["hint: `"]).err;
        let audit = hint.split_once("hint: `morphcog audit ").unwrap().1;
        let audit = audit.rsplit_once("` audits").unwrap().0;
        for command in [
            format!("eval -q -n 4 --cycles 1 {test}"),
            format!("audit -q {audit}"),
        ] {
            let line = format!("{PROGRAM} {command}");
            let mut bash = std::process::Command::new("bash");
            let ended = bash
                .args(["-c", &line])
                .current_dir(sandbox.path(""))
                .output()
                .unwrap();
            assert!(ended.status.success(), "{command}: {ended:?}");
        }
        for file in ["eval.json", "audit.json"] {
            assert!(
                sandbox.path("").join(folder).join(file).exists(),
                "{file} of {folder:?}"
            );
        }
    }
}
