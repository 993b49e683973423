//! [`Targets`]: the lengths that a scenario asks its actuators for.

use schemars::JsonSchema;
use serde::de::{Error as _, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer};
use std::f64::consts::TAU;
use std::fmt;

/// Most memory for listed targets \[bytes\].
const MOST: usize = 128 << 20;

/// The targets of all actuators at every control step, row-major as the body, in voxel lengths.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Targets {
    /// One list for each control step; after the last, the first follows.
    Listed {
        /// Number of actuators in each.
        actuators: usize,
        lengths: Vec<f64>,
    },
    /// A sine for each actuator.
    Periodic(Wave),
}

/// Targets `mean + amplitude · sin(2π · step / period + phase)`, the first step being 0.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wave {
    /// Mean target, in voxel lengths.
    mean: f64,
    /// Amplitude, in voxel lengths; targets are clipped to 0.6 to 1.6.
    amplitude: f64,
    /// Control steps of a cycle.
    period: f64,
    /// Phase of each actuator, in radians.
    phases: Vec<f64>,
}

/// The forms of targets in a file, for the schema alone.
#[derive(JsonSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "describes the file")]
pub(crate) enum TargetsForm {
    /// One list for each control step, a number for each actuator; after the last, the first follows.
    Listed(Vec<Vec<f64>>),
    /// A sine for each actuator.
    Periodic(Wave),
}

impl Targets {
    /// Checks them for a body with so many actuators.
    pub(crate) fn validate(&self, actuators: usize) -> Result<(), String> {
        let counted = |found: usize, key: &str| match found == actuators {
            true => Ok(()),
            false => Err(format!(
                "{key}: expected a number for each of the body's {actuators} actuators (7 and 8), found {found}"
            )),
        };
        match self {
            Targets::Listed {
                actuators: found,
                lengths,
            } => {
                counted(*found, "targets[0]")?;
                match lengths.iter().position(|length| !length.is_finite()) {
                    None => Ok(()),
                    Some(at) => Err(format!(
                        "targets[{}]: expected finite numbers",
                        at / actuators.max(1)
                    )),
                }
            }
            Targets::Periodic(Wave {
                mean,
                amplitude,
                period,
                phases,
            }) => {
                counted(phases.len(), "targets.phases")?;
                let is_finite = [mean, amplitude].into_iter().chain(phases);
                if !is_finite.copied().all(f64::is_finite) {
                    return Err("targets: expected finite numbers".to_string());
                }
                match *period > 0.0 && period.is_finite() {
                    true => Ok(()),
                    false => Err(format!(
                        "targets.period: {period}, expected a number of control steps above 0"
                    )),
                }
            }
        }
    }

    /// Writes the targets at a control step, the first being 0.
    pub(crate) fn at(&self, step: u64, targets: &mut Vec<f64>) {
        targets.clear();
        match self {
            Targets::Listed { actuators, lengths } => {
                let count = lengths.len() / actuators.max(&1);
                let first = (step % count.max(1) as u64) as usize * actuators;
                targets.extend(lengths.iter().skip(first).take(*actuators));
            }
            Targets::Periodic(Wave {
                mean,
                amplitude,
                period,
                phases,
            }) => {
                let cycle = TAU * step as f64 / period;
                let target = |phase: &f64| mean + amplitude * libm::sin(cycle + phase);
                targets.extend(phases.iter().map(target));
            }
        }
    }

    /// Returns the number of control steps that are listed.
    pub(crate) fn listed(&self) -> Option<u64> {
        match self {
            Targets::Listed { actuators, lengths } => Some((lengths.len() / actuators) as u64),
            Targets::Periodic(_) => None,
        }
    }
}

impl<'de> Deserialize<'de> for Targets {
    fn deserialize<D: Deserializer<'de>>(reader: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Targets;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a list for each control step, or mean, amplitude, period and phases")
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Targets, A::Error> {
                Wave::deserialize(MapAccessDeserializer::new(map)).map(Targets::Periodic)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Targets, A::Error> {
                let (mut lengths, mut actuators, mut steps) = (Vec::new(), 0, 0);
                while let Some(targets) = list.next_element::<Vec<f64>>()? {
                    if steps == 0 {
                        actuators = targets.len();
                    }
                    if targets.len() != actuators || targets.is_empty() {
                        return Err(A::Error::custom(format!(
                            "expected the same actuators at every step, one or more: step 0 has {actuators}, \
                             step {steps} {}",
                            targets.len()
                        )));
                    }
                    lengths.extend(targets);
                    steps += 1;
                    if lengths.len() * size_of::<f64>() > MOST {
                        return Err(A::Error::custom(format!(
                            "expected targets that need at most {} MB of memory: {steps} steps do",
                            MOST >> 20
                        )));
                    }
                }
                match steps {
                    0 => Err(A::Error::custom(
                        "expected targets of one control step or more",
                    )),
                    _ => Ok(Targets::Listed { actuators, lengths }),
                }
            }
        }
        reader.deserialize_any(Either)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Targets, String> {
        serde_json::from_str(text).map_err(|error| error.to_string())
    }

    fn at(targets: &Targets, step: u64) -> Vec<f64> {
        let mut found = vec![9.0];
        targets.at(step, &mut found);
        found
    }

    #[test]
    fn a_list_begins_again_after_its_last_step() {
        let targets = parsed("[[1, 1.5], [0.6, 0.7]]").unwrap();
        assert_eq!(
            (at(&targets, 0), at(&targets, 3)),
            (vec![1.0, 1.5], vec![0.6, 0.7])
        );
        assert_eq!(targets.listed(), Some(2));
        assert_eq!(targets.validate(2), Ok(()));
        assert!(targets.validate(3).unwrap_err().contains("targets[0]"));
    }

    #[test]
    fn a_wave_is_a_sine_with_the_phase_of_each_actuator() {
        let wave = r#"{"mean": 1.1, "amplitude": 0.5, "period": 25, "phases": [0, 1.7]}"#;
        let targets = parsed(wave).unwrap();
        let expected = [0.0, 1.7].map(|phase: f64| 1.1 + 0.5 * (TAU * 7.0 / 25.0 + phase).sin());
        for (found, expected) in at(&targets, 7).into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-15);
        }
        assert_eq!(targets.listed(), None);
        assert!(targets.validate(1).unwrap_err().contains("targets.phases"));
        let still = parsed(&wave.replace("25", "0")).unwrap();
        assert!(still.validate(2).unwrap_err().contains("targets.period: 0"));
    }

    #[test]
    fn other_forms_are_refused_with_what_is_expected() {
        for (text, words) in [
            ("7", "a list for each control step"),
            ("[]", "one control step or more"),
            ("[[1], [1, 1]]", "step 1 2"),
            ("[[]]", "one or more"),
            (r#"{"mean": 1}"#, "missing field `amplitude`"),
            (r#"{"meen": 1}"#, "unknown field `meen`"),
        ] {
            let error = parsed(text).unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
