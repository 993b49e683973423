//! [`Ranks`]: processes that share the work of one command, by MPI (feature `mpi`).
//!
//! Every process, a *rank*, runs the same code on the same data, so all have the same results. Only
//! slow work is divided, and its results are exchanged. The first rank leads: it alone writes
//! results and prints. (Any rank may write `validation.json`: all have the same bytes.)

use crate::base::error::Error;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::cmp::Reverse;

/// The ranks as seen by one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ranks {
    rank: usize,
    size: usize,
}

/// Keeps MPI running; dropping it finalises MPI.
pub struct Guard {
    #[cfg(feature = "mpi")]
    _universe: Option<mpi::environment::Universe>,
}

/// Environment variables in which MPI launchers put the number of processes.
const LAUNCHED: [&str; 2] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"];

impl Ranks {
    pub(crate) const ALONE: Ranks = Ranks { rank: 0, size: 1 };

    /// Joins the ranks that this process was started with; without MPI it is alone.
    ///
    /// # Errors
    /// Returns an error if MPI cannot be used, or if it started several processes of a program
    /// built without it, which would all do the same work.
    pub fn join() -> Result<(Ranks, Guard), Error> {
        let launched = LAUNCHED
            .iter()
            .find_map(|name| std::env::var(name).ok()?.trim().parse::<usize>().ok());
        join(launched)
    }

    /// Returns true if this is the rank that writes and prints.
    pub fn leads(self) -> bool {
        self.rank == 0
    }

    pub(crate) fn rank(self) -> usize {
        self.rank
    }

    /// Returns the number of ranks.
    pub fn size(self) -> usize {
        self.size
    }

    /// Returns the rank that does each piece of work, given the pieces' sizes.
    pub(crate) fn owners(self, sizes: &[u64]) -> Vec<usize> {
        owners(sizes, self.size)
    }

    /// Returns the values of all ranks, in their order. Every rank must call it, or others block.
    ///
    /// # Panics
    /// If a value cannot pass through JSON, which cannot happen as all ranks run the same program.
    pub fn share<T: Serialize + DeserializeOwned>(self, own: T) -> Vec<T> {
        const WHY: &str = "all ranks are the same program, and say numbers, texts and lists";
        if self.size == 1 {
            return vec![own];
        }
        let all = gather(&serde_json::to_vec(&own).expect(WHY));
        all.iter()
            .map(|bytes| serde_json::from_slice(bytes).expect(WHY))
            .collect()
    }

    /// Divides jobs among the ranks by size. Each rank does its own with `work` and receives all
    /// results, in the jobs' order. If one rank's `work` gives up, all return `None`. Every rank
    /// must call it with the same jobs, or the others block.
    pub(crate) fn scatter_gather<J, R: Serialize + DeserializeOwned>(
        self,
        jobs: Vec<J>,
        sizes: &[u64],
        work: impl FnOnce(&[J]) -> Option<Vec<R>>,
    ) -> Option<Vec<R>> {
        let owners = self.owners(sizes);
        let own: Vec<J> = jobs
            .into_iter()
            .zip(&owners)
            .filter(|(_, owner)| **owner == self.rank)
            .map(|(job, _)| job)
            .collect();
        let shares: Option<Vec<Vec<R>>> = self.share(work(&own)).into_iter().collect();
        let mut shares: Vec<_> = shares?.into_iter().map(Vec::into_iter).collect();
        let next = |owner: &usize| shares[*owner].next().expect("a rank does all of its jobs");
        Some(owners.iter().map(next).collect())
    }

    /// Returns true if all ranks vote true. Even a stopped rank must vote, or the others block.
    pub(crate) fn all(self, own: bool) -> bool {
        self.share(own).into_iter().all(|is_so| is_so)
    }

    /// Returns the leading rank's value. Every rank must call it, or the others block.
    pub(crate) fn broadcast<T: Serialize + DeserializeOwned>(self, own: Option<T>) -> Option<T> {
        self.share(own).swap_remove(0)
    }

    /// Ends all ranks at once, this one with an exit code; for failures that others may not know.
    pub(crate) fn abort(self, code: u8) -> ! {
        abort(code)
    }
}

/// Divides pieces of work of these sizes among ranks: the largest first, each to the rank with the
/// least work. So the result depends on the sizes alone.
pub fn owners(sizes: &[u64], ranks: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    // A stable sort: pieces of the same size keep their order.
    order.sort_by_key(|piece| Reverse(sizes[*piece]));
    let (mut owners, mut loads) = (vec![0; sizes.len()], vec![0_u64; ranks]);
    for piece in order {
        let owner = (0..ranks).min_by_key(|rank| loads[*rank]).unwrap_or(0);
        owners[piece] = owner;
        loads[owner] += sizes[piece].max(1);
    }
    owners
}

#[cfg(feature = "mpi")]
mod world {
    use super::{Error, Guard, Ranks};
    use mpi::Threading;
    use mpi::collective::CommunicatorCollectives;
    use mpi::datatype::PartitionMut;
    use mpi::topology::{Communicator, SimpleCommunicator};

    pub(super) fn join(_launched: Option<usize>) -> Result<(Ranks, Guard), Error> {
        // One thread at a time calls MPI, but not always the first one.
        let Some((universe, _)) = mpi::initialize_with_threading(Threading::Serialized) else {
            return Err(Error::other(
                "MPI cannot be used: it was initialised before".to_string(),
            ));
        };
        let world = universe.world();
        let number = |number: i32| usize::try_from(number).expect("ranks are counted from 0");
        let ranks = Ranks {
            rank: number(world.rank()),
            size: number(world.size()),
        };
        Ok((
            ranks,
            Guard {
                _universe: Some(universe),
            },
        ))
    }

    pub(super) fn gather(own: &[u8]) -> Vec<Vec<u8>> {
        let world = SimpleCommunicator::world();
        let length =
            i32::try_from(own.len()).expect("what ranks exchange is far below two gigabytes");
        let size = usize::try_from(world.size()).expect("ranks are counted from 0");
        let mut lengths = vec![0_i32; size];
        world.all_gather_into(&length, &mut lengths[..]);
        let starts: Vec<i32> = lengths
            .iter()
            .scan(0_i32, |start, length| {
                let here = *start;
                *start += length;
                Some(here)
            })
            .collect();
        let place = |number: i32| usize::try_from(number).expect("lengths are not negative");
        let total: usize = lengths.iter().copied().map(place).sum();
        let mut all = vec![0_u8; total];
        {
            let mut parts = PartitionMut::new(&mut all[..], &lengths[..], &starts[..]);
            world.all_gather_varcount_into(own, &mut parts);
        }
        let part = |(start, length): (&i32, &i32)| {
            all[place(*start)..place(*start) + place(*length)].to_vec()
        };
        starts.iter().zip(&lengths).map(part).collect()
    }

    pub(super) fn abort(code: u8) -> ! {
        SimpleCommunicator::world().abort(i32::from(code))
    }
}

#[cfg(not(feature = "mpi"))]
mod world {
    use super::{Error, Guard, Ranks};

    pub(super) fn join(launched: Option<usize>) -> Result<(Ranks, Guard), Error> {
        match launched {
            Some(size) if size > 1 => {
                let text =
                    format!("MPI started {size} processes, and this morphcog is built without MPI");
                let error = Error::usage(text).advice("build it with the feature mpi");
                Err(error.advice("start it once"))
            }
            _ => Ok((Ranks::ALONE, Guard {})),
        }
    }

    pub(super) fn gather(own: &[u8]) -> Vec<Vec<u8>> {
        vec![own.to_vec()]
    }

    pub(super) fn abort(code: u8) -> ! {
        std::process::exit(i32::from(code))
    }
}

use world::{abort, gather, join};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_pieces_go_first_and_every_rank_has_about_as_much() {
        assert_eq!(owners(&[1, 9, 5, 5, 4], 3), [2, 0, 1, 2, 1]);
        assert_eq!(
            owners(&[0, 0, 0, 0], 3),
            [0, 1, 2, 0],
            "what weighs nothing is divided, too"
        );
        assert_eq!(Ranks::ALONE.owners(&[3, 1]), [0, 0]);
        assert_eq!(owners(&[], 3), Vec::<usize>::new());
    }

    #[test]
    fn a_process_alone_shares_with_itself() {
        assert_eq!(Ranks::ALONE.share(vec![1.5, -0.0]), [vec![1.5, -0.0]]);
        assert_eq!(Ranks::ALONE.broadcast(Some(7)), Some(7));
    }
}
