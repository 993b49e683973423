use super::*;
use crate::base::Grid;
use crate::base::stop::NEVER;
use crate::config::BUILT_IN;
use crate::sim::Physics;
use crate::store::audit::Verdict;
use crate::store::images::{DatasetRef, ImageRef};
use crate::task::protocol::{Life, Protocol};

/// Two images, of classes 0 and 1, the first dark and the second bright, each in a fresh life of five cycles.
fn trial(height: usize, width: usize, physics: Physics) -> Trial {
    let set = ["task={splits=[0,1],same_way_bin=true}", "protocol.control_steps=250"].map(str::to_string);
    let mut config = Config::parse(BUILT_IN[0].1, BUILT_IN[0].0, &set).unwrap();
    config.physics = physics;
    let criteria = Criteria::default();
    let dataset = DatasetRef { name: "none".to_string(), train_sha256: String::new() };
    let images = [0, 1].map(|label| ImageRef { index: usize::from(label), label }).to_vec();
    let stimuli = [0.0, 1.0].map(|pixel| Grid::filled(height, width, pixel)).to_vec();
    Trial {
        grouping: config.grouping().unwrap(),
        training: Training { dataset, images, stimuli, conditions: Vec::new() },
        criteria,
        config,
    }
}

fn audited(body: &str, task: &str, physics: Physics) -> RobotAudit {
    let body: Body = body.parse().unwrap();
    let trial = trial(body.height(), body.width(), physics);
    let subject = Subject { id: "x".to_string(), task: task.to_string(), body, known: None };
    trial.robot(&subject, &AtomicBool::new(false), &AtomicU64::new(0), &()).unwrap()
}

/// Muscles of one phase above, of the other below, a soft front and a rigid foot: it walks to the right.
const WALKER: &str = "444422/444422/333311/330011";

#[test]
fn a_symmetric_passive_block_is_not_a_walker() {
    for task in ["same way", "0|1"] {
        let found = audited("1221/1221", task, Physics::default());
        assert_eq!(found.verdict, Verdict::NotAWalker, "{found:?}");
        assert!(found.reason.contains("the right way for 0"), "{}", found.reason);
        assert!(found.lives.is_empty() && found.energy_per_cycle.drive == 0.0);
    }
}

#[test]
fn a_plain_walker_is_physical() {
    let found = audited(WALKER, "same way", Physics::default());
    assert_eq!(found.verdict, Verdict::Physical, "{found:#?}");
    assert_eq!((found.persisting, found.lives.len()), (1.0, 14));
    assert!(found.displacements.unwrap().iter().all(|d| *d > 5.0));
    assert!(found.spread < 1.0 && found.energy_per_cycle.drive > 0.0);
    // It sees nothing, so that it cannot tell classes apart.
    assert_eq!(audited(WALKER, "0|1", Physics::default()).verdict, Verdict::NotAWalker);
}

#[test]
fn a_stopped_audit_has_no_verdict() {
    let body: Body = WALKER.parse().unwrap();
    let trial = trial(body.height(), body.width(), Physics::default());
    let subject = Subject { id: "x".to_string(), task: "same way".to_string(), body, known: None };
    assert!(trial.robot(&subject, &AtomicBool::new(true), &AtomicU64::new(0), &()).is_none());
}

#[test]
fn images_that_are_the_same_to_the_sensors_are_one_life_with_the_same_end() {
    // Its one sensor sees the top right pixel; the images differ elsewhere, too.
    let body: Body = "444425/444422/333311/330011".parse().unwrap();
    let image =
        |sensed: f64, other: f64| Grid::from_fn(4, 6, |r, c| if (r, c) == (0, 5) { sensed } else { other });
    let stimuli = vec![image(0.0, 0.0), image(1.0, 0.0), image(0.0, 1.0), image(1.0, 1.0), image(0.0, 0.5)];
    let Trial { config, .. } = trial(4, 6, Physics::default());
    let setting = Setting { body, physics: config.physics, protocol: config.protocol, stimuli };
    let (displacements, _) = live(&setting, false, &NEVER).unwrap().unwrap();
    let (all, _) = live(&setting, true, &NEVER).unwrap().unwrap();
    assert_eq!(displacements, all);
    assert_ne!(all[0], all[1], "it sees something");
    let sequential =
        Setting { protocol: Protocol { life: Life::Sequential, ..setting.protocol.clone() }, ..setting };
    let (displacements, _) = live(&sequential, false, &NEVER).unwrap().unwrap();
    assert_eq!(displacements.len(), 5);
    assert_ne!(displacements[0], displacements[2], "what comes later begins elsewhere");
}

#[test]
fn verdicts_that_another_audit_wrote_meanwhile_stay() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(AUDIT_JSON);
    let file = |sha: &str, ids: &[&str]| {
        let robot = |id: &&str| RobotAudit { id: id.to_string(), ..audited("1", "0|1", Physics::default()) };
        let robots = ids.iter().map(robot).collect();
        AuditFile { robots, ..AuditFile::new("run", sha.to_string(), 3, &Criteria::default()) }
    };
    let ids = |file: &AuditFile| file.robots.iter().map(|robot| robot.id.clone()).collect::<Vec<_>>();
    let mut ours = file("a", &["x", "y"]);
    ours.add_known(&path);
    assert_eq!(ids(&ours), ["x", "y"]);
    file("a", &["y", "z"]).write(&path).unwrap();
    ours.add_known(&path);
    assert_eq!(ids(&ours), ["x", "y", "z"]);
    // Of another state of the run.
    let mut other = file("b", &["x"]);
    other.add_known(&path);
    assert_eq!(ids(&other), ["x"]);
}
