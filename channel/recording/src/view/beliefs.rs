//! Beliefs as columns: bars, text, one line per material, latency.

use re_sdk_types::archetypes::{LineStrips2D, Points2D, Scalars, SeriesLines, TextDocument};
use re_sdk_types::components::MediaType;
use tactnet_skin::packets::{Stage, TactileBelief};

use super::bars;
use super::scene::Stream;
use crate::RecordingError;

/// Beliefs about a finger's sweeps that are not sent yet, with the names of the materials at that time.
#[derive(Default)]
pub(super) struct BeliefColumns {
    waiting: Vec<Row>,
}

struct Row {
    time_ns: i64,
    bars: Vec<(String, f32)>,
    words: String,
    posterior: Vec<f64>,
    /// Stage and latency in ms, for complete sweeps.
    latency: Option<(&'static str, f64)>,
}

/// Stages of complete sweeps, and the names of their latencies.
const WHOLE: [(Stage, &str); 2] = [(Stage::Plain, "plain"), (Stage::Dropout, "dropout")];

/// Returns the valid probabilities.
pub(super) fn posterior(belief: &TactileBelief) -> &[f32] {
    &belief.posterior[..(belief.materials as usize).min(belief.posterior.len())]
}

impl BeliefColumns {
    /// Sends the static parts.
    pub(super) fn prepare(stream: &Stream, id: &str) -> Result<(), RecordingError> {
        stream.send_static(format!("{id}/belief/bars/outline"), &bars::outline())?;
        let names = Points2D::update_fields()
            .with_show_labels(true)
            .with_colors([bars::NAME])
            .with_radii([0.0]);
        stream.send_static(format!("{id}/belief/bars/name"), &names)?;
        for (_, stage) in WHOLE {
            let line = SeriesLines::new().with_names([stage]);
            stream.send_static(format!("{id}/latency/{stage}"), &line)?;
        }
        Ok(())
    }

    /// Names the lines of the materials.
    pub(super) fn name(
        stream: &Stream,
        id: &str,
        materials: &[String],
    ) -> Result<(), RecordingError> {
        let names = materials.iter().map(String::as_str);
        let lines = SeriesLines::new().with_names(names);
        stream.send_static(format!("{id}/belief/posterior"), &lines)
    }

    pub(super) fn show(&mut self, time_ns: i64, belief: &TactileBelief, materials: &[String]) {
        let posterior = posterior(belief);
        let stage = WHOLE
            .iter()
            .find(|(stage, _)| *stage as u32 == belief.stage);
        self.waiting.push(Row {
            time_ns,
            bars: bars::likeliest(posterior, materials),
            words: bars::words(belief, materials),
            posterior: posterior.iter().map(|p| f64::from(*p)).collect(),
            latency: stage.map(|(_, name)| (*name, belief.latency_ns as f64 / 1e6)),
        });
    }

    /// Sends all waiting beliefs.
    pub(super) fn send(&mut self, stream: &Stream, id: &str) -> Result<(), RecordingError> {
        let rows = std::mem::take(&mut self.waiting);
        if rows.is_empty() {
            return Ok(());
        }
        let times = || [stream.times(rows.iter().map(|row| row.time_ns).collect())];
        let drawn: Vec<usize> = rows.iter().map(|row| row.bars.len()).collect();
        let bars = || rows.iter().flat_map(|row| row.bars.iter().enumerate());
        let length = LineStrips2D::update_fields()
            .with_strips(bars().map(|(place, (_, p))| bars::strip(place, *p)))
            .with_radii(bars().map(|_| bars::RADIUS))
            .with_colors(bars().map(|(place, _)| bars::color(place)))
            .columns(drawn.clone());
        stream.send(format!("{id}/belief/bars/length"), times(), length)?;
        let name = Points2D::update_fields()
            .with_positions(bars().map(|(place, _)| bars::before(place)))
            .with_labels(bars().map(|(_, (name, p))| format!("{name} {:.0} %", 100.0 * p)))
            .columns(drawn);
        stream.send(format!("{id}/belief/bars/name"), times(), name)?;
        let words = TextDocument::update_fields()
            .with_many_text(rows.iter().map(|row| row.words.as_str()))
            .with_many_media_type(rows.iter().map(|_| MediaType::markdown()))
            .columns_of_unit_batches();
        stream.send(format!("{id}/belief/text"), times(), words)?;
        let posterior = Scalars::update_fields()
            .with_scalars(rows.iter().flat_map(|row| row.posterior.iter().copied()))
            .columns(rows.iter().map(|row| row.posterior.len()));
        stream.send(format!("{id}/belief/posterior"), times(), posterior)?;
        for (_, stage) in WHOLE {
            let of_stage = rows.iter().filter_map(|row| match row.latency {
                Some((name, ms)) if name == stage => Some((row.time_ns, ms)),
                _ => None,
            });
            let (times_ns, ms): (Vec<i64>, Vec<f64>) = of_stage.unzip();
            if !ms.is_empty() {
                let latency = Scalars::update_fields()
                    .with_scalars(ms)
                    .columns_of_unit_batches();
                let entity = format!("{id}/latency/{stage}");
                stream.send(entity, [stream.times(times_ns)], latency)?;
            }
        }
        Ok(())
    }
}
