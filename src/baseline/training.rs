//! Training a network from scratch, as the paper has it: Adam, with early stopping.

use super::network::{Activation, Kind, Network, Pooling, Shape};
use crate::base::Grid;
use crate::base::random::Stream;
use candle_core::{D, DType, Device, Result, Tensor};
use candle_nn::{AdamW, Optimizer, ParamsAdamW};
use serde::{Deserialize, Serialize};

/// What training waits for an improvement of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Watch {
    /// Share answered right: larger is better.
    Accuracy,
    /// Cross-entropy: smaller is better.
    Loss,
}

/// How networks are trained.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Hyperparameters {
    /// Passes over the training images. Default 50, the paper's.
    pub epochs: usize,
    /// Epochs without an improvement after which training ends. Default 5, the paper's.
    pub patience: usize,
    /// What is to improve.
    pub watch: Watch,
    /// Whether the best epoch's network is tested, not the last epoch's.
    pub restore_best: bool,
    /// Adam's learning rate.
    pub learning_rate: f64,
    /// Images per step; 0: all at once.
    pub batch: usize,
    /// What follows the hidden layer.
    pub activation: Activation,
    /// Side of the convolution's kernels.
    pub kernel: usize,
    /// What becomes of the convolution's maps.
    pub pooling: Pooling,
}

impl Default for Hyperparameters {
    fn default() -> Self {
        Hyperparameters {
            epochs: 50,
            patience: 5,
            watch: Watch::Accuracy,
            restore_best: false,
            learning_rate: 1e-3,
            batch: 0,
            activation: Activation::Relu,
            kernel: 3,
            pooling: Pooling::None,
        }
    }
}

/// Images with their groups (0 or 1), ready for networks.
#[derive(Clone, Debug)]
pub struct Samples {
    /// n × 1 × height × width, f32.
    images: Tensor,
    /// n, u32.
    groups: Tensor,
    /// Rows and columns.
    size: (usize, usize),
}

impl Samples {
    /// From images of one size, in [0, 1], and their groups, as many.
    ///
    /// # Errors
    /// If there are none, or they are not as many or not of one size.
    pub fn new(images: &[&Grid<f64>], groups: &[u32]) -> Result<Self> {
        let size = images.first().map_or((0, 0), |image| (image.height(), image.width()));
        let pixels: Vec<f32> =
            images.iter().flat_map(|image| image.cells().iter().map(|&pixel| pixel as f32)).collect();
        let images = Tensor::from_vec(pixels, (images.len(), 1, size.0, size.1), &Device::Cpu)?;
        let groups = Tensor::from_vec(groups.to_vec(), groups.len(), &Device::Cpu)?;
        Ok(Samples { images, groups, size })
    }

    /// Number of images.
    pub fn len(&self) -> usize {
        self.groups.elem_count()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// How a training ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trained {
    /// Share of the test images answered right.
    pub accuracy: f64,
    /// Epochs it took.
    pub epochs: usize,
    /// Numbers that training changed.
    pub parameters: usize,
}

/// (accuracy, loss) of a network on samples.
fn judge(network: &Network, samples: &Samples) -> Result<(f64, f64)> {
    let outputs = network.forward(&samples.images)?;
    let right = outputs.argmax(D::Minus1)?.eq(&samples.groups)?.to_dtype(DType::F32)?.sum_all()?;
    let loss = candle_nn::loss::cross_entropy(&outputs, &samples.groups)?;
    let share = f64::from(right.to_scalar::<f32>()?) / samples.len().max(1) as f64;
    Ok((share, f64::from(loss.to_scalar::<f32>()?)))
}

/// Trains a network of a kind and size on `training`, waits for improvement on `waiting`, and tests it on `test`.
///
/// # Errors
/// If the images do not go with each other or with the kernels.
pub fn train(
    (kind, size): (Kind, usize),
    hyper: &Hyperparameters,
    training: &Samples,
    waiting: &Samples,
    test: &Samples,
    rng: &mut Stream,
) -> Result<Trained> {
    let Hyperparameters { epochs, patience, watch, kernel, activation, pooling, .. } = *hyper;
    let network = Network::new(Shape { kind, size, image: training.size, kernel, activation, pooling }, rng)?;
    let adam = ParamsAdamW { lr: hyper.learning_rate, weight_decay: 0.0, ..ParamsAdamW::default() };
    let mut optimizer = AdamW::new(network.parameters(), adam)?;
    let batch = if hyper.batch == 0 { training.len() } else { hyper.batch.min(training.len()) }.max(1);
    let mut best: Option<(f64, Vec<Tensor>)> = None;
    let mut waited = 0;
    let mut done = 0;
    while done < epochs && waited < patience {
        let order: Vec<u32> =
            rng.sample(training.len(), training.len()).into_iter().map(|index| index as u32).collect();
        for chosen in order.chunks(batch) {
            let chosen = Tensor::from_vec(chosen.to_vec(), chosen.len(), &Device::Cpu)?;
            let images = training.images.index_select(&chosen, 0)?;
            let groups = training.groups.index_select(&chosen, 0)?;
            optimizer.backward_step(&candle_nn::loss::cross_entropy(&network.forward(&images)?, &groups)?)?;
        }
        done += 1;
        let (accuracy, loss) = judge(&network, waiting)?;
        let value = if watch == Watch::Accuracy { accuracy } else { -loss };
        if best.as_ref().is_none_or(|(least, _)| value > *least) {
            let kept = if hyper.restore_best {
                network.parameters().iter().map(|p| p.as_tensor().copy()).collect::<Result<_>>()?
            } else {
                Vec::new()
            };
            (best, waited) = (Some((value, kept)), 0);
        } else {
            waited += 1;
        }
    }
    if let Some((_, kept)) = best {
        for (parameter, value) in network.parameters().iter().zip(&kept) {
            parameter.set(value)?;
        }
    }
    let (accuracy, _) = judge(&network, test)?;
    Ok(Trained { accuracy, epochs: done, parameters: network.count() })
}
