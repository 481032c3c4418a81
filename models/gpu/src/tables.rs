//! Division of steps into windows, and the Fourier matrices of a window.

use std::f64::consts::TAU;

use tactnet_conv::BlockShape;

/// Maximum number of steps in a window; longer sweeps are divided.
const LONGEST: usize = 160;
/// Approximate number of new steps per window in a divided sweep.
const RANGE: usize = 112;

/// Windows over the steps of a sweep.
///
/// A sweep that fits is one window, followed by as many zeros as a kernel reaches back, so that the circular convolution wraps around to
/// zeros. A longer sweep is divided into ranges; a window holds a range and the steps that the kernel reads on either side (overlap-save;
/// overlap-add in the backward pass).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Windows {
    /// Number of ranges in a sweep.
    pub(crate) ranges: usize,
    /// Number of steps in a range; the last may hold fewer.
    pub(crate) range: usize,
    /// Number of steps of a window before its range.
    pub(crate) offset: usize,
    /// Number of steps in a window.
    pub(crate) window: usize,
    /// Number of frequencies of a window.
    pub(crate) bins: usize,
    /// Number of ranges on either side that share a step with a window.
    pub(crate) neighbours: usize,
}

impl Windows {
    pub(crate) fn of(shape: &BlockShape) -> Self {
        let reach = shape.kernel[0] / 2;
        let (range, offset) = if shape.steps + reach <= LONGEST {
            (shape.steps, 0)
        } else {
            let longest = RANGE.max(reach);
            let ranges = shape.steps.div_ceil(longest);
            (shape.steps.div_ceil(ranges).max(reach), reach)
        };
        let window = range + reach + offset;
        Self {
            ranges: shape.steps.div_ceil(range),
            range,
            offset,
            window,
            bins: window / 2 + 1,
            neighbours: usize::from(offset > 0),
        }
    }

    /// Returns cosine and sine of `frequency` at `step`, which may be negative.
    fn turn(&self, frequency: usize, step: isize) -> [f64; 2] {
        let step = step.rem_euclid(self.window as isize) as usize;
        // Whole turns are removed exactly, in integers.
        let angle = TAU * ((frequency * step) % self.window) as f64 / self.window as f64;
        [angle.cos(), angle.sin()]
    }

    /// Returns the matrix from steps to the parts of a spectrum, `[2 bins][steps.len()]`; `sign` multiplies the sine.
    fn spectrum(&self, steps: &[isize], sign: f64) -> Vec<f32> {
        (0..2 * self.bins)
            .flat_map(|row| {
                steps.iter().map(move |&step| {
                    let [cosine, sine] = self.turn(row / 2, step);
                    (if row.is_multiple_of(2) {
                        cosine
                    } else {
                        sign * sine
                    }) as f32
                })
            })
            .collect()
    }

    /// Returns the contribution of part `row % 2` of frequency `row / 2` to a step.
    fn share(&self, row: usize, step: isize) -> f32 {
        let frequency = row / 2;
        // All other frequencies also represent their conjugates.
        let alone = frequency == 0 || 2 * frequency == self.window;
        let weight = if alone { 1.0 } else { 2.0 } / self.window as f64;
        let [cosine, sine] = self.turn(frequency, step);
        (weight * if row.is_multiple_of(2) { cosine } else { -sine }) as f32
    }

    /// Returns the transform of a window, `[2 bins][window]`.
    pub(crate) fn forward(&self) -> Vec<f32> {
        let steps: Vec<isize> = (0..self.window as isize).collect();
        self.spectrum(&steps, -1.0)
    }

    /// Returns the step of a window that a kernel's tap reads for the range's first step.
    fn tap(&self, tap: usize, taps: usize) -> isize {
        tap as isize - (taps / 2) as isize + self.offset as isize
    }

    /// Returns the transform of a kernel to conjugated spectra, `[2 bins][taps]`.
    pub(crate) fn of_taps(&self, taps: usize) -> Vec<f32> {
        let steps: Vec<isize> = (0..taps).map(|tap| self.tap(tap, taps)).collect();
        self.spectrum(&steps, 1.0)
    }

    /// Returns the inverse transform to the steps of a range, `[range][2 bins]`.
    pub(crate) fn backward(&self) -> Vec<f32> {
        (0..self.range as isize)
            .flat_map(|step| (0..2 * self.bins).map(move |row| self.share(row, step)))
            .collect()
    }

    /// Returns the inverse transform to the steps of a range from all windows that hold them, `[range][(neighbour, bin, part)]`.
    pub(crate) fn overlapped(&self) -> Vec<f32> {
        let around = self.neighbours as isize;
        let mut all = Vec::new();
        for step in 0..self.range as isize {
            for neighbour in -around..=around {
                let at = step + self.offset as isize - neighbour * self.range as isize;
                let inside = (0..self.window as isize).contains(&at);
                all.extend((0..2 * self.bins).map(
                    |row| {
                        if inside { self.share(row, at) } else { 0.0 }
                    },
                ));
            }
        }
        all
    }

    /// Returns the inverse transform to the taps of a kernel, `[taps][2 bins]`.
    pub(crate) fn for_taps(&self, taps: usize) -> Vec<f32> {
        (0..taps)
            .map(|tap| self.tap(tap, taps))
            .flat_map(|step| (0..2 * self.bins).map(move |row| self.share(row, step)))
            .collect()
    }
}
