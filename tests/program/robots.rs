//! Which archives and robots are meant.

use crate::common::program::{Sandbox, files, said};
use crate::with_run;
use morphcog::store::eval::EvalFile;

/// A sandbox with two finished runs, `a` and `b`, that have few robots and validation images.
fn with_two_runs() -> Sandbox {
    let sandbox = Sandbox::tiny();
    let few = "--set archive.keep=4";
    for (run, seed) in [("a", 3), ("b", 4)] {
        let evolve = format!(
            "evolve -q -c tiny.toml -o {run} --seed {seed} --set validation.images=40 {few}"
        );
        sandbox.run(&evolve).ended(0, &[]);
    }
    sandbox
}

#[test]
fn several_archives_are_named_in_the_same_way_by_every_command() {
    let sandbox = with_two_runs();
    let commands = [
        "eval -q -n 4 --cycles 1 --robots top:1",
        "audit -q --robots top:1",
        "plot -q archive",
        "plot -q progress",
        "plot -q body",
        "report -q --rollouts 0",
    ];
    for command in commands {
        for archives in [
            "--archive a b",
            "--archive a/run.json --archive b",
            "-a a -a b/run.json",
        ] {
            sandbox.run(&format!("{command} {archives}")).ended(0, &[]);
        }
        sandbox
            .run(&format!("{command} -a a b a/run.json"))
            .ended(2, &["a/run.json"]);
        sandbox
            .run(&format!("{command} -a a none"))
            .ended(3, &["none"]);
    }
    let words = |command: &str| {
        let help = sandbox.run(&format!("{command} --help")).ended(0, &[]).out;
        let (_, words) = help
            .split_once("--archive <FILE>...")
            .unwrap_or_else(|| panic!("{command}: {help}"));
        let words: Vec<&str> = words
            .split("under runs/)")
            .next()
            .unwrap_or_default()
            .split_whitespace()
            .collect();
        words.join(" ")
    };
    assert!(!words("eval").is_empty());
    for command in ["audit", "plot", "report", "serve"] {
        assert_eq!(words(command), words("eval"), "{command}");
    }
}

#[test]
fn robots_are_selected_in_the_same_words_by_every_command() {
    let sandbox = with_two_runs();
    let run = sandbox.run_file("a");
    let [first, second] = [0, 1].map(|place| run.elites[place].id.as_str());
    let commands = ["eval -q -n 4 --cycles 1", "audit -q", "plot -q body"];
    for command in commands {
        for robots in [
            "best",
            first,
            &format!("{first},{second}"),
            "top:1",
            "random:2",
            "best-validation:1",
        ] {
            sandbox
                .run(&format!("{command} -a a --robots {robots}"))
                .ended(0, &[]);
        }
        for word in ["--robot", "--select"] {
            sandbox
                .run(&format!("{command} -a a {word} {first}"))
                .ended(0, &[]);
        }
        sandbox
            .run(&format!(
                "{command} -a a --robots {first} --robots {second}"
            ))
            .ended(0, &[]);
        sandbox
            .run(&format!("{command} -a a --robots best --robots top:1"))
            .ended(2, &["--robots"]);
    }
    for command in commands.iter().chain(&["replay", "response"]) {
        sandbox
            .run(&format!("{command} -a a --robots worst:3"))
            .ended(2, &["worst:3", "top:N"]);
        sandbox
            .run(&format!("{command} -a a --robots top:0"))
            .ended(2, &["top:0"]);
        sandbox
            .run(&format!("{command} -a a --robots zzz"))
            .ended(3, &["zzz"]);
    }
    // A figure each.
    sandbox.run("plot body -a a --robots all").ended(0, &[]);
    assert!(run.elites.iter().all(|robot| {
        sandbox
            .path(&format!("a/plot-body-{}.svg", robot.id))
            .exists()
    }));
    sandbox.run("plot body --robots gallery").ended(0, &[]);
    assert!(
        ["APUKI", "YJTLA"]
            .iter()
            .all(|name| sandbox.path(&format!("plot-body-{name}.svg")).exists())
    );
    // Of several archives together.
    let best = ["a", "b"].map(|run| sandbox.run_file(run).best().unwrap().clone());
    let fittest = if best[1].objective > best[0].objective {
        &best[1]
    } else {
        &best[0]
    };
    let said = sandbox.run("plot body -a a b --robots top:1").ended(0, &[]);
    assert_eq!(said.out.matches("wrote").count(), 3, "{}", said.out);
    assert!(said.out.contains(&fittest.id), "{}", said.out);
}

#[test]
fn a_command_that_shows_one_robot_says_what_to_do_where_several_are_selected() {
    let sandbox = with_two_runs();
    let run = sandbox.run_file("a");
    for one in [
        "best",
        "top:1",
        "random:1",
        "best-validation:1",
        &run.elites[0].id,
    ] {
        sandbox
            .run(&format!("replay -a a --robot {one} -o walk.png"))
            .ended(0, &[]);
    }
    let [first, second] = [0, 1].map(|place| run.elites[place].id.as_str());
    for many in [
        "all",
        "top:2",
        "random:2",
        "best-validation:2",
        &format!("{first},{second}"),
    ] {
        let said = sandbox.run(&format!("replay -a a --robot {many} -o many.png"));
        said.ended(2, &["--robot: ", "morphcog plot"]);
    }
    let said = sandbox.run("replay --robot gallery --dataset builtin -o many.png");
    said.ended(2, &["5 (QMAXD", "--robot QMAXD"]);
    assert!(!sandbox.path("many.png").exists());
}

#[test]
fn robots_are_found_by_unique_beginnings_of_their_ids_only() {
    let sandbox = with_run();
    let run = sandbox.run_file("run");
    let ids: Vec<&str> = run.elites.iter().map(|robot| robot.id.as_str()).collect();
    let id = ids[0];
    let unique = (1..=id.len())
        .map(|len| &id[..len])
        .find(|begin| ids.iter().filter(|other| other.starts_with(*begin)).count() == 1)
        .unwrap();
    let replay = |robot: &str| {
        sandbox.run(&format!(
            "replay -a run/run.json --robot {robot} -o out.png"
        ))
    };
    for known in [id, unique, &id.to_uppercase(), "best"] {
        replay(known).ended(0, &[]);
    }
    replay("zzz").ended(3, &["zzz"]);
    let eval = |robots: &str| {
        sandbox.run(&format!(
            "eval -a run/run.json -n 2 --cycles 1 --robots {robots}"
        ))
    };
    assert!(eval(unique).ended(0, &[]).out.contains(id));
    eval(&format!("{unique},zzz")).ended(3, &["zzz"]);
    // Of more than sixteen robots two ids begin alike.
    let twice = ids.iter().find_map(|id| {
        let begin = &id[..1];
        (ids.iter().filter(|other| other.starts_with(begin)).count() > 1).then_some(begin)
    });
    let twice = twice.expect("more than sixteen robots");
    eval(twice).ended(3, &[&format!("begin with {twice}: ")]);
}

#[test]
fn robots_drawn_at_random_depend_on_the_seed_and_are_different_ones() {
    let sandbox = with_run();
    let drawn = |seed: u32, count: usize| -> Vec<String> {
        let eval = format!(
            "eval -q -a run/run.json -n 2 --cycles 1 --robots random:{count} --seed {seed}"
        );
        sandbox.run(&eval).ended(0, &[]);
        let report: EvalFile = serde_json::from_str(&sandbox.read("run/eval.json")).unwrap();
        report.robots.into_iter().map(|robot| robot.id).collect()
    };
    let all = sandbox.run_file("run").elites.len();
    assert_eq!(drawn(1, 3), drawn(1, 3));
    assert!((2..8).any(|seed| drawn(seed, 3) != drawn(1, 3)));
    let mut everyone = drawn(1, all + 5);
    everyone.sort();
    everyone.dedup();
    assert_eq!(everyone.len(), all);
}

#[test]
fn a_broken_run_json_is_refused_saying_how() {
    let sandbox = with_run();
    let whole = sandbox.read("run/run.json");
    let replaced = |from: &str, to: &str| {
        assert!(whole.contains(from), "{from}");
        whole.replacen(from, to, 1)
    };
    let edge = whole.find("\"edges\":[[").unwrap() + "\"edges\":[".len();
    let cyclic = format!("{}[4,4,1.0],{}", &whole[..edge], &whole[edge..]);
    let elite = whole.lines().nth(1).unwrap();
    let id = &sandbox.run_file("run").elites[0].id;
    for (content, word) in [
        (String::new(), "run.json"),
        (whole[..whole.len() / 2].to_string(), "run.json:"),
        ("{\"a\": 1}".to_string(), "format"),
        ("[1, 2]".to_string(), "run.json"),
        (
            replaced("\"format_version\":1", "\"format_version\":2"),
            "format_version",
        ),
        (
            replaced("\"format\":\"morphcog-run\"", "\"format\":\"other\""),
            "format",
        ),
        (cyclic, "elites.1.genome"),
        (
            replaced(
                "\"elites\":[",
                &format!("\"elites\":[\n{},", elite.trim_end_matches(',')),
            ),
            "elite",
        ),
        (
            replaced("\"displacements\":[", "\"displacements\":[1.0,"),
            "displacement",
        ),
        (replaced("\"cell\":[", "\"cell\":[999,"), "cell"),
        (
            replaced("\"gravity\":110.0", "\"gravity\":null"),
            "config.physics.gravity",
        ),
        (replaced("\"body\":[[", "\"body\":[[9],["), "body"),
        (
            replaced(&format!("\"id\":\"{id}\""), "\"id\":\"../../x\""),
            "its id",
        ),
        (
            replaced("\"voxels\":{\"muscle\":", "\"voxels\":{\"muscle\":1"),
            "voxel counts",
        ),
        (replaced("\"task\":\"0|1\"", "\"task\":\"0|2\""), "task"),
        (replaced("\"label\":0", "\"label\":7"), "training_images"),
        (
            replaced("\"possible_cells\":", "\"possible_cells\":1"),
            "dimensions",
        ),
    ] {
        sandbox.write("bad/run.json", &content);
        for command in [
            "eval -n 2 --cycles 1 -a bad/run.json",
            "replay -a bad/run.json",
        ] {
            let said = sandbox.run(command).ended(3, &["bad/run.json"]);
            assert!(said.err.contains(word), "expected {word:?} in {}", said.err);
        }
    }
    assert_eq!(files(&sandbox.path("bad")).len(), 1, "nothing was written");
}

#[test]
fn robots_that_ship_with_the_program_are_named_where_archives_are() {
    let sandbox = Sandbox::new();
    sandbox
        .run("plot body -q -a gallery:zero_one-2 -o body.svg")
        .ended(0, &[]);
    sandbox
        .run("replay -q -a gallery:zero_one --robot best --dataset builtin --images 0 -o walk.png")
        .ended(0, &[]);
    // Where one run is wanted, a set is no answer.
    sandbox
        .run("response -a gallery:team")
        .ended(2, &["45", "gallery:team-0v1"]);
    sandbox.write("plan.toml", "archive = \"gallery:team\"\npairs = [0, 1]\n");
    sandbox
        .run("sweep plan.toml --status")
        .ended(3, &["archive", "45"]);
    // Of a set, every run; results go to the present folder, under the name of the set.
    sandbox
        .run("eval -q -a gallery:zero_one --dataset builtin --images 2 --cycles 1 --physical-only")
        .ended(0, &[]);
    let tested: serde_json::Value =
        serde_json::from_str(&sandbox.read("gallery-zero_one-eval.json")).unwrap();
    let robots = tested["robots"].as_array().unwrap();
    assert!(
        robots.len() >= 2 && robots.iter().all(|robot| robot["task"] == "0|1"),
        "{robots:?}"
    );
    // And from there they are read.
    sandbox
        .run("report -q -a gallery:zero_one --rollouts 0")
        .ended(0, &[]);
    let page = sandbox.read("gallery-zero_one-report.html");
    let id = robots[0]["id"].as_str().unwrap();
    assert!(
        page.contains("2 builtin test images") && page.contains(id),
        "the report has the test"
    );
    sandbox
        .run("eval -q -a gallery:zero_one-2 --dataset builtin --images 2 --cycles 1")
        .ended(0, &[]);
    sandbox
        .run("plot accuracy -q -a gallery:zero_one-2")
        .ended(0, &[]);
    assert!(
        sandbox
            .path("gallery-zero_one-2-plot-accuracy.svg")
            .exists()
    );
    sandbox
        .run("plot body -q -a gallery:zero_one-1 --robot best")
        .ended(0, &[]);
    let id = &morphcog::robots::published::trained(morphcog::shipped::gallery::ZERO_ONE).unwrap()
        [0]
    .0
    .elites[0]
        .id;
    assert!(
        sandbox
            .path(&format!("gallery-zero_one-1-plot-body-{id}.svg"))
            .exists()
    );
    let refused = sandbox.run("eval -a gallery:zero --images 2");
    refused.ended(
        2,
        &[
            "gallery:zero",
            "gallery:all, gallery:zero_one, gallery:zero_one-1",
        ],
    );
}

#[test]
fn runs_of_the_atlas_are_read_compressed_and_leave_their_results_here() {
    let sandbox = with_run();
    let compressed = |name: &str| {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        std::io::Write::write_all(&mut encoder, sandbox.read(name).as_bytes()).unwrap();
        encoder.finish().unwrap()
    };
    sandbox
        .run("audit -q -a run --robots best --set least_walk=0")
        .ended(0, &[]);
    for file in ["run.json", "audit.json"] {
        sandbox.write(
            &format!("data/atlas/tiny-1/{file}.gz"),
            compressed(&format!("run/{file}")),
        );
        sandbox.write(
            &format!("elsewhere/tiny-2/{file}.gz"),
            compressed(&format!("run/{file}")),
        );
    }
    let results_of = |from: &str| {
        (
            sandbox.read(&format!("{from}.json")),
            sandbox.read(&format!("{from}.csv")),
        )
    };
    sandbox
        .run("eval -q -a run --robots best --images 4")
        .ended(0, &[]);
    sandbox
        .run("eval -q -a atlas:tiny-1 --robots best --images 4")
        .ended(0, &[]);
    assert_eq!(results_of("run/eval").1, results_of("atlas-tiny-1-eval").1);
    sandbox
        .run(
            "capacity -q --eval atlas-tiny-1-eval.json --set trainings=1 --set clean=true \
             --set mlp.epochs=1 --set sizes=[1,2]",
        )
        .ended(0, &[]);
    for kind in ["accuracy", "capacity"] {
        sandbox
            .run(&format!("plot {kind} -q -a atlas:tiny-1"))
            .ended(0, &[]);
        assert!(
            sandbox
                .path(&format!("atlas-tiny-1-plot-{kind}.svg"))
                .exists()
        );
    }
    sandbox.run("plot archive -q -a atlas:tiny").ended(0, &[]);
    sandbox
        .run("report -q -a atlas:tiny-1 -o report.html")
        .ended(0, &[]);
    assert!(
        sandbox
            .read("report.html")
            .contains("robots, 1 were audited")
    );

    // An audit goes on from the verdicts that came with the run, and what it finds here counts.
    let missing = ["atlas:tiny-1/audit.json: ", "(1 of"];
    sandbox
        .run("eval -q -a atlas:tiny-1 --robots random:2 --images 4 --physical-only")
        .ended(3, &missing);
    let run: serde_json::Value = serde_json::from_str(&sandbox.read("run/run.json")).unwrap();
    let audited = sandbox.read("run/audit.json");
    let ids = run["elites"]
        .as_array()
        .unwrap()
        .iter()
        .map(|robot| robot["id"].as_str().unwrap());
    let all = ids.clone().count();
    let others: Vec<&str> = ids.filter(|id| !audited.contains(id)).collect();
    assert_eq!(others.len(), all - 1);
    let others = others.join(",");
    sandbox
        .run(&format!(
            "audit -q -a atlas:tiny-1 --robots {others} --set least_walk=0"
        ))
        .ended(0, &[]);
    sandbox
        .run("report -q -a atlas:tiny-1 -o all.html")
        .ended(0, &[]);
    assert!(
        sandbox
            .read("all.html")
            .contains(&format!("robots, {all} were audited"))
    );
    let drawn =
        sandbox.run("eval -a atlas:tiny-1 --robots random:2 --images 4 --cycles 1 --physical-only");
    assert!(!drawn.err.contains("has not been audited"), "{}", drawn.err);
    sandbox.write(
        "atlas-tiny-1-audit.json",
        sandbox
            .read("atlas-tiny-1-audit.json")
            .replace("sha256\":\"", "sha256\":\"0"),
    );
    let stale = [
        "atlas-tiny-1-audit.json: ",
        "`morphcog audit --archive atlas:tiny-1`",
    ];
    sandbox
        .run("eval -a atlas:tiny-1 --robots random:2 --images 4 --physical-only")
        .ended(3, &stale);

    let elsewhere = |args: &str| {
        let mut command = sandbox.command(args.split_whitespace());
        command.env("MORPHCOG_ATLAS", "elsewhere");
        said(command)
    };
    elsewhere("eval -q -a atlas:tiny-2 --robots best --images 4").ended(0, &[]);
    elsewhere("eval -q -a atlas:tiny-1 --robots best --images 4").ended(0, &[]);
    let both = [
        "elsewhere/tiny-3/run.json.gz",
        "data/atlas/tiny-3/run.json.gz",
        "tiny-2",
    ];
    elsewhere("eval -a atlas:tiny-3 --images 4").ended(3, &both);
    let unset = ["atlas:tiny-2/run.json: ", "MORPHCOG_ATLAS", "tiny-1"];
    sandbox
        .run("eval -a atlas:tiny-2 --images 4")
        .ended(3, &unset);
    Sandbox::new()
        .run("replay -a atlas:tiny-2")
        .ended(3, &["MORPHCOG_ATLAS"]);
    let mut command = sandbox.command("eval -a atlas:tiny-1 --images 4".split_whitespace());
    command.env("MORPHCOG_ATLAS", "nowhere");
    said(command).ended(3, &["MORPHCOG_ATLAS=nowhere: "]);
    // A file of two members, as `cat a.gz b.gz` makes it, is what both hold.
    let run = std::fs::read(sandbox.path("run/run.json")).unwrap();
    for (part, name) in [
        (&run[..run.len() / 2], "first"),
        (&run[run.len() / 2..], "second"),
    ] {
        sandbox.write(name, part);
    }
    let members = [compressed("first"), compressed("second")].concat();
    sandbox.write("data/atlas/members-1/run.json.gz", members);
    sandbox
        .run("plot archive -a atlas:members-1 -o members.svg")
        .ended(0, &[]);
    sandbox.write(
        "data/atlas/broken-1/run.json.gz",
        &compressed("run/run.json")[..200],
    );
    sandbox
        .run("eval -a atlas:broken --images 4")
        .ended(3, &["atlas:broken-1/run.json: "]);
}
