//! Genomes. A [`Genome`] describes a [`Body`]; it knows nothing of physics, tasks or archives.

pub(crate) mod cppn;
mod edits;
mod express;
mod file;
pub(crate) mod function;
pub(crate) mod mutation;
pub(crate) mod params;
mod voxels;

use crate::base::hash;
use crate::base::random::Stream;
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::body::{Body, BodyError};
pub(crate) use cppn::Cppn;
pub(crate) use edits::Edits;
pub(crate) use params::MutationParams;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
pub(crate) use voxels::other_voxel;

/// The object of evolution: a network that describes a body, and single voxels in which the body
/// differs. In files `{"cppn": …, "edits": …}`, see [`Cppn`] and [`Edits`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Genome {
    /// The network.
    cppn: Cppn,
    /// Voxels that differ from the network's description.
    #[serde(default, skip_serializing_if = "Edits::is_empty")]
    edits: Edits,
}

/// The bodies that evolution may use (paper: 14 × 14 voxels, connected, at least three muscles).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BodySpec {
    pub(crate) height: usize,
    pub(crate) width: usize,
    pub(crate) min_muscles: usize,
}

/// Most mutations in a row without a valid body. (On 14 × 14 voxels a random individual needs about
/// 25, seldom above 150; an offspring two or three.)
pub(crate) const MAX_MUTATIONS: usize = 100_000;

/// Mutations between two checks for a stop.
const MUTATIONS_AT_ONCE: usize = 200;

/// The reason for the lack of a valid body.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GenomeError {
    /// No mutation gave a valid body.
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
        /// Muscles required.
        min_muscles: usize,
    },
    /// The size is impossible for a body.
    #[error(transparent)]
    Size(#[from] BodyError),
    /// The search was stopped before it found one.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl Genome {
    /// Returns the start of evolution: [`Cppn::initial`], an empty body.
    pub fn initial() -> Self {
        Genome {
            cppn: Cppn::initial(),
            edits: Edits::default(),
        }
    }

    /// Applies one random mutation to the network (paper, section "Genome").
    pub(crate) fn mutate(&mut self, params: &MutationParams, rng: &mut Stream) {
        mutation::mutate(&mut self.cppn, params, rng);
    }

    /// Returns the body of this size that it describes, valid or not.
    ///
    /// # Errors
    /// Returns a [`BodyError`] if the size is impossible for a body.
    pub fn body(&self, height: usize, width: usize) -> Result<Body, BodyError> {
        let described = self.cppn.express(height, width)?;
        if self.edits.is_empty() {
            Ok(described)
        } else {
            Body::new(self.edits.apply(&described))
        }
    }

    /// Returns a copy with this body; voxels that differ from the network's become edits.
    ///
    /// # Errors
    /// Returns a [`BodyError`] if the size is impossible for a body.
    pub fn with_body(&self, body: &Body) -> Result<Self, BodyError> {
        let described = self.cppn.express(body.height(), body.width())?;
        let mut edits = Edits::default();
        body.voxels()
            .iter()
            .for_each(|(place, material)| edits.set(place, *material, described.voxels()[place]));
        Ok(Genome {
            cppn: self.cppn.clone(),
            edits,
        })
    }

    /// Returns a short id, equal for equal genomes: ten hexadecimal digits of its
    /// [digest](Genome::digest). The first becomes a letter (`g` to `p` for 0 to 9), since tools
    /// read `18e2354970` as a number.
    pub fn id(&self) -> String {
        let mut id = self.digest()[..10].to_string();
        if let Ok(digit) = id[..1].parse::<u8>() {
            id.replace_range(..1, char::from(b'g' + digit).encode_utf8(&mut [0; 4]));
        }
        id
    }

    /// Returns true if an id is this genome's; in older files it may begin with a digit.
    pub(crate) fn has_id(&self, id: &str) -> bool {
        id == self.id() || id == &self.digest()[..10]
    }

    /// Returns the SHA-256 of its content, in hexadecimal digits.
    pub fn digest(&self) -> String {
        hash::sha256_hex(&[self.cppn.canonical_bytes(), self.edits.canonical_bytes()].concat())
    }

    /// Mutates a copy until its body is valid, at least once; returns it with that body. A fraction
    /// [`MutationParams::voxel_mutations`] of offspring has voxels mutated instead.
    ///
    /// # Errors
    /// Returns a [`GenomeError`] if the size is impossible or [`MAX_MUTATIONS`] give no valid body.
    pub fn offspring(
        &self,
        spec: BodySpec,
        params: &MutationParams,
        rng: &mut Stream,
    ) -> Result<(Genome, Body), GenomeError> {
        self.offspring_unless(spec, params, rng, &Session::default())
    }

    /// Acts as [`Genome::offspring`], unless `stop` is set in the meantime.
    pub(crate) fn offspring_unless(
        &self,
        spec: BodySpec,
        params: &MutationParams,
        rng: &mut Stream,
        session: &Session,
    ) -> Result<(Genome, Body), GenomeError> {
        // With no voxel mutations nothing is drawn, so that older runs stay reproducible.
        if params.voxel_mutations == 0.0 || rng.unit() >= params.voxel_mutations {
            return self.with_mutated_network(spec, params, rng, session);
        }
        let described = self.cppn.express(spec.height, spec.width)?;
        match self.with_voxels_changed(&described, spec, params, rng, session) {
            // No draw of voxels gave a valid body.
            Err(GenomeError::NoValidBody { .. }) => {
                self.with_mutated_network(spec, params, rng, session)
            }
            changed => changed,
        }
    }

    fn with_mutated_network(
        &self,
        spec: BodySpec,
        params: &MutationParams,
        rng: &mut Stream,
        session: &Session,
    ) -> Result<(Genome, Body), GenomeError> {
        let BodySpec {
            height,
            width,
            min_muscles,
        } = spec;
        let mutations = if min_muscles > height.saturating_mul(width) {
            0
        } else {
            MAX_MUTATIONS
        };
        let mut genome = self.clone();
        for number in 1..=mutations {
            // The first check comes late: a run stopped at its start still gets its folder.
            if number % MUTATIONS_AT_ONCE == 0 {
                session.check()?;
            }
            genome.mutate(params, rng);
            let body = genome.body(height, width)?;
            if body.is_valid(min_muscles) {
                return Ok((genome, body));
            }
        }
        Err(GenomeError::NoValidBody {
            mutations,
            height,
            width,
            min_muscles,
        })
    }

    /// Mutates [`Genome::initial`] until its body is valid; returns the individual with that body.
    ///
    /// # Errors
    /// As [`Genome::offspring`].
    pub fn random(
        spec: BodySpec,
        params: &MutationParams,
        rng: &mut Stream,
    ) -> Result<(Genome, Body), GenomeError> {
        Genome::random_unless(spec, params, rng, &Session::default())
    }

    /// Acts as [`Genome::random`], unless `stop` is set in the meantime.
    pub(crate) fn random_unless(
        spec: BodySpec,
        params: &MutationParams,
        rng: &mut Stream,
        session: &Session,
    ) -> Result<(Genome, Body), GenomeError> {
        Genome::initial().with_mutated_network(spec, params, rng, session)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};

    pub(super) const PAPER: BodySpec = BodySpec {
        height: 14,
        width: 14,
        min_muscles: 3,
    };

    pub(super) fn rng(seed: u64) -> Stream {
        stream(seed, Purpose::RandomImmigrant, 0, 0)
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
            (genome, _) = genome
                .offspring(PAPER, &MutationParams::default(), rng)
                .unwrap();
        }
        let body = hash::hex(&crate::body::key(&genome.body(14, 14).unwrap()));
        assert_eq!((genome.id().as_str(), &body[..10]), PINNED);
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
    fn ids_begin_with_a_letter_and_those_of_old_files_are_still_known() {
        let mut ids = std::collections::BTreeSet::new();
        let mut digits = 0;
        for seed in 0..40 {
            let (genome, _) =
                Genome::random(PAPER, &MutationParams::default(), &mut rng(seed)).unwrap();
            let (id, old) = (genome.id(), genome.digest()[..10].to_string());
            assert!(
                id.starts_with(|c: char| c.is_ascii_lowercase()) && id[1..] == old[1..],
                "{id} {old}"
            );
            assert!(genome.has_id(&id) && genome.has_id(&old) && !genome.has_id(&id[1..]));
            digits += usize::from(id != old);
            ids.insert(id);
        }
        assert!(digits > 10 && ids.len() == 40, "{digits}");
    }

    #[test]
    fn hopeless_bodies_are_a_typed_error() {
        let error = |height, width, min_muscles| {
            let spec = BodySpec {
                height,
                width,
                min_muscles,
            };
            Genome::random(spec, &MutationParams::default(), &mut rng(0)).unwrap_err()
        };
        assert!(matches!(
            error(1, 2, 3),
            GenomeError::NoValidBody { mutations: 0, .. }
        ));
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
