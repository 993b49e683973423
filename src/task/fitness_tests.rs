use super::*;
use Group::{A, B};
use proptest::prelude::*;

const MANY: [Fitness; 7] = [
    Fitness::MeanClipped,
    Fitness::MeanHinge,
    Fitness::RightThenMargin,
    Fitness::RightThenMin,
    Fitness::UntilFifthWrong,
    Fitness::UntilTwentiethWrong,
    Fitness::Response,
];

fn fitness(kind: Fitness, answers: &[(Group, f64)]) -> f64 {
    better(Criterion::from(kind).of_assignments(answers.iter().map(|&(group, d)| (group, Some(d)))))
}

#[test]
fn long_walks_count_no_more_than_enough() {
    let mean = |answers: &[(Group, f64)]| fitness(Fitness::MeanClipped, answers);
    assert_eq!(mean(&[(A, -5.0), (B, 40.0)]), 0.75);
    assert_eq!(mean(&[(A, 40.0), (A, -10.0), (B, 2.0), (B, -10.0)]), 0.2);
    assert_eq!(mean(&[(A, 4.0), (B, 4.0)]), 0.0);
}

#[test]
fn the_farther_astray_the_worse_is_a_hinged_answer_but_enough_is_enough() {
    let mean = |answers: &[(Group, f64)]| fitness(Fitness::MeanHinge, answers);
    assert_eq!(mean(&[(A, 5.0), (B, -40.0)]), 0.75);
    assert_eq!(mean(&[(A, 40.0), (B, 40.0)]), -1.5);
    // Three of four known by far and one by far wrong is worth less than all four a little.
    let (three, four) =
        ([(A, 30.0), (A, 30.0), (B, -30.0), (B, 30.0)], [(A, 1.0), (A, 1.0), (B, -1.0), (B, -1.0)]);
    assert!(mean(&three) < mean(&four));
    let clipped = |answers: &[(Group, f64)]| fitness(Fitness::MeanClipped, answers);
    assert!(clipped(&three) > clipped(&four));
    assert!(mean(&[(A, f64::NAN), (B, -9.0)]).is_nan());
}

#[test]
fn how_far_is_enough_is_a_matter_of_the_criterion() {
    let mean = |fitness, enough, answers: &[(Group, f64)]| {
        let known = answers.iter().map(|&(group, d)| (group, Some(d)));
        better(Criterion { fitness, enough }.of_assignments(known))
    };
    let answers = [(A, 30.0), (A, -10.0), (B, -10.0), (B, -80.0)];
    assert_eq!(mean(Fitness::MeanHinge, 40, &answers), (0.75 - 0.25 + 0.25 + 1.0) / 4.0);
    assert_eq!(mean(Fitness::MeanClipped, 40, &answers), mean(Fitness::MeanHinge, 40, &answers));
    assert_eq!(mean(Fitness::MeanHinge, 5, &answers), (1.0 - 2.0 + 1.0 + 1.0) / 4.0);
    assert_eq!(mean(Fitness::MeanClipped, 5, &answers), 0.5);
    // Of two robots that are as often right, the one that walks farther.
    let (short, long) = ([(A, 12.0), (B, -12.0)], [(A, 36.0), (B, -36.0)]);
    assert_eq!(mean(Fitness::MeanHinge, ENOUGH, &short), mean(Fitness::MeanHinge, ENOUGH, &long));
    assert!(mean(Fitness::MeanHinge, 40, &short) < mean(Fitness::MeanHinge, 40, &long));
}

#[test]
fn a_response_is_the_standard_deviation_within_two_conditions_that_take_turns() {
    let response = |d: &[f64]| {
        let answers: Vec<(Group, f64)> =
            d.iter().zip([A, B, B].iter().cycle()).map(|(&d, &g)| (g, d)).collect();
        fitness(Fitness::Response, &answers)
    };
    // 1, 5 and 3 around 3, and 100 and 104 around 102: (4 + 4 + 0 + 4 + 4)/(5 − 2).
    assert_eq!(response(&[1.0, 100.0, 5.0, 104.0, 3.0]), (16.0_f64 / 3.0).sqrt());
    // What the conditions differ by is no response, nor is which way the robot walks.
    assert_eq!(response(&[7.0, -100.0, 11.0, -104.0, 9.0]), (16.0_f64 / 3.0).sqrt());
    assert_eq!(response(&[2.0, -2.0, 2.0, -2.0]), 0.0);
    // Exactly: ten times 0.1 is not 1 in binary.
    assert_eq!(response(&[0.1; 20]).to_bits(), 0.0_f64.to_bits());
    assert!(response(&[1.0, 2.0, f64::NAN, 2.0]).is_nan());
    // Too few to say anything, and none.
    assert_eq!((response(&[1.0, 9.0]), response(&[1.0]), response(&[])), (0.0, 0.0, f64::INFINITY));
    // What is to come may be anything.
    let some = [(A, Some(1.0)), (B, None), (A, Some(1.0)), (B, Some(1.0))];
    let response = Criterion::from(Fitness::Response);
    assert_eq!(better(response.of_assignments(some.iter().copied())), f64::INFINITY);
    assert_eq!(Fitness::Response.unit(), Some("voxel lengths"));
    assert!(!response.is_mean() && response.last_wrong().is_none());
}

#[test]
fn groups_weigh_the_same_however_many_images_they_have() {
    // One against three: always walking one way is worth nothing, and not three quarters.
    let same_way = [(A, 20.0), (B, 20.0), (B, 20.0), (B, 20.0)];
    assert!(fitness(Fitness::MeanClipped, &same_way).abs() < 1e-12);
    let right = |answers: &[(Group, f64)]| fitness(Fitness::RightThenMargin, answers);
    assert!((2.0..2.7).contains(&right(&same_way)), "{}", right(&same_way));
    // All of A and two of three of B: 2 + 2 · 2/3 of 4.
    let most = right(&[(A, 9.0), (B, -9.0), (B, -9.0), (B, 9.0)]);
    assert!((2.0 + 4.0 / 3.0..4.0).contains(&most), "{most}");
}

#[test]
fn one_more_right_answer_beats_any_margin() {
    for kind in [Fitness::RightThenMargin, Fitness::RightThenMin] {
        let right = |answers: &[(Group, f64)]| fitness(kind, answers);
        let (short, long) =
            (right(&[(A, 3.1), (A, 3.1), (B, -3.1)]), right(&[(A, 90.0), (A, 3.0), (B, -90.0)]));
        assert!((3.0..4.0).contains(&short) && (2.0..3.0).contains(&long), "{kind:?} {short} {long}");
        let (short, long) = (right(&[(A, 3.1), (B, -3.1)]), right(&[(A, 3.0), (B, -1e9)]));
        assert!((2.0..3.0).contains(&short) && (1.0..2.0).contains(&long), "{kind:?} {short} {long}");
        // Nor does the tie-break ever saturate.
        assert!(right(&[(A, 1e4), (B, -1e4)]) > right(&[(A, 1e3), (B, -1e3)]));
        assert!(right(&[(A, f64::NAN), (B, -9.0)]).is_nan());
    }
    assert!(mean_of_nan().is_nan());
}

#[test]
fn of_equals_in_right_answers_the_one_with_the_better_worst_is_fitter() {
    let right = |answers: &[(Group, f64)]| fitness(Fitness::RightThenMin, answers);
    // A worst margin of 10 is worth 3/4 of an image, here of one of A's, 3/4; what the others are does not matter.
    assert_eq!(right(&[(A, 90.0), (A, 10.0), (B, -30.0)]), 3.0 + 0.75 * 0.75);
    assert!(right(&[(A, 5.0), (B, -5.0)]) > right(&[(A, 4.0), (B, -90.0)]));
    assert!(right(&[(A, -1.0), (B, -5.0)]) > right(&[(A, -2.0), (B, -90.0)]));
    // The worst image known says at once how good a robot can become.
    let to_come = (0..40).flat_map(|_| [(A, None), (B, None)]);
    let known = [(A, Some(10.0)), (B, Some(-30.0))].into_iter();
    let right = Criterion::from(Fitness::RightThenMin);
    let bound = better(right.of_assignments(known.chain(to_come)));
    assert!((82.75..82.75 + 1e-6).contains(&bound), "{bound}");
}

#[test]
fn the_fifth_wrong_answer_ends_it() {
    let until = |answers: &[(Group, f64)]| fitness(Fitness::UntilFifthWrong, answers);
    let (right, wrong) = ([(A, 9.0), (B, -9.0)], [(A, 3.0), (B, 1.0)]);
    // Six right, four wrong, two right: eight, and less than one for how far it walked.
    let alive = [right, right, right, wrong, wrong, right].concat();
    assert!((8.0..9.0).contains(&until(&alive)), "{}", until(&alive));
    // Then two wrong ones: with the first of them it is over, whatever comes.
    let over = [&alive[..], &wrong].concat();
    assert!((8.0..9.0).contains(&until(&over)));
    assert_eq!(until(&over), until(&[&over[..], &right, &right].concat()));
    // Two of three images are of group B, and weigh 3/4 each; one of A's, 3/2. Until seven of B are wrong, four of A.
    let same_way: Vec<_> = (0..12).flat_map(|_| [(A, -9.0), (B, -9.0), (B, -9.0)]).collect();
    assert!((6.0..6.75).contains(&until(&same_way)), "{}", until(&same_way));
    assert!(until(&[(A, f64::NAN), (B, 1.0)]).is_nan());
    // The other ends with the twentieth; walking one way is right on every second image until then.
    let longer = |answers: &[(Group, f64)]| fitness(Fitness::UntilTwentiethWrong, answers);
    let same_way = |images| vec![[(A, -9.0), (B, -9.0)]; images].concat();
    assert!((20.0..21.0).contains(&longer(&same_way(20))));
    assert_eq!(longer(&same_way(20)), longer(&same_way(30)));
    assert!(longer(&same_way(19)) < longer(&same_way(20)));
}

#[test]
fn what_comes_after_the_fifth_wrong_answer_is_known_not_to_count() {
    let settled = |answers: &[(Group, Option<f64>)]| {
        Criterion::from(Fitness::UntilFifthWrong).is_settled(answers.iter().copied())
    };
    // Neither way right: both assignments are over after five.
    let (stood, to_come) = ([(A, Some(0.0)), (B, Some(0.0))], [(A, None), (B, None)]);
    assert!(settled(&[stood, stood, stood, to_come].concat()));
    assert!(!settled(&[stood, stood, to_come, to_come].concat()));
    // Something is missing before.
    assert!(!settled(&[stood, to_come, stood, stood].concat()));
    assert!(
        MANY[..4]
            .iter()
            .all(|&kind| !Criterion::from(kind).is_settled([stood, stood, stood].concat().into_iter()))
    );
}

fn mean_of_nan() -> f64 {
    fitness(Fitness::MeanClipped, &[(A, 1.0), (B, f64::NAN)])
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
            let criterion = Criterion::from(kind);
            let fitness = criterion.of_assignments(all.clone());
            let bound = criterion.of_assignments(known.clone());
            prop_assert!(bound.0 >= fitness.0 && bound.1 >= fitness.1, "{kind:?}");
            if criterion.is_settled(known.clone()) {
                prop_assert_eq!(bound, fitness);
            }
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
