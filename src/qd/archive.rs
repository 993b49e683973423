//! [`Archive`]: the best solution found so far in every cell.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize, Serializer};
use std::collections::BTreeMap;

/// The best solution of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Elite<S> {
    /// Index of its cell, see [`crate::qd::DescriptorSpace`].
    pub(crate) cell: usize,
    /// Its fitness, finite.
    pub(crate) objective: f64,
    pub(crate) solution: S,
}

/// At most one [`Elite`] per cell (Mouret & Clune 2015). In files a list in the cells' order.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Vec<Elite<S>>", bound(deserialize = "S: Deserialize<'de>"))]
pub struct Archive<S> {
    elites: BTreeMap<usize, Elite<S>>,
}

/// The outcome of an insertion into an [`Archive`].
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Insertion<S> {
    New,
    /// The solution is strictly fitter than the elite it replaced.
    Improved {
        old: Elite<S>,
    },
    /// The existing elite is as fit or fitter.
    Rejected,
}

#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(crate) enum ArchiveError {
    #[error("cell {cell}: the objective is {objective}, expected a finite number")]
    Objective {
        cell: usize,
        /// The objective found.
        objective: f64,
    },
    #[error("cell {0} holds two elites, expected at most one")]
    Occupied(usize),
}

/// Figures of an archive: pyribs' `ArchiveStats` for an archive of the possible cells alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ArchiveStats {
    /// Number of elites.
    pub(crate) num_elites: usize,
    /// Elites per possible cell.
    pub(crate) coverage: f64,
    /// Σ (objective − offset) over the elites; negative if they are below the offset on average.
    pub(crate) qd_score: f64,
    /// QD score per possible cell.
    pub(crate) norm_qd_score: f64,
    /// Largest objective, none in an empty archive.
    pub obj_max: Option<f64>,
    /// Mean objective, none in an empty archive.
    pub(crate) obj_mean: Option<f64>,
}

impl<S> Archive<S> {
    pub(crate) fn new() -> Self {
        Archive {
            elites: BTreeMap::new(),
        }
    }

    /// Puts a solution into its cell if that is empty or its elite is strictly less fit.
    pub(crate) fn insert(&mut self, new: Elite<S>) -> Result<Insertion<S>, ArchiveError> {
        let Elite {
            cell, objective, ..
        } = new;
        if !objective.is_finite() {
            return Err(ArchiveError::Objective { cell, objective });
        }
        if self
            .objective(cell)
            .is_some_and(|incumbent| objective <= incumbent)
        {
            return Ok(Insertion::Rejected);
        }
        let old = self.elites.insert(cell, new);
        Ok(old.map_or(Insertion::New, |old| Insertion::Improved { old }))
    }

    /// Removes all but the `count` fittest of each kind; the first cells win a tie.
    pub(crate) fn retain_fittest<K: Ord>(&mut self, count: usize, kind: impl Fn(&S) -> K) {
        let mut ranked: Vec<(f64, usize)> = self.elites().map(|e| (e.objective, e.cell)).collect();
        // A stable sort: elites come in the order of their cells.
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut kept: BTreeMap<K, usize> = BTreeMap::new();
        for (_, cell) in ranked {
            let Some(elite) = self.elites.get(&cell) else {
                continue;
            };
            let kept = kept.entry(kind(&elite.solution)).or_default();
            *kept += 1;
            if *kept > count {
                self.elites.remove(&cell);
            }
        }
    }

    /// Returns the objective of the `count`-th fittest elite (from 1) of a kind, if it exists.
    pub(crate) fn nth_fittest(&self, count: usize, of: impl Fn(&S) -> bool) -> Option<f64> {
        let mut objectives: Vec<f64> = self
            .elites()
            .filter(|e| of(&e.solution))
            .map(|e| e.objective)
            .collect();
        objectives.sort_by(|a, b| b.total_cmp(a));
        objectives.get(count.checked_sub(1)?).copied()
    }

    pub(crate) fn get(&self, cell: usize) -> Option<&Elite<S>> {
        self.elites.get(&cell)
    }

    pub(crate) fn objective(&self, cell: usize) -> Option<f64> {
        self.get(cell).map(|elite| elite.objective)
    }

    pub(crate) fn len(&self) -> usize {
        self.elites.len()
    }

    /// Iterates over the elites in the order of their cells.
    pub(crate) fn elites(&self) -> impl Iterator<Item = &Elite<S>> {
        self.elites.values()
    }

    /// Returns the fittest elite; the first cell wins a tie.
    pub(crate) fn best(&self) -> Option<&Elite<S>> {
        self.elites().reduce(|best, e| {
            if e.objective > best.objective {
                e
            } else {
                best
            }
        })
    }

    /// Computes the figures of an archive with this many `possible` cells; `qd_offset` is pyribs'
    /// `qd_score_offset`.
    pub fn stats(&self, possible: usize, qd_offset: f64) -> ArchiveStats {
        let (num_elites, cells) = (self.len(), possible.max(1) as f64);
        // (`sum` of nothing would be −0.)
        let sum = |term: fn(f64, f64) -> f64| {
            self.elites()
                .fold(0.0, |s, e| s + term(e.objective, qd_offset))
        };
        let qd_score = sum(|objective, offset| objective - offset);
        let total = sum(|objective, _| objective);
        ArchiveStats {
            num_elites,
            coverage: num_elites as f64 / cells,
            qd_score,
            norm_qd_score: qd_score / cells,
            obj_max: self.best().map(|e| e.objective),
            obj_mean: (num_elites > 0).then(|| total / num_elites as f64),
        }
    }
}

impl<S> Default for Archive<S> {
    fn default() -> Self {
        Archive::new()
    }
}

impl<S: Serialize> Serialize for Archive<S> {
    fn serialize<T: Serializer>(&self, serializer: T) -> Result<T::Ok, T::Error> {
        serializer.collect_seq(self.elites())
    }
}

impl<S> TryFrom<Vec<Elite<S>>> for Archive<S> {
    type Error = ArchiveError;
    fn try_from(elites: Vec<Elite<S>>) -> Result<Self, ArchiveError> {
        let mut archive = Archive::new();
        for elite in elites {
            let cell = elite.cell;
            if archive.get(cell).is_some() {
                return Err(ArchiveError::Occupied(cell));
            }
            archive.insert(elite)?;
        }
        Ok(archive)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn elite(cell: usize, objective: f64, solution: char) -> Elite<char> {
        Elite {
            cell,
            objective,
            solution,
        }
    }

    #[test]
    fn only_the_strictly_fitter_replace_an_elite() {
        let mut archive = Archive::new();
        assert_eq!(archive.insert(elite(3, -1.0, 'a')), Ok(Insertion::New));
        assert_eq!(archive.insert(elite(3, -1.0, 'b')), Ok(Insertion::Rejected));
        let old = elite(3, -1.0, 'a');
        assert_eq!(
            archive.insert(elite(3, 2.0, 'c')),
            Ok(Insertion::Improved { old })
        );
        assert_eq!(archive.insert(elite(3, 1.0, 'd')), Ok(Insertion::Rejected));
        assert_eq!(
            (archive.get(3), archive.len()),
            (Some(&elite(3, 2.0, 'c')), 1)
        );
    }

    #[test]
    fn the_fittest_of_each_kind_can_be_kept() {
        let told = [
            (5, 2.0, 'a'),
            (1, 2.0, 'a'),
            (2, 3.0, 'a'),
            (7, -1.0, 'b'),
            (8, 0.0, 'b'),
            (9, 9.0, 'c'),
        ];
        let elites = told
            .map(|(cell, objective, kind)| elite(cell, objective, kind))
            .to_vec();
        let kept = |count| {
            let mut archive = Archive::try_from(elites.clone()).unwrap();
            archive.retain_fittest(count, |kind| *kind);
            archive.elites().map(|e| e.cell).collect::<Vec<_>>()
        };
        assert_eq!(kept(1), [2, 8, 9]);
        assert_eq!(kept(2), [1, 2, 7, 8, 9]);
        assert_eq!(kept(3).len(), 6);
        assert!(kept(0).is_empty());
        let archive = Archive::try_from(elites.clone()).unwrap();
        let nth = |count, kind| archive.nth_fittest(count, |k| *k == kind);
        assert_eq!(
            [nth(0, 'a'), nth(1, 'a'), nth(3, 'a'), nth(4, 'a')],
            [None, Some(3.0), Some(2.0), None]
        );
    }

    #[test]
    fn what_is_not_a_number_never_enters() {
        let mut archive = Archive::new();
        for objective in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(matches!(
                archive.insert(elite(0, objective, 'a')),
                Err(ArchiveError::Objective { .. })
            ));
        }
        assert_eq!(archive.len(), 0);
    }

    #[test]
    fn figures_are_those_of_pyribs() {
        #[derive(Deserialize)]
        struct Case {
            cells: usize,
            qd_score_offset: f64,
            told: Vec<(usize, f64)>,
            stats: ArchiveStats,
        }
        let text = include_str!("../../tests/pyribs/stats.json");
        let cases: Vec<Case> = serde_json::from_str(text).unwrap();
        assert!(cases.len() > 3 && cases.iter().any(|case| case.stats.qd_score < 0.0));
        for Case {
            cells,
            qd_score_offset,
            told,
            stats: theirs,
        } in cases
        {
            let mut archive = Archive::new();
            for (cell, objective) in told {
                archive.insert(elite(cell, objective, 'x')).unwrap();
            }
            let ours = archive.stats(cells, qd_score_offset);
            assert_eq!(
                (ours.num_elites, ours.obj_max),
                (theirs.num_elites, theirs.obj_max)
            );
            assert_eq!(
                (ours.coverage, ours.obj_mean.is_some()),
                (theirs.coverage, theirs.obj_mean.is_some())
            );
            // pyribs adds up in the order of insertion, we in the order of cells.
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * (1.0 + b.abs());
            assert!(near(ours.qd_score, theirs.qd_score), "{ours:?} {theirs:?}");
            assert!(
                near(ours.norm_qd_score, theirs.norm_qd_score),
                "{ours:?} {theirs:?}"
            );
            assert!(
                near(ours.obj_mean.unwrap_or(0.0), theirs.obj_mean.unwrap_or(0.0)),
                "{ours:?} {theirs:?}"
            );
        }
    }

    #[test]
    fn files_hold_a_list_in_the_order_of_cells() {
        let mut archive = Archive::new();
        archive.insert(elite(7, 4.0, 'b')).unwrap();
        archive.insert(elite(2, 0.5, 'a')).unwrap();
        let text = serde_json::to_string(&archive).unwrap();
        let first = r#"{"cell":2,"objective":0.5,"solution":"a"}"#;
        assert_eq!(
            text,
            format!(r#"[{first},{{"cell":7,"objective":4.0,"solution":"b"}}]"#)
        );
        assert_eq!(
            serde_json::from_str::<Archive<char>>(&text).unwrap(),
            archive
        );
        let twice =
            serde_json::from_str::<Archive<char>>(&format!("[{first},{first}]")).unwrap_err();
        assert!(twice.to_string().contains("cell 2 holds two"), "{twice}");
    }

    proptest! {
        #[test]
        fn every_cell_holds_the_first_of_its_fittest(
            told in prop::collection::vec((0..5usize, -3..3i32), 0..50)
        ) {
            let mut archive = Archive::new();
            for (order, (cell, objective)) in told.iter().enumerate() {
                archive.insert(Elite { cell: *cell, objective: f64::from(*objective), solution: order }).unwrap();
            }
            for cell in 0..5 {
                let here = || told.iter().enumerate().filter(|(_, t)| t.0 == cell);
                let best = here().map(|(_, t)| t.1).max();
                let first = here().find(|(_, t)| Some(t.1) == best).map(|(order, _)| order);
                prop_assert_eq!(archive.get(cell).map(|e| e.solution), first);
            }
            prop_assert!(archive.elites().is_sorted_by_key(|e| e.cell));
        }
    }
}
