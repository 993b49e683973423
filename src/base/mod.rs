//! Floor 0: what every room stands on (index arithmetic, random generators, hashes).

pub mod files;
pub mod grid;
pub mod hash;
pub mod lanes;
pub mod random;

pub use grid::Grid;
