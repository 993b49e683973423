//! The commands, one file each: options in, result out. They compose the modules below, report
//! through an [`Observer`](crate::base::observer::Observer), and never print.

pub mod audit;
pub mod bench;
pub mod capacity;
pub(crate) mod collect;
#[cfg(feature = "figures")]
pub mod compare;
pub mod data;
pub mod eval;
pub mod evolve;
pub mod pairs;
pub mod plan;
#[cfg(feature = "figures")]
pub mod plot;
pub mod replay;
#[cfg(feature = "figures")]
pub(crate) mod report;
pub(crate) mod reproduce;
pub mod response;
pub mod schema;
pub mod simulate;
pub(crate) mod sweep;
pub(crate) mod table;
pub(crate) mod tasks;
pub mod team;
pub mod train;
pub mod verify;
