//! The window of a sweep that is classified: the middle of the motion, collected frame by frame.

use crate::Frame;

/// Part of a motion that is kept, and the number of lost frames that are interpolated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WindowConfig {
    /// Number of taxels in a frame.
    pub taxels: usize,
    /// Number of frames skipped after the motion starts. At 750 Hz the middle 1000 of 1500 frames start after 250
    /// (thesis, section 4.3.2).
    pub skip: usize,
    /// Number of frames kept.
    pub steps: usize,
    /// Maximum number of consecutive lost frames that linear interpolation fills in; a longer gap spoils the sweep.
    pub longest_gap: usize,
}

/// The effect of a frame on the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Push {
    /// Accepted; the window is not full yet.
    Taken,
    /// Accepted; the window is full and can be read.
    Complete,
    /// Ignored, because the window was already full or the sweep is spoiled.
    Ignored,
}

/// Reason why a frame spoils the sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum WindowError {
    /// Too many consecutive frames were lost.
    #[error(
        "{lost} frames lost in a row before frame {sequence}, at most {allowed} can be interpolated"
    )]
    Gap {
        /// Number of lost frames.
        lost: u64,
        /// Sequence number of the frame after the gap.
        sequence: u64,
        /// Maximum number of consecutive lost frames.
        allowed: usize,
    },
    /// A frame arrived twice, or an older frame arrived late.
    #[error("frame {sequence} came after frame {last}")]
    Order {
        /// Sequence number of the frame.
        sequence: u64,
        /// Sequence number of the frame before it.
        last: u64,
    },
    /// The frame has another number of taxels.
    #[error("a frame of {found} taxels, expected {expected}")]
    Taxels {
        /// Number of taxels in the frame.
        found: usize,
        /// Number of taxels in the window.
        expected: usize,
    },
    /// A taxel value is not finite.
    #[error("frame {sequence}: taxel {taxel} is not finite")]
    NotFinite {
        /// Sequence number of the frame.
        sequence: u64,
        /// Index of the taxel.
        taxel: usize,
    },
}

/// Collects the frames of one sweep. After an error the sweep is spoiled, and the next one starts with
/// [`SweepWindow::restart`].
///
/// # Example
/// ```
/// use tactnet_skin::{Frame, Push, SweepWindow, WindowConfig};
///
/// let config = WindowConfig { taxels: 1, skip: 1, steps: 3, longest_gap: 1 };
/// let mut window = SweepWindow::new(config);
/// let mut push = |sequence: u64| {
///     let taxels = [10.0 * sequence as f32];
///     window.push(&Frame { sequence, sensor_time_nanos: 0, taxels: &taxels })
/// };
/// assert_eq!(push(0), Ok(Push::Taken)); // skipped
/// assert_eq!(push(1), Ok(Push::Taken));
/// // Frame 2 is lost and interpolated.
/// assert_eq!(push(3), Ok(Push::Complete));
/// assert_eq!(window.sweep().unwrap(), [10.0, 20.0, 30.0]);
/// assert_eq!(window.filled_in(), 1);
/// assert_eq!(window.row(2), [30.0]);
/// window.restart();
/// assert_eq!(window.kept(), 0);
/// ```
#[derive(Debug, Clone)]
pub struct SweepWindow {
    config: WindowConfig,
    /// `[steps][taxels]`, in digits.
    values: Vec<f32>,
    /// `[taxels]`: the newest frame, the starting point of interpolation.
    newest: Vec<f32>,
    last: Option<u64>,
    seen: usize,
    filled_in: usize,
    spoiled: bool,
}

impl SweepWindow {
    /// Creates an empty window and allocates all of its memory.
    pub fn new(config: WindowConfig) -> Self {
        Self {
            values: vec![0.0; config.steps * config.taxels],
            newest: vec![0.0; config.taxels],
            last: None,
            seen: 0,
            filled_in: 0,
            spoiled: false,
            config,
        }
    }

    /// Discards the sweep; the next frame is the first of a new motion.
    pub fn restart(&mut self) {
        self.last = None;
        self.seen = 0;
        self.filled_in = 0;
        self.spoiled = false;
    }

    /// Discards the sweep but keeps the newest frame, so that frames lost before the next one are detected.
    pub fn restart_here(&mut self) {
        let last = self.last;
        self.restart();
        self.last = last;
    }

    /// Records a frame between sweeps, so that frames lost before the next sweep are detected.
    pub fn see(&mut self, frame: &Frame<'_>) {
        if frame.taxels.len() == self.newest.len() && frame.taxels.iter().all(|v| v.is_finite()) {
            self.newest.copy_from_slice(frame.taxels);
        }
        self.last = Some(frame.sequence);
    }

    /// Adds the next frame of the motion. After an error every frame is ignored until [`SweepWindow::restart`].
    ///
    /// # Errors
    /// Returns the reason why the frame spoils the sweep.
    pub fn push(&mut self, frame: &Frame<'_>) -> Result<Push, WindowError> {
        if self.spoiled {
            return Ok(Push::Ignored);
        }
        let outcome = self.take(frame);
        self.spoiled = outcome.is_err();
        outcome
    }

    fn take(&mut self, frame: &Frame<'_>) -> Result<Push, WindowError> {
        let WindowConfig {
            taxels,
            longest_gap,
            ..
        } = self.config;
        if frame.taxels.len() != taxels {
            return Err(WindowError::Taxels {
                found: frame.taxels.len(),
                expected: taxels,
            });
        }
        if let Some(taxel) = frame.taxels.iter().position(|v| !v.is_finite()) {
            return Err(WindowError::NotFinite {
                sequence: frame.sequence,
                taxel,
            });
        }
        if self.is_complete() {
            return Ok(Push::Ignored);
        }
        if let Some(last) = self.last {
            if frame.sequence <= last {
                return Err(WindowError::Order {
                    sequence: frame.sequence,
                    last,
                });
            }
            let lost = frame.sequence - last - 1;
            if lost > longest_gap as u64 {
                return Err(WindowError::Gap {
                    lost,
                    sequence: frame.sequence,
                    allowed: longest_gap,
                });
            }
            for step in 1..=lost {
                let weight = step as f32 / (lost + 1) as f32;
                self.filled_in += usize::from(self.is_open());
                self.keep(|taxel, newest| newest + (frame.taxels[taxel] - newest) * weight);
            }
        }
        self.keep(|taxel, _| frame.taxels[taxel]);
        self.newest.copy_from_slice(frame.taxels);
        self.last = Some(frame.sequence);
        Ok(if self.is_complete() {
            Push::Complete
        } else {
            Push::Taken
        })
    }

    /// Returns true if the window is full.
    pub fn is_complete(&self) -> bool {
        !self.spoiled && self.seen >= self.config.skip + self.config.steps
    }

    /// Returns the window as `[steps][taxels]` digits once it is full.
    pub fn sweep(&self) -> Option<&[f32]> {
        self.is_complete().then_some(self.values.as_slice())
    }

    /// Returns the first `frames` frames of the window as `[frames][taxels]` digits; `None` before there are as many.
    pub fn first(&self, frames: usize) -> Option<&[f32]> {
        let values = frames * self.config.taxels;
        (!self.spoiled && self.kept() >= frames).then(|| &self.values[..values])
    }

    /// Returns the number of frames in the window so far, including interpolated ones.
    pub fn kept(&self) -> usize {
        let WindowConfig { skip, steps, .. } = self.config;
        self.seen.saturating_sub(skip).min(steps)
    }

    /// Returns frame `number` of the window as `[taxels]` digits.
    ///
    /// # Panics
    /// Panics if `number` is not below [`SweepWindow::kept`].
    pub fn row(&self, number: usize) -> &[f32] {
        assert!(number < self.kept(), "frame {number} of the window");
        let taxels = self.config.taxels;
        &self.values[number * taxels..(number + 1) * taxels]
    }

    /// Returns true if the next frame belongs to the window.
    fn is_open(&self) -> bool {
        let WindowConfig { skip, steps, .. } = self.config;
        (skip..skip + steps).contains(&self.seen)
    }

    /// Returns the number of interpolated frames in the window.
    pub fn filled_in(&self) -> usize {
        self.filled_in
    }

    fn keep(&mut self, value: impl Fn(usize, f32) -> f32) {
        let WindowConfig { taxels, skip, .. } = self.config;
        if self.is_open() {
            let row = (self.seen - skip) * taxels;
            for taxel in 0..taxels {
                self.values[row + taxel] = value(taxel, self.newest[taxel]);
            }
        }
        self.seen += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CONFIG: WindowConfig = WindowConfig {
        taxels: 2,
        skip: 3,
        steps: 5,
        longest_gap: 2,
    };

    fn push(window: &mut SweepWindow, sequence: u64) -> Result<Push, WindowError> {
        let taxels = [sequence as f32, -(sequence as f32)];
        window.push(&Frame {
            sequence,
            sensor_time_nanos: 0,
            taxels: &taxels,
        })
    }

    #[test]
    fn the_middle_of_the_motion_is_kept() {
        let mut window = SweepWindow::new(CONFIG);
        for sequence in 100..107 {
            assert_eq!(push(&mut window, sequence), Ok(Push::Taken));
            assert!(window.sweep().is_none());
        }
        assert_eq!(push(&mut window, 107), Ok(Push::Complete));
        assert_eq!(push(&mut window, 108), Ok(Push::Ignored));
        let sweep = window.sweep().unwrap();
        assert_eq!(sweep[..4], [103.0, -103.0, 104.0, -104.0]);
        assert_eq!(sweep[8..], [107.0, -107.0]);
        window.restart();
        assert!(window.sweep().is_none());
    }

    #[test]
    fn long_gaps_repeats_and_foreign_frames_are_refused_with_a_reason() {
        let reason = |sequence: u64, taxels: &[f32]| {
            let mut window = SweepWindow::new(CONFIG);
            push(&mut window, 5).unwrap();
            let frame = Frame {
                sequence,
                sensor_time_nanos: 0,
                taxels,
            };
            let error = window.push(&frame).unwrap_err();
            for sequence in 20..40 {
                assert_eq!(push(&mut window, sequence), Ok(Push::Ignored));
            }
            assert!(window.sweep().is_none(), "a spoiled sweep never completes");
            window.restart();
            assert_eq!(push(&mut window, 41), Ok(Push::Taken));
            error
        };
        let good = [0.0, 0.0];
        let gap = WindowError::Gap {
            lost: 3,
            sequence: 9,
            allowed: 2,
        };
        assert_eq!(reason(9, &good), gap);
        assert_eq!(
            reason(5, &good),
            WindowError::Order {
                sequence: 5,
                last: 5
            }
        );
        let nan = WindowError::NotFinite {
            sequence: 6,
            taxel: 1,
        };
        assert_eq!(reason(6, &[0.0, f32::NAN]), nan);
        let short = WindowError::Taxels {
            found: 1,
            expected: 2,
        };
        assert_eq!(reason(6, &[0.0]), short);
    }

    proptest! {
        #[test]
        fn short_gaps_in_a_straight_line_change_nothing(lost in proptest::collection::btree_set(1_u64..30, 0..12)) {
            let mut window = SweepWindow::new(WindowConfig { longest_gap: 12, steps: 25, ..CONFIG });
            let mut whole = window.clone();
            for sequence in 0..31 {
                prop_assert!(push(&mut whole, sequence).is_ok());
                if !lost.contains(&sequence) {
                    prop_assert!(push(&mut window, sequence).is_ok());
                }
            }
            for (a, b) in window.sweep().unwrap().iter().zip(whole.sweep().unwrap()) {
                prop_assert!((a - b).abs() < 1e-4);
            }
        }
    }
}
