//! The state of the page.

use std::collections::VecDeque;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::Serialize;
use tactnet_skin::packets::{
    Command, Counters, Event, Stage, SweepCommand, TactileBelief, TactileStatus, Verdict,
};

use super::objects::{Answer, Object, Objects, Score};
use super::range::Range;

/// Most lines of the traces.
const LINES: usize = 64;
/// Materials that are shown by name.
const SHOWN: usize = 5;
/// Events that are remembered.
const EVENTS: usize = 40;

/// The state of the page, sent twenty times a second.
#[derive(Serialize)]
pub(super) struct View<'a> {
    pub(super) rows: u32,
    pub(super) cols: u32,
    pub(super) steps: u32,
    /// Number of materials of the network.
    pub(super) materials: usize,
    /// Digits of the newest frame.
    pub(super) frame: &'a [f32],
    /// Of all frames so far.
    pub(super) range: &'a Range,
    /// Frames since the last view, thinned out.
    pub(super) trace: &'a [Vec<f32>],
    /// Rows of `trace` a second.
    pub(super) trace_hz: f64,
    pub(super) frames_per_s: f64,
    /// Of the newest sweep.
    pub(super) belief: Option<&'a Shown>,
    pub(super) object: &'a Object,
    pub(super) score: &'a Score,
    /// What to know about the score; empty if nothing.
    pub(super) note: &'a str,
    /// The classifier can call a material unknown, as far as its beliefs have shown.
    pub(super) tells_unknown: bool,
    /// Robot and balls, where there are some.
    pub(super) stage: Option<&'a serde_json::Value>,
    pub(super) model_version: u64,
    pub(super) counters: &'a [(&'static str, f64)],
    pub(super) events: &'a VecDeque<Line>,
    /// Status came within the last second.
    pub(super) alive: bool,
    /// Since the last status, milliseconds.
    pub(super) heard_ms: u64,
}

/// A line of the events.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Line {
    /// Milliseconds since 1970.
    at_ms: u64,
    text: String,
    /// Of an object with a truth: whether the answer was right.
    right: Option<bool>,
}

/// A belief, for people.
#[derive(Debug, Serialize)]
pub(super) struct Shown {
    sweep: u64,
    /// `anytime`, `plain` or `dropout`.
    stage: &'static str,
    frames: u32,
    latency_us: f64,
    unknown: bool,
    /// Whether the object is, where the classifier tells.
    #[serde(skip)]
    object_unknown: Option<bool>,
    posterior: Vec<(String, f32)>,
    fused: Vec<(String, f32)>,
    fused_sweeps: u32,
}

/// What has come on the channels of the classifier.
#[derive(Debug, Default)]
pub(super) struct Seen {
    pub(super) names: Vec<String>,
    pub(super) belief: Option<Shown>,
    pub(super) objects: Objects,
    pub(super) model_version: u64,
    pub(super) counters: Vec<(&'static str, f64)>,
    pub(super) events: VecDeque<Line>,
    /// Lines that nobody has asked for yet, oldest first.
    pub(super) news: VecDeque<String>,
    /// A belief said whether its material is known.
    pub(super) tells_unknown: bool,
    /// Whole sweeps are judged by dropout.
    pub(super) by_dropout: bool,
}

impl Seen {
    pub(super) fn take_command(&mut self, command: &SweepCommand) {
        match command.command() {
            Some(Command::Start) => {
                let material = command.material.as_str();
                self.objects.sweep_over(material, &self.names);
            }
            Some(Command::Reset) => {
                self.belief = None;
                if let Some(object) = self.objects.next() {
                    self.tell(object.line(), object.right());
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
        let shown = Shown {
            sweep: belief.sweep,
            stage,
            frames: belief.frames,
            latency_us: belief.latency_ns as f64 / 1e3,
            unknown: belief.verdict == Verdict::Unknown as u32,
            object_unknown: match belief.fused_verdict {
                verdict if verdict == Verdict::Known as u32 => Some(false),
                verdict if verdict == Verdict::Unknown as u32 => Some(true),
                // A network that never says so has not said so now.
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
                self.tell(format!("sweep {} rejected: {text}", status.sweep), None);
            }
            _ if status.event == Event::Refused as u32 => self.tell(text.into(), None),
            _ => self.add(format!("sweep {}: {text}", status.sweep), None),
        }
    }

    /// Adds what people at the terminal see, too.
    fn tell(&mut self, text: String, right: Option<bool>) {
        if self.news.len() == EVENTS {
            self.news.pop_front();
        }
        self.news.push_back(text.clone());
        self.add(text, right);
    }

    fn add(&mut self, text: String, right: Option<bool>) {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        let at_ms = now.map_or(0, |now| now.as_millis() as u64);
        self.events.push_front(Line { at_ms, text, right });
        self.events.truncate(EVENTS);
    }
}

impl Shown {
    /// Returns what all sweeps of the object say together. Where the classifier does not tell, it is unknown if most sweeps were called so.
    ///
    /// - `sweeps`: whole sweeps of the object
    fn answer(&self, sweeps: u32) -> Option<Answer> {
        let rows = match self.fused_sweeps {
            0 => &self.posterior,
            _ => &self.fused,
        };
        // Sweeps that were called unknown are not fused.
        let most = || 2 * self.fused_sweeps < sweeps;
        let known = !self.object_unknown.unwrap_or_else(most);
        let (nearest, probability) = rows.first()?;
        Some(Answer {
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
        ("sweeps judged", counters.sweeps as f64),
        ("sweeps rejected", counters.rejected as f64),
        ("sweeps called unknown", counters.unknown as f64),
        (
            "answers over the time limit",
            counters.deadline_misses as f64,
        ),
        (
            "longest wait of a reading, ms",
            (counters.worst_delay_ns as f64 / 1e4).round() / 100.0,
        ),
    ]
}

/// The lines of the traces: one a taxel, or the means of neighbours where there are too many.
pub(super) fn lines(digits: &[f32]) -> Vec<f32> {
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
        let mut seen = Seen {
            names: vec!["cork".into(), "wood".into()],
            by_dropout: true,
            ..Seen::default()
        };
        seen.take_command(&command(Command::Start, "wood"));
        for stage in [Stage::Anytime, Stage::Plain, Stage::Dropout] {
            seen.take_belief(&belief(stage, Verdict::Known, &[0.2, 0.8]));
        }
        let object = serde_json::to_value(&seen.objects.object).unwrap();
        assert_eq!(
            object,
            serde_json::json!({ "number": 1, "truth": "wood", "taught": true, "several": false, "sweeps": 1, "right": true,
                "answer": { "material": "wood", "nearest": "wood", "probability": 0.8_f32 } })
        );
        seen.take_command(&command(Command::Reset, ""));
        assert!(seen.belief.is_none() && seen.objects.object.right().is_none());
        assert_eq!(
            seen.events[0].text,
            "object 1: said wood (80 %) after 1 sweep, it was wood"
        );
        // A sweep that was called unknown is not fused: nothing else is said of the object.
        seen.take_command(&command(Command::Start, "metal"));
        seen.take_belief(&belief(Stage::Dropout, Verdict::Unknown, &[]));
        assert_eq!(seen.objects.object.right(), Some(true));
        // One of two, then one of three: most of them were called unknown.
        seen.take_belief(&belief(Stage::Dropout, Verdict::Known, &[0.2, 0.8]));
        assert_eq!(seen.objects.object.right(), Some(false));
        let mut third = belief(Stage::Dropout, Verdict::Unknown, &[0.2, 0.8]);
        seen.take_belief(&third);
        assert_eq!(seen.objects.object.right(), Some(true));
        // What the classifier says of the object goes before.
        third.fused_verdict = Verdict::Known as u32;
        seen.take_belief(&third);
        assert_eq!(seen.objects.object.right(), Some(false));
    }

    #[test]
    fn a_network_that_cannot_say_unknown_is_not_said_to_have_said_so() {
        let mut seen = Seen {
            names: vec!["cork".into(), "wood".into()],
            by_dropout: true,
            ..Seen::default()
        };
        seen.take_command(&command(Command::Start, "wood"));
        // Two sweeps of which one is fused: the other was forgotten when a material was learnt.
        for _ in 0..3 {
            seen.take_belief(&belief(Stage::Dropout, Verdict::NotTold, &[0.2, 0.8]));
        }
        assert_eq!(seen.objects.object.right(), Some(true));
    }

    #[test]
    fn rejected_sweeps_and_judged_objects_are_told_at_the_terminal() {
        let mut seen = Seen::default();
        let status = |event: Event, text: &str| TactileStatus {
            event: event as u32,
            sweep: 4,
            text: Text::new(text),
            ..TactileStatus::zeroed()
        };
        seen.take_status(&status(Event::Swapped, "version 0 serves"));
        seen.take_status(&status(Event::Rejected, "taxel 4 is saturated"));
        assert_eq!(seen.news, ["sweep 4 rejected: taxel 4 is saturated"]);
        assert_eq!(seen.events.len(), 2);
        for _ in 0..2 * EVENTS {
            seen.take_status(&status(Event::Rejected, "again"));
        }
        assert_eq!(seen.news.len(), EVENTS, "where nobody asks");
    }

    #[test]
    fn large_skins_are_drawn_as_means_of_neighbours() {
        assert_eq!(lines(&[1.0; 64]).len(), 64);
        let digits: Vec<f32> = (0..1024).map(|i| (i / 16) as f32).collect();
        assert_eq!(
            lines(&digits),
            (0..64).map(|i| i as f32).collect::<Vec<_>>()
        );
    }
}
