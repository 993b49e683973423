//! Requests for simulations: validates and bounds the page's input and turns it into plans.

use crate::base::Grid;
use crate::body::Body;
use crate::serve::catalogue::{RobotCatalogue, Who};
use crate::serve::images::{ImageName, ImageSets};
use crate::serve::refusal::HttpRefusal;
use crate::sim::Physics;
use crate::task::class_names::ClassNames;
use crate::task::protocol::Protocol;
use crate::task::recording::FramedImage;
use crate::task::stimulus::{Encoding, Reduction, StimulusParams, stimulus};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

/// Maximum number of control steps in a simulation, across image changes: a hundred cycles.
pub(crate) const MAX_STEPS: u32 = 5000;
/// The largest side of a drawing \[pixels\].
pub(crate) const MAX_PICTURE: usize = 128;
/// The fastest pace other than "as fast as possible".
pub(crate) const MAX_SPEED: f64 = 16.0;

/// A robot of a collection, or any body with the parameters of its stimulus.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SubjectRequest {
    /// The number of the collection.
    archive: Option<usize>,
    /// The id of the robot there.
    robot: Option<String>,
    /// The body, in place of a robot.
    #[serde(default, deserialize_with = "self_moving_if_any")]
    body: Option<Body>,
    encoding: Option<StimulusParams>,
}

/// Reads a body without actuators: the page cannot give them targets.
pub(crate) fn self_moving<'de, D: Deserializer<'de>>(reader: D) -> Result<Body, D::Error> {
    let body = Body::deserialize(reader)?;
    match body
        .voxels()
        .cells()
        .iter()
        .any(|material| material.is_actuator())
    {
        false => Ok(body),
        true => Err(D::Error::custom(
            "expected materials 0…6: actuators (7 and 8) need targets, which the page does not give",
        )),
    }
}

fn self_moving_if_any<'de, D: Deserializer<'de>>(reader: D) -> Result<Option<Body>, D::Error> {
    self_moving(reader).map(Some)
}

/// The visible image, at most one of the three; none is dark.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ImageChoice {
    /// A drawing: 0 paper … 255 ink, rows from the top.
    drawing: Option<Grid<u8>>,
    image: Option<ImageName>,
    /// A finished stimulus, one number from 0 to 1 per voxel.
    stimulus: Option<Grid<f64>>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SimulationRequest {
    subject: SubjectRequest,
    #[serde(default)]
    shown: ImageChoice,
    /// The control steps per image; the default is the robot's protocol.
    control_steps: Option<u32>,
    /// The speed as a multiple of real time; 0: as fast as possible. Default 1.
    speed: Option<f64>,
}

/// A request for a body's stimulus, without a simulation.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SeeRequest {
    subject: SubjectRequest,
    #[serde(default)]
    shown: ImageChoice,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ChangeRequest {
    pub(crate) shown: Option<ImageChoice>,
    /// The speed as a multiple of real time; 0: as fast as possible.
    pub(crate) speed: Option<f64>,
    pub(crate) paused: Option<bool>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Pace {
    /// A multiple of real time.
    Times(f64),
    Free,
}

impl Pace {
    /// Creates a pace from a number, 0 for as fast as possible.
    pub(crate) fn of(speed: f64) -> Result<Self, HttpRefusal> {
        match speed {
            0.0 => Ok(Pace::Free),
            times if (0.1..=MAX_SPEED).contains(&times) => Ok(Pace::Times(times)),
            _ => Err(HttpRefusal::Wrong(format!(
                "speed: {speed}: expected 0 (as fast as possible) or 0.1 to {MAX_SPEED}"
            ))),
        }
    }
}

/// A stimulus with its class, if that is known.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SeenPixels {
    /// The stimulus, H × W in \[0, 1\].
    pub(crate) stimulus: Grid<f64>,
    /// The class of a test image.
    pub(crate) label: Option<u8>,
    /// The image that it is a part of, if the sensors do not cover all of it.
    pub(crate) image: Option<FramedImage>,
}

#[derive(Clone, Debug)]
pub(crate) struct RolloutPlan {
    pub(crate) who: Who,
    /// The first stimulus.
    pub(crate) seen: SeenPixels,
    pub(crate) pace: Pace,
}

impl SubjectRequest {
    fn find(self, catalogue: &RobotCatalogue) -> Result<Who, HttpRefusal> {
        let wrong = |text: &str| Err(HttpRefusal::Wrong(text.to_string()));
        match self {
            SubjectRequest {
                archive: Some(index),
                robot: Some(id),
                body: None,
                encoding: None,
            } => catalogue.collection(index)?.who(&id),
            SubjectRequest {
                archive: None,
                robot: None,
                body: Some(body),
                encoding,
            } => {
                if !body.is_connected() {
                    return wrong(
                        "subject.body: expected at least one voxel, and all hanging together through their sides",
                    );
                }
                let encoding = encoding.unwrap_or(StimulusParams {
                    reduction: Reduction::Area,
                    encoding: Encoding::Saturated,
                    ..StimulusParams::default()
                });
                let (physics, protocol) = (Physics::default(), Protocol::default());
                Ok(Who {
                    body,
                    physics,
                    protocol,
                    encoding,
                    judge: None,
                    names: ClassNames::default(),
                })
            }
            _ => {
                wrong("subject: expected either archive and robot, or body (perhaps with encoding)")
            }
        }
    }
}

impl ImageChoice {
    /// Converts the image to the stimulus of a body.
    pub(crate) fn seen(self, who: &Who, images: &ImageSets) -> Result<SeenPixels, HttpRefusal> {
        let (height, width) = (who.body.height(), who.body.width());
        let reduce = |pixels: &Grid<u8>| {
            stimulus(pixels, height, width, &who.encoding)
                .map_err(|error| HttpRefusal::Wrong(format!("shown: {error}")))
        };
        match self {
            ImageChoice {
                drawing: None,
                image: None,
                stimulus: None,
            } => Ok(SeenPixels {
                stimulus: Grid::filled(height, width, 0.0),
                label: None,
                image: None,
            }),
            ImageChoice {
                drawing: Some(pixels),
                image: None,
                stimulus: None,
            } => {
                let (rows, columns) = (pixels.height(), pixels.width());
                if rows > MAX_PICTURE || columns > MAX_PICTURE {
                    return Err(HttpRefusal::Wrong(format!(
                        "shown.drawing: {rows} × {columns} pixels, expected at most {MAX_PICTURE} × {MAX_PICTURE}"
                    )));
                }
                Ok(SeenPixels {
                    stimulus: reduce(&pixels)?,
                    label: None,
                    image: FramedImage::of(&pixels, &who.encoding),
                })
            }
            ImageChoice {
                drawing: None,
                image: Some(name),
                stimulus: None,
            } => {
                let image = images.image(&name)?;
                Ok(SeenPixels {
                    stimulus: reduce(&image.pixels)?,
                    label: Some(image.label),
                    image: FramedImage::of(&image.pixels, &who.encoding),
                })
            }
            ImageChoice {
                drawing: None,
                image: None,
                stimulus: Some(given),
            } => {
                if (given.height(), given.width()) != (height, width) {
                    let (rows, columns) = (given.height(), given.width());
                    return Err(HttpRefusal::Wrong(format!(
                        "shown.stimulus: {rows} × {columns} pixels, expected {height} × {width} as the body"
                    )));
                }
                if given
                    .cells()
                    .iter()
                    .any(|pixel| !(0.0..=1.0).contains(pixel))
                {
                    return Err(HttpRefusal::Wrong(
                        "shown.stimulus: expected numbers from 0 to 1".to_string(),
                    ));
                }
                Ok(SeenPixels {
                    stimulus: given,
                    label: None,
                    image: None,
                })
            }
            _ => Err(HttpRefusal::Wrong(
                "shown: expected one of drawing, image, stimulus".to_string(),
            )),
        }
    }
}

impl SimulationRequest {
    pub(crate) fn plan(
        self,
        catalogue: &RobotCatalogue,
        images: &ImageSets,
    ) -> Result<RolloutPlan, HttpRefusal> {
        let mut who = self.subject.find(catalogue)?;
        let steps = self
            .control_steps
            .unwrap_or(who.protocol.control_steps.min(MAX_STEPS));
        if !(1..=MAX_STEPS).contains(&steps) {
            return Err(HttpRefusal::Wrong(format!(
                "control_steps: {steps}: expected 1 to {MAX_STEPS}"
            )));
        }
        who.protocol.control_steps = steps;
        let seen = self.shown.seen(&who, images)?;
        Ok(RolloutPlan {
            who,
            seen,
            pace: Pace::of(self.speed.unwrap_or(1.0))?,
        })
    }
}

impl SeeRequest {
    pub(crate) fn seen(
        self,
        catalogue: &RobotCatalogue,
        images: &ImageSets,
    ) -> Result<SeenPixels, HttpRefusal> {
        let who = self.subject.find(catalogue)?;
        self.shown.seen(&who, images)
    }
}

pub(crate) fn read<T: serde::de::DeserializeOwned>(body: &[u8]) -> Result<T, HttpRefusal> {
    let text = std::str::from_utf8(body)
        .map_err(|_| HttpRefusal::Wrong("request: not UTF-8 text".to_string()))?;
    crate::config::reading::read_json(text, "request").map_err(HttpRefusal::from)
}
