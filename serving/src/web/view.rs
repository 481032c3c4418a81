//! State of the live page.

use std::collections::VecDeque;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::Serialize;
use tactnet_skin::packets::{
    Command, Counters, Event, Stage, SweepCommand, TactileBelief, TactileStatus, Verdict,
};

use super::likeness_banner::{LikenessBanner, is_verdict};
use super::objects::{Object, Objects, Prediction, Score};
use super::range::DisplayRange;

/// Maximum number of traces.
const MAX_TRACES: usize = 64;
/// Number of materials shown by name.
const SHOWN_MATERIALS: usize = 5;
/// Number of events kept for the page.
const KEPT_EVENTS: usize = 40;

/// State of the page as JSON, sent twenty times a second.
#[derive(Serialize)]
pub(super) struct View<'a> {
    pub(super) rows: u32,
    pub(super) cols: u32,
    pub(super) steps: u32,
    /// Number of materials of the network.
    pub(super) materials: usize,
    /// Values of the newest frame, in digits.
    pub(super) frame: &'a [f32],
    /// Value range of all frames so far.
    pub(super) range: &'a DisplayRange,
    /// Thinned-out frames since the last update.
    pub(super) trace: &'a [Vec<f32>],
    /// Rows of `trace` per second.
    pub(super) trace_hz: f64,
    pub(super) frames_per_s: f64,
    /// Belief of the newest sweep.
    pub(super) belief: Option<&'a BeliefView>,
    pub(super) object: &'a Object,
    pub(super) score: &'a Score,
    /// Note beside the score; empty if there is none.
    pub(super) note: &'a str,
    /// True if a belief has had a verdict, so that the classifier can predict unknown.
    pub(super) tells_unknown: bool,
    /// Difference of the sweeps from the training data, while they are unlike it.
    pub(super) unlike: Option<&'a str>,
    /// State of the catching stage, if there is one.
    pub(super) stage: Option<&'a serde_json::Value>,
    pub(super) model_version: u64,
    pub(super) counters: &'a [(&'static str, f64)],
    pub(super) events: &'a VecDeque<EventLine>,
    /// True if a status packet arrived within the last second.
    pub(super) alive: bool,
    /// Time since the last status packet, in ms.
    pub(super) heard_ms: u64,
}

/// An event in the page's list.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct EventLine {
    /// Time in ms since 1970.
    at_ms: u64,
    text: String,
    /// For an object with a known material: true if the prediction is correct.
    right: Option<bool>,
}

/// A belief as the page shows it.
#[derive(Debug, Serialize)]
pub(super) struct BeliefView {
    sweep: u64,
    /// `anytime`, `plain` or `dropout`.
    stage: &'static str,
    frames: u32,
    latency_us: f64,
    unknown: bool,
    /// True if the object is unknown; `None` without a verdict.
    #[serde(skip)]
    object_unknown: Option<bool>,
    posterior: Vec<(String, f32)>,
    fused: Vec<(String, f32)>,
    fused_sweeps: u32,
}

/// State collected from the classifier's channels.
#[derive(Debug, Default)]
pub(super) struct ClassifierState {
    pub(super) names: Vec<String>,
    pub(super) belief: Option<BeliefView>,
    pub(super) objects: Objects,
    pub(super) model_version: u64,
    pub(super) counters: Vec<(&'static str, f64)>,
    pub(super) events: VecDeque<EventLine>,
    /// Messages not yet taken, oldest first.
    pub(super) messages: VecDeque<String>,
    /// True once a belief has had a verdict.
    pub(super) tells_unknown: bool,
    pub(super) banner: LikenessBanner,
    /// True if dropout beliefs decide complete sweeps.
    pub(super) by_dropout: bool,
}

impl ClassifierState {
    pub(super) fn take_command(&mut self, command: &SweepCommand) {
        match command.command() {
            Some(Command::Start) => {
                let material = command.material.as_str();
                self.objects.start_sweep(material, &self.names);
            }
            Some(Command::Reset) => {
                self.belief = None;
                if let Some(object) = self.objects.next() {
                    self.announce(object.line(), object.right());
                }
            }
            _ => {}
        }
    }

    pub(super) fn take_belief(&mut self, belief: &TactileBelief) {
        let stage = match belief.stage {
            stage if stage == Stage::Anytime as u32 => "anytime",
            stage if stage == Stage::Plain as u32 => "plain",
            _ => "dropout",
        };
        self.model_version = belief.model_version;
        self.tells_unknown |= belief.verdict != Verdict::NotTold as u32;
        let shown = BeliefView {
            sweep: belief.sweep,
            stage,
            frames: belief.frames,
            latency_us: belief.latency_ns as f64 / 1e3,
            unknown: belief.verdict == Verdict::Unknown as u32,
            object_unknown: match belief.fused_verdict {
                verdict if verdict == Verdict::Known as u32 => Some(false),
                verdict if verdict == Verdict::Unknown as u32 => Some(true),
                // A network without verdicts never predicts unknown.
                _ if belief.verdict == Verdict::NotTold as u32 => Some(false),
                _ => None,
            },
            posterior: largest(&belief.posterior, &self.names),
            fused: largest(&belief.fused, &self.names),
            fused_sweeps: belief.fused_sweeps,
        };
        let last = if self.by_dropout { "dropout" } else { "plain" };
        if stage == last
            && let Some(answer) = shown.answer(self.objects.object.sweeps() + 1)
        {
            self.objects.judge(answer);
        }
        self.belief = Some(shown);
    }

    pub(super) fn take_status(&mut self, status: &TactileStatus) {
        self.counters = counters(&status.counters);
        let text = status.text.as_str();
        if [Event::Swapped as u32, Event::Adapted as u32].contains(&status.event) {
            self.banner = LikenessBanner::default();
        }
        if is_verdict(status) {
            if status.finger == 0 && self.banner.take(status) {
                self.announce(format!("sweep {}: {text}", status.sweep), None);
            }
            return;
        }
        match &self.belief {
            Some(belief) if status.event == Event::Classified as u32 => {
                let said = match belief.posterior.first() {
                    _ if belief.unknown => "unknown material".into(),
                    Some((name, p)) => format!("{name} ({:.0} %)", 100.0 * p),
                    None => return,
                };
                let truth = self.objects.object.truth();
                let was = truth.map_or(String::new(), |truth| format!(", it was {truth}"));
                self.add(format!("sweep {}: {said}{was}", status.sweep), None);
            }
            _ if text.is_empty() || status.event == Event::Reset as u32 => {}
            _ if status.event == Event::Rejected as u32 => {
                self.announce(format!("sweep {} rejected: {text}", status.sweep), None);
            }
            _ if [
                Event::Refused as u32,
                Event::Masked as u32,
                Event::Adapted as u32,
            ]
            .contains(&status.event) =>
            {
                self.announce(text.into(), None);
            }
            _ => self.add(format!("sweep {}: {text}", status.sweep), None),
        }
    }

    /// Adds an event that is also printed in the terminal.
    fn announce(&mut self, text: String, right: Option<bool>) {
        if self.messages.len() == KEPT_EVENTS {
            self.messages.pop_front();
        }
        self.messages.push_back(text.clone());
        self.add(text, right);
    }

    fn add(&mut self, text: String, right: Option<bool>) {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        let at_ms = now.map_or(0, |now| now.as_millis() as u64);
        self.events.push_front(EventLine { at_ms, text, right });
        self.events.truncate(KEPT_EVENTS);
    }
}

impl BeliefView {
    /// Returns the prediction from all sweeps of the object. Without a verdict the object is unknown if most of its
    /// sweeps were.
    ///
    /// - `sweeps`: number of complete sweeps of the object
    fn answer(&self, sweeps: u32) -> Option<Prediction> {
        let rows = match self.fused_sweeps {
            0 => &self.posterior,
            _ => &self.fused,
        };
        // Sweeps predicted unknown are not fused.
        let most = || 2 * self.fused_sweeps < sweeps;
        let known = !self.object_unknown.unwrap_or_else(most);
        let (nearest, probability) = rows.first()?;
        Some(Prediction {
            material: known.then(|| nearest.clone()),
            nearest: nearest.clone(),
            probability: *probability,
        })
    }
}

fn counters(counters: &Counters) -> Vec<(&'static str, f64)> {
    vec![
        ("readings", counters.frames as f64),
        ("lost readings", counters.dropped_frames as f64),
        ("sweeps classified", counters.sweeps as f64),
        ("sweeps rejected", counters.rejected as f64),
        ("sweeps predicted unknown", counters.unknown as f64),
        ("missed deadlines", counters.deadline_misses as f64),
        (
            "longest processing delay, ms",
            (counters.worst_delay_ns as f64 / 1e4).round() / 100.0,
        ),
    ]
}

/// Returns the values of the traces: one per taxel, or the means of neighbours on large skins.
pub(super) fn trace_values(digits: &[f32]) -> Vec<f32> {
    let together = digits.len().div_ceil(MAX_TRACES).max(1);
    let groups = digits.chunks(together);
    groups
        .map(|group| group.iter().sum::<f32>() / group.len() as f32)
        .collect()
}

/// Returns the most probable materials.
fn largest(probabilities: &[f32], names: &[String]) -> Vec<(String, f32)> {
    let mut all: Vec<(String, f32)> = names
        .iter()
        .cloned()
        .zip(probabilities.iter().copied())
        .collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.truncate(SHOWN_MATERIALS);
    all
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_skin::packets::Text;

    use super::*;

    fn command(kind: Command, material: &str) -> SweepCommand {
        SweepCommand {
            kind: kind as u32,
            material: Text::new(material),
            ..SweepCommand::zeroed()
        }
    }

    fn belief(stage: Stage, verdict: Verdict, fused: &[f32]) -> TactileBelief {
        let mut belief = TactileBelief {
            stage: stage as u32,
            verdict: verdict as u32,
            fused_sweeps: u32::from(!fused.is_empty()),
            ..TactileBelief::zeroed()
        };
        belief.posterior[..2].copy_from_slice(&[0.75, 0.25]);
        belief.fused[..fused.len()].copy_from_slice(fused);
        belief
    }

    #[test]
    fn whole_sweeps_are_judged_once_and_a_reset_forgets_them() {
        let mut state = ClassifierState {
            names: vec!["cork".into(), "wood".into()],
            by_dropout: true,
            ..ClassifierState::default()
        };
        state.take_command(&command(Command::Start, "wood"));
        for stage in [Stage::Anytime, Stage::Plain, Stage::Dropout] {
            state.take_belief(&belief(stage, Verdict::Known, &[0.2, 0.8]));
        }
        let object = serde_json::to_value(&state.objects.object).unwrap();
        assert_eq!(
            object,
            serde_json::json!({ "number": 1, "truth": "wood", "taught": true, "several": false, "sweeps": 1, "right": true,
                "answer": { "material": "wood", "nearest": "wood", "probability": 0.8_f32 } })
        );
        state.take_command(&command(Command::Reset, ""));
        assert!(state.belief.is_none() && state.objects.object.right().is_none());
        assert_eq!(
            state.events[0].text,
            "object 1: said wood (80 %) after 1 sweep, it was wood"
        );
        // A sweep predicted unknown is not fused, so the object has no other prediction.
        state.take_command(&command(Command::Start, "metal"));
        state.take_belief(&belief(Stage::Dropout, Verdict::Unknown, &[]));
        assert_eq!(state.objects.object.right(), Some(true));
        // One of two, then one of three: most sweeps are unknown.
        state.take_belief(&belief(Stage::Dropout, Verdict::Known, &[0.2, 0.8]));
        assert_eq!(state.objects.object.right(), Some(false));
        let mut third = belief(Stage::Dropout, Verdict::Unknown, &[0.2, 0.8]);
        state.take_belief(&third);
        assert_eq!(state.objects.object.right(), Some(true));
        // The object's own verdict takes precedence.
        third.fused_verdict = Verdict::Known as u32;
        state.take_belief(&third);
        assert_eq!(state.objects.object.right(), Some(false));
    }

    #[test]
    fn a_network_without_verdicts_never_predicts_unknown() {
        let mut state = ClassifierState {
            names: vec!["cork".into(), "wood".into()],
            by_dropout: true,
            ..ClassifierState::default()
        };
        state.take_command(&command(Command::Start, "wood"));
        // One of two sweeps is fused; the other was discarded when a material was enrolled.
        for _ in 0..3 {
            state.take_belief(&belief(Stage::Dropout, Verdict::NotTold, &[0.2, 0.8]));
        }
        assert_eq!(state.objects.object.right(), Some(true));
    }

    #[test]
    fn rejected_sweeps_and_judged_objects_are_told_at_the_terminal() {
        let mut state = ClassifierState::default();
        let status = |event: Event, text: &str| TactileStatus {
            event: event as u32,
            sweep: 4,
            text: Text::new(text),
            ..TactileStatus::zeroed()
        };
        state.take_status(&status(Event::Swapped, "version 0 serves"));
        state.take_status(&status(Event::Rejected, "taxel 4 is saturated"));
        assert_eq!(state.messages, ["sweep 4 rejected: taxel 4 is saturated"]);
        assert_eq!(state.events.len(), 2);
        for _ in 0..2 * KEPT_EVENTS {
            state.take_status(&status(Event::Rejected, "again"));
        }
        assert_eq!(state.messages.len(), KEPT_EVENTS, "where nobody asks");
    }

    #[test]
    fn large_skins_are_drawn_as_means_of_neighbours() {
        assert_eq!(trace_values(&[1.0; 64]).len(), 64);
        let digits: Vec<f32> = (0..1024).map(|i| (i / 16) as f32).collect();
        assert_eq!(
            trace_values(&digits),
            (0..64).map(|i| i as f32).collect::<Vec<_>>()
        );
    }
}
