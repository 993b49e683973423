//! A team: robots that tell pairs apart answer together, by rules that a few lines here repeat; it
//! goes on after a stop, and says clearly who or what is missing.

use crate::common::program::{Sandbox, TINY, files, pairs};
use morphcog::store::eval::EvalFile;
use morphcog::store::team::TeamFile;
use morphcog::task::margins::Margins;
use morphcog::task::stimulus::Reduction;
use serde_json::Value;
use std::collections::BTreeMap;

const TEAM: &str = "team --archive pairs/0v1 pairs/0v4 pairs/1v4 --classes 0,1,4";

fn read(sandbox: &Sandbox, name: &str) -> TeamFile {
    TeamFile::read(&sandbox.path(name)).unwrap()
}

#[test]
fn the_answers_are_those_of_the_rules_in_the_documentation() {
    let sandbox = pairs();
    sandbox.run(&format!("{TEAM} --images 24")).ended(0, &[]);
    let team = read(&sandbox, "pairs/team.json");
    let answers = team.answers.as_ref().unwrap();
    assert_eq!(
        (team.images.len(), team.members.len(), team.size),
        (24, 3, 3)
    );
    for (place, image) in team.images.iter().enumerate() {
        let (mut votes, mut sums) = (BTreeMap::<u8, i32>::new(), BTreeMap::<u8, f64>::new());
        for member in &team.members {
            let walk = member.displacements[place].unwrap_or(0.0);
            let [a, b] = [member.groups[0][0], member.groups[1][0]];
            let (left, right) = if member.first_group_walks == "left" {
                (a, b)
            } else {
                (b, a)
            };
            let (towards, away) = if walk > 0.0 {
                (right, left)
            } else {
                (left, right)
            };
            *votes.entry(towards).or_default() += i32::from(walk.abs() > 3.0);
            *sums.entry(towards).or_default() += walk.abs().min(10.0);
            *sums.entry(away).or_default() -= walk.abs().min(10.0);
        }
        let most = [0, 1, 4]
            .map(|class| votes.get(&class).copied().unwrap_or(0))
            .into_iter()
            .max()
            .unwrap();
        let best = |among: &dyn Fn(u8) -> bool| {
            let candidates = [0_u8, 1, 4].into_iter().filter(|class| among(*class));
            candidates
                .reduce(|best, next| {
                    if sums[&next] > sums[&best] {
                        next
                    } else {
                        best
                    }
                })
                .unwrap()
        };
        let by_votes = best(&|class| votes.get(&class).copied().unwrap_or(0) == most);
        let found = (answers.votes.answers[place], answers.walks.answers[place]);
        assert_eq!(
            found,
            (by_votes, best(&|_| true)),
            "image {place} of class {}",
            image.label
        );
    }
    let right = |of: &[u8]| {
        team.images
            .iter()
            .zip(of)
            .filter(|(image, answer)| image.label == **answer)
            .count()
    };
    assert_eq!(answers.votes.accuracy.right, right(&answers.votes.answers));
    let diagonal: usize = (0..3)
        .map(|class| answers.votes.confusion[class][class])
        .sum();
    assert_eq!(answers.votes.accuracy.right, diagonal);
    assert_eq!(answers.votes.confusion.iter().flatten().sum::<usize>(), 24);
    // What needs no body reads drawn digits well; the table and the pictures are there.
    let baselines = team.baselines.unwrap();
    assert!(
        baselines.linear_pairs.accuracy > 0.9 && baselines.nearest_neighbour.accuracy > 0.9,
        "{baselines:?}"
    );
    assert_eq!(sandbox.read("pairs/team.csv").lines().count(), 25);
    for picture in ["confusion.svg", "confusion.png", "bodies.svg", "bodies.png"] {
        assert!(
            sandbox.path(&format!("pairs/team-{picture}")).exists(),
            "{picture}"
        );
    }
}

#[test]
fn robots_see_their_own_windows_and_classifiers_what_all_see_together() {
    let sandbox = pairs();
    let tested = |name: &str| {
        sandbox
            .run(&format!("{TEAM} -q --images 24 -o {name}.json"))
            .ended(0, &[]);
        read(&sandbox, &format!("{name}.json"))
    };
    let before = tested("before");
    // A robot that images move, and its run.
    let moves = |walks: &[Option<f64>]| walks.iter().any(|walk| *walk != walks[0]);
    let seeing = before
        .members
        .iter()
        .position(|member| moves(&member.displacements))
        .unwrap();
    let [a, b] = [0, 1].map(|group| before.members[seeing].groups[group][0]);
    let path = format!("pairs/{}v{}", a.min(b), a.max(b));
    let text = sandbox.read(&format!("{path}/run.json"));
    let mut run = sandbox.run_file(&path);
    // All but the two leftmost columns, which are dark, are hidden from it.
    run.config.stimulus.margin = Margins {
        right: 26,
        ..Margins::default()
    };
    sandbox.write(&format!("{path}/run.json"), run.to_json());
    let after = tested("after");
    for (place, (a, b)) in before.members.iter().zip(&after.members).enumerate() {
        assert_eq!(
            a.displacements != b.displacements,
            place == seeing,
            "{place}"
        );
    }
    assert!(!moves(&after.members[seeing].displacements));
    let [a, b] = [&before, &after].map(|team| team.baselines.clone().unwrap());
    assert_eq!(
        (a.linear_one_against_rest, a.nearest_neighbour),
        (b.linear_one_against_rest, b.nearest_neighbour)
    );
    // Both classes are the same there, and only the linear function of that pair is lost.
    assert!(
        b.linear_pairs.accuracy < a.linear_pairs.accuracy - 0.05,
        "{a:?} {b:?}"
    );
    assert!(b.linear_pairs.accuracy > 0.5, "{b:?}");
    // As it was, the test has the bytes that it had.
    sandbox.write(&format!("{path}/run.json"), text);
    tested("again");
    assert_eq!(sandbox.read("before.json"), sandbox.read("again.json"));
}

#[test]
fn eval_shows_robots_of_several_runs_their_own_windows_and_judges_pixels_by_what_all_see() {
    let sandbox = pairs();
    let mut run = sandbox.run_file("pairs/0v1");
    run.config.stimulus.reduction = Reduction::Area;
    sandbox.write("whole/run.json", run.to_json());
    run.config.stimulus.margin = Margins {
        right: 9,
        ..Margins::default()
    };
    sandbox.write("left/run.json", run.to_json());
    run.config.stimulus.margin = Margins {
        left: 9,
        ..Margins::default()
    };
    sandbox.write("right/run.json", run.to_json());
    let tested = |archives: &str, count: usize, name: &str| -> EvalFile {
        sandbox
            .run(&format!(
                "eval -q -a {archives} --robots top:{count} --images 24 -o {name}.json"
            ))
            .ended(0, &[]);
        serde_json::from_str(&sandbox.read(&format!("{name}.json"))).unwrap()
    };
    let [whole, left, right] = ["whole", "left", "right"].map(|run| tested(run, 1, run));
    let walks = |file: &EvalFile| -> Vec<_> {
        file.robots
            .iter()
            .map(|robot| robot.displacements.clone())
            .collect()
    };
    let both = tested("left right", 2, "both");
    assert_eq!(walks(&both), [walks(&left), walks(&right)].concat());
    assert!(walks(&left) != walks(&right) && walks(&left) != walks(&whole));
    assert_eq!(
        both.setting.unwrap().stimulus,
        whole.setting.unwrap().stimulus
    );
    assert_eq!(both.baselines, whole.baselines);
    assert_ne!(both.baselines, left.baselines);
    // Another encoding is another experiment.
    run.config.stimulus.level = 0.3;
    sandbox.write("right/run.json", run.to_json());
    sandbox
        .run("eval -q -a left right")
        .ended(3, &["right/run.json", "[stimulus]"]);
}

#[test]
fn eval_shows_robots_of_several_tasks_the_same_images_if_these_split_the_same_classes() {
    let sandbox = Sandbox::new();
    for (name, task) in [
        ("zero", "groups = [[0], [1, 4]]"),
        ("four", "groups = [[4], [0, 1]]"),
        ("all", "splits = [0, 1, 4]"),
        ("pair", "groups = [[0], [1]]"),
    ] {
        let config = TINY
            .replace("groups = [[0], [1]]", task)
            .replace("train_images = [0, 1]", "");
        let config = config.replace("generations = 12", "generations = 3\narchive.keep = 2");
        sandbox.write("run.toml", config);
        sandbox
            .run(&format!("evolve -q -c run.toml -o {name}"))
            .ended(0, &[]);
    }
    let tested = |archives: &str, robots: &str, name: &str| -> EvalFile {
        let archives = format!("-a {archives} --robots {robots}");
        sandbox
            .run(&format!("eval -q {archives} --images 6 -o {name}.json"))
            .ended(0, &[]);
        EvalFile::read(&sandbox.path(&format!("{name}.json"))).unwrap()
    };
    let [zero, four, all] = ["zero", "four", "all"].map(|name| tested(name, "top:1", name));
    let together = tested("zero four all", "all", "together");
    let tasks: Vec<&str> = together.means.keys().map(String::as_str).collect();
    assert_eq!(tasks, ["0|14", "1|04", "4|01"]);
    for (file, run) in [(&zero, 0), (&four, 1), (&all, 2)] {
        assert!(!file.robots.is_empty());
        for alone in &file.robots {
            let same = together
                .robots
                .iter()
                .find(|robot| robot.run == run && robot.id == alone.id);
            let same = same.unwrap_or_else(|| panic!("{}: not tested", alone.id));
            assert_eq!(
                (&same.task, same.right, same.images),
                (&alone.task, alone.right, alone.images)
            );
            let of = |file: &EvalFile| {
                let mut walks: Vec<(usize, u8)> = file
                    .images
                    .iter()
                    .map(|image| (image.index, image.label))
                    .collect();
                walks.sort_unstable();
                walks
            };
            assert_eq!(of(file), of(&together));
        }
    }
    // The nearest training image is of the runs that have a task: of this one, one has it by itself.
    let nearest =
        |file: &EvalFile, task: &str| file.baselines[task].nearest_training_image.unwrap();
    let mean = f64::midpoint(nearest(&zero, "0|14"), nearest(&all, "0|14"));
    assert!((nearest(&together, "0|14") - mean).abs() < 1e-12);
    assert_eq!(nearest(&together, "1|04"), nearest(&all, "1|04"));
    let few = "--set networks=[\"mlp\"] --set trainings=1 --set sizes=[1,2] --set mlp.epochs=1";
    let of_all = format!("capacity -q --eval together.json {few} -o capacity.json");
    let capacity = sandbox.run(&of_all).ended(0, &[]);
    assert!(
        tasks.iter().all(|task| capacity.out.contains(task)),
        "{}",
        capacity.out
    );
    // Other classes are another experiment.
    sandbox
        .run("eval -q -a zero pair")
        .ended(3, &["pair/run.json", "[task]"]);
}

#[test]
fn a_team_shows_the_same_walks_as_eval() {
    let sandbox = pairs();
    sandbox
        .run("eval -q -a pairs/0v1 --robots best --images 8 -o eval.json")
        .ended(0, &[]);
    sandbox
        .run("team -q --archive pairs/0v1 --classes 0,1 --images 8 -o team.json")
        .ended(0, &[]);
    let eval: Value = serde_json::from_str(&sandbox.read("eval.json")).unwrap();
    let member = &read(&sandbox, "team.json").members[0];
    let walks: Vec<Option<f64>> =
        serde_json::from_value(eval["robots"][0]["displacements"].clone()).unwrap();
    assert_eq!(member.displacements, walks);
    assert_eq!(
        Value::from(member.own.accuracy),
        eval["robots"][0]["accuracy"]
    );
    assert_eq!(
        Value::from(member.first_group_walks.as_str()),
        eval["robots"][0]["first_group_walks"]
    );
}

#[test]
fn a_test_that_was_stopped_goes_on_and_ends_with_the_same_bytes_on_any_threads() {
    let sandbox = pairs();
    std::fs::create_dir(sandbox.path("whole")).unwrap();
    std::fs::create_dir(sandbox.path("parts")).unwrap();
    sandbox
        .run(&format!(
            "{TEAM} -q --images 6 -o whole/team.json --threads 1"
        ))
        .ended(0, &[]);
    // As if it was stopped after the first robot.
    let mut part = read(&sandbox, "whole/team.json");
    part.members.truncate(1);
    (part.answers, part.baselines) = (None, None);
    part.write(&sandbox.path("parts/team.json")).unwrap();
    let said = sandbox
        .run(&format!("{TEAM} --images 6 -o parts/team.json --threads 3"))
        .ended(0, &[]);
    assert!(said.err.contains("(6 of 18 walks known"), "{}", said.err);
    assert!(files(&sandbox.path("whole")) == files(&sandbox.path("parts")));
    // As if it was stopped within a block: two robots have seen some of the images.
    let mut part: Value = serde_json::from_str(&sandbox.read("whole/team.json")).unwrap();
    let root = part.as_object_mut().unwrap();
    root.remove("answers");
    root.remove("baselines");
    let members = root["members"].as_array_mut().unwrap();
    members.pop();
    for (member, shown) in members.iter_mut().zip([vec![0, 2, 4, 5], vec![2]]) {
        for place in (0..6).filter(|place| !shown.contains(place)) {
            member["displacements"][place] = Value::Null;
        }
        member["shown"] = shown.into();
    }
    sandbox.write("parts/team.json", part.to_string());
    let said = sandbox
        .run(&format!("{TEAM} --images 6 -o parts/team.json --threads 2"))
        .ended(0, &[]);
    assert!(said.err.contains("(5 of 18 walks known"), "{}", said.err);
    assert!(files(&sandbox.path("whole")) == files(&sandbox.path("parts")));
    // With a run more, before the others: only its robot is shown the images, and what is known of the
    // others is in the file from then on.
    let fewer = TEAM.replace("pairs/0v1 ", "");
    std::fs::create_dir(sandbox.path("more")).unwrap();
    sandbox
        .run(&format!("{fewer} -q --images 6 -o more/team.json"))
        .ended(0, &[]);
    let said = sandbox
        .run(&format!("{TEAM} --images 6 -o more/team.json"))
        .ended(0, &[]);
    assert!(said.err.contains("(12 of 18 walks known"), "{}", said.err);
    assert!(files(&sandbox.path("whole")) == files(&sandbox.path("more")));
    // Other images are shown to all.
    let said = sandbox
        .run(&format!("{TEAM} --images 6 --seed 2 -o parts/team.json"))
        .ended(0, &[]);
    assert!(!said.err.contains(" known"), "{}", said.err);
}

#[test]
fn a_file_that_cannot_be_read_is_not_written_over() {
    let sandbox = pairs();
    for content in [
        "{",
        "{\"format\": \"morphcog-team\", \"format_version\": 99}",
        "my notes",
    ] {
        sandbox.write("pairs/team.json", content);
        let said = sandbox.run(&format!("{TEAM} -q --images 6"));
        said.ended(3, &["pairs/team.json", "--out"]);
        assert_eq!(sandbox.read("pairs/team.json"), content);
    }
}

#[test]
fn validation_images_are_none_that_a_run_was_trained_on() {
    let sandbox = pairs();
    sandbox
        .run(&format!("{TEAM} -q --split validation --images 6"))
        .ended(0, &[]);
    let team = read(&sandbox, "pairs/team-validation.json");
    for run in ["pairs/0v1", "pairs/0v4", "pairs/1v4"] {
        let trained = sandbox.run_file(run).training_images;
        assert!(
            !trained.is_empty() && team.images.iter().all(|image| !trained.contains(image)),
            "{run}"
        );
    }
}

#[test]
fn what_is_missing_or_does_not_go_together_is_said_with_exit_code_3() {
    let sandbox = pairs();
    let all = sandbox.run("team --archive pairs/0v1 pairs/0v4");
    all.ended(3, &["2, 3, 5, 6, 7, 8, 9", "--classes"]);
    sandbox
        .run("team --archive pairs/0v4 pairs/1v4 --classes 0,1")
        .ended(3, &["left out: 2 robots that know other classes", "0, 1"]);
    sandbox.run("team").ended(3, &["data fetch mnist"]);
    sandbox.run("team --archive nowhere").ended(3, &["nowhere"]);
    sandbox
        .run("team --archive pairs/0v1 pairs/0v1 --classes 0,1")
        .ended(2, &["pairs/0v1/run.json"]);
    sandbox
        .run("team --archive pairs/0v1 --classes 0,77")
        .ended(2, &["77"]);
    sandbox
        .run("team --archive pairs/0v1 --classes 0,1 --images 1")
        .ended(2, &["--images 1"]);
    sandbox
        .run("team --archive pairs/0v1 --classes 0,1 --images 99999")
        .ended(3, &["500", "1000"]);
    sandbox
        .run(&format!("{TEAM} --robots none"))
        .ended(3, &["none"]);
    sandbox
        .run(&format!("{TEAM} --robots best-validation:1"))
        .ended(2, &["best-validation"]);
    sandbox
        .run(&format!("{TEAM} --out pairs/0v1/run.json"))
        .ended(2, &["--out"]);
    let other = TINY.replace(
        "dataset = \"builtin\"",
        "dataset = \"builtin\"\nbuiltin = { seed = 9 }",
    );
    sandbox.write("run.toml", other);
    sandbox.run("evolve -q -c run.toml -o other").ended(0, &[]);
    sandbox
        .run("team --archive pairs/0v4 other --classes 0,1,4")
        .ended(3, &["other/run.json"]);
    assert!(!sandbox.path("pairs/team.json").exists());
}

#[test]
fn robots_that_know_other_classes_are_left_out_of_a_team() {
    let sandbox = pairs();
    let said = sandbox
        .run("team --archive pairs/0v1 pairs/0v4 pairs/1v4 --classes 1,4 --images 4 -o some.json")
        .ended(0, &[]);
    assert!(said.err.contains("left out: 2 robots"), "{}", said.err);
    let team = read(&sandbox, "some.json");
    assert_eq!((team.classes.as_slice(), team.size), (&[1, 4][..], 1));
    sandbox
        .run("team -q --archive pairs/1v4 --classes 1,4 --images 4 -o alone.json")
        .ended(0, &[]);
    assert_eq!(sandbox.read("some.json"), sandbox.read("alone.json"));
}

#[test]
fn a_second_test_on_other_images_or_without_a_member_keeps_the_first() {
    let sandbox = pairs();
    sandbox.run(&format!("{TEAM} -q --images 6")).ended(0, &[]);
    let first = sandbox.read("pairs/team.json");
    sandbox
        .run(&format!("{TEAM} --images 6"))
        .ended(0, &["(18 of 18 walks known", " 0.0 rollouts/s"]);
    assert_eq!(sandbox.read("pairs/team.json"), first);
    sandbox
        .run(&format!("{TEAM} --images 6 --seed 2"))
        .ended(0, &["pairs/team.json"]);
    assert_ne!(sandbox.read("pairs/team.json"), first);
    assert!(
        files(&sandbox.path("pairs"))
            .values()
            .any(|content| content == first.as_bytes())
    );
    let whole = sandbox.read("pairs/team.json");
    let smaller = TEAM.replace(" pairs/1v4", "");
    sandbox
        .run(&format!("{smaller} --images 6 --seed 2"))
        .ended(0, &["(12 of 12 walks known", "pairs/team.json"]);
    assert_eq!(read(&sandbox, "pairs/team.json").members.len(), 2);
    assert!(
        files(&sandbox.path("pairs"))
            .values()
            .any(|content| content == whole.as_bytes())
    );
}
