//! How robots vary: newcomers and mutated offspring, each from a random stream of its own.

use super::Error;
use super::archive::Robot;
use super::relatives::Relatives;
use super::training::Training;
use crate::base::random::{Purpose, stream};
use crate::body::Body;
use crate::genome::{BodySpec, Genome, GenomeError, MutationParams};
use crate::qd::Variation;
use crate::sim::Physics;
use crate::task::grouping::Grouping;
use crate::task::surrogate::Surrogate;
use std::cell::LazyCell;
use std::sync::atomic::AtomicBool;

/// How genomes vary in this run.
pub(super) struct Mutations<'a> {
    pub seed: u64,
    pub spec: BodySpec,
    pub params: &'a MutationParams,
    /// Where there are none, candidates all promise the same.
    pub lessons: Option<Lessons<'a>>,
    /// Once set, no more are made.
    pub stop: &'a AtomicBool,
}

/// What tells how parents answer.
#[derive(Clone, Copy)]
pub(super) struct Lessons<'a> {
    /// What they were trained on.
    pub training: &'a Training,
    /// On what tasks.
    pub grouping: &'a Grouping,
    /// The physics they lived under.
    pub physics: &'a Physics,
    /// Who else did.
    pub relatives: &'a Relatives,
}

/// A robot that has not lived yet.
fn newborn((genome, body): (Genome, Body), generation: u64, parent: Option<&Robot>) -> Robot {
    Robot {
        id: genome.id(),
        cell: Vec::new(),
        task: String::new(),
        objective: 0.0,
        displacements: Vec::new(),
        voxels: body.counts(),
        generation,
        parent: parent.map(|parent| parent.id.clone()),
        body,
        genome,
    }
}

/// Why there is no robot.
pub(super) fn unmade(error: GenomeError) -> Error {
    match error {
        GenomeError::Stopped(stopped) => stopped.into(),
        error => Error::input(format!("body: {error}")),
    }
}

impl Mutations<'_> {
    /// Whether there can be robots at all: to be known before an earlier run is deleted.
    pub fn check(&self) -> Result<(), Error> {
        self.newcomer(0, 0).map(drop).map_err(unmade)
    }

    fn surrogate<'b>(&'b self, parent: &'b Robot) -> Option<Surrogate<'b>> {
        let Lessons { training, grouping, physics, relatives } = self.lessons?;
        let split = grouping.tasks().iter().find(|split| split.name() == parent.task)?;
        let answers = training.answers(parent.displacements.iter().copied().map(Some));
        let most = usize::from(self.params.voxel_relatives);
        let relatives = relatives.of(&parent.body, most);
        Surrogate::of(
            &parent.body,
            &training.stimuli,
            &answers,
            &relatives,
            split,
            grouping.criterion(),
            physics,
        )
    }
}

impl Variation<Robot> for Mutations<'_> {
    type Error = GenomeError;

    fn newcomer(&self, generation: u64, child: u64) -> Result<Robot, GenomeError> {
        let rng = &mut stream(self.seed, Purpose::Newcomer, generation, child);
        Ok(newborn(Genome::random_unless(self.spec, self.params, rng, self.stop)?, generation, None))
    }

    fn offspring(&self, parent: &Robot, generation: u64, child: u64) -> Result<Robot, GenomeError> {
        let rng = &mut stream(self.seed, Purpose::Mutation, generation, child);
        // Fitted when first asked: most runs never do.
        let surrogate = LazyCell::new(|| self.surrogate(parent));
        let promise = |body: &Body| surrogate.as_ref().map_or(0.0, |surrogate| surrogate.worth(body));
        let made = parent.genome.promising_offspring(self.spec, self.params, rng, promise, self.stop)?;
        Ok(newborn(made, generation, Some(parent)))
    }
}
