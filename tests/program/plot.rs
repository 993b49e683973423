//! `morphcog plot`: every kind of figure is made, well-formed, the same every time, and refuses
//! what it cannot show.

use crate::common::program::{Made, Sandbox, TINY};
use roxmltree::{Document, Node};
use std::sync::OnceLock;

const CAPACITY: &str = r#"{
  "format": "morphcog-capacity", "format_version": 1, "program_version": "0.1.0", "run": "tiny",
  "selected": "all elites",
  "dataset": "builtin", "patience_on": "test", "trainings": 3, "stopped": false,
  "tasks": [{"task": "0|1", "robots": 2, "accuracy": 0.6, "curves": [
    {"network": "mlp", "fit": [0.5, 0.05, 0.0], "capacity": 2.0, "points": [
      {"size": 1, "mean": 0.55, "standard_deviation": 0.02, "parameters": 52},
      {"size": 2, "mean": 0.6, "standard_deviation": 0.03, "parameters": 103},
      {"size": 3, "mean": 0.65, "standard_deviation": 0.01, "parameters": 154}]}]}]}"#;

/// Kinds that show one robot, and kinds that do not.
const OF_ROBOTS: [&str; 3] = ["body", "spacetime", "snapshots"];
const OF_RUNS: [&str; 4] = ["archive", "progress", "accuracy", "capacity"];

/// A sandbox with a finished tiny run in `run`, with all that figures are made of.
fn with_run() -> Sandbox {
    static RUN: OnceLock<Made> = OnceLock::new();
    Sandbox::once(&RUN, |sandbox| {
        sandbox.write("tiny.toml", TINY);
        sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
        sandbox
            .run("eval -q -a run/run.json -n 10 -r top:3 --cycles 1")
            .ended(0, &[]);
        // Of the robots that were evaluated.
        let read = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
        let (mut capacity, eval) = (read(CAPACITY), read(&sandbox.read("run/eval.json")));
        capacity["selected"] = eval["selected"].clone();
        for key in ["robots", "accuracy"] {
            capacity["tasks"][0][key] = eval["means"]["0|1"][key].clone();
        }
        sandbox.write("run/capacity.json", capacity.to_string());
    })
}

/// Width and height that a PNG says it has.
fn png_size(bytes: &[u8]) -> [u32; 2] {
    assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n");
    [16, 20].map(|at| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()))
}

#[test]
fn every_kind_makes_a_well_formed_svg_a_png_and_a_pdf_beside_the_run() {
    let sandbox = with_run();
    let best = sandbox
        .run_file("run")
        .elites
        .into_iter()
        .max_by(|a, b| a.objective.total_cmp(&b.objective));
    let best = best.unwrap().id;
    for kind in OF_ROBOTS.into_iter().chain(OF_RUNS) {
        let said = sandbox
            .run(&format!("plot {kind} -a run/run.json"))
            .ended(0, &[]);
        let robot = if OF_ROBOTS.contains(&kind) {
            format!("-{best}")
        } else {
            String::new()
        };
        let stem = format!("run/plot-{kind}{robot}");
        for ending in ["svg", "png", "pdf"] {
            assert!(said.out.contains(&format!("{stem}.{ending}")), "{said:?}");
        }
        let svg = sandbox.read(&format!("{stem}.svg"));
        let document = Document::parse(&svg).unwrap();
        let root = document.root_element();
        assert_eq!(root.tag_name().name(), "svg");
        // Several can stand in one page.
        let clashes = |node: &Node| node.has_attribute("id") || node.has_attribute("class");
        assert!(!document.descendants().any(|node| clashes(&node)), "{kind}");
        // Its words are outlines, which look the same everywhere.
        let is_text = |node: &Node| node.has_tag_name("text");
        assert!(!document.descendants().any(|node| is_text(&node)), "{kind}");
        assert!(words(&document).len() > 2, "{kind}");
        if kind != "capacity" {
            assert!(
                svg.contains("run, seed 3"),
                "{kind}: the title says run and seed"
            );
        }
        assert!(
            robot.is_empty() || svg.contains(&best),
            "{kind}: the title says the robot"
        );
        assert!(svg.len() < 200_000, "{kind}: {}", svg.len());
        let png = std::fs::read(sandbox.path(&format!("{stem}.png"))).unwrap();
        // 85 mm at 300 pixels per inch.
        assert_eq!(png_size(&png)[0], 1005, "{kind}");
        let pdf = std::fs::read(sandbox.path(&format!("{stem}.pdf"))).unwrap();
        assert!(pdf.starts_with(b"%PDF-1.7\n"), "{kind}");
        let pdf = String::from_utf8_lossy(&pdf);
        assert!(
            pdf.contains("/MediaBox[0 0 241 ") && pdf.contains("/FontFile2 "),
            "{kind}"
        );
    }
}

/// The words of an SVG, in the order in which they are drawn.
fn words(document: &Document) -> Vec<String> {
    let letters = document
        .descendants()
        .filter(|node| node.has_tag_name("path"));
    letters
        .filter_map(|node| node.attribute("aria-label").map(str::to_string))
        .collect()
}

#[test]
fn a_figure_for_a_paper_has_its_width_no_title_and_the_font_of_the_paper() {
    let sandbox = with_run();
    let plot = |line: &str| sandbox.run(&format!("plot body -a run -o a.svg {line}"));
    let read = || {
        let svg = sandbox.read("a.svg");
        let document = Document::parse(&svg).unwrap();
        let width = document.root_element().attribute("width").unwrap();
        (width.to_string(), words(&document))
    };
    plot("").ended(0, &[]);
    let (_, with) = read();
    plot("--width 120 --no-title").ended(0, &[]);
    let (width, without) = read();
    assert_eq!(width, "340.16pt");
    assert_eq!(without, with[2..]);
    plot("--width 10").ended(2, &["--width", "60"]);
    // Another font than usual.
    let font = format!("{}/src/draw/assets", env!("CARGO_MANIFEST_DIR"));
    let bold = format!("{font}/DejaVuSansCondensed-Bold-subset.ttf");
    let own = sandbox.read("a.svg");
    let plain = |line: &str| {
        plot(&format!("--width 120 --no-title {line}")).ended(0, &[]);
        sandbox.read("a.svg")
    };
    assert_eq!(plain(""), own);
    assert_ne!(plain(&format!("--font {bold}")), own);
    // A letter that the font lacks is named; the program's own font draws a box.
    sandbox.write("漢.toml", TINY);
    sandbox.run("evolve -q -c 漢.toml -g 2 -o 漢").ended(0, &[]);
    let refused = format!("plot archive -a 漢 -o b --font {bold}");
    sandbox.run(&refused).ended(3, &["--font", "漢"]);
    sandbox.run("plot archive -a 漢 -o b.svg").ended(0, &[]);
    sandbox.write("no.ttf", "no font");
    plot("--font no.ttf").ended(3, &["no.ttf", "font"]);
    plot("--font none.ttf").ended(3, &["none.ttf"]);
    plot(&format!("--font {bold} --font {bold} --font {bold}")).ended(2, &["--font", "3"]);
}

#[test]
fn letters_are_at_least_seven_points_high() {
    let sandbox = with_run();
    for kind in OF_ROBOTS.into_iter().chain(OF_RUNS) {
        sandbox
            .run(&format!("plot {kind} -a run/run.json -o figure.svg"))
            .ended(0, &[]);
        let svg = sandbox.read("figure.svg");
        let document = Document::parse(&svg).unwrap();
        let sizes = document
            .descendants()
            .filter_map(|node| node.attribute("font-size")?.parse::<f64>().ok());
        assert!(sizes.fold(f64::INFINITY, f64::min) >= 7.0, "{kind}");
    }
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let sandbox = with_run();
    for kind in ["archive", "snapshots", "spacetime"] {
        for name in ["one", "two"] {
            sandbox
                .run(&format!("plot {kind} -a run/run.json -o {name}"))
                .ended(0, &[]);
        }
        for ending in ["svg", "png", "pdf"] {
            let [one, two] = ["one", "two"]
                .map(|name| std::fs::read(sandbox.path(&format!("{name}.{ending}"))).unwrap());
            assert!(one == two, "{kind}.{ending}");
        }
    }
}

#[test]
fn the_ending_says_the_format_and_the_resolution_is_a_choice() {
    let sandbox = with_run();
    sandbox
        .run("plot archive -a run/run.json -o a.png --dpi 72 --transparent")
        .ended(0, &[]);
    assert_eq!(
        png_size(&std::fs::read(sandbox.path("a.png")).unwrap())[0],
        241
    );
    sandbox
        .run("plot archive -a run/run.json -o a.svg")
        .ended(0, &[]);
    assert!(!sandbox.path("run/plot-archive.svg").exists());
    assert!(sandbox.read("a.svg").contains("#ffffff"));
}

#[test]
fn a_figure_that_is_too_long_for_print_has_fewer_pixels_and_nothing_is_written_before_that_is_known()
 {
    let sandbox = Sandbox::new();
    let tasks = TINY.replace(
        "groups = [[0], [1]]",
        "splits = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]",
    );
    let tasks = tasks.replace("train_images = [0, 1]", "images_per_class = 1");
    sandbox.write(
        "tasks.toml",
        tasks.replace("generations = 12", "generations = 1"),
    );
    sandbox.run("evolve -q -c tasks.toml -o run").ended(0, &[]);
    let refused = sandbox
        .run("plot archive -a run --dpi 300")
        .ended(2, &["--dpi 300"]);
    assert!(refused.out.is_empty(), "{refused:?}");
    assert!(!sandbox.path("run/plot-archive.svg").exists());
    sandbox
        .run("plot archive -a run --dpi 300 -o a.svg")
        .ended(0, &[]);
    sandbox
        .run("plot archive -a run")
        .ended(0, &["note: run/plot-archive.png: 4"]);
    assert_eq!(sandbox.read("run/plot-archive.svg"), sandbox.read("a.svg"));
    let [_, height] = png_size(&std::fs::read(sandbox.path("run/plot-archive.png")).unwrap());
    assert!((15_000..=16_000).contains(&height), "{height}");
}

#[test]
fn seeds_become_one_figure_and_robots_one_each() {
    let sandbox = with_run();
    sandbox
        .run("evolve -q -c tiny.toml --seed 4 -o other")
        .ended(0, &[]);
    sandbox
        .run("plot progress -a run/run.json -a other/run.json -o both.svg")
        .ended(0, &[]);
    // Without a name it goes above both, and not over a figure of one of them.
    sandbox
        .run("plot progress -q -a run/run.json -a other/run.json")
        .ended(0, &[]);
    assert!(
        sandbox.path("plot-progress.svg").exists()
            && !sandbox.path("run/plot-progress.svg").exists()
    );
    for kind in ["archive", "body"] {
        sandbox
            .run(&format!("plot {kind} -a run -o run/"))
            .ended(2, &["--out run/"]);
    }
    sandbox
        .run("replay -a run -f gif -o figs/")
        .ended(2, &["--out figs/"]);
    assert!(
        sandbox
            .read("both.svg")
            .contains("run, seed 3; other, seed 4")
    );
    // Folders that differ in the seed only have one name.
    for seed in [3, 4] {
        let args = format!("evolve -q -c tiny.toml --seed {seed} -o runs/tiny-seed{seed}");
        sandbox.run(&args).ended(0, &[]);
    }
    sandbox
        .run("plot progress -q -a runs -o all.svg")
        .ended(0, &[]);
    assert!(sandbox.read("all.svg").contains("tiny, seeds 3, 4"));
    sandbox
        .run("plot progress -a run -a run/run.json")
        .ended(2, &["run/run.json"]);
    let ids: Vec<String> = sandbox
        .run_file("run")
        .elites
        .iter()
        .take(2)
        .map(|elite| elite.id.clone())
        .collect();
    sandbox
        .run(&format!(
            "plot body -a run/run.json -r {},{}",
            ids[0], ids[1]
        ))
        .ended(0, &[]);
    for id in &ids {
        assert!(sandbox.path(&format!("run/plot-body-{id}.png")).exists());
    }
    // A published robot needs no archive.
    sandbox.run("plot body --robot YJTLA").ended(0, &[]);
    assert!(sandbox.read("plot-body-YJTLA.svg").contains("YJTLA"));
}

#[test]
fn a_test_of_several_runs_says_which_they_are_in_as_many_lines_as_that_needs() {
    let sandbox = with_run();
    sandbox.write("other.toml", crate::common::program::TINY);
    let evolve = |config: &str, seed: u64, out: &str| {
        sandbox
            .run(&format!(
                "evolve -q -c {config}.toml --seed {seed} -o {out}"
            ))
            .ended(0, &[]);
    };
    evolve("tiny", 4, "four");
    evolve("tiny", 3, "again --set map_elites.parents=6");
    evolve("other", 5, "other");
    // All words, after the title.
    let said_of = |runs: &str, robots: &str| {
        sandbox
            .run(&format!(
                "eval -q -a {runs} -n 10 -r {robots} --cycles 1 -o e.json"
            ))
            .ended(0, &[]);
        sandbox
            .run("plot accuracy -a e.json -o e.svg")
            .ended(0, &[]);
        let svg = sandbox.read("e.svg");
        let document = Document::parse(&svg).unwrap();
        words(&document).split_off(1)
    };
    let selected = "the 2 fittest of each task on the training images";
    let said = |runs: &str, name: &str, has_seed: bool| {
        let words = said_of(runs, "top:2");
        assert_eq!(words[0], format!("{name}; {selected}"));
        assert_eq!(
            words.iter().any(|word| word.ends_with("(3)")),
            has_seed,
            "{words:?}"
        );
    };
    said("run", "tiny, seed 3", false);
    // Of one name: its seeds, each once.
    said("run four again", "tiny, seeds 3, 4", true);
    // Of several names a seed would not say whose it is.
    said("run four other", "3 runs", false);
    let ids: Vec<String> = sandbox
        .run_file("run")
        .elites
        .iter()
        .take(9)
        .map(|elite| elite.id.clone())
        .collect();
    let of = format!("tiny, seed 3; chosen by id: {}", ids.join(", "));
    let lines = said_of("run", &ids.join(","));
    assert!(
        (2..=3).any(|count| lines[..count].join(" ") == of),
        "{lines:?}"
    );
}

#[test]
fn progress_is_that_of_runs_with_two_generations_or_more() {
    let sandbox = with_run();
    sandbox
        .run("evolve -q -c tiny.toml --seed 4 -g 1 -o short")
        .ended(0, &[]);
    let short = ["short/metrics.csv"];
    sandbox
        .run("plot progress -a short -o short.svg")
        .ended(3, &short);
    assert!(!sandbox.path("short.svg").exists());
    sandbox
        .run("plot progress -a short run -o both.svg")
        .ended(0, &short);
    let svg = sandbox.read("both.svg");
    assert!(
        svg.contains("run, seed 3") && !svg.contains("seeds"),
        "{svg}"
    );
}

#[test]
fn what_cannot_be_shown_is_refused_in_a_line() {
    let sandbox = with_run();
    let refused = |line: &str, code, words: &[&str]| {
        let said = sandbox.run(&format!("plot {line}")).ended(code, words);
        assert!(
            code == 2
                || said
                    .err
                    .lines()
                    .filter(|line| line.starts_with("error"))
                    .count()
                    == 1,
            "{said:?}"
        );
    };
    refused("pie -a run/run.json", 2, &["spacetime"]);
    refused(
        "archive -a run/run.json -o figure.eps",
        2,
        &["figure.eps", ".svg", ".png", ".pdf"],
    );
    refused(
        "archive -a run/run.json --robot best",
        2,
        &["--robot", "body, spacetime, snapshots"],
    );
    refused("sensitivity -a run/run.json", 2, &["spacetime"]);
    refused(
        "body -a run/run.json -r best,best -o a.svg",
        2,
        &["--out", "2"],
    );
    refused("body -a run/run.json --dpi 1", 2, &["--dpi"]);
    refused("body -a run/run.json --robot zzz", 3, &["zzz"]);
    refused("archive -a none/run.json", 3, &["none/run.json"]);
    refused("archive", 3, &["runs/"]);
    refused(
        "snapshots -a run/run.json --images test:999999",
        2,
        &["--images"],
    );
    std::fs::remove_file(sandbox.path("run/eval.json")).unwrap();
    refused(
        "accuracy -a run/run.json",
        3,
        &["eval.json", "morphcog eval"],
    );
    sandbox.write("run/eval.json", "{}");
    refused(
        "accuracy -a run/run.json",
        3,
        &["eval.json", "morphcog-eval"],
    );
    std::fs::remove_file(sandbox.path("run/capacity.json")).unwrap();
    refused(
        "capacity -a run/run.json",
        3,
        &["capacity.json", "morphcog capacity"],
    );
    sandbox.write("run/metrics.csv", "generation,coverage\n0,x\n");
    refused("progress -a run/run.json", 3, &["metrics.csv"]);
    std::fs::remove_file(sandbox.path("run/metrics.csv")).unwrap();
    refused("progress -a run/run.json", 3, &["metrics.csv"]);
}

#[test]
fn metrics_and_capacity_of_another_run_are_not_taken_for_this_ones() {
    let sandbox = with_run();
    sandbox
        .run("evolve -q -c tiny.toml --seed 4 -o other")
        .ended(0, &[]);
    let own = sandbox.read("run/metrics.csv");
    let (header, lines) = own.split_once('\n').unwrap();
    let reversed: Vec<&str> = lines.lines().rev().collect();
    let metrics = [
        (sandbox.read("other/metrics.csv"), "another run"),
        (format!("{header}\n{}\n", reversed.join("\n")), "in order"),
        (format!("{own}{lines}"), "in order"),
        (
            own[..own.trim_end().rfind('\n').unwrap() + 1].to_string(),
            "another state",
        ),
        (
            format!(
                "{header}\n0,1,7.5{}",
                &lines[lines.match_indices(',').nth(2).unwrap().0..]
            ),
            "from 0 to 1",
        ),
    ];
    for (content, word) in metrics {
        sandbox.write("run/metrics.csv", content);
        sandbox
            .run("plot progress -a run")
            .ended(3, &["run/metrics.csv", word]);
        let said = sandbox.run("report -q -a run --rollouts 0").ended(0, &[]);
        assert!(
            said.err.is_empty() || said.err.contains("metrics.csv"),
            "{said:?}"
        );
        let said = sandbox
            .run("report -a run --rollouts 0")
            .ended(0, &["run/metrics.csv"]);
        assert_eq!(said.err.matches("run/metrics.csv").count(), 1, "{said:?}");
    }
    sandbox.write("run/metrics.csv", own);
    sandbox.run("plot progress -a run").ended(0, &[]);
    // The capacity beside a run must be that of the evaluation beside it; without one, of the run.
    let capacity: serde_json::Value =
        serde_json::from_str(&sandbox.read("run/capacity.json")).unwrap();
    let mut other = capacity.clone();
    other["tasks"][0]["accuracy"] = 0.125.into();
    other["run"] = "other".into();
    sandbox.write("run/capacity.json", other.to_string());
    sandbox
        .run("plot capacity -a run")
        .ended(3, &["run/capacity.json"]);
    std::fs::remove_file(sandbox.path("run/eval.json")).unwrap();
    sandbox
        .run("plot capacity -a run")
        .ended(3, &["run/capacity.json"]);
    sandbox.write("run/capacity.json", capacity.to_string());
    sandbox.run("plot capacity -a run").ended(0, &[]);
}

#[test]
fn moving_pictures_have_a_look_and_a_speed() {
    let sandbox = with_run();
    let gif = |line: &str| {
        sandbox
            .run(&format!(
                "replay -a run/run.json -i 0 -o a.gif --width 320 {line}"
            ))
            .ended(0, &[]);
        std::fs::read(sandbox.path("a.gif")).unwrap()
    };
    // Hundredths of a second from frame to frame stand in the blocks that begin so.
    let delays = |bytes: &[u8]| -> Vec<u8> {
        let blocks = bytes
            .windows(8)
            .filter(|b| b[..3] == [0x21, 0xf9, 0x04] && b[7] == 0);
        blocks.map(|block| block[4]).collect()
    };
    let own = gif("");
    assert_eq!((delays(&own)[0], delays(&own).len()), (4, 11));
    assert_eq!(gif("--fps 25 --every 2"), own);
    let all = gif("--fps 50");
    assert_eq!((delays(&all)[0], delays(&all).len()), (2, 21));
    let fast = gif("--every 4");
    assert_eq!((delays(&fast)[0], delays(&fast).len()), (2, 6));
    assert_ne!(gif("--look paper"), own);
    sandbox
        .run("replay -a run/run.json --look pretty")
        .ended(2, &["--look"]);
    sandbox
        .run("replay -a run/run.json --fps 60")
        .ended(2, &["--fps"]);
}
