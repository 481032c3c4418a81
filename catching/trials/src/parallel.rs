//! Work on several cores.

use rayon::prelude::*;

use crate::error::TrialError;

/// Returns the results of `work` for all numbers, computed on all cores.
pub(crate) fn on_all_cores<N: Send, T: Send>(
    numbers: impl IntoParallelIterator<Item = N>,
    work: impl Fn(N) -> Result<T, TrialError> + Sync + Send,
) -> Result<Vec<T>, TrialError> {
    numbers.into_par_iter().map(work).collect()
}

#[cfg(test)]
pub(crate) fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("threads start").install(work)
}
