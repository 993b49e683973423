//! Floor 0: what every room stands on (index arithmetic, random generators, hashes, files, numbers and lines as text).

pub mod clock;
pub mod files;
pub mod grid;
pub mod hash;
pub mod lanes;
pub mod number;
pub mod random;
pub mod stop;
pub mod text;

pub use grid::Grid;
