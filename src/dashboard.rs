//! `tactnet dashboard`: a live page in the browser; it looks on and can die without anybody noticing.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Args;
use serde::Serialize;
use tactnet_channel::{Bus, Domain, GetPort, Priority, PutPort, Start, Table, Wait};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{
    Command, Event, ModelNames, SkinFrame, Stage, SweepCommand, TactileBelief, TactileStatus, Text,
    Verdict,
};
use tokio::sync::watch;

use crate::stop::Stop;
use crate::{output, web};

/// The page, which needs nothing else. It shows the first finger.
const PAGE: &str = include_str!("dashboard.html");
const EVERY: Duration = Duration::from_millis(50);
/// Every so many frames one is drawn.
const DRAWN: u64 = 3;
/// Materials that are shown.
const SHOWN: usize = 8;
/// Events that are remembered.
const EVENTS: usize = 12;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet dashboard --table robot.toml                            http://127.0.0.1:8750\n  \
    tactnet dashboard --table robot.toml --listen 0.0.0.0:8750      for everybody in the network")]
pub struct DashboardArgs {
    /// The table of channels
    #[arg(long, value_name = "FILE")]
    table: PathBuf,
    /// Where to answer browsers
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8750")]
    listen: SocketAddr,
}

/// What the page gets, twenty times a second.
#[derive(Default, Serialize)]
struct View {
    rows: u32,
    cols: u32,
    /// Digits of the newest frame.
    frame: Vec<f32>,
    /// Frames since the last view, thinned out.
    trace: Vec<Vec<f32>>,
    frames_per_s: f64,
    sweep: u64,
    motion: u64,
    /// `anytime`, `plain` or `dropout`.
    stage: &'static str,
    frames: u32,
    steps: u32,
    latency_us: f64,
    entropy: f32,
    /// `known`, `unknown` or nothing.
    verdict: &'static str,
    posterior: Vec<(String, f32)>,
    fused: Vec<(String, f32)>,
    fused_sweeps: u32,
    model_version: u64,
    counters: Vec<(&'static str, f64)>,
    events: VecDeque<String>,
    /// Whether status came within the last second.
    alive: bool,
}

struct Ports {
    skin: GetPort<SkinFrame>,
    beliefs: GetPort<TactileBelief>,
    status: GetPort<TactileStatus>,
    model: GetPort<ModelNames>,
}

/// Runs the command.
pub fn run(arguments: &DashboardArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let table = Table::load(&arguments.table)?;
    let config = ServeConfig::of(&table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let ports = Ports {
        skin: bus.get_port(config.fingers[0].as_str(), Start::Now)?,
        beliefs: bus.get_port(config.belief.as_str(), Start::Now)?,
        status: bus.get_port(config.status.as_str(), Start::Now)?,
        model: bus.get_port(config.model.as_str(), Start::History(1))?,
    };
    let commands = Arc::new(bus.put_port::<SweepCommand>(config.command.as_str(), Priority::High)?);
    let (tell, news) = watch::channel::<Arc<str>>("{}".into());
    let web = web::dashboard(arguments.listen, PAGE, news, move || reset(&commands))?;
    eprintln!("open http://{} in a browser; Ctrl-C ends", web.address());
    output::print(format_args!("ready"))?;
    let (mut view, mut names) = (View::default(), Vec::new());
    let (mut begun, mut heard, mut frames) = (Instant::now(), Instant::now(), 0_u64);
    while !stop.asked() {
        // Sleeps until the next frame or the next view.
        if let Some(frame) = ports.skin.get(Wait::Block { timeout: EVERY })? {
            frames += 1;
            if let Some(frame) = frame.first() {
                if frame.sequence % DRAWN == 0 {
                    view.trace.push(frame.values().to_vec());
                }
                view.frame = frame.values().to_vec();
            }
        }
        while let Some(model) = ports.model.try_get()? {
            if let Some(model) = model.first() {
                names = model.names[..(model.materials as usize).min(model.names.len())]
                    .iter()
                    .map(|name| name.as_str().to_string())
                    .collect();
                (view.rows, view.cols, view.steps) = (model.rows, model.cols, model.steps);
            }
        }
        while let Some(belief) = ports.beliefs.try_get()? {
            if let Some(belief) = belief.first()
                && belief.finger == 0
            {
                view.take_belief(belief, &names);
            }
        }
        while let Some(status) = ports.status.try_get()? {
            heard = Instant::now();
            if let Some(status) = status.first() {
                view.take_status(status);
            }
        }
        if begun.elapsed() >= EVERY {
            let rate = frames as f64 / begun.elapsed().as_secs_f64();
            view.frames_per_s += (rate - view.frames_per_s) * 0.2;
            view.alive = heard.elapsed() < Duration::from_secs(1);
            // Nobody may be looking.
            let _ = tell.send(serde_json::to_string(&view)?.into());
            view.trace.clear();
            (begun, frames) = (Instant::now(), 0);
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn reset(commands: &PutPort<SweepCommand>) {
    // A page that asks twice is served once more; nothing is lost if this fails.
    let _ = commands.put_copy(&[SweepCommand {
        kind: Command::Reset as u32,
        finger: 0,
        motion: 0,
        sweeps: 0,
        reserved: 0,
        material: Text::default(),
    }]);
}

/// The most probable materials.
fn largest(probabilities: &[f32], names: &[String]) -> Vec<(String, f32)> {
    let mut all: Vec<(String, f32)> = names
        .iter()
        .cloned()
        .zip(probabilities.iter().copied())
        .collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.truncate(SHOWN);
    all
}

impl View {
    fn take_belief(&mut self, belief: &TactileBelief, names: &[String]) {
        self.sweep = belief.sweep;
        self.motion = belief.motion;
        self.stage = match belief.stage {
            stage if stage == Stage::Anytime as u32 => "anytime",
            stage if stage == Stage::Plain as u32 => "plain",
            _ => "dropout",
        };
        self.frames = belief.frames;
        self.latency_us = belief.latency_ns as f64 / 1e3;
        self.entropy = belief.entropy;
        self.verdict = match belief.verdict {
            verdict if verdict == Verdict::Known as u32 => "known",
            verdict if verdict == Verdict::Unknown as u32 => "unknown",
            _ => "",
        };
        self.posterior = largest(&belief.posterior, names);
        self.fused = largest(&belief.fused, names);
        self.fused_sweeps = belief.fused_sweeps;
        self.model_version = belief.model_version;
    }

    fn take_status(&mut self, status: &TactileStatus) {
        let counters = &status.counters;
        self.counters = vec![
            ("frames", counters.frames as f64),
            ("lost frames", counters.dropped_frames as f64),
            ("sweeps judged", counters.sweeps as f64),
            ("sweeps rejected", counters.rejected as f64),
            ("unknown materials", counters.unknown as f64),
            ("deadlines missed", counters.deadline_misses as f64),
            (
                "worst delay, ms",
                (counters.worst_delay_ns as f64 / 1e4).round() / 100.0,
            ),
        ];
        let judged = match self.posterior.first() {
            Some((name, p)) if status.event == Event::Judged as u32 => match self.verdict {
                "unknown" => "unknown material".to_string(),
                _ => format!("{name}, {:.0} %", 100.0 * p),
            },
            _ => String::new(),
        };
        let text = match status.text.as_str() {
            "" => judged.as_str(),
            text => text,
        };
        if !text.is_empty() {
            self.events
                .push_front(format!("sweep {}: {text}", status.sweep));
            self.events.truncate(EVENTS);
        }
    }
}
