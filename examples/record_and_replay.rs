//! Records a robot's channels to an MCAP file, reads it back, and replays it on the channels.
//!
//!     cargo run --release --example record_and_replay [FILE.mcap]

use std::path::PathBuf;
use std::time::Duration;

use tactnet_channel::{Bus, Domain, Hub, Priority, Start, now_ns, remove_bus};
use tactnet_recording::{About, RecordedPacket, Recorder, Recording};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{MAX_TAXELS, SkinFrame};

/// Number of frames that are recorded.
const FRAMES: u64 = 300;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let file = std::env::args()
        .nth(1)
        .map_or(folder.path().join("frames.mcap"), PathBuf::from);

    // Names, sizes and rates of the channels; a hub owns them.
    let config = ServeConfig::default();
    let table = config.table(&format!("example{}", std::process::id()));
    let hub = Hub::spawn(&table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let finger = config.fingers[0].as_str();
    let skin = bus.put_port::<SkinFrame>(finger, Priority::High)?;

    let mut recorder = Recorder::start(&bus, &table, &file, &About::default())?;
    for sequence in 0..FRAMES {
        let mut digits = [0.0; MAX_TAXELS];
        digits[0] = sequence as f32;
        skin.put_copy(&[SkinFrame {
            sequence,
            sensor_time_ns: now_ns(),
            taxels: 16,
            reserved: 0,
            digits,
        }])?;
        recorder.step(Duration::from_millis(1))?;
    }
    let counts = recorder.finish()?;
    println!("recorded {} frames, {} lost", counts.frames, counts.lost);

    let recording = Recording::read(&file)?;
    let listener = bus.get_port::<SkinFrame>(finger, Start::Now)?;
    let mut replayed = 0;
    for entry in &recording.entries {
        let RecordedPacket::Frame(frame) = &entry.packet else {
            continue;
        };
        skin.put_copy(&[**frame])?;
        let came = listener.try_get()?.ok_or("a frame did not come")?;
        if bytes(&came[0]) == bytes(frame) {
            replayed += 1;
        }
    }
    println!("replayed {replayed} of {FRAMES} frames, bit by bit");

    drop((skin, listener, bus));
    hub.stop()?;
    remove_bus(&table)?;
    if replayed == FRAMES {
        Ok(())
    } else {
        Err("the recording is not what was put".into())
    }
}

fn bytes(frame: &SkinFrame) -> &[u8] {
    bytemuck::bytes_of(frame)
}
