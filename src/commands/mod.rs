//! The commands, one file each: options in, result out. They compose the modules below, report
//! through an [`Observer`](crate::base::observer::Observer), and never print.

pub mod audit;
pub mod bench;
pub mod capacity;
pub mod collect;
pub mod data;
pub mod eval;
pub mod evolve;
pub mod plan;
#[cfg(feature = "figures")]
pub mod plot;
pub mod replay;
pub mod reproduce;
pub mod response;
pub mod schema;
pub mod simulate;
pub mod sweep;
pub mod table;
pub mod tasks;
pub mod team;
pub mod train;
