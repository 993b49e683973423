//! Checks of `[[stage]]` that types cannot make.

use super::curriculum::Period;
use super::{Config, Error};
use crate::genome::params::{MAX_CANDIDATES, MAX_RELATIVES};
use crate::task::protocol::Life;

/// Most draws of images in a stage: what a run was trained on is worked out from all of them.
const MAX_DRAWS: u64 = 100_000;

impl Config {
    /// Checks the stages.
    pub(super) fn validate_stages(&self) -> Result<(), Error> {
        let refuse = |number: usize, text: String| Err(Error::input(format!("stage {}: {text}", number + 1)));
        let mut begin = 0_u64;
        for (number, stage) in self.stage.iter().enumerate() {
            let is_last = number + 1 == self.stage.len();
            match stage.generations {
                None if !is_last => {
                    let text = "expected generations: only the last stage lasts to the end";
                    return refuse(number, text.to_string());
                }
                Some(0) => return refuse(number, "generations = 0: expected 1 or more".to_string()),
                generations => begin = begin.saturating_add(generations.unwrap_or(0)),
            }
            if begin > u64::from(u32::MAX) {
                return refuse(number, format!("it ends with generation {begin}: expected less than 2³²"));
            }
            if let Some(every) = stage.redraw.filter(|&every| every > 0) {
                let lasts = match stage.generations {
                    Some(generations) if !is_last => generations,
                    _ => self.generations.saturating_sub(begin - stage.generations.unwrap_or(0)),
                };
                if lasts / every > MAX_DRAWS {
                    let least = lasts.div_ceil(MAX_DRAWS);
                    let text =
                        format!("redraw = {every}: expected {least} or more: {MAX_DRAWS} draws at most");
                    return refuse(number, text);
                }
            }
            let zeros = [
                ("images_per_class", stage.images_per_class == Some(0)),
                ("redraw", stage.redraw == Some(0)),
                ("start_with", stage.start_with == Some(0)),
                ("keep", stage.keep == Some(0)),
                ("enough", stage.enough == Some(0)),
            ];
            if let Some((key, _)) = zeros.iter().find(|(_, is_zero)| *is_zero) {
                return refuse(number, format!("{key} = 0: expected 1 or more"));
            }
            if let Some(share) = stage.voxel_mutations.filter(|share| !(0.0..=1.0).contains(share)) {
                return refuse(number, format!("voxel_mutations = {share}: expected a number from 0 to 1"));
            }
            if let Some(least) = stage.threshold_min.filter(|least| !least.is_finite()) {
                return refuse(number, format!("threshold_min = {least}: expected a finite number"));
            }
            let by_turns = [
                ("raised_starts", stage.raised_starts.is_some_and(|rows| rows > 0)),
                ("without_limits", stage.without_limits == Some(true)),
            ];
            if let Some((key, _)) = by_turns.iter().find(|(_, is_wanted)| *is_wanted)
                && self.protocol.life == Life::Sequential
            {
                let why = "expected protocol.life = \"fresh\": a sequential life is one life";
                return refuse(number, format!("{key}: {why}"));
            }
            let turns = self.turns(number);
            if let Some((images, (key, least))) = self.images_per_class_of(number).zip(turns)
                && images < least
            {
                let what =
                    if key == "raised_starts" { "so many rows are taken" } else { "limits are left away" };
                let text = format!(
                    "{key}: expected {least} images per class or more, found {images}: else no turn comes at which {what}"
                );
                return refuse(number, text);
            }
            if number == 0 && stage.start_with.is_some() && self.start.archive.is_none() {
                let text = "start_with: expected a stage before, or [start] archive: there are no elites to choose among";
                return refuse(number, text.to_string());
            }
            let pixels = self.body.height * self.body.width;
            if let Some(inverted) = stage.inverted_pixels.filter(|&inverted| inverted > pixels) {
                let text = format!("inverted_pixels = {inverted}: expected a number from 0 to {pixels}");
                return refuse(number, text);
            }
            let criterion = self.criterion_in(Period { stage: number, draw: 0 });
            if stage.enough.is_some() && !criterion.is_mean() {
                let text = "enough: expected fitness = \"mean_clipped\" or \"mean_hinge\"";
                return refuse(number, text.to_string());
            }
            if stage.race == Some(true) && !criterion.is_mean() {
                let text = "race: expected fitness = \"mean_clipped\" or \"mean_hinge\": how far an offspring is behind is told by a mean";
                return refuse(number, text.to_string());
            }
            let counts = [
                ("voxel_candidates", stage.voxel_candidates, 1, MAX_CANDIDATES),
                ("voxel_changes", stage.voxel_changes, 1, MAX_CANDIDATES),
                ("voxel_relatives", stage.voxel_relatives, 0, MAX_RELATIVES),
            ];
            for (key, count, least, most) in counts {
                if let Some(count) = count.filter(|count| !(least..=most).contains(count)) {
                    let text = format!("{key} = {count}: expected a number from {least} to {most}");
                    return refuse(number, text);
                }
            }
            if let Some(of) = stage.images_of {
                if !(1..=number).contains(&of) {
                    let text = format!("images_of = {of}: expected the number of a stage before, from 1");
                    return refuse(number, text);
                }
                let own = [
                    ("images_per_class", stage.images_per_class.is_some()),
                    ("pool", stage.pool.is_some()),
                    ("redraw", stage.redraw.is_some()),
                ];
                if let Some((key, _)) = own.iter().find(|(_, given)| *given) {
                    let text = format!("{key}: expected either images_of or {key}, not both");
                    return refuse(number, text);
                }
            }
            let drawing = [
                ("pool", stage.pool.is_some(), "how many are chosen of it"),
                ("redraw", stage.redraw.is_some(), "what is to be drawn"),
            ];
            if stage.images_per_class.is_none()
                && let Some((key, _, what)) = drawing.iter().find(|(_, given, _)| *given)
            {
                return refuse(number, format!("{key}: expected images_per_class, too: {what}"));
            }
            if let (Some(pool), Some(images)) = (stage.pool, stage.images_per_class)
                && pool < images
            {
                let text = format!("pool = {pool}: expected images_per_class, {images}, or more");
                return refuse(number, text);
            }
        }
        Ok(())
    }

    /// The number of images of each class that a stage shows; where images are named, the most that it can be.
    fn images_per_class_of(&self, number: usize) -> Option<usize> {
        let stage = &self.stage[number];
        match stage.images_of {
            Some(of) if (1..=number).contains(&of) => self.images_per_class_of(of - 1),
            Some(_) => None,
            None => Some(stage.images_per_class.unwrap_or(match &self.data.train_images {
                None => self.data.images_per_class,
                Some(named) => (named.len() + 1).saturating_sub(self.classes().len()),
            })),
        }
    }

    /// Images of a class that it takes until every raised start, and a life without limits, has had a turn; with the key that asks
    /// for the last of them. `None` if all lives are as ever.
    fn turns(&self, number: usize) -> Option<(&'static str, usize)> {
        let stage = &self.stage[number];
        let starts = stage.raised_starts.unwrap_or(0) as usize + 1;
        match stage.without_limits == Some(true) {
            true => Some(("without_limits", starts + 1)),
            false if starts > 1 => Some(("raised_starts", starts)),
            false => None,
        }
    }
}
