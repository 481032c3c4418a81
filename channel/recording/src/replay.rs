//! Replay of a recording onto channels, and comparison of the beliefs.

mod frame_losses;
mod sweep_beliefs;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;
use tactnet_channel::{Bus, GetPort, Priority, PutPort, Start, Table, Wait};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{SkinFrame, SweepCommand, TactileBelief};

use crate::{Entry, RecordedPacket, Recording, RecordingError};
pub use frame_losses::FrameLosses;
pub use sweep_beliefs::SweepBeliefs;

/// Time after the last frame at which the replay stops waiting for beliefs.
const SILENCE: Duration = Duration::from_millis(500);

/// Maximum pause, in seconds. Longer ones (damaged time stamps, idle robot) are shortened to it.
const LONGEST_PAUSE_S: f64 = 60.0;

/// Counts of the replayed packets, and the beliefs about them.
#[derive(Debug, Default)]
pub struct Played {
    /// Duration of the replay, in seconds.
    pub seconds: f64,
    /// Number of frames that were put.
    pub frames: usize,
    /// Number of commands that were put.
    pub commands: usize,
    /// Number of pauses over one minute that were shortened.
    pub pauses_cut: usize,
    /// Sequence number of the last frame of each finger.
    pub last_frames: BTreeMap<u32, u64>,
    /// Beliefs in order of arrival.
    pub beliefs: Vec<TactileBelief>,
}

/// Result of a replay.
#[derive(Debug, Serialize)]
pub struct ReplayReport {
    /// Version of this document: 1.
    pub schema_version: u32,
    /// Git commit of the program.
    pub git: &'static str,
    /// Duration of the replay, in seconds.
    pub seconds: f64,
    /// Speed relative to the recording.
    pub speed: f64,
    /// Number of frames that were put.
    pub frames: usize,
    /// Number of these frames that the classifier lost.
    pub frames_lost: u64,
    /// Number of commands that were put.
    pub commands: usize,
    /// Number of pauses over one minute that were shortened: damaged time stamps or an idle robot.
    pub pauses_cut: usize,
    /// Beliefs of the replay.
    #[serde(flatten)]
    pub replayed: SweepBeliefs,
    /// Beliefs of the recording about the replayed frames.
    pub recorded: SweepBeliefs,
    /// True if every recorded belief was reproduced bit by bit, with label, verdict and strangeness; `null` without
    /// recorded beliefs.
    pub identical: Option<bool>,
    /// Number of recorded beliefs that were not reproduced.
    pub differing: usize,
    /// True if another network than the recorded one was requested.
    pub another_asked: bool,
    /// Reason why the end of the recording is missing, if it is.
    pub cut: Option<String>,
}

impl ReplayReport {
    /// Compares replayed with recorded beliefs.
    ///
    /// - `git`: git commit of the program
    /// - `another_asked`: true if another network than the recorded one was requested
    ///
    /// # Errors
    /// The recorded table has a wrong section of the classifier.
    pub fn new(
        git: &'static str,
        recording: &Recording,
        played: Played,
        frames_lost: u64,
        speed: f64,
        another_asked: bool,
    ) -> Result<Self, RecordingError> {
        let mut recorded = SweepBeliefs::recorded(recording)?;
        let replayed = SweepBeliefs::of(&played.beliefs);
        // Sweeps that were not replayed cannot be compared.
        recorded.about.retain(|belief| {
            played
                .last_frames
                .get(&belief.finger)
                .is_some_and(|last| belief.last_frame <= *last)
        });
        let differing = recorded.missing_in(&replayed);
        Ok(Self {
            schema_version: 1,
            git,
            seconds: played.seconds,
            speed,
            frames: played.frames,
            frames_lost,
            commands: played.commands,
            pauses_cut: played.pauses_cut,
            identical: (!recorded.about.is_empty()).then_some(differing == 0),
            differing,
            another_asked,
            replayed,
            recorded,
            cut: recording.cut.clone(),
        })
    }
}

/// Puts frames and commands onto the channels at their recorded times, and collects the beliefs about them.
///
/// Pauses of over one minute are shortened to one minute.
///
/// - `speed`: speed relative to the recording
/// - `stopped`: ends the replay when it returns true
///
/// # Errors
/// A channel is missing or has failed.
pub fn play(
    recording: &Recording,
    bus: &Bus,
    table: &Table,
    speed: f64,
    stopped: &dyn Fn() -> bool,
) -> Result<Played, RecordingError> {
    let config = ServeConfig::of(table)?;
    let beliefs = bus.get_port::<TactileBelief>(config.belief.as_str(), Start::Now)?;
    let mut player = Player::open(bus, &config)?;
    let over = &AtomicBool::new(false);
    let begun = Instant::now();
    let beliefs = std::thread::scope(|scope| -> Result<_, RecordingError> {
        let over_now = EndOnDrop(over);
        let listener = scope.spawn(move || collect_beliefs(&beliefs, over));
        player.play(recording, begun, speed, stopped)?;
        drop(over_now);
        listener
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })?;
    Ok(Played {
        seconds: begun.elapsed().as_secs_f64(),
        beliefs,
        ..player.played
    })
}

/// Gets beliefs until `over` is set and none has arrived for a while.
fn collect_beliefs(
    port: &GetPort<TactileBelief>,
    over: &AtomicBool,
) -> Result<Vec<TactileBelief>, RecordingError> {
    let mut beliefs = Vec::new();
    let mut newest = Instant::now();
    while !over.load(Ordering::Relaxed) || newest.elapsed() < SILENCE {
        let patience = Wait::Block {
            timeout: Duration::from_millis(20),
        };
        if let Some(belief) = port.get(patience)? {
            beliefs.extend(belief.first());
            newest = Instant::now();
        } else if !over.load(Ordering::Relaxed) {
            newest = Instant::now();
        }
    }
    Ok(beliefs)
}

/// Puts recorded frames and commands onto the channels.
struct Player<'a> {
    commands: PutPort<SweepCommand>,
    /// Number and port of each finger, by channel.
    skins: BTreeMap<&'a str, (u32, PutPort<SkinFrame>)>,
    played: Played,
}

impl<'a> Player<'a> {
    fn open(bus: &Bus, config: &'a ServeConfig) -> Result<Self, RecordingError> {
        let mut skins = BTreeMap::new();
        for (number, finger) in (0..).zip(&config.fingers) {
            let port = bus.put_port(finger.as_str(), Priority::High)?;
            skins.insert(&**finger, (number, port));
        }
        Ok(Self {
            commands: bus.put_port(config.command.as_str(), Priority::High)?,
            skins,
            played: Played::default(),
        })
    }

    /// Puts every packet at its time, until `stopped` returns true.
    fn play(
        &mut self,
        recording: &Recording,
        begun: Instant,
        speed: f64,
        stopped: &dyn Fn() -> bool,
    ) -> Result<(), RecordingError> {
        let is_input = |entry: &&Entry| {
            matches!(
                entry.packet,
                RecordedPacket::Frame(_) | RecordedPacket::Command(_)
            )
        };
        let entries = || recording.entries.iter().filter(is_input);
        let mut before_ns = entries().next().map_or(0, |entry| entry.time_ns);
        let mut due = 0.0;
        for entry in entries() {
            // Entries are ordered by time.
            let pause = entry.time_ns.saturating_sub(before_ns) as f64 / 1e9;
            before_ns = entry.time_ns;
            self.played.pauses_cut += usize::from(pause > LONGEST_PAUSE_S);
            due += pause.min(LONGEST_PAUSE_S) / speed;
            if !wait_until(begun, due, stopped) {
                break;
            }
            self.put(entry)?;
        }
        Ok(())
    }

    fn put(&mut self, entry: &Entry) -> Result<(), RecordingError> {
        match &entry.packet {
            RecordedPacket::Frame(frame) => {
                let Some((number, skin)) = self.skins.get(&*entry.channel) else {
                    return Err(RecordingError::NoChannel {
                        channel: entry.channel.to_string(),
                    });
                };
                skin.put_copy(&[**frame])?;
                self.played.last_frames.insert(*number, frame.sequence);
                self.played.frames += 1;
            }
            RecordedPacket::Command(command) => {
                self.commands.put_copy(&[*command])?;
                self.played.commands += 1;
            }
            _ => {}
        }
        Ok(())
    }
}

/// Waits until `due` seconds after `begun`. Returns false if `stopped` returns true first.
fn wait_until(begun: Instant, due: f64, stopped: &dyn Fn() -> bool) -> bool {
    loop {
        if stopped() {
            return false;
        }
        let left = due - begun.elapsed().as_secs_f64();
        if left <= 0.0 {
            return true;
        }
        std::thread::sleep(Duration::from_secs_f64(left.min(0.05)));
    }
}

/// Ends the listener when dropped, also after an error.
struct EndOnDrop<'a>(&'a AtomicBool);

impl Drop for EndOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
