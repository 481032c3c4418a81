//! What a calibrated classifier says of sweeps besides their material: unknown or not, and what else it may be.

use serde::Serialize;
use tactnet_data::SweepView;
use tactnet_pipeline::{CalibrationTarget, Classifier, Estimate, NoveltyScorer, RunDir};

use crate::output;

/// How well the promises of `train --calibrate` were kept.
#[derive(Serialize)]
pub struct Verdicts {
    promise: CalibrationTarget,
    /// Of sweeps of known materials: share called unknown.
    false_alarms: Option<Estimate>,
    /// Of sweeps of known materials: share whose material is in the prediction set.
    coverage: Option<Estimate>,
    /// Materials in a prediction set, mean over sweeps of known materials.
    set_size: Option<f64>,
    /// Materials of the data set that the classifier does not know.
    unknown_materials: Vec<String>,
    /// Of sweeps of unknown materials: share called unknown.
    detected: Option<Estimate>,
}

/// Sweeps of materials that the classifier knows, and the others.
pub fn by_known_material<'a>(
    classifier: &Classifier,
    view: &SweepView<'a>,
) -> (SweepView<'a>, SweepView<'a>) {
    let dataset = view.dataset();
    let known: Vec<&str> = classifier.config().labels.names().collect();
    let is_known =
        |index: &usize| known.contains(&dataset.labels().name(dataset.records()[*index].label));
    let (inside, outside) = view.indices().iter().copied().partition(is_known);
    (
        SweepView::new(dataset, inside),
        SweepView::new(dataset, outside),
    )
}

impl Verdicts {
    /// `None` for a run that was not calibrated.
    pub fn of(
        run: &RunDir,
        classifier: &Classifier,
        known: &SweepView<'_>,
        unknown: &SweepView<'_>,
    ) -> anyhow::Result<Option<Self>> {
        let Some(calibration) = run.calibration()? else {
            return Ok(None);
        };
        let sweeps = run.train_embeddings()?;
        let strangeness = NoveltyScorer::fit(classifier, &sweeps)?;
        let judged = |view: &SweepView<'_>| -> anyhow::Result<_> {
            Ok(calibration.judge(&strangeness, &classifier.embed(view)?)?)
        };
        let share = |of: usize, all: usize| {
            (all > 0).then(|| Estimate::wilson(of as f64 / all as f64, all))
        };
        let (inside, outside) = (judged(known)?, judged(unknown)?);
        let own: Vec<&str> = classifier.config().labels.names().collect();
        let labels = known.dataset().labels();
        let covered = inside.iter().enumerate().filter(|(position, verdict)| {
            let name = labels.name(known.label(*position));
            verdict.set.iter().any(|label| own[*label] == name)
        });
        let covered = covered.count();
        let alarms = inside.iter().filter(|verdict| verdict.unknown).count();
        let sizes: usize = inside.iter().map(|verdict| verdict.set.len()).sum();
        let mut unknown_materials: Vec<String> = (0..unknown.len())
            .map(|position| labels.name(unknown.label(position)).to_string())
            .collect();
        unknown_materials.sort();
        unknown_materials.dedup();
        Ok(Some(Self {
            promise: calibration.promise,
            false_alarms: share(alarms, inside.len()),
            coverage: share(covered, inside.len()),
            set_size: (!inside.is_empty()).then(|| sizes as f64 / inside.len() as f64),
            unknown_materials,
            detected: share(
                outside.iter().filter(|verdict| verdict.unknown).count(),
                outside.len(),
            ),
        }))
    }

    /// For people.
    pub fn print(&self) -> anyhow::Result<()> {
        let percent = |estimate: Estimate| {
            format!(
                "{:.1} % ({:.1} to {:.1})",
                100.0 * estimate.mean,
                100.0 * estimate.ci95_low,
                100.0 * estimate.ci95_high
            )
        };
        if let (Some(alarms), Some(coverage), Some(size)) =
            (self.false_alarms, self.coverage, self.set_size)
        {
            output::print(format_args!(
                "known materials called unknown: {}, promised {:.1} %",
                percent(alarms),
                100.0 * self.promise.false_alarms
            ))?;
            output::print(format_args!(
                "material in the prediction set: {}, promised {:.1} %; {size:.1} materials in a set",
                percent(coverage),
                100.0 * self.promise.coverage
            ))?;
        }
        if let Some(detected) = self.detected {
            output::print(format_args!(
                "unknown materials called unknown: {} of {} sweeps ({})",
                percent(detected),
                detected.n,
                self.unknown_materials.join(", ")
            ))?;
        }
        Ok(())
    }
}
