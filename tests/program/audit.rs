//! Verdicts: deterministic, resumable, never stale; and `--physical-only` means what it says.

use crate::common::program::{Made, Sandbox, TINY};
use morphcog::base::observer::{Observer, Work};
use morphcog::base::session::Session;
use morphcog::commands::audit::AuditOptions;
use morphcog::robots::selection::Selection;
use morphcog::store::audit::AuditFile;
use morphcog::store::audit::Verdict;
use std::collections::BTreeSet;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// What tiny robots in short rollouts can be held to, so that some are physical and some are not.
const MILD: &str = "--set threshold=0 --set least_walk=0 --set least_kept=0.5 --set least_distance=0 --set \
 perturbations.time_step=[2] --set perturbations.start=[] --set perturbations.least_sensors=1";

/// [`TINY`] with rollouts of three cycles, and few robots.
fn config() -> String {
    let config = TINY.replace("control_steps = 20", "control_steps = 150");
    format!("{config}\n[archive]\nkeep = 8\n[validation]\nimages = 40\n")
}

/// A sandbox with a run of it in `run`.
fn evolved() -> Sandbox {
    static RUN: OnceLock<Made> = OnceLock::new();
    Sandbox::once(&RUN, |sandbox| {
        sandbox.write("tiny.toml", config());
        sandbox
            .run("evolve --config tiny.toml --out run --generations 40")
            .ended(0, &[]);
    })
}

/// The same with verdicts on all of its robots, made on one thread.
fn audited() -> Sandbox {
    static VERDICTS: OnceLock<Made> = OnceLock::new();
    Sandbox::once(&VERDICTS, |sandbox| {
        sandbox.write("tiny.toml", config());
        sandbox
            .run("evolve --config tiny.toml --out run --generations 40")
            .ended(0, &[]);
        audit(sandbox, "--threads 1");
    })
}

fn written(sandbox: &Sandbox) -> [String; 2] {
    [
        sandbox.read("run/audit.json"),
        sandbox.read("run/audit.csv"),
    ]
}

fn audit(sandbox: &Sandbox, more: &str) {
    sandbox
        .run(&format!("audit --archive run/run.json {MILD} {more}"))
        .ended(0, &[]);
}

fn verdicts(sandbox: &Sandbox) -> AuditFile {
    AuditFile::read(&sandbox.path("run/audit.json")).unwrap()
}

#[test]
fn verdicts_are_the_same_bytes_on_any_number_of_threads_and_however_often_it_was_stopped() {
    let sandbox = audited();
    let alone = written(&sandbox);
    std::fs::remove_file(sandbox.path("run/audit.json")).unwrap();
    audit(&sandbox, "--threads 3 --robots top:2");
    assert_eq!(verdicts(&sandbox).robots.len(), 2);
    audit(&sandbox, "--threads 3 --robots random:3");
    audit(&sandbox, "--threads 2");
    assert_eq!(written(&sandbox), alone);
    let file = verdicts(&sandbox);
    let run = sandbox.run_file("run");
    let ids = |ids: Vec<&String>| ids.into_iter().cloned().collect::<Vec<_>>();
    assert_eq!(
        ids(file.robots.iter().map(|r| &r.id).collect()),
        ids(run.elites.iter().map(|r| &r.id).collect())
    );
    for (robot, elite) in file.robots.iter().zip(&run.elites) {
        assert_eq!(
            robot.displacements.as_ref(),
            Some(&elite.displacements),
            "its rollout in its own run"
        );
        assert_eq!(
            robot.rollouts.is_empty(),
            robot.verdict == Verdict::NotAWalker
        );
        assert!(
            robot.rollouts.iter().all(|rollout| rollout.persists)
                || robot.verdict != Verdict::Physical
        );
    }
    // Other criteria are another audit, which does not replace the one there is.
    let other = "audit --archive run/run.json --set threshold=1000";
    sandbox.run(other).ended(3, &["run/audit.json", "--out"]);
    std::fs::remove_file(sandbox.path("run/audit.json")).unwrap();
    sandbox.run(other).ended(0, &[]);
    let robots = verdicts(&sandbox).robots;
    assert_eq!(robots.len(), run.elites.len());
    assert!(
        robots
            .iter()
            .all(|robot| robot.verdict == Verdict::NotAWalker)
    );
}

#[test]
fn robots_of_several_runs_are_audited_each_with_its_run_and_a_wrong_id_before_any() {
    let sandbox = evolved();
    sandbox
        .run("evolve --config tiny.toml --out other --generations 5 --seed 9")
        .ended(0, &[]);
    let best = |run: &str| sandbox.run_file(run).best().unwrap().id.clone();
    let both = "audit --archive run/run.json --archive other/run.json";
    let wrong = format!(
        "{both} {MILD} --robots {},{},nobody",
        best("run"),
        best("other")
    );
    sandbox.run(&wrong).ended(3, &["nobody"]);
    assert!(!sandbox.path("run/audit.json").exists() && !sandbox.path("other/audit.json").exists());
    sandbox
        .run(&format!(
            "{both} {MILD} --robots {},{}",
            best("run"),
            best("other")
        ))
        .ended(0, &[]);
    for run in ["run", "other"] {
        let file = AuditFile::read(&sandbox.path(&format!("{run}/audit.json"))).unwrap();
        assert_eq!(
            file.robots
                .iter()
                .map(|robot| &robot.id)
                .collect::<Vec<_>>(),
            [&best(run)]
        );
    }
    // Robots of one run only: there is nothing to say of the other.
    std::fs::remove_file(sandbox.path("other/audit.json")).unwrap();
    sandbox
        .run(&format!("{both} {MILD} --robots {}", best("run")))
        .ended(0, &[]);
    assert!(!sandbox.path("other/audit.json").exists());
}

#[test]
fn physical_only_selects_physical_robots_and_nothing_else() {
    let sandbox = audited();
    let file = verdicts(&sandbox);
    let of = |physical: bool| -> BTreeSet<String> {
        let robots = file
            .robots
            .iter()
            .filter(|robot| (robot.verdict == Verdict::Physical) == physical);
        robots.map(|robot| robot.id.clone()).collect()
    };
    let (physical, others) = (of(true), of(false));
    assert!(!physical.is_empty() && !others.is_empty(), "{file:#?}");
    for select in ["all", "random:10", "top:3", "best"] {
        let args = format!(
            "eval --archive run/run.json --images 4 --cycles 1 --select {select} --physical-only"
        );
        sandbox.run(&args).ended(0, &[]);
        let report: serde_json::Value =
            serde_json::from_str(&sandbox.read("run/eval.json")).unwrap();
        let robots = report["robots"].as_array().unwrap();
        let ids: BTreeSet<String> = robots
            .iter()
            .map(|robot| robot["id"].as_str().unwrap().to_string())
            .collect();
        assert!(
            !ids.is_empty() && ids.is_subset(&physical),
            "{select}: {ids:?}"
        );
        assert!(select != "all" || ids == physical);
        assert!(
            report["selected"]
                .as_str()
                .unwrap()
                .ends_with("of those audited as physical")
        );
    }
    // A robot that is named and is not physical is refused, with the reason.
    let other = others.first().unwrap();
    let reason = file.robot(other).unwrap().conclusion();
    sandbox
        .run(&format!(
            "eval --archive run/run.json --images 4 --robots {other} --physical-only"
        ))
        .ended(3, &[other, &reason]);
    sandbox
        .run(&format!(
            "replay --archive run/run.json --robot {other} --physical-only -o x.png"
        ))
        .ended(3, &[other, &reason]);
    sandbox
        .run("replay --archive run/run.json --physical-only -o best.png")
        .ended(0, &[]);
    assert!(sandbox.path("best.png").exists());
    let fittest = sandbox
        .run_file("run")
        .elites
        .into_iter()
        .filter(|robot| physical.contains(&robot.id));
    let fittest = fittest
        .max_by(|a, b| a.objective.total_cmp(&b.objective))
        .unwrap();
    let said = sandbox
        .run("replay --archive run/run.json --physical-only --format html")
        .ended(0, &[]);
    assert!(
        sandbox
            .path(&format!("run/replay-{}.html", fittest.id))
            .exists(),
        "{said:?}"
    );
}

#[test]
fn without_verdicts_on_this_very_archive_nothing_is_drawn() {
    let sandbox = evolved();
    let draw = |sandbox: &Sandbox| {
        sandbox.run(
            "eval --archive run/run.json --images 4 --cycles 1 --select random:10 --physical-only",
        )
    };
    draw(&sandbox).ended(3, &["`morphcog audit --archive run/run.json`"]);
    // Of a part of an archive no fair draw is possible.
    audit(&sandbox, "--robots top:2");
    draw(&sandbox).ended(3, &["run/audit.json", "(2 of"]);
    let sandbox = audited();
    draw(&sandbox).ended(0, &[]);
    // The run goes on: its verdicts are stale.
    sandbox
        .run("evolve --config tiny.toml --out run --generations 45 --resume")
        .ended(0, &[]);
    draw(&sandbox).ended(
        3,
        &["run/audit.json", "`morphcog audit --archive run/run.json`"],
    );
    audit(&sandbox, "");
    draw(&sandbox).ended(0, &[]);
    // Broken files are refused as broken.
    sandbox.write("run/audit.json", "{\"format\": \"morphcog-eval\"}");
    draw(&sandbox).ended(3, &["audit.json", "morphcog-audit"]);
    sandbox.write("run/audit.json", "{");
    draw(&sandbox).ended(3, &["audit.json"]);
}

#[test]
fn the_best_physical_on_validation_needs_no_verdicts_on_those_behind_it() {
    let sandbox = audited();
    let whole = verdicts(&sandbox);
    std::fs::remove_file(sandbox.path("run/audit.json")).unwrap();
    let eval = |options: &str| {
        sandbox.run(&format!(
            "eval --archive run/run.json --images 4 --cycles 1 --robots {options}"
        ))
    };
    let chosen = || -> Vec<String> {
        let report: serde_json::Value =
            serde_json::from_str(&sandbox.read("run/eval.json")).unwrap();
        let robots = report["robots"].as_array().unwrap();
        robots
            .iter()
            .map(|robot| robot["id"].as_str().unwrap().to_string())
            .collect()
    };
    let best = "best-validation:1 --physical-only";
    eval(best).ended(3, &["`morphcog audit --archive run/run.json`"]);
    eval("best-validation:7").ended(0, &[]);
    let ranking = chosen();
    let is_physical = |id: &String| whole.robot(id).unwrap().is_physical();
    let place = ranking
        .iter()
        .position(is_physical)
        .expect("one of the first seven is physical");
    // Verdicts on the first of the ranking only, without that one and with it.
    let known = |count: usize| {
        let mut part = whole.clone();
        part.robots = whole
            .robots
            .iter()
            .filter(|robot| ranking[..count].contains(&robot.id))
            .cloned()
            .collect();
        assert!(part.robots.len() == count && count < whole.robots.len());
        sandbox.write("run/audit.json", part.to_json());
    };
    known(place);
    eval(best).ended(
        3,
        &[
            &ranking[place],
            &format!("--robots best-validation:{}", place + 1),
        ],
    );
    known(place + 1);
    eval(best).ended(0, &[]);
    assert_eq!(chosen(), [ranking[place].clone()]);
    // With verdicts on all it is the same robot.
    sandbox.write("run/audit.json", whole.to_json());
    eval(best).ended(0, &[]);
    assert_eq!(chosen(), [ranking[place].clone()]);
}

#[test]
fn an_audit_says_what_it_found_in_a_table_and_as_json() {
    let sandbox = evolved();
    let said = sandbox
        .run(&format!(
            "audit --archive run/run.json --robots top:3 {MILD}"
        ))
        .ended(0, &[]);
    for robot in verdicts(&sandbox).robots {
        assert!(said.out.contains(&robot.id), "{} in {}", robot.id, said.out);
    }
    assert!(said.out.contains("run/audit.json"), "{}", said.out);
    let said = sandbox
        .run(&format!(
            "--json audit --archive run/run.json --robots top:3 {MILD}"
        ))
        .ended(0, &[]);
    let last = said.json_lines().pop().unwrap();
    assert_eq!(
        (
            last["event"].as_str(),
            last["robots"].as_array().unwrap().len()
        ),
        (Some("audited"), 3)
    );
    assert_eq!(last["robots"][0]["id"], verdict_of_best(&sandbox));
}

fn verdict_of_best(sandbox: &Sandbox) -> serde_json::Value {
    let run = sandbox.run_file("run");
    let best = run
        .elites
        .iter()
        .max_by(|a, b| a.objective.total_cmp(&b.objective))
        .unwrap();
    best.id.clone().into()
}

#[test]
fn what_cannot_be_audited_is_refused_with_what_to_do() {
    let sandbox = evolved();
    let audit = |args: &str| sandbox.run(&format!("audit --archive run/run.json {args}"));
    audit("--set treshold=1").ended(2, &["treshold"]);
    audit("--set perturbations.time_step=[1]").ended(3, &["perturbations.time_step", "2 to 64"]);
    audit("--criteria none.toml").ended(3, &["none.toml"]);
    audit("--robots nobody").ended(3, &["nobody"]);
    // Verdicts that cannot be read may be those of a newer version: they stay.
    sandbox.write("run/audit.json", "{");
    audit("--robots top:1").ended(3, &["run/audit.json"]);
    assert_eq!(sandbox.read("run/audit.json"), "{");
    audit("-o run/run.json").ended(2, &["--out run/run.json"]);
    sandbox.write("own.toml", "threshold = -1\n");
    audit("--criteria own.toml").ended(3, &["threshold"]);
    sandbox
        .run("audit --archive none.json")
        .ended(3, &["none.json"]);
    sandbox
        .run("replay --robot XFJPI --physical-only")
        .ended(3, &["audit --archive gallery:"]);
}

/// Stops an audit when it is half done.
struct Impatient {
    rollouts: AtomicU64,
    stop: AtomicBool,
}

impl Observer for Impatient {
    fn begins(&self, work: &Work) {
        self.rollouts.store(work.total, Ordering::Relaxed);
    }
    fn progress(&self, done: u64) {
        self.stop.fetch_or(
            2 * done > self.rollouts.load(Ordering::Relaxed),
            Ordering::Relaxed,
        );
    }
    fn warning(&self, text: &str) {
        panic!("{text}");
    }
}

#[test]
fn what_a_stopped_audit_was_done_with_is_kept() {
    let sandbox = audited();
    let whole = verdicts(&sandbox);
    std::fs::remove_file(sandbox.path("run/audit.json")).unwrap();
    let impatient = Impatient {
        rollouts: AtomicU64::new(0),
        stop: AtomicBool::new(false),
    };
    let options = AuditOptions {
        archive: sandbox.path("run/run.json"),
        robots: Selection::All,
        seed: 1,
        criteria: whole.criteria.clone(),
        fresh: false,
        out: sandbox.path("run/audit.json"),
    };
    let ended = morphcog::commands::audit::audit(
        &options,
        &Session::new(&impatient.stop, &impatient).threads(Some(1)),
    )
    .unwrap();
    assert!(ended.stopped);
    let kept = verdicts(&sandbox);
    let (some, all) = (kept.robots.len(), whole.robots.len());
    assert!(0 < some && some < all, "{some} of {all}");
    assert!(kept.robots.iter().all(|robot| whole.robots.contains(robot)));
    audit(&sandbox, "");
    assert_eq!(verdicts(&sandbox), whole);
}

#[test]
fn known_verdicts_are_said_to_be_known_and_made_again_only_if_asked_for() {
    let sandbox = evolved();
    audit(&sandbox, "--robots top:3");
    let made = sandbox.read("run/audit.json");
    // As they might have been found in another way.
    let mut verdicts: serde_json::Value = serde_json::from_str(&made).unwrap();
    verdicts["robots"][0]["reason"] = "as it was".into();
    sandbox.write("run/audit.json", verdicts.to_string());
    let said = sandbox
        .run(&format!("audit -a run {MILD} --robots top:3"))
        .ended(0, &["--fresh"]);
    assert!(said.out.contains("as it was"), "{said:?}");
    let said = sandbox
        .run(&format!("audit -a run {MILD} --robots top:4"))
        .ended(0, &["--fresh"]);
    assert!(said.out.contains("as it was"), "{said:?}");
    let said = sandbox
        .run(&format!("audit -a run {MILD} --robots top:3 --fresh"))
        .ended(0, &[]);
    assert!(
        !said.out.contains("as it was") && !said.err.contains("--fresh"),
        "{said:?}"
    );
    // The fourth one's verdict has stayed.
    let now = AuditFile::read(&sandbox.path("run/audit.json")).unwrap();
    let before: AuditFile = serde_json::from_str(&made).unwrap();
    assert_eq!((now.robots.len(), before.robots.len()), (4, 3));
    assert!(
        before
            .robots
            .iter()
            .all(|robot| now.robot(&robot.id) == Some(robot))
    );
}
