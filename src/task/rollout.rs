//! Rollouts: from a body, a protocol and stimuli to displacements.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::stop::{NEVER, Stopped};
use crate::base::text::counted;
use crate::body::Body;
use crate::sim::{Energy, Physics, Start, StepError, System, Unstable, World, Worlds};
use crate::task::class_names::ClassNames;
use crate::task::protocol::{Protocol, RolloutMode};
use crate::task::recording::{Frame, LabelledStimulus, Phase, Recording, VoxelCorners};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Most places of points in a recording: some gigabyte.
pub(crate) const MOST_PLACES: usize = 50_000_000;

/// Converts world units to voxel lengths, in which distances are reported, as in the paper.
pub(crate) fn voxel_lengths(world_units: f64, physics: &Physics) -> f64 {
    world_units / physics.cell_size
}

/// Converts a position in world units to voxel lengths, with y from the ground.
pub fn place([x, y]: [f64; 2], physics: &Physics) -> [f64; 2] {
    [
        voxel_lengths(x, physics),
        voxel_lengths(y, physics) - f64::from(physics.ground_row),
    ]
}

/// Converts a position in a world to voxel lengths: from the body's left edge at the start and the
/// flat ground, or on terrain from column 0 and row 0.
pub fn place_in(world: &World, [x, y]: [f64; 2]) -> [f64; 2] {
    let physics = world.system().physics();
    match world.terrain() {
        None => place([x, y], physics),
        Some(_) => {
            let left = world.start().column as f64;
            [left + voxel_lengths(x, physics), voxel_lengths(y, physics)]
        }
    }
}

/// A robot on the ground, ready for images.
pub struct Rollout {
    world: World,
    /// Number of control steps per image.
    control_steps: u32,
    /// Centre of mass along x at the start of the current image \[world units\].
    begin: f64,
}

impl Rollout {
    /// Makes a robot at its start.
    pub fn new(system: &Arc<System>, protocol: &Protocol) -> Self {
        let start = Start {
            column: protocol.start_column,
            row: protocol.start_row,
        };
        let world = World::new(Arc::clone(system), start);
        Rollout {
            begin: world.centre_of_mass()[0],
            world,
            control_steps: protocol.control_steps,
        }
    }

    fn physics(&self) -> &Physics {
        self.world.system().physics()
    }

    /// Simulates an image for the protocol's control steps from the current state. Returns the
    /// displacement of the centre of mass along x, in voxel lengths, right positive. `watch` is
    /// called after every control step.
    ///
    /// # Errors
    /// Returns [`Unstable`] if the rollout ends.
    pub fn show(
        &mut self,
        stimulus: &Grid<f64>,
        mut watch: impl FnMut(&World),
    ) -> Result<f64, Unstable> {
        self.look_at(stimulus);
        for _ in 0..self.control_steps {
            self.step()?;
            watch(&self.world);
        }
        Ok(self.moved())
    }

    /// Acts as [`Rollout::show`] without a watcher, unless `stop` is set in the meantime.
    pub(crate) fn show_unless(
        &mut self,
        stimulus: &Grid<f64>,
        stop: &AtomicBool,
    ) -> Result<f64, StepError> {
        self.look_at(stimulus);
        for _ in 0..self.control_steps {
            self.step_unless(stop)?;
        }
        Ok(self.moved())
    }

    /// Sets the image until the next call, and measures displacement from here.
    pub(crate) fn look_at(&mut self, stimulus: &Grid<f64>) {
        self.world.set_stimulus(stimulus);
        self.begin = self.world.centre_of_mass()[0];
    }

    pub(crate) fn step(&mut self) -> Result<(), Unstable> {
        self.world.step()
    }

    /// Simulates one control step; returns soon after `stop` is set.
    pub(crate) fn step_unless(&mut self, stop: &AtomicBool) -> Result<(), StepError> {
        self.world.step_unless(stop)
    }

    /// Returns the centre of mass's x displacement under this image, voxel lengths, right positive.
    pub(crate) fn moved(&self) -> f64 {
        voxel_lengths(self.world.centre_of_mass()[0] - self.begin, self.physics())
    }

    pub(crate) fn frame(&self) -> Frame {
        frame(&self.world)
    }

    /// Returns the voxels with their corners, as indices into a [`Rollout::frame`]'s points.
    pub(crate) fn voxels(&self) -> Vec<VoxelCorners> {
        voxels(&self.world)
    }

    pub(crate) fn reset(&mut self) {
        self.world.reset();
    }
}

/// Simulates one fresh rollout under one image, unless `stop` is set in the meantime. Returns its
/// displacement in voxel lengths.
///
/// # Errors
/// Returns a [`StepError`] if it was stopped, or if the rollout became unstable.
pub fn fresh_rollout(
    system: &Arc<System>,
    protocol: &Protocol,
    stimulus: &Grid<f64>,
    stop: &AtomicBool,
) -> Result<f64, StepError> {
    Rollout::new(system, protocol).show_unless(stimulus, stop)
}

/// Simulates fresh rollouts under at most [`Worlds::MOST`] images, side by side, unless `stop` is
/// set in the meantime. Returns displacements in voxel lengths, with the bits of [`fresh_rollout`].
///
/// # Errors
/// Returns [`Stopped`] if `stop` was set; single rollouts return [`Unstable`].
pub fn fresh_rollouts_of(
    system: &Arc<System>,
    protocol: &Protocol,
    stimuli: &[Grid<f64>],
    stop: &AtomicBool,
) -> Result<Vec<Result<f64, Unstable>>, Stopped> {
    if let [one] = stimuli {
        return Ok(vec![StepError::outcome(fresh_rollout(
            system, protocol, one, stop,
        ))?]);
    }
    let start = Start {
        column: protocol.start_column,
        row: protocol.start_row,
    };
    let mut worlds = Worlds::new(Arc::clone(system), start, stimuli.len());
    stimuli
        .iter()
        .enumerate()
        .for_each(|(number, stimulus)| worlds.set_stimulus(number, stimulus));
    let begin = worlds.all()[0].centre_of_mass()[0];
    for _ in 0..protocol.control_steps {
        worlds.step_unless(stop)?;
    }
    let moved = |(world, ended): (&World, &Option<Unstable>)| match ended {
        Some(unstable) => Err(*unstable),
        None => Ok(voxel_lengths(
            world.centre_of_mass()[0] - begin,
            system.physics(),
        )),
    };
    Ok(worlds.all().iter().zip(worlds.ended()).map(moved).collect())
}

/// Simulates the images by the protocol, in fresh rollouts or one, unless `stop` is set in the
/// meantime. Returns the displacements in voxel lengths, and, if `measured`, the energies put in.
pub(crate) fn walk(
    system: &Arc<System>,
    protocol: &Protocol,
    stimuli: &[Grid<f64>],
    measured: bool,
    stop: &AtomicBool,
) -> Result<(Vec<f64>, Energy), StepError> {
    let mut rollout = Rollout::new(system, protocol);
    if measured {
        rollout.world = rollout.world.with_energy_meter();
    }
    let mut displacements = Vec::with_capacity(stimuli.len());
    for stimulus in stimuli {
        if protocol.rollout == RolloutMode::Fresh {
            rollout.reset();
        }
        displacements.push(rollout.show_unless(stimulus, stop)?);
    }
    Ok((displacements, rollout.world.energy()))
}

/// Returns for each stimulus the first with the same pixels under sensors: those share a rollout.
pub(crate) fn same_to_sensors(body: &Body, stimuli: &[&Grid<f64>]) -> Vec<usize> {
    let sensors = || {
        body.voxels()
            .iter()
            .filter(|(_, m)| m.is_sensor())
            .map(|(place, _)| place)
    };
    let mut first = std::collections::HashMap::new();
    let seen = |stimulus: &Grid<f64>| {
        sensors()
            .map(|place| stimulus.or_default(place).to_bits())
            .collect::<Vec<u64>>()
    };
    stimuli
        .iter()
        .enumerate()
        .map(|(i, stimulus)| *first.entry(seen(stimulus)).or_insert(i))
        .collect()
}

/// Checks that a recording of a body, which holds every point at every moment, is short enough.
///
/// # Errors
/// Returns an error that says how many control steps are possible.
pub fn check_length(
    [rows, columns]: [usize; 2],
    protocol: &Protocol,
    images: usize,
) -> Result<(), Error> {
    let points = (rows + 1) * (columns + 1);
    let most = MOST_PLACES / points / images.max(1);
    let steps = protocol.control_steps;
    match steps as usize > most {
        true => Err(Error::input(format!(
            "protocol.control_steps = {steps}: expected at most {most} to record a rollout under {}",
            counted(images, "image", "images")
        ))
        .advice("show fewer images")),
        false => Ok(()),
    }
}

/// Records a robot's rollout frame by frame for pictures, with one phase for each image and no
/// judge. An unstable rollout is recorded up to its end.
pub fn record(
    robot: &str,
    body: &Body,
    physics: &Physics,
    protocol: &Protocol,
    fresh: bool,
    images: &[LabelledStimulus],
) -> Recording {
    record_unless(robot, body, (physics, protocol), fresh, images, &NEVER)
        .expect("nothing sets its flag")
}

/// Acts as [`record`], unless `stop` is set in the meantime.
///
/// # Errors
/// Returns [`Stopped`] if `stop` was set.
pub fn record_unless(
    robot: &str,
    body: &Body,
    (physics, protocol): (&Physics, &Protocol),
    fresh: bool,
    images: &[LabelledStimulus],
    stop: &AtomicBool,
) -> Result<Recording, Stopped> {
    let system = Arc::new(System::new(body, physics.clone()));
    let mut rollout = Rollout::new(&system, protocol);
    let mut recording = Recording {
        robot: robot.to_string(),
        body: body.clone(),
        terrain: None,
        voxels: rollout.voxels(),
        phases: Vec::new(),
        frames: Vec::new(),
        every: 1,
        cycle: physics.cycle_steps as usize,
        unstable: false,
        judge: None,
        names: ClassNames::default(),
    };
    for (index, seen) in images.iter().enumerate() {
        if fresh || index == 0 {
            rollout.reset();
            recording.frames.push(rollout.frame());
        }
        let first_frame = recording.frames.len() - 1;
        rollout.look_at(&seen.stimulus);
        let mut unstable = false;
        let mut displacement = rollout.moved();
        for _ in 0..protocol.control_steps {
            unstable = StepError::outcome(rollout.step_unless(stop))?.is_err();
            if unstable {
                break;
            }
            displacement = rollout.moved();
            recording.frames.push(rollout.frame());
        }
        recording.phases.push(Phase {
            first_frame,
            seen: seen.clone(),
            displacement,
        });
        if unstable {
            recording.unstable = true;
            break;
        }
    }
    Ok(recording)
}

/// Records the start of a simulation and its present moment under a stimulus, for a picture.
pub fn moment(world: &World, body: &Body, stimulus: Grid<f64>) -> Recording {
    let mut start = world.clone();
    start.reset();
    let frames = vec![frame(&start), frame(world)];
    let seen = LabelledStimulus {
        class: 0,
        label: "now".to_string(),
        stimulus,
        image: None,
    };
    Recording {
        robot: String::new(),
        body: body.clone(),
        terrain: world.terrain().cloned(),
        voxels: voxels(world),
        phases: vec![Phase {
            first_frame: 0,
            seen,
            displacement: frames[1].centre[0] - frames[0].centre[0],
        }],
        frames,
        every: world.control_step() as usize,
        cycle: world.system().physics().cycle_steps as usize,
        unstable: false,
        judge: None,
        names: ClassNames::default(),
    }
}

/// Returns the present moment.
pub(crate) fn frame(world: &World) -> Frame {
    Frame {
        points: world.points().map(|at| place_in(world, at)).collect(),
        centre: place_in(world, world.centre_of_mass()),
    }
}

/// Returns the voxels with their corners, as indices into a [`frame`]'s points.
pub(crate) fn voxels(world: &World) -> Vec<VoxelCorners> {
    let corner = |((row, column), corners)| VoxelCorners {
        row,
        column,
        corners,
    };
    world.voxels().map(corner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::stop::NEVER;

    const STEPS: u32 = 12;

    fn protocol() -> Protocol {
        Protocol {
            rollout: RolloutMode::Fresh,
            control_steps: STEPS,
            ..Protocol::default()
        }
    }

    fn body() -> Body {
        "4663/4005/3305".parse().unwrap()
    }

    fn system() -> Arc<System> {
        Arc::new(System::new(&body(), Physics::default()))
    }

    /// Makes an image of one brightness except for a pixel over the empty middle.
    fn image(brightness: f64, middle: f64) -> Grid<f64> {
        Grid::from_fn(
            3,
            4,
            |r, c| if (r, c) == (1, 1) { middle } else { brightness },
        )
    }

    #[test]
    fn a_displacement_is_the_way_of_the_centre_of_mass_in_voxel_lengths() {
        let (system, protocol) = (system(), protocol());
        let mut rollout = Rollout::new(&system, &protocol);
        let mut way = Vec::new();
        let start = rollout.world.centre_of_mass()[0];
        let first = rollout
            .show(&image(1.0, 0.0), |world| {
                way.push(world.centre_of_mass()[0])
            })
            .unwrap();
        assert_eq!(way.len(), STEPS as usize);
        assert!((first - 10.0 * (way[STEPS as usize - 1] - start)).abs() < 1e-12 && first != 0.0);
        // The rollout continues from there; after a reset, from the beginning.
        assert_ne!(rollout.show(&image(1.0, 0.0), |_| ()).unwrap(), first);
        rollout.reset();
        assert_eq!(rollout.show(&image(1.0, 0.0), |_| ()).unwrap(), first);
        assert_eq!(
            fresh_rollout(&system, &protocol, &image(1.0, 0.0), &NEVER),
            Ok(first)
        );
    }

    #[test]
    fn images_are_the_same_to_sensors_if_they_differ_elsewhere_only() {
        let images = [
            image(0.0, 0.0),
            image(0.5, 0.0),
            image(0.0, 1.0),
            image(0.5, 0.7),
            image(0.25, 0.0),
        ];
        let views: Vec<&Grid<f64>> = images.iter().collect();
        assert_eq!(same_to_sensors(&body(), &views), [0, 1, 0, 1, 4]);
        let blind: Body = "4113/4001/3301".parse().unwrap();
        assert_eq!(same_to_sensors(&blind, &views), [0; 5]);
        assert!(same_to_sensors(&blind, &[]).is_empty());
        // Images that are the same to the sensors give the same rollout.
        let (system, protocol) = (system(), protocol());
        let live = |image| fresh_rollout(&system, &protocol, image, &NEVER).unwrap();
        assert_eq!(live(&images[1]), live(&images[3]));
        assert_ne!(live(&images[0]), live(&images[1]));
    }

    #[test]
    fn a_recording_has_the_bits_of_its_rollout_and_none_if_it_is_stopped() {
        let (protocol, physics) = (protocol(), Physics::default());
        let seen = LabelledStimulus {
            class: 0,
            label: String::new(),
            image: None,
            stimulus: image(1.0, 0.0),
        };
        let images = [seen.clone(), seen];
        let setting = (&physics, &protocol);
        let recorded = |stop: &AtomicBool| record_unless("", &body(), setting, true, &images, stop);
        let recording = recorded(&NEVER).unwrap();
        let walked = fresh_rollout(&system(), &protocol, &image(1.0, 0.0), &NEVER).unwrap();
        assert_eq!(
            recording
                .phases
                .iter()
                .map(|phase| phase.displacement)
                .collect::<Vec<_>>(),
            [walked; 2]
        );
        assert_eq!(recorded(&AtomicBool::new(true)).map(drop), Err(Stopped));
    }

    #[test]
    fn recordings_that_would_fill_the_memory_are_refused_with_the_longest_possible() {
        let steps = |control_steps| Protocol {
            control_steps,
            ..protocol()
        };
        let checked = |most, images| check_length([4, 9], &steps(most), images);
        assert_eq!(checked(50_000, 20), Ok(()));
        let error = checked(50_001, 20).unwrap_err().to_string();
        assert!(
            error.contains("at most 50000") && error.contains("20 images"),
            "{error}"
        );
    }

    #[test]
    fn a_rollout_that_is_stopped_has_no_displacement() {
        let (system, protocol) = (system(), protocol());
        let stop = AtomicBool::new(true);
        let image = image(1.0, 0.0);
        assert_eq!(
            fresh_rollout(&system, &protocol, &image, &stop),
            Err(Stopped.into())
        );
        assert_eq!(
            walk(&system, &protocol, &[image], false, &stop),
            Err(Stopped.into())
        );
    }

    fn recorded(fresh: bool, physics: &Physics) -> Recording {
        let seen = |class, label: &str, stimulus| LabelledStimulus {
            class,
            label: label.to_string(),
            stimulus,
            image: None,
        };
        let images = [
            seen(0, "dark", image(0.0, 0.0)),
            seen(1, "bright", image(1.0, 0.0)),
        ];
        record("r", &body(), physics, &protocol(), fresh, &images)
    }

    #[test]
    fn a_continuous_rollout_is_recorded_as_one_with_a_frame_per_control_step() {
        let physics = Physics::default();
        let recording = recorded(false, &physics);
        let steps = STEPS as usize;
        assert_eq!(recording.frames.len(), 1 + 2 * steps);
        let begin: Vec<usize> = recording
            .phases
            .iter()
            .map(|phase| phase.first_frame)
            .collect();
        assert_eq!((begin, recording.unstable), (vec![0, steps], false));
        assert_eq!(recording.phases[1].seen.label, "bright");
        assert_eq!((recording.voxels.len(), recording.cycle), (9, 50));
        for (phase, end) in recording.phases.iter().zip([steps, 2 * steps]) {
            let way =
                recording.frames[end].centre[0] - recording.frames[phase.first_frame].centre[0];
            assert!(
                (phase.displacement - way).abs() < 1e-9,
                "{} {way}",
                phase.displacement
            );
        }
        // y starts at the ground, under the robot; x at its left edge; a voxel is 1.
        let points = &recording.frames[0].points;
        let least = |axis: usize| points.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
        assert!(
            least(0).abs() < 1e-9 && least(1).abs() < 1e-9,
            "{} {}",
            least(0),
            least(1)
        );
        let [top_left, _, bottom_right, _] = recording.voxels[0].corners;
        let side = points[bottom_right][0] - points[top_left][0];
        assert!((side - 1.0).abs() < 1e-9 && points[top_left][1] > points[bottom_right][1]);
    }

    #[test]
    fn a_fresh_rollout_jumps_back_to_the_start_for_every_image() {
        let physics = Physics::default();
        let (fresh, continuous) = (recorded(true, &physics), recorded(false, &physics));
        let steps = STEPS as usize;
        assert_eq!(fresh.frames.len(), 2 * (1 + steps));
        assert_eq!(fresh.phases[1].first_frame, 1 + steps);
        assert_eq!(fresh.frames[1 + steps], fresh.frames[0]);
        assert_eq!(fresh.frames[..1 + steps], continuous.frames[..1 + steps]);
        let alone = fresh_rollout(&system(), &protocol(), &image(1.0, 0.0), &NEVER);
        assert_eq!(alone, Ok(fresh.phases[1].displacement));
    }

    #[test]
    fn a_walk_is_what_the_protocol_says() {
        let (physics, system) = (Physics::default(), system());
        let images = [image(0.0, 0.0), image(1.0, 0.0)];
        for rollout in [RolloutMode::Fresh, RolloutMode::Sequential] {
            let protocol = Protocol {
                rollout,
                ..protocol()
            };
            let walk = |measured| walk(&system, &protocol, &images, measured, &NEVER);
            let [(plain, nothing), (measured, energy)] = [false, true].map(|m| walk(m).unwrap());
            let recorded = recorded(rollout == RolloutMode::Fresh, &physics).phases;
            assert_eq!(
                plain,
                recorded
                    .iter()
                    .map(|phase| phase.displacement)
                    .collect::<Vec<_>>()
            );
            assert_eq!((plain, nothing), (measured, Energy::default()));
            assert!(energy.drive > 0.0, "{energy:?}");
        }
    }

    #[test]
    fn an_unstable_rollout_is_recorded_up_to_its_end() {
        let physics = Physics {
            blow_up_extent: 0.12,
            ..Physics::default()
        };
        let recording = recorded(true, &physics);
        assert!(recording.unstable && recording.phases.len() == 1);
        assert!(
            (1..=STEPS as usize).contains(&recording.frames.len()),
            "{}",
            recording.frames.len()
        );
        assert!(recording.phases[0].displacement.is_finite());
    }
}
