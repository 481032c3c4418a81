//! Packets as people and scripts read them.

use std::fmt;

use bytemuck::AnyBitPattern;
use serde::Serialize;
use tactnet_channel::Packet;

use crate::packets::{
    Command, Event, ModelNames, SkinFrame, Stage, SweepCommand, TactileBelief, TactileStatus,
    Verdict,
};

/// Values of a frame that are printed.
const PRINTED: usize = 8;

/// A tactile packet. Numbers that the sender should not have put are `"?"` or `null`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "type")]
pub enum Readable {
    /// A frame of the skin.
    SkinFrame {
        /// Its number since the sensor started.
        frame: u64,
        /// By the sensor's clock, milliseconds.
        sensor_time_ms: f64,
        /// `[taxels]`, row by row
        values: Vec<f32>,
    },
    /// A wish of the motion controller or a person.
    SweepCommand {
        /// `start`, `stop`, `reset` or `enroll`.
        command: &'static str,
        /// From 0.
        finger: u32,
        /// Number of the motion.
        motion: u64,
        /// What is swept over, or to be learnt; empty where nobody says.
        material: String,
    },
    /// A belief about the material.
    TactileBelief {
        /// Number of the sweep, from 1.
        sweep: u64,
        /// From 0.
        finger: u32,
        /// `anytime`, `plain` or `dropout`.
        stage: &'static str,
        /// Frames of the sweep so far.
        frames: u32,
        /// Frames of a whole sweep, once the network has said so.
        #[serde(skip_serializing_if = "Option::is_none")]
        sweep_frames: Option<u32>,
        /// The sweep goes on: its answer may still change.
        provisional: bool,
        /// Of this sweep alone.
        sweep_says: Answer,
        /// Of all sweeps of the object; `None` before the first whole one.
        object_says: Option<Answer>,
        /// Whole sweeps that `object_says` is of.
        object_sweeps: u32,
        /// From the newest frame to this belief, milliseconds.
        latency_ms: f64,
    },
    /// An event of the classifier.
    TactileStatus {
        /// `alive`, `begun`, `classified`, `rejected`, …
        event: &'static str,
        /// From 0.
        finger: u32,
        /// Number of the sweep.
        sweep: u64,
        /// Frames that came so far.
        frames: u64,
        /// Whole sweeps so far.
        sweeps: u64,
        /// Rejected sweeps so far.
        rejected: u64,
        /// For people.
        text: String,
    },
    /// The network that serves.
    ModelNames {
        /// Its number.
        version: u64,
        /// Frames a second.
        sample_rate_hz: f64,
        /// Frames of a sweep.
        steps: u32,
        /// Rows of taxels.
        rows: u32,
        /// Columns of taxels.
        cols: u32,
        /// By label.
        materials: Vec<String>,
    },
}

/// The most probable material.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// Its label.
    pub label: u32,
    /// Its name, once the network's names have come.
    pub material: Option<String>,
    /// 0 to 1.
    pub probability: Option<f32>,
    /// `known`, `unknown` or `not told`.
    pub verdict: &'static str,
}

impl Readable {
    /// Returns a packet's first item; `None` for packets that are none of the tactile ones, of another version, or too short.
    ///
    /// - `packet`, `version`: as the table says
    /// - `network`: which gave the answers, where that is known
    pub fn new(
        packet: &str,
        version: u32,
        bytes: &[u8],
        network: Option<&ModelNames>,
    ) -> Option<Self> {
        None.or_else(|| item(packet, version, bytes).map(|frame| of_frame(&frame)))
            .or_else(|| item(packet, version, bytes).map(|command| of_command(&command)))
            .or_else(|| item(packet, version, bytes).map(|belief| of_belief(&belief, network)))
            .or_else(|| item(packet, version, bytes).map(|status| of_status(&status)))
            .or_else(|| item(packet, version, bytes).map(|model| of_names(&model)))
    }
}

/// Returns the names of a network's materials, by label.
pub fn material_names(model: &ModelNames) -> Vec<String> {
    let known = (model.materials as usize).min(model.names.len());
    let names = model.names[..known].iter();
    names.map(|name| name.as_str().to_owned()).collect()
}

fn item<T: Packet + AnyBitPattern>(packet: &str, version: u32, bytes: &[u8]) -> Option<T> {
    let first = bytes.get(..size_of::<T>())?;
    (packet == T::NAME && version == T::VERSION).then(|| bytemuck::pod_read_unaligned(first))
}

fn of_frame(frame: &SkinFrame) -> Readable {
    Readable::SkinFrame {
        frame: frame.sequence,
        sensor_time_ms: frame.sensor_time_ns as f64 / 1e6,
        values: frame.values().to_vec(),
    }
}

fn of_command(command: &SweepCommand) -> Readable {
    Readable::SweepCommand {
        command: match command.command() {
            Some(Command::Start) => "start",
            Some(Command::Stop) => "stop",
            Some(Command::Reset) => "reset",
            Some(Command::Enroll) => "enroll",
            None => "?",
        },
        finger: command.finger,
        motion: command.motion,
        material: command.material.as_str().into(),
    }
}

fn of_belief(belief: &TactileBelief, network: Option<&ModelNames>) -> Readable {
    let names = network.map(material_names).unwrap_or_default();
    let answer = |label: u32, probabilities: &[f32], verdict: u32| Answer {
        label,
        material: names.get(label as usize).cloned(),
        probability: probabilities.get(label as usize).copied(),
        verdict: match verdict {
            verdict if verdict == Verdict::Known as u32 => "known",
            verdict if verdict == Verdict::Unknown as u32 => "unknown",
            verdict if verdict == Verdict::NotTold as u32 => "not told",
            _ => "?",
        },
    };
    Readable::TactileBelief {
        sweep: belief.sweep,
        finger: belief.finger,
        stage: match belief.stage {
            stage if stage == Stage::Anytime as u32 => "anytime",
            stage if stage == Stage::Plain as u32 => "plain",
            stage if stage == Stage::Dropout as u32 => "dropout",
            _ => "?",
        },
        frames: belief.frames,
        sweep_frames: network.map(|network| network.steps),
        provisional: belief.stage == Stage::Anytime as u32,
        sweep_says: answer(belief.label, &belief.posterior, belief.verdict),
        object_says: (belief.fused_sweeps > 0)
            .then(|| answer(belief.fused_label, &belief.fused, belief.fused_verdict)),
        object_sweeps: belief.fused_sweeps,
        latency_ms: belief.latency_ns as f64 / 1e6,
    }
}

impl Event {
    /// Returns the event in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Alive => "alive",
            Self::Begun => "begun",
            Self::Classified => "classified",
            Self::Rejected => "rejected",
            Self::Reset => "reset",
            Self::Refused => "refused",
            Self::Swapped => "swapped",
            Self::ModelRejected => "model rejected",
            Self::Enrolled => "enrolled",
            Self::Unreachable => "unreachable",
        }
    }
}

fn of_status(status: &TactileStatus) -> Readable {
    Readable::TactileStatus {
        event: Event::of(status.event).map_or("?", Event::name),
        finger: status.finger,
        sweep: status.sweep,
        frames: status.counters.frames,
        sweeps: status.counters.sweeps,
        rejected: status.counters.rejected,
        text: status.text.as_str().into(),
    }
}

fn of_names(model: &ModelNames) -> Readable {
    Readable::ModelNames {
        version: model.version,
        sample_rate_hz: model.sample_rate_hz,
        steps: model.steps,
        rows: model.rows,
        cols: model.cols,
        materials: material_names(model),
    }
}

impl fmt::Display for Readable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SkinFrame {
                frame,
                sensor_time_ms,
                values,
            } => {
                write!(f, "frame {frame} at {sensor_time_ms:.1} ms:")?;
                for value in values.iter().take(PRINTED) {
                    // Not more digits than eyes compare.
                    write!(f, " {}", (value * 1e3).round() / 1e3)?;
                }
                match values.len().saturating_sub(PRINTED) {
                    0 => Ok(()),
                    more => write!(f, " … ({more} more)"),
                }
            }
            Self::SweepCommand {
                command,
                finger,
                motion,
                material,
            } => {
                write!(f, "{command}, finger {finger}, motion {motion}")?;
                match material.as_str() {
                    "" => Ok(()),
                    material => write!(f, ", {material}"),
                }
            }
            Self::TactileBelief {
                sweep,
                stage,
                frames,
                sweep_frames,
                provisional,
                sweep_says,
                object_says,
                object_sweeps,
                ..
            } => {
                write!(f, "sweep {sweep}, ")?;
                match (provisional, sweep_frames) {
                    (true, Some(all)) => write!(f, "{frames} of {all} frames, provisional")?,
                    (true, None) => write!(f, "{frames} frames so far, provisional")?,
                    (false, _) => write!(f, "complete")?,
                }
                if *stage == "dropout" {
                    f.write_str(", mean over dropout masks")?;
                }
                write!(f, ": {sweep_says}")?;
                match object_says {
                    Some(answer) => {
                        let plural = if *object_sweeps == 1 { "" } else { "s" };
                        write!(f, "; object after {object_sweeps} sweep{plural}: {answer}")
                    }
                    None => Ok(()),
                }
            }
            Self::TactileStatus {
                event,
                sweep,
                frames,
                sweeps,
                rejected,
                text,
                ..
            } => {
                write!(
                    f,
                    "{event}, sweep {sweep}; {frames} frames, {sweeps} sweeps, {rejected} rejected"
                )?;
                match text.as_str() {
                    "" => Ok(()),
                    text => write!(f, ": {text}"),
                }
            }
            Self::ModelNames {
                version,
                sample_rate_hz,
                steps,
                rows,
                cols,
                materials,
            } => write!(
                f,
                "version {version}, {steps} frames of {rows} x {cols} taxels at {sample_rate_hz} Hz: {}",
                materials.join(", ")
            ),
        }
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.material {
            Some(material) => f.write_str(material)?,
            None => write!(f, "label {}", self.label)?,
        }
        if let Some(probability) = self.probability {
            write!(f, " {:.1} %", 100.0 * probability)?;
        }
        match self.verdict {
            "not told" => Ok(()),
            verdict => write!(f, " ({verdict})"),
        }
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::packets::Text;

    fn read<T: Packet>(packet: &T, network: Option<&ModelNames>) -> Option<Readable> {
        Readable::new(T::NAME, T::VERSION, bytemuck::bytes_of(packet), network)
    }

    /// Tells cork from wood by 400 frames.
    fn network() -> ModelNames {
        let mut network = ModelNames {
            steps: 400,
            materials: 2,
            ..ModelNames::zeroed()
        };
        network.names[0] = Text::new("cork");
        network.names[1] = Text::new("wood");
        network
    }

    #[test]
    fn a_belief_during_a_sweep_says_how_much_was_seen_and_that_it_is_provisional() {
        let mut belief = TactileBelief {
            sweep: 12,
            stage: Stage::Anytime as u32,
            frames: 25,
            label: 1,
            ..TactileBelief::zeroed()
        };
        belief.posterior[1] = 0.997;
        let shown = |belief: &TactileBelief, network: Option<&ModelNames>| {
            read(belief, network).unwrap().to_string()
        };
        assert_eq!(
            shown(&belief, Some(&network())),
            "sweep 12, 25 of 400 frames, provisional: wood 99.7 %"
        );
        assert_eq!(
            shown(&belief, None),
            "sweep 12, 25 frames so far, provisional: label 1 99.7 %"
        );
        belief.stage = Stage::Plain as u32;
        belief.frames = 400;
        assert_eq!(
            shown(&belief, Some(&network())),
            "sweep 12, complete: wood 99.7 %"
        );
    }

    #[test]
    fn beliefs_are_read_with_and_without_names() {
        let mut belief = TactileBelief {
            sweep: 12,
            stage: Stage::Dropout as u32,
            frames: 400,
            label: 1,
            verdict: Verdict::Known as u32,
            ..TactileBelief::zeroed()
        };
        belief.posterior[1] = 0.9311;
        let alone = read(&belief, None).unwrap().to_string();
        assert_eq!(
            alone,
            "sweep 12, complete, mean over dropout masks: label 1 93.1 % (known)"
        );
        belief.fused_sweeps = 2;
        belief.fused_label = 0;
        belief.fused[0] = 0.75;
        let named = read(&belief, Some(&network())).unwrap().to_string();
        assert_eq!(
            named,
            "sweep 12, complete, mean over dropout masks: wood 93.1 % (known); object after 2 sweeps: cork 75.0 %"
        );
    }

    #[test]
    fn every_tactile_packet_is_read_and_no_other() {
        let mut frame = SkinFrame {
            sequence: 7,
            sensor_time_ns: 28_000_000,
            taxels: 2,
            ..SkinFrame::zeroed()
        };
        frame.digits[..2].copy_from_slice(&[-1.71791, 8.0]);
        assert_eq!(
            read(&frame, None).unwrap().to_string(),
            "frame 7 at 28.0 ms: -1.718 8"
        );
        let status = TactileStatus {
            event: Event::Rejected as u32,
            sweep: 3,
            text: Text::new("taxel 4 is saturated"),
            ..TactileStatus::zeroed()
        };
        assert_eq!(
            read(&status, None).unwrap().to_string(),
            "rejected, sweep 3; 0 frames, 0 sweeps, 0 rejected: taxel 4 is saturated"
        );
        assert!(read(&SweepCommand::zeroed(), None).is_some());
        let model = ModelNames {
            materials: u32::MAX,
            ..ModelNames::zeroed()
        };
        assert!(read(&model, None).is_some());
        let bytes = bytemuck::bytes_of(&status);
        for (packet, version, bytes) in [
            ("Imu", 1, bytes),
            (TactileStatus::NAME, 99, bytes),
            (TactileStatus::NAME, TactileStatus::VERSION, &bytes[..9]),
        ] {
            assert_eq!(Readable::new(packet, version, bytes, None), None);
        }
    }
}
