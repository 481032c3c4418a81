//! Sweeps that are longer than the training sweeps, frame by frame: the windows are those of the offline classifier.

use tactnet_models::StreamingNet;

use super::long_sweeps::hop;

/// The newest frames of a sweep, and sums over its complete windows.
#[derive(Debug)]
pub(super) struct LongSweep {
    /// Number of frames in a window, those of the longest training sweep.
    window: usize,
    taxels: usize,
    /// Ring of the newest `window` frames, `[window][taxels]`, normalised.
    newest: Vec<f32>,
    /// Number of frames so far.
    frames: usize,
    /// First frame of the window in the network.
    start: usize,
    /// Number of windows in the sums.
    pub(super) windows: usize,
    /// Sums of the plain scores, `[materials]`.
    pub(super) scores: Vec<f32>,
    /// Logarithms of the sums of the probabilities, `[materials]`: plain, and by dropout.
    pub(super) plain: Vec<f64>,
    pub(super) dropout: Vec<f64>,
    /// Sum of the mutual informations.
    pub(super) information: f64,
}

impl LongSweep {
    pub(super) fn new(window: usize, taxels: usize, materials: usize) -> Self {
        Self {
            window,
            taxels,
            newest: vec![0.0; window * taxels],
            frames: 0,
            start: 0,
            windows: 0,
            scores: vec![0.0; materials],
            plain: vec![f64::NEG_INFINITY; materials],
            dropout: vec![f64::NEG_INFINITY; materials],
            information: 0.0,
        }
    }

    pub(super) fn restart(&mut self) {
        self.frames = 0;
        self.start = 0;
        self.windows = 0;
        self.scores.fill(0.0);
        self.plain.fill(f64::NEG_INFINITY);
        self.dropout.fill(f64::NEG_INFINITY);
        self.information = 0.0;
    }

    /// Returns the number of frames so far.
    pub(super) fn frames(&self) -> usize {
        self.frames
    }

    /// Returns true if the newest frame ends a window that the next frame makes one of several.
    pub(super) fn ends_window(&self) -> bool {
        self.frames >= self.window && (self.frames - self.window).is_multiple_of(hop(self.window))
    }

    /// Adds a frame, and passes it to the network while the first window is open.
    pub(super) fn push(&mut self, net: &mut StreamingNet, frame: &[f32]) {
        let at = self.frames % self.window * self.taxels;
        self.newest[at..at + self.taxels].copy_from_slice(frame);
        if self.frames < self.window {
            net.push(frame);
        }
        self.frames += 1;
    }

    /// Passes the window that ends with the newest frame to the network.
    pub(super) fn load_newest(&mut self, net: &mut StreamingNet) {
        let start = self.frames.saturating_sub(self.window);
        if start == self.start {
            return;
        }
        net.restart();
        for frame in start..self.frames {
            let at = frame % self.window * self.taxels;
            net.push(&self.newest[at..at + self.taxels]);
        }
        self.start = start;
    }
}

/// Adds probabilities to sums, both as logarithms.
pub(super) fn add_log(sums: &mut [f64], log_probability: &[f64]) {
    for (sum, log_p) in sums.iter_mut().zip(log_probability) {
        let (large, small) = (sum.max(*log_p), sum.min(*log_p));
        if large > f64::NEG_INFINITY {
            *sum = large + (small - large).exp().ln_1p();
        }
    }
}

/// Replaces the probabilities of the newest window by the mean over it and the windows in the sums, all as logarithms.
pub(super) fn mean_log(sums: &[f64], windows: usize, log_probability: &mut [f64]) {
    if windows == 0 {
        return;
    }
    add_log(log_probability, sums);
    let count = ((windows + 1) as f64).ln();
    log_probability.iter_mut().for_each(|log_p| *log_p -= count);
}
