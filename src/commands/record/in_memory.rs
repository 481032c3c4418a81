//! `tactnet record --before`: keeps the last seconds in memory and writes them after a trigger.

use std::time::Duration;

use anyhow::{Context, bail};
use clap::Args;
use tactnet_channel::{Bus, ChannelId, GetPort, Table, now_ns};
use tactnet_recording::{About, Counts, MemoryDump, MemoryLimits, MemoryRecorder, Trigger};

use super::RecordArgs;
use crate::output;
use crate::stop::Stop;

/// Maximum sleep, which bounds the reaction time to signals.
const LOOK: Duration = Duration::from_millis(50);

#[derive(Args)]
pub struct InMemoryArgs {
    /// Keep the last S seconds in memory, and write them after a trigger
    #[arg(long, value_name = "S", conflicts_with = "seconds")]
    before: Option<f64>,
    /// Also write the S seconds after the trigger
    #[arg(long, value_name = "S", default_value_t = 0.0, requires = "before")]
    after: f64,
    /// Channel whose first packet is the trigger, besides SIGUSR1 and Ctrl-C
    #[arg(long, value_name = "ID", requires = "before")]
    trigger: Option<String>,
    /// Maximum memory per channel, in MiB
    #[arg(long, value_name = "MIB", default_value_t = 32, requires = "before")]
    memory: usize,
}

impl InMemoryArgs {
    /// Returns the limits if the recording is in memory.
    pub fn limits(&self) -> anyhow::Result<Option<MemoryLimits>> {
        let Some(before) = self.before else {
            return Ok(None);
        };
        let before = Duration::try_from_secs_f64(before);
        Ok(Some(MemoryLimits {
            before: before.with_context(|| "--before: expected 0 or more seconds")?,
            bytes_per_channel: self.memory.saturating_mul(1 << 20),
        }))
    }
}

/// Keeps packets in memory until a trigger, and writes the file. Returns its counts and the channels whose memory was
/// too short.
///
/// - `table`: the channels to record
pub fn record(
    arguments: &RecordArgs,
    bus: &Bus,
    table: &Table,
    about: About,
    limits: MemoryLimits,
    stop: &Stop,
) -> anyhow::Result<(Counts, Vec<String>)> {
    let InMemoryArgs { after, trigger, .. } = &arguments.in_memory;
    let after = Duration::try_from_secs_f64(*after);
    let after = after.with_context(|| "--after: expected 0 or more seconds")?;
    Stop::listen_to_triggers();
    let port = trigger.as_deref().map(|id| open_trigger(bus, id));
    let port = port.transpose()?;
    let mut recorder = MemoryRecorder::start(bus, table, about, limits)?;
    say!(
        "keeping {:.1} s of {} in {:.1} MiB; SIGUSR1{} or Ctrl-C writes {}",
        limits.before.as_secs_f64(),
        output::counted(table.channels.len(), "channel"),
        recorder.memory_bytes() as f64 / f64::from(1 << 20),
        trigger
            .as_ref()
            .map_or(String::new(), |id| format!(", a packet on `{id}`")),
        arguments.out.display()
    );
    output::print(format_args!("ready"))?;
    let at_ns = loop {
        recorder.step(LOOK)?;
        if let Some(at_ns) = triggered_at(port.as_ref(), stop)? {
            break at_ns;
        }
    };
    if !recorder.trigger(&arguments.out, Trigger { at_ns, after })? {
        bail!("{}: another file is being written", arguments.out.display());
    }
    say!("triggered; writing {}", arguments.out.display());
    let dump = written(&mut recorder, stop)?;
    let short = dump.short.iter().map(|short| {
        say!(
            "`{}`: only {:.1} s before the trigger fit into the memory; `--memory` sets it",
            short.channel,
            short.seconds
        );
        short.channel.clone()
    });
    Ok((dump.counts, short.collect()))
}

fn open_trigger(bus: &Bus, id: &str) -> anyhow::Result<GetPort<u8>> {
    Ok(bus.raw_get_port(ChannelId::new(id)?)?)
}

/// Returns the time of the trigger by the channels' clock; `None` before it.
fn triggered_at(port: Option<&GetPort<u8>>, stop: &Stop) -> anyhow::Result<Option<u64>> {
    if let Some(packet) = port.map(GetPort::try_get).transpose()?.flatten() {
        let header = packet.header();
        // The clock of another host has another zero.
        return Ok(Some(if header.remote == 0 {
            header.put_ns
        } else {
            now_ns()
        }));
    }
    Ok((Stop::take_trigger() || stop.asked()).then(now_ns))
}

/// Waits until the file is complete; Ctrl-C ends the time after the trigger.
fn written(recorder: &mut MemoryRecorder, stop: &Stop) -> anyhow::Result<MemoryDump> {
    loop {
        if stop.asked() {
            recorder.cut_short();
        }
        if let Some(dump) = recorder.step(LOOK)? {
            return Ok(dump);
        }
    }
}
