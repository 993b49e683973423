//! [`Predictor`]: the accuracy that training a gait would reach, from its response alone.

use crate::base::Grid;
use crate::base::error::Error;
use crate::base::session::Session;
use crate::config::Config;
use crate::data::dataset::{Dataset, DatasetError, Split};
use crate::images::training::scarcest;
use crate::images::whereabouts::stimulus_for;
use crate::response::design_problem::Example;
use crate::response::estimate::teachable;
use crate::response::gait::Gait;
use crate::response::regression::{RandomRollout, Response};
use crate::store::images::ImageRef;
use crate::store::response::TrainingEstimate;
use crate::task::answer;
use crate::task::grouping::{Groups, balanced};
use crate::task::stimulus::StimulusParams;
use crate::training::window::Windows;

/// Most training images per class of a task. More cost time, and hardly narrow the interval of the
/// estimated accuracy.
const IMAGES_PER_CLASS: usize = 1000;

/// Fewest images per class of a task: half pose the design problems, half test the answers.
const LEAST_PER_CLASS: usize = 4;

/// A task that gaits could be trained for, with training images.
pub(crate) struct Predictor {
    pub(crate) groups: Groups,
    pub(crate) config: Config,
    pub(crate) dataset: Dataset,
    /// Training images, equally many per class, class by class.
    images: Vec<ImageRef>,
}

impl Predictor {
    /// Draws images of a task by a seed.
    ///
    /// # Errors
    /// Returns an error if a class has too few images, or if a body of this size cannot see them.
    pub(crate) fn new(
        config: Config,
        dataset: Dataset,
        groups: &Groups,
        seed: u64,
    ) -> Result<Self, Error> {
        let classes = groups.classes().concat();
        let per_class = IMAGES_PER_CLASS.min(scarcest(&dataset, &classes, LEAST_PER_CLASS)?);
        let drawn = dataset
            .draw(Split::Train, &classes, per_class, seed)
            .map_err(|error: DatasetError| Error::input(error.to_string()))?;
        let labels = classes
            .iter()
            .flat_map(|class| std::iter::repeat_n(*class, per_class));
        let images = labels
            .zip(drawn)
            .map(|(label, index)| ImageRef { index, label })
            .collect();
        let task = Predictor {
            groups: groups.clone(),
            config,
            dataset,
            images,
        };
        // Images that cannot be seen must be refused before anything is measured.
        task.images.first().map_or(Ok(()), |image| {
            task.seen(&task.config.stimulus, image).map(drop)
        })?;
        Ok(task)
    }

    fn seen(&self, stimulus: &StimulusParams, image: &ImageRef) -> Result<Grid<f64>, Error> {
        stimulus_for(
            &self.config.body,
            stimulus,
            &self.dataset,
            Split::Train,
            image.index,
        )
    }

    /// Estimates the accuracy that training a gait could reach, under the best window; `None` if
    /// it has too few rollouts.
    pub(crate) fn taught(
        &self,
        gait: &Gait,
        response: &Response,
        shown: &[RandomRollout],
        session: &Session,
    ) -> Result<Option<TrainingEstimate>, Error> {
        let config = &self.config;
        let (mut stimulus, mut margin) = (config.stimulus, None);
        if config.train.windows > 0 {
            let windows = Windows::of(config, &self.dataset, &self.images, self.groups.classes())?;
            let found = windows.best(gait, response, session, &|_| ())?;
            stimulus.margin = found.margins;
            margin = Some(found.margins);
        }
        let [first, _] = self.groups.classes();
        let ways = balanced(self.images.iter().map(|image| image.label), first);
        let example = |(image, (right, weight)): (&ImageRef, (f64, f64))| {
            let seen = self.seen(&stimulus, image)?;
            Ok(Example {
                right,
                weight,
                ..Example::new(gait, &seen, &config.physics)
            })
        };
        let examples = self
            .images
            .iter()
            .zip(ways)
            .map(example)
            .collect::<Result<Vec<Example>, Error>>()?;
        let found = teachable(
            shown,
            response.scatter,
            &examples,
            answer::THRESHOLD,
            config.seed,
            session,
        )?;
        Ok(found.map(|teachable| TrainingEstimate {
            margin,
            ..teachable.into()
        }))
    }
}
