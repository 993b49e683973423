//! [`Condition`]: under what a robot is shown a training image, so that evolution cannot live off what an audit changes.

use serde::{Deserialize, Serialize};

/// In what a fresh life differs from what protocol and physics say. The default is not at all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Rows by which the start is raised.
    pub raised: u32,
    /// Whether the length limits are beyond every goal ([`Physics::without_limits`](crate::sim::Physics::without_limits)). Who becomes unstable then gets nowhere:
    /// its displacement is 0.
    pub without_limits: bool,
}

impl Condition {
    /// Those under which a response is measured, by turns: as ever; and raised by a row and without length limits, so that
    /// luck at the first touch of the ground, or at a limit, is no response.
    pub const OF_RESPONSE: [Condition; 2] =
        [Condition { raised: 0, without_limits: false }, Condition { raised: 1, without_limits: true }];

    /// Conditions of images of these classes. Within each class for itself, by turns: starts raised by no row up to `most`, and
    /// then the same again without length limits, if such lives are wanted.
    pub fn by_turns(classes: impl Iterator<Item = u8>, most: u32, without_limits: bool) -> Vec<Self> {
        let mut turns = [0_u64; u8::MAX as usize + 1];
        let starts = u64::from(most) + 1;
        let condition = |class: u8| {
            let turn = turns[usize::from(class)];
            turns[usize::from(class)] += 1;
            Condition {
                raised: (turn % starts) as u32,
                without_limits: without_limits && (turn / starts) % 2 == 1,
            }
        };
        classes.map(condition).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_are_raised_and_limits_removed_by_turns_within_each_class() {
        let conditions = |classes: &[u8], most: u32, without_limits: bool| {
            let all = Condition::by_turns(classes.iter().copied(), most, without_limits);
            all.iter().map(|c| (c.raised, c.without_limits)).collect::<Vec<_>>()
        };
        let classes = [0, 1, 0, 1, 0, 1, 0, 7];
        let raised: Vec<u32> = conditions(&classes, 2, false).into_iter().map(|(raised, _)| raised).collect();
        assert_eq!(raised, [0, 0, 1, 1, 2, 2, 0, 0]);
        assert_eq!(conditions(&classes, 0, false), [(0, false); 8]);
        assert_eq!(conditions(&[0, 0], u32::MAX, true), [(0, false), (1, false)]);
        let (with, without) = (false, true);
        assert_eq!(
            conditions(&[4, 5, 4, 5, 4], 0, true),
            [with, with, without, without, with].map(|w| (0, w))
        );
        let every = [(0, with), (1, with), (0, without), (1, without), (0, with)];
        assert_eq!(conditions(&[3; 5], 1, true), every);
    }
}
