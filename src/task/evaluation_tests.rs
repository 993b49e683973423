use super::*;
use crate::base::stop::NEVER;
use crate::body::Material;
use crate::sim::UnstableReason;
use std::collections::BTreeSet;

/// A sensor that expands at both ends: under a bright image it is wider than `Physics::blow_up_extent` here allows.
fn body() -> Body {
    let row = [Material::SensorExpand, Material::Soft, Material::SensorExpand];
    Body::new(Grid::from_fn(1, 3, |_, column| row[column])).unwrap()
}

fn physics() -> Physics {
    Physics { blow_up_extent: 0.115, ..Physics::default() }
}

/// Images by their three pixels.
fn images(rows: &[[f64; 3]]) -> Vec<Grid<f64>> {
    rows.iter().map(|row| Grid::from_fn(1, 3, |_, column| row[column])).collect()
}

/// The second and the fourth look the same to the sensors, and so do the first and the last.
const CALM: [[f64; 3]; 5] =
    [[0.4, 0.0, 0.3], [0.2, 0.5, 0.4], [0.1, 0.0, 0.4], [0.2, 0.9, 0.4], [0.4, 1.0, 0.3]];
/// The third is too bright, and so is the last.
const WILD: [[f64; 3]; 5] =
    [[0.4, 0.0, 0.3], [0.2, 0.5, 0.4], [1.0, 0.0, 1.0], [0.2, 0.9, 0.4], [1.0, 0.7, 1.0]];

fn run(rows: &[[f64; 3]], life: Life, savings: Savings, order: &[usize], may_win: Box<MayWin>) -> Evaluation {
    let protocol = Protocol { life, control_steps: 8, ..Protocol::default() };
    let body = body();
    let job = Job { body: &body, order: order.to_vec(), may_win, given_up: None };
    let mut evaluations =
        evaluate(&[job], &images(rows), &[], &physics(), &protocol, savings, &NEVER).unwrap();
    assert_eq!(evaluations.len(), 1);
    let evaluation = evaluations.remove(0);
    let Evaluation { simulated, shared, stopped, .. } = evaluation;
    assert_eq!(simulated + shared + stopped, rows.len() as u64, "{evaluation:?}");
    assert!(savings.shared_lives || shared == 0, "{evaluation:?}");
    evaluation
}

fn rayon(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

/// Orders to show images in: none, a first one, all, and some with images that are there twice or not at all.
const ORDERS: [&[usize]; 4] = [&[], &[3], &[4, 2, 0, 1, 3], &[7, 2, 2, 4]];

fn all_savings() -> impl Iterator<Item = Savings> {
    (0..4).map(|mask| Savings { known_bodies: true, early_stop: mask & 1 > 0, shared_lives: mask & 2 > 0 })
}

#[test]
fn every_image_is_simulated_shared_or_stopped_in_every_outcome() {
    for (life, savings) in
        [Life::Fresh, Life::Sequential].into_iter().flat_map(|l| all_savings().map(move |s| (l, s)))
    {
        for (rows, order) in [&CALM, &WILD].into_iter().flat_map(|r| ORDERS.map(|order| (r, order))) {
            // After none, after some, never.
            for patience in [0, 1, 2, 5] {
                let may_win = move |known: &[Option<f64>]| known.iter().flatten().count() <= patience;
                let evaluation = run(rows, life, savings, order, Box::new(may_win));
                let is_stopped = matches!(evaluation.outcome, Outcome::Stopped(_));
                assert!(!is_stopped || savings.early_stop && patience < 5, "{evaluation:?}");
                assert_eq!(matches!(evaluation.outcome, Outcome::Walked(_)), rows == &CALM && !is_stopped);
            }
        }
    }
}

#[test]
fn the_outcome_is_the_same_with_each_saving_and_in_any_order() {
    for life in [Life::Fresh, Life::Sequential] {
        let none = Savings { known_bodies: false, early_stop: false, shared_lives: false };
        let walked = run(&CALM, life, none, &[], Box::new(|_| true));
        let Outcome::Walked(displacements) = &walked.outcome else { panic!("{walked:?}") };
        assert!(displacements.len() == 5 && displacements.iter().any(|d| *d != 0.0));
        assert_eq!(walked.simulated, 5);
        for (savings, order) in all_savings().flat_map(|savings| ORDERS.map(|order| (savings, order))) {
            let other = run(&CALM, life, savings, order, Box::new(|_| true));
            assert_eq!(other.outcome, walked.outcome);
            let lives = if savings.shared_lives && life == Life::Fresh { 3 } else { 5 };
            assert_eq!((other.simulated, other.stopped), (lives, 0));
            let wild = run(&WILD, life, savings, order, Box::new(|_| true));
            let Outcome::Unstable(end) = wild.outcome else { panic!("{wild:?}") };
            assert_eq!(end.reason, UnstableReason::BlownUp);
        }
    }
}

#[test]
fn fresh_lives_follow_the_order_and_stop_when_nothing_can_be_won() {
    // Image 3 is image 1's life, image 4 image 0's: with both known, nothing can be won any more.
    let may_win = |known: &[Option<f64>]| {
        assert!(known[3].is_some() && known[1] == known[3], "image 3 comes first: {known:?}");
        known[0].is_none()
    };
    let evaluation = run(&CALM, Life::Fresh, Savings::default(), &[3, 4], Box::new(may_win));
    let all = run(&CALM, Life::Fresh, Savings::default(), &[], Box::new(|_| true)).outcome.known();
    let mut known = all.unwrap_or_default();
    known[2] = None;
    let outcome = Outcome::Stopped(known);
    assert_eq!(evaluation, Evaluation { outcome, simulated: 2, shared: 2, stopped: 1 });
}

#[test]
fn every_life_is_looked_at_once() {
    let rows: Vec<[f64; 3]> = (0..60).map(|i| [0.4 / 60.0 * f64::from(i), 0.0, 0.3]).collect();
    let looks = Arc::new(AtomicUsize::new(0));
    let look = Arc::clone(&looks);
    let may_win: Box<MayWin> = Box::new(move |_| {
        look.fetch_add(1, Ordering::Relaxed);
        true
    });
    let evaluation = rayon(2).install(|| run(&rows, Life::Fresh, Savings::default(), &[], may_win));
    assert_eq!(evaluation.simulated, 60);
    // After the last one there is no rest to be dropped.
    assert_eq!(looks.load(Ordering::Relaxed), 59);
}

#[test]
fn a_raised_start_is_another_life_even_under_the_same_image() {
    let protocol = Protocol { life: Life::Fresh, control_steps: 30, ..Protocol::default() };
    let (body, physics, images) = (body(), physics(), images(&CALM));
    let system = Arc::new(System::new(&body, physics.clone()));
    let live = |image: usize, rows: u32| {
        let raised = Protocol { start_row: protocol.start_row + rows, ..protocol.clone() };
        fresh_life(&system, &raised, &images[image], &NEVER).unwrap().unwrap()
    };
    // Images 1 and 3, and 0 and 4, show the sensors the same; of the last pair, the start is, too.
    let raised = [1, 0, 1, 2];
    let expected = [live(0, 1), live(1, 0), live(2, 1), live(3, 2), live(4, 0)];
    assert!(expected[1] != expected[3] && expected[0] != expected[4], "{expected:?}");
    for savings in all_savings() {
        let evaluated = |raised: &[u32]| {
            let condition = |&raised: &u32| Condition { raised, ..Condition::default() };
            let conditions: Vec<Condition> = raised.iter().map(condition).collect();
            let job = Job { body: &body, order: Vec::new(), may_win: Box::new(|_| true), given_up: None };
            evaluate(&[job], &images, &conditions, &physics, &protocol, savings, &NEVER).unwrap().remove(0)
        };
        let evaluation = evaluated(&raised);
        assert_eq!((evaluation.outcome, evaluation.simulated), (Outcome::Walked(expected.to_vec()), 5));
        let lives = if savings.shared_lives { 4 } else { 5 };
        assert_eq!(evaluated(&[1, 0, 1, 2, 1]).simulated, lives);
    }
}

#[test]
fn a_life_without_limits_is_another_life_and_leads_nowhere_where_it_becomes_unstable() {
    let protocol = Protocol { life: Life::Fresh, control_steps: 30, ..Protocol::default() };
    let images = images(&WILD);
    let evaluated = |physics: &Physics, without_limits: &[bool]| {
        let condition = |&without_limits: &bool| Condition { without_limits, ..Condition::default() };
        let conditions: Vec<Condition> = without_limits.iter().map(condition).collect();
        let body = body();
        let may_win = Box::new(|_: &[Option<f64>]| true);
        let job = Job { body: &body, order: Vec::new(), may_win, given_up: None };
        evaluate(&[job], &images, &conditions, physics, &protocol, Savings::default(), &NEVER)
            .unwrap()
            .remove(0)
    };
    // A sensor at rest is as far below its goal as tight limits keep it.
    let tight = Physics { limit_high: 1.02, limit_low: 0.98, ..physics() };
    let expected = |physics: &Physics, image: usize| {
        let system = Arc::new(System::new(&body(), physics.clone()));
        fresh_life(&system, &protocol, &images[image], &NEVER).unwrap()
    };
    let calm = Physics { blow_up_extent: 1.0, ..tight.clone() };
    let mixed = [true, false, false, true, true];
    let evaluation = evaluated(&calm, &mixed);
    let free = calm.without_limits();
    let alone: Vec<f64> = mixed
        .iter()
        .enumerate()
        .map(|(image, &off)| expected(if off { &free } else { &calm }, image).unwrap())
        .collect();
    // Images 1 and 3, and 2 and 4, show the sensors the same, but not under the same condition.
    assert!(alone[1] != alone[3] && alone[2] != alone[4], "{alone:?}");
    assert_eq!((evaluation.outcome, evaluation.simulated), (Outcome::Walked(alone), 5));

    // Without them it grows wider than it may: that is no reason to refuse it, but no way either.
    assert!(expected(&tight, 2).is_ok() && expected(&tight.without_limits(), 2).is_err());
    let evaluation = evaluated(&tight, &[false, false, true, false, false]);
    let Outcome::Walked(walked) = evaluation.outcome else { panic!("{:?}", evaluation.outcome) };
    assert_eq!(walked[2], 0.0);
    assert_eq!(walked[1], expected(&tight, 1).unwrap());
}

#[test]
fn a_sequential_life_keeps_the_order_of_the_images() {
    let asked = Mutex::new(BTreeSet::new());
    let may_win = |known: &[Option<f64>]| {
        let first = known.iter().map_while(|displacement| *displacement).count();
        assert_eq!(known.iter().flatten().count(), first, "{known:?}");
        asked.lock().unwrap().insert(first);
        true
    };
    run(&CALM, Life::Sequential, Savings::default(), &[3, 4], Box::new(may_win));
    assert_eq!(*asked.lock().unwrap(), BTreeSet::from([1, 2, 3, 4]));
}

#[test]
fn what_is_stopped_is_no_evaluation_and_ends_in_the_middle_of_a_life() {
    let (body, images) = (body(), images(&CALM));
    // A life that lasts for minutes.
    for life in [Life::Fresh, Life::Sequential] {
        let protocol = Protocol { life, control_steps: 10_000_000, ..Protocol::default() };
        let may_win = Box::new(|_: &[Option<f64>]| true);
        let job = Job { body: &body, order: Vec::new(), may_win, given_up: None };
        let stop = AtomicBool::new(false);
        let begin = std::time::Instant::now();
        let ended = std::thread::scope(|threads| {
            threads.spawn(|| {
                std::thread::sleep(std::time::Duration::from_millis(50));
                stop.store(true, Ordering::Relaxed);
            });
            evaluate(&[job], &images, &[], &Physics::default(), &protocol, Savings::default(), &stop)
        });
        assert_eq!(ended, Err(Stopped));
        assert!(begin.elapsed().as_secs() < 5, "{:?}", begin.elapsed());
    }
}
