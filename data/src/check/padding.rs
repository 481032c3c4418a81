//! Frames that were added to sweeps to make them equally long.

use super::fill_values::FillValues;
use super::finding;
use super::lengths::Separation;
use super::rest::{End, Rest, run_at};
use super::sweep_statistics::{JUMP, Run, SweepStatistics};
use crate::{Dataset, Finding, FindingKind, Place, Remedy, Severity};

/// Minimum length of padding with noise, in frames, and as a share of the sweep: shorter quiet tails are in every signal.
const QUIET_FRAMES: usize = 5;
const QUIET_SHARE: f64 = 0.02;
/// Minimum share of sweeps with a quiet tail; of sweeps that begin quietly, fewer may have one, or the sensor rests.
const QUIET_SWEEPS: f64 = 0.1;
const QUIET_HEADS: f64 = 0.05;
/// Maximum mean difference between frames in a quiet tail, for each taxel, as a share of that before the tail.
const QUIET_TAXEL: f32 = 0.1;

/// Padding of one sweep.
#[derive(Clone, Copy)]
struct Padding {
    sweep: usize,
    end: End,
    frames: usize,
    content: &'static str,
}

/// Returns a warning for each padded sweep, and an error if the lengths of the padding separate the materials.
pub(super) fn padding(
    dataset: &Dataset,
    sweeps: &[SweepStatistics],
    rest: &Rest<'_>,
    fills: &FillValues,
) -> Vec<Finding> {
    let equal = [End::Tail, End::Head].map(|end| equal_frames(sweeps, rest, end));
    let mut padded = equal.concat();
    if padded.is_empty() {
        padded = quiet_tails(dataset, sweeps, rest);
    }
    let mut findings: Vec<Finding> = separation(dataset, &padded).into_iter().collect();
    // Fill values are reported as such.
    padded.retain(|padding| !fills.are_in(&sweeps[padding.sweep]));
    findings.extend(padded.iter().map(|padding| describe(dataset, padding)));
    findings
}

/// Returns the sweeps that begin or end with equal frames, which no sensor at rest explains.
fn equal_frames(sweeps: &[SweepStatistics], rest: &Rest<'_>, end: End) -> Vec<Padding> {
    let mut padded = Vec::new();
    for (index, sweep) in sweeps.iter().enumerate() {
        let Some(run) = run_at(end, sweep) else {
            continue;
        };
        let is_added = match end {
            End::Head => is_added_head(index, run, rest),
            End::Tail => is_added_tail(index, sweep, run, rest),
        };
        if is_added {
            let is_zero = rest.is_zero(index, run);
            padded.push(Padding {
                sweep: index,
                end,
                frames: run.frames,
                content: if is_zero { "are zero" } else { "are equal" },
            });
        }
    }
    padded
}

fn is_added_tail(index: usize, sweep: &SweepStatistics, run: &Run, rest: &Rest<'_>) -> bool {
    // A sensor that begins at rest may end so.
    if rest.is_like(End::Head, index, run) || rest.is_like_own(End::Head, index, run) {
        return false;
    }
    if rest.is_gradual(End::Tail, index, run) {
        return false;
    }
    let is_usual = rest.is_like(End::Tail, index, run);
    let is_no_accident = (rest.is_fine || !is_usual) && rest.is_no_accident(index, run);
    let jumps = sweep.top_change > 0.0 && run.change_in > JUMP * sweep.top_change;
    is_no_accident || jumps
}

fn is_added_head(index: usize, run: &Run, rest: &Rest<'_>) -> bool {
    if rest.is_like(End::Tail, index, run) || rest.is_like_own(End::Tail, index, run) {
        return false;
    }
    if rest.is_gradual(End::Head, index, run) {
        return false;
    }
    // Other sensors may rest before a contact.
    let is_usual = rest.is_like(End::Head, index, run);
    (rest.is_fine || !is_usual) && rest.is_no_accident(index, run)
}

/// Returns the sweeps whose motion ends at once and leaves noise, if other sweeps do not begin so.
fn quiet_tails(dataset: &Dataset, sweeps: &[SweepStatistics], rest: &Rest<'_>) -> Vec<Padding> {
    let all = sweeps.len() as f64;
    let least = QUIET_FRAMES.max((QUIET_SHARE * dataset.shape().steps as f64) as usize);
    let heads = sweeps.iter().filter(|sweep| sweep.quiet_head).count();
    let tails = sweeps.iter().enumerate();
    let tails = tails.filter(|(_, sweep)| sweep.quiet_tail >= least && !sweep.quiet_head);
    let count = tails.clone().count();
    if (heads as f64) >= QUIET_HEADS * all || (count as f64) < QUIET_SWEEPS * all || count < 2 {
        return Vec::new();
    }
    // A finger that is lifted fades to the level of the sensor at rest, which is one in all sweeps.
    let starts: Vec<(usize, usize)> = tails
        .clone()
        .map(|(index, sweep)| (index, sweep.steps - sweep.quiet_tail + 1))
        .collect();
    let fading = starts.iter().filter(|(sweep, start)| {
        let before = start.saturating_sub(2);
        rest.are_near(*sweep, before, *start)
    });
    if 2 * fading.count() >= starts.len() && rest.are_one_level(&starts) {
        return Vec::new();
    }
    tails
        .filter(|(index, sweep)| is_quiet_in_all_taxels(dataset, *index, sweep.quiet_tail))
        .map(|(sweep, statistics)| Padding {
            sweep,
            end: End::Tail,
            frames: statistics.quiet_tail,
            content: "hold only noise",
        })
        .collect()
}

/// Returns true if the tail begins with a jump, or if each taxel that moves before the tail is quiet in it.
fn is_quiet_in_all_taxels(dataset: &Dataset, sweep: usize, tail: usize) -> bool {
    let shape = dataset.shape();
    let values = dataset.sweep(sweep);
    let (before, after) = values.split_at(values.len() - tail * shape.taxels());
    let frames: Vec<&[f32]> = before.chunks_exact(shape.taxels()).collect();
    let change = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>();
    let greatest = frames.windows(2).map(|pair| change(pair[0], pair[1]));
    let greatest = greatest.fold(0.0, f32::max);
    let jump = frames.last().map(|last| change(last, after));
    if jump.is_some_and(|jump| jump > JUMP * greatest && greatest > 0.0) {
        return true;
    }
    let mean_change = |values: &[f32], taxel: usize| {
        let of_taxel = values[taxel..].iter().step_by(shape.taxels());
        let pairs = of_taxel.clone().zip(of_taxel.skip(1));
        let sum: f32 = pairs.clone().map(|(a, b)| (b - a).abs()).sum();
        sum / pairs.count().max(1) as f32
    };
    (0..shape.taxels())
        .filter(|taxel| before.len() > *taxel && after.len() > *taxel)
        .all(|taxel| mean_change(after, taxel) <= QUIET_TAXEL * mean_change(before, taxel))
}

fn describe(dataset: &Dataset, padding: &Padding) -> Finding {
    let steps = dataset.steps_of(padding.sweep);
    let Padding {
        sweep,
        end,
        frames,
        content,
    } = *padding;
    let (which, step) = match end {
        End::Head => ("first", 0),
        End::Tail => ("last", steps - frames),
    };
    let message = format!(
        "{}: the {which} {frames} of {steps} frames {content} in all taxels; padded?",
        dataset.describe(sweep)
    );
    let at = Place {
        sweep: Some(sweep),
        step: Some(step),
        ..Place::default()
    };
    Finding {
        remedy: (end == End::Tail).then_some(Remedy::KeepSteps { steps: step }),
        ..finding(Severity::Warning, FindingKind::Padding, at, message)
    }
}

/// Returns an error if the lengths of the padding separate the materials.
fn separation(dataset: &Dataset, padded: &[Padding]) -> Option<Finding> {
    if padded.is_empty() || dataset.labels().len() < 2 {
        return None;
    }
    let mut lengths = vec![0; dataset.len()];
    // Frames at rest before a contact look like padding; their number may be chance.
    let tails = padded.iter().filter(|padding| padding.end == End::Tail);
    for padding in tails {
        lengths[padding.sweep] += padding.frames;
    }
    let by_length = Separation::by(dataset, &lengths)?;
    let tails = padded.iter().filter(|padding| padding.end == End::Tail);
    let shortest = tails.map(|padding| dataset.steps_of(padding.sweep) - padding.frames);
    let message = format!(
        "the length of the padding alone separates the materials: {:.0} % of the sweeps are recognised by it, {:.0} % by guessing; {} of {} sweeps are padded",
        100.0 * by_length.right,
        100.0 * by_length.guessing,
        padded.len(),
        dataset.len(),
    );
    Some(Finding {
        remedy: shortest.min().map(|steps| Remedy::KeepSteps { steps }),
        ..finding(
            Severity::Error,
            FindingKind::Padding,
            Place::default(),
            message,
        )
    })
}
