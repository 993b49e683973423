//! Images, animations and pages made from recordings of rollouts.
//!
//! A [`Walk`](walk::Walk) is a validated [`Recording`](crate::task::recording::Recording); a
//! [`Stage`](stage::Stage) decides which part of the world a picture shows. `scene` and `panel` turn one frame into drawing
//! primitives, and `raster` paints them. The animated GIF, films and the self-contained HTML page
//! build on these. Figures for print are vectors, in [`plot`]; `serve` has its own page, over HTTP.

pub(crate) mod colour;
pub mod course;
pub(crate) mod error;
pub mod film;
pub(crate) mod fonts;
pub mod gif;
pub mod html;
mod lzw;
pub(crate) mod palette;
pub(crate) mod panel;
pub mod plot;
pub mod raster;
pub(crate) mod report;
pub(crate) mod scene;
pub(crate) mod sheet;
pub(crate) mod stage;
pub(crate) mod video;
pub mod walk;

/// Simulates a body (text form) for tests, under `phases` images, alternately dark and bright, for
/// `steps` control steps each.
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
    use crate::task::recording::LabelledStimulus;
    use crate::task::rollout::record;
    let body: Body = body.parse().expect("tests name bodies");
    let image = |phase: usize| {
        let pixel = |row: usize, column: usize| {
            if (row + column + phase).is_multiple_of(3) {
                1.0
            } else {
                0.0
            }
        };
        let stimulus = Grid::from_fn(body.height(), body.width(), pixel);
        let label = format!("{} (train {})", phase % 2, 2 * phase + 1);
        LabelledStimulus {
            class: (phase % 2) as u8,
            label,
            stimulus,
            image: None,
        }
    };
    let images: Vec<LabelledStimulus> = (0..phases).map(image).collect();
    let protocol = Protocol {
        control_steps: steps,
        ..Protocol::default()
    };
    record(
        "ROBOT",
        &body,
        &Physics::default(),
        &protocol,
        fresh,
        &images,
    )
}
