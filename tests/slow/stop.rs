//! Whatever a command computes, it ends soon when it is to, and what would not end is refused
//! before it begins.
#![cfg(unix)]

use crate::common::program::{PROGRAM, Sandbox, TINY, files, gaits, without_seconds};
use crate::common::server::Server;
use morphcog::base::error::ErrorKind;
use morphcog::base::session::Session;
use morphcog::commands::evolve::{EvolveOptions, evolve};
use morphcog::config::Config;
use morphcog::store::folder::IfExists;
use std::io::Read;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, ExitStatus};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// An image lasts a million control steps, the most there can be: a rollout of a minute or more.
const LONG: &str = "--set protocol.control_steps=1000000";
/// It takes some hundredths of a second; the rest is for machines that have other things to do.
const SOON: Duration = Duration::from_secs(6);
/// Processor time that no program needs to begin.
const WORK: Duration = Duration::from_millis(120);

/// Waits until a program is at its work: it has used more processor time than it needs to begin, however
/// busy the machine is.
#[track_caller]
fn at_work(child: &mut Child) {
    let begin = Instant::now();
    while processor_time(child.id())
        .map_or(begin.elapsed() < Duration::from_secs(4), |time| time < WORK)
    {
        assert!(
            child.try_wait().unwrap().is_none(),
            "it has ended before it was stopped"
        );
        assert!(
            begin.elapsed() < Duration::from_secs(100),
            "it does not work"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(
        child.try_wait().unwrap().is_none(),
        "it has ended before it was stopped"
    );
}

/// The processor time of a process so far, where the system tells it.
fn processor_time(process: u32) -> Option<Duration> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // Behind the name, which is in parentheses; in hundredths of a second.
    let fields: Vec<&str> = stat.rsplit_once(") ")?.1.split(' ').collect();
    let ticks = |field: usize| fields[field].parse::<u64>().expect("proc(5): a number");
    Some(Duration::from_millis(10 * (ticks(11) + ticks(12))))
}

/// Sends a signal when the program is at work; then it ends soon.
#[track_caller]
fn stopped(child: &mut Child, signal: &str) -> ExitStatus {
    at_work(child);
    let sent = Command::new("kill")
        .args(["-s", signal, &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if begin.elapsed() > SOON {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("still running {SOON:?} after {signal}");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A run whose robots live long, as its `run.json` says.
fn patient_run(control_steps: u32) -> Sandbox {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    let text = sandbox.read("run/run.json");
    let long = text.replace(
        "\"control_steps\":20",
        &format!("\"control_steps\":{control_steps}"),
    );
    assert_ne!(text, long);
    sandbox.write("run/run.json", long);
    sandbox
}

#[test]
fn a_generation_that_lasts_for_minutes_is_dropped_when_a_signal_comes() {
    let sandbox = Sandbox::tiny();
    for signal in ["INT", "TERM", "USR1"] {
        let mut child = sandbox.start(&format!("evolve -q -c tiny.toml {LONG} -o {signal}"));
        assert_eq!(stopped(&mut child, signal).code(), Some(75), "{signal}");
        let saved = sandbox.run_file(signal);
        assert_eq!((saved.generations, saved.elites.len()), (0, 0), "{signal}");
        assert_eq!(
            sandbox
                .read(&format!("{signal}/metrics.csv"))
                .lines()
                .count(),
            1,
            "{signal}"
        );
    }
}

#[test]
fn eval_audit_response_validation_and_capacity_end_soon_and_leave_nothing_half_done() {
    let sandbox = patient_run(1_000_000);
    let before = files(&sandbox.path("run"));
    for command in [
        "eval -q -a run/run.json --images 40 --cycles 10000",
        "audit -q -a run/run.json",
        "audit -q -a run/run.json --set perturbations.time_step=[64]",
        "response -q -a run/run.json --robots all",
    ] {
        let mut child = sandbox.start(command);
        assert_eq!(stopped(&mut child, "INT").code(), Some(75), "{command}");
        // An audit's file says of whom nothing is known yet.
        let mut after = files(&sandbox.path("run"));
        for name in ["audit.json", "audit.csv"] {
            if let Some(audit) = after.remove(name) {
                assert!(
                    !String::from_utf8(audit).unwrap().contains("\"verdict\""),
                    "{command}"
                );
            }
        }
        assert_eq!(after, before, "{command}");
        let _ = std::fs::remove_file(sandbox.path("run/audit.json"));
    }
    let validates =
        "--set validation.best=1 --set validation.images=40 --set physics.cycle_steps=100000";
    let mut child = sandbox.start(&format!("evolve -q -c tiny.toml -o validated {validates}"));
    assert_eq!(stopped(&mut child, "TERM").code(), Some(75));
    assert_eq!(sandbox.run_file("validated").generations, 12);
    assert!(!sandbox.path("validated/validation.json").exists());

    sandbox.run("evolve -q -c tiny.toml -o short").ended(0, &[]);
    sandbox
        .run("eval -q -a short/run.json --images 40 --cycles 1 --robots top:4")
        .ended(0, &[]);
    let endless =
        "--set mlp.epochs=1000000000 --set mlp.patience=1000000000 --set networks=[\"mlp\"]";
    let capacity =
        format!("capacity -q --eval short/eval.json --set trainings=2 --set sizes=[1,2] {endless}");
    let mut child = sandbox.start(&capacity);
    assert_eq!(stopped(&mut child, "INT").code(), Some(75));
    assert!(!sandbox.path("short/capacity.json").exists());
}

#[test]
fn commands_that_have_nothing_to_save_are_ended_by_the_signal_and_leave_no_file() {
    // More could not be recorded.
    let sandbox = patient_run(600_000);
    sandbox.write(
        "long.json",
        "{\"body\": [[3, 4, 3], [4, 0, 4]], \"control_steps\": 1000000}",
    );
    let before = files(&sandbox.path("run"));
    let mut child = sandbox.start("simulate long.json --points -o long.csv");
    assert_eq!(stopped(&mut child, "TERM").code(), Some(75));
    let left = std::fs::read_dir(sandbox.path(""))
        .unwrap()
        .map(|entry| entry.unwrap().file_name());
    assert!(
        left.into_iter()
            .all(|name| !name.to_string_lossy().contains("long.csv"))
    );
    // A picture is whole or not there.
    let mut child = sandbox.start("replay -q -a run/run.json --robot best --format gif");
    assert_eq!(stopped(&mut child, "TERM").code(), Some(75));
    assert_eq!(files(&sandbox.path("run")), before);
    for command in [
        "plot -q spacetime -a run/run.json",
        "report -q run/run.json",
        "bench",
    ] {
        let mut child = sandbox.start(command);
        assert_eq!(stopped(&mut child, "TERM").code(), None, "{command}");
        assert_eq!(files(&sandbox.path("run")), before, "{command}");
    }
}

/// How a command ends that a signal meets at work.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    /// It saves what it has, and says so with 75.
    Stopped,
    /// It has nothing to save: by the signal, as is usual.
    BySignal,
    /// To be ended so is what it is for.
    Done,
}

#[test]
fn every_command_ends_in_its_documented_way_when_a_signal_asks_it_to() {
    // More could not be recorded.
    let sandbox = patient_run(600_000);
    sandbox.write(
        "long.json",
        "{\"body\": [[3, 4, 3], [4, 0, 4]], \"control_steps\": 1000000}",
    );
    let patient = TINY.replace("control_steps = 20", "control_steps = 1000000");
    sandbox.write("patient.toml", patient);
    sandbox.write("sweep.toml", "config = \"patient.toml\"\nseeds = [1, 2]\n");
    sandbox.write(
        "paper.toml",
        "seeds = [1]\nrobots = 3\nimages = 20\n[[experiment]]\nconfig = \"patient.toml\"\n",
    );
    sandbox.run("evolve -q -c tiny.toml -o short").ended(0, &[]);
    sandbox
        .run("eval -q -a short --images 40 --cycles 1 --robots top:4")
        .ended(0, &[]);
    let endless =
        "--set mlp.epochs=1000000000 --set mlp.patience=1000000000 --set networks=[\"mlp\"]";
    // A mirror that takes connections and says nothing.
    let silent = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let mirror = format!("http://{}", silent.local_addr().unwrap());
    let mut connections = Vec::new();
    let commands = [
        ("demo -q -o demo-N".to_string(), End::Stopped),
        (
            format!("evolve -q -c tiny.toml {LONG} -o evolve-N"),
            End::Stopped,
        ),
        (
            format!(
                "train -q -a gallery:gaits-6 -t 0|1 --set data.dataset=builtin -o train-N {LONG}"
            ),
            End::Stopped,
        ),
        (
            "eval -q -a run --images 40 --cycles 10000 -o eval-N.json".to_string(),
            End::Stopped,
        ),
        ("audit -q -a run -o audit-N.json".to_string(), End::Stopped),
        (
            "response -q -a run --robots all -o response-N.json".to_string(),
            End::Stopped,
        ),
        (
            format!("capacity -q --eval short/eval.json {endless} -o capacity-N.json"),
            End::Stopped,
        ),
        ("sweep -q sweep.toml -o sweep-N".to_string(), End::Stopped),
        (
            "sweep -q sweep.toml -o task-N --task 1".to_string(),
            End::Stopped,
        ),
        (
            "reproduce -q paper.toml -o reproduce-N".to_string(),
            End::Stopped,
        ),
        ("verify -q same-bits -o verify-N".to_string(), End::Stopped),
        (
            "simulate long.json --points -o long-N.csv".to_string(),
            End::Stopped,
        ),
        ("simulate long.json --points".to_string(), End::BySignal),
        (
            "replay -q -a run --robot best --format gif -o walk-N.gif".to_string(),
            End::Stopped,
        ),
        (
            "plot -q spacetime -a run -o spacetime-N.svg".to_string(),
            End::BySignal,
        ),
        ("report -q run -o report-N.html".to_string(), End::BySignal),
        ("bench".to_string(), End::BySignal),
        (
            format!("data fetch mnist --to data-N --mirror {mirror}"),
            End::BySignal,
        ),
        ("serve -q --no-open".to_string(), End::Done),
    ];
    for (signal, number) in [("HUP", 1), ("TERM", 15), ("INT", 2)] {
        if crate::common::program::is_ignored(number) {
            continue;
        }
        let mut started: Vec<(Child, &str, End)> = Vec::new();
        // All signals come to one place; one command of each way to end meets all three.
        let meets = |command: &str| {
            number == 15
                || ["evolve", "replay", "plot", "serve"]
                    .iter()
                    .any(|name| command.starts_with(name))
        };
        for (command, end) in commands.iter().filter(|(command, _)| meets(command)) {
            started.push((sandbox.start(&command.replace("-N", signal)), command, *end));
        }
        // All of them together, for none is waited for alone. These wait themselves: for an answer, for a
        // request, for somebody to read on, and for a command.
        for (child, command, _) in &mut started {
            match command.split(' ').next() {
                Some("data") => connections.push(silent.accept().unwrap()),
                Some("serve" | "simulate") if !command.contains("-o ") => {
                    let said = child.stdout.as_mut().unwrap().read(&mut [0; 4]).unwrap();
                    assert!(said > 0, "{command}");
                }
                // Its command works.
                Some("verify") => {
                    let run = sandbox.path(&format!("verify{signal}/same-bits/runs"));
                    let begin = Instant::now();
                    while !run.exists() && begin.elapsed() < Duration::from_secs(100) {
                        std::thread::sleep(Duration::from_millis(5));
                    }
                }
                _ => at_work(child),
            }
        }
        for (child, ..) in &started {
            let sent = Command::new("kill")
                .args(["-s", signal, &child.id().to_string()])
                .status()
                .unwrap();
            assert!(sent.success());
        }
        // One that goes on has died by 9 when its end is compared, and none outlives the test.
        let begin = Instant::now();
        for (child, ..) in &mut started {
            while child.try_wait().unwrap().is_none() {
                if begin.elapsed() > 3 * SOON {
                    child.kill().unwrap();
                }
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        for (child, command, end) in started {
            let ended = child.wait_with_output().unwrap();
            let found = (ended.status.code(), ended.status.signal());
            let expected = match end {
                End::Stopped => (Some(75), None),
                End::BySignal => (None, Some(number.cast_signed())),
                End::Done => (Some(0), None),
            };
            let said = String::from_utf8_lossy(&ended.stderr);
            assert_eq!(found, expected, "{command} and {signal}: {said}");
        }
    }
    let left = std::fs::read_dir(sandbox.path(""))
        .unwrap()
        .map(|entry| entry.unwrap().file_name());
    let half: Vec<_> = left
        .filter(|name| name.to_string_lossy().ends_with(".tmp"))
        .collect();
    assert!(half.is_empty(), "{half:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_hangup_that_is_ignored_at_the_start_as_by_nohup_stays_ignored() {
    let sandbox = Sandbox::tiny();
    let script = format!("trap '' HUP; exec {PROGRAM} evolve -q -c tiny.toml {LONG} -o run");
    let mut command = Command::new("sh");
    command
        .args(["-c", &script])
        .current_dir(sandbox.path(""))
        .stderr(std::process::Stdio::piped());
    let mut child = command.spawn().unwrap();
    at_work(&mut child);
    let sent = Command::new("kill")
        .args(["-s", "HUP", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
    assert_eq!(stopped(&mut child, "TERM").code(), Some(75));
}

#[test]
fn a_rollout_that_is_watched_ends_with_its_tab_and_with_the_server() {
    let sandbox = Sandbox::new();
    let server = Server::start(&sandbox, "");
    let body: Vec<Vec<u8>> = (0..64)
        .map(|row| (0..64).map(|c| 3 + ((row + c) % 2) as u8).collect())
        .collect();
    let rollout =
        serde_json::json!({ "subject": { "body": body }, "control_steps": 5000, "speed": 0 });
    let running = || server.get("/api/status").body;
    let mut events = server.events("/api/simulations", &rollout);
    events.next().unwrap();
    assert!(running().contains("\"simulations\":1"), "{}", running());
    drop(events);
    let begin = Instant::now();
    while !running().contains("\"simulations\":0") {
        assert!(begin.elapsed() < SOON, "{}", running());
        std::thread::sleep(Duration::from_millis(10));
    }
    let mut events = server.events("/api/simulations", &rollout);
    events.next().unwrap();
    server.ended_by("TERM");
}

#[test]
fn a_run_stopped_at_any_moments_goes_on_to_the_same_bytes() {
    let sandbox = Sandbox::new();
    for (name, text) in [("plain", TINY.to_string()), ("gaits", gaits())] {
        let text = text.replace("control_steps = 20", "control_steps = 60");
        sandbox.write(&format!("{name}.toml"), &text);
        sandbox
            .run(&format!("evolve -q -c {name}.toml -o {name}-whole"))
            .ended(0, &[]);
        let options = EvolveOptions {
            config: Config::parse(&text, "run.toml", &[]).unwrap(),
            name: name.to_string(),
            out: sandbox.path(name),
            if_exists: IfExists::Resume,
        };
        let (mut random, mut stops) = (9_u64, 0);
        loop {
            let stop = AtomicBool::new(false);
            random = random
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            // Long enough for some generations in the end, however slow the machine is at the
            // moment.
            let patience = Duration::from_micros((random >> 33) % (20_000 + 3_000 * stops));
            let finished = std::thread::scope(|threads| {
                threads.spawn(|| {
                    std::thread::sleep(patience);
                    stop.store(true, Ordering::Relaxed);
                });
                evolve(&options, &Session::new(&stop, &()).threads(Some(2)))
            });
            match finished {
                Ok(finished) if !finished.stopped => break,
                Ok(_) => {}
                // A program that another test starts has this process's files, and with them the
                // lock of the run before, for a moment.
                Err(error) if error.kind == ErrorKind::Occupied => continue,
                // Before there was anything to save.
                Err(error) => assert_eq!(error.kind, ErrorKind::Stopped, "{error}"),
            }
            stops += 1;
            assert!(stops < 400, "it does not get on");
        }
        assert!(stops > 0);
        let result = |folder: &str| {
            let read = |file: &str| sandbox.read(&format!("{folder}/{file}"));
            (read("run.json"), without_seconds(&read("metrics.csv")))
        };
        assert_eq!(result(name), result(&format!("{name}-whole")), "{name}");
    }
}

#[test]
fn what_would_not_end_is_refused_with_its_key_wherever_it_stands() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    let good = sandbox.read("run/run.json");
    let hostile = [
        (
            "\"blow_up_extent\":10.0",
            "\"blow_up_extent\":1e10",
            "physics.blow_up_extent = 10000000000",
        ),
        (
            "\"substeps\":30",
            "\"substeps\":4000000000",
            "physics.substeps = 4000000000",
        ),
        (
            "\"cycle_steps\":50",
            "\"cycle_steps\":4000000000",
            "physics.cycle_steps = 4000000000",
        ),
        (
            "\"control_steps\":20",
            "\"control_steps\":4000000000",
            "protocol.control_steps = 4000000000",
        ),
        (
            "\"start_row\":2",
            "\"start_row\":4000000000",
            "protocol.start_row = 4000000000",
        ),
        (
            "\"generations\":12,\"stats\"",
            "\"generations\":4000000000,\"stats\"",
            "generations = 4000000000",
        ),
    ];
    for (from, to, expected) in hostile {
        assert!(good.contains(from), "{from}");
        sandbox.write("run/run.json", good.replace(from, to));
        for command in [
            "eval",
            "audit",
            "response",
            "report",
            "replay -r best",
            "serve --no-open",
        ] {
            let archive = if command == "report" {
                "run/run.json"
            } else {
                "-a run/run.json"
            };
            sandbox
                .run(&format!("{command} {archive}"))
                .ended(3, &["run/run.json", expected]);
        }
        let assignment = format!(
            "{}={}",
            expected.split(' ').next().unwrap(),
            to.rsplit(':').next().unwrap()
        );
        if !assignment.starts_with("generations") {
            sandbox
                .run(&format!("evolve -c tiny.toml -o new --set {assignment}"))
                .ended(3, &[expected]);
        }
    }
    sandbox.write(
        "run/run.json",
        good.replace("\"cycle_steps\":50", "\"cycle_steps\":100000"),
    );
    sandbox
        .run("eval -a run/run.json --cycles 11")
        .ended(2, &["--cycles 11: "]);
    sandbox.write(
        "run/run.json",
        good.replace("\"control_steps\":20", "\"control_steps\":1000000"),
    );
    for command in [
        "plot spacetime -a run/run.json",
        "replay -r best -a run/run.json",
        "report run/run.json",
    ] {
        let expected = "protocol.control_steps = 1000000";
        sandbox.run(command).ended(3, &[expected]);
    }
    sandbox.write("run/run.json", &good);
    sandbox
        .run("eval -q -a run/run.json --images 40 --cycles 1")
        .ended(0, &[]);
    let report = sandbox.read("run/eval.json");
    let wide = report.replace(
        "\"body\":{\"height\":5,\"width\":5",
        "\"body\":{\"height\":5,\"width\":4000000000",
    );
    assert_ne!(report, wide);
    sandbox.write("run/eval.json", wide);
    sandbox
        .run("capacity --eval run/eval.json")
        .ended(3, &["run/eval.json: setting: body.width = 4000000000"]);
    let scenario = |keys: &str| sandbox.write("a.json", format!("{{\"body\": [[3]], {keys}}}"));
    scenario("\"physics\": {\"blow_up_extent\": 1e10, \"time_step\": 0.5}, \"control_steps\": 2");
    sandbox
        .run("simulate a.json")
        .ended(3, &["a.json: physics.blow_up_extent"]);
    scenario("\"physics\": {\"substeps\": 4000000000}");
    sandbox
        .run("simulate a.json")
        .ended(3, &["a.json: physics.substeps"]);
}
