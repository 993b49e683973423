//! Packs the runs that ship with the program (feature `gallery`) into one compressed file, which
//! `src/shipped/gallery.rs` reads: 1 MB of the program instead of 2.8.

use flate2::Compression;
use flate2::write::GzEncoder;
use std::env;
use std::fs;
use std::io::{self, Write};
use std::path::Path;

/// A set of runs: its name, its runs with their folders below `data/`, and their files.
struct Set {
    name: &'static str,
    runs: Vec<(String, String)>,
    files: &'static [&'static str],
}

const TRAINED: &[&str] = &["run.json", "audit.json", "validation.json"];

/// The sets; the default one first. Runs are numbered by their seeds, or named after their digits.
fn sets() -> Vec<Set> {
    let numbered = |name: &str, folder: &str, seeds: &[u8]| -> Vec<(String, String)> {
        let run = |seed: &u8| (format!("{name}-{seed}"), format!("{folder}-{seed}"));
        seeds.iter().map(run).collect()
    };
    let of_tasks = |name: &str, tasks: &[String]| -> Vec<(String, String)> {
        let run = |task: &String| (format!("{name}-{task}"), format!("{name}/{task}"));
        tasks.iter().map(run).collect()
    };
    let four = [
        "0v123", "1v023", "2v013", "3v012", "01v23", "02v13", "03v12",
    ];
    let pairs = (0..10).flat_map(|first| (first + 1..10).map(move |other| (first, other)));
    let pairs: Vec<String> = pairs
        .map(|(first, other)| format!("{first}v{other}"))
        .collect();
    vec![
        Set {
            name: "zero_one",
            runs: numbered("zero_one", "trained/zero-one", &[1, 2, 3]),
            files: TRAINED,
        },
        Set {
            name: "four_digit",
            runs: of_tasks("four_digit", &four.map(str::to_string)),
            files: TRAINED,
        },
        Set {
            name: "team",
            runs: of_tasks("team", &pairs),
            files: TRAINED,
        },
        Set {
            name: "gaits",
            // Those of the demo first.
            runs: numbered("gaits", "gaits/seed", &[6, 1]),
            files: &["run.json", "response.json"],
        },
        Set {
            name: "gates",
            runs: vec![("gates".to_string(), "gates".to_string())],
            files: &["run.json", "audit.json"],
        },
    ]
}

/// Writes all files behind lines that name them: `set NAME`, `run NAME`, `file NAME BYTES`.
fn pack(out: impl Write) -> io::Result<()> {
    let mut out = GzEncoder::new(out, Compression::best());
    for set in sets() {
        writeln!(out, "set gallery:{}", set.name)?;
        for (name, folder) in set.runs {
            writeln!(out, "run gallery:{name}")?;
            for file in set.files {
                let path = Path::new("data").join(&folder).join(file);
                let text = fs::read_to_string(&path)
                    .map_err(|error| io::Error::other(format!("{}: {error}", path.display())))?;
                writeln!(out, "file {file} {}\n{text}", text.len())?;
            }
        }
    }
    out.finish()?.flush()
}

fn main() -> io::Result<()> {
    println!("cargo::rerun-if-changed=build.rs");
    if env::var_os("CARGO_FEATURE_GALLERY").is_none() {
        return Ok(());
    }
    for folder in ["trained", "four_digit", "team", "gaits", "gates"] {
        println!("cargo::rerun-if-changed=data/{folder}");
    }
    let folder = env::var_os("OUT_DIR").ok_or_else(|| io::Error::other("cargo sets OUT_DIR"))?;
    pack(fs::File::create(Path::new(&folder).join("gallery.gz"))?)
}
