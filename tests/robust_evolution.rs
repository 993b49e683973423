//! `robust = true`, in `[evaluation]` or a stage: the worst life counts, savings are lossless, and without it nothing is
//! different.

mod common;

use common::program::{Sandbox, TINY};
use morphcog::run::archive::{Robot, RunFile};
use morphcog::run::audit_file::AuditFile;
use morphcog::task::grouping::Group::{A, B};
use morphcog::task::score::two_group_fitness;

fn evolved(sandbox: &Sandbox, out: &str, more: &str) -> RunFile {
    sandbox.write("tiny.toml", TINY.replace("control_steps = 20", "control_steps = 60"));
    sandbox.run(&format!("evolve --config tiny.toml --generations 25 --out {out} {more}")).ended(0, &[]);
    sandbox.run_file(out)
}

#[test]
fn robust_fitness_is_that_of_the_worst_life() {
    let sandbox = Sandbox::new();
    let run = evolved(&sandbox, "run", "--set evaluation.robust=true");
    let audit = "audit --archive run/run.json --set threshold=0 --set perturbations.raised=[1] --set perturbations.share=0.05";
    sandbox.run(audit).ended(0, &[]);
    let audit = AuditFile::read(&sandbox.path("run/audit.json")).unwrap();
    let fitness = |d: &[f64]| two_group_fitness(&[(A, d[0]), (B, d[1])]);
    let (mut compared, mut lowered) = (0, 0);
    for robot in &run.elites {
        let found = audit.robot(&robot.id).unwrap();
        let lives =
            found.lives.iter().filter(|l| ["start raised by 1", "stiffness -5 %"].contains(&l.name.as_str()));
        let lives: Vec<f64> = lives.map(|life| fitness(life.displacements.as_ref().unwrap())).collect();
        if let [raised, softer] = lives.as_slice() {
            let plain = fitness(&robot.displacements);
            assert_eq!(robot.objective, plain.min(*raised).min(*softer), "{}", robot.id);
            compared += 1;
            lowered += usize::from(robot.objective < plain);
        }
    }
    assert!(compared >= 2 && lowered >= 1, "{compared} compared, {lowered} lowered");
}

#[test]
fn savings_change_no_robust_archive_and_threads_do_not_either() {
    let sandbox = Sandbox::new();
    let on = "--set evaluation.robust=true";
    let run = evolved(&sandbox, "run", &format!("{on} --threads 1"));
    let off =
        "--set savings.early_stop=false --set savings.known_bodies=false --set savings.shared_lives=false";
    assert_eq!(evolved(&sandbox, "slow", &format!("{on} {off} --threads 3")).elites, run.elites);
    // Resumed, it ends with the same bytes.
    let args = format!("evolve --config tiny.toml --out again {on}");
    sandbox.run(&format!("{args} --generations 9")).ended(0, &[]);
    sandbox.run(&format!("{args} --generations 25 --resume")).ended(0, &[]);
    assert_eq!(sandbox.read("again/run.json"), sandbox.read("run/run.json"));
}

#[test]
fn without_it_nothing_is_different() {
    let sandbox = Sandbox::new();
    let plain = evolved(&sandbox, "plain", "");
    let off = evolved(&sandbox, "off", "--set evaluation.robust=false");
    assert_eq!(plain, off);
    assert!(!sandbox.read("plain/run.json").contains("robust"), "no key that was not there before");
    let robust = evolved(&sandbox, "robust", "--set evaluation.robust=true");
    assert!(sandbox.read("robust/config.toml").contains("robust = true"));
    assert_ne!(robust.elites, plain.elites);
    sandbox.run("evolve --config tiny.toml --out x --set evaluation.robust=1").ended(2, &["robust"]);
}

#[test]
fn a_stage_may_be_robust_by_itself() {
    let sandbox = Sandbox::new();
    let tiny = TINY.replace("control_steps = 20", "control_steps = 60");
    let run = |out: &str, stages: &str| {
        sandbox.write(&format!("{out}.toml"), format!("{tiny}\n{stages}"));
        sandbox.run(&format!("evolve --config {out}.toml --generations 20 --out {out}")).ended(0, &[]);
        sandbox.run_file(out)
    };
    let (first, last) = ("[[stage]]\ngenerations = 12", "[[stage]]");
    let plain = run("plain", &format!("{first}\n{last}"));
    let robust = run("robust", &format!("{first}\n{last}\nrobust = true"));
    assert_ne!(robust.elites, plain.elites);
    // The elites of the first stage, too, are as fit as in the worst of their lives.
    let plain_life =
        |robot: &Robot| two_group_fitness(&[(A, robot.displacements[0]), (B, robot.displacements[1])]);
    let stayed = robust.elites.iter().filter(|robot| plain.elites.iter().any(|other| other.id == robot.id));
    assert!(stayed.clone().any(|robot| robot.objective < plain_life(robot)), "{} stayed", stayed.count());
    // Or do without.
    let off = "robust = false";
    let off = run("off", &format!("[evaluation]\nrobust = true\n{first}\n{off}\n{last}\n{off}"));
    assert_eq!(off.elites, plain.elites);
}
