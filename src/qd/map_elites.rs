//! [`MapElites`]: propose a generation, make and evaluate it, add it to the archive.

use crate::qd::archive::{Archive, ArchiveError, Elite, Insertion};
use crate::qd::emitter::{EmitterParams, Proposal, Variation};

/// MAP-Elites (Mouret & Clune 2015; paper, section "MAP-Elites").
///
/// [`ask`](MapElites::ask) proposes a generation; its solutions are [`make`](MapElites::make)d and
/// evaluated in any order and on any threads; [`tell`](MapElites::tell) adds them to the archive in
/// the order of their numbers. So nothing depends on which was first.
#[derive(Clone, Debug)]
pub(crate) struct MapElites<S> {
    seed: u64,
    params: EmitterParams,
    archive: Archive<S>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Evaluated<S> {
    /// Number within the generation.
    pub(crate) child: u64,
    pub(crate) cell: usize,
    /// Its fitness, finite.
    pub(crate) objective: f64,
    pub(crate) solution: S,
}

impl<S> MapElites<S> {
    /// Starts a search with an archive, or continues one.
    pub(crate) fn new(seed: u64, params: EmitterParams, archive: Archive<S>) -> Self {
        MapElites {
            seed,
            params,
            archive,
        }
    }

    pub(crate) fn archive(&self) -> &Archive<S> {
        &self.archive
    }

    pub(crate) fn retain_fittest<K: Ord>(&mut self, count: usize, kind: impl Fn(&S) -> K) {
        self.archive.retain_fittest(count, kind);
    }

    pub(crate) fn ask(&self, generation: u64) -> Vec<Proposal> {
        self.params.ask(&self.archive, self.seed, generation)
    }

    /// Makes one solution of a generation (a random immigrant if the proposal's cell has no elite).
    pub(crate) fn make<V: Variation<S>>(
        &self,
        proposal: Proposal,
        variation: &V,
    ) -> Result<S, V::Error> {
        let Proposal {
            generation,
            child,
            parent,
        } = proposal;
        match parent.and_then(|cell| self.archive.get(cell)) {
            Some(elite) => variation.offspring(&elite.solution, generation, child),
            None => variation.random_immigrant(generation, child),
        }
    }

    /// Adds the solutions of a generation to the archive, in the order of their numbers, and
    /// returns the outcome of each. Leave out solutions without fitness (unstable rollouts).
    pub(crate) fn tell(
        &mut self,
        mut generation: Vec<Evaluated<S>>,
    ) -> Result<Vec<(u64, Insertion<S>)>, ArchiveError> {
        generation.sort_by_key(|e| e.child);
        let told = generation.into_iter().map(
            |Evaluated {
                 child,
                 cell,
                 objective,
                 solution,
             }| {
                Ok((
                    child,
                    self.archive.insert(Elite {
                        cell,
                        objective,
                        solution,
                    })?,
                ))
            },
        );
        told.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};
    use rayon::prelude::*;
    use std::convert::Infallible;

    /// A random walk of numbers.
    struct Walk;

    impl Variation<f64> for Walk {
        type Error = Infallible;
        fn random_immigrant(&self, generation: u64, child: u64) -> Result<f64, Infallible> {
            Ok(stream(1, Purpose::RandomImmigrant, generation, child).unit())
        }
        fn offspring(&self, parent: &f64, generation: u64, child: u64) -> Result<f64, Infallible> {
            Ok(parent + stream(1, Purpose::Mutation, generation, child).normal())
        }
    }

    fn evaluated(proposal: &Proposal, solution: f64) -> Evaluated<f64> {
        let cell = (solution.abs() * 4.0) as usize % 10;
        Evaluated {
            child: proposal.child,
            cell,
            objective: (solution * 7.0).sin(),
            solution,
        }
    }

    fn search(generations: u64, parallel: bool) -> Archive<f64> {
        let mut search = MapElites::new(1, EmitterParams::default(), Archive::new());
        for generation in 0..generations {
            let asked = search.ask(generation);
            let make = |p: &Proposal| evaluated(p, search.make(*p, &Walk).unwrap());
            let made = match parallel {
                true => asked.par_iter().rev().map(make).collect(),
                false => asked.iter().map(make).collect(),
            };
            search.tell(made).unwrap();
        }
        search.archive
    }

    #[test]
    fn archives_depend_on_neither_threads_nor_order() {
        let archive = search(100, false);
        assert_eq!(search(100, true), archive);
        assert_eq!(archive.len(), 10);
        assert!(archive.stats(10, 0.0).qd_score > search(5, false).stats(10, 0.0).qd_score);
    }

    #[test]
    fn a_search_goes_on_from_a_stored_archive_as_if_it_never_stopped() {
        let text = serde_json::to_string(&search(50, false)).unwrap();
        let mut resumed = MapElites::new(
            1,
            EmitterParams::default(),
            serde_json::from_str(&text).unwrap(),
        );
        for generation in 50..100 {
            let asked = resumed.ask(generation);
            let made = asked
                .iter()
                .map(|p| evaluated(p, resumed.make(*p, &Walk).unwrap()))
                .collect();
            resumed.tell(made).unwrap();
        }
        assert_eq!(resumed.archive, search(100, false));
    }

    #[test]
    fn the_first_child_keeps_the_cell_against_an_equal() {
        let mut search = MapElites::new(1, EmitterParams::default(), Archive::new());
        let child = |child, solution| Evaluated {
            child,
            cell: 0,
            objective: 1.0,
            solution,
        };
        let told = search.tell(vec![child(1, 'b'), child(0, 'a')]).unwrap();
        assert_eq!(told, [(0, Insertion::New), (1, Insertion::Rejected)]);
        assert_eq!(search.archive().get(0).unwrap().solution, 'a');
        let error = Evaluated {
            child: 2,
            cell: 0,
            objective: f64::NAN,
            solution: 'c',
        };
        assert!(search.tell(vec![error]).is_err());
    }
}
