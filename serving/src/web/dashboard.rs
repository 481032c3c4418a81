//! A live page in the browser. It only looks on: nobody notices when it ends.

use std::collections::VecDeque;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::Serialize;
use tactnet_channel::{Bus, GetPort, Priority, PutPort, Start, Wait};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{
    Command, Event, ModelNames, SkinFrame, Stage, SweepCommand, TactileBelief, TactileStatus, Text,
    Verdict,
};
use tokio::sync::watch;

use super::WebServer;
use crate::ServeError;

/// The page, which needs nothing else. It shows the first finger.
const PAGE: &str = include_str!("dashboard.html");
const EVERY: Duration = Duration::from_millis(50);
/// Every so many frames one is drawn.
const DRAWN: u64 = 3;
/// Most lines of the traces.
const LINES: usize = 64;
/// Materials that are shown.
const SHOWN: usize = 8;
/// Events that are remembered.
const EVENTS: usize = 12;

/// The state of the page, sent twenty times a second.
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
    /// Status came within the last second.
    alive: bool,
}

/// The page on its address, and the channels that it shows.
pub struct Dashboard {
    web: WebServer,
    skin: GetPort<SkinFrame>,
    beliefs: GetPort<TactileBelief>,
    status: GetPort<TactileStatus>,
    model: GetPort<ModelNames>,
    views: watch::Sender<Arc<str>>,
    view: View,
    names: Vec<String>,
    /// Since the last view.
    begun: Instant,
    frames: u64,
    /// When the last status came.
    heard: Instant,
}

impl Dashboard {
    /// Opens the channels and answers browsers.
    ///
    /// - `listener`: see [`super::listen`]
    ///
    /// # Errors
    /// No hub; channels missing in the table; a system without threads or sockets to spare.
    pub fn open(
        bus: &Bus,
        config: &ServeConfig,
        listener: TcpListener,
    ) -> Result<Self, ServeError> {
        let skin = bus.get_port(config.fingers[0].as_str(), Start::Now)?;
        let beliefs = bus.get_port(config.belief.as_str(), Start::Now)?;
        let status = bus.get_port(config.status.as_str(), Start::Now)?;
        let model = bus.get_port(config.model.as_str(), Start::History(1))?;
        let commands = bus.put_port::<SweepCommand>(config.command.as_str(), Priority::High)?;
        let commands = Arc::new(commands);
        let (views, shown) = watch::channel::<Arc<str>>("{}".into());
        let now = Instant::now();
        Ok(Self {
            web: super::dashboard(listener, PAGE, shown, move || reset(&commands))?,
            skin,
            beliefs,
            status,
            model,
            views,
            view: View::default(),
            names: Vec::new(),
            begun: now,
            frames: 0,
            heard: now,
        })
    }

    /// Returns the address that it listens at.
    pub fn address(&self) -> SocketAddr {
        self.web.address()
    }

    /// Sleeps until the next frame or the next view, and shows all that has come.
    ///
    /// # Errors
    /// The channels have broken down.
    pub fn step(&mut self) -> Result<(), ServeError> {
        if let Some(packet) = self.skin.get(Wait::Block { timeout: EVERY })? {
            self.frames += 1;
            if let Some(frame) = packet.first() {
                if frame.sequence % DRAWN == 0 {
                    self.view.trace.push(lines(frame.values()));
                }
                self.view.frame = frame.values().to_vec();
            }
        }
        while let Some(packet) = self.model.try_get()? {
            if let Some(model) = packet.first() {
                let materials = (model.materials as usize).min(model.names.len());
                let names = model.names[..materials].iter();
                self.names = names.map(|name| name.as_str().to_string()).collect();
                self.view.rows = model.rows;
                self.view.cols = model.cols;
                self.view.steps = model.steps;
            }
        }
        while let Some(packet) = self.beliefs.try_get()? {
            if let Some(belief) = packet.first()
                && belief.finger == 0
            {
                self.view.take_belief(belief, &self.names);
            }
        }
        while let Some(packet) = self.status.try_get()? {
            self.heard = Instant::now();
            if let Some(status) = packet.first() {
                self.view.take_status(status);
            }
        }
        if self.begun.elapsed() >= EVERY {
            self.send_view();
        }
        Ok(())
    }

    fn send_view(&mut self) {
        let rate = self.frames as f64 / self.begun.elapsed().as_secs_f64();
        self.view.frames_per_s += (rate - self.view.frames_per_s) * 0.2;
        self.view.alive = self.heard.elapsed() < Duration::from_secs(1);
        let text = serde_json::to_string(&self.view)
            .unwrap_or_else(|error| panic!("a view is plain values: {error}"));
        // Nobody may be looking.
        let _ = self.views.send(text.into());
        self.view.trace.clear();
        self.begun = Instant::now();
        self.frames = 0;
    }
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

/// The lines of the traces: one a taxel, or the means of neighbours where there are too many.
fn lines(digits: &[f32]) -> Vec<f32> {
    let together = digits.len().div_ceil(LINES).max(1);
    let groups = digits.chunks(together);
    groups
        .map(|group| group.iter().sum::<f32>() / group.len() as f32)
        .collect()
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
            ("sweeps classified", counters.sweeps as f64),
            ("sweeps rejected", counters.rejected as f64),
            ("unknown materials", counters.unknown as f64),
            ("deadlines missed", counters.deadline_misses as f64),
            (
                "worst delay, ms",
                (counters.worst_delay_ns as f64 / 1e4).round() / 100.0,
            ),
        ];
        let classified = match self.posterior.first() {
            Some((name, p)) if status.event == Event::Classified as u32 => match self.verdict {
                "unknown" => "unknown material".to_string(),
                _ => format!("{name}, {:.0} %", 100.0 * p),
            },
            _ => String::new(),
        };
        let text = match status.text.as_str() {
            "" => classified.as_str(),
            text => text,
        };
        if !text.is_empty() {
            self.events
                .push_front(format!("sweep {}: {text}", status.sweep));
            self.events.truncate(EVENTS);
        }
    }
}
