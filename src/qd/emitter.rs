//! [`EmitterParams`]: the composition of a generation; [`Variation`]: the making of its solutions.

use crate::base::random::{Purpose, stream};
use crate::qd::archive::Archive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::num::NonZeroU16;

/// Sizes of generations (paper, section "MAP-Elites"); keys of a config's section `[map_elites]`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EmitterParams {
    /// Random individuals of the first generation. Default 20, the paper's.
    ///
    /// Also of later ones, as long as the archive is empty.
    pub(crate) initial: NonZeroU16,
    /// Most elites per generation that have a mutated offspring. Default 20, the paper's.
    pub parents: u16,
    /// Random individuals of each later generation. Default 0.
    pub(crate) random_immigrants: u16,
}

impl Default for EmitterParams {
    fn default() -> Self {
        let initial = NonZeroU16::MIN.saturating_add(19);
        EmitterParams {
            initial,
            parents: 20,
            random_immigrants: 0,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Proposal {
    /// Generation, from 0.
    pub(crate) generation: u64,
    /// Number within the generation, from 0.
    pub(crate) child: u64,
    /// Cell of its parent; `None` for a random individual.
    pub(crate) parent: Option<usize>,
}

/// Makes solutions. All chance must come from streams of (generation, child) and the run's seed, so
/// that solutions may be made in any order and on any thread.
pub(crate) trait Variation<S> {
    type Error;

    fn random_immigrant(&self, generation: u64, child: u64) -> Result<S, Self::Error>;

    fn offspring(&self, parent: &S, generation: u64, child: u64) -> Result<S, Self::Error>;
}

impl EmitterParams {
    /// Returns the composition of `generation`: offspring of different elites drawn uniformly, then
    /// random immigrants. While the archive is empty (in the first generation, and later if no
    /// individual was stable), all are random individuals.
    pub(crate) fn ask<S>(&self, archive: &Archive<S>, seed: u64, generation: u64) -> Vec<Proposal> {
        let cells: Vec<usize> = archive.elites().map(|e| e.cell).collect();
        let mut rng = stream(seed, Purpose::Parents, generation, 0);
        let drawn = rng.sample(cells.len(), usize::from(self.parents));
        let random_immigrants = if cells.is_empty() {
            self.initial.get()
        } else {
            self.random_immigrants
        };
        let parents = drawn.into_iter().map(|i| Some(cells[i]));
        let all = parents.chain((0..random_immigrants).map(|_| None));
        all.zip(0..)
            .map(|(parent, child)| Proposal {
                generation,
                child,
                parent,
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qd::archive::Elite;

    fn archive(cells: impl IntoIterator<Item = usize>) -> Archive<()> {
        let elites: Vec<_> = cells
            .into_iter()
            .map(|cell| Elite {
                cell,
                objective: 0.0,
                solution: (),
            })
            .collect();
        elites.try_into().unwrap()
    }

    #[test]
    fn the_first_generation_and_any_before_the_first_elite_is_random() {
        for generation in [0, 1, 2] {
            let asked = EmitterParams::default().ask(&archive([]), 1, generation);
            assert_eq!(asked.len(), 20);
            assert!(
                asked
                    .iter()
                    .all(|p| p.parent.is_none() && p.generation == generation)
            );
        }
    }

    #[test]
    fn parents_are_different_elites_and_random_immigrants_come_after() {
        let params = EmitterParams {
            parents: 5,
            random_immigrants: 2,
            ..EmitterParams::default()
        };
        let asked = params.ask(&archive((0..90).map(|i| 3 * i)), 1, 4);
        assert_eq!(
            asked.iter().map(|p| p.child).collect::<Vec<_>>(),
            [0, 1, 2, 3, 4, 5, 6]
        );
        let mut parents: Vec<usize> = asked.iter().filter_map(|p| p.parent).collect();
        parents.sort_unstable();
        parents.dedup();
        assert!(parents.len() == 5 && parents.iter().all(|p| p % 3 == 0));
        assert!(asked[5..].iter().all(|p| p.parent.is_none()));
        // Fewer elites than parents: fewer offspring.
        assert_eq!(params.ask(&archive([8, 9]), 1, 4).len(), 4);
    }

    #[test]
    fn every_elite_is_as_likely_a_parent_and_seeds_and_generations_differ() {
        let (params, archive) = (EmitterParams::default(), archive(0..90));
        let mut hits = [0; 90];
        for generation in 0..4500 {
            let asked = params.ask(&archive, 1, generation);
            asked.iter().for_each(|p| hits[p.parent.unwrap()] += 1);
        }
        assert!(hits.iter().all(|h| (850..1150).contains(h)), "{hits:?}");
        assert_ne!(params.ask(&archive, 1, 3), params.ask(&archive, 2, 3));
        assert_eq!(params.ask(&archive, 1, 3), params.ask(&archive, 1, 3));
    }

    #[test]
    fn sizes_in_files_have_the_papers_defaults_and_are_checked() {
        let read =
            |text: &str| serde_json::from_str::<EmitterParams>(text).map_err(|e| e.to_string());
        let params = read("{}").unwrap();
        assert_eq!(
            (
                params.initial.get(),
                params.parents,
                params.random_immigrants
            ),
            (20, 20, 0)
        );
        assert!(read(r#"{"initial": 0}"#).unwrap_err().contains("nonzero"));
        assert!(read(r#"{"parent": 5}"#).unwrap_err().contains("parent"));
    }
}
