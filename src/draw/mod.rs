//! Pictures: recordings of rollouts become images, animations and pages here.
//!
//! A [`Walk`] is a checked [`Recording`](crate::task::recording::Recording); a [`Stage`] decides
//! what part of the world a picture shows; `scene` and `panel` make drawing primitives of one
//! frame; `raster` paints them. On top of these stand the animated GIF and the self-contained HTML
//! page. Figures for print are vectors and stand apart, in [`plot`].
//! `serve` is a page of its own, over HTTP.

pub mod colour;
pub mod error;
pub mod fonts;
pub mod gif;
pub mod html;
pub mod palette;
pub mod panel;
pub mod plot;
pub mod raster;
pub mod report;
pub mod scene;
pub mod sheet;
pub mod stage;
pub mod walk;

pub use stage::Stage;
pub use walk::Walk;

/// For tests: the simulation of a body (text form) that is shown `phases` images, dark and bright
/// ones by turns, each for `steps` control steps.
#[cfg(test)]
pub(crate) fn simulated(
    body: &str,
    phases: usize,
    steps: u32,
    fresh: bool,
) -> crate::task::recording::Recording {
    use crate::base::Grid;
    use crate::body::Body;
    use crate::sim::Physics;
    use crate::task::protocol::Protocol;
    use crate::task::recording::Seen;
    use crate::task::rollout::record;
    let body: Body = body.parse().expect("tests name bodies");
    let image = |phase: usize| {
        let pixel =
            |row: usize, column: usize| if (row + column + phase).is_multiple_of(3) { 1.0 } else { 0.0 };
        let stimulus = Grid::from_fn(body.height(), body.width(), pixel);
        let label = format!("{} (train {})", phase % 2, 2 * phase + 1);
        Seen { class: (phase % 2) as u8, label, stimulus }
    };
    let images: Vec<Seen> = (0..phases).map(image).collect();
    let protocol = Protocol { control_steps: steps, ..Protocol::default() };
    record("ROBOT", &body, &Physics::default(), &protocol, fresh, &images)
}
