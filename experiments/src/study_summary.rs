//! What a study found: means over its tasks, with intervals, and methods compared on the same tasks.

use std::collections::BTreeMap;

use rand::RngExt;
use serde::{Deserialize, Serialize};
use tactnet_data::Seed;

use crate::published_confusion::TACTMAT_MATERIALS;
use crate::study::{FeatureMap, Measurement, Study, StudyResult};
use crate::tasks::{ExperimentDir, TaskState};
use crate::{ExperimentError, Statistic, Task, resampled_t_test};

/// Draws of the bootstrap.
const RESAMPLES: usize = 2000;
/// Shots whose accuracy by transfer is looked for without pre-knowledge.
const TARGETS: [usize; 2] = [1, 10];

/// Everything a study found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StudySummary {
    /// The question.
    pub kind: Study,
    /// One entry for each data set, method and circumstance.
    pub rows: Vec<StudyRow>,
    /// Every method against the study's reference, on the same tasks.
    pub comparisons: Vec<StudyComparison>,
    /// How many more sweeps a network without pre-knowledge needs.
    pub sample_efficiency: Vec<SampleEfficiency>,
    /// Sweeps in a plane.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub maps: Vec<FeatureMap>,
    /// The tasks behind the numbers.
    pub tasks: Vec<StudyRecord>,
}

/// One quantity: mean over tasks.
///
/// The interval is Student's over tasks; where tasks share training sweeps, with the variance of Nadeau & Bengio (2003). Draws of
/// new materials come from one and the same data set, so an interval over draws says nothing about other data sets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StudyRow {
    /// Name of the data set; "twin" is synthetic.
    pub data: String,
    /// `kept` or `removed`.
    pub levels: String,
    /// Name of the networks' recipe.
    pub model: String,
    /// What was measured.
    pub measure: String,
    /// By which method.
    pub method: String,
    /// Under which circumstances; empty where there is only one.
    pub setting: String,
    /// Sweeps of every new material that were learnt from.
    pub shots: Option<usize>,
    /// Sweeps behind one decision.
    pub sweeps: Option<usize>,
    /// Mean; shares are 0 to 1.
    pub mean: f64,
    /// Standard deviation over tasks; absent with one task.
    pub sd: Option<f64>,
    /// Lower end of the 95 % interval; absent with one task.
    pub ci95_low: Option<f64>,
    /// Upper end.
    pub ci95_high: Option<f64>,
    /// Tasks.
    pub n: usize,
    /// Decisions behind it, all tasks together.
    pub decisions: usize,
    /// One value for each task.
    pub values: Vec<f64>,
    /// Whether the materials are TactMat's, so that published numbers may stand beside it.
    pub tactmat: bool,
    /// What was published for TactMat, in the same unit.
    pub published: Option<f64>,
    /// What humans reached on TactMat.
    pub humans: Option<f64>,
}

/// Two methods on the same tasks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StudyComparison {
    /// Name of the data set.
    pub data: String,
    /// Name of the networks' recipe.
    pub model: String,
    /// `kept` or `removed`.
    pub levels: String,
    /// What was measured.
    pub measure: String,
    /// Under which circumstances.
    pub setting: String,
    /// Sweeps of every new material that were learnt from.
    pub shots: Option<usize>,
    /// Sweeps behind one decision.
    pub sweeps: Option<usize>,
    /// One method.
    pub first: String,
    /// The reference.
    pub second: String,
    /// Mean of first minus second.
    pub difference: f64,
    /// Lower end of its 95 % interval; absent with one task.
    pub ci95_low: Option<f64>,
    /// Upper end.
    pub ci95_high: Option<f64>,
    /// Two-sided p-value that it is zero.
    pub p: Option<f64>,
    /// Tasks.
    pub n: usize,
}

/// Sweeps that a network without pre-knowledge needs to be as good as transfer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SampleEfficiency {
    /// Name of the data set.
    pub data: String,
    /// Name of the networks' recipe.
    pub model: String,
    /// `kept` or `removed`.
    pub levels: String,
    /// Sweeps of every new material that transfer learns from.
    pub transfer_shots: usize,
    /// Its accuracy.
    pub accuracy: f64,
    /// Sweeps without pre-knowledge for the same, between tested numbers on a logarithmic scale; absent where even the most are not
    /// enough.
    pub shots: Option<f64>,
    /// 95 % interval by bootstrap over draws, absent with one draw; an absent end lies beyond the most.
    pub ci95: Option<[Option<f64>; 2]>,
    /// Published ratio, where the materials are TactMat's.
    pub published_ratio: Option<f64>,
}

/// Where the numbers of one task come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StudyRecord {
    /// Name of its folder.
    pub id: String,
    /// The split, for people.
    pub split: String,
    /// SHA-256 of the split.
    pub split_sha256: String,
    /// SHA-256 of the recipe.
    pub recipe_sha256: String,
    /// Commit of the program.
    pub git: String,
    /// Time of the task, seconds.
    pub seconds: f64,
    /// What was chosen on the way.
    pub chosen: BTreeMap<String, f64>,
}

/// One ended task.
pub(crate) struct EndedStudy<'a> {
    pub(crate) task: &'a Task,
    pub(crate) result: StudyResult,
}

/// Tasks that have ended.
pub(crate) fn ended(dir: &ExperimentDir) -> Result<Vec<EndedStudy<'_>>, ExperimentError> {
    dir.plan
        .tasks
        .iter()
        .filter(|task| dir.state(task) == TaskState::Done)
        .map(|task| {
            Ok(EndedStudy {
                task,
                result: dir.study_result(task)?,
            })
        })
        .collect()
}

/// What tasks of one row have in common.
type Key = (String, String, String, Column);

/// What is measured, without whose it is.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Column {
    measure: String,
    setting: String,
    shots: Option<usize>,
    sweeps: Option<usize>,
    method: String,
}

impl Column {
    fn of(measurement: &Measurement) -> Self {
        Self {
            measure: measurement.measure.clone(),
            setting: measurement.setting.clone(),
            shots: measurement.shots,
            sweeps: measurement.sweeps,
            method: measurement.method.clone(),
        }
    }
}

/// Means over the tasks that have ended.
///
/// # Errors
/// Tasks on different versions of a data set.
pub(crate) fn summary(
    dir: &ExperimentDir,
    kind: Study,
    ended: &[EndedStudy<'_>],
) -> Result<StudySummary, ExperimentError> {
    let mut order: Vec<Key> = Vec::new();
    // Number of the task, value, decisions.
    let mut values: BTreeMap<Key, Vec<(usize, f64, usize)>> = BTreeMap::new();
    let mut hashes: BTreeMap<&str, &str> = BTreeMap::new();
    for EndedStudy { task, result } in ended {
        if *hashes.entry(&result.data).or_insert(&result.data_sha256) != result.data_sha256 {
            return Err(ExperimentError::Folder {
                path: dir.path().into(),
                reason: format!(
                    "`{}` has changed between tasks; run it in a new folder",
                    result.data
                ),
            });
        }
        for measurement in &result.measurements {
            let column = Column::of(measurement);
            let key = (
                result.data.clone(),
                result.levels.clone(),
                task.model.clone(),
                column,
            );
            if !values.contains_key(&key) {
                order.push(key.clone());
            }
            values.entry(key).or_default().push((
                result.task.number,
                measurement.value,
                measurement.decisions,
            ));
        }
    }
    let share = kind.test_share();
    let like_tactmat = |data: &str| {
        let own = ended.iter().find(|ended| ended.result.data == data);
        own.is_some_and(|own| is_tactmat(&own.result.materials))
    };
    let rows: Vec<StudyRow> = order
        .iter()
        .map(|key| {
            let mut row = row(kind, share, key, &values[key]);
            row.tactmat = like_tactmat(&row.data);
            if !row.tactmat {
                (row.published, row.humans) = (None, None);
            }
            row
        })
        .collect();
    let mut comparisons = Vec::new();
    for key in &order {
        let (data, levels, model, column) = key;
        let Some(reference) = reference(kind, &column.measure) else {
            continue;
        };
        if column.method == reference {
            continue;
        }
        let mut other = column.clone();
        other.method = reference.into();
        let other = (data.clone(), levels.clone(), model.clone(), other);
        let Some(theirs) = values.get(&other) else {
            continue;
        };
        let differences: Vec<f64> = values[key]
            .iter()
            .filter_map(|(number, own, _)| {
                let (_, their, _) = theirs.iter().find(|(known, _, _)| known == number)?;
                Some(own - their)
            })
            .collect();
        if differences.is_empty() {
            continue;
        }
        let p = resampled_t_test(&differences, share);
        let n = differences.len();
        let statistic = Statistic::of(differences, share);
        comparisons.push(StudyComparison {
            data: data.clone(),
            model: model.clone(),
            levels: levels.clone(),
            measure: column.measure.clone(),
            setting: column.setting.clone(),
            shots: column.shots,
            sweeps: column.sweeps,
            first: column.method.clone(),
            second: reference.into(),
            difference: statistic.mean,
            ci95_low: statistic.ci95.map(|ci| ci[0]),
            ci95_high: statistic.ci95.map(|ci| ci[1]),
            p,
            n,
        });
    }
    let tasks = ended
        .iter()
        .map(|EndedStudy { task, result }| StudyRecord {
            id: task.id.clone(),
            split: result.split.clone(),
            split_sha256: result.split_sha256.clone(),
            recipe_sha256: result.recipe_sha256.clone(),
            git: result.provenance.git.clone(),
            seconds: result.seconds,
            chosen: result.chosen.clone(),
        })
        .collect();
    let sample_efficiency = if kind == Study::Nshot {
        sample_efficiency(&rows, Seed(dir.plan.recipe.seed))
    } else {
        Vec::new()
    };
    let maps = ended
        .iter()
        .flat_map(|ended| ended.result.maps.clone())
        .collect();
    Ok(StudySummary {
        maps,
        kind,
        rows,
        comparisons,
        sample_efficiency,
        tasks,
    })
}

/// The method that others are compared with.
fn reference(kind: Study, measure: &str) -> Option<&'static str> {
    match (kind, measure) {
        (Study::Nshot, "accuracy") => Some("ol-mean"),
        (Study::Differentiate, "accuracy") => Some("siamese"),
        (Study::Unknown, "auroc") => Some("largest probability"),
        _ => None,
    }
}

fn row(kind: Study, share: f64, key: &Key, values: &[(usize, f64, usize)]) -> StudyRow {
    let (data, levels, model, column) = key;
    let own: Vec<f64> = values.iter().map(|(_, value, _)| *value).collect();
    // What can lie outside 0 to 1.
    let is_share = !matches!(
        column.measure.as_str(),
        "set size" | "mean sweeps" | "known, lost"
    );
    let statistic = if is_share {
        Statistic::of_shares(own.clone(), share)
    } else {
        Statistic::of(own.clone(), share)
    };
    let (published, humans) = published(kind, column);
    StudyRow {
        data: data.clone(),
        levels: levels.clone(),
        model: model.clone(),
        measure: column.measure.clone(),
        method: column.method.clone(),
        setting: column.setting.clone(),
        shots: column.shots,
        sweeps: column.sweeps,
        mean: statistic.mean,
        sd: statistic.sd,
        ci95_low: statistic.ci95.map(|ci| ci[0]),
        ci95_high: statistic.ci95.map(|ci| ci[1]),
        n: own.len(),
        decisions: values.iter().map(|(_, _, decisions)| decisions).sum(),
        values: own,
        tactmat: false,
        published,
        humans,
    }
}

/// Whether these are TactMat's materials, in whatever order.
fn is_tactmat(materials: &[String]) -> bool {
    materials.len() == TACTMAT_MATERIALS.len()
        && TACTMAT_MATERIALS
            .iter()
            .all(|name| materials.iter().any(|material| material == name))
}

/// What was published on TactMat for the robot and for humans (thesis, tables 4.2 and 4.3, figures 4.10 and 4.12, section 4.6.4).
fn published(kind: Study, column: &Column) -> (Option<f64>, Option<f64>) {
    let known = |robot: f64| (Some(robot), None);
    match (kind, column.method.as_str(), column.setting.as_str()) {
        (Study::Nshot, "ol-mean", _) if column.shots == Some(1) => known(0.755),
        (Study::Nshot, "ol", _) if column.shots == Some(1) => known(0.750),
        (Study::Differentiate, "siamese", setting) => match (setting, column.sweeps) {
            ("all pairs", Some(1)) => known(0.918),
            ("all pairs", Some(3)) => known(0.954),
            ("hard pairs", Some(1)) => (Some(0.769), Some(0.697)),
            ("hard pairs", Some(3)) => (Some(0.828), Some(0.785)),
            _ => (None, None),
        },
        // The base network: table 4.2.
        (Study::Sequential, "plain", "fixed 1") if column.measure == "accuracy" => known(0.855),
        (Study::Sequential, "plain", "fixed 3") if column.measure == "accuracy" => known(0.943),
        _ => (None, None),
    }
}

/// For every data set with both curves: where the one without pre-knowledge reaches transfer's accuracy.
fn sample_efficiency(rows: &[StudyRow], seed: Seed) -> Vec<SampleEfficiency> {
    let mut found = Vec::new();
    let curve = |of: &StudyRow, method: &str| -> Vec<(usize, Vec<f64>)> {
        let mut points: Vec<(usize, Vec<f64>)> = rows
            .iter()
            .filter(|row| (&row.data, &row.levels, &row.model) == (&of.data, &of.levels, &of.model))
            .filter(|row| row.method == method)
            .filter_map(|row| Some((row.shots?, row.values.clone())))
            .collect();
        points.sort_by_key(|(shots, _)| *shots);
        points
    };
    for row in rows.iter().filter(|row| row.method == "ol-mean") {
        let Some(target) = row.shots.filter(|shots| TARGETS.contains(shots)) else {
            continue;
        };
        let scratch = curve(row, "nk");
        // Only draws that both curves have in full can be resampled together.
        if scratch.len() < 2
            || scratch
                .iter()
                .any(|(_, values)| values.len() != row.values.len())
        {
            continue;
        }
        let everything: Vec<usize> = (0..row.values.len()).collect();
        let mut rng = seed.rng(("sample efficiency", target));
        let mut draws: Vec<f64> = (0..RESAMPLES)
            .map(|_| {
                let drawn: Vec<usize> = everything
                    .iter()
                    .map(|_| rng.random_range(0..everything.len()))
                    .collect();
                crossing(&scratch, &row.values, &drawn).unwrap_or(f64::INFINITY)
            })
            .collect();
        draws.sort_by(f64::total_cmp);
        let end = |share: f64| {
            let value = draws[((RESAMPLES - 1) as f64 * share).round() as usize];
            value.is_finite().then_some(value)
        };
        found.push(SampleEfficiency {
            data: row.data.clone(),
            model: row.model.clone(),
            levels: row.levels.clone(),
            transfer_shots: target,
            accuracy: row.mean,
            shots: crossing(&scratch, &row.values, &everything),
            ci95: (everything.len() > 1).then(|| [end(0.025), end(0.975)]),
            published_ratio: row.tactmat.then_some(if target == 1 { 15.0 } else { 5.0 }),
        });
    }
    found
}

/// The smallest number of shots at which the mean of `curve` reaches the mean of `target`, over the draws named by `drawn`;
/// between two tested numbers by a straight line over their logarithm.
fn crossing(curve: &[(usize, Vec<f64>)], target: &[f64], drawn: &[usize]) -> Option<f64> {
    let mean = |values: &[f64]| drawn.iter().map(|i| values[*i]).sum::<f64>() / drawn.len() as f64;
    let target = mean(target);
    let mut before: Option<(f64, f64)> = None;
    for (shots, values) in curve {
        let (position, accuracy) = ((*shots as f64).ln(), mean(values));
        if accuracy >= target {
            return Some(match before {
                None => *shots as f64,
                Some((last, low)) => {
                    let share = (target - low) / (accuracy - low);
                    (last + share * (position - last)).exp()
                }
            });
        }
        before = Some((position, accuracy));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_crosses_between_tested_shots_on_a_logarithmic_scale() {
        let curve = vec![
            (1, vec![0.2, 0.4]),
            (4, vec![0.5, 0.7]),
            (16, vec![0.8, 1.0]),
        ];
        let at = |target: f64, drawn: &[usize]| crossing(&curve, &[target, target], drawn);
        assert_eq!(at(0.1, &[0, 1]), Some(1.0));
        // Means 0.3, 0.6, 0.9: half way between 4 and 16 is 8.
        assert!((at(0.75, &[0, 1]).unwrap() - 8.0).abs() < 1e-9);
        assert!((at(0.65, &[0, 0]).unwrap() - 8.0).abs() < 1e-9);
        assert_eq!(at(0.95, &[0, 1]), None);
    }
}
