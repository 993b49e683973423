//! `simulate`: one body, one rollout, one trajectory.

use crate::common::program::{Sandbox, said_of};
use crate::common::reference::{Reference, golden};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// A reference rollout as a scenario file, without its name, the width of its world and its results.
pub fn scenario(sandbox: &Sandbox, name: &str) -> Reference {
    const NOT_ASKED_FOR: [&str; 7] = [
        "name",
        "world_width",
        "unstable_at",
        "com",
        "points",
        "displacement_voxels",
        "displacement_voxels_shifted_world",
    ];
    let mut rollout: BTreeMap<String, serde_json::Value> = golden(name);
    rollout.retain(|key, _| !NOT_ASKED_FOR.contains(&key.as_str()));
    sandbox.write("scenario.json", serde_json::to_string(&rollout).unwrap());
    golden(name)
}

/// Reads a trajectory; numbers must name the f64 they were.
fn rows(csv: &str) -> Vec<[f64; 2]> {
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("step,com_x,com_y"));
    let row = |(number, line): (usize, &str)| {
        let fields: Vec<&str> = line.split(',').collect();
        assert_eq!(
            (fields.len(), fields[0]),
            (3, number.to_string().as_str()),
            "{line}"
        );
        let digits = |text: &str| text.chars().filter(char::is_ascii_digit).count();
        assert!(fields[1..].iter().all(|text| digits(text) >= 17), "{line}");
        [fields[1], fields[2]].map(|text| text.parse().unwrap())
    };
    lines.enumerate().map(row).collect()
}

/// Asserts that a trajectory in voxel lengths is the reference's, which is in world units of ten
/// voxel lengths, from the world's left edge and from two rows below the ground.
fn agree(ours: &[[f64; 2]], reference: &Reference) {
    let (theirs, start) = (&reference.com, reference.start_column as f64);
    assert_eq!(ours.len(), theirs.len());
    for (a, b) in ours.iter().zip(theirs) {
        let b = [10.0 * b[0] - start, 10.0 * b[1] - 2.0];
        assert!(
            (a[0] - b[0]).abs() < 1e-6 && (a[1] - b[1]).abs() < 1e-6,
            "{a:?} and {b:?}"
        );
    }
}

#[test]
fn simulate_agrees_with_a_reference_trajectory() {
    let sandbox = Sandbox::new();
    let rollout = scenario(&sandbox, "disc_5x5_00");
    let printed = sandbox.run("simulate scenario.json").ended(0, &[]);
    assert!(printed.err.is_empty(), "{}", printed.err);
    agree(&rows(&printed.out), &rollout);
    let written = sandbox
        .run("simulate scenario.json --out traj.csv")
        .ended(0, &[]);
    assert!(written.out.is_empty());
    assert_eq!(sandbox.read("traj.csv"), printed.out);
}

#[test]
fn simulate_reads_standard_input_and_writes_every_point_and_pixel() {
    let sandbox = Sandbox::new();
    let scenario = "{\"body\": [[3, 6], [4, 0]], \"stimuli\": [[[0, 0.5], [0, 0]], [[1, 1], [1, 1]]], \
     \"switch_every\": 3}";
    let told = |args: &str, input: &str| {
        said_of(
            sandbox.command(args.split(' ')),
            input,
            Duration::from_secs(60),
        )
    };
    let printed = told("simulate - --points", scenario).ended(0, &[]);
    let table: Vec<Vec<&str>> = printed
        .out
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    let names = "step,com_x,com_y,x_0,y_0,x_1,y_1,x_2,y_2,x_3,y_3,x_4,y_4,x_5,y_5,x_6,y_6,x_7,y_7,\
                 pixel_0_0,pixel_0_1,pixel_1_0,pixel_1_1";
    assert_eq!((table[0].join(",").as_str(), table.len()), (names, 8));
    for row in &table[1..] {
        let numbers: Vec<f64> = row.iter().map(|text| text.parse().unwrap()).collect();
        let mean = |axis: usize| {
            (0..8)
                .map(|point| numbers[3 + 2 * point + axis])
                .sum::<f64>()
                / 8.0
        };
        assert!(
            (mean(0) - numbers[1]).abs() < 1e-9 && (mean(1) - numbers[2]).abs() < 1e-9,
            "{row:?}"
        );
    }
    let pixels: Vec<String> = table[1..].iter().map(|row| row[19..].join(" ")).collect();
    assert_eq!(
        pixels,
        [
            "0 0 0 0",
            "0 0.5 0 0",
            "0 0.5 0 0",
            "0 0.5 0 0",
            "1 1 1 1",
            "1 1 1 1",
            "1 1 1 1"
        ]
    );
    // The centre is the same without them.
    sandbox.write("s.json", scenario);
    let plain = sandbox.run("simulate s.json").ended(0, &[]).out;
    let centres = table
        .iter()
        .map(|row| row[..3].join(",") + "\n")
        .collect::<String>();
    assert_eq!(plain, centres);
    told("simulate -", "{\"body\": [[9]]}").ended(3, &["standard input", "body"]);
}

#[test]
fn an_unstable_rollout_ends_with_4_after_its_rows_and_says_when() {
    let sandbox = Sandbox::new();
    let rollout = scenario(&sandbox, "unstable_comb");
    let said = sandbox.run("simulate scenario.json").ended(4, &[]);
    agree(&rows(&said.out), &rollout);
    let last = said.err.lines().last().unwrap();
    assert!(last.contains("control step 70"), "{last}");
    sandbox
        .run("simulate scenario.json -o traj.csv")
        .ended(4, &["control step 70"]);
    assert_eq!(sandbox.read("traj.csv"), said.out);
}

#[test]
fn contacts_without_offset_or_stiffness_blow_nothing_up() {
    let sandbox = Sandbox::new();
    for physics in [
        "\"contact_offset\": 0",
        "\"contact_stiffness\": 0",
        "\"contact_damping\": 0, \"friction\": 0",
    ] {
        let body = "[[3, 3, 6], [4, 2, 5]]";
        sandbox.write(
            "s.json",
            format!("{{\"body\": {body}, \"control_steps\": 3, \"physics\": {{{physics}}}}}"),
        );
        sandbox.run("simulate s.json").ended(0, &[]);
    }
}

#[test]
fn simulate_switches_stimuli_and_resets_when_asked() {
    let sandbox = Sandbox::new();
    let run = |text: &str| {
        sandbox.write("s.json", text);
        rows(&sandbox.run("simulate s.json").ended(0, &[]).out)
    };
    let body = r#""body": [[6, 4, 5], [3, 0, 3]]"#;
    let [a, b] = ["[[1, 0, 0.5], [0, 0, 0]]", "[[0, 1, 1], [0, 0, 0]]"];
    let alone = |stimulus: &str| {
        run(&format!(
            "{{{body}, \"stimulus\": {stimulus}, \"control_steps\": 9}}"
        ))
    };
    let fresh = run(&format!(
        "{{{body}, \"stimuli\": [{a}, {b}], \"switch_every\": 9, \"reset_between\": true}}"
    ));
    let (first, second) = (alone(a), alone(b));
    assert_eq!(
        (fresh.len(), &fresh[..10], &fresh[10..]),
        (19, &first[..], &second[1..])
    );
    let continuous = run(&format!(
        "{{{body}, \"stimuli\": [{a}, {b}], \"switch_every\": 9}}"
    ));
    assert_eq!(continuous[..10], first[..]);
    assert_ne!(continuous[10..], fresh[10..]);
    let moved = run(&format!(
        "{{{body}, \"stimulus\": {a}, \"control_steps\": 9, \"start_column\": 499}}"
    ));
    assert!(
        (moved[9][0] - first[9][0]).abs() < 1e-6,
        "positions are from where the body starts"
    );
}

#[test]
fn a_wrong_scenario_is_refused_with_file_line_and_key() {
    let sandbox = Sandbox::new();
    for (text, word) in [
        ("", "s.json"),
        ("{\n\"body\": [[3]],\n\"bodi\": 1}", "s.json:3"),
        ("{\"body\": [[3], [3, 3]]}", "row 1"),
        ("{\"body\": []}", "body"),
        ("{\"body\": [[9]]}", "body"),
        ("{\"body\": [[-1]]}", "body"),
        ("{\"body\": [[3.5]]}", "body"),
        ("{\"body\": [[0]]}", "body"),
        ("{\"body\": [[3]], \"stimulus\": [[1e999]]}", "stimulus"),
        ("{\"body\": [[3]], \"stimulus\": [[-0.1]]}", "stimulus"),
        ("{\"body\": [[3]], \"stimulus\": [[null]]}", "stimulus"),
        ("{\"body\": [[3]], \"stimulus\": [[1, 1]]}", "stimulus"),
        ("{\"body\": [[3]], \"stimuli\": []}", "stimuli"),
        (
            "{\"body\": [[3]], \"stimuli\": [[[1]]], \"switch_every\": 0}",
            "switch_every",
        ),
        (
            "{\"body\": [[3]], \"stimuli\": [[[1]]], \"stimulus\": [[1]], \"switch_every\": 1}",
            "stimuli",
        ),
        ("{\"body\": [[3]], \"switch_every\": 3}", "switch_every"),
        (
            "{\"body\": [[3]], \"reset_between\": true}",
            "reset_between",
        ),
        (
            "{\"body\": [[3]], \"physics\": {\"servo_gain\": 0}}",
            "servo_gain",
        ),
        ("{\"body\": [[3]], \"control_steps\": -3}", "control_steps"),
        ("{\"body\": [[3]], \"control_steps\": 1e3}", "control_steps"),
        (
            "{\"body\": [[3]], \"start_column\": 9223372036854775807}",
            "start_column",
        ),
        (
            "{\"body\": [[3]], \"start_column\": -9223372036854775808}",
            "start_column",
        ),
        ("{\"body\": [[3]], \"start_row\": 1}", "start_row"),
        ("{\"body\": [[3]], \"start_row\": -1}", "start_row"),
        (
            "{\"body\": [[3]], \"physics\": {\"gravity\": \"x\"}}",
            "physics.gravity",
        ),
        (
            "{\"body\": [[3]], \"physics\": {\"mass\": 0}}",
            "physics.mass",
        ),
        (
            "{\"body\": [[3]], \"physics\": {\"peg_spacing\": 0}}",
            "physics.peg_spacing",
        ),
    ] {
        sandbox.write("s.json", text);
        let said = sandbox.run("simulate s.json").ended(3, &["s.json", word]);
        assert!(said.out.is_empty(), "{text}");
    }
    sandbox
        .run("simulate nowhere.json")
        .ended(3, &["nowhere.json"]);
    let huge = vec![vec![1; 65]; 65];
    sandbox.write("s.json", format!("{{\"body\": {huge:?}}}"));
    sandbox.run("simulate s.json").ended(3, &["65", "64"]);
}

/// A run on terrain of EvoGym's own simulator, as a scenario, and its trajectory.
fn on_terrain(name: &str) -> (serde_json::Value, Vec<[f64; 2]>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/sim/tests/golden/terrain");
    let file = std::fs::File::open(folder.join(format!("{name}.json.gz"))).unwrap();
    let run: serde_json::Value =
        serde_json::from_reader(flate2::read::GzDecoder::new(file)).unwrap();
    let rows = |rows: &serde_json::Value| -> Vec<Vec<u64>> {
        let material = |voxel: &serde_json::Value| match voxel.as_u64().unwrap() {
            actuator @ 3..=4 => actuator + 4,
            passive => passive,
        };
        let row = |row: &serde_json::Value| row.as_array().unwrap().iter().map(material).collect();
        rows.as_array().unwrap().iter().map(row).collect()
    };
    let body = rows(&run["body"]);
    let actuators = body.iter().flatten().filter(|voxel| **voxel >= 7).count();
    let phase = run["phase"].as_f64().unwrap();
    let phases: Vec<f64> = (0..actuators).map(|k| phase * k as f64).collect();
    let objects: Vec<serde_json::Value> = run["terrain_objects"]
        .as_array()
        .unwrap()
        .iter()
        .map(|object| {
            let [column, row, grid] = ["column", "row", "grid"].map(|key| &object[key]);
            serde_json::json!({ "column": column, "row": row, "grid": grid })
        })
        .collect();
    let com: Vec<[f64; 2]> = serde_json::from_value(run["com"].clone()).unwrap();
    let scenario = serde_json::json!({
        "body": body,
        "start_column": run["start_column"],
        "start_row": run["start_row"],
        "terrain": objects,
        "targets": { "mean": 1.1, "amplitude": 0.5, "period": 25, "phases": phases },
        "control_steps": com.len() - 1,
    });
    (scenario, com)
}

#[test]
fn simulate_agrees_with_evogym_on_terrain_with_actuators() {
    let sandbox = Sandbox::new();
    for name in ["climber0_2", "platformjumper0_4"] {
        let (scenario, com) = on_terrain(name);
        sandbox.write("s.json", scenario.to_string());
        let ours = rows(&sandbox.run("simulate s.json").ended(0, &[]).out);
        assert_eq!(ours.len(), com.len());
        for (step, (ours, theirs)) in ours.iter().zip(&com).enumerate() {
            let apart = (ours[0] - theirs[0]).abs().max((ours[1] - theirs[1]).abs());
            assert!(apart < 1e-6, "{name}, step {step}: {apart}");
        }
    }
}

#[test]
fn listed_targets_move_actuators_as_their_wave_does() {
    let sandbox = Sandbox::new();
    let run = |targets: &str| {
        let scenario = format!(
            "{{\"body\": [[7, 1], [8, 7]], \"control_steps\": 40, \"targets\": {targets}}}"
        );
        sandbox.write("s.json", scenario);
        let said = sandbox.run("simulate s.json --points").ended(0, &[]);
        said.out
    };
    let wave = run(r#"{"mean": 1.1, "amplitude": 0.5, "period": 20, "phases": [0, 1, 2]}"#);
    let target = |step: u32, phase: f64| {
        1.1 + 0.5 * libm::sin(std::f64::consts::TAU * f64::from(step) / 20.0 + phase)
    };
    let cycle: Vec<[f64; 3]> = (0..20)
        .map(|step| [0.0, 1.0, 2.0].map(|phase| target(step, phase)))
        .collect();
    let listed = run(&format!("{cycle:?}"));
    let numbers = |csv: &str| -> Vec<Vec<f64>> {
        let lines = csv.lines().skip(1);
        lines
            .map(|line| line.split(',').map(|text| text.parse().unwrap()).collect())
            .collect()
    };
    let header = wave.lines().next().unwrap();
    assert!(header.ends_with("pixel_1_1,target_0_0,target_1_0,target_1_1"));
    let (wave, listed) = (numbers(&wave), numbers(&listed));
    assert_eq!((wave.len(), wave[0].len()), (41, listed[0].len()));
    for (a, b) in wave.iter().flatten().zip(listed.iter().flatten()) {
        assert!((a - b).abs() < 1e-9, "{a} and {b}");
    }
    assert!(wave[1][wave[1].len() - 3..] != wave[9][wave[1].len() - 3..]);
    // Without targets, actuators hold still: nothing pushes sideways in free fall.
    sandbox.write(
        "s.json",
        "{\"body\": [[7, 8]], \"control_steps\": 40, \"start_row\": 90}",
    );
    let still = rows(&sandbox.run("simulate s.json").ended(0, &[]).out);
    assert!((still[40][0] - still[0][0]).abs() < 1e-6);
}

#[test]
fn the_ending_of_out_makes_pictures_with_the_terrain() {
    let sandbox = Sandbox::new();
    let (mut scenario, _) = on_terrain("upstepper0_2");
    scenario["control_steps"] = 10.into();
    sandbox.write("stairs.json", scenario.to_string());
    for name in ["walk.png", "walk.gif", "walk.html"] {
        let said = sandbox.run(&format!("simulate stairs.json -o {name}"));
        assert!(said.ended(0, &[]).out.contains(name));
    }
    let begins = |name: &str, with: &[u8]| {
        assert!(std::fs::read(sandbox.path(name)).unwrap().starts_with(with));
    };
    begins("walk.png", b"\x89PNG");
    begins("walk.gif", b"GIF89a");
    let page = sandbox.read("walk.html");
    assert!(page.contains("\"terrain\":[{") && page.contains("actuator, vertical"));
    sandbox
        .run("simulate stairs.json -o walk.gif --points")
        .ended(2, &["--points", "table"]);
    sandbox
        .run("simulate stairs.json -o walk.csv --width 200")
        .ended(2, &["--width", "picture or film"]);
    // An unstable simulation is drawn up to its end.
    self::scenario(&sandbox, "unstable_comb");
    sandbox
        .run("simulate scenario.json -o comb.png")
        .ended(4, &["control step 70"]);
    begins("comb.png", b"\x89PNG");
}

#[test]
fn a_wrong_terrain_or_target_is_refused_with_its_key() {
    let sandbox = Sandbox::new();
    let ground = r#"{"column": 0, "row": 0, "grid": ["555"]}"#;
    for (keys, word) in [
        (format!("\"terrain\": [{ground}]"), "start_column"),
        (
            format!("\"terrain\": [{ground}], \"start_column\": 0"),
            "start_row",
        ),
        (
            format!("\"terrain\": [{ground}], \"start_column\": 0, \"start_row\": 0"),
            "overlaps",
        ),
        (
            "\"terrain\": [], \"start_column\": 0, \"start_row\": 1".to_string(),
            "at least one object",
        ),
        ("\"terrain\": [{\"column\": -1}]".to_string(), "column"),
        ("\"targets\": [[1, 1]]".to_string(), "targets[0]"),
        ("\"targets\": [[1], [1, 1]]".to_string(), "targets"),
        ("\"targets\": [[1e999]]".to_string(), "targets"),
        ("\"targets\": {\"mean\": 1}".to_string(), "amplitude"),
    ] {
        sandbox.write("s.json", format!("{{\"body\": [[7]], {keys}}}"));
        sandbox.run("simulate s.json").ended(3, &["s.json", word]);
    }
}
