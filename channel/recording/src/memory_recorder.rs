//! Recorder in memory with a pre-trigger: it writes the last seconds before an event.
//!
//! ```text
//! channels ──> MemoryRecorder::step ──> a ring per channel ── after a trigger ──> ChannelFile ──> FILE.mcap
//! ```
//!
//! The rings take all packets also while a file is written. So a slow disk delays the file, and packets are lost only
//! if a ring is shorter than that delay.

use std::path::Path;
use std::time::Duration;

use tactnet_channel::{Bus, Table, now_ns};

use crate::channel_file::{ChannelFile, Piece};
use crate::described_channels::{Channel, DescribedChannels};
use crate::packet_ring::{PacketRing, PacketStamp};
use crate::recorder::About;
use crate::{Counts, RecordingError};

/// Maximum rate for which a ring reserves memory, in items per second: four times that of the fastest packets here.
const FASTEST_HZ: f64 = 4000.0;
/// Length of the ring of a channel that is needed to read others, such as the names of materials.
const KEPT_NAMES: usize = 16;
/// Sleep between two attempts to pass packets to a writer that is busy.
const BUSY: Duration = Duration::from_millis(1);

/// Limits of a recording in memory.
#[derive(Debug, Clone, Copy)]
pub struct MemoryLimits {
    /// Time before the trigger that is kept.
    pub before: Duration,
    /// Maximum memory of a channel, in bytes.
    pub bytes_per_channel: usize,
}

/// Event whose surroundings are written.
#[derive(Debug, Clone, Copy)]
pub struct Trigger {
    /// Time of the event by the host's monotonic clock ([`tactnet_channel::now_ns`], and the header of a packet of this
    /// host), in nanoseconds.
    pub at_ns: u64,
    /// Time after it that is written, too.
    pub after: Duration,
}

/// A channel whose memory was too short for the requested time.
#[derive(Debug, Clone, PartialEq)]
pub struct ShortWindow {
    /// Id of the channel.
    pub channel: String,
    /// Time before the trigger that the file has of it, in seconds.
    pub seconds: f64,
}

/// Content of a written file.
#[derive(Debug, Clone, PartialEq)]
pub struct MemoryDump {
    /// Written messages. Losses count from the start of the recorder.
    pub counts: Counts,
    /// Channels whose memory was too short.
    pub short: Vec<ShortWindow>,
}

/// Keeps the last packets of all described channels of a table in memory, and writes them to a file after a trigger.
///
/// All memory is reserved at the start: for each channel as much as its packets need at 4 kHz, but at most the limit.
pub struct MemoryRecorder {
    followed: DescribedChannels,
    rings: Vec<PacketRing>,
    table: Table,
    about: About,
    before: Duration,
    writing: Option<Writing>,
}

impl MemoryRecorder {
    /// Opens the channels and reserves the memory.
    ///
    /// - `table`: all channels of the bus, or those of [`select_channels`](crate::select_channels)
    ///
    /// # Errors
    /// No hub runs; no channel of the table can be recorded.
    pub fn start(
        bus: &Bus,
        table: &Table,
        about: About,
        limits: MemoryLimits,
    ) -> Result<Self, RecordingError> {
        let followed = DescribedChannels::open(bus, table)?;
        let fast = (limits.before.as_secs_f64() * FASTEST_HZ) as usize;
        let rings = followed.channels().iter().map(|channel| {
            let kind = channel.kind;
            let packets = match kind.is_needed_to_read_others() {
                true => KEPT_NAMES,
                false => fast,
            };
            PacketRing::new(kind.layout.bytes, packets, limits.bytes_per_channel)
        });
        Ok(Self {
            rings: rings.collect(),
            followed,
            table: bus.table().clone(),
            about,
            before: limits.before,
            writing: None,
        })
    }

    /// Returns the reserved memory, in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.rings.iter().map(PacketRing::bytes).sum()
    }

    /// Starts to write a file with the packets around an event. Returns false while another file is being written.
    ///
    /// # Errors
    /// The file exists or cannot be written.
    pub fn trigger(&mut self, path: &Path, trigger: Trigger) -> Result<bool, RecordingError> {
        if self.writing.is_some() {
            return Ok(false);
        }
        let epoch_ns = self.followed.epoch_ns;
        let at_ns = epoch_ns + trigger.at_ns;
        let begin_ns = at_ns.saturating_sub(nanoseconds(self.before));
        let end_ns = at_ns.saturating_add(nanoseconds(trigger.after));
        let file = ChannelFile::create(path, &self.table, &self.about, &self.followed, begin_ns)?;
        let channels = self.followed.channels();
        let of_ring = |(channel, ring): (&Channel, &PacketRing)| {
            let oldest = ring.get(ring.begin())?.0.put_ns;
            ring.has_replaced_since(begin_ns).then(|| ShortWindow {
                channel: channel.id.to_string(),
                seconds: at_ns.saturating_sub(oldest) as f64 / 1e9,
            })
        };
        // The names may be older than the window.
        let is_names = |place: usize| channels[place].kind.is_needed_to_read_others();
        let short = channels.iter().zip(&self.rings).filter_map(of_ring);
        self.writing = Some(Writing {
            file,
            begin_ns,
            end_ns,
            next: self.rings.iter().map(PacketRing::begin).collect(),
            names: (0..channels.len())
                .filter(|place| is_names(*place))
                .collect(),
            waiting: None,
            short: short.collect(),
            counts: Counts {
                channels: channels.len(),
                ..Counts::default()
            },
        });
        Ok(true)
    }

    /// Ends the time after the trigger now, if a file is being written.
    pub fn cut_short(&mut self) {
        let now_ns = self.now_ns();
        if let Some(writing) = &mut self.writing {
            writing.end_ns = writing.end_ns.min(now_ns);
        }
    }

    /// Waits for packets, at most for `patience`, and keeps them. Returns the content of a file that is now complete.
    ///
    /// # Errors
    /// The channels have failed; the file cannot be written. The recorder can go on after an error of the file.
    pub fn step(&mut self, patience: Duration) -> Result<Option<MemoryDump>, RecordingError> {
        let patience = match self.writing {
            Some(_) => patience.min(BUSY),
            None => patience,
        };
        self.followed.wait(patience)?;
        let (is_over, end_ns) = match &self.writing {
            Some(writing) => (self.now_ns() > writing.end_ns, writing.end_ns),
            None => (false, 0),
        };
        let mut came_in_time = false;
        self.followed.follow(|item| {
            came_in_time |= item.put_ns <= end_ns;
            let stamp = PacketStamp {
                put_ns: item.put_ns,
                sender: item.sender,
            };
            self.rings[item.place].push(stamp, item.bytes);
        })?;
        let Some(mut writing) = self.writing.take() else {
            return Ok(None);
        };
        let has_all = writing.pass_on(&self.rings, self.followed.channels())?;
        if !(has_all && is_over && !came_in_time) {
            self.writing = Some(writing);
            return Ok(None);
        }
        writing.file.end()?;
        writing.counts.lost += self.followed.lost();
        Ok(Some(MemoryDump {
            counts: writing.counts,
            short: writing.short,
        }))
    }

    /// Returns the time of day by the channels' clock, in nanoseconds since 1970.
    fn now_ns(&self) -> u64 {
        self.followed.epoch_ns + now_ns()
    }
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

/// A file that is being written.
struct Writing {
    file: ChannelFile,
    /// First and last time of the window, in nanoseconds since 1970.
    begin_ns: u64,
    end_ns: u64,
    /// Number of the next packet of each ring.
    next: Vec<u64>,
    /// Channels whose last packet before the window is still to be written.
    names: Vec<usize>,
    /// Message for which the writer had no place.
    waiting: Option<Piece>,
    short: Vec<ShortWindow>,
    counts: Counts,
}

impl Writing {
    /// Passes packets of the window to the writer, ordered by time, as long as it takes them. Returns true if it has
    /// all.
    fn pass_on(
        &mut self,
        rings: &[PacketRing],
        channels: &[Channel],
    ) -> Result<bool, RecordingError> {
        while let Some(piece) = self
            .waiting
            .take()
            .or_else(|| self.next_name(rings, channels))
            .or_else(|| self.next_piece(rings, channels))
        {
            let kind = channels[piece.place].kind;
            self.waiting = self.file.try_send(piece)?;
            if self.waiting.is_some() {
                return Ok(false);
            }
            self.counts.add(kind);
        }
        Ok(true)
    }

    /// Returns the last names before the window, once for each channel.
    fn next_name(&mut self, rings: &[PacketRing], channels: &[Channel]) -> Option<Piece> {
        while let Some(place) = self.names.pop() {
            let ring = &rings[place];
            let packets = (ring.begin()..ring.end())
                .rev()
                .filter_map(|at| ring.get(at));
            let mut earlier = packets.filter(|(stamp, _)| stamp.put_ns < self.begin_ns);
            if let Some((stamp, packet)) = earlier.next() {
                return Some(self.piece(&channels[place], place, stamp, packet));
            }
        }
        None
    }

    /// Returns the message of the oldest packet of the window that is left.
    fn next_piece(&mut self, rings: &[PacketRing], channels: &[Channel]) -> Option<Piece> {
        let mut oldest: Option<(u64, usize)> = None;
        for (place, ring) in rings.iter().enumerate() {
            let next = &mut self.next[place];
            if *next < ring.begin() {
                self.counts.lost += ring.begin() - *next;
                *next = ring.begin();
            }
            while let Some((stamp, _)) = ring.get(*next) {
                if (self.begin_ns..=self.end_ns).contains(&stamp.put_ns) {
                    let found = (stamp.put_ns, place);
                    oldest = Some(oldest.map_or(found, |oldest| oldest.min(found)));
                    break;
                }
                *next += 1;
            }
        }
        let (_, place) = oldest?;
        let (stamp, packet) = rings[place].get(self.next[place])?;
        self.next[place] += 1;
        Some(self.piece(&channels[place], place, stamp, packet))
    }

    fn piece(&self, channel: &Channel, place: usize, stamp: PacketStamp, packet: &[u8]) -> Piece {
        Piece {
            place,
            sender: stamp.sender,
            log_time: stamp.put_ns.max(self.begin_ns),
            publish_time: stamp.put_ns,
            data: channel.kind.to_message(packet),
        }
    }
}

#[cfg(test)]
mod tests;
