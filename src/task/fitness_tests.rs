use super::*;
use Group::{A, B};
use proptest::prelude::*;

const MANY: [Fitness; 2] = [Fitness::MeanClipped, Fitness::Response];

fn fitness(kind: Fitness, answers: &[(Group, f64)]) -> f64 {
    better(kind.of_assignments(answers.iter().map(|&(group, d)| (group, Some(d)))))
}

#[test]
fn long_walks_count_no_more_than_enough() {
    let mean = |answers: &[(Group, f64)]| fitness(Fitness::MeanClipped, answers);
    assert_eq!(mean(&[(A, -5.0), (B, 40.0)]), 0.75);
    assert_eq!(mean(&[(A, 40.0), (A, -10.0), (B, 2.0), (B, -10.0)]), 0.2);
    assert_eq!(mean(&[(A, 4.0), (B, 4.0)]), 0.0);
}

#[test]
fn a_response_is_what_moves_the_two_of_a_pair_apart_within_conditions_that_take_turns() {
    let response = |d: &[f64]| {
        let answers: Vec<(Group, f64)> =
            d.iter().zip([A, B, B].iter().cycle()).map(|(&d, &g)| (g, d)).collect();
        fitness(Fitness::Response, &answers)
    };
    // Half differences 3, 2, −1, −2; half sums 0 and 0, and 10 and 10, which is 5 voxel lengths on average.
    let pairs = [3.0, -3.0, 12.0, 8.0, -1.0, 1.0, 8.0, 12.0];
    assert_eq!(response(&pairs), 4.5_f64.sqrt() - 5.0 / 8.0);
    // Which way the robot walks does not matter; how far it walks anyway costs; what the conditions differ by adds nothing.
    assert_eq!(response(&pairs.map(|d| -d)), 4.5_f64.sqrt() - 5.0 / 8.0);
    assert_eq!(response(&[3.0, -3.0, 2.0, -2.0, -1.0, 1.0, -2.0, 2.0]), 4.5_f64.sqrt());
    assert_eq!(response(&[13.0, 7.0, -8.0, -12.0, 9.0, 11.0, -12.0, -8.0]), 4.5_f64.sqrt());
    // What is the same for both of a pair is none.
    assert_eq!(response(&[2.0, 2.0, 0.0, 0.0, -2.0, -2.0, 0.0, 0.0]), -(4.0_f64).sqrt());
    // Exactly: ten times 0.1 is not 1 in binary.
    assert!((response(&[0.1; 20]) + 0.0125).abs() < 1e-12 && response(&[0.0; 20]) == 0.0);
    assert!(response(&[1.0, 2.0, 1.0, 2.0, f64::NAN, 2.0]).is_nan());
    // Too few to say anything, and none.
    assert_eq!((response(&[1.0, 9.0]), response(&[1.0]), response(&[])), (0.0, 0.0, f64::INFINITY));
    // What is to come may be anything.
    let some = [(A, Some(1.0)), (B, None), (A, Some(1.0)), (B, Some(1.0))];
    assert_eq!(better(Fitness::Response.of_assignments(some.iter().copied())), f64::INFINITY);
    assert_eq!(Fitness::Response.unit(), Some("voxel lengths"));
}

#[test]
fn groups_weigh_the_same_however_many_images_they_have() {
    // One against three: always walking one way is worth nothing, and not three quarters.
    let same_way = [(A, 20.0), (B, 20.0), (B, 20.0), (B, 20.0)];
    assert!(fitness(Fitness::MeanClipped, &same_way).abs() < 1e-12);
    // All of A, and two of three of B: 1/2 + 1/2 · 1/3.
    let most = fitness(Fitness::MeanClipped, &[(A, 20.0), (B, -20.0), (B, -20.0), (B, 20.0)]);
    assert!((most - 2.0 / 3.0).abs() < 1e-12, "{most}");
}

#[test]
fn an_answer_that_is_no_number_makes_none_of_the_mean() {
    assert!(fitness(Fitness::MeanClipped, &[(A, 1.0), (B, f64::NAN)]).is_nan());
}

proptest! {
    #[test]
    fn what_is_known_bounds_what_can_come(
        answers in prop::collection::vec(
            (any::<bool>(), prop_oneof![-30.0..30.0f64, Just(10.0), Just(-10.0)], any::<bool>()),
            1..40,
        )
    ) {
        let all = answers.iter().map(|&(a, d, _)| (if a { A } else { B }, Some(d)));
        let known = answers.iter().map(|&(a, d, known)| (if a { A } else { B }, known.then_some(d)));
        for kind in MANY {
            let fitness = kind.of_assignments(all.clone());
            let bound = kind.of_assignments(known.clone());
            prop_assert!(bound.0 >= fitness.0 && bound.1 >= fitness.1, "{kind:?}");
        }
    }

    #[test]
    fn mirrored_answers_are_as_fit(answers in prop::collection::vec((any::<bool>(), -30.0..30.0f64), 1..20)) {
        let of = |sign: f64| answers.iter().map(move |&(a, d)| (if a { A } else { B }, sign * d)).collect::<Vec<_>>();
        for kind in MANY {
            prop_assert_eq!(fitness(kind, &of(1.0)), fitness(kind, &of(-1.0)));
        }
    }
}
