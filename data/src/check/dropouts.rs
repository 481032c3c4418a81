//! Stretches in which all taxels are zero or frozen, in the middle of a motion.

use super::fill_values::FillValues;
use super::finding;
use super::rest::{End, Rest};
use super::sweep_statistics::{Run, SweepStatistics};
use crate::{Dataset, Finding, FindingKind, Place, Severity};

/// Ratio of the changes before and after a dropout to the largest other change of the sweep: the signal leaves and
/// returns at once, in contrast to a finger that is lifted.
const JUMP: f32 = 3.0;
/// Minimum share of a sweep's frames for a dropout to change what is learnt.
const LARGE_SHARE: f64 = 0.1;
/// Minimum share of all frames for dropouts to change what is learnt.
const LARGE_SHARE_OF_ALL: f64 = 0.01;

/// Dropouts of one sweep.
struct Dropouts {
    sweep: usize,
    first: Run,
    frames: usize,
    runs: usize,
}

/// Returns a finding for each sweep with dropouts.
pub(super) fn dropouts(
    dataset: &Dataset,
    sweeps: &[SweepStatistics],
    rest: &Rest<'_>,
    fills: &FillValues,
) -> Vec<Finding> {
    let mut found = Vec::new();
    for (index, sweep) in sweeps.iter().enumerate() {
        let lost: Vec<&Run> = sweep
            .middle_runs()
            .filter(|run| is_dropout(index, sweep, run, rest))
            .collect();
        if let Some(&&first) = lost.first()
            && !fills.are_in(sweep)
        {
            found.push(Dropouts {
                sweep: index,
                first,
                frames: lost.iter().map(|run| run.frames).sum(),
                runs: lost.len(),
            });
        }
    }
    let all: usize = found.iter().map(|dropouts| dropouts.frames).sum();
    let is_many = all as f64 >= LARGE_SHARE_OF_ALL * dataset.frames() as f64;
    let finding_of = |found: Dropouts| {
        let steps = sweeps[found.sweep].steps;
        let is_large = found.frames as f64 >= LARGE_SHARE * steps as f64;
        let severity = if is_many || is_large {
            Severity::Error
        } else {
            Severity::Warning
        };
        let Run { start, frames, .. } = found.first;
        let state = if rest.is_zero(found.sweep, &found.first) {
            "zero"
        } else {
            "frozen"
        };
        let others = match found.runs {
            1 => String::new(),
            runs => format!("; {} frames in {runs} such stretches", found.frames),
        };
        let message = format!(
            "{}: all taxels are {state} from step {start} to {}, {frames} of {steps} frames, in the middle of a motion{others}",
            dataset.describe(found.sweep),
            start + frames - 1,
        );
        let at = Place {
            sweep: Some(found.sweep),
            step: Some(start),
            ..Place::default()
        };
        finding(severity, FindingKind::Dropout, at, message)
    };
    found.into_iter().map(finding_of).collect()
}

fn is_dropout(index: usize, sweep: &SweepStatistics, run: &Run, rest: &Rest<'_>) -> bool {
    let usual = sweep.top_change.max(rest.change());
    if rest.is_lift(index, run) {
        return false;
    }
    if usual > 0.0 && run.change_in.min(run.change_out) > JUMP * usual {
        return true;
    }
    let is_at_rest = || {
        [End::Head, End::Tail]
            .into_iter()
            .any(|end| rest.is_like(end, index, run) || rest.is_like_own(end, index, run))
    };
    (rest.is_no_accident(index, run) || rest.is_far_zero(index, run)) && !is_at_rest()
}
