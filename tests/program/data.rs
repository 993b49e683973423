//! Datasets: what is missing or broken.

use crate::common::program::{PROGRAM, Sandbox, said, write_images, write_pictures};

#[test]
fn missing_data_are_refused_naming_file_place_and_remedy() {
    let sandbox = Sandbox::tiny();
    std::fs::create_dir(sandbox.path("empty")).unwrap();
    let words = ["train-images-idx3-ubyte", "morphcog data fetch mnist"];
    let run = "evolve -c tiny.toml -o run --set data.dataset=mnist";
    sandbox
        .run(run)
        .ended(3, &["data/mnist", "morphcog data fetch mnist"]);
    sandbox
        .run(&format!("{run} --data empty"))
        .ended(3, &[&words[..], &["in empty"]].concat());
    let mut command = sandbox.command(run.split(' '));
    command.env("MORPHCOG_DATA", sandbox.path("empty"));
    said(command).ended(3, &[&words[..], &["MORPHCOG_DATA"]].concat());
    sandbox
        .run(&format!("{run} --set data.dir=empty"))
        .ended(3, &[&words[..], &["[data] dir"]].concat());
    sandbox
        .run("data info mnist")
        .ended(3, &["data/mnist", "morphcog data fetch mnist"]);
    sandbox.run("data info ../x").ended(3, &["../x"]);
    assert!(!sandbox.path("run").exists());
}

#[test]
fn broken_data_are_refused_naming_the_file() {
    let sandbox = Sandbox::tiny();
    sandbox.write(
        "data/mnist/train-images-idx3-ubyte",
        [0u8, 0, 8, 3, 0, 0, 0, 9, 0, 0],
    );
    sandbox.write(
        "data/mnist/train-labels-idx1-ubyte",
        [0u8, 0, 8, 1, 0, 0, 0, 9],
    );
    let run = "evolve -c tiny.toml -o run --set data.dataset=mnist";
    sandbox.run(run).ended(3, &["train-images-idx3-ubyte"]);
    sandbox.write("data/mnist/train-images-idx3-ubyte", "this is no image");
    sandbox.run(run).ended(3, &["train-images-idx3-ubyte"]);
    // Also where the other split can be used.
    sandbox.write(
        "data/mnist/t10k-images-idx3-ubyte",
        [0u8, 0, 8, 3, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 9],
    );
    sandbox.write(
        "data/mnist/t10k-labels-idx1-ubyte",
        [0u8, 0, 8, 1, 0, 0, 0, 1, 5],
    );
    let said = sandbox
        .run("data info mnist")
        .ended(3, &["error: train: ", "train-images-idx3-ubyte"]);
    assert!(said.out.contains("test: 1 "), "{said:?}");
    assert!(!said.err.contains("warning"), "{said:?}");
    for file in ["train-images-idx3-ubyte", "train-labels-idx1-ubyte"] {
        std::fs::remove_file(sandbox.path("data/mnist").join(file)).unwrap();
    }
    sandbox
        .run("data info mnist")
        .ended(0, &["warning: train: "]);
}

#[test]
fn every_image_is_shown_if_all_are_asked_for() {
    let sandbox = Sandbox::tiny();
    let mut labels = vec![0_u8, 0, 0, 1, 1, 0, 7, 1];
    let header = |magic: u8, sizes: &[u32]| {
        let mut bytes = vec![0, 0, 8, magic];
        sizes
            .iter()
            .for_each(|size| bytes.extend(size.to_be_bytes()));
        bytes
    };
    for split in ["train", "t10k"] {
        let count = labels.len() as u32;
        let pixels: Vec<u8> = (0..count * 64)
            .map(|place| (place * 37 % 251) as u8)
            .collect();
        let images = [header(3, &[count, 8, 8]), pixels].concat();
        sandbox.write(&format!("own/{split}-images-idx3-ubyte"), images);
        sandbox.write(
            &format!("own/{split}-labels-idx1-ubyte"),
            [header(1, &[count]), labels.clone()].concat(),
        );
        labels.push(0);
    }
    let set = "--set data.dataset=own --set data.train_images=[0,3]";
    sandbox
        .run(&format!("evolve -q -c tiny.toml {set} --data own -o run"))
        .ended(0, &[]);
    sandbox
        .run("eval -q -a run --data own --images all --cycles 1 --robots top:1")
        .ended(0, &[]);
    let eval: serde_json::Value = serde_json::from_str(&sandbox.read("run/eval.json")).unwrap();
    let shown: Vec<u64> = eval["images"]
        .as_array()
        .unwrap()
        .iter()
        .map(|image| image["index"].as_u64().unwrap())
        .collect();
    // Class after class; no sevens, which the run does not know.
    assert_eq!(shown, [0, 1, 2, 5, 8, 3, 4, 7]);
    // A report's commands ask for the same.
    sandbox
        .run("report -q run --rollouts 0 --data own")
        .ended(0, &[]);
    assert!(sandbox.read("run/report.html").contains("--images all"));
    sandbox
        .run("team -q -a run --data own --classes 0,1 --images all -o team.json")
        .ended(0, &[]);
    let team: serde_json::Value = serde_json::from_str(&sandbox.read("team.json")).unwrap();
    assert_eq!(team["images"].as_array().unwrap().len(), 8);
    sandbox
        .run("eval -q -a run --data own --images most")
        .ended(2, &["--images"]);
}

#[test]
fn what_contradicts_itself_or_asks_for_too_much_is_refused() {
    let sandbox = Sandbox::new();
    sandbox
        .run("-q data info --json")
        .ended(2, &["--quiet", "--json"]);
    sandbox
        .run("data info -q --json")
        .ended(2, &["--quiet", "--json"]);
    let mut command = sandbox.command(["data", "info"]);
    command.env("RAYON_NUM_THREADS", "100000");
    said(command).ended(2, &["RAYON_NUM_THREADS = 100000", "1024"]);
}

#[test]
fn data_info_and_sheet_work_on_the_built_in_digits() {
    let sandbox = Sandbox::new();
    let info = |args: &str| sandbox.run(&format!("data info {args}")).ended(0, &[]).out;
    assert_eq!(info(""), info("builtin"));
    sandbox
        .run("data sheet -o made.png --samples 2 --test")
        .ended(0, &[]);
    assert!(
        std::fs::read(sandbox.path("made.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );
    sandbox
        .run("data sheet -o none.png --samples 0")
        .ended(2, &["--samples"]);
    assert!(!sandbox.path("none.png").exists());
}

#[test]
fn data_info_and_sheet_say_that_emnist_is_transposed_and_do_so_with_other_images_if_asked() {
    let sandbox = Sandbox::new();
    write_images(&sandbox, "there/emnist-letters-", [6, 9], 1);
    write_images(&sandbox, "own/", [6, 9], 1);
    let info = |args: &str| sandbox.run(&format!("data info {args}")).ended(0, &[]).out;
    let sum = |said: &str| {
        said.lines()
            .find(|line| line.starts_with("train: "))
            .unwrap()
            .to_string()
    };
    let emnist = info("letters --data there");
    assert!(emnist.contains("9 × 6"), "{emnist}");
    assert!(info("own --data own").contains("6 × 9"));
    assert_eq!(sum(&info("own --data own --transpose true")), sum(&emnist));
    assert_eq!(
        sum(&info("letters --data there --transpose false")),
        sum(&info("own --data own"))
    );
    let json = &sandbox
        .run("data info letters --data there --json")
        .ended(0, &[])
        .json_lines()[0];
    assert_eq!(json["splits"]["train"]["transposed"], true);
    sandbox
        .run("data sheet letters --data there -o turned.png")
        .ended(0, &[]);
    sandbox
        .run("data sheet own --data own -o stored.png")
        .ended(0, &[]);
    let [turned, stored] =
        ["turned.png", "stored.png"].map(|name| std::fs::read(sandbox.path(name)).unwrap());
    assert_ne!(turned, stored);
}

#[test]
#[cfg(unix)]
fn a_link_that_leads_nowhere_is_an_error() {
    let sandbox = Sandbox::new();
    write_images(&sandbox, "own/", [6, 9], 1);
    std::fs::remove_file(sandbox.path("own/t10k-images-idx3-ubyte")).unwrap();
    sandbox
        .run("data info own --data own")
        .ended(0, &["warning: test: "]);
    std::os::unix::fs::symlink("gone", sandbox.path("own/t10k-images-idx3-ubyte")).unwrap();
    sandbox
        .run("data info own --data own")
        .ended(3, &["error: test: ", "own/t10k-images-idx3-ubyte", "gone"]);
}

#[test]
fn a_download_that_fails_says_what_does_without() {
    let sandbox = Sandbox::new();
    let said = sandbox
        .run("data fetch --mirror http://127.0.0.1:1")
        .ended(1, &["--data", "builtin"]);
    assert_eq!(
        said.err.matches("127.0.0.1:1/train-images").count(),
        1,
        "{}",
        said.err
    );
    assert!(!sandbox.path("data").exists());
}

#[test]
#[cfg(target_os = "linux")]
fn images_that_do_not_fit_into_memory_are_an_error_and_no_abort() {
    let sandbox = Sandbox::new();
    let write = |name: &str, header: &[u8], length: u64| {
        let path = sandbox.write(name, header);
        std::fs::File::options()
            .write(true)
            .open(path)
            .unwrap()
            .set_len(length)
            .unwrap();
    };
    // 280 MB of black, which take no space on the disk.
    write(
        "own/train-images-idx3-ubyte",
        &[0, 0, 8, 3, 0, 0, 0x11, 0x80, 0, 0, 1, 0, 0, 0, 0, 250],
        16 + 286_720_000,
    );
    write(
        "own/train-labels-idx1-ubyte",
        &[0, 0, 8, 1, 0, 0, 0x11, 0x80],
        8 + 4_480,
    );
    for limit in [250_000, 500_000] {
        let mut shell = std::process::Command::new("sh");
        let line = format!("ulimit -v {limit}; exec {PROGRAM} data info own --data own");
        let output = shell
            .args(["-c", &line])
            .current_dir(sandbox.path(""))
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(3), "{said}");
        assert!(said.contains("train-images-idx3-ubyte: "), "{said}");
    }
}

#[test]
fn a_folder_of_pictures_becomes_a_dataset_like_any_other() {
    let sandbox = Sandbox::new();
    write_pictures(&sandbox, "photos", 10);
    let import = "data import photos --name shapes";
    let made = sandbox
        .run(import)
        .ended(0, &["left out: across/broken.png"]);
    for part in ["across", "inverted", "wrote data/shapes"] {
        assert!(made.out.contains(part), "{part}: {made:?}");
    }
    let next = "next: morphcog train --pairs --dataset shapes";
    assert!(made.err.lines().any(|line| line == next), "{made:?}");
    let info = sandbox.run("data info shapes").ended(0, &[]).out;
    let parts = [
        "train: 16 images of 28 × 28",
        "test: 4 images of 28 × 28",
        "split  class  name",
        "train      1  up",
    ];
    for part in parts {
        assert!(info.contains(part), "{part}: {info}");
    }
    assert!(sandbox.read("data/shapes/images.csv").contains("up/9.png"));
    assert!(
        std::fs::read(sandbox.path("data/shapes/sheet.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );
    // It is there once, and is replaced if that is asked for.
    sandbox.run(import).ended(5, &["data/shapes", "--force"]);
    sandbox
        .run(&format!("{import} --force --seed 2"))
        .ended(0, &[]);
    let elsewhere = sandbox.run(&format!("{import} --to a/b")).ended(0, &[]);
    assert!(
        elsewhere.err.contains("--dataset shapes --data a/b"),
        "{elsewhere:?}"
    );
    sandbox
        .run(&format!("{import}2 --fit keep --invert no"))
        .ended(3, &["--fit"]);
    sandbox
        .run("data import nothing --name x")
        .ended(3, &["nothing"]);
    sandbox
        .run("data import photos --name builtin")
        .ended(2, &["--name builtin"]);
    let kept: Vec<_> = std::fs::read_dir(sandbox.path("data")).unwrap().collect();
    assert_eq!(kept.len(), 1, "{kept:?}");
}
