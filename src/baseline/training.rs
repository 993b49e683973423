//! Training a network from scratch as in the paper: Adam, with early stopping.

use crate::base::Grid;
use crate::base::random::Stream;
use crate::base::session::Session;
use crate::base::stop::Stopped;
use crate::baseline::network::{Network, Patches, Shape, cross_entropy};
use crate::baseline::settings::{Hyperparameters, NetworkKind, Trained, Watch};
use nalgebra::DVector;

/// Images with their groups (0 or 1), prepared for networks of a kind.
#[derive(Clone, Debug)]
pub(crate) struct Samples {
    images: Vec<(Patches, usize)>,
    /// The networks' shape, except for their size.
    shape: Shape,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum SamplesError {
    #[error("expected images, found none")]
    Empty,
    #[error("expected images of {} × {} pixels, found {} × {}", first.0, first.1, other.0, other.1)]
    Size {
        first: (usize, usize),
        other: (usize, usize),
    },
}

impl Samples {
    /// Prepares images of one size, with values in [0, 1], each with its group (0 or 1).
    pub(crate) fn new(
        images: &[(&Grid<f64>, usize)],
        kind: NetworkKind,
        hyper: &Hyperparameters,
    ) -> Result<Self, SamplesError> {
        let size = |(image, _): &(&Grid<f64>, usize)| (image.height(), image.width());
        let first = images.first().map(size).ok_or(SamplesError::Empty)?;
        if let Some(other) = images.iter().map(size).find(|other| *other != first) {
            return Err(SamplesError::Size { first, other });
        }
        let Hyperparameters {
            kernel,
            activation,
            pooling,
            ..
        } = *hyper;
        let shape = Shape {
            kind,
            size: 1,
            image: first,
            kernel,
            activation,
            pooling,
        };
        let images = images
            .iter()
            .map(|(image, group)| (shape.patches(image), *group))
            .collect();
        Ok(Samples { images, shape })
    }
}

/// Returns a network's accuracy on samples, and the value to improve; larger is better.
fn test(
    network: &mut Network,
    samples: &Samples,
    watch: Watch,
    session: &Session,
) -> Result<(f64, f64), Stopped> {
    let (mut correct, mut loss) = (0, 0.0);
    for (image, group) in &samples.images {
        session.check()?;
        let outputs = network.forward(image);
        correct += usize::from(usize::from(outputs[1] > outputs[0]) == *group);
        loss += cross_entropy(outputs, *group).0;
    }
    let accuracy = correct as f64 / samples.images.len() as f64;
    Ok((
        accuracy,
        if watch == Watch::Accuracy {
            accuracy
        } else {
            -loss
        },
    ))
}

/// Adam (Kingma & Ba 2015) with its usual constants.
struct Adam {
    rate: f64,
    /// Running means of the gradient and of its square.
    moments: [DVector<f64>; 2],
    /// β₁ᵗ and β₂ᵗ after t steps.
    powers: [f64; 2],
}

impl Adam {
    const BETAS: [f64; 2] = [0.9, 0.999];
    const EPSILON: f64 = 1e-8;

    fn new(rate: f64, parameters: usize) -> Self {
        Adam {
            rate,
            moments: [0, 1].map(|_| DVector::zeros(parameters)),
            powers: [1.0, 1.0],
        }
    }

    fn step(&mut self, parameters: &mut DVector<f64>, gradient: &DVector<f64>) {
        let [beta1, beta2] = Self::BETAS;
        self.powers = [self.powers[0] * beta1, self.powers[1] * beta2];
        let scales = self.powers.map(|power| 1.0 / (1.0 - power));
        let [m, v] = self.moments.each_mut().map(DVector::as_mut_slice);
        let (parameters, gradient) = (parameters.as_mut_slice(), &gradient.as_slice()[..m.len()]);
        for (i, g) in gradient.iter().enumerate() {
            m[i] = beta1 * m[i] + (1.0 - beta1) * g;
            v[i] = beta2 * v[i] + (1.0 - beta2) * g * g;
            parameters[i] -=
                self.rate * (m[i] * scales[0]) / ((v[i] * scales[1]).sqrt() + Self::EPSILON);
        }
    }
}

/// Trains a network of a size on `training`, waits for improvement on `waiting`, and tests it on
/// `test_set`: samples for networks of one kind. Every image checks for a stop.
pub(crate) fn train(
    size: usize,
    hyper: &Hyperparameters,
    training: &Samples,
    waiting: &Samples,
    test_set: &Samples,
    rng: &mut Stream,
    session: &Session,
) -> Result<Trained, Stopped> {
    let Hyperparameters {
        epochs,
        patience,
        watch,
        ..
    } = *hyper;
    let mut network = Network::new(
        Shape {
            size,
            ..training.shape
        },
        rng,
    );
    let parameters = network.parameters().len();
    let mut adam = Adam::new(hyper.learning_rate, parameters);
    let mut gradient = DVector::zeros(parameters);
    let count = training.images.len();
    let batch = if hyper.batch == 0 { count } else { hyper.batch };
    let mut best: Option<(f64, Option<DVector<f64>>)> = None;
    let mut waited = 0;
    let mut done = 0;
    // Accuracy of the current network on `waiting`.
    let mut present = None;
    while done < epochs && waited < patience {
        for chosen in rng.sample(count, count).chunks(batch) {
            gradient.fill(0.0);
            for (image, group) in chosen.iter().map(|index| &training.images[*index]) {
                session.check()?;
                let (_, by_outputs) = cross_entropy(network.forward(image), *group);
                let by_outputs = by_outputs.map(|derivative| derivative / chosen.len() as f64);
                network.backward(image, by_outputs, &mut gradient);
            }
            adam.step(network.parameters_mut(), &gradient);
        }
        done += 1;
        let (accuracy, value) = test(&mut network, waiting, watch, session)?;
        present = Some(accuracy);
        if best.as_ref().is_none_or(|(least, _)| value > *least) {
            (best, waited) = (
                Some((
                    value,
                    hyper.restore_best.then(|| network.parameters().clone()),
                )),
                0,
            );
        } else {
            waited += 1;
        }
    }
    if let Some((_, Some(kept))) = best.filter(|_| waited > 0) {
        *network.parameters_mut() = kept;
        present = None;
    }
    let accuracy = match present.filter(|_| std::ptr::eq(waiting, test_set)) {
        Some(known) => known,
        None => test(&mut network, test_set, Watch::Accuracy, session)?.0,
    };
    Ok(Trained {
        accuracy,
        epochs: done,
        parameters,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};

    use std::sync::atomic::AtomicBool;

    /// Makes noisy images that are brighter at the top, or at the bottom.
    fn samples(seed: u64, count: usize, kind: NetworkKind, hyper: &Hyperparameters) -> Samples {
        let rng = &mut stream(seed, Purpose::Networks, 0, 0);
        let groups: Vec<usize> = (0..count)
            .map(|number| usize::from(number % 3 == 0))
            .collect();
        let images: Vec<Grid<f64>> = groups
            .iter()
            .map(|&group| {
                Grid::from_fn(6, 6, |row, _| {
                    let bright = (row < 3) == (group == 0);
                    rng.uniform(0.0, 0.6) + if bright { 0.4 } else { 0.0 }
                })
            })
            .collect();
        Samples::new(&images.iter().zip(groups).collect::<Vec<_>>(), kind, hyper).unwrap()
    }

    fn trained(kind: NetworkKind, hyper: &Hyperparameters, seed: u64) -> Trained {
        let [learn, test] =
            [(1, 12), (2, 150)].map(|(seed, count)| samples(seed, count, kind, hyper));
        let rng = &mut stream(seed, Purpose::Networks, 1, 0);
        train(8, hyper, &learn, &test, &test, rng, &Session::default()).unwrap()
    }

    #[test]
    fn both_kinds_learn_what_can_be_learnt() {
        for kind in NetworkKind::ALL {
            for watch in [Watch::Accuracy, Watch::Loss] {
                let hyper = Hyperparameters {
                    learning_rate: 0.01,
                    watch,
                    batch: 5,
                    patience: 50,
                    ..Default::default()
                };
                let Trained {
                    accuracy, epochs, ..
                } = trained(kind, &hyper, 1);
                assert!(
                    accuracy > 0.95 && epochs == 50,
                    "{kind:?} {watch:?}: {accuracy}"
                );
            }
        }
    }

    #[test]
    fn the_best_epochs_network_is_tested_on_request_and_patience_ends_training() {
        let last = Hyperparameters {
            learning_rate: 0.03,
            batch: 0,
            ..Default::default()
        };
        let best = Hyperparameters {
            restore_best: true,
            ..last
        };
        let mut better = 0;
        for seed in 0..8 {
            let [last, best] = [last, best].map(|hyper| trained(NetworkKind::Mlp, &hyper, seed));
            assert!(
                best.accuracy >= last.accuracy && best.epochs == last.epochs && best.epochs < 50
            );
            better += usize::from(best.accuracy > last.accuracy);
        }
        assert!(better > 0);
    }

    /// A change of one bit in any parameter, of any kind of layer, changes this hash.
    #[test]
    fn trained_parameters_are_pinned_to_the_bit() {
        use crate::baseline::Pooling;
        use crate::baseline::settings::Activation;
        let mut bits = String::new();
        for kind in NetworkKind::ALL {
            for (activation, pooling) in [
                (Activation::Relu, Pooling::None),
                (Activation::Tanh, Pooling::Max2),
                (Activation::Sigmoid, Pooling::Mean),
            ] {
                let hyper = Hyperparameters {
                    activation,
                    pooling,
                    batch: 5,
                    ..Default::default()
                };
                let images = samples(1, 12, kind, &hyper);
                let rng = &mut stream(6, Purpose::Networks, 1, 0);
                let mut network = Network::new(
                    Shape {
                        size: 5,
                        ..images.shape
                    },
                    rng,
                );
                let mut adam = Adam::new(hyper.learning_rate, network.parameters().len());
                for (image, group) in &images.images {
                    let mut gradient = DVector::zeros(network.parameters().len());
                    let (_, by_outputs) = cross_entropy(network.forward(image), *group);
                    network.backward(image, by_outputs, &mut gradient);
                    adam.step(network.parameters_mut(), &gradient);
                }
                bits.extend(
                    network
                        .parameters()
                        .iter()
                        .map(|x| format!("{:016x}", x.to_bits())),
                );
            }
        }
        assert_eq!(crate::base::hash::sha256_hex(bits.as_bytes()), PINNED);
    }
    const PINNED: &str = "a8a07b6a20b7beaa339945be3378d89a3839e2912a1b47d73bb22884e367c083";

    #[test]
    fn a_training_is_stopped_between_images() {
        let hyper = Hyperparameters {
            epochs: 1_000_000,
            patience: 1_000_000,
            ..Default::default()
        };
        let [learn, test] = [12, 150].map(|count| samples(1, count, NetworkKind::Cnn, &hyper));
        let rng = &mut stream(1, Purpose::Networks, 1, 0);
        let stop = AtomicBool::new(false);
        let begin = std::time::Instant::now();
        let ended = std::thread::scope(|threads| {
            threads.spawn(|| {
                std::thread::sleep(std::time::Duration::from_millis(50));
                stop.store(true, std::sync::atomic::Ordering::Relaxed);
            });
            train(
                8,
                &hyper,
                &learn,
                &test,
                &test,
                rng,
                &Session::new(&stop, &()),
            )
        });
        assert_eq!(ended, Err(Stopped));
        assert!(begin.elapsed().as_secs() < 5, "{:?}", begin.elapsed());
    }

    #[test]
    fn no_images_and_images_of_several_sizes_are_refused() {
        let [image, other] =
            [(6, 6), (6, 7)].map(|(rows, columns)| Grid::from_fn(rows, columns, |_, _| 0.5));
        let new = |images: &[(&Grid<f64>, usize)]| {
            Samples::new(images, NetworkKind::Mlp, &Hyperparameters::default())
                .map(|_| ())
                .unwrap_err()
                .to_string()
        };
        assert_eq!(new(&[]), "expected images, found none");
        assert_eq!(
            new(&[(&image, 0), (&other, 1)]),
            "expected images of 6 × 6 pixels, found 6 × 7"
        );
    }
}
