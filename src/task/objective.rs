//! [`Objective`]: what evolution maximises.

use crate::base::Grid;
use crate::body::{Body, key};
use crate::sim::Physics;
use crate::task::answer::Answer;
use crate::task::evaluation::MayWin;
use crate::task::grouping::Grouping;
use crate::task::perturbation::Condition;
use std::borrow::Cow;

/// The objective of evolution: what is simulated for a candidate, and what its fitness counts.
pub(crate) trait Objective: Sync {
    /// Returns images and conditions, given the training images as sensors see them, in \[0, 1\].
    fn prepare(
        &self,
        stimuli: Vec<Grid<f64>>,
        physics: &Physics,
        seed: u64,
    ) -> (Vec<Grid<f64>>, Vec<Condition>);

    /// Returns the body that is simulated for a candidate's.
    fn simulated<'b>(&self, body: &'b Body) -> Cow<'b, Body>;

    /// Returns the key by which a candidate's body counts as evaluated.
    fn known_key(&self, body: &Body) -> [u8; 16] {
        key(&self.simulated(body))
    }

    /// Returns true if a known body may be evaluated again, where `savings` does not forbid it.
    fn may_repeat(&self) -> bool;

    /// Returns the factor by which a body's fitness is multiplied.
    fn factor(&self, body: &Body) -> f64;

    /// Returns the order of the images, given the parent's answers; empty for their own order.
    fn order(&self, grouping: &Grouping, of_parent: Option<&[Answer]>) -> Vec<usize>;

    /// Returns what ends an evaluation early, given the fitness to exceed on each task, if any.
    fn given_up(&self, to_beat: &[Option<f64>]) -> Option<Box<MayWin<'static>>>;
}

/// Recognition: bodies as they are walk under the training images.
pub(crate) struct Recognition;

impl Objective for Recognition {
    fn prepare(
        &self,
        stimuli: Vec<Grid<f64>>,
        _: &Physics,
        _: u64,
    ) -> (Vec<Grid<f64>>, Vec<Condition>) {
        (stimuli, Vec::new())
    }

    fn simulated<'b>(&self, body: &'b Body) -> Cow<'b, Body> {
        Cow::Borrowed(body)
    }

    fn may_repeat(&self) -> bool {
        true
    }

    fn factor(&self, _: &Body) -> f64 {
        1.0
    }

    fn order(&self, grouping: &Grouping, of_parent: Option<&[Answer]>) -> Vec<usize> {
        // What was hard for the parent is hard for its offspring: it is soon known that it fails.
        of_parent.map_or_else(Vec::new, |answers| grouping.hardest_first(answers))
    }

    fn given_up(&self, _: &[Option<f64>]) -> Option<Box<MayWin<'static>>> {
        None
    }
}
