//! Properties that hold for any body and any stimulus.
#![allow(clippy::disallowed_methods)]

use morphcog_sim::{Body, Grid, Material, Physics, Start, System, Unstable, World};
use proptest::prelude::*;

/// Any matrix of materials of the given kinds, with at least one voxel; it need not hang together.
fn bodies(kinds: &'static [Material], side: usize) -> impl Strategy<Value = Body> {
    (1..=side, 1..=side).prop_flat_map(move |(height, width)| {
        let cells = prop::collection::vec(prop::sample::select(kinds), height * width);
        cells.prop_filter_map("empty", move |cells| {
            let body = Body::new(Grid::from_fn(height, width, |r, c| cells[r * width + c])).ok()?;
            (body.counts().total > 0).then_some(body)
        })
    })
}

fn stimuli(body: Body) -> impl Strategy<Value = (Body, Grid<f64>)> {
    let (height, width) = (body.height(), body.width());
    prop::collection::vec(0.0..=1.0, height * width).prop_map(move |pixels| {
        (
            body.clone(),
            Grid::from_fn(height, width, |r, c| pixels[r * width + c]),
        )
    })
}

/// A simulation: centre of mass before and after each control step.
fn simulate(
    body: &Body,
    stimulus: &Grid<f64>,
    start: Start,
    steps: u32,
    physics: &Physics,
) -> Result<Vec<[f64; 2]>, Unstable> {
    let mut world = World::new(System::new(body, physics.clone()), start);
    world.set_stimulus(stimulus);
    let mut path = vec![world.centre_of_mass()];
    for _ in 0..steps {
        world.step()?;
        path.push(world.centre_of_mass());
    }
    Ok(path)
}

const ALL: &[Material] = &Material::ALL;
/// Bodies whose physics has no left and right: without rigid voxels (their pass has a direction),
/// without soft ones (of soft and active the later one wins) and without corner-only contacts (they
/// start with two edges at distance 0 from a point, of which the first in the order top, right,
/// bottom, left counts).
fn symmetric_bodies() -> impl Strategy<Value = Body> {
    let filled = bodies(ACTIVE_OR_EMPTY, 7).prop_map(|body| {
        let mut voxels = body.voxels().clone();
        let empty = |g: &Grid<Material>, r, c| g[(r, c)].is_empty();
        // Filling a gap may make a new corner-only contact above or to the left, so until nothing
        // changes.
        loop {
            let before = voxels.clone();
            for r in 1..voxels.height() {
                for c in 1..voxels.width() {
                    let around = [(r - 1, c - 1), (r - 1, c), (r, c - 1), (r, c)];
                    let [a, b, d, e] = around.map(|(r, c)| empty(&voxels, r, c));
                    if a == e && b == d && a != b {
                        let gap = around
                            .into_iter()
                            .find(|&(r, c)| empty(&voxels, r, c))
                            .unwrap();
                        voxels[gap] = Material::SensorExpand;
                    }
                }
            }
            if voxels == before {
                return Body::new(voxels).unwrap();
            }
        }
    });
    filled.prop_filter("connected", Body::is_connected)
}

/// Its voxels with what they see, wherever in its box they are.
fn voxels(body: &Body, stimulus: &Grid<f64>) -> Vec<(usize, usize, Material, f64)> {
    let list = || body.voxels().iter().filter(|(_, m)| !m.is_empty());
    let left = list().map(|((_, c), _)| c).min().unwrap_or(0);
    let seen = |place, m: &Material| if m.is_sensor() { stimulus[place] } else { 0.0 };
    list()
        .map(|((r, c), m)| (r, c - left, *m, seen((r, c), m)))
        .collect()
}

const ACTIVE_OR_EMPTY: &[Material] = &[
    Material::Empty,
    Material::MuscleInPhase,
    Material::MuscleAntiphase,
    Material::SensorShrink,
    Material::SensorExpand,
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_mirror_image_walks_the_mirrored_way(
        (body, stimulus) in symmetric_bodies().prop_flat_map(stimuli)
    ) {
        // A symmetric robot falls with its middle exactly on a vertex of the ground, and rounding
        // then decides on which side it first touches (physics.md, "What agreement can be had").
        prop_assume!(voxels(&body, &stimulus) != voxels(&body.mirrored(), &stimulus.mirrored()));
        let physics = Physics::default();
        let start = Start { column: 0, row: 3 };
        // A peg's column is not symmetric, but reached only by tunnelling.
        let ours = simulate(&body, &stimulus, start, 60, &physics);
        let mirrored = simulate(&body.mirrored(), &stimulus.mirrored(), start, 60, &physics);
        match (ours, mirrored) {
            (Ok(ours), Ok(mirrored)) => {
                let walked = |path: &[[f64; 2]]| path[60][0] - path[0][0];
                let (a, b) = (walked(&ours), walked(&mirrored));
                prop_assert!((a + b).abs() < 1e-6, "{a} and {b}");
                prop_assert!((ours[60][1] - mirrored[60][1]).abs() < 1e-6);
            }
            (ours, mirrored) => prop_assert_eq!(ours.err(), mirrored.err()),
        }
    }

    #[test]
    fn moving_the_robot_along_the_ground_changes_nothing(
        (body, stimulus) in bodies(ALL, 7).prop_flat_map(stimuli),
        column in -1000i64..1000,
        row in 2u32..4,
    ) {
        let physics = Physics::default();
        let at = |column| simulate(&body, &stimulus, Start { column, row }, 40, &physics);
        prop_assert_eq!(at(0), at(6 * column));
    }

    #[test]
    fn in_free_fall_the_centre_of_mass_keeps_its_x(
        (body, stimulus) in bodies(ALL, 7).prop_flat_map(stimuli)
    ) {
        // Without self-contact: the voxels may touch, but nothing comes of it.
        let physics = Physics { self_contact_weight: 0.0, ..Physics::default() };
        if let Ok(path) = simulate(&body, &stimulus, Start { column: 0, row: 200 }, 30, &physics) {
            for [x, _] in &path {
                prop_assert!((x - path[0][0]).abs() < 1e-9, "{} to {x}", path[0][0]);
            }
        }
    }

    #[test]
    fn no_side_of_a_voxel_of_any_body_is_ever_far_from_its_rest_length(
        (body, stimulus) in bodies(ALL, 10).prop_flat_map(stimuli),
        row in 2u32..4,
    ) {
        let physics = Physics::default();
        let mut world = World::new(System::new(&body, physics.clone()), Start { column: 0, row });
        world.set_stimulus(&stimulus);
        while world.control_step() < 100 && world.step().is_ok() {
            let points: Vec<[f64; 2]> = world.points().collect();
            for (place, corners) in world.voxels() {
                for side in 0..4 {
                    let [a, b] = [corners[side], corners[(side + 1) % 4]].map(|corner| points[corner]);
                    let length = (a[0] - b[0]).hypot(a[1] - b[1]) / physics.cell_size;
                    prop_assert!((0.6..1.5).contains(&length), "{place:?}, side {side}: {length} rest lengths");
                }
            }
        }
    }

    #[test]
    fn physics_that_no_body_can_stand_ends_in_a_typed_instability(
        (body, stimulus) in bodies(ALL, 5).prop_flat_map(stimuli),
        time_step in prop::sample::select(vec![1e-3, 1e-2, 1.0, 1e6, 1e150]),
    ) {
        let physics = Physics { time_step, ..Physics::default() };
        let end = simulate(&body, &stimulus, Start { column: 0, row: 2 }, 20, &physics);
        prop_assert!(end.is_err_and(|end| end.control_step < 20), "{time_step}: it went on");
    }
}

#[test]
fn a_large_body_of_every_material_stays_stable() {
    let body = Body::new(Grid::from_fn(28, 28, |r, c| {
        Material::ALL[(r * 5 + c * 3) % 6 + 1]
    }))
    .unwrap();
    let stimulus = Grid::from_fn(28, 28, |r, c| f64::from(u8::from((r + c) % 2 == 0)));
    let path = simulate(
        &body,
        &stimulus,
        Start { column: 0, row: 2 },
        20,
        &Physics::default(),
    )
    .unwrap();
    assert!(path.iter().flatten().all(|v| v.is_finite()));
}

#[test]
fn an_empty_body_does_not_panic() {
    let body = Body::new(Grid::filled(3, 3, Material::Empty)).unwrap();
    let stimulus = Grid::filled(3, 3, 1.0);
    assert!(
        simulate(
            &body,
            &stimulus,
            Start { column: 0, row: 2 },
            5,
            &Physics::default()
        )
        .is_ok()
    );
}
