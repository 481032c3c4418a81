//! How steps are cut into windows, and the Fourier matrices of a window.

use std::f64::consts::TAU;

use tactnet_conv::BlockShape;

/// Steps that one window holds at most; longer sweeps are cut.
const LONGEST: usize = 160;
/// New steps of each window where sweeps are cut, about.
const RANGE: usize = 112;

/// Windows over the steps of a sweep.
///
/// A sweep that fits is one window with zeros behind, as many as a kernel reaches back: what comes around in a circular convolution falls on
/// them. A longer one is cut into ranges; a window holds a range and what the kernel reaches on either side (overlap-save; backward,
/// overlap-add).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Windows {
    /// Ranges of a sweep.
    pub(crate) ranges: usize,
    /// Steps of a range; the last may hold fewer.
    pub(crate) range: usize,
    /// Steps of a window in front of its range.
    pub(crate) offset: usize,
    /// Steps of a window.
    pub(crate) window: usize,
    /// Frequencies of a window.
    pub(crate) bins: usize,
    /// Ranges on either side that share a step with a window.
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

    /// Cosine and sine of `frequency` at `step`, which may be negative.
    fn turn(&self, frequency: usize, step: isize) -> [f64; 2] {
        let step = step.rem_euclid(self.window as isize) as usize;
        // Of whole turns only the rest counts: exact in integers.
        let angle = TAU * ((frequency * step) % self.window) as f64 / self.window as f64;
        [angle.cos(), angle.sin()]
    }

    /// A spectrum's parts from steps: `[2 bins][steps.len()]`, `sign` of the sine.
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

    /// What part `row % 2` of frequency `row / 2` adds to a step.
    fn share(&self, row: usize, step: isize) -> f32 {
        let frequency = row / 2;
        // All others stand for their conjugate, too.
        let alone = frequency == 0 || 2 * frequency == self.window;
        let weight = if alone { 1.0 } else { 2.0 } / self.window as f64;
        let [cosine, sine] = self.turn(frequency, step);
        (weight * if row.is_multiple_of(2) { cosine } else { -sine }) as f32
    }

    /// `[2 bins][window]`
    pub(crate) fn forward(&self) -> Vec<f32> {
        let steps: Vec<isize> = (0..self.window as isize).collect();
        self.spectrum(&steps, -1.0)
    }

    /// The step of a window at which a kernel's tap reads for the range's first step.
    fn tap(&self, tap: usize, taps: usize) -> isize {
        tap as isize - (taps / 2) as isize + self.offset as isize
    }

    /// Conjugated spectra of the kernel: `[2 bins][taps]`.
    pub(crate) fn of_taps(&self, taps: usize) -> Vec<f32> {
        let steps: Vec<isize> = (0..taps).map(|tap| self.tap(tap, taps)).collect();
        self.spectrum(&steps, 1.0)
    }

    /// Back to the steps of a range: `[range][2 bins]`.
    pub(crate) fn backward(&self) -> Vec<f32> {
        (0..self.range as isize)
            .flat_map(|step| (0..2 * self.bins).map(move |row| self.share(row, step)))
            .collect()
    }

    /// Back to the steps of a range from all windows that hold them: `[range][(neighbour, bin, part)]`.
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

    /// Back to the taps of a kernel: `[taps][2 bins]`.
    pub(crate) fn for_taps(&self, taps: usize) -> Vec<f32> {
        (0..taps)
            .map(|tap| self.tap(tap, taps))
            .flat_map(|step| (0..2 * self.bins).map(move |row| self.share(row, step)))
            .collect()
    }
}
