//! How much a robot's walk depends on each pixel: lives under images with that pixel flipped.

use super::replay::Subject;
use crate::base::Grid;
use crate::base::stop::NEVER;
use crate::sim::System;
use crate::task::protocol::Life;
use crate::task::rollout::walk;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// What flipping pixels of an image does to a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensitivity {
    /// What the image is, for people.
    pub label: String,
    /// The image as the robot sees it.
    pub stimulus: Grid<f64>,
    /// Displacement under it, voxel lengths; none if the life is unstable.
    pub displacement: Option<f64>,
    /// Every pixel that lies on a sensor voxel (others cannot matter).
    pub pixels: Vec<FlippedPixel>,
}

/// A pixel that was flipped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlippedPixel {
    /// Its row and column.
    pub place: (usize, usize),
    /// Displacement with that pixel flipped, voxel lengths; none if the life is unstable.
    pub displacement: Option<f64>,
}

impl Sensitivity {
    /// By how much flipping a pixel changes the displacement, voxel lengths; none if one of the lives is unstable.
    pub fn change(&self, pixel: &FlippedPixel) -> Option<f64> {
        Some(pixel.displacement? - self.displacement?)
    }

    /// Whether with that pixel flipped the robot walks the other way.
    pub fn turns(&self, pixel: &FlippedPixel) -> bool {
        matches!((self.displacement, pixel.displacement), (Some(a), Some(b)) if a * b < 0.0)
    }
}

/// Lives to simulate: one per image, and one per image and sensor.
pub fn lives(subject: &Subject) -> usize {
    subject.images.len() * (1 + sensors(subject).len())
}

/// Simulates all of them as the robot's protocol has it: in fresh lives, or in one after the images before, which stay
/// as they are. `progress` is told after every life how many are done.
pub fn sensitivity(subject: &Subject, progress: &(dyn Fn(u64) + Sync)) -> Vec<Sensitivity> {
    let config = &subject.found.config;
    let system = Arc::new(System::new(&subject.found.body, config.physics.clone()));
    let sensors = sensors(subject);
    let images: Vec<Grid<f64>> = subject.images.iter().map(|(_, image)| image.clone()).collect();
    let flips = std::iter::once(None).chain(sensors.iter().copied().map(Some));
    let jobs: Vec<(usize, Option<(usize, usize)>)> =
        flips.flat_map(|flip| (0..images.len()).map(move |k| (k, flip))).collect();
    let done = AtomicU64::new(0);
    let live = |&(k, flip): &(usize, Option<(usize, usize)>)| {
        let mut shown = match config.protocol.life {
            Life::Fresh => vec![images[k].clone()],
            Life::Sequential => images[..=k].to_vec(),
        };
        if let (Some(place), Some(last)) = (flip, shown.last_mut()) {
            *last = flipped(last, place);
        }
        let displacements = walk(&system, &config.protocol, &shown, false, &NEVER);
        let displacements = displacements.expect("nobody sets NEVER");
        progress(done.fetch_add(1, Ordering::Relaxed) + 1);
        displacements.ok().and_then(|(displacements, _)| displacements.last().copied())
    };
    let displacements: Vec<Option<f64>> = jobs.par_iter().map(live).collect();
    let of = |k: usize, flip: Option<(usize, usize)>| {
        jobs.iter().zip(&displacements).find(|(job, _)| **job == (k, flip)).and_then(|(_, d)| *d)
    };
    let image = |(k, (label, stimulus)): (usize, &(String, Grid<f64>))| Sensitivity {
        label: label.clone(),
        stimulus: stimulus.clone(),
        displacement: of(k, None),
        pixels: sensors
            .iter()
            .map(|&place| FlippedPixel { place, displacement: of(k, Some(place)) })
            .collect(),
    };
    subject.images.iter().enumerate().map(image).collect()
}

fn sensors(subject: &Subject) -> Vec<(usize, usize)> {
    let voxels = subject.found.body.voxels().iter();
    voxels.filter(|(_, material)| material.is_sensor()).map(|(place, _)| place).collect()
}

/// The image with a pixel as far away from itself as can be: a dark one white, a bright one black.
fn flipped(image: &Grid<f64>, place: (usize, usize)) -> Grid<f64> {
    let mut image = image.clone();
    image[place] = if image[place] < 0.5 { 1.0 } else { 0.0 };
    image
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::replay::{Options, find};
    use crate::task::protocol::Protocol;

    fn subject(life: Life) -> Subject {
        let mut found = find(&Options { robot: "YJTLA".into(), ..Options::default() }).unwrap();
        found.body = "4663/4005/3305".parse().unwrap();
        found.config.protocol = Protocol { life, control_steps: 15, ..Protocol::default() };
        let image = |v: f64| Grid::from_fn(3, 4, |r, c| if r == c { v } else { 0.0 });
        Subject { found, images: vec![("dark".into(), image(0.0)), ("diagonal".into(), image(1.0))] }
    }

    #[test]
    fn only_sensors_are_flipped_and_every_life_is_the_one_it_says() {
        for life in [Life::Fresh, Life::Sequential] {
            let subject = subject(life);
            let count = AtomicU64::new(0);
            let found = sensitivity(&subject, &|_| {
                count.fetch_add(1, Ordering::Relaxed);
            });
            assert_eq!((count.into_inner() as usize, lives(&subject)), (10, 10));
            let places: Vec<_> = found[1].pixels.iter().map(|pixel| pixel.place).collect();
            assert_eq!(places, [(0, 1), (0, 2), (1, 3), (2, 3)]);
            let config = &subject.found.config;
            let system = Arc::new(System::new(&subject.found.body, config.physics.clone()));
            let flip = flipped(&subject.images[1].1, (1, 3));
            let shown = match life {
                Life::Fresh => vec![flip],
                Life::Sequential => vec![subject.images[0].1.clone(), flip],
            };
            let (expected, _) = walk(&system, &config.protocol, &shown, false, &NEVER).unwrap().unwrap();
            assert_eq!(found[1].pixels[2].displacement, expected.last().copied());
            assert!(found[1].change(&found[1].pixels[2]).is_some_and(|change| change != 0.0));
        }
    }

    #[test]
    fn a_flip_goes_to_the_far_end() {
        let image = Grid::from_fn(1, 3, |_, c| [0.0, 0.6, 1.0][c]);
        let values: Vec<f64> = (0..3).map(|c| flipped(&image, (0, c))[(0, c)]).collect();
        assert_eq!(values, [1.0, 0.0, 0.0]);
    }

    #[test]
    fn an_unstable_life_has_no_displacement() {
        let mut subject = subject(Life::Fresh);
        subject.found.config.physics.blow_up_extent = 0.12;
        let found = sensitivity(&subject, &|_| ());
        assert!(found.iter().all(|s| s.pixels.iter().all(|p| s.change(p).is_none() && !s.turns(p))));
    }
}
