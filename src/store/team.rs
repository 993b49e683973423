//! `team.json` and `team.csv`: the joint answers of robots of several runs.

use crate::base::error::Error;
use crate::base::ranges;
use crate::base::table;
use crate::body::Body;
use crate::data::description::check_names;
use crate::store::images::{HeldOut, ImageRef};
use crate::store::names::FigureFormat;
use crate::store::results::{self, Stored, write_with_table};
use crate::task::answer::Direction;
use crate::task::answer::Readout;
use crate::task::class_names::ClassNames;
use crate::task::protocol::MAX_STEPS;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(crate) const FORMAT: &str = "morphcog-team";
pub(crate) const FORMAT_VERSION: u32 = 1;

/// The names of the figures beside it: the confusion matrix, and the poster of all bodies.
pub(crate) const FIGURES: [&str; 2] = ["confusion", "bodies"];

/// Returns the files of a figure beside results in `out`, one for each format.
pub(crate) fn figure(out: &Path, name: &str) -> [PathBuf; 3] {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    let file = |format: FigureFormat| format!("{stem}-{name}.{}", format.ending());
    FigureFormat::ALL.map(|format| out.with_file_name(file(format)))
}

/// The maximum number of cycles per image: the default of the longest rollout.
const MOST_CYCLES: u32 = MAX_STEPS / 50;

/// The content of `team.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TeamFile {
    /// The constant "morphcog-team".
    #[schemars(extend("const" = FORMAT))]
    pub(crate) format: String,
    /// The version of this schema.
    #[schemars(range(min = 1, max = FORMAT_VERSION))]
    pub(crate) format_version: u32,
    /// The version of morphcog that wrote the file.
    pub(crate) program_version: String,
    /// The classes to tell apart, in order.
    pub classes: Vec<u8>,
    /// The names of the dataset's classes, from class 0; a class without one is called by its
    /// number. Absent if none has a name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) class_names: Vec<String>,
    /// The name of the dataset.
    pub(crate) dataset: String,
    /// The SHA-256 of its test split.
    pub(crate) test_sha256: String,
    /// The split of the images: test, or validation.
    pub(crate) split: HeldOut,
    /// The seed of the drawn images.
    pub(crate) seed: u64,
    /// The walk up to which a robot gives no vote \[voxel lengths\].
    #[serde(deserialize_with = "ranges::size")]
    pub threshold: f64,
    /// The walk up to which distances count in sums \[voxel lengths\].
    #[serde(deserialize_with = "ranges::size")]
    pub(crate) clip: f64,
    /// The number of actuation cycles per image, each image a fresh rollout.
    pub(crate) cycles: u32,
    /// The images.
    pub images: Vec<ImageRef>,
    /// The robots evaluated so far.
    pub members: Vec<Member>,
    /// The size of the team; larger than `members` if it was stopped.
    pub size: usize,
    /// The joint answers; absent if it was stopped.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub answers: Option<Answers>,
    /// The baselines on the same images without bodies, or with one; absent if it was stopped.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baselines: Option<TeamBaselines>,
}

/// A robot of a team.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Member {
    /// The id of the robot.
    pub id: String,
    /// The name of its run.
    pub(crate) run: String,
    /// The SHA-256 of its run.json.
    pub run_sha256: String,
    /// The task of the robot.
    pub task: String,
    /// The classes of the two groups.
    pub groups: [Vec<u8>; 2],
    /// The direction of the first group on the training images: "left" or "right".
    pub first_group_walks: String,
    /// The body.
    pub(crate) body: Body,
    /// The accuracy on the images of its own classes.
    pub own: Accuracy,
    /// The share of all images under which it moved no farther than the threshold, or was unstable.
    #[serde(deserialize_with = "ranges::share")]
    pub(crate) not_moved: f64,
    /// The displacement under each image \[voxel lengths\]; null if unstable, or not shown yet.
    #[serde(deserialize_with = "ranges::number")]
    pub displacements: Vec<Option<f64>>,
    /// If the test was stopped, the places of the images that it was shown; absent: all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) shown: Vec<usize>,
}

/// A walk: `None` if it is still to be done, else its displacement \[voxel lengths\], or `None` for
/// an unstable one.
pub(crate) type Walk = Option<Option<f64>>;

/// The answers of a team, by both decoders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Answers {
    /// The answers by most votes.
    pub votes: Decoded,
    /// The answers by the largest sum of walks.
    pub walks: Decoded,
    /// The share of images for which several classes had most votes.
    #[serde(deserialize_with = "ranges::share")]
    pub(crate) ties: f64,
    /// The share of the robots that know the answered class and voted for it, averaged over images.
    #[serde(deserialize_with = "ranges::share")]
    pub(crate) agreement: f64,
    /// The mean number of robots that moved no farther than the threshold, or were unstable.
    #[serde(deserialize_with = "ranges::size")]
    pub(crate) not_moved: f64,
}

/// The answers of one decoder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Decoded {
    /// The accuracy of the answers.
    pub accuracy: Accuracy,
    /// The share answered correctly, by class.
    #[serde(deserialize_with = "ranges::share")]
    pub(crate) per_class: BTreeMap<u8, f64>,
    /// The number of images by class (rows) and answer (columns), both in the order of `classes`.
    pub confusion: Vec<Vec<usize>>,
    /// The answer to each image.
    pub answers: Vec<u8>,
}

/// Accuracies on the same images, from the pixels that the robots use together: within the smallest
/// of their margins, by the first robot's stimulus.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TeamBaselines {
    /// The number of training images for the linear classifiers and the nearest neighbour.
    pub(crate) training_images: usize,
    /// A linear function for each class against all others; the largest wins.
    pub linear_one_against_rest: Accuracy,
    /// A linear function for each pair of classes, with votes like the team's. For a pair that a
    /// robot tells apart, it uses the robot's pixels.
    pub linear_pairs: Accuracy,
    /// The class of the nearest training image.
    pub nearest_neighbour: Accuracy,
    /// The best robot of the team by itself, with votes like the team's.
    pub(crate) best_body: Accuracy,
    /// The id of that robot.
    pub(crate) best_body_id: String,
}

/// The accuracy on some images.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Accuracy {
    /// Images answered correctly.
    pub right: usize,
    /// Fraction answered correctly.
    #[serde(deserialize_with = "ranges::share")]
    pub accuracy: f64,
    /// Its 95 % Wilson interval.
    #[serde(deserialize_with = "ranges::interval")]
    pub(crate) interval: [f64; 2],
}

impl Accuracy {
    /// Checks that it covers at most this many images.
    ///
    /// # Errors
    /// If more are correct, the error names the key.
    pub(crate) fn validate(&self, images: usize) -> Result<(), Error> {
        match self.right <= images {
            true => Ok(()),
            false => Err(Error::at_key(
                "right",
                format!("expected at most {images}, found {}", self.right),
            )),
        }
    }
}

impl Stored for TeamFile {
    const FORMAT: (&'static str, u32) = (FORMAT, FORMAT_VERSION);

    fn validate(&self) -> Result<(), Error> {
        let (classes, images) = (self.classes.len(), self.images.len());
        let refuse =
            |key: &str, expected: String| Err(Error::at_key(key, format!("expected {expected}")));
        let mut different = self.classes.clone();
        different.sort_unstable();
        different.dedup();
        if classes < 2 || different != self.classes {
            return refuse("classes", "two or more, each once, in order".to_string());
        }
        check_names(&self.class_names).map_err(|text| Error::at_key("class_names", text))?;
        if let Some(image) = self
            .images
            .iter()
            .find(|image| !self.classes.contains(&image.label))
        {
            return refuse(
                "images",
                format!("labels among the classes, found {}", image.label),
            );
        }
        if !(1..=MOST_CYCLES).contains(&self.cycles) {
            return refuse("cycles", format!("1 to {MOST_CYCLES}"));
        }
        if images == 0 {
            return refuse("images", "one or more".to_string());
        }
        if self.members.len() > self.size {
            return refuse("members", format!("at most {}, as size says", self.size));
        }
        for (place, member) in self.members.iter().enumerate() {
            let of = |key: &str| format!("members[{place}].{key}");
            let mut known: Vec<u8> = member.groups.concat();
            known.sort_unstable();
            known.dedup();
            let all = member.groups.concat();
            if known.len() != all.len() || all.iter().any(|class| !self.classes.contains(class)) {
                return refuse(
                    &of("groups"),
                    "two groups of the classes, each class once".to_string(),
                );
            }
            if member.groups.iter().any(Vec::is_empty) {
                return refuse(&of("groups"), "a class in each group".to_string());
            }
            if Direction::named(&member.first_group_walks).is_none() {
                return refuse(&of("first_group_walks"), "left or right".to_string());
            }
            if member.displacements.len() != images {
                return refuse(
                    &of("displacements"),
                    format!("one for each of {images} images"),
                );
            }
            if !member.shown.is_sorted_by(|a, b| a < b)
                || member.shown.last().is_some_and(|place| *place >= images)
            {
                return refuse(&of("shown"), "places of images, in order".to_string());
            }
            if self.answers.is_some() && !member.shown.is_empty() {
                return refuse(&of("shown"), "none, since there are answers".to_string());
            }
            member
                .own
                .validate(images)
                .map_err(|error| error.in_place(&of("own")))?;
        }
        for decoded in self
            .answers
            .iter()
            .flat_map(|answers| [&answers.votes, &answers.walks])
        {
            decoded
                .accuracy
                .validate(images)
                .map_err(|error| error.in_place("accuracy"))?;
            if decoded.answers.len() != images {
                return refuse("answers", format!("one for each of {images} images"));
            }
            if decoded
                .answers
                .iter()
                .any(|answer| !self.classes.contains(answer))
            {
                return refuse("answers", "classes of the team".to_string());
            }
            if !decoded.per_class.keys().eq(&self.classes) {
                return refuse("per_class", "the classes of the team".to_string());
            }
            let rows = &decoded.confusion;
            if rows.len() != classes || rows.iter().any(|row| row.len() != classes) {
                return refuse("confusion", format!("{classes} rows of {classes} numbers"));
            }
            if rows
                .iter()
                .flatten()
                .fold(0, |sum: usize, count| sum.saturating_add(*count))
                != images
            {
                return refuse("confusion", format!("{images} images in all"));
            }
        }
        if let Some(baselines) = &self.baselines {
            let TeamBaselines {
                linear_one_against_rest,
                linear_pairs,
                nearest_neighbour,
                best_body,
                ..
            } = baselines;
            for (key, accuracy) in [
                ("linear_one_against_rest", linear_one_against_rest),
                ("linear_pairs", linear_pairs),
                ("nearest_neighbour", nearest_neighbour),
                ("best_body", best_body),
            ] {
                accuracy
                    .validate(images)
                    .map_err(|error| error.in_place(&format!("baselines.{key}")))?;
            }
        }
        Ok(())
    }
}

impl Member {
    /// Returns its walks, in the images' order.
    pub(crate) fn walks(&self) -> Vec<Walk> {
        let is_shown =
            |place: usize| self.shown.is_empty() || self.shown.binary_search(&place).is_ok();
        let walks = self.displacements.iter().enumerate();
        walks
            .map(|(place, walk)| is_shown(place).then_some(*walk))
            .collect()
    }

    /// Returns the classes that a walk of this robot to either side votes for.
    pub(crate) fn judge(&self) -> Readout {
        let [a, b] = self.groups.clone();
        if self.first_group_walks == Direction::Left.name() {
            Readout { left: a, right: b }
        } else {
            Readout { left: b, right: a }
        }
    }
}

impl TeamFile {
    pub(crate) fn names(&self) -> ClassNames {
        ClassNames::of(&self.class_names)
    }

    /// Reads a team.json.
    ///
    /// # Errors
    /// Returns an error if the file is missing or invalid.
    pub fn read(path: &Path) -> Result<Self, Error> {
        results::read(path, Some("team"))
    }

    /// Writes the file, and its table beside it.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let json =
            serde_json::to_string(self).expect("keys are text and numbers are finite") + "\n";
        let figures = FIGURES.iter().flat_map(|name| figure(path, name));
        write_with_table(path, &json, &self.to_csv(), figures)
    }

    /// Encodes a row per image: its class, both answers, and each robot's displacement.
    fn to_csv(&self) -> Vec<u8> {
        let columns = ["index", "label", "by_votes", "by_walks"]
            .map(str::to_string)
            .into_iter();
        let columns = columns.chain(
            self.members
                .iter()
                .map(|member| format!("{} {}", member.task, member.id)),
        );
        let rows = self.images.iter().enumerate().map(|(place, image)| {
            let answer = |of: fn(&Answers) -> &Decoded| {
                self.answers.as_ref().map(|all| of(all).answers[place])
            };
            let walks: Vec<Option<f64>> = self
                .members
                .iter()
                .map(|member| member.displacements[place])
                .collect();
            (
                image.index,
                image.label,
                answer(|all| &all.votes),
                answer(|all| &all.walks),
                walks,
            )
        });
        table::csv(columns, rows)
    }
}
