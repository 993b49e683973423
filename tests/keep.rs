//! Who is let into the archive of a stage, and who stays.

mod common;

use common::program::{Sandbox, TINY, staged};
use morphcog::run::archive::Robot;
use std::collections::BTreeSet;

fn elites(sandbox: &Sandbox, name: &str, text: &str, options: &str) -> Vec<Robot> {
    sandbox.write("run.toml", text);
    sandbox.run(&format!("evolve -q -c run.toml -o {name} {options}")).ended(0, &[]);
    sandbox.run_file(name).elites
}

#[test]
fn a_stage_starts_with_the_fittest_it_keeps_on_its_own_images() {
    let sandbox = Sandbox::new();
    // Nobody is born in the third stage's first generation: no parents, and a newcomer that can be told by its age.
    let lonely = |text: String| text.replace("parents = 8", "parents = 0\nnewcomers = 1");
    let all = elites(&sandbox, "all", &lonely(staged()).replace("keep = 4", ""), "-g 8");
    let mut kept = elites(&sandbox, "kept", &lonely(staged()).replace("keep = 4", "keep = 2"), "-g 8");
    let mut fittest: Vec<Robot> = all.into_iter().filter(|robot| robot.generation < 7).collect();
    fittest.sort_by(|a, b| b.objective.total_cmp(&a.objective));
    fittest.truncate(2);
    kept.retain(|robot| robot.generation < 7);
    kept.sort_by(|a, b| b.objective.total_cmp(&a.objective));
    assert_eq!(kept, fittest);
}

#[test]
fn a_stage_starts_with_the_fittest_of_the_stage_before_and_no_others() {
    let sandbox = Sandbox::new();
    // Nobody is born in the third stage's first generation: no parents, and a newcomer that can be told by its age.
    let lonely = staged().replace("parents = 8", "parents = 0\nnewcomers = 1").replace("keep = 4", "");
    let mut before = elites(&sandbox, "before", &lonely, "-g 7");
    let all = elites(&sandbox, "all", &lonely, "-g 8");
    let few = elites(&sandbox, "few", &lonely.replace("pool = 9", "pool = 9\nstart_with = 2"), "-g 8");
    before.sort_by(|a, b| b.objective.total_cmp(&a.objective));
    let ids = |robots: &[Robot]| {
        let old = robots.iter().filter(|robot| robot.generation < 7);
        old.map(|robot| robot.id.clone()).collect::<BTreeSet<String>>()
    };
    let (fittest, of_all) = (ids(&before[..2]), ids(&all));
    assert_eq!(ids(&few), of_all.intersection(&fittest).cloned().collect());
    assert!(of_all.len() > 2 && !ids(&few).is_empty(), "{of_all:?}");
}

#[test]
fn a_stage_lets_in_only_offspring_that_exceed_its_threshold() {
    let sandbox = Sandbox::new();
    // Long enough lives for robots to differ.
    let base = TINY
        .replace("control_steps = 20", "control_steps = 60")
        .replace("generations = 12", "generations = 9");
    let stages = |second: &str| {
        let fitness = "images_per_class = 6\nfitness = \"mean_clipped\"";
        format!("{base}\n[[stage]]\ngenerations = 4\n{fitness}\n[[stage]]\n{fitness}\n{second}")
    };
    let open = elites(&sandbox, "open", &stages(""), "");
    let born = |robots: &[Robot]| -> Vec<Robot> {
        robots.iter().filter(|robot| robot.generation >= 4).cloned().collect()
    };
    let mut told: Vec<f64> = born(&open).iter().map(|robot| robot.objective).collect();
    told.sort_by(f64::total_cmp);
    let least = told[told.len() / 2];
    assert!(told[0] < least, "{told:?}");
    for more in ["", "race = true\nvoxel_mutations = 0.5\nvoxel_relatives = 3\n"] {
        let text = stages(&format!("threshold_min = {least:?}\n{more}"));
        let few = elites(&sandbox, "few", &text, "--force");
        let ids =
            |robots: &[Robot]| robots.iter().map(|robot| robot.id.clone()).collect::<BTreeSet<String>>();
        // Elites of before stay, however fit, but where somebody who exceeds the threshold is fitter.
        assert!(few.iter().all(|robot| robot.generation < 4 || robot.objective > least), "{more}");
        let before: Vec<Robot> = elites(&sandbox, "before", &text, "--force -g 4");
        let cells: BTreeSet<_> = before.iter().map(|robot| &robot.cell).collect();
        assert!(before.iter().filter(|robot| ids(&few).contains(&robot.id)).count() > 0);
        assert!(cells.iter().all(|cell| few.iter().any(|robot| robot.cell == **cell)), "{more}");
        assert!(!born(&few).is_empty(), "{more}");
        // What it saves is lossless, and a stopped run goes on to the same.
        let savings = "savings.known_bodies savings.shared_lives savings.early_stop";
        let off: String = savings.split(' ').map(|key| format!(" --set {key}=false")).collect();
        assert_eq!(elites(&sandbox, "other", &text, &format!("--force{off}")), few, "{more}");
        assert_eq!(elites(&sandbox, "other", &text, "--force --threads 3"), few, "{more}");
        elites(&sandbox, "other", &text, "--force -g 7");
        assert_eq!(elites(&sandbox, "other", &text, "--resume"), few, "{more}");
    }
    // Nobody can: an archive stays empty, or is that of before.
    sandbox.write("run.toml", format!("{base}\n[[stage]]\nthreshold_min = 1000000\n"));
    let said = sandbox.run("evolve -c run.toml -o empty").ended(0, &["the archive is empty"]);
    assert!(!said.err.contains("next:"), "{}", said.err);
    let nobody = elites(&sandbox, "nobody", &stages("threshold_min = 1"), "");
    assert!(nobody.iter().all(|robot| robot.generation < 4) && !nobody.is_empty());
}

#[test]
fn a_run_that_lets_nobody_in_says_so_and_chooses_nobody_at_its_end() {
    let sandbox = Sandbox::new();
    let stage = "\n[[stage]]\nthreshold_min = 1000000\n[validation]\nbest = 1\n";
    sandbox.write("run.toml", format!("{TINY}{stage}"));
    for _ in 0..2 {
        sandbox.run("evolve -c run.toml -o run --resume").ended(0, &["the archive is empty"]);
    }
    assert!(!sandbox.path("run/validation.json").exists());
}
