//! Loss and accuracy of a batch, read from the device on demand.

use burn::tensor::Tensor;
use tactnet_models::values;

use super::pairs_pass::near_their_own;

/// Loss and accuracy of a batch, still on the device.
pub struct Measured {
    values: Tensor<1>,
    kind: Kind,
}

/// Layout of the values.
enum Kind {
    /// Loss and number of correct predictions.
    Clean,
    /// Loss and number of correct predictions of the clean half, then of the adversarial half; `alpha` is the weight of the clean loss.
    Adversarial { alpha: f64 },
    /// Loss, then distances `[sweeps][sweeps]`.
    Pairs { labels: Vec<usize> },
}

/// Loss and accuracy of a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figures {
    /// Loss in nats per sweep.
    pub loss: f64,
    /// Number of correctly predicted clean sweeps, with dropout.
    pub correct: usize,
    /// Number of correctly predicted adversarial sweeps; `None` without adversarial training.
    pub adversarial_correct: Option<usize>,
}

impl Measured {
    /// - `half`: loss and number of correct predictions, `[2]`
    pub(crate) fn clean(half: Tensor<1>) -> Self {
        Self {
            values: half,
            kind: Kind::Clean,
        }
    }

    /// - `halves`: loss and number of correct predictions of clean and of adversarial sweeps, `[2]` each
    /// - `alpha`: weight of the clean loss
    pub(crate) fn adversarial(halves: [Tensor<1>; 2], alpha: f64) -> Self {
        Self {
            values: Tensor::cat(halves.to_vec(), 0),
            kind: Kind::Adversarial { alpha },
        }
    }

    /// - `loss`: `[1]`
    /// - `distances`: between all sweeps of the batch, `[sweeps, sweeps]`
    pub(crate) fn pairs(loss: Tensor<1>, distances: Tensor<2>, labels: &[usize]) -> Self {
        Self {
            values: Tensor::cat(vec![loss, distances.flatten(0, 1)], 0),
            kind: Kind::Pairs {
                labels: labels.to_vec(),
            },
        }
    }

    /// Reads the values, which waits for the device.
    pub fn read(self) -> Figures {
        Self::read_all(vec![self])[0]
    }

    /// Reads several batches at once.
    pub(crate) fn read_all(several: Vec<Self>) -> Vec<Figures> {
        if several.is_empty() {
            return Vec::new();
        }
        let (tensors, parts): (Vec<_>, Vec<_>) = several
            .into_iter()
            .map(|one| {
                let len = one.values.dims()[0];
                (one.values, (one.kind, len))
            })
            .unzip();
        let read = values(Tensor::cat(tensors, 0));
        let mut rest = &read[..];
        let mut figures = Vec::with_capacity(parts.len());
        for (kind, len) in parts {
            let (own, others) = rest.split_at(len);
            figures.push(kind.figures(own));
            rest = others;
        }
        figures
    }
}

impl Kind {
    fn figures(&self, values: &[f32]) -> Figures {
        let loss = f64::from(values[0]);
        match self {
            Self::Clean => Figures {
                loss,
                correct: values[1] as usize,
                adversarial_correct: None,
            },
            Self::Adversarial { alpha } => Figures {
                loss: alpha * loss + (1.0 - alpha) * f64::from(values[2]),
                correct: values[1] as usize,
                adversarial_correct: Some(values[3] as usize),
            },
            Self::Pairs { labels } => Figures {
                loss,
                correct: near_their_own(&values[1..], labels),
                adversarial_correct: None,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};

    use super::*;

    #[test]
    fn batches_of_all_kinds_are_read_together() {
        let device = Device::flex();
        let tensor = |values: &[f32]| {
            Tensor::<1>::from_data(TensorData::new(values.to_vec(), [values.len()]), &device)
        };
        let distances = tensor(&[0.0, 1.0, 2.0, 1.0, 0.0, 3.0, 2.0, 3.0, 0.0]).reshape([3, 3]);
        let found = Measured::read_all(vec![
            Measured::clean(tensor(&[0.5, 7.0])),
            Measured::adversarial([tensor(&[1.0, 6.0]), tensor(&[3.0, 2.0])], 0.25),
            Measured::pairs(tensor(&[4.0]), distances, &[0, 0, 1]),
        ]);
        let expected = [(0.5, 7, None), (2.5, 6, Some(2)), (4.0, 2, None)];
        for (found, (loss, correct, adversarial_correct)) in found.iter().zip(expected) {
            let expected = Figures {
                loss,
                correct,
                adversarial_correct,
            };
            assert_eq!(*found, expected);
        }
        assert!(Measured::read_all(Vec::new()).is_empty());
    }
}
