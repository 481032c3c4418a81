//! Where sweeps begin and end in the stream of frames, and which of them can be used.
//!
//! Pure logic: a [`SweepSegmenter`] takes the frames and commands of one finger and returns what they change. Every fault of the sensor or of the
//! motion controller ends in a [`Reject`] with its reason; a rejected sweep gives no final belief, whatever beliefs its beginning gave.

mod config;
mod reject;

use crate::Frame;

use crate::{Push, SweepWindow, WindowConfig};
pub use config::{Contact, Segmentation, SegmenterConfig};
pub use reject::Reject;

/// No value is out of range, and none is saturated.
const ANY: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];

/// The effect of a frame or a command on the sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SweepChange {
    /// None.
    Unchanged,
    /// A sweep began.
    Begun,
    /// The window has new rows.
    Extended,
    /// The window is whole.
    Complete,
    /// The sweep cannot be used.
    Rejected(Reject),
    /// The sweep cannot be used, and the next one began.
    RejectedAndBegun(Reject),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Idle,
    /// The window fills.
    Sweeping,
    /// The window is whole or spoiled; the motion goes on.
    Over,
}

/// Finds the sweeps in the frames of one finger.
#[derive(Debug, Clone)]
pub struct SweepSegmenter {
    config: SegmenterConfig,
    steps: usize,
    period_ns: f64,
    window: SweepWindow,
    state: State,
    /// Sequence and sensor time of the newest frame, and of the one that the sweep's clock is compared with.
    newest: Option<(u64, u64)>,
    first: Option<(u64, u64)>,
    /// Frames in a row that speak for the other state of contact.
    turning: usize,
    /// Least and greatest value of a taxel.
    limits: [f32; 2],
    /// `[taxels]`: digit, how often in a row, how often in a row at the greatest value
    health: Vec<(f32, usize, usize)>,
    /// Rows of the window whose health was looked at.
    examined: usize,
}

impl SweepSegmenter {
    /// Allocates everything it will ever need.
    ///
    /// - `steps`: frames of a window
    /// - `rate_hz`: frames per second
    pub fn new(mut config: SegmenterConfig, steps: usize, taxels: usize, rate_hz: f64) -> Self {
        config.saturated_frames = config.saturated_frames.min(steps);
        let window = SweepWindow::new(WindowConfig {
            taxels,
            skip: config.skip,
            steps,
            longest_gap: config.longest_gap,
        });
        Self {
            limits: config.values.unwrap_or(ANY),
            config,
            steps,
            period_ns: 1e9 / rate_hz,
            window,
            state: State::Idle,
            newest: None,
            first: None,
            turning: 0,
            health: vec![(0.0, 0, 0); taxels],
            examined: 0,
        }
    }

    /// Sets the least and the greatest value of a taxel, from the next frame on.
    pub fn set_values(&mut self, values: [f32; 2]) {
        self.limits = values;
    }

    /// The window of the sweep that is going on, or of the last one.
    pub fn window(&self) -> &SweepWindow {
        &self.window
    }

    /// Returns true while a window fills.
    pub fn is_sweeping(&self) -> bool {
        self.state == State::Sweeping
    }

    /// The motion controller starts a sweep.
    pub fn start(&mut self) -> SweepChange {
        let before = self.state;
        let found = self.window.kept();
        self.begin();
        if before == State::Sweeping {
            return SweepChange::RejectedAndBegun(Reject::SecondStart {
                found,
                expected: self.steps,
            });
        }
        SweepChange::Begun
    }

    /// The motion controller has stopped.
    pub fn stop(&mut self) -> SweepChange {
        let before = self.state;
        self.state = State::Idle;
        if before == State::Sweeping {
            return SweepChange::Rejected(Reject::Short {
                found: self.window.kept(),
                expected: self.steps,
            });
        }
        SweepChange::Unchanged
    }

    fn begin(&mut self) {
        // Frames that were lost just before count, too.
        self.window.restart_here();
        self.state = State::Sweeping;
        self.first = self.newest;
        self.turning = 0;
        self.examined = 0;
        self.health.fill((0.0, 0, 0));
    }

    /// The next frame of the finger.
    pub fn push(&mut self, frame: &Frame<'_>) -> SweepChange {
        let contact = match self.config.segmentation {
            Segmentation::Command => SweepChange::Unchanged,
            Segmentation::Contact(contact) => self.update_contact(contact, frame.taxels),
        };
        if contact != SweepChange::Unchanged || self.state != State::Sweeping {
            self.window.see(frame);
            self.newest = Some((frame.sequence, frame.sensor_time_nanos));
            return contact;
        }
        let taken = self.take(frame);
        self.newest = Some((frame.sequence, frame.sensor_time_nanos));
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

    /// Begins or ends a sweep where contact does.
    fn update_contact(&mut self, contact: Contact, taxels: &[f32]) -> SweepChange {
        let mean = taxels.iter().sum::<f32>() / taxels.len().max(1) as f32;
        // A broken taxel must not keep a contact for ever.
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
        if self.turning < contact.frames {
            return SweepChange::Unchanged;
        }
        self.turning = 0;
        if touching { self.stop() } else { self.start() }
    }

    fn take(&mut self, frame: &Frame<'_>) -> Result<Push, Reject> {
        let [least, greatest] = self.limits;
        let off = frame
            .taxels
            .iter()
            .position(|digit| *digit < least || *digit > greatest);
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
            self.first = Some((frame.sequence, frame.sensor_time_nanos));
        }
        if self.window.filled_in() > self.config.most_filled_in {
            return Err(Reject::Losses {
                found: self.window.filled_in(),
                allowed: self.config.most_filled_in,
            });
        }
        for row in self.examined..self.window.kept() {
            let row = self.window.row(row);
            examine(&self.config, greatest, &mut self.health, row)?;
        }
        self.examined = self.window.kept();
        Ok(pushed)
    }
}

impl SweepSegmenter {
    /// - `since`: sequence and sensor time of an earlier frame
    /// - `tolerance`: periods
    fn check_clock(
        &self,
        since: Option<(u64, u64)>,
        tolerance: f64,
        frame: &Frame<'_>,
    ) -> Result<(), Reject> {
        let Some((sequence, time)) = since else {
            return Ok(());
        };
        if frame.sequence <= sequence {
            // The window says so itself.
            return Ok(());
        }
        let expected = (frame.sequence - sequence) as f64 * self.period_ns;
        let found = frame.sensor_time_nanos as f64 - time as f64;
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

/// Looks for stalled and saturated taxels.
///
/// - `greatest`: value of a saturated taxel
fn examine(
    config: &SegmenterConfig,
    greatest: f32,
    health: &mut [(f32, usize, usize)],
    row: &[f32],
) -> Result<(), Reject> {
    for (taxel, ((last, same, full), digit)) in health.iter_mut().zip(row).enumerate() {
        *same = if digit == last && *digit != 0.0 {
            *same + 1
        } else {
            1
        };
        *last = *digit;
        *full = if *digit >= greatest { *full + 1 } else { 0 };
        if *full >= config.saturated_frames {
            return Err(Reject::Saturated {
                taxel,
                frames: *full,
            });
        }
        if *same >= config.stalled_frames {
            return Err(Reject::Stalled {
                taxel,
                digit: *digit,
                frames: *same,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::WindowError;

    const PERIOD: u64 = 1_000_000;

    fn config() -> SegmenterConfig {
        SegmenterConfig {
            skip: 2,
            longest_gap: 1,
            stalled_frames: 4,
            saturated_frames: 3,
            values: Some([0.0, 255.0]),
            ..SegmenterConfig::default()
        }
    }

    fn segmenter(config: SegmenterConfig) -> SweepSegmenter {
        SweepSegmenter::new(config, 6, 2, 1e9 / PERIOD as f64)
    }

    /// A frame on time whose digits change.
    fn good(segmenter: &mut SweepSegmenter, sequence: u64) -> SweepChange {
        let digits = [20.0 + (sequence % 3) as f32, 30.0 + (sequence % 2) as f32];
        push(segmenter, sequence, sequence * PERIOD, digits)
    }

    fn push(
        segmenter: &mut SweepSegmenter,
        sequence: u64,
        time: u64,
        digits: [f32; 2],
    ) -> SweepChange {
        segmenter.push(&Frame {
            sequence,
            sensor_time_nanos: time,
            taxels: &digits,
        })
    }

    #[test]
    fn a_commanded_sweep_completes_once() {
        let mut segmenter = segmenter(config());
        assert_eq!(good(&mut segmenter, 4), SweepChange::Unchanged);
        assert_eq!(segmenter.start(), SweepChange::Begun);
        for sequence in 5..12 {
            assert_eq!(good(&mut segmenter, sequence), SweepChange::Extended);
        }
        assert_eq!(good(&mut segmenter, 12), SweepChange::Complete);
        assert_eq!(segmenter.window().kept(), 6);
        assert_eq!(good(&mut segmenter, 13), SweepChange::Unchanged);
        assert_eq!(segmenter.stop(), SweepChange::Unchanged);
        assert_eq!(good(&mut segmenter, 14), SweepChange::Unchanged);
        assert_eq!(segmenter.start(), SweepChange::Begun);
    }

    #[test]
    fn every_fault_has_its_outcome() {
        let begun = || {
            let mut segmenter = segmenter(config());
            segmenter.start();
            (0..4).for_each(|sequence| {
                good(&mut segmenter, sequence);
            });
            segmenter
        };
        // One lost frame is filled in, two are too many.
        let mut lost = begun();
        assert_eq!(good(&mut lost, 5), SweepChange::Extended);
        assert_eq!(lost.window().filled_in(), 1);
        let rejected = good(&mut begun(), 6);
        assert!(matches!(
            rejected,
            SweepChange::Rejected(Reject::Window(WindowError::Gap { lost: 2, .. }))
        ));
        let repeated = good(&mut begun(), 3);
        assert!(matches!(
            repeated,
            SweepChange::Rejected(Reject::Window(WindowError::Order { .. }))
        ));
        for time in [4 * PERIOD + 600_000, 3 * PERIOD, 0] {
            let jumped = push(&mut begun(), 4, time, [1.0, 2.0]);
            assert!(matches!(
                jumped,
                SweepChange::Rejected(Reject::Clock { .. })
            ));
        }
        let mut late = begun();
        assert_eq!(
            push(&mut late, 4, 4 * PERIOD + 400_000, [1.0, 2.0]),
            SweepChange::Extended
        );
        let mut short = begun();
        let expected = Reject::Short {
            found: 2,
            expected: 6,
        };
        assert_eq!(short.stop(), SweepChange::Rejected(expected));
        let second = Reject::SecondStart {
            found: 2,
            expected: 6,
        };
        let mut twice = begun();
        assert_eq!(twice.start(), SweepChange::RejectedAndBegun(second));
        assert_eq!(twice.window().kept(), 0);
        assert_eq!(good(&mut twice, 4), SweepChange::Extended);
    }

    #[test]
    fn losses_just_before_the_first_frame_count_and_clocks_may_not_drift() {
        let mut late = segmenter(config());
        good(&mut late, 3);
        late.start();
        let gap = good(&mut late, 9);
        assert!(matches!(
            gap,
            SweepChange::Rejected(Reject::Window(WindowError::Gap { lost: 5, .. }))
        ));
        // A sensor that restarts is followed from its new beginning on.
        late.stop();
        good(&mut late, 0);
        late.start();
        assert_eq!(good(&mut late, 1), SweepChange::Extended);

        // Each frame is in time, all together are not.
        let mut slow = segmenter(SegmenterConfig {
            clock_drift: 2.0,
            ..config()
        });
        slow.start();
        let mut outcomes = (0..8).map(|sequence| {
            let digits = [20.0 + (sequence % 3) as f32, 30.0 + (sequence % 2) as f32];
            push(&mut slow, sequence, sequence * PERIOD * 14 / 10, digits)
        });
        assert!(outcomes.any(|o| matches!(o, SweepChange::Rejected(Reject::Clock { .. }))));

        let mut holes = segmenter(SegmenterConfig {
            most_filled_in: 1,
            skip: 0,
            ..config()
        });
        holes.start();
        good(&mut holes, 0);
        assert_eq!(good(&mut holes, 2), SweepChange::Extended);
        let losses = Reject::Losses {
            found: 2,
            allowed: 1,
        };
        assert_eq!(good(&mut holes, 4), SweepChange::Rejected(losses));

        let mut wild = segmenter(config());
        wild.start();
        let range = push(&mut wild, 0, 0, [1.0, 1e30]);
        assert!(matches!(
            range,
            SweepChange::Rejected(Reject::Range { taxel: 1, .. })
        ));
    }

    #[test]
    fn stalled_and_saturated_taxels_are_found_and_silent_ones_are_not() {
        let sweep = |digits: &dyn Fn(u64) -> [f32; 2]| {
            let mut segmenter = segmenter(config());
            segmenter.start();
            (0..8)
                .map(|sequence| {
                    push(
                        &mut segmenter,
                        sequence,
                        sequence * PERIOD,
                        digits(sequence),
                    )
                })
                .find(|change| *change != SweepChange::Extended)
                .unwrap()
        };
        let stalled = Reject::Stalled {
            taxel: 1,
            digit: 7.0,
            frames: 4,
        };
        assert_eq!(sweep(&|n| [n as f32, 7.0]), SweepChange::Rejected(stalled));
        assert_eq!(sweep(&|n| [n as f32, 0.0]), SweepChange::Complete);
        let saturated = Reject::Saturated {
            taxel: 0,
            frames: 3,
        };
        assert_eq!(
            sweep(&|n| [255.0, n as f32]),
            SweepChange::Rejected(saturated)
        );
    }

    #[test]
    fn values_below_zero_are_as_good_as_others_where_the_skin_gives_them() {
        let sweep = |values: Option<[f32; 2]>, digit: f32| {
            let mut segmenter = segmenter(SegmenterConfig { values, ..config() });
            segmenter.start();
            (0..8)
                .map(|sequence| {
                    let digits = [digit, -(sequence as f32)];
                    push(&mut segmenter, sequence, sequence * PERIOD, digits)
                })
                .find(|change| *change != SweepChange::Extended)
                .unwrap()
        };
        // Not stalled: zero is silence.
        assert_eq!(sweep(Some([-24.5, 31.0]), 0.0), SweepChange::Complete);
        assert_eq!(sweep(None, 0.0), SweepChange::Complete);
        let low = sweep(Some([-24.5, 31.0]), -24.6);
        let SweepChange::Rejected(reject) = low else {
            panic!("{low:?}")
        };
        assert_eq!(
            reject.to_string(),
            "frame 0: taxel 0 shows -24.6, expected -24.5 to 31; `values` in the table widens that"
        );
        let mut later = segmenter(config());
        later.set_values([-1.0, 1.0]);
        later.start();
        assert_eq!(
            push(&mut later, 0, 0, [-0.5, 0.5]),
            SweepChange::Extended,
            "another network's values"
        );
    }

    #[test]
    fn contact_begins_and_ends_with_hysteresis() {
        let contact = Contact {
            begins: 10.0,
            ends: 5.0,
            frames: 2,
        };
        let mut segmenter = segmenter(SegmenterConfig {
            segmentation: Segmentation::Contact(contact),
            skip: 0,
            ..config()
        });
        let mut sequence = 0;
        let mut touch = |mean: f32| {
            sequence += 1;
            let digits = [mean + (sequence % 2) as f32 * 0.1, mean];
            push(&mut segmenter, sequence, sequence * PERIOD, digits)
        };
        assert_eq!(touch(12.0), SweepChange::Unchanged);
        assert_eq!(
            touch(8.0),
            SweepChange::Unchanged,
            "one frame is no contact"
        );
        assert_eq!(touch(12.0), SweepChange::Unchanged);
        assert_eq!(touch(12.0), SweepChange::Begun);
        for mean in [11.0, 4.0, 8.0, 7.0, 4.0] {
            assert_eq!(touch(mean), SweepChange::Extended, "{mean}");
        }
        let short = Reject::Short {
            found: 5,
            expected: 6,
        };
        assert_eq!(touch(4.0), SweepChange::Rejected(short));
        assert_eq!(touch(0.0), SweepChange::Unchanged);
    }
}
