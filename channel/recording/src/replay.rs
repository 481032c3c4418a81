//! A recording back onto channels, and whether the classifier believes the same again.

mod frame_losses;
mod sweep_beliefs;

use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;
use tactnet_channel::{Bus, Priority, PutPort, Start, Table, Wait};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{SkinFrame, SweepCommand, TactileBelief};

use crate::{Entry, RecordedPacket, Recording, RecordingError};
pub use frame_losses::FrameLosses;
pub use sweep_beliefs::SweepBeliefs;

/// No belief comes so long after its last frame.
const SILENCE: Duration = Duration::from_millis(500);

/// A longer pause is a damaged time stamp or an idle robot, and is cut to this, seconds.
const LONGEST_PAUSE_S: f64 = 60.0;

/// Counts of the packets that were put onto the channels, and the beliefs that came.
#[derive(Debug)]
pub struct Played {
    /// How long it took.
    pub seconds: f64,
    /// Frames that were put.
    pub frames: usize,
    /// Commands that were put.
    pub commands: usize,
    /// Pauses of over a minute that were cut to one.
    pub pauses_cut: usize,
    /// Sequence of the last frame that was put, by finger.
    pub last_frames: BTreeMap<u32, u64>,
    /// In the order in which they came.
    pub beliefs: Vec<TactileBelief>,
}

/// Result of a replay, as `tactnet replay --json` prints it.
#[derive(Debug, Serialize)]
pub struct ReplayReport {
    /// 1.
    pub schema_version: u32,
    /// Commit of the program.
    pub git: &'static str,
    /// How long it took.
    pub seconds: f64,
    /// How much faster than it happened.
    pub speed: f64,
    /// Frames that were put.
    pub frames: usize,
    /// Frames of those that the classifier never got.
    pub frames_lost: u64,
    /// Commands that were put.
    pub commands: usize,
    /// Pauses of over a minute that were cut to one: a damaged time stamp, or a robot that did nothing.
    pub pauses_cut: usize,
    /// Beliefs that came now.
    #[serde(flatten)]
    pub replayed: SweepBeliefs,
    /// Beliefs of the recording about what was played.
    pub recorded: SweepBeliefs,
    /// Every recorded belief came again, bit by bit, with label, verdict and strangeness; `null`: there was none to compare.
    pub identical: Option<bool>,
    /// Recorded beliefs that did not come again.
    pub differing: usize,
    /// Another network than the one that the recording keeps was asked for.
    pub another_asked: bool,
    /// Why the recording's end is missing, if it is.
    pub cut: Option<String>,
}

impl ReplayReport {
    /// Compares what came with what was recorded.
    ///
    /// - `git`: commit of the program
    /// - `another_asked`: another network than the one that the recording keeps was asked for
    ///
    /// # Errors
    /// A wrong section of the classifier in the recorded table.
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
        // What was not played cannot come again.
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

impl fmt::Display for ReplayReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let alike: String = match self.identical {
            None => "the recording has none to compare".into(),
            Some(true) => "bit by bit as recorded".into(),
            Some(false) => format!(
                "{} of {} recorded ones differ{}",
                self.differing,
                self.recorded.beliefs,
                if self.another_asked {
                    ": another network, as asked"
                } else {
                    " (another network, or another version?)"
                }
            ),
        };
        write!(
            f,
            "{} frames, {} lost; {} sweeps, {} beliefs, {alike}",
            self.frames, self.frames_lost, self.replayed.sweeps, self.replayed.beliefs
        )?;
        match self.recorded.unfinished {
            0 => Ok(()),
            more => write!(
                f,
                "; {more} more in the recording, about sweeps that lack their beginning or end, are not compared"
            ),
        }
    }
}

/// Puts frames and commands onto the channels at their times, and listens to the beliefs about them. Pauses of over a minute are cut to one.
///
/// - `speed`: how much faster than it happened
/// - `stopped`: ends it early when it returns true
///
/// # Errors
/// Channels that are not there, or have broken down.
pub fn play(
    recording: &Recording,
    bus: &Bus,
    table: &Table,
    speed: f64,
    stopped: &dyn Fn() -> bool,
) -> Result<Played, RecordingError> {
    let config = ServeConfig::of(table)?;
    let beliefs = bus.get_port::<TactileBelief>(config.belief.as_str(), Start::Now)?;
    let commands = bus.put_port::<SweepCommand>(config.command.as_str(), Priority::High)?;
    let mut skins: BTreeMap<&str, (u32, PutPort<SkinFrame>)> = BTreeMap::new();
    for (number, finger) in (0..).zip(&config.fingers) {
        let port = bus.put_port(finger.as_str(), Priority::High)?;
        skins.insert(finger, (number, port));
    }
    let mut last_frames = BTreeMap::new();
    let over = &AtomicBool::new(false);
    let (mut frames, mut put_commands, mut pauses_cut) = (0, 0, 0);
    let begun = Instant::now();
    let heard = std::thread::scope(|scope| -> Result<Vec<TactileBelief>, RecordingError> {
        let over_now = EndOnDrop(over);
        let listener = scope.spawn(move || -> Result<Vec<TactileBelief>, RecordingError> {
            let mut heard = Vec::new();
            let mut newest = Instant::now();
            while !over.load(Ordering::Relaxed) || newest.elapsed() < SILENCE {
                let patience = Wait::Block {
                    timeout: Duration::from_millis(20),
                };
                if let Some(belief) = beliefs.get(patience)? {
                    heard.extend(belief.first());
                    newest = Instant::now();
                } else if !over.load(Ordering::Relaxed) {
                    newest = Instant::now();
                }
            }
            Ok(heard)
        });
        let moves = |entry: &&Entry| {
            matches!(
                entry.packet,
                RecordedPacket::Frame(_) | RecordedPacket::Command(_)
            )
        };
        let entries = || recording.entries.iter().filter(moves);
        let mut before_ns = entries().next().map_or(0, |entry| entry.time_ns);
        let mut due = 0.0;
        for entry in entries() {
            // They are in the order of their times.
            let pause = entry.time_ns.saturating_sub(before_ns) as f64 / 1e9;
            before_ns = entry.time_ns;
            pauses_cut += usize::from(pause > LONGEST_PAUSE_S);
            due += pause.min(LONGEST_PAUSE_S) / speed;
            if !wait_until(begun, due, stopped) {
                break;
            }
            match &entry.packet {
                RecordedPacket::Frame(frame) => {
                    let Some((number, skin)) = skins.get(&*entry.channel) else {
                        return Err(RecordingError::NoChannel {
                            channel: entry.channel.to_string(),
                        });
                    };
                    skin.put_copy(&[**frame])?;
                    last_frames.insert(*number, frame.sequence);
                    frames += 1;
                }
                RecordedPacket::Command(command) => {
                    commands.put_copy(&[*command])?;
                    put_commands += 1;
                }
                _ => {}
            }
        }
        drop(over_now);
        listener
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })?;
    Ok(Played {
        seconds: begun.elapsed().as_secs_f64(),
        frames,
        commands: put_commands,
        pauses_cut,
        last_frames,
        beliefs: heard,
    })
}

/// Waits until `due` seconds after `begun`; returns false when `stopped` does first.
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

/// Ends the listener, also when something went wrong.
struct EndOnDrop<'a>(&'a AtomicBool);

impl Drop for EndOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
