//! Skin that plays recorded or synthetic sweeps, with the motion controller that commands them.

use tactnet_data::Dataset;

use tactnet_skin::packets::{Command, MAX_TAXELS, SkinFrame, SweepCommand, Text};

use crate::SkinFault;

/// Duration of the rest without contact between two motions, in s.
const REST_SECONDS: f64 = 0.5;

/// Returns the number of frames of the default rest at a skin's rate.
pub fn rest_frames(rate_hz: f64) -> usize {
    (REST_SECONDS * rate_hz).round() as usize
}

/// Factor by which the rest before a new object is longer.
const OBJECT_REST: usize = 4;

/// Plays sweeps in a loop. Each motion consists of rest, start, lead-in, the sweep, lead-out and stop.
///
/// A recorded sweep is the middle of a motion; the leads mirror its beginning and end. If the lead is as long as the
/// part that the classifier skips, the classifier's window is exactly the recorded sweep.
#[derive(Debug)]
pub struct SkinSimulator<'a> {
    dataset: &'a Dataset,
    /// Indices of the played sweeps, repeated.
    order: Vec<usize>,
    lead: usize,
    rest: usize,
    /// Number of sweeps per object; `None` if no command marks a new object.
    object_sweeps: Option<u64>,
    /// Number of frames without contact before the current or next motion.
    pause: usize,
    /// `[taxels]`: readings without contact, in digits.
    untouched: Vec<f32>,
    finger: u32,
    fault: SkinFault,
    /// `[steps][taxels]` of the current sweep.
    sweep: Vec<f32>,
    /// Number of motions so far.
    motion: u64,
    /// Number of frames of this motion so far, including the rest.
    at: usize,
    sequence: u64,
}

/// One time step of the skin.
#[derive(Debug, Clone, Copy)]
pub struct SkinStep {
    /// Command to send before the frame.
    pub command: Option<SweepCommand>,
    /// The frame.
    pub frame: SkinFrame,
}

impl<'a> SkinSimulator<'a> {
    /// Creates a skin at rest.
    ///
    /// - `order`: indices of sweeps in `dataset`, played in a loop
    /// - `lead`: number of frames of the motion before and after a sweep
    /// - `rest`: number of frames without contact before each motion
    ///
    /// # Panics
    /// Panics if `order` is empty, or if the data set has more taxels than a frame.
    pub fn new(dataset: &'a Dataset, order: Vec<usize>, lead: usize, rest: usize) -> Self {
        assert!(!order.is_empty(), "a sweep to play");
        let shape = dataset.shape();
        assert!(shape.taxels() <= MAX_TAXELS, "taxels of a frame");
        let rest = rest.max(1);
        Self {
            order,
            lead,
            rest,
            object_sweeps: None,
            pause: rest,
            untouched: untouched(dataset),
            finger: 0,
            fault: SkinFault::default(),
            sweep: vec![0.0; shape.values()],
            motion: 0,
            at: 0,
            sequence: 0,
            dataset,
        }
    }

    /// Commands a reset after a longer rest before the first of every `sweeps` sweeps.
    ///
    /// # Panics
    /// Panics if `sweeps` is 0.
    pub fn with_objects_of(mut self, sweeps: u64) -> Self {
        assert!(sweeps > 0, "sweeps of an object");
        self.object_sweeps = Some(sweeps);
        self.pause = self.rest * OBJECT_REST;
        self
    }

    /// Sends frames as a skin with this fault gives them.
    pub fn with_fault(self, fault: SkinFault) -> Self {
        Self { fault, ..self }
    }

    /// Returns the index of the sweep that a motion plays.
    pub fn sweep_of(&self, motion: u64) -> usize {
        self.order[(motion - 1) as usize % self.order.len()]
    }

    /// Returns the number of motions started.
    pub fn motions(&self) -> u64 {
        self.motion
    }

    /// Returns the number of frames of the current or next motion, including the rest.
    pub fn frames_of_a_motion(&self) -> usize {
        self.pause + 2 * self.lead + self.dataset.shape().steps
    }

    /// Returns true if the next motion is the first of an object.
    fn object_is_next(&self) -> bool {
        let sweeps = self.object_sweeps;
        sweeps.is_some_and(|sweeps| self.motion.is_multiple_of(sweeps))
    }

    /// Returns the sample rate, in frames per second.
    pub fn rate_hz(&self) -> f64 {
        self.dataset.sample_rate_hz()
    }

    /// Returns the next time step.
    pub fn step(&mut self) -> SkinStep {
        let shape = self.dataset.shape();
        let taxels = shape.taxels();
        let mut command = None;
        if self.at == self.pause {
            self.motion += 1;
            self.dataset
                .copy_sweep(self.sweep_of(self.motion), &mut self.sweep);
            command = Some(Command::Start);
        }
        let mut digits = [0.0; MAX_TAXELS];
        digits[..taxels].copy_from_slice(&self.untouched);
        if self.at >= self.pause {
            let row = mirrored(self.at - self.pause, self.lead, shape.steps) * taxels;
            digits[..taxels].copy_from_slice(&self.sweep[row..row + taxels]);
        } else if self.at == 0 && self.motion > 0 {
            command = Some(Command::Stop);
        } else if self.at + 1 == self.pause && self.object_is_next() {
            command = Some(Command::Reset);
        }
        self.fault.apply(&mut digits[..taxels], shape);
        let frame = SkinFrame {
            sequence: self.sequence,
            sensor_time_ns: (self.sequence as f64 * 1e9 / self.dataset.sample_rate_hz()) as u64,
            taxels: taxels as u32,
            reserved: 0,
            digits,
        };
        self.sequence += 1;
        self.at += 1;
        if self.at == self.frames_of_a_motion() {
            self.at = 0;
            self.pause = match self.object_is_next() {
                true => self.rest * OBJECT_REST,
                false => self.rest,
            };
        }
        SkinStep {
            command: command.map(|command| SweepCommand {
                kind: command as u32,
                finger: self.finger,
                motion: self.motion,
                sweeps: 0,
                reserved: 0,
                material: match command {
                    Command::Start => {
                        let label = self.dataset.records()[self.sweep_of(self.motion)].label;
                        Text::new(self.dataset.labels().name(label))
                    }
                    _ => Text::default(),
                },
            }),
            frame,
        }
    }
}

/// Returns the reading of each taxel without contact, in digits. It is zero, except for skins with an offset at rest:
/// if all readings are further from zero than half of their spread, it is the taxel's own reading closest to zero.
fn untouched(dataset: &Dataset) -> Vec<f32> {
    let taxels = dataset.shape().taxels();
    let mut ends = vec![[f32::INFINITY, f32::NEG_INFINITY]; taxels];
    let mut sweep = vec![0.0; dataset.shape().values()];
    for index in 0..dataset.len() {
        dataset.copy_sweep(index, &mut sweep);
        for frame in sweep.chunks_exact(taxels) {
            for (ends, reading) in ends.iter_mut().zip(frame) {
                *ends = [ends[0].min(*reading), ends[1].max(*reading)];
            }
        }
    }
    let least = ends
        .iter()
        .map(|ends| ends[0])
        .fold(f32::INFINITY, f32::min);
    let most = ends
        .iter()
        .map(|ends| ends[1])
        .fold(f32::NEG_INFINITY, f32::max);
    let away = |ends: &[f32; 2]| match least > 0.0 {
        true => ends[0],
        false => ends[1],
    };
    match 2.0 * least.max(-most) > most - least {
        true => ends.iter().map(away).collect(),
        false => vec![0.0; taxels],
    }
}

/// Returns the recorded step for a step of the motion, mirrored at both ends of the sweep.
pub(crate) fn mirrored(at: usize, lead: usize, steps: usize) -> usize {
    let last = steps - 1;
    if at < lead {
        (lead - at).min(last)
    } else if at < lead + steps {
        at - lead
    } else {
        last.saturating_sub(at - lead - last)
    }
}

#[cfg(test)]
mod tests {
    use tactnet_data::twin;
    use tactnet_data::{LabelSet, Samples, SweepRecord, SweepShape};

    use super::*;
    use tactnet_skin::{SegmenterConfig, SweepChange, SweepSegmenter};

    #[test]
    fn the_segmenter_finds_the_recorded_sweeps_again() {
        let twin = twin::small(2, 2, 60).unwrap();
        let mut skin = SkinSimulator::new(&twin, vec![3, 1], 20, 5);
        let config = SegmenterConfig {
            skip: 20.into(),
            ..SegmenterConfig::default()
        };
        let mut segmenter = SweepSegmenter::new(config, 60, 16, twin.sample_rate_hz());
        let mut found = Vec::new();
        for _ in 0..3 * skin.frames_of_a_motion() {
            let step = skin.step();
            match step.command.and_then(|command| command.command()) {
                Some(Command::Start) => assert_eq!(segmenter.start(), SweepChange::Begun),
                Some(Command::Stop) => assert_eq!(segmenter.stop(), SweepChange::Unchanged),
                _ => {}
            }
            let change = segmenter.push(&tactnet_skin::Frame {
                sequence: step.frame.sequence,
                sensor_time_nanos: step.frame.sensor_time_ns,
                taxels: step.frame.values(),
            });
            assert!(!matches!(change, SweepChange::Rejected(_)), "{change:?}");
            if change == SweepChange::Complete {
                let sweep = segmenter.window().sweep().unwrap();
                assert_eq!(sweep, twin.sweep(skin.sweep_of(skin.motions())));
                found.push(skin.sweep_of(skin.motions()));
            }
        }
        assert_eq!(found, [3, 1, 3]);
    }

    #[test]
    fn every_object_begins_with_a_reset_and_has_as_many_sweeps_as_asked_for() {
        let twin = twin::small(2, 4, 60).unwrap();
        let mut skin = SkinSimulator::new(&twin, vec![0, 1, 4, 5], 2, 1).with_objects_of(2);
        let mut commands = Vec::new();
        while skin.motions() < 5 {
            commands.extend(skin.step().command);
        }
        let kinds: Vec<_> = commands.iter().filter_map(SweepCommand::command).collect();
        use Command::{Reset, Start, Stop};
        let object = [Reset, Start, Stop, Start, Stop];
        assert_eq!(kinds, [&object[..], &object, &object[..2]].concat());
        let materials: Vec<&str> = commands
            .iter()
            .filter(|command| command.command() == Some(Start))
            .map(|command| command.material.as_str())
            .collect();
        let names: Vec<&str> = twin.labels().names().collect();
        assert_eq!(
            materials,
            [names[0], names[0], names[1], names[1], names[0]]
        );
    }

    #[test]
    fn a_skin_that_rests_elsewhere_does_not_fall_to_zero_between_sweeps() {
        let shape = SweepShape {
            steps: 3,
            rows: 1,
            cols: 2,
        };
        for (sweep, rest) in [
            ([2000., 90., 2010., 95., 2005., 80.], [0., 0.]),
            ([2000., 1990., 2010., 1995., 2005., 1980.], [2000., 1980.]),
            (
                [-2000., -1990., -2010., -1995., -2005., -1980.],
                [-2000., -1980.],
            ),
        ] {
            let labels = LabelSet::new(["cork".to_owned()]).unwrap();
            let record = SweepRecord::new(0, 0);
            let samples = Samples::F32(sweep.to_vec());
            let dataset = Dataset::new("own", 100.0, shape, labels, vec![record], samples).unwrap();
            let mut skin = SkinSimulator::new(&dataset, vec![0], 0, 2);
            let frames: Vec<_> = (0..3)
                .map(|_| skin.step().frame.values().to_vec())
                .collect();
            assert_eq!(frames[..2], [rest, rest]);
            assert_eq!(frames[2], sweep[..2]);
        }
    }

    #[test]
    fn leads_are_mirrors() {
        let steps: Vec<usize> = (0..10).map(|at| mirrored(at, 3, 4)).collect();
        assert_eq!(steps, [3, 2, 1, 0, 1, 2, 3, 2, 1, 0]);
    }
}
