//! Figures for print and pages. Each is a function from its data to a [`Figure`].
//!
//! `canvas` holds the elements, `svg`, `pixels` and `pdf` render them; figures share `axes` and
//! `scales`; `robot` draws bodies; `style` holds what users choose. Sizes fit a journal's column or
//! page, unless a width is chosen; words have 7 points at any width.

mod accuracy;
mod archive;
mod axes;
mod body;
pub(super) mod canvas;
mod capacity;
pub(crate) mod cells;
mod comparison;
mod figure;
mod gates;
mod pdf;
mod pixels;
mod progress;
mod response;
pub(super) mod robot;
mod scales;
mod snapshots;
mod spacetime;
mod style;
mod svg;
mod sweep;
mod team;

pub(crate) use accuracy::accuracy;
pub use archive::archive;
pub(crate) use body::body;
pub(crate) use capacity::capacity;
pub(crate) use comparison::comparison;
pub(crate) use figure::PRINT;
pub use figure::{Background, Figure};
pub(crate) use gates::gates;
pub(crate) use progress::progress;
pub(crate) use response::response;
pub(crate) use snapshots::snapshots;
pub(crate) use spacetime::spacetime;
pub use style::Style;
pub(crate) use style::{COLUMN, MILLIMETRES};
pub(crate) use sweep::sweep;
pub use team::{confusion, poster};
