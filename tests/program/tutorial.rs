//! The pages for beginners: every command works, in their order, in an empty folder. All other pages:
//! the program understands every command.

use crate::common::program::{Sandbox, said};
use clap::Parser;
use morphcog::cli::Cli;
use std::path::Path;

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
        let settings = [
            "train.images_per_class=20",
            "train.random_images=60",
            "train.final_images=10",
        ];
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
        let said = said(sandbox.command(&command));
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

#[test]
fn every_command_of_the_page_on_own_images_works_in_small_with_images_of_one_s_own() {
    let sandbox = Sandbox::new();
    // Crosses, bars and so on: ten images of each of five classes, 14 × 14 pixels.
    let (count, side) = (50_u32, 14_u32);
    let image = |number: u32| {
        (0..side * side).map(move |pixel| {
            let (row, column) = (pixel / side, pixel % side);
            let is_on = match number % 5 {
                0 => row == column || row + column == side - 1,
                1 => row % 4 == number / 5 % 4,
                2 => column % 4 == number / 5 % 4,
                3 => row < 7,
                _ => column < 7,
            };
            if is_on { 200 } else { 0 }
        })
    };
    let header = |kind: u8, sizes: &[u32]| {
        let mut bytes = vec![0, 0, 8, kind];
        sizes
            .iter()
            .for_each(|size| bytes.extend(size.to_be_bytes()));
        bytes
    };
    for split in ["train", "t10k"] {
        let mut images = header(3, &[count, side, side]);
        images.extend((0..count).flat_map(image));
        let mut labels = header(1, &[count]);
        labels.extend((0..count).map(|number| (number % 5) as u8));
        sandbox.write(&format!("shapes/{split}-images-idx3-ubyte"), images);
        sandbox.write(&format!("shapes/{split}-labels-idx1-ubyte"), labels);
    }
    all_work("own-images.md", &sandbox);
    let run = sandbox.run_file("runs/shapes");
    assert_eq!(run.config.task.groups, Some([vec![0], vec![3, 4]]));
}
