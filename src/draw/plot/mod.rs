//! Figures for print and pages. Each is a function from its data to a [`Figure`].
//!
//! `canvas` holds the elements, `svg` and `pixels` render them; figures share `axes` and `scales`;
//! `robot` draws bodies. Sizes fit a journal's column or page; words have 7 points, captions less.

mod accuracy;
mod archive;
mod axes;
mod body;
pub(super) mod canvas;
mod capacity;
mod figure;
mod pixels;
mod progress;
mod response;
pub(super) mod robot;
mod scales;
mod snapshots;
mod spacetime;
mod svg;
mod sweep;
mod team;

pub use accuracy::accuracy;
pub use archive::archive;
pub use body::body;
pub use capacity::capacity;
pub use figure::{Background, COLUMN, Figure, PAGE, PRINT};
pub use progress::progress;
pub use response::response;
pub use scales::{below, sequential};
pub use snapshots::snapshots;
pub use spacetime::spacetime;
pub use sweep::sweep;
pub use team::{confusion, poster};
