//! A live page in the browser. It only looks on: nobody notices when it ends.

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tactnet_channel::{Bus, GetPort, Priority, PutPort, Start, Wait};
use tactnet_skin::packets::{
    Command, ModelNames, SkinFrame, SweepCommand, TactileBelief, TactileStatus, Text,
};
use tactnet_skin::{ServeConfig, material_names};
use tokio::sync::watch;

use super::WebServer;
use super::range::Range;
use super::view::{Seen, View, lines};
use crate::ServeError;

const EVERY: Duration = Duration::from_millis(50);
/// Every so many frames one is drawn.
const DRAWN: u64 = 3;

/// The page on its address, and the channels that it shows. It shows the first finger.
pub struct Dashboard {
    web: WebServer,
    skin: GetPort<SkinFrame>,
    commands: GetPort<SweepCommand>,
    beliefs: GetPort<TactileBelief>,
    status: GetPort<TactileStatus>,
    model: GetPort<ModelNames>,
    views: watch::Sender<Arc<str>>,
    seen: Seen,
    /// Shape of the skin, and length and rate of a sweep.
    names: Option<Box<ModelNames>>,
    /// Digits of the newest frame.
    frame: Vec<f32>,
    range: Range,
    /// Frames since the last view, thinned out.
    trace: Vec<Vec<f32>>,
    frames_per_s: f64,
    /// Since the last view.
    begun: Instant,
    frames: u64,
    /// When the last status came.
    heard: Instant,
    /// What to know about the score.
    note: String,
    stage: Option<StageSource>,
}

/// Looks at what a stage shows, and returns it as the page's program reads it.
pub type StageSource = Box<dyn FnMut() -> Result<serde_json::Value, ServeError> + Send>;

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
        let commands = bus.get_port(config.command.as_str(), Start::Now)?;
        let beliefs = bus.get_port(config.belief.as_str(), Start::Now)?;
        let status = bus.get_port(config.status.as_str(), Start::Now)?;
        let model = bus.get_port(config.model.as_str(), Start::History(1))?;
        let resets = bus.put_port::<SweepCommand>(config.command.as_str(), Priority::High)?;
        let resets = Arc::new(resets);
        let (views, shown) = watch::channel::<Arc<str>>("{}".into());
        let now = Instant::now();
        Ok(Self {
            web: super::dashboard(listener, shown, move || reset(&resets))?,
            skin,
            commands,
            beliefs,
            status,
            model,
            views,
            seen: Seen::default(),
            names: None,
            frame: Vec::new(),
            range: Range::default(),
            trace: Vec::new(),
            frames_per_s: 0.0,
            begun: now,
            frames: 0,
            heard: now,
            note: String::new(),
            stage: None,
        })
    }

    /// Shows a line beside the score.
    pub fn set_note(&mut self, note: String) {
        self.note = note;
    }

    /// Draws robot and balls above the answer; the source is asked twenty times a second.
    pub fn show_stage(&mut self, stage: StageSource) {
        self.stage = Some(stage);
    }

    /// Returns the address that it listens at.
    pub fn address(&self) -> SocketAddr {
        self.web.address()
    }

    /// Returns the link that opens the page.
    pub fn link(&self) -> String {
        self.web.link_to("/")
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
                    self.trace.push(lines(frame.values()));
                }
                self.frame = frame.values().to_vec();
                self.range.widen(&self.frame);
            }
        }
        while let Some(packet) = self.model.try_get()? {
            if let Some(model) = packet.first() {
                self.take_names(model);
            }
        }
        // Before the beliefs: they are of the object and the sweep that were commanded before them.
        while let Some(packet) = self.commands.try_get()? {
            if let Some(command) = packet.first()
                && command.finger == 0
            {
                self.seen.take_command(command);
            }
        }
        while let Some(packet) = self.beliefs.try_get()? {
            if let Some(belief) = packet.first()
                && belief.finger == 0
            {
                self.seen.take_belief(belief);
            }
        }
        while let Some(packet) = self.status.try_get()? {
            self.heard = Instant::now();
            if let Some(status) = packet.first() {
                self.seen.take_status(status);
            }
        }
        if self.begun.elapsed() >= EVERY {
            let stage = self.stage.as_mut().map(|look| look()).transpose()?;
            self.send_view(stage.as_ref());
        }
        Ok(())
    }

    /// Returns a line for every object that was judged and everything that was rejected or refused since the last call, oldest first; only the
    /// newest of many.
    pub fn take_news(&mut self) -> Vec<String> {
        self.seen.news.drain(..).collect()
    }

    fn take_names(&mut self, model: &ModelNames) {
        self.seen.names = material_names(model);
        self.seen.by_dropout = model.mc_samples > 0;
        self.names = Some(Box::new(*model));
    }

    fn send_view(&mut self, stage: Option<&serde_json::Value>) {
        let rate = self.frames as f64 / self.begun.elapsed().as_secs_f64();
        self.frames_per_s += (rate - self.frames_per_s) * 0.2;
        let (heard, seen) = (self.heard.elapsed(), &self.seen);
        let mut view = View {
            materials: seen.names.len(),
            frame: &self.frame,
            range: &self.range,
            trace: &self.trace,
            frames_per_s: self.frames_per_s,
            belief: seen.belief.as_ref(),
            object: &seen.objects.object,
            score: &seen.objects.score,
            note: &self.note,
            tells_unknown: seen.tells_unknown,
            stage,
            model_version: seen.model_version,
            counters: &seen.counters,
            events: &seen.events,
            alive: heard < Duration::from_secs(1),
            heard_ms: heard.as_millis() as u64,
            rows: 0,
            cols: 0,
            steps: 0,
            trace_hz: self.frames_per_s / DRAWN as f64,
        };
        if let Some(names) = &self.names {
            view.rows = names.rows;
            view.cols = names.cols;
            view.steps = names.steps;
            view.trace_hz = names.sample_rate_hz / DRAWN as f64;
        }
        let text = serde_json::to_string(&view)
            .unwrap_or_else(|error| panic!("a view is plain values: {error}"));
        // Nobody may be looking.
        let _ = self.views.send(text.into());
        self.trace.clear();
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
