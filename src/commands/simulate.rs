//! `morphcog simulate`: simulates any body under any stimuli and targets, on any terrain.

mod targets;

use crate::base::Grid;
use crate::base::error::{Error, ErrorKind};
use crate::base::files::{read_given, read_limited, write_whole};
use crate::base::session::Session;
use crate::base::stop::NEVER;
use crate::body::{Body, Material};
use crate::commands::replay::Replay;
use crate::config::reading;
use crate::sim::{Physics, Start, StepError, System, World};
use crate::store::folder;
use crate::task::class_names::ClassNames;
use crate::task::protocol::{MAX_COLUMN, MAX_ROW, MAX_STEPS};
use crate::task::recording::{LabelledStimulus, Phase, Recording};
use crate::task::rollout::{MOST_PLACES, frame, place_in, voxels};
use crate::task::terrain::{self, FixedObject, at_most_a_thousand};
use schemars::JsonSchema;
use serde::de::{Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use targets::{Targets, TargetsForm};

/// A body, its stimuli and targets, its ground, and the length of the simulation.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// The body as rows of 0…8; 7 and 8 are EvoGym's horizontal and vertical actuator.
    pub(crate) body: Body,
    /// One stimulus for the whole simulation: a pixel per voxel, 0 to 1. Default dark.
    #[schemars(with = "Option<Vec<Vec<f64>>>")]
    stimulus: Option<Grid<f64>>,
    /// Several stimuli, each for `switch_every` control steps; after the last, the first follows.
    #[serde(default, deserialize_with = "bounded")]
    #[schemars(with = "Option<Vec<Vec<Vec<f64>>>>")]
    stimuli: Option<Vec<Grid<f64>>>,
    /// Number of control steps of each stimulus.
    switch_every: Option<u64>,
    /// True if the robot returns to its initial state at every switch.
    #[serde(default)]
    reset_between: bool,
    /// The length of each actuator at every control step, row-major; without targets, they rest.
    #[schemars(with = "Option<TargetsForm>")]
    targets: Option<Targets>,
    /// Objects of fixed cells on which the body starts, instead of the flat ground. They do not
    /// overlap; each is one piece.
    #[serde(default, deserialize_with = "some_objects")]
    #[schemars(with = "Option<Vec<FixedObject>>")]
    terrain: Option<Vec<FixedObject>>,
    /// Grid column of the body's left edge; 493 if it is not given, needed with terrain.
    start_column: Option<i64>,
    /// Grid row of its bottom row: 2 is on the flat ground; needed with terrain, whose rows count
    /// from 0.
    start_row: Option<u32>,
    /// Number of control steps, at most 1,000,000. Default: `stimuli` or listed `targets` each once,
    /// else 500.
    control_steps: Option<u64>,
    /// Constants of the simulator that differ from the defaults.
    #[serde(default)]
    physics: Physics,
}

/// Most memory for stimuli \[bytes\].
const MOST_STIMULI: usize = 128 << 20;

/// Reads stimuli of at most [`MOST_STIMULI`] bytes.
fn bounded<'de, D: Deserializer<'de>>(reader: D) -> Result<Option<Vec<Grid<f64>>>, D::Error> {
    struct Stimuli;
    impl<'de> Visitor<'de> for Stimuli {
        type Value = Vec<Grid<f64>>;
        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("a list of stimuli")
        }
        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
            let (mut stimuli, mut bytes) = (Vec::new(), 0);
            while let Some(stimulus) = list.next_element::<Grid<f64>>()? {
                // Pixels and their allocation, and an entry in the list, which doubles as it grows.
                bytes += stimulus.area() * size_of::<f64>() + 16 + 2 * size_of::<Grid<f64>>();
                if bytes > MOST_STIMULI {
                    let (count, pixels) = (stimuli.len(), stimulus.area());
                    let (most, each) = (
                        MOST_STIMULI >> 20,
                        if pixels == 1 { "pixel" } else { "pixels" },
                    );
                    return Err(A::Error::custom(format!(
                        "expected stimuli that need at most {most} MB of memory: {count} of {pixels} {each} do"
                    )));
                }
                stimuli.push(stimulus);
            }
            Ok(stimuli)
        }
    }
    struct Perhaps;
    impl<'de> Visitor<'de> for Perhaps {
        type Value = Option<Vec<Grid<f64>>>;
        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("a list of stimuli")
        }
        fn visit_none<E>(self) -> Result<Self::Value, E> {
            Ok(None)
        }
        fn visit_unit<E>(self) -> Result<Self::Value, E> {
            Ok(None)
        }
        fn visit_some<D: Deserializer<'de>>(self, reader: D) -> Result<Self::Value, D::Error> {
            reader.deserialize_seq(Stimuli).map(Some)
        }
    }
    reader.deserialize_option(Perhaps)
}

fn some_objects<'de, D: Deserializer<'de>>(
    reader: D,
) -> Result<Option<Vec<FixedObject>>, D::Error> {
    at_most_a_thousand(reader).map(Some)
}

/// The paper's start column.
const COLUMN: i64 = 493;

/// Default number of control steps: ten actuation cycles.
const CONTROL_STEPS: u64 = 500;

impl Scenario {
    /// Reads a scenario, from standard input if the path is `-`.
    ///
    /// # Errors
    /// Returns an error with line and key if the file is wrong.
    pub fn read(path: &Path) -> Result<Self, Error> {
        if path == Path::new("-") {
            let text = read_limited(std::io::stdin());
            let text = text.map_err(|error| Error::reading(Path::new("standard input"), &error))?;
            return Scenario::parse(&text, "standard input");
        }
        let text = read_given(path).map_err(|error| Error::reading(path, &error))?;
        Scenario::parse(&text, &path.display().to_string())
    }

    /// Parses a scenario; errors mention `name`.
    pub(crate) fn parse(text: &str, name: &str) -> Result<Self, Error> {
        let scenario: Scenario = reading::read_json(text, name)?;
        scenario.validate().map_err(|error| error.in_place(name))?;
        Ok(scenario)
    }

    fn validate(&self) -> Result<(), Error> {
        let refuse = |text: String| Err(Error::input(text));
        self.physics
            .validate()
            .map_err(|error| Error::input(format!("physics.{error}")))?;
        if self.body.counts().total == 0 {
            return refuse("body: expected at least one voxel that is not empty".to_string());
        }
        match (&self.stimulus, &self.stimuli, self.switch_every) {
            (Some(_), Some(_), _) => {
                return refuse(
                    "stimuli: expected either stimulus or stimuli, not both".to_string(),
                );
            }
            (_, Some(stimuli), _) if stimuli.is_empty() => {
                return refuse("stimuli: expected at least one stimulus".to_string());
            }
            (_, Some(_), None | Some(0)) => {
                return refuse(
                    "switch_every: expected 1 or more control steps with stimuli".to_string(),
                );
            }
            (_, None, Some(_)) => {
                return refuse("switch_every: expected only with stimuli".to_string());
            }
            (_, None, _) if self.reset_between => {
                return refuse("reset_between: expected only with stimuli".to_string());
            }
            _ => {}
        }
        for (index, stimulus) in self.stimuli().iter().enumerate() {
            let key = if self.stimuli.is_some() {
                format!("stimuli[{index}]")
            } else {
                "stimulus".to_string()
            };
            let (height, width) = (self.body.height(), self.body.width());
            if (stimulus.height(), stimulus.width()) != (height, width) {
                let (rows, columns) = (stimulus.height(), stimulus.width());
                return refuse(format!(
                    "{key}: {rows} × {columns} pixels, expected {height} × {width} as the body"
                ));
            }
            if let Some(((row, column), pixel)) = stimulus
                .iter()
                .find(|(_, pixel)| !(0.0..=1.0).contains(*pixel))
            {
                return refuse(format!(
                    "{key}: row {row}, column {column}: {pixel}, expected 0 to 1"
                ));
            }
        }
        if let Some(targets) = &self.targets {
            targets
                .validate(self.actuators().count())
                .map_err(Error::input)?;
        }
        let is_flat = self.terrain.is_none();
        if !is_flat {
            for (key, is_missing) in [
                ("start_column", self.start_column.is_none()),
                ("start_row", self.start_row.is_none()),
            ] {
                if is_missing {
                    return refuse(format!("{key}: expected with terrain"));
                }
            }
        }
        let ground = if is_flat { self.physics.ground_row } else { 0 };
        if let Some(row) = self
            .start_row
            .filter(|row| !(ground..=MAX_ROW).contains(row))
        {
            let on_ground = if is_flat { " (on the ground)" } else { "" };
            return refuse(format!(
                "start_row: {row}, expected {ground}{on_ground} to {MAX_ROW}"
            ));
        }
        if self.control_steps() > u64::from(MAX_STEPS) {
            let key = if self.control_steps.is_some() {
                "control_steps"
            } else {
                "switch_every"
            };
            let steps = self.control_steps();
            return refuse(format!(
                "{key}: {steps} control steps in all, expected at most {MAX_STEPS}"
            ));
        }
        if !(-MAX_COLUMN..=MAX_COLUMN).contains(&self.start().column) {
            return refuse(format!(
                "start_column: expected −{MAX_COLUMN} to {MAX_COLUMN}"
            ));
        }
        // Refuses a wrong terrain, and a body without room on it.
        if !is_flat {
            self.world()?;
        }
        Ok(())
    }

    /// Makes the robot at rest at its start.
    fn world(&self) -> Result<World, Error> {
        let system = System::new(&self.body, self.physics.clone());
        match &self.terrain {
            None => Ok(World::new(system, self.start())),
            Some(objects) => {
                let terrain = terrain::built(objects, self.physics.cell_size)?;
                terrain::placed(system, self.start(), terrain)
            }
        }
    }

    /// Returns the row and column of each actuator, row-major.
    fn actuators(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let voxels = self.body.voxels().iter();
        voxels
            .filter(|(_, material): &(_, &Material)| material.is_actuator())
            .map(|(place, _)| place)
    }

    /// Returns the stimuli in turn, none if all is dark.
    pub(crate) fn stimuli(&self) -> &[Grid<f64>] {
        self.stimuli.as_deref().unwrap_or(self.stimulus.as_slice())
    }

    pub(crate) fn start(&self) -> Start {
        Start {
            column: self.start_column.unwrap_or(COLUMN),
            row: self.start_row.unwrap_or(self.physics.ground_row),
        }
    }

    pub(crate) fn physics(&self) -> &Physics {
        &self.physics
    }

    pub(crate) fn control_steps(&self) -> u64 {
        let shown = self
            .switch_every
            .map(|every| every.saturating_mul(self.stimuli().len() as u64));
        let listed = self.targets.as_ref().and_then(Targets::listed);
        let given = self.control_steps.or(shown).or(listed);
        given.unwrap_or(CONTROL_STEPS)
    }

    /// Refuses what only the simulator has: other ground than the flat one, and targets.
    pub(crate) fn check_plain(&self) -> Result<(), String> {
        let key = match (&self.terrain, &self.targets) {
            (Some(_), _) => "terrain",
            (None, Some(_)) => "targets",
            (None, None) if self.actuators().next().is_some() => "body: actuators",
            (None, None) => return Ok(()),
        };
        Err(format!(
            "scenario: {key}: the page has the flat ground and stimuli only; morphcog simulate takes others"
        ))
    }
}

/// A scenario under way.
struct Simulation<'a> {
    scenario: &'a Scenario,
    world: World,
    step: u64,
    dark: Grid<f64>,
    targets: Vec<f64>,
}

impl<'a> Simulation<'a> {
    fn new(scenario: &'a Scenario) -> Result<Self, Error> {
        Ok(Simulation {
            world: scenario.world()?,
            step: 0,
            dark: Grid::filled(scenario.body.height(), scenario.body.width(), 0.0),
            targets: vec![1.0; scenario.actuators().count()],
            scenario,
        })
    }

    /// Returns the number of a stimulus in the next or the present control step.
    fn stimulus(&self, step: u64) -> Option<usize> {
        let every = self.scenario.switch_every.unwrap_or(u64::MAX);
        let count = self.scenario.stimuli().len() as u64;
        Some(((step / every).checked_rem(count))? as usize)
    }

    /// Returns the stimulus of the control step before; dark at the start.
    fn shown(&self) -> &Grid<f64> {
        let before = self.step.checked_sub(1);
        let number = before.and_then(|step| self.stimulus(step));
        number.map_or(&self.dark, |number| &self.scenario.stimuli()[number])
    }

    /// Returns true if a stimulus begins with the next control step.
    fn switches(&self) -> bool {
        let every = self.scenario.switch_every.unwrap_or(u64::MAX);
        self.step.is_multiple_of(every) && !self.scenario.stimuli().is_empty()
    }

    /// Simulates the next control step, under its stimulus or targets.
    fn step(&mut self, stop: &AtomicBool) -> Result<(), Error> {
        if self.switches()
            && let Some(number) = self.stimulus(self.step)
        {
            self.world.set_stimulus(&self.scenario.stimuli()[number]);
            if self.scenario.reset_between {
                self.world.reset();
            }
        }
        if let Some(targets) = &self.scenario.targets {
            targets.at(self.step, &mut self.targets);
            let set = self.world.set_targets(&self.targets);
            set.map_err(|error| Error::input(format!("targets: {error}")))?;
        }
        StepError::outcome(self.world.step_unless(stop))?.map_err(|unstable| {
            // Resets restart the simulation's own clock; errors count the scenario's steps.
            let unstable = crate::sim::Unstable {
                control_step: self.step,
                ..unstable
            };
            Error::unstable(unstable.to_string())
        })?;
        self.step += 1;
        Ok(())
    }
}

/// Simulates the scenario and passes the CSV to `line`, line by line: `step,com_x,com_y`, then the
/// centre of mass before the first and after every control step. `points` adds every point
/// (`x_0,y_0`, …, in EvoGym's order), pixel (`pixel_ROW_COLUMN`) and actuator's target
/// (`target_ROW_COLUMN`) of that step. Positions are in voxel lengths: x from the body's left edge at the start, y from
/// the ground; on terrain x from column 0, y from row 0.
///
/// # Errors
/// Returns [`crate::base::error::ErrorKind::Unstable`] if it ends early, or the error of `line`.
pub fn simulate(
    scenario: &Scenario,
    points: bool,
    mut line: impl FnMut(String) -> Result<(), Error>,
) -> Result<(), Error> {
    let mut simulation = Simulation::new(scenario)?;
    let mut header = "step,com_x,com_y".to_string();
    if points {
        (0..simulation.world.points().count())
            .for_each(|number| header += &format!(",x_{number},y_{number}"));
        let pixels = simulation.dark.iter().map(|(place, _)| ("pixel", place));
        let targets = scenario.actuators().map(|place| ("target", place));
        pixels
            .chain(targets)
            .for_each(|(what, (row, column))| header += &format!(",{what}_{row}_{column}"));
    }
    line(header + "\n")?;
    let mut row = |simulation: &Simulation| {
        let lengths = |at: [f64; 2]| place_in(&simulation.world, at).map(digits17);
        let [x, y] = lengths(simulation.world.centre_of_mass());
        let mut text = format!("{},{x},{y}", simulation.step);
        if points {
            let all = simulation.world.points().map(lengths);
            all.for_each(|[x, y]| text += &format!(",{x},{y}"));
            let inputs = simulation.shown().cells().iter().chain(&simulation.targets);
            inputs.for_each(|input| text += &format!(",{input}"));
        }
        line(text + "\n")
    };
    row(&simulation)?;
    for _ in 0..scenario.control_steps() {
        simulation.step(&NEVER)?;
        row(&simulation)?;
    }
    Ok(())
}

/// Records the simulation for pictures, with a phase for each stimulus, under a name. An unstable
/// simulation is recorded up to its end, and its error returned as well.
///
/// # Errors
/// Returns an error if there would be too many frames, or `stop` was set.
pub(crate) fn record(
    scenario: &Scenario,
    name: &str,
    stop: &AtomicBool,
) -> Result<(Replay, Result<(), Error>), Error> {
    let mut simulation = Simulation::new(scenario)?;
    let (steps, points) = (
        scenario.control_steps(),
        simulation.world.points().count() as u64,
    );
    let most = MOST_PLACES as u64 / points.max(1);
    if steps > most {
        return Err(Error::input(format!(
            "control_steps: {steps} in all, expected at most {most} for pictures"
        )));
    }
    let start = frame(&simulation.world);
    let mut recording = Recording {
        robot: name.to_string(),
        body: scenario.body.clone(),
        terrain: simulation.world.terrain().cloned(),
        voxels: voxels(&simulation.world),
        phases: Vec::new(),
        frames: vec![start.clone()],
        every: 1,
        cycle: scenario.physics.cycle_steps as usize,
        unstable: false,
        judge: None,
        names: ClassNames::default(),
    };
    let mut outcome = Ok(());
    for step in 0..steps.max(1) {
        if step == 0 || simulation.switches() {
            if step > 0 && scenario.reset_between {
                recording.frames.push(start.clone());
            }
            recording
                .phases
                .push(phase(&simulation, recording.frames.len() - 1));
        }
        if step == steps {
            break;
        }
        outcome = simulation.step(stop);
        match &outcome {
            Ok(()) => recording.frames.push(frame(&simulation.world)),
            Err(error) if error.kind == ErrorKind::Unstable => {
                recording.unstable = true;
                break;
            }
            Err(error) => return Err(error.clone()),
        }
    }
    let ends: Vec<usize> = {
        let next = recording.phases.iter().skip(1).map(|phase| {
            let first = phase.first_frame;
            first - usize::from(scenario.reset_between)
        });
        next.chain([recording.frames.len() - 1]).collect()
    };
    for (phase, end) in recording.phases.iter_mut().zip(ends) {
        let x = |frame: usize| recording.frames[frame].centre[0];
        phase.displacement = x(end) - x(phase.first_frame);
    }
    let about = vec![
        ("Scenario".to_string(), name.to_string()),
        ("Control steps".to_string(), steps.to_string()),
    ];
    let replay = Replay {
        recording,
        about,
        name: name.to_string(),
    };
    Ok((replay, outcome))
}

/// Begins a phase with the next control step.
fn phase(simulation: &Simulation, first_frame: usize) -> Phase {
    let number = simulation.stimulus(simulation.step);
    let stimuli = simulation.scenario.stimuli();
    let label = match number {
        None if simulation.scenario.targets.is_some() => "targets".to_string(),
        None => "no stimulus".to_string(),
        Some(_) if stimuli.len() == 1 => "stimulus".to_string(),
        Some(number) => format!("stimulus {number}"),
    };
    Phase {
        first_frame,
        seen: LabelledStimulus {
            class: 0,
            label,
            stimulus: number
                .map_or(&simulation.dark, |number| &stimuli[number])
                .clone(),
            image: None,
        },
        displacement: 0.0,
    }
}

/// Writes the CSV of a scenario to a file, which must not be the scenario's; that of an unstable
/// simulation goes up to its end. A stopped session leaves the file unchanged.
pub(crate) fn to_file(
    from: &Path,
    points: bool,
    path: &Path,
    session: &Session,
) -> Result<(), Error> {
    let scenario = &Scenario::read(from)?;
    if path.exists() && path.canonicalize().ok() == from.canonicalize().ok() {
        let text = "expected another name: this would overwrite the scenario";
        return Err(Error::argument("out", path.display(), text));
    }
    folder::writable(path)?;
    // Line by line, since a long simulation with all points has gigabytes.
    let mut outcome = Ok(());
    let written = write_whole(path, |file| {
        let (mut file, mut failed) = (BufWriter::new(file), None);
        outcome = simulate(scenario, points, |line| {
            if let Err(stopped) = session.check() {
                failed = Some(io::Error::new(io::ErrorKind::Interrupted, stopped));
                return Err(stopped.into());
            }
            file.write_all(line.as_bytes()).map_err(|error| {
                let said = Error::writing(path, &error);
                failed = Some(error);
                said
            })
        });
        failed.map_or_else(|| file.flush(), Err)
    });
    if matches!(&outcome, Err(error) if error.kind == ErrorKind::Stopped) {
        return Err(Error::stopped(format!(
            "stopped; {} is not written",
            path.display()
        )));
    }
    written.map_err(|error| Error::writing(path, &error))?;
    outcome
}

/// Formats a number with 17 significant digits, which identify every f64.
pub(crate) fn digits17(value: f64) -> String {
    // Makes -0 into 0.
    let value = value + 0.0;
    let before = if value == 0.0 {
        0.0
    } else {
        libm::log10(value.abs()).floor()
    };
    let decimals = (16.0 - before).clamp(0.0, 40.0) as usize;
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seventeen_digits_name_every_number() {
        for value in [
            19.9605633802817,
            1.0 / 3.0,
            1e-9,
            -123456.789,
            0.1 + 0.2,
            0.0,
            1e20,
            9.99999999999999999,
        ] {
            assert_eq!(
                digits17(value).parse::<f64>().unwrap(),
                value,
                "{}",
                digits17(value)
            );
        }
        assert_eq!(digits17(0.5), "0.50000000000000000");
    }

    fn refused(text: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scenario.json");
        std::fs::write(&path, text).unwrap();
        Scenario::read(&path).unwrap_err().message
    }

    #[test]
    fn what_is_wrong_with_a_scenario_is_said_with_its_key() {
        assert!(refused("{}").contains("missing field `body`"));
        assert!(refused("{\"body\": [[3, 9]]}").contains("body"));
        assert!(refused("{\"body\": [[0, 0]]}").contains("not empty"));
        assert!(refused("{\"body\": [[3]],\n\"control_step\": 5}").contains(":2: "));
        assert!(refused("{\"body\": [[3]], \"stimulus\": [[0.5, 1]]}").contains("1 × 2 pixels"));
        assert!(refused("{\"body\": [[3]], \"stimulus\": [[1.5]]}").contains("expected 0 to 1"));
        assert!(refused("{\"body\": [[3]], \"stimuli\": [[[1]]]}").contains("switch_every"));
        assert!(refused("{\"body\": [[3]], \"start_row\": 1}").contains("start_row"));
        assert!(refused("{\"body\": [[3]], \"stimuli\": 7}").contains("a list"));
        let null =
            Scenario::parse("{\"body\": [[3]], \"stimuli\": null}", "scenario.json").unwrap();
        assert!(null.stimuli().is_empty());
    }

    #[test]
    fn stimuli_are_bounded_by_the_memory_that_they_need() {
        // Forty million of them, a file of 240 MB, took 3.7 GB. This endless file must be refused
        // while it is read.
        let many = 2_000_000;
        let text = format!(
            "{{\"body\": [[3]], \"switch_every\": 1, \"stimuli\": [{}",
            "[[1]],".repeat(many)
        );
        let error = Scenario::parse(&text, "scenario.json").unwrap_err().message;
        assert!(
            error.starts_with("scenario.json:1: stimuli") && error.contains("128 MB"),
            "{error}"
        );
        let some = format!(
            "{{\"body\": [[3]], \"switch_every\": 1, \"stimuli\": [{}[[1]]]}}",
            "[[1]],".repeat(99_999)
        );
        assert_eq!(
            Scenario::parse(&some, "scenario.json")
                .unwrap()
                .control_steps(),
            100_000
        );
    }

    #[test]
    fn a_scenario_that_would_not_end_is_refused_with_its_key() {
        let refused = |keys: &str| refused(&format!("{{\"body\": [[3]], {keys}}}"));
        let blown =
            "\"physics\": {\"blow_up_extent\": 1e10, \"time_step\": 0.5}, \"control_steps\": 2";
        assert!(
            refused(blown)
                .contains("physics.blow_up_extent = 10000000000: expected at most 1000 times cell")
        );
        let substeps = refused("\"physics\": {\"substeps\": 4000000000}");
        assert!(
            substeps
                .contains("physics.substeps = 4000000000: expected a whole number from 1 to 1000")
        );
        assert!(refused("\"control_steps\": 1000001").contains("control_steps: 1000001"));
        let shown = refused("\"stimuli\": [[[1]], [[0]]], \"switch_every\": 600000");
        assert!(
            shown.contains("switch_every: 1200000 control steps in all, expected at most 1000000")
        );
        assert!(refused("\"start_row\": 4000000000").contains("start_row: 4000000000, expected 2"));
    }
}
