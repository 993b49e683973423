//! Training a network from scratch, as the paper has it: Adam, with early stopping.

use crate::base::Grid;
use crate::base::random::Stream;
use crate::base::stop::{Stopped, check};
use crate::baseline::network::{Network, Shape};
use crate::baseline::settings::{Hyperparameters, Kind, Trained, Watch};
use candle_core::{D, DType, Device, Result, Tensor};
use candle_nn::{AdamW, Optimizer, ParamsAdamW};
use std::sync::atomic::AtomicBool;

/// Images with their groups (0 or 1), as networks of a kind see them.
#[derive(Clone, Debug)]
pub struct Samples {
    /// As [`Shape::seen`] returns them.
    seen: Tensor,
    /// n, u32.
    groups: Tensor,
    /// Of the networks but for their size.
    shape: Shape,
}

impl Samples {
    /// From images of one size, in [0, 1], and their groups, as many, for networks of a kind.
    ///
    /// # Errors
    /// If there are none, or they are not as many or not of one size.
    pub fn new(images: &[&Grid<f64>], groups: &[u32], kind: Kind, hyper: &Hyperparameters) -> Result<Self> {
        let Some(first) = images.first() else { candle_core::bail!("expected images, found none") };
        if images.len() != groups.len() {
            candle_core::bail!(
                "expected as many groups as images, found {} and {}",
                groups.len(),
                images.len()
            );
        }
        let Hyperparameters { kernel, activation, pooling, .. } = *hyper;
        let shape =
            Shape { kind, size: 1, image: (first.height(), first.width()), kernel, activation, pooling };
        let groups = Tensor::from_vec(groups.to_vec(), groups.len(), &Device::Cpu)?;
        Ok(Samples { seen: shape.seen(images)?, groups, shape })
    }

    fn len(&self) -> usize {
        self.groups.elem_count()
    }
}

/// Images judged at once \[images\]: activations of this many stay in a core's cache; with more, it
/// is slower.
const JUDGED_AT_ONCE: usize = 64;

/// Why a training has no result.
#[derive(Debug, thiserror::Error)]
pub enum Untrained {
    /// It was stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The images do not go with each other or with the kernels.
    #[error(transparent)]
    Failed(#[from] candle_core::Error),
}

/// A network's accuracy, and what its training waits for an improvement of; larger is better.
fn judge(
    network: &Network,
    samples: &Samples,
    watch: Watch,
    stop: &AtomicBool,
) -> std::result::Result<(f64, f64), Untrained> {
    let (mut right, mut loss) = (0.0, 0.0);
    for first in (0..samples.len()).step_by(JUDGED_AT_ONCE) {
        check(stop)?;
        let count = JUDGED_AT_ONCE.min(samples.len() - first);
        let groups = samples.groups.narrow(0, first, count)?;
        let outputs = network.forward(&samples.seen.narrow(1, first, count)?.contiguous()?)?;
        let hits = outputs.argmax(D::Minus1)?.eq(&groups)?.to_dtype(DType::F32)?.sum_all()?;
        right += f64::from(hits.to_scalar::<f32>()?);
        if watch == Watch::Loss {
            let mean = candle_nn::loss::cross_entropy(&outputs, &groups)?.to_scalar::<f32>()?;
            loss += f64::from(mean) * count as f64;
        }
    }
    let accuracy = right / samples.len() as f64;
    Ok((accuracy, if watch == Watch::Accuracy { accuracy } else { -loss }))
}

/// Trains a network of a size on `training`, waits for improvement on `waiting`, and tests it on
/// `test`: samples for networks of one kind. Unless `stop` is set meanwhile, which is looked at
/// between batches.
///
/// # Errors
/// If it was stopped; if the images do not go with each other or with the kernels.
pub fn train(
    size: usize,
    hyper: &Hyperparameters,
    training: &Samples,
    waiting: &Samples,
    test: &Samples,
    rng: &mut Stream,
    stop: &AtomicBool,
) -> std::result::Result<Trained, Untrained> {
    let Hyperparameters { epochs, patience, watch, .. } = *hyper;
    let network = Network::new(Shape { size, ..training.shape }, rng)?;
    let adam = ParamsAdamW { lr: hyper.learning_rate, weight_decay: 0.0, ..ParamsAdamW::default() };
    let mut optimizer = AdamW::new(network.parameters(), adam)?;
    let batch = if hyper.batch == 0 { training.len() } else { hyper.batch };
    let mut best: Option<(f64, Vec<Tensor>)> = None;
    let mut waited = 0;
    let mut done = 0;
    // Of the network as it is, on the images waited on.
    let mut present = None;
    while done < epochs && waited < patience {
        let order: Vec<u32> =
            rng.sample(training.len(), training.len()).into_iter().map(|index| index as u32).collect();
        for chosen in order.chunks(batch) {
            check(stop)?;
            let chosen = Tensor::from_vec(chosen.to_vec(), chosen.len(), &Device::Cpu)?;
            let seen = training.seen.index_select(&chosen, 1)?;
            let groups = training.groups.index_select(&chosen, 0)?;
            optimizer.backward_step(&candle_nn::loss::cross_entropy(&network.forward(&seen)?, &groups)?)?;
        }
        done += 1;
        let (accuracy, value) = judge(&network, waiting, watch, stop)?;
        present = Some(accuracy);
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
    if let Some((_, kept)) = best.filter(|_| waited > 0 && hyper.restore_best) {
        for (parameter, value) in network.parameters().iter().zip(&kept) {
            parameter.set(value)?;
        }
        present = None;
    }
    let accuracy = match present.filter(|_| std::ptr::eq(waiting, test)) {
        Some(known) => known,
        None => judge(&network, test, Watch::Accuracy, stop)?.0,
    };
    Ok(Trained { accuracy, epochs: done, parameters: network.count() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};
    use crate::base::stop::NEVER;

    /// Noisy images that are brighter above, or below: more of them than are judged at once.
    fn samples(seed: u64, count: usize, kind: Kind, hyper: &Hyperparameters) -> Samples {
        let rng = &mut stream(seed, Purpose::Networks, 0, 0);
        let groups: Vec<u32> = (0..count).map(|number| u32::from(number % 3 == 0)).collect();
        let images: Vec<Grid<f64>> = groups
            .iter()
            .map(|&group| {
                Grid::from_fn(6, 6, |row, _| {
                    let bright = (row < 3) == (group == 0);
                    rng.uniform(0.0, 0.6) + if bright { 0.4 } else { 0.0 }
                })
            })
            .collect();
        Samples::new(&images.iter().collect::<Vec<_>>(), &groups, kind, hyper).unwrap()
    }

    fn trained(kind: Kind, hyper: &Hyperparameters, seed: u64) -> Trained {
        let [learn, test] = [(1, 12), (2, 150)].map(|(seed, count)| samples(seed, count, kind, hyper));
        let rng = &mut stream(seed, Purpose::Networks, 1, 0);
        train(8, hyper, &learn, &test, &test, rng, &NEVER).unwrap()
    }

    #[test]
    fn both_kinds_learn_what_can_be_learnt() {
        for kind in Kind::ALL {
            for watch in [Watch::Accuracy, Watch::Loss] {
                let hyper = Hyperparameters {
                    learning_rate: 0.01,
                    watch,
                    batch: 5,
                    patience: 50,
                    ..Default::default()
                };
                let Trained { accuracy, epochs, .. } = trained(kind, &hyper, 1);
                assert!(accuracy > 0.95 && epochs == 50, "{kind:?} {watch:?}: {accuracy}");
            }
        }
    }

    #[test]
    fn the_best_epochs_network_is_tested_if_wished_and_patience_ends_training() {
        let last = Hyperparameters { learning_rate: 0.03, batch: 0, ..Default::default() };
        let best = Hyperparameters { restore_best: true, ..last };
        let mut better = 0;
        for seed in 0..8 {
            let [last, best] = [last, best].map(|hyper| trained(Kind::Mlp, &hyper, seed));
            assert!(best.accuracy >= last.accuracy && best.epochs == last.epochs && best.epochs < 50);
            better += usize::from(best.accuracy > last.accuracy);
        }
        assert!(better > 0);
    }

    #[test]
    fn accuracy_is_over_all_images_however_they_are_judged() {
        let hyper = Hyperparameters::default();
        let samples = samples(3, 150, Kind::Cnn, &hyper);
        let shape = Shape { size: 3, ..samples.shape };
        let network = Network::new(shape, &mut stream(4, Purpose::Networks, 0, 0)).unwrap();
        let outputs = network.forward(&samples.seen).unwrap();
        let answers = outputs.argmax(D::Minus1).unwrap().to_vec1::<u32>().unwrap();
        let groups = samples.groups.to_vec1::<u32>().unwrap();
        let right = answers.iter().zip(&groups).filter(|(answer, group)| answer == group).count();
        let loss = candle_nn::loss::cross_entropy(&outputs, &samples.groups).unwrap();
        let (accuracy, value) = judge(&network, &samples, Watch::Loss, &NEVER).unwrap();
        assert_eq!(accuracy, right as f64 / 150.0);
        assert!((value / 150.0 + f64::from(loss.to_scalar::<f32>().unwrap())).abs() < 1e-5);
    }

    #[test]
    fn a_training_is_stopped_between_batches() {
        let hyper = Hyperparameters { epochs: 1_000_000, patience: 1_000_000, ..Default::default() };
        let [learn, test] = [12, 150].map(|count| samples(1, count, Kind::Cnn, &hyper));
        let rng = &mut stream(1, Purpose::Networks, 1, 0);
        let stop = AtomicBool::new(false);
        let begin = std::time::Instant::now();
        let ended = std::thread::scope(|threads| {
            threads.spawn(|| {
                std::thread::sleep(std::time::Duration::from_millis(50));
                stop.store(true, std::sync::atomic::Ordering::Relaxed);
            });
            train(8, &hyper, &learn, &test, &test, rng, &stop)
        });
        assert!(matches!(ended, Err(Untrained::Stopped(Stopped))), "{ended:?}");
        assert!(begin.elapsed().as_secs() < 5, "{:?}", begin.elapsed());
    }

    #[test]
    fn images_and_groups_must_go_together() {
        let image = Grid::from_fn(6, 6, |_, _| 0.5);
        let new = |images: &[&Grid<f64>], groups: &[u32]| {
            Samples::new(images, groups, Kind::Mlp, &Hyperparameters::default())
                .map(|_| ())
                .unwrap_err()
                .to_string()
        };
        assert!(new(&[], &[]).contains("found none"));
        assert!(new(&[&image], &[0, 1]).contains("found 2 and 1"));
    }
}
