//! The pages for beginners: every command works, in their order, in an empty folder. All other pages:
//! the program understands every command.

use crate::common::program::{Sandbox, said_of};
use clap::Parser;
use morphcog::cli::Cli;
use serde_json::Value;
use std::path::Path;
use std::time::Duration;

/// The commands of a page: lines of `console` blocks that begin with a prompt, without `morphcog`
/// itself. Quotes hold blanks together.
fn commands(page: &str) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("docs")
            .join(page),
    )
    .unwrap();
    let mut is_console = false;
    let mut commands = Vec::new();
    for line in text.lines() {
        if line.starts_with("```") {
            is_console = line == "```console";
        } else if is_console {
            let command = line
                .strip_prefix("$ morphcog ")
                .expect("a console block has commands of the program");
            commands.push(words(command));
        }
    }
    commands
}

fn words(line: &str) -> Vec<String> {
    let (mut words, mut is_quoted, mut is_begun) = (Vec::new(), false, false);
    for c in line.chars() {
        match c {
            '"' => is_quoted = !is_quoted,
            ' ' if !is_quoted => is_begun = false,
            _ => {
                if !is_begun {
                    words.push(String::new());
                }
                is_begun = true;
                words.last_mut().unwrap().push(c);
            }
        }
    }
    words
}

/// The same command with less to do: a twentieth of the generations, a tenth of the images, a training
/// on few random images, a film of few frames.
fn in_small(mut command: Vec<String>) -> Vec<String> {
    for (flag, parts) in [("--generations", 20), ("--images", 10)] {
        let Some(at) = command.iter().position(|word| word == flag) else {
            continue;
        };
        let number: u32 = command[at + 1].parse().expect("the flag takes a number");
        command[at + 1] = number.div_ceil(parts).to_string();
    }
    if command[0] == "replay" {
        command.extend(["--every", "20"].map(str::to_string));
    }
    if command[0] == "train" {
        let mut settings = vec![
            "train.images_per_class=20",
            "train.random_images=60",
            "train.final_images=10",
        ];
        if command.iter().any(|word| word == "--pairs") {
            settings.extend([
                "train.windows=60",
                "train.rounds=1",
                "train.images=20",
                "train.challengers=0",
                "validation.best=0",
            ]);
            let gait = ["--archive", "gallery:gaits-6", "--robots", "best"];
            command.extend(gait.map(str::to_string));
        }
        command.extend(
            settings
                .iter()
                .flat_map(|setting| ["--set", setting])
                .map(str::to_string),
        );
    }
    command
}

fn all_work(page: &str, sandbox: &Sandbox) {
    let commands = commands(page);
    assert!(commands.len() >= 3, "{page}: {commands:?}");
    for command in commands.into_iter().map(in_small) {
        // A team is trained in a minute; on a machine that is busy, in more.
        let said = said_of(sandbox.command(&command), "", Duration::from_secs(400));
        assert_eq!(said.code, Some(0), "{page}: {command:?}: {said:#?}");
    }
}

#[test]
fn the_program_understands_every_command_of_every_page() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let pages = std::fs::read_dir(root.join("docs"))
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let pages = pages.filter(|path| path.extension().is_some_and(|ending| ending == "md"));
    let mut count = 0;
    for page in pages.chain([root.join("README.md"), root.join("CONTRIBUTING.md")]) {
        let text = std::fs::read_to_string(&page).unwrap();
        for line in text.lines() {
            // Also where another program starts it.
            let Some((_, command)) = line
                .split_once("morphcog ")
                .filter(|_| line.starts_with("$ "))
            else {
                continue;
            };
            let all = words(
                command
                    .split(['#', '>'])
                    .next()
                    .unwrap()
                    .split(" | ")
                    .next()
                    .unwrap(),
            );
            let all = all
                .iter()
                .map(|word| if word == "KIND" { "body" } else { word });
            let parsed = Cli::try_parse_from(std::iter::once("morphcog").chain(all));
            assert!(
                parsed.is_ok(),
                "{}: {line}\n{}",
                page.display(),
                parsed.unwrap_err()
            );
            count += 1;
        }
    }
    assert!(count > 40, "{count}");
}

#[test]
fn every_command_of_the_tutorial_works_in_small() {
    let sandbox = Sandbox::new();
    all_work("tutorial.md", &sandbox);
    for file in [
        "runs/quickstart-seed1/run.json",
        "runs/quickstart-seed1/audit.json",
        "runs/zero-one/eval.json",
    ] {
        assert!(sandbox.path(file).exists(), "{file}");
    }
    assert_eq!(sandbox.run_file("runs/quickstart-seed1").generations, 4);
}

/// Writes a picture of a shape, dark on bright, of an odd size, somewhere in it.
fn draw(sandbox: &Sandbox, name: &str, class: usize, number: usize) {
    let noise = |salt: usize| {
        let mixed = (number * 31 + class * 7 + salt * 101 + 1) as u32;
        (mixed.wrapping_mul(2_654_435_761) >> 8) as usize
    };
    let [height, width] = [noise(1), noise(2)].map(|noise| 31 + noise % 40);
    let radius = height.min(width) as f64 * (0.28 + (noise(3) % 12) as f64 / 100.0);
    let at = |side: usize, noise: usize| {
        radius + 1.0 + (side as f64 - 2.0 * radius - 2.0) * (noise % 100) as f64 / 100.0
    };
    let (row, column) = (at(height, noise(4)), at(width, noise(5)));
    let is_ink = |y: usize, x: usize| {
        let (dy, dx) = ((y as f64 - row) / radius, (x as f64 - column) / radius);
        let (from, inside) = match class {
            0 => ((dy * dy + dx * dx).sqrt(), 0.7),
            1 => (dy.abs().max(dx.abs()) * 1.2, 0.7),
            _ => (dy.max(1.7 * dx.abs() - dy), 0.5),
        };
        (inside..=1.0).contains(&from)
    };
    let pixels: Vec<u8> = (0..height * width)
        .map(|place| {
            if is_ink(place / width, place % width) {
                20
            } else {
                240
            }
        })
        .collect();
    let path = sandbox.path(&format!("photos/{name}/{number}.png"));
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let file = std::fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, width as u32, height as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder
        .write_header()
        .unwrap()
        .write_image_data(&pixels)
        .unwrap();
}

#[test]
fn every_command_of_the_page_on_own_images_works_in_small_with_pictures_of_one_s_own() {
    let sandbox = Sandbox::new();
    for (class, name) in ["circle", "square", "triangle"].iter().enumerate() {
        (0..30).for_each(|number| draw(&sandbox, name, class, number));
    }
    all_work("own-images.md", &sandbox);
    let team: Value = serde_json::from_str(&sandbox.read("runs/shapes-team/team.json")).unwrap();
    let accuracy = &team["answers"]["votes"]["accuracy"]["accuracy"];
    assert!(accuracy.as_f64().unwrap() >= 0.8, "{accuracy}");
    assert_eq!(team["images"].as_array().unwrap().len(), 18);
    let tasks = ["circle|square", "circle|triangle", "square|triangle"];
    for (member, task) in team["members"].as_array().unwrap().iter().zip(tasks) {
        assert_eq!(member["task"], task);
    }
    assert_eq!(
        sandbox.run_file("runs/shapes").elites[0].task,
        "circle|square,triangle"
    );
}
