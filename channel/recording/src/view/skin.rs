//! Frames as columns: one line per taxel, and heatmaps.

use re_sdk::log::TimeColumn;
use re_sdk_types::archetypes::{Scalars, SeriesLines, Tensor};
use re_sdk_types::components::ValueRange;
use re_sdk_types::datatypes::{TensorBuffer, TensorData};
use tactnet_skin::packets::SkinFrame;

use super::scene::Stream;
use crate::RecordingError;

/// Maximum number of frames that are sent together.
const TOGETHER: usize = 4096;
/// Interval of the heatmaps, in nanoseconds.
const HEATMAP_EVERY: i64 = 40_000_000;

/// Consecutive frames of one finger.
#[derive(Debug, Clone, Default)]
pub struct Stretch {
    /// `[frames]`, nanoseconds since the scene's origin.
    pub times_ns: Vec<i64>,
    /// Sequence numbers, `[frames]`.
    pub sequences: Vec<i64>,
    /// Digits, `[frames][taxels]`.
    pub digits: Vec<f32>,
}

/// Frames of a finger that are not sent yet.
#[derive(Default)]
pub(super) struct SkinColumns {
    waiting: Stretch,
    taxels: usize,
    shape: Option<[usize; 2]>,
    /// Smallest and largest digits so far.
    range: Option<[f32; 2]>,
    drawn_ns: Option<i64>,
    named: bool,
}

impl SkinColumns {
    pub(super) fn set_shape(&mut self, rows: usize, cols: usize) {
        if self.shape != Some([rows, cols]) {
            (self.shape, self.named) = (Some([rows, cols]), false);
        }
    }

    pub(super) fn show(
        &mut self,
        stream: &Stream,
        id: &str,
        time_ns: i64,
        frame: &SkinFrame,
    ) -> Result<(), RecordingError> {
        let digits = frame.values();
        if self.waiting.times_ns.len() >= TOGETHER || self.taxels != digits.len() {
            self.send(stream, id)?;
            self.taxels = digits.len();
        }
        self.waiting.times_ns.push(time_ns);
        self.waiting.sequences.push(frame.sequence as i64);
        self.waiting.digits.extend_from_slice(digits);
        Ok(())
    }

    /// Adds consecutive frames; the lines are interrupted after them.
    pub(super) fn show_stretch(
        &mut self,
        stream: &Stream,
        id: &str,
        stretch: Stretch,
    ) -> Result<(), RecordingError> {
        self.send(stream, id)?;
        let Some(last_ns) = stretch.times_ns.last().copied() else {
            return Ok(());
        };
        self.taxels = stretch.digits.len() / stretch.times_ns.len();
        self.waiting = stretch;
        self.send(stream, id)?;
        let nothing = Scalars::update_fields()
            .with_scalars(Vec::<f64>::new())
            .columns([0]);
        stream.send(
            format!("{id}/traces"),
            [stream.times(vec![last_ns + 1])],
            nothing,
        )
    }

    /// Sends all traces and some heatmaps.
    pub(super) fn send(&mut self, stream: &Stream, id: &str) -> Result<(), RecordingError> {
        let waiting = std::mem::take(&mut self.waiting);
        let (frames, taxels) = (waiting.times_ns.len(), self.taxels);
        if frames == 0 || taxels == 0 {
            return Ok(());
        }
        let [rows, cols] = match self.shape {
            Some([rows, cols]) if rows * cols == taxels => [rows, cols],
            _ => square(taxels),
        };
        if !self.named {
            let names = (0..taxels).map(|taxel| format!("{}, {}", taxel / cols, taxel % cols));
            stream.send_static(
                format!("{id}/traces"),
                &SeriesLines::new().with_names(names),
            )?;
            self.named = true;
        }
        let (mut times_ns, mut tensors, mut ranges) = (Vec::new(), Vec::new(), Vec::new());
        for (&time_ns, digits) in waiting.times_ns.iter().zip(waiting.digits.chunks(taxels)) {
            let range = self.range_with(digits);
            // The clock may have been set back.
            let due = self
                .drawn_ns
                .is_none_or(|drawn_ns| time_ns < drawn_ns || time_ns - drawn_ns >= HEATMAP_EVERY);
            if due {
                self.drawn_ns = Some(time_ns);
                let shape = vec![rows as u64, cols as u64];
                let buffer = TensorBuffer::F32(digits.to_vec().into());
                times_ns.push(time_ns);
                tensors.push(TensorData::new(shape, buffer).with_dim_names(["row", "col"]));
                ranges.push(range);
            }
        }
        let traces = Scalars::update_fields()
            .with_scalars(waiting.digits.iter().map(|digit| f64::from(*digit)))
            .columns(std::iter::repeat_n(taxels, frames));
        let indexes = [
            stream.times(waiting.times_ns),
            TimeColumn::new_sequence("frame", waiting.sequences),
        ];
        stream.send(format!("{id}/traces"), indexes, traces)?;
        let heatmaps = Tensor::update_fields()
            .with_many_value_range(ranges)
            .with_many_data(tensors)
            .columns_of_unit_batches();
        stream.send(format!("{id}/heatmap"), [stream.times(times_ns)], heatmaps)
    }

    /// Returns the range of all digits so far, including these. Values that are not numbers are ignored.
    fn range_with(&mut self, digits: &[f32]) -> ValueRange {
        for &digit in digits.iter().filter(|digit| digit.is_finite()) {
            let [low, high] = self.range.unwrap_or([digit, digit]);
            self.range = Some([low.min(digit), high.max(digit)]);
        }
        let [low, high] = self.range.unwrap_or([0.0, 1.0]).map(f64::from);
        ValueRange::from([low, high.max(low + 1.0)])
    }
}

/// Returns rows and columns: a square if possible, otherwise one row.
fn square(taxels: usize) -> [usize; 2] {
    let side = taxels.isqrt();
    if side * side == taxels {
        [side, side]
    } else {
        [1, taxels]
    }
}
