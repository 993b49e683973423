//! Where the system has no thread left: every command says so, and none panics.
#![cfg(target_os = "linux")]

use crate::common::program::{PROGRAM, SETTINGS, Said, Sandbox, said};

/// Runs the program under limits of `prlimit`. That of processes and threads does not bind root: there
/// it runs as another user.
fn limited(sandbox: &Sandbox, limits: &str, args: &str) -> Said {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let program = sandbox.path("morphcog");
    if !program.exists() {
        std::fs::copy(PROGRAM, &program).unwrap();
        std::fs::set_permissions(sandbox.path("."), PermissionsExt::from_mode(0o777)).unwrap();
    }
    let is_root = std::fs::metadata("/proc/self").unwrap().uid() == 0;
    let nobody = format!("--reuid={}", 20_000 + std::process::id() % 40_000);
    let as_another = ["setpriv", &nobody, "--clear-groups"];
    let words = as_another
        .into_iter()
        .filter(|_| is_root)
        .chain(["prlimit"])
        .chain(limits.split(' '));
    let words: Vec<&str> = words.chain(["./morphcog"]).chain(args.split(' ')).collect();
    let mut command = std::process::Command::new(words[0]);
    SETTINGS
        .iter()
        .for_each(|name| _ = command.env_remove(name));
    command
        .current_dir(sandbox.path("."))
        .args(&words[1..])
        .env("RAYON_NUM_THREADS", "2");
    said(command)
}

#[test]
fn where_the_system_has_no_thread_left_every_command_says_so_and_none_panics() {
    let sandbox = Sandbox::tiny();
    sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    sandbox
        .run("eval -q -a run --images 40 --cycles 1 --robots top:2")
        .ended(0, &[]);
    sandbox.write("plan.toml", "config = \"tiny.toml\"\nseeds = [1, 2]\n");
    sandbox.write(
        "scenario.json",
        "{\"body\": [[3, 4]], \"control_steps\": 20}",
    );
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
        (
            "train -a gallery:gaits-6 -t 0|1 --set data.dataset=builtin -o trained",
            true,
        ),
        ("demo -o demo", true),
        ("eval -a run --images 4 --cycles 1 --robots top:2", true),
        ("audit -a run --robots top:1", true),
        ("response -a run --robots all --images 60", true),
        ("capacity --eval run/eval.json --set trainings=1", true),
        ("sweep plan.toml -o sweep", true),
        ("serve --no-open", true),
        ("report run --rollouts 1", true),
        ("replay -a run -r best --format gif --every 20", true),
        ("replay -a run -r best --format html", false),
        ("plot body -a run", false),
        ("simulate scenario.json -o rollout.csv", false),
        ("data info builtin", false),
        ("bench --json", false),
    ] {
        let said = limited(&sandbox, "--nproc=1", args);
        match needs_threads {
            true => drop(said.ended(1, &[none_left])),
            false => {
                let said = said.ended(0, &[]);
                // Speed is measured in processor time.
                if args.starts_with("bench") {
                    let clocks: Vec<_> = said
                        .json_lines()
                        .iter()
                        .map(|line| line["clock"].clone())
                        .collect();
                    let is_right =
                        clocks.len() >= 5 && clocks.iter().all(|clock| clock == "processor");
                    assert!(is_right, "{clocks:?}");
                }
            }
        }
        // Some are there, but not enough.
        for most in [2, 3].into_iter().filter(|_| needs_threads) {
            let said = limited(&sandbox, &format!("--nproc={most}"), args);
            assert!(matches!(said.code, Some(0 | 1)), "{args}: {said:?}");
            assert!(
                said.code == Some(0) || said.err.contains(none_left),
                "{args}: {said:?}"
            );
        }
    }
    // Where the address space has no room for more, pictures need none.
    let gif = "replay -a run -r best --format gif --every 20 -o run/small.gif";
    limited(&sandbox, "--nproc=1 --as=90000000", gif).ended(0, &[]);
    // Nothing was half begun.
    assert!(
        std::fs::read_to_string(sandbox.path("new/.lock"))
            .unwrap_or_default()
            .is_empty()
    );
}
