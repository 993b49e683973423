//! [`Probing`]: the measurement of a gait's response.

use crate::base::Grid;
use crate::base::random::{Purpose, stream};
use crate::body::{Body, Material};
use crate::response::gait::{Gait, random_image};
use crate::response::regression::{RandomRollout, Response};
use crate::sim::Physics;
use crate::task::perturbation::Condition;
use std::ops::Range;

/// Random images, numbered from 0, for a gait's probe, and the conditions that they take in turn.
#[derive(Clone, Debug)]
pub struct Probing {
    /// Every condition once.
    conditions: Vec<Condition>,
    seed: u64,
}

impl Probing {
    /// Makes a probing under these conditions; repeated ones count once.
    pub fn new(conditions: &[Condition], seed: u64) -> Self {
        let mut once: Vec<Condition> = Vec::new();
        for condition in conditions {
            if !once.contains(condition) {
                once.push(condition.clone());
            }
        }
        Probing {
            conditions: once,
            seed,
        }
    }

    /// Returns the conditions, each once, in the order of their numbers.
    pub(crate) fn conditions(&self) -> &[Condition] {
        &self.conditions
    }

    /// Simulates a gait's probe under the random images with these numbers and returns the stable
    /// rollouts. `roll` returns a body's displacements under images and conditions, `None` if
    /// unstable.
    ///
    /// # Errors
    /// Returns those of `roll`.
    pub fn shown<E>(
        &self,
        gait: &Gait,
        physics: &Physics,
        numbers: Range<usize>,
        roll: impl FnOnce(&Body, &[Grid<f64>], &[Condition]) -> Result<Vec<Option<f64>>, E>,
    ) -> Result<Vec<RandomRollout>, E> {
        let probe = gait.probe();
        let image = |number: usize| {
            let mut random = stream(self.seed, Purpose::RandomImages, 0, number as u64);
            random_image(probe.height(), probe.width(), physics, &mut random)
        };
        let condition = |number: usize| number % self.conditions.len();
        let stimuli: Vec<Grid<f64>> = numbers.clone().map(image).collect();
        let conditions: Vec<Condition> = numbers
            .clone()
            .map(|number| self.conditions[condition(number)].clone())
            .collect();
        let displacements = roll(&probe, &stimuli, &conditions)?;
        let design = vec![Material::SensorExpand; gait.places().len()];
        let shown = numbers.zip(&stimuli).zip(displacements).filter_map(
            |((number, stimulus), displacement)| {
                let widths = gait.widths(&design, stimulus, physics);
                Some(RandomRollout {
                    widths,
                    displacement: displacement?,
                    condition: condition(number),
                })
            },
        );
        Ok(shown.collect())
    }
}

/// Returns the response from `shown` of all `rollouts`; `None` if most are unstable or few stable.
pub(crate) fn response(shown: &[RandomRollout], rollouts: usize) -> Option<Response> {
    if 2 * shown.len() > rollouts {
        Response::of(shown)
    } else {
        None
    }
}
