//! Tactile packets as one line of terminal text.

use std::fmt;

use tactnet_skin::{MaterialPrediction, ReadablePacket};

/// Number of taxel values that are printed of a frame.
const PRINTED_VALUES: usize = 8;

/// Prints a tactile packet in one line.
pub struct PacketText<'a>(pub &'a ReadablePacket);

impl fmt::Display for PacketText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            ReadablePacket::SkinFrame {
                frame,
                sensor_time_ms,
                values,
            } => {
                write!(f, "frame {frame} at {sensor_time_ms:.1} ms:")?;
                write_values(f, values)
            }
            ReadablePacket::SweepCommand {
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
            belief @ ReadablePacket::TactileBelief { .. } => write_belief(f, belief),
            ReadablePacket::TactileStatus {
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
            ReadablePacket::ModelNames {
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

/// Writes the first values of a frame.
fn write_values(f: &mut fmt::Formatter<'_>, values: &[f32]) -> fmt::Result {
    for value in values.iter().take(PRINTED_VALUES) {
        // Three decimals are enough to compare by eye.
        write!(f, " {}", (value * 1e3).round() / 1e3)?;
    }
    match values.len().saturating_sub(PRINTED_VALUES) {
        0 => Ok(()),
        more => write!(f, " … ({more} more)"),
    }
}

fn write_belief(f: &mut fmt::Formatter<'_>, packet: &ReadablePacket) -> fmt::Result {
    let ReadablePacket::TactileBelief {
        sweep,
        stage,
        frames,
        sweep_frames,
        provisional,
        sweep_says,
        object_says,
        object_sweeps,
        ..
    } = packet
    else {
        return Ok(());
    };
    write!(f, "sweep {sweep}, ")?;
    match (provisional, sweep_frames) {
        (true, Some(all)) => write!(f, "{frames} of {all} frames, provisional")?,
        (true, None) => write!(f, "{frames} frames so far, provisional")?,
        (false, _) => write!(f, "complete")?,
    }
    if *stage == "dropout" {
        f.write_str(", mean over dropout masks")?;
    }
    f.write_str(": ")?;
    write_prediction(f, sweep_says)?;
    if let Some(prediction) = object_says {
        let plural = if *object_sweeps == 1 { "" } else { "s" };
        write!(f, "; object after {object_sweeps} sweep{plural}: ")?;
        write_prediction(f, prediction)?;
    }
    Ok(())
}

fn write_prediction(f: &mut fmt::Formatter<'_>, prediction: &MaterialPrediction) -> fmt::Result {
    match &prediction.material {
        Some(material) => f.write_str(material)?,
        None => write!(f, "label {}", prediction.label)?,
    }
    if let Some(probability) = prediction.probability {
        write!(f, " {:.1} %", 100.0 * probability)?;
    }
    match prediction.verdict {
        "not told" => Ok(()),
        verdict => write!(f, " ({verdict})"),
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_channel::Packet;
    use tactnet_skin::packets::{
        Event, ModelNames, SkinFrame, Stage, TactileBelief, TactileStatus, Text, Verdict,
    };

    use super::*;

    fn text<T: Packet>(packet: &T, network: Option<&ModelNames>) -> String {
        let bytes = bytemuck::bytes_of(packet);
        let packet = ReadablePacket::new(T::NAME, T::VERSION, bytes, network).unwrap();
        PacketText(&packet).to_string()
    }

    /// Distinguishes cork from wood with sweeps of 400 frames.
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
    fn a_belief_during_a_sweep_shows_its_frames_and_is_marked_provisional() {
        let mut belief = TactileBelief {
            sweep: 12,
            stage: Stage::Anytime as u32,
            frames: 25,
            label: 1,
            ..TactileBelief::zeroed()
        };
        belief.posterior[1] = 0.997;
        assert_eq!(
            text(&belief, Some(&network())),
            "sweep 12, 25 of 400 frames, provisional: wood 99.7 %"
        );
        assert_eq!(
            text(&belief, None),
            "sweep 12, 25 frames so far, provisional: label 1 99.7 %"
        );
        belief.stage = Stage::Plain as u32;
        belief.frames = 400;
        assert_eq!(
            text(&belief, Some(&network())),
            "sweep 12, complete: wood 99.7 %"
        );
    }

    #[test]
    fn beliefs_are_printed_with_and_without_material_names() {
        let mut belief = TactileBelief {
            sweep: 12,
            stage: Stage::Dropout as u32,
            frames: 400,
            label: 1,
            verdict: Verdict::Known as u32,
            ..TactileBelief::zeroed()
        };
        belief.posterior[1] = 0.9311;
        let alone = text(&belief, None);
        assert_eq!(
            alone,
            "sweep 12, complete, mean over dropout masks: label 1 93.1 % (known)"
        );
        belief.fused_sweeps = 2;
        belief.fused_label = 0;
        belief.fused[0] = 0.75;
        let named = text(&belief, Some(&network()));
        assert_eq!(
            named,
            "sweep 12, complete, mean over dropout masks: wood 93.1 % (known); object after 2 sweeps: cork 75.0 %"
        );
    }

    #[test]
    fn frames_and_events_are_printed_in_one_line() {
        let mut frame = SkinFrame {
            sequence: 7,
            sensor_time_ns: 28_000_000,
            taxels: 2,
            ..SkinFrame::zeroed()
        };
        frame.digits[..2].copy_from_slice(&[-1.71791, 8.0]);
        assert_eq!(text(&frame, None), "frame 7 at 28.0 ms: -1.718 8");
        let status = TactileStatus {
            event: Event::Rejected as u32,
            sweep: 3,
            text: Text::new("taxel 4 is saturated"),
            ..TactileStatus::zeroed()
        };
        assert_eq!(
            text(&status, None),
            "rejected, sweep 3; 0 frames, 0 sweeps, 0 rejected: taxel 4 is saturated"
        );
    }
}
