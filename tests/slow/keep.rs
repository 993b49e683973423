//! What stays in an archive that keeps only the fittest.

use crate::common::program::{Sandbox, TINY, gaits};
use morphcog::store::run::Robot;

fn elites(sandbox: &Sandbox, name: &str, text: &str, options: &str) -> Vec<Robot> {
    sandbox.write("run.toml", text);
    sandbox.run(&format!("evolve -q -c run.toml -o {name} {options}")).ended(0, &[]);
    sandbox.run_file(name).elites
}

#[test]
fn only_so_many_of_the_fittest_stay_and_savings_and_stops_change_nothing() {
    let sandbox = Sandbox::new();
    for text in [gaits(), format!("{TINY}\n[archive]\nkeep = 6\n")] {
        let kept = elites(&sandbox, "kept", &text, "--force");
        assert_eq!(kept.len(), 6);
        let all = elites(&sandbox, "all", &text.replace("keep = 6", ""), "--force -g 1");
        let first = elites(&sandbox, "first", &text, "--force -g 1");
        let mut fittest = all.clone();
        fittest.sort_by(|a, b| b.objective.total_cmp(&a.objective));
        fittest.truncate(6);
        let mut first_of_all = first.clone();
        first_of_all.sort_by(|a, b| b.objective.total_cmp(&a.objective));
        assert!(all.len() > 6 || all.len() == first.len());
        assert_eq!(first_of_all, fittest);
        let savings = "savings.known_bodies savings.shared_rollouts savings.early_stop";
        let off: String = savings.split(' ').map(|key| format!(" --set {key}=false")).collect();
        if !text.contains("response") {
            assert_eq!(elites(&sandbox, "other", &text, &format!("--force{off}")), kept);
        }
        assert_eq!(elites(&sandbox, "other", &text, "--force --threads 3"), kept);
        elites(&sandbox, "other", &text, "--force -g 7");
        assert_eq!(elites(&sandbox, "other", &text, "--resume"), kept);
    }
}
