//! Sweeps that share frames, as overlapping windows of one recording do.

use rayon::prelude::*;

use super::shared_frames::{Anchor, Candidate, Frames, SharedRun, candidates, shortest_run};
use super::sweep_statistics::SweepStatistics;
use super::{are_together, finding};
use crate::{Dataset, Finding, FindingKind, Place, Remedy, Severity};

/// Frames that a sweep shares with an earlier one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Overlap {
    pub(super) later: usize,
    pub(super) earlier: usize,
    /// First shared frame in the earlier sweep.
    start_in_earlier: usize,
    /// Shared frames of the later sweep.
    run: SharedRun,
}

/// Returns the pairs of sweeps that share a run of frames, sorted by the later sweep; not those with equal values.
pub(super) fn overlaps(dataset: &Dataset, sweeps: &[SweepStatistics]) -> Vec<Overlap> {
    let Some(run) = shortest_run(dataset.shortest()) else {
        return Vec::new();
    };
    let taxels = dataset.shape().taxels();
    let frames_of = |sweep: usize| Frames::of(dataset.sweep(sweep), taxels);
    let mut anchors: Vec<Anchor> = (0..dataset.len())
        .into_par_iter()
        .flat_map_iter(|sweep| {
            let of_sweep = frames_of(sweep).anchors(run).unwrap_or_default();
            of_sweep.into_iter().map(move |(hash, step)| Anchor {
                hash,
                sweep: sweep as u32,
                step: step as u32,
            })
        })
        .collect();
    anchors.par_sort_unstable();
    let mut candidates = candidates(&anchors);
    drop(anchors);
    candidates.retain(|pair| {
        let [earlier, later] = [pair.earlier, pair.later].map(|sweep| sweep as usize);
        sweeps[earlier].hash != sweeps[later].hash
    });
    let all_frames = dataset.frames();
    let by_sweep: Vec<&[Candidate]> = candidates.chunk_by(|a, b| a.later == b.later).collect();
    by_sweep
        .into_par_iter()
        .flat_map_iter(|pairs| {
            let later = frames_of(pairs[0].later as usize);
            pairs.iter().filter_map(move |pair| {
                let earlier = frames_of(pair.earlier as usize);
                let run = later.shared_run(&earlier, pair.lag, all_frames)?;
                Some(Overlap {
                    later: pair.later as usize,
                    earlier: pair.earlier as usize,
                    start_in_earlier: run.start.saturating_add_signed(pair.lag as isize),
                    run,
                })
            })
        })
        .collect()
}

/// Returns a finding for each sweep that shares frames with an earlier one: an error, or a warning if both are in one
/// block, so that a split can keep them together. It names the sweep with most of the frames.
pub(super) fn findings(dataset: &Dataset, overlaps: &[Overlap]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for of_sweep in overlaps.chunk_by(|a, b| a.later == b.later) {
        for together in [false, true] {
            let of_kind = of_sweep
                .iter()
                .filter(|pair| are_together(dataset, pair.earlier, pair.later) == together);
            if let Some(most) = of_kind.clone().max_by_key(|pair| pair.run.frames) {
                let mut partners: Vec<usize> = of_kind.map(|pair| pair.earlier).collect();
                partners.dedup();
                findings.push(found(dataset, most, partners.len() - 1, together));
            }
        }
    }
    findings
}

/// Returns the finding about one pair.
///
/// - `others`: number of other earlier sweeps that share frames with the later one
fn found(dataset: &Dataset, pair: &Overlap, others: usize, together: bool) -> Finding {
    let Overlap { later, earlier, .. } = *pair;
    let frames = pair.run.frames;
    let mut message = format!(
        "{} (`X[{earlier}]`) and {} (`X[{later}]`) share {frames} of {} frames, from steps {} and {} on",
        dataset.describe(earlier),
        dataset.describe(later),
        dataset.steps_of(later),
        pair.start_in_earlier,
        pair.run.start,
    );
    match others {
        0 => {}
        1 => message.push_str("; the latter shares frames with one more sweep"),
        others => message.push_str(&format!(
            "; the latter shares frames with {others} more sweeps"
        )),
    }
    if together {
        message.push_str("; both are in one block, so a split has to leave whole blocks out");
    }
    let record = &dataset.records()[later];
    let at = Place {
        material: Some(dataset.labels().name(record.label).into()),
        sweep: Some(later),
        step: Some(pair.run.start),
        ..Place::default()
    };
    let severity = match together {
        true => Severity::Warning,
        false => Severity::Error,
    };
    let finding = finding(severity, FindingKind::Overlap, at, message);
    match together {
        true => finding.with_remedy(Remedy::LeaveBlocksOut),
        false => finding,
    }
}
