//! Logic gates: runs without any data, what is said of the gates, and those that ship.

use crate::common::program::Sandbox;
use std::collections::BTreeSet;

/// The gates of two cues, as tables name them.
const GATES: [&str; 7] = ["OR", "b and not a", "a and not b", "AND", "a", "b", "XOR"];

/// Returns the cells of a table's row that begins with a text.
fn row<'a>(table: &'a str, first: &str) -> Option<Vec<&'a str>> {
    let mut rows = table.lines().map(|line| {
        let cells = line.split("  ").map(str::trim);
        cells.filter(|cell| !cell.is_empty()).collect::<Vec<_>>()
    });
    rows.find(|cells| cells.first() == Some(&first))
}

#[test]
fn gates_are_evolved_without_data_and_named_with_what_their_directions_mean() {
    let sandbox = Sandbox::new();
    let said = sandbox
        .run("evolve --config gates.toml --generations 12 --out run")
        .ended(0, &["audit --archive run", "plot gates --archive run"]);
    let run = sandbox.run_file("run");
    let mut tasks: Vec<&str> = run.elites.iter().map(|robot| &*robot.task).collect();
    tasks.sort_unstable();
    tasks.dedup();
    let named: Vec<_> = GATES
        .iter()
        .filter_map(|gate| row(&said.out, gate))
        .collect();
    assert_eq!(named.len(), tasks.len(), "{}", said.out);
    // Each is right as far as its fitness says.
    for cells in named {
        let robot = run
            .elites
            .iter()
            .find(|robot| *robot.id == **cells.last().unwrap());
        let robot = robot.unwrap();
        let (side, inputs) = cells[1].split_once(" for ").unwrap();
        let inputs: Vec<&str> = inputs.split(", ").collect();
        let margins = ["00", "01", "10", "11"].iter().zip(&robot.displacements);
        let margins = margins.map(|(input, walk)| {
            let is_left = inputs.contains(input) == (side == "left");
            if is_left { -walk } else { *walk }
        });
        let least = margins.fold(f64::INFINITY, f64::min);
        assert!((least - robot.objective).abs() < 1e-9, "{cells:?}");
    }
}

#[test]
fn gates_of_three_cues_are_counted_by_their_classes() {
    let sandbox = Sandbox::new();
    let said = sandbox
        .run(
            "evolve --config gates.toml --generations 6 --out run --set data.dataset=gates-3 \
             --set task.splits=[0,1,2,3,4,5,6,7] --set data.train_images=[0,1,2,3,4,5,6,7]",
        )
        .ended(0, &[]);
    let run = sandbox.run_file("run");
    let right = run.elites.iter().filter(|robot| robot.objective > 0.0);
    let gates: BTreeSet<&str> = right.map(|robot| &*robot.task).collect();
    let table = said
        .out
        .lines()
        .skip_while(|line| !line.starts_with("class of gates"));
    let rows = table
        .skip(2)
        .take_while(|line| !line.contains("cells filled"));
    let count = |line: &str| {
        row(line, line.split("  ").next()?)?[1]
            .parse::<usize>()
            .ok()
    };
    let counted: usize = rows.map(|line| count(line).expect(line)).sum();
    assert_eq!(counted, gates.len(), "{}", said.out);
}

#[test]
fn every_shipped_gate_is_physical_and_walks_the_right_way_under_all_four_inputs() {
    let sandbox = Sandbox::new();
    let said = sandbox
        .run("plot gates -a gallery:gates -o gates")
        .ended(0, &[]);
    let robots = GATES.map(|gate| {
        let cells = row(&said.out, gate).unwrap();
        assert_eq!(cells[4], "physical", "{cells:?}");
        // From raised starts, too.
        assert_eq!(cells[7], "8 of 8", "{cells:?}");
        cells[2]
    });
    for file in ["gates.svg", "gates.png", "gates.pdf"] {
        assert!(sandbox.path(file).exists());
    }
    sandbox
        .run(&format!(
            "eval -a gallery:gates --images all --robots {} --threshold 3 -o eval.json",
            robots.join(",")
        ))
        .ended(0, &[]);
    let eval: serde_json::Value = serde_json::from_str(&sandbox.read("eval.json")).unwrap();
    let tested = eval["robots"].as_array().unwrap();
    assert_eq!(tested.len(), GATES.len());
    // Networks of tasks whose classes have names.
    sandbox
        .run("capacity --eval eval.json --set trainings=2 --set sizes=[1,4]")
        .ended(0, &[]);
    let networks: serde_json::Value = serde_json::from_str(&sandbox.read("capacity.json")).unwrap();
    assert_eq!(networks["tasks"].as_array().unwrap().len(), GATES.len());
    for robot in tested {
        assert_eq!(
            (&robot["images"], &robot["accuracy"]),
            (&4.into(), &1.0.into()),
            "{robot}"
        );
    }
}

#[test]
fn what_is_no_gate_is_refused() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    sandbox.run("plot gates -a run").ended(
        3,
        &["run/run.json: expected a run on the dataset gates, found builtin"],
    );
    sandbox
        .run("data import run --name gates-4")
        .ended(2, &["gates-4", "expected another name"]);
    sandbox
        .run("evolve --config gates.toml --set data.dataset=gates-5")
        .ended(3, &["gates-5"]);
}

#[test]
fn all_four_inputs_are_shown_side_by_side() {
    let sandbox = Sandbox::new();
    let size = |name: &str| {
        let picture = std::fs::read(sandbox.path(name)).unwrap();
        [16, 20].map(|at| u32::from_be_bytes(picture[at..at + 4].try_into().unwrap()))
    };
    let replay = "replay -a gallery:gates -f png --width 320";
    sandbox.run(&format!("{replay} -o one")).ended(0, &[]);
    sandbox
        .run(&format!("{replay} --side-by-side -o all"))
        .ended(0, &[]);
    let (one, all) = (size("one.png"), size("all.png"));
    assert_eq!(all, one.map(|side| 2 * side + 2));
    sandbox
        .run("replay -a gallery:gates --side-by-side --every 50 --width 320 -o all.gif")
        .ended(0, &[]);
    let gif = std::fs::read(sandbox.path("all.gif")).unwrap();
    let sides = [6, 8].map(|at| u32::from(u16::from_le_bytes([gif[at], gif[at + 1]])));
    assert_eq!(sides, all);
    // Images that follow each other have no common clock.
    sandbox
        .run(
            "evolve -q --config gates.toml --generations 2 --out run \
             --set protocol.rollout=\"sequential\"",
        )
        .ended(0, &[]);
    // Refused before the run is even looked for.
    for pictures in ["-f html", "-f terminal", "-o page.html"] {
        sandbox
            .run(&format!("replay -a none.json {pictures} --side-by-side"))
            .ended(2, &["side-by-side", "pictures and films"]);
    }
    sandbox
        .run("replay -a gallery:gates -f png --side-by-side --width 4000")
        .ended(2, &["width", "4096"]);
    sandbox
        .run("replay -a run -f gif --side-by-side")
        .ended(2, &["side by side", "fresh rollout"]);
}
