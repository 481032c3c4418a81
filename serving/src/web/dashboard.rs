//! Live page in the browser. It only observes; the service does not depend on it.

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
use super::range::DisplayRange;
use super::view::{ClassifierState, View, trace_values};
use crate::ServeError;

/// Interval between two updates of the page.
const EVERY: Duration = Duration::from_millis(50);
/// Every third frame is drawn as a point of the traces.
const DRAWN: u64 = 3;

/// The page and the channels that it shows. It shows the first finger.
pub struct Dashboard {
    web: WebServer,
    skin: GetPort<SkinFrame>,
    commands: GetPort<SweepCommand>,
    beliefs: GetPort<TactileBelief>,
    status: GetPort<TactileStatus>,
    model: GetPort<ModelNames>,
    views: watch::Sender<Arc<str>>,
    state: ClassifierState,
    /// Shape of the skin, and length and sample rate of a sweep.
    names: Option<Box<ModelNames>>,
    /// Values of the newest frame, in digits.
    frame: Vec<f32>,
    range: DisplayRange,
    /// Thinned-out frames since the last update.
    trace: Vec<Vec<f32>>,
    frames_per_s: f64,
    /// Time of the last update.
    begun: Instant,
    frames: u64,
    /// Time of the last status packet.
    heard: Instant,
    /// Note beside the score; empty if there is none.
    note: String,
    stage: Option<StageSource>,
}

/// Returns the state of a catching stage in the page's JSON format.
pub type StageSource = Box<dyn FnMut() -> Result<serde_json::Value, ServeError> + Send>;

impl Dashboard {
    /// Opens the channels and serves the page.
    ///
    /// - `listener`: from [`super::listen`]
    ///
    /// # Errors
    /// Fails without a hub, if channels are missing in the table, or if no thread or socket is available.
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
            state: ClassifierState::default(),
            names: None,
            frame: Vec::new(),
            range: DisplayRange::default(),
            trace: Vec::new(),
            frames_per_s: 0.0,
            begun: now,
            frames: 0,
            heard: now,
            note: String::new(),
            stage: None,
        })
    }

    /// Sets the note beside the score.
    pub fn set_note(&mut self, note: String) {
        self.note = note;
    }

    /// Draws robot and balls above the prediction; `stage` is called twenty times a second.
    pub fn show_stage(&mut self, stage: StageSource) {
        self.stage = Some(stage);
    }

    /// Returns the address at which the server listens.
    pub fn address(&self) -> SocketAddr {
        self.web.address()
    }

    /// Returns the link that opens the page.
    pub fn link(&self) -> String {
        self.web.link_to("/")
    }

    /// Waits for the next frame or update and processes everything that has arrived.
    ///
    /// # Errors
    /// Fails if the channels break down.
    pub fn step(&mut self) -> Result<(), ServeError> {
        if let Some(packet) = self.skin.get(Wait::Block { timeout: EVERY })? {
            self.frames += 1;
            if let Some(frame) = packet.first() {
                if frame.sequence % DRAWN == 0 {
                    self.trace.push(trace_values(frame.values()));
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
        // Commands first: beliefs belong to the object and the sweep commanded before them.
        while let Some(packet) = self.commands.try_get()? {
            if let Some(command) = packet.first()
                && command.finger == 0
            {
                self.state.take_command(command);
            }
        }
        while let Some(packet) = self.beliefs.try_get()? {
            if let Some(belief) = packet.first()
                && belief.finger == 0
            {
                self.state.take_belief(belief);
            }
        }
        while let Some(packet) = self.status.try_get()? {
            self.heard = Instant::now();
            if let Some(status) = packet.first() {
                self.state.take_status(status);
            }
        }
        if self.begun.elapsed() >= EVERY {
            let stage = self.stage.as_mut().map(|look| look()).transpose()?;
            self.send_view(stage.as_ref());
        }
        Ok(())
    }

    /// Returns a line for every finished object and every rejection or refusal since the last call, oldest first. Old
    /// lines are dropped if there are many.
    pub fn take_messages(&mut self) -> Vec<String> {
        self.state.messages.drain(..).collect()
    }

    fn take_names(&mut self, model: &ModelNames) {
        self.state.names = material_names(model);
        self.state.by_dropout = model.mc_samples > 0;
        self.names = Some(Box::new(*model));
    }

    fn send_view(&mut self, stage: Option<&serde_json::Value>) {
        let rate = self.frames as f64 / self.begun.elapsed().as_secs_f64();
        self.frames_per_s += (rate - self.frames_per_s) * 0.2;
        let (heard, state) = (self.heard.elapsed(), &self.state);
        let mut view = View {
            materials: state.names.len(),
            frame: &self.frame,
            range: &self.range,
            trace: &self.trace,
            frames_per_s: self.frames_per_s,
            belief: state.belief.as_ref(),
            object: &state.objects.object,
            score: &state.objects.score,
            note: &self.note,
            tells_unknown: state.tells_unknown,
            unlike: state.banner.text(),
            stage,
            model_version: state.model_version,
            counters: &state.counters,
            events: &state.events,
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
        // Fails only if no browser is connected.
        let _ = self.views.send(text.into());
        self.trace.clear();
        self.begun = Instant::now();
        self.frames = 0;
    }
}

fn reset(commands: &PutPort<SweepCommand>) {
    // If it fails, the user presses the button again.
    let _ = commands.put_copy(&[SweepCommand {
        kind: Command::Reset as u32,
        finger: 0,
        motion: 0,
        sweeps: 0,
        reserved: 0,
        material: Text::default(),
    }]);
}
