//! Stages of a run: what robots are trained on, and how they are judged, from which generation on.

use super::Config;
use crate::genome::MutationParams;
use crate::genome::params::VoxelScope;
use crate::task::evaluation::Savings;
use crate::task::fitness::{Criterion, Fitness};
use serde::{Deserialize, Serialize};
use std::iter::successors;

/// A stage: table `[[stage]]`. It starts with the archive of the stage before it, evaluated anew.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StageConfig {
    /// Generations it lasts; the last stage lasts to the run's last generation, whatever it says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub generations: Option<u64>,
    /// Training images of each class, drawn by the run's seed. Default: the images of the section `[data]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub images_per_class: Option<usize>,
    /// Images of each class among which to choose, drawn in the same way: those that are hardest to tell from another class
    /// become the training images. Default: no choice.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pool: Option<usize>,
    /// The stage before, from 1, whose images (of its last draw) are the training images once more. Default: others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub images_of: Option<usize>,
    /// How answers to several images are judged together. Default `evaluation.fitness`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fitness: Option<Fitness>,
    /// Where fitness is a mean, the margin at which an answer is as good as can be \[voxel lengths\]. Default `evaluation.enough`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub enough: Option<u16>,
    /// After every so many generations other images are drawn and all elites evaluated anew, so that no luck stays in the
    /// archive. Default: never.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub redraw: Option<u64>,
    /// Elites of each task of the stage before, or of the archive that the run starts from, that are evaluated when the stage
    /// begins: those who were fittest there. Default: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start_with: Option<usize>,
    /// Elites of each task that stay in the archive: the fittest, at any time. Who is not among them is not let in, and can
    /// be told early. Default: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep: Option<usize>,
    /// Fitness that an offspring must exceed to be let in, into an empty cell, too; named as in pyribs. Elites of before stay.
    /// Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threshold_min: Option<f64>,
    /// Share of offspring of which one voxel is mutated instead of the network. Default `genome.voxel_mutations`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxel_mutations: Option<f64>,
    /// Most voxel mutations among which an offspring's is chosen. Default `genome.voxel_candidates`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxel_candidates: Option<u16>,
    /// Most voxels of an offspring that change. Default `genome.voxel_changes`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxel_changes: Option<u16>,
    /// Most relatives whose lives tell what changes promise. Default `genome.voxel_relatives`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxel_relatives: Option<u16>,
    /// Which voxels may change. Default `genome.voxel_scope`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxel_scope: Option<VoxelScope>,
    /// Rows up to which starts are raised: of each class the first image is shown to a robot that starts as ever, the next to
    /// one that starts a row higher, and so on by turns, so that nobody can live off how it first touches the ground. Fresh
    /// lives only. Default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub raised_starts: Option<u32>,
    /// Half of each class's images are shown to a robot without length limits: after each round of raised starts another one, so
    /// that nobody can live off what limits do to springs. Fresh lives only. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without_limits: Option<bool>,
    /// Pixels that are inverted in each training image, others in each, so that nobody can live off a single one. Default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inverted_pixels: Option<usize>,
    /// Offspring that fall behind their parent on the images so far are not shown the rest: not lossless. Only where fitness is a
    /// mean. Default: not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub race: Option<bool>,
}

/// Generations with the same training images and the same fitness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Period {
    /// Its stage, from 0; 0 in a run without stages.
    pub stage: usize,
    /// How often the stage's images have been drawn before.
    pub draw: u64,
}

impl Period {
    /// Which draw of images it is: different in every period, and never that of the section `[data]`, which is 0.
    pub fn number(self) -> u64 {
        ((self.stage as u64 + 1) << 32) + self.draw
    }
}

impl Config {
    /// The period that a generation (from 0) belongs to.
    pub fn period(&self, generation: u64) -> Period {
        self.period_and_next(generation).0
    }

    /// The periods that the first generations belong to, in their order.
    pub fn periods(&self, generations: u64) -> impl Iterator<Item = Period> {
        let firsts = successors(Some(0), |&first| Some(self.period_and_next(first).1));
        firsts.take_while(move |&first| first < generations).map(|first| self.period(first))
    }

    /// The period that a generation belongs to, and the first generation of the next one.
    fn period_and_next(&self, generation: u64) -> (Period, u64) {
        let mut begin = 0;
        for (stage, config) in self.stage.iter().enumerate() {
            let is_last = stage + 1 == self.stage.len();
            let lasts = config.generations.filter(|_| !is_last).unwrap_or(u64::MAX - begin);
            let end = begin + lasts;
            if generation < end || is_last {
                let Some(every) = config.redraw else { return (Period { stage, draw: 0 }, end) };
                let draw = (generation - begin) / every.max(1);
                let next = begin.saturating_add((draw + 1).saturating_mul(every.max(1)));
                return (Period { stage, draw }, next.min(end));
            }
            begin = end;
        }
        (Period { stage: 0, draw: 0 }, u64::MAX)
    }

    /// What is said of the stage of a period.
    fn stage_of(&self, period: Period) -> StageConfig {
        self.stage.get(period.stage).copied().unwrap_or_default()
    }

    /// What answers are judged by in a generation (from 0).
    pub fn criterion(&self, generation: u64) -> Criterion {
        self.criterion_in(self.period(generation))
    }

    /// What answers are judged by in a period.
    pub fn criterion_in(&self, period: Period) -> Criterion {
        let stage = self.stage_of(period);
        Criterion {
            fitness: stage.fitness.unwrap_or(self.evaluation.fitness),
            enough: stage.enough.unwrap_or(self.evaluation.enough),
        }
    }

    /// The period whose images are shown in a period: itself, or one of a stage before.
    pub fn drawn_in(&self, period: Period) -> Period {
        let Some(shown) = self.stage_of(period).images_of.and_then(|number| self.stage.get(..number)) else {
            return period;
        };
        let end: u64 = shown.iter().filter_map(|stage| stage.generations).sum();
        self.drawn_in(self.period(end.saturating_sub(1)))
    }

    /// Training images of each class in a period; `None`: those of the section `[data]`.
    pub fn drawn_per_class(&self, period: Period) -> Option<usize> {
        self.stage_of(period).images_per_class
    }

    /// Images of each class among which the hardest are chosen in a period; `None`: no choice.
    pub fn pool(&self, period: Period) -> Option<usize> {
        self.stage_of(period).pool
    }

    /// Rows up to which starts are raised in a period, by turns within a class.
    pub fn raised_starts(&self, period: Period) -> u32 {
        self.stage_of(period).raised_starts.unwrap_or(0)
    }

    /// Whether half of the images are shown to robots without length limits in a period.
    pub fn without_limits(&self, period: Period) -> bool {
        self.stage_of(period).without_limits.unwrap_or(false)
    }

    /// Pixels that are inverted in each training image of a period.
    pub fn inverted_pixels(&self, period: Period) -> usize {
        self.stage_of(period).inverted_pixels.unwrap_or(0)
    }

    /// Whether offspring are raced against their parents in a period.
    pub fn race(&self, period: Period) -> bool {
        self.stage_of(period).race.unwrap_or(false)
    }

    /// Elites of each task of before, the fittest, with which a period begins; `None`: all. When images are drawn anew, all stay.
    pub fn start_with(&self, period: Period) -> Option<usize> {
        self.stage_of(period).start_with.filter(|_| period.draw == 0)
    }

    /// Elites of each task that stay in the archive in a period; `None`: all. What a stage does not say, `[archive]` does.
    pub fn keep(&self, period: Period) -> Option<usize> {
        self.stage_of(period).keep.or(self.archive.keep)
    }

    /// Fitness that who is born in a period must exceed to be let in; `None`: any will do.
    pub fn threshold_min(&self, period: Period) -> Option<f64> {
        self.stage_of(period).threshold_min
    }

    /// What is saved in a period. What one parent left behind in a race, another might not: no body is evaluated twice. Nor is
    /// a gait whose response is known, or it would fill the archive with its sensors. What relatives tell of is what was shown
    /// to them: it is the same whatever the savings, because all are on.
    pub fn savings_in(&self, period: Period) -> Savings {
        let known_bodies = self.savings.known_bodies || self.race(period) || self.measures_response(period);
        match self.mutation_in(period).voxel_relatives {
            0 => Savings { known_bodies, ..self.savings },
            _ => Savings::default(),
        }
    }

    /// How genomes mutate in a period.
    pub fn mutation_in(&self, period: Period) -> MutationParams {
        let stage = self.stage_of(period);
        MutationParams {
            voxel_mutations: stage.voxel_mutations.unwrap_or(self.genome.voxel_mutations),
            voxel_candidates: stage.voxel_candidates.unwrap_or(self.genome.voxel_candidates),
            voxel_changes: stage.voxel_changes.unwrap_or(self.genome.voxel_changes),
            voxel_relatives: stage.voxel_relatives.unwrap_or(self.genome.voxel_relatives),
            voxel_scope: stage.voxel_scope.unwrap_or(self.genome.voxel_scope),
            ..self.genome.clone()
        }
    }
}

#[cfg(test)]
#[path = "curriculum_tests.rs"]
mod tests;
