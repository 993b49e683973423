//! Hostile files and requests: whatever they hold, the program ends soon, says what is wrong in one
//! harmless line that names the file, and never panics. By hand, for ten minutes:
//!
//! `MORPHCOG_HOSTILE_SECONDS=600 cargo test --release --test slow hostile -- --nocapture`
//!
//! The worst that was ever found stands in `tests/corpus/`.

use crate::common::hostile::{Dice, bytes, value};
use crate::common::program::{Said, Sandbox, said_of};
use crate::common::server;
use morphcog::base::error::{Error, ErrorKind};
use morphcog::base::hash::sha256_hex;
use morphcog::base::session::Session;
use morphcog::base::stop::NEVER;
use morphcog::base::text::is_unseen;
use morphcog::cli::explain::explain;
use morphcog::cli::output::console::{Console, Mode};
use morphcog::cli::output::reporters::Reporter;
use morphcog::commands::evolve;
use morphcog::commands::evolve::EvolveOptions;
use morphcog::commands::plot::{self, FigureKind, PlotOptions};
use morphcog::commands::simulate::{Scenario, simulate};
use morphcog::commands::{eval, replay};
use morphcog::config::Config;
use morphcog::draw::plot::{Background, Style, confusion, poster};
use morphcog::images::training::TrainingImages;
use morphcog::robots::selection::Selection;
use morphcog::serve::server::Server;
use morphcog::serve::{self, Service};
use morphcog::store::audit::AuditFile;
use morphcog::store::folder::IfExists;
use morphcog::store::images::{HeldOut, HowMany};
use morphcog::store::run::RunFile;
use morphcog::store::team::TeamFile;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

/// No input may take longer: many times what the slowest takes on an idle machine.
const LIMIT: Duration = Duration::from_secs(20);
/// Rollouts may last as long as their file says; so long they are waited for, and then stopped.
const PATIENCE: Duration = Duration::from_millis(500);
/// Without a word from the user, so long all together.
const SECONDS: f64 = 3.0;

/// Two groups of tiny robots, few of them, with short genomes.
const FEW: &str = r#"
seed = 3
generations = 4
[body]
height = 3
width = 4
min_muscles = 1
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
initial = 6
parents = 3
"#;

/// What a kind of input is put to.
type Target = (&'static str, fn(&World, &mut Dice, &mut Case));

const TARGETS: [Target; 10] = [
    ("scenario", scenario),
    ("run", run),
    ("config", config),
    ("eval", evaluation),
    ("audit", audit),
    ("capacity", capacity),
    ("team", team),
    ("metrics", metrics),
    ("checkpoint", checkpoint),
    ("request", request),
];

/// What stays the same for all inputs.
struct World {
    sandbox: Sandbox,
    /// A valid file of each kind.
    seeds: BTreeMap<&'static str, Vec<u8>>,
    port: u16,
}

/// The input at work.
#[derive(Default)]
struct Case {
    input: Vec<u8>,
    /// What the program said of it.
    outcome: String,
}

impl Case {
    /// An error about a file must name it, in a line that does no harm.
    fn check<T>(&mut self, outcome: Result<T, Error>, file: &str) -> Option<T> {
        match outcome {
            Ok(found) => {
                self.outcome += "ok ";
                Some(found)
            }
            // As it was asked for.
            Err(error) if error.kind == ErrorKind::Stopped => None,
            Err(error) => {
                self.outcome += &format!("{error} ");
                let explained = explain(&error);
                assert!(explained.message.contains(file), "names no file: {error:?}");
                assert!(
                    matches!(error.kind, ErrorKind::Input | ErrorKind::Unstable),
                    "{error:?}"
                );
                for text in [Some(&explained.message), explained.hint.as_ref()]
                    .into_iter()
                    .flatten()
                {
                    assert!(!text.contains(is_unseen), "not harmless: {text:?}");
                    assert!(text.chars().count() < 2000, "overlong: {text}");
                }
                None
            }
        }
    }
}

/// Where a console writes, to be looked at.
#[derive(Clone, Default)]
struct Page(Arc<Mutex<Vec<u8>>>);

impl Write for Page {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl World {
    fn new() -> Self {
        let sandbox = Sandbox::new();
        sandbox.write("few.toml", FEW);
        sandbox
            .run("evolve -q --config few.toml --out run")
            .ended(0, &[]);
        sandbox
            .run("eval -q --archive run/run.json --images 2 --cycles 1 --robots top:2")
            .ended(0, &[]);
        let audit =
            "audit -q --archive run/run.json --robots top:2 --set perturbations.time_step=[2]";
        sandbox.run(audit).ended(0, &[]);
        sandbox
            .run("team -q --archive run/run.json --classes 0,1 --images 4 --out run/team.json")
            .ended(0, &[]);
        let networks = "--set trainings=1 --set sizes=[1,3] --set networks=[\"mlp\"]";
        sandbox
            .run(&format!("capacity -q --eval run/eval.json {networks}"))
            .ended(0, &[]);
        let scenario = json!({
            "body": [[3, 4, 1], [6, 2, 5]], "stimuli": [[[0, 1, 0.5], [1, 0, 0]], [[0, 0, 0], [1, 1, 1]]],
            "switch_every": 10, "reset_between": true, "start_column": 3, "start_row": 2, "control_steps": 30,
            "physics": serde_json::to_value(morphcog::sim::Physics::default()).unwrap(),
        });
        let request = format!(
            "POST /api/simulations HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nOrigin: \
             http://127.0.0.1:PORT\r\nContent-Length: LENGTH\r\n\r\n{}",
            json!({ "subject": { "archive": 3, "robot": "ROBOT" }, "control_steps": 40, "speed": 0.0,
                    "shown": { "stimulus": [[0, 1, 0.5, 0], [1, 0, 0, 1], [0, 0, 1, 0]] } })
        );
        let id = sandbox.run_file("run").elites[0].id.clone();
        let mut seeds = BTreeMap::from([
            ("scenario", scenario.to_string().into_bytes()),
            ("request", request.replace("ROBOT", &id).into_bytes()),
        ]);
        for (kind, name) in [
            ("run", "run/run.json"),
            ("config", "run/config.toml"),
            ("eval", "run/eval.json"),
            ("audit", "run/audit.json"),
            ("capacity", "run/capacity.json"),
            ("team", "run/team.json"),
            ("metrics", "run/metrics.csv"),
            ("checkpoint", "run/checkpoint.json"),
        ] {
            seeds.insert(kind, std::fs::read(sandbox.path(name)).unwrap());
        }
        let archives = vec![sandbox.path("run/run.json")];
        let (service, _) = Service::open(&serve::ServeOptions {
            archives,
            ..serve::ServeOptions::default()
        })
        .unwrap();
        let server = Server::bind(service, Default::default(), 0).unwrap();
        let port = server
            .url()
            .rsplit(':')
            .next()
            .unwrap()
            .trim_end_matches('/')
            .parse()
            .unwrap();
        static NEVER: AtomicBool = AtomicBool::new(false);
        std::thread::spawn(move || server.run(&NEVER));
        World {
            sandbox,
            seeds,
            port,
        }
    }

    /// A copy of the run in a folder of its own, with one file replaced.
    fn with(&self, name: &str, content: &[u8]) -> PathBuf {
        let folder = self.sandbox.path("hostile");
        for (kind, own) in [
            ("run", "run.json"),
            ("eval", "eval.json"),
            ("audit", "audit.json"),
            ("metrics", "metrics.csv"),
        ] {
            let is_other = own != name;
            std::fs::create_dir_all(&folder).unwrap();
            if is_other {
                std::fs::write(folder.join(own), &self.seeds[kind]).unwrap();
            }
        }
        std::fs::write(folder.join(name), content).unwrap();
        folder
    }

    /// A JSON seed, mutated in what it says or as bytes.
    fn json(&self, kind: &str, dice: &mut Dice) -> Vec<u8> {
        let seed = &self.seeds[kind];
        if dice.below(3) == 0 {
            return bytes(dice, seed);
        }
        let text = serde_json::from_slice::<Value>(seed).unwrap();
        let text = value(dice, &text).to_string().into_bytes();
        if dice.below(8) == 0 {
            bytes(dice, &text)
        } else {
            text
        }
    }

    /// Makes a figure, and looks at what was said.
    fn plot(&self, case: &mut Case, kind: FigureKind, archive: &Path, name: &str) {
        let (out, err) = (Page::default(), Page::default());
        let console =
            Console::with_writers(Mode::Human, Box::new(out.clone()), Box::new(err.clone()));
        let reporter = Reporter::new(&console);
        let wanted = PlotOptions {
            kind,
            archives: vec![archive.to_path_buf()],
            robots: Vec::new(),
            options: replay::ReplayOptions::default(),
            every: 0,
            out: Some(self.sandbox.path("figure.svg")),
            dpi: Some(36),
            background: Background::Paper,
            style: Style::default(),
        };
        case.check(plot::plot(&wanted, &Session::new(&NEVER, &reporter)), name);
        for page in [out, err] {
            let text = String::from_utf8(page.0.lock().unwrap().clone()).unwrap();
            assert!(
                text.chars().all(|c| c == '\n' || !is_unseen(c)),
                "not harmless: {text:?}"
            );
        }
    }
}

fn scenario(world: &World, dice: &mut Dice, case: &mut Case) {
    case.input = world.json("scenario", dice);
    let path = world.sandbox.write("scenario.json", &case.input);
    let Some(scenario) = case.check(Scenario::read(&path), "scenario.json") else {
        return;
    };
    // As many rows as a reader takes before it closes the pipe.
    let (mut rows, begin) = (0, Instant::now());
    let gone = || Error::unstable("scenario.json: nobody reads on".to_string());
    let row = |_| {
        rows += 1;
        if rows < 50 && begin.elapsed() < PATIENCE {
            Ok(())
        } else {
            Err(gone())
        }
    };
    let simulated =
        simulate(&scenario, false, row).map_err(|error| error.in_place("scenario.json"));
    case.check(simulated, "scenario.json");
}

fn run(world: &World, dice: &mut Dice, case: &mut Case) {
    case.input = world.json("run", dice);
    let folder = world.with("run.json", &case.input);
    let archive = folder.join("run.json");
    let Some(run) = case.check(RunFile::read(&archive), "run.json") else {
        return;
    };
    let options = eval::EvalOptions {
        archives: vec![archive.clone()],
        robots: Selection::Top(1),
        images: Some(HowMany::Evenly(2)),
        split: HeldOut::Test,
        validation: None,
        seed: 1,
        threshold: 3.0,
        cycles: 1,
        dataset: None,
        out: folder.join("other.json"),
    };
    let stop = Arc::new(AtomicBool::new(false));
    let ended = {
        let stop = Arc::clone(&stop);
        let (done, waits) = mpsc::channel::<()>();
        std::thread::spawn(move || {
            let _ = waits.recv_timeout(PATIENCE);
            stop.store(true, Ordering::Relaxed);
        });
        done
    };
    case.check(
        eval::eval(&options, &Session::new(&stop, &()).threads(Some(1))),
        "run.json",
    );
    drop(ended);
    world.plot(case, FigureKind::Archive, &archive, "run.json");
    let substeps =
        run.config.protocol.control_steps as f64 * f64::from(run.config.physics.substeps);
    if substeps < 1e5 {
        world.plot(case, FigureKind::Spacetime, &archive, "run.json");
    }
    case.check(
        Service::open(&serve::ServeOptions {
            archives: vec![archive.clone()],
            ..serve::ServeOptions::default()
        }),
        "run.json",
    );
}

fn config(world: &World, dice: &mut Dice, case: &mut Case) {
    let seed = std::str::from_utf8(&world.seeds["config"]).unwrap();
    let as_json = serde_json::to_value(toml::from_str::<toml::Value>(seed).unwrap()).unwrap();
    let name = if dice.below(2) == 0 {
        "config.toml"
    } else {
        "config.json"
    };
    case.input = match dice.below(3) {
        0 => bytes(dice, seed.as_bytes()),
        _ => {
            let value = value(dice, &as_json);
            match (name, toml::to_string(&value)) {
                ("config.toml", Ok(text)) => text.into_bytes(),
                _ => value.to_string().into_bytes(),
            }
        }
    };
    let path = world.sandbox.write(name, &case.input);
    if let Some(config) = case.check(Config::load(&path.to_string_lossy(), &[]), name) {
        let _ = TrainingImages::load(&config, None);
    }
}

fn evaluation(world: &World, dice: &mut Dice, case: &mut Case) {
    case.input = world.json("eval", dice);
    let folder = world.with("eval.json", &case.input);
    world.plot(
        case,
        FigureKind::Accuracy,
        &folder.join("eval.json"),
        "eval.json",
    );
    world.plot(
        case,
        FigureKind::Accuracy,
        &folder.join("run.json"),
        "eval.json",
    );
}

fn audit(world: &World, dice: &mut Dice, case: &mut Case) {
    case.input = world.json("audit", dice);
    let folder = world.with("audit.json", &case.input);
    case.check(AuditFile::read(&folder.join("audit.json")), "audit.json");
    let options = replay::ReplayOptions {
        robot: "best".to_string(),
        physical_only: true,
        archive: Some(folder.join("run.json")),
        ..replay::ReplayOptions::default()
    };
    case.check(replay::find(&options), "audit.json");
}

fn capacity(world: &World, dice: &mut Dice, case: &mut Case) {
    case.input = world.json("capacity", dice);
    let folder = world.with("capacity.json", &case.input);
    world.plot(
        case,
        FigureKind::Capacity,
        &folder.join("capacity.json"),
        "capacity.json",
    );
}

/// What a report shows of a team.
fn team(world: &World, dice: &mut Dice, case: &mut Case) {
    case.input = world.json("team", dice);
    let folder = world.with("team.json", &case.input);
    if let Some(file) = case.check(TeamFile::read(&folder.join("team.json")), "team.json") {
        let (is_decided, has_robots) = (file.answers.is_some(), !file.members.is_empty());
        assert_eq!(
            (
                confusion(&file, &Style::default()).is_some(),
                poster(&file, &Style::default()).is_some(),
            ),
            (is_decided, has_robots)
        );
    }
}

fn metrics(world: &World, dice: &mut Dice, case: &mut Case) {
    case.input = bytes(dice, &world.seeds["metrics"]);
    let folder = world.with("metrics.csv", &case.input);
    world.plot(
        case,
        FigureKind::Progress,
        &folder.join("run.json"),
        "metrics.csv",
    );
}

/// Goes on with a run from a wrong checkpoint, signed again or not.
fn checkpoint(world: &World, dice: &mut Dice, case: &mut Case) {
    let seed = &world.seeds["checkpoint"];
    case.input = match dice.below(4) {
        0 => bytes(dice, seed),
        _ => {
            let content = seed.splitn(2, |&byte| byte == b'\n').nth(1).unwrap();
            let content: Value = serde_json::from_slice(content).unwrap();
            let content = value(dice, &content).to_string();
            format!("{}\n{content}\n", sha256_hex(content.as_bytes())).into_bytes()
        }
    };
    let folder = world.with("checkpoint.json", &case.input);
    let before = std::fs::read(folder.join("run.json")).unwrap();
    let options = EvolveOptions {
        config: Config::parse(FEW, "few.toml", &[]).unwrap(),
        name: "few".to_string(),
        out: folder.clone(),
        if_exists: IfExists::Resume,
    };
    let resumed = evolve::evolve(
        &options,
        &Session::new(&AtomicBool::new(true), &()).threads(Some(1)),
    );
    // What is wrong with the run is told with its folder.
    if case.check(resumed, "hostile").is_none() {
        assert_eq!(
            std::fs::read(folder.join("run.json")).unwrap(),
            before,
            "nothing is lost"
        );
    } else {
        RunFile::read(&folder.join("run.json")).expect("a run that this program can have made");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

fn request(world: &World, dice: &mut Dice, case: &mut Case) {
    let seed = String::from_utf8(world.seeds["request"].clone()).unwrap();
    let (head, body) = seed.split_once("\r\n\r\n").unwrap();
    let mut body = body.as_bytes().to_vec();
    if dice.below(3) > 0 {
        body = value(dice, &serde_json::from_slice(&body).unwrap())
            .to_string()
            .into_bytes();
    }
    let paths = [
        "rollouts",
        "body",
        "stimulus",
        "scenario",
        "rollouts/1",
        "archives/3",
        "images?set=builtin&class=1",
    ];
    let mut head = head.replace("/api/simulations", &format!("/api/{}", dice.pick(&paths)));
    head = head
        .replace("PORT", &world.port.to_string())
        .replace("LENGTH", &body.len().to_string());
    case.input = [head.as_bytes(), b"\r\n\r\n", &body].concat();
    if dice.below(2) == 0 {
        case.input = bytes(dice, &case.input);
    }
    ask(world.port, case);
}

/// Sends a request, and reads some of the answer.
fn ask(port: u16, case: &mut Case) {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    // What is refused early is not read to its end.
    let _ = stream
        .write_all(&case.input)
        .and_then(|()| stream.shutdown(Shutdown::Write));
    let mut answer = Vec::new();
    let _ = stream.take(4000).read_to_end(&mut answer);
    let text = String::from_utf8_lossy(&answer).into_owned();
    case.outcome += text.lines().next().unwrap_or_default();
    assert!(text.is_empty() || text.starts_with("HTTP/1.1 "), "{text:?}");
    let status = text.get(9..12).unwrap_or_default();
    assert!(
        [
            "", "200", "204", "400", "403", "404", "405", "408", "411", "413", "431", "503"
        ]
        .contains(&status),
        "{text}"
    );
    if let Some((_, body)) = text
        .split_once("\r\n\r\n")
        .filter(|_| status.starts_with('4'))
    {
        assert_eq!(
            body.lines().count(),
            usize::from(!body.is_empty()),
            "one line: {body:?}"
        );
        assert!(
            body.chars().all(|c| c == '\n' || !is_unseen(c)),
            "not harmless: {body:?}"
        );
    }
}

static PANICS: AtomicUsize = AtomicUsize::new(0);
/// The input at work, and since when.
static AT_WORK: Mutex<Option<(String, Instant)>> = Mutex::new(None);

/// Where an input is kept that broke something.
fn kept(name: &str, input: &[u8]) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("hostile");
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    std::fs::write(&path, input).unwrap();
    path
}

#[test]
fn mutated_inputs_are_refused_or_used_and_nothing_else_ever_happens() {
    let seconds = std::env::var("MORPHCOG_HOSTILE_SECONDS")
        .ok()
        .map(|text| text.parse::<f64>().unwrap());
    let only = std::env::var("MORPHCOG_HOSTILE_ONLY").ok();
    let world = World::new();
    let until = Instant::now() + Duration::from_secs_f64(seconds.unwrap_or(SECONDS));
    let first: u64 =
        std::env::var("MORPHCOG_HOSTILE_FIRST").map_or(0, |text| text.parse().unwrap());
    // Panics of the program's threads count, too; those of other tests, whose threads have their names, do not.
    let usual = std::panic::take_hook();
    let own = std::thread::current().name().map(str::to_string);
    std::panic::set_hook(Box::new(move |about| {
        let thread = std::thread::current();
        if thread
            .name()
            .is_none_or(|name| !name.contains("::") || own.as_deref() == Some(name))
        {
            PANICS.fetch_add(1, Ordering::Relaxed);
        }
        usual(about);
    }));
    std::thread::spawn(|| {
        loop {
            std::thread::sleep(Duration::from_millis(200));
            if let Some((name, since)) = &*AT_WORK.lock().unwrap()
                && since.elapsed() > LIMIT
            {
                eprintln!(
                    "{name} does not end; run it alone with MORPHCOG_HOSTILE_ONLY and MORPHCOG_HOSTILE_FIRST"
                );
                std::process::exit(1);
            }
        }
    });
    let (mut counts, mut outcomes, mut slowest) = (
        [0u64; TARGETS.len()],
        BTreeMap::<String, u64>::new(),
        Vec::new(),
    );
    let mut failures = Vec::new();
    for number in first.. {
        for (kind, (name, target)) in TARGETS.iter().enumerate() {
            if only.as_ref().is_some_and(|only| only != name) {
                continue;
            }
            let label = format!("{name}-{number}");
            let begin = Instant::now();
            *AT_WORK.lock().unwrap() = Some((label.clone(), begin));
            let mut case = Case::default();
            let simulated = catch_unwind(AssertUnwindSafe(|| {
                target(&world, &mut Dice::new(kind, number), &mut case);
                assert_eq!(
                    PANICS.load(Ordering::Relaxed),
                    0,
                    "a panic in another thread"
                );
            }));
            if simulated.is_err() {
                failures.push(kept(&label, &case.input));
                PANICS.store(0, Ordering::Relaxed);
            }
            counts[kind] += 1;
            slowest.push((begin.elapsed(), label, case.input.len()));
            let outcome: String = case
                .outcome
                .chars()
                .filter(|c| !c.is_ascii_digit())
                .take(80)
                .collect();
            *outcomes.entry(format!("{name}: {outcome}")).or_default() += 1;
        }
        slowest.sort_by_key(|(time, ..)| std::cmp::Reverse(*time));
        slowest.truncate(12);
        if Instant::now() > until || failures.len() > 20 {
            break;
        }
    }
    *AT_WORK.lock().unwrap() = None;
    if seconds.is_some() {
        println!("inputs: {counts:?} of {:?}", TARGETS.map(|(name, _)| name));
        slowest
            .iter()
            .for_each(|(time, label, size)| println!("{time:>10.1?}  {label} ({size} bytes)"));
        outcomes
            .iter()
            .for_each(|(outcome, count)| println!("{count:>8}  {outcome}"));
    }
    assert!(counts.iter().sum::<u64>() > 0);
    assert!(failures.is_empty(), "see {failures:#?}");
}

/// Runs a command on a file of the corpus: soon it ends, with words that do no harm and name the
/// file if it is refused.
#[track_caller]
fn put_to(sandbox: &Sandbox, args: &str, file: &str) -> Said {
    let said = said_of(sandbox.command(args.split_whitespace()), "", LIMIT);
    assert!(
        [Some(0), Some(3), Some(4)].contains(&said.code),
        "{args}: {said:#?}"
    );
    for text in [&said.out, &said.err] {
        assert!(
            text.chars().all(|c| c == '\n' || !is_unseen(c)),
            "{args}: not harmless: {text:?}"
        );
        assert!(
            text.lines().all(|line| !line.starts_with("error: forged")),
            "{args}: a forged line: {text}"
        );
        assert!(
            text.lines().all(|line| line.chars().count() < 4000),
            "{args}: overlong: {text}"
        );
    }
    assert!(
        said.code != Some(3) || said.err.contains(file),
        "{args}: names no file: {said:#?}"
    );
    said
}

#[test]
fn the_worst_inputs_end_soon_in_every_command_that_reads_them() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus");
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    let sandbox = Sandbox::new();
    sandbox.write("few.toml", FEW);
    sandbox
        .run("evolve -q --config few.toml --out run")
        .ended(0, &[]);
    let server = server::Server::start(&sandbox, "--archive run/run.json");
    let mut kinds = BTreeMap::<String, usize>::new();
    for path in files {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let content = std::fs::read(&path).unwrap();
        let kind = name.split('-').next().unwrap().to_string();
        let file = |name: &str| drop(sandbox.write(&format!("hostile/{name}"), &content));
        let put_to = |args: &str, file: &str| put_to(&sandbox, args, file);
        match kind.as_str() {
            "scenario" => {
                file("scenario.json");
                put_to(
                    "simulate hostile/scenario.json --out hostile/rollout.csv",
                    "scenario.json",
                );
            }
            "run" => {
                file("run.json");
                put_to(
                    "eval --archive hostile/run.json --images 2 --cycles 1 --robots top:1",
                    "run.json",
                );
                put_to(
                    "plot archive --archive hostile/run.json --dpi 36",
                    "run.json",
                );
                put_to(
                    "plot spacetime --archive hostile/run.json --dpi 36",
                    "run.json",
                );
            }
            "eval" => {
                file("eval.json");
                put_to(
                    "plot accuracy --archive hostile/eval.json --dpi 36",
                    "eval.json",
                );
            }
            "request" => {
                let text =
                    String::from_utf8_lossy(&content).replace("PORT", &server.port.to_string());
                let mut case = Case {
                    input: text.into_bytes(),
                    ..Case::default()
                };
                ask(server.port, &mut case);
                assert!(
                    case.outcome.starts_with("HTTP/1.1 "),
                    "{name}: {}",
                    case.outcome
                );
            }
            _ => panic!("{name}: expected scenario-, run-, eval- or request-"),
        }
        *kinds.entry(kind).or_default() += 1;
    }
    assert_eq!(
        kinds.keys().map(String::as_str).collect::<Vec<_>>(),
        ["eval", "request", "run", "scenario"]
    );
    assert_eq!(server.get("/api/status").status, 200);
    #[cfg(unix)]
    server.ended_by("TERM");
}
