//! Evaluation of many robots at once, in parallel over robots and images, and what can be saved without loss.

use super::protocol::{Life, Protocol};
use super::rollout::{Rollout, fresh_life, same_to_sensors};
use crate::base::Grid;
use crate::body::Body;
use crate::sim::{Lattice, Physics, Unstable};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Mutex;

/// Savings that change no archive; keys of a config's section `[savings]`. All on by default.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Savings {
    /// A body already evaluated in this run is not simulated again: it would be exactly as fit, and only the
    /// strictly fitter get in.
    pub known_bodies: bool,
    /// An offspring that can no longer beat the elite of any cell it may belong to is not simulated further.
    pub early_stop: bool,
    /// Images that show a body's sensors the same pixels are one life.
    pub shared_lives: bool,
}

impl Default for Savings {
    fn default() -> Self {
        Savings { known_bodies: true, early_stop: true, shared_lives: true }
    }
}

/// How an evaluation ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The displacement under every image, in the images' order, voxel lengths.
    Walked(Vec<f64>),
    /// A life became unstable: no fitness.
    Unstable(Unstable),
    /// Stopped because it could not get into the archive any more.
    Stopped,
}

/// An outcome and the simulation it took. A *showing* is one image shown to one robot: a fresh life, or one
/// phase of a sequential one.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluation {
    /// How it ended.
    pub outcome: Outcome,
    /// Showings simulated.
    pub simulated: u64,
    /// Showings that another image's life stood for.
    pub shared: u64,
    /// Showings not needed after an early stop (or after an instability).
    pub stopped: u64,
}

/// Displacement per image, as far as known.
pub type Known = Vec<Option<f64>>;

/// Whether a robot with these displacements so far may still get into the archive.
pub type MayWin<'a> = dyn Fn(&[Option<f64>]) -> bool + Sync + Send + 'a;

/// A body to be evaluated.
pub struct Job<'a> {
    /// The body.
    pub body: &'a Body,
    /// The image to begin with, where the order is free (fresh lives): the one that limits its parent.
    pub first_image: usize,
    /// Whether it may still get into the archive, given some of its displacements; asked with early stopping only.
    pub may_win: Box<MayWin<'a>>,
}

/// Evaluates jobs, each on all images; results in the jobs' order, the same on any number of threads.
pub fn evaluate(
    jobs: &[Job],
    images: &[Grid<f64>],
    physics: &Physics,
    protocol: &Protocol,
    savings: Savings,
) -> Vec<Evaluation> {
    let stage = Stage { images, physics, protocol, savings };
    let done: Vec<Mutex<Option<Evaluation>>> = jobs.iter().map(|_| Mutex::new(None)).collect();
    rayon::scope(|scope| {
        for (job, done) in jobs.iter().zip(&done) {
            let stage = &stage;
            scope.spawn(move |scope| match protocol.life {
                Life::Sequential => put(done, stage.sequential(job)),
                Life::Fresh => stage.fresh(job, done, scope),
            });
        }
    });
    let whole = |slot: Mutex<Option<Evaluation>>| slot.into_inner().unwrap_or_else(|e| e.into_inner());
    // Every task has put its evaluation in, or the scope has passed its panic on.
    done.into_iter().filter_map(whole).collect()
}

fn put(slot: &Mutex<Option<Evaluation>>, evaluation: Evaluation) {
    *slot.lock().unwrap_or_else(|e| e.into_inner()) = Some(evaluation);
}

/// What all jobs of an evaluation have in common.
struct Stage<'a> {
    images: &'a [Grid<f64>],
    physics: &'a Physics,
    protocol: &'a Protocol,
    savings: Savings,
}

/// A fresh evaluation under way.
struct Progress {
    lattice: Lattice,
    /// Images still to be shown, next last.
    open: Vec<usize>,
    /// For each image the one whose life it shares.
    same_as: Vec<usize>,
    known: Known,
    simulated: u64,
}

impl<'a> Stage<'a> {
    fn sequential(&self, job: &Job) -> Evaluation {
        let lattice = Lattice::new(job.body, self.physics);
        let mut rollout = Rollout::new(&lattice, self.physics, self.protocol);
        let mut known: Known = vec![None; self.images.len()];
        let mut simulated = 0;
        let ended = |outcome, simulated| {
            let stopped = self.images.len() as u64 - simulated;
            Evaluation { outcome, simulated, shared: 0, stopped }
        };
        for (index, image) in self.images.iter().enumerate() {
            simulated += 1;
            match rollout.show(image, |_| ()) {
                Ok(displacement) => known[index] = Some(displacement),
                Err(unstable) => return ended(Outcome::Unstable(unstable), simulated),
            }
            if self.savings.early_stop && index + 1 < self.images.len() && !(job.may_win)(&known) {
                return ended(Outcome::Stopped, simulated);
            }
        }
        ended(Outcome::Walked(known.into_iter().flatten().collect()), simulated)
    }

    /// Fresh lives are independent work items. Without early stopping all at once; with it one after the other for
    /// a robot, so that what is simulated does not depend on timing.
    fn fresh<'s>(&'s self, job: &'s Job<'s>, done: &'s Mutex<Option<Evaluation>>, scope: &rayon::Scope<'s>) {
        let views: Vec<&Grid<f64>> = self.images.iter().collect();
        let same_as = match self.savings.shared_lives {
            true => same_to_sensors(job.body, &views),
            false => (0..views.len()).collect(),
        };
        let first = same_as.get(job.first_image).copied().unwrap_or(0);
        let mut open: Vec<usize> = (0..views.len()).filter(|&i| same_as[i] == i && i != first).collect();
        open.reverse();
        open.push(first);
        let lattice = Lattice::new(job.body, self.physics);
        let mut progress = Progress { lattice, open, same_as, known: vec![None; views.len()], simulated: 0 };
        if self.savings.early_stop {
            self.advance(job, done, progress, scope);
            return;
        }
        let open = std::mem::take(&mut progress.open);
        let life = |&image: &usize| (image, self.life(&progress.lattice, image));
        let lives: Vec<_> = open.par_iter().rev().map(life).collect();
        progress.simulated = lives.len() as u64;
        let unstable = lives.iter().find_map(|(_, life)| life.err());
        lives.into_iter().for_each(|(image, life)| progress.note(image, life.ok()));
        put(done, progress.ended(unstable.map(Outcome::Unstable)));
    }

    fn life(&self, lattice: &Lattice, image: usize) -> Result<f64, Unstable> {
        fresh_life(lattice, self.physics, self.protocol, &self.images[image])
    }

    /// Shows the next image, then spawns the rest as a task of its own if the robot may still win.
    fn advance<'s>(
        &'s self,
        job: &'s Job<'s>,
        done: &'s Mutex<Option<Evaluation>>,
        mut progress: Progress,
        scope: &rayon::Scope<'s>,
    ) {
        let Some(image) = progress.open.pop() else {
            return put(done, progress.ended(None));
        };
        progress.simulated += 1;
        match self.life(&progress.lattice, image) {
            Err(unstable) => return put(done, progress.ended(Some(Outcome::Unstable(unstable)))),
            Ok(displacement) => progress.note(image, Some(displacement)),
        }
        if progress.open.is_empty() {
            put(done, progress.ended(None));
        } else if !(job.may_win)(&progress.known) {
            put(done, progress.ended(Some(Outcome::Stopped)));
        } else {
            scope.spawn(move |scope| self.advance(job, done, progress, scope));
        }
    }
}

impl Progress {
    fn note(&mut self, image: usize, displacement: Option<f64>) {
        for (known, _) in self.known.iter_mut().zip(&self.same_as).filter(|(_, same)| **same == image) {
            *known = displacement;
        }
    }

    fn ended(self, early: Option<Outcome>) -> Evaluation {
        let all = self.known.len() as u64;
        let stopped = self.same_as.iter().filter(|same| self.open.contains(same)).count() as u64;
        let shared = all - self.simulated - stopped;
        let outcome = early.unwrap_or_else(|| Outcome::Walked(self.known.into_iter().flatten().collect()));
        Evaluation { outcome, simulated: self.simulated, shared, stopped }
    }
}
