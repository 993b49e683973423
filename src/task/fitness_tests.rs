use super::*;
use Group::{A, B};
use proptest::prelude::*;

const MANY: [Fitness; 7] = [
    Fitness::MeanClipped,
    Fitness::RightThenMargin,
    Fitness::RightThenMin,
    Fitness::UntilFifthWrong,
    Fitness::UntilTwentiethWrong,
    Fitness::UntilFifthWrongOfClass,
    Fitness::UntilTwentiethWrongOfClass,
];

/// An answer to an image of a group's only class.
fn shown(group: Group, displacement: Option<f64>) -> (Group, Answer) {
    (group, Answer { class: u8::from(group == B), displacement })
}

fn fitness(kind: Fitness, answers: &[(Group, f64)]) -> f64 {
    better(kind.of_assignments(answers.iter().map(|&(group, d)| shown(group, Some(d)))))
}

#[test]
fn long_walks_count_no_more_than_enough() {
    let mean = |answers: &[(Group, f64)]| fitness(Fitness::MeanClipped, answers);
    assert_eq!(mean(&[(A, -5.0), (B, 40.0)]), 0.75);
    assert_eq!(mean(&[(A, 40.0), (A, -10.0), (B, 2.0), (B, -10.0)]), 0.2);
    assert_eq!(mean(&[(A, 4.0), (B, 4.0)]), 0.0);
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
    let all = known.chain(to_come).map(|(group, d)| shown(group, d));
    let bound = better(Fitness::RightThenMin.of_assignments(all));
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
    let is_settled = |kind: Fitness, answers: &[(Group, Option<f64>)]| {
        kind.is_settled(answers.iter().map(|&(group, d)| shown(group, d)))
    };
    let settled = |answers: &[(Group, Option<f64>)]| is_settled(Fitness::UntilFifthWrong, answers);
    // Neither way right: both assignments are over after five.
    let (stood, to_come) = ([(A, Some(0.0)), (B, Some(0.0))], [(A, None), (B, None)]);
    assert!(settled(&[stood, stood, stood, to_come].concat()));
    assert!(!settled(&[stood, stood, to_come, to_come].concat()));
    // Something is missing before.
    assert!(!settled(&[stood, to_come, stood, stood].concat()));
    assert!(MANY[..3].iter().all(|kind| !is_settled(*kind, &[stood; 3].concat())));
}

#[test]
fn the_fifth_wrong_answer_of_a_class_ends_it_and_three_known_classes_are_worth_little() {
    let of = |kind: Fitness, turns: &dyn Fn(usize) -> [f64; 4], count: usize| {
        let turn = |turn| {
            let answer = move |(class, group): (u8, Group)| {
                (group, Answer { class, displacement: Some(turns(turn)[usize::from(class)]) })
            };
            [(0, A), (1, B), (2, A), (3, B)].map(answer)
        };
        better(kind.of_assignments((0..count).flat_map(turn)))
    };
    let until = |turns: &dyn Fn(usize) -> [f64; 4], count| of(Fitness::UntilFifthWrongOfClass, turns, count);
    // Never 3: the fifth of them ends it, after four whole turns and three images.
    let three = |_| [9.0, -9.0, 9.0, 9.0];
    assert!((15.0..16.0).contains(&until(&three, 40)), "{}", until(&three, 40));
    // Every second image of all classes: 2 in all sixteen images of the turns up to the ninth, and two of that one.
    let half = |turn| if turn % 2 == 0 { [-9.0, -9.0, 9.0, -9.0] } else { [9.0, 9.0, -9.0, -9.0] };
    assert!((19.0..21.0).contains(&until(&half, 40)), "{}", until(&half, 40));
    // Counted over all, the first is the better one by far.
    let over_all = |turns: &dyn Fn(usize) -> [f64; 4]| of(Fitness::UntilFifthWrong, turns, 40);
    assert!(over_all(&three) > 1.5 * over_all(&half));
    // Four wrong answers in every class are not the end.
    let four = |turn| if turn < 4 { [-9.0, 9.0, 9.0, -9.0] } else { [9.0, -9.0, 9.0, -9.0] };
    assert!(until(&four, 40) > 140.0);
    // The other ends with the twentieth of a class.
    let longer = |count| of(Fitness::UntilTwentiethWrongOfClass, &three, count);
    assert!((60.0..61.0).contains(&longer(20)) && longer(20) == longer(40), "{} {}", longer(20), longer(40));
    assert!(longer(19) < longer(20));
}

fn mean_of_nan() -> f64 {
    fitness(Fitness::MeanClipped, &[(A, 1.0), (B, f64::NAN)])
}

proptest! {
    #[test]
    fn what_is_known_bounds_what_can_come(
        answers in prop::collection::vec(
            (0..4u8, prop_oneof![-30.0..30.0f64, Just(10.0), Just(-10.0)], any::<bool>()),
            1..60,
        )
    ) {
        let of = |class, displacement| (if class < 2 { A } else { B }, Answer { class, displacement });
        let all = answers.iter().map(|&(class, d, _)| of(class, Some(d)));
        let known = answers.iter().map(|&(class, d, known)| of(class, known.then_some(d)));
        for kind in MANY {
            let fitness = kind.of_assignments(all.clone());
            let bound = kind.of_assignments(known.clone());
            prop_assert!(bound.0 >= fitness.0 && bound.1 >= fitness.1, "{kind:?}");
            if kind.is_settled(known.clone()) {
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
