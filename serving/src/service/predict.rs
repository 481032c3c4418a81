//! Predictions and the belief packets that carry them.

use tactnet_channel::now_ns;
use tactnet_models::{Belief, argmax, entropy};
use tactnet_pipeline::SweepBelief;

use super::Service;
use crate::ServeError;
use tactnet_skin::packets::{MAX_MATERIALS, Stage, TactileBelief, Verdict};

impl Service {
    /// Predicts the material from the frames of the sweep so far and sends the belief.
    pub(super) fn predict(
        &mut self,
        number: usize,
        stage: Stage,
        sequence: u64,
        put_ns: u64,
    ) -> Result<(), ServeError> {
        let begun = now_ns();
        let finger = &mut self.fingers[number];
        let last = match stage {
            Stage::Anytime => false,
            Stage::Plain => self.config.mc_samples == 0,
            Stage::Dropout => true,
        };
        let mut packet = self.beliefs.loan(1)?;
        let out = &mut packet[0];
        let belief = match stage {
            Stage::Dropout => finger.classifier.classify_by_dropout(),
            Stage::Anytime | Stage::Plain => finger.classifier.classify(),
        };
        let verdict = verdict_of(belief.unknown);
        *out = bytemuck::Zeroable::zeroed();
        write_sweep(out, &belief, verdict);
        // An unknown sweep must not count towards one of the known materials.
        if last && verdict != Verdict::Unknown {
            finger.classifier.fuse();
        }
        if last {
            finger.classifier.end_sweep();
        }
        out.fused_verdict = verdict_of(finger.classifier.object_is_unknown()) as u32;
        write_fused(out, finger.classifier.fused());
        out.sweep = finger.sweep;
        out.motion = finger.motion;
        out.model_version = self.names.version;
        out.last_frame = sequence;
        out.stage = stage as u32;
        out.finger = number as u32;
        out.frames = finger.taken as u32;
        out.filled_in = finger.segmenter.window().filled_in() as u32;
        let now = now_ns();
        out.latency_ns = now.saturating_sub(put_ns);
        let (latency, whole) = (out.latency_ns, stage != Stage::Anytime);
        self.beliefs.put(packet)?;
        self.counters.beliefs += 1;
        if last && verdict == Verdict::Unknown {
            self.counters.unknown += 1;
        }
        let deadline_ms = self.config.deadline_ms(stage, self.names.sample_rate_hz);
        if whole && latency as f64 > 1e6 * deadline_ms {
            self.counters.deadline_misses += 1;
        }
        self.metrics.count_prediction(stage, now - begun);
        Ok(())
    }
}

/// Writes the prediction of this sweep alone into the packet.
fn write_sweep(out: &mut TactileBelief, belief: &SweepBelief<'_>, verdict: Verdict) {
    let log_p = belief.log_probability;
    out.materials = log_p.len() as u32;
    out.label = argmax(log_p) as u32;
    out.verdict = verdict as u32;
    out.entropy = belief.entropy as f32;
    out.strangeness = belief.strangeness.unwrap_or(0.0) as f32;
    out.threshold = belief.threshold.unwrap_or(0.0) as f32;
    for (out, log_p) in out.posterior.iter_mut().zip(log_p) {
        *out = log_p.exp() as f32;
    }
}

/// Writes the fused prediction of all sweeps into the packet.
fn write_fused(out: &mut TactileBelief, fused: &Belief) {
    let mut probabilities = [0.0; MAX_MATERIALS];
    let probabilities = &mut probabilities[..out.materials as usize];
    fused.probabilities_into(probabilities);
    out.fused_sweeps = fused.sweeps() as u32;
    out.fused_label = argmax(probabilities) as u32;
    for (out, p) in out.fused.iter_mut().zip(probabilities.iter()) {
        *out = *p as f32;
    }
    probabilities.iter_mut().for_each(|p| *p = p.ln());
    out.fused_entropy = entropy(probabilities) as f32;
}

fn verdict_of(unknown: Option<bool>) -> Verdict {
    match unknown {
        None => Verdict::NotTold,
        Some(false) => Verdict::Known,
        Some(true) => Verdict::Unknown,
    }
}
