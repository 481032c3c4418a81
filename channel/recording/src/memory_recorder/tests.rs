//! Tests of the recorder in memory, on channels within this process.

use std::sync::Arc;

use bytemuck::Zeroable;
use tactnet_channel::{ChannelConfig, Domain, GetPort, Packet, Priority, PutPort, Start};
use tactnet_skin::packets::{ModelNames, SkinFrame, SweepCommand};

use super::*;
use crate::{RecordedPacket, Recording};

const LIMITS: MemoryLimits = MemoryLimits {
    before: Duration::from_millis(300),
    bytes_per_channel: 1 << 22,
};

/// A bus within this process, and a folder for files.
struct Lab {
    bus: Bus,
    table: Table,
    folder: tempfile::TempDir,
}

fn config<T: Packet>() -> ChannelConfig {
    ChannelConfig {
        put_ports: 2,
        depth: 1024,
        history: 1,
        ..ChannelConfig::of::<T>(2)
    }
}

impl Lab {
    fn new() -> Self {
        let table = Table::new("memory")
            .with("frames", config::<SkinFrame>())
            .with("commands", config::<SweepCommand>())
            .with("names", config::<ModelNames>());
        Self {
            bus: Bus::open(Domain::Process, &table).unwrap(),
            table,
            folder: tempfile::tempdir().unwrap(),
        }
    }

    fn recorder(&self, limits: MemoryLimits) -> MemoryRecorder {
        MemoryRecorder::start(&self.bus, &self.table, About::default(), limits).unwrap()
    }

    fn put<T: Packet>(&self, channel: &str) -> PutPort<T> {
        self.bus.put_port(channel, Priority::Normal).unwrap()
    }

    /// Writes a file and reads it.
    fn dump(&self, recorder: &mut MemoryRecorder, trigger: Trigger) -> (MemoryDump, Recording) {
        let path = self.folder.path().join(format!("{}.mcap", trigger.at_ns));
        assert!(recorder.trigger(&path, trigger).unwrap());
        assert!(!recorder.trigger(&path, trigger).unwrap(), "one at a time");
        loop {
            if let Some(dump) = recorder.step(Duration::from_millis(5)).unwrap() {
                return (dump, Recording::read(&path).unwrap());
            }
        }
    }
}

fn frame(sequence: u64) -> SkinFrame {
    SkinFrame {
        sequence,
        ..SkinFrame::zeroed()
    }
}

fn command(motion: u64) -> SweepCommand {
    SweepCommand {
        motion,
        ..SweepCommand::zeroed()
    }
}

/// Channel, number, time of the put and put-port of a packet.
type Seen = (Arc<str>, u64, u64, u64);

/// Gets all packets of a channel, as another component sees them.
fn seen<T: Packet>(id: &str, port: &GetPort<T>, number: fn(&T) -> u64) -> Vec<Seen> {
    let packets = std::iter::from_fn(|| port.try_get().unwrap());
    packets
        .flat_map(|packet| {
            let header = *packet.header();
            let of = |item: &T| (Arc::from(id), number(item), header.put_ns, header.sender);
            packet.iter().map(of).collect::<Vec<_>>()
        })
        .collect()
}

/// Returns the packets of a recording with the times of the channels' clock.
fn written(recording: &Recording) -> Vec<Seen> {
    let zero = recording.channel_clock_zero_ns.unwrap();
    let entries = recording.entries.iter().map(|entry| {
        let number = match &entry.packet {
            RecordedPacket::Frame(frame) => frame.sequence,
            RecordedPacket::Command(command) => command.motion,
            other => panic!("{other:?}"),
        };
        let sender = entry.sender.unwrap();
        (entry.channel.clone(), number, entry.time_ns - zero, sender)
    });
    entries.collect()
}

#[test]
fn a_dump_has_exactly_the_packets_around_the_trigger_with_times_and_senders() {
    let lab = Lab::new();
    let mut recorder = lab.recorder(LIMITS);
    let frames = lab.bus.get_port("frames", Start::Now).unwrap();
    let commands = lab.bus.get_port("commands", Start::Now).unwrap();
    let puts = [lab.put::<SkinFrame>("frames"), lab.put("frames")];
    let other = lab.put::<SweepCommand>("commands");
    let mut at_ns = 0;
    // 600 ms, of which 300 before and 50 after the trigger are written.
    for number in 0..300 {
        puts[number as usize % 2]
            .put_copy(&[frame(number), frame(1000 + number)])
            .unwrap();
        if number % 10 == 0 {
            other.put_copy(&[command(number)]).unwrap();
        }
        if number == 200 {
            at_ns = now_ns();
        }
        assert_eq!(recorder.step(Duration::ZERO).unwrap(), None);
        std::thread::sleep(Duration::from_millis(2));
    }
    let after = Duration::from_millis(50);
    let (dump, recording) = lab.dump(&mut recorder, Trigger { at_ns, after });
    let mut expected = seen("frames", &frames, |frame: &SkinFrame| frame.sequence);
    expected.extend(seen("commands", &commands, |command: &SweepCommand| {
        command.motion
    }));
    let all = expected.len();
    let window = at_ns - 300_000_000..=at_ns + 50_000_000;
    expected.retain(|(_, _, put_ns, _)| window.contains(put_ns));
    expected.sort_by_key(|(_, _, put_ns, _)| *put_ns);
    // Also on a busy machine, which sleeps longer.
    assert!(
        10 < expected.len() && expected.len() < all,
        "{}",
        expected.len()
    );
    assert_eq!(written(&recording), expected);
    assert_eq!((recording.cut, recording.foreign), (None, 0));
    assert_eq!(dump.counts.messages, expected.len() as u64);
    assert_eq!((dump.counts.channels, dump.counts.lost), (3, 0));
    assert!(dump.short.is_empty(), "{:?}", dump.short);
    // Both put-ports of a channel.
    let senders: std::collections::BTreeSet<_> = expected.iter().map(|seen| seen.3).collect();
    assert_eq!(senders.len(), 3);
}

#[test]
fn packets_after_the_trigger_are_waited_for_and_a_second_dump_has_its_own_window() {
    let lab = Lab::new();
    let mut recorder = lab.recorder(LIMITS);
    let put = lab.put::<SkinFrame>("frames");
    put.put_copy(&[frame(1)]).unwrap();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(50));
            put.put_copy(&[frame(2)]).unwrap();
        });
        let trigger = Trigger {
            at_ns: now_ns(),
            after: Duration::from_millis(200),
        };
        let (_, recording) = lab.dump(&mut recorder, trigger);
        let numbers: Vec<_> = written(&recording).iter().map(|seen| seen.1).collect();
        assert_eq!(numbers, [1, 2]);
        assert!(now_ns() > trigger.at_ns + 200_000_000);
    });
    std::thread::sleep(LIMITS.before);
    put.put_copy(&[frame(3)]).unwrap();
    let trigger = Trigger {
        at_ns: now_ns(),
        after: Duration::ZERO,
    };
    let (_, recording) = lab.dump(&mut recorder, trigger);
    let numbers: Vec<_> = written(&recording).iter().map(|seen| seen.1).collect();
    assert_eq!(numbers, [3]);
}

#[test]
fn memory_is_reserved_once_and_a_channel_that_needs_more_is_named() {
    let lab = Lab::new();
    let limits = MemoryLimits {
        bytes_per_channel: 20 * (size_of::<SkinFrame>() + 16),
        ..LIMITS
    };
    let mut recorder = lab.recorder(limits);
    let reserved = recorder.memory_bytes();
    assert!(reserved <= 3 * limits.bytes_per_channel, "{reserved}");
    let (put, other) = (lab.put::<SkinFrame>("frames"), lab.put("commands"));
    other.put_copy(&[command(5)]).unwrap();
    for number in 0..50 {
        put.put_copy(&[frame(number)]).unwrap();
        recorder.step(Duration::ZERO).unwrap();
    }
    assert_eq!(recorder.memory_bytes(), reserved);
    let trigger = Trigger {
        at_ns: now_ns(),
        after: Duration::ZERO,
    };
    let (dump, recording) = lab.dump(&mut recorder, trigger);
    let numbers: Vec<_> = written(&recording).iter().map(|seen| seen.1).collect();
    let newest = 30..50;
    assert_eq!(numbers, [5].into_iter().chain(newest).collect::<Vec<_>>());
    let [short] = &dump.short[..] else {
        panic!("{dump:?}");
    };
    assert!(
        short.channel == "frames" && short.seconds < 0.3,
        "{short:?}"
    );
}

#[test]
fn names_that_were_put_long_before_are_in_the_file() {
    let lab = Lab::new();
    let names = lab.put::<ModelNames>("names");
    let named = |version| ModelNames {
        version,
        ..ModelNames::zeroed()
    };
    names.put_copy(&[named(1)]).unwrap();
    let mut recorder = lab.recorder(LIMITS);
    recorder.step(Duration::ZERO).unwrap();
    names.put_copy(&[named(2)]).unwrap();
    recorder.step(Duration::ZERO).unwrap();
    std::thread::sleep(LIMITS.before + Duration::from_millis(20));
    names.put_copy(&[named(3)]).unwrap();
    let trigger = Trigger {
        at_ns: now_ns(),
        after: Duration::ZERO,
    };
    let (_, recording) = lab.dump(&mut recorder, trigger);
    let versions: Vec<_> = recording
        .entries
        .iter()
        .map(|entry| match &entry.packet {
            RecordedPacket::Model(names) => names.version,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(versions, [2, 3]);
}

#[test]
fn an_existing_file_is_not_overwritten_and_the_recorder_goes_on() {
    let lab = Lab::new();
    let mut recorder = lab.recorder(LIMITS);
    let path = lab.folder.path().join("there.mcap");
    std::fs::write(&path, "mine").unwrap();
    let trigger = Trigger {
        at_ns: now_ns(),
        after: Duration::ZERO,
    };
    let refused = recorder.trigger(&path, trigger).unwrap_err().to_string();
    assert!(refused.contains("exists"), "{refused}");
    assert_eq!(std::fs::read(&path).unwrap(), b"mine");
    lab.dump(&mut recorder, trigger);
}
