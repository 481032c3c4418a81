//! Segmentation of the frame stream into sweeps, with the checks that reject unusable sweeps.
//!
//! Pure logic: a [`SweepSegmenter`] takes the frames and commands of one finger and returns their effect. Every fault
//! of the sensor or the motion controller ends in a [`Reject`] with its reason. A rejected sweep has no final belief,
//! although its first frames may have had beliefs.

mod config;
mod reject;
#[cfg(test)]
mod tests;

use crate::{Frame, Push, SweepWindow, WindowConfig};

use config::FrameCounts;
pub use config::{Contact, Segmentation, SegmenterConfig};
pub use reject::Reject;

/// Limits under which every finite value is in range and none counts as saturated.
const NO_LIMITS: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];

/// The effect of a frame or a command on the sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SweepChange {
    /// No effect.
    Unchanged,
    /// A sweep started.
    Begun,
    /// The window has new frames.
    Extended,
    /// The window is full, or the sweep ended early with enough frames, see [`SweepSegmenter::accept_from`].
    Complete,
    /// The sweep is rejected.
    Rejected(Reject),
    /// The sweep is rejected, and the next one started.
    RejectedAndBegun(Reject),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// No motion.
    Idle,
    /// The window is being filled.
    Sweeping,
    /// The window is full or spoiled, and the motion continues.
    Over,
}

/// Sequence number and sensor time of a frame.
#[derive(Debug, Clone, Copy)]
struct FrameTime {
    sequence: u64,
    sensor_time_nanos: u64,
}

impl FrameTime {
    fn of(frame: &Frame<'_>) -> Self {
        Self {
            sequence: frame.sequence,
            sensor_time_nanos: frame.sensor_time_nanos,
        }
    }
}

/// Recent values of one taxel within a sweep.
#[derive(Debug, Clone, Copy, Default)]
struct TaxelHealth {
    /// Newest value, in digits.
    digit: f32,
    /// Number of consecutive frames with this value.
    repeated: usize,
    /// Number of consecutive frames at the maximum value.
    saturated: usize,
}

/// Finds the sweeps in the frames of one finger.
///
/// # Example
/// ```
/// use tactnet_skin::{Frame, SegmenterConfig, SweepChange, SweepSegmenter};
///
/// let config = SegmenterConfig { skip: 0.into(), ..SegmenterConfig::default() };
/// // Windows of 2 frames, 1 taxel, 1000 Hz.
/// let mut segmenter = SweepSegmenter::new(config, 2, 1, 1000.0);
/// segmenter.set_values([0.0, 255.0]);
/// let mut push = |segmenter: &mut SweepSegmenter, sequence: u64| {
///     let taxels = [20.0 + sequence as f32];
///     let sensor_time_nanos = sequence * 1_000_000;
///     segmenter.push(&Frame { sequence, sensor_time_nanos, taxels: &taxels })
/// };
/// assert_eq!(segmenter.start(), SweepChange::Begun);
/// assert_eq!(push(&mut segmenter, 0), SweepChange::Extended);
/// assert!(segmenter.is_sweeping());
/// assert_eq!(push(&mut segmenter, 1), SweepChange::Complete);
/// assert_eq!(segmenter.window().sweep().unwrap(), [20.0, 21.0]);
/// assert_eq!(segmenter.stop(), SweepChange::Unchanged);
/// ```
#[derive(Debug, Clone)]
pub struct SweepSegmenter {
    config: SegmenterConfig,
    counts: FrameCounts,
    steps: usize,
    /// Number of window frames from which a sweep may end early; `steps` if it may not.
    least: usize,
    period_ns: f64,
    window: SweepWindow,
    state: State,
    /// The newest frame.
    newest: Option<FrameTime>,
    /// Reference frame for the clock drift over the sweep.
    first: Option<FrameTime>,
    /// Number of consecutive frames that indicate the other contact state.
    turning: usize,
    /// Minimum and maximum value of a taxel, in digits.
    limits: [f32; 2],
    /// `[taxels]`
    health: Vec<TaxelHealth>,
    /// `[taxels]`: true for dead taxels, whose values are not checked.
    dead: Vec<bool>,
    /// Number of window frames whose taxels have been checked.
    examined: usize,
}

impl SweepSegmenter {
    /// Creates an idle segmenter and allocates all of its memory.
    ///
    /// - `trained`: number of frames in the longest training sweep
    /// - `taxels`: number of taxels in a frame
    /// - `rate_hz`: frames per second
    pub fn new(config: SegmenterConfig, trained: usize, taxels: usize, rate_hz: f64) -> Self {
        let longest = config.longest.map_or(0, |span| span.frames(rate_hz));
        let steps = longest.max(trained);
        let counts = config.at_rate(steps, rate_hz);
        let window = SweepWindow::new(WindowConfig {
            taxels,
            skip: counts.skip,
            steps,
            longest_gap: counts.longest_gap,
        });
        Self {
            limits: config.values.unwrap_or(NO_LIMITS),
            config,
            counts,
            steps,
            least: trained,
            period_ns: 1e9 / rate_hz,
            window,
            state: State::Idle,
            newest: None,
            first: None,
            turning: 0,
            health: vec![TaxelHealth::default(); taxels],
            dead: vec![false; taxels],
            examined: 0,
        }
    }

    /// Sets the minimum and maximum value of a taxel, in digits, from the next frame on.
    pub fn set_values(&mut self, values: [f32; 2]) {
        self.limits = values;
    }

    /// Sets the dead taxels in place of those set before, from the next frame on. Their values neither reject a sweep, if they are finite, nor
    /// count as contact.
    pub fn set_dead(&mut self, dead: impl IntoIterator<Item = usize>) {
        self.dead.fill(false);
        dead.into_iter().for_each(|taxel| self.dead[taxel] = true);
    }

    /// Accepts sweeps that end early with at least `least` frames in the window, for a classifier that was trained on sweeps of unequal length.
    /// [`SweepWindow::kept`] is then their number of frames.
    pub fn accept_from(&mut self, least: usize) {
        self.least = least.clamp(1, self.steps);
    }

    /// Returns the window of the current or the last sweep.
    pub fn window(&self) -> &SweepWindow {
        &self.window
    }

    /// Returns true while a window is being filled.
    pub fn is_sweeping(&self) -> bool {
        self.state == State::Sweeping
    }

    /// Starts a sweep by command of the motion controller.
    pub fn start(&mut self) -> SweepChange {
        let before = self.state;
        let found = self.window.kept();
        self.begin();
        if before == State::Sweeping {
            return SweepChange::RejectedAndBegun(Reject::SecondStart {
                found,
                expected: self.least,
            });
        }
        SweepChange::Begun
    }

    /// Ends the motion by command of the motion controller.
    pub fn stop(&mut self) -> SweepChange {
        let before = self.state;
        self.state = State::Idle;
        if before == State::Sweeping && self.window.kept() >= self.least {
            return SweepChange::Complete;
        }
        if before == State::Sweeping {
            return SweepChange::Rejected(Reject::Short {
                found: self.window.kept(),
                expected: self.least,
            });
        }
        SweepChange::Unchanged
    }

    fn begin(&mut self) {
        // Frames lost just before the start count as lost.
        self.window.restart_here();
        self.state = State::Sweeping;
        self.first = self.newest;
        self.turning = 0;
        self.examined = 0;
        self.health.fill(TaxelHealth::default());
    }

    /// Processes the next frame of the finger.
    pub fn push(&mut self, frame: &Frame<'_>) -> SweepChange {
        let contact = match self.config.segmentation {
            Segmentation::Command => SweepChange::Unchanged,
            Segmentation::Contact(contact) => self.update_contact(contact, frame.taxels),
        };
        if contact != SweepChange::Unchanged || self.state != State::Sweeping {
            self.window.see(frame);
            self.newest = Some(FrameTime::of(frame));
            return contact;
        }
        let taken = self.take(frame);
        self.newest = Some(FrameTime::of(frame));
        match taken {
            Ok(Push::Taken) => SweepChange::Extended,
            Ok(Push::Complete) => {
                self.state = State::Over;
                SweepChange::Complete
            }
            Ok(Push::Ignored) => SweepChange::Unchanged,
            Err(reject) => {
                self.state = State::Over;
                SweepChange::Rejected(reject)
            }
        }
    }

    /// Starts or ends a sweep when contact starts or ends.
    fn update_contact(&mut self, contact: Contact, taxels: &[f32]) -> SweepChange {
        let alive = || taxels.iter().zip(&self.dead).filter(|(_, dead)| !**dead);
        let sum: f32 = alive().map(|(digit, _)| digit).sum();
        let mean = sum / alive().count().max(1) as f32;
        // A broken taxel must not hold the contact forever.
        let mean = if mean.is_finite() {
            mean
        } else {
            f32::NEG_INFINITY
        };
        let touching = self.state != State::Idle;
        let turns = match touching {
            true => mean < contact.ends,
            false => mean >= contact.begins,
        };
        self.turning = if turns { self.turning + 1 } else { 0 };
        if self.turning < self.counts.contact {
            return SweepChange::Unchanged;
        }
        self.turning = 0;
        if touching { self.stop() } else { self.start() }
    }

    fn take(&mut self, frame: &Frame<'_>) -> Result<Push, Reject> {
        let [least, greatest] = self.limits;
        let mut checked = frame.taxels.iter().zip(&self.dead);
        let off = checked.position(|(digit, dead)| !dead && (*digit < least || *digit > greatest));
        if let Some(taxel) = off {
            return Err(Reject::Range {
                sequence: frame.sequence,
                taxel,
                digit: frame.taxels[taxel],
                least,
                greatest,
            });
        }
        for (since, tolerance) in [
            (self.newest, self.config.clock_tolerance),
            (self.first, self.config.clock_drift),
        ] {
            self.check_clock(since, tolerance, frame)?;
        }
        let pushed = self.window.push(frame)?;
        if self.first.is_none() {
            self.first = Some(FrameTime::of(frame));
        }
        if self.window.filled_in() > self.counts.most_filled_in {
            return Err(Reject::Losses {
                found: self.window.filled_in(),
                allowed: self.counts.most_filled_in,
            });
        }
        for row in self.examined..self.window.kept() {
            let checked = self.health.iter_mut().zip(self.window.row(row));
            let checked = checked.enumerate().filter(|(taxel, _)| !self.dead[*taxel]);
            for (taxel, (health, digit)) in checked {
                health.examine(&self.counts, greatest, taxel, *digit)?;
            }
        }
        self.examined = self.window.kept();
        Ok(pushed)
    }
}

impl SweepSegmenter {
    /// Compares the sensor's clock with the frame numbers.
    ///
    /// - `since`: an earlier frame
    /// - `tolerance`: in frame periods
    fn check_clock(
        &self,
        since: Option<FrameTime>,
        tolerance: f64,
        frame: &Frame<'_>,
    ) -> Result<(), Reject> {
        let Some(since) = since else {
            return Ok(());
        };
        if frame.sequence <= since.sequence {
            // The window reports the wrong order.
            return Ok(());
        }
        let expected = (frame.sequence - since.sequence) as f64 * self.period_ns;
        let found = frame.sensor_time_nanos as f64 - since.sensor_time_nanos as f64;
        if (found - expected).abs() > tolerance * self.period_ns {
            return Err(Reject::Clock {
                sequence: frame.sequence,
                found_ns: found as i64,
                expected_ns: expected as i64,
            });
        }
        Ok(())
    }
}

impl TaxelHealth {
    /// Adds the next value of a taxel; rejects stalled and saturated taxels.
    ///
    /// - `greatest`: value of a saturated taxel, in digits
    /// - `taxel`: index of the taxel
    /// - `digit`: its value, in digits
    fn examine(
        &mut self,
        counts: &FrameCounts,
        greatest: f32,
        taxel: usize,
        digit: f32,
    ) -> Result<(), Reject> {
        self.repeated = if digit == self.digit && digit != 0.0 {
            self.repeated + 1
        } else {
            1
        };
        self.digit = digit;
        self.saturated = if digit >= greatest {
            self.saturated + 1
        } else {
            0
        };
        if self.saturated >= counts.saturated {
            return Err(Reject::Saturated {
                taxel,
                frames: self.saturated,
            });
        }
        if self.repeated >= counts.stalled {
            return Err(Reject::Stalled {
                taxel,
                digit,
                frames: self.repeated,
            });
        }
        Ok(())
    }
}
