//! Floor 2: genomes. A [`Genome`] describes a [`Body`]; it knows nothing of physics, tasks or archives.

pub mod cppn;
mod edits;
mod express;
mod file;
pub mod function;
pub mod mutation;

use crate::base::{hash, random::Stream};
use crate::body::{Body, BodyError, Material};
pub use cppn::Cppn;
pub use edits::{EditError, Edits};
pub use file::CppnError;
pub use mutation::MutationParams;
use serde::{Deserialize, Serialize};

/// What evolution varies: a network that describes a body, and single voxels in which the body differs from that. In files
/// `{"cppn": …, "edits": …}`, see [`Cppn`] and [`Edits`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Genome {
    cppn: Cppn,
    #[serde(default, skip_serializing_if = "Edits::is_empty")]
    edits: Edits,
}

/// Which bodies evolution may use (paper: 14 × 14 voxels, connected, at least three muscles).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BodySpec {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Least number of muscle voxels.
    pub min_muscles: usize,
}

/// Most mutations in a row without a valid body. (On 14 × 14 voxels a random individual needs some 25 from
/// nothing, seldom above 150; an offspring two or three.)
pub const MAX_MUTATIONS: usize = 100_000;

/// Why there is no valid body.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GenomeError {
    /// Mutation never gave a valid body.
    #[error(
        "no valid body after {mutations} mutations; expected a connected body of at most {height} × {width} \
         voxels with at least {min_muscles} muscles: make it larger or ask for fewer muscles"
    )]
    NoValidBody {
        /// Mutations tried.
        mutations: usize,
        /// Rows of the body.
        height: usize,
        /// Columns of the body.
        width: usize,
        /// Muscles asked for.
        min_muscles: usize,
    },
    /// The size is not a body's.
    #[error(transparent)]
    Size(#[from] BodyError),
}

impl Genome {
    /// Where evolution starts: [`Cppn::initial`], an empty body.
    pub fn initial() -> Self {
        Genome { cppn: Cppn::initial(), edits: Edits::default() }
    }

    /// Its network.
    pub fn cppn(&self) -> &Cppn {
        &self.cppn
    }

    /// Voxels that are not what the network says.
    pub fn edits(&self) -> &Edits {
        &self.edits
    }

    /// One random mutation of the network (paper, section "Genome").
    pub fn mutate(&mut self, params: &MutationParams, rng: &mut Stream) {
        mutation::mutate(&mut self.cppn, params, rng);
    }

    /// The body it describes, of `height` × `width` voxels.
    ///
    /// # Errors
    /// [`BodyError`] if the size is not a body's.
    pub fn body(&self, height: usize, width: usize) -> Result<Body, BodyError> {
        let described = self.cppn.express(height, width)?;
        if self.edits.is_empty() { Ok(described) } else { Body::new(self.edits.apply(&described)) }
    }

    /// A short id, the same for the same genome: the first ten hexadecimal digits of its content's hash.
    pub fn id(&self) -> String {
        let content = [self.cppn.canonical_bytes(), self.edits.canonical_bytes()].concat();
        hash::sha256_hex(&content)[..10].to_string()
    }

    /// A copy with one mutation, and more of them until its body is valid; with that body. Of some, as many as
    /// [`MutationParams::voxel_mutations`] says, one voxel is mutated and not the network.
    ///
    /// # Errors
    /// [`GenomeError`] if the size is not a body's or [`MAX_MUTATIONS`] give no valid body.
    pub fn offspring(
        &self,
        spec: BodySpec,
        params: &MutationParams,
        rng: &mut Stream,
    ) -> Result<(Genome, Body), GenomeError> {
        // Without voxel mutations nothing is drawn, and runs are what they were before there were any.
        if params.voxel_mutations > 0.0 && rng.unit() < params.voxel_mutations {
            return self.with_one_voxel_changed(spec, rng);
        }
        self.with_mutated_network(spec, params, rng)
    }

    /// A copy of which one voxel is of another material, drawn anew from the same parent until its body is valid.
    fn with_one_voxel_changed(
        &self,
        spec: BodySpec,
        rng: &mut Stream,
    ) -> Result<(Genome, Body), GenomeError> {
        let BodySpec { height, width, min_muscles } = spec;
        let described = self.cppn.express(height, width)?;
        let now = self.edits.apply(&described);
        for _ in 0..MAX_MUTATIONS {
            let place = (rng.below(height), rng.below(width));
            // One of the six others.
            let step = 1 + rng.below(Material::ALL.len() - 1);
            let material = Material::ALL[(usize::from(now[place].code()) + step) % Material::ALL.len()];
            let mut genome = self.clone();
            genome.edits.set(place, material, described.voxels()[place]);
            let body = Body::new(genome.edits.apply(&described))?;
            if body.is_valid(min_muscles) {
                return Ok((genome, body));
            }
        }
        Err(GenomeError::NoValidBody { mutations: MAX_MUTATIONS, height, width, min_muscles })
    }

    fn with_mutated_network(
        &self,
        spec: BodySpec,
        params: &MutationParams,
        rng: &mut Stream,
    ) -> Result<(Genome, Body), GenomeError> {
        let BodySpec { height, width, min_muscles } = spec;
        let mutations = if min_muscles > height.saturating_mul(width) { 0 } else { MAX_MUTATIONS };
        let mut genome = self.clone();
        for _ in 0..mutations {
            genome.mutate(params, rng);
            let body = genome.body(height, width)?;
            if body.is_valid(min_muscles) {
                return Ok((genome, body));
            }
        }
        Err(GenomeError::NoValidBody { mutations, height, width, min_muscles })
    }

    /// A random individual: [`Genome::initial`], mutated until its body is valid; with that body.
    ///
    /// # Errors
    /// As [`Genome::offspring`].
    pub fn random(
        spec: BodySpec,
        params: &MutationParams,
        rng: &mut Stream,
    ) -> Result<(Genome, Body), GenomeError> {
        Genome::initial().with_mutated_network(spec, params, rng)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};

    const PAPER: BodySpec = BodySpec { height: 14, width: 14, min_muscles: 3 };

    fn rng(seed: u64) -> Stream {
        stream(seed, Purpose::Newcomer, 0, 0)
    }

    #[test]
    fn random_individuals_and_offspring_have_valid_bodies() {
        let params = MutationParams::default();
        for seed in 0..20 {
            let rng = &mut rng(seed);
            let (parent, body) = Genome::random(PAPER, &params, rng).unwrap();
            assert!(body.is_valid(3) && parent.body(14, 14).unwrap() == body);
            let (child, body) = parent.offspring(PAPER, &params, rng).unwrap();
            assert!(body.is_valid(3) && child.body(14, 14).unwrap() == body);
            assert!(child != parent && child.id() != parent.id());
        }
    }

    #[test]
    fn same_seed_same_bits_on_any_machine() {
        // Pinned: a change here changes every run (CHANGELOG: Reproducibility-breaking).
        let rng = &mut rng(1);
        let (mut genome, _) = Genome::random(PAPER, &MutationParams::default(), rng).unwrap();
        for _ in 0..300 {
            (genome, _) = genome.offspring(PAPER, &MutationParams::default(), rng).unwrap();
        }
        assert_eq!((genome.id().as_str(), genome.body(14, 14).unwrap().id().as_str()), PINNED);
    }
    const PINNED: (&str, &str) = ("f4c491fccd", "2ccdd22cbc");

    #[test]
    fn ids_survive_files() {
        let (genome, _) = Genome::random(PAPER, &MutationParams::default(), &mut rng(5)).unwrap();
        let text = serde_json::to_string(&genome).unwrap();
        assert!(text.starts_with(r#"{"cppn":{"version":1,"#));
        let read: Genome = serde_json::from_str(&text).unwrap();
        assert_eq!((read.id(), read.id().len()), (genome.id(), 10));
    }

    #[test]
    fn a_voxel_mutation_changes_one_voxel_and_nothing_else() {
        let always = MutationParams { voxel_mutations: 1.0, ..MutationParams::default() };
        let rng = &mut rng(3);
        let (mut parent, mut body) = Genome::random(PAPER, &always, rng).unwrap();
        assert!(parent.edits().is_empty());
        for _ in 0..200 {
            let (child, changed) = parent.offspring(PAPER, &always, rng).unwrap();
            let pairs = body.voxels().cells().iter().zip(changed.voxels().cells());
            assert_eq!(pairs.filter(|(before, after)| before != after).count(), 1);
            assert!(child.cppn() == parent.cppn() && child.id() != parent.id() && changed.is_valid(3));
            (parent, body) = (child, changed);
        }
        assert!((20..=196).contains(&parent.edits().len()), "{}", parent.edits().len());
        // The network goes on mutating below the edits, and files keep both.
        let text = serde_json::to_string(&parent).unwrap();
        let read: Genome = serde_json::from_str(&text).unwrap();
        assert_eq!((read.id(), read.body(14, 14)), (parent.id(), Ok(body)));
        let (child, _) = read.offspring(PAPER, &MutationParams::default(), rng).unwrap();
        assert!(child.edits() == read.edits() && child.cppn() != read.cppn());
    }

    #[test]
    fn every_voxel_and_material_is_as_likely_to_be_mutated() {
        let always = MutationParams { voxel_mutations: 1.0, ..MutationParams::default() };
        let (parent, _) = Genome::random(PAPER, &MutationParams::default(), &mut rng(5)).unwrap();
        let spec = BodySpec { min_muscles: 0, ..PAPER };
        // A full grid stays connected whatever one voxel becomes: nothing is drawn twice.
        let mut full = parent.clone();
        let described = parent.cppn.express(14, 14).unwrap();
        (0..196).for_each(|i| {
            full.edits.set((i / 14, i % 14), Material::Soft, described.voxels()[(i / 14, i % 14)])
        });
        let (mut places, mut materials) = ([0; 196], [0; 7]);
        for seed in 0..6000 {
            let (_, body) = full.offspring(spec, &always, &mut rng(seed)).unwrap();
            let mut cells = body.voxels().cells().iter().zip(0..);
            let (material, place) = cells.find(|(m, _)| **m != Material::Soft).unwrap();
            places[place] += 1;
            materials[usize::from(material.code())] += 1;
        }
        assert!(places.iter().all(|n| (10..60).contains(n)), "{places:?}");
        assert_eq!(materials[2], 0);
        assert!([0, 1, 3, 4, 5, 6].iter().all(|m| (880..1120).contains(&materials[*m])), "{materials:?}");
    }

    #[test]
    fn hopeless_bodies_are_a_typed_error() {
        let error = |height, width, min_muscles| {
            let spec = BodySpec { height, width, min_muscles };
            Genome::random(spec, &MutationParams::default(), &mut rng(0)).unwrap_err()
        };
        assert!(matches!(error(1, 2, 3), GenomeError::NoValidBody { mutations: 0, .. }));
        assert!(matches!(error(0, 2, 0), GenomeError::Size(_)));
        assert!(matches!(error(65, 2, 3), GenomeError::Size(_)));
    }

    #[test]
    fn networks_stay_small_under_mutation_alone() {
        let (mut genome, mut rng) = (Genome::initial(), rng(0));
        for _ in 0..20_000 {
            genome.mutate(&MutationParams::default(), &mut rng);
            assert!(genome.cppn.hidden().len() < 60 && genome.cppn.edges().len() < 200);
        }
    }
}
