//! Quality diversity. Knows neither genomes nor bodies: a solution is any type `S`.

pub mod archive;
pub mod descriptor;
pub mod emitter;
pub mod map_elites;

pub use archive::{Archive, ArchiveStats, Elite, Insertion};
pub use descriptor::DescriptorSpace;
pub use emitter::{EmitterParams, Proposal, Variation};
pub use map_elites::{Evaluated, MapElites};
