//! Whose images robots are shown: the run's own, wherever they lie, and others only if they are
//! asked for by name.
#![allow(clippy::disallowed_methods)]

use crate::common::program::{Sandbox, TINY, files, mnist, said, write_images};
use crate::common::server::Server;
use morphcog::store::eval::EvalFile;
use std::collections::BTreeMap;
use std::fs::{remove_dir_all, remove_file, rename};
use std::sync::OnceLock;

/// Images of 10 × 10 pixels in a folder.
fn write_dataset(sandbox: &Sandbox, folder: &str, seed: u8) {
    write_images(sandbox, &format!("{folder}/"), [10, 10], seed);
}

/// A run on `shapes`, which lie in `there`: evolved once, and put into folders of other names.
fn with_run() -> Sandbox {
    static RUN: OnceLock<BTreeMap<String, String>> = OnceLock::new();
    let sandbox = Sandbox::new();
    write_dataset(&sandbox, "there", 1);
    let config = TINY.replace("\"builtin\"", "\"shapes\"");
    let few = "[validation]\nimages = 40\nbest = 1\n[archive]\nkeep = 3\n";
    sandbox.write("shapes.toml", format!("{config}\n{few}"));
    // Where its images are is another place in every sandbox.
    let here = sandbox.path("there").to_str().unwrap().to_string();
    let run = RUN.get_or_init(|| {
        sandbox
            .run("evolve -q -c shapes.toml -o runs/one -g 6 --data there")
            .ended(0, &[]);
        let text = |content| String::from_utf8(content).unwrap().replace(&here, "HERE");
        files(&sandbox.path("runs/one"))
            .into_iter()
            .map(|(name, content)| (name, text(content)))
            .collect()
    });
    for (name, content) in run {
        sandbox.write(&format!("runs/one/{name}"), content.replace("HERE", &here));
    }
    sandbox
}

/// Without a look at which of a run's robots are best on other images.
const UNVALIDATED: &str = "--set validation.best=0";

/// What looks at images of a run.
const COMMANDS: [&str; 9] = [
    "eval -a runs/one --images 8 --cycles 1 --robots top:2",
    "eval -a runs/one --images 8 --cycles 1 --robots best-validation:2 --validation 40",
    "eval -a runs/one --images 8 --cycles 1 --split validation -o validated.json",
    "audit -a runs/one --robots top:1 -o audit.json",
    "replay -a runs/one --images test:3 -o replay.png",
    "plot spacetime -a runs/one -o plot.svg",
    "report runs/one -o report.html --rollouts 1",
    "capacity --eval runs/one/eval.json --set trainings=2 --set sizes=[1,2] -o capacity.json",
    "evolve -c shapes.toml -o runs/one -g 7 --resume",
];

#[test]
fn a_run_remembers_where_its_images_were() {
    let sandbox = with_run();
    sandbox
        .run(&format!(
            "evolve -q -c shapes.toml -o runs/new -g 1 --data there {UNVALIDATED}"
        ))
        .ended(0, &[]);
    let text = sandbox.read("runs/new/data-folder.json");
    assert_eq!(sandbox.read("runs/one/data-folder.json"), text);
    let file: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(file["dataset"], "shapes");
    assert_eq!(
        file["folder"].as_str().unwrap(),
        sandbox.path("there").to_str().unwrap()
    );
    for command in COMMANDS {
        sandbox.run(command).ended(0, &[]);
    }
    let sets = Server::start(&sandbox, "--archive runs/one")
        .get("/api/images")
        .body;
    assert!(sets.contains("shapes"), "{sets}");
    // It is of the run, so nothing is written over it, and a run that takes its place has none of
    // it.
    sandbox
        .run("eval -a runs/one --images 8 -o runs/one/data-folder.json")
        .ended(2, &["--out runs/one/data-folder.json"]);
    sandbox
        .run(&format!(
            "evolve -q -c shapes.toml --set data.dataset=builtin {UNVALIDATED} -o runs/one --force"
        ))
        .ended(0, &[]);
    assert!(!sandbox.path("runs/one/data-folder.json").exists());
}

#[test]
fn a_sweep_over_a_run_looks_where_the_run_remembers() {
    let sandbox = with_run();
    sandbox.write(
        "plan.toml",
        "archive = \"runs/one\"\nrobots = \"top:1\"\npairs = [0, 1]\n\
         set = [\"train.random_images=20\", \"train.rounds=1\", \"train.images=4\", \"train.final_images=4\", \
         \"train.challengers=1\", \"train.images_per_class=30\", \"validation.images=40\", \
         \"validation.best=0\"]\n[eval]\nimages = 4\n",
    );
    sandbox.run("sweep -q plan.toml --out all").ended(0, &[]);
    // Another place is no better than none.
    sandbox
        .run("sweep -q plan.toml --out again --data nowhere")
        .ended(3, &["nowhere"]);
}

#[test]
fn a_training_that_takes_the_place_of_another_takes_nothing_of_it() {
    let sandbox = with_run();
    write_dataset(&sandbox, "elsewhere", 2);
    let little = "--set train.random_images=20 --set train.rounds=1 --set train.images=4 \
                  --set train.final_images=4 --set train.challengers=1 --set train.images_per_class=30 \
                  --set validation.images=40 --set validation.best=0";
    let train = format!("train -q -a runs/one --task 0|1 --robots top:1 {little} -o taught");
    sandbox
        .run(&format!("{train} --data elsewhere"))
        .ended(0, &[]);
    let of = |sandbox: &Sandbox| sandbox.run_file("taught").dataset;
    let before = of(&sandbox);
    sandbox.run(&format!("{train} --force")).ended(0, &[]);
    assert_ne!(of(&sandbox), before);
    assert_eq!(of(&sandbox), sandbox.run_file("runs/one").dataset);
}

#[test]
fn where_the_images_lie_is_no_part_of_the_run() {
    let sandbox = with_run();
    write_dataset(&sandbox, "elsewhere/shapes", 1);
    sandbox
        .run("evolve -q -c shapes.toml -o runs/two -g 6 --data elsewhere")
        .ended(0, &[]);
    assert_eq!(
        sandbox.read("runs/one/run.json"),
        sandbox.read("runs/two/run.json")
    );
    let folder = sandbox.read("runs/two/data-folder.json");
    assert!(folder.contains("elsewhere/shapes"), "{folder}");
}

#[test]
fn a_folder_that_is_gone_is_one_error_that_says_where_it_was_looked_for() {
    let sandbox = with_run();
    sandbox.run(COMMANDS[0]).ended(0, &[]);
    rename(sandbox.path("there"), sandbox.path("moved")).unwrap();
    for command in COMMANDS {
        let words = [
            "runs/one/data-folder.json",
            "there",
            "data/shapes",
            "--data",
        ];
        let said = sandbox.run(command).ended(3, &words);
        assert_eq!(said.err.matches("error:").count(), 1, "{}", said.err);
    }
    for command in COMMANDS {
        sandbox
            .run(&format!("{command} --data moved"))
            .ended(0, &[]);
    }
    // Named once more when it went on, they are known again.
    sandbox.run(COMMANDS[0]).ended(0, &[]);
    assert!(sandbox.read("runs/one/data-folder.json").contains("moved"));
    // Where a dataset always lies it is found, too.
    std::fs::create_dir(sandbox.path("data")).unwrap();
    rename(sandbox.path("moved"), sandbox.path("data/shapes")).unwrap();
    sandbox.run(COMMANDS[0]).ended(0, &[]);
}

#[test]
fn what_the_user_says_comes_before_what_a_run_remembers() {
    let sandbox = with_run();
    write_dataset(&sandbox, "other", 2);
    std::fs::create_dir(sandbox.path("empty")).unwrap();
    sandbox
        .run(&format!("{} --data other", COMMANDS[0]))
        .ended(3, &["other", "SHA-256"]);
    let mut command = sandbox.command(COMMANDS[0].split_whitespace());
    command.env("MORPHCOG_DATA", "empty");
    said(command).ended(3, &["empty", "MORPHCOG_DATA"]);
    sandbox.write("runs/one/data-folder.json", "{}");
    sandbox
        .run(COMMANDS[0])
        .ended(3, &["runs/one/data-folder.json", "--data"]);
    sandbox
        .run(&format!("{} --data there", COMMANDS[0]))
        .ended(0, &[]);
    // One that someone wrote may go from the run's folder on.
    let text = r#"{"format":"morphcog-data-folder","format_version":1,"dataset":"shapes","folder":"../../there"}"#;
    sandbox.write("runs/one/data-folder.json", text);
    sandbox.run(COMMANDS[0]).ended(0, &[]);
}

#[test]
fn an_evaluation_on_other_images_than_the_runs_is_refused() {
    let sandbox = with_run();
    sandbox.run(COMMANDS[0]).ended(0, &[]);
    let before = sandbox.read("runs/one/eval.json");
    write_dataset(&sandbox, "there", 2);
    let said = sandbox
        .run(COMMANDS[0])
        .ended(3, &["SHA-256", "there", "--data", "--dataset NAME"]);
    assert_eq!(
        (said.out.as_str(), sandbox.read("runs/one/eval.json")),
        ("", before)
    );
    // Networks on other images are worth nothing beside its robots.
    sandbox
        .run(COMMANDS[7])
        .ended(3, &["SHA-256", "runs/one/eval.json", "--data"]);
}

#[test]
fn test_images_are_needed_only_where_they_are_shown() {
    let sandbox = with_run();
    for name in ["images-idx3-ubyte", "labels-idx1-ubyte"] {
        remove_file(sandbox.path(&format!("there/t10k-{name}"))).unwrap();
    }
    for command in [
        "eval -a runs/one --images 8 --cycles 1 --robots best-validation:1 --validation 40 --split validation",
        "audit -a runs/one --robots top:1",
        "replay -a runs/one --images train:3 -o replay.png",
        "report runs/one -o report.html --rollouts 0",
        "evolve -c shapes.toml -o runs/one -g 7 --resume",
    ] {
        sandbox.run(command).ended(0, &[]);
    }
    for command in [
        "eval -a runs/one --images 8 --cycles 1",
        "replay -a runs/one --images test:3 -o replay.png",
    ] {
        sandbox.run(command).ended(3, &["t10k-images-idx3-ubyte"]);
    }
}

#[test]
fn robots_are_shown_another_dataset_if_it_is_asked_for_and_the_results_say_so() {
    let sandbox = with_run();
    let command = "eval -a runs/one --images 8 --cycles 1 --dataset builtin --robots";
    let said = sandbox.run(&format!("{command} top:2")).ended(0, &[]);
    assert!(
        said.out.contains("8 builtin test images") && said.out.contains("trained on shapes"),
        "{}",
        said.out
    );
    let read = || EvalFile::read(&sandbox.path("runs/one/eval.json")).unwrap();
    let (run, report) = (sandbox.run_file("runs/one"), read());
    assert_eq!(report.dataset, "builtin");
    assert_eq!(report.trained_on, Some(run.dataset.clone()));
    let setting = report.setting.as_ref().unwrap();
    assert_eq!(setting.data.dataset, "builtin");
    assert_ne!(setting.train_sha256, run.dataset.train_sha256);
    assert_eq!(report.baselines.len(), 1);
    assert!(
        report
            .baselines
            .values()
            .all(|baselines| baselines.nearest_training_image.is_none())
    );
    sandbox.run("plot accuracy -a runs/one").ended(0, &[]);
    assert!(
        sandbox
            .read("runs/one/plot-accuracy.svg")
            .contains("trained on shapes")
    );
    sandbox.run("report runs/one --rollouts 0").ended(0, &[]);
    assert!(
        sandbox
            .read("runs/one/report.html")
            .contains("trained on shapes")
    );
    sandbox.run(COMMANDS[7]).ended(
        3,
        &["runs/one/eval.json", "shapes", "builtin", "morphcog eval"],
    );
    // Who is best is told by the run's own images.
    sandbox
        .run(&format!("{command} best-validation:1 --validation 40"))
        .ended(0, &[]);
    assert_eq!(read().robots[0].validation.as_ref().unwrap().images, 40);
    sandbox
        .run(&format!("{command} top:1 --split validation"))
        .ended(2, &["--dataset", "test images only"]);
    // Its own name changes nothing.
    sandbox
        .run(&format!("{} --dataset shapes", COMMANDS[0]))
        .ended(0, &[]);
    let named = sandbox.read("runs/one/eval.json");
    sandbox.run(COMMANDS[0]).ended(0, &[]);
    assert_eq!(sandbox.read("runs/one/eval.json"), named);
    assert_eq!(read().trained_on, None);
    // Published robots need no MNIST then.
    sandbox
        .run("eval --robots XFJPI --dataset builtin --images 2 --cycles 1 -o published.json")
        .ended(0, &[]);
    let report = EvalFile::read(&sandbox.path("published.json")).unwrap();
    assert_eq!(
        (
            report.dataset.as_str(),
            report.trained_on.unwrap().name.as_str()
        ),
        ("builtin", "mnist")
    );
}

#[test]
fn mnist_is_known_by_any_name() {
    let Some(mnist) = mnist("other names of MNIST") else {
        return;
    };
    let sandbox = Sandbox::new();
    let info = |name: &str, options: &[&str]| {
        let mut command = sandbox.command(["data", "info", name].iter().chain(options));
        command.env("MORPHCOG_DATA", &mnist);
        said(command).ended(0, &[])
    };
    let words = ["train: these are the images of mnist", "test: ", "mine"];
    info("mine", &[]).ended(0, &words);
    let event = &info("mine", &["--json"]).json_lines()[0];
    assert_eq!(
        event["known_as"],
        serde_json::json!({"train": "mnist", "test": "mnist"})
    );
    assert!(!info("mnist", &[]).err.contains("these are the images of"));
    // Under the name of another published dataset it would be taken for that.
    let mut command =
        sandbox.command("eval -a gallery:zero_one-1 --images 4 --dataset fashion-mnist".split(' '));
    command.env("MORPHCOG_DATA", &mnist);
    said(command).ended(3, &["mnist", "fashion-mnist"]);
}

#[test]
fn a_run_is_shown_its_images_the_way_it_was_made_with_them_whatever_their_files_are_called() {
    let sandbox = with_run();
    sandbox.run(COMMANDS[0]).ended(0, &[]);
    let before = sandbox.read("runs/one/eval.json");
    // By their new names they would be transposed.
    remove_dir_all(sandbox.path("there")).unwrap();
    write_images(&sandbox, "there/emnist-letters-", [10, 10], 1);
    sandbox.run(COMMANDS[0]).ended(0, &[]);
    assert_eq!(sandbox.read("runs/one/eval.json"), before);
    for command in COMMANDS[1..8].iter() {
        sandbox.run(command).ended(0, &[]);
    }
    // A run that is made with them says how they are seen.
    let evolve = format!("evolve -c shapes.toml -g 2 --data there {UNVALIDATED} -o");
    sandbox
        .run(&format!("{evolve} runs/turned"))
        .ended(0, &["data.transpose = false"]);
    let same = sandbox
        .run(&format!("{evolve} runs/same --set data.transpose=false"))
        .ended(0, &[]);
    assert!(!same.err.contains("data.transpose"), "{}", same.err);
    let of = |run: &str| sandbox.run_file(run).dataset;
    assert_eq!(of("runs/same"), of("runs/one"));
    assert_ne!(of("runs/turned"), of("runs/one"));
    assert!(!sandbox.read("runs/turned/run.json").contains("transpose"));
    // And goes on so when they have other names.
    remove_dir_all(sandbox.path("there")).unwrap();
    write_dataset(&sandbox, "there", 1);
    sandbox
        .run("eval -a runs/turned --images 8 --cycles 1 --robots top:2")
        .ended(0, &[]);
    let wrong = "evolve -c tiny.toml -o runs/two --set data.transpose=true";
    sandbox.write("tiny.toml", TINY);
    sandbox.run(wrong).ended(3, &["data.transpose"]);
}

#[test]
#[cfg(unix)]
fn a_tilde_in_a_path_is_the_home_folder() {
    let sandbox = with_run();
    let at_home = |args: &str| {
        let mut command = sandbox.command(args.split_whitespace());
        command.env("HOME", sandbox.path(""));
        said(command)
    };
    let evolve = format!("evolve -q -c ~/shapes.toml -g 1 {UNVALIDATED}");
    at_home(&format!("{evolve} -o runs/two --set data.dir=~/there")).ended(0, &[]);
    assert_eq!(
        sandbox.read("runs/two/run.json").matches("~/there").count(),
        1
    );
    at_home(&format!("{evolve} -o runs/three --data=~/there")).ended(0, &[]);
    at_home("data info shapes --data=~/there").ended(0, &[]);
    // What a folder is really called is no home folder.
    sandbox
        .run("evolve -c shapes.toml -o runs/four --data=~there")
        .ended(3, &["~there"]);
    sandbox.write(
        "plans/plan.toml",
        "archive = \"~/runs/one\"\nrobots = \"top:1\"\ngroups = [\"0|1\"]\n\
         set = [\"train.random_images=40\", \"train.rounds=1\", \"train.images=10\", \"train.final_images=10\", \
         \"train.challengers=1\", \"train.images_per_class=30\", \"validation.images=40\"]\n",
    );
    at_home("sweep plans/plan.toml --list --out all").ended(0, &[]);
}

#[test]
fn test_images_of_any_size_are_shown_to_robots_on_the_page() {
    let sandbox = Sandbox::new();
    write_images(&sandbox, "there/", [150, 200], 1);
    sandbox.write("shapes.toml", TINY.replace("\"builtin\"", "\"shapes\""));
    sandbox
        .run("evolve -q -c shapes.toml -o runs/one --data there")
        .ended(0, &[]);
    let robot = &sandbox.run_file("runs/one").elites[0].id;
    let server = Server::start(&sandbox, "--archive runs/one");
    let shown = |archive: usize| {
        let asked = serde_json::json!({
            "subject": { "archive": archive, "robot": robot }, "shown": { "image": { "set": "shapes", "index": 3 } },
        });
        server.post("/api/stimulus", &asked)
    };
    let answer = (0..9)
        .map(shown)
        .find(|answer| answer.status == 200)
        .unwrap();
    assert!(answer.body.contains("\"label\":1"), "{}", answer.body);
}
