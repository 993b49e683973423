//! Runs the program as users do: in its own folder, without settings from outside.

use morphcog::store::run::RunFile;
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Path of the program.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_morphcog");
/// Time limit of every command in a test.
const LIMIT: Duration = Duration::from_secs(120);
/// Variables of the environment that must not affect tests.
pub const SETTINGS: [&str; 10] = [
    "MORPHCOG_ATLAS",
    "MORPHCOG_DATA",
    "MORPHCOG_FFMPEG",
    "MORPHCOG_ISA",
    "NO_COLOR",
    "TERM",
    "RAYON_NUM_THREADS",
    "HQ_TASK_ID",
    "SLURM_ARRAY_TASK_ID",
    "PBS_ARRAY_INDEX",
];

/// A tiny run with all features: two digits, bodies of 5 × 5, a fifth of a second.
pub const TINY: &str = r#"
seed = 3
generations = 12

[body]
height = 5
width = 5

[task]
groups = [[0], [1]]

[data]
dataset = "builtin"
train_images = [0, 1]

[stimulus]
reduction = "area"

[protocol]
rollout = "fresh"
control_steps = 20

[map_elites]
initial = 8
parents = 8
"#;

/// Returns [`TINY`] evolved the other way: the response is the fitness, half of the offspring
/// change in up to four voxels, and the six fittest stay.
pub fn gaits() -> String {
    let data = TINY.replace("train_images = [0, 1]", "images_per_class = 4");
    format!(
        "{data}\n[genome]\nvoxel_mutations = 0.5\nvoxel_changes = 4\n[evaluation]\nfitness = \"response\"\n\
         [archive]\nkeep = 6\n"
    )
}

/// Output and end of a command.
#[derive(Debug)]
pub struct Said {
    /// Exit code; `None` if a signal ended it.
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

impl Said {
    /// Checks that it ended with this code and that stderr has these files, keys, numbers, ids or
    /// commands. Snapshots check the wording.
    #[track_caller]
    pub fn ended(self, code: i32, words: &[&str]) -> Self {
        assert_eq!(self.code, Some(code), "{self:#?}");
        for word in words {
            assert!(
                self.err.contains(word),
                "expected {word:?} in:\n{}",
                self.err
            );
        }
        self
    }

    /// Parses every line of stdout as JSON.
    #[track_caller]
    pub fn json_lines(&self) -> Vec<serde_json::Value> {
        json_lines(&self.out)
    }
}

/// Parses every line of a text as JSON.
#[track_caller]
pub fn json_lines(text: &str) -> Vec<serde_json::Value> {
    let read = |line: &str| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e} in: {line}"));
    text.lines().map(read).collect()
}

/// A folder in which commands run; dropping it deletes it.
pub struct Sandbox(TempDir);

/// Files that [`Sandbox::once`] copies.
pub type Made = BTreeMap<String, Vec<u8>>;

/// Reads all files below a folder, by relative path.
fn tree(folder: &Path, prefix: &str) -> Made {
    let mut files = Made::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = format!("{prefix}{}", entry.file_name().to_str().unwrap());
        match entry.path().is_dir() {
            true => files.extend(tree(&entry.path(), &format!("{name}/"))),
            false => _ = files.insert(name, std::fs::read(entry.path()).unwrap()),
        }
    }
    files
}

impl Sandbox {
    pub fn new() -> Self {
        Sandbox(tempfile::tempdir().unwrap())
    }

    /// Makes a sandbox with [`TINY`] as `tiny.toml`.
    pub fn tiny() -> Self {
        let sandbox = Sandbox::new();
        sandbox.write("tiny.toml", TINY);
        sandbox
    }

    /// Returns a sandbox as `make` leaves it. It runs once; later sandboxes are copies.
    pub fn once(made: &OnceLock<Made>, make: impl FnOnce(&Sandbox)) -> Self {
        let files = made.get_or_init(|| {
            let sandbox = Sandbox::new();
            make(&sandbox);
            tree(&sandbox.path(""), "")
        });
        let sandbox = Sandbox::new();
        files
            .iter()
            .for_each(|(name, content)| _ = sandbox.write(name, content));
        sandbox
    }

    /// Starts a run that does not end by itself and writes checkpoints all the time.
    pub fn endless(&self, out: &str) -> Child {
        self.write(
            "long.toml",
            TINY.replace("generations = 12", "generations = 10000000"),
        );
        self.start(&format!(
            "evolve -q -c long.toml -o {out} --set checkpoint.seconds=0.1"
        ))
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, content).unwrap();
        path
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Returns the program, not yet started.
    pub fn command<A: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = A>) -> Command {
        let mut command = Command::new(PROGRAM);
        command.current_dir(self.0.path()).args(args);
        SETTINGS.iter().for_each(|name| {
            command.env_remove(name);
        });
        command
    }

    /// Runs the program; blanks separate arguments.
    #[track_caller]
    pub fn run(&self, args: &str) -> Said {
        said(self.command(args.split_whitespace()))
    }

    /// Starts the program in the background with stdout piped; blanks separate arguments.
    pub fn start(&self, args: &str) -> Child {
        let mut command = self.command(args.split_whitespace());
        command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    pub fn run_file(&self, folder: &str) -> RunFile {
        RunFile::read(&self.path(folder).join("run.json")).unwrap()
    }
}

/// Writes a folder of grey PNGs: bars upright and across, dark on a bright ground, of several sizes;
/// and one that is broken.
pub fn write_pictures(sandbox: &Sandbox, folder: &str, count: u32) {
    for number in 0..count {
        for (class, is_upright) in [("up", true), ("across", false)] {
            let (width, height, at) = (60 + number, 50, 20 + number % 9);
            let is_ink = |row: u32, column: u32| match is_upright {
                true => (at..at + 5).contains(&column) && (8..40).contains(&row),
                false => (at..at + 5).contains(&row) && (8..40).contains(&column),
            };
            let pixels: Vec<u8> = (0..width * height)
                .map(|place| {
                    if is_ink(place / width, place % width) {
                        20
                    } else {
                        230
                    }
                })
                .collect();
            let mut bytes = Vec::new();
            let mut encoder = png::Encoder::new(&mut bytes, width, height);
            encoder.set_color(png::ColorType::Grayscale);
            let mut writer = encoder.write_header().unwrap();
            writer.write_image_data(&pixels).unwrap();
            writer.finish().unwrap();
            sandbox.write(&format!("{folder}/{class}/{number}.png"), bytes);
        }
    }
    sandbox.write(&format!("{folder}/across/broken.png"), "no picture");
}

/// Writes an IDX dataset of zeros and ones, in files whose paths begin with `prefix`: noise, of
/// seed `seed`, with a bar, which is upright in zeros.
pub fn write_images(sandbox: &Sandbox, prefix: &str, [height, width]: [usize; 2], seed: u8) {
    let header = |sizes: &[u32]| {
        let magic = [0, 0, 8, sizes.len() as u8];
        [
            &magic[..],
            &sizes
                .iter()
                .flat_map(|size| size.to_be_bytes())
                .collect::<Vec<_>>(),
        ]
        .concat()
    };
    for (split, count) in [("train", 120u32), ("t10k", 24)] {
        let pixel = |image: u32, place: usize| {
            let (row, column) = (place / width, place % width);
            let on_bar = if image % 2 == 1 {
                column / 2 == 2
            } else {
                row / 2 == 2
            };
            let noise = (place as u32 + 31 * image)
                .wrapping_mul(2_654_435_761)
                .to_be_bytes()[0]
                ^ seed;
            if on_bar { 255 } else { noise / 3 }
        };
        let pixels =
            (0..count).flat_map(|image| (0..height * width).map(move |place| pixel(image, place)));
        let images = [
            header(&[count, height as u32, width as u32]),
            pixels.collect(),
        ]
        .concat();
        let labels = [
            header(&[count]),
            (0..count).map(|image| (image % 2) as u8).collect(),
        ]
        .concat();
        sandbox.write(&format!("{prefix}{split}-images-idx3-ubyte"), images);
        sandbox.write(&format!("{prefix}{split}-labels-idx1-ubyte"), labels);
    }
}

/// Runs a command, which must never panic.
#[track_caller]
pub fn said(command: Command) -> Said {
    said_of(command, "", LIMIT)
}

/// Runs a command that reads `input` and must end within `limit`.
#[track_caller]
pub fn said_of(mut command: Command, input: &str, limit: Duration) -> Said {
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // A command that does not read it may have ended already.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    fn reader(mut pipe: impl Read + Send + 'static) -> std::thread::JoinHandle<String> {
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            pipe.read_to_end(&mut bytes).unwrap();
            String::from_utf8_lossy(&bytes).into_owned()
        })
    }
    let (out, err) = (
        reader(child.stdout.take().unwrap()),
        reader(child.stderr.take().unwrap()),
    );
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if begin.elapsed() > limit {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("still running after {limit:?}: {command:?}");
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let said = Said {
        code: status.code(),
        out: out.join().unwrap(),
        err: err.join().unwrap(),
    };
    assert!(
        !said.err.contains("panicked") && said.code != Some(101),
        "{said:#?}"
    );
    assert!(said.code.is_some(), "ended by a signal: {said:#?}");
    said
}

/// Reports a skipped test past the harness, which hides the output of passing tests.
#[allow(clippy::disallowed_methods)]
pub fn skipped(why: &str) {
    std::io::stderr()
        .write_all(format!("SKIPPED: {why}\n").as_bytes())
        .unwrap();
}

/// Returns the MNIST folder in `MORPHCOG_DATA`; without one, reports `what` as not tested.
pub fn mnist(what: &str) -> Option<OsString> {
    let folder = std::env::var_os("MORPHCOG_DATA").filter(|folder| !folder.is_empty());
    if folder.is_none() {
        skipped(&format!(
            "MORPHCOG_DATA does not name a folder with MNIST; not tested: {what}"
        ));
    }
    folder
}

/// Sends a started program the signal that Slurm sends before its time limit.
pub fn terminate(child: &Child) {
    let sent = Command::new("kill")
        .args(["-s", "USR1", &child.id().to_string()])
        .status();
    assert!(sent.unwrap().success());
}

/// Returns true if tests run with a signal ignored, as hangups are under `nohup` and interrupts in
/// a shell's background. Programs they start inherit this, so its test would see nothing.
pub fn is_ignored(signal: u32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = ignored
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .unwrap_or(0);
    let is = mask >> (signal - 1) & 1 == 1;
    if is {
        skipped(&format!("signal {signal} is ignored here"));
    }
    is
}

/// Reads all files of a folder, for comparison.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let named = |path: PathBuf| {
        (
            path.file_name().unwrap().to_string_lossy().into_owned(),
            std::fs::read(&path).unwrap_or_default(),
        )
    };
    entries.map(named).collect()
}

/// Returns `metrics.csv` without its last column, the only one that depends on the clock.
pub fn without_seconds(metrics: &str) -> Vec<String> {
    assert!(
        metrics
            .lines()
            .next()
            .is_some_and(|header| header.ends_with(",seconds"))
    );
    metrics
        .lines()
        .map(|line| line.rsplit_once(',').unwrap().0.to_string())
        .collect()
}

/// Returns a sandbox with runs of all pairs of three digits, in `pairs/`.
pub fn pairs() -> Sandbox {
    static PAIRS: OnceLock<Made> = OnceLock::new();
    Sandbox::once(&PAIRS, |sandbox| {
        for [a, b] in [[0, 1], [0, 4], [1, 4]] {
            let task = format!("groups = [[{a}], [{b}]]");
            let config = TINY
                .replace("groups = [[0], [1]]", &task)
                .replace("train_images = [0, 1]", "");
            sandbox.write("run.toml", config);
            sandbox
                .run(&format!("evolve -q -c run.toml -o pairs/{a}v{b}"))
                .ended(0, &[]);
        }
    })
}
