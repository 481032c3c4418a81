//! Parts of pages.

pub(crate) use tactnet_plot::report::{
    LEFT, Share, at_most, axes, captioned, chart, legend, percent, report_page, shares,
};

#[cfg(test)]
pub(crate) mod tests {
    pub(crate) use tactnet_plot::report::assert_page;

    /// Returns the result of `work` on a number of threads.
    pub(crate) fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads start").install(work)
    }
}
