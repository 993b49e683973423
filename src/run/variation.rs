//! How robots vary: newcomers and mutated offspring, each from a random stream of its own.

use super::Error;
use super::archive::Robot;
use crate::base::random::{Purpose, stream};
use crate::body::Body;
use crate::genome::{BodySpec, Genome, GenomeError, MutationParams};
use crate::qd::Variation;

/// How genomes vary in this run.
pub(super) struct Mutations<'a> {
    pub seed: u64,
    pub spec: BodySpec,
    pub params: &'a MutationParams,
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

impl Mutations<'_> {
    /// Whether there can be robots at all: to be known before an earlier run is deleted.
    pub fn check(&self) -> Result<(), Error> {
        self.newcomer(0, 0).map(drop).map_err(|error| Error::input(format!("body: {error}")))
    }
}

impl Variation<Robot> for Mutations<'_> {
    type Error = GenomeError;

    fn newcomer(&self, generation: u64, child: u64) -> Result<Robot, GenomeError> {
        let rng = &mut stream(self.seed, Purpose::Newcomer, generation, child);
        Ok(newborn(Genome::random(self.spec, self.params, rng)?, generation, None))
    }

    fn offspring(&self, parent: &Robot, generation: u64, child: u64) -> Result<Robot, GenomeError> {
        let rng = &mut stream(self.seed, Purpose::Mutation, generation, child);
        let made = parent.genome.offspring(self.spec, self.params, rng)?;
        Ok(newborn(made, generation, Some(parent)))
    }
}
