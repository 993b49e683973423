//! Same bits: a run depends on config and seed only, not on the number of threads or the
//! instruction set.

use crate::common::program::{Said, Sandbox, TINY, said, without_seconds};
use morphcog::sim::InstructionSet;

/// Configs that differ in what could depend on timing: kind of rollout, tasks, images per class.
fn configs() -> Vec<(&'static str, String)> {
    let splits = TINY
        .replace("groups = [[0], [1]]", "splits = [0, 1, 2]\nsame_way_bin = true")
        .replace("train_images = [0, 1]", "train_images = [0, 1, 2]");
    let sequential = "rollout = \"sequential\"";
    let drawn = "images_per_class = 3";
    vec![
        ("fresh", TINY.to_string()),
        ("sequential", TINY.replace("rollout = \"fresh\"", sequential)),
        ("many", TINY.replace("train_images = [0, 1]", drawn).replace("[[0], [1]]", "[[0, 4], [1]]")),
        ("splits", splits.clone()),
        ("splits-sequential", splits.replace("rollout = \"fresh\"", sequential)),
        (
            "no-savings",
            format!("{TINY}\n[savings]\nknown_bodies = false\nearly_stop = false\nshared_rollouts = false\n"),
        ),
    ]
}

#[test]
fn a_run_has_the_same_bytes_on_any_number_of_threads() {
    for (name, config) in configs() {
        let sandbox = Sandbox::new();
        sandbox.write("run.toml", config);
        let result = |threads: u32| {
            let out = format!("threads-{threads}");
            sandbox.run(&format!("evolve -q -c run.toml -o {out} --threads {threads}")).ended(0, &[]);
            let metrics = without_seconds(&sandbox.read(&format!("{out}/metrics.csv")));
            (sandbox.read(&format!("{out}/run.json")), metrics)
        };
        let one = result(1);
        for threads in [2, 3, 7] {
            assert_eq!(result(threads), one, "{name} on {threads} threads");
        }
    }
}

/// Runs the program under limits of `prlimit`. That of processes and threads does not bind root: there
/// it runs as another user.
#[cfg(target_os = "linux")]
fn limited(sandbox: &Sandbox, limits: &str, args: &str) -> Said {
    use crate::common::program::{PROGRAM, SETTINGS};
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let program = sandbox.path("morphcog");
    if !program.exists() {
        std::fs::copy(PROGRAM, &program).unwrap();
        std::fs::set_permissions(sandbox.path("."), PermissionsExt::from_mode(0o777)).unwrap();
    }
    let is_root = std::fs::metadata("/proc/self").unwrap().uid() == 0;
    let nobody = format!("--reuid={}", 20_000 + std::process::id() % 40_000);
    let as_another = ["setpriv", &nobody, "--clear-groups"];
    let words = as_another.into_iter().filter(|_| is_root).chain(["prlimit"]).chain(limits.split(' '));
    let words: Vec<&str> = words.chain(["./morphcog"]).chain(args.split(' ')).collect();
    let mut command = std::process::Command::new(words[0]);
    SETTINGS.iter().for_each(|name| _ = command.env_remove(name));
    command.current_dir(sandbox.path(".")).args(&words[1..]).env("RAYON_NUM_THREADS", "2");
    said(command)
}

#[cfg(target_os = "linux")]
#[test]
fn where_the_system_has_no_thread_left_every_command_says_so_and_none_panics() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    sandbox.run("eval -q -a run --images 40 --cycles 1 --robots top:2").ended(0, &[]);
    sandbox.write("plan.toml", "config = \"tiny.toml\"\nseeds = [1, 2]\n");
    sandbox.write("scenario.json", "{\"body\": [[3, 4]], \"control_steps\": 20}");
    let open = |path: &str| {
        for entry in std::fs::read_dir(sandbox.path(path)).unwrap() {
            let all = std::os::unix::fs::PermissionsExt::from_mode(0o777);
            std::fs::set_permissions(entry.unwrap().path(), all).unwrap();
        }
    };
    open(".");
    open("run");
    let none_left = "a thread cannot be started";
    for (args, needs_threads) in [
        ("evolve -c tiny.toml -o new", true),
        ("train -a gallery:gaits -t 0|1 --set data.dataset=builtin -o trained", true),
        ("demo -o demo", true),
        ("eval -a run --images 4 --cycles 1 --robots top:2", true),
        ("audit -a run --robots top:1", true),
        ("response -a run --robots all --images 60", true),
        ("capacity --eval run/eval.json --set trainings=1", true),
        ("sweep plan.toml -o sweep", true),
        ("serve --no-open", true),
        ("report run --rollouts 1", true),
        ("replay -a run -r best --format gif", true),
        ("replay -a run -r best --format html", false),
        ("plot body -a run", false),
        ("simulate scenario.json -o rollout.csv", false),
        ("data info builtin", false),
        ("bench", false),
    ] {
        let said = limited(&sandbox, "--nproc=1", args);
        match needs_threads {
            true => drop(said.ended(1, &[none_left, "hint:"])),
            false => drop(said.ended(0, &[])),
        }
        // Some are there, but not enough.
        for most in [2, 3].into_iter().filter(|_| needs_threads) {
            let said = limited(&sandbox, &format!("--nproc={most}"), args);
            assert!(matches!(said.code, Some(0 | 1)), "{args}: {said:?}");
            assert!(said.code == Some(0) || said.err.contains(none_left), "{args}: {said:?}");
        }
    }
    // Where the address space has no room for more, pictures need none.
    let gif = "replay -a run -r best --format gif -o run/small.gif";
    limited(&sandbox, "--nproc=1 --as=90000000", gif).ended(0, &[]);
    // Nothing was half begun.
    assert!(std::fs::read_to_string(sandbox.path("new/.lock")).unwrap_or_default().is_empty());
}

#[test]
fn a_run_has_the_same_bytes_on_every_instruction_set() {
    let sets: Vec<_> = InstructionSet::ALL.into_iter().filter(|set| set.is_available()).collect();
    println!("instruction sets of this machine: {sets:?}");
    for (name, config) in configs() {
        let sandbox = Sandbox::new();
        sandbox.write("run.toml", config);
        let result = |set: InstructionSet| {
            let mut command = sandbox.command(["evolve", "-q", "-c", "run.toml", "-o", set.name()]);
            command.env("MORPHCOG_ISA", set.name());
            said(command).ended(0, &[]);
            sandbox.read(&format!("{}/run.json", set.name()))
        };
        let first = result(sets[0]);
        for &set in &sets[1..] {
            assert_eq!(result(set), first, "{name} on {set:?}");
        }
    }
}

#[test]
fn another_seed_makes_another_run_and_the_same_seed_the_same() {
    let sandbox = Sandbox::tiny();
    let result = |seed: u32, out: &str| {
        sandbox.run(&format!("evolve -q -c tiny.toml --seed {seed} -o {out}")).ended(0, &[]);
        sandbox.run_file(out).elites
    };
    let first = result(1, "a");
    assert_eq!(result(1, "b"), first);
    assert_ne!(result(2, "c"), first);
}

#[test]
fn an_evaluation_has_the_same_bytes_on_any_number_of_threads() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    let result = |threads: u32| {
        let eval = format!("eval -q -a run/run.json -n 20 --cycles 1 --robots random:4 --threads {threads}");
        let said = sandbox.run(&eval).ended(0, &[]);
        (said.out, sandbox.read("run/eval.json"), sandbox.read("run/eval.csv"))
    };
    let one = result(1);
    assert!([2, 5].iter().all(|&threads| result(threads) == one));
}
