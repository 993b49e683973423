//! What the commands do, one file per command: options in, result out. They compose the modules
//! below, report through an [`Observer`](crate::base::observer::Observer), and never print.

pub mod audit;
pub mod bench;
#[cfg(feature = "networks")]
pub mod capacity;
#[cfg(feature = "networks")]
pub mod capacity_images;
pub mod collect;
pub mod data;
pub mod eval;
pub mod eval_images;
pub mod one_by_one;
#[cfg(feature = "networks")]
pub mod plan;
pub mod plot;
pub mod replay;
pub mod report;
#[cfg(feature = "networks")]
pub mod reproduce;
#[cfg(feature = "networks")]
pub mod schema;
pub mod simulate;
pub mod sweep;
#[cfg(feature = "networks")]
pub mod table;
pub mod tasks;
pub mod team;
