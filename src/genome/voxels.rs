//! Mutations of single voxels, whatever the network describes.

use crate::base::Grid;
use crate::base::random::Stream;
use crate::base::session::Session;
use crate::body::{Body, Material};
use crate::genome::{BodySpec, Edits, Genome, GenomeError, MAX_MUTATIONS, MutationParams};

impl Genome {
    /// Returns a copy with up to [`MutationParams::voxel_changes`] voxels changed, and its body.
    pub(super) fn with_voxels_changed(
        &self,
        described: &Body,
        spec: BodySpec,
        params: &MutationParams,
        rng: &mut Stream,
        session: &Session,
    ) -> Result<(Genome, Body), GenomeError> {
        let most_changes = usize::from(params.voxel_changes);
        let doublings = most_changes.next_power_of_two().ilog2() as usize;
        let changes = if doublings > 0 {
            most_changes.min(1 << rng.below(doublings + 1))
        } else {
            1
        };
        let (mut edits, mut body) = one_voxel_changed(&self.edits, described, spec, rng, session)?;
        for _ in 1..changes {
            (edits, body) = one_voxel_changed(&edits, described, spec, rng, session)?;
        }
        Ok((
            Genome {
                cppn: self.cppn.clone(),
                edits,
            },
            body,
        ))
    }
}

/// Draws a place, (row, column), and one of the six other materials, all equally likely.
pub(crate) fn other_voxel(voxels: &Grid<Material>, rng: &mut Stream) -> ((usize, usize), Material) {
    let place = (rng.below(voxels.height()), rng.below(voxels.width()));
    let step = 1 + rng.below(Material::ALL.len() - 1);
    (
        place,
        Material::ALL[(usize::from(voxels[place].code()) + step) % Material::ALL.len()],
    )
}

/// Changes one more voxel than `edits`, drawn anew until the body is valid; returns edits and body.
fn one_voxel_changed(
    edits: &Edits,
    described: &Body,
    spec: BodySpec,
    rng: &mut Stream,
    session: &Session,
) -> Result<(Edits, Body), GenomeError> {
    let BodySpec {
        height,
        width,
        min_muscles,
    } = spec;
    let now = edits.apply(described);
    for _ in 0..MAX_MUTATIONS {
        session.check()?;
        let (place, material) = other_voxel(&now, rng);
        let mut edits = edits.clone();
        edits.set(place, material, described.voxels()[place]);
        let body = Body::new(edits.apply(described))?;
        if body.is_valid(min_muscles) {
            return Ok((edits, body));
        }
    }
    Err(GenomeError::NoValidBody {
        mutations: MAX_MUTATIONS,
        height,
        width,
        min_muscles,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::genome::tests::{PAPER, rng};

    #[test]
    fn a_voxel_mutation_changes_one_voxel_and_nothing_else() {
        let always = MutationParams {
            voxel_mutations: 1.0,
            ..MutationParams::default()
        };
        let rng = &mut rng(3);
        let (mut parent, mut body) = Genome::random(PAPER, &always, rng).unwrap();
        assert!(parent.edits.0.is_empty());
        for _ in 0..200 {
            let (child, changed) = parent.offspring(PAPER, &always, rng).unwrap();
            let pairs = body.voxels().cells().iter().zip(changed.voxels().cells());
            assert_eq!(pairs.filter(|(before, after)| before != after).count(), 1);
            assert!(child.cppn == parent.cppn && child.id() != parent.id() && changed.is_valid(3));
            (parent, body) = (child, changed);
        }
        assert!(
            (20..=196).contains(&parent.edits.0.len()),
            "{}",
            parent.edits.0.len()
        );
        // The network goes on mutating below the edits, and files keep both.
        let text = serde_json::to_string(&parent).unwrap();
        let read: Genome = serde_json::from_str(&text).unwrap();
        assert_eq!((read.id(), read.body(14, 14)), (parent.id(), Ok(body)));
        let (child, _) = read
            .offspring(PAPER, &MutationParams::default(), rng)
            .unwrap();
        assert!(child.edits == read.edits && child.cppn != read.cppn);
    }

    #[test]
    fn every_voxel_and_material_is_as_likely_to_be_mutated() {
        let always = MutationParams {
            voxel_mutations: 1.0,
            ..MutationParams::default()
        };
        let (parent, _) = Genome::random(PAPER, &MutationParams::default(), &mut rng(5)).unwrap();
        let spec = BodySpec {
            min_muscles: 0,
            ..PAPER
        };
        // A full grid stays connected whatever one voxel becomes, so nothing is drawn twice.
        let mut full = parent.clone();
        let described = parent.cppn.express(14, 14).unwrap();
        (0..196).for_each(|i| {
            full.edits.set(
                (i / 14, i % 14),
                Material::Soft,
                described.voxels()[(i / 14, i % 14)],
            )
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
        assert!(
            [0, 1, 3, 4, 5, 6]
                .iter()
                .all(|m| (880..1120).contains(&materials[*m])),
            "{materials:?}"
        );
    }

    #[test]
    fn offspring_change_in_as_many_voxels_as_are_drawn() {
        let params = MutationParams {
            voxel_mutations: 1.0,
            voxel_changes: 12,
            ..MutationParams::default()
        };
        let (parent, body) = Genome::random(PAPER, &params, &mut rng(5)).unwrap();
        let changed = |seed| {
            let (_, made) = parent.offspring(PAPER, &params, &mut rng(seed)).unwrap();
            assert!(made.is_valid(3));
            body.voxels()
                .cells()
                .iter()
                .zip(made.voxels().cells())
                .filter(|(a, b)| a != b)
                .count()
        };
        let mut counts = [0; 13];
        (0..800).for_each(|seed| counts[changed(seed)] += 1);
        // 1, 2, 4, 8 or 12; occasionally one voxel twice.
        let ranges = [
            counts[1],
            counts[2],
            counts[3] + counts[4],
            counts[5..9].iter().sum(),
            counts[9..].iter().sum(),
        ];
        assert!(
            ranges
                .iter()
                .all(|offspring| (120..200).contains(offspring)),
            "{counts:?}"
        );
    }
}
