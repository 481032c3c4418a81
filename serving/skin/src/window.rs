//! The window of a sweep that is classified: the middle of the motion, frame by frame.

use crate::Frame;

/// Which part of a motion is kept, and how many lost frames are forgiven.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WindowConfig {
    /// Taxels in a frame.
    pub taxels: usize,
    /// Frames skipped after the motion starts. At 750 Hz the middle 1000 of 1500 frames begin after 250
    /// (thesis, section 4.3.2).
    pub skip: usize,
    /// Frames kept.
    pub steps: usize,
    /// Lost frames in a row that are filled in by linear interpolation; more make the sweep useless.
    pub longest_gap: usize,
}

/// The effect of a frame on the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Push {
    /// Taken; the window is not full yet.
    Taken,
    /// Taken; the window is full and can be read.
    Complete,
    /// The window was full already, or the sweep is lost.
    Ignored,
}

/// Why a sweep cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum WindowError {
    /// Too many frames lost in a row.
    #[error(
        "{lost} frames lost in a row before frame {sequence}, at most {allowed} can be filled in"
    )]
    Gap {
        /// Frames lost.
        lost: u64,
        /// The frame that came after them.
        sequence: u64,
        /// Most frames that are forgiven.
        allowed: usize,
    },
    /// A frame came twice, or an older one came late.
    #[error("frame {sequence} came after frame {last}")]
    Order {
        /// The frame that came.
        sequence: u64,
        /// The frame before it.
        last: u64,
    },
    /// A frame of another sensor.
    #[error("a frame of {found} taxels, expected {expected}")]
    Taxels {
        /// Taxels of the frame.
        found: usize,
        /// Taxels of the window.
        expected: usize,
    },
    /// A value that is no number.
    #[error("frame {sequence}: taxel {taxel} is not finite")]
    NotFinite {
        /// The frame.
        sequence: u64,
        /// The taxel.
        taxel: usize,
    },
}

/// Collects the frames of one sweep. After an error the sweep is lost: [`SweepWindow::restart`] before the next one.
#[derive(Debug, Clone)]
pub struct SweepWindow {
    config: WindowConfig,
    /// `[steps][taxels]`
    values: Vec<f32>,
    /// `[taxels]`, the newest frame, from which gaps are interpolated
    newest: Vec<f32>,
    last: Option<u64>,
    seen: usize,
    filled_in: usize,
    spoiled: bool,
}

impl SweepWindow {
    /// Allocates everything it will ever need.
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

    /// Forgets the sweep; the next frame is the first of a new motion.
    pub fn restart(&mut self) {
        self.last = None;
        self.seen = 0;
        self.filled_in = 0;
        self.spoiled = false;
    }

    /// Forgets the sweep, but not the frame before: the next frame must follow it, or be near enough.
    pub fn restart_here(&mut self) {
        let last = self.last;
        self.restart();
        self.last = last;
    }

    /// Notes a frame between sweeps, from which the next one is counted.
    pub fn see(&mut self, frame: &Frame<'_>) {
        if frame.taxels.len() == self.newest.len() && frame.taxels.iter().all(|v| v.is_finite()) {
            self.newest.copy_from_slice(frame.taxels);
        }
        self.last = Some(frame.sequence);
    }

    /// Takes the next frame of the motion; after an error every frame is ignored until [`SweepWindow::restart`].
    ///
    /// # Errors
    /// Says why the sweep cannot be used any more.
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

    /// `[steps][taxels]` digits once the window is full.
    pub fn sweep(&self) -> Option<&[f32]> {
        self.is_complete().then_some(self.values.as_slice())
    }

    /// Frames of the window so far, interpolated ones included.
    pub fn kept(&self) -> usize {
        let WindowConfig { skip, steps, .. } = self.config;
        self.seen.saturating_sub(skip).min(steps)
    }

    /// `[taxels]` digits of a frame of the window.
    ///
    /// # Panics
    /// If it has not come yet ([`SweepWindow::kept`]).
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

    /// Frames of the window that were interpolated.
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
