//! Memory of large tensors that nobody holds any longer, for the results of later operations.
//!
//! A result goes to Burn and is freed when its graph has done with it. Allocated afresh it would be cleared, mostly page by page by the
//! system, only to be overwritten; in a training step that is a twentieth of the time, on one thread.

use burn::backend::Flex;
use burn::backend::tensor::FloatTensor;

use super::buffers::Buffers;

/// Values from which on memory is worth keeping.
const LEAST: usize = 1 << 14;

/// A training step has fewer results at once.
static SPARE: Buffers<Vec<f32>> = Buffers::at_most(16);

/// Memory for `len` values, with whatever was in it: of large tensors that nobody holds any longer. Sweeps for a network that lie in such
/// memory leave it for the next.
pub fn take(len: usize) -> Vec<f32> {
    if len < LEAST {
        vec![0.0; len]
    } else {
        SPARE.take(len)
    }
}

/// Memory that is not needed any more.
pub(crate) fn give(values: Vec<f32>) {
    if values.len() >= LEAST {
        SPARE.give(values);
    }
}

/// The memory of a tensor, unless somebody else holds it.
pub(crate) fn reclaim(tensor: FloatTensor<Flex>) {
    let large = tensor.layout().num_elements() >= LEAST;
    if large && tensor.is_unique() && tensor.is_contiguous() {
        tensor.into_data().try_into_vec().into_iter().for_each(give);
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;

    use super::*;

    // Sizes that no other test has.
    fn tensor(len: usize) -> FloatTensor<Flex> {
        FloatTensor::<Flex>::from_data(TensorData::new(vec![7f32; len], [len]))
    }

    #[test]
    fn memory_that_nobody_holds_is_taken_again() {
        let len = LEAST + 1234;
        // Other tests may push it out meanwhile, but not every time.
        let found = (0..100).any(|_| {
            let lost = tensor(len);
            reclaim(lost);
            let (again, other) = (take(len), take(len));
            // It is handed out once, as it was; fresh memory is zero.
            assert!(other.iter().all(|&value| value == 0.0));
            again.iter().all(|&value| value == 7.0)
        });
        assert!(found);
    }

    #[test]
    fn memory_that_somebody_holds_stays_theirs() {
        let len = LEAST + 4321;
        let held = tensor(len);
        reclaim(held.clone());
        let mut taken = take(len);
        taken.fill(1.0);
        assert!(held.storage::<f32>().iter().all(|&value| value == 7.0));
    }
}
