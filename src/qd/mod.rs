//! Quality diversity. Knows neither genomes nor bodies: a solution is any type `S`.

pub(crate) mod archive;
pub(crate) mod descriptor;
pub(crate) mod emitter;
pub(crate) mod map_elites;

pub(crate) use archive::{Archive, ArchiveStats, Elite};
pub(crate) use descriptor::DescriptorSpace;
pub(crate) use emitter::{EmitterParams, Proposal, Variation};
pub(crate) use map_elites::{Evaluated, MapElites};
