use super::*;
use crate::run::Error;
use crate::run::config::BUILT_IN;

fn config(stages: &str) -> Result<Config, Error> {
    Config::parse(&format!("{}\n{stages}", BUILT_IN[0].1), "stages.toml", &[])
}

#[test]
fn stages_follow_each_other_and_the_last_lasts() {
    let config = config(
        "[[stage]]\ngenerations = 10\n[[stage]]\ngenerations = 20\nimages_per_class = 4\nfitness = 'mean_clipped'\n\
         redraw = 8\n[[stage]]\nimages_per_class = 8\nfitness = 'mean_hinge'",
    )
    .unwrap();
    let at = |generation| {
        let Period { stage, draw } = config.period(generation);
        (stage, draw)
    };
    assert_eq!(
        [0, 9, 10, 17, 18, 29, 30, 10_000].map(at),
        [(0, 0), (0, 0), (1, 0), (1, 0), (1, 1), (1, 2), (2, 0), (2, 0)]
    );
    let fitness = [Fitness::Min, Fitness::MeanClipped, Fitness::MeanHinge];
    assert_eq!([9, 10, 30].map(|generation| config.criterion(generation).fitness), fitness);
    assert_eq!([9, 10, 30].map(|g| config.drawn_per_class(config.period(g))), [None, Some(4), Some(8)]);
    assert_ne!(config.period(10).number(), config.period(18).number());
    // All of them, however many generations they last.
    for generations in [1, 10, 11, 18, 19, 26, 27, 30, 31, 1000] {
        let mut periods: Vec<Period> = (0..generations).map(|generation| config.period(generation)).collect();
        periods.dedup();
        assert_eq!(config.periods(generations).collect::<Vec<_>>(), periods, "{generations}");
    }
    assert_eq!(config.periods(u64::MAX).count(), 5);
}

#[test]
fn a_stage_may_say_how_far_is_enough() {
    let stages = "[evaluation]\nfitness = 'mean_hinge'\nenough = 25\n[[stage]]\ngenerations = 1\n[[stage]]\nenough = 40";
    let enough = |config: &Config| [0, 1].map(|generation| config.criterion(generation).enough);
    let said = config(stages).unwrap();
    assert_eq!(enough(&said), [25, 40]);
    assert_eq!(enough(&Config::parse(&said.to_toml(), "again.toml", &[]).unwrap()), [25, 40]);
    let unsaid = config("[[stage]]\nfitness = 'mean_hinge'").unwrap();
    assert_eq!(enough(&unsaid), [10, 10]);
    assert!(!unsaid.to_toml().contains("enough"));
}

#[test]
fn without_stages_there_is_one_period() {
    let config = config("").unwrap();
    assert_eq!(config.period(12_345), Period { stage: 0, draw: 0 });
    assert_eq!((config.criterion(9).fitness, config.drawn_per_class(config.period(9))), (Fitness::Min, None));
}

#[test]
fn starts_are_raised_and_limits_removed_in_fresh_lives_only() {
    let with = |life: &str, stages: &str| {
        let life = format!("protocol.life={life}");
        Config::parse(&format!("{}\n{stages}", BUILT_IN[0].1), "stages.toml", &[life])
    };
    for key in ["raised_starts = 2", "without_limits = true"] {
        let text = with("sequential", &format!("[[stage]]\n{key}")).unwrap_err().to_string();
        let name = key.split(' ').next().unwrap();
        assert!(text.contains(&format!("stage 1: {name}: expected protocol.life = \"fresh\"")), "{text}");
    }
    with("sequential", "[[stage]]\nraised_starts = 0\nwithout_limits = false").unwrap();
    let stages = "[[stage]]\nimages_per_class = 4\nraised_starts = 2\nwithout_limits = true\ngenerations = 1\n[[stage]]";
    let fresh = with("fresh", stages).unwrap();
    let periods = [0, 1].map(|generation| fresh.period(generation));
    assert_eq!(periods.map(|period| fresh.raised_starts(period)), [2, 0]);
    assert_eq!(periods.map(|period| fresh.without_limits(period)), [true, false]);
}

#[test]
fn stages_that_cannot_be_are_refused() {
    for (stages, expected) in [
        ("[[stage]]\nimages_per_class = 2\n[[stage]]", "stage 1: expected generations"),
        ("[[stage]]\ngenerations = 0", "stage 1: generations = 0"),
        ("[[stage]]\nimages_per_class = 0", "stage 1: images_per_class = 0"),
        ("[[stage]]\nredraw = 5", "stage 1: redraw: expected images_per_class"),
        ("[[stage]]\nimages_per_class = 2\nredraw = 0", "stage 1: redraw = 0"),
        ("[[stage]]\nvoxel_mutations = 1.5", "stage 1: voxel_mutations = 1.5: expected a number from 0 to 1"),
        (
            "[[stage]]\nvoxel_candidates = 0",
            "stage 1: voxel_candidates = 0: expected a number from 1 to 1000",
        ),
        (
            "[[stage]]\nvoxel_changes = 1001",
            "stage 1: voxel_changes = 1001: expected a number from 1 to 1000",
        ),
        (
            "[[stage]]\nvoxel_relatives = 101",
            "stage 1: voxel_relatives = 101: expected a number from 0 to 100",
        ),
        ("[[stage]]\nrace = true", "stage 1: race: expected fitness = \"mean_clipped\" or \"mean_hinge\""),
        ("[[stage]]\nfitness = 'mean_hinge'\nenough = 0", "stage 1: enough = 0"),
        (
            "[[stage]]\nimages_per_class = 2\nraised_starts = 2",
            "stage 1: raised_starts: expected 3 images per class or more, found 2",
        ),
        ("[[stage]]\nwithout_limits = true", "stage 1: without_limits: expected 2 images per class or more"),
        (
            "[[stage]]\ngenerations = 1\nimages_per_class = 3\n[[stage]]\nimages_of = 1\nraised_starts = 2\nwithout_limits = true",
            "stage 2: without_limits: expected 4 images per class or more, found 3",
        ),
        ("[[stage]]\nstart_with = 3", "stage 1: start_with: expected a stage before, or [start] archive"),
        ("[[stage]]\nenough = 20", "stage 1: enough: expected fitness = \"mean_clipped\" or \"mean_hinge\""),
        ("[evaluation]\nenough = 0", "evaluation.enough = 0: expected 1 or more"),
        (
            "[[stage]]\ninverted_pixels = 9999",
            "stage 1: inverted_pixels = 9999: expected a number from 0 to 49",
        ),
        ("[[stage]]\nthreshold_min = nan", "stage 1: threshold_min = NaN: expected a finite number"),
        ("[[stage]]\nstart_with = 0", "stage 1: start_with = 0: expected 1 or more"),
        ("[[stage]]\npool = 5", "stage 1: pool: expected images_per_class"),
        ("[[stage]]\nimages_of = 1", "stage 1: images_of = 1: expected the number of a stage before"),
        (
            "[[stage]]\ngenerations = 3\n[[stage]]\nimages_of = 0",
            "stage 2: images_of = 0: expected the number",
        ),
        (
            "[[stage]]\ngenerations = 3\n[[stage]]\nimages_of = 1\nimages_per_class = 3",
            "stage 2: images_per_class: expected either images_of or images_per_class, not both",
        ),
        ("[[stage]]\nimages_per_class = 8\npool = 7", "stage 1: pool = 7: expected images_per_class, 8"),
    ] {
        let error = config(stages).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}
