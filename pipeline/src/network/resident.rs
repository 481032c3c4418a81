//! Training sweeps in GPU memory for a whole training. Digits of 8 and 16 bits are packed into words; batches are gathered and normalised on
//! the device.

use burn::tensor::{Device, Int, Tensor, TensorData};
use tactnet_data::{Samples, SweepView};

use crate::Normalizer;

/// Maximum size in bytes of resident sweeps: the minimum size limit of a storage buffer that WebGPU guarantees.
pub(crate) const MOST_BYTES: usize = 128 << 20;
/// Number of bits in a word.
const WORD: usize = 32;

/// Sweeps in the memory of a device.
pub(crate) struct ResidentSweeps {
    kept: Kept,
    /// Values of a sweep, `[1, steps, taxels]`.
    extents: [usize; 3],
}

enum Kept {
    Packed(Box<Packed>),
    /// Normalised values, `[sweeps, values]`.
    Normalized(Box<Tensor<2>>),
}

/// Digits as recorded, packed into words.
struct Packed {
    /// `[sweeps, words]`, with the first value of a word in its lowest bits.
    words: Tensor<2, Int>,
    bits: usize,
    /// `[1, 1, 1, taxels]`
    offset: Tensor<4>,
    gain: Tensor<4>,
}

impl ResidentSweeps {
    /// Copies sweeps to `device`; returns `None` if they are too large.
    pub(crate) fn new(
        sweeps: &SweepView<'_>,
        normalizer: &Normalizer,
        device: &Device,
    ) -> Option<Self> {
        let shape = sweeps.shape();
        let kept = match sweeps.dataset().samples() {
            Samples::U8(digits) if !normalizer.needs_whole_sweep() => {
                Kept::packed(sweeps, digits, normalizer, device)
            }
            Samples::U16(digits) if !normalizer.needs_whole_sweep() => {
                Kept::packed(sweeps, digits, normalizer, device)
            }
            _ => Kept::normalized(sweeps, normalizer, device),
        };
        Some(Self {
            kept: kept?,
            extents: [1, shape.steps, shape.taxels()],
        })
    }

    /// Returns the normalised sweeps at `positions`, `[batch, 1, steps, taxels]`.
    pub(crate) fn batch(&self, positions: &[usize]) -> Tensor<4> {
        let [_, steps, taxels] = self.extents;
        let (batch, values) = (positions.len(), steps * taxels);
        match &self.kept {
            Kept::Normalized(sweeps) => sweeps
                .as_ref()
                .clone()
                .select(0, numbers(positions, &sweeps.device()))
                .reshape([batch, 1, steps, taxels]),
            Kept::Packed(packed) => {
                let digits = packed.digits(positions).slice([0..batch, 0..values]);
                let digits = digits.reshape([batch, 1, steps, taxels]);
                (digits - packed.offset.clone()) * packed.gain.clone()
            }
        }
    }
}

impl Packed {
    /// Returns the digits of the sweeps at `positions`, including padding in their last words: `[batch, values of the words]`.
    fn digits(&self, positions: &[usize]) -> Tensor<2> {
        let numbers = numbers(positions, &self.words.device());
        let words = self.words.clone().select(0, numbers);
        let mask = (1_i64 << self.bits) - 1;
        let parts = (0..WORD / self.bits).map(|part| {
            let shifted = match part {
                0 => words.clone(),
                part => words
                    .clone()
                    .bitwise_right_shift_scalar((part * self.bits) as i64),
            };
            shifted
                .bitwise_and_scalar(mask)
                .float()
                .unsqueeze_dim::<3>(2)
        });
        Tensor::cat(parts.collect(), 2).flatten::<2>(1, 2)
    }
}

impl Kept {
    fn packed<T: Copy + Into<u32>>(
        sweeps: &SweepView<'_>,
        digits: &[T],
        normalizer: &Normalizer,
        device: &Device,
    ) -> Option<Self> {
        let (bits, values) = (8 * size_of::<T>(), sweeps.shape().values());
        let width = values.div_ceil(WORD / bits);
        if sweeps.len() * width * size_of::<u32>() > MOST_BYTES {
            return None;
        }
        let mut words = Vec::with_capacity(sweeps.len() * width);
        for &index in sweeps.indices() {
            let sweep = &digits[index * values..][..values];
            words.extend(packed(sweep).map(u32::cast_signed));
        }
        let row = |values: &[f32]| {
            Tensor::from_data(
                TensorData::new(values.to_vec(), [1, 1, 1, values.len()]),
                device,
            )
        };
        Some(Self::Packed(Box::new(Packed {
            words: Tensor::from_data(TensorData::new(words, [sweeps.len(), width]), device),
            bits,
            offset: row(normalizer.offset()),
            gain: row(normalizer.gain()),
        })))
    }

    fn normalized(
        sweeps: &SweepView<'_>,
        normalizer: &Normalizer,
        device: &Device,
    ) -> Option<Self> {
        let (count, shape) = (sweeps.len(), sweeps.shape());
        if count * shape.values() * size_of::<f32>() > MOST_BYTES {
            return None;
        }
        let mut values = vec![0.0; count * shape.values()];
        let all: Vec<usize> = (0..count).collect();
        sweeps.copy_batch(&all, &mut values);
        normalizer.apply(&mut values, shape);
        let extents = [count, shape.values()];
        let values = TensorData::new(values, extents);
        Some(Self::Normalized(Box::new(Tensor::from_data(
            values, device,
        ))))
    }
}

/// Packs digits into words, the first into the lowest bits.
pub(crate) fn packed<T: Copy + Into<u32>>(digits: &[T]) -> impl Iterator<Item = u32> {
    let bits = 8 * size_of::<T>();
    digits.chunks(WORD / bits).map(move |chunk| {
        let parts = chunk.iter().enumerate();
        parts.fold(0, |word, (part, digit)| {
            word | (*digit).into() << (part * bits)
        })
    })
}

fn numbers(positions: &[usize], device: &Device) -> Tensor<1, Int> {
    let numbers: Vec<i32> = positions.iter().map(|&position| position as i32).collect();
    let extent = [numbers.len()];
    Tensor::from_data(TensorData::new(numbers, extent), device)
}

#[cfg(test)]
mod tests {
    use tactnet_data::twin;
    use tactnet_data::{Dataset, Fold, Scheme, Seed};
    use tactnet_models::{Compute, values};

    use super::*;
    use crate::{MeanRemoval, Scaling};

    /// Returns three materials with ten sweeps of 7 steps and 3 taxels, whose values do not fill the last word.
    fn sweeps(samples: impl Fn(Vec<f32>) -> Samples) -> Dataset {
        let twin = twin::small(3, 10, 60).unwrap();
        let shape = tactnet_data::SweepShape {
            steps: 7,
            rows: 1,
            cols: 3,
        };
        let digits = (0..twin.len() * shape.values()).map(|i| ((i * 7919) % 256) as f32);
        Dataset::new(
            "some",
            750.0,
            shape,
            twin.labels().clone(),
            twin.records().to_vec(),
            samples(digits.collect()),
        )
        .unwrap()
    }

    fn check(dataset: &Dataset, levels: MeanRemoval, device: &Device) {
        let fold = Fold::new(dataset, Scheme::default(), Seed(1), 0, 0).unwrap();
        let normalizer = Normalizer::fit(Scaling::PerTaxel, levels, &fold.train);
        let resident = ResidentSweeps::new(&fold.train, &normalizer, device).unwrap();
        let positions = [5, 0, 23, 5];
        let mut expected = vec![0.0; positions.len() * dataset.shape().values()];
        fold.train.copy_batch(&positions, &mut expected);
        normalizer.apply(&mut expected, dataset.shape());
        assert_eq!(resident.batch(&positions).dims(), [4, 1, 7, 3]);
        assert_eq!(values(resident.batch(&positions)), expected);
    }

    fn check_all_on(device: &Device) {
        let u8s = |digits: Vec<f32>| Samples::U8(digits.iter().map(|d| *d as u8).collect());
        let u16s =
            |digits: Vec<f32>| Samples::U16(digits.iter().map(|d| *d as u16 * 257).collect());
        let thirds = |digits: Vec<f32>| Samples::F32(digits.iter().map(|d| d / 3.0).collect());
        for dataset in [sweeps(u8s), sweeps(u16s), sweeps(thirds)] {
            for levels in [MeanRemoval::None, MeanRemoval::PerSweep] {
                check(&dataset, levels, device);
            }
        }
    }

    #[test]
    fn batches_are_those_that_the_processor_makes() {
        check_all_on(&Compute::Cpu.open().unwrap());
    }

    #[test]
    #[cfg(feature = "vulkan")]
    fn batches_are_those_that_the_processor_makes_on_a_vulkan_device_too() {
        check_all_on(&Compute::Vulkan.open().unwrap());
    }
}
