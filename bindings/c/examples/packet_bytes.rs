//! Prints packets with known values as bytes, to compare them with `tests/c/packet_bytes.c` and the Python package.

use bytemuck::{Zeroable, bytes_of};
use tactnet_channel::Packet;
use tactnet_skin::packets::{
    Command, Event, MAX_MATERIALS, MAX_TAXELS, ModelNames, SkinFrame, Stage, SweepCommand,
    TactileBelief, TactileStatus, Text, Verdict,
};

fn print<T: Packet>(packet: &T) {
    let bytes = bytes_of(packet);
    let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    println!("{} {} {hex}", T::NAME, bytes.len());
}

fn main() {
    let mut frame = SkinFrame::zeroed();
    (frame.sequence, frame.sensor_time_ns, frame.taxels) = (1, 0x0102_0304_0506_0708, 2);
    frame.digits[..2].copy_from_slice(&[1.5, -0.25]);
    frame.digits[MAX_TAXELS - 1] = 3.0;
    print(&frame);
    print(&SweepCommand {
        kind: Command::Enroll as u32,
        finger: 1,
        motion: 9,
        sweeps: 3,
        reserved: 0,
        material: Text::new("grüner Filz"),
    });
    let mut belief = TactileBelief {
        sweep: 1,
        motion: 2,
        model_version: 3,
        last_frame: 4,
        latency_ns: 5,
        stage: Stage::Dropout as u32,
        finger: 6,
        frames: 7,
        filled_in: 8,
        materials: 2,
        label: 1,
        verdict: Verdict::Unknown as u32,
        entropy: 0.5,
        strangeness: 0.75,
        threshold: 1.25,
        fused_sweeps: 9,
        fused_label: 1,
        fused_entropy: 2.5,
        fused_verdict: Verdict::Known as u32,
        ..TactileBelief::zeroed()
    };
    belief.posterior[1] = 1.0;
    belief.fused[MAX_MATERIALS - 1] = 1.0;
    print(&belief);
    let mut status = TactileStatus {
        event: Event::Unreachable as u32,
        finger: 1,
        sweep: 2,
        motion: 3,
        model_version: 4,
        text: Text::new("one line"),
        ..TactileStatus::zeroed()
    };
    (status.counters.frames, status.counters.worst_delay_ns) = (5, 6);
    status.counters.allocations = 7;
    print(&status);
    let mut names = ModelNames {
        version: 1,
        sample_rate_hz: 750.0,
        steps: 1000,
        rows: 4,
        cols: 4,
        mc_samples: 50,
        materials: 2,
        ..ModelNames::zeroed()
    };
    (names.names[0], names.names[1]) = (Text::new("felt"), Text::new("cork"));
    print(&names);
}
