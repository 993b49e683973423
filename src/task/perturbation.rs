//! [`Perturbation`]: a change of a simulation that should make no difference to a robot that walks
//! by body and image. `morphcog audit` tests robots under many of them. `morphcog train` uses some,
//! so that robots do not come to depend on what they change.
//!
//! Starting at another column is not one: the simulator gives the same bits wherever on the ground
//! a robot stands (except for pegs below the ground, which a robot can reach only by tunnelling). A
//! raised start also changes the column.

use crate::base::random::{Purpose, stream};
use crate::base::{Grid, number};
use crate::body::Body;
use crate::sim::Physics;
use crate::task::protocol::{Protocol, RolloutMode};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The kind of a change.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub(crate) enum PerturbationKind {
    /// The robot starts above the ground, and first touches it in another way; also in another
    /// column.
    Start,
    /// Robot and images are mirrored, which reverses ties and all that goes from left to right.
    Mirror,
    /// The material stays, at a shorter time step ([`Physics::refined`]).
    TimeStep,
    /// The length limits remove an excess half as fast. Or they are beyond every goal, so that no
    /// spring is held at a limit against its goal and gains energy there.
    LengthLimits,
    /// A contact of the robot with itself counts once instead of twice.
    SelfContact,
    /// Images of a sequential simulation are reversed: this finds robots that turn by the clock.
    Order,
    /// The stiffness of all springs changes.
    Stiffness,
    /// The friction of contacts changes.
    Friction,
    /// Gravity changes.
    Gravity,
    /// A pixel under a sensor, another one in each image, is inverted.
    Pixel,
}

impl PerturbationKind {
    /// All kinds, in the order of a report.
    pub(crate) const ALL: [PerturbationKind; 10] = [
        PerturbationKind::Start,
        PerturbationKind::Mirror,
        PerturbationKind::TimeStep,
        PerturbationKind::LengthLimits,
        PerturbationKind::SelfContact,
        PerturbationKind::Order,
        PerturbationKind::Stiffness,
        PerturbationKind::Friction,
        PerturbationKind::Gravity,
        PerturbationKind::Pixel,
    ];

    /// True if it changes the simulated world. A robot that fails under the others, which change
    /// only computation or presentation, exploits something other than body and image.
    pub(crate) fn is_of_the_world(self) -> bool {
        self >= PerturbationKind::Stiffness
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            PerturbationKind::Start => "start",
            PerturbationKind::Mirror => "ties (mirror image)",
            PerturbationKind::TimeStep => "time step",
            PerturbationKind::LengthLimits => "length limits",
            PerturbationKind::SelfContact => "self-contact",
            PerturbationKind::Order => "order of images",
            PerturbationKind::Stiffness => "stiffness",
            PerturbationKind::Friction => "friction",
            PerturbationKind::Gravity => "gravity",
            PerturbationKind::Pixel => "pixel noise",
        }
    }
}

/// The sizes of an audit's changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Sizes {
    /// Rows by which the start is raised, one rollout each. Default 1 and 2.
    pub(crate) start: Vec<u32>,
    /// Divisors of the time step, one rollout each. Default 2 and 4.
    pub(crate) time_step: Vec<u32>,
    /// Fraction by which stiffness, friction and gravity are raised and lowered. Default 0.05.
    pub(crate) share: f64,
    /// Number of rollouts with a changed pixel in every image. Default 3.
    pub(crate) pixels: u32,
    /// Fewest sensors of a robot whose pixels are changed: else one pixel is no noise. Default 10.
    pub(crate) least_sensors: usize,
    /// Seed of the pixels. Default 1.
    pub(crate) seed: u64,
}

impl Default for Sizes {
    fn default() -> Self {
        Sizes {
            start: vec![1, 2],
            time_step: vec![2, 4],
            share: 0.05,
            pixels: 3,
            least_sensors: 10,
            seed: 1,
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PerturbedSetting {
    pub(crate) body: Body,
    pub(crate) physics: Physics,
    pub(crate) protocol: Protocol,
    pub(crate) stimuli: Vec<Grid<f64>>,
}

/// Perturbations that the images of a training take in turn; keys of `train.perturbations`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct ByTurns {
    /// Most rows by which starts are raised, in turn from 0. Default 2.
    pub(crate) start: u32,
    /// Simulates half of the images without length limits. Default true.
    ///
    /// Then the limits of soft and active voxels lie beyond every goal.
    pub(crate) length_limits: bool,
}

impl Default for ByTurns {
    fn default() -> Self {
        ByTurns {
            start: 2,
            length_limits: true,
        }
    }
}

/// The perturbations of one rollout; often none.
pub(crate) type Condition = Vec<Perturbation>;

impl ByTurns {
    /// Returns every condition once: starts raised by 0 up to the most rows, then without limits.
    pub(crate) fn conditions(&self) -> impl Iterator<Item = Condition> {
        let ByTurns {
            start,
            length_limits,
        } = *self;
        let one = move |without_limits: bool| {
            (0..=start).map(move |rows| condition(rows, without_limits))
        };
        one(false).chain(length_limits.then(|| one(true)).into_iter().flatten())
    }

    /// Returns the conditions of images of these classes, which take turns within each class.
    pub(crate) fn of(&self, classes: impl Iterator<Item = u8>) -> Vec<Condition> {
        let starts = u64::from(self.start) + 1;
        let mut turns = [0_u64; u8::MAX as usize + 1];
        let condition = |class: u8| {
            let turn = turns[usize::from(class)];
            turns[usize::from(class)] += 1;
            condition(
                (turn % starts) as u32,
                self.length_limits && (turn / starts) % 2 == 1,
            )
        };
        classes.map(condition).collect()
    }
}

/// Number of conditions of [`of_response`].
pub(crate) const CONDITIONS_OF_RESPONSE: usize = 2;

/// Returns the conditions of measuring a response, in turn: the default; a start raised by a row,
/// without length limits. So luck at the ground or at a limit does not count.
pub(crate) fn of_response() -> [Condition; CONDITIONS_OF_RESPONSE] {
    [condition(0, false), condition(1, true)]
}

/// Returns the condition of a start raised by this number of rows, with or without length limits.
pub(crate) fn condition(rows: u32, without_limits: bool) -> Condition {
    let start = (rows > 0).then_some(Perturbation::Start { rows });
    start
        .into_iter()
        .chain(without_limits.then_some(Perturbation::NoLengthLimits))
        .collect()
}

/// One change of a simulation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Stored", into = "Stored")]
pub enum Perturbation {
    /// The start is raised by this number of rows and moved by as many columns.
    Start {
        /// Rows \[voxels\].
        rows: u32,
    },
    /// Robot and images are mirrored.
    Mirror,
    /// The time step is divided by a whole number.
    TimeStep {
        /// 1 or more.
        divisor: u32,
    },
    /// The length limits remove an excess half as fast.
    SlowLengthLimits,
    /// The length limits are beyond every goal.
    NoLengthLimits,
    /// A contact of the robot with itself counts once instead of twice.
    SelfContact,
    /// The images come in reverse order.
    Order,
    /// The stiffness of all springs is multiplied.
    Stiffness {
        /// More than 0.
        factor: f64,
    },
    /// The friction of contacts is multiplied.
    Friction {
        /// More than 0.
        factor: f64,
    },
    /// Gravity is multiplied.
    Gravity {
        /// More than 0.
        factor: f64,
    },
    /// A pixel under a sensor is inverted in each image.
    Pixel {
        /// The number of the draw.
        draw: u32,
        /// Its seed.
        seed: u64,
    },
}

/// A perturbation as stored in files.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Perturbation")]
struct Stored {
    /// The kind of the change.
    kind: PerturbationKind,
    /// Rows, divisor of the time step, factor, speed of the limits (0: none), or number of the
    /// draw; 0.5 for the other kinds.
    amount: f64,
    /// Seed of the draw; 0 without a draw.
    #[serde(default, skip_serializing_if = "is_zero")]
    seed: u64,
}

fn is_zero(seed: &u64) -> bool {
    *seed == 0
}

impl From<Perturbation> for Stored {
    fn from(perturbation: Perturbation) -> Self {
        let (amount, seed) = match perturbation {
            Perturbation::Start { rows } => (f64::from(rows), 0),
            Perturbation::TimeStep { divisor } => (f64::from(divisor), 0),
            Perturbation::Stiffness { factor }
            | Perturbation::Friction { factor }
            | Perturbation::Gravity { factor } => (factor, 0),
            Perturbation::Pixel { draw, seed } => (f64::from(draw), seed),
            Perturbation::NoLengthLimits => (0.0, 0),
            Perturbation::Mirror
            | Perturbation::SlowLengthLimits
            | Perturbation::SelfContact
            | Perturbation::Order => (0.5, 0),
        };
        Stored {
            kind: perturbation.kind(),
            amount,
            seed,
        }
    }
}

impl TryFrom<Stored> for Perturbation {
    type Error = String;

    fn try_from(Stored { kind, amount, seed }: Stored) -> Result<Self, String> {
        let is_whole = amount.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&amount);
        let whole = || match is_whole {
            true => Ok(amount as u32),
            false => Err(format!(
                "amount {amount}: expected a whole number of {}",
                kind.name()
            )),
        };
        Ok(match kind {
            PerturbationKind::Start => Perturbation::Start { rows: whole()? },
            PerturbationKind::Mirror => Perturbation::Mirror,
            PerturbationKind::TimeStep => Perturbation::TimeStep { divisor: whole()? },
            PerturbationKind::LengthLimits if amount == 0.0 => Perturbation::NoLengthLimits,
            PerturbationKind::LengthLimits => Perturbation::SlowLengthLimits,
            PerturbationKind::SelfContact => Perturbation::SelfContact,
            PerturbationKind::Order => Perturbation::Order,
            PerturbationKind::Stiffness => Perturbation::Stiffness { factor: amount },
            PerturbationKind::Friction => Perturbation::Friction { factor: amount },
            PerturbationKind::Gravity => Perturbation::Gravity { factor: amount },
            PerturbationKind::Pixel => Perturbation::Pixel {
                draw: whole()?,
                seed,
            },
        })
    }
}

impl Perturbation {
    /// Returns all changes of these sizes that apply to body and protocol, in a report's order.
    pub(crate) fn all(sizes: &Sizes, body: &Body, rollout: RolloutMode) -> Vec<Self> {
        let sees = body.counts().sensor >= sizes.least_sensors;
        let factors = [1.0 - sizes.share, 1.0 + sizes.share];
        let of = |kind| -> Vec<Self> {
            match kind {
                PerturbationKind::Start => sizes
                    .start
                    .iter()
                    .map(|&rows| Perturbation::Start { rows })
                    .collect(),
                PerturbationKind::Mirror => vec![Perturbation::Mirror],
                PerturbationKind::TimeStep => sizes
                    .time_step
                    .iter()
                    .map(|&divisor| Perturbation::TimeStep { divisor })
                    .collect(),
                PerturbationKind::LengthLimits => {
                    vec![Perturbation::SlowLengthLimits, Perturbation::NoLengthLimits]
                }
                PerturbationKind::SelfContact => vec![Perturbation::SelfContact],
                PerturbationKind::Order if rollout == RolloutMode::Fresh => Vec::new(),
                PerturbationKind::Order => vec![Perturbation::Order],
                PerturbationKind::Stiffness => factors
                    .map(|factor| Perturbation::Stiffness { factor })
                    .to_vec(),
                PerturbationKind::Friction => factors
                    .map(|factor| Perturbation::Friction { factor })
                    .to_vec(),
                PerturbationKind::Gravity => factors
                    .map(|factor| Perturbation::Gravity { factor })
                    .to_vec(),
                PerturbationKind::Pixel if !sees => Vec::new(),
                PerturbationKind::Pixel => (1..=sizes.pixels)
                    .map(|draw| Perturbation::Pixel {
                        draw,
                        seed: sizes.seed,
                    })
                    .collect(),
            }
        };
        PerturbationKind::ALL.into_iter().flat_map(of).collect()
    }

    pub(crate) fn kind(&self) -> PerturbationKind {
        match self {
            Perturbation::Start { .. } => PerturbationKind::Start,
            Perturbation::Mirror => PerturbationKind::Mirror,
            Perturbation::TimeStep { .. } => PerturbationKind::TimeStep,
            Perturbation::SlowLengthLimits | Perturbation::NoLengthLimits => {
                PerturbationKind::LengthLimits
            }
            Perturbation::SelfContact => PerturbationKind::SelfContact,
            Perturbation::Order => PerturbationKind::Order,
            Perturbation::Stiffness { .. } => PerturbationKind::Stiffness,
            Perturbation::Friction { .. } => PerturbationKind::Friction,
            Perturbation::Gravity { .. } => PerturbationKind::Gravity,
            Perturbation::Pixel { .. } => PerturbationKind::Pixel,
        }
    }

    /// Returns its name for people, such as "time step / 4".
    pub(crate) fn name(&self) -> String {
        let kind = self.kind().name();
        match self {
            Perturbation::Start { rows } => format!("{kind} raised by {rows}"),
            Perturbation::Mirror => kind.to_string(),
            Perturbation::Order => format!("{kind} reversed"),
            Perturbation::TimeStep { divisor } => format!("{kind} / {divisor}"),
            Perturbation::NoLengthLimits => format!("{kind} beyond all goals"),
            Perturbation::SlowLengthLimits => format!("{kind} half as fast"),
            Perturbation::SelfContact => format!("{kind} counted once"),
            Perturbation::Stiffness { factor }
            | Perturbation::Friction { factor }
            | Perturbation::Gravity { factor } => {
                let change = number::signed(100.0 * (factor - 1.0), 3);
                format!(
                    "{kind} {} %",
                    change.strip_suffix(".000").unwrap_or(&change)
                )
            }
            Perturbation::Pixel { draw, .. } => format!("{kind} {draw}"),
        }
    }

    /// True except without limits: a body that needs its materials' limits exploits nothing.
    pub(crate) fn counts_if_unstable(&self) -> bool {
        *self != Perturbation::NoLengthLimits
    }

    /// Returns the changed setting; see [`Perturbation::undo`] before comparing.
    pub(crate) fn apply(&self, setting: &PerturbedSetting) -> PerturbedSetting {
        let PerturbedSetting {
            body,
            physics,
            protocol,
            stimuli,
        } = setting;
        let stimulus = |(image, stimulus)| self.stimulus(body, stimulus, image as u64);
        let mut stimuli: Vec<Grid<f64>> = stimuli.iter().enumerate().map(stimulus).collect();
        if *self == Perturbation::Order {
            stimuli.reverse();
        }
        PerturbedSetting {
            body: self.body(body),
            physics: self.physics(physics),
            protocol: self.protocol(protocol),
            stimuli,
        }
    }

    pub(crate) fn body(&self, body: &Body) -> Body {
        if *self == Perturbation::Mirror {
            body.mirrored()
        } else {
            body.clone()
        }
    }

    pub(crate) fn physics(&self, physics: &Physics) -> Physics {
        match *self {
            Perturbation::TimeStep { divisor } => physics.refined(divisor),
            Perturbation::NoLengthLimits => physics.without_limits(),
            Perturbation::SlowLengthLimits => physics.with_slower_limits(2.0),
            Perturbation::SelfContact => Physics {
                self_contact_weight: physics.self_contact_weight * 0.5,
                ..physics.clone()
            },
            Perturbation::Stiffness { factor } => physics.with_stiffness(factor),
            Perturbation::Friction { factor } => Physics {
                friction: physics.friction * factor,
                ..physics.clone()
            },
            Perturbation::Gravity { factor } => Physics {
                gravity: physics.gravity * factor,
                ..physics.clone()
            },
            Perturbation::Start { .. }
            | Perturbation::Mirror
            | Perturbation::Order
            | Perturbation::Pixel { .. } => physics.clone(),
        }
    }

    pub(crate) fn protocol(&self, protocol: &Protocol) -> Protocol {
        match *self {
            Perturbation::Start { rows } => Protocol {
                start_row: protocol.start_row.saturating_add(rows),
                start_column: protocol.start_column - i64::from(rows),
                ..protocol.clone()
            },
            _ => protocol.clone(),
        }
    }

    /// Returns the changed stimulus of the image with this number, for the unchanged body.
    pub(crate) fn stimulus(&self, body: &Body, stimulus: &Grid<f64>, image: u64) -> Grid<f64> {
        match *self {
            Perturbation::Mirror => stimulus.mirrored(),
            Perturbation::Pixel { draw, seed } => {
                with_pixel_inverted(body, stimulus, (seed, draw, image))
            }
            _ => stimulus.clone(),
        }
    }

    /// Returns displacements in the unperturbed frame: mirrored back, in the unchanged order.
    pub(crate) fn undo(&self, mut displacements: Vec<f64>) -> Vec<f64> {
        match self {
            Perturbation::Mirror => displacements.iter_mut().for_each(|d| *d = -*d),
            Perturbation::Order => displacements.reverse(),
            _ => {}
        }
        displacements
    }
}

/// Inverts a pixel under a sensor, drawn by the seed, the number of the draw and that of the image.
fn with_pixel_inverted(
    body: &Body,
    stimulus: &Grid<f64>,
    (seed, draw, image): (u64, u32, u64),
) -> Grid<f64> {
    let sensors: Vec<_> = body
        .voxels()
        .iter()
        .filter(|(_, m)| m.is_sensor())
        .map(|(place, _)| place)
        .collect();
    let mut random = stream(seed, Purpose::AuditPixels, u64::from(draw), image);
    let chosen = random.choose(&sensors).copied();
    let pixel = |row, column| {
        let pixel = stimulus[(row, column)];
        if chosen == Some((row, column)) {
            1.0 - pixel
        } else {
            pixel
        }
    };
    Grid::from_fn(stimulus.height(), stimulus.width(), pixel)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setting() -> PerturbedSetting {
        let stimuli = vec![Grid::filled(2, 4, 0.25), Grid::filled(2, 4, 1.0)];
        let body = "3516/4442".parse().unwrap();
        PerturbedSetting {
            body,
            physics: Physics::default(),
            protocol: Protocol::default(),
            stimuli,
        }
    }

    fn all(rollout: RolloutMode) -> Vec<Perturbation> {
        let sizes = Sizes {
            least_sensors: 2,
            ..Sizes::default()
        };
        Perturbation::all(&sizes, &setting().body, rollout)
    }

    fn of(kind: PerturbationKind) -> Vec<PerturbedSetting> {
        all(RolloutMode::Sequential)
            .iter()
            .filter(|p| p.kind() == kind)
            .map(|p| p.apply(&setting()))
            .collect()
    }

    #[test]
    fn every_perturbation_changes_what_it_says_and_nothing_else() {
        let plain = setting();
        for perturbation in all(RolloutMode::Sequential) {
            let changed = perturbation.apply(&plain);
            let parts = [
                changed.body != plain.body,
                changed.physics != plain.physics,
                changed.protocol != plain.protocol,
                changed.stimuli != plain.stimuli,
            ];
            // The images of this setting are symmetric: mirroring does not change them.
            let expected = match perturbation.kind() {
                PerturbationKind::Start => [false, false, true, false],
                PerturbationKind::Mirror => [true, false, false, false],
                PerturbationKind::Pixel | PerturbationKind::Order => [false, false, false, true],
                _ => [false, true, false, false],
            };
            assert_eq!(parts, expected, "{}", perturbation.name());
            changed.physics.validate().unwrap();
        }
        assert_eq!(of(PerturbationKind::Start)[1].protocol.start_row, 4);
        assert_eq!(
            of(PerturbationKind::Gravity)[0].physics.gravity,
            110.0 * 0.95
        );
        assert_eq!(of(PerturbationKind::TimeStep)[1].physics.substeps, 120);
        let [slow, far] = [
            &of(PerturbationKind::LengthLimits)[0].physics,
            &of(PerturbationKind::LengthLimits)[1].physics,
        ];
        assert!((0.55..0.56).contains(&slow.limit_share) && far.limit_share == 0.8);
        assert_eq!(
            (far.limit_low, far.limit_high, slow.limit_low),
            (0.6, 1.6, 0.75)
        );
        assert_eq!(
            of(PerturbationKind::SelfContact)[0]
                .physics
                .self_contact_weight,
            1.0
        );
    }

    #[test]
    fn one_pixel_under_a_sensor_is_inverted_in_each_image_and_draws_differ() {
        let changed = of(PerturbationKind::Pixel);
        assert_eq!(changed, of(PerturbationKind::Pixel));
        for setting in &changed {
            for (stimulus, plain) in setting.stimuli.iter().zip([0.25, 1.0]) {
                let differing: Vec<_> = stimulus.iter().filter(|(_, v)| **v != plain).collect();
                assert_eq!(differing.len(), 1);
                assert!([(0, 1), (0, 3)].contains(&differing[0].0));
                assert_eq!(*differing[0].1, 1.0 - plain);
            }
        }
        assert!(changed.iter().any(|other| *other != changed[0]));
        // With two sensors one pixel is more than noise.
        let few = Perturbation::all(&Sizes::default(), &setting().body, RolloutMode::Fresh);
        assert!(few.iter().all(|p| p.kind() != PerturbationKind::Pixel));
        let blind = PerturbedSetting {
            body: "33/44".parse().unwrap(),
            ..setting()
        };
        let pixel = Perturbation::Pixel { draw: 1, seed: 1 };
        assert_eq!(pixel.apply(&blind), blind);
    }

    #[test]
    fn starts_are_raised_and_limits_removed_by_turns_within_each_class() {
        let conditions = |classes: &[u8], start: u32, length_limits: bool| {
            ByTurns {
                start,
                length_limits,
            }
            .of(classes.iter().copied())
        };
        let of = |turns: &[(u32, bool)]| -> Vec<Condition> {
            turns
                .iter()
                .map(|(rows, without)| condition(*rows, *without))
                .collect()
        };
        let (with, without) = (false, true);
        let raised = [0, 0, 1, 1, 2, 2, 0, 0].map(|rows| (rows, with));
        assert_eq!(conditions(&[0, 1, 0, 1, 0, 1, 0, 7], 2, false), of(&raised));
        assert_eq!(
            conditions(&[0, 0], u32::MAX, true),
            of(&[(0, with), (1, with)])
        );
        let limits = [with, with, without, without, with].map(|w| (0, w));
        assert_eq!(conditions(&[4, 5, 4, 5, 4], 0, true), of(&limits));
        let every = [(0, with), (1, with), (0, without), (1, without)];
        assert_eq!(conditions(&[3; 4], 1, true), of(&every));
        assert_eq!(
            ByTurns {
                start: 1,
                length_limits: true
            }
            .conditions()
            .collect::<Vec<_>>(),
            of(&every)
        );
        assert_eq!(
            ByTurns {
                start: 2,
                length_limits: false
            }
            .conditions()
            .count(),
            3
        );
        let json = serde_json::to_string(&condition(1, true)).unwrap();
        assert_eq!(
            json,
            r#"[{"kind":"start","amount":1.0},{"kind":"length_limits","amount":0.0}]"#
        );
        for perturbation in all(RolloutMode::Sequential) {
            let json = serde_json::to_string(&perturbation).unwrap();
            assert_eq!(
                serde_json::from_str::<Perturbation>(&json).unwrap(),
                perturbation
            );
        }
        let half =
            serde_json::from_str::<Perturbation>(r#"{"kind":"start","amount":0.5}"#).unwrap_err();
        assert!(
            half.to_string()
                .contains("amount 0.5: expected a whole number"),
            "{half}"
        );
    }

    #[test]
    fn names_are_distinct_and_a_mirror_image_walks_the_other_way() {
        let all = all(RolloutMode::Sequential);
        let mut names: Vec<String> = all.iter().map(Perturbation::name).collect();
        assert!(
            names.contains(&"time step / 4".to_string())
                && names.contains(&"gravity -5 %".to_string())
        );
        names.sort();
        names.dedup();
        assert_eq!(names.len(), all.len());
        let excused: Vec<String> = all
            .iter()
            .filter(|p| !p.counts_if_unstable())
            .map(Perturbation::name)
            .collect();
        assert_eq!(excused, ["length limits beyond all goals"]);
        for perturbation in all {
            let expected = match perturbation.kind() {
                PerturbationKind::Mirror => [-2.0, -3.0],
                PerturbationKind::Order => [3.0, 2.0],
                _ => [2.0, 3.0],
            };
            assert_eq!(perturbation.undo(vec![2.0, 3.0]), expected);
        }
        // Fresh rollouts have no order.
        let fresh = super::tests::all(RolloutMode::Fresh);
        assert!(
            fresh.iter().all(|p| p.kind() != PerturbationKind::Order)
                && fresh.len() + 1 == names.len()
        );
    }
}
