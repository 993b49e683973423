//! What a robot must reach to be let into the archive, and what it reached.

use super::Run;
use crate::qd::Evaluated;
use crate::run::archive::Robot;
use crate::run::keep::Floors;
use crate::run::response::is_left_behind;
use crate::task::evaluation::{Job, MayWin};
use crate::task::race::Race;
use std::iter::repeat;

impl Run<'_> {
    /// Coordinates of the cell of a robot that performs a task.
    fn cell(&self, mut bins: Vec<usize>, task: usize) -> Vec<usize> {
        bins.extend((self.grouping.tasks().len() > 1).then_some(task));
        bins
    }

    /// How a robot is to be evaluated; `parent` is the cell of its parent.
    pub(super) fn job<'b>(&'b self, parent: Option<usize>, robot: &'b Robot, floors: &'b Floors) -> Job<'b> {
        let (archive, training, grouping) = (self.search.archive(), &self.training, &self.grouping);
        let answers = parent
            .and_then(|cell| archive.get(cell))
            .map(|elite| training.answers(elite.solution.displacements.iter().copied().map(Some)));
        let bins = robot.bins();
        let config = &self.options.config;
        let measures_response = config.measures_response(self.period);
        let places = config.worth_of_places(&robot.body, self.period);
        let to_beat: Vec<Option<f64>> = (0..grouping.tasks().len())
            .map(|task| {
                let cell = self.space.index(&self.cell(bins.clone(), task));
                floors
                    .to_beat(task, cell.and_then(|cell| archive.objective(cell)))
                    .map(|least| least / places)
            })
            .collect();
        let beaten = to_beat.clone();
        let may_win = move |known: &[Option<f64>]| {
            grouping.can_still_win(&training.answers(known.iter().copied()), |task| beaten[task])
        };
        // Who has no parent races against one who stands still, whose answers are worth nothing: it is told by its own.
        let rival = || answers.clone().unwrap_or_else(|| training.answers(repeat(Some(0.0))));
        let race = self.options.config.race(self.period).then(|| Race::against(grouping, &rival())).flatten();
        // Who races is not shown first what its parent did worst, else it would begin with what that did badly by chance.
        let order = match &race {
            Some(race) => race.order().to_vec(),
            // The first pairs decide whether the others are worth it.
            None if measures_response => Vec::new(),
            None => answers.map_or_else(Vec::new, |answers| grouping.hardest_first(&answers)),
        };
        let given_up = if measures_response {
            let least = to_beat.into_iter().flatten().fold(f64::INFINITY, f64::min);
            Some(Box::new(move |known: &[Option<f64>]| least.is_finite() && is_left_behind(known, least))
                as Box<MayWin>)
        } else {
            race.map(|race| {
                Box::new(move |known: &[Option<f64>]| race.is_left_behind(known, |task| to_beat[task]))
                    as Box<MayWin>
            })
        };
        Job { body: &robot.body, order, may_win: Box::new(may_win), given_up }
    }

    /// A robot as it is told to the archive; nothing if a stage that keeps only the fittest does not let it in.
    pub(super) fn scored(
        &self,
        child: u64,
        robot: Robot,
        displacements: Vec<f64>,
        floors: &Floors,
    ) -> Option<Evaluated<Robot>> {
        let answers = self.training.answers(displacements.iter().copied().map(Some));
        let score = self.grouping.score(&answers);
        let coordinates = self.cell(robot.bins(), score.task);
        let cell = self.space.index(&coordinates).expect("the coordinates are bins of this very space");
        let task = self.grouping.tasks()[score.task].name();
        let places = self.options.config.worth_of_places(&robot.body, self.period);
        let objective = places * score.fitness;
        let solution = Robot { cell: coordinates, task, objective, displacements, ..robot };
        let is_in = floors.to_beat(score.task, None).is_none_or(|floor| objective > floor);
        is_in.then_some(Evaluated { child, cell, objective, solution })
    }
}
