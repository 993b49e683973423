//! Mutations of single voxels, whatever the network describes.

use super::params::VoxelScope;
use super::{BodySpec, Edits, Genome, GenomeError, MAX_MUTATIONS, MutationParams};
use crate::base::random::Stream;
use crate::base::stop::check;
use crate::body::{Body, Material};
use std::sync::atomic::AtomicBool;

impl Genome {
    /// A copy with as many voxels changed as is drawn ([`MutationParams::voxel_changes`]), each of them chosen among as many
    /// candidates as is drawn ([`MutationParams::voxel_candidates`]) by what their bodies promise; with its body.
    pub(super) fn with_voxels_changed(
        &self,
        described: &Body,
        spec: BodySpec,
        params: &MutationParams,
        rng: &mut Stream,
        promise: impl Fn(&Body) -> f64,
        stop: &AtomicBool,
    ) -> Result<(Genome, Body), GenomeError> {
        let scope = params.voxel_scope;
        let is_choice = params.voxel_candidates > 1;
        let promise = |body: &Body| if is_choice { promise(body) } else { 0.0 };
        // Nothing is drawn where there is nothing to choose.
        let more = if is_choice { rng.below(usize::from(params.voxel_candidates)) } else { 0 };
        let most_changes = usize::from(params.voxel_changes);
        let doublings = most_changes.next_power_of_two().ilog2() as usize;
        let changes = if doublings > 0 { most_changes.min(1 << rng.below(doublings + 1)) } else { 1 };
        let chosen = |edits: &Edits, rng: &mut Stream| -> Result<_, GenomeError> {
            let mut best = one_voxel_changed(edits, described, spec, scope, rng, stop)?;
            let mut most = promise(&best.1);
            for _ in 0..more {
                let candidate = one_voxel_changed(edits, described, spec, scope, rng, stop)?;
                let promised = promise(&candidate.1);
                if promised > most {
                    (best, most) = (candidate, promised);
                }
            }
            Ok((best, most))
        };
        let ((mut edits, mut body), mut most) = chosen(&self.edits, rng)?;
        for _ in 1..changes {
            let (next, promised) = chosen(&edits, rng)?;
            if is_choice && promised <= most {
                break;
            }
            ((edits, body), most) = (next, promised);
        }
        Ok((Genome { cppn: self.cppn.clone(), edits }, body))
    }
}

/// Edits of what a network describes, with one more voxel of another material, drawn anew until their body is valid; with that.
fn one_voxel_changed(
    edits: &Edits,
    described: &Body,
    spec: BodySpec,
    scope: VoxelScope,
    rng: &mut Stream,
    stop: &AtomicBool,
) -> Result<(Edits, Body), GenomeError> {
    let BodySpec { height, width, min_muscles } = spec;
    let now = edits.apply(described);
    for _ in 0..MAX_MUTATIONS {
        check(stop)?;
        let place = (rng.below(height), rng.below(width));
        // One of the six others.
        let step = 1 + rng.below(Material::ALL.len() - 1);
        let material = Material::ALL[(usize::from(now[place].code()) + step) % Material::ALL.len()];
        if !scope.contains(now[place]) || !scope.contains(material) {
            continue;
        }
        let mut edits = edits.clone();
        edits.set(place, material, described.voxels()[place]);
        let body = Body::new(edits.apply(described))?;
        if body.is_valid(min_muscles) {
            return Ok((edits, body));
        }
    }
    Err(GenomeError::NoValidBody { mutations: MAX_MUTATIONS, height, width, min_muscles })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::stop::NEVER;
    use crate::genome::tests::{PAPER, rng};

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
    fn of_several_candidates_the_most_promising_becomes_the_offspring() {
        let one = MutationParams { voxel_mutations: 1.0, ..MutationParams::default() };
        let many = MutationParams { voxel_candidates: 40, ..one.clone() };
        let (parent, _) = Genome::random(PAPER, &one, &mut rng(5)).unwrap();
        let sensors = |body: &Body| body.counts().sensor as f64;
        let mean = |params: &MutationParams| -> f64 {
            let made =
                |seed| parent.promising_offspring(PAPER, params, &mut rng(seed), sensors, &NEVER).unwrap();
            (0..60).map(|seed| sensors(&made(seed).1)).sum::<f64>() / 60.0
        };
        assert!(mean(&many) > mean(&one) + 0.4, "{} {}", mean(&many), mean(&one));
        for seed in 0..20 {
            // Nothing is asked, and nothing else drawn, where there is but one.
            let asked = |_: &Body| panic!("asked");
            let lone = parent.promising_offspring(PAPER, &one, &mut rng(seed), asked, &NEVER).unwrap();
            assert_eq!(lone, parent.offspring(PAPER, &one, &mut rng(seed)).unwrap());
            // Where all promise the same, it is the first.
            let same = parent.offspring(PAPER, &many, &mut rng(seed)).unwrap();
            let rng = &mut rng(seed);
            let _ = (rng.unit(), rng.below(40));
            let described = parent.cppn.express(14, 14).unwrap();
            let (edits, body) =
                one_voxel_changed(&parent.edits, &described, PAPER, VoxelScope::All, rng, &NEVER).unwrap();
            assert_eq!(same, (Genome { cppn: parent.cppn.clone(), edits }, body));
        }
    }

    #[test]
    fn offspring_change_in_as_many_voxels_as_are_drawn_and_only_as_long_as_it_promises_more() {
        let blind = MutationParams { voxel_mutations: 1.0, voxel_changes: 12, ..MutationParams::default() };
        let (parent, body) = Genome::random(PAPER, &blind, &mut rng(5)).unwrap();
        let changed = |params: &MutationParams, seed, promise: fn(&Body) -> f64| {
            let (_, made) =
                parent.promising_offspring(PAPER, params, &mut rng(seed), promise, &NEVER).unwrap();
            assert!(made.is_valid(3));
            body.voxels().cells().iter().zip(made.voxels().cells()).filter(|(a, b)| a != b).count()
        };
        let mut counts = [0; 13];
        (0..800).for_each(|seed| counts[changed(&blind, seed, |_| panic!("asked"))] += 1);
        // 1, 2, 4, 8 or 12; now and then one voxel twice.
        let ranges = [
            counts[1],
            counts[2],
            counts[3] + counts[4],
            counts[5..9].iter().sum(),
            counts[9..].iter().sum(),
        ];
        assert!(ranges.iter().all(|offspring| (120..200).contains(offspring)), "{counts:?}");
        let choosy = MutationParams { voxel_candidates: 20, ..blind };
        let sensors = |body: &Body| body.counts().sensor as f64;
        let most = (0..60).map(|seed| changed(&choosy, seed, sensors)).max();
        assert!(most > Some(6), "{most:?}");
        assert!((0..60).all(|seed| changed(&choosy, seed, |_| 0.0) == 1));
    }

    #[test]
    fn what_walks_may_be_kept_and_then_only_soft_voxels_and_sensors_change() {
        let params = MutationParams {
            voxel_mutations: 1.0,
            voxel_scope: VoxelScope::Sensors,
            ..MutationParams::default()
        };
        let scope = params.voxel_scope;
        let mut of_kind = [0, 0];
        for seed in 0..60 {
            let (parent, before) = Genome::random(PAPER, &MutationParams::default(), &mut rng(seed)).unwrap();
            let (child, after) = parent.offspring(PAPER, &params, &mut rng(seed)).unwrap();
            let changed =
                || before.voxels().cells().iter().zip(after.voxels().cells()).filter(|(a, b)| a != b);
            let has_any = before.voxels().cells().iter().any(|m| scope.contains(*m));
            if has_any {
                assert!(changed().all(|(a, b)| scope.contains(*a) && scope.contains(*b)));
                assert_eq!(changed().count(), 1);
            }
            // Where there are none, it is the network that mutates.
            assert_eq!((child.cppn() == parent.cppn(), child.edits().is_empty()), (has_any, !has_any));
            of_kind[usize::from(has_any)] += 1;
        }
        assert!(of_kind.iter().all(|bodies| *bodies >= 5), "{of_kind:?}");
    }
}
