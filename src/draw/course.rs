//! Pictures of a robot at one of EvoGym's tasks.

use crate::base::Grid;
use crate::draw::colour::GRID;
use crate::draw::error::PictureError;
use crate::draw::raster;
use crate::draw::scene::{Look, Primitive, Window, body, ruler, terrain};
use crate::draw::walk::Walk;
use crate::evogym::environment::Environment;
use crate::task::class_names::ClassNames;
use crate::task::recording::{Frame, LabelledStimulus, Phase, Recording, VoxelCorners};
use std::ops::RangeInclusive;
use tiny_skia::Pixmap;

/// The sides that a picture can have, pixels.
const SIDES: RangeInclusive<u32> = 16..=4096;
/// The voxel length, pixels, from which the grid is drawn.
const FINE: f64 = 5.0;

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The middle of the picture, voxel lengths.
    pub centre: [f64; 2],
    /// The width of the part of the world that is shown, voxel lengths.
    pub width: f64,
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// True if the ground and the sky's colour are drawn.
    pub background: bool,
    /// True if the grid is drawn.
    pub grid: bool,
    /// True if the robot is drawn.
    pub robot: bool,
    /// True if the ground's outline is drawn.
    pub edges: bool,
}

/// Draws a robot on its ground; returns red, green and blue of each pixel, rows from the top.
///
/// # Errors
/// Returns a [`PictureError`] if the picture would be too small or too large.
pub fn picture(environment: &Environment, view: &View) -> Result<Vec<u8>, PictureError> {
    let [width, height] = view.size;
    if !view.size.iter().all(|side| SIDES.contains(side)) {
        return Err(PictureError::Size { width, height });
    }
    let mut pixmap = Pixmap::new(width, height).ok_or(PictureError::Size { width, height })?;
    pixmap.fill(tiny_skia::Color::WHITE);
    let scale = f64::from(width) / view.width.clamp(1.0, 1e4);
    let half = view.size.map(|side| f64::from(side) / scale / 2.0);
    let [x, y] = view.centre.map(|at| if at.is_finite() { at } else { 0.0 });
    let window = Window {
        left: x - half[0],
        right: x + half[0],
        bottom: y - half[1],
        top: y + half[1],
        scale,
        zoom: (f64::from(width) / 720.0).max(1.0),
        crisp: false,
        look: Look::Plain,
    };
    let mut scene = Vec::new();
    if view.grid && scale >= FINE {
        grid(&window, &mut scene);
    }
    if view.background {
        for object in environment.course().terrain.objects() {
            terrain(object, &window, view.edges, &mut scene);
        }
    }
    if view.robot {
        let recording = moment(environment);
        scene.extend(body(&Walk::new(&recording)?, 0, &window));
    }
    raster::draw(&mut pixmap, &scene, window.zoom, |[x, y]| {
        [(x - window.left) * scale, (window.top - y) * scale]
    });
    let pixels = pixmap.data().chunks_exact(4);
    Ok(pixels
        .flat_map(|pixel| [pixel[0], pixel[1], pixel[2]])
        .collect())
}

fn grid(window: &Window, scene: &mut Vec<Primitive>) {
    let line = |points: [[f64; 2]; 2]| Primitive::Line {
        points: points.to_vec(),
        width: 1.0,
        colour: GRID,
        smooth: false,
    };
    let columns = ruler(window, 0.0, 1.0);
    scene.extend(columns.map(|x| line([[x, window.bottom], [x, window.top]])));
    let rows = window.bottom.ceil() as i64..=window.top.floor() as i64;
    scene.extend(rows.map(|y| line([[window.left, y as f64], [window.right, y as f64]])));
}

/// Returns the present moment as a recording, in voxel lengths from the world's corner.
fn moment(environment: &Environment) -> Recording {
    let points = environment
        .points()
        .iter()
        .map(|point| point.map(|at| at / 0.1));
    let body = environment.body();
    let voxel = |((row, column), corners)| VoxelCorners {
        row,
        column,
        corners,
    };
    Recording {
        robot: String::new(),
        body: body.clone(),
        terrain: None,
        voxels: environment.voxels().map(voxel).collect(),
        phases: vec![Phase {
            first_frame: 0,
            seen: LabelledStimulus {
                class: 0,
                label: String::new(),
                stimulus: Grid::filled(body.height(), body.width(), 0.0),
                image: None,
            },
            displacement: 0.0,
        }],
        frames: vec![Frame {
            points: points.collect(),
            centre: [0.0; 2],
        }],
        every: 1,
        cycle: 50,
        unstable: false,
        judge: None,
        names: ClassNames::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Material;
    use crate::draw::colour::{GROUND, PAPER, shade};
    use crate::evogym::{course::Course, robot, tasks};
    use std::sync::Arc;

    #[test]
    fn ground_and_robot_are_where_the_view_says() {
        let course = Arc::new(Course::new(tasks::find("Walker-v0").unwrap()).unwrap());
        let body = robot::body(&Grid::filled(2, 2, 3)).unwrap();
        let environment = Environment::new(&course, &body, None).unwrap();
        let view = View {
            centre: [3.0, 2.0],
            width: 8.0,
            size: [160, 80],
            background: true,
            grid: true,
            robot: true,
            edges: true,
        };
        let pixels = picture(&environment, &view).unwrap();
        let at = |[x, y]: [f64; 2], pixels: &[u8]| {
            let (column, row) = ((20.0 * (x + 1.0)) as usize, (20.0 * (4.0 - y)) as usize);
            let first = 3 * (160 * row + column);
            [pixels[first], pixels[first + 1], pixels[first + 2]]
        };
        assert_eq!(at([4.5, 0.5], &pixels), GROUND.rgb);
        assert_eq!(at([4.5, 1.5], &pixels), PAPER.rgb);
        // Beside the mark in the middle of the voxel.
        let robot = shade(Material::ActuatorHorizontal, 1.0).rgb;
        assert_eq!(at([1.2, 1.2], &pixels), robot);
        let hidden = View {
            robot: false,
            background: false,
            ..view
        };
        let pixels = picture(&environment, &hidden).unwrap();
        assert_eq!(
            [[1.2, 1.2], [4.5, 0.5]].map(|place| at(place, &pixels)),
            [PAPER.rgb; 2]
        );
        assert!(
            picture(
                &environment,
                &View {
                    size: [4, 80],
                    ..view
                }
            )
            .is_err()
        );
    }
}
